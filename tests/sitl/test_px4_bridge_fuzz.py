"""Does the bridge to PX4 survive what was not meant for it? Junk beside the firmware on TCP, at the LiDAR's link and
at the ear; and any motor outputs."""

import itertools
import math
import random
import socket
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav
from test_px4_bridge import Flight, flight

from companion.core.mavlink import Connection, PacketParser
from companion.core.transport import pair
from companion.core.types import LandedState
from companion.core.udp import Udp
from mission.hostile import junk
from sitl.px4_ear import Px4Ear
from sitl.px4_plant import FirmwareStatus

PACKETS = 10_000
LAST_STEP = 1500  # of the 1750 that the flight takes


class Intruder:
    """Connects beside the firmware, and sends junk everywhere, in step with the flight: it is the stop request."""

    def __init__(self, one: Flight) -> None:
        self.sent = 0
        self._plant = one.bridge.plant
        links = one.bridge._links
        self._stream = socket.create_connection(("127.0.0.1", links.tcp.port), 5.0)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        ends = [links.ear._connection.transport, links.lidar.transport]
        self._addresses = [("127.0.0.1", end.port) for end in ends if isinstance(end, Udp)]
        self._source = junk(random.Random(7))

    def send_some(self) -> bool:
        """What is due by now; never asks to stop."""
        while self.sent < min(PACKETS, PACKETS * self._plant.step // LAST_STEP):
            packet = next(self._source)
            self._stream.sendall(packet)
            for address in self._addresses:
                self._udp.sendto(packet, address)
            self.sent += 1
            if self.sent == PACKETS:
                self.close()
        return False

    def close(self) -> None:
        self._stream.close()
        self._udp.close()


@pytest.fixture(scope="module")
def disturbed() -> Iterator[tuple[Flight, Intruder]]:
    with flight() as one:
        intruder = Intruder(one)
        one.run(intruder.send_some)
        yield one, intruder


def test_ten_thousand_packets_of_junk_at_each_port_do_not_end_the_firmwares_flight(
    disturbed: tuple[Flight, Intruder],
) -> None:
    one, intruder = disturbed
    heights = np.array([-row.truth.pos_ned_m[2] for row in one.truth.rows])
    assert intruder.sent == PACKETS
    assert one.bridge.missed == 0
    assert heights.max() == pytest.approx(1.5, abs=0.4)
    assert heights[-1] == pytest.approx(0.0, abs=0.05)
    assert one.truth.rows[-1].landed is LandedState.ON_GROUND
    assert one.bridge.plant.status.finished


def test_junk_is_counted_on_every_link_and_said_at_the_end(disturbed: tuple[Flight, Intruder]) -> None:
    one, _ = disturbed
    links = one.bridge._links
    packets = list(itertools.islice(junk(random.Random(7)), PACKETS))
    alone = PacketParser()
    for packet in packets:
        alone.feed(packet)
    for connection in (links.lidar, links.ear._connection):
        assert connection.counts.unknown == pytest.approx(alone.counts.unknown, rel=0.02), connection.transport.name
        assert connection.counts.bad_bytes == pytest.approx(alone.counts.bad_bytes, rel=0.02), connection.transport.name
    assert links.hil.counts.unknown > 500, "some are cut off by what came before them"
    assert links.hil.counts.bad_bytes == pytest.approx(alone.counts.bad_bytes, rel=0.1)
    assert any(said.startswith("simulator link: ") for said in one.said)


single = st.floats(width=32) | st.sampled_from([0.0, 0.4, 1.0, math.nan, math.inf, -math.inf, 1e38])


@settings(max_examples=100, deadline=None)
@given(st.lists(single, min_size=16, max_size=16), st.integers(0, 255), st.integers(0, 2**64 - 1))
def test_no_motor_outputs_make_the_aircraft_lose_its_numbers(controls: list[float], mode: int, time_us: int) -> None:
    with flight() as one:
        one.px4._socket.close()
        one.bridge.plant.advance([0.0] * 4, False)
        ours, theirs = pair()
        one.bridge._links = replace(one.bridge._links, hil=Connection(ours, 1, 1))
        sender = Connection(theirs, 1, 1)
        sender.send(mav.MAVLink_hil_actuator_controls_message(time_us, controls, mode, 1))
        one.bridge._take_controls()
        for _ in range(5):
            one.bridge.plant.advance(one.bridge._controls, one.bridge.plant.status.armed)
        assert np.isfinite(one.bridge.plant.truth.pos_ned_m).all()
        future = time_us > 4000
        assert (one.bridge._answered_us < 0) is future, "outputs for a step that has not been are none"


@given(st.integers(0, 255), st.integers(0, 2**32 - 1))
def test_no_news_of_the_firmware_break_the_ear(landed: int, custom_mode: int) -> None:
    ours, theirs = pair()
    ear = Px4Ear(Connection(ours, 1, 1), 1, FirmwareStatus())
    news = mav.MAVLink_autopilot_state_for_gimbal_device_message(1, 1, 0, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, 0, landed)
    Connection(theirs, 1, 1).send(news, mav.MAVLink_heartbeat_message(2, 12, 29, custom_mode, 3, 3))
    ear.listen()
