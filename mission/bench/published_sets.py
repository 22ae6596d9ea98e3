"""Which worlds do the published set-ups describe? Forest, narrow gap, pole, and a yard with movers; seeded; world ned.

Forest, gap and pole are those of Loquercio et al. 2021 (Learning High-Speed Flight in the Wild): vehicle sphere of
0.2 m, sensing 6 m at 15 Hz, start at the origin, straight north. The yard has the counts of a table that quotes NavRL
(20 x 20 m, LiDAR 4 m, 2 m/s); what that does not say is our own: sizes, speeds, ways.
"""

import math
from typing import Final

import numpy as np

from companion.core.types import F64
from mission.world_check import WorldError, check_world
from sitl.world import Mover, World, wall_box

RADIUS_M: Final = 0.2
FOREST_M: Final = (60.0, 30.0)  # north, east
FOREST_SOUTH_M: Final = -3.0  # its southern edge, seen from the start
TRUNK_M: Final = 0.3  # radius
CLEAR_M: Final = 1.5  # round the start
FOREST_FINISH_M: Final = 40.0
GAP_WALL_M: Final = 40.0
GAP_AHEAD_M: Final = 10.0
GAP_OPENING_M: Final = (0.8, 1.0)
GAP_OFFSET_M: Final = 5.0
GAP_THICK_M: Final = 0.2
POLE_AHEAD_M: Final = 6.0
POLE_RADIUS_M: Final = 0.75
BEYOND_M: Final = 40.0  # pilots are sent this far beyond the finish, so that none brakes for it
YARD_M: Final = 20.0
YARD_RADIUS_M: Final = 0.33
YARD_OUTSIDE_M: Final = 2.0  # start and goal lie this far before and behind the yard
STATIC_RADIUS_M: Final = (0.15, 0.35)
MOVER_RADIUS_M: Final = (0.2, 0.4)
MOVER_M_S: Final = (0.5, 1.5)
MOVER_WAY_M: Final = (3.0, 8.0)
REDRAWS: Final = 200


def forest(seed: int, density_per_m2: float) -> World:
    """Poisson trunks of 0.6 m over 60 x 30 m. Redrawn until a way leads through."""
    rng = np.random.default_rng(seed)
    length_m, width_m = FOREST_M
    north_m = FOREST_SOUTH_M + length_m
    for _ in range(REDRAWS):
        count = int(rng.poisson(density_per_m2 * length_m * width_m))
        places = rng.uniform((FOREST_SOUTH_M, -width_m / 2), (north_m, width_m / 2), size=(count, 2))
        trunks = places[np.hypot(*places.T) >= CLEAR_M + TRUNK_M]
        world = World(
            f"forest_{round(1 / density_per_m2)}_{seed}",
            np.zeros(2),
            np.array([north_m + 1.0, 0.0]),
            (FOREST_SOUTH_M - 2.0, -width_m / 2, north_m + BEYOND_M, width_m / 2),
            _circles(trunks, np.full(len(trunks), TRUNK_M)),
            np.empty((0, 6)),
        )
        if _passable(world, RADIUS_M):
            return world
    raise WorldError(f"forest of {density_per_m2:g} trunks/m2: {REDRAWS} draws have no way through")


def gap(seed: int) -> World:
    """A wall of 40 m across the way, 10 m ahead, with one opening of 0.8 to 1.0 m up to 5 m off the line."""
    rng = np.random.default_rng(seed)
    opening_m, offset_m = rng.uniform(*GAP_OPENING_M), rng.uniform(-GAP_OFFSET_M, GAP_OFFSET_M)
    ends = (-GAP_WALL_M / 2, offset_m - opening_m / 2), (offset_m + opening_m / 2, GAP_WALL_M / 2)
    walls = [wall_box((GAP_AHEAD_M, a), (GAP_AHEAD_M, b), GAP_THICK_M, math.inf) for a, b in ends]
    return World(
        f"gap_{seed}",
        np.zeros(2),
        np.array([2.0 * GAP_AHEAD_M, 0.0]),
        (-10.0, -GAP_WALL_M / 2, 2.0 * GAP_AHEAD_M + BEYOND_M, GAP_WALL_M / 2),
        np.empty((0, 4)),
        np.array(walls),
    )


def pole(seed: int) -> World:
    """One pole of 1.5 m, its middle 6 m ahead; the seed moves the vehicle only."""
    return World(
        f"pole_{seed}",
        np.zeros(2),
        np.array([2.0 * POLE_AHEAD_M, 0.0]),
        (-100.0, -15.0, 2.0 * POLE_AHEAD_M + BEYOND_M, 15.0),
        _circles(np.array([[POLE_AHEAD_M, 0.0]]), np.array([POLE_RADIUS_M])),
        np.empty((0, 6)),
    )


def yard(seed: int, static: int, moving: int) -> World:
    """20 x 20 m with that many of each, from one side to the other. Redrawn until what stands leaves a way."""
    rng = np.random.default_rng(seed)
    for _ in range(REDRAWS):
        places = rng.uniform((0.0, -YARD_M / 2), (YARD_M, YARD_M / 2), size=(static, 2))
        world = World(
            f"yard_{static}_{moving}_{seed}",
            np.array([-YARD_OUTSIDE_M, 0.0]),
            np.array([YARD_M + YARD_OUTSIDE_M, 0.0]),
            (-4.0, -YARD_M / 2 - 2.0, YARD_M + 4.0, YARD_M / 2 + 2.0),
            _circles(places, rng.uniform(*STATIC_RADIUS_M, size=static)),
            np.empty((0, 6)),
            tuple(_mover(rng) for _ in range(moving)),
        )
        if _passable(world, YARD_RADIUS_M):
            return world
    raise WorldError(f"yard with {static} obstacles: {REDRAWS} draws have no way through")


def _mover(rng: np.random.Generator) -> Mover:
    """To and fro inside the yard."""
    low, high = np.array([0.0, -YARD_M / 2]), np.array([YARD_M, YARD_M / 2])
    while True:
        a = rng.uniform(low, high)
        course_rad, way_m = rng.uniform(-math.pi, math.pi), rng.uniform(*MOVER_WAY_M)
        b = a + way_m * np.array([math.cos(course_rad), math.sin(course_rad)])
        if (b >= low).all() and (b <= high).all():
            break
    speed = float(rng.uniform(*MOVER_M_S))
    ends = (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))
    return Mover(*ends, float(rng.uniform(*MOVER_RADIUS_M)), math.inf, speed, speed, float(rng.uniform()))


def _passable(world: World, radius_m: float) -> bool:
    try:
        check_world(world, radius_m, 0.05)
    except WorldError:
        return False
    return True


def _circles(places: F64, radii: F64) -> F64:
    return np.column_stack([places, radii, np.full(len(places), np.inf)]).reshape(-1, 4)
