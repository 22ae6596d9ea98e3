"""How do several vehicles fly in one world? A process for each, since Python keeps one core busy, and a hub between.

The exit code is that of the first vehicle that ends by itself; the others are ended with it.
"""

import multiprocessing
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Final

from sitl import app
from sitl.airspace import Hub
from sitl.vehicle_config import VehicleConfig

ENDING_WALL_S: Final = 5.0  # patience before a vehicle that was asked to end is killed
POLL_WALL_S: Final = 0.2  # the stop request is looked at this often


@dataclass(frozen=True, slots=True)
class Member:
    """One vehicle of the fleet."""

    process: SpawnProcess
    channel: Connection


def run(configs: Sequence[VehicleConfig]) -> int:
    """All vehicles, until a signal or until one of them ends. Returns the exit code."""
    context = multiprocessing.get_context("spawn")
    with app.stop_on_signals() as stopped:
        members = [_start(context, config) for config in configs]
        try:
            return _serve(members, stopped)
        finally:
            _end(members)


def _start(context: SpawnContext, config: VehicleConfig) -> Member:
    ours, theirs = context.Pipe()
    process = context.Process(target=_fly, args=(config, theirs), name=f"vehicle {config.system_id}", daemon=True)
    process.start()
    theirs.close()
    return Member(process, ours)


def _fly(config: VehicleConfig, channel: Connection) -> None:
    """The life of one process."""

    def say(text: str) -> None:
        print(f"[{config.system_id}] {text}", file=sys.stderr, flush=True)

    sys.exit(app.run(config, say, channel))


def _serve(members: Sequence[Member], stopped: Callable[[], bool]) -> int:
    """Pass on what they tell each other."""
    hub = Hub([member.channel for member in members])
    open_channels = [member.channel for member in members]
    ends = {member.process.sentinel: member.process for member in members}
    while not stopped():
        for ready in wait([*open_channels, *ends], POLL_WALL_S):
            if isinstance(ready, Connection):
                try:
                    hub.take(ready)
                except (EOFError, OSError):
                    open_channels.remove(ready)  # its process ends, and says how
            elif isinstance(ready, int):
                return _exit_code(ends[ready])
    return app.EXIT_OK


def _exit_code(process: SpawnProcess) -> int:
    process.join()
    code = process.exitcode or 0
    return code if code >= 0 else 128 - code


def _end(members: Sequence[Member]) -> None:
    """Ask all, wait for all, insist."""
    for member in members:
        member.process.terminate()
    for member in members:
        member.process.join(ENDING_WALL_S)
        if member.process.is_alive():
            member.process.kill()
            member.process.join()
        member.channel.close()
