"""How do several seeds train at once on one machine?  A process per seed, so many at a time; one dying stops no other.

A process sends its status up a pipe after every episode. It ends by itself when nobody listens any more, so that no
orphan goes on writing; a lock on the seed's folder keeps two processes from training the same seed.
"""

import contextlib
import fcntl
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from companion.core.params import ParamError
from mission.errors import FlightError, InputError
from mission.training.status import Status

STDERR = "stderr.log"
LOCK = ".lock"
LOCK_S = 20.0  # wall: an orphan ends with its episode
POLL_S = 0.5
EXIT_FAILED = 1
EXIT_ALONE = 3  # nobody listens: the fleet was killed

Job = Callable[[int, Path], Iterator[Status]]  # trains the seed in the folder; must survive pickling
OnUpdate = Callable[[Sequence["Member"]], None]


@dataclass(frozen=True, slots=True)
class Member:
    """One seed of the fleet, as far as is known."""

    seed: int
    state: str = "waiting"  # waiting | training | done | failed
    status: Status | None = None
    error: str | None = None  # one line, where it failed


def seed_folder(folder: Path, seed: int) -> Path:
    """Where a seed's files lie."""
    return folder / f"seed_{seed}"


def run_fleet(job: Job, seeds: Sequence[int], folder: Path, jobs: int, on_update: OnUpdate) -> list[Member]:
    """Train every seed, at most ``jobs`` at a time; how each ended, in the order of ``seeds``."""
    members = {seed: Member(seed) for seed in seeds}
    waiting, running = list(seeds), dict[int, _Running]()
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                seed = waiting.pop(0)
                running[seed] = _start(job, seed, seed_folder(folder, seed))
                members[seed] = replace(members[seed], state="training")
            handles = [handle for one in running.values() for handle in (one.pipe, one.process.sentinel)]
            wait(handles, timeout=POLL_S)
            for seed, one in list(running.items()):
                members[seed] = _heard(members[seed], one.pipe)
                if one.process.exitcode is not None:
                    members[seed] = _ended(_heard(members[seed], one.pipe), one.process.exitcode, folder)
                    one.pipe.close()
                    del running[seed]
            on_update(list(members.values()))
    finally:
        for one in running.values():
            one.process.terminate()
            one.process.join()
    return list(members.values())


@contextlib.contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Hold the folder for this process. Raises InputError when another one keeps it."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("a+") as file:
        deadline_s = time.monotonic() + LOCK_S
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if time.monotonic() > deadline_s:
                    raise InputError(f"{folder} is being trained in by another process") from error
                time.sleep(0.1)
        file.truncate(0)
        file.write(str(os.getpid()))  # for people
        file.flush()
        yield


@dataclass(frozen=True, slots=True)
class _Running:
    process: SpawnProcess
    pipe: "Connection[object, object]"


def _start(job: Job, seed: int, folder: Path) -> _Running:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(job, seed, folder, there), daemon=True, name=f"seed {seed}")
    process.start()
    there.close()
    return _Running(process, here)


def _work(job: Job, seed: int, folder: Path, pipe: "Connection[object, object]") -> None:
    """The process of one seed; trouble travels as text, or lies in ``stderr.log``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the fleet ends its processes itself
    try:
        with folder_lock(folder):
            with (folder / STDERR).open("w", encoding="utf-8") as errors:
                os.dup2(errors.fileno(), sys.stderr.fileno())
            for status in job(seed, folder):
                pipe.send(status)
    except BrokenPipeError:
        sys.exit(EXIT_ALONE)
    except (InputError, FlightError, ParamError) as error:
        pipe.send(str(error))
        sys.exit(EXIT_FAILED)
    except OSError as error:  # a disk that is full: nothing more can be said in a file
        pipe.send(f"{error.filename or folder}: {error.strerror or error}")
        sys.exit(EXIT_FAILED)


def _heard(member: Member, pipe: "Connection[object, object]") -> Member:
    """With all that has come up the pipe."""
    try:
        while pipe.poll():
            news = pipe.recv()
            member = replace(member, status=news) if isinstance(news, Status) else replace(member, error=str(news))
    except (EOFError, OSError):
        pass  # the other end is closed, perhaps in the middle of a message
    return member


def _ended(member: Member, code: int, folder: Path) -> Member:
    if code == 0:
        return replace(member, state="done")
    if member.error is None:
        log = seed_folder(folder, member.seed) / STDERR
        lines = log.read_text(encoding="utf-8").strip().splitlines() if log.is_file() else []
        why = f"killed by {signal.Signals(-code).name}" if code < 0 else (lines[-1] if lines else f"exit code {code}")
        member = replace(member, error=why)
    return replace(member, state="failed")


def cores() -> int:
    """How many seeds this machine trains at once."""
    return max(1, os.cpu_count() or 1)
