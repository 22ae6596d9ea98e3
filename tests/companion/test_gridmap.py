"""What the rolling map may claim: certified cells are really free, hits are remembered, movers are forgotten."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core import gridmap
from companion.core.frames import quaternion
from companion.core.gridmap import GridMap, MapParams
from companion.core.types import F64, Scan, VehicleState
from companion.perception.polar import flatten

PARAMS = MapParams()
SECTOR_RAD = math.radians(5.0)


def ring_scan(t_s: float, pos: F64, discs: F64, offset_deg: float = 0.0, tilt: tuple[float, float] = (0.0, 0.0)):
    """An exact scan of discs (n, e, r) as 72 sector minima of 360 level rays; yaw 0."""
    azimuth = np.radians(np.arange(360.0))
    best = np.full(360, np.inf)
    for north, east, radius in discs:
        dn, de = north - pos[0], east - pos[1]
        along = dn * np.cos(azimuth) + de * np.sin(azimuth)
        square = radius**2 - (dn**2 + de**2 - along**2)
        hit = (square >= 0) & (along > 0)
        best[hit] = np.minimum(best[hit], along[hit] - np.sqrt(square[hit]))
    best[best > 30.0] = np.inf
    rolled = np.roll(best, -round(offset_deg)).reshape(72, 5).min(axis=1)
    scan = Scan(t_s, rolled, math.radians(offset_deg + 2.0), SECTOR_RAD, 0.1, 30.0)
    state = VehicleState(t_s, np.array([*pos, -2.5]), np.zeros(3), quaternion(*tilt, 0.0), np.zeros(3))
    return scan, state


def seen_map(discs: F64, poses: list[tuple[float, float]], grid: GridMap | None = None, t0: float = 1.0) -> GridMap:
    grid = grid or gridmap.empty(PARAMS)
    for i, pos in enumerate(poses):
        scan, state = ring_scan(t0 + 0.04 * i, np.array(pos), discs, offset_deg=(0, 2, 4, 1, 3)[i % 5])
        grid = gridmap.update(grid, flatten(scan, state, 0.0, 0.4).polar, PARAMS)
    return grid


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.floats(-8, 8), st.floats(-8, 8)), min_size=1, max_size=6), st.floats(-0.5, 0.5))
def test_a_certified_cell_holds_no_part_of_any_obstacle(centres: list[tuple[float, float]], start: float) -> None:
    discs = np.array([[n, e, 0.4] for n, e in centres if math.hypot(n, e) > 1.5]).reshape(-1, 3)
    grid = seen_map(discs, [(start + 0.1 * i, 0.07 * i) for i in range(10)])
    north, east = gridmap.centres(grid)
    certain = grid.free_t > gridmap.NEVER
    for n, e, r in discs:
        from_centre = np.hypot((north - n)[:, None], (east - e)[None, :])
        # rays are one degree apart: between two of them a disc's edge bulges by millimetres at these ranges
        assert not (certain & (from_centre < r - 0.02)).any()


def test_dithered_scans_sharpen_an_arc_to_the_width_of_a_ray() -> None:
    discs = np.array([[6.0, 0.0, 0.3]])
    one = gridmap.occupied_points(seen_map(discs, [(0.0, 0.0)]), 1.0, PARAMS)
    five = gridmap.occupied_points(seen_map(discs, [(0.0, 0.0)] * 5), 1.2, PARAMS)
    assert np.ptp(five[:, 1]) < np.ptp(one[:, 1])
    assert np.abs(five[:, 1]).max() < 0.3 + 0.2


def test_a_gap_between_two_trunks_is_open_after_five_dithered_scans() -> None:
    discs = np.array([[5.0, -0.9, 0.3], [5.0, 0.9, 0.3]])  # 1.2 m free between them
    grid = seen_map(discs, [(0.0, 0.0)] * 5)
    points = gridmap.occupied_points(grid, 1.2, PARAMS)
    assert np.abs(points[:, 1]).min() > 0.33


def test_what_moved_away_is_forgotten_as_soon_as_its_place_is_seen_free() -> None:
    grid = seen_map(np.array([[4.0, 0.0, 0.3]]), [(0.0, 0.0)] * 3)
    grid = seen_map(np.array([[4.0, 3.0, 0.3]]), [(0.0, 0.0)] * 5, grid, t0=1.2)
    points = gridmap.occupied_points(grid, 1.4, PARAMS)
    assert np.hypot(points[:, 0] - 4.0, points[:, 1]).min() > 1.0
    assert np.hypot(points[:, 0] - 4.0, points[:, 1] - 3.0).min() < 0.5


def test_what_moves_into_certified_space_is_painted_whole() -> None:
    grid = seen_map(np.empty((0, 3)), [(0.0, 0.0)] * 3)
    grid = seen_map(np.array([[4.0, 0.0, 0.3]]), [(0.0, 0.0)], grid, t0=1.2)
    points = gridmap.occupied_points(grid, 1.2, PARAMS)
    assert np.hypot(points[:, 0] - 3.7, points[:, 1]).min() < 0.1


def test_a_hit_not_seen_again_ages_out() -> None:
    grid = seen_map(np.array([[4.0, 0.0, 0.3]]), [(0.0, 0.0)])
    assert len(gridmap.occupied_points(grid, 1.0 + PARAMS.forget_s - 1.0, PARAMS)) > 0
    assert len(gridmap.occupied_points(grid, 1.1 + PARAMS.forget_s, PARAMS)) == 0


def test_hits_keep_their_place_when_the_map_rolls() -> None:
    disc = np.array([[4.0, 0.0, 0.3]])
    grid = seen_map(disc, [(0.0, 0.0)] * 5)
    before = gridmap.occupied_points(grid, 1.2, PARAMS)
    rolled = seen_map(np.empty((0, 3)), [(-6.0, -5.0)], replace(grid), t0=1.3)
    after = gridmap.occupied_points(rolled, 1.3, PARAMS)
    assert rolled.corner != grid.corner
    assert {tuple(p) for p in after.round(4)} <= {tuple(p) for p in before.round(4)}


def test_seen_tells_certified_and_hit_cells_from_those_never_looked_at() -> None:
    grid = seen_map(np.array([[4.0, 0.0, 0.3]]), [(0.0, 0.0)])
    assert gridmap.seen(grid, np.array([[1.0, 0.0], [6.0, 0.0], [500.0, 0.0]])).tolist() == [True, False, False]


@pytest.mark.parametrize("pitch_deg", [0.0, 10.0, 25.0, 35.0])
def test_ground_returns_of_a_tilted_scan_are_no_obstacles(pitch_deg: float) -> None:
    height, pitch = 2.5, -math.radians(pitch_deg)
    bearing = np.arange(72) * SECTOR_RAD
    q = quaternion(0.0, pitch, 0.0)
    drop = np.cos(bearing) * math.sin(-pitch)  # nose down: forward beams fall
    edge = np.maximum(np.cos(bearing - SECTOR_RAD / 2), np.cos(bearing + SECTOR_RAD / 2)) * math.sin(-pitch)
    with np.errstate(divide="ignore"):
        ground = np.where(edge > 1e-3, height / np.maximum(edge, drop), np.inf)
    ground[ground > 30.0] = np.inf
    scan = Scan(1.0, ground, 0.0, SECTOR_RAD, 0.1, 30.0)
    state = VehicleState(1.0, np.array([0.0, 0.0, -height]), np.zeros(3), q, np.zeros(3))
    assert flatten(scan, state, 0.0, 0.4).polar.hit_m.size == 0


def test_slant_ranges_of_a_tilted_scan_become_horizontal_ones() -> None:
    pitch = -math.radians(20.0)
    wall_north_m = 5.0
    range_m = np.full(72, np.inf)
    range_m[0] = wall_north_m / math.cos(pitch)
    scan = Scan(1.0, range_m, 0.0, SECTOR_RAD, 0.1, 30.0)
    state = VehicleState(1.0, np.array([0.0, 0.0, -20.0]), np.zeros(3), quaternion(0.0, pitch, 0.0), np.zeros(3))
    flat = flatten(scan, state, 0.0, 0.4)
    assert flat.bearing_range_m[0] == pytest.approx(wall_north_m, rel=1e-3)


def test_an_unknown_sector_certifies_nothing() -> None:
    scan = Scan(1.0, np.full(72, np.nan), 0.0, SECTOR_RAD, 0.1, 30.0)
    state = VehicleState(1.0, np.array([0.0, 0.0, -2.5]), np.zeros(3), quaternion(0, 0, 0), np.zeros(3))
    flat = flatten(scan, state, 0.0, 0.4)
    assert (flat.polar.free_m == 0.0).all()
    assert np.isnan(flat.bearing_range_m).all()
    assert (gridmap.update(gridmap.empty(PARAMS), flat.polar, PARAMS).free_t == gridmap.NEVER).all()


def test_a_sensor_that_looks_ahead_only_says_nothing_of_what_is_behind() -> None:
    scan, state = ring_scan(1.0, np.zeros(2), np.array([[4.0, 0.0, 0.3]]))
    ahead = replace(scan, range_m=np.roll(scan.range_m, 14)[:29], angle_offset_rad=-14 * SECTOR_RAD)  # +-72.5 deg
    flat = flatten(ahead, state, 0.0, 0.4)
    whole = flatten(replace(scan, angle_offset_rad=0.0), state, 0.0, 0.4)
    bearing_deg = (np.arange(72) * 5 + 180) % 360 - 180
    assert np.isnan(flat.bearing_range_m[np.abs(bearing_deg) > 73]).all()
    assert (flat.bearing_range_m == whole.bearing_range_m)[np.abs(bearing_deg) < 72].all()
    grid = gridmap.update(gridmap.empty(PARAMS), flat.polar, PARAMS)
    assert not gridmap.seen(grid, np.array([[-3.0, 0.0]])).any()
    assert gridmap.seen(grid, np.array([[3.0, 0.0]])).all()
