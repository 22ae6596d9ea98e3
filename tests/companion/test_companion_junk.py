"""Ten thousand packets of junk at every kind of port of the companion, signed and not: does it mind?

Real ports, the vehicle on the same one; what comes over UDP while a whole mission flies: ``test_attack``.
"""

import contextlib
import os
import random
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from companion_bench import Bench

from companion.core import codec
from companion.core.serial_port import SerialPort
from companion.core.tcp import tcp_in, tcp_out
from companion.core.transport import Transport
from companion.core.udp import udp_in, udp_out
from mission.hostile import junk

PACKETS = 10_000
A_STEP = 50
STEPS = PACKETS // A_STEP


@dataclass(frozen=True)
class Wire:
    """The companion's end, the vehicle's, and how a stranger writes to the former."""

    near: Transport
    far: Transport
    intrude: Callable[[bytes], bool]  # False: the line is full, again later


class Master:
    """The other end of a serial line, where vehicle and noise share the wire."""

    name = "master"

    def __init__(self) -> None:
        self._fd, self._slave = os.openpty()
        os.set_blocking(self._fd, False)
        self.device = os.ttyname(self._slave)
        self._unsent = b""

    def send(self, data: bytes) -> None:
        self._unsent += data
        with contextlib.suppress(BlockingIOError):
            while self._unsent:
                self._unsent = self._unsent[os.write(self._fd, self._unsent) :]

    def intrude(self, data: bytes) -> bool:
        self.send(b"")
        if self._unsent:
            return False
        self.send(data)
        return True

    def receive(self) -> list[bytes]:
        with contextlib.suppress(BlockingIOError):
            return [os.read(self._fd, 4096)]
        return []

    def files(self) -> tuple[()]:
        return ()

    def ready(self) -> bool:
        return False

    def close(self) -> None:
        os.close(self._fd)
        os.close(self._slave)


def udp_wire(stack: ExitStack) -> Wire:
    near = udp_in("127.0.0.1", 0)
    far = udp_out("127.0.0.1", near.port)
    stranger = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    return Wire(near, far, lambda data: stranger.sendto(data, ("127.0.0.1", near.port)) >= 0)


def tcp_wire(stack: ExitStack) -> Wire:
    near = tcp_in("127.0.0.1", 0)
    far = tcp_out("127.0.0.1", near.port)
    stranger = stack.enter_context(socket.create_connection(("127.0.0.1", near.port)))
    return Wire(near, far, lambda data: stranger.send(data) == len(data))


def serial_wire(_stack: ExitStack) -> Wire:
    master = Master()
    return Wire(SerialPort(master.device, 921600), master, master.intrude)


@pytest.fixture(params=[False, True], ids=["unsigned", "signed"])
def key(request: pytest.FixtureRequest, tmp_path: Path) -> Path | None:
    if not request.param:
        return None
    path = tmp_path / "key"
    path.write_text("11" * 32)
    path.chmod(0o600)
    return path


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


@pytest.mark.parametrize("make", [udp_wire, tcp_wire, serial_wire])
def test_ten_thousand_packets_of_junk_on_the_vehicles_link_change_nothing_that_the_companion_asks_for(
    make: Callable[[ExitStack], Wire], key: Path | None, stack: ExitStack, tmp_path: Path
) -> None:
    wire = make(stack)
    bench = fly_through_junk(Bench(tmp_path, wire=(wire.near, wire.far), key=key), wire, stack)
    assert_unmoved(bench, 0)


def test_ten_thousand_packets_of_junk_on_the_lidars_link_change_nothing_that_the_companion_asks_for(
    key: Path | None, stack: ExitStack, tmp_path: Path
) -> None:
    wire = udp_wire(stack)
    bench = fly_through_junk(Bench(tmp_path, own_lidar=True, lidar_wire=(wire.near, wire.far), key=key), wire, stack)
    assert_unmoved(bench, 1)


def fly_through_junk(bench: Bench, wire: Wire, stack: ExitStack) -> Bench:
    """Eight seconds of OFFBOARD, all the junk in them."""
    for end in (wire.near, wire.far):
        stack.callback(end.close)
    bench.run(0.4)
    bench.vehicle.custom_mode = codec.PX4_OFFBOARD
    bench.run(0.4)
    bench.vehicle.setpoints.clear()
    source = junk(random.Random(3))
    for _ in range(STEPS):
        for _ in range(A_STEP):
            packet = next(source)
            while not wire.intrude(packet):
                bench.companion.turn(bench.stop, wait_s=0.0)
        bench.run(0.04)
    return bench


def assert_unmoved(bench: Bench, link: int) -> None:
    asked = [setpoint.pos_ned_m for setpoint in bench.vehicle.setpoints]
    assert len(asked) > 0.9 * STEPS
    assert all(place is not None and np.array_equal(place, bench.brain.place) for place in asked)
    assert bench.companion.exit_code is None
    assert bench.vehicle.mode_requests == []
    counts = bench.companion.links[link].counts
    assert counts.unknown > 500
    assert counts.bad_bytes > 1_000_000
    if bench.key is not None:
        assert counts.unsigned > 1000
