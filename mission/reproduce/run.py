"""How are the arms run?  A process per seed of any arm, so many at once; what is done already is not done again.

``OUT/arms/ARM/`` is a run folder like any other: ``run.yaml``, a folder a seed. A seed is done once its greedy flights
lie there. An arm with a budget of ticks waits until the seeds of the other arm are done: each of its seeds gets what
the same seed of the other used.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mission.errors import InputError
from mission.reproduce.arms import Arm, Table, unnamed
from mission.reproduce.greedy import GREEDY, fly_greedily
from mission.strict_yaml import write_yaml
from mission.training.configure import plain
from mission.training.fleet import Member, folder_lock, run_fleet, seed_folder
from mission.training.run_folder import RUN_FILE, RunSpec, open_run
from mission.training.seed_job import SeedJob
from mission.training.seed_job import check as check_spec
from mission.training.status import Status
from mission.training.trainer import RESULT

ARMS = "arms"
PROCESSES = ".processes"  # below OUT: what a process said when it died


@dataclass(frozen=True, slots=True)
class Task:
    """One seed of one arm."""

    arm: str
    spec: RunSpec
    seed: int
    folder: Path
    flights: int

    @property
    def done(self) -> bool:
        """Nothing is left to do."""
        return (self.folder / GREEDY).is_file()


OnUpdate = Callable[[Sequence[tuple[Task, Member]]], None]


@dataclass(frozen=True, slots=True)
class TaskJob:
    """What a process is handed: its number among the tasks says which seed it trains."""

    tasks: tuple[Task, ...]

    def __call__(self, number: int, folder: Path) -> Iterator[Status]:
        """Train from where it stands, then fly greedily."""
        task = self.tasks[number]
        with folder_lock(task.folder):
            yield from SeedJob(task.spec)(task.seed, task.folder)
            fly_greedily(task.spec, task.seed, task.folder, task.flights)


def arm_folder(out: Path, arm: Arm) -> Path:
    """Where an arm's run lies."""
    return out / ARMS / arm.run


def check(arms: Sequence[Arm]) -> None:
    """Raises InputError or ParamError about an arm that cannot be trained, naming it, before any process starts."""
    for arm in arms:
        try:
            check_spec(arm.spec((1,)))
        except InputError as error:
            raise InputError(f"arm '{arm.name}': {error}") from error


def prepare(out: Path, arms: Sequence[Arm], seeds: Sequence[int]) -> None:
    """``run.yaml`` of every arm. Raises InputError where an arm was begun with other settings."""
    for arm in arms:
        folder = arm_folder(out, arm)
        wanted = replace(arm.spec(arm.seeds_of(seeds)), preset=replace(arm.preset, name=arm.run, text=arm.text))
        if (folder / RUN_FILE).is_file():
            begun = open_run(folder)
            difference = _difference(begun, wanted)
            if difference:
                raise InputError(f"{folder} was begun with {difference}: go on with another --out")
            wanted = replace(begun, seeds=tuple(sorted({*begun.seeds, *wanted.seeds})))
        try:
            folder.mkdir(parents=True, exist_ok=True)
            temporary = folder / f".{RUN_FILE}"
            write_yaml(temporary, wanted.as_dict())
            temporary.replace(folder / RUN_FILE)
        except OSError as error:
            raise InputError(f"'{folder}' cannot be written: {error.strerror or error}") from error


def run_all(
    out: Path, table: Table, arms: Sequence[Arm], seeds: Sequence[int], jobs: int, on_update: OnUpdate
) -> list[str]:
    """Train every seed of every arm that is not done; one line for each that failed or had to be left."""
    free = [arm for arm in arms if arm.ticks_of is None]
    troubles = _run([task for arm in free for task in tasks_of(out, table, arm, seeds)], out, jobs, on_update)
    budgeted: list[Task] = []
    for arm in arms:
        if arm.ticks_of is None:
            continue
        found = tasks_of(out, table, arm, seeds)
        budgeted += found
        left = sorted({*arm.seeds_of(seeds)} - {task.seed for task in found})
        troubles += [f"{arm.name} seed {seed}: waits for {arm.ticks_of}" for seed in left]
    return troubles + _run(budgeted, out, jobs, on_update)


def tasks_of(out: Path, table: Table, arm: Arm, seeds: Sequence[int]) -> list[Task]:
    """The seeds of an arm; of one with a budget those whose budget is known."""
    tasks: list[Task] = []
    own = arm.seeds_of(seeds)
    for seed in own:
        spec = arm.spec(own)
        if arm.ticks_of is not None:
            ticks = _ticks(seed_folder(arm_folder(out, table.arm(arm.ticks_of)), seed))
            if ticks is None:
                continue
            spec = replace(spec, until=replace(spec.until, ticks=ticks))
        tasks.append(Task(arm.run, spec, seed, seed_folder(arm_folder(out, arm), seed), table.flights))
    return tasks


def _run(tasks: Sequence[Task], out: Path, jobs: int, on_update: OnUpdate) -> list[str]:
    unique = {task.folder: task for task in tasks if not task.done}
    waiting = tuple(unique.values())
    if not waiting:
        return []

    def told(members: Sequence[Member]) -> None:
        on_update(list(zip(waiting, members, strict=True)))

    members = run_fleet(TaskJob(waiting), range(len(waiting)), out / PROCESSES, jobs, told)
    failed = [(task, member) for task, member in zip(waiting, members, strict=True) if member.state == "failed"]
    return [f"{task.arm} seed {task.seed}: {member.error}" for task, member in failed]


def _ticks(folder: Path) -> int | None:
    """What a seed that is done has used."""
    path = folder / RESULT
    return int(json.loads(path.read_text(encoding="utf-8"))["ticks"]) if path.is_file() else None


def _difference(begun: RunSpec, wanted: RunSpec) -> str:
    """The first setting that is not the same; empty where all are."""
    before, now = (plain(replace(spec, seeds=(), preset=unnamed(spec.preset))) for spec in (begun, wanted))
    old, new = dict(_flat("", before)), dict(_flat("", now))
    for key in {**new, **old}:
        if old.get(key) != new.get(key):
            return f"{key.removeprefix('preset.')} = {old.get(key)}, now {new.get(key)}"
    return ""


def _flat(prefix: str, value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _flat(f"{prefix}.{key}" if prefix else str(key), item)
    else:
        yield prefix, value
