"""Where does everything about one flight lie?  ``flights/<UTC>_<mission>_s<seed>/``, and what is written into it.

The folder is made only after everything that a person handed in was checked.
"""

import json
import platform
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from companion.core import params as core_params
from mission.errors import InputError
from mission.flight_plan import FlightPlan
from mission.judge import Result
from mission.strict_yaml import write_yaml
from mission.world_file import world_hash, world_yaml

DEFAULT_PARENT = Path("flights")
VERSIONED = ("swiftnav", "numpy", "scipy", "pymavlink", "python-fcl", "jsbsim", "mavsdk", "numba")


def make_folder(plan: FlightPlan, out: Path | None, now: datetime | None = None) -> Path:
    """A new folder: ``out`` itself, which must be new or empty, or one below ./flights. Raises InputError."""
    stamp = (now or datetime.now(UTC)).strftime("%Y%m%dT%H%M%SZ")
    folder = out or DEFAULT_PARENT / f"{stamp}_{plan.mission.name}_s{plan.seed}"
    try:
        if out is not None:
            _make_empty(folder)
            return folder
        return _make_numbered(folder)
    except OSError as error:
        raise InputError(f"flight folder '{folder}' cannot be written: {error.strerror or error}") from error


def write_inputs(plan: FlightPlan, folder: Path, settings: dict[str, Any]) -> None:
    """What is needed to fly this again: mission, world, parameters, draws of the seed, versions."""
    write_yaml(folder / "mission.yaml", plan.mission.model_dump(mode="json"))
    write_yaml(folder / "params.yaml", core_params.as_dict(plan.params))
    (folder / "world.yaml").write_text(world_yaml(plan.world), encoding="utf-8")
    _write_json(folder / "versions.json", versions(plan, settings))


def write_result(result: Result, folder: Path) -> None:
    """``result.json``."""
    _write_json(folder / "result.json", result.as_dict())


def versions(plan: FlightPlan, settings: dict[str, Any]) -> dict[str, Any]:
    """What flew: packages, machine, seed and its draws, command-line settings."""
    draws = plan.draws
    return {
        "packages": {name: _version(name) for name in VERSIONED},
        "python": platform.python_version(),
        "platform": f"{sys.platform} {platform.machine()}",
        "seed": plan.seed,
        "spawn_ned_m": list(draws.spawn_ned_m),
        "spawn_yaw_rad": draws.yaw_rad,
        "wind_ned_m_s": list(draws.wind_ned_m_s),
        "sim_seed": draws.sim_seed,
        "mover_seed": draws.mover_seed,
        "world_sha256": world_hash(plan.world),
        "policy": plan.params.policy.name,
        "policy_sha256": plan.policy_sha256(),
        "guard": plan.params.policy.guard,
        "settings": settings,
    }


def _make_empty(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise InputError(f"flight folder '{folder}' is not empty")
    probe = folder / ".probe"
    probe.touch()
    probe.unlink()


def _make_numbered(folder: Path) -> Path:
    """Two flights in one second get two folders."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    number = 1
    while True:
        candidate = folder if number == 1 else folder.with_name(f"{folder.name}_{number}")
        try:
            candidate.mkdir()
            return candidate
        except FileExistsError:
            number += 1


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _write_json(path: Path, data: dict[str, Any]) -> None:
    path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
