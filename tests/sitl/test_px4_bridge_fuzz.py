"""Does the bridge to PX4 survive what was not meant for it? Junk beside the firmware on TCP, at the LiDAR's link and
at the ear; and any motor outputs."""

import math
import random
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav
from test_px4_bridge import Flight, flight

from companion.core.mavlink import Connection
from companion.core.transport import pair
from companion.core.types import LandedState
from companion.core.udp import Udp
from mission.hostile import junk
from sitl.px4_ear import Px4Ear
from sitl.px4_plant import FirmwareStatus

PACKETS = 10_000


class Intruder(threading.Thread):
    """Connects beside the firmware, and sends junk everywhere until the bridge is done."""

    def __init__(self, one: Flight) -> None:
        super().__init__(daemon=True)
        self.sent = 0
        self.over = threading.Event()
        links = one.bridge._links
        self._stream = socket.create_connection(("127.0.0.1", links.tcp.port), 5.0)
        ends = [links.ear._connection.transport, links.lidar.transport]
        ports = [end.port for end in ends if isinstance(end, Udp)]
        self._datagrams = [(socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", port)) for port in ports]

    def run(self) -> None:
        source = junk(random.Random(7))
        with self._stream, self._datagrams[0][0], self._datagrams[1][0]:
            while self.sent < PACKETS and not self.over.is_set():
                packet = next(source)
                self._stream.sendall(packet)
                for port, address in self._datagrams:
                    port.sendto(packet, address)
                self.sent += 1
                if self.sent % 20 == 0:
                    self.over.wait(0.002)


@pytest.fixture(scope="module")
def disturbed() -> Iterator[tuple[Flight, Intruder]]:
    with flight() as one:
        intruder = Intruder(one)
        intruder.start()
        one.run()
        intruder.over.set()
        intruder.join()
        yield one, intruder


def test_junk_beside_the_firmware_does_not_end_its_flight(disturbed: tuple[Flight, Intruder]) -> None:
    one, intruder = disturbed
    heights = np.array([-row.truth.pos_ned_m[2] for row in one.truth.rows])
    assert intruder.sent > 1000
    assert heights.max() == pytest.approx(1.5, abs=0.4)
    assert heights[-1] == pytest.approx(0.0, abs=0.05)
    assert one.truth.rows[-1].landed is LandedState.ON_GROUND
    assert one.bridge.plant.status.finished


def test_junk_is_counted_on_every_link_and_said_at_the_end(disturbed: tuple[Flight, Intruder]) -> None:
    one, _ = disturbed
    links = one.bridge._links
    for connection in (links.hil, links.lidar, links.ear._connection):
        assert connection.counts.bad_bytes > 10_000, connection.transport.name
        assert connection.counts.unknown > 50, connection.transport.name
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
