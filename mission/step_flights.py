"""How are the steps flown, by the embedded stack and by a real PX4 on the same aircraft? Gives the truth of each."""

import math
import tempfile
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.clock import SystemClock
from companion.core.codec import VEHICLE_COMPONENT
from companion.core.mavlink import Connection
from companion.core.types import F64
from companion.core.udp import udp_in
from mission.errors import FlightError
from mission.processes import Children
from mission.px4_firmware import Px4Build, start
from mission.step_plan import END_S, Ask, ask_at, open_world, track_of
from sitl.demand import TrajectorySetpoint
from sitl.hil_sensors import HilSensors, SensorNoise
from sitl.link import HOST
from sitl.modes import MAIN_OFFBOARD, FlightMode
from sitl.px4_app import open_links, open_plant
from sitl.px4_bridge import Bridge
from sitl.simulation import SimConfig, Simulation
from sitl.truth_log import TruthRow
from sitl.vehicle_config import Firmware, VehicleConfig

SEED: Final = 1
COMPANION_PORT: Final = 14540
COMPANION: Final = mav.MAV_COMP_ID_ONBOARD_COMPUTER
FIT_S: Final = 10.0  # vehicle time at which the arming checks have long passed
GIVE_UP_S: Final = 60.0
SAMPLE_STEPS: Final = 5  # 50 Hz
AGAIN_S: Final = 0.5  # between two requests to arm
# GPS as good as a motion capture system: what is compared are control loops, not how well a position is known.
NOISE: Final = SensorNoise(gps_ne_m=0.01, gps_down_m=0.02, gps_vel_ne_m_s=0.01, gps_vel_down_m_s=0.02)
NOT_ACC: Final = 0b111 << 6
NOT_YAW_RATE: Final = 1 << 11


def fly_embedded() -> F64:
    """The track of the embedded stack, see ``track_of``."""
    sim = Simulation(open_world(), SimConfig(seed=SEED))
    rows: list[TruthRow] = []
    began_s = math.nan
    while not sim.t_s - began_s > END_S:
        sim.advance(SAMPLE_STEPS)
        sim.refresh()
        ask = ask_at(sim.t_s - began_s if math.isfinite(began_s) else 0.0)
        pos, vel, no_acc = np.array(ask.pos_ned_m), np.array(ask.vel_ned_m_s), np.full(3, math.nan)
        sim.submit_trajectory(TrajectorySetpoint(pos, vel, no_acc, ask.yaw_rad, 0.0), None)
        if math.isnan(began_s) and sim.t_s > FIT_S:
            sim.autopilot.command_mode(FlightMode.OFFBOARD)
            sim.autopilot.command_arm()
            began_s = sim.t_s
        ap = sim.autopilot
        rows.append(TruthRow(sim.t_ms, sim.truth, 0.0, False, ap.mode, ap.armed, ap.landed_state))
    return track_of(rows, began_s)


def fly_px4(build: Px4Build, instance: int) -> F64:
    """The track of a real PX4, in real time. Raises FlightError when it does not fly."""
    rows = _Rows()
    clock = SystemClock()
    config = VehicleConfig(open_world(), SimConfig(seed=SEED), instance=instance, firmware=Firmware.PX4)
    plant = open_plant(config)
    with ExitStack() as stack:
        links = open_links(config, plant, clock, stack)
        port = udp_in(HOST, COMPANION_PORT + instance, clock)
        stack.callback(port.close)
        client = _Client(Connection(port, instance + 1, COMPANION), instance + 1)
        stack.enter_context(client)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="swiftnav_steps_")))
        children = stack.enter_context(Children())
        firmware = start(children, build, instance, folder / "px4", folder / "px4.log")
        bridge = Bridge(plant, HilSensors(SEED, noise=NOISE), links, 1.0, clock, rows)
        bridge.run(lambda: client.over or firmware.exit_code is not None or client.late(plant.truth.t_s))
        last_line = firmware.last_line()
    if not client.over:
        raise FlightError(f"PX4 did not fly the steps: {'; '.join(client.texts) or last_line}")
    return track_of(rows.rows, client.began_s)


class _Rows:
    """Truth that is kept, where a file would be."""

    def __init__(self) -> None:
        self.rows: list[TruthRow] = []

    def write(self, rows: list[TruthRow]) -> None:
        self.rows += rows
        rows.clear()

    def flush(self) -> None:
        """Nothing can be lost."""


class _Client(threading.Thread):
    """A companion that streams the plan's setpoints by the vehicle's clock, and arms."""

    def __init__(self, connection: Connection, system: int) -> None:
        super().__init__(daemon=True)
        self.began_s = math.nan  # vehicle time at which it was armed
        self.over = False
        self.texts: list[str] = []
        self._connection = connection
        self._system = system
        self._armed = False
        self._asked_s = -math.inf
        self._ended = threading.Event()

    def __enter__(self) -> "_Client":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.join()

    def late(self, t_s: float) -> bool:
        """Should it have been armed long ago?"""
        return math.isnan(self.began_s) and t_s > GIVE_UP_S

    def run(self) -> None:
        while not self._ended.is_set():
            for message in self._connection.receive(0.02):
                kind = message.get_msgId()
                if message.get_srcComponent() != VEHICLE_COMPONENT:
                    continue
                if kind == mav.MAVLINK_MSG_ID_STATUSTEXT:
                    self.texts.append(message.text)
                elif kind == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
                    self._at(message.time_boot_ms / 1e3)
                elif kind == mav.MAVLINK_MSG_ID_HEARTBEAT and message.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED:
                    self._armed = True

    def _at(self, t_s: float) -> None:
        if self._armed and math.isnan(self.began_s):
            self.began_s = t_s
        flown_s = t_s - self.began_s
        self.over = self.over or flown_s > END_S
        self._connection.send(_setpoint(ask_at(flown_s if math.isfinite(flown_s) else 0.0), t_s, self._system))
        if not self._armed and t_s > FIT_S and t_s - self._asked_s > AGAIN_S:
            self._asked_s = t_s
            custom = float(mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
            self._order(mav.MAV_CMD_DO_SET_MODE, custom, float(MAIN_OFFBOARD))
            self._order(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def _order(self, command: int, *params: float) -> None:
        filled = [*params, *[0.0] * 7][:7]
        self._connection.send(mav.MAVLink_command_long_message(self._system, VEHICLE_COMPONENT, command, 0, *filled))


def _setpoint(ask: Ask, t_s: float, system: int) -> mav.MAVLink_set_position_target_local_ned_message:
    values = (*ask.pos_ned_m, *ask.vel_ned_m_s)
    mask = sum(1 << axis for axis, value in enumerate(values) if math.isnan(value)) | NOT_ACC | NOT_YAW_RATE
    filled = [0.0 if math.isnan(value) else value for value in values]
    return mav.MAVLink_set_position_target_local_ned_message(
        round(t_s * 1e3), system, VEHICLE_COMPONENT, mav.MAV_FRAME_LOCAL_NED, mask, *filled, 0, 0, 0, ask.yaw_rad, 0
    )
