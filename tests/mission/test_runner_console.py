"""What a person sees of a flight: lines, the live panel, pictures; also of a flight that never began."""

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from mission.console import FlightConsole, LogTail, print_result
from mission.figures import draw_flight
from mission.flight_plan import plan_flight
from mission.judge import judge

ROW = {"t_s": 12.0, "mode": "rl", "s_fuzzy": 0.61, "d_min_m": 1.24, "goal_distance_m": 40.0}


def line(**changes: object) -> str:
    return json.dumps({**ROW, **changes}) + "\n"


def test_the_tail_shows_the_newest_whole_line_only(tmp_path: Path) -> None:
    path = tmp_path / "navigator.jsonl"
    tail = LogTail(path)
    assert tail.read() is None
    with path.open("w") as file:
        file.write(line(t_s=1.0) + line(t_s=2.0) + '{"t_s": 3.')
        file.flush()
        assert tail.read() == {**ROW, "t_s": 2.0}
        file.write("5}\n")
        file.flush()
    assert tail.read() == {"t_s": 3.5}
    assert tail.read() == {"t_s": 3.5}


def test_without_a_terminal_there_are_plain_lines(tmp_path: Path) -> None:
    out = io.StringIO()
    path = tmp_path / "navigator.jsonl"
    with FlightConsole("trajectory2, seed 1", LogTail(path), console=Console(file=out, width=120)) as console:
        console.say("armed")
        path.write_text(line(mode="travel", goal_distance_m=50.0))
        console.refresh()
        path.write_text(line())
        console.refresh()  # too soon for another line
    text = out.getvalue()
    assert text.splitlines()[:2] == ["trajectory2, seed 1", "  armed"]
    assert "Travel   t 12.0 s  score 0.61  d_min 1.2 m  goal 50.0 m    0%" in text
    assert text.count("\n") == 3
    assert "\x1b" not in text


def test_on_a_terminal_the_panel_shows_mode_score_distance_and_progress(tmp_path: Path) -> None:
    out = io.StringIO()
    path = tmp_path / "navigator.jsonl"
    terminal = Console(file=out, width=110, height=20, force_terminal=True, color_system=None)
    with FlightConsole("trajectory2", LogTail(path), console=terminal) as console:
        path.write_text(line(mode="travel", goal_distance_m=50.0))
        console.refresh()
        with path.open("a") as file:
            file.write(line())
        console.refresh()
        console.say("vehicle: Takeoff detected")
    text = out.getvalue()
    for word in ("RL", "score 0.61", "d_min 1.2 m", "goal 40.0 m", "20%", "vehicle: Takeoff detected"):
        assert word in text


def test_quiet_means_nothing_at_all(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "navigator.jsonl"
    path.write_text(line())
    with FlightConsole("title", LogTail(path), quiet=True) as console:
        console.say("armed")
        console.refresh()
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("name", ["trajectory1_movers", "forest"])
def test_a_flight_that_never_began_still_has_a_result_and_pictures(name: str, tmp_path: Path) -> None:
    plan = plan_flight(name, seed=1)
    result = judge(plan, tmp_path, "no vehicle answered")
    assert (result.success, result.reason, result.path_ratio) == (False, "no vehicle answered", None)
    draw_flight(plan, tmp_path, result)
    assert (tmp_path / "top_view.png").stat().st_size > 10_000
    out = io.StringIO()
    print_result(result, Console(file=out))
    assert "failure" in out.getvalue()
