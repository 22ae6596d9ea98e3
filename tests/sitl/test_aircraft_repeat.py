"""Does the same seed give the same flight, to the bit, whatever was flown before? And is JSBSim quiet?"""

import hashlib
import random

import numpy as np
import pytest

from companion.core.frames import quaternion
from sitl.vehicle import Turbulence, Vehicle, Wind

WIND = Wind((3.0, -2.0, 0.5), Turbulence.LIGHT)


def flight_sha1(vehicle: Vehicle, seed: int, steps: int) -> str:
    """Fly off the ground in turbulence; hash everything that truth shows."""
    vehicle.reset(seed, yaw_rad=0.3, wind=WIND)
    digest = hashlib.sha1()
    vehicle.set_motors(True)
    vehicle.command_position((2.0, 1.0, -3.0), (0.5, 0.0, 0.0), yaw_rad=-1.0)
    for _ in range(steps // 10):
        truth = vehicle.truth()
        for values in (truth.pos_ned_m, truth.vel_ned_m_s, truth.q_ned_frd, truth.rates_frd_rad_s, truth.acc_frd_m_s2):
            digest.update(values.tobytes())
        digest.update(np.array([truth.t_s, truth.thrust_norm, truth.on_ground]).tobytes())
        vehicle.step(10)
    return digest.hexdigest()


def disturb(vehicle: Vehicle, dice: random.Random) -> None:
    """Leave the vehicle in some other state: another mode, wind, place."""
    vehicle.reset(dice.randrange(1000), dice.uniform(-3, 3), Wind((-6.0, 1.0, 0.0), dice.choice(list(Turbulence))))
    vehicle.set_motors(True)
    [
        lambda: vehicle.command_rates((1.0, -2.0, 0.5), 0.9),
        lambda: vehicle.command_attitude(quaternion(0.3, -0.5, 1.0), 0.7),
        lambda: vehicle.command_position(None, (5.0, -9.0, -3.0), (1.0, 1.0, 1.0), None, 0.4),
    ][dice.randrange(3)]()
    vehicle.step(dice.randrange(1, 60))


def test_a_thousand_resets_repeat_the_same_flight_to_the_bit() -> None:
    vehicle, dice = Vehicle(), random.Random(5)
    want = flight_sha1(Vehicle(), seed=11, steps=150)
    for _ in range(1000):
        disturb(vehicle, dice)
        assert flight_sha1(vehicle, seed=11, steps=150) == want


def test_a_long_flight_repeats_in_a_fresh_and_in_a_used_vehicle() -> None:
    used = Vehicle()
    disturb(used, random.Random(1))
    assert flight_sha1(used, 3, 5000) == flight_sha1(Vehicle(), 3, 5000)


def test_two_vehicles_in_one_process_do_not_touch_each_other() -> None:
    alone = flight_sha1(Vehicle(), 4, 500)
    one, other = Vehicle(), Vehicle()
    disturb(other, random.Random(2))
    one_digest = flight_sha1(one, 4, 500)
    other.step(100)
    assert one_digest == alone
    assert flight_sha1(other, 4, 500) == alone


@pytest.mark.parametrize("seed", [0, 2**31 - 3, 2**40 + 7])
def test_another_seed_gives_other_turbulence(seed: int) -> None:
    vehicle = Vehicle()
    assert flight_sha1(vehicle, seed, 500) != flight_sha1(vehicle, seed + 1, 500)


def test_step_sizes_do_not_matter_only_their_sum() -> None:
    vehicle = Vehicle()
    ends = []
    for pattern in ((10,) * 50, (1,) * 500, (7, 3, 40) * 10):
        vehicle.reset(9, wind=WIND)
        vehicle.set_motors(True)
        vehicle.command_position((1.0, 0.0, -2.0), yaw_rad=0.0)
        for n in pattern:
            vehicle.step(n)
        ends.append((vehicle.t_s, *vehicle.truth().pos_ned_m))
    assert ends[0] == ends[1] == ends[2]
    assert ends[0][0] == 2.0


def test_jsbsim_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    vehicle = Vehicle()
    flight_sha1(vehicle, 1, 100)
    assert capfd.readouterr() == ("", "")
