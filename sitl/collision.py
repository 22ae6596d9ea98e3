"""How far is the vehicle from the nearest obstacle? Truth for the judge, by python-fcl; the ground is no obstacle.

The vehicle and every obstacle are upright, and so the distance splits: horizontally a disc meets outlines, vertically
the vehicle's lower edge meets the top. Obstacles of one height form a layer of slices at down = 0 in which fcl finds
the outline nearest to the vehicle's axis, from which the radius is then taken off: that keeps fcl to its closed forms
for spheres, and contact needs no depth of it. (Two cylinders go through libccd: 0.3 m wrong where their axes coincide;
a depth goes through its EPA: about a second.) Slices also keep small bounding boxes when they are turned.
"""

import math
from collections.abc import Sequence

import fcl
import numpy as np

from companion.core.types import F64
from sitl.world import Mover, World

SLICE_M = 1.0  # thickness of a slice: any


class CollisionChecker:
    """Surface-to-surface distance from the vehicle, an upright cylinder, to everything in one world."""

    def __init__(self, world: World, radius_m: float = 0.33, half_height_m: float = 0.08) -> None:
        self._radius_m = radius_m
        self._half_height_m = half_height_m
        tops = {*world.circles[:, 3].tolist(), *world.boxes[:, 5].tolist(), *(m.height_m for m in world.movers)}
        self._layers = [(top_m, _Layer(world, top_m)) for top_m in sorted(tops)]

    def clearance(self, t_s: float, pos_world_ned_m: F64) -> float:
        """Metres from surface to surface; inf in an empty world; in contact minus the depth, at most the radius."""
        north_m, east_m, down_m = pos_world_ned_m.tolist()
        nearest_m = math.inf
        for top_m, layer in self._layers:
            beside_m = layer.distance(t_s, north_m, east_m) - self._radius_m
            above_m = -down_m - self._half_height_m - top_m
            nearest_m = min(nearest_m, math.hypot(max(beside_m, 0.0), above_m) if above_m > 0.0 else beside_m)
        return nearest_m


class _Layer:
    """The obstacles that reach up to ``top_m``, seen from above."""

    def __init__(self, world: World, top_m: float) -> None:
        self._axis = fcl.CollisionObject(fcl.Sphere(0.0), fcl.Transform())
        self._movers = [m for m in world.movers if m.height_m == top_m]
        self._moving = [_cylinder((0.0, 0.0, m.radius_m)) for m in self._movers]
        self._all = [_cylinder(row[:3]) for row in world.circles.tolist() if row[3] == top_m]
        self._all += [_box(row[:5]) for row in world.boxes.tolist() if row[5] == top_m]
        self._all += self._moving
        self._manager = fcl.DynamicAABBTreeCollisionManager()
        self._manager.registerObjects(self._all)
        self._manager.setup()

    def distance(self, t_s: float, north_m: float, east_m: float) -> float:
        """Metres from the vehicle's axis to the nearest outline; 0 inside one."""
        for mover, body in zip(self._movers, self._moving, strict=True):
            self._place(mover, body, t_s)
        self._axis.setTranslation(np.array([north_m, east_m, 0.0]))
        data = fcl.DistanceData()
        self._manager.distance(self._axis, data, fcl.defaultDistanceCallback)
        return max(0.0, float(data.result.min_distance))  # fcl says -1 for any overlap

    def _place(self, mover: Mover, body: fcl.CollisionObject, t_s: float) -> None:
        north_m, east_m = mover.position_ned_m(t_s)
        body.setTranslation(np.array([north_m, east_m, 0.0]))
        self._manager.update(body)  # fcl misses a moved object otherwise


def _cylinder(circle: Sequence[float]) -> fcl.CollisionObject:
    north_m, east_m, radius_m = circle
    return fcl.CollisionObject(fcl.Cylinder(radius_m, SLICE_M), fcl.Transform(np.array([north_m, east_m, 0.0])))


def _box(box: Sequence[float]) -> fcl.CollisionObject:
    north_m, east_m, yaw_rad, half_length_m, half_width_m = box
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    pose = fcl.Transform(rotation, np.array([north_m, east_m, 0.0]))
    return fcl.CollisionObject(fcl.Box(2 * half_length_m, 2 * half_width_m, SLICE_M), pose)
