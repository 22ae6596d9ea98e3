"""PX4's own SITL suite (test/mavsdk_tests) for multicopters, told anew with MAVSDK 4.1 and its tolerances.

Elsewhere: take-off and hold, missions, refused failures (test_mission_mavsdk), sensor losses (test_failsafes), sticks
(test_client_steering). Its cases of control allocation fly a hexarotor with one or two motors off; a quadrotor cannot.
What does not depend on the rotors is here: the failure is found, and its action is carried out.
"""

import asyncio
import math
from itertools import count

import pytest
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.follow_me import FollowMeAsync
from mavsdk.asyncio.plugins.manual_control import ManualControlAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.failure import FailureType, FailureUnit
from mavsdk.plugins.follow_me import Config, TargetLocation
from mavsdk.plugins.offboard import Attitude, PositionNedYaw, VelocityNedYaw
from mavsdk_kit import Pilot, fly

from sitl.geo import Origin

INSTANCES = count(43)
SPEED = 4.0
ORIGIN = Origin()
RADIUS_M = 0.3
NAN = math.nan


async def seconds(sim_s: float) -> None:
    """Vehicle time passes."""
    await asyncio.sleep(sim_s / SPEED)


async def climb(pilot: Pilot, height_m: float) -> None:
    """Take off and hover."""
    await pilot.action.set_takeoff_altitude(height_m)
    await pilot.action.arm()
    await pilot.action.takeoff()
    await pilot.until(lambda: pilot.mode == "HOLD" and pilot.position_ned_m[2] < 0.5 - height_m, 60.0)


async def goto(pilot: Pilot, offboard: OffboardAsync, target: PositionNedYaw, limit_s: float) -> None:
    """OFFBOARD to a place, in vehicle seconds."""
    await offboard.set_position_ned(target)
    await offboard.start()
    place = (target.north_m, target.east_m, target.down_m)
    await pilot.until(lambda: math.dist(pilot.position_ned_m, place) < RADIUS_M, limit_s / SPEED)


async def come_down(pilot: Pilot, offboard: OffboardAsync) -> None:
    """Down at 1 m/s until it disarms itself, near home."""
    await offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 1.0, 0.0))
    await pilot.until(lambda: not pilot.armed, 120.0 / SPEED)
    assert math.hypot(*pilot.position_ned_m[:2]) < 2.0


@pytest.mark.slow
def test_offboard_takeoff_and_land() -> None:
    async def story(pilot: Pilot) -> None:
        offboard = OffboardAsync(pilot.system)
        await pilot.action.arm()
        await goto(pilot, offboard, PositionNedYaw(0.0, 0.0, -2.0, 0.0), 90.0)
        await come_down(pilot, offboard)

    fly(next(INSTANCES), story, SPEED)


def test_offboard_position_control() -> None:
    async def story(pilot: Pilot) -> None:
        offboard = OffboardAsync(pilot.system)
        await pilot.action.arm()
        legs = [(0, 0, -2, 0), (0, 5, -2, 180), (5, 5, -4, 180), (5, 0, -4, 90), (0, 0, -2, 0)]
        for leg in legs:
            await goto(pilot, offboard, PositionNedYaw(*map(float, leg)), 10.0)
        await come_down(pilot, offboard)

    fly(next(INSTANCES), story, SPEED)


def test_offboard_attitude_control() -> None:
    async def story(pilot: Pilot) -> None:
        offboard = OffboardAsync(pilot.system)
        angles = [0.0, 0.0]

        async def watch() -> None:
            async for euler in pilot.telemetry.subscribe_attitude_euler():
                angles[:] = [euler.roll_deg, euler.pitch_deg]

        watching = asyncio.create_task(watch())
        await offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 0.0))
        await offboard.start()
        await pilot.action.arm()
        await offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 0.8))
        await pilot.until(lambda: pilot.position_ned_m[2] < -10.0, 30.0 / SPEED)
        await offboard.set_attitude(Attitude(0.0, -20.0, 0.0, 0.8))
        await seconds(3.0)
        roll_deg, pitch_deg = angles
        assert abs(roll_deg) < 5.0
        assert abs(pitch_deg + 20.0) < 5.0
        assert pilot.position_ned_m[0] > 3.0
        await offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 0.4))
        await seconds(6.0)
        await offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 0.0))
        await pilot.until(lambda: not pilot.armed, 120.0 / SPEED)
        watching.cancel()

    fly(next(INSTANCES), story, SPEED)


def config(angle_deg: float) -> Config:
    return Config(10.0, 8.0, 0.1, Config.FollowAltitudeMode.CONSTANT, 15.0, angle_deg)


@pytest.mark.slow
@pytest.mark.parametrize("with_velocity", [False, True])
def test_follow_target_from_every_side(with_velocity: bool) -> None:
    """The target walks north at 1.5 m/s; its place comes once a second."""
    pace_m_s = 1.5

    async def story(pilot: Pilot) -> None:
        follow = FollowMeAsync(pilot.system)
        await climb(pilot, 10.0)
        await follow.start()
        north_m = 0.0
        velocity = (pace_m_s, 0.0, 0.0) if with_velocity else (NAN, NAN, NAN)
        for angle_deg in (180.0, 0.0, 45.0, -45.0):
            await follow.set_config(config(angle_deg))
            for second in range(15):
                north_m += pace_m_s
                lat_deg, lon_deg = ORIGIN.lat_lon_deg(north_m, 0.0)
                await follow.set_target_location(TargetLocation(lat_deg, lon_deg, ORIGIN.alt_m(0.0), *velocity))
                await seconds(1.0)
                if second > 10:
                    check(pilot, north_m, angle_deg)
        await follow.stop()

    fly(next(INSTANCES), story, SPEED)


def check(pilot: Pilot, target_north_m: float, angle_deg: float) -> None:
    """PX4's tolerances: 11 m aside, and 1 m of height; its angle is checked as a place."""
    north_m, east_m, down_m = pilot.position_ned_m
    angle_rad = math.radians(angle_deg)
    wanted = (target_north_m + 8.0 * math.cos(angle_rad), 8.0 * math.sin(angle_rad))
    assert math.dist((north_m, east_m), wanted) < 11.0
    assert abs(down_m + 10.0) < 1.0


def test_follow_target_without_a_place_stays_where_it_is() -> None:
    async def story(pilot: Pilot) -> None:
        follow = FollowMeAsync(pilot.system)
        await climb(pilot, 5.0)
        await follow.set_config(config(180.0))
        await follow.start()
        await pilot.until(lambda: pilot.mode == "FOLLOW_ME")
        before = pilot.position_ned_m
        for _ in range(5):
            await follow.set_target_location(TargetLocation(NAN, NAN, NAN, 2.0, 1.0, 0.5))
            await seconds(1.0)
        assert math.dist(before[:2], pilot.position_ned_m[:2]) < 4.0
        assert pilot.mode == "FOLLOW_ME"
        await follow.stop()

    fly(next(INSTANCES), story, SPEED)


@pytest.mark.slow
def test_follow_target_adjusted_by_sticks() -> None:
    """Each stick at its stop for 3 s changes at least half of what it is to change."""

    async def story(pilot: Pilot) -> None:
        follow, manual = FollowMeAsync(pilot.system), ManualControlAsync(pilot.system)
        sticks = [0.0, 0.0, 0.5, 0.0]

        async def stream() -> None:
            while True:
                await follow.set_target_location(TargetLocation(*place, ORIGIN.alt_m(0.0), 0.0, 0.0, 0.0))
                await manual.set_manual_control_input(*sticks)
                await asyncio.sleep(0.02)

        async def push(*deflected: float) -> None:
            sticks[:] = deflected
            await seconds(3.0)
            sticks[:] = [0.0, 0.0, 0.5, 0.0]
            await seconds(3.0)

        place = ORIGIN.lat_lon_deg(0.0, 0.0)
        await ParamAsync(pilot.system).set_param_float("COM_RC_LOSS_T", 5.0)
        await climb(pilot, 10.0)
        await follow.set_config(Config(10.0, 10.0, 0.1, Config.FollowAltitudeMode.CONSTANT, 5.0, 0.0))
        await follow.start()
        streaming = asyncio.create_task(stream())
        await pilot.until(lambda: abs(math.hypot(*pilot.position_ned_m[:2]) - 10.0) < 0.5)
        down_m = pilot.position_ned_m[2]
        await push(0.0, 0.0, 1.0, 0.0)
        assert down_m - pilot.position_ned_m[2] > 1.5 * 3.0 / 2
        await push(1.0, 0.0, 0.5, 0.0)
        assert math.hypot(*pilot.position_ned_m[:2]) > 10.0 + 2.0 * 3.0 / 2
        before_rad = math.atan2(pilot.position_ned_m[1], pilot.position_ned_m[0])
        await push(0.0, 1.0, 0.5, 0.0)
        after_rad = math.atan2(pilot.position_ned_m[1], pilot.position_ned_m[0])
        assert (after_rad - before_rad) % math.tau > 5.0 / 16.0 * 3.0 / 2
        assert pilot.mode == "FOLLOW_ME"
        streaming.cancel()
        await follow.stop()

    fly(next(INSTANCES), story, SPEED)


@pytest.mark.slow
def test_a_failure_is_rejected_in_mid_air_while_it_is_not_enabled() -> None:
    async def story(pilot: Pilot) -> None:
        await climb(pilot, 3.0)
        with pytest.raises(Exception, match=r"DISABLED|DENIED"):
            await FailureAsync(pilot.system).inject(FailureUnit.SYSTEM_MOTOR, FailureType.OFF, 1)
        await pilot.action.return_to_launch()
        await pilot.until(lambda: not pilot.armed, 180.0 / SPEED)
        assert "Motor failure detected" not in pilot.texts

    fly(next(INSTANCES), story, SPEED)


async def stop_motor(pilot: Pilot, action: int) -> None:
    """COM_ACT_FAIL_ACT, then motor 1 fails at a height of 20 m."""
    param = ParamAsync(pilot.system)
    await param.set_param_int("SYS_FAILURE_EN", 1)
    await param.set_param_int("COM_ACT_FAIL_ACT", action)
    await climb(pilot, 20.0)
    failure = FailureAsync(pilot.system)
    await asyncio.sleep(0.3)  # MAVSDK asks for SYS_FAILURE_EN when the plugin is made
    await failure.inject(FailureUnit.SYSTEM_MOTOR, FailureType.OFF, 1)
    await pilot.until(lambda: "Motor failure detected" in pilot.texts, 5.0)
    await pilot.until(lambda: "Failsafe activated" in pilot.texts, 5.0)


def test_a_motor_failure_terminates_the_flight_where_it_is_told_to() -> None:
    async def story(pilot: Pilot) -> None:
        await stop_motor(pilot, 4)
        fall_s = 2.0 + math.sqrt(20.0 * 2.0 / 10.0)
        await pilot.until(lambda: not pilot.armed, fall_s)  # PX4's wall time: only a fall is quick enough

    fly(next(INSTANCES), story, SPEED)


@pytest.mark.slow
def test_a_motor_failure_is_only_said_by_default() -> None:
    async def story(pilot: Pilot) -> None:
        await stop_motor(pilot, 0)
        assert pilot.mode == "HOLD"

    fly(next(INSTANCES), story, SPEED)
