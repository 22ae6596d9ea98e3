"""What does a real PX4 say of itself? Mode and landed state, from the one MAVLink link that nobody else listens to.

Its simulator link tells only whether the motors are armed. PX4's gimbal link speaks to nobody without a gimbal, and
says what the judge wants: HEARTBEAT, and AUTOPILOT_STATE_FOR_GIMBAL_DEVICE 20 times a second. Nothing is ever sent
there. A PX4 without that link flies as well, but its mode stays unknown.
"""

from typing import Any

from pymavlink.dialects.v20 import common as mav

from companion.core.codec import VEHICLE_COMPONENT
from companion.core.mavlink import Connection
from companion.core.types import LandedState
from sitl.modes import from_custom_mode
from sitl.px4_plant import FirmwareStatus

Message = Any  # a MAVLink_*_message object

LANDED_STATES = frozenset(int(state) for state in LandedState)
EAR_PORT = 13280  # px4-rc.mavlink: where PX4's gimbal link sends to; instance N adds N


class Px4Ear:
    """Keeps a ``FirmwareStatus`` up to date."""

    def __init__(self, connection: Connection, system: int, status: FirmwareStatus) -> None:
        self._connection = connection
        self._system = system
        self._status = status

    def listen(self) -> None:
        """Take in what has arrived."""
        for message in self._connection.receive():
            if message.get_srcSystem() == self._system and message.get_srcComponent() == VEHICLE_COMPONENT:
                self._take(message)

    def _take(self, message: Message) -> None:
        status, kind = self._status, message.get_msgId()
        if kind == mav.MAVLINK_MSG_ID_HEARTBEAT:
            status.mode = from_custom_mode(message.custom_mode) or status.mode
        elif kind == mav.MAVLINK_MSG_ID_AUTOPILOT_STATE_FOR_GIMBAL_DEVICE:
            if message.landed_state in LANDED_STATES:
                status.landed = LandedState(message.landed_state)
            status.has_flown = status.has_flown or (status.armed and status.landed is LandedState.IN_AIR)
