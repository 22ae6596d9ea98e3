import dataclasses
import math

import numpy as np
import pytest

from companion.core.types import F64, LandedState, Setpoint
from sitl.gates import Gate, GateKeeper
from sitl.lidar import LidarParams
from sitl.modes import FlightMode
from sitl.simulation import SimConfig, Simulation
from sitl.truth_log import truth_line, truth_sha256
from sitl.vehicle import Turbulence, Wind
from sitl.world import Mover, World
from sitl.world_json import world_from_json, world_to_json

WINDY = SimConfig(seed=3, wind=Wind((3.0, 1.0, 0.0), Turbulence.LIGHT))


def world(*circles: tuple[float, float, float, float], movers: tuple[Mover, ...] = ()) -> World:
    rows = np.array(circles, dtype=float).reshape(len(circles), 4)
    return World("test", np.zeros(2), np.array([30.0, 0.0]), (-50, -50, 50, 50), rows, np.zeros((0, 6)), movers)


def at(sim: Simulation, *pos: float, vel: F64 | None = None) -> Setpoint:
    return Setpoint(sim.t_s, np.array(pos), vel, None, 0.0)


def take_off(sim: Simulation) -> None:
    """Through the gates, as an operator in this process."""
    gates = GateKeeper(companion=False)
    while (gate := gates.waiting(sim)) is not Gate.OFFBOARD:
        if gate is Gate.ARM:
            assert sim.autopilot.command_arm().accepted
        elif gate is Gate.TAKEOFF:
            assert sim.autopilot.command_takeoff().accepted
        else:
            sim.advance_to_scan()


def offboard(sim: Simulation) -> None:
    take_off(sim)
    sim.submit(at(sim, 0.0, 0.0, -2.5))
    assert sim.autopilot.command_mode(FlightMode.OFFBOARD).accepted


def fly(config: SimConfig) -> Simulation:
    """Out to 6 m north, and down there."""
    sim = Simulation(world((10.0, 3.0, 0.5, math.inf)), config)
    offboard(sim)
    while not sim.finished:
        sim.advance_to_scan()
        down_m = -2.5 if sim.t_s < 14.0 else 1.0
        sim.submit(at(sim, min(6.0, max(0.0, 2.0 * (sim.t_s - 8.0))), 0.0, down_m))
        assert sim.t_s < 60.0
    return sim


def test_scans_come_at_exact_multiples_of_the_period() -> None:
    sim = Simulation(world())
    stamps = [round(sim.advance_to_scan().scan.t_s * 1e3) for _ in range(50)]
    assert stamps == list(range(40, 2040, 40))


@pytest.mark.parametrize("slices", [1, 3, 5, 7])
def test_slices_of_time_give_the_same_flight_as_whole_scans(slices: int) -> None:
    whole, sliced = Simulation(world(), WINDY), Simulation(world(), WINDY)
    for sim in (whole, sliced):
        sim.autopilot.command_arm(force=True)
        sim.autopilot.command_takeoff()
    for _ in range(60):
        seen = whole.advance_to_scan()
        while (same := sliced.advance(slices)) is None:
            sliced.refresh()
        assert np.array_equal(seen.state.pos_ned_m, same.state.pos_ned_m)
        assert np.array_equal(seen.scan.range_m, same.scan.range_m, equal_nan=True)


def test_same_seed_gives_the_same_bytes_and_another_seed_does_not() -> None:
    first, again = fly(WINDY), fly(WINDY)
    lines = [[truth_line(row, sim.spawn_ned_m) for row in sim.rows] for sim in (first, again)]
    assert lines[0] == lines[1]
    other = fly(dataclasses.replace(WINDY, seed=4))
    assert truth_sha256(first.rows, first.spawn_ned_m) != truth_sha256(other.rows, other.spawn_ned_m)


def test_an_offboard_flight_ends_where_it_was_sent_landed_and_disarmed() -> None:
    sim = fly(WINDY)
    assert sim.rows[-1].landed is LandedState.ON_GROUND
    assert not sim.rows[-1].armed or not sim.autopilot.armed
    assert sim.truth.pos_ned_m == pytest.approx([6.0, 0.0, 0.0], abs=0.3)
    assert not sim.contact
    count = len(sim.rows)
    sim.advance_to_scan()
    assert len(sim.rows) == count, "the truth log ends with the flight"


def test_a_setpoint_takes_effect_one_latency_after_its_scan() -> None:
    sims = [Simulation(world(), SimConfig(latency_s=latency_s)) for latency_s in (0.052, 0.152)]
    moved_s = []
    for sim in sims:
        offboard(sim)
        for _ in range(25):
            sim.advance_to_scan()
            sim.submit(at(sim, 0.0, 0.0, -2.5))
        start_s = sim.t_s
        sim.advance_to_scan()
        while abs(sim.truth.rates_frd_rad_s[1]) < 0.05:
            sim.submit(at(sim, 5.0, 0.0, -2.5))
            while sim.advance(1) is None:
                sim.refresh()
                if abs(sim.truth.rates_frd_rad_s[1]) >= 0.05:
                    break
        moved_s.append(sim.t_s - start_s)
    assert moved_s[1] - moved_s[0] == pytest.approx(0.1, abs=0.005)


def test_the_latency_of_the_lidar_adds_up() -> None:
    slow = Simulation(world(), SimConfig(latency_s=0.05, lidar=LidarParams(latency_s=0.1)))
    fast = Simulation(world(), SimConfig(latency_s=0.15))
    for sim in (slow, fast):
        offboard(sim)
        for _ in range(50):
            sim.advance_to_scan()
            sim.submit(at(sim, 3.0, 0.0, -2.5))
    assert np.array_equal(slow.state.pos_ned_m, fast.state.pos_ned_m)


@pytest.mark.parametrize(("rate_hz", "step_ms"), [(10.0, 100), (12.5, 80), (50.0, 20), (25.0, 40)])
def test_other_scan_rates_that_fit_the_physics_work(rate_hz: float, step_ms: int) -> None:
    sim = Simulation(world((5.0, 0.0, 1.0, math.inf)), SimConfig(lidar=LidarParams(rate_hz=rate_hz)))
    for i in range(1, 60):
        seen = sim.advance_to_scan()
        assert seen.state.t_s == seen.scan.t_s == i * step_ms / 1e3
        assert sim.rows[-1].clearance_m == pytest.approx(5.0 - 1.0 - 0.33, abs=0.01)


def test_a_scan_rate_off_the_physics_grid_is_refused() -> None:
    with pytest.raises(ValueError, match=r"30\.0 Hz"):
        Simulation(world(), SimConfig(lidar=LidarParams(rate_hz=30.0)))


@pytest.mark.parametrize("name", ["MPC_NO_SUCH", "COM_OF_LOS_T"])
def test_an_unknown_px4_parameter_is_refused(name: str) -> None:
    with pytest.raises(KeyError, match=name):
        Simulation(world(), SimConfig(px4_params={name: 1.0}))


def test_loop_parameters_reach_the_vehicle() -> None:
    def height_after(seconds: float, up_m_s: float) -> float:
        sim = Simulation(world(), SimConfig(px4_params={"MPC_Z_VEL_MAX_UP": up_m_s}))
        offboard(sim)
        until_s = sim.t_s + seconds
        while sim.t_s < until_s:
            sim.advance_to_scan()
            sim.submit(at(sim, 0.0, 0.0, -30.0))
        return float(-sim.truth.pos_ned_m[2])

    assert height_after(3.0, 1.0) < height_after(3.0, 4.0) - 4.0


def test_no_contact_is_missed_between_two_scans() -> None:
    """A pole thinner than the way between two scans, passed at speed: the vehicle overlaps it only for a moment."""
    pole = (12.0, 0.33 + 0.02 - 0.004, 0.02, math.inf)  # 4 mm of overlap, for less than one scan period at 9 m/s
    sim = Simulation(world(pole))
    offboard(sim)
    while sim.truth.pos_ned_m[0] < 14.0:
        sim.advance_to_scan()
        sim.submit(at(sim, 200.0, 0.0, -2.5))
    assert np.hypot(*sim.truth.vel_ned_m_s[:2]) > 6.0
    assert sim.contact
    assert min(row.clearance_m for row in sim.rows) <= 0.0


def test_a_mover_that_runs_into_a_standing_vehicle_is_a_contact() -> None:
    mover = Mover((-5.0, 0.0), (5.0, 0.0), 0.3, math.inf, 1.5, 1.5, 0.0)
    sim = Simulation(world(movers=(mover,)))
    before = sim.contact
    while sim.t_s < 4.0:
        sim.advance_to_scan()
    assert not before
    assert sim.contact


def test_world_positions_are_local_positions_from_the_spawn() -> None:
    sim = Simulation(world((10.0, 5.0, 1.0, math.inf)), SimConfig(spawn_ned_m=(7.0, 5.0)))
    sim.advance_to_scan()
    assert sim.rows[0].clearance_m == pytest.approx(3.0 - 1.0 - 0.33, abs=0.01)
    assert '"pos_world_ned_m":[7.0' in truth_line(sim.rows[0], sim.spawn_ned_m)


def test_every_gate_is_passed_once_and_in_order() -> None:
    sim = Simulation(world())
    gates = GateKeeper()
    assert gates.waiting(sim, companion_heard=False) is Gate.COMPANION
    assert gates.waiting(sim) is None, "not ready yet"
    while gates.waiting(sim) is None:
        sim.advance_to_scan()
    assert sim.t_s == pytest.approx(2.5, abs=0.04)
    assert gates.waiting(sim) is Gate.ARM
    sim.autopilot.command_arm()
    assert gates.waiting(sim) is Gate.TAKEOFF
    sim.autopilot.command_takeoff()
    while gates.waiting(sim) is None:
        sim.advance_to_scan()
    assert gates.waiting(sim) is Gate.OFFBOARD
    sim.submit(at(sim, 0.0, 0.0, -2.5))
    sim.autopilot.command_mode(FlightMode.OFFBOARD)
    assert gates.waiting(sim) is None
    sim.autopilot.command_mode(FlightMode.HOLD)
    assert gates.waiting(sim) is None, "a pilot who takes over is not stopped"
    sim.autopilot.command_land()
    while gates.waiting(sim) is None:
        sim.advance_to_scan()
    assert gates.waiting(sim) is Gate.END


def test_return_comes_home_and_lands() -> None:
    sim = Simulation(world(), SimConfig(px4_params={"RTL_RETURN_ALT": 6.0}))
    offboard(sim)
    while sim.truth.pos_ned_m[0] < 9.0:
        sim.advance_to_scan()
        sim.submit(at(sim, 10.0, 0.0, -2.5))
    assert sim.autopilot.command_mode(FlightMode.RTL).accepted
    highest_m = 0.0
    while not sim.finished:
        sim.advance_to_scan()
        highest_m = max(highest_m, -float(sim.truth.pos_ned_m[2]))
        assert sim.t_s < 60.0
    assert highest_m == pytest.approx(6.0, abs=0.5)
    assert np.hypot(*sim.truth.pos_ned_m[:2]) < 0.3


def test_a_world_survives_json_bit_by_bit() -> None:
    mover = Mover((-5.1, 0.0), (5.0, 0.3), 0.3, math.inf, 1.5, 1.2345678901234567, 0.1)
    first = world((1 / 3, 2.0, 0.5, math.inf), (4.0, 5.0, 0.1, 2.5), movers=(mover,))
    back = world_from_json(world_to_json(first))
    assert np.array_equal(back.circles, first.circles)
    assert np.array_equal(back.boxes, first.boxes)
    assert back.movers == first.movers
    assert back.bounds_m == first.bounds_m
