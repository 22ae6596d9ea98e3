"""Can this world be flown at all: start and goal free, and a way between them? Pure; world ned, surface distances.

The way is searched on a grid of exact clearances, so a refusal can say how wide the best way is and what is missing.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from companion.core.types import F64
from mission.errors import InputError
from sitl.world import World

RADIUS_M = 0.33  # vehicle profile
MARGIN_M = 0.05  # what the vehicle needs beside its radius to fly through at all
CELL_M = 0.1
CELLS_MAX = 8e6  # larger worlds get larger cells
OVERFLOWN_M = 2.0  # what is lower does not bar the way: cruise is at least 2.5 m
BISECTIONS = 10  # of the widest clearance: to a millimetre


class WorldError(InputError):
    """The world cannot be used; the text is one line with the reason."""


def clearance_m(world: World, points_ned_m: F64) -> F64:
    """Distance (n,) from points (n, 2) to the nearest surface of what stands still; negative inside; inf if empty."""
    nearest = np.full(len(points_ned_m), np.inf)
    for distance_m in distances_m(world, points_ned_m):
        np.minimum(nearest, distance_m, out=nearest)
    return nearest


def distances_m(world: World, points_ned_m: F64) -> Iterator[F64]:
    """Distances (n,) from points (n, 2) to the surface of each thing that stands still, one after the other."""
    for circle in world.circles:
        yield _to_circle(circle, points_ned_m)
    for box in world.boxes:
        yield _to_box(box, points_ned_m)


def check_world(world: World, radius_m: float = RADIUS_M, margin_m: float = MARGIN_M, cell_m: float = CELL_M) -> None:
    """Raise WorldError when start or goal is not free for the vehicle, or no way leads from one to the other."""
    need_m = radius_m + margin_m
    for what, place in (("start", world.start_ned_m), ("goal", world.goal_ned_m)):
        _check_place(world, what, place, need_m)
    widest_m = widest_way_m(world, need_m, cell_m)
    if widest_m < need_m:
        best = f"the widest way has {widest_m:.2f} m to either side" if widest_m > 0.0 else "no way is open at all"
        raise WorldError(
            f"world '{world.name}': goal is not reachable: the vehicle needs {need_m:.2f} m to either side"
            f" (radius {radius_m:g} + margin {margin_m:g}), {best}, {need_m - max(widest_m, 0.0):.2f} m are missing"
        )


def widest_way_m(world: World, enough_m: float, cell_m: float = CELL_M) -> float:
    """The largest clearance up to ``enough_m`` at which start and goal are connected; 0 when they never are."""
    if len(world.circles) + len(world.boxes) == 0:
        return enough_m
    field, cell_m = clearance_grid(world, enough_m, cell_m)
    n_min, e_min, _, _ = world.bounds_m
    places = (world.start_ned_m, world.goal_ned_m)
    cells = [(round((n - n_min) / cell_m), round((e - e_min) / cell_m)) for n, e in places]
    for cell, place in zip(cells, places, strict=True):  # the exact place is known to be free
        field[cell] = min(enough_m, float(clearance_m(world, place[None, :])[0]))
    if _connected(field >= enough_m, cells):
        return enough_m
    low, high = 0.0, enough_m
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if _connected(field > middle, cells) else (low, middle)
    return low


def clearance_grid(world: World, up_to_m: float, cell_m: float = CELL_M) -> tuple[F64, float]:
    """Clearances (rows north, columns east, from the lower bounds) cut off at ``up_to_m``, and the cell size."""
    n_min, e_min, n_max, e_max = world.bounds_m
    cell_m = max(cell_m, math.sqrt((n_max - n_min) * (e_max - e_min) / CELLS_MAX))
    north = np.arange(n_min, n_max + cell_m / 2, cell_m)
    east = np.arange(e_min, e_max + cell_m / 2, cell_m)
    field = np.full((len(north), len(east)), up_to_m)
    barring: list[tuple[Callable[[F64, F64], F64], F64, float]] = []
    barring += [(_to_circle, row, float(row[2])) for row in world.circles if row[3] >= OVERFLOWN_M]
    barring += [(_to_box, row, math.hypot(row[3], row[4])) for row in world.boxes if row[5] >= OVERFLOWN_M]
    for distance, row, reach_m in barring:
        i = slice(*np.searchsorted(north, (row[0] - reach_m - up_to_m, row[0] + reach_m + up_to_m)))
        j = slice(*np.searchsorted(east, (row[1] - reach_m - up_to_m, row[1] + reach_m + up_to_m)))
        points = np.stack(np.meshgrid(north[i], east[j], indexing="ij"), axis=-1)
        np.minimum(field[i, j], distance(row, points), out=field[i, j])
    return field, cell_m


def _check_place(world: World, what: str, place: F64, need_m: float) -> None:
    north_m, east_m = (float(c) for c in place)
    label = f"world '{world.name}': {what} ({north_m:g}, {east_m:g})"
    if not world.inside(north_m, east_m):
        n_min, e_min, n_max, e_max = world.bounds_m
        raise WorldError(f"{label} is outside the bounds north {n_min:g}..{n_max:g}, east {e_min:g}..{e_max:g} m")
    free_m = float(clearance_m(world, place[None, :])[0])
    if free_m <= 0.0:
        raise WorldError(f"{label} is inside an obstacle, {-free_m:.2f} m deep")
    if free_m < need_m:
        raise WorldError(
            f"{label} has {free_m:.2f} m to the nearest obstacle, the vehicle needs {need_m:.2f} m:"
            f" {need_m - free_m:.2f} m are missing"
        )
    for mover in world.movers:
        if _to_segment(np.array(mover.a_ned_m), np.array(mover.b_ned_m), place) - mover.radius_m < need_m:
            raise WorldError(f"{label} is in the way of a mover")


def _connected(free: NDArray[np.bool_], cells: list[tuple[int, int]]) -> bool:
    labels, _ = ndimage.label(free)
    return bool(labels[cells[0]] == labels[cells[1]] != 0)


def _to_circle(circle: F64, points: F64) -> F64:
    distance: F64 = np.hypot(points[..., 0] - circle[0], points[..., 1] - circle[1]) - circle[2]
    return distance


def _to_box(box: F64, points: F64) -> F64:
    north, east = points[..., 0] - box[0], points[..., 1] - box[1]
    cos, sin = math.cos(box[2]), math.sin(box[2])
    along = np.abs(north * cos + east * sin) - box[3]
    across = np.abs(east * cos - north * sin) - box[4]
    distance: F64 = np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))
    distance += np.minimum(np.maximum(along, across), 0.0)
    return distance


def _to_segment(a: F64, b: F64, point: F64) -> float:
    along = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.hypot(*(a + along * (b - a) - point)))
