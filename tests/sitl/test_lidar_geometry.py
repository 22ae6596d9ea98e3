"""Does the LiDAR see the true surfaces, tilted or level, and nothing else?"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import quaternion, rotation_ned_frd
from companion.core.types import F64, Scan
from sitl.lidar import Lidar, LidarParams
from sitl.world import Mover, World, arc_boxes, wall_box

EXACT = LidarParams(sigma_m=0.0, dither=False, mount_up_m=0.0)
LEVEL = quaternion(0.0, 0.0, 0.0)
ALL_HEIGHTS = (0.5, 2.0, 4.0, math.inf)


def world_of(circles: list[list[float]] | None = None, boxes: list[list[float]] | None = None, **more: object) -> World:
    return World(
        name="test",
        start_ned_m=np.zeros(2),
        goal_ned_m=np.array([40.0, 0.0]),
        bounds_m=(-50.0, -50.0, 50.0, 50.0),
        circles=np.array(circles or [], dtype=float).reshape(-1, 4),
        boxes=np.array(boxes or [], dtype=float).reshape(-1, 6),
        **more,  # type: ignore[arg-type]
    )


def ahead(world: World, q_ned_frd: F64 = LEVEL, up_m: float = 3.0, t_s: float = 0.0) -> Scan:
    return Lidar(world, EXACT).scan(t_s, np.array([0.0, 0.0, -up_m]), q_ned_frd)


def test_a_tree_ahead_reads_its_near_surface() -> None:
    scan = ahead(world_of([[10.0, 0.0, 0.5, math.inf]]))
    assert scan.range_m[0] == pytest.approx(9.5)
    assert np.isinf(scan.range_m[10:60]).all()


def test_a_tree_to_the_right_shows_in_the_sectors_to_the_right() -> None:
    scan = ahead(world_of([[0.0, 8.0, 0.5, math.inf]]))
    assert np.nanargmin(scan.range_m) == 18
    assert scan.range_m[18] == pytest.approx(7.5)


def test_a_wall_across_reads_its_distance_over_the_cosine() -> None:
    scan = ahead(world_of(boxes=[wall_box((5.0, -40.0), (5.0, 40.0), 0.2, math.inf)]))
    assert scan.range_m[0] == pytest.approx(4.9)
    nearest_ray_rad = math.radians(30 - 2)  # sector 6 gathers the rays at 28..32 deg
    assert scan.range_m[6] == pytest.approx(4.9 / math.cos(nearest_ray_rad))


def test_yaw_turns_the_scan_the_other_way() -> None:
    scan = ahead(world_of([[10.0, 0.0, 0.5, math.inf]]), quaternion(0.0, 0.0, math.radians(90)))
    assert scan.range_m[54] == pytest.approx(9.5)


def test_beyond_the_range_is_measured_free() -> None:
    scan = ahead(world_of([[30.6, 0.0, 0.5, math.inf], [-30.4, 0.0, 0.5, math.inf]]))
    assert np.isinf(scan.range_m[0])
    assert scan.range_m[36] == pytest.approx(29.9)


def test_a_level_scan_sees_no_ground() -> None:
    assert np.isinf(ahead(world_of()).range_m).all()


def test_nose_down_sees_the_ground_ahead_at_height_over_sine_and_nothing_behind() -> None:
    scan = ahead(world_of(), quaternion(0.0, math.radians(-20), 0.0))
    assert scan.range_m[0] == pytest.approx(3.0 / math.sin(math.radians(20)))
    assert np.isinf(scan.range_m[20:53]).all()


def test_roll_right_sees_the_ground_to_the_right() -> None:
    scan = ahead(world_of(), quaternion(math.radians(25), 0.0, 1.0))
    assert scan.range_m[18] == pytest.approx(3.0 / math.sin(math.radians(25)))
    assert np.isinf(scan.range_m[54])


def test_a_tilted_ray_reads_the_slant_range_to_a_trunk() -> None:
    scan = ahead(world_of([[8.0, 0.0, 0.5, math.inf]]), quaternion(0.0, math.radians(10), 0.0))
    assert scan.range_m[0] == pytest.approx(7.5 / math.cos(math.radians(10)))


def test_what_is_lower_than_the_sweep_is_not_seen() -> None:
    low, high = [8.0, 0.0, 0.5, 2.9], [8.0, 0.0, 0.5, 3.1]
    assert np.isinf(ahead(world_of([low])).range_m).all()
    assert ahead(world_of([high])).range_m[0] == pytest.approx(7.5)


def test_a_ray_that_passes_over_the_edge_meets_the_top() -> None:
    pitch_rad = math.radians(-15)
    scan = ahead(world_of(boxes=[[8.0, 0.0, 0.0, 3.0, 3.0, 1.5]]), quaternion(0.0, pitch_rad, 0.0))
    assert scan.range_m[0] == pytest.approx((3.0 - 1.5) / math.sin(-pitch_rad))


def test_the_sensor_sits_above_the_vehicle() -> None:
    lidar = Lidar(world_of([[8.0, 0.0, 0.5, 3.05]]), LidarParams(sigma_m=0.0, mount_up_m=0.1))
    assert np.isinf(lidar.scan(0.0, np.array([0.0, 0.0, -3.0]), LEVEL).range_m).all()
    assert lidar.scan(0.0, np.array([0.0, 0.0, -2.9]), LEVEL).range_m[0] == pytest.approx(7.5)


def test_a_mover_is_seen_where_it_is() -> None:
    mover = Mover((10.0, -5.0), (10.0, 5.0), 0.5, math.inf, 1.0, 1.0, 0.0)
    world = world_of(movers=(mover,))
    assert ahead(world, t_s=5.0).range_m[0] == pytest.approx(9.5)
    assert np.isinf(ahead(world, t_s=0.0).range_m[0])
    assert ahead(world, t_s=0.0).range_m.min() == pytest.approx(math.hypot(10.0, 5.0) - 0.5, abs=0.02)


def test_an_arc_is_seen_at_its_radius_from_its_centre() -> None:
    boxes = arc_boxes((0.0, 0.0), 7.0, math.radians(-70), math.radians(70), 0.2, math.inf)
    scan = ahead(world_of(boxes=boxes))
    front = np.r_[scan.range_m[:14], scan.range_m[59:]]
    assert front == pytest.approx(6.9, abs=0.02)
    assert np.isinf(scan.range_m[15:58]).all()


def random_world(rng: np.random.Generator, obstacles: int) -> World:
    heights = rng.choice(ALL_HEIGHTS, size=2 * obstacles)
    circles = np.column_stack(
        [rng.uniform(-25, 25, (obstacles, 2)), rng.uniform(0.1, 3.0, obstacles), heights[:obstacles]]
    )
    boxes = np.column_stack(
        [
            rng.uniform(-25, 25, (obstacles, 2)),
            rng.uniform(-np.pi, np.pi, obstacles),
            rng.uniform(0.05, 4.0, (obstacles, 2)),
            heights[obstacles:],
        ]
    )
    return world_of(circles.tolist(), boxes.tolist())


def brute_force(world: World, pos_ned_m: F64, q_ned_frd: F64, rays: int, range_max_m: float) -> F64:
    """Every ray against every solid as an intersection of intervals of the ray parameter; no culling."""
    bearing = np.arange(rays) * math.tau / rays
    body = np.stack([np.cos(bearing), np.sin(bearing), np.zeros(rays)])
    north, east, down = rotation_ned_frd(q_ned_frd) @ body
    up_m = -pos_ned_m[2]
    nearest = np.where(down > 0, up_m / np.where(down > 0, down, 1.0), np.inf)
    for c_n, c_e, radius, height in world.circles:
        n, e = pos_ned_m[0] - c_n, pos_ned_m[1] - c_e
        a, b, c = north**2 + east**2, n * north + e * east, n * n + e * e - radius**2
        disc = b * b - a * c
        root = np.sqrt(np.maximum(disc, 0.0))
        side = (np.where(disc < 0, np.inf, (-b - root) / a), np.where(disc < 0, -np.inf, (-b + root) / a))
        nearest = np.minimum(nearest, enter(side, below(up_m, down, height)))
    for c_n, c_e, yaw, half_length, half_width, height in world.boxes:
        cos, sin = math.cos(yaw), math.sin(yaw)
        n, e = pos_ned_m[0] - c_n, pos_ned_m[1] - c_e
        along = between(n * cos + e * sin, north * cos + east * sin, half_length)
        across = between(e * cos - n * sin, east * cos - north * sin, half_width)
        nearest = np.minimum(nearest, enter(along, across, below(up_m, down, height)))
    return np.where(nearest <= range_max_m, nearest, np.inf)


def between(offset: float, direction: F64, half: float) -> tuple[F64, F64]:
    ends = np.stack([(-half - offset) / direction, (half - offset) / direction])
    return ends.min(axis=0), ends.max(axis=0)


def below(up_m: float, down: F64, height: float) -> tuple[F64, F64]:
    if math.isinf(height):
        return np.full(down.shape, -np.inf), np.full(down.shape, np.inf)
    crossing = (up_m - height) / down
    return np.where(down > 0, crossing, -np.inf), np.where(down > 0, np.inf, crossing)


def enter(*intervals: tuple[F64, F64]) -> F64:
    near = np.maximum(0.0, np.max([i[0] for i in intervals], axis=0))
    far = np.min([i[1] for i in intervals], axis=0)
    return np.where(near <= far, near, np.inf)


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    roll=st.floats(-math.pi, math.pi),
    pitch=st.floats(-1.5, 1.5),
    yaw=st.floats(-math.pi, math.pi),
    up_m=st.floats(0.2, 6.0),
)
def test_culling_changes_nothing(seed: int, roll: float, pitch: float, yaw: float, up_m: float) -> None:
    rng = np.random.default_rng(seed)
    world = random_world(rng, int(rng.integers(0, 12)))
    pos = np.array([*rng.uniform(-10, 10, 2), -up_m])
    q = quaternion(roll + 1e-7, pitch + 1e-7, yaw + 1e-7)  # a ray that is exactly level divides the oracle by zero
    lidar = Lidar(world, EXACT)
    rays = lidar.true_ranges(0.0, pos, q)
    expected = brute_force(world, pos, q, 360, 30.0)
    assert rays == pytest.approx(expected, rel=1e-6, abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), roll=st.floats(-0.6, 0.6), pitch=st.floats(-0.6, 0.6), yaw=st.floats(-3.0, 3.0))
def test_a_mirrored_world_gives_the_mirrored_scan(seed: int, roll: float, pitch: float, yaw: float) -> None:
    world = random_world(np.random.default_rng(seed), 6)
    circles, boxes = world.circles.copy(), world.boxes.copy()
    circles[:, 1] *= -1.0
    boxes[:, 1:3] *= -1.0
    mirrored = world_of(circles.tolist(), boxes.tolist())
    here = ahead(world, quaternion(roll, pitch, yaw)).range_m
    there = ahead(mirrored, quaternion(-roll, pitch, -yaw)).range_m
    assert there == pytest.approx(here[-np.arange(72)], rel=1e-6)


def test_more_rays_read_the_same_where_they_coincide() -> None:
    world = random_world(np.random.default_rng(3), 10)
    pos, q = np.array([0.0, 0.0, -2.0]), quaternion(0.1, -0.2, 0.3)
    few = Lidar(world, EXACT).true_ranges(0.0, pos, q)
    many = Lidar(world, LidarParams(rays=1440, mount_up_m=0.0)).true_ranges(0.0, pos, q)
    assert many[::4] == pytest.approx(few)
