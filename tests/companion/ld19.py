"""An LD19 on a pseudo terminal: its packets as lds2d reads them, of a made-up room."""

import math
import os
import random
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

from lds2d.crc import crc8

POINTS = 12  # of a packet
TURN_HZ = 10.0
PACKETS = 36  # of a revolution: a point every 360 / 432 degrees

Room = Callable[[float], float]  # range in metres at an angle in radians, clockwise; 0 is no return


def packet(first_deg: float, step_deg: float, ranges_m: list[float]) -> bytes:
    last_deg = first_deg + step_deg * (POINTS - 1)
    body = struct.pack("<BBHH", 0x54, 0x2C, round(TURN_HZ * 360), round(first_deg * 100) % 36000)
    body += b"".join(struct.pack("<HB", round(range_m * 1e3), 200) for range_m in ranges_m)
    body += struct.pack("<HH", round(last_deg * 100) % 36000, 0)
    return body + bytes([crc8(body)])


def revolution(room: Room) -> list[bytes]:
    step_deg = 360.0 / (PACKETS * POINTS)
    firsts = [k * POINTS * step_deg for k in range(PACKETS)]
    return [
        packet(first, step_deg, [room(math.radians(first + i * step_deg)) for i in range(POINTS)]) for first in firsts
    ]


def noise(rng: random.Random) -> bytes:
    """Something like a packet that is none: random, cut off, changed, starts without an end."""
    whole = packet(rng.uniform(0.0, 360.0), 0.8, [rng.uniform(0.0, 12.0) for _ in range(POINTS)])
    at = rng.randrange(1, len(whole))
    changed = whole[:at] + bytes([whole[at] ^ rng.randrange(1, 256)]) + whole[at + 1 :]
    return rng.choice((rng.randbytes(at), whole[:at], changed, whole[:2] * at))


class Ld19:
    """Turns in a thread while plugged in."""

    def __init__(self, path: Path, room: Room) -> None:
        self.path = path
        self._packets = revolution(room)
        self.plug_in()

    def plug_in(self) -> None:
        self._master, self._slave = os.openpty()
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._slave))
        self._pulled = threading.Event()
        self._thread = threading.Thread(target=self._turn)
        self._thread.start()

    def disturb(self, noise: bytes) -> None:
        """Between two of its packets."""
        os.write(self._master, noise)

    def pull(self) -> None:
        self._pulled.set()
        self._thread.join()
        self.path.unlink()
        os.close(self._slave)
        os.close(self._master)

    def _turn(self) -> None:
        """Four packets at a time: the terminal's buffer holds more, and sleeping is coarse."""
        began_s, sent = time.monotonic(), 0
        while not self._pulled.is_set():
            due = int((time.monotonic() - began_s) * TURN_HZ * PACKETS)
            for k in range(sent, due):
                os.write(self._master, self._packets[k % PACKETS])
            sent = due
            time.sleep(4 / (TURN_HZ * PACKETS))
