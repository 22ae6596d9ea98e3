"""How is a policy trained, all settings in one value?  Presets by name or from a YAML file, every key checked.

A preset holds five sections, each a frozen dataclass beside the code that it belongs to; what a file leaves out is the
dataclass's default. ``default`` is the best that was measured, ``paper`` the paper's settings as far as it prints them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

from companion.core.params import nearest
from mission.errors import InputError
from mission.strict_yaml import read_yaml
from mission.training.configure import configured
from mission.training.env_config import EnvConfig
from mission.training.exploration import ExplorationConfig
from mission.training.replay import KINDS, ReplayConfig
from mission.training.td3 import TD3Config
from mission.training.until import TrainingConfig

CAPACITY_MAX = 10_000_000  # transitions: 6 GB


@dataclass(frozen=True, slots=True)
class MemoryConfig(ReplayConfig):
    """Which replay memory."""

    kind: str = "per"
    capacity: int = 50_000

    def __post_init__(self) -> None:
        ReplayConfig.__post_init__(self)  # super() is not to be had in a class with slots
        if self.kind not in KINDS:
            raise ValueError(f"'kind' = '{self.kind}'{nearest(self.kind, list(KINDS))}")
        if self.capacity < 1:
            raise ValueError(f"'capacity' = {self.capacity} wants at least 1")
        if self.capacity > CAPACITY_MAX:
            raise ValueError(f"'capacity' = {self.capacity} wants at most {CAPACITY_MAX}")


@dataclass(frozen=True, slots=True)
class Preset:
    """Everything but world and seed."""

    name: str = ""
    text: str = ""
    env: EnvConfig = field(default_factory=EnvConfig)
    td3: TD3Config = field(default_factory=TD3Config)
    replay: MemoryConfig = field(default_factory=MemoryConfig)
    exploration: ExplorationConfig = field(default_factory=ExplorationConfig)
    training: TrainingConfig = field(default_factory=TrainingConfig)


SECTIONS: dict[str, type[Any]] = {
    "env": EnvConfig,
    "td3": TD3Config,
    "replay": MemoryConfig,
    "exploration": ExplorationConfig,
    "training": TrainingConfig,
}


def list_presets() -> list[str]:
    """Names that ``load_preset`` knows without a path."""
    return sorted(item.name.removesuffix(".yaml") for item in _folder().iterdir() if item.name.endswith(".yaml"))


def load_preset(name_or_path: str, settings: Mapping[str, Mapping[str, Any]] | None = None) -> Preset:
    """The preset of that name or in that file, with ``{section: {field: value}}`` on top. Raises InputError."""
    if name_or_path in list_presets():
        with resources.as_file(_folder() / f"{name_or_path}.yaml") as path:
            data = read_yaml(path)
        return preset_from({"name": name_or_path, **data}, f"preset {name_or_path}", settings)
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        raise InputError(f"unknown preset '{name_or_path}'{nearest(name_or_path, list_presets())}")
    return preset_from({"name": path.stem, **read_yaml(path)}, str(path), settings)


def preset_from(data: Any, where: str, settings: Mapping[str, Mapping[str, Any]] | None = None) -> Preset:
    """The preset in nested plain values. Raises InputError naming ``where``, key and value."""
    if not isinstance(data, Mapping):
        raise InputError(f"{where}: wants 'section: {{field: value}}', got {data!r}")
    known = [f.name for f in fields(Preset)]
    for key in (*data, *(settings or {})):
        if key not in known or (key in (settings or {}) and key not in SECTIONS):
            raise InputError(f"{where}: unknown section '{key}'{nearest(str(key), list(SECTIONS))}")
    sections = {
        name: configured(kind, _merged(data.get(name), (settings or {}).get(name)), f"{where}: {name}")
        for name, kind in SECTIONS.items()
    }
    return Preset(str(data.get("name", "")), str(data.get("text", "")), **sections)


def _merged(values: Any, settings: Mapping[str, Any] | None) -> Any:
    if settings is None or not isinstance(values, Mapping | None):
        return values
    return {**(values or {}), **settings}


def _folder() -> Any:
    return resources.files("mission.training") / "presets"
