"""How much longer than the shortest way was a training flight? Cheap where a world is flown many times; world ned.

The exact shortest way takes most of a second. It is worked out once for a world's own start; a start nearby goes
straight to where that way is in free sight and follows it.
"""

import math
from functools import lru_cache

import numpy as np

from companion.core.types import F64
from mission.shortest_path import shortest_path, straight_free
from mission.training.flight import End, Flight
from sitl.world import World

WORLDS = 64  # whose ways are kept
VERTEX_M = 1.0  # how far apart are the places where a start nearby may join the way
BESIDE_M = 1.5
TOUCH_M = 0.02  # the shortest way touches what it goes round


def path_ratio(flight: Flight, known: bool) -> float | None:
    """Flown over shortest, from the hand-over to the goal, what was left of it included; None unless it got there.

    ``known`` False is also None: the shortest way in a world that is flown once costs as much as the flight.
    """
    if not known or flight.end is not End.GOAL:
        return None
    plan = flight.spec.plan
    began_ned_m = np.array(flight.log.track_ne_m[0])
    shortest_m = shortest_from(plan.world, began_ned_m, plan.params.vehicle.radius_m)
    return (flight.log.path_m + flight.goal_m) / shortest_m if 0.0 < shortest_m < math.inf else None


def shortest_from(world: World, began_ned_m: F64, radius_m: float) -> float:
    """Length of the shortest way from a place near the start to the goal; inf when there is none."""
    ways = _ways(world, radius_m)
    if not ways:
        return math.inf
    places, left_m = (np.concatenate(column) for column in zip(*ways, strict=True))
    total_m = np.hypot(*(places - began_ned_m).T) + left_m
    for k in np.argsort(total_m, kind="stable").tolist():  # straight to where a way is in free sight, and along it
        if straight_free(world, began_ned_m, places[k], radius_m - TOUCH_M):
            return float(total_m[k])
    return math.inf


@lru_cache(maxsize=WORLDS)
def _ways(world: World, radius_m: float) -> tuple[tuple[F64, F64], ...]:
    """From the start, and from beside it, where another side of the first obstacle may be the shorter one.

    Each as places (k, 2) along it, and what is left of it at each (k,).
    """
    ahead = world.goal_ned_m - world.start_ned_m
    aside = np.array([-ahead[1], ahead[0]]) / max(math.hypot(ahead[0], ahead[1]), 1e-9)
    begins = [world.start_ned_m + share * BESIDE_M * aside for share in (0.0, 1.0, -1.0)]
    ways = (shortest_path(world, begin, world.goal_ned_m, radius_m) for begin in begins)
    return tuple(_places(way) for way in ways if way is not None)


def _places(way: F64) -> tuple[F64, F64]:
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    at = np.append(np.arange(0.0, lengths[-1], VERTEX_M), lengths[-1])
    places = np.stack([np.interp(at, lengths, way[:, 0]), np.interp(at, lengths, way[:, 1])], axis=1)
    return places, lengths[-1] - at
