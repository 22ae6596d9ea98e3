"""How does a client steer? Every kind of OFFBOARD setpoint; the vehicle stays in the air from one to the next."""

import asyncio
import math
from typing import Any

from conversations.client import Vehicle, kinds, refusal
from conversations.conversation import Conversation

HEIGHT_M = 4.0
LEGS = ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0))
RADIUS_M, TURN_S = 4.0, 10.0  # of the circle that is flown by position, velocity and acceleration
HOVER = 0.5  # thrust that lifts a little or not at all


def setpoint(kind: str, *values: float) -> Any:
    """Of this class of MAVSDK's."""
    return getattr(kinds("offboard"), kind)(*values)


async def steered(vehicle: Vehicle, begin: Any) -> None:
    """OFFBOARD, after its first setpoint."""
    await begin
    await vehicle.offboard.start()
    await vehicle.until(lambda: vehicle.mode == "OFFBOARD")


async def let_go(vehicle: Vehicle) -> None:
    """OFFBOARD ends; it holds."""
    await vehicle.offboard.stop()
    await vehicle.until(lambda: vehicle.mode == "HOLD")


async def by_position_from_the_ground(vehicle: Vehicle) -> None:
    said = await refusal("offboard", vehicle.offboard.start())
    assert "NO_SETPOINT" in said
    await vehicle.action.arm()
    offboard = vehicle.offboard
    await steered(vehicle, offboard.set_position_ned(setpoint("PositionNedYaw", 0.0, 0.0, 0.0, 0.0)))
    for (north_m, east_m), yaw_deg in zip(LEGS, (0.0, 90.0, 180.0), strict=True):
        await offboard.set_position_ned(setpoint("PositionNedYaw", north_m, east_m, -HEIGHT_M, yaw_deg))
        await vehicle.near(north_m, east_m, -HEIGHT_M)
    await let_go(vehicle)


async def by_velocity(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    offboard, (_, east_m, down_m) = vehicle.offboard, vehicle.place_ned_m
    await steered(vehicle, offboard.set_velocity_ned(setpoint("VelocityNedYaw", 0.0, 0.0, 0.0, 90.0)))
    await offboard.set_velocity_ned(setpoint("VelocityNedYaw", 0.0, 2.0, -1.0, 90.0))
    await vehicle.until(lambda: vehicle.place_ned_m[1] > east_m + 3.0 and vehicle.place_ned_m[2] < down_m - 1.0)
    await let_go(vehicle)


async def by_velocity_of_the_body(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    offboard = vehicle.offboard
    yaw_deg = [math.nan]

    async def look() -> None:
        async for euler in vehicle.telemetry.attitude_euler():
            yaw_deg[0] = euler.yaw_deg

    looking = asyncio.create_task(look())
    await steered(vehicle, offboard.set_velocity_body(setpoint("VelocityBodyYawspeed", 0.0, 0.0, 0.0, 0.0)))
    await offboard.set_velocity_body(setpoint("VelocityBodyYawspeed", 0.0, 0.0, 0.0, 45.0))
    await vehicle.until(lambda: -60.0 < yaw_deg[0] < -30.0)  # it turns clockwise through all of them
    await offboard.set_velocity_body(setpoint("VelocityBodyYawspeed", 0.0, 0.0, 0.0, 0.0))
    before = vehicle.place_ned_m
    await offboard.set_velocity_body(setpoint("VelocityBodyYawspeed", 3.0, 0.0, 0.0, 0.0))
    await vehicle.until(lambda: math.dist(vehicle.place_ned_m[:2], before[:2]) > 6.0)
    way_deg = math.degrees(math.atan2(vehicle.place_ned_m[1] - before[1], vehicle.place_ned_m[0] - before[0]))
    assert math.cos(math.radians(way_deg - yaw_deg[0])) > 0.8, "where the nose points"
    looking.cancel()
    await let_go(vehicle)


async def by_position_and_velocity(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    offboard, still = vehicle.offboard, setpoint("VelocityNedYaw", 0.0, 0.0, 0.0, 0.0)
    here = setpoint("PositionNedYaw", *vehicle.place_ned_m, 0.0)
    await steered(vehicle, offboard.set_position_velocity_ned(here, still))
    target = setpoint("PositionNedYaw", 5.0, -5.0, -HEIGHT_M, 0.0)
    await offboard.set_position_velocity_ned(target, still)
    await vehicle.near(5.0, -5.0, -HEIGHT_M)
    await let_go(vehicle)


async def by_position_velocity_and_acceleration(vehicle: Vehicle) -> None:
    """Round a circle, as a recorded trajectory would be flown."""
    await vehicle.airborne(HEIGHT_M)
    offboard = vehicle.offboard
    await steered(vehicle, offboard.set_position_ned(setpoint("PositionNedYaw", RADIUS_M, 0.0, -HEIGHT_M, 0.0)))
    await vehicle.near(RADIUS_M, 0.0, -HEIGHT_M)
    for step in range(41):
        angle_rad, turn_rad_s = math.tau * step / 40, math.tau / TURN_S
        out = (RADIUS_M * math.cos(angle_rad), RADIUS_M * math.sin(angle_rad))
        await offboard.set_position_velocity_acceleration_ned(
            setpoint("PositionNedYaw", *out, -HEIGHT_M, 0.0),
            setpoint("VelocityNedYaw", -out[1] * turn_rad_s, out[0] * turn_rad_s, 0.0, 0.0),
            setpoint("AccelerationNed", -out[0] * turn_rad_s**2, -out[1] * turn_rad_s**2, 0.0),
        )
        await asyncio.sleep(0.05)
        assert abs(math.hypot(*vehicle.place_ned_m[:2]) - RADIUS_M) < RADIUS_M
    await offboard.set_position_ned(setpoint("PositionNedYaw", RADIUS_M, 0.0, -HEIGHT_M, 0.0))
    await vehicle.near(RADIUS_M, 0.0, -HEIGHT_M)
    await let_go(vehicle)


async def by_attitude_and_thrust(vehicle: Vehicle) -> None:
    await vehicle.airborne(HEIGHT_M)
    offboard, (north_m, _, down_m) = vehicle.offboard, vehicle.place_ned_m
    await steered(vehicle, offboard.set_attitude(setpoint("Attitude", 0.0, 0.0, 0.0, HOVER)))
    await offboard.set_attitude(setpoint("Attitude", 0.0, 0.0, 0.0, 0.6))
    await vehicle.until(lambda: vehicle.place_ned_m[2] < down_m - 2.0)
    await offboard.set_attitude(setpoint("Attitude", 0.0, -15.0, 0.0, HOVER))  # nose down: forward, north
    await vehicle.until(lambda: vehicle.place_ned_m[0] > north_m + 3.0)
    await let_go(vehicle)
    await vehicle.down()


CONVERSATIONS = (
    Conversation(by_position_from_the_ground, ("offboard_position_ned.py",)),
    Conversation(by_velocity, ("offboard_velocity_ned.py",)),
    Conversation(by_velocity_of_the_body, ("offboard_velocity_body.py",)),
    Conversation(by_position_and_velocity, ("offboard_position_velocity_ned.py",)),
    Conversation(by_position_velocity_and_acceleration, ("offboard_from_csv/offboard_from_csv.py",)),
    Conversation(by_attitude_and_thrust, ("offboard_attitude.py",)),
)
