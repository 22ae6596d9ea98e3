"""Does it stand, take off, land and crash as a body with legs and rotor tips does?"""

import itertools
import math

import numpy as np
import pytest

from companion.core.frames import quaternion, rotation_ned_frd
from sitl.vehicle import DT_S, Truth, Vehicle, Wind


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return Vehicle()


def watch(vehicle: Vehicle, duration_s: float) -> list[Truth]:
    rows = []
    for _ in range(round(duration_s / DT_S)):
        vehicle.step()
        rows.append(vehicle.truth())
    return rows


def speed(truth: Truth) -> float:
    return float(np.abs(truth.vel_ned_m_s).max() + np.abs(truth.rates_frd_rad_s).max())


def test_it_stands_still_at_the_origin(vehicle: Vehicle) -> None:
    vehicle.reset(seed=1, yaw_rad=0.7)
    start = vehicle.truth()
    rows = watch(vehicle, 2.0)
    assert start.t_s == 0.0
    assert all(row.on_ground for row in rows)
    assert np.abs(rows[-1].pos_ned_m).max() < 1e-6
    assert max(speed(row) for row in rows) < 1e-5
    assert rows[-1].acc_frd_m_s2 == pytest.approx([0.0, 0.0, -9.80665], abs=1e-4)


def test_idling_motors_do_not_lift_or_turn_it(vehicle: Vehicle) -> None:
    vehicle.reset(seed=1)
    vehicle.set_motors(True)
    rows = watch(vehicle, 3.0)
    assert 0.0 < rows[-1].thrust_norm < 0.05
    assert rows[-1].on_ground
    assert np.abs(rows[-1].pos_ned_m).max() < 1e-3


def test_friction_holds_it_in_a_breeze(vehicle: Vehicle) -> None:
    vehicle.reset(seed=1, wind=Wind((8.0, 0.0, 0.0)))
    rows = watch(vehicle, 5.0)
    assert np.abs(rows[-1].pos_ned_m[:2]).max() < 2e-3


def test_it_takes_off_upright_and_reaches_its_height(vehicle: Vehicle) -> None:
    vehicle.reset(seed=1)
    vehicle.set_motors(True)
    vehicle.command_position((0.0, 0.0, -2.5), yaw_rad=0.0)
    rows = watch(vehicle, 10.0)
    assert not rows[-1].on_ground
    assert sum(a.on_ground != b.on_ground for a, b in itertools.pairwise(rows)) == 1
    assert min(float(row.pos_ned_m[2]) for row in rows) > -2.6
    assert rows[-1].pos_ned_m == pytest.approx([0.0, 0.0, -2.5], abs=0.03)
    assert min(float(rotation_ned_frd(row.q_ned_frd)[2, 2]) for row in rows) > math.cos(0.01)


@pytest.mark.parametrize("sink_m_s", [0.3, 0.7, 1.5])
def test_landing_touches_once_and_rests_without_jitter(vehicle: Vehicle, sink_m_s: float) -> None:
    vehicle.place((0.0, 0.0, -2.5), quaternion(0.0, 0.0, 0.0), seed=1)
    vehicle.set_motors(True)
    vehicle.command_position((0.0, 0.0, math.nan), (math.nan, math.nan, sink_m_s), yaw_rad=0.0)
    rows = watch(vehicle, 2.5 / sink_m_s + 2.0)
    touch = next(i for i, row in enumerate(rows) if row.on_ground)
    assert all(row.on_ground for row in rows[touch:])
    assert max(speed(row) for row in rows[touch + round(0.5 / DT_S) :]) < 0.02
    vehicle.command_idle()
    vehicle.set_motors(False)
    rows = watch(vehicle, 2.0)
    assert speed(rows[-1]) < 1e-5
    assert np.abs(rows[-1].pos_ned_m).max() < 5e-3


@pytest.mark.parametrize(
    "attitude_rad",
    [(math.pi, 0.0, 0.0), (0.0, 1.5, 0.0), (1.6, 0.0, 0.4), (0.5, 2.0, 0.3), (2.8, -0.4, 2.0), (0.2, 0.1, 0.0)],
)
def test_a_drop_from_five_metres_ends_at_rest_on_the_ground(
    vehicle: Vehicle, attitude_rad: tuple[float, float, float]
) -> None:
    vehicle.place((0.0, 0.0, -5.0), quaternion(*attitude_rad), seed=1)
    rows = watch(vehicle, 6.0)
    end = rows[-1]
    assert end.on_ground
    assert speed(end) < 1e-3
    assert -0.01 < end.pos_ned_m[2] < 0.05
    assert np.abs(end.pos_ned_m[:2]).max() < 3.0
    impact = next(i for i, row in enumerate(rows) if row.on_ground)
    assert min(float(row.pos_ned_m[2]) for row in rows[impact:]) > -5.0
    assert abs(rotation_ned_frd(end.q_ned_frd)[2, 2]) > 0.99


def test_a_contact_never_adds_energy(vehicle: Vehicle) -> None:
    vehicle.place((0.0, 0.0, -2.0), quaternion(0.6, 0.3, 0.0), seed=1)
    rows = watch(vehicle, 3.0)
    energy_j_kg = [0.5 * float(row.vel_ned_m_s @ row.vel_ned_m_s) - 9.80665 * float(row.pos_ned_m[2]) for row in rows]
    assert max(energy_j_kg) <= energy_j_kg[0] * 1.001
