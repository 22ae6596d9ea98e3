"""Which messages steer besides commands and local setpoints? Global and attitude setpoints, sticks, targets."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mav

from sitl import setpoints
from sitl.answers import CRITICAL, StatusText
from sitl.follow import Target
from sitl.link import COMPONENT, Link
from sitl.pilot import sticks_of
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object


class Inputs:
    """Serves one vehicle on every link."""

    def __init__(self, sim: Simulation, system_id: int) -> None:
        self._sim = sim
        self._system_id = system_id
        self.handlers: Mapping[int, Callable[[Link, Message], None]] = {
            mav.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._global,
            mav.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: self._attitude,
            mav.MAVLINK_MSG_ID_MANUAL_CONTROL: self._sticks,
            mav.MAVLINK_MSG_ID_FOLLOW_TARGET: self._target,
        }

    def _global(self, _link: Link, message: Message) -> None:
        """OFFBOARD: position by latitude, longitude and altitude (frames 5, 6, 11), velocity, acceleration."""
        if not self._for_us(message):
            return
        ap = self._sim.autopilot
        try:
            setpoint = setpoints.global_int(message, self._sim.origin, ap.home.down_m if ap.home is not None else 0.0)
        except setpoints.SetpointError as error:
            ap.texts.append(StatusText(CRITICAL, str(error)))
            return
        self._sim.submit_trajectory(setpoint, None)

    def _attitude(self, _link: Link, message: Message) -> None:
        """OFFBOARD: attitude or body rates, with thrust."""
        setpoint = setpoints.attitude(message) if self._for_us(message) else None
        if setpoint is not None:
            self._sim.submit_trajectory(setpoint, None)

    def _sticks(self, _link: Link, message: Message) -> None:
        """Sticks of a joystick."""
        sticks = sticks_of(message)
        if message.target in (0, self._system_id) and sticks is not None:
            self._sim.autopilot.hear_sticks(sticks)

    def _target(self, _link: Link, message: Message) -> None:
        """Where the one to follow is."""
        lat_deg, lon_deg = message.lat / 1e7, message.lon / 1e7
        if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0 and math.isfinite(message.alt)):
            return
        vel = np.array(message.vel, dtype=np.float64)
        if not np.isfinite(vel).all():
            vel = np.zeros(3)
        origin = self._sim.origin
        pos = np.array([*origin.north_east_m(lat_deg, lon_deg), origin.down_m(message.alt)])
        self._sim.autopilot.steering.target = Target(self._sim.t_s, pos, vel)

    def _for_us(self, message: Message) -> bool:
        return message.target_system in (0, self._system_id) and message.target_component in (0, COMPONENT)
