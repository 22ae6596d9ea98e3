"""What does the aircraft do while a real PX4 turns its motors? Physics, LiDAR and contact; no sockets, no autopilot.

The sibling of ``simulation`` without the embedded flight stack; vehicle time only, local ned from where it stands.
"""

from dataclasses import dataclass

import numpy as np

from companion.core.codec import quantise_scan
from companion.core.types import F64, LandedState, Scan
from sitl.contact import ContactWatch
from sitl.lidar import Lidar
from sitl.modes import FlightMode
from sitl.px4_airframe import Airframe
from sitl.simulation import STEP_MS, SimConfig, scan_steps
from sitl.truth_log import TruthRow
from sitl.vehicle import Truth, Vehicle
from sitl.world import World


@dataclass(slots=True)
class FirmwareStatus:
    """What PX4 last said of itself."""

    mode: FlightMode = FlightMode.HOLD  # PX4 boots into it
    armed: bool = False
    landed: LandedState = LandedState.ON_GROUND
    has_flown: bool = False

    @property
    def finished(self) -> bool:
        """Has it flown and disarmed?"""
        return self.has_flown and not self.armed


class Plant:
    """One aircraft in one world under motor commands."""

    def __init__(self, world: World, config: SimConfig, airframe: Airframe) -> None:
        self.world = world
        self.status = FirmwareStatus()  # kept up to date by whoever listens to PX4
        self.rows: list[TruthRow] = []  # one a scan, until the flight is over
        self.step = 0
        spawn = world.start_ned_m if config.spawn_ned_m is None else config.spawn_ned_m
        self.spawn_ned_m: F64 = np.array([spawn[0], spawn[1], 0.0])
        self.scan_steps = scan_steps(config.lidar)
        self._airframe = airframe
        self._vehicle = Vehicle(STEP_MS / 1e3)
        self._vehicle.mount_rotors(airframe.own_positions())
        self._vehicle.reset(config.seed, config.spawn_yaw_rad, config.wind)
        self._lidar = Lidar(world, config.lidar, config.seed)
        self._contact = ContactWatch(world, config.radius_m, self.spawn_ned_m, STEP_MS / 1e3, self.scan_steps)
        self._motors_on = False
        self._closed = False  # no more rows
        self.truth: Truth = self._vehicle.truth()
        self._contact.look(self.step, self.truth.t_s, self.truth)

    @property
    def contact(self) -> bool:
        """Was anything ever touched?"""
        return self._contact.contact

    def advance(self, controls: list[float], armed: bool) -> None:
        """One physics step under PX4's motor outputs (at least 4, its order)."""
        if armed is not self._motors_on:
            self._motors_on = armed
            self._vehicle.set_motors(armed)
        self._vehicle.command_motors(self._airframe.own_order(controls))
        self._vehicle.step()
        self.step += 1
        self.truth = self._vehicle.truth()
        if self.step >= self._contact.due_step:
            self._contact.look(self.step, self.truth.t_s, self.truth)

    @property
    def scan_due(self) -> bool:
        """Is this a scan instant?"""
        return self.step % self.scan_steps == 0

    def observe(self) -> Scan:
        """The scan of this instant, quantised as the wire does, and a row of truth."""
        truth, status = self.truth, self.status
        if not self._closed:
            self._closed = status.finished  # the last row shows the vehicle disarmed
            clearance_m = self._contact.take_smallest_m()
            row = TruthRow(
                self.step * STEP_MS, truth, clearance_m, self.contact, status.mode, status.armed, status.landed
            )
            self.rows.append(row)
        return quantise_scan(self._lidar.scan(truth.t_s, truth.pos_ned_m + self.spawn_ned_m, truth.q_ned_frd))
