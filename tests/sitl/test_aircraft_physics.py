"""Does the aircraft obey physics? Compared with constants and laws written down here, not with the model itself."""

import math

import numpy as np
import pytest

from companion.core.frames import quaternion, rotation_ned_frd
from companion.core.types import F64
from sitl.vehicle import DT_S, Truth, Vehicle, Wind

MASS_KG = 0.907
G_M_S2 = 9.80665
WEIGHT_N = MASS_KG * G_M_S2
FULL_THRUST_N = 19.6
AREA_M2 = np.array([0.012, 0.012, 0.030])
ROTOR_DRAG_N_S_M = 0.125  # at hover
INERTIA_KG_M2 = np.array([0.0045, 0.0055, 0.0090])
MOTOR_LAG_S = 0.035
LEVEL = quaternion(0.0, 0.0, 0.0)
DOWN = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return Vehicle()


def air_density_kg_m3(alt_m: float) -> float:
    """International Standard Atmosphere, troposphere."""
    return 1.225 * math.pow(1 - 2.25577e-5 * alt_m, 4.2559)


def hover(vehicle: Vehicle, alt_m: float = 50.0, settle_s: float = 4.0) -> None:
    vehicle.place((0, 0, -alt_m), LEVEL, seed=1)
    vehicle.set_motors(True)
    vehicle.command_position((0, 0, -alt_m), yaw_rad=0.0)
    vehicle.step(round(settle_s / DT_S))


def record(vehicle: Vehicle, duration_s: float) -> list[Truth]:
    rows = [vehicle.truth()]
    for _ in range(round(duration_s / DT_S)):
        vehicle.step()
        rows.append(vehicle.truth())
    return rows


def manoeuvre(vehicle: Vehicle) -> list[Truth]:
    """Sprint, climb, turn and brake: every term of the balance takes part."""
    hover(vehicle)
    vehicle.command_position(None, (12.0, 4.0, -3.0), yaw_rad=0.6)
    rows = record(vehicle, 3.0)
    vehicle.command_position(None, (-5.0, 9.0, 2.0), yaw_rad=0.2)
    rows += record(vehicle, 2.0)[1:]
    vehicle.command_position((0.0, 0.0, -60.0), yaw_rad=0.0)
    return rows + record(vehicle, 3.0)[1:]


def force_ned_n(truth: Truth) -> F64:
    """Thrust, body drag and rotor drag in still air, from the laws in the aircraft's description."""
    rotation = rotation_ned_frd(truth.q_ned_frd)
    vel_frd_m_s = rotation.T @ truth.vel_ned_m_s
    thrust_n = truth.thrust_norm * FULL_THRUST_N
    rotor_drag = ROTOR_DRAG_N_S_M * math.sqrt(thrust_n / WEIGHT_N) * np.array([1.0, 1.0, 0.0])
    density = air_density_kg_m3(-float(truth.pos_ned_m[2]))
    body_drag = 0.5 * density * float(np.linalg.norm(vel_frd_m_s)) * AREA_M2
    force: F64 = rotation @ (-(body_drag + rotor_drag) * vel_frd_m_s - thrust_n * DOWN) + WEIGHT_N * DOWN
    return force


def energy_j(truth: Truth) -> float:
    rotational = 0.5 * float(INERTIA_KG_M2 @ truth.rates_frd_rad_s**2)
    kinetic = 0.5 * MASS_KG * float(truth.vel_ned_m_s @ truth.vel_ned_m_s)
    return rotational + kinetic - WEIGHT_N * float(truth.pos_ned_m[2])


def test_hover_thrust_equals_weight(vehicle: Vehicle) -> None:
    hover(vehicle, settle_s=15.0)
    density_ratio = air_density_kg_m3(50.0) / 1.225
    truth = vehicle.truth()
    assert truth.thrust_norm * FULL_THRUST_N == pytest.approx(WEIGHT_N, rel=1e-4)
    assert truth.acc_frd_m_s2 == pytest.approx([0.0, 0.0, -G_M_S2], abs=1e-3)
    assert vehicle._fdm["mix/thrust"] == pytest.approx(WEIGHT_N / FULL_THRUST_N / density_ratio, rel=1e-3)


def test_a_dropped_vehicle_falls_with_g_before_drag_grows(vehicle: Vehicle) -> None:
    vehicle.place((0, 0, -100), LEVEL, seed=1)
    vehicle.step(25)
    truth = vehicle.truth()
    assert truth.vel_ned_m_s[2] / truth.t_s == pytest.approx(G_M_S2, rel=1e-3)
    assert truth.pos_ned_m[2] + 100 == pytest.approx(0.5 * G_M_S2 * truth.t_s**2, rel=5e-3)
    assert np.abs(truth.acc_frd_m_s2).max() < 0.03


def test_terminal_speed_is_where_drag_meets_weight(vehicle: Vehicle) -> None:
    vehicle.place((0, 0, -600), LEVEL, seed=1)
    vehicle.step(round(12 / DT_S))
    truth = vehicle.truth()
    density = air_density_kg_m3(-float(truth.pos_ned_m[2]))
    assert truth.vel_ned_m_s[2] == pytest.approx(math.sqrt(2 * WEIGHT_N / (density * AREA_M2[2])), rel=3e-3)


def test_momentum_changes_by_the_impulse_of_all_forces(vehicle: Vehicle) -> None:
    rows = manoeuvre(vehicle)
    force = np.array([force_ned_n(row) for row in rows])
    impulse = (force[1:] + force[:-1]).sum(axis=0) * DT_S / 2
    change = MASS_KG * (rows[-1].vel_ned_m_s - rows[0].vel_ned_m_s)
    scale = np.abs(force).sum(axis=0) * DT_S
    assert np.abs(impulse - change).max() < 0.002 * scale.max()


def test_energy_changes_by_the_work_of_thrust_and_drag(vehicle: Vehicle) -> None:
    rows = manoeuvre(vehicle)
    power = np.array([(force_ned_n(row) - WEIGHT_N * DOWN) @ row.vel_ned_m_s for row in rows])
    work_j = float((power[1:] + power[:-1]).sum()) * DT_S / 2
    turnover_j = float(np.abs(power).sum()) * DT_S
    assert energy_j(rows[-1]) - energy_j(rows[0]) == pytest.approx(work_j, abs=0.004 * turnover_j)


def test_the_accelerometer_reads_every_force_but_gravity(vehicle: Vehicle) -> None:
    for truth in manoeuvre(vehicle)[::50]:
        felt_ned = rotation_ned_frd(truth.q_ned_frd) @ truth.acc_frd_m_s2
        assert MASS_KG * felt_ned == pytest.approx(force_ned_n(truth) - WEIGHT_N * DOWN, abs=0.08)


@pytest.mark.parametrize("course_deg", [0, 90, 225])
def test_local_position_is_the_integral_of_velocity_over_100_m(vehicle: Vehicle, course_deg: float) -> None:
    hover(vehicle)
    speed = 15 * np.array([math.cos(math.radians(course_deg)), math.sin(math.radians(course_deg)), -0.05])
    vehicle.command_position(None, speed, yaw_rad=0.0)
    rows = record(vehicle, 9.0)
    vel = np.array([row.vel_ned_m_s for row in rows])
    travelled = (vel[1:] + vel[:-1]).sum(axis=0) * DT_S / 2
    moved = rows[-1].pos_ned_m - rows[0].pos_ned_m
    assert np.linalg.norm(moved) > 100
    assert moved == pytest.approx(travelled, abs=1e-4)


def test_motors_reach_63_percent_of_a_speed_step_after_their_lag(vehicle: Vehicle) -> None:
    vehicle.place((0, 0, -100), LEVEL, seed=1)
    vehicle.set_motors(True)
    vehicle.command_rates((0, 0, 0), 0.3)
    vehicle.step(250)
    vehicle.command_rates((0, 0, 0), 0.6)
    speed = np.sqrt([row.thrust_norm for row in record(vehicle, 0.4)])
    share = (speed - speed[0]) / (speed[-1] - speed[0])
    assert np.interp(1 - math.exp(-1), share, np.arange(len(share)) * DT_S) == pytest.approx(
        MOTOR_LAG_S, abs=1.5 * DT_S
    )


@pytest.mark.parametrize("alt_m", [0.5, 1500.0, 3000.0])
def test_thrust_follows_air_density(vehicle: Vehicle, alt_m: float) -> None:
    vehicle.place((0, 0, -alt_m), LEVEL, seed=1)
    vehicle.set_motors(True)
    vehicle.command_rates((0, 0, 0), 0.5)
    vehicle.step(100)
    assert vehicle.truth().thrust_norm == pytest.approx(0.5 * air_density_kg_m3(alt_m) / 1.225, rel=2e-3)


def test_a_steady_wind_is_only_a_moving_frame(vehicle: Vehicle) -> None:
    wind = (3.0, -4.0, 0.0)
    paths = []
    for air in ((0.0, 0.0, 0.0), wind):
        vehicle.place((0, 0, -50), quaternion(0.1, -0.2, 0.3), 1, Wind(air), vel_ned_m_s=air)
        vehicle.set_motors(True)
        vehicle.command_rates((0.2, 0.1, -0.3), 0.45)
        vehicle.step(500)
        paths.append(vehicle.truth())
    still, blown = paths
    assert blown.q_ned_frd == pytest.approx(still.q_ned_frd, abs=1e-6)
    assert blown.pos_ned_m - still.pos_ned_m == pytest.approx(np.array(wind) * still.t_s, abs=1e-3)


def test_a_mirrored_command_flies_a_mirrored_path(vehicle: Vehicle) -> None:
    ends = []
    for side in (1.0, -1.0):
        hover(vehicle, settle_s=1.0)
        vehicle.command_position((8.0, side * 5.0, -52.0), yaw_rad=side * 1.2)
        vehicle.step(400)
        ends.append(vehicle.truth())
    assert ends[1].pos_ned_m * [1, -1, 1] == pytest.approx(ends[0].pos_ned_m, abs=1e-6)
    assert ends[1].q_ned_frd * [1, -1, 1, -1] == pytest.approx(ends[0].q_ned_frd, abs=1e-6)


def test_counter_clockwise_rotors_push_the_nose_clockwise(vehicle: Vehicle) -> None:
    hover(vehicle, settle_s=1.0)
    vehicle.command_rates((0, 0, 0.5), WEIGHT_N / FULL_THRUST_N)
    vehicle.step(10)
    fdm = vehicle._fdm
    assert fdm["rotor/speed-fr-norm"] > fdm["rotor/speed-fl-norm"]
    torque_n_m = (
        0.0144
        * 4.4482216
        * sum(sign * fdm[f"rotor/thrust-{rotor}-lbs"] for rotor, sign in (("fr", 1), ("rl", 1), ("fl", -1), ("rr", -1)))
    )
    before = float(vehicle.truth().rates_frd_rad_s[2])
    vehicle.step(1)
    after = float(vehicle.truth().rates_frd_rad_s[2])
    assert (after - before) / DT_S == pytest.approx(torque_n_m / INERTIA_KG_M2[2], rel=0.03)
