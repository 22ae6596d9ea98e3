"""A client flies: goto, orbit, offboard in every frame, sticks, follow me. MAVSDK and pymavlink over UDP."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

import pytest
from mavsdk.asyncio.plugins.follow_me import FollowMeAsync
from mavsdk.asyncio.plugins.manual_control import ManualControlAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.action import OrbitYawBehavior
from mavsdk.plugins.follow_me import Config, TargetLocation
from mavsdk.plugins.offboard import (
    Attitude,
    AttitudeRate,
    PositionGlobalYaw,
    PositionNedYaw,
    VelocityBodyYawspeed,
    VelocityNedYaw,
)
from mavsdk_kit import Pilot, fly, vehicle
from pymavlink.dialects.v20 import common as mav
from raw_kit import Raw

from sitl.geo import Origin
from sitl.modes import FlightMode

INSTANCE = 251
ORIGIN = Origin()
SPEED = 4.0


def near(pilot: Pilot, north_m: float, east_m: float, down_m: float, radius_m: float = 0.5) -> Callable[[], bool]:
    return lambda: math.dist(pilot.position_ned_m, (north_m, east_m, down_m)) < radius_m


async def climb(pilot: Pilot) -> None:
    """Take off and hold."""
    await pilot.action.set_takeoff_altitude(5.0)
    await pilot.action.arm()
    await pilot.action.takeoff()
    await pilot.until(lambda: pilot.mode == "HOLD" and pilot.position_ned_m[2] < -4.5)


def test_goto_orbit_and_return() -> None:
    async def story(pilot: Pilot) -> None:
        await climb(pilot)
        lat_deg, lon_deg = ORIGIN.lat_lon_deg(10.0, -6.0)
        await pilot.action.goto_location(lat_deg, lon_deg, ORIGIN.alt_m(-8.0), 90.0)
        await pilot.until(near(pilot, 10.0, -6.0, -8.0))
        await pilot.action.set_current_speed(2.0)
        centre = ORIGIN.lat_lon_deg(0.0, 0.0)
        behaviour = OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
        await pilot.action.do_orbit(6.0, 3.0, behaviour, *centre, ORIGIN.alt_m(-7.0))
        await pilot.until(near(pilot, 6.0, 0.0, -7.0, 1.0))
        assert pilot.mode not in ("HOLD", "OFFBOARD")
        await pilot.until(near(pilot, 0.0, 6.0, -7.0, 1.0))  # clockwise
        await pilot.until(near(pilot, -6.0, 0.0, -7.0, 1.0))
        await pilot.action.return_to_launch()
        await pilot.until(lambda: not pilot.armed, 90.0)
        assert math.hypot(*pilot.position_ned_m[:2]) < 0.5

    fly(INSTANCE, story, SPEED)


def test_offboard_by_position_velocity_globe_attitude_and_rates() -> None:
    async def story(pilot: Pilot) -> None:
        offboard = OffboardAsync(pilot.system)
        await pilot.action.arm()
        await offboard.set_position_ned(PositionNedYaw(0.0, 0.0, -4.0, 0.0))
        await offboard.start()
        await pilot.until(near(pilot, 0.0, 0.0, -4.0))
        await offboard.set_velocity_body(VelocityBodyYawspeed(2.0, 0.0, 0.0, 0.0))
        await pilot.until(lambda: pilot.position_ned_m[0] > 5.0)
        await offboard.set_velocity_ned(VelocityNedYaw(0.0, 2.0, 0.0, 90.0))
        await pilot.until(lambda: pilot.position_ned_m[1] > 5.0)
        lat_deg, lon_deg = ORIGIN.lat_lon_deg(2.0, 1.0)
        height = PositionGlobalYaw.AltitudeType.REL_HOME
        await offboard.set_position_global(PositionGlobalYaw(lat_deg, lon_deg, 6.0, 0.0, height))
        await pilot.until(near(pilot, 2.0, 1.0, -6.0))
        await offboard.set_attitude(Attitude(0.0, 0.0, 0.0, 0.6))
        await pilot.until(lambda: pilot.position_ned_m[2] < -9.0)
        await offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 30.0, 0.454))
        await asyncio.sleep(0.5)
        assert pilot.mode == "OFFBOARD"
        await offboard.stop()
        await pilot.until(lambda: pilot.mode == "HOLD")
        await pilot.action.kill()
        await pilot.until(lambda: not pilot.armed)

    fly(INSTANCE + 1, story, SPEED)


def test_a_joystick_flies_position_and_altitude_and_its_loss_lands() -> None:
    async def story(pilot: Pilot) -> None:
        manual = ManualControlAsync(pilot.system)
        await ParamAsync(pilot.system).set_param_int("NAV_RCL_ACT", 3)
        sticks = [0.0, 0.0, 0.5, 0.0]

        async def hands() -> None:
            while True:
                await manual.set_manual_control_input(*sticks)
                await asyncio.sleep(0.02)

        moving = asyncio.create_task(hands())
        await asyncio.sleep(0.1)
        await manual.start_position_control()
        await pilot.until(lambda: pilot.mode == "POSCTL")
        await pilot.action.arm()
        sticks[2] = 0.9
        await pilot.until(lambda: pilot.position_ned_m[2] < -4.0)
        sticks[:] = [0.6, 0.0, 0.5, 0.0]
        await pilot.until(lambda: pilot.position_ned_m[0] > 6.0)
        sticks[:] = [0.0, 0.6, 0.5, 0.0]
        await pilot.until(lambda: pilot.position_ned_m[1] > 6.0)
        sticks[:] = [0.0, 0.0, 0.5, 0.0]
        await asyncio.sleep(1.0)
        here = pilot.position_ned_m
        await asyncio.sleep(1.0)
        assert math.dist(here, pilot.position_ned_m) < 0.3, "let go, it stays"
        await manual.start_altitude_control()
        await pilot.until(lambda: pilot.mode == "ALTCTL")
        moving.cancel()
        await pilot.until(lambda: "Manual control lost" in pilot.texts and pilot.mode == "LAND")
        await pilot.until(lambda: not pilot.armed, 90.0)

    fly(INSTANCE + 2, story, SPEED)


def test_a_stick_takes_over_from_hold() -> None:
    with vehicle(INSTANCE + 3, SPEED):
        raw = Raw(14550 + INSTANCE + 3).ready()
        raw.take_off(3.0)
        for x in (0, 0, 700, 700):
            raw.link.mav.manual_control_send(1, x, 0, 500, 0, 0)
        raw.mode(FlightMode.POSCTL, 5.0)
        raw.close()


def test_follow_me_keeps_its_place_behind_the_target() -> None:
    async def story(pilot: Pilot) -> None:
        follow = FollowMeAsync(pilot.system)
        await climb(pilot)
        await follow.set_config(Config(8.0, 5.0, 0.1, Config.FollowAltitudeMode.CONSTANT, 5.0, 180.0))
        await follow.start()
        await pilot.until(lambda: pilot.mode == "FOLLOW_ME")
        for step in range(12):
            north_m = 1.0 + step
            lat_deg, lon_deg = ORIGIN.lat_lon_deg(north_m, 3.0)
            await follow.set_target_location(TargetLocation(lat_deg, lon_deg, ORIGIN.alt_m(0.0), 1.0, 0.0, 0.0))
            await asyncio.sleep(0.25)
        await pilot.until(near(pilot, 12.0 - 5.0, 3.0, -8.0, 2.5))
        await follow.stop()
        await pilot.until(lambda: pilot.mode == "HOLD")

    fly(INSTANCE + 4, story, 2.0)


@pytest.mark.parametrize(("frame", "down_m"), [(5, -6.0), (6, -6.0), (11, -6.0)])
def test_global_setpoints_in_every_frame(frame: int, down_m: float) -> None:
    with vehicle(INSTANCE + 5, SPEED):
        raw = Raw(14550 + INSTANCE + 5).ready()
        lat_deg, lon_deg = ORIGIN.lat_lon_deg(4.0, 0.0)
        alt_m = ORIGIN.alt_m(down_m) if frame == 5 else -down_m
        where = (round(lat_deg * 1e7), round(lon_deg * 1e7), alt_m)

        def stream(message: Any) -> bool:
            raw.link.mav.set_position_target_global_int_send(0, 1, 0, frame, 2552, *where, *[0] * 8)
            return math.dist((message.x, message.y, message.z), (4.0, 0.0, down_m)) < 0.5

        raw.position(lambda m: stream(m) or True)
        assert raw.command(mav.MAV_CMD_DO_SET_MODE, 1, 6) == 0
        assert raw.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        raw.position(stream)
        raw.close()
