"""What really happened, one line a scan? Rows, and their text: deterministic, so that equal flights give equal bytes.

Positions are world ned, everything else as in ``Truth``; numbers are the shortest text that gives the same double.
"""

import hashlib
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, Protocol

from companion.core.types import F64, LandedState
from sitl.modes import FlightMode
from sitl.vehicle import Truth


class TruthRow(NamedTuple):
    """One scan instant."""

    t_ms: int
    truth: Truth  # local ned
    clearance_m: float  # smallest since the row before; surface to surface
    contact: bool  # ever so far
    mode: FlightMode
    armed: bool
    landed: LandedState


def truth_line(row: TruthRow, spawn_ned_m: F64) -> str:
    """One JSON object without line end; an infinite clearance is null."""
    truth = row.truth
    return json.dumps(
        {
            "t_s": row.t_ms / 1e3,
            "pos_world_ned_m": (truth.pos_ned_m + spawn_ned_m).tolist(),
            "vel_ned_m_s": truth.vel_ned_m_s.tolist(),
            "q_ned_frd": truth.q_ned_frd.tolist(),
            "rates_frd_rad_s": truth.rates_frd_rad_s.tolist(),
            "clearance_m": row.clearance_m if math.isfinite(row.clearance_m) else None,
            "contact": row.contact,
            "mode": row.mode.name,
            "armed": row.armed,
            "landed": row.landed.name,
        },
        allow_nan=False,
        separators=(",", ":"),
    )


def truth_sha256(rows: Iterable[TruthRow], spawn_ned_m: F64) -> str:
    """SHA-256 of the truth log as a file has it."""
    digest = hashlib.sha256()
    for row in rows:
        digest.update(truth_line(row, spawn_ned_m).encode() + b"\n")
    return digest.hexdigest()


class TruthSink(Protocol):
    """Where truth goes."""

    def write(self, rows: list[TruthRow]) -> None:
        """Take the rows out of the list."""

    def flush(self) -> None:
        """Let nothing be lost."""


class TruthFile:
    """truth.jsonl, written as the flight goes."""

    def __init__(self, path: Path, spawn_ned_m: F64) -> None:
        """Create ``path``. Raises OSError when that is not possible."""
        self._file = path.open("w", encoding="utf-8", newline="\n")
        self._spawn_ned_m = spawn_ned_m

    def write(self, rows: list[TruthRow]) -> None:
        """Take the rows out of the list and append them."""
        self._file.writelines(truth_line(row, self._spawn_ned_m) + "\n" for row in rows)
        rows.clear()

    def flush(self) -> None:
        """Bring everything to the disk."""
        self._file.flush()

    def close(self) -> None:
        """Flush and close; may be called twice."""
        self._file.close()
