"""What do memory, rates and speed do in the long run? Samples in, figures out; wall time; pure but for one ``ps``."""

import math
import statistics
import subprocess
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl.streams import CURRENT_MODE_ID

SETTLE_S: Final = 300.0  # after which memory must not grow; of a shorter soak half
SHARE: Final = 0.1  # of the rest, at its beginning and at its end, that is compared
COUNTS_MIN: Final = 30  # messages that a rate is worked out from, at least
KIB_MB: Final = 1024.0 / 1e6


@dataclass(slots=True)
class Memory:
    """Resident memory of one process over the soak."""

    name: str
    samples: list[tuple[float, float]] = field(default_factory=list)  # s since the start, MB

    def growth_mb(self) -> float | None:
        """Median at the end less median after it had settled; None for a life too short to tell."""
        after = _settled(self.samples)
        some = max(1, round(SHARE * len(after)))
        if len(after) < 2 * some:
            return None
        head, tail = after[:some], after[-some:]
        return statistics.median(mb for _, mb in tail) - statistics.median(mb for _, mb in head)


@dataclass(slots=True)
class Traffic:
    """What one vehicle sent: vehicle time against wall time, and messages by id in windows of time."""

    name: str
    clock: list[tuple[float, float]] = field(default_factory=list)  # s since the start, vehicle time s
    windows: list[tuple[float, Counter[int]]] = field(default_factory=list)  # length s, messages

    def realtime_factor(self) -> float | None:
        """Vehicle seconds a wall second, from the first sample to the last."""
        if len(self.clock) < 2:
            return None
        (wall_s, vehicle_s), (wall_end_s, vehicle_end_s) = self.clock[0], self.clock[-1]
        return (vehicle_end_s - vehicle_s) / (wall_end_s - wall_s)

    def rates(self) -> dict[int, tuple[float, float]]:
        """By id: mean rate in Hz of wall time, and by which share it rose from the first half of the windows on.

        A message more or less in one half is not counted: it is where the window was cut.
        """
        half = len(self.windows) // 2
        parts = (self.windows, self.windows[:half], self.windows[half:])
        ids = sorted({i for _, counts in self.windows for i, n in counts.items()})
        found = {}
        for message_id in ids:
            if sum(counts[message_id] for _, counts in self.windows) >= COUNTS_MIN:
                whole, first, second = (_rate(part, message_id) for part in parts)
                one_hz = _rate([(sum(length for length, _ in parts[1]), Counter({message_id: 1}))], message_id)
                rise = math.copysign(max(abs(second - first) - one_hz, 0.0), second - first)
                found[message_id] = (whole, rise / first if first > 0.0 else 0.0)
        return found


def summary(memories: Iterable[Memory], traffics: Sequence[Traffic], asked_hz: Mapping[int, float]) -> dict[str, Any]:
    """The figures, JSON-ready; ``asked_hz``: rates of the link that was listened to."""
    factors = [factor for traffic in traffics if (factor := traffic.realtime_factor()) is not None]
    streams = [_stream(message_id, traffics, asked_hz[message_id]) for message_id in sorted(asked_hz)]
    heard = [stream for stream in streams if stream is not None]
    lives = [memory for memory in memories if memory.samples]
    longest = max((len(memory.samples) for memory in lives), default=0)
    processes = [_process(memory) for memory in lives if len(memory.samples) > longest // 2]
    short = [max(mb for _, mb in memory.samples) for memory in lives if len(memory.samples) <= longest // 2]
    grown = [row["growth_mb"] for row in processes if row["growth_mb"] is not None]
    return {
        "realtime_factor": min(factors, default=None),
        "rate_error_max": max((abs(row["error"]) for row in heard), default=None),
        "rate_drift_max": max((abs(row["drift"]) for row in heard), default=None),
        "growth_mb_max": max(grown, default=None),
        "processes": processes,
        "short_lives": len(short),  # companions of legs flown: too short to tell growth
        "short_lives_peak_mb": max(short, default=None),
        "streams": heard,
    }


def resident_mb(parent: int) -> dict[int, tuple[float, str]]:
    """Memory and command line of a process and all that it has started."""
    told = subprocess.run(["ps", "-axo", "pid=,ppid=,rss=,args="], capture_output=True, text=True, check=True).stdout
    return family_of(told, parent)


def family_of(told: str, parent: int) -> dict[int, tuple[float, str]]:
    """The same from what ``ps`` has told."""
    rows = [line.split(maxsplit=3) for line in told.splitlines()]
    known = {int(row[0]): row for row in rows if len(row) == 4}
    family = {parent} & known.keys()
    while more := {pid for pid, row in known.items() if int(row[1]) in family} - family:
        family |= more
    return {pid: (int(known[pid][2]) * KIB_MB, known[pid][3]) for pid in sorted(family)}


def _settled(samples: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    if not samples:
        return []
    settle_s = min(SETTLE_S, (samples[-1][0] - samples[0][0]) / 2)
    return [sample for sample in samples if sample[0] - samples[0][0] >= settle_s]


def _rate(windows: Sequence[tuple[float, Counter[int]]], message_id: int) -> float:
    length_s = sum(length for length, _ in windows)
    return sum(counts[message_id] for _, counts in windows) / length_s if length_s > 0.0 else 0.0


def _stream(message_id: int, traffics: Sequence[Traffic], asked_hz: float) -> dict[str, Any] | None:
    """The vehicle that is furthest from what is asked for; None for a stream that none of them sends often enough."""
    found = [rates[message_id] for traffic in traffics if message_id in (rates := traffic.rates())]
    if not found:
        return None
    whole, _ = max(found, key=lambda rates: abs(rates[0] - asked_hz))
    drift = max((drift for _, drift in found), key=abs)
    error, kind = whole / asked_hz - 1.0, mav.mavlink_map.get(message_id)
    name = kind.msgname if kind is not None else "CURRENT_MODE" if message_id == CURRENT_MODE_ID else str(message_id)
    return {"message": name, "asked_hz": asked_hz, "hz": whole, "error": error, "drift": drift}


def _process(memory: Memory) -> dict[str, Any]:
    sizes = [mb for _, mb in memory.samples]
    return {"name": memory.name, "first_mb": sizes[0], "peak_mb": max(sizes), "growth_mb": memory.growth_mb()}
