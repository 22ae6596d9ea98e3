"""How does a client fly by PX4's own modes? Take-off, goto, orbit, sticks, Follow Me, no GPS, and the log of it all."""

import asyncio
import math
from pathlib import Path

from conversations.client import Vehicle, finish, kinds
from conversations.conversation import Conversation

HEIGHT_M = 4.0
STICK_PERIOD_S = 0.05


async def it_takes_off_and_lands(vehicle: Vehicle) -> None:
    began = vehicle.place_ned_m
    await vehicle.airborne(HEIGHT_M)
    assert vehicle.landed == "IN_AIR"
    await vehicle.down()
    assert math.dist(began, vehicle.place_ned_m) < 1.0


async def it_tells_its_height_its_mode_and_whether_it_flies(vehicle: Vehicle) -> None:
    heights, modes, air = list[int](), list[str](), list[bool]()

    async def look_at_height() -> None:
        async for position in vehicle.telemetry.position():
            heights.append(round(position.relative_altitude_m))

    async def look_at_mode() -> None:
        async for mode in vehicle.telemetry.flight_mode():
            modes.append(mode.name)

    async def look_at_air() -> None:
        async for flies in vehicle.telemetry.in_air():
            air.append(flies)
            if not flies and True in air:
                return

    looking = [asyncio.create_task(look()) for look in (look_at_height, look_at_mode)]
    landed = asyncio.create_task(look_at_air())
    await vehicle.airborne(HEIGHT_M)
    await vehicle.down()
    await asyncio.wait_for(landed, 20.0)
    for task in looking:
        task.cancel()
    assert max(heights) == round(HEIGHT_M)
    assert heights[-1] == 0
    assert [mode for mode in dict.fromkeys(modes) if mode != "HOLD"] == ["TAKEOFF", "LAND"]


async def the_log_of_a_flight_is_downloaded(vehicle: Vehicle) -> None:
    logs = await vehicle.log_files.get_entries()
    assert logs, "one for each time it was armed"
    copy = Path("copy.ulg").resolve()
    await finish(vehicle.log_files.download_log_file(logs[0], str(copy)))
    assert copy.read_bytes().startswith(b"ULog")
    assert copy.stat().st_size == logs[0].size_bytes


async def it_goes_to_a_place(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    altitude_m = vehicle.home.absolute_altitude_m + 8.0
    await vehicle.action.goto_location(*vehicle.lat_lon_deg(8.0, -6.0), altitude_m, 90.0)
    await vehicle.near(8.0, -6.0, -8.0)


async def it_orbits_and_returns(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    inwards = kinds("action").OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER
    altitude_m = vehicle.home.absolute_altitude_m + 7.0
    await vehicle.action.do_orbit(6.0, 3.0, inwards, *vehicle.lat_lon_deg(0.0, 0.0), altitude_m)
    await vehicle.near(6.0, 0.0, -7.0, 1.5)
    await vehicle.near(0.0, 6.0, -7.0, 1.5)
    await vehicle.near(-6.0, 0.0, -7.0, 1.5)
    await vehicle.action.set_return_to_launch_altitude(8.0)
    await vehicle.action.return_to_launch()
    await vehicle.until(lambda: not vehicle.armed)
    assert vehicle.from_home_m() < 1.0


async def it_is_flown_by_sticks(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    manual, sticks = vehicle.manual_control, [0.0, 0.0, 0.5, 0.0]

    async def hold_sticks() -> None:
        while True:
            await manual.set_manual_control_input(*sticks)
            await asyncio.sleep(STICK_PERIOD_S)

    holding = asyncio.create_task(hold_sticks())
    await asyncio.sleep(4 * STICK_PERIOD_S)
    await manual.start_position_control()
    await vehicle.until(lambda: vehicle.mode == "POSCTL")
    north_m, east_m, _ = vehicle.place_ned_m
    sticks[:] = [0.7, 0.0, 0.5, 0.0]
    await vehicle.until(lambda: vehicle.place_ned_m[0] > north_m + 5.0)
    sticks[:] = [0.0, -0.7, 0.5, 0.0]
    await vehicle.until(lambda: vehicle.place_ned_m[1] < east_m - 5.0)
    holding.cancel()
    await manual.set_manual_control_input(0.0, 0.0, 0.5, 0.0)  # a stick that moves after "hold" would take over again
    await vehicle.action.hold()
    await vehicle.until(lambda: vehicle.mode == "HOLD")


async def it_follows_somebody(vehicle: Vehicle) -> None:
    follow, config = vehicle.follow_me, kinds("follow_me").Config
    await follow.set_config(config(8.0, 2.0, 0.02, config.FollowAltitudeMode.TARGET_GPS, 10.0, 0.0))
    await vehicle.airborne(HEIGHT_M)
    await follow.start()
    await vehicle.until(lambda: vehicle.mode == "FOLLOW_ME")
    for north_m, east_m in ((5.0, 10.0), (-5.0, 10.0)):
        lat_deg, lon_deg = vehicle.lat_lon_deg(north_m, east_m)
        altitude_m = vehicle.home.absolute_altitude_m
        where = kinds("follow_me").TargetLocation(lat_deg, lon_deg, altitude_m, 0.0, 0.0, 0.0)
        await follow.set_target_location(where)
        await vehicle.until(lambda: math.dist(vehicle.place_ned_m[:2], (north_m, east_m)) < 3.5)  # noqa: B023
    await vehicle.until(lambda: abs(vehicle.place_ned_m[2] + 8.0) < 1.0)
    await follow.stop()
    await vehicle.until(lambda: vehicle.mode == "HOLD")


async def it_comes_down_without_gps(vehicle: Vehicle) -> None:
    await vehicle.param.set_param_int("SYS_FAILURE_EN", 1)
    await vehicle.airborne(HEIGHT_M)
    unit, kind = kinds("failure").FailureUnit.SENSOR_GPS, kinds("failure").FailureType
    inject = vehicle.failure.inject
    await asyncio.sleep(0.3)  # the client asks for SYS_FAILURE_EN when it makes the plugin
    await inject(unit, kind.OFF, 0)
    await vehicle.until(lambda: vehicle.mode != "HOLD" and any("ailsafe" in text for text in vehicle.texts))
    await vehicle.until(lambda: not vehicle.armed)
    await inject(unit, kind.OK, 0)
    await vehicle.param.set_param_int("SYS_FAILURE_EN", 0)


CONVERSATIONS = (
    Conversation(it_takes_off_and_lands, ("takeoff_and_land.py", "asyncio/takeoff_and_land.py")),
    Conversation(it_tells_its_height_its_mode_and_whether_it_flies, ("telemetry_takeoff_and_land.py",)),
    Conversation(the_log_of_a_flight_is_downloaded, ("logfile_download.py",)),
    Conversation(it_goes_to_a_place, ("goto.py",)),
    Conversation(it_orbits_and_returns, ("do_orbit.py",)),
    Conversation(it_is_flown_by_sticks, ("manual_control.py",)),
    Conversation(it_follows_somebody, ("follow_me_example.py",)),
    Conversation(it_comes_down_without_gps, ("failure_injection.py",)),
)
