"""How far is the vehicle from the nearest obstacle? Truth for the judge, by python-fcl; the ground is no obstacle.

The vehicle is an upright cylinder, and so the problem splits in two: against obstacles taller than any flight only the
horizontal counts, so they are thin slices at down = 0 that meet a sphere (fcl's closed forms: exact, and boxes that are
turned keep small bounding boxes); against obstacles with a height it is a cylinder at its true place. Frame: world ned.
"""

import math
from collections.abc import Callable, Sequence

import fcl
import numpy as np

from companion.core.types import F64
from sitl.world import Mover, World

SLICE_M = 1.0  # thickness of the slice that stands for an infinite height
BURIED_M = 1.0  # obstacles reach below the ground, so that a landed vehicle meets their side and not their rim


class CollisionChecker:
    """Surface-to-surface distance from the vehicle to everything in one world."""

    def __init__(self, world: World, radius_m: float = 0.33, half_height_m: float = 0.08) -> None:
        self._tall = _Group(world, fcl.Sphere(radius_m), math.isinf)
        self._low = _Group(world, fcl.Cylinder(radius_m, 2 * half_height_m), math.isfinite)

    def clearance(self, t_s: float, pos_world_ned_m: F64) -> float:
        """Metres from surface to surface; 0 or less in contact (minus the depth); inf in an empty world."""
        north_m, east_m, down_m = pos_world_ned_m.tolist()
        return min(self._tall.distance(t_s, north_m, east_m, 0.0), self._low.distance(t_s, north_m, east_m, down_m))


class _Group:
    """The obstacles of one kind of height and the shape that the vehicle has for them."""

    def __init__(self, world: World, vehicle: fcl.CollisionGeometry, wanted: Callable[[float], bool]) -> None:
        self._vehicle = fcl.CollisionObject(vehicle, fcl.Transform())
        self._movers = [m for m in world.movers if wanted(m.height_m)]
        self._moving = [_cylinder((0.0, 0.0, m.radius_m, m.height_m)) for m in self._movers]
        fixed = [_cylinder(row) for row in world.circles.tolist() if wanted(row[3])]
        fixed += [_box(row) for row in world.boxes.tolist() if wanted(row[5])]
        self._all = fixed + self._moving
        self._manager = fcl.DynamicAABBTreeCollisionManager()
        self._manager.registerObjects(self._all)
        self._manager.setup()

    def distance(self, t_s: float, north_m: float, east_m: float, down_m: float) -> float:
        if not self._all:
            return math.inf
        for mover, body in zip(self._movers, self._moving, strict=True):
            self._place(mover, body, t_s)
        self._vehicle.setTranslation(np.array([north_m, east_m, down_m]))
        data = fcl.DistanceData()
        self._manager.distance(self._vehicle, data, fcl.defaultDistanceCallback)
        distance_m = float(data.result.min_distance)
        return distance_m if distance_m > 0.0 else self._minus_depth()

    def _place(self, mover: Mover, body: fcl.CollisionObject, t_s: float) -> None:
        north_m, east_m = mover.position_ned_m(t_s)
        body.setTranslation(np.array([north_m, east_m, _upright(mover.height_m)[1]]))
        self._manager.update(body)  # fcl misses a moved object otherwise

    def _minus_depth(self) -> float:
        """fcl's broad phase says -1 for any overlap; the depth is asked of each pair."""
        request = fcl.DistanceRequest(enable_signed_distance=True)
        depths = (fcl.distance(self._vehicle, body, request, fcl.DistanceResult()) for body in self._all)
        return min(0.0, *(float(depth) for depth in depths))


def _cylinder(circle: Sequence[float]) -> fcl.CollisionObject:
    north_m, east_m, radius_m, height_m = circle
    length_m, down_m = _upright(height_m)
    return fcl.CollisionObject(fcl.Cylinder(radius_m, length_m), fcl.Transform(np.array([north_m, east_m, down_m])))


def _box(box: Sequence[float]) -> fcl.CollisionObject:
    north_m, east_m, yaw_rad, half_length_m, half_width_m, height_m = box
    length_m, down_m = _upright(height_m)
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    pose = fcl.Transform(
        np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]), np.array([north_m, east_m, down_m])
    )
    return fcl.CollisionObject(fcl.Box(2 * half_length_m, 2 * half_width_m, length_m), pose)


def _upright(height_m: float) -> tuple[float, float]:
    """Length along down and centre of an obstacle: fcl's origin is the middle."""
    if math.isinf(height_m):
        return SLICE_M, 0.0
    return height_m + BURIED_M, (BURIED_M - height_m) / 2
