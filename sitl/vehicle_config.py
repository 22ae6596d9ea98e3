"""What is one run of the vehicle? World, simulation, speed and ports as one value that travels as JSON."""

import dataclasses
import json
import math
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from sitl.geo import Origin
from sitl.lidar import LidarParams
from sitl.server import RunConfig
from sitl.simulation import SimConfig
from sitl.vehicle import Turbulence, Wind
from sitl.world import World
from sitl.world_json import world_from_json, world_to_json


class ConfigError(ValueError):
    """A configuration is wrong; the text is one line."""


class Firmware(StrEnum):
    """Who flies the aircraft?"""

    EMBEDDED = "embedded"  # our own flight stack
    PX4 = "px4"  # a real PX4 at the simulator port


@dataclass(frozen=True, slots=True)
class VehicleConfig:
    """Everything that ``sitl.app.run`` needs; ``log_dir`` takes truth.jsonl, sitl.json and *.tlog."""

    world: World
    sim: SimConfig = field(default_factory=SimConfig)
    run: RunConfig = field(default_factory=RunConfig)
    instance: int = 0  # adds to every port
    system_id: int = 1
    log_dir: Path | None = None
    firmware: Firmware = Firmware.EMBEDDED
    params_file: Path | None = None  # PX4 parameters, read at the start and kept up to date
    sign_key: Path | None = None  # file of the key for the links of companion and ground station; None: unsigned

    def to_json(self) -> dict[str, Any]:
        """Plain values; ``from_json`` gives the same configuration back."""
        sim = dataclasses.asdict(self.sim)
        if self.sim.wind is not None:
            sim["wind"]["turbulence"] = self.sim.wind.turbulence.name
        speed = self.run.speed
        return {
            "world": world_to_json(self.world),
            "sim": sim,
            "run": {**dataclasses.asdict(self.run), "speed": speed if math.isfinite(speed) else None},
            "instance": self.instance,
            "system_id": self.system_id,
            "log_dir": str(self.log_dir) if self.log_dir is not None else None,
            "firmware": self.firmware.value,
            "params_file": str(self.params_file) if self.params_file is not None else None,
            "sign_key": str(self.sign_key) if self.sign_key is not None else None,
        }


def from_json(data: dict[str, Any]) -> VehicleConfig:
    """The configuration of ``VehicleConfig.to_json``. Raises ConfigError."""
    try:
        speed = data["run"].get("speed", 1.0)
        return VehicleConfig(
            world=world_from_json(data["world"]),
            sim=_sim(data.get("sim", {})),
            run=RunConfig(**{**data["run"], "speed": math.inf if speed is None else float(speed)}),
            instance=int(data.get("instance", 0)),
            system_id=int(data.get("system_id", 1)),
            log_dir=Path(data["log_dir"]) if data.get("log_dir") else None,
            firmware=Firmware(data.get("firmware", Firmware.EMBEDDED)),
            params_file=Path(data["params_file"]) if data.get("params_file") else None,
            sign_key=Path(data["sign_key"]) if data.get("sign_key") else None,
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(f"vehicle configuration: {type(error).__name__}: {error}") from error


def load(path: Path) -> VehicleConfig:
    """Read a JSON file. Raises ConfigError."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"vehicle configuration {path}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"vehicle configuration {path} is no JSON: {error}") from error
    if not isinstance(data, dict):
        raise ConfigError(f"vehicle configuration {path}: an object is wanted")
    return from_json(data)


def _sim(data: dict[str, Any]) -> SimConfig:
    values = dict(data)
    if values.get("spawn_ned_m") is not None:
        north_m, east_m = values["spawn_ned_m"]
        values["spawn_ned_m"] = (float(north_m), float(east_m))
    if values.get("wind") is not None:
        n, e, d = values["wind"]["mean_ned_m_s"]
        values["wind"] = Wind((n, e, d), Turbulence[values["wind"].get("turbulence", "NONE")])
    if "faults" in values:
        values["faults"] = tuple(values["faults"])
    if "origin" in values:
        values["origin"] = Origin(**values["origin"])
    if "lidar" in values:
        values["lidar"] = LidarParams(**values["lidar"])
    return SimConfig(**values)
