"""Is the position control in the XML PX4's? Against PX4's PositionControl, restated here, on random setpoints."""

import functools
import math
from dataclasses import dataclass

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import quaternion
from companion.core.types import F64
from sitl.vehicle import Vehicle

G_M_S2 = 9.80665
HOVER, THRUST_MIN, THRUST_MAX, XY_MARGIN = 0.454, 0.12, 1.0, 0.3
TILT_RAD = math.radians(35)
POS_P = np.array([0.95, 0.95, 1.0])
VEL_P = np.array([1.8, 1.8, 4.0])
XY_MAX_M_S, UP_MAX_M_S, DOWN_MAX_M_S = 20.0, 5.0, 3.0

number = st.floats(-30.0, 30.0)
axis = st.one_of(number, st.just(math.nan))
vector = st.tuples(axis, axis, axis).map(np.array)
small = st.tuples(*[st.one_of(st.floats(-6.0, 6.0), st.just(math.nan))] * 3).map(np.array)


@functools.cache
def vehicle_without_derivative() -> Vehicle:
    """PX4 takes the velocity derivative from outside its control law; here it is left out."""
    vehicle = Vehicle()
    for name in ("MPC_XY_VEL_D_ACC", "MPC_Z_VEL_D_ACC"):
        vehicle.set_parameter(name, 0.0)
    return vehicle


@dataclass(frozen=True)
class Wanted:
    thrust_norm: float
    z_ned: F64  # body z axis


def constrain_xy(first: F64, second: F64, limit: float) -> F64:
    """PX4 ControlMath::constrainXY: the first vector has priority."""
    if np.linalg.norm(first + second) <= limit:
        return first + second
    length = float(np.linalg.norm(first))
    if length >= limit:
        return first / length * limit
    unit = second / np.linalg.norm(second)
    along = float(unit @ first)
    reach = -along + math.sqrt(along**2 - (length**2 - limit**2))
    constrained: F64 = first + unit * reach
    return constrained


def add_if_present(base: F64, extra: F64) -> F64:
    return np.where(np.isnan(base), extra, np.where(np.isnan(extra), base, base + extra))


def px4(pos: F64, vel: F64, pos_sp: F64, vel_sp: F64, acc_sp: F64) -> Wanted:
    """PositionControl::update with empty integrators."""
    from_pos = POS_P * (pos_sp - pos)
    vel_sp = add_if_present(vel_sp, from_pos)
    p_part = np.nan_to_num(from_pos)
    absent = np.isnan(vel_sp)
    vel_sp[:2] = constrain_xy(p_part[:2], np.nan_to_num(vel_sp - p_part)[:2], XY_MAX_M_S)
    vel_sp[2] = min(max(vel_sp[2], -UP_MAX_M_S), DOWN_MAX_M_S)
    vel_sp[absent] = math.nan
    acc = np.nan_to_num(add_if_present(acc_sp, VEL_P * (vel_sp - vel)))
    return thrust_for(acc)


def thrust_for(acc: F64) -> Wanted:
    """PositionControl::_accelerationControl and the thrust limits after it."""
    z_ned = np.array([-acc[0], -acc[1], G_M_S2])
    z_ned /= np.linalg.norm(z_ned)
    side = math.hypot(z_ned[0], z_ned[1])
    if math.acos(min(1.0, z_ned[2])) > TILT_RAD:
        z_ned = np.array([*(z_ned[:2] / side * math.sin(TILT_RAD)), math.cos(TILT_RAD)])
    collective = min((acc[2] * HOVER / G_M_S2 - HOVER) / z_ned[2], -THRUST_MIN)
    thrust = z_ned * collective
    kept = min(float(np.hypot(*thrust[:2])), XY_MARGIN)
    thrust[2] = max(thrust[2], -math.sqrt(THRUST_MAX**2 - kept**2))
    side_max = math.sqrt(max(0.0, THRUST_MAX**2 - thrust[2] ** 2))
    side = float(np.hypot(*thrust[:2]))
    if side > side_max:
        thrust[:2] *= side_max / side
    length = float(np.linalg.norm(thrust))
    return Wanted(length, -thrust / length)


@settings(max_examples=300, deadline=None)
@given(pos_sp=vector, vel_sp=vector, acc_sp=small, vel=st.tuples(number, number, st.floats(-6.0, 6.0)).map(np.array))
def test_thrust_vector_equals_px4_for_any_mix_of_present_and_absent_axes(
    pos_sp: F64, vel_sp: F64, acc_sp: F64, vel: F64
) -> None:
    vehicle = vehicle_without_derivative()
    vehicle.place((1.0, -2.0, -40.0), quaternion(0.0, 0.0, 0.4), seed=1, vel_ned_m_s=vel)
    vehicle.set_motors(True)
    pos_sp = pos_sp + np.array([0.0, 0.0, -40.0])
    vehicle.command_position(pos_sp, vel_sp, acc_sp, yaw_rad=0.4)
    vehicle.step()
    truth = vehicle.truth()
    want = px4(truth.pos_ned_m, truth.vel_ned_m_s, pos_sp, vel_sp.copy(), acc_sp)
    fdm = vehicle._fdm
    assert abs(fdm["tsp/thrust"] - want.thrust_norm) < 1e-9
    assert np.abs([fdm["tsp/z-n"], fdm["tsp/z-e"], fdm["tsp/z-d"]] - want.z_ned).max() < 1e-9
