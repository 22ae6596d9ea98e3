"""How does a world file become a ``World``, and a ``World`` a file and a hash?

A world is a name (``trajectory2``) or a YAML file (``world_spec`` has its keys). ``load_world`` refuses what cannot be
flown.
"""

import dataclasses
import hashlib
import io
import json
import math
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from companion.core.params import nearest
from mission.errors import InputError
from mission.strict_yaml import checked, read_yaml
from mission.world_check import MARGIN_M, RADIUS_M, WorldError, check_world
from mission.world_spec import WorldSpec, build
from sitl.world import Mover, World

HASH_DIGITS = 6  # micrometres: the last bits of sin and cos differ between platforms


def list_worlds() -> list[str]:
    """Names that ``load_world`` knows without a path."""
    return sorted(item.name.removesuffix(".yaml") for item in _folder().iterdir() if item.name.endswith(".yaml"))


def load_world(
    name_or_path: str | Path,
    start: tuple[float, float] | None = None,
    goal: tuple[float, float] | None = None,
    radius_m: float = RADIUS_M,
    margin_m: float = MARGIN_M,
) -> World:
    """The world of that name or in that file, checked for a vehicle of ``radius_m``; ``start`` and ``goal`` [north,
    east] replace the file's. Raises WorldError."""
    world = _read(str(name_or_path))
    if start is not None:
        world = dataclasses.replace(world, start_ned_m=np.array(start, dtype=float))
    if goal is not None:
        world = dataclasses.replace(world, goal_ned_m=np.array(goal, dtype=float))
    check_world(world, radius_m, margin_m)
    return world


def world_from_data(data: dict[str, Any], where: str) -> World:
    """The world in a mapping as YAML gives it, not yet checked for a way. Raises WorldError prefixed with ``where``."""
    try:
        return build(checked(WorldSpec, data, where))
    except WorldError:
        raise
    except InputError as error:
        raise WorldError(str(error)) from error


def world_yaml(world: World) -> str:
    """A world file that loads to the same world; walls and arcs come out as the boxes they are made of."""
    n_min, e_min, n_max, e_max = world.bounds_m
    data: dict[str, Any] = {
        "name": world.name,
        "start": world.start_ned_m.tolist(),
        "goal": world.goal_ned_m.tolist(),
        "bounds": {"north": [n_min, n_max], "east": [e_min, e_max]},
        "cylinders": [{"at": [n, e], "radius_m": r, **_height(h)} for n, e, r, h in world.circles.tolist()],
        "boxes": [
            {"at": [n, e], "size_m": [2 * hl, 2 * hw], "yaw_deg": math.degrees(yaw), **_height(h)}
            for n, e, yaw, hl, hw, h in world.boxes.tolist()
        ],
        "movers": [_mover_data(m) for m in world.movers],
    }
    text = io.StringIO()
    yaml = YAML()
    yaml.default_flow_style = None
    yaml.width = 120
    yaml.dump({key: value for key, value in data.items() if value != []}, text)
    return text.getvalue()


def world_hash(world: World) -> str:
    """sha256 of everything that can be touched, seen or reached, to the micrometre; name and text do not count."""
    content = {
        "start": world.start_ned_m.tolist(),
        "goal": world.goal_ned_m.tolist(),
        "bounds": list(world.bounds_m),
        "circles": world.circles.tolist(),
        "boxes": world.boxes.tolist(),
        "movers": [dataclasses.astuple(m) for m in world.movers],
    }
    return hashlib.sha256(json.dumps(_rounded(content), sort_keys=True).encode()).hexdigest()


def _folder() -> Any:
    return resources.files("mission") / "worlds"


def _read(name_or_path: str) -> World:
    if name_or_path in list_worlds():
        with resources.as_file(_folder() / f"{name_or_path}.yaml") as path:
            return _from_yaml(path, name_or_path)
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        raise WorldError(f"unknown world '{name_or_path}'{nearest(name_or_path, list_worlds())}")
    return _from_yaml(path, str(path))


def _from_yaml(path: Path, where: str) -> World:
    try:
        data = read_yaml(path)
    except InputError as error:
        raise WorldError(str(error)) from error
    data.setdefault("name", path.stem)
    return world_from_data(data, f"world {where}")


def _mover_data(mover: Mover) -> dict[str, Any]:
    return {
        "between": [list(mover.a_ned_m), list(mover.b_ned_m)],
        "radius_m": mover.radius_m,
        "speed_max_m_s": mover.speed_max_m_s,
        "speed_m_s": mover.speed_m_s,
        "phase": mover.phase,
        **_height(mover.height_m),
    }


def _height(height_m: float) -> dict[str, float]:
    return {} if math.isinf(height_m) else {"height_m": height_m}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    if isinstance(value, float):
        return "inf" if math.isinf(value) else round(value, HASH_DIGITS) + 0.0
    return value
