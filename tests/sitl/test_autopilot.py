import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.types import LandedState, VehicleState
from sitl.answers import Result
from sitl.autopilot import READY_S, Autopilot
from sitl.demand import Loop, TrajectorySetpoint, no_axes
from sitl.modes import ARMABLE, FLYABLE, TITLES, FlightMode, base_mode, from_custom_mode, from_main_sub
from sitl.px4_params import ParamStore

TICK_S = 0.04


def state(t_s: float, down_m: float = 0.0, vel: tuple[float, float, float] = (0, 0, 0)) -> VehicleState:
    level = np.array([1.0, 0.0, 0.0, 0.0])
    return VehicleState(t_s, np.array([0.0, 0.0, down_m]), np.array(vel, dtype=float), level, np.zeros(3))


def setpoint(down_m: float = math.nan, vel_down_m_s: float = math.nan, yaw_rad: float = 0.0) -> TrajectorySetpoint:
    nothing = no_axes()
    pos, vel = nothing.copy(), nothing.copy()
    pos[2], vel[2] = down_m, vel_down_m_s
    return TrajectorySetpoint(pos, vel, nothing, yaw_rad, math.nan)


class Rig:
    """An autopilot on a vehicle that follows vertical demands at once."""

    def __init__(self, **params: float) -> None:
        self.autopilot = Autopilot(ParamStore(params))
        self.t_s = 0.0
        self.down_m = 0.0
        self.landed_states: list[LandedState] = []

    @property
    def texts(self) -> list[str]:
        return [text.text for text in self.autopilot.texts]

    def run(self, until: Callable[[], bool], limit_s: float = 60.0, stream: TrajectorySetpoint | None = None) -> float:
        """Tick until ``until()``; returns the seconds that it took."""
        start_s = self.t_s
        while not until():
            assert self.t_s - start_s < limit_s, f"not reached in {limit_s} s: {self.texts}"
            self.tick(stream)
        return self.t_s - start_s

    def for_s(self, duration_s: float, stream: TrajectorySetpoint | None = None) -> None:
        for _ in range(round(duration_s / TICK_S)):
            self.tick(stream)

    def tick(self, stream: TrajectorySetpoint | None = None) -> None:
        self.t_s += TICK_S
        vel = self._move()
        if stream is not None:
            self.autopilot.hear_setpoint(self.t_s)
            self.autopilot.use_setpoint(stream)
        self.autopilot.update(state(self.t_s, self.down_m, (0, 0, vel)), contact=self.down_m >= 0.0)
        now = self.autopilot.landed_state
        if not self.landed_states or self.landed_states[-1] is not now:
            self.landed_states.append(now)

    def _move(self) -> float:
        demand, before_m = self.autopilot.demand, self.down_m
        if demand.loop is Loop.IDLE:
            self.down_m = min(0.0, self.down_m + 2.0 * TICK_S)
        elif math.isfinite(demand.pos_ned_m[2]):
            step_m = float(np.clip(demand.pos_ned_m[2] - self.down_m, -3.0 * TICK_S, 3.0 * TICK_S))
            self.down_m = min(0.0, self.down_m + step_m)
        else:
            self.down_m = min(0.0, self.down_m + float(np.nan_to_num(demand.vel_ned_m_s[2])) * TICK_S)
        return 0.0 if self.down_m >= 0.0 else (self.down_m - before_m) / TICK_S

    def ready(self) -> "Rig":
        self.run(lambda: self.autopilot.ready)
        return self

    def flying(self) -> "Rig":
        """Armed, taken off, in HOLD."""
        self.ready()
        assert self.autopilot.command_arm().accepted
        assert self.autopilot.command_takeoff().accepted
        self.run(lambda: self.autopilot.mode is FlightMode.HOLD)
        return self


def test_mode_codes_are_those_of_px4() -> None:
    assert FlightMode.OFFBOARD == 393216
    assert FlightMode.TAKEOFF == 33816576
    assert FlightMode.HOLD == 50593792
    assert FlightMode.RTL == 84148224
    assert FlightMode.LAND == 100925440
    assert FlightMode.POSCTL == 196608
    assert FlightMode.ORBIT == 16973824
    assert all(from_custom_mode(int(mode)) is mode for mode in FlightMode)
    assert set(TITLES) == set(FlightMode)


@pytest.mark.parametrize(
    ("mode", "armed", "flags"),
    [
        (FlightMode.HOLD, False, 29),
        (FlightMode.HOLD, True, 157),
        (FlightMode.OFFBOARD, True, 145),
        (FlightMode.POSCTL, False, 81),
        (FlightMode.POSCTL, True, 209),
    ],
)
def test_base_mode_is_what_px4_was_seen_to_send(mode: FlightMode, armed: bool, flags: int) -> None:
    assert base_mode(mode, armed) == flags


def test_unknown_mode_is_temporarily_rejected() -> None:
    assert from_main_sub(42, 0) is None
    assert Rig().autopilot.command_mode(None).result is Result.TEMPORARILY_REJECTED


def test_arming_is_denied_until_the_vehicle_is_ready() -> None:
    rig = Rig()
    rig.for_s(READY_S - 2 * TICK_S)
    assert rig.autopilot.command_arm().result is Result.TEMPORARILY_REJECTED
    assert rig.texts == ["Arming denied: Resolve system health failures first"]
    rig.ready()
    assert rig.autopilot.command_arm().accepted
    assert rig.autopilot.armed
    assert rig.autopilot.command_arm().accepted, "arming twice is fine"
    assert rig.texts[-1] == "Armed by external command"


@pytest.mark.parametrize("mode", list(FlightMode))
def test_a_disarmed_vehicle_takes_every_mode_but_arms_only_in_some(mode: FlightMode) -> None:
    rig = Rig().ready()
    assert rig.autopilot.command_mode(mode).accepted
    allowed = mode in ARMABLE - {FlightMode.OFFBOARD, FlightMode.MISSION}  # no stream and no mission here
    assert rig.autopilot.command_arm().accepted is allowed
    rig.tick()


@pytest.mark.parametrize("mode", list(FlightMode))
def test_an_armed_vehicle_takes_only_modes_that_it_can_fly(mode: FlightMode) -> None:
    rig = Rig().flying()
    answer = rig.autopilot.command_mode(mode)
    allowed = mode in FLYABLE and mode is not FlightMode.OFFBOARD
    assert answer.accepted is allowed
    if not allowed:
        assert answer.text == f"Switching to {TITLES[mode]} is currently not available"
        assert rig.autopilot.mode is FlightMode.HOLD
    rig.for_s(1.0)


def test_forced_arming_survives_any_mode() -> None:
    rig = Rig()
    rig.autopilot.command_mode(FlightMode.MANUAL)
    assert rig.autopilot.command_arm(force=True).accepted
    rig.for_s(1.0)
    assert rig.autopilot.demand.loop is Loop.IDLE


def test_takeoff_reaches_its_height_and_holds_there() -> None:
    rig = Rig().flying()
    rig.for_s(2.0)
    assert rig.down_m == pytest.approx(-2.5, abs=0.02)
    assert rig.landed_states == [LandedState.ON_GROUND, LandedState.TAKEOFF, LandedState.IN_AIR]
    assert "Using default takeoff altitude: 2.5 m" in rig.texts
    assert "Takeoff detected" in rig.texts


def test_takeoff_waits_for_the_motors() -> None:
    rig = Rig().ready()
    rig.autopilot.command_takeoff(-4.0)
    rig.for_s(1.0)
    assert rig.autopilot.mode is FlightMode.TAKEOFF
    assert rig.down_m == 0.0, "legal while disarmed, but nothing climbs"
    rig.autopilot.command_arm()
    assert 1.0 <= rig.run(lambda: not rig.autopilot.landed) <= 1.8
    rig.run(lambda: rig.autopilot.mode is FlightMode.HOLD)
    assert rig.down_m == pytest.approx(-4.0, abs=0.1)


def test_takeoff_below_the_vehicle_keeps_its_height() -> None:
    rig = Rig().flying()
    rig.autopilot.command_takeoff(-1.0)
    rig.for_s(3.0)
    assert "Already higher than takeoff altitude" in rig.texts
    assert rig.down_m == pytest.approx(-2.5, abs=0.1)


def test_landing_ends_disarmed_in_hold() -> None:
    rig = Rig().flying()
    rig.autopilot.command_land()
    rig.run(lambda: rig.autopilot.landed)
    landed_s = rig.run(lambda: not rig.autopilot.armed)
    assert landed_s == pytest.approx(2.0, abs=2 * TICK_S)
    assert rig.autopilot.mode is FlightMode.HOLD
    assert rig.landed_states[-2:] == [LandedState.LANDING, LandedState.ON_GROUND]
    assert rig.texts[-3:] == ["Landing at current position", "Landing detected", "Disarmed by landing"]


def test_a_vehicle_that_never_takes_off_disarms_itself() -> None:
    rig = Rig().ready()
    rig.autopilot.command_arm()
    assert rig.run(lambda: not rig.autopilot.armed) == pytest.approx(10.0, abs=2 * TICK_S)
    assert rig.texts[-1] == "Disarmed by auto preflight disarming"


@pytest.mark.parametrize("name", ["COM_DISARM_PRFLT", "COM_DISARM_LAND"])
def test_auto_disarm_can_be_switched_off(name: str) -> None:
    rig = Rig(**{name: -1.0})
    if name == "COM_DISARM_LAND":
        rig.flying().autopilot.command_land()
    else:
        rig.ready().autopilot.command_arm()
    rig.for_s(20.0)
    assert rig.autopilot.armed
    assert rig.autopilot.landed


def test_disarming_in_the_air_needs_force() -> None:
    rig = Rig().flying()
    assert rig.autopilot.command_disarm().result is Result.TEMPORARILY_REJECTED
    assert rig.texts[-1] == "Disarming denied: not landed"
    assert rig.autopilot.command_disarm(force=True).accepted
    assert rig.autopilot.demand.loop is Loop.IDLE


def test_offboard_is_refused_without_a_stream_and_taken_with_one_setpoint() -> None:
    rig = Rig().flying()
    assert rig.autopilot.command_mode(FlightMode.OFFBOARD).text == ("Switching to Offboard is currently not available")
    rig.autopilot.hear_setpoint(rig.t_s)
    assert rig.autopilot.command_mode(FlightMode.OFFBOARD).accepted
    assert rig.autopilot.mode is FlightMode.OFFBOARD


def test_offboard_follows_the_setpoint_as_it_is() -> None:
    rig = Rig().flying()
    wanted = setpoint(down_m=-4.0, yaw_rad=1.0)
    rig.tick(wanted)
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    rig.for_s(2.0, wanted)
    assert rig.down_m == pytest.approx(-4.0, abs=0.01)
    assert rig.autopilot.demand.pos_ned_m is wanted.pos_ned_m
    assert rig.autopilot.demand.yaw_rad == 1.0


def test_a_setpoint_without_yaw_keeps_the_nose() -> None:
    rig = Rig().flying()
    for yaw_rad in (1.0, math.nan, math.nan):
        rig.tick(setpoint(down_m=-2.5, yaw_rad=yaw_rad))
        rig.autopilot.command_mode(FlightMode.OFFBOARD)
        rig.tick(setpoint(down_m=-2.5, yaw_rad=yaw_rad))
    assert rig.autopilot.demand.yaw_rad == 1.0


@pytest.mark.parametrize("wanted", [setpoint(down_m=-3.0), setpoint(vel_down_m_s=-1.0)])
def test_offboard_takes_off_from_the_ground(wanted: TrajectorySetpoint) -> None:
    rig = Rig().ready()
    rig.tick(wanted)
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    assert rig.autopilot.command_arm().accepted
    rig.run(lambda: not rig.autopilot.landed, stream=wanted)
    assert rig.landed_states == [LandedState.ON_GROUND, LandedState.IN_AIR]


def test_offboard_lands_by_a_setpoint_below_the_ground_and_stays_in_offboard() -> None:
    rig = Rig().flying()
    rig.tick(setpoint(down_m=-2.5))
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    rig.run(lambda: not rig.autopilot.armed, stream=setpoint(down_m=1.0))
    assert rig.texts[-1] == "Disarmed by landing"
    assert rig.autopilot.mode is FlightMode.OFFBOARD, "the user's wish"
    rig.for_s(2.0)
    assert rig.autopilot.command_arm().result is Result.TEMPORARILY_REJECTED, "no stream, no arming"


@pytest.mark.parametrize(
    ("action", "shown", "landed"),
    [
        (0, FlightMode.POSCTL, True),
        (1, FlightMode.ALTCTL, True),
        (2, FlightMode.STABILIZED, True),
        (3, FlightMode.RTL, True),
        (4, FlightMode.LAND, True),
        (5, FlightMode.HOLD, False),
        (99, FlightMode.LAND, True),
    ],
)
def test_a_lost_stream_leads_to_the_configured_failsafe(action: int, shown: FlightMode, landed: bool) -> None:
    rig = Rig(COM_OBL_RC_ACT=action).flying()
    rig.tick(setpoint(down_m=-2.5))
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    rig.for_s(0.4, setpoint(down_m=-2.5))
    lost_s = rig.run(lambda: rig.autopilot.failsafe is not None)
    assert lost_s == pytest.approx(1.05, abs=0.06)
    assert rig.autopilot.mode is shown
    assert "Failsafe activated" in rig.texts
    rig.for_s(20.0)
    assert rig.autopilot.armed is not landed


@pytest.mark.parametrize("action", [6, 7])
def test_a_lost_stream_can_cut_the_motors(action: int) -> None:
    rig = Rig(COM_OBL_RC_ACT=action).flying()
    rig.tick(setpoint(down_m=-2.5))
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    rig.run(lambda: not rig.autopilot.armed)
    assert rig.autopilot.demand.loop is Loop.IDLE


def test_offboard_comes_back_by_itself_when_the_stream_does() -> None:
    rig = Rig(COM_OBL_RC_ACT=5).flying()
    rig.tick(setpoint(down_m=-2.5))
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    rig.for_s(3.0)
    assert rig.autopilot.mode is FlightMode.HOLD
    rig.for_s(0.2, setpoint(down_m=-3.0))
    assert rig.autopilot.mode is FlightMode.OFFBOARD
    assert rig.autopilot.failsafe is None


def test_a_command_ends_a_failsafe() -> None:
    rig = Rig().flying()
    rig.tick(setpoint(down_m=-2.5))
    rig.autopilot.command_mode(FlightMode.OFFBOARD)
    rig.run(lambda: rig.autopilot.failsafe is not None)
    assert rig.autopilot.command_mode(FlightMode.HOLD).accepted
    rig.for_s(5.0)
    assert rig.autopilot.mode is FlightMode.HOLD
    assert not rig.autopilot.landed


def test_hold_brakes_where_px4_would_stop() -> None:
    autopilot = Autopilot()
    autopilot.command_arm(force=True)
    for i in range(10):  # in the air, 3 m/s north
        autopilot.update(state(i * TICK_S, -2.5, (3.0, 0.0, 0.0)), contact=False)
    autopilot.command_mode(FlightMode.HOLD)
    autopilot.update(state(0.4, -2.5, (3.0, 0.0, 0.0)), contact=False)
    assert autopilot.demand.pos_ned_m.tolist() == pytest.approx([3.0 * (3.0 / 6.0 + 0.6), 0.0, -2.5])


COMMANDS = st.sampled_from(
    [
        "arm",
        "force arm",
        "disarm",
        "kill",
        "takeoff",
        "land",
        "setpoint up",
        "setpoint down",
        "setpoint nothing",
        "wait",
    ]
)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(COMMANDS | st.sampled_from(list(FlightMode)), st.integers(1, 60)), max_size=25))
def test_no_sequence_of_commands_breaks_the_rules(steps: list[tuple[str | FlightMode, int]]) -> None:
    rig = Rig()
    for what, ticks in steps:
        ap = rig.autopilot
        flying_before = ap.armed and not ap.landed
        _do(rig, what)
        if flying_before and what != "kill":
            assert ap.armed, "nothing but force stops the motors in the air"
        for _ in range(ticks):
            rig.tick()
            assert ap.mode in TITLES
            assert ap.armed or ap.demand.loop is Loop.IDLE
            assert (ap.landed_state is LandedState.ON_GROUND) is ap.landed
            if ap.demand.loop is Loop.POSITION:
                both = np.concatenate([ap.demand.pos_ned_m, ap.demand.vel_ned_m_s, ap.demand.acc_ned_m_s2])
                assert np.isfinite(both).any()


def _do(rig: Rig, what: str | FlightMode) -> None:
    ap = rig.autopilot
    if isinstance(what, FlightMode):
        ap.command_mode(what)
    elif what.endswith("arm"):
        if what == "disarm":
            ap.command_disarm()
        else:
            ap.command_arm(force=what.startswith("force"))
    elif what == "kill":
        ap.command_disarm(force=True)
    elif what == "takeoff":
        ap.command_takeoff()
    elif what == "land":
        ap.command_land()
    elif what.startswith("setpoint"):
        ap.hear_setpoint(rig.t_s)
        heights = {"setpoint up": -5.0, "setpoint down": 1.0}
        ap.use_setpoint(setpoint(down_m=heights[what]) if what in heights else setpoint(vel_down_m_s=0.0))
