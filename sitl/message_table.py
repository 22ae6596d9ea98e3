"""Which messages can the vehicle send by itself or when asked? All builders, by message id."""

from collections.abc import Callable, Mapping
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl import messages, messages_modes, messages_sensors
from sitl.mission_service import mission_current
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object

BUILDERS: Final[Mapping[int, Callable[[Simulation], Message | None]]] = {
    **messages.BUILDERS,
    **messages_sensors.BUILDERS,
    **messages_modes.BUILDERS,
    mav.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
}
