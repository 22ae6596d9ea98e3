"""What is written of one run? One line of a CSV file; appended whole or not at all, read back for resuming.

The columns of ``runs.csv`` are the fields of ``Row``. A line that was cut off by a crash does not count and is flown
again.
"""

import csv
import dataclasses
import io
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mission.errors import InputError

DECIMALS: Final = 4


@dataclass(frozen=True, slots=True)
class Row:
    """One run; rates and sums are made of these only."""

    cell: str
    run: int
    world: str
    seed: int
    end: str  # as ``flight.End``
    success: bool
    collision: bool  # the vehicle moved into something
    struck: bool  # it stood and something moved into it
    timeout: bool
    time_s: float
    path_m: float
    shortest_m: float | None  # for the vehicle, to where a flight is finished
    reference_m: float | None  # of the score
    mean_m_s: float | None  # from where the suite measures
    min_clearance_m: float | None
    jerk_m2_s6: float | None
    switches: int
    switches_bound: int | None
    start_m_s: float
    decision_ms: str  # of each decision, blank between; wall time
    tick_p50_ms: float | None  # of the other ticks; wall time
    tick_p99_ms: float | None
    commit: str

    @property
    def decisions_ms(self) -> list[float]:
        """Wall time of each decision."""
        return [float(word) for word in self.decision_ms.split()]


COLUMNS: Final = tuple(f.name for f in dataclasses.fields(Row))


def append(path: Path, row: Row) -> None:
    """Add one row in one write, in place of a line that was cut off; the file begins with the names of the columns."""
    kept = _whole_lines(path)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    if not kept:
        writer.writerow(COLUMNS)
    writer.writerow([_cell(getattr(row, name)) for name in COLUMNS])
    with path.open("ab") as file:
        file.truncate(len(kept))
        file.write(text.getvalue().encode())
        file.flush()
        os.fsync(file.fileno())


def read(path: Path) -> list[Row]:
    """Every whole row, one for each cell and run: the first. Raises InputError where the file is another kind."""
    lines = list(csv.reader(io.StringIO(_whole_lines(path).decode(), newline="")))
    if lines and tuple(lines[0]) != COLUMNS:
        raise InputError(f"{path}: other columns than this version writes; choose another --out")
    rows: dict[tuple[str, int], Row] = {}
    for line in lines[1:]:
        row = _row(line)
        if row is not None:
            rows.setdefault((row.cell, row.run), row)
    return list(rows.values())


def barn_log(rows: Iterable[Row], metric: Any) -> str:
    """The six columns of the published logs: world, success, collided, timeout, time, score (``metric`` of a row)."""
    lines = []
    for row in rows:
        number = row.world.rpartition("_")[2]
        flags = f"{row.success:d} {row.collision or row.struck:d} {row.timeout:d}"
        lines.append(f"{number} {flags} {row.time_s:.4f} {metric(row):.4f}\n")
    return "".join(lines)


def _whole_lines(path: Path) -> bytes:
    """What is there, up to the last end of a line."""
    data = path.read_bytes() if path.is_file() else b""
    return data[: data.rfind(b"\n") + 1]


def _row(line: list[str]) -> Row | None:
    """None for a line that was cut off."""
    if len(line) != len(COLUMNS):
        return None
    values: dict[str, Any] = {}
    for field, text in zip(dataclasses.fields(Row), line, strict=True):
        try:
            values[field.name] = _parsed(str(field.type), text)
        except ValueError:
            return None
    return Row(**values)


def _parsed(kind: str, text: str) -> Any:
    if "bool" in kind:
        return {"0": False, "1": True}[text] if text in ("0", "1") else _not_read(text)
    if "None" in kind and text == "":
        return None
    if "int" in kind:
        return int(text)
    return float(text) if "float" in kind else text


def _not_read(text: str) -> bool:
    raise ValueError(text)


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if isinstance(value, bool):
        return str(int(value))
    return f"{value:.{DECIMALS}f}" if isinstance(value, float) else str(value)
