"""Where do several vehicles of one world stand at the start, and what does each of them get? Pure; world ned.

The places are those of a square lattice round the start, nearest first, from which the start is reached on a straight
line: within the bounds and clear of every obstacle, movers wherever they go. The first is the start itself.
"""

import dataclasses
import math
from pathlib import Path
from typing import Final

import numpy as np

from companion.core.types import F64
from sitl.collision import CollisionChecker
from sitl.geo import Origin
from sitl.vehicle_config import ConfigError, VehicleConfig
from sitl.world import World

SPACING_M: Final = 3.0  # from centre to centre
CLEAR_M: Final = 0.5  # left between a hull and whatever stands near
RINGS: Final = 8  # of the lattice that are looked at
STEP_M: Final = 0.25  # along the line to the start


def places(world: World, count: int, radius_m: float, start_ned_m: tuple[float, float] | None = None) -> list[F64]:
    """``count`` places (2,) round the start, None: the world's. Raises ConfigError when there are not so many."""
    start = np.array(start_ned_m) if start_ned_m is not None else np.asarray(world.start_ned_m)
    checker = CollisionChecker(_with_ways(world), radius_m)
    cells = [(i, j) for i in range(-RINGS, RINGS + 1) for j in range(-RINGS, RINGS + 1)]
    cells.sort(key=lambda cell: (math.hypot(*cell), cell))
    found = [start]
    for i, j in cells[1:]:
        if len(found) == count:
            break
        place = start + SPACING_M * np.array([i, j], dtype=np.float64)
        if _free(world, checker, start, place, radius_m):
            found.append(place)
    if len(found) < count:
        raise ConfigError(f"world {world.name} has room for {len(found)} vehicles at its start, not for {count}")
    return found


def fleet(config: VehicleConfig, count: int) -> list[VehicleConfig]:
    """``config`` for each of ``count`` vehicles, as PX4 numbers its instances. Raises ConfigError.

    Vehicle i has ports + i, system id instance + 1 and seed + i; logs and parameters are kept by system id.
    """
    sim = config.sim
    spots = places(config.world, count, sim.radius_m, sim.spawn_ned_m)
    return [_member(config, index, spot, spot - spots[0]) for index, spot in enumerate(spots)]


def _member(config: VehicleConfig, index: int, place: F64, offset_m: F64) -> VehicleConfig:
    origin = config.sim.origin
    lat_deg, lon_deg = origin.lat_lon_deg(*offset_m.tolist())
    sim = dataclasses.replace(
        config.sim,
        seed=config.sim.seed + index,
        spawn_ned_m=(float(place[0]), float(place[1])),
        origin=Origin(lat_deg, lon_deg, origin.alt_amsl_m),
    )
    system_id = config.instance + index + 1
    return dataclasses.replace(
        config,
        sim=sim,
        instance=config.instance + index,
        system_id=system_id,
        log_dir=config.log_dir / f"vehicle_{system_id}" if config.log_dir is not None else None,
        params_file=_numbered(config.params_file, system_id) if config.params_file is not None else None,
    )


def _numbered(path: Path, system_id: int) -> Path:
    return path.with_name(f"{path.stem}_{system_id}{path.suffix}")


def _free(world: World, checker: CollisionChecker, start: F64, place: F64, radius_m: float) -> bool:
    """Room to stand at ``place``, and a straight way there."""
    n_min, e_min, n_max, e_max = world.bounds_m
    edge_m = radius_m + CLEAR_M
    inside = n_min + edge_m <= place[0] <= n_max - edge_m and e_min + edge_m <= place[1] <= e_max - edge_m
    steps = math.ceil(math.dist(start, place) / STEP_M)
    way = (start + (place - start) * (k / steps) for k in range(1, steps + 1))
    return inside and all(checker.clearance(0.0, np.array([n, e, 0.0])) > CLEAR_M for n, e in way)


def _with_ways(world: World) -> World:
    """Movers everywhere at once: a row of discs along the way of each."""
    rows = []
    for mover in world.movers:
        a, b = np.array(mover.a_ned_m), np.array(mover.b_ned_m)
        steps = math.ceil(math.dist(a, b) / STEP_M)
        rows += [[*(a + (b - a) * (k / steps)), mover.radius_m, mover.height_m] for k in range(steps + 1)]
    circles = np.concatenate([world.circles, np.array(rows).reshape(-1, 4)])
    return dataclasses.replace(world, circles=circles, movers=())
