"""Do vehicles keep time, rates and memory in the long run?  ``python -m mission.soak --minutes 10 --count 8``

Vehicles, and with ``--fly`` companions, run as child processes. Memory is that of the operating system, rates and
vehicle time are those of the operator's link, which nobody else uses meanwhile. ``--speed max`` with ``--fly`` is
lockstep; without companions there are no answers to wait for, and time runs as fast as the vehicles can.
"""

import argparse
import json
import math
import os
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav
from rich.console import Console
from rich.table import Table

from companion.core.tlog import packet_length
from companion.core.transport import wait_readable
from companion.core.udp import Udp, udp_in
from mission.errors import FlightError, InputError
from mission.processes import INSTANCE_MAX, Children
from mission.runner import OPERATOR_PORT, check_ports
from mission.soak_figures import Memory, Traffic, resident_mb, summary
from mission.soak_flights import Flier, soak_world
from sitl import formation
from sitl.link import HOST
from sitl.server import RunConfig
from sitl.simulation import SimConfig
from sitl.streams import LEAN_HZ, ONBOARD_HZ
from sitl.vehicle_config import VehicleConfig

SAMPLE_S: Final = 3.0
WINDOW_S: Final = 10.0
WARM_UP_S: Final = 5.0  # after the last vehicle was heard
START_S: Final = 60.0  # that all have to be heard
FACTOR_MIN: Final = 0.99  # of the speed asked for
EXIT_HELD, EXIT_MISSED, EXIT_BAD_INPUT = 0, 1, 2
HEADER_BYTES: Final = 10  # MAVLink 2
ON_CHANGE: Final = (
    mav.MAVLINK_MSG_ID_HEARTBEAT, mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, mav.MAVLINK_MSG_ID_HOME_POSITION,
)  # fmt: skip
KINDS: Final = {"spawn_main": "vehicle", "-m companion": "companion", "resource_tracker": "tracker"}


class Ear:
    """Counts what one vehicle sends on its operator's link, without decoding it."""

    def __init__(self, member: VehicleConfig) -> None:
        """Raises TransportError for a port in use."""
        self.traffic = Traffic(f"vehicle {member.system_id}")
        self.udp: Udp = udp_in(HOST, OPERATOR_PORT + member.instance)
        self.vehicle_s: float | None = None
        self._counts: Counter[int] = Counter()
        self._since_s = 0.0

    def listen(self) -> None:
        """Take in what has come."""
        for chunk in self.udp.receive():
            at = 0
            while (length := packet_length(chunk[at : at + 3])) > 0 and at + length <= len(chunk):
                self._count(chunk[at : at + length])
                at += length

    def roll(self, wall_s: float, keep: bool) -> None:
        """Begin a new window at ``wall_s``; the one before counts when told to ``keep`` it."""
        if keep:
            self.traffic.windows.append((wall_s - self._since_s, self._counts))
        self._since_s, self._counts = wall_s, Counter()

    def _count(self, packet: bytes) -> None:
        message_id = int.from_bytes(packet[7:10], "little")
        self._counts[message_id] += 1
        if message_id == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            self.vehicle_s = int.from_bytes(packet[HEADER_BYTES : HEADER_BYTES + 4], "little") / 1e3


def soak(given: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Run it; the figures. Raises InputError for a port in use, FlightError when something ends before its time."""
    lockstep = given.fly and math.isinf(given.speed)
    run = RunConfig(given.speed, lockstep, gates=lockstep)
    alone = VehicleConfig(soak_world(), SimConfig(seed=given.seed), run, given.instance)
    members = formation.fleet(alone, given.count) if given.count > 1 else [alone]
    for member in members:
        check_ports(member.instance)
    paths = [folder / f"vehicle_{member.system_id}.json" for member in members]
    for path, member in zip(paths, members, strict=True):
        path.write_text(json.dumps(member.to_json()), encoding="utf-8")
    stop = threading.Event()
    with ExitStack() as stack:
        children = stack.enter_context(Children())
        ears = [Ear(member) for member in members]
        for ear in ears:
            stack.callback(ear.udp.close)
        fleet = children.start("vehicles", "sitl", [str(path) for path in paths], folder / "vehicles.log")
        pool = stack.enter_context(ThreadPoolExecutor(len(members)))
        stack.callback(stop.set)
        fliers = [Flier(member, children, folder, stop) for member in members] if given.fly else []
        flying = [pool.submit(flier.fly) for flier in fliers]
        memories = _watch(given.minutes * 60.0, ears, flying, lambda: fleet.exit_code is None)
        stop.set()
        legs = sum(future.result() for future in flying)
    rates = LEAN_HZ if lockstep else ONBOARD_HZ
    quiet = {mav.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS}  # in its own mode only
    if lockstep:  # also sent whenever they change
        quiet |= set(ON_CHANGE)
    figures = summary(memories, [e.traffic for e in ears], {i: hz for i, hz in rates.items() if i not in quiet})
    return {**_asked(given), "legs": legs, **figures}


def _watch(wall_s: float, ears: list[Ear], flying: list[Future[int]], alive: Callable[[], bool]) -> list[Memory]:
    """Listen and sample for ``wall_s`` after everybody was heard."""
    memories: dict[int, Memory] = {}
    began_s, heard_s = time.monotonic(), math.inf
    sample_s = window_s = began_s
    while (now_s := time.monotonic()) - heard_s < wall_s + WARM_UP_S:
        wait_readable([ear.udp for ear in ears], 0.1)
        for ear in ears:
            ear.listen()
        for future in flying:
            if future.done():
                future.result()
        if not alive():
            raise FlightError("the vehicles ended before their time")
        if math.isinf(heard_s):
            if all(ear.vehicle_s is not None for ear in ears):
                heard_s = now_s
            elif now_s - began_s > START_S:
                raise FlightError(f"not all vehicles were heard within {START_S:g} s")
        warm = now_s - heard_s >= WARM_UP_S
        if now_s - window_s >= WINDOW_S or (warm and not ears[0].traffic.clock):
            keep = bool(ears[0].traffic.clock)
            window_s = now_s
            for ear in ears:
                ear.roll(now_s, keep)
                if warm and ear.vehicle_s is not None:
                    ear.traffic.clock.append((now_s - began_s, ear.vehicle_s))
        if warm and now_s - sample_s >= SAMPLE_S:
            sample_s = now_s
            _sample(memories, now_s - began_s, alone=len(ears) == 1)
    return list(memories.values())


def _sample(memories: dict[int, Memory], at_s: float, alone: bool) -> None:
    """Every child but the ``ps`` that tells of them; ``alone``: a single vehicle needs no hub."""
    for pid, (size_mb, command) in resident_mb(os.getpid()).items():
        if pid == os.getpid() or command.startswith("ps "):
            continue
        kind = next((name for words, name in KINDS.items() if words in command), "vehicle" if alone else "hub")
        memories.setdefault(pid, Memory(f"{kind} {pid}")).samples.append((at_s, size_mb))


def _asked(given: argparse.Namespace) -> dict[str, Any]:
    speed = given.speed if math.isfinite(given.speed) else "max"
    return {"minutes": given.minutes, "count": given.count, "speed": speed, "companions": given.fly}


def missed(figures: dict[str, Any]) -> list[str]:
    """What did not hold."""
    factor, speed = figures["realtime_factor"], figures["speed"]
    growth_mb, gone = figures["growth_mb_max"], []
    if speed != "max" and (factor is None or factor < FACTOR_MIN * speed):
        gone.append(f"real-time factor {factor if factor is None else round(factor, 3)}, asked for is {speed:g}")
    if growth_mb is not None and growth_mb >= 2.0:
        gone.append(f"memory grew by {growth_mb:.1f} MB")
    if figures["rate_drift_max"] is None or figures["rate_drift_max"] > 0.05:
        gone.append("rates drifted")
    return gone


def main(arguments: list[str] | None = None) -> int:
    """Soak, print, judge. Exit code 0 where everything held."""
    given = _parser().parse_args(arguments)
    console = Console(stderr=given.json, highlight=False)
    try:
        with tempfile.TemporaryDirectory(prefix="swiftnav-soak-") as folder:
            figures = soak(given, Path(folder))
    except (InputError, FlightError, OSError) as error:
        print(f"soak: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    gone = missed(figures)
    _print(figures, console)
    console.print("missed: " + "; ".join(gone) if gone else "held")
    if given.json:
        print(json.dumps({**figures, "missed": gone}))
    return EXIT_MISSED if gone else EXIT_HELD


def _print(figures: dict[str, Any], console: Console) -> None:
    table = Table("process", "first MB", "peak MB", "growth MB")
    for row in figures["processes"]:
        growth = "" if row["growth_mb"] is None else f"{row['growth_mb']:+.2f}"
        table.add_row(row["name"], f"{row['first_mb']:.1f}", f"{row['peak_mb']:.1f}", growth)
    console.print(table)
    rates = Table("message", "asked Hz", "Hz", "drift")
    for row in figures["streams"]:
        rates.add_row(row["message"], f"{row['asked_hz']:g}", f"{row['hz']:.2f}", f"{100 * row['drift']:+.1f} %")
    console.print(rates)
    factor = figures["realtime_factor"]
    console.print(f"real-time factor {factor:.4f}, legs flown {figures['legs']}" if factor is not None else "no clock")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m mission.soak",
        description=__doc__.split("\n")[0] if __doc__ else None,
        epilog="example: python -m mission.soak --minutes 60 --speed max --fly --json",
    )
    add = parser.add_argument
    add("--minutes", type=float, default=10.0, help="after everybody was heard (default: %(default)g)")
    add("--count", type=int, choices=range(1, INSTANCE_MAX + 2), default=1, metavar="N", help="vehicles")
    add("--speed", type=_speed, default=1.0, help="times real time, or max (default: 1)")
    add("--fly", action="store_true", help="with a companion each, there and back again until the time is over")
    add("--instance", type=int, default=0, help="of the first vehicle")
    add("--seed", type=int, default=0)
    add("--json", action="store_true", help="print one JSON object")
    return parser


def _speed(text: str) -> float:
    speed = math.inf if text == "max" else float(text)
    if not speed > 0.0:
        raise argparse.ArgumentTypeError("wants a number above 0, or max")
    return speed


if __name__ == "__main__":
    sys.exit(main())
