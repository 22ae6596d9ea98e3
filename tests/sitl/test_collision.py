"""Is the judge's clearance the distance between the vehicle's surface and the nearest obstacle's?"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import quaternion
from companion.core.types import F64
from sitl.collision import CollisionChecker
from sitl.lidar import Lidar, LidarParams
from sitl.world import Mover, World, wall_box

RADIUS_M = 0.33
HALF_HEIGHT_M = 0.08


def world_of(circles: list[list[float]] | None = None, boxes: list[list[float]] | None = None, **more: object) -> World:
    return World(
        name="test",
        start_ned_m=np.zeros(2),
        goal_ned_m=np.ones(2),
        bounds_m=(-50.0, -50.0, 50.0, 50.0),
        circles=np.array(circles or [], dtype=float).reshape(-1, 4),
        boxes=np.array(boxes or [], dtype=float).reshape(-1, 6),
        **more,  # type: ignore[arg-type]
    )


def clearance(world: World, north_m: float, east_m: float, up_m: float = 3.0, t_s: float = 0.0) -> float:
    return CollisionChecker(world, RADIUS_M, HALF_HEIGHT_M).clearance(t_s, np.array([north_m, east_m, -up_m]))


def signed_distance_m(world: World, point: F64) -> float:
    """Horizontal distance from a point to the nearest surface, by hand."""
    to_circles = [math.dist(point, c[:2]) - c[2] for c in world.circles]
    to_boxes = []
    for n, e, yaw, half_length, half_width, _ in world.boxes:
        dn, de = point[0] - n, point[1] - e
        along = abs(dn * math.cos(yaw) + de * math.sin(yaw)) - half_length
        across = abs(de * math.cos(yaw) - dn * math.sin(yaw)) - half_width
        to_boxes.append(math.hypot(max(along, 0.0), max(across, 0.0)) + min(max(along, across), 0.0))
    return float(min(to_circles + to_boxes))


def random_world(seed: int) -> World:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 15))
    tall = np.full(count, np.inf)
    circles = np.column_stack([rng.uniform(-15, 15, (count, 2)), rng.uniform(0.1, 2.0, count), tall])
    boxes = np.column_stack(
        [rng.uniform(-15, 15, (count, 2)), rng.uniform(-3, 3, count), rng.uniform(0.02, 4.0, (count, 2)), tall]
    )
    return world_of(circles.tolist(), boxes.tolist())


def test_an_empty_world_has_no_obstacle_at_any_distance() -> None:
    assert clearance(world_of(), 0.0, 0.0) == math.inf


def test_the_ground_is_no_obstacle() -> None:
    assert clearance(world_of([[10.0, 0.0, 0.5, 4.0]]), 0.0, 0.0, up_m=0.0) == pytest.approx(9.5 - RADIUS_M, abs=1e-6)


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), north=st.floats(-15, 15), east=st.floats(-15, 15), up=st.floats(0.0, 50.0))
def test_clearance_is_the_horizontal_distance_to_what_is_tall(seed: int, north: float, east: float, up: float) -> None:
    world = random_world(seed)
    expected = max(0.0, signed_distance_m(world, np.array([north, east]))) - RADIUS_M
    assert clearance(world, north, east, up) == pytest.approx(expected, abs=1e-6)


@settings(max_examples=100, deadline=None)
@given(depth=st.floats(0.001, 0.3), bearing=st.floats(-3.1, 3.1))
def test_in_contact_with_a_trunk_it_is_minus_the_depth(depth: float, bearing: float) -> None:
    apart = 0.5 + RADIUS_M - depth
    world = world_of([[0.0, 0.0, 0.5, math.inf], [5.0, 5.0, 0.5, math.inf]])
    found = clearance(world, apart * math.cos(bearing), apart * math.sin(bearing))
    assert found == pytest.approx(-depth)


def test_deep_inside_a_box_is_contact() -> None:
    assert clearance(world_of(boxes=[[0.0, 0.0, 0.3, 5.0, 5.0, math.inf]]), 0.0, 0.0) == -RADIUS_M


def test_over_a_low_obstacle_it_is_the_vertical_gap() -> None:
    world = world_of([[0.0, 0.0, 0.5, 2.0]], [[10.0, 0.0, 0.4, 1.0, 1.0, 2.5]])
    assert clearance(world, 0.0, 0.0, up_m=3.0) == pytest.approx(1.0 - HALF_HEIGHT_M, abs=1e-6)
    assert clearance(world, 10.0, 0.0, up_m=3.0) == pytest.approx(0.5 - HALF_HEIGHT_M, abs=1e-6)
    assert clearance(world, 10.0, 0.0, up_m=2.55) <= 0.0


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), on_axis=st.booleans(), up=st.floats(0.1, 8.0), top=st.floats(0.1, 6.0))
def test_clearance_to_what_is_low_is_the_distance_in_space(seed: int, on_axis: bool, up: float, top: float) -> None:
    world = random_world(seed)
    circles, boxes = world.circles.copy(), world.boxes.copy()
    circles[:, 3] = boxes[:, 5] = top
    low = world_of(circles.tolist(), boxes.tolist())
    place = circles[0, :2] if on_axis else np.random.default_rng(seed).uniform(-15, 15, 2)
    beside = max(0.0, signed_distance_m(low, place) - RADIUS_M)
    above = max(0.0, up - HALF_HEIGHT_M - top)
    expected = math.hypot(beside, above)
    found = clearance(low, *place, up_m=up)
    assert max(0.0, found) == pytest.approx(expected, abs=1e-6)


def test_beside_a_low_obstacle_it_is_the_horizontal_gap() -> None:
    world = world_of(boxes=[wall_box((5.0, -3.0), (5.0, 3.0), 0.2, 2.0)])
    assert clearance(world, 0.0, 0.0, up_m=1.0) == pytest.approx(4.9 - RADIUS_M, abs=1e-6)


def test_the_nearer_of_tall_and_low_counts() -> None:
    world = world_of([[2.0, 0.0, 0.5, math.inf], [-1.5, 0.0, 0.5, 5.0]])
    assert clearance(world, 0.0, 0.0) == pytest.approx(1.0 - RADIUS_M, abs=1e-6)


@pytest.mark.parametrize("height_m", [math.inf, 6.0])
def test_a_mover_counts_where_it_is_now(height_m: float) -> None:
    mover = Mover((5.0, -8.0), (5.0, 8.0), 0.4, height_m, 1.6, 1.6, 0.0)
    checker = CollisionChecker(world_of([[-20.0, 0.0, 0.5, math.inf]], movers=(mover,)), RADIUS_M, HALF_HEIGHT_M)
    for t_s in (0.0, 5.0, 2.5, 5.0, 11.0):  # also back in time
        expected = math.dist((0.0, 0.0), mover.position_ned_m(t_s)) - 0.4 - RADIUS_M
        assert checker.clearance(t_s, np.array([0.0, 0.0, -3.0])) == pytest.approx(expected, abs=1e-6)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_ray_of_the_lidar_reads_less_than_the_clearance(seed: int) -> None:
    world = random_world(seed)
    if signed_distance_m(world, np.zeros(2)) < RADIUS_M:
        return
    pos = np.array([0.0, 0.0, -3.0])
    nearest_m = Lidar(world, LidarParams(rays=3600)).true_ranges(0.0, pos, quaternion(0.0, 0.0, 0.0)).min()
    clear_m = clearance(world, 0.0, 0.0) + RADIUS_M
    assert clear_m - 1e-6 <= nearest_m
    if clear_m < 5.0:
        assert nearest_m <= clear_m + 0.12  # a thin wall end may lie between two rays 9 mm apart
