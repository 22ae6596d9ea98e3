"""Is a LiDAR that sits the wrong way found by its scans? The simulator's LiDAR, moved, and read wrongly on purpose."""

import dataclasses
import math

import numpy as np
import pytest

from companion.core.frames import quaternion
from companion.core.inputs import Inputs
from companion.core.types import AutopilotStatus, LandedState, VehicleState
from companion.perception.orientation import Fault, judge_orientation
from mission.world_file import load_world
from sitl.lidar import Lidar, LidarParams
from sitl.world import World

ON_GROUND = AutopilotStatus(armed=False, offboard=False, landed=LandedState.ON_GROUND)
TICKS = 60
Motion = tuple[float, float, float]  # north, east, turn at the end

STILL: Motion = (0.0, 0.0, 0.0)
TURNED: Motion = (0.0, 0.0, math.pi / 2)
CARRIED: Motion = (1.4, 0.6, 0.1)
BOTH: Motion = (1.2, -0.6, -math.pi / 2)


def place(name: str) -> tuple[World, tuple[float, float]]:
    if name == "room":
        walls = np.array([[4, 0, 0, 0.1, 6, 9], [-3, 0, 0, 0.1, 6, 9], [0, 5, 0, 6, 0.1, 9], [0, -4, 0, 6, 0.1, 9.0]])
        pole = np.array([[2.0, 1.5, 0.3, 9.0]])
        world = World("room", np.zeros(2), np.array([1.0, 0.0]), (-9.0, -9.0, 9.0, 9.0), pole, walls, ())
        return world, (0.0, 0.0)
    world = load_world(name)
    return world, (float(world.start_ned_m[0]) + 8.0, float(world.start_ned_m[1]))


def looked(where: str, motion: Motion, mirrored: bool = False, offset_deg: float = 0.0) -> list[Inputs]:
    """Scans on the way, read by somebody who has the LiDAR mounted otherwise."""
    world, (north_m, east_m) = place(where)
    lidar = Lidar(world, LidarParams(sigma_m=0.02), seed=1)
    ticks = []
    for k in range(TICKS):
        share = k / (TICKS - 1)
        q = quaternion(0.0, 0.0, 0.3 + share * motion[2])
        pos = np.array([north_m + share * motion[0], east_m + share * motion[1], -1.0])
        state = VehicleState(k * 0.1, pos, np.zeros(3), q, np.zeros(3))
        scan = lidar.scan(k * 0.1, pos, q)
        last_rad = scan.angle_offset_rad + (len(scan.range_m) - 1) * scan.increment_rad
        first_rad = -last_rad if mirrored else scan.angle_offset_rad
        range_m = scan.range_m[::-1] if mirrored else scan.range_m
        offset_rad = math.radians(offset_deg)
        read = dataclasses.replace(
            scan, range_m=range_m, angle_offset_rad=first_rad + (offset_rad if mirrored else -offset_rad)
        )
        ticks.append(Inputs(state, read, ON_GROUND))
    return ticks


@pytest.mark.parametrize("where", ["room", "trajectory1", "trajectory2"])
def test_a_well_mounted_lidar_is_confirmed_as_far_as_the_motion_shows_it(where: str) -> None:
    for motion, hand_seen, offset_seen in ((STILL, 0, 0), (TURNED, 1, 0), (CARRIED, 0, 1), (BOTH, 1, 1)):
        seen = judge_orientation(looked(where, motion))
        assert (seen.fault, seen.hand_seen, seen.offset_seen) == (None, bool(hand_seen), bool(offset_seen))


@pytest.mark.parametrize("where", ["room", "trajectory2"])
@pytest.mark.parametrize("offset_deg", [0.0, 90.0, 180.0])
def test_a_mirrored_lidar_is_found_by_turning(where: str, offset_deg: float) -> None:
    for motion in (TURNED, BOTH):
        assert judge_orientation(looked(where, motion, mirrored=True, offset_deg=offset_deg)).fault is Fault.MIRRORED


@pytest.mark.parametrize("where", ["room", "trajectory2"])
@pytest.mark.parametrize("offset_deg", [45.0, 90.0, 180.0, -90.0])
def test_a_lidar_whose_zero_is_not_at_the_nose_is_found_by_carrying_it(where: str, offset_deg: float) -> None:
    for motion in (CARRIED, BOTH):
        seen = judge_orientation(looked(where, motion, offset_deg=offset_deg))
        assert seen.fault is Fault.TURNED
        off_deg = (math.degrees(seen.offset_rad) - offset_deg + 180.0) % 360.0 - 180.0
        assert abs(off_deg) <= 15.0


def test_an_open_field_shows_nothing() -> None:
    world = load_world("open")
    lidar = Lidar(world, LidarParams())
    ticks = []
    for k in range(TICKS):
        pos, q = np.array([k * 0.05, 0.0, -1.0]), quaternion(0.0, 0.0, k * 0.03)
        ticks.append(
            Inputs(VehicleState(k * 0.1, pos, np.zeros(3), q, np.zeros(3)), lidar.scan(k * 0.1, pos, q), ON_GROUND)
        )
    seen = judge_orientation(ticks)
    assert (seen.fault, seen.hand_seen, seen.offset_seen) == (None, False, False)
    assert judge_orientation([]).fault is None
