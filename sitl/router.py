"""What does the vehicle do with an incoming message? Answers go back on the link that asked.

The one place where messages change the vehicle: commands, setpoints, parameters. What is addressed to somebody else is
ignored silently, as PX4 does.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core.frames import yaw_rad
from sitl import command, commands, param_protocol, setpoints
from sitl.answers import CRITICAL, StatusText
from sitl.command import Command
from sitl.commands import ANYBODY
from sitl.flight_logs import FlightLogs
from sitl.inputs import Inputs
from sitl.link import COMPONENT, Link
from sitl.log_service import LogService
from sitl.mission_service import MissionService
from sitl.side_services import SideServices
from sitl.simulation import STEP_MS, Simulation

Message = Any  # a MAVLink_*_message object

ANSWER_WINDOW_MS: Final = 1000  # a setpoint may answer a scan that is not older than this


class Router:
    """Serves every link of one vehicle."""

    def __init__(self, sim: Simulation, system_id: int, logs: FlightLogs | None = None) -> None:
        self.companion_heard = False
        self.answered_ms = -1  # time of the newest scan that a setpoint has answered
        self._sim = sim
        self._missions = MissionService(sim, system_id)
        self._logs = LogService(logs, system_id)
        self._now_s = math.nan  # wall, of the last tick
        self._gcs_heard_s = math.nan
        self._system_id = system_id
        self.handlers: Mapping[int, Callable[[Link, Message], None]] = {
            mav.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            mav.MAVLINK_MSG_ID_COMMAND_LONG: self._command_long,
            mav.MAVLINK_MSG_ID_COMMAND_INT: self._command_int,
            mav.MAVLINK_MSG_ID_SET_MODE: self._set_mode,
            mav.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._setpoint,
            mav.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._param_read,
            mav.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._param_list,
            mav.MAVLINK_MSG_ID_PARAM_SET: self._param_set,
            mav.MAVLINK_MSG_ID_PING: self._ping,
            mav.MAVLINK_MSG_ID_TIMESYNC: self._timesync,
            **Inputs(sim, system_id).handlers,
            **SideServices(sim, system_id).handlers,
            **self._logs.handlers,
        }

    def handle(self, link: Link, message: Message) -> None:
        """Act on one message; what is not understood is ignored."""
        handler = self.handlers.get(message.get_msgId())
        if handler is not None:
            handler(link, message)
        else:
            self._missions.handle(link, message)

    def tick(self, links: Sequence[Link], now_s: float) -> None:
        """Wall time has passed: transfers go on, silence is noticed."""
        self._now_s = now_s
        self._missions.tick(links, now_s)
        self._logs.tick(links)
        silent_s = now_s - self._gcs_heard_s  # NaN before the first
        self._sim.autopilot.guardian.hear_link(silent_s > self._sim.autopilot.params["COM_DL_LOSS_T"])

    def _heartbeat(self, link: Link, message: Message) -> None:
        """Who is there: the companion, a ground station."""
        self.companion_heard = self.companion_heard or link.companion
        if message.type == mav.MAV_TYPE_GCS:
            self._gcs_heard_s = self._now_s

    def _command_long(self, link: Link, message: Message) -> None:
        """One COMMAND_ACK; see the commands."""
        self._execute(link, message, command.from_long(message), message.target_component)

    def _command_int(self, link: Link, message: Message) -> None:
        """One COMMAND_ACK; see the commands."""
        self._execute(link, message, command.from_int(message), message.target_component)

    def _set_mode(self, link: Link, message: Message) -> None:
        """As DO_SET_MODE, whose COMMAND_ACK it gets."""
        self._execute(link, message, command.from_set_mode(message), COMPONENT)

    def _execute(self, link: Link, message: Message, asked: Command, component: int) -> None:
        to_all = asked.id in ANYBODY and message.target_system == 0
        if not (to_all or message.target_system == self._system_id) or component not in (0, COMPONENT):
            return
        answer = commands.execute(asked, self._sim, link)
        ack = mav.MAVLink_command_ack_message(
            asked.id, answer.result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        for told in answer.messages:
            link.connection.send(told)
        link.connection.send(ack)
        self.answered_ms = min(self.answered_ms, self._sim.t_ms)  # a reboot starts vehicle time anew

    def _setpoint(self, _link: Link, message: Message) -> None:
        """OFFBOARD: position, velocity, acceleration in LOCAL_NED or BODY_NED."""
        if message.target_system not in (0, self._system_id) or message.target_component not in (0, COMPONENT):
            return
        try:
            setpoint = setpoints.local_ned(message, yaw_rad(self._sim.state.q_ned_frd))
        except setpoints.SetpointError as error:
            self._sim.autopilot.texts.append(StatusText(CRITICAL, str(error)))
            return
        scan_ms = self._answers(message.time_boot_ms)
        self._sim.submit_trajectory(setpoint, scan_ms)
        if scan_ms is not None:
            self.answered_ms = max(self.answered_ms, scan_ms)

    def _answers(self, time_boot_ms: int) -> int | None:
        """The scan that a setpoint with this stamp answers; None for a client with a clock of its own."""
        recent = 0 <= self._sim.t_ms - time_boot_ms <= ANSWER_WINDOW_MS
        on_scan = time_boot_ms % (self._sim.scan_steps * STEP_MS) == 0
        return time_boot_ms if recent and on_scan else None

    def _param_read(self, link: Link, message: Message) -> None:
        """PARAM_VALUE; silence for an unknown one."""
        self._send_params(link, message, param_protocol.read)

    def _param_list(self, link: Link, message: Message) -> None:
        """PARAM_VALUE of _HASH_CHECK, then of every parameter."""
        self._send_params(link, message, lambda _message, sim: param_protocol.read_all(sim))

    def _param_set(self, link: Link, message: Message) -> None:
        """PARAM_VALUE now in force; silence for an unknown name or a wrong type."""
        self._send_params(link, message, param_protocol.write)

    def _send_params(
        self, link: Link, message: Message, answer: Callable[[Message, Simulation], list[Message]]
    ) -> None:
        if self._addressed(message):
            for reply in answer(message, self._sim):
                link.connection.send(reply)

    def _ping(self, link: Link, message: Message) -> None:
        """A request is answered to its sender."""
        if message.target_system == 0 and message.target_component == 0:
            reply = mav.MAVLink_ping_message(
                message.time_usec, message.seq, message.get_srcSystem(), message.get_srcComponent()
            )
            link.connection.send(reply)

    def _timesync(self, link: Link, message: Message) -> None:
        """A request is answered with vehicle time in ns."""
        if message.tc1 == 0:
            link.connection.send(mav.MAVLink_timesync_message(self._sim.t_ms * 1_000_000, message.ts1))

    def _addressed(self, message: Message) -> bool:
        return message.target_system == self._system_id and message.target_component in (0, COMPONENT)
