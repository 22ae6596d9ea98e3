"""How does a world travel to another process? As plain JSON values; an infinite height is null."""

import dataclasses
import math
from typing import Any

import numpy as np

from companion.core.types import F64
from sitl.world import Mover, World


def world_to_json(world: World) -> dict[str, Any]:
    """Plain values of a world, movers as they are."""
    return {
        "name": world.name,
        "start_ned_m": world.start_ned_m.tolist(),
        "goal_ned_m": world.goal_ned_m.tolist(),
        "bounds_m": list(world.bounds_m),
        "circles": _rows(world.circles),
        "boxes": _rows(world.boxes),
        "movers": [_finite_or_none(dataclasses.asdict(mover)) for mover in world.movers],
    }


def world_from_json(data: dict[str, Any]) -> World:
    """The world of ``world_to_json``, bit by bit. Raises KeyError, TypeError or ValueError for something else."""
    n_min, e_min, n_max, e_max = (float(v) for v in data["bounds_m"])
    return World(
        name=str(data["name"]),
        start_ned_m=np.array(data["start_ned_m"], dtype=np.float64),
        goal_ned_m=np.array(data["goal_ned_m"], dtype=np.float64),
        bounds_m=(n_min, e_min, n_max, e_max),
        circles=_array(data["circles"], 4),
        boxes=_array(data["boxes"], 6),
        movers=tuple(_mover(mover) for mover in data["movers"]),
    )


def _rows(array: F64) -> list[list[float | None]]:
    return [[v if math.isfinite(v) else None for v in row] for row in array.tolist()]


def _array(rows: list[list[float | None]], width: int) -> F64:
    values = [[math.inf if v is None else float(v) for v in row] for row in rows]
    return np.array(values, dtype=np.float64).reshape(len(values), width)


def _finite_or_none(values: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and math.isinf(v) else v for k, v in values.items()}


def _mover(data: dict[str, Any]) -> Mover:
    values: dict[str, Any] = {k: math.inf if v is None else v for k, v in data.items()}
    ends = {name: (float(values[name][0]), float(values[name][1])) for name in ("a_ned_m", "b_ned_m")}
    return Mover(**{**values, **ends})
