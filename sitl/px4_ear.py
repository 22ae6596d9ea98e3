"""What does a real PX4 say of itself? Mode, landed state and texts, from the one MAVLink link nobody else listens to.

Its simulator link tells only whether the motors are armed. PX4's gimbal link is idle without a gimbal; everything that
the judge wants is asked for there. A PX4 without that link flies as well, but its mode stays unknown.
"""

from collections.abc import Callable
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core.codec import VEHICLE_COMPONENT
from companion.core.mavlink import Connection
from companion.core.types import LandedState
from sitl.modes import from_custom_mode
from sitl.px4_plant import FirmwareStatus

Message = Any  # a MAVLink_*_message object

LOCAL_PORT, PX4_PORT = 13280, 13030  # px4-rc.mavlink; instance N adds N
COMPONENT: Final = mav.MAV_COMP_ID_USER1  # as whom we ask
ASK_AGAIN_WALL_S: Final = 1.0
LANDED_US: Final = 40_000  # interval of EXTENDED_SYS_STATE: one for each scan at 25 Hz


class Px4Ear:
    """Keeps a ``FirmwareStatus`` up to date."""

    def __init__(self, connection: Connection, system: int, status: FirmwareStatus, say: Callable[[str], None]) -> None:
        self.connection = connection
        self._system = system
        self._status = status
        self._say = say
        self._asked_s: float | None = None
        self._answered = False

    def listen(self, now_s: float) -> None:
        """Take in what has arrived; ask (again) for what is missing."""
        for message in self.connection.receive():
            if message.get_srcSystem() == self._system and message.get_srcComponent() == VEHICLE_COMPONENT:
                self._take(message)
        if not self._answered and (self._asked_s is None or now_s - self._asked_s > ASK_AGAIN_WALL_S):
            self._asked_s = now_s
            self.connection.send(self._request())

    def _take(self, message: Message) -> None:
        status, kind = self._status, message.get_msgId()
        if kind == mav.MAVLINK_MSG_ID_HEARTBEAT:
            status.mode = from_custom_mode(message.custom_mode) or status.mode
        elif kind == mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            self._answered = True
            status.landed = LandedState(message.landed_state)
            status.has_flown = status.has_flown or (status.armed and status.landed is LandedState.IN_AIR)
        elif kind == mav.MAVLINK_MSG_ID_STATUSTEXT:
            self._say(f"PX4: {message.text.rstrip()}")

    def _request(self) -> Message:
        return mav.MAVLink_command_long_message(
            self._system,
            VEHICLE_COMPONENT,
            mav.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
            LANDED_US,
            *[0.0] * 5,
        )
