"""How do the same seeds train on a Ray cluster?  One task a seed; no shared disk is needed.

A task streams what a local process would leave behind: its status after every episode, and the files of the seed's
folder at every checkpoint. So the run folder on this machine always holds checkpoints to resume from, wherever a task
ran; a task that is lost is reported like a process that died. Needs the extra ``scale``.
"""

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import RayError

from companion.core.params import ParamError
from mission.cluster import connected
from mission.errors import FlightError, InputError
from mission.training.checkpoint import write_whole
from mission.training.fleet import Job, Member, OnUpdate, folder_lock, seed_folder
from mission.training.status import Status

POLL_S = 0.5

Files = dict[str, bytes]  # by path below the seed's folder
News = Status | Files | str  # how it stands, what lies there, what went wrong


def run_ray_fleet(
    job: Job, seeds: Sequence[int], folder: Path, address: str, jobs: int, on_update: OnUpdate
) -> list[Member]:
    """Train every seed on the cluster at ``address``; how each ended, in the order of ``seeds``. Raises InputError."""
    with contextlib.ExitStack() as stack:
        stack.enter_context(connected(address, jobs))
        members = {seed: Member(seed) for seed in seeds}
        streams: dict[int, Any] = {}
        for seed in seeds:
            stack.enter_context(folder_lock(seed_folder(folder, seed)))
            streams[seed] = _TASK.remote(job, seed, read_files(seed_folder(folder, seed)))
        while streams:
            ready, _ = ray.wait(list(streams.values()), num_returns=len(streams), timeout=POLL_S, fetch_local=False)
            for seed, stream in list(streams.items()):
                if stream in ready:
                    members[seed], ended = _take(members[seed], stream, seed_folder(folder, seed))
                    if ended:
                        del streams[seed]
            on_update(list(members.values()))
    return list(members.values())


def read_files(folder: Path) -> Files:
    """Everything in a seed's folder but locks and halves."""
    if not folder.is_dir():
        return {}
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith(".")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def write_files(folder: Path, files: Files) -> None:
    """Exactly ``files`` in the folder; each whole. What is not among them any more goes last."""
    for name in sorted(files, key=lambda name: (name.startswith("checkpoint"), name)):  # it must find its rows
        path, data = folder / name, files[name]
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    for name in set(read_files(folder)) - set(files):
        (folder / name).unlink()


def _train(job: Job, seed: int, files: Files) -> Iterator[News]:
    """One seed on some machine of the cluster."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_files(folder, files)
        kept = ""
        try:
            for status in job(seed, folder):
                newest = max((path.name for path in folder.glob("checkpoint-*.sha256")), default="")
                if newest != kept or status.state == "done":
                    kept = newest
                    yield read_files(folder)
                yield status
        except (InputError, FlightError, ParamError) as error:
            yield str(error)


_TASK = ray.remote(num_cpus=1, max_retries=0)(_train)


def _take(member: Member, stream: Any, folder: Path) -> tuple[Member, bool]:
    """The next piece of news of a seed, and whether it was the last."""
    try:
        news: News = ray.get(next(stream))
    except StopIteration:
        done = member.status is not None and member.status.state == "done"
        error = member.error or (None if done else "the task ended early")
        return replace(member, state="failed" if error else "done", error=error), True
    except RayError as error:
        lines = str(error).strip().splitlines()
        return replace(member, state="failed", error=lines[-1] if lines else type(error).__name__), True
    if isinstance(news, Status):
        return replace(member, state="training", status=news), False
    if isinstance(news, str):
        return replace(member, error=news), False
    write_files(folder, news)
    return member, False
