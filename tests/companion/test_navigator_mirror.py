"""Left and right are the same to the navigator: a mirrored scene gives the mirrored tick, ties aside.

Ties: a vehicle on the border of a cell or on a diagonal of its cell, a nose exactly between two bins, a hit exactly on
the border of a cell: the poses here keep off them. The expert's distance field has ties by nature (two hits equally
many cells away), so its path is compared to a cell, and everything else to the last digits.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene import DT_S, FLYING, HOVERING, PARAMS, Eye, ring, world

from companion import navigator
from companion.checker.checker import VerdictKind
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import F64, AutopilotStatus, NavMode, Setpoint, VehicleState
from companion.navigator import Memory, Record
from companion.navigator.memory import Path

EAST = np.array([1.0, -1.0])
IN_SPACE = np.array([1.0, -1.0, 1.0])
ROTATION = np.array([1.0, -1.0, 1.0, -1.0])  # of a quaternion; roll and yaw change sign, pitch does not
POS_NED_M = (0.4 + 0.02, 0.2 + 0.07, -2.5)  # first and second quarter of a cell: on no diagonal
TREES = st.lists(st.tuples(st.floats(-5.0, 13.0), st.floats(-9.0, 9.0), st.floats(0.2, 0.5)), min_size=3, max_size=16)
BENDS = st.lists(st.tuples(st.floats(0.5, 2.5), st.floats(-0.9, 0.9)), min_size=1, max_size=5)
WORDS = ("mode", "line_of_sight", "points", "decisions", "switches", "aborts", "stopping", "verdict", "margin_m")
NUMBERS = ("s_fuzzy", "d_min_m", "density", "scale", "goal_distance_m", "speed_m_s", "free_m")
DECIDED = ("clearance_m", "score")
CELL_M = PARAMS.map.cell_m
STAND_TICKS, TRAVEL_TICKS, RL_TICKS = 4, 12, 60


def mirrored(inputs: Inputs) -> Inputs:
    """The same moment with east and west exchanged."""
    state, scan = inputs.state, inputs.scan
    there = VehicleState(
        state.t_s,
        state.pos_ned_m * IN_SPACE,
        state.vel_ned_m_s * IN_SPACE,
        state.q_ned_frd * ROTATION,
        state.rates_frd_rad_s * -IN_SPACE,
    )
    backwards = scan.range_m[(-np.arange(len(scan.range_m))) % len(scan.range_m)]
    turned = replace(scan, range_m=backwards, angle_offset_rad=-scan.angle_offset_rad)
    return replace(inputs, state=there, scan=turned)


def mirrored_memory(memory: Memory, own: Memory) -> Memory:
    """``own`` with the mirrored path of ``memory``: small differences of two decisions are not carried on."""
    if memory.engaged is None or own.engaged is None:
        return own
    path = memory.engaged.path
    if path is not None:
        path = replace(path, vertices_ne_m=path.vertices_ne_m * EAST)
    plan = None if memory.policy is None else memory.policy * EAST
    return replace(own, policy=plan, engaged=replace(own.engaged, path=path))


def assert_mirrored(here: Record, there: Record) -> None:
    """Facts, clamp, verdict and setpoint of two ticks."""
    one, other = here.as_dict(), there.as_dict()
    assert [other.get(key) for key in WORDS] == [one.get(key) for key in WORDS]
    decided = here.decision is not None
    for key in DECIDED if decided else NUMBERS:
        slack = 0.5 * CELL_M if decided else 1e-5
        assert other.get(key) == (None if one.get(key) is None else pytest.approx(one[key], abs=slack)), key
    if not decided:
        assert_setpoint_mirrored(here.setpoint, there.setpoint)
    elif one["path_ne_m"] is not None:
        assert np.array(other["path_ne_m"])[-1] * EAST == pytest.approx(np.array(one["path_ne_m"])[-1], abs=2 * CELL_M)


def assert_setpoint_mirrored(here: Setpoint, there: Setpoint) -> None:
    for part in ("pos_ned_m", "vel_ned_m_s", "acc_ned_m_s2"):
        a, b = getattr(here, part), getattr(there, part)
        assert (a is None) == (b is None)
        assert a is None or b * IN_SPACE == pytest.approx(a, abs=1e-5), part
    assert here.yaw_rad is not None and there.yaw_rad is not None
    assert math.sin(there.yaw_rad + here.yaw_rad) == pytest.approx(0.0, abs=1e-5)


class Pair:
    """A vehicle that stands and looks, and its mirror image."""

    def __init__(self, trees: Any, goal_east_m: float, yaw_rad: float, speed_m_s: float) -> None:
        clear = [(n, e, r) for n, e, r in trees if math.hypot(n - POS_NED_M[0], e - POS_NED_M[1]) > r + 0.4]
        self._eye = Eye(world(clear), sigma_m=0.01)
        self._task = Task(np.array([30.0, goal_east_m]), None, 3.0)
        self._image = replace(self._task, goal_ned_m=self._task.goal_ned_m * EAST)
        self._velocity = (speed_m_s * math.cos(yaw_rad), speed_m_s * math.sin(yaw_rad), 0.0)
        self._yaw_rad = yaw_rad
        self._tick = 0
        self.here = self.there = navigator.start(PARAMS)

    def tick(self, status: AutopilotStatus = FLYING) -> Record:
        """One tick of both; asserts that they mirror each other."""
        self._tick += 1
        yaw = self._yaw_rad + 0.003 * self._tick
        inputs = self._eye.inputs(round(1.0 + DT_S * self._tick, 6), POS_NED_M, self._velocity, yaw, status)
        self.here, _, record = navigator.tick(self.here, inputs, self._task, PARAMS)
        self.there, _, image = navigator.tick(self.there, mirrored(inputs), self._image, PARAMS)
        assert_mirrored(record, image)
        self.there = mirrored_memory(self.here, self.there)
        return record

    def follow(self, path_ne_m: F64) -> None:
        """From now on in RL mode along this path, no decision due."""
        assert self.here.engaged is not None and self.there.engaged is not None
        path = Path(path_ne_m, 0.0, 0.1, self.here.t_s, 0.4, 1.0)
        rl = replace(self.here.engaged.arbiter, mode=NavMode.RL)
        self.here = replace(self.here, engaged=replace(self.here.engaged, arbiter=rl, path=path, tried_t_s=math.inf))
        self.there = replace(self.there, engaged=replace(self.there.engaged, arbiter=rl, tried_t_s=math.inf))
        self.there = mirrored_memory(self.here, self.there)


@settings(max_examples=30, deadline=None)
@given(TREES, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.sampled_from([0.0, 0.4, 1.5]), BENDS)
def test_a_mirrored_scene_gives_the_mirrored_score_and_clamp(trees, goal_east_m, yaw_rad, speed_m_s, bends) -> None:
    pair = Pair(trees, goal_east_m + 0.0123, yaw_rad + 0.00123, speed_m_s)
    for _ in range(STAND_TICKS):
        assert pair.tick(HOVERING).mode == "standby"
    for _ in range(TRAVEL_TICKS):
        assert pair.tick().mode == NavMode.TRAVEL
    course = np.cumsum([0.0, *(bend for _, bend in bends[1:])]) + yaw_rad
    steps = np.array([[length] for length, _ in bends]) * np.stack([np.cos(course), np.sin(course)], axis=1)
    pair.follow(np.cumsum([POS_NED_M[:2], *steps], axis=0))
    for _ in range(3):
        assert pair.tick().mode == NavMode.RL


@pytest.mark.parametrize("seed", range(8))
def test_a_mirrored_scene_gives_the_mirrored_verdict(seed: int) -> None:
    rng = np.random.default_rng(seed)
    trees = [(n, e, 0.3) for n, e in rng.uniform((-3.0, -7.0), (9.0, 7.0), (16, 2))]
    pair = Pair(trees, rng.uniform(-2.0, 2.0), rng.uniform(-3.0, 3.0), 0.0)
    records = [pair.tick() for _ in range(RL_TICKS)]
    verdicts = [record.decision.verdict.kind for record in records if record.decision is not None]
    assert records[-1].mode == NavMode.RL
    assert len(verdicts) >= 3


def test_a_mirrored_cage_is_refused_on_both_sides() -> None:
    pair = Pair(ring(0.45, at=POS_NED_M[:2]), 0.5, 0.4, 0.0)
    records = [pair.tick() for _ in range(RL_TICKS)]
    assert {r.decision.verdict.kind for r in records if r.decision is not None} == {VerdictKind.REFUSED}
