"""How does an operator fly the mission?  Connect, health, arm, take off, OFFBOARD to the companion, watch.

An independent client (MAVSDK) on a link of its own. Wall-clock timeouts guard every step; the mission's time limit
counts vehicle time. Whatever ends ``fly`` early, cancelling it included, leaves an airborne vehicle in HOLD.
"""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, MavsdkConnectionError, System
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkDirectError, MavlinkMessage
from mavsdk.logging import LogLevel, log_subscribe

from mission.errors import FlightError
from mission.telemetry_watch import TelemetryWatch

MAV_CMD_DO_SET_MODE = 176
MAV_MODE_FLAG_CUSTOM_MODE_ENABLED = 1
PX4_MAIN_MODE_OFFBOARD = 6
MAV_RESULT_ACCEPTED = 0
RETRY_WALL_S = 0.1  # between two tries of a refused command
HOLD_WALL_S = 3.0  # that an interrupted flight gives to its last HOLD

Say = Callable[[str], None]


class OperatorError(FlightError):
    """The flight could not start or went wrong; the text is the reason, one line."""


class RefusedError(RuntimeError):
    """The vehicle answered a command with something else than 'accepted'."""


@dataclass(frozen=True, slots=True)
class OperatorConfig:
    """Where the vehicle answers and how long each step may take; ``*_wall_s`` count the operator's own clock."""

    url: str
    time_limit_s: float  # vehicle time in OFFBOARD
    connect_wall_s: float = 20.0
    ready_wall_s: float = 30.0
    command_wall_s: float = 10.0
    takeoff_wall_s: float = 60.0
    offboard_wall_s: float = 20.0
    stuck_wall_s: float = 10.0  # without vehicle time going on
    left_wall_s: float = 1.0  # out of OFFBOARD: a failsafe may end by itself, a pilot keeps the vehicle


async def fly(config: OperatorConfig, say: Say) -> None:
    """From the ground to disarmed on the ground; returns once landed. Raises OperatorError with the reason."""
    log_subscribe(_drop_mavsdk_log)
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        system = await _connect(mavsdk, config)
        say("vehicle found")
        async with TelemetryWatch(system, say) as watch:
            action = ActionAsync(system)
            try:
                await _take_off(config, watch, action, say)
                await _hand_over(config, watch, MavlinkDirectAsync(system), say)
                await _watch(config, watch, say)
            except BaseException:
                await _leave_holding(action, watch)
                raise
    finally:
        mavsdk.destroy()


async def _connect(mavsdk: Mavsdk, config: OperatorConfig) -> System:
    try:
        await mavsdk.add_any_connection(config.url)
    except MavsdkConnectionError as error:
        raise OperatorError(f"cannot open {config.url}: {error}") from error
    system = await mavsdk.first_autopilot(config.connect_wall_s)
    if system is None:
        raise OperatorError(f"no vehicle answered on {config.url} within {config.connect_wall_s:g} s")
    return system


async def _take_off(config: OperatorConfig, watch: TelemetryWatch, action: ActionAsync, say: Say) -> None:
    if not await watch.until(lambda: watch.healthy and watch.armable, config.ready_wall_s):
        raise OperatorError(f"the vehicle was not ready to arm within {config.ready_wall_s:g} s")
    await _insist(action.arm, config.command_wall_s, "arming refused", watch)
    say("armed")
    await _insist(action.takeoff, config.command_wall_s, "take-off refused", watch)
    if not await watch.until(lambda: watch.mode == "HOLD" and watch.landed == "IN_AIR", config.takeoff_wall_s):
        raise OperatorError(f"the vehicle did not take off within {config.takeoff_wall_s:g} s")
    say("in the air, holding")


async def _hand_over(config: OperatorConfig, watch: TelemetryWatch, direct: MavlinkDirectAsync, say: Say) -> None:
    wall_s = config.offboard_wall_s
    await _insist(lambda: _ask_offboard(direct), wall_s, "OFFBOARD refused, is the companion streaming?", watch)
    if not await watch.until(lambda: watch.mode == "OFFBOARD", wall_s):
        raise OperatorError(f"the vehicle accepted OFFBOARD but did not report it within {wall_s:g} s")
    say("OFFBOARD: the companion steers")


async def _watch(config: OperatorConfig, watch: TelemetryWatch, say: Say) -> None:
    """Until disarmed on the ground, or until something is wrong."""
    start_s, began_wall_s = watch.t_s, time.monotonic()
    while True:
        await watch.until(lambda: not watch.armed, 0.5)
        if not watch.armed:
            say("disarmed")
            return
        if not watch.connected:
            raise OperatorError("the vehicle was lost in flight")
        if time.monotonic() - max(watch.moved_wall_s, began_wall_s) > config.stuck_wall_s:
            raise OperatorError(f"vehicle time stood still for {config.stuck_wall_s:g} s")
        if not await watch.until(lambda: watch.mode == "OFFBOARD" or not watch.armed, config.left_wall_s):
            raise OperatorError(f"the vehicle left OFFBOARD for {watch.mode}")
        if watch.t_s - start_s > config.time_limit_s:
            raise OperatorError(f"time limit of {config.time_limit_s:g} s reached")


async def _ask_offboard(direct: MavlinkDirectAsync) -> None:
    """DO_SET_MODE by hand: MAVSDK's own offboard.start would stream setpoints of its own."""
    fields = {
        "target_system": 1,
        "target_component": 1,
        "command": MAV_CMD_DO_SET_MODE,
        "confirmation": 0,
        "param1": MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        "param2": PX4_MAIN_MODE_OFFBOARD,
        **{f"param{i}": 0 for i in range(3, 8)},
    }
    ack = await direct.send_command(MavlinkMessage("COMMAND_LONG", 0, 0, 1, 1, json.dumps(fields)))
    result = json.loads(ack.fields_json).get("result")
    if result != MAV_RESULT_ACCEPTED:
        raise RefusedError(f"MAV_RESULT {result}")


async def _insist(ask: Callable[[], Awaitable[Any]], wall_s: float, failure: str, watch: TelemetryWatch) -> None:
    """Repeat a command until it is accepted; the last text of the vehicle explains a refusal."""
    deadline_s = time.monotonic() + wall_s
    while True:
        try:
            await ask()
            return
        except (ActionError, MavlinkDirectError, RefusedError) as error:
            if time.monotonic() > deadline_s:
                why = watch.texts[-1] if watch.texts else str(error).split(";")[0]
                raise OperatorError(f"{failure} ({why})") from error
        await asyncio.sleep(RETRY_WALL_S)


async def _leave_holding(action: ActionAsync, watch: TelemetryWatch) -> None:
    """HOLD for a vehicle that flies; a lost one cannot be told."""
    if not (watch.armed and watch.connected):
        return
    try:
        await asyncio.wait_for(asyncio.shield(action.hold()), HOLD_WALL_S)
    except (ActionError, TimeoutError):
        watch.texts.append("HOLD not confirmed")


def _drop_mavsdk_log(_level: LogLevel, _text: str, _file: str | None, _line: int) -> bool:
    """True: MAVSDK keeps its log lines off stdout, which belongs to ``--json``."""
    return True
