"""How are the runs of a suite flown: which are missing, by how many processes, and where do the rows go?

``OUT/SUITE/ENTRY/`` holds ``runs.csv`` (one row a run, appended as it ends), ``setup.json`` (what was flown, so that
runs of other settings are never mixed in) and ``failures/``. Interrupt at any time: what is there is not flown again.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mission.bench import rows
from mission.bench.entry import Entry, Run, fly_run
from mission.bench.rows import Row
from mission.bench.suites import Suite, suite_named
from mission.cluster import on_cluster
from mission.errors import InputError
from mission.provenance import commit, machine
from mission.side_by_side import side_by_side

RUNS, SETUP, FAILURES = "runs.csv", "setup.json", "failures"


@dataclass(frozen=True, slots=True)
class SuiteSpec:
    """Which suite, as a person names it."""

    name: str
    folder: Path | None = None
    part: str = "all"

    def load(self) -> Suite:
        """Raises InputError."""
        return suite_named(self.name, self.folder, self.part)


@dataclass(frozen=True, slots=True)
class Job:
    """One run still to be flown."""

    cell: int
    run: int


def entry_folder(out: Path, spec: SuiteSpec, entry: Entry) -> Path:
    """Where the runs of an entry lie."""
    suite = spec.name if spec.part == "all" else f"{spec.name}_{spec.part}"
    parts = [entry.pilot]
    parts += [entry.profile] if entry.profile is not None else []
    parts += [entry.stress] if entry.stress != "none" else []
    parts += ["stiff"] if entry.px4_params else []
    parts += [] if entry.guard else ["alone"]
    parts += [_plain(f"{name}={value}") for fields in entry.overrides.values() for name, value in fields.items()]
    return out / suite / "_".join(parts)


def missing(suite: Suite, runs: int | None, there: list[Row]) -> list[Job]:
    """Runs of each cell that are not there yet, the first runs of every cell first."""
    flown = {(row.cell, row.run) for row in there}
    count = suite.runs if runs is None else runs
    return [
        Job(index, run)
        for run in range(count)
        for index, cell in enumerate(suite.cells)
        if (cell.name, run) not in flown
    ]


def fly_missing(
    spec: SuiteSpec,
    suite: Suite,
    entry: Entry,
    folder: Path,
    runs: int | None = None,
    jobs: int = 1,
    cluster: str | None = None,
) -> Iterator[Row]:
    """Fly what is missing, append each row as it ends and hand it over.

    Raises InputError for other settings there or a cluster that does not answer, FlightError where a process died.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _claim(folder / SETUP, spec, entry)
    except OSError as error:
        raise InputError(f"--out: {error.filename or folder}: {error.strerror}") from error
    todo = missing(suite, runs, rows.read(folder / RUNS))
    for run in _flown(_Work(suite, entry, commit()), todo, jobs, cluster):
        if run.picture is not None:
            _keep_picture(folder / FAILURES, run)
        rows.append(folder / RUNS, run.row)
        yield run.row


def read_entry(folder: Path) -> list[Row]:
    """Everything that was flown into this folder."""
    return rows.read(folder / RUNS)


def read_rows(folder: Path, suite: Suite, runs: int | None = None) -> list[Row]:
    """What was flown of the suite's cells, by run, at most that many of each cell."""
    most = suite.runs if runs is None else runs
    names = [cell.name for cell in suite.cells]
    found = [row for row in rows.read(folder / RUNS) if row.cell in names and row.run < most]
    return sorted(found, key=lambda row: (names.index(row.cell), row.run))


def _claim(path: Path, spec: SuiteSpec, entry: Entry) -> None:
    """Write down what is flown here; what lies here already must be the same."""
    settings: dict[str, Any] = {"suite": spec.name, "part": spec.part, **entry.settings()}
    if path.is_file():
        there = _setup(path)
        for key, value in settings.items():
            if there.get(key) != value:
                raise InputError(
                    f"{path.parent} holds runs with {key} {json.dumps(there.get(key))}, asked for is"
                    f" {json.dumps(value)}: choose another --out, or remove it"
                )
        return
    stamp = datetime.now(UTC).strftime("%Y-%m-%d")
    text = json.dumps({**settings, "date": stamp, "commit": commit(), "machine": machine()}, indent=1)
    part = path.with_name(f".{path.name}.part")
    part.write_text(text + "\n", encoding="utf-8")
    part.replace(path)  # whole or not at all


def _setup(path: Path) -> dict[str, Any]:
    try:
        there = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}; choose another --out") from error
    if not isinstance(there, dict):
        raise InputError(f"{path} holds no settings; choose another --out")
    return there


def _keep_picture(folder: Path, run: Run) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{_plain(run.row.cell)}_{run.row.run:04d}.png").write_bytes(run.picture or b"")


def _plain(text: str) -> str:
    """As it may stand in the name of a file."""
    return "".join(c if c.isalnum() or c in ".-=" else "_" for c in text)


@dataclass(frozen=True, slots=True)
class _Work:
    """What every run of an entry needs."""

    suite: Suite
    entry: Entry
    commit: str

    def fly(self, job: Job) -> Run:
        return fly_run(self.suite.cells[job.cell].course(job.run), job.run, self.entry, self.commit)


def _flown(work: _Work, todo: list[Job], jobs: int, cluster: str | None) -> Iterator[Run]:
    if cluster is not None:
        yield from on_cluster(_Work.fly, work, todo, cluster, jobs)
    elif jobs == 1 or len(todo) <= 1:
        yield from map(work.fly, todo)
    else:
        yield from side_by_side(_fly, todo, jobs, _set_up, (work,), in_order=False)


_process: list[_Work] = []  # filled once, in a process of the pool only


def _set_up(work: _Work) -> None:
    _process.append(work)


def _fly(job: Job) -> Run:
    return _process[0].fly(job)
