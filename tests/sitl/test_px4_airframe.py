"""Does a PX4 that believes in its airframe file turn our aircraft as it means to? Motors one by one, in PX4's order."""

import math

import numpy as np
import pytest
from pretend_px4 import MIX

from companion.core.frames import quaternion
from sitl.aircraft import ROTORS
from sitl.px4_airframe import ARM_M, NONE_IRIS
from sitl.vehicle import Vehicle

HOVER = 0.4539
PUSH = 0.05  # of full thrust, for 0.1 s


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    built = Vehicle()
    built.mount_rotors(NONE_IRIS.own_positions())
    return built


def turned(vehicle: Vehicle, controls: list[float]) -> np.ndarray:
    """Body rates after 0.1 s of PX4's motor outputs, from hover."""
    vehicle.place((0.0, 0.0, -50.0), quaternion(0.0, 0.0, 0.0), seed=1)
    vehicle.set_motors(True)
    vehicle.command_motors([HOVER] * 4)
    vehicle.step(100)
    vehicle.command_motors(NONE_IRIS.own_order(controls))
    vehicle.step(25)
    return vehicle.truth().rates_frd_rad_s


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_that_px4_asks_for_turns_that_axis_and_no_other(vehicle: Vehicle, axis: int) -> None:
    rates = turned(vehicle, (HOVER + PUSH * MIX[:, axis]).tolist())
    assert rates[axis] > 0.05
    others = np.delete(rates, axis)
    assert np.abs(others).max() < 0.03 * rates[axis]


def test_equal_motor_outputs_at_hover_thrust_carry_the_weight(vehicle: Vehicle) -> None:
    turned(vehicle, [HOVER] * 4)
    sinking_m_s = float(vehicle.truth().vel_ned_m_s[2])  # from the time that the motors took to start
    vehicle.step(250)
    truth = vehicle.truth()
    assert float(truth.vel_ned_m_s[2]) == pytest.approx(sinking_m_s, abs=0.1)
    assert truth.thrust_norm == pytest.approx(HOVER, rel=0.02)


def test_a_motor_output_beyond_its_range_is_full_or_idle(vehicle: Vehicle) -> None:
    turned(vehicle, [5.0] * 4)
    vehicle.step(100)
    assert vehicle.truth().thrust_norm == pytest.approx(1.0, abs=0.02)
    vehicle.command_motors([-1.0] * 4)
    vehicle.step(100)
    assert vehicle.truth().thrust_norm == pytest.approx(0.01, abs=0.005)


def test_a_motor_output_that_is_no_number_is_refused(vehicle: Vehicle) -> None:
    with pytest.raises(ValueError, match="motors must be finite"):
        vehicle.command_motors([math.nan] * 4)


def test_the_rotors_keep_the_size_of_the_aircraft_and_the_proportions_of_px4() -> None:
    places = dict(zip(ROTORS, NONE_IRIS.own_positions(), strict=True))
    arms = np.abs(np.array(list(places.values())))
    assert arms.mean(axis=0) == pytest.approx([ARM_M, ARM_M])
    for rotor, (forward_m, right_m) in places.items():
        assert (forward_m > 0) == rotor.startswith("f")
        assert (right_m > 0) == rotor.endswith("r")
    assert places["fr"][1] / -places["rl"][1] == pytest.approx(0.245 / 0.1875)


def test_extra_outputs_of_px4_are_nobodys(vehicle: Vehicle) -> None:
    assert NONE_IRIS.own_order([0.1, 0.2, 0.3, 0.4, 0.9, 0.9]) == [0.1, 0.2, 0.3, 0.4]


def test_back_in_position_control_the_aircraft_flies_as_ever(vehicle: Vehicle) -> None:
    turned(vehicle, [HOVER] * 4)
    vehicle.command_position((1.0, 0.0, -50.0), yaw_rad=0.0)
    vehicle.step(2000)
    assert vehicle.truth().pos_ned_m == pytest.approx([1.0, 0.0, -50.0], abs=0.1)
