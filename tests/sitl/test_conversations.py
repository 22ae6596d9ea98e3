"""Every conversation that MAVSDK's own examples hold, in our words: both client versions, ``swiftnav sitl``, real UDP.

What is told is in ``conversations/``; a client tells it in a process of its own. MAVSDK 3.17.4 lives in an environment
of its own, which ``make setup`` makes; ``SWIFTNAV_MAVSDK3`` names the Python of another one.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest
from conversations.tell import ALL_HELD

from mission.client_example_table import MAVSDK_3, MAVSDK_4, Example
from mission.client_examples import READY, SITL
from mission.errors import InputError
from mission.processes import INSTANCE_MAX, Children
from mission.runner import check_ports

HERE = Path(__file__).parent
NAMED = os.environ.get("SWIFTNAV_MAVSDK3")
CLIENTS = {
    "3.17.4": Path(NAMED).absolute() if NAMED else HERE.parents[1] / ".venv-mavsdk3" / "bin" / "python",
    "4.1": Path(sys.executable),
}
CHAPTERS = ("ground", "missions", "offboard", "flights")
SPEED = "15"
# Silences that a client counts in seconds of its own clock, and this vehicle fifteen times as fast.
PATIENCE = "1\t1\tCOM_OF_LOSS_T\t30.0\t9\n1\t1\tCOM_RC_LOSS_T\t30.0\t9\n1\t1\tCOM_DL_LOSS_T\t300\t6\n"
READY_WALL_S, CHAPTER_WALL_S = 60.0, 200.0
WITHOUT_A_VEHICLE = {"show_debug_output.py"}  # its address is wrong on purpose


@dataclass(frozen=True, slots=True)
class Client:
    """One of the two, and the vehicle that it speaks to."""

    python: Path
    url: str
    folder: Path

    def tell(self, chapter: str) -> None:
        """All conversations of a chapter, in a process of its own."""
        said = self.folder / f"{chapter}.log"
        command = [str(self.python), "-u", "-W", "ignore", "-m", "conversations.tell", chapter, self.url]
        with said.open("wb") as out:
            child = subprocess.Popen(
                command,
                cwd=self.folder,
                env={**os.environ, "PYTHONPATH": str(HERE)},
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        try:
            code = child.wait(CHAPTER_WALL_S)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)  # its MAVSDK server with it
            child.wait()
        text = said.read_text(errors="replace")
        assert (code, ALL_HELD in text) == (0, True), text


@pytest.fixture(scope="module", params=CLIENTS)
def client(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    python = CLIENTS[request.param]
    if not (NAMED or python.exists()):
        pytest.skip(f"{python} is not there: `make setup` makes it")
    folder, instance = tmp_path_factory.mktemp("conversations"), free_instance()
    params, log = folder / "vehicle.params", folder / "vehicle.log"
    params.write_text(PATIENCE, encoding="utf-8")
    options = ["--instance", str(instance), "--speed", SPEED, "--params", str(params)]
    with Children() as children:
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        vehicle = children.start_program("vehicle", [sys.executable, "-c", SITL, "sitl", *options], log, threads)
        deadline_s = time.monotonic() + READY_WALL_S
        while READY not in log.read_text(errors="replace"):
            assert vehicle.exit_code is None and time.monotonic() < deadline_s, vehicle.last_line()
            time.sleep(0.1)
        yield Client(python, f"udpin://127.0.0.1:{14540 + instance}", folder)


def free_instance() -> int:
    """An instance whose ports nobody uses."""
    for number in range(INSTANCE_MAX, -1, -1):
        with suppress(InputError):
            check_ports(number)
            return number
    pytest.fail("the ports of all instances are taken")


def test_a_vehicle_on_the_ground_answers_whatever_it_is_asked(client: Client) -> None:
    client.tell("ground")


def test_plans_fences_and_rally_points_are_taken_and_flown(client: Client) -> None:
    client.tell("missions")


def test_every_kind_of_offboard_setpoint_steers(client: Client) -> None:
    client.tell("offboard")


def test_modes_of_px4_fly_and_leave_a_log(client: Client) -> None:
    client.tell("flights")


@pytest.mark.parametrize("example", [*MAVSDK_3, *MAVSDK_4], ids=lambda example: example.script)
def test_what_an_example_says_is_told_here(example: Example) -> None:
    told = {
        script
        for chapter in CHAPTERS
        for conversation in import_module(f"conversations.{chapter}").CONVERSATIONS
        for script in conversation.scripts
    }
    assert example.script in told | WITHOUT_A_VEHICLE
