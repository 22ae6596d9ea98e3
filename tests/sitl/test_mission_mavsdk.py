"""Missions, fences and failures as a client of somebody else sees them: MAVSDK 4.1 over UDP."""

import asyncio
import math
from typing import Any

import pytest
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.plugins.failure import FailureError, FailureResult, FailureType, FailureUnit
from mavsdk.plugins.geofence import Circle, FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.mission import MissionItem, MissionPlan
from mavsdk.plugins.mission_raw import MissionItem as RawItem
from mavsdk_kit import Pilot, fly
from mission_kit import ORIGIN

SPEED = 8.0
Action = MissionItem.VehicleAction


def waypoint(north_m: float, east_m: float, height_m: float = 10.0, **more: Any) -> MissionItem:
    lat_deg, lon_deg = ORIGIN.lat_lon_deg(north_m, east_m)
    values = {
        "speed_m_s": 5.0,
        "is_fly_through": True,
        "gimbal_pitch_deg": math.nan,
        "gimbal_yaw_deg": math.nan,
        "camera_action": MissionItem.CameraAction.NONE,
        "loiter_time_s": math.nan,
        "camera_photo_interval_s": math.nan,
        "acceptance_radius_m": math.nan,
        "yaw_deg": math.nan,
        "camera_photo_distance_m": math.nan,
        "vehicle_action": Action.NONE,
    }
    return MissionItem(lat_deg, lon_deg, height_m, **{**values, **more})


def square(height_m: float = 10.0, **more: Any) -> list[MissionItem]:
    return [waypoint(n, e, height_m, **more) for n, e in ((0, 0), (20, 0), (20, 20), (0, 20))]


def raw(seq: int, command: int, north_m: float, east_m: float, height_m: float, kind: int = 0) -> RawItem:
    lat_deg, lon_deg = ORIGIN.lat_lon_deg(north_m, east_m)
    place = (round(lat_deg * 1e7), round(lon_deg * 1e7), height_m)
    return RawItem(seq, 6, command, int(seq == 0 and kind == 0), 1, 0.0, 0.0, 0.0, math.nan, *place, kind)


async def start(pilot: Pilot, mission: MissionAsync, items: list[MissionItem], returns: bool = True) -> None:
    """PX4's example: return after the mission, upload, arm, start."""
    await pilot.action.set_return_to_launch_altitude(12.0)
    await mission.set_return_to_launch_after_mission(returns)
    await mission.upload_mission(MissionPlan(items))
    await pilot.action.arm()
    await mission.start_mission()


def test_a_square_mission_is_flown_with_progress_and_the_vehicle_returns() -> None:
    async def story(pilot: Pilot) -> None:
        mission, away_m = MissionAsync(pilot.system), []
        progress: list[tuple[int, int]] = []

        async def follow() -> None:
            async for news in mission.subscribe_mission_progress():
                progress[len(progress) :] = [(news.current, news.total)]

        task = asyncio.create_task(follow())
        items = square(gimbal_pitch_deg=-60.0, gimbal_yaw_deg=10.0, camera_action=MissionItem.CameraAction.TAKE_PHOTO)
        await start(pilot, mission, items)
        await pilot.until(lambda: pilot.mode == "MISSION")
        while pilot.mode == "MISSION":
            if pilot.position_ned_m[2] < -9.0:
                away_m.append(outside_square(*pilot.position_ned_m[:2]))
            await asyncio.sleep(0.02)
        await pilot.until(lambda: pilot.mode == "RETURN_TO_LAUNCH")
        assert await mission.is_mission_finished()
        await pilot.until(lambda: not pilot.armed, 90.0)
        task.cancel()
        assert max(away_m) < 5.0
        assert math.dist(pilot.position_ned_m, (0.0, 0.0, 0.0)) < 1.0
        assert progress[-1] == (4, 4)
        assert [now for now, _ in progress] == sorted(now for now, _ in progress)

    fly(61, story, SPEED)


def outside_square(north_m: float, east_m: float) -> float:
    """Distance to the nearest leg of the square."""
    legs = (
        (abs(east_m), north_m),
        (abs(north_m - 20.0), east_m),
        (abs(east_m - 20.0), north_m),
    )
    return min(math.hypot(across, max(0.0, -along, along - 20.0)) for across, along in legs)


def test_a_mission_is_paused_resumed_jumped_and_cleared() -> None:
    async def story(pilot: Pilot) -> None:
        mission = MissionAsync(pilot.system)
        await start(pilot, mission, [waypoint(0, 0, 5), waypoint(60, 0, 5), waypoint(0, 6, 5)], returns=False)
        await pilot.until(lambda: pilot.position_ned_m[0] > 8.0)
        await mission.pause_mission()
        await pilot.until(lambda: pilot.mode == "HOLD")
        await asyncio.sleep(4.0 / SPEED)
        assert pilot.position_ned_m[0] < 30.0
        await mission.start_mission()
        await pilot.until(lambda: pilot.mode == "MISSION")
        await mission.set_current_mission_item(2)
        await pilot.until(lambda: "Mission finished, loitering" in pilot.texts)
        assert pilot.position_ned_m == pytest.approx((0.0, 6.0, -5.0), abs=4.0)  # reached at 2 m, seen late
        plan = await mission.download_mission()
        assert [item.relative_altitude_m for item in plan.mission_items] == [5.0, 5.0, 5.0]
        await mission.clear_mission()
        assert not (await mission.download_mission()).mission_items

    fly(62, story, SPEED)


def test_a_mission_that_takes_off_and_lands_ends_disarmed() -> None:
    async def story(pilot: Pilot) -> None:
        mission = MissionAsync(pilot.system)
        items = [
            waypoint(0, 0, 6, vehicle_action=Action.TAKEOFF),
            waypoint(10, 0, 6, loiter_time_s=1.0, is_fly_through=False),
            waypoint(10, 5, 6, vehicle_action=Action.LAND),
        ]
        await start(pilot, mission, items, returns=False)
        await pilot.until(lambda: pilot.landed == "LANDING")
        await pilot.until(lambda: not pilot.armed)
        assert pilot.position_ned_m == pytest.approx((10.0, 5.0, 0.0), abs=0.6)

    fly(63, story, SPEED)


def test_raw_missions_fences_and_rally_points_come_back_as_they_went() -> None:
    async def story(pilot: Pilot) -> None:
        plans = MissionRawAsync(pilot.system)
        mission = [raw(0, 22, 0, 0, 5), raw(1, 16, 10, 0, 5), raw(2, 16, 10, 5, 5)]
        rally = [raw(n, 5100, 5 * n, 0, 0, 2) for n in range(3)]
        await plans.upload_mission(mission)
        await plans.upload_rally_points(rally)
        back = await plans.download_mission()
        assert [(item.seq, item.command, item.x, item.y) for item in back] == [
            (item.seq, item.command, item.x, item.y) for item in mission
        ]
        assert [item.x for item in await plans.download_rallypoints()] == [item.x for item in rally]
        fence = GeofenceAsync(pilot.system)
        corners = [Point(*ORIGIN.lat_lon_deg(n, e)) for n, e in ((-50, -50), (50, -50), (50, 50), (-50, 50))]
        nowhere = Circle(Point(0.0, 0.0), 5.0, FenceType.INCLUSION)
        await fence.upload_geofence(GeofenceData([Polygon(corners, FenceType.INCLUSION)], [nowhere]))
        assert len(await plans.download_geofence()) == 5
        await pilot.until(lambda: "Geofence invalid, doesn't contain Home position" in pilot.texts)
        await fence.clear_geofence()
        assert not await plans.download_geofence()

    fly(64, story, 4.0)


def test_failures_are_refused_until_they_are_allowed_and_then_act() -> None:
    """PX4's case: rejected in mid-air while SYS_FAILURE_EN is 0."""

    async def story(pilot: Pilot) -> None:
        await pilot.action.set_takeoff_altitude(5.0)
        await pilot.action.arm()
        await pilot.action.takeoff()
        await pilot.until(lambda: pilot.mode == "HOLD" and pilot.position_ned_m[2] < -4.5)
        failure = FailureAsync(pilot.system)
        with pytest.raises(FailureError) as refused:
            await failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)
        assert refused.value.result in (FailureResult.DISABLED, FailureResult.DENIED)  # by itself, or by the vehicle
        await ParamAsync(pilot.system).set_param_int("SYS_FAILURE_EN", 1)
        await inject(pilot, FailureUnit.SENSOR_GPS, FailureType.OFF)
        await pilot.until(lambda: pilot.mode == "LAND")
        await pilot.until(lambda: not pilot.armed)
        assert "Failsafe activated" in pilot.texts

    fly(65, story, SPEED)


async def inject(pilot: Pilot, unit: Any, kind: Any) -> None:
    """MAVSDK asks for SYS_FAILURE_EN when the plugin is made, and does not wait for the answer."""
    failure = FailureAsync(pilot.system)
    await asyncio.sleep(0.3)
    await failure.inject(unit, kind, 0)


@pytest.mark.slow
def test_a_breached_fence_sends_the_vehicle_home() -> None:
    async def story(pilot: Pilot) -> None:
        param, fence = ParamAsync(pilot.system), GeofenceAsync(pilot.system)
        await param.set_param_int("GF_ACTION", 3)
        await param.set_param_float("COM_FAIL_ACT_T", 0.0)
        await pilot.action.set_return_to_launch_altitude(8.0)
        here = Point(ORIGIN.lat_deg, ORIGIN.lon_deg)
        await fence.upload_geofence(GeofenceData([], [Circle(here, 15.0, FenceType.INCLUSION)]))
        await pilot.action.set_takeoff_altitude(5.0)
        await pilot.action.arm()
        await pilot.action.takeoff()
        await pilot.until(lambda: pilot.mode == "HOLD" and pilot.position_ned_m[2] < -4.5)
        lat_deg, lon_deg = ORIGIN.lat_lon_deg(40.0, 0.0)
        await pilot.action.goto_location(lat_deg, lon_deg, ORIGIN.alt_amsl_m + 5.0, 0.0)
        await pilot.until(lambda: pilot.mode == "RETURN_TO_LAUNCH")
        assert "Geofence: approaching or outside geofence" in pilot.texts
        await pilot.until(lambda: not pilot.armed)
        assert math.hypot(*pilot.position_ned_m[:2]) < 1.0

    fly(66, story, SPEED)


# --- PX4's own SITL suite, the longer cases -------------------------------------------------------------------------


@pytest.mark.slow
def test_px4_takeoff_and_hold_position() -> None:
    async def story(pilot: Pilot) -> None:
        await pilot.action.set_takeoff_altitude(10.0)
        await pilot.action.arm()
        await pilot.action.takeoff()
        await pilot.until(lambda: pilot.mode == "HOLD" and pilot.landed == "IN_AIR")
        await asyncio.sleep(2.0 / SPEED)
        for _ in range(int(60.0 / SPEED / 0.02)):
            assert abs(pilot.position_ned_m[2] + 10.0) < 0.1
            assert math.hypot(*pilot.position_ned_m[:2]) < 0.5
            await asyncio.sleep(0.02)
        await pilot.action.land()
        await pilot.until(lambda: not pilot.armed, 90.0)

    fly(67, story, SPEED)


@pytest.mark.slow
@pytest.mark.parametrize("height_m", [10.0, 20.0])
def test_px4_fly_square_mission_with_manual_return(height_m: float) -> None:
    async def story(pilot: Pilot) -> None:
        mission = MissionAsync(pilot.system)
        await start(pilot, mission, square(height_m), returns=False)
        await pilot.until(lambda: pilot.mode == "MISSION")
        await pilot.until(lambda: pilot.mode == "HOLD", 120.0)
        assert await mission.is_mission_finished()
        await pilot.action.return_to_launch()
        await pilot.until(lambda: not pilot.armed, 120.0)
        assert math.hypot(*pilot.position_ned_m[:2]) < 1.0

    fly(68, story, SPEED)


@pytest.mark.slow
def test_px4_fly_straight_mission() -> None:
    async def story(pilot: Pilot) -> None:
        mission = MissionAsync(pilot.system)
        await start(pilot, mission, [waypoint(n, 0, 6) for n in (0, 20, 40, 60)], returns=False)
        await pilot.until(lambda: pilot.position_ned_m[0] > 2.0)
        while pilot.mode == "MISSION":
            assert abs(pilot.position_ned_m[1]) < 1.0
            assert abs(pilot.position_ned_m[2] + 6.0) < 1.0
            await asyncio.sleep(0.02)
        assert pilot.position_ned_m[0] > 55.0

    fly(69, story, SPEED)
