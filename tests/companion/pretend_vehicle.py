"""A PX4-like vehicle for tests of the companion: kinematic, one scan a step, in vehicle time; no physics."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.frames import quaternion
from companion.core.mavlink import Connection
from companion.core.types import LandedState, Scan, Setpoint, VehicleState

STEP_MS = 40
STEP_S = STEP_MS / 1e3
DISARMED, ARMED = 29, 157  # base_mode as PX4 sends it
SPEED_M_S = 4.0


@dataclass
class PretendVehicle:
    """Flies straight to the position setpoint while in OFFBOARD; lands and disarms like PX4."""

    link: Connection
    lidar: Connection | None = None  # None: scans go over ``link``
    pos_ned_m: Any = field(default_factory=lambda: np.array([0.0, 0.0, -3.0]))
    custom_mode: int = codec.PX4_HOLD
    armed: bool = True
    landed: LandedState = LandedState.IN_AIR
    k: int = 0
    sends_scans: bool = True
    sends_anything: bool = True
    obeys_modes: bool = True
    setpoints: list[Setpoint] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    heartbeats: list[Any] = field(default_factory=list)
    mode_requests: list[int] = field(default_factory=list)
    scans_heard: list[Any] = field(default_factory=list)
    ground_s: float = 0.0
    vel_ned_m_s: Any = field(default_factory=lambda: np.zeros(3))

    @property
    def t_s(self) -> float:
        return self.k * STEP_MS / 1e3

    @property
    def offboard(self) -> bool:
        return self.custom_mode == codec.PX4_OFFBOARD

    def step(self) -> None:
        """One scan period: listen, move, speak."""
        self.listen()
        self.k += 1
        self.move()
        if self.sends_anything:
            self.speak()

    def listen(self) -> None:
        for message in self.link.receive():
            kind = message.get_msgId()
            if kind == mav.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED:
                self.setpoints.append(codec.decode_setpoint(message))
            elif kind == mav.MAVLINK_MSG_ID_STATUSTEXT:
                self.texts.append(message.text)
            elif kind == mav.MAVLINK_MSG_ID_HEARTBEAT:
                self.heartbeats.append(message)
            elif kind == mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
                self.scans_heard.append(message)
            elif kind == mav.MAVLINK_MSG_ID_COMMAND_LONG:
                self.obey(message)

    def obey(self, message: Any) -> None:
        custom_mode = int(message.param2) << 16 | int(message.param3) << 24
        self.mode_requests.append(custom_mode)
        if self.obeys_modes:
            self.custom_mode = custom_mode
        self.link.send(mav.MAVLink_command_ack_message(message.command, 0 if self.obeys_modes else 1))

    def move(self) -> None:
        self.vel_ned_m_s = np.zeros(3)
        if self.armed and self.offboard and self.setpoints and self.setpoints[-1].pos_ned_m is not None:
            way = self.setpoints[-1].pos_ned_m - self.pos_ned_m
            length = float(np.linalg.norm(way))
            if length > 1e-9:
                self.vel_ned_m_s = way * min(1.0 / STEP_S, SPEED_M_S / length)
                self.pos_ned_m = self.pos_ned_m + self.vel_ned_m_s * STEP_S
        if self.pos_ned_m[2] >= 0.0:
            self.pos_ned_m = np.array([*self.pos_ned_m[:2], 0.0])
            self.landed = LandedState.ON_GROUND
            self.ground_s += STEP_S
            self.armed = self.armed and self.ground_s < 2.0

    def speak(self) -> None:
        yaw = self.setpoints[-1].yaw_rad if self.setpoints and self.offboard else 0.0
        state = VehicleState(self.t_s, self.pos_ned_m, self.vel_ned_m_s, quaternion(0.0, 0.0, yaw or 0.0), np.zeros(3))
        messages = [
            codec.encode_vehicle_heartbeat(ARMED if self.armed else DISARMED, self.custom_mode, 4),
            codec.encode_extended_state(self.landed),
            codec.encode_attitude(state),
            codec.encode_position(state),
        ]
        scan = codec.encode_scan(Scan(self.t_s, np.full(72, math.inf), 0.0, math.radians(5.0), 0.2, 30.0))
        if self.sends_scans and self.lidar is None:
            messages.append(scan)
        self.link.send(*messages)
        if self.sends_scans and self.lidar is not None:
            self.lidar.send(scan)
