"""How do the vehicles of one world keep time together? Each tells the hub where it is; the hub, everybody at once.

A vehicle tells at every scan instant and waits for what the others say of theirs before its time goes on: vehicle time
is one for all, however the processes run, and what each sees of the others follows from the seeds alone. While it waits
its links are served.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Final

import numpy as np

from companion.core.types import F64
from sitl.neighbours import ROW, Neighbours, row_of
from sitl.simulation import Simulation

WORD: Final = struct.Struct(f"<{ROW}d?")  # where a vehicle is, and whether it has flown and disarmed


@dataclass(frozen=True, slots=True)
class Word:
    """What one vehicle tells at a scan instant."""

    row: F64  # as ``neighbours.row_of``
    finished: bool

    def packed(self) -> bytes:
        """For the channel."""
        return WORD.pack(*self.row.tolist(), self.finished)


def unpacked(raw: bytes) -> list[Word]:
    """The words that were packed one after the other."""
    return [Word(np.array(values[:ROW]), values[ROW]) for values in WORD.iter_unpack(raw)]


class Airspace:
    """One vehicle's end of its channel to the hub."""

    def __init__(self, channel: Connection, radius_m: float) -> None:
        """``radius_m``: of the other vehicles."""
        self.neighbours = Neighbours(radius_m)
        self.closed = False  # the hub is gone
        self._channel = channel
        self._told_s: float | None = None  # world time of what was told and not answered yet
        self._others_finished = False

    def tell(self, sim: Simulation) -> None:
        """The vehicle is at a scan instant, or about to begin."""
        self._told_s = sim.world_s
        try:
            self._channel.send_bytes(Word(row_of(sim.truth, sim.spawn_ned_m), sim.finished).packed())
        except OSError:
            self.closed = True

    @property
    def waiting(self) -> bool:
        """Has somebody not come to this instant yet?"""
        return self._told_s is not None

    def listen(self) -> None:
        """Take in what has come from the hub."""
        try:
            if self._told_s is not None and not self.closed and self._channel.poll():
                self._hear(self._told_s)
        except (EOFError, OSError):
            self.closed = True

    def over(self, sim: Simulation) -> bool:
        """Has everybody flown and disarmed?"""
        return sim.finished and self._others_finished

    def files(self) -> Sequence[Connection]:
        """The channel."""
        return (self._channel,) if not self.closed else ()

    def ready(self) -> bool:
        """Never: select sees everything."""
        return False

    def _hear(self, told_s: float) -> None:
        words = unpacked(self._channel.recv_bytes())
        self.neighbours.hear(told_s, np.array([word.row for word in words]).reshape(-1, ROW))
        self._others_finished = all(word.finished for word in words)
        self._told_s = None


class Hub:
    """Takes one word of each vehicle, then gives each those of the others; whoever is quick waits."""

    def __init__(self, channels: Sequence[Connection]) -> None:
        self._channels = list(channels)
        self._told: dict[Connection, bytes] = {}

    def take(self, channel: Connection) -> None:
        """Something has come on this channel. Raises EOFError or OSError when the vehicle is gone."""
        self._told[channel] = channel.recv_bytes()
        if len(self._told) < len(self._channels):
            return
        told, self._told = self._told, {}
        for own in self._channels:
            own.send_bytes(b"".join(told[channel] for channel in self._channels if channel is not own))
