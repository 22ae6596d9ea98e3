import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mission_kit import open_world

from companion.core.frames import euler_rad
from sitl.estimate_errors import LOST_AFTER_S, EstimateErrors
from sitl.faults import FAULTS, Fault, FaultBook, parse
from sitl.modes import FlightMode
from sitl.simulation import SimConfig, Simulation
from sitl.truth_log import truth_sha256
from sitl.vehicle_config import VehicleConfig, from_json

DT_S = 0.04


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("gps_off", Fault("gps_off", 1.0)),
        ("gps_off@30", Fault("gps_off", 1.0, 30.0)),
        ("gps_off@30..45", Fault("gps_off", 1.0, 30.0, 45.0)),
        ("gps_off@30.5..45.25", Fault("gps_off", 1.0, 30.5, 45.25)),
        ("motor2=0.5@20", Fault("motor2", 0.5, 20.0)),
        ("motor1", Fault("motor1", 0.0)),
        ("wind_north=-4@1..2", Fault("wind_north", -4.0, 1.0, 2.0)),
        (" position_drift=1.5 ", Fault("position_drift", 1.5)),
    ],
)
def test_a_fault_is_read_as_it_is_written(text: str, fault: Fault) -> None:
    assert parse(text) == fault


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("gps_of", "did you mean 'gps_off'"),
        ("gps_off@50..40", "end before it starts"),
        ("motor1=1.5", "fraction"),
        ("gusts=-1", "below 0"),
        ("gusts=nan", "no number"),
        ("gusts@x", "no number"),
        ("", "wanted"),
        ("gps_off@@3", "wanted"),
    ],
)
def test_a_bad_fault_is_refused_in_one_line(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why) as caught:
        parse(text)
    assert "\n" not in str(caught.value)


@given(st.sampled_from(sorted(FAULTS)), st.floats(0, 1), st.floats(0, 100), st.floats(0.1, 100), st.floats(0, 250))
def test_a_scheduled_fault_is_in_force_from_its_start_to_its_end(
    name: str, value: float, start_s: float, length_s: float, t_s: float
) -> None:
    end_s = start_s + length_s
    book = FaultBook([f"{name}={value!r}@{start_s!r}..{end_s!r}"] if "e" not in f"{value!r}{start_s!r}" else [])
    assert (name in book.at(t_s)) is (not book.quiet and start_s <= t_s < end_s)


def test_what_is_injected_overrides_the_schedule() -> None:
    book = FaultBook(["gps_off@10"])
    book.inject("gps_off", None)
    book.inject("motor3", 0.0)
    assert book.at(20.0) == {"motor3": 0.0}


# --- the estimate -------------------------------------------------------------------------------------------------


def test_a_position_drift_has_its_size_after_a_minute() -> None:
    ends = []
    for seed in range(60):
        errors = EstimateErrors(seed)
        for tick in range(1500):
            errors.update(tick * DT_S, DT_S, {"position_drift": 2.0})
        ends.append(float(np.hypot(*errors.pos_ned_m[:2])))
    assert math.sqrt(np.mean(np.square(ends))) == pytest.approx(2.0, rel=0.25)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 200))
def test_the_same_seed_gives_the_same_errors_and_nothing_without_a_fault(seed: int, ticks: int) -> None:
    faults = {"position_drift": 1.0, "velocity_noise": 0.1, "baro_drift": 0.5, "gyro_noise": 0.01}
    one, two, none = EstimateErrors(seed), EstimateErrors(seed), EstimateErrors(seed)
    for tick in range(ticks):
        one.update(tick * DT_S, DT_S, faults)
        two.update(tick * DT_S, DT_S, faults)
        none.update(tick * DT_S, DT_S, {})
    assert np.array_equal(one.pos_ned_m, two.pos_ned_m)
    assert np.array_equal(one.rates_frd_rad_s, two.rates_frd_rad_s)
    assert not none.any
    assert not none.pos_ned_m.any()


def test_without_gps_the_position_coasts_and_is_lost_and_comes_back() -> None:
    errors, t_s = EstimateErrors(1), 0.0
    while errors.position_ok:
        errors.update(t_s, DT_S, {"gps_off": 1.0})
        t_s += DT_S
    assert t_s == pytest.approx(LOST_AFTER_S, abs=0.1)
    assert 0.5 < np.linalg.norm(errors.pos_ned_m) < 3.0
    for _ in range(200):
        errors.update(t_s, DT_S, {})
    assert errors.position_ok
    assert np.linalg.norm(errors.pos_ned_m) < 0.01


# --- in flight ----------------------------------------------------------------------------------------------------


def hover(*faults: str, seconds: float = 30.0, seed: int = 4) -> Simulation:
    """Take off to 5 m and hold."""
    sim = Simulation(open_world(), SimConfig(seed=seed, faults=faults, px4_params={"MIS_TAKEOFF_ALT": 5.0}))
    while sim.t_s < 3.0:
        sim.advance_to_scan()
    sim.autopilot.command_arm(force=True)
    sim.autopilot.command_takeoff()
    while sim.t_s < seconds:
        sim.advance_to_scan()
    return sim


def test_a_vehicle_flies_where_it_believes_to_be() -> None:
    sim = hover("position_drift=6@12", seconds=60.0)
    error = sim.trouble.errors.pos_ned_m
    assert np.linalg.norm(error) > 1.0
    assert sim.state.pos_ned_m[:2] == pytest.approx([0.0, 0.0], abs=1.0)  # it runs after its walking estimate
    assert sim.truth.pos_ned_m == pytest.approx(sim.state.pos_ned_m - error, abs=1e-4)


def test_baro_drift_moves_the_height_only() -> None:
    sim = hover("baro_drift=3@12", seconds=60.0)
    assert sim.truth.pos_ned_m[:2] == pytest.approx([0.0, 0.0], abs=0.2)
    assert abs(sim.truth.pos_ned_m[2] + 5.0) > 0.3
    assert sim.state.pos_ned_m[2] == pytest.approx(-5.0, abs=0.2)


def test_noise_is_reported_and_flown_through() -> None:
    sim = hover("velocity_noise=0.2@12", "gyro_noise=0.05@12", "attitude_noise=1@12", seconds=14.0)
    rates, speeds, rolls = [], [], []
    for _ in range(250):
        sim.advance_to_scan()
        rates.append(sim.state.rates_frd_rad_s[0] - sim.truth.rates_frd_rad_s[0])
        speeds.append(sim.state.vel_ned_m_s[0] - sim.truth.vel_ned_m_s[0])
        rolls.append(euler_rad(sim.state.q_ned_frd)[0] - euler_rad(sim.truth.q_ned_frd)[0])
    assert np.std(rates) == pytest.approx(0.05, rel=0.3)
    assert np.std(speeds) == pytest.approx(0.2, rel=0.25)
    assert np.std(rolls) == pytest.approx(math.radians(1.0), rel=0.3)
    assert sim.truth.pos_ned_m == pytest.approx([0.0, 0.0, -5.0], abs=0.6)


def test_a_weak_rotor_is_flown_and_a_dead_one_is_not() -> None:
    weak, dead = hover("motor2=0.9@12", seconds=25.0), hover("motor2=0@12", seconds=16.0)
    assert weak.truth.pos_ned_m == pytest.approx([0.0, 0.0, -5.0], abs=1.5)
    assert dead.truth.on_ground or dead.truth.pos_ned_m[2] > -4.0


def test_wind_and_gusts_push_and_end() -> None:
    calm, gusty = hover(seconds=20.0), hover("gusts=4@12..40", "wind_east=6@12..40", seconds=20.0)
    pushed = np.hypot(*(gusty.truth.pos_ned_m - calm.truth.pos_ned_m)[:2])
    assert pushed > 0.05
    while gusty.t_s < 60.0:
        gusty.advance_to_scan()
    assert gusty.truth.pos_ned_m == pytest.approx([0.0, 0.0, -5.0], abs=0.2)


def test_a_flight_with_faults_repeats_bit_by_bit_and_differs_by_seed() -> None:
    faults = ("position_drift=2", "velocity_noise=0.1", "gusts=2@10", "motor3=0.9@15", "gps_off@16..19")

    def sha(seed: int) -> str:
        sim = hover(*faults, seconds=22.0, seed=seed)
        return truth_sha256(sim.rows, sim.spawn_ned_m)

    assert sha(4) == sha(4)
    assert sha(4) != sha(5)


def test_faults_that_have_not_begun_change_nothing() -> None:
    """Byte for byte the flight without them: nothing is drawn, nothing is touched."""
    plain, later = hover(seconds=15.0), hover("gusts=3@100", "gps_off@100", "position_drift=9@100", seconds=15.0)
    assert truth_sha256(plain.rows, plain.spawn_ned_m) == truth_sha256(later.rows, later.spawn_ned_m)


def test_reading_the_state_in_between_changes_nothing() -> None:
    def fly(refresh: bool) -> str:
        sim = Simulation(open_world(), SimConfig(seed=1, faults=("velocity_noise=0.2", "position_drift=3", "gusts=2")))
        while sim.t_s < 3.0:
            sim.advance_to_scan()
        sim.autopilot.command_arm()
        sim.autopilot.command_takeoff()
        while sim.t_s < 8.0:
            sim.advance(3)
            if refresh:
                sim.refresh()
        return truth_sha256(sim.rows, sim.spawn_ned_m)

    assert fly(True) == fly(False)


def test_a_reboot_starts_the_faults_anew() -> None:
    sim = Simulation(open_world(), SimConfig(seed=1, faults=("gps_off@2..6",)))
    while sim.t_s < 8.0:
        sim.advance_to_scan()
    assert sim.autopilot.ready
    sim.reboot()
    while sim.t_s < 5.0:
        sim.advance_to_scan()
    assert not sim.autopilot.ready
    assert sim.autopilot.mode is FlightMode.HOLD


def test_faults_travel_with_the_vehicles_configuration() -> None:
    config = VehicleConfig(open_world(), SimConfig(faults=("gps_off@3", "motor1=0.5")))
    assert from_json(config.to_json()).sim.faults == ("gps_off@3", "motor1=0.5")


def test_a_vehicle_without_gps_does_not_arm() -> None:
    sim = Simulation(open_world(), SimConfig(faults=("gps_off",)))
    while sim.t_s < 4.0:
        sim.advance_to_scan()
    assert not sim.autopilot.ready
    assert not sim.autopilot.command_arm().accepted
