"""Does a serial LiDAR reach the navigator and the autopilot? lds2d's own parsers behind a pseudo terminal."""

import math
import random
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lds2d", reason="needs the 'hw' extra")

from ld19 import TURN_HZ, Ld19, noise

from companion.core import codec
from companion.core.clock import SystemClock
from companion.core.transport import wait_readable
from companion.core.types import Scan
from companion.link.lidar import LidarError
from companion.link.lidar_params import LidarParams
from companion.link.lidar_serial import SerialLidar
from companion.link.vehicle_clock import VehicleClock

BOOTED_S = 1000.0  # the vehicle's clock is this far behind ours


def room(angle_rad: float) -> float:
    """A wall 4 m to the right, a pole ahead-left; nothing else."""
    if abs(angle_rad - math.radians(90.0)) < math.radians(60.0):
        return 4.0 / math.cos(angle_rad - math.radians(90.0))
    return 1.5 if abs(angle_rad - math.radians(330.0)) < math.radians(4.0) else 0.0


@pytest.fixture
def ld19(tmp_path: Path) -> Iterator[Ld19]:
    lidar = Ld19(tmp_path / "ttyLIDAR", room)
    yield lidar
    if lidar.path.exists():
        lidar.pull()


def collected(lidar: SerialLidar, enough: Callable[[list[Scan]], bool], patience_s: float = 10.0) -> list[Scan]:
    """Scans by a vehicle clock that is heard fifty times a second, until there are enough."""
    clock, vehicle_clock = SystemClock(), VehicleClock()
    began_s = clock.now_s()
    scans: list[Scan] = []
    while not enough(scans) and clock.now_s() - began_s < patience_s:
        vehicle_clock.update(clock.now_s() - BOOTED_S, clock.now_s())
        scans += [codec.decode_scan(message) for message in lidar.receive(vehicle_clock)]
        wait_readable(lidar.waits_on(), 0.02, clock)
    return scans


def test_sweeps_become_scans_in_vehicle_time_and_in_the_body_frame(ld19: Ld19) -> None:
    with closing(SerialLidar("LD19", str(ld19.path), None, LidarParams())) as lidar:
        scans = collected(lidar, lambda scans: len(scans) >= 12)
    now_s = time.monotonic() - BOOTED_S
    assert all(now_s - 3.0 < scan.t_s < now_s for scan in scans)
    steps_s = np.diff([scan.t_s for scan in scans])
    assert (steps_s > 0.0).all()
    assert float(np.median(steps_s)) == pytest.approx(1 / TURN_HZ, rel=0.2)
    assert len({round(scan.angle_offset_rad, 6) for scan in scans}) == 5  # dithered
    for scan in scans[2:]:
        bearing_deg = np.degrees(scan.angle_offset_rad + np.arange(72) * scan.increment_rad) % 360.0
        right = np.abs(bearing_deg - 90.0) < 5.0
        assert scan.range_m[right] == pytest.approx(4.0, abs=0.05)
        assert np.nanmin(scan.range_m[np.abs(bearing_deg - 330.0) < 3.0]) == 1.5
        assert np.isinf(scan.range_m[np.abs(bearing_deg - 230.0) < 20.0]).all()


def test_a_lidar_mounted_upside_down_facing_aft_is_turned_right(ld19: Ld19) -> None:
    params = LidarParams(clockwise=False, mount_yaw_rad=math.pi)
    with closing(SerialLidar("LD19", str(ld19.path), None, params)) as lidar:
        scan = collected(lidar, lambda scans: len(scans) >= 3)[-1]
    bearing_deg = np.degrees(scan.angle_offset_rad + np.arange(72) * scan.increment_rad) % 360.0
    assert scan.range_m[np.abs(bearing_deg - 90.0) < 5.0] == pytest.approx(4.0, abs=0.05)  # pi - 90 degrees
    assert np.nanmin(scan.range_m[np.abs(bearing_deg - 210.0) < 3.0]) == 1.5


def test_an_unplugged_lidar_is_silence_and_goes_on_when_it_is_back(ld19: Ld19) -> None:
    with closing(SerialLidar("LD19", str(ld19.path), None, LidarParams())) as lidar:
        assert collected(lidar, lambda scans: len(scans) >= 2)
        ld19.pull()
        collected(lidar, lambda _: False, 0.3)
        assert collected(lidar, lambda _: False, 0.5) == []
        ld19.plug_in()
        assert len(collected(lidar, lambda scans: len(scans) >= 3)) >= 3


def test_ten_thousand_packets_of_noise_on_the_line_are_not_the_end_of_it(ld19: Ld19) -> None:
    rng = random.Random(5)
    with closing(SerialLidar("LD19", str(ld19.path), None, LidarParams())) as lidar:
        for _ in range(10_000):
            ld19.disturb(noise(rng))
        # an eight-bit checksum lets one packet of noise in 256 through: clean is what comes after the last of it
        scans = collected(lidar, lambda scans: len(scans) >= 4 and all(as_the_room_is(scan) for scan in scans[-4:]))
    assert len(scans) >= 4 and all(as_the_room_is(scan) for scan in scans[-4:])


def as_the_room_is(scan: Scan) -> bool:
    """A wall 4 m to the right, nothing aft on the left."""
    bearing_deg = np.degrees(scan.angle_offset_rad + np.arange(72) * scan.increment_rad) % 360.0
    right_m = scan.range_m[np.abs(bearing_deg - 90.0) < 5.0]
    return bool(
        (np.abs(right_m - 4.0) < 0.05).all() and np.isinf(scan.range_m[np.abs(bearing_deg - 230.0) < 20.0]).all()
    )


def test_without_vehicle_time_scans_are_dropped_and_not_kept_for_later(ld19: Ld19) -> None:
    with closing(SerialLidar("LD19", str(ld19.path), None, LidarParams())) as lidar:
        wait_readable(lidar.waits_on(), 5.0)
        assert lidar.receive(VehicleClock()) == []


def test_closing_twice_is_closing_once_and_quick(ld19: Ld19) -> None:
    lidar = SerialLidar("LD19", str(ld19.path), None, LidarParams())
    began_s = time.monotonic()
    lidar.close()
    lidar.close()
    assert time.monotonic() - began_s < 2.0
    assert lidar.files() == ()


@pytest.mark.parametrize(
    ("model", "device", "says"),
    [
        ("LD91", "/dev/null", "lds2d knows no LiDAR 'LD91'; did you mean 'LD19'?"),
        ("LDS02RR", "/dev/null", "turns only while a program drives its motor"),
        ("LD19", "/dev/no-such-port", "lds2d:LD19:/dev/no-such-port: /dev/no-such-port cannot be opened: "),
    ],
)
def test_a_lidar_that_cannot_be_opened_is_one_line(model: str, device: str, says: str) -> None:
    with pytest.raises(LidarError) as caught:
        SerialLidar(model, device, None, LidarParams())
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lds2d", None)
    with pytest.raises(LidarError, match=r"pip install 'swiftnav\[hw\]'"):
        SerialLidar("LD19", "/dev/null", None, LidarParams())
