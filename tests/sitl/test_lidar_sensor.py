"""Do noise, dropouts, dither and sectors behave as a sensor's, and repeat with the seed?"""

import importlib
import math
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import quaternion
from companion.core.types import F64
from sitl.lidar import Lidar, LidarParams
from sitl.lidar_kernel import sector_minima
from sitl.world import World, arc_boxes

POS = np.array([0.0, 0.0, -3.0])
LEVEL = quaternion(0.0, 0.0, 0.0)
ROOM_M = 10.0  # inner radius of the round room


def room() -> World:
    boxes = arc_boxes((0.0, 0.0), ROOM_M + 0.1, 0.0, math.tau, 0.2, math.inf, sagitta_m=1e-4)
    bounds = (-20.0, -20.0, 20.0, 20.0)
    return World("room", np.zeros(2), np.ones(2), bounds, np.empty((0, 4)), np.array(boxes))


def scans(params: LidarParams, seed: int, count: int) -> F64:
    lidar = Lidar(room(), params, seed)
    return np.array([lidar.scan(i * 0.04, POS, LEVEL).range_m for i in range(count)])


def test_a_scan_does_not_depend_on_the_scans_before_it() -> None:
    params = LidarParams(sigma_m=0.05, dropout=0.3)
    in_order = scans(params, 7, 50)
    lidar = Lidar(room(), params, 7)
    for i in (31, 4, 49, 31):
        assert np.array_equal(lidar.scan(i * 0.04, POS, LEVEL).range_m, in_order[i], equal_nan=True)


def test_seeds_and_scans_differ() -> None:
    params = LidarParams(dither=False)
    a, b = scans(params, 1, 2), scans(params, 2, 2)
    assert (a[0] != a[1]).all()
    assert (a != b).all()


def test_neighbouring_seeds_and_scans_are_uncorrelated() -> None:
    params = LidarParams(rays=72, sectors=72, dither=False, sigma_m=0.1)
    noise = np.array([scans(params, seed, 40) for seed in range(20)]) - ROOM_M
    flat = noise.reshape(20, -1)
    between_seeds = np.corrcoef(flat)[~np.eye(20, dtype=bool)]
    between_scans = np.corrcoef(noise.reshape(-1, 72))[~np.eye(800, dtype=bool)]
    assert abs(between_seeds).max() < 5.0 / math.sqrt(40 * 72)
    assert abs(between_scans).max() < 6.0 / math.sqrt(72)


def test_noise_has_the_sigma_asked_for_and_no_bias() -> None:
    params = LidarParams(rays=72, sectors=72, dither=False, sigma_m=0.05)
    noise = scans(params, 3, 400) - ROOM_M
    assert noise.std() == pytest.approx(0.05, rel=0.02)
    assert noise.mean() == pytest.approx(0.0, abs=0.001)


def test_dropped_rays_are_as_many_as_asked_for() -> None:
    params = LidarParams(rays=72, sectors=72, dither=False, dropout=0.2)
    assert np.isnan(scans(params, 3, 400)).mean() == pytest.approx(0.2, abs=0.01)


def test_a_sector_is_unknown_only_when_all_its_rays_are_dropped() -> None:
    scan = scans(LidarParams(dropout=0.5, dither=False), 5, 400)
    assert np.isnan(scan).mean() == pytest.approx(0.5**5, rel=0.1)
    assert np.isfinite(scan[~np.isnan(scan)]).all()


def test_all_rays_dropped_is_all_unknown() -> None:
    assert np.isnan(scans(LidarParams(dropout=1.0), 5, 3)).all()


def test_a_surface_nearer_than_the_range_begins_reads_where_it_begins() -> None:
    world = World(
        "tree", np.zeros(2), np.ones(2), (-1, -1, 1, 1), np.array([[0.55, 0.0, 0.5, np.inf]]), np.empty((0, 6))
    )
    assert Lidar(world).scan(0.0, POS, LEVEL).range_m[0] == 0.1


@given(
    rays=st.lists(st.sampled_from([1.0, 2.0, 5.0, math.inf, math.nan]), min_size=20, max_size=20),
    first=st.integers(-10, 30),
)
def test_a_sector_is_the_nearest_of_what_its_rays_saw(rays: list[float], first: int) -> None:
    sector = np.empty(4)
    sector_minima(np.array(rays), first, sector)
    for i, value in enumerate(sector):
        seen = [r for r in (rays[(first + 5 * i + j) % 20] for j in range(5)) if not math.isnan(r)]
        assert math.isnan(value) if not seen else value == min(seen)


def test_dither_steps_the_centre_of_sector_zero_0_2_4_1_3_degrees() -> None:
    lidar = Lidar(room())
    offsets = [math.degrees(lidar.scan(i * 0.04, POS, LEVEL).angle_offset_rad) for i in range(6)]
    assert offsets == pytest.approx([0.0, 2.0, 4.0, 1.0, 3.0, 0.0])


def test_without_dither_sector_zero_is_centred_on_the_nose() -> None:
    lidar = Lidar(room(), LidarParams(dither=False))
    assert {lidar.scan(i * 0.04, POS, LEVEL).angle_offset_rad for i in range(6)} == {0.0}


@pytest.mark.parametrize("rays", [360, 720])
@given(ray=st.integers(0, 359), index=st.integers(0, 4))
def test_what_one_ray_sees_shows_in_the_sector_that_covers_its_bearing(rays: int, ray: int, index: int) -> None:
    bearing = math.radians(ray)
    post = np.array([[5.0 * math.cos(bearing), 5.0 * math.sin(bearing), 0.01, np.inf]])
    world = World("post", np.zeros(2), np.ones(2), (-1, -1, 1, 1), post, np.empty((0, 6)))
    scan = Lidar(world, LidarParams(rays=rays, sigma_m=0.0)).scan(index * 0.04, POS, LEVEL)
    (hit,) = np.flatnonzero(np.isfinite(scan.range_m))
    centre = scan.angle_offset_rad + hit * scan.increment_rad
    assert abs(math.remainder(bearing - centre, math.tau)) <= scan.increment_rad / 2 + 1e-9


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"rays": 100}, "100 rays do not divide into 72 sectors"),
        ({"dropout": 1.5}, "dropout 1.5"),
        ({"dropout": math.nan}, "dropout nan"),
        ({"range_min_m": 40.0}, "range_min_m 40.0"),
        ({"sigma_m": -0.1}, "sigma_m -0.1"),
        ({"rate_hz": 0.0}, "rate_hz 0.0"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(bad: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LidarParams(**bad)  # type: ignore[arg-type]


def test_a_missing_numba_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    monkeypatch.delitem(sys.modules, "sitl.compiled")
    with pytest.raises(ImportError, match=r"swiftnav\[sitl\]"):
        importlib.import_module("sitl.compiled")
