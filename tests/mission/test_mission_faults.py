from pathlib import Path

import pytest

from mission.errors import InputError
from mission.flight_plan import plan_flight
from mission.mission_file import load_mission
from mission.simulate import sim_config

TEXT = """
world: open
goal: [30, 5]
faults: [position_drift=1.5, 'gps_off@30..33']
success: {time_limit_s: 40}
"""


def written(folder: Path, text: str) -> str:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_faults_of_a_mission_and_of_the_command_line_reach_the_vehicle(tmp_path: Path) -> None:
    plan = plan_flight(written(tmp_path, TEXT), 1, faults=["motor2=0.8@10"])
    assert sim_config(plan).faults == ("position_drift=1.5", "gps_off@30..33", "motor2=0.8@10")


def test_without_faults_nothing_is_broken(tmp_path: Path) -> None:
    assert sim_config(plan_flight("trajectory1", 1)).faults == ()


@pytest.mark.parametrize(("old", "new"), [("gps_off", "gps_of"), ("30..33", "33..30"), ("1.5", "-1.5")])
def test_a_wrong_fault_is_refused_in_one_line(tmp_path: Path, old: str, new: str) -> None:
    with pytest.raises(InputError) as caught:
        load_mission(written(tmp_path, TEXT.replace(old, new)))
    assert "faults" in str(caught.value)
    assert "\n" not in str(caught.value)
