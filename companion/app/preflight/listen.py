"""How is the check before a flight made? Opens what the flight would open, listens, and has everything judged.

Nothing is asked of the vehicle but three parameters; no setpoint is sent.
"""

import os
import shutil
from contextlib import ExitStack
from pathlib import Path

from companion import navigator
from companion.app.config import CompanionConfig, ConfigError
from companion.app.config import check as check_config
from companion.app.opening import connect, exposed, open_all
from companion.app.preflight.heard import Heard
from companion.app.preflight.lidar_rows import lidar_rows
from companion.app.preflight.own_rows import (
    as_if_flying,
    belief_row,
    log_row,
    params_row,
    policy_row,
    rehearsal_row,
    task_row,
)
from companion.app.preflight.rows import Grade, Report, Row
from companion.app.preflight.vehicle_rows import PX4_PARAMS, vehicle_rows
from companion.core import codec
from companion.core.clock import Clock, SystemClock
from companion.core.keyring import KeyFileError
from companion.core.mavlink import Connection, LinkCounts
from companion.core.param_codec import encode_param_request
from companion.core.transport import TransportError, wait_readable
from companion.link.lidar import Lidar, LidarError
from companion.link.vehicle_clock import VehicleClock

LISTEN_S = 5.0
TURN_S = 0.05
ASK_S = 1.0  # between two heartbeats of ours, and two requests for what has not been answered
REHEARSED_SCANS = 50


def check(
    config: CompanionConfig,
    listen_s: float = LISTEN_S,
    params_problem: str | None = None,
    goal_given: bool = True,
    clock: Clock | None = None,
) -> Report:
    """Listen for ``listen_s`` after the vehicle's first word, and for as long for that word; judge."""
    clock = clock or SystemClock()
    rows = [params_row(config.params, params_problem), policy_row(config.params)]
    rows += [task_row(config.task if goal_given else None), _log_row(config.log_dir)]
    with ExitStack() as stack:
        try:
            check_config(config)
            opened = open_all(config, clock, stack)
        except (ConfigError, KeyFileError, TransportError, LidarError) as error:
            return Report([*rows, Row("links", Grade.FAIL, str(error), "is a companion running already?")])
        vehicle, lidar = connect(opened, config, None, clock)
        heard = _Listener(config, vehicle, lidar, clock).listen(listen_s)
    rows.append(belief_row(config.sign_key is not None, exposed(config), vehicle.counts))
    return Report([*rows, *_heard_rows(heard, vehicle.counts, config)])


def _heard_rows(heard: Heard, counts: LinkCounts, config: CompanionConfig) -> list[Row]:
    rows = list(vehicle_rows(heard, counts, config.vehicle_url, config.params, config.task.cruise_m_s))
    if heard.system is not None:
        rows += [*lidar_rows(heard, config.params), _rehearse(heard, config)]
    return rows


class _Listener:
    """The loop."""

    def __init__(self, config: CompanionConfig, vehicle: Connection, lidar: Lidar | None, clock: Clock) -> None:
        self._vehicle = vehicle
        self._lidar = lidar
        self._clock = clock
        self._heard = Heard.nothing(config.params.link)
        self._vehicle_clock = VehicleClock()
        self._links = [vehicle, *(lidar.links() if lidar is not None else ())]
        self._waits_on = [vehicle.transport, *(lidar.waits_on() if lidar is not None else ())]
        self._asked_s = clock.now_s() - ASK_S

    def listen(self, listen_s: float) -> Heard:
        """Until ``listen_s`` after the first word, or so long without one."""
        until_s = self._clock.now_s() + listen_s
        greeted = False
        while self._clock.now_s() < until_s:
            wait_readable(self._waits_on, TURN_S, self._clock)
            self._take_in()
            if self._heard.system is not None and not greeted:
                greeted = True
                until_s = self._clock.now_s() + listen_s
                for link in self._links:
                    link.speak_as(self._heard.system, codec.COMPANION_COMPONENT)
            if self._clock.now_s() - self._asked_s >= ASK_S:
                self._ask()
        return self._heard

    def _take_in(self) -> None:
        wall_s = self._clock.wall_us() / 1e6
        now_s = self._clock.now_s()
        for message in self._vehicle.receive():
            self._heard.feed(message, now_s, wall_s)
        if self._lidar is None:
            return
        self._vehicle_clock.update(self._heard.assembler.vehicle_time_s, now_s)
        for message in self._lidar.receive(self._vehicle_clock):
            self._heard.feed(self._vehicle.relay(message) if self._lidar.local else message, now_s, wall_s)

    def _ask(self) -> None:
        """Say that we are here, and ask for what has not been told."""
        self._asked_s = self._clock.now_s()
        for link in self._links:
            link.send(codec.encode_companion_heartbeat())
        system = self._heard.system
        if system is not None:
            missing = [name for name in PX4_PARAMS if name not in self._heard.params]
            self._vehicle.send(*(encode_param_request(name, system) for name in missing))


def _rehearse(heard: Heard, config: CompanionConfig) -> Row:
    """Fly on the last scans, without a word to the vehicle, and measure how long that takes."""
    clock, ticks = SystemClock(), as_if_flying(heard.ticks[-REHEARSED_SCANS:])
    memory = navigator.start(config.params)
    tick_ms: list[float] = []
    try:
        for inputs in ticks:
            began_s = clock.now_s()
            memory, _, _ = navigator.tick(memory, inputs, config.task, config.params)
            tick_ms.append((clock.now_s() - began_s) * 1e3)
    except Exception as error:  # whatever it trips over here it would trip over in flight
        return rehearsal_row([], f"{type(error).__name__}: {error}")
    return rehearsal_row(tick_ms[1:], None)  # the first one loads what the others find in place


def _log_row(folder: Path) -> Row:
    """Looked at, not written: a check leaves nothing behind."""
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        return log_row(str(folder), None, f"{there} is a file")
    if not os.access(there, os.W_OK):
        return log_row(str(folder), None, f"{there} may not be written by this user")
    return log_row(str(folder), shutil.disk_usage(there).free, None)
