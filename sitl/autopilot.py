"""What does the autopilot do with commands, setpoints and time? PX4's commander, without sockets and without physics.

Feed ``update`` with the vehicle's state at every control tick, call a ``command_*`` when one arrives, and read
``armed``, ``mode``, ``landed_state`` and ``demand``. What PX4 would say as STATUSTEXT gathers in ``texts``.
Local ned: the origin is where the vehicle booted.
"""

import math
from typing import Final

from companion.core.types import LandedState, VehicleState
from sitl.answers import ACCEPTED, CRITICAL, INFO, CommandResult, Result, StatusText
from sitl.demand import IDLE, Demand, OffboardSetpoint
from sitl.failsafe import Facts, Failsafe, without_sticks
from sitl.geo import Origin
from sitl.home import Home, here
from sitl.land_detector import LandDetector
from sitl.modes import ARMABLE, AUTONOMOUS, FLYABLE, MANUAL, TITLES, FlightMode
from sitl.navigator import Navigator
from sitl.offboard_stream import OffboardStream
from sitl.pilot import Sticks
from sitl.px4_params import ParamStore
from sitl.steering import BEHAVIOURS, Behaviour, Steering

READY_S: Final = 2.5  # PX4 v1.16 SIH: prearm checks pass two to three seconds after boot


class Autopilot:
    """Arming, flight modes, take-off, landing, failsafe."""

    def __init__(self, params: ParamStore | None = None, origin: Origin | None = None) -> None:
        """``origin``: where on the globe local ned begins."""
        self.params = params or ParamStore()
        self.armed = False
        self.user_mode = FlightMode.HOLD  # what was asked for; ``mode`` is what is flown
        self.failsafe: Failsafe | None = None
        self.has_flown = False
        self.demand: Demand = IDLE
        self.home: Home | None = None  # None until the position is known
        self.texts: list[StatusText] = []
        self._state: VehicleState | None = None
        self._detector = LandDetector()
        self.steering = Steering(self.params)
        self._ready_said = False
        self.armed_s = self.takeoff_s = math.inf  # vehicle time of the last arming and take-off
        self._landed_s = math.inf  # since when armed and landed
        self.flights = 0
        self._stream = OffboardStream(self.params)
        self._mode_chosen = False  # by a person, since the last update
        nav = self._navigator = Navigator(self.params, self.steering, self.texts.append, origin or Origin())
        self.plans, self.mission, self.guardian = nav.plans, nav.mission, nav.guardian

    # --- what others see --------------------------------------------------------------------------------------

    @property
    def t_s(self) -> float:
        """Vehicle time of the last update."""
        return self._state.t_s if self._state is not None else 0.0

    @property
    def ready(self) -> bool:
        """Have the prearm checks passed?"""
        return self.t_s >= READY_S and self.guardian.fit

    @property
    def mode(self) -> FlightMode:
        """The flight mode that HEARTBEAT shows."""
        return self.failsafe.mode if self.failsafe is not None else self.user_mode

    @property
    def state(self) -> VehicleState | None:
        """The estimate of the last update."""
        return self._state

    @property
    def motors_on(self) -> bool:
        """Do the rotors turn?"""
        return self.armed and self._behaviour() is not Behaviour.CUT

    @property
    def landed(self) -> bool:
        """What the land detector says."""
        return self._detector.landed

    @property
    def landed_state(self) -> LandedState:
        """MAV_LANDED_STATE as EXTENDED_SYS_STATE shows it."""
        if self.landed:
            return LandedState.ON_GROUND
        if self.mode is FlightMode.TAKEOFF:
            return LandedState.TAKEOFF
        returns = self.mode is FlightMode.RTL and self.steering.landing
        coming_down = returns or (self.mode is FlightMode.MISSION and self.mission.landing)
        return LandedState.LANDING if self.mode is FlightMode.LAND or coming_down else LandedState.IN_AIR

    # --- what arrives -----------------------------------------------------------------------------------------

    def hear_setpoint(self, t_s: float) -> None:
        """A setpoint arrived: proof of life of the OFFBOARD stream, in any mode."""
        self._stream.hear(t_s)

    def hear_sticks(self, sticks: Sticks) -> None:
        """MANUAL_CONTROL arrived."""
        pilot = self.steering.pilot
        pilot.hear(self.t_s, sticks)
        if self.armed and self.mode in AUTONOMOUS and pilot.takes_over(self.t_s):
            self._say(INFO, "Pilot took over using sticks")
            self._choose_mode(FlightMode.POSCTL)

    def set_home(self, home: Home) -> None:
        """From now on this is home."""
        self.home = self.steering.home = home

    def use_setpoint(self, setpoint: OffboardSetpoint) -> None:
        """From now on this is what OFFBOARD flies."""
        self._stream.setpoint = setpoint
        if self._state is not None and self._steers() and self.mode is FlightMode.OFFBOARD:
            self.demand = self.steering.demand(Behaviour.OFFBOARD, self._state, setpoint)

    def command_arm(self, force: bool = False, reason: str = "external command") -> CommandResult:
        """MAV_CMD_COMPONENT_ARM_DISARM with 1."""
        if self.armed:
            return ACCEPTED
        allowed = self.user_mode in ARMABLE | MANUAL and self._flyable(self.user_mode)
        if not force and not (self.ready and allowed):
            return self._refuse("Arming denied: Resolve system health failures first")
        self.armed = True
        if self._state is not None and self.params["COM_HOME_EN"] and not (self.home is not None and self.home.manual):
            self.set_home(here(self._state))
        self.armed_s = self._landed_s = self.t_s
        self.steering.restart()
        self._say(INFO, f"Armed by {reason}")
        return ACCEPTED

    def command_disarm(self, force: bool = False) -> CommandResult:
        """MAV_CMD_COMPONENT_ARM_DISARM with 0; ``force`` stops the motors in the air."""
        if not self.armed:
            return ACCEPTED
        if not (force or self.landed):
            return self._refuse("Disarming denied: not landed")
        self._disarm("Disarmed by external command")
        return ACCEPTED

    def command_mode(self, mode: FlightMode | None) -> CommandResult:
        """MAV_CMD_DO_SET_MODE; None is a mode that PX4 does not have."""
        if mode is None:
            return CommandResult(Result.TEMPORARILY_REJECTED, "Unsupported mode")
        stuck = self.user_mode is FlightMode.TERMINATION and mode is not self.user_mode
        if self.armed and (stuck or not self._flyable(mode)):
            return self._refuse(f"Switching to {TITLES[mode]} is currently not available")
        self._choose_mode(mode)
        return ACCEPTED

    def command_mission(self) -> CommandResult:
        """MAV_CMD_MISSION_START: fly the mission, and arm for it."""
        if not self._navigator.mission_flyable():
            self._say(CRITICAL, "Mission start denied! No valid mission")
            return CommandResult(Result.DENIED)
        chosen = self.command_mode(FlightMode.MISSION)
        return self.command_arm(reason="mission start") if chosen.accepted else chosen

    def command_takeoff(self, down_m: float | None = None) -> CommandResult:
        """MAV_CMD_NAV_TAKEOFF to a local altitude; None: MIS_TAKEOFF_ALT above here."""
        here_m = float(self._state.pos_ned_m[2]) if self._state is not None else 0.0
        if down_m is None:
            height_m = float(self.params["MIS_TAKEOFF_ALT"])
            self._say(INFO, f"Using default takeoff altitude: {height_m:.1f} m")
            down_m = here_m - height_m
        elif down_m > here_m:
            self._say(CRITICAL, "Already higher than takeoff altitude")
        self._choose_mode(FlightMode.TAKEOFF)
        self.steering.restart()
        self.steering.takeoff_down_m = down_m
        return ACCEPTED

    def command_land(self) -> CommandResult:
        """MAV_CMD_NAV_LAND: here."""
        self._choose_mode(FlightMode.LAND)
        return ACCEPTED

    # --- time passes ------------------------------------------------------------------------------------------

    def update(self, state: VehicleState, contact: bool) -> None:
        """One control tick; ``contact``: any part touches the ground."""
        self._state = state
        if not self._ready_said and self.ready:
            self._ready_said = True
            if self.home is None:
                self.set_home(here(state))
            self._say(INFO, "Ready for takeoff!")
        self._detect_ground(state, contact)
        self._guard(state)
        if not self.armed:
            self.demand = IDLE
            return
        self._watch_sticks()
        self._fly_mission(state)
        self._watch_disarm()
        if not self._steers():
            self.demand = IDLE
            return
        self.demand = self.steering.demand(self._behaviour(), state, self._stream.setpoint)
        if self.mode is FlightMode.TAKEOFF and self.steering.arrived(state):
            self.user_mode = FlightMode.HOLD
            self.steering.settle()

    def _detect_ground(self, state: VehicleState, contact: bool) -> None:
        if not self._detector.update(state, contact, self._wants_up(), self.guardian.position_ok):
            return
        if self.landed:
            self._landed_s = state.t_s
            self.steering.restart()
            self._say(INFO, "Landing detected")
        else:
            self.has_flown = True
            self.takeoff_s = state.t_s
            self.flights += 1
            self._say(INFO, "Takeoff detected")

    def _guard(self, state: VehicleState) -> None:
        """Enter or leave a failsafe; the intended mode comes back by itself when nothing is wrong any more."""
        lost = self.user_mode is FlightMode.OFFBOARD and not self._stream.fresh(self.t_s)
        blind = self.user_mode in MANUAL - {FlightMode.POSCTL, FlightMode.POSITION_SLOW}
        by_stream = self.user_mode is FlightMode.OFFBOARD and not self._stream.needs_position
        chosen, self._mode_chosen = self._mode_chosen, False
        armed_for_s = self.t_s - self.armed_s
        needs_position = not (blind or by_stream)
        facts = Facts(self.t_s, self.armed, self.user_mode, armed_for_s, chosen, lost, needs_position=needs_position)
        failsafe = self._navigator.failsafe(state, self.landed, facts)
        if failsafe == self.failsafe or not self.armed:
            return
        self.failsafe = failsafe
        self.steering.restart()
        if failsafe is not None and failsafe.behaviour is Behaviour.CUT:
            self._disarm("Disarmed by failsafe")

    def _fly_mission(self, state: VehicleState) -> None:
        ends_in = self._navigator.fly(self._behaviour() is Behaviour.MISSION, state, self.landed)
        if ends_in is not None:
            self._change_mode(ends_in)
        if ends_in is FlightMode.HOLD:
            self.steering.adopt(self.mission.settle())

    def _watch_sticks(self) -> None:
        if self.mode not in MANUAL or self.user_mode not in MANUAL or self.steering.pilot.present(self.t_s):
            return
        self._say(CRITICAL, "Manual control lost")
        self._say(CRITICAL, "Failsafe activated")
        self._change_mode(without_sticks(self.params))

    def _watch_disarm(self) -> None:
        if not (self.armed and self.landed):
            return
        flown = self._landed_s > self.armed_s
        limit_s = self.params["COM_DISARM_LAND" if flown else "COM_DISARM_PRFLT"]
        if limit_s > 0.0 and not self._wants_up() and self.t_s - self._landed_s >= limit_s:
            self._disarm("Disarmed by landing" if flown else "Disarmed by auto preflight disarming")

    def _steers(self) -> bool:
        """Do the loops act? Not while disarmed, spooling up, or on the ground without a wish to leave it."""
        if not self.motors_on:
            return False
        if not self.landed:
            return True
        return self._wants_up() and self.t_s - self.armed_s >= self.params["COM_SPOOLUP_TIME"]

    def _wants_up(self) -> bool:
        if not self.armed or self._state is None:
            return False
        return self.steering.climbs(self._behaviour(), self._state, self._stream.setpoint)

    def _behaviour(self) -> Behaviour:
        return self.failsafe.behaviour if self.failsafe is not None else BEHAVIOURS.get(self.user_mode, Behaviour.HOLD)

    def _flyable(self, mode: FlightMode) -> bool:
        if mode in MANUAL:
            return self.steering.pilot.present(self.t_s)
        if mode is FlightMode.MISSION:
            return self._navigator.mission_flyable()
        return mode in FLYABLE and (mode is not FlightMode.OFFBOARD or self._stream.fresh(self.t_s))

    def _choose_mode(self, mode: FlightMode) -> None:
        """A person wants this mode."""
        self._mode_chosen = True
        self._change_mode(mode)

    def _change_mode(self, mode: FlightMode) -> None:
        if mode is self.user_mode and self.failsafe is None:
            return
        self.user_mode = mode
        self.failsafe = None
        self.steering.restart()
        if mode is FlightMode.LAND and self.armed:
            self._say(INFO, "Landing at current position")
        elif mode is FlightMode.TERMINATION and self.armed:
            self._say(CRITICAL, "Flight termination active")

    def _disarm(self, text: str) -> None:
        self.armed = False
        self.failsafe = None
        self.demand = IDLE
        if self.user_mode is not FlightMode.OFFBOARD and self.user_mode not in MANUAL:
            self.user_mode = FlightMode.HOLD
        self._say(INFO, text)

    def _refuse(self, text: str) -> CommandResult:
        self._say(CRITICAL, text)
        return CommandResult(Result.TEMPORARILY_REJECTED, text)

    def _say(self, severity: int, text: str) -> None:
        self.texts.append(StatusText(severity, text))
