"""What do sticks change in Orbit and Follow Target? The modes stay; as PX4 v1.16 has it. In one process, no clock."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_kit import open_world

from sitl.follow import MAX_M, MIN_M, Offset, Perspective, Target
from sitl.guided_tasks import ACC_MAX_M_S2, RADIUS_MIN_M, SPEED_MAX_M_S, Circle, Nose, by_sticks
from sitl.modes import FlightMode
from sitl.pilot import CENTRED, Sticks
from sitl.px4_params import ParamStore
from sitl.simulation import SimConfig, Simulation

THERE = Offset(0.0, 0.0, 0.0)  # nothing missing
PARAMS = ParamStore({})
DEFLECTION = st.floats(-1.0, 1.0)
STICKS = st.builds(Sticks, DEFLECTION, DEFLECTION, DEFLECTION, DEFLECTION)


class Flight:
    """Hovering at 10 m, in the mode."""

    def __init__(self, mode: FlightMode) -> None:
        config = SimConfig(seed=1, px4_params={"MIS_TAKEOFF_ALT": 10.0, "FLW_TGT_HT": 10.0, "FLW_TGT_FA": 0.0})
        self.sim = Simulation(open_world(), config)
        self.ap, self.sticks, self.target_ned_m = self.sim.autopilot, CENTRED, np.zeros(3)
        self.run(3.0)
        assert self.ap.command_arm().accepted
        self.ap.command_takeoff()
        self.run(12.0)
        assert self.ap.command_mode(mode).accepted
        if mode is FlightMode.ORBIT:
            self.ap.steering.orbit(Circle(np.array([0.0, 0.0, -10.0]), 6.0, 2.0, Nose.CENTRE))

    def run(self, seconds: float) -> None:
        for tick in range(round(seconds * 25)):
            if tick % 5 == 0 and self.ap.armed:
                self.ap.hear_sticks(self.sticks)
                self.ap.steering.target = Target(self.sim.t_s, self.target_ned_m, np.zeros(3))
            self.sim.advance_to_scan()

    def hold(self, sticks: Sticks, seconds: float) -> None:
        """Then let go, and wait."""
        self.sticks = sticks
        self.run(seconds)
        self.sticks = CENTRED
        self.run(3.0)

    @property
    def seen(self) -> tuple[float, float, float]:
        """Height, distance and bearing as seen from the target."""
        north_m, east_m, down_m = self.sim.state.pos_ned_m.tolist()
        return -down_m, math.hypot(north_m, east_m), math.atan2(east_m, north_m)


def test_sticks_change_height_distance_and_angle_of_follow_target() -> None:
    """PX4's case: at least half of what a stick at its stop is to change in 3 s."""
    flight = Flight(FlightMode.FOLLOW)
    flight.run(10.0)
    before_m, _, _ = flight.seen
    flight.hold(Sticks(up=1.0), 3.0)
    assert flight.seen[0] > before_m + 1.5 * 3.0 / 2
    before_m = flight.seen[1]
    flight.hold(Sticks(forward=1.0), 3.0)
    assert flight.seen[1] > before_m + 2.0 * 3.0 / 2
    before_rad = flight.seen[2]
    flight.hold(Sticks(right=1.0), 3.0)
    turned_rad = (flight.seen[2] - before_rad) % math.tau
    assert turned_rad > 5.0 / flight.seen[1] * 3.0 / 2
    assert flight.ap.mode is FlightMode.FOLLOW


def test_sticks_change_the_circle_of_an_orbit_and_do_not_end_it() -> None:
    flight = Flight(FlightMode.ORBIT)
    flight.run(6.0)
    flight.hold(Sticks(forward=-1.0), 1.0)
    circle = flight.ap.steering.circle
    assert flight.ap.mode is FlightMode.ORBIT
    assert circle is not None
    assert circle.radius_m > 8.0
    flight.run(4.0)
    assert flight.seen[1] == pytest.approx(circle.radius_m, abs=1.0)


@given(STICKS, st.floats(0.0, 1.0))
def test_an_offset_stays_in_px4s_bounds_and_waits_for_the_vehicle(sticks: Sticks, dt_s: float) -> None:
    perspective = Perspective(PARAMS)
    for _ in range(100):
        perspective.move(sticks, THERE, dt_s)
        assert MIN_M <= perspective.offset.height_m <= MAX_M
        assert MIN_M <= perspective.offset.distance_m <= MAX_M
        assert abs(perspective.offset.angle_rad) <= math.pi
    before = perspective.offset
    perspective.move(sticks, Offset(1.0, 2.0, 1.0), dt_s)
    assert perspective.offset == before


def test_a_parameter_that_changes_counts_and_the_others_stay_as_the_sticks_left_them() -> None:
    params = ParamStore({})
    perspective = Perspective(params)
    perspective.move(Sticks(up=1.0, forward=1.0), THERE, 1.0)
    params.set("FLW_TGT_DST", 20.0)
    perspective.update()
    assert perspective.offset.distance_m == 20.0
    assert perspective.offset.height_m == pytest.approx(9.5)
    perspective.update()
    assert perspective.offset.distance_m == 20.0


@given(STICKS, st.floats(0.0, 1.0), st.sampled_from(Nose), st.sampled_from([-1.0, 1.0]))
def test_a_circle_by_sticks_is_one_that_can_be_flown(sticks: Sticks, dt_s: float, nose: Nose, sign: float) -> None:
    circle = Circle(np.zeros(3), 5.0, 2.0 * sign, nose)
    for _ in range(50):
        circle = by_sticks(circle, sticks, dt_s, PARAMS)
        assert RADIUS_MIN_M <= circle.radius_m <= PARAMS["MC_ORBIT_RAD_MAX"]
        assert abs(circle.speed_m_s) <= min(SPEED_MAX_M_S, math.sqrt(ACC_MAX_M_S2 * circle.radius_m)) + 1e-9


@pytest.mark.parametrize(
    ("nose", "speed_m_s", "sticks", "larger", "quicker"),
    [
        (Nose.CENTRE, 1.0, Sticks(forward=1.0), -1, 0),
        (Nose.CENTRE, 1.0, Sticks(right=1.0), 0, -1),
        (Nose.TANGENT, 1.0, Sticks(forward=1.0), 0, 1),
        (Nose.TANGENT, 1.0, Sticks(right=1.0), -1, 0),
        (Nose.TANGENT, -1.0, Sticks(right=1.0), 1, 0),
        (Nose.TANGENT, -1.0, Sticks(forward=1.0), 0, -1),
    ],
)
def test_sticks_mean_what_they_mean_to_px4(
    nose: Nose, speed_m_s: float, sticks: Sticks, larger: int, quicker: int
) -> None:
    circle = Circle(np.zeros(3), 5.0, speed_m_s, nose)
    after = by_sticks(circle, sticks, 0.1, PARAMS)
    assert np.sign(after.radius_m - circle.radius_m) == larger
    assert np.sign(after.speed_m_s - circle.speed_m_s) == quicker
    assert by_sticks(circle, CENTRED, 0.1, PARAMS) is circle
