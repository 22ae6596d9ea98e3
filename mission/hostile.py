"""What may arrive at a port that was not meant for it? Junk, forgeries and replays, by seed, and who sends them."""

import random
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core.signing import KEY_BYTES
from companion.core.tlog import TlogError, read_tlog

Message = Any  # a MAVLink_*_message object

DATAGRAM_BYTES: Final = 60_000  # near the most that one datagram can carry
PACKET_BYTES: Final = 280  # the longest MAVLink packet
FUTURE: Final = (1 << 48) - 1  # the last timestamp there is
FORCE: Final = 21196  # of MAV_CMD_COMPONENT_ARM_DISARM: in the air, too
ELSEWHERE: Final = 77  # a system that nobody is
BURST: Final = 20
ADDRESSES: Final = 8


def junk(rng: random.Random) -> Iterator[bytes]:
    """Datagrams without a single packet that means something: malformed, cut off, too long, changed, unknown."""
    kinds: Sequence[Callable[[random.Random], bytes]] = (
        _noise,
        _cut_off,
        _too_long,
        _wrong_checksum,
        _unknown,
        _wrong_length,
        _strange_flags,
        _out_of_order,
    )
    while True:
        yield kinds[rng.randrange(len(kinds))](rng)


def forgeries(rng: random.Random, system: int = 1) -> Iterator[bytes]:
    """Orders that would hurt, from everybody's ids: unsigned, or signed with a key that is not ours."""
    while True:
        sender = mav.MAVLink(None, system, rng.choice((1, 191, 190)))
        if rng.random() < 0.3:
            sender.srcSystem = 255
        sender.seq = rng.randrange(256)
        if rng.random() < 0.7:
            sender.signing.secret_key, sender.signing.link_id = rng.randbytes(KEY_BYTES), rng.randrange(4)
            sender.signing.timestamp = rng.choice((FUTURE, FUTURE // 2, rng.randrange(FUTURE)))
            sender.signing.sign_outgoing = True
        yield rng.choice(_orders(rng, system)).pack(sender)


def replays(rng: random.Random, recordings: Sequence[Path]) -> Iterator[bytes]:
    """Packets as they were on the wire, good signatures included; nothing until something was recorded."""
    while True:
        packets = []
        for path in recordings:
            try:
                packets += [packet for _, packet in read_tlog(path)]
            except (OSError, TlogError):  # not there yet, or being written
                continue
        rng.shuffle(packets)
        yield from packets[:500]
        if not packets:
            yield b""


class Siege:
    """Sends to every port, from many addresses, while the context lasts."""

    def __init__(
        self,
        ports: Sequence[int],
        each: int,
        source: Callable[[int], Iterator[bytes]],
        over_s: float,
        begin: Callable[[], bool] = lambda: True,
    ) -> None:
        """``each`` datagrams to each port, ``source(port)`` gives them; over ``over_s`` of wall time from ``begin``."""
        self.sent = dict.fromkeys(ports, 0)
        self._each, self._over_s, self._begin = each, over_s, begin
        self._sources = {port: source(port) for port in ports}
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="siege")

    def __enter__(self) -> "Siege":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._begin() and not self._done.wait(0.05):
            pass
        sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(ADDRESSES)]
        began_s = time.monotonic()
        while not self._done.is_set() and min(self.sent.values()) < self._each:
            for at, (port, source) in enumerate(self._sources.items()):
                for turn in range(min(BURST, self._each - self.sent[port])):
                    packet = next(source)
                    if not packet:
                        break
                    sockets[(turn + at) % len(sockets)].sendto(packet, ("127.0.0.1", port))
                    self.sent[port] += 1
            share = min(self.sent.values()) / self._each
            self._done.wait(max(0.002, began_s + share * self._over_s - time.monotonic()))
        for one in sockets:
            one.close()


def _orders(rng: random.Random, system: int) -> list[Message]:
    far = [rng.uniform(-100.0, 100.0) for _ in range(9)]
    stamp = rng.randrange(1 << 20) * 40
    return [
        mav.MAVLink_command_long_message(system, 1, 400, 0, 0, FORCE, 0, 0, 0, 0, 0),
        mav.MAVLink_command_long_message(system, 1, 185, 0, 1, 0, 0, 0, 0, 0, 0),
        mav.MAVLink_command_long_message(system, 1, 176, 0, 1, 4, 6, 0, 0, 0, 0),
        mav.MAVLink_set_mode_message(system, 1, 0x06040000),
        mav.MAVLink_param_set_message(system, 1, b"COM_OF_LOSS_T", 0.0, 9),
        mav.MAVLink_set_position_target_local_ned_message(stamp, system, 1, 1, 0, *far, 0.0, 0.0),
        mav.MAVLink_heartbeat_message(2, 12, 29, 0, 3, 3),  # to the companion: it stands disarmed on the ground
        mav.MAVLink_local_position_ned_message(stamp, *far[:6]),
        mav.MAVLink_mission_clear_all_message(system, 1, 255),
    ]


def _packet(rng: random.Random, message: Message | None = None) -> bytes:
    """A whole packet that nobody acts upon: news of a system that nobody flies."""
    sender = mav.MAVLink(None, ELSEWHERE, rng.randrange(1, 256))
    sender.seq = rng.randrange(256)
    news = message or mav.MAVLink_debug_message(rng.randrange(1 << 32), rng.randrange(256), rng.random())
    packet: bytes = news.pack(sender)
    return packet


def _noise(rng: random.Random) -> bytes:
    return rng.choice((b"", b"\xfd", b"\xfe")) + rng.randbytes(rng.randrange(PACKET_BYTES))


def _cut_off(rng: random.Random) -> bytes:
    packet = _packet(rng)
    return packet[: rng.randrange(1, len(packet))]


def _too_long(rng: random.Random) -> bytes:
    return rng.randbytes(rng.choice((PACKET_BYTES, 2000, DATAGRAM_BYTES // 20)))


def _wrong_checksum(rng: random.Random) -> bytes:
    packet = bytearray(_packet(rng))
    packet[rng.randrange(-2, 0)] ^= rng.randrange(1, 256)
    return bytes(packet)


def _unknown(rng: random.Random) -> bytes:
    body = rng.randbytes(rng.randrange(1, 255))
    head = bytes([0xFD, len(body), 0, 0, rng.randrange(256), 1, 1]) + (60_000 + rng.randrange(999)).to_bytes(
        3, "little"
    )
    return head + body + rng.randbytes(2)


def _wrong_length(rng: random.Random) -> bytes:
    packet = bytearray(_packet(rng))
    packet[1] = rng.randrange(256)
    return bytes(packet)


def _strange_flags(rng: random.Random) -> bytes:
    packet = bytearray(_packet(rng))
    packet[2] = rng.randrange(1, 256)
    return bytes(packet)


def _out_of_order(rng: random.Random) -> bytes:
    """Good packets; their numbers jump back and forth."""
    return b"".join(_packet(rng) for _ in range(rng.randrange(1, 4)))
