"""How does the vehicle run as a program? Opens ports and logs, runs until told to stop, closes everything.

Exit code 0 after SIGINT or SIGTERM; 2 with one line for a wrong configuration, a port in use or a log folder that
cannot be written.
"""

import contextlib
import dataclasses
import importlib.metadata
import json
import platform
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from companion.core.clock import Clock, SystemClock
from companion.core.keyring import KeyFileError, Keyring
from companion.core.transport import TransportError
from companion.core.types import F64
from sitl import px4_app
from sitl.airspace import Airspace
from sitl.flight_logs import FlightLogs
from sitl.link import SPECS, Link, bind, open_links
from sitl.param_file import ParamFile, ParamFileError, read_param_file
from sitl.px4_bridge import Bridge
from sitl.server import Server
from sitl.simulation import Simulation
from sitl.truth_log import TruthFile
from sitl.vehicle_config import ConfigError, Firmware, VehicleConfig

EXIT_OK: Final = 0
EXIT_BAD_INPUT: Final = 2
PACKAGES: Final = ("swiftnav", "jsbsim", "numpy", "numba", "pymavlink", "python-fcl")

Say = Callable[[str], None]


def run(config: VehicleConfig, say: Say | None = None, channel: Connection | None = None) -> int:
    """The vehicle, until a signal. Returns the exit code. ``say`` takes one line at a time; None: stderr.

    ``channel``: to the hub of the other vehicles in its world (``sitl.fleet``); it ends with the hub.
    """
    tell = say or _to_stderr
    with stop_on_signals() as stopped, ExitStack() as stack:
        try:
            if config.firmware is Firmware.PX4:
                program: Server | Bridge = _open_px4(config, stack, tell)
            else:
                airspace = Airspace(channel, config.sim.radius_m) if channel is not None else None
                program = _open(config, stack, tell, airspace)
        except (TransportError, KeyFileError, ConfigError) as error:
            tell(str(error))
            return EXIT_BAD_INPUT
        except OSError as error:
            tell(f"log folder {config.log_dir} cannot be written: {error.strerror or error}")
            return EXIT_BAD_INPUT
        tell(px4_app.ready_line(config) if config.firmware is Firmware.PX4 else _ready_line(config))
        program.run(stopped)
        program.flush()
    return EXIT_OK


def _open(config: VehicleConfig, stack: ExitStack, say: Say, airspace: Airspace | None) -> Server:
    """Everything that can be refused, before anything is written."""
    clock = SystemClock()
    try:
        sim = Simulation(config.world, config.sim, airspace.neighbours if airspace is not None else None)
    except (KeyError, ValueError) as error:
        raise ConfigError(str(error.args[0])) from error
    keyring = _open_keyring(config, clock)
    bound = bind(config.instance, clock)
    for _, transport in bound:
        stack.callback(transport.close)
    sim.set_parameter("MAV_SYS_ID", config.system_id)
    param_file = _open_params(config, sim)
    truth = _open_truth(config, sim.spawn_ned_m, stack)
    links = open_links(bound, config.system_id, config.log_dir, clock, keyring, lean=config.run.lockstep)
    for link in links:
        stack.callback(link.close)
    if config.log_dir is not None:
        stack.callback(_write_counts, links, config.log_dir / "links.json")
    folder = config.log_dir or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="swiftnav-")))
    logs = FlightLogs(folder)
    stack.callback(logs.close)
    return Server(sim, links, config.run, clock, config.system_id, truth, say, logs, param_file, airspace)


def _open_params(config: VehicleConfig, sim: Simulation) -> ParamFile | None:
    """Take the parameters of the file, and keep it up to date from now on. Raises ConfigError and OSError."""
    if config.params_file is None:
        return None
    params = sim.autopilot.params
    param_file = ParamFile(config.params_file, config.system_id, {name: params[name] for name in params.names()})
    try:
        for name, value in read_param_file(config.params_file, params).items():
            sim.set_parameter(name, value)
        param_file.save(params)
    except (ParamFileError, ValueError) as error:
        raise ConfigError(str(error)) from error
    except OSError as error:
        raise ConfigError(f"{config.params_file} cannot be written: {error.strerror or error}") from error
    return param_file


def _open_px4(config: VehicleConfig, stack: ExitStack, say: Say) -> Bridge:
    """The same for the bridge to a real PX4."""
    clock = SystemClock()
    if config.sign_key is not None:
        raise ConfigError(
            "signing ends at the simulator port: PX4 v1.16 cannot sign, later ones are given the key themselves"
        )
    try:
        plant = px4_app.open_plant(config)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    links = px4_app.open_links(config, plant, clock, stack)
    truth = _open_truth(config, plant.spawn_ned_m, stack)
    return px4_app.open_bridge(config, plant, links, clock, truth, say)


def _open_keyring(config: VehicleConfig, clock: Clock) -> Keyring | None:
    if config.sign_key is None:
        return None
    return Keyring(config.sign_key, f"vehicle_{config.system_id}_{config.instance}", clock)


def _open_truth(config: VehicleConfig, spawn_ned_m: F64, stack: ExitStack) -> TruthFile | None:
    """The log folder with what it holds from the start. Raises OSError."""
    if config.log_dir is None:
        return None
    config.log_dir.mkdir(parents=True, exist_ok=True)
    truth = TruthFile(config.log_dir / "truth.jsonl", spawn_ned_m)
    stack.callback(truth.close)
    _write_versions(config, config.log_dir / "sitl.json")
    return truth


@contextlib.contextmanager
def stop_on_signals() -> Iterator[Callable[[], bool]]:
    """A question that is answered with True once SIGINT or SIGTERM has come."""
    asked: list[int] = []

    def remember(number: int, _frame: Any) -> None:
        asked.append(number)

    before = {number: signal.signal(number, remember) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _write_counts(links: Sequence[Link], path: Path) -> None:
    """What each link has seen, refused packets among it."""
    counts = {link.name: dataclasses.asdict(link.connection.counts) for link in links}
    path.write_text(json.dumps(counts, indent=1) + "\n", encoding="utf-8")


def _write_versions(config: VehicleConfig, path: Path) -> None:
    """What flew: configuration, seed and versions."""
    versions = {name: _version(name) for name in PACKAGES}
    facts = {"python": platform.python_version(), "platform": platform.platform(), "versions": versions}
    path.write_text(json.dumps({**facts, "config": config.to_json()}, indent=1) + "\n", encoding="utf-8")


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _ready_line(config: VehicleConfig) -> str:
    ports = ", ".join(f"{spec.name} udp {spec.remote_port + config.instance}" for spec in SPECS)
    return f"vehicle {config.system_id} in world {config.world.name}: {ports}"


def _to_stderr(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
