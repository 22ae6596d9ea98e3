"""MAVSDK-Python's own example scripts, unchanged, against a vehicle at real time; slow, and only where they are.

``SWIFTNAV_EXAMPLES`` names the folder (``examples`` of a clone), ``SWIFTNAV_EXAMPLES_PYTHON`` a Python that has
``mavsdk==3.17.4`` and anyio. The ports are PX4's own: nothing else may use them.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from mission.world_file import load_world
from sitl.server import RunConfig
from sitl.vehicle_config import VehicleConfig

FOLDER = os.environ.get("SWIFTNAV_EXAMPLES")
PYTHON = os.environ.get("SWIFTNAV_EXAMPLES_PYTHON")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(not (FOLDER and PYTHON), reason="SWIFTNAV_EXAMPLES and SWIFTNAV_EXAMPLES_PYTHON are not set"),
]

# Script and the longest it may take. It has to end by itself, without error.
ENDING = {
    "all_params.py": 60,
    "calibration.py": 120,
    "do_orbit.py": 150,
    "failure_injection.py": 120,
    "firmware_version.py": 60,
    "follow_me_example.py": 120,
    "geofence.py": 60,
    "mission.py": 300,
    "mission_import.py": 120,
    "mission_raw.py": 120,
    "mavlink_direct_send.py": 60,
    "offboard_attitude.py": 120,
    "offboard_from_csv/offboard_from_csv.py": 300,
    "offboard_position_ned.py": 150,
    "offboard_position_velocity_ned.py": 150,
    "offboard_velocity_body.py": 150,
    "offboard_velocity_ned.py": 150,
    "rtcm.py": 60,
    "send_status_message.py": 60,
    "show_debug_output.py": 60,
    "takeoff_and_land.py": 90,
    "telemetry_takeoff_and_land.py": 120,
    "tune.py": 60,
}
# Script without end: how long to watch it and what it has to say by then.
ENDLESS = {
    "goto.py": (25, "Staying connected"),
    "gripper.py": (15, "Staying connected"),
    "highres_imu.py": (15, "X Acceleration"),
    "manual_control.py": (30, "-- Starting manual control"),
    "mavlink_direct_receive.py": (15, "ATTITUDE from 1/1"),
    "px4_ev_automation.py": (20, "Landed state"),
    "telemetry.py": (15, "Position:"),
    "telemetry_flight_mode.py": (15, "FlightMode: HOLD"),
    "telemetry_is_armed_is_in_air.py": (15, "Is_armed: False"),
    "transponder.py": (15, "Waiting for transponder messages"),
}


@pytest.fixture
def flying(tmp_path: Path) -> Iterator[None]:
    """A fresh vehicle on PX4's ports, as ``swiftnav sitl`` starts it."""
    config = tmp_path / "vehicle.json"
    world = load_world("open")
    config.write_text(json.dumps(VehicleConfig(world, run=RunConfig(speed=1.0)).to_json()), encoding="utf-8")
    child = subprocess.Popen([sys.executable, "-m", "sitl", str(config)], stderr=subprocess.DEVNULL)
    time.sleep(6.0)  # scripts arm as soon as the position is known
    yield
    child.send_signal(signal.SIGINT)
    child.wait(20)


@contextmanager
def example(script: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """One example in a folder that has the files it reads; it talks into ``said``. Its MAVSDK server ends with it."""
    assert FOLDER is not None
    assert PYTHON is not None
    for name in ("example-mission.plan", "offboard_from_csv/active.csv"):
        shutil.copy(Path(FOLDER) / name, folder)
    with (folder / "said").open("wb") as said:
        child = subprocess.Popen(
            [PYTHON, "-u", str(Path(FOLDER) / script)],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            yield child
        finally:
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            child.wait()


@pytest.mark.parametrize("script", ENDING)
def test_an_example_runs_to_its_end(flying: None, script: str, tmp_path: Path) -> None:
    with example(script, tmp_path) as child:
        assert child.wait(ENDING[script]) == 0, (tmp_path / "said").read_text(encoding="utf-8")


@pytest.mark.parametrize("script", ENDLESS)
def test_an_example_without_end_says_what_it_should(flying: None, script: str, tmp_path: Path) -> None:
    limit_s, wanted = ENDLESS[script]
    with example(script, tmp_path):
        time.sleep(limit_s)
        assert wanted in (tmp_path / "said").read_text(encoding="utf-8")


def test_a_flight_can_be_downloaded(flying: None, tmp_path: Path) -> None:
    with example("takeoff_and_land.py", tmp_path) as child:
        assert child.wait(90) == 0
    time.sleep(15.0)
    with example("logfile_download.py", tmp_path) as child:
        assert child.wait(90) == 0
    assert next(tmp_path.glob("*.ulog")).read_bytes().startswith(b"ULog")
