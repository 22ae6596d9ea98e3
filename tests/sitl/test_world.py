"""Do movers, arcs and walls come out as the file meant them?"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.types import F64
from sitl.world import Mover, World, arc_boxes, box_corners, wall_box

MOVER = Mover((0.0, -5.0), (3.0, -1.0), 0.3, math.inf, 1.5, 1.2, 0.25)


def world_with(*movers: Mover) -> World:
    circles, boxes = np.array([[1.0, 2.0, 0.5, np.inf]]), np.empty((0, 6))
    return World("test", np.zeros(2), np.ones(2), (-9.0, -9.0, 9.0, 9.0), circles, boxes, movers)


def test_a_mover_starts_where_its_phase_says() -> None:
    assert MOVER.position_ned_m(0.0) == pytest.approx((1.5, -3.0))


def test_a_mover_comes_back_after_its_cycle() -> None:
    cycle_s = 2 * 5.0 / 1.2
    assert MOVER.position_ned_m(17.3 + cycle_s) == pytest.approx(MOVER.position_ned_m(17.3))


@given(t_s=st.floats(0.0, 1e4), dt_s=st.floats(0.001, 1.0))
def test_a_mover_stays_between_its_ends_and_never_exceeds_its_speed(t_s: float, dt_s: float) -> None:
    here, there = MOVER.position_ned_m(t_s), MOVER.position_ned_m(t_s + dt_s)
    assert math.dist(here, MOVER.a_ned_m) + math.dist(here, MOVER.b_ned_m) == pytest.approx(5.0)
    assert math.dist(here, there) <= 1.2 * dt_s + 1e-8


@given(seed=st.integers(0, 2**32 - 1))
def test_a_seed_draws_phase_and_speed_and_nothing_else(seed: int) -> None:
    world = world_with(MOVER, MOVER)
    drawn = world.seeded(seed)
    assert drawn.movers == world.seeded(seed).movers
    assert drawn.movers[0] != drawn.movers[1]
    for mover in drawn.movers:
        assert 0.6 * 1.5 <= mover.speed_m_s <= 1.5
        assert 0.0 <= mover.phase < 1.0
        assert (mover.a_ned_m, mover.b_ned_m, mover.radius_m) == (MOVER.a_ned_m, MOVER.b_ned_m, MOVER.radius_m)


def test_movers_stand_after_what_stands_still() -> None:
    rows = world_with(MOVER).at(0.0)
    assert rows.tolist() == [[1.0, 2.0, 0.5, math.inf], [pytest.approx(1.5), pytest.approx(-3.0), 0.3, math.inf]]


def test_a_still_world_is_not_copied() -> None:
    world = world_with()
    assert world.at(3.0) is world.circles


def test_arrays_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="read-only"):
        world_with().circles[0, 0] = 3.0


def test_a_wall_runs_from_end_to_end() -> None:
    corners = box_corners(np.array([wall_box((1.0, 1.0), (4.0, 5.0), 0.2, 2.0)]))[0]
    ends = (corners[:2].mean(axis=0), corners[2:].mean(axis=0))
    assert ends[0] == pytest.approx((4.0, 5.0))
    assert ends[1] == pytest.approx((1.0, 1.0))


@settings(max_examples=30)
@given(
    radius=st.floats(0.5, 20.0),
    start=st.floats(-math.pi, math.pi),
    span=st.floats(0.1, math.tau),
    thickness=st.floats(0.05, 0.4),
)
def test_an_arc_has_no_hole_and_keeps_its_sagitta(radius: float, start: float, span: float, thickness: float) -> None:
    boxes = np.array(arc_boxes((2.0, 3.0), radius, start, start + span, thickness, math.inf))
    faces_m = {
        radius + thickness / 2: True,
        radius - thickness / 2 + 0.0201: True,
        radius + thickness / 2 + 0.0201: False,
        radius - thickness / 2 - 0.0001: False,
    }
    for bearing in np.linspace(start, start + span, 100)[1:-1]:
        for at, solid in faces_m.items():
            point = np.array([2.0 + at * math.cos(bearing), 3.0 + at * math.sin(bearing)])
            assert covered(boxes, point) == solid


def covered(boxes: F64, point: F64) -> bool:
    cos, sin = np.cos(boxes[:, 2]), np.sin(boxes[:, 2])
    north, east = point[0] - boxes[:, 0], point[1] - boxes[:, 1]
    slack = 1e-9
    along = np.abs(north * cos + east * sin) <= boxes[:, 3] + slack
    return bool((along & (np.abs(east * cos - north * sin) <= boxes[:, 4] + slack)).any())
