"""Range noise reckoned with: its scatter is found, walls stand where they are, an outlier closes no gap."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.core import gridmap
from companion.core.frames import quaternion
from companion.core.gridmap import GridMap, MapParams, PolarScan
from companion.core.types import F64, Scan, VehicleState
from companion.perception.noise import entered
from companion.perception.polar import flatten

PARAMS = MapParams(cell_m=0.05, cells=160, sense_m=4.0, blend=0.3)
UNBIAS, REFUTE = 0.8, 1.5  # of the profile ``tight``
POST_M = 0.075
GAP_M = 0.74  # between the posts at the gap's sides
WALL = np.array(  # a wall of posts across north 1.0 with a gap at east 0, and side walls at 1.2 m
    [(1.0, side * (GAP_M / 2 + POST_M + 0.15 * i)) for side in (-1, 1) for i in range(6)]
    + [(0.15 * i - 1.5, side * 1.2) for side in (-1, 1) for i in range(17)]
)


def scan_of(posts: F64, t_s: float, pos: F64, sigma_m: float, rng: np.random.Generator) -> PolarScan:
    """72 minima of 360 noisy rays in whole centimetres, dithered, laid flat; level, yaw 0."""
    azimuth = np.radians(np.arange(360.0))
    away = posts - pos
    along = away[:, :1] * np.cos(azimuth) + away[:, 1:] * np.sin(azimuth)
    square = POST_M**2 - ((away**2).sum(axis=1)[:, None] - along**2)
    ranges = np.where((square >= 0) & (along > 0), along - np.sqrt(np.maximum(square, 0)), np.inf).min(axis=0)
    ranges += sigma_m * rng.standard_normal(360)
    offset = (0, 2, 4, 1, 3)[round(t_s * 25) % 5]
    minima = np.round(np.roll(ranges, -offset).reshape(72, 5).min(axis=1), 2)
    scan = Scan(t_s, minima, math.radians(offset + 2.0), math.radians(5.0), 0.1, 30.0)
    state = VehicleState(t_s, np.array([*pos, -2.5]), np.zeros(3), quaternion(0.0, 0.0, 0.0), np.zeros(3))
    return flatten(scan, state, 0.0, 0.4).polar


def flown(sigma_m: float, unbias: float, refute: float, seed: int = 1) -> GridMap:
    """The map after two seconds on the way to the gap."""
    rng, grid = np.random.default_rng(seed), gridmap.empty(PARAMS)
    for i in range(50):
        pos = np.array([0.012 * i, 0.002 * i])
        grid = entered(grid, scan_of(WALL, 1.0 + 0.04 * i, pos, sigma_m, rng), unbias, refute, PARAMS)
    return grid


def sigma_of(grid: GridMap) -> float:
    assert grid.lately is not None
    return grid.lately.sigma_m


def into_the_gap_m(grid: GridMap) -> F64:
    """How far each hit of the wall's near side lies before the surface of its nearest post."""
    hits = gridmap.occupied_points(grid, 3.0, PARAMS)
    hits = hits[np.hypot(hits[:, 0] - 0.95, hits[:, 1]) < 0.7]
    gaps: F64 = np.hypot(*(hits[:, None] - WALL[None]).transpose(2, 0, 1)).min(axis=1) - POST_M
    return gaps


@pytest.mark.parametrize("sigma_m", [0.01, 0.02, 0.03])
def test_the_scatter_of_the_ranges_is_found_in_the_scans(sigma_m: float) -> None:
    assert sigma_of(flown(sigma_m, UNBIAS, REFUTE)) == pytest.approx(sigma_m, abs=0.006)


def test_without_noise_hardly_any_is_found() -> None:
    assert sigma_of(flown(0.0, UNBIAS, REFUTE)) < 0.006


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noisy_hits_stand_out_of_the_surface_by_half_of_what_they_did(seed: int) -> None:
    plain = into_the_gap_m(flown(0.03, 0.0, 0.0, seed))
    better = into_the_gap_m(flown(0.03, UNBIAS, REFUTE, seed))
    assert len(better) >= 8
    assert np.percentile(better, 90) < 0.6 * np.percentile(plain, 90)
    assert np.abs(np.median(better)) < 0.02


@pytest.mark.parametrize("sigma_m", [0.0, 0.01, 0.03])
def test_every_post_at_the_gap_is_still_on_the_map(sigma_m: float) -> None:
    hits = gridmap.occupied_points(flown(sigma_m, UNBIAS, REFUTE), 3.0, PARAMS)
    for post in WALL[np.hypot(WALL[:, 0] - 1.0, WALL[:, 1]) < 0.6]:
        assert np.hypot(*(hits - post).T).min() < POST_M + 0.03


def test_a_single_outlier_is_not_entered() -> None:
    rng, grid = np.random.default_rng(4), flown(0.01, UNBIAS, REFUTE)
    scan = scan_of(WALL, 3.0, np.array([0.59, 0.1]), 0.01, rng)
    sector = scan.hit_sector == scan.hit_sector[np.argmin(np.abs(scan.hit_m - 0.8))]
    outlier = replace(scan, hit_m=np.where(sector, scan.hit_m - 0.05, scan.hit_m))
    plain = entered(grid, scan, UNBIAS, REFUTE, PARAMS)
    struck = entered(grid, outlier, UNBIAS, REFUTE, PARAMS)
    place = gridmap.AZIMUTH_DIR[outlier.hit_bin[sector]] * outlier.hit_m[sector][:, None] + outlier.pos_ne_m
    cells, _ = gridmap.cells_of(plain, place)
    entered_now = (struck.hit_t.ravel()[cells] == np.float32(3.0)) & (plain.hit_t.ravel()[cells] == gridmap.NEVER)
    assert not entered_now.any()


@pytest.mark.parametrize("speed_m_s", [0.3, 0.6, 0.8, 1.5])
@pytest.mark.parametrize("sigma_m", [0.01, 0.03])
def test_what_comes_nearer_is_on_the_map_all_the_time(speed_m_s: float, sigma_m: float) -> None:
    rng, grid, pos = np.random.default_rng(5), gridmap.empty(PARAMS), np.zeros(2)
    nearest = []
    for i in range(60):
        front = 2.0 - speed_m_s * 0.04 * max(i - 30, 0)
        posts = np.concatenate([WALL[WALL[:, 0] < 0.9], [[front, 0.1 * j] for j in (-1, 0, 1)]])
        if front < 0.6:
            break
        grid = entered(grid, scan_of(posts, 1.0 + 0.04 * i, pos, sigma_m, rng), UNBIAS, REFUTE, PARAMS)
        hits = gridmap.occupied_points(grid, 1.0 + 0.04 * i, PARAMS)
        ahead = hits[(np.abs(hits[:, 1]) < 0.2) & (hits[:, 0] > 0.2)]
        nearest.append(ahead[:, 0].min() - (front - POST_M) if len(ahead) else math.inf)
    assert max(nearest[32:]) < 0.16
    assert np.mean(nearest[32:]) < 0.06


def test_without_either_it_is_the_plain_map() -> None:
    scan = scan_of(WALL, 1.0, np.zeros(2), 0.01, np.random.default_rng(6))
    grid = gridmap.empty(PARAMS)
    plain, same = gridmap.update(grid, scan, PARAMS), entered(grid, scan, 0.0, 0.0, PARAMS)
    assert (plain.hit_t == same.hit_t).all()
    assert (plain.hit_ne_m == same.hit_ne_m).all()
