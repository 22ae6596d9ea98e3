"""The companion falls silent, is killed, or speaks over a bad radio: the vehicle gets into its failsafe, unharmed."""

import random
from pathlib import Path

import pytest

from mission.bad_radio import fly
from mission.flight_plan import plan_flight
from mission.kills import LOSS_S, SLACK_S, STANDS_M_S, kills, table
from mission.relay import BAD_RADIO
from mission.simulate import sim_config, ticks
from sitl.modes import FlightMode
from sitl.simulation import Simulation

STAND_S = 5.0


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.slow)])
def test_a_companion_that_falls_silent_in_flight_leaves_a_vehicle_in_its_failsafe_in_time(seed: int) -> None:
    plan = plan_flight("trajectory1", seed)
    sim = Simulation(plan.world, sim_config(plan))
    sim.set_parameter("COM_OBL_RC_ACT", 5)
    silent_s = 12.0 + random.Random(seed).uniform(0.0, 12.0)
    for record in ticks(sim, plan):
        if record.inputs.state.t_s >= silent_s:
            break
    assert sim.autopilot.mode is FlightMode.OFFBOARD
    while sim.autopilot.mode is FlightMode.OFFBOARD:
        sim.advance_to_scan()
        assert sim.t_s <= silent_s + LOSS_S + SLACK_S
    assert sim.autopilot.mode is FlightMode.HOLD
    while sim.t_s < silent_s + STAND_S:
        sim.advance_to_scan()
    assert not sim.contact
    assert abs(sim.state.vel_ned_m_s).max() < STANDS_M_S


@pytest.mark.slow
def test_a_killed_companion_costs_neither_the_vehicle_nor_the_mission(tmp_path: Path, instance: int) -> None:
    flown = kills("trajectory1", [0, 1, 2], 1.0, [instance], tmp_path)
    assert all(kill.fine for kill in flown), table(flown)


@pytest.mark.slow
def test_a_flight_over_a_bad_radio_ends_landed_or_holding_without_contact(tmp_path: Path, instance: int) -> None:
    flight = fly("trajectory1", 1, BAD_RADIO, instance, tmp_path)
    assert flight.safe, flight
