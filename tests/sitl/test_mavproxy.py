"""MAVProxy itself, as a user types: connect, parameters, arm, take off, mission, log; slow, only where it is installed.

``SWIFTNAV_MAVPROXY`` is its command (else ``mavproxy.py`` on PATH). Its own ``mode NAME`` cannot be used: it hands
PX4's modes to MAVLink as they stand in its table and fails, with a real PX4, too; ``long DO_SET_MODE`` works.
"""

import os
import shlex
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from mavsdk_kit import vehicle

COMMAND = os.environ.get("SWIFTNAV_MAVPROXY") or shutil.which("mavproxy.py")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(300),
    pytest.mark.skipif(COMMAND is None, reason="no mavproxy.py on PATH, and SWIFTNAV_MAVPROXY is not set"),
]
INSTANCE = 42
HOME = (47.397742, 8.545594)


class Console:
    """MAVProxy's prompt."""

    def __init__(self, port: int, folder: Path) -> None:
        assert COMMAND is not None
        words = [*shlex.split(COMMAND), f"--master=udpin:127.0.0.1:{port}", f"--state-basedir={folder}", "--aircraft=a"]
        self._process = subprocess.Popen(
            words,
            cwd=folder,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._lines: list[str] = []
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        self._lines.extend(iter(self._process.stdout.readline, ""))

    def type(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def told(self, text: str, limit_s: float = 30.0) -> None:
        """Wait for a text; what was said up to it is forgotten."""
        deadline_s = time.monotonic() + limit_s
        while True:
            for at, line in enumerate(self._lines):
                if text in line:
                    del self._lines[: at + 1]
                    return
            assert time.monotonic() < deadline_s, f"no '{text}' in {self._lines}"
            time.sleep(0.05)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Console]:
    with vehicle(INSTANCE, 2.0, folder=tmp_path):
        one = Console(14550 + INSTANCE, tmp_path)
        yield one
        one.close()


def plan() -> str:
    """A file of waypoints: take off, two corners, land."""
    lat, lon = HOME
    items = [(22, lat, lon, 5), (16, lat + 1e-4, lon, 5), (16, lat + 1e-4, lon + 1e-4, 5), (21, lat + 1e-4, lon, 0)]
    rows = [f"{seq} 0 3 {c} 0 0 0 0 {a:.7f} {o:.7f} {h} 1" for seq, (c, a, o, h) in enumerate(items)]
    return "\n".join(["QGC WPL 110", *(row.replace(" ", "\t") for row in rows)]) + "\n"


def test_a_user_of_mavproxy_flies_a_mission_and_takes_the_log_home(console: Console, tmp_path: Path) -> None:
    (tmp_path / "plan.txt").write_text(plan(), encoding="utf-8")
    console.told("online system 1")
    console.told("parameters to ")  # all of them, saved
    console.type("param set MIS_TAKEOFF_ALT 4")
    time.sleep(1.0)
    console.type("param show MIS_TAKEOFF_ALT")
    console.told("MIS_TAKEOFF_ALT  4.0")
    console.type("wp load plan.txt")
    console.told("MISSION_ACK: TYPE_MISSION: ACCEPTED")
    console.type("takeoff nan")  # PX4's p7 is above sea level; NaN is its default height
    console.told("NAV_TAKEOFF: ACCEPTED")
    console.type("arm throttle")
    console.told("ARMED")
    console.told("Mode LOITER")
    console.type("long DO_SET_MODE 29 4 4")
    console.told("Mode MISSION")
    console.told("waypoint 3")
    console.told("DISARMED", 60.0)
    console.type("log list")
    console.told("numLogs 1")
    console.type("log download latest flight.ulg")
    console.told("Finished downloading")
    assert (tmp_path / "flight.ulg").read_bytes().startswith(b"ULog")
