"""Parameters and missions over a link that loses, delays, doubles and reorders both ways; on a clock moved by hand."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from mission_kit import item_int, open_world, place
from pymavlink.dialects.v20 import common as mav

from companion.core.clock import ManualClock
from companion.core.lossy import Loss, LossyTransport
from companion.core.mavlink import Connection
from companion.core.transport import pair
from sitl.link import SPECS, Link
from sitl.router import Router
from sitl.simulation import Simulation

BAD_RADIO = Loss(loss=0.3, duplicate=0.1, delay_s=0.2, jitter_s=0.1)
STEP_S = 0.02
PATIENCE_S = 1.5  # of the client before it asks again
ITEMS = [place(10.0 * i, -5.0 * i, 10.0 + i) for i in range(12)]


class Bench:
    """A vehicle that serves one link, and a patient client behind a bad radio."""

    def __init__(self, seed: int) -> None:
        self.clock = ManualClock()
        ours, theirs = pair()
        radio = LossyTransport(theirs, BAD_RADIO, seed, self.clock)
        self.sim = Simulation(open_world())
        self.router = Router(self.sim, 1)
        self.link = Link(SPECS[2], Connection(ours, 1, 1, clock=self.clock))
        self.client = Connection(radio, 255, 190, clock=self.clock)

    def wait(self) -> list[Any]:
        """A moment goes by; what the client has heard."""
        self.clock.sleep_s(STEP_S)
        for message in self.link.connection.receive():
            self.router.handle(self.link, message)
        self.router.tick([self.link], self.clock.now_s())
        return self.client.receive()

    def ask(self, question: Any, wanted: Callable[[Any], bool], limit_s: float = 60.0) -> Any | None:
        """Ask again and again until a wanted answer comes; None when there is none in time."""
        asked_s = -math.inf
        deadline_s = self.clock.now_s() + limit_s
        while self.clock.now_s() < deadline_s:
            if self.clock.now_s() - asked_s > PATIENCE_S:
                asked_s = self.clock.now_s()
                self.client.send(question)
            answer = next((message for message in self.wait() if wanted(message)), None)
            if answer is not None:
                return answer
        return None


@pytest.mark.parametrize("seed", range(3))
def test_every_parameter_arrives_and_one_that_is_set_is_set(seed: int) -> None:
    bench = Bench(seed)
    bench.client.send(mav.MAVLink_param_request_list_message(1, 1))
    values: dict[int, float] = {}
    count, quiet_s = None, 0.0
    while count is None or len(values) < count:
        heard = [m for m in bench.wait() if m.get_type() == "PARAM_VALUE" and m.param_index < m.param_count]
        values |= {m.param_index: m.param_value for m in heard}
        count = heard[-1].param_count if heard else count
        quiet_s = 0.0 if heard else quiet_s + STEP_S
        if quiet_s > PATIENCE_S:  # as ground stations do: ask for what is missing
            quiet_s = 0.0
            for index in [i for i in range(count or 1) if i not in values][:20]:
                bench.client.send(mav.MAVLink_param_request_read_message(1, 1, b"", index))
        assert bench.clock.now_s() < 600.0
    assert len(values) == len(bench.sim.autopilot.params.names())
    setting = mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 7.5, mav.MAV_PARAM_TYPE_REAL32)
    assert bench.ask(setting, lambda m: m.get_type() == "PARAM_VALUE" and m.param_value == 7.5) is not None
    assert bench.sim.autopilot.params["MIS_TAKEOFF_ALT"] == 7.5


@pytest.mark.parametrize("seed", range(5))
def test_a_mission_is_uploaded_and_downloaded_again(seed: int) -> None:
    bench = Bench(seed)
    upload(bench)
    assert download(bench) == [(item.x, item.y, item.z) for item in ITEMS]


def download(bench: Bench) -> list[tuple[int, int, float]]:
    """As clients do: one item after the other, asked for again after silence; in the end from the start."""
    while bench.clock.now_s() < 600.0:
        listing = bench.ask(mav.MAVLink_mission_request_list_message(1, 1), lambda m: m.get_type() == "MISSION_COUNT")
        assert listing is not None
        items: list[tuple[int, int, float]] = []
        answer = listing
        while answer is not None and len(items) < listing.count:
            answer = bench.ask(mav.MAVLink_mission_request_int_message(1, 1, len(items)), is_item(len(items)), 8.0)
            items += [(answer.x, answer.y, answer.z)] if answer is not None else []
        if answer is not None:
            bench.client.send(mav.MAVLink_mission_ack_message(1, 1, 0))
            return items
    raise AssertionError("the mission was not downloaded")


def is_item(seq: int) -> Callable[[Any], bool]:
    return lambda message: message.get_type() == "MISSION_ITEM_INT" and message.seq == seq


def upload(bench: Bench) -> None:
    """As clients do: tell the number, answer every request, begin again after silence."""
    told_s = -math.inf
    while bench.clock.now_s() < 300.0:
        if bench.clock.now_s() - told_s > 8.0:
            told_s = bench.clock.now_s()
            bench.client.send(mav.MAVLink_mission_count_message(1, 1, len(ITEMS)))
        for message in bench.wait():
            if message.get_type() == "MISSION_REQUEST_INT":
                told_s = bench.clock.now_s()
                bench.client.send(item_int(message.seq, ITEMS[message.seq]))
            elif message.get_type() == "MISSION_ACK" and message.type == mav.MAV_MISSION_ACCEPTED:
                return
    raise AssertionError("the mission was not uploaded")
