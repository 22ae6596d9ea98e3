import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core.mavlink import Connection
from companion.core.transport import pair
from sitl.extra_messages import RawMessage
from sitl.link import SPECS, Link
from sitl.modes import FlightMode
from sitl.pacer import Pacer
from sitl.router import Router
from sitl.simulation import Simulation
from sitl.streams import StreamSchedule
from sitl.world import World

EMPTY = World("empty", np.zeros(2), np.array([5.0, 0.0]), (-9, -9, 9, 9), np.zeros((0, 4)), np.zeros((0, 6)))
# What changes the control loops to nonsense is the user's own doing, as with PX4.
HANDLED = sorted(set(Router(Simulation(EMPTY), 1).handlers) - {mav.MAVLINK_MSG_ID_PARAM_SET})
COMMANDS = [400, 176, 22, 21, 20, 512, 511, 510, 519, 520, 410, 192, 16, 31000]


class Bench:
    """A flying simulation and one link to it, without sockets."""

    def __init__(self) -> None:
        ours, theirs = pair()
        self.link = Link(SPECS[0], Connection(ours, 1, 1))
        self.client = Connection(theirs, 245, 190)
        self.sim = Simulation(EMPTY)
        self.router = Router(self.sim, 1)
        self.sim.autopilot.command_arm(force=True)
        self.sim.autopilot.command_takeoff()
        while self.sim.autopilot.mode is not FlightMode.HOLD:
            self.sim.advance_to_scan()

    def receive(self, message: Any) -> list[Any]:
        """Through bytes to the router; the answers."""
        self.client.send(message)
        for arrived in self.link.connection.receive():
            self.router.handle(self.link, arrived)
        return self.client.receive()


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench()


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(HANDLED), st.binary(min_size=80, max_size=80))
def test_no_payload_of_any_handled_message_breaks_the_vehicle(bench: Bench, message_id: int, payload: bytes) -> None:
    kind = mav.mavlink_map[message_id]
    body = payload[: kind.unpacker.size]
    bench.receive(RawMessage(message_id, kind.msgname, kind.crc_extra, body))
    bench.sim.advance_to_scan()
    assert np.isfinite(bench.sim.truth.pos_ned_m).all()


param = st.floats(width=32) | st.sampled_from([0.0, 1.0, 4.0, 6.0, 21196.0])


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(COMMANDS), st.lists(param, min_size=7, max_size=7))
def test_every_command_with_any_parameters_gets_exactly_one_answer(
    bench: Bench, number: int, params: list[float]
) -> None:
    answers = bench.receive(mav.MAVLink_command_long_message(1, 1, number, 0, *params))
    acks = [m for m in answers if m.get_type() == "COMMAND_ACK"]
    assert [m.command for m in acks] == [number]
    assert acks[0].result in range(5)
    bench.sim.advance_to_scan()
    assert np.isfinite(bench.sim.truth.pos_ned_m).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 0xFFF), st.lists(st.floats(width=32), min_size=11, max_size=11))
def test_no_setpoint_makes_the_vehicle_lose_its_numbers(bench: Bench, mask: int, values: list[float]) -> None:
    sim, ap = bench.sim, bench.sim.autopilot
    for _ in range(5):
        if not ap.armed:
            ap.command_arm(force=True)
        bench.receive(mav.MAVLink_set_position_target_local_ned_message(1, 1, 1, 1, mask, *values))
        ap.command_mode(FlightMode.OFFBOARD)
        sim.advance_to_scan()
    assert np.isfinite(sim.truth.pos_ned_m).all()
    assert np.isfinite(sim.truth.rates_frd_rad_s).all()


@settings(max_examples=100)
@given(st.lists(st.floats(0.0, 0.3), min_size=1, max_size=200), st.floats(0.1, 50.0))
def test_the_pacer_never_runs_ahead_and_never_jumps(waits_s: list[float], speed: float) -> None:
    pacer, wall_s, step, start_s = Pacer(speed, 0.004), 100.0, 0, 100.0
    for wait_s in waits_s:
        steps = pacer.steps_due(wall_s, step, 5)
        assert 0 <= steps <= 5
        step += steps
        assert step * 0.004 <= (wall_s - start_s) * speed + 1e-6
        assert 0.0 <= pacer.wait_s(wall_s, step + 1) <= 0.004 / speed + 1e-9
        wall_s += wait_s


def test_a_schedule_keeps_its_rates_and_does_not_catch_up() -> None:
    schedule = StreamSchedule({1: 50.0, 2: 10.0})
    sent = [i for now_ms in range(0, 1000, 4) for i in schedule.due(now_ms * 1000)]
    assert (sent.count(1), sent.count(2)) == (50, 10)
    assert schedule.next_us == 1_000_000
    assert schedule.due(5_000_000) == [1, 2]
    assert schedule.due(5_000_001) == []
    schedule.set_interval(1, -1)
    schedule.set_interval(2, 500_000)
    assert schedule.due(6_000_000) == [2]
    assert schedule.interval_us(1) == 0
    schedule.set_interval(1, 0)
    assert schedule.interval_us(1) == 20_000
    assert StreamSchedule({}).next_us == math.inf


def test_a_speed_must_be_above_zero() -> None:
    for speed in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="speed"):
            Pacer(speed, 0.004)
