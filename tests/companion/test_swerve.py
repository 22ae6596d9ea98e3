"""To which side a vehicle passes what it cannot stop for, and when it brakes instead."""

import math
from dataclasses import replace

import numpy as np
import pytest
from point_mass import PointMass

from companion.core.types import F64, VehicleState
from companion.guidance.limits import LimitsParams
from companion.guidance.swerve import TURN_GAP_S, Swerve, past, setpoint, turn_aside

PARAMS = LimitsParams(swerve_m_s2=6.5)
RADIUS_M = 0.2
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
AROUND = np.arange(72) * math.tau / 72


def flying(speed_m_s: float, t_s: float = 0.0) -> VehicleState:
    return VehicleState(t_s, np.zeros(3), np.array([speed_m_s, 0.0, 0.0]), LEVEL, np.zeros(3))


def pole(north_m: float, east_m: float = 0.0, radius_m: float = 0.75) -> F64:
    return np.array([north_m, east_m]) + radius_m * np.stack([np.cos(AROUND), np.sin(AROUND)], axis=1)


def begun(points: F64, speed_m_s: float = 7.0, before: Swerve | None = None, t_s: float = 0.0) -> Swerve | None:
    return turn_aside(before, flying(speed_m_s, t_s), points, RADIUS_M, None, PARAMS)


def test_what_is_too_near_to_stop_for_is_passed_on_the_side_with_more_room() -> None:
    for east_m, side in ((0.2, -1.0), (-0.2, 1.0)):
        swerve = begun(pole(5.8, east_m))
        assert swerve is not None and swerve.side == side


def test_a_stop_from_three_metres_a_second_is_not_given_up_for_a_swerve() -> None:
    assert begun(pole(1.2, 0.1, radius_m=0.3), speed_m_s=2.9) is None
    assert begun(pole(1.6, 0.1, radius_m=0.3), speed_m_s=3.1) is not None


def test_by_default_nothing_is_swerved_for() -> None:
    assert turn_aside(None, flying(7.0), pole(5.8, 0.2), RADIUS_M, None, LimitsParams()) is None


def test_where_a_wall_leaves_no_side_it_brakes() -> None:
    wall = np.stack([np.full(401, 3.0), np.linspace(-20.0, 20.0, 401)], axis=1)
    assert begun(wall) is None


@pytest.mark.parametrize("speed_m_s", [5.0, 6.5])
def test_where_braking_ends_in_time_it_brakes_in_a_swerve_or_not(speed_m_s: float) -> None:
    for before in (None, Swerve(0.0, 1.0, 0.0)):
        assert begun(pole(6.0, 0.1), speed_m_s, before, 0.07) is None


def test_a_swerve_keeps_its_side_from_tick_to_tick_and_is_forgotten_after_a_pause() -> None:
    first = Swerve(0.0, 1.0, 0.0)
    on, anew = begun(pole(5.5, 0.3), before=first, t_s=0.07), begun(pole(5.5, 0.3), before=first, t_s=TURN_GAP_S + 0.1)
    assert on == replace(first, t_s=0.07)
    assert anew is not None and anew.side == -1.0


@pytest.mark.parametrize("speed_m_s", [6.8, 7.0])
def test_a_vehicle_with_lag_that_swerves_does_not_touch(speed_m_s: float) -> None:
    vehicle, swerve, points, nearest = PointMass(vel=(speed_m_s, 0.0), lag_s=0.1), None, pole(6.0, 0.1), math.inf
    for _ in range(40):
        state = vehicle.state()
        ahead = points[points[:, 0] > state.pos_ned_m[0] - 1.0]
        turned = turn_aside(swerve, state, ahead, RADIUS_M, None, PARAMS) if float(vehicle.pos[0]) < 5.5 else None
        swerve = turned or swerve
        assert swerve is not None
        vehicle.tick(setpoint(swerve, state, turned is not None, -2.5, 0.0, PARAMS))
        nearest = min(nearest, float(np.hypot(*(points - vehicle.pos[:2]).T).min()))
    assert nearest > RADIUS_M


def test_after_a_swerve_the_vehicle_goes_straight_on_for_a_moment() -> None:
    swerve, later = Swerve(0.0, -1.0, 1.0), flying(7.0, 1.3)
    assert past(swerve, later) and not past(swerve, flying(7.0, 2.0))
    asked = setpoint(swerve, later, False, -2.5, 0.0, PARAMS)
    assert asked.vel_ned_m_s is not None and asked.vel_ned_m_s.tolist() == [7.0, 0.0, 0.0]
