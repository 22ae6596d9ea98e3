"""Which named parameter sets come with the companion? ``companion/profiles/*.yaml``: {group: {field: value}} each."""

from collections.abc import Mapping
from importlib import resources
from typing import Any

from ruamel.yaml import YAML

from companion.core.params import ParamError, nearest

FOLDER = "profiles"


def profile_names() -> list[str]:
    """Every name that ``profile_named`` knows."""
    files = (resources.files("companion") / FOLDER).iterdir()
    return sorted(item.name.removesuffix(".yaml") for item in files if item.name.endswith(".yaml"))


def profile_named(name: str) -> dict[str, dict[str, Any]]:
    """Overrides of the defaults. Raises ParamError with the nearest name."""
    if name not in profile_names():
        raise ParamError(f"unknown profile '{name}'{nearest(name, profile_names())}")
    text = (resources.files("companion") / FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    overrides: dict[str, dict[str, Any]] = YAML(typ="safe").load(text) or {}
    return overrides


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Two sets of overrides as one; ``above`` wins, field by field."""
    both = dict(below)
    for group, fields in above.items():
        known = both.get(group)
        both[group] = {**known, **fields} if isinstance(known, Mapping) and isinstance(fields, Mapping) else fields
    return both
