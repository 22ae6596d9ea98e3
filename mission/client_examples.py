"""Do the scripts of others fly our vehicle? ``python -m mission.client_examples FOLDER --python PYTHON``.

Runs MAVSDK's own examples, unchanged, each against a fresh ``swiftnav sitl`` at real time, and prints a table.
``FOLDER`` is ``examples`` of a clone of MAVSDK-Python and ``PYTHON`` one that has mavsdk 3.17.4, anyio, tqdm,
aioconsole and pyserial; with ``--native`` it is ``py/mavsdk/examples`` of MAVSDK and mavsdk 4.1. The ports are PX4's
own: nothing else may use them.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mission.client_example_table import MAVSDK_3, MAVSDK_4, PARAM_FILE, URL, Example, Kind
from mission.processes import Children

SITL: Final = "import sys; from mission.cli import main; sys.exit(main(sys.argv[1:]))"
READY: Final = "Ready for takeoff!"
READY_WALL_S: Final = 60.0
LOG_WALL_S: Final = 15.0  # from the end of an example's flight until the vehicle has closed its log
POLL_WALL_S: Final = 0.1
PARAMS: Final = "1\t1\tMIS_TAKEOFF_ALT\t4.0\t9\n1\t1\tCOM_RC_IN_MODE\t1\t6\n"  # QGroundControl's file format
FILES: Final = ("example-mission.plan", "offboard_from_csv/active.csv")  # read from where a script is started
SERVER: Final = "import mavsdk, pathlib; print(pathlib.Path(mavsdk.__file__).parent / 'bin' / 'mavsdk_server')"
SERVER_PORT: Final = "50051"


@dataclass(frozen=True, slots=True)
class Clone:
    """Where the examples are, and the Python for them."""

    folder: Path
    python: str


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one example."""

    example: Example
    code: int | None  # None: it was ended
    wall_s: float
    said: str

    @property
    def fine(self) -> bool:
        """Did it do what it has to?"""
        ended = self.code == 0 if self.example.kind is Kind.ENDS else True
        return ended and self.example.says in self.said

    def row(self) -> str:
        """A row of a Markdown table."""
        code = "" if self.code is None else str(self.code)
        verdict = self.example.kind.value if self.fine else "NOT AS IT SHOULD"
        said = f"`{self.example.says}`" if self.example.says else ""
        return f"| {self.example.script} | {verdict} | {code} | {self.wall_s:.0f} | {said} |"


def run_example(example: Example, clone: Clone, world: str, scratch: Path) -> Outcome:
    """One example against a vehicle of its own in ``world``; ``scratch`` is where it is started."""
    for name in FILES:
        if (clone.folder / name).is_file():
            shutil.copy(clone.folder / name, scratch)
    (scratch / PARAM_FILE).write_text(PARAMS, encoding="utf-8")
    with _vehicle(world, scratch / "vehicle.log"), ExitStack() as stack:
        if example.server:
            path = subprocess.check_output([clone.python, "-W", "ignore", "-c", SERVER], text=True).strip()
            command = [path, "-p", SERVER_PORT, URL]
            stack.enter_context(Children()).start_program("server", command, scratch / "server.log", {})
        if example.before:
            _run(Example(example.before, READY_WALL_S), clone, scratch)
            time.sleep(LOG_WALL_S)
        return _run(example, clone, scratch)


def _run(example: Example, clone: Clone, scratch: Path) -> Outcome:
    said = scratch / "said"
    command = [clone.python, "-u", "-W", "ignore", str(clone.folder / example.script), *example.arguments]
    with said.open("wb") as out:
        child = subprocess.Popen(
            command, cwd=scratch, stdin=subprocess.PIPE, stdout=out, stderr=subprocess.STDOUT, start_new_session=True
        )
    assert child.stdin is not None
    child.stdin.write(example.typed.encode())
    child.stdin.flush()
    began_s = time.monotonic()
    try:
        while child.poll() is None and time.monotonic() - began_s < example.limit_s:
            if example.kind is not Kind.ENDS and example.says in said.read_text(errors="replace"):
                break
            time.sleep(POLL_WALL_S)
        return Outcome(example, child.poll(), time.monotonic() - began_s, said.read_text(errors="replace"))
    finally:
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)  # its MAVSDK server with it
        child.wait()
        child.stdin.close()


@contextmanager
def _vehicle(world: str, log: Path) -> Iterator[None]:
    """``swiftnav sitl`` in this world, ready to be armed."""
    with Children() as children:
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        child = children.start_program("vehicle", [sys.executable, "-c", SITL, "sitl", "--world", world], log, threads)
        deadline_s = time.monotonic() + READY_WALL_S
        while READY not in log.read_text(errors="replace"):
            if child.exit_code is not None or time.monotonic() > deadline_s:
                raise RuntimeError(f"the vehicle does not get ready: {child.last_line()}")
            time.sleep(POLL_WALL_S)
        yield


def main(arguments: list[str] | None = None) -> int:
    """Run them, print the table. Exit code 0 when all did what they have to."""
    parser = argparse.ArgumentParser(prog="python -m mission.client_examples", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--python", default=sys.executable, help="default: this one")
    parser.add_argument("--native", action="store_true", help="the examples of mavsdk 4.1")
    parser.add_argument("--world", default="open")
    parser.add_argument("--only", nargs="*", help="scripts; default: all")
    given = parser.parse_args(arguments)
    clone = Clone(given.folder.resolve(), given.python)
    table = MAVSDK_4 if given.native else MAVSDK_3
    chosen = [e for e in table if given.only is None or e.script in given.only]
    print(f"| script, in {given.world} | result | exit code | s | said |\n|---|---|---|---|---|", flush=True)
    fine = True
    for example in chosen:
        with tempfile.TemporaryDirectory(prefix="swiftnav-example-") as scratch:
            outcome = run_example(example, clone, given.world, Path(scratch))
        print(outcome.row(), flush=True)
        fine = fine and outcome.fine
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
