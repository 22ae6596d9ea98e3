"""What happened, row by row?  Reads ``truth.jsonl`` (simulator) and ``navigator.jsonl`` (companion) into columns.

Truth is in the world's ned; the navigator's rows are in local ned, whose origin is the spawn, and are moved into the
world here. A last line that was cut off is left out.
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64, LandedState
from companion.navigator.record import STANDBY


@dataclass(frozen=True, slots=True)
class TruthLog:
    """One row a scan; (n,) unless said otherwise."""

    t_s: F64
    pos_ned_m: F64  # (n, 3) world
    vel_ned_m_s: F64  # (n, 3)
    clearance_m: F64  # smallest since the row before, surface to surface; <= 0: contact; inf in an empty world
    armed: NDArray[np.bool_]
    offboard: NDArray[np.bool_]
    landed: NDArray[np.int64]  # LandedState

    @property
    def flown(self) -> slice:
        """From the first row in OFFBOARD to the last touchdown, or to the end of a log that ends in the air; empty when
        never in OFFBOARD."""
        steered = np.flatnonzero(self.offboard & self.armed)
        if not len(steered):
            return slice(0, 0)
        airborne = np.flatnonzero((self.landed != LandedState.ON_GROUND) & self.armed)
        last = int(airborne[-1]) if len(airborne) else int(steered[0])
        return slice(int(steered[0]), min(last + 2, len(self.t_s)))


@dataclass(frozen=True, slots=True)
class NavigatorDecision:
    """One RL decision; polylines (k, 2) in world ned, None where there was none."""

    t_s: float
    proposal_ned_m: F64 | None
    path_ned_m: F64 | None
    verdict: str | None


@dataclass(frozen=True, slots=True)
class NavigatorLog:
    """One row a tick; (n,) unless said otherwise; NaN = absent."""

    t_s: F64
    mode: tuple[str, ...]  # standby | travel | rl | landing | hold
    pos_ned_m: F64  # (n, 3) world
    speed_m_s: F64  # horizontal, of the estimate
    setpoint_ned_m: F64  # (n, 3) world
    d_min_m: F64  # NaN: nothing within sensing radius
    s_fuzzy: F64
    goal_distance_m: F64
    switches: int
    switches_bound: int
    aborts: int
    rl_decisions: int
    decisions: tuple[NavigatorDecision, ...]


def read_truth(path: Path) -> TruthLog:
    """Columns of ``truth.jsonl``; empty columns for an empty file."""
    rows = list(read_rows(path))
    return TruthLog(
        t_s=_column(rows, "t_s"),
        pos_ned_m=_vectors(rows, "pos_world_ned_m"),
        vel_ned_m_s=_vectors(rows, "vel_ned_m_s"),
        clearance_m=np.nan_to_num(_column(rows, "clearance_m"), nan=math.inf),
        armed=np.array([bool(row["armed"]) for row in rows], dtype=bool),
        offboard=np.array([row["mode"] == "OFFBOARD" for row in rows], dtype=bool),
        landed=np.array([LandedState[row["landed"]] for row in rows], dtype=np.int64),
    )


def read_navigator(path: Path, spawn_ned_m: tuple[float, float]) -> NavigatorLog:
    """Columns of ``navigator.jsonl``, moved into the world by ``spawn_ned_m`` (the local origin)."""
    rows = list(read_rows(path))
    origin = np.array([*spawn_ned_m, 0.0])
    last = rows[-1] if rows else {}
    engaged = [row for row in rows if row["mode"] != STANDBY]
    final = engaged[-1] if engaged else {}
    velocity = _vectors(rows, "vel_ned_m_s")
    return NavigatorLog(
        t_s=_column(rows, "t_s"),
        mode=tuple(row["mode"] for row in rows),
        pos_ned_m=_vectors(rows, "pos_ned_m") + origin,
        speed_m_s=np.hypot(velocity[:, 0], velocity[:, 1]),
        setpoint_ned_m=_vectors(rows, "sp_pos_ned_m") + origin,
        d_min_m=_column(rows, "d_min_m"),
        s_fuzzy=_column(rows, "s_fuzzy"),
        goal_distance_m=_column(rows, "goal_distance_m"),
        switches=int(final.get("switches", 0)),
        switches_bound=int(final.get("switches_bound", 0)),
        aborts=int(final.get("aborts", 0)),
        rl_decisions=int(last.get("decisions", 0)),
        decisions=tuple(_decision(row, origin[:2]) for row in rows if "verdict" in row),
    )


def read_rows(path: Path) -> Iterator[dict[str, Any]]:
    """Every whole line of a JSON-lines file; nothing for a file that is not there."""
    if not path.is_file():
        return
    with path.open(encoding="utf-8") as file:
        for line in file:
            if line.endswith("\n"):
                yield json.loads(line)


def _column(rows: list[dict[str, Any]], key: str) -> F64:
    return np.array([math.nan if row[key] is None else row[key] for row in rows], dtype=np.float64)


def _vectors(rows: list[dict[str, Any]], key: str) -> F64:
    absent = (math.nan, math.nan, math.nan)
    return np.array([absent if row[key] is None else row[key] for row in rows], dtype=np.float64).reshape(-1, 3)


def _decision(row: dict[str, Any], origin: F64) -> NavigatorDecision:
    proposal, path = (
        None if not row.get(key) else np.array(row[key], dtype=np.float64) + origin
        for key in ("proposal_ne_m", "path_ne_m")
    )
    return NavigatorDecision(float(row["t_s"]), proposal, path, row["verdict"])
