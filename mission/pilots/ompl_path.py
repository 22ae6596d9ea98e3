"""Which way does OMPL find through a world that is known? Shortest path for a disc; world ned; same call, same answer.

Informed RRT* with a fixed seed and number of iterations, then OMPL's shortcuts. OMPL is imported here only.
"""

import math
from itertools import count

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric, util
from scipy import ndimage

from companion.core.types import F64
from mission.world_check import clearance_grid, clearance_m
from sitl.world import World

SEED = 1
ITERATIONS = 2500
SHORTCUT_ROUNDS = 3
SHORTCUT_STEPS = 200
ROPE_M = 0.5  # spacing of the points between which the rope shortcut tries
CELL_M = 0.05


def ompl_path(world: World, from_ned_m: F64, to_ned_m: F64, radius_m: float) -> F64 | None:
    """The way (k, 2) from (n, e) to (n, e), or None where OMPL finds none."""
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(SEED)
    room = _Room(world, from_ned_m, to_ned_m, radius_m)
    if not room.connected(from_ned_m, to_ned_m):
        return None
    space = base.RealVectorStateSpace(2)
    space.setBounds(_bounds(world))
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(lambda state: room.free(np.array([state[0], state[1]])))
    motions = _Motions(information, room)
    information.setMotionValidator(motions)
    setup.setStartAndGoalStates(_state(space, from_ned_m), _state(space, to_ned_m))
    setup.setOptimizationObjective(base.PathLengthOptimizationObjective(information))
    setup.setPlanner(geometric.InformedRRTstar(information))
    asked = count()
    setup.solve(base.PlannerTerminationCondition(lambda: next(asked) >= ITERATIONS))
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    for _ in range(SHORTCUT_ROUNDS):
        simplifier.ropeShortcutPath(path, ROPE_M)
        simplifier.partialShortcutPath(path, SHORTCUT_STEPS, SHORTCUT_STEPS)
        simplifier.reduceVertices(path)
    return np.array([[state[0], state[1]] for state in path.getStates()])


class _Room:
    """Where the disc fits, by cell; round an end that is too near to something it is let out."""

    def __init__(self, world: World, from_ned_m: F64, to_ned_m: F64, radius_m: float) -> None:
        field, self._cell_m = clearance_grid(world, radius_m + CELL_M, CELL_M)
        self._fits: NDArray[np.bool_] = field >= radius_m
        self._low = np.array(world.bounds_m[:2])
        self._last = np.array(field.shape) - 1
        north, east = (low + np.arange(n) * self._cell_m for low, n in zip(self._low, field.shape, strict=True))
        for end in (from_ned_m, to_ned_m):
            out_m = max(radius_m - float(clearance_m(world, end[None])[0]), 0.0) + self._cell_m
            self._fits |= np.hypot((north - end[0])[:, None], (east - end[1])[None, :]) <= out_m

    def connected(self, from_ned_m: F64, to_ned_m: F64) -> bool:
        """Is there any way?"""
        labels, _ = ndimage.label(self._fits)
        first, last = labels[tuple(self._cells(np.stack([from_ned_m, to_ned_m])).T)]
        return bool(first == last != 0)

    def free(self, point_ned_m: F64) -> bool:
        """Does the disc fit at (2,)?"""
        return self._all_free(point_ned_m[None])

    def line_free(self, a_ned_m: F64, b_ned_m: F64) -> bool:
        """Does it fit all along a straight line?"""
        steps = max(2, math.ceil(math.dist(a_ned_m.tolist(), b_ned_m.tolist()) / self._cell_m))
        return self._all_free(a_ned_m + (np.arange(steps + 1) / steps)[:, None] * (b_ned_m - a_ned_m))

    def _all_free(self, points_ned_m: F64) -> bool:
        cells = self._cells(points_ned_m)
        return bool(self._fits[cells[:, 0], cells[:, 1]].all())

    def _cells(self, points_ned_m: F64) -> NDArray[np.intp]:
        cells = np.rint((points_ned_m - self._low) / self._cell_m).astype(np.intp)
        inside: NDArray[np.intp] = np.clip(cells, 0, self._last)
        return inside


class _Motions(base.MotionValidator):  # type: ignore[misc]  # OMPL has no types
    """OMPL's question, answered for a whole line at once."""

    def __init__(self, information: base.SpaceInformation, room: _Room) -> None:
        super().__init__(information)
        self._room = room

    def checkMotion(self, first: base.State, second: base.State) -> bool:  # noqa: N802 (OMPL's name)
        return self._room.line_free(np.array([first[0], first[1]]), np.array([second[0], second[1]]))


def _bounds(world: World) -> base.RealVectorBounds:
    bounds = base.RealVectorBounds(2)
    for axis in (0, 1):
        bounds.setLow(axis, float(world.bounds_m[axis]))
        bounds.setHigh(axis, float(world.bounds_m[axis + 2]))
    return bounds


def _state(space: base.RealVectorStateSpace, place_ned_m: F64) -> base.State:
    state = space.allocState()
    state[0], state[1] = (float(metres) for metres in place_ned_m)
    return state
