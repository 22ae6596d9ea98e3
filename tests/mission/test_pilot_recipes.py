"""What each recipe promises of itself: stops fit, mirrored scenes give mirrored answers, the barrier holds."""

import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from companion.core.types import F64
from mission.pilots import brake, dwa, vfh
from mission.pilots.brake import BrakeParams
from mission.pilots.dwa import DwaParams
from mission.pilots.vfh import VfhParams

EAST = np.array([1.0, -1.0])
POINTS = st.lists(st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)), min_size=1, max_size=12)
RANGES = st.integers(0, 10**6).map(lambda seed: np.random.default_rng(seed).uniform(0.5, 12.0, 72))
PUSH = st.tuples(st.floats(1.0, 6.0), st.floats(0.05, 0.6))  # size, course; off the borders of sectors
VFH = VfhParams()


def outside(points: list[tuple[float, float]], least_m: float) -> F64:
    """Those that are no nearer than that."""
    kept = np.array([p for p in points if math.hypot(*p) > least_m], dtype=float).reshape(-1, 2)
    assume(len(kept) > 0)
    return kept


@given(ranges=RANGES, push=PUSH, vel=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)))
def test_collision_prevention_mirrors(ranges: F64, push: tuple[float, float], vel: tuple[float, float]) -> None:
    course = np.arange(72) * math.tau / 72
    acc = push[0] * np.array([math.cos(push[1]), math.sin(push[1])])
    mirrored = ranges[-np.arange(72) % 72]
    params = BrakeParams(cp_guide_deg=0.0)  # its steering takes the first of equals
    there = brake.constrained(acc, np.array(vel), brake.Ranges(course, ranges), 3.0, params)
    here = brake.constrained(acc * EAST, np.array(vel) * EAST, brake.Ranges(course, mirrored), 3.0, params)
    np.testing.assert_allclose(here, there * EAST, atol=1e-9)


@given(distance=st.floats(0.0, 30.0))
def test_collision_prevention_stops_within_the_distance(distance: float) -> None:
    params = BrakeParams()
    speed = brake.stop_speed(distance, params)
    lag_s = 2.0 * params.acc_hor_m_s2 / params.jerk_m_s3
    assert speed * lag_s + speed * speed / (2.0 * params.acc_hor_m_s2) <= distance + 1e-6


@given(points=POINTS)
def test_free_ways_mirror_and_end_at_the_radius(points: list[tuple[float, float]]) -> None:
    near, course = outside(points, 0.6), np.arange(72) * math.tau / 72
    free = dwa.free_ways(np.zeros(2), course, near, 0.5, 4.0)
    np.testing.assert_allclose(dwa.free_ways(np.zeros(2), -course, near * EAST, 0.5, 4.0), free, atol=1e-9)
    ends = free[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1)
    gaps = np.hypot(*(ends[:, None] - near[None]).transpose(2, 0, 1))
    assert gaps.min() >= 0.5 - 1e-6


@given(free=st.floats(0.0, 10.0))
def test_an_admissible_speed_stops_within_its_way(free: float) -> None:
    params = DwaParams()
    speed = float(dwa.stop_speed(np.array([free]), params)[0])
    assert speed * params.delay_s + speed * speed / (2.0 * params.decel_m_s2) <= free + 1e-9


@given(points=POINTS, course=st.floats(-3.1, 3.1), speed=st.floats(0.0, 3.0))
def test_the_barrier_lets_nothing_close_in_too_fast(
    points: list[tuple[float, float]], course: float, speed: float
) -> None:
    offset = outside(points, 0.5)
    wanted = speed * np.array([math.cos(course), math.sin(course)])
    let = vfh.barrier(wanted, offset, 0.4, VFH)
    distance = np.hypot(offset[:, 0], offset[:, 1])
    closing = (offset @ let) / distance
    near = distance < 2.0
    assert (closing[near] <= VFH.barrier_1_s * (distance[near] - 0.4) + 0.05).all()
    assert np.hypot(*let) <= speed + 1e-9
    mirrored = vfh.barrier(wanted * EAST, offset * EAST, 0.4, VFH)
    np.testing.assert_allclose(mirrored, let * EAST, atol=1e-6)


@given(blocked=st.lists(st.booleans(), min_size=vfh.SECTORS, max_size=vfh.SECTORS))
def test_openings_are_all_that_is_free(blocked: list[bool]) -> None:
    found = vfh.openings(np.array(blocked))
    assert sum(length for _, length in found) == blocked.count(False)
    for first, length in found:
        assert not any(blocked[(first + k) % vfh.SECTORS] for k in range(length))


@given(blocked=st.lists(st.booleans(), min_size=vfh.SECTORS, max_size=vfh.SECTORS), target=st.floats(-3.0, 3.0))
def test_candidates_lie_in_openings(blocked: list[bool], target: float) -> None:
    for course in vfh.candidates(np.array(blocked), target, VFH):
        sector = math.floor((course % math.tau) / vfh.SECTOR_RAD)
        assert not (blocked[sector % vfh.SECTORS] and blocked[(sector + 1) % vfh.SECTORS])


def test_speed_is_full_only_where_all_is_well() -> None:
    assert vfh.fuzzy_share(9.0, 9.0, 0.0, VFH) == 1.0
    assert vfh.fuzzy_share(0.0, 9.0, 0.0, VFH) == VFH.slow_share
    assert vfh.fuzzy_share(9.0, 0.0, 0.0, VFH) == VFH.slow_share
    assert vfh.fuzzy_share(9.0, 9.0, math.pi, VFH) == VFH.slow_share
