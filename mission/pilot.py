"""How does a pilot with nothing but a MAVLink ground station fly?  Plain commands, for flights that are disturbed.

The operator of ``swiftnav fly`` ends a flight when anything odd happens. This one is for tests that make it happen: it
says what it sees, in vehicle time, and leaves the decision to the caller.
"""

import struct
from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.clock import Clock, SystemClock
from companion.core.mavlink import Connection
from companion.core.types import LandedState
from companion.core.udp import udp_in
from mission.errors import FlightError
from sitl.link import HOST

Message = Any  # a MAVLink_*_message object

GCS_PORT: Final = 14550
IDS: Final = (255, 190)
HEARTBEAT_S: Final = 1.0
ASK_AGAIN_S: Final = 0.3
READY_BIT: Final = mav.MAV_SYS_STATUS_PREARM_CHECK
ACCEPTED: Final = mav.MAV_RESULT_ACCEPTED


class Pilot:
    """A ground station on the vehicle's GCS link."""

    def __init__(self, instance: int, clock: Clock | None = None, system: int = 1) -> None:
        """``system``: id of the vehicle. Raises TransportError when somebody else has the port."""
        self.t_s = 0.0
        self.pos_ned_m = (0.0, 0.0, 0.0)
        self.custom_mode = 0
        self.armed = self.ready = False
        self.landed = LandedState.UNDEFINED
        self.texts: list[str] = []
        self._system = system
        self._clock = clock or SystemClock()
        self._link = Connection(udp_in(HOST, GCS_PORT + instance, self._clock), *IDS, clock=self._clock)
        self._beat_s = self._clock.now_s() - HEARTBEAT_S
        self._results: dict[int, int] = {}

    def listen(self, wall_s: float = 0.02) -> None:
        """Take in what the vehicle says, for a moment."""
        if self._clock.now_s() - self._beat_s >= HEARTBEAT_S:
            self._beat_s = self._clock.now_s()
            self._link.send(mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))
        for message in self._link.receive(wall_s):
            if message.get_srcComponent() == codec.VEHICLE_COMPONENT:
                self._take(message)

    def until(self, reached: Callable[[], bool], wall_s: float) -> bool:
        """Listen until ``reached()``; False when ``wall_s`` went by first."""
        deadline_s = self._clock.now_s() + wall_s
        while not reached():
            if self._clock.now_s() > deadline_s:
                return False
            self.listen()
        return True

    def insist(self, reached: Callable[[], bool], ask: Callable[[], None], wall_s: float, what: str) -> None:
        """Ask again and again until it is so. Raises FlightError."""
        deadline_s = self._clock.now_s() + wall_s
        while not reached():
            if self._clock.now_s() > deadline_s:
                raise FlightError(f"{what} did not happen within {wall_s:g} s ({'; '.join(self.texts[-2:])})")
            ask()
            self.until(reached, ASK_AGAIN_S)

    def command(self, number: int, *params: float) -> None:
        """Send a COMMAND_LONG; the rest of the parameters is 0."""
        filled = [*params, *[0.0] * (7 - len(params))]
        self._link.send(mav.MAVLink_command_long_message(self._system, 1, number, 0, *filled))

    def set_integer(self, name: str, value: int) -> None:
        """Set an INT32 parameter: its bits travel as those of a float."""
        (bits,) = struct.unpack("<f", struct.pack("<i", value))
        self._link.send(mav.MAVLink_param_set_message(self._system, 1, name.encode(), bits, mav.MAV_PARAM_TYPE_INT32))

    def set_real(self, name: str, value: float) -> None:
        """Set a REAL32 parameter."""
        self._link.send(mav.MAVLink_param_set_message(self._system, 1, name.encode(), value, mav.MAV_PARAM_TYPE_REAL32))

    def take_off(self, wall_s: float = 60.0) -> None:
        """From the ground to a hold in the air; nothing to do for a vehicle that flies. Raises FlightError."""
        self.insist(lambda: self.ready or self.armed, lambda: None, wall_s, "getting ready")
        if self.landed == LandedState.IN_AIR and self.armed:
            return
        self.insist(lambda: self.armed, lambda: self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1), wall_s, "arming")
        self.insist(lambda: self.landed != LandedState.ON_GROUND, self._ask_takeoff, wall_s, "lifting off")
        flying = lambda: self.landed == LandedState.IN_AIR and self.custom_mode == codec.PX4_HOLD  # noqa: E731
        self.insist(flying, lambda: None, wall_s, "take-off")

    def hand_over(self, wall_s: float = 30.0) -> None:
        """OFFBOARD: the companion steers. Raises FlightError."""
        ask = lambda: self._link.send(codec.encode_set_mode(codec.PX4_OFFBOARD, self._system))  # noqa: E731
        self.insist(lambda: self.custom_mode == codec.PX4_OFFBOARD, ask, wall_s, "OFFBOARD")

    def close(self) -> None:
        """Free the port."""
        self._link.close()

    def _ask_takeoff(self) -> None:
        self.command(mav.MAV_CMD_NAV_TAKEOFF, *[float("nan")] * 7)

    def _take(self, message: Message) -> None:
        kind = message.get_msgId()
        if kind == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            self.t_s = message.time_boot_ms / 1e3
            self.pos_ned_m = (message.x, message.y, message.z)
        elif kind == mav.MAVLINK_MSG_ID_HEARTBEAT:
            self.custom_mode = message.custom_mode
            self.armed = bool(message.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)
        elif kind == mav.MAVLINK_MSG_ID_SYS_STATUS:
            self.ready = bool(message.onboard_control_sensors_health & READY_BIT)
        elif kind == mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            self.landed = LandedState(message.landed_state)
        elif kind == mav.MAVLINK_MSG_ID_STATUSTEXT:
            self.texts.append(message.text)
