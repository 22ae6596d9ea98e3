"""Of what are random worlds put together? Yard or fenced garden, trees, blocks, arcs, rows of clusters, pockets; pure.

World ned. A ``Site`` grows part by part; what stands too near to start or goal is left out.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from companion.core.types import F64
from mission.bench import barn, cells
from mission.world_check import CELL_M, MARGIN_M
from sitl.world import World, arc_boxes, wall_box

KEEP_CLEAR_M = 2.0  # round start and goal
WALL_M = 0.3  # thickness of arcs and pockets
FENCE_M = 0.1
INSET_M = 3.0
Circle = tuple[float, float, float]  # north, east, radius
Box = list[float]  # a row of World.boxes


@dataclass(frozen=True, slots=True)
class Site:
    """A world in the making."""

    goal_m: float  # north of the start
    bounds_m: tuple[float, float, float, float]  # north min, east min, north max, east max
    circles: tuple[Circle, ...] = ()
    boxes: tuple[Box, ...] = ()
    spare_m: float = MARGIN_M  # of the narrowest way, to either side
    search_m: float = CELL_M  # cells in which a way is looked for

    def world(self, name: str) -> World:
        """Finished; everything is taller than any flight."""
        circles = [(*circle, math.inf) for circle in self.circles]
        return World(
            name=name,
            start_ned_m=np.zeros(2),
            goal_ned_m=np.array([self.goal_m, 0.0]),
            bounds_m=self.bounds_m,
            circles=np.array(circles, dtype=float).reshape(-1, 4),
            boxes=np.array(self.boxes, dtype=float).reshape(-1, 6),
        )


@dataclass(frozen=True, slots=True)
class ArcDraw:
    """From which ranges a concave arc is drawn, open to the start; uniform."""

    radius_m: tuple[float, float] = (4.0, 9.0)
    half_deg: tuple[float, float] = (40.0, 80.0)
    turn_deg: float = 25.0  # to either side
    shift_m: float = 4.0  # to either side


def yard() -> Site:
    """Open ground, 60 x 40 m, as the forests of the acceptance."""
    return Site(54.0, (-INSET_M, -20.0, 57.0, 20.0))


def garden() -> Site:
    """Fenced ground of the size of trajectory2."""
    corners = [(-4.0, -12.0), (61.0, -12.0), (61.0, 12.0), (-4.0, 12.0)]
    sides = zip(corners, corners[1:] + corners[:1], strict=True)
    return Site(56.0, (-5.0, -13.0, 62.0, 13.0), boxes=tuple(wall_box(a, b, FENCE_M, math.inf) for a, b in sides))


def box_and_field() -> Site:
    """Ground of BARN's measures with nothing on it; a way is a few centimetres wider than the vehicle."""
    (south_m, west_m, north_m, east_m), (start_m, middle_m) = barn.BOUNDS, barn.START
    bounds_m = (south_m - start_m, west_m - middle_m, north_m - start_m, east_m - middle_m)
    return Site(barn.GOAL[0] - start_m, bounds_m, spare_m=cells.SPARE_M, search_m=barn.FINE_M)


def with_cells(site: Site, rng: np.random.Generator) -> Site:
    """The field and the box before it, as ``bench heldout`` has them."""
    places = cells.cylinders(rng, float(rng.choice(cells.FILLS)), int(rng.choice(cells.ITERATIONS)))
    circles = tuple((north_m, east_m, cells.CYLINDER_M) for north_m, east_m in (places - barn.START).tolist())
    return replace(site, circles=site.circles + circles)


def with_trees(site: Site, rng: np.random.Generator, density_per_m2: float, radius_m: tuple[float, float]) -> Site:
    """Trees: their number Poisson, places and radii uniform."""
    places = _places(site, rng, density_per_m2)
    radii = rng.uniform(*radius_m, size=len(places))
    trees = [(n, e, r) for (n, e), r in zip(places.tolist(), radii.tolist(), strict=True)]
    return replace(
        site, circles=site.circles + tuple(tree for tree in trees if _clear(site, tree[0], tree[1], tree[2]))
    )


def with_blocks(site: Site, rng: np.random.Generator, density_per_m2: float) -> Site:
    """Boxes of 0.4 to 2 m and pieces of wall up to 5 m, half and half, turned anyhow."""
    rows = []
    for north_m, east_m in _places(site, rng, density_per_m2).tolist():
        wall = rng.uniform() < 0.5
        half_m = (rng.uniform(0.5, 2.5), FENCE_M) if wall else tuple(rng.uniform(0.2, 1.0, size=2).tolist())
        yaw_rad = rng.uniform(0.0, math.pi)
        if _clear(site, north_m, east_m, math.hypot(*half_m)):
            rows.append([north_m, east_m, yaw_rad, half_m[0], half_m[1], math.inf])
    return replace(site, boxes=site.boxes + tuple(rows))


def with_arc(site: Site, rng: np.random.Generator, top_m: float, draw: ArcDraw | None = None) -> Site:
    """A concave arc whose middle lies at north ``top_m``."""
    draw = draw or ArcDraw()
    radius_m = rng.uniform(*draw.radius_m)
    half_rad = math.radians(rng.uniform(*draw.half_deg))
    turn_rad = math.radians(rng.uniform(-draw.turn_deg, draw.turn_deg))
    shift_m = rng.uniform(-draw.shift_m, draw.shift_m)
    centre = (top_m - radius_m * math.cos(turn_rad), shift_m - radius_m * math.sin(turn_rad))
    rows = arc_boxes(centre, radius_m, turn_rad - half_rad, turn_rad + half_rad, WALL_M, math.inf)
    return replace(site, boxes=site.boxes + tuple(rows))


def with_pocket(
    site: Site, rng: np.random.Generator, width_m: tuple[float, float], depth_m: tuple[float, float]
) -> Site:
    """Three walls, open to the start, turned by 15 deg and shifted by 2 m at most."""
    half_m, deep_m = rng.uniform(*width_m) / 2, rng.uniform(*depth_m)
    turn_rad, shift_m = math.radians(rng.uniform(-15.0, 15.0)), rng.uniform(-2.0, 2.0)
    back_m = rng.uniform(24.0, 34.0)
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)

    def corner(forward_m: float, right_m: float) -> tuple[float, float]:
        return back_m + forward_m * cos - right_m * sin, shift_m + forward_m * sin + right_m * cos

    chain = [corner(-deep_m, -half_m), corner(0.0, -half_m), corner(0.0, half_m), corner(-deep_m, half_m)]
    walls = [wall_box(a, b, WALL_M, math.inf) for a, b in itertools.pairwise(chain)]
    return replace(site, boxes=site.boxes + tuple(walls))


def with_row(site: Site, rng: np.random.Generator, north_m: float, gap_m: tuple[float, float]) -> Site:
    """A row of clusters across the site with gaps of that width between them, surface to surface."""
    circles: list[Circle] = []
    boxes: list[Box] = []
    east_m, end_m = site.bounds_m[1] + 1.0, site.bounds_m[3] - 1.0
    east_m += rng.uniform(*gap_m)
    while True:
        width_m = rng.uniform(1.2, 3.5)
        if east_m + width_m + gap_m[0] > end_m:
            return replace(site, circles=site.circles + tuple(circles), boxes=site.boxes + tuple(boxes))
        at_m = north_m + rng.uniform(-0.6, 0.6)
        if rng.uniform() < 0.3:
            boxes.append([at_m, east_m + width_m / 2, 0.0, rng.uniform(0.3, 0.8), width_m / 2, math.inf])
        else:
            circles += _cluster(rng, at_m, east_m, width_m)
        east_m += width_m + rng.uniform(*gap_m)


def _cluster(rng: np.random.Generator, north_m: float, east_m: float, width_m: float) -> list[Circle]:
    """Trees side by side over ``width_m``, too close together to fly between."""
    count = max(2, math.ceil(width_m / 1.1))
    radii = rng.uniform(0.3, 0.45, size=count)
    edges = (east_m + radii[0], east_m + width_m - radii[-1])
    places = np.linspace(edges[0], edges[1], count)
    return [(north_m + rng.uniform(-0.3, 0.3), float(e), float(r)) for e, r in zip(places, radii, strict=True)]


def _places(site: Site, rng: np.random.Generator, density_per_m2: float) -> F64:
    n_min, e_min, n_max, e_max = site.bounds_m
    count = int(rng.poisson(density_per_m2 * (n_max - n_min) * (e_max - e_min)))
    return rng.uniform((n_min, e_min), (n_max, e_max), size=(count, 2))


def _clear(site: Site, north_m: float, east_m: float, reach_m: float) -> bool:
    keep_m = KEEP_CLEAR_M + reach_m
    return math.hypot(north_m, east_m) >= keep_m and math.hypot(north_m - site.goal_m, east_m) >= keep_m
