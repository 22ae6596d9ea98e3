"""A small stand-in for a real PX4 at the simulator port: an estimate from the sensors, a hover controller, a script.

Written from px4_hil's wire description and the airframe file's geometry, not from the code under test.
"""

import math
import socket
import threading
from dataclasses import dataclass, field

import numpy as np
from pymavlink.dialects.v20 import common as mav

HOLD = 4 << 16 | 3 << 24
OFFBOARD = 6 << 16
HOME_DEG = (47.397742, 8.545594)
HOME_M = 489.4
EARTH_M = 6371000.0
GRAVITY = np.array([0.0, 0.0, 9.80665])
HOVER = 0.4539
# PX4's normalised mixer of airframe 10016: what roll, pitch, yaw and thrust do to its motors 0 to 3
MIX = np.array(
    [
        [-0.4954, 0.7071, 0.7653, 1.0],
        [0.4954, -0.7071, 1.0, 1.0],
        [0.4954, 0.7071, -0.7653, 1.0],
        [-0.4954, -0.7071, -1.0, 1.0],
    ]
)


@dataclass
class Script:
    """What it does when, in vehicle time."""

    silent_s: float = 0.1  # no motor outputs at first
    arm_s: float = 0.6
    climb_m: float = 1.5
    land_s: float = 4.0
    end_s: float = 7.0
    hang_after_s: float = math.inf  # from then on it answers nothing


@dataclass
class Heard:
    """What came over the simulator link."""

    sensor_us: list[int] = field(default_factory=list)
    fields: list[int] = field(default_factory=list)
    gps_us: list[int] = field(default_factory=list)


class PretendPx4(threading.Thread):
    """Connects, flies its script, closes the connection."""

    def __init__(self, port: int, ear_port: int, script: Script | None = None) -> None:
        super().__init__(daemon=True)
        self.script = script or Script()
        self.heard = Heard()
        self._socket = socket.create_connection(("127.0.0.1", port), 5.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._ear = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", ear_port))
        self._mav = mav.MAVLink(None, srcSystem=1, srcComponent=1)
        self._rotation = np.eye(3)  # frd to ned
        self._pos = np.zeros(3)
        self._vel = np.zeros(3)
        self._rate_sum = np.zeros(3)
        self._armed = False
        self._landed = mav.MAV_LANDED_STATE_ON_GROUND

    def run(self) -> None:
        parser = mav.MAVLink(None)
        with self._socket as link, self._ear[0]:
            while True:
                try:
                    chunk = link.recv(4096)
                except OSError:
                    return
                if not chunk:
                    return
                for message in parser.parse_buffer(chunk) or []:
                    if message.get_msgId() == mav.MAVLINK_MSG_ID_HIL_GPS:
                        self._take_gps(message)
                    elif message.get_msgId() == mav.MAVLINK_MSG_ID_HIL_SENSOR and not self._take_sensor(message):
                        return

    def _take_sensor(self, message: mav.MAVLink_hil_sensor_message) -> bool:
        """Answer one HIL_SENSOR; False at the end of the script."""
        t_s = message.time_usec / 1e6
        self.heard.sensor_us.append(message.time_usec)
        self.heard.fields.append(message.fields_updated)
        rates = np.array([message.xgyro, message.ygyro, message.zgyro])
        self._estimate(rates, np.array([message.xacc, message.yacc, message.zacc]))
        if len(self.heard.sensor_us) % 12 == 0:
            self._speak()
        if self.script.silent_s < t_s < self.script.hang_after_s:
            controls = self._fly(t_s, rates)
            mode = 1 | (128 if self._armed else 0)
            answer = mav.MAVLink_hil_actuator_controls_message(message.time_usec, [*controls, *[0.0] * 12], mode, 1)
            self._socket.sendall(answer.pack(self._mav))
        return t_s < self.script.end_s

    def _take_gps(self, message: mav.MAVLink_hil_gps_message) -> None:
        self.heard.gps_us.append(message.time_usec)
        north = math.radians(message.lat / 1e7 - HOME_DEG[0]) * EARTH_M
        east = math.radians(message.lon / 1e7 - HOME_DEG[1]) * EARTH_M * math.cos(math.radians(HOME_DEG[0]))
        self._pos += 0.1 * (np.array([north, east, HOME_M - message.alt / 1e3]) - self._pos)
        self._vel += 0.3 * (np.array([message.vn, message.ve, message.vd]) / 1e2 - self._vel)

    def _estimate(self, rates: np.ndarray, acc: np.ndarray) -> None:
        p, q, r = rates * 0.004
        self._rotation = self._rotation @ np.array([[1, -r, q], [r, 1, -p], [-q, p, 1]])
        self._rotation, _ = np.linalg.qr(self._rotation)
        self._rotation *= np.sign(np.diag(self._rotation))  # yaw starts at 0 and tilts stay small
        self._vel += (self._rotation @ acc + GRAVITY) * 0.004
        self._pos += self._vel * 0.004
        if not self._armed:
            self._vel[:] = 0.0

    def _fly(self, t_s: float, rates: np.ndarray) -> list[float]:
        script = self.script
        self._armed = script.arm_s <= t_s < script.end_s - 0.5
        flying = self._armed and t_s < script.end_s - 1.0
        airborne = script.arm_s + 1.0 < t_s < script.end_s - 0.8
        self._landed = mav.MAV_LANDED_STATE_IN_AIR if airborne else mav.MAV_LANDED_STATE_ON_GROUND
        if not flying:
            return [0.0] * 4
        goal = np.array([0.0, 0.0, -script.climb_m if t_s < script.land_s else 0.3])
        vel_sp = np.clip(goal - self._pos, [-1, -1, -1.2], [1, 1, 0.9])
        acc_sp = 2.5 * (vel_sp - self._vel)
        tilt = np.clip((self._rotation.T @ (acc_sp * [1, 1, 0]))[:2] / 9.8, -0.2, 0.2)  # forward, right
        roll = math.atan2(self._rotation[2, 1], self._rotation[2, 2])
        pitch = -math.asin(max(-1.0, min(1.0, self._rotation[2, 0])))
        error = np.array([5 * (tilt[1] - roll), 5 * (-tilt[0] - pitch), 0.0]) - rates
        self._rate_sum += error * 0.004
        thrust = min(0.8, max(0.1, HOVER * (1 - acc_sp[2] / 9.8)))
        command = [*(np.array([0.12, 0.12, 0.2]) * error + 0.1 * self._rate_sum), thrust]
        return [float(c) for c in np.clip(MIX @ command, 0.0, 1.0)]

    def _speak(self) -> None:
        mode = OFFBOARD if self._landed == mav.MAV_LANDED_STATE_IN_AIR else HOLD
        beat = mav.MAVLink_heartbeat_message(mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4, 0, mode, 4, 3)
        state = mav.MAVLink_autopilot_state_for_gimbal_device_message(
            0, 0, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, 0, self._landed
        )
        udp, address = self._ear
        for message in (beat, state):
            udp.sendto(message.pack(self._mav), address)
