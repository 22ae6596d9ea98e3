"""Which messages make up the inputs of one tick? Pure: fed in order, by vehicle time only, so that a replay agrees.

A tick is due whenever a scan (OBSTACLE_DISTANCE) arrives: the state is taken at the scan's instant from the samples of
ATTITUDE_QUATERNION and LOCAL_POSITION_NED, the status from the last HEARTBEAT and EXTENDED_SYS_STATE of the autopilot.
"""

import dataclasses
import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.frames import yaw_rad
from companion.core.inputs import Inputs
from companion.core.types import AutopilotStatus, Scan, VehicleState
from companion.link.params import LinkParams
from companion.link.samples import REBOOT_S, Samples, state_at

Message = Any  # a MAVLink_*_message object

AUTOPILOT_COMPONENT = codec.VEHICLE_COMPONENT
REBOOT_SAMPLES = 5  # so many old samples in a row are a clock that started again; fewer are packets that came late


class Assembler:
    """Collects what the vehicle and its LiDAR say; locks on to the first autopilot heard."""

    def __init__(self, params: LinkParams) -> None:
        self._params = params
        self._position = Samples()
        self._attitude = Samples()
        self._heartbeat: Message | None = None
        self._extended: Message | None = None
        self._last_scan_s = -math.inf
        self._old_samples = 0  # in a row
        self.status: AutopilotStatus | None = None  # what the autopilot last said of itself
        self.vehicle_system: int | None = None  # system id of the autopilot, once heard
        self.reboots = 0  # times that vehicle time started again
        self.dropped_scans = 0  # unreadable, repeated, late, of another clock, or without a state to go with

    @property
    def custom_mode(self) -> int | None:
        """Flight mode of the last HEARTBEAT as PX4 numbers it; None before the first."""
        return self._heartbeat.custom_mode if self._heartbeat is not None else None

    @property
    def vehicle_time_s(self) -> float:
        """Vehicle time of the newest state sample; -inf before the first."""
        return min(self._position.newest_s, self._attitude.newest_s)

    @property
    def last_scan_s(self) -> float:
        """Vehicle time of the newest scan used; -inf before the first."""
        return self._last_scan_s

    def latest_state(self) -> VehicleState | None:
        """The state at ``vehicle_time_s``; None until position and attitude were heard."""
        t_s = self.vehicle_time_s
        return state_at(self._position, self._attitude, t_s, 0.0) if math.isfinite(t_s) else None

    def feed(self, message: Message) -> Inputs | None:
        """Take one message in; the inputs of a tick when it completes them."""
        kind = message.get_msgId()
        if kind == mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
            return self._take_scan(message)
        if message.get_srcComponent() != AUTOPILOT_COMPONENT:
            return None
        if kind == mav.MAVLINK_MSG_ID_HEARTBEAT:
            self._take_heartbeat(message)
        elif message.get_srcSystem() != self.vehicle_system:
            return None
        elif kind == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            self._take_position(message)
        elif kind == mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION:
            self._take_attitude(message)
        elif kind == mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
            self._extended = message
            self._judge_status()
        return None

    def _take_heartbeat(self, message: Message) -> None:
        if message.autopilot == mav.MAV_AUTOPILOT_INVALID:
            return
        if self.vehicle_system is None:
            self.vehicle_system = message.get_srcSystem()
        if message.get_srcSystem() == self.vehicle_system:
            self._heartbeat = message
            self._judge_status()

    def _judge_status(self) -> None:
        if self._heartbeat is not None:
            self.status = codec.decode_status(self._heartbeat, self._extended)

    def _take_position(self, message: Message) -> None:
        m = message
        self._put(self._position, m.time_boot_ms, (m.x, m.y, m.z), (m.vx, m.vy, m.vz))

    def _take_attitude(self, message: Message) -> None:
        m = message
        q_ned_frd = (m.q1, m.q2, m.q3, m.q4)
        rates_frd_rad_s = (m.rollspeed, m.pitchspeed, m.yawspeed)
        self._put(self._attitude, m.time_boot_ms, q_ned_frd, rates_frd_rad_s)

    def _put(self, samples: Samples, time_boot_ms: int, value: tuple[float, ...], rate: tuple[float, ...]) -> None:
        if not all(map(math.isfinite, (*value, *rate))):
            return  # an estimate that is not there yet: as if nothing was heard
        t_s = codec.from_ms(time_boot_ms)
        if t_s >= samples.newest_s - REBOOT_S:
            self._old_samples = 0
        else:
            self._old_samples += 1
            if self._old_samples < REBOOT_SAMPLES:
                return
            self._forget()
        samples.put(t_s, np.array(value), np.array(rate))

    def _forget(self) -> None:
        """The vehicle has booted: its clock and its origin are new, and what it said of itself is over."""
        self.reboots += 1
        self._old_samples = 0
        self._position.clear()
        self._attitude.clear()
        self._last_scan_s = -math.inf
        self._heartbeat = self._extended = self.status = None

    def _take_scan(self, message: Message) -> Inputs | None:
        if self._params.lidar_component not in (0, message.get_srcComponent()):
            return None
        scan, status = self._scan(message), self.status
        if scan is None or status is None or not self._is_next(scan.t_s):
            self.dropped_scans += 1
            return None
        self._last_scan_s = scan.t_s
        return self._inputs(scan, status)

    def _scan(self, message: Message) -> Scan | None:
        """The scan in the body frame; None when unreadable, or when there is no state to go with it."""
        state_s = self.vehicle_time_s
        if not math.isfinite(state_s):
            return None
        (q_ned_frd, _), _, _ = self._attitude.around(state_s)
        try:
            scan = codec.decode_scan(message, yaw_rad(q_ned_frd))
        except codec.CodecError:
            return None
        return dataclasses.replace(scan, t_s=state_s) if self._params.arrival_stamps else scan

    def _is_next(self, scan_s: float) -> bool:
        """Newer than the last one, and not of a clock that is ahead of the vehicle's."""
        return self._last_scan_s < scan_s <= self.vehicle_time_s + REBOOT_S

    def _inputs(self, scan: Scan, status: AutopilotStatus) -> Inputs:
        max_age_s = self._params.max_state_age_s
        state = state_at(self._position, self._attitude, scan.t_s, max_age_s)
        gap_s = max(self._position.gap_s(scan.t_s), self._attitude.gap_s(scan.t_s))
        age_s = self.vehicle_time_s - scan.t_s
        return Inputs(state, scan, status, fresh=gap_s <= max_age_s and age_s <= self._params.max_scan_age_s)
