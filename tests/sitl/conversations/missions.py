"""How does a client plan? Missions by item and raw, a plan file, a fence, rally points; flown, paused, resumed."""

import asyncio
import json
import math
from pathlib import Path
from typing import Any

from conversations.client import NATIVE, Vehicle, first, kinds, refusal
from conversations.conversation import Conversation

HEIGHT_M = 4.0
TAKE_OFF, WAYPOINT, RALLY, RELATIVE = 22, 16, 5100, 6
CORNER, CIRCLE = 5001, 5003  # of a fence
PLACES_M = ((0.0, 0.0), (15.0, 0.0), (15.0, 10.0))
RALLIES_M = ((5.0, 12.0), (-5.0, 12.0))


def item(vehicle: Vehicle, north_m: float, east_m: float, **more: Any) -> Any:
    """A waypoint that is flown through at 6 m/s."""
    kind = kinds("mission").MissionItem
    values = {
        "speed_m_s": 6.0,
        "is_fly_through": True,
        "gimbal_pitch_deg": math.nan,
        "gimbal_yaw_deg": math.nan,
        "camera_action": kind.CameraAction.NONE,
        "loiter_time_s": math.nan,
        "camera_photo_interval_s": math.nan,
        "acceptance_radius_m": math.nan,
        "yaw_deg": math.nan,
        "camera_photo_distance_m": math.nan,
        "vehicle_action": kind.VehicleAction.NONE,
    }
    return kind(*vehicle.lat_lon_deg(north_m, east_m), HEIGHT_M, **{**values, **more})


def raw(vehicle: Vehicle, seq: int, command: int, north_m: float, kind: int = 0) -> Any:
    """An item as it goes over the wire."""
    lat_deg, lon_deg = vehicle.lat_lon_deg(north_m, 0.0)
    place = (round(lat_deg * 1e7), round(lon_deg * 1e7), HEIGHT_M)
    current = int(seq == 0 and kind == 0)
    return kinds("mission_raw").MissionItem(seq, RELATIVE, command, current, 1, 0.0, 0.0, 0.0, math.nan, *place, kind)


async def raw_items_come_back_as_they_went(vehicle: Vehicle) -> None:
    sent = [raw(vehicle, seq, WAYPOINT if seq else TAKE_OFF, 10.0 * seq) for seq in range(22)]
    changed = asyncio.create_task(first(vehicle.mission_raw.mission_changed(), limit_s=20.0))
    await asyncio.sleep(0.1)
    await vehicle.mission_raw.upload_mission(sent)
    assert await changed
    back = await vehicle.mission_raw.download_mission()
    assert [(one.command, one.x, one.y) for one in back] == [(one.command, one.x, one.y) for one in sent]
    await vehicle.mission_raw.clear_mission()
    assert not await vehicle.mission_raw.download_mission()


async def a_plan_file_is_imported_with_its_rally_points(vehicle: Vehicle) -> None:
    plan = Path("of_the_ground_station.plan").resolve()
    plan.write_text(json.dumps(plan_of(vehicle)), encoding="utf-8")
    out = await vehicle.mission_raw.import_qgroundcontrol_mission(str(plan))
    assert (len(out.mission_items), len(out.rally_items)) == (3, 2)
    await vehicle.mission_raw.upload_mission(out.mission_items)
    await vehicle.mission_raw.upload_rally_points(out.rally_items)
    assert [one.command for one in await vehicle.mission_raw.download_rallypoints()] == [RALLY, RALLY]
    assert len(await vehicle.mission_raw.download_mission()) == 3


def plan_of(vehicle: Vehicle) -> dict[str, Any]:
    """QGroundControl's file format."""
    home = [vehicle.home.latitude_deg, vehicle.home.longitude_deg, vehicle.home.absolute_altitude_m]
    items = [
        {
            "type": "SimpleItem",
            "command": WAYPOINT if number else TAKE_OFF,
            "frame": 3,
            "autoContinue": True,
            "doJumpId": number + 1,
            "params": [0, 0, 0, None, *vehicle.lat_lon_deg(*place), HEIGHT_M],
        }
        for number, place in enumerate(PLACES_M)
    ]
    mission = {"version": 2, "firmwareType": 12, "vehicleType": 2, "cruiseSpeed": 15, "hoverSpeed": 5}
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {**mission, "globalPlanAltitudeMode": 1, "plannedHomePosition": home, "items": items},
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": [[*vehicle.lat_lon_deg(*place), 20.0] for place in RALLIES_M]},
    }


async def a_fence_with_a_circle_of_no_size_is_taken(vehicle: Vehicle) -> None:
    module = kinds("geofence")
    corners = [module.Point(*vehicle.lat_lon_deg(*at)) for at in ((-99, -99), (99, -99), (99, 99), (-99, 99))]
    polygon = module.Polygon(corners, module.FenceType.INCLUSION)
    nowhere = module.Circle(module.Point(0.0, 0.0), 0.0, module.FenceType.INCLUSION)
    if NATIVE:  # this client wants a size, so the circle goes as it is
        said = await refusal("geofence", vehicle.geofence.upload_geofence(module.GeofenceData([polygon], [nowhere])))
        assert "INVALID_ARGUMENT" in said
        await vehicle.mission_raw.upload_geofence(fence_of(corners))
    else:
        await vehicle.geofence.upload_geofence(module.GeofenceData([polygon], [nowhere]))
    assert len(await vehicle.mission_raw.download_geofence()) == 5
    await vehicle.geofence.clear_geofence()
    assert not await vehicle.mission_raw.download_geofence()


def fence_of(corners: list[Any]) -> list[Any]:
    """A polygon and a circle of no size, as they go over the wire."""
    kind = kinds("mission_raw").MissionItem
    places = [
        (CORNER, float(len(corners)), round(at.latitude_deg * 1e7), round(at.longitude_deg * 1e7)) for at in corners
    ]
    return [
        kind(seq, 5, command, 0, 1, size, 0.0, 0.0, 0.0, x, y, 0.0, 1)
        for seq, (command, size, x, y) in enumerate([*places, (CIRCLE, 0.0, 0, 0)])
    ]


async def a_mission_with_speeds_is_flown_and_ends_at_the_nearest_rally_point(vehicle: Vehicle) -> None:
    mission, progress = vehicle.mission, list[tuple[int, int]]()

    async def look() -> None:
        async for news in mission.mission_progress():
            progress.append((news.current, news.total))

    looking = asyncio.create_task(look())
    await vehicle.action.set_return_to_launch_altitude(HEIGHT_M)
    await mission.set_return_to_launch_after_mission(True)
    await mission.upload_mission(kinds("mission").MissionPlan([item(vehicle, *place) for place in PLACES_M]))
    wire = await vehicle.mission_raw.download_mission()
    assert [one.command for one in wire] == [WAYPOINT, 178, WAYPOINT, 178, WAYPOINT, 178, 20]
    await vehicle.action.arm()
    await mission.start_mission()
    await vehicle.until(lambda: vehicle.mode == "RETURN_TO_LAUNCH")
    assert await mission.is_mission_finished()
    await vehicle.until(lambda: not vehicle.armed)
    looking.cancel()
    assert math.dist(vehicle.place_ned_m[:2], RALLIES_M[0]) < 1.0
    assert progress[-1] == (3, 3)
    assert progress == sorted(progress)
    await clear_rally_points(vehicle)


async def clear_rally_points(vehicle: Vehicle) -> None:
    """No plugin does; a plugin that hears the answer to it while it uploads gives up."""
    direct, clear = vehicle.mavlink_direct, {"target_system": 1, "target_component": 1, "mission_type": 2}
    answer = asyncio.create_task(first(direct.message("MISSION_ACK"), limit_s=20.0))
    await asyncio.sleep(0.2)
    await direct.send_message(
        kinds("mavlink_direct").MavlinkMessage("MISSION_CLEAR_ALL", 245, 190, 1, 1, json.dumps(clear))
    )
    assert json.loads((await answer).fields_json)["type"] == 0


async def a_mission_with_a_camera_is_paused_and_resumed(vehicle: Vehicle) -> None:
    await vehicle.until(lambda: vehicle.ready)
    mission, kind = vehicle.mission, kinds("mission").MissionItem.CameraAction
    looks = {"gimbal_pitch_deg": -45.0, "gimbal_yaw_deg": 30.0}
    actions = (kind.TAKE_PHOTO, kind.START_VIDEO, kind.STOP_VIDEO)
    items = [
        item(vehicle, *place, camera_action=action, speed_m_s=4.0, **looks)
        for place, action in zip(PLACES_M, actions, strict=True)
    ]
    await mission.upload_mission(kinds("mission").MissionPlan(items))
    await vehicle.action.arm()
    await mission.start_mission()
    await first(mission.mission_progress(), lambda news: news.current >= 1)
    await mission.pause_mission()
    await vehicle.until(lambda: vehicle.mode == "HOLD")
    await mission.start_mission()
    await vehicle.until(lambda: vehicle.mode == "MISSION")
    await vehicle.until(lambda: vehicle.mode == "RETURN_TO_LAUNCH")
    await vehicle.until(lambda: not vehicle.armed)
    assert vehicle.from_home_m() < 1.0
    await mission.clear_mission()


CONVERSATIONS = (
    Conversation(raw_items_come_back_as_they_went, ("mission_raw.py",)),
    Conversation(a_plan_file_is_imported_with_its_rally_points, ("mission_import.py",)),
    Conversation(a_fence_with_a_circle_of_no_size_is_taken, ("geofence.py",)),
    Conversation(a_mission_with_speeds_is_flown_and_ends_at_the_nearest_rally_point, ("mission.py",)),
    Conversation(a_mission_with_a_camera_is_paused_and_resumed, ("asyncio/mission.py",)),
)
