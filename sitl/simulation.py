"""What happens to the vehicle between one scan and the next? Physics, autopilot, LiDAR and contact; no sockets.

Vehicle time only: the same calls give the same bits, however long they take. ``advance`` stops at every scan instant
and returns what the companion would see of it, quantised as the wire does. A setpoint takes effect a configured
latency after the scan that it answers. Local ned: origin where the vehicle stands at the start; world ned where the
name says so.
"""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from companion.core.codec import from_ms, quantise_scan, quantise_state, to_ms
from companion.core.frames import quaternion, yaw_rad
from companion.core.types import F64, AutopilotStatus, Scan, Setpoint, VehicleState
from sitl.autopilot import Autopilot
from sitl.contact import ContactWatch
from sitl.demand import Demand, Loop, OffboardSetpoint
from sitl.faults import FaultBook
from sitl.geo import Origin
from sitl.lidar import Lidar, LidarParams
from sitl.mission_items import MissionType
from sitl.modes import FlightMode
from sitl.neighbours import Neighbours
from sitl.px4_params import ParamStore
from sitl.setpoints import of_companion
from sitl.trouble import Trouble
from sitl.truth_log import TruthRow
from sitl.vehicle import Loops, Truth, Vehicle, Wind
from sitl.world import World

STEP_MS: Final = 4  # 250 Hz physics
CONTROL_STEPS: Final = 10  # autopilot at 25 Hz


@dataclass(frozen=True, slots=True)
class SimConfig:
    """One run, but for the world (whose movers are already seeded)."""

    seed: int = 0  # turbulence and LiDAR noise
    spawn_ned_m: tuple[float, float] | None = None  # world north, east; None: the world's start
    spawn_yaw_rad: float = 0.0
    wind: Wind | None = None
    latency_s: float = 0.05  # from scan to setpoint in force
    radius_m: float = 0.33
    lidar: LidarParams = field(default_factory=LidarParams)
    px4_params: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()  # as ``sitl.faults`` reads them
    origin: Origin = field(default_factory=Origin)  # where on the globe the vehicle stands at the start


@dataclass(frozen=True, slots=True)
class Observation:
    """What the companion sees of one scan instant."""

    state: VehicleState
    status: AutopilotStatus
    scan: Scan


class Simulation:
    """One vehicle in one world."""

    def __init__(self, world: World, config: SimConfig | None = None, neighbours: Neighbours | None = None) -> None:
        """``neighbours``: the other vehicles of the world, for whoever tells where they are; None: there are none."""
        self.config = config or SimConfig()
        self.origin = self.config.origin
        self.neighbours = neighbours
        self.world = world
        self.rows: list[TruthRow] = []  # one a scan, until the vehicle has disarmed after its flight
        spawn = world.start_ned_m if self.config.spawn_ned_m is None else self.config.spawn_ned_m
        self.spawn_ned_m: F64 = np.array([spawn[0], spawn[1], 0.0])
        self.scan_steps = scan_steps(self.config.lidar)
        self.state: VehicleState  # the estimate at the last control tick, quantised
        self.truth: Truth
        self.scan: Scan | None = None
        self.boot_unix_us = 0  # when the vehicle booted, UNIX time; told from outside
        self._delay_steps = math.ceil((self.config.latency_s + self.config.lidar.latency_s) * 1e3 / STEP_MS - 1e-9)
        self._step = 0
        self._booted_ms = 0  # world time of the last boot
        self._queue: deque[tuple[int, OffboardSetpoint]] = deque()  # step from which it is in force
        self._vehicle = Vehicle(STEP_MS / 1e3)
        self.autopilot = Autopilot(ParamStore(loops=self._vehicle.parameters), self.origin)
        for name, value in self.config.px4_params.items():
            self.set_parameter(name, value)
        self._vehicle.reset(self.config.seed, self.config.spawn_yaw_rad, self.config.wind)
        self.trouble = Trouble(FaultBook(self.config.faults), self.config.seed, self._vehicle, self.config.wind)
        self._applied: Demand | None = None
        self._error_count = 0  # of the errors that the applied demand allows for
        self._armed = False
        self._touched = False  # before the last boot
        self._lidar = Lidar(world, self.config.lidar, self.config.seed)
        self._contact = self._contact_watch()
        self._closed = False  # no more rows
        self._sense()
        self._look()

    @property
    def contact(self) -> bool:
        """Was anything ever touched?"""
        return self._touched or self._contact.contact

    @property
    def loops(self) -> Loops:
        """What the control loops ask for."""
        return self._vehicle.loops()

    @property
    def t_s(self) -> float:
        """Vehicle time since boot."""
        return from_ms(self._step * STEP_MS)

    @property
    def world_s(self) -> float:
        """Time of the world: where movers and neighbours are. Without neighbours the world boots with the vehicle."""
        return from_ms(self._booted_ms + self._step * STEP_MS)

    @property
    def t_ms(self) -> int:
        """Vehicle time since boot, exact."""
        return self._step * STEP_MS

    @property
    def step(self) -> int:
        """Physics steps since boot."""
        return self._step

    @property
    def runs_ahead(self) -> bool:
        """Is the next scan reached before the answer to this one is in force?"""
        return self._delay_steps > self.scan_steps

    @property
    def finished(self) -> bool:
        """Has the vehicle flown and disarmed?"""
        return self.autopilot.has_flown and not self.autopilot.armed

    def advance_to_scan(self) -> Observation:
        """Advance to the next scan instant."""
        while True:
            observation = self.advance(self.scan_steps)
            if observation is not None:
                return observation

    def advance(self, steps: int) -> Observation | None:
        """Advance at most ``steps`` physics steps; stops early, with its observation, at a scan instant."""
        to_scan = self.scan_steps - self._step % self.scan_steps
        target = self._step + min(steps, to_scan)
        while self._step < target:
            self._advance_to(min(self._next_event(), target))
        return self._observe() if steps >= to_scan else None

    def submit(self, setpoint: Setpoint) -> None:
        """The companion's answer to a scan; in force one latency after ``setpoint.t_s``."""
        self.submit_trajectory(of_companion(setpoint), to_ms(setpoint.t_s))

    def submit_trajectory(self, setpoint: OffboardSetpoint, scan_ms: int | None) -> None:
        """A setpoint from the wire; ``scan_ms``: time of the scan that it answers, None: in force at once."""
        due = self._step if scan_ms is None else max(self._step, scan_ms // STEP_MS + self._delay_steps)
        while self._queue and self._queue[-1][0] >= due:
            self._queue.pop()  # overtaken by this one
        self._queue.append((due, setpoint))
        self.autopilot.hear_setpoint(self.t_s if scan_ms is None else from_ms(scan_ms))

    def set_parameter(self, name: str, value: float) -> None:
        """Change a PX4 parameter. Raises KeyError or ValueError naming it."""
        self.autopilot.params.set(name, value)
        if name in self._vehicle.parameters:
            self._vehicle.set_parameter(name, value)

    def reboot(self) -> None:
        """Start anew where the vehicle stands: vehicle time 0, disarmed; parameters and plans stay."""
        stands, plans = self.truth, self.autopilot.plans
        self.boot_unix_us += self._step * STEP_MS * 1000
        if self.neighbours is not None:  # scans stay in step with theirs
            self._booted_ms += self._step // self.scan_steps * self.scan_steps * STEP_MS
        self._step, self._applied, self._armed, self._closed, self.scan = 0, None, False, False, None
        self._queue.clear()
        self._vehicle.place(
            stands.pos_ned_m,
            quaternion(0.0, 0.0, yaw_rad(stands.q_ned_frd)),
            self.config.seed,
            self.config.wind,
        )
        self.trouble = Trouble(self.trouble.book, self.config.seed, self._vehicle, self.config.wind)
        self.autopilot = Autopilot(self.autopilot.params, self.origin)
        for kind in MissionType:
            self.autopilot.plans.replace(kind, plans.items(kind))
        self._touched = self.contact
        self._contact = self._contact_watch()
        self._sense()
        self._look()

    def refresh(self) -> None:
        """Bring ``state`` and ``truth`` up to this instant; between control ticks they lag behind."""
        self._sense()

    # --- one stretch of time ----------------------------------------------------------------------------------

    def _next_event(self) -> int:
        """The next step at which Python has something to do."""
        event = self._step + CONTROL_STEPS - self._step % CONTROL_STEPS
        if self._queue:
            event = min(event, max(self._queue[0][0], self._step))
        return min(event, max(self._contact.due_step, self._step + 1))

    def _advance_to(self, step: int) -> None:
        if step > self._step:
            self._apply()
            self._vehicle.step(step - self._step)
            self._step = step
        while self._queue and self._queue[0][0] <= self._step:
            self.autopilot.use_setpoint(self._queue.popleft()[1])
        control = self._step % CONTROL_STEPS == 0
        checked = self._step >= self._contact.due_step
        if control or checked:
            self._sense(tick=control)
        if control:
            self.autopilot.update(self.state, self.truth.on_ground)
        if checked:
            self._look()

    def _sense(self, tick: bool = False) -> None:
        truth = self.truth = self._vehicle.truth()
        if tick:
            self.trouble.update(self.t_s, CONTROL_STEPS * STEP_MS / 1e3, truth, self.autopilot)
        self.state = quantise_state(self.trouble.estimate(self.t_s, truth))

    def _look(self) -> None:
        self._contact.look(self._step, self.world_s, self.truth)

    def _observe(self) -> Observation:
        ap = self.autopilot
        mode, landed = ap.mode, ap.landed_state
        self._check_scan_instant()
        scan = self._sweep()
        self.scan = quantise_scan(scan)
        clearance_m = self._contact.take_smallest_m()
        if not self._closed:
            self._closed = self.finished  # the last row shows the vehicle disarmed
            self.rows.append(TruthRow(self.t_ms, self.truth, clearance_m, self.contact, mode, ap.armed, landed))
        status = AutopilotStatus(ap.armed, mode is FlightMode.OFFBOARD, landed)
        return Observation(self.state, status, self.scan)

    def _sweep(self) -> Scan:
        pos_world_ned_m, circles = self.truth.pos_ned_m + self.spawn_ned_m, None
        if self.neighbours is not None:
            seen = self.neighbours.circles(self.world_s, float(pos_world_ned_m[2]))
            circles = np.concatenate([self.world.at(self.world_s), seen])
        return self._lidar.scan(self.t_s, pos_world_ned_m, self.truth.q_ned_frd, circles)

    def _contact_watch(self) -> ContactWatch:
        c, step_s = self.config, STEP_MS / 1e3
        return ContactWatch(self.world, c.radius_m, self.spawn_ned_m, step_s, self.scan_steps, self.neighbours)

    def _check_scan_instant(self) -> None:
        """A scan instant off the control grid has neither state nor clearance yet."""
        if self._step % CONTROL_STEPS:
            self._sense()
        if self._contact.due_step <= self._step:
            self._look()

    # --- to the vehicle ---------------------------------------------------------------------------------------

    def _apply(self) -> None:
        ap = self.autopilot
        if ap.motors_on is not self._armed:
            self._armed = ap.motors_on
            self._vehicle.set_motors(self._armed)
        demand, errors = ap.demand, self.trouble.errors
        if demand is self._applied and errors.count == self._error_count:
            return
        self._applied, self._error_count = demand, errors.count
        if demand.loop is Loop.IDLE:
            self._vehicle.command_idle()
            return
        if demand.q_ned_frd is not None:
            self._vehicle.command_attitude(demand.q_ned_frd, demand.thrust_norm)
            return
        if demand.rates_frd_rad_s is not None:
            self._vehicle.command_rates(demand.rates_frd_rad_s.tolist(), demand.thrust_norm)
            return
        pos_ned_m, vel_ned_m_s = demand.pos_ned_m, demand.vel_ned_m_s
        if errors.any:
            pos_ned_m, vel_ned_m_s = self.trouble.shifted(pos_ned_m, vel_ned_m_s)
        self._vehicle.command_position(
            pos_ned_m.tolist(),
            vel_ned_m_s.tolist(),
            demand.acc_ned_m_s2.tolist(),
            demand.yaw_rad,
            demand.yaw_rate_rad_s,
        )


def scan_steps(params: LidarParams) -> int:
    """Physics steps from scan to scan. Raises ValueError when the rate does not fit the physics."""
    steps = round(1e3 / STEP_MS / params.rate_hz)
    if steps < 1 or not math.isclose(steps * STEP_MS / 1e3 * params.rate_hz, 1.0, rel_tol=1e-6):
        raise ValueError(f"LiDAR: {params.rate_hz} Hz is no whole number of {STEP_MS} ms physics steps")
    return steps
