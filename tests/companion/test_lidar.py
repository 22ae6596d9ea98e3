"""Do scans of every kind of LiDAR mean the same? Sweeps, vehicle time, recordings; pure or in one thread."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core import codec
from companion.core.mavlink import Connection
from companion.core.tlog import TlogWriter
from companion.core.transport import pair
from companion.core.types import Scan
from companion.core.url import Url, UrlError
from companion.link.lidar import LidarError
from companion.link.lidar_params import LidarParams
from companion.link.lidar_replay import ReplayLidar, read_scans, write_scans
from companion.link.lidar_url import ReplayFile, SerialModel, parse_lidar
from companion.link.sweep import DITHER_RAD, scan_of
from companion.link.vehicle_clock import AHEAD_S, WINDOW_S, VehicleClock

ANGLES_RAD = np.radians(np.arange(0.0, 360.0, 0.8))


def pole_at(bearing_rad: float, params: LidarParams) -> Scan:
    """One pole 2 m away, 6 degrees wide; nothing else returns anything."""
    way_rad = (ANGLES_RAD if params.clockwise else -ANGLES_RAD) + params.mount_yaw_rad
    off_rad = (way_rad - bearing_rad + math.pi) % (2 * math.pi) - math.pi
    return scan_of(1.0, ANGLES_RAD, np.where(np.abs(off_rad) < math.radians(3.0), 2.0, 0.0), params)


@given(
    bearing_deg=st.floats(-179.0, 179.0),
    mount_deg=st.floats(-179.0, 179.0),
    clockwise=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_a_pole_is_seen_where_it_is_however_the_lidar_is_mounted(
    bearing_deg: float, mount_deg: float, clockwise: bool
) -> None:
    scan = pole_at(math.radians(bearing_deg), LidarParams(mount_yaw_rad=math.radians(mount_deg), clockwise=clockwise))
    struck = np.flatnonzero(np.isfinite(scan.range_m))
    centres_rad = scan.angle_offset_rad + struck * scan.increment_rad
    off_rad = (centres_rad - math.radians(bearing_deg) + math.pi) % (2 * math.pi) - math.pi
    assert 1 <= len(struck) <= 3
    assert np.abs(off_rad).max() < math.radians(3.0 + 2.5 + 0.5)
    assert (scan.range_m[struck] == 2.0).all()
    assert np.isinf(np.delete(scan.range_m, struck)).all()


@given(ranges_m=st.lists(st.sampled_from([0.0, 0.1, 0.5, 3.0, 11.9, 15.0]), min_size=450, max_size=450))
@settings(max_examples=30, deadline=None)
def test_a_sector_never_reports_more_room_than_its_nearest_ray(ranges_m: list[float]) -> None:
    params = LidarParams()
    measured_m = np.array(ranges_m)
    for number in range(len(DITHER_RAD)):
        scan = scan_of(1.0, ANGLES_RAD, measured_m, params, number)
        away_rad = ANGLES_RAD[:, None] - scan.angle_offset_rad - np.arange(72) * scan.increment_rad
        inside = np.abs((away_rad + math.pi) % (2 * math.pi) - math.pi) < scan.increment_rad / 2 - 1e-9
        for i, range_m in enumerate(scan.range_m):
            hits = [r for r in measured_m[inside[:, i]] if params.range_min_m <= r <= params.range_max_m]
            assert not (hits and not range_m <= min(hits))


def test_what_a_missing_return_means_is_said_by_a_parameter_and_no_ray_at_all_is_unknown() -> None:
    half = ANGLES_RAD[math.pi > ANGLES_RAD]
    none = np.zeros(len(half))
    free = scan_of(1.0, half, none, LidarParams())
    assert np.isinf(free.range_m[1:35]).all()
    assert np.isnan(free.range_m[38:71]).all()
    assert np.isnan(scan_of(1.0, half, none, LidarParams(no_return_free=False)).range_m).all()
    too_near = scan_of(1.0, half, np.full(len(half), 0.1), LidarParams())
    assert np.isnan(too_near.range_m).all()


@given(
    delays_ms=st.lists(st.integers(1, 120), min_size=60, max_size=120),
    origin_s=st.floats(-1e4, 1e4),
    ask_s=st.floats(0.0, 0.08),
)
@settings(max_examples=50, deadline=None)
def test_vehicle_time_is_known_to_the_smallest_delay_of_the_last_two_seconds(
    delays_ms: list[int], origin_s: float, ask_s: float
) -> None:
    clock = VehicleClock()
    arrivals = sorted((origin_s + k * 0.02 + delay / 1e3, k * 0.02) for k, delay in enumerate(delays_ms))
    for now_s, vehicle_s in arrivals:
        clock.update(vehicle_s, now_s)
    now_s = arrivals[-1][0]
    estimate_s = clock.at(now_s + ask_s)
    assert estimate_s is not None
    truth_s = now_s + ask_s - origin_s
    quickest_s = min(now_s - vehicle_s - origin_s for now_s, vehicle_s in arrivals if arrivals[-1][0] - now_s < 1.0)
    assert truth_s - 0.121 <= estimate_s <= truth_s + 1e-6
    assert estimate_s <= clock.newest_s + AHEAD_S
    if truth_s <= clock.newest_s + AHEAD_S:
        assert estimate_s >= truth_s - quickest_s - 1e-6


def test_a_vehicle_clock_that_stands_still_or_starts_again_is_followed() -> None:
    clock = VehicleClock()
    assert clock.at(5.0) is None
    clock.update(-math.inf, 5.0)
    assert clock.at(5.0) is None
    clock.update(100.0, 5.0)
    assert clock.at(5.01) == pytest.approx(100.01)
    clock.update(100.0, 9.0)
    assert clock.at(9.0) == 100.0 + AHEAD_S
    clock.update(2.0, 10.0)
    assert clock.at(10.01) == pytest.approx(2.01)
    for k in range(1, 400):  # runs at half our pace
        clock.update(2.0 + k * 0.01, 10.0 + k * 0.02)
    estimate_s = clock.at(10.0 + 399 * 0.02)
    assert estimate_s is not None
    assert 5.99 - 1e-9 <= estimate_s <= 5.99 + min(AHEAD_S, WINDOW_S / 2)


def some_scans(count: int = 5, first_s: float = 70.0) -> list[Scan]:
    rng = np.random.default_rng(3)
    scans = []
    for k in range(count):
        range_m = rng.uniform(0.3, 10.0, 72).round(2)
        range_m[k], range_m[k + 9] = math.nan, math.inf
        scans.append(codec.quantise_scan(Scan(first_s + k * 0.1, range_m, 0.1, math.radians(5.0), 0.25, 12.0)))
    return scans


def assert_same_scan(left: Scan, right: Scan) -> None:
    np.testing.assert_array_equal(left.range_m, right.range_m)
    assert dataclasses.replace(left, range_m=None) == dataclasses.replace(right, range_m=None)


def as_tlog(path: Path, scans: list[Scan]) -> Path:
    writer = TlogWriter(path)
    link = Connection(pair()[0], 1, 191, writer)
    for scan in scans:
        link.send(codec.encode_companion_heartbeat(), codec.encode_scan(scan), codec.encode_scan(scan))
    writer.close()
    return path


@pytest.mark.parametrize("kind", ["tlog", "jsonl"])
def test_a_recording_gives_back_each_scan_once(tmp_path: Path, kind: str) -> None:
    scans = some_scans()
    path = tmp_path / f"scans.{kind}"
    if kind == "tlog":
        as_tlog(path, scans)
    else:
        write_scans(path, list(reversed(scans)))
    for found, scan in zip(read_scans(path), scans, strict=True):
        assert_same_scan(found, scan)


def test_a_recording_is_played_into_vehicle_time_and_not_faster_than_the_vehicle_lives(tmp_path: Path) -> None:
    path = tmp_path / "scans.jsonl"
    write_scans(path, some_scans(6))
    lidar, clock = ReplayLidar(path), VehicleClock()
    assert lidar.receive(clock) == []
    played: list[tuple[float, float]] = []
    for k in range(1, 51):
        vehicle_s = 30.0 + k * 0.02
        clock.update(vehicle_s, 0.0)
        played += [(vehicle_s, message.time_usec / 1e6) for message in lidar.receive(clock)]
    assert [stamp for _, stamp in played] == pytest.approx([30.02 + k * 0.1 for k in range(6)])
    assert all(0.0 <= vehicle_s - stamp_s < 0.0201 for vehicle_s, stamp_s in played)
    assert (lidar.local, lidar.waits_on(), lidar.links()) == (True, (), ())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has no scan that could be replayed"),
        ("nonsense\n", "line 1 is no scan"),
        ("[1]\n", "line 1 is no scan"),
        (json.dumps({"t_s": 1.0}) + "\n", "line 1 is no scan: it wants an object with t_s, range_m"),
    ],
)
def test_a_file_without_scans_is_one_line_that_names_it(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "scans.jsonl"
    path.write_text(text)
    with pytest.raises(LidarError) as caught:
        ReplayLidar(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_or_a_log_that_is_none_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(LidarError, match=r"none\.tlog cannot be read: No such file"):
        ReplayLidar(tmp_path / "none.tlog")
    (tmp_path / "bad.tlog").write_bytes(b"this is no log of packets")
    with pytest.raises(LidarError, match="is no telemetry log"):
        ReplayLidar(tmp_path / "bad.tlog")


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin://0.0.0.0:14600", Url("udpin", "0.0.0.0", 14600)),
        ("replay:flights/a b/companion.tlog", ReplayFile(Path("flights/a b/companion.tlog"))),
        ("lds2d:LD19:/dev/ttyUSB0", SerialModel("LD19", "/dev/ttyUSB0", None)),
        (
            "lds2d:YDLIDAR-X4:/dev/serial/by-id/usb-x:128000",
            SerialModel("YDLIDAR-X4", "/dev/serial/by-id/usb-x", 128000),
        ),
    ],
)
def test_a_lidar_is_named_by_one_text(text: str, url: Any) -> None:
    assert parse_lidar(text) == url


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("14600", "is no connection URL"),
        ("udpim://0.0.0.0:1", "did you mean 'udpin'"),
        ("replay:", "replay needs a file"),
        ("lds2d:LD19", "expected lds2d:MODEL:/dev/DEVICE[:BAUD]"),
        ("lds2d::/dev/ttyUSB0", "expected lds2d:MODEL:/dev/DEVICE[:BAUD]"),
        ("lds2d:LD19:/dev/ttyUSB0:fast", "baud rate 'fast' must be a number above 0"),
    ],
)
def test_a_wrong_lidar_is_one_line_that_quotes_it(text: str, says: str) -> None:
    with pytest.raises(UrlError) as caught:
        parse_lidar(text)
    assert says in str(caught.value)
    assert f"'{text}'" in str(caught.value)
