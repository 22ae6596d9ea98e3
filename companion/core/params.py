"""How is a tunable declared, checked and read from a file?

A parameter is a field of a frozen dataclass made with ``param``: default, unit, range, MAVLink name (UPPER_SNAKE, at
most 16 characters) and text. ``update`` applies nested ``{group: {field: value}}`` overrides and names what is wrong.
"""

import dataclasses
import difflib
import math
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

MAVLINK_NAME_MAX = 16  # char[16] param_id of PARAM_SET

T = TypeVar("T")


class ParamError(ValueError):
    """A parameter file or override is wrong; the text names key and value."""


@dataclasses.dataclass(frozen=True, slots=True)
class ParamInfo:
    """What ``params docs`` prints of one parameter."""

    key: str  # group.field
    name: str  # UPPER_SNAKE
    default: Any
    unit: str
    low: float | None
    high: float | None
    text: str


def param(default: T, name: str, text: str, unit: str = "", low: float | None = None, high: float | None = None) -> T:
    """Declare a tunable of a frozen dataclass; ``low`` and ``high`` are inclusive bounds."""
    field: Any = dataclasses.field(
        default=default, metadata={"name": name, "text": text, "unit": unit, "low": low, "high": high}
    )
    return field  # type: ignore[no-any-return]


def infos(params: Any) -> Iterator[ParamInfo]:
    """Every parameter of a group-of-groups dataclass, in order of declaration."""
    for group in dataclasses.fields(params):
        for field in dataclasses.fields(getattr(params, group.name)):
            meta = field.metadata
            yield ParamInfo(
                f"{group.name}.{field.name}",
                meta["name"],
                field.default,
                meta["unit"],
                meta["low"],
                meta["high"],
                meta["text"],
            )


def update(params: T, overrides: Mapping[str, Any]) -> T:
    """A copy of ``params`` with ``{group: {field: value}}`` applied. Raises ParamError naming key and value."""
    groups = [f.name for f in dataclasses.fields(params)]  # type: ignore[arg-type]
    changed: dict[str, Any] = {}
    for group, values in overrides.items():
        if group not in groups:
            raise ParamError(f"unknown parameter group '{group}'{nearest(group, groups)}")
        if not isinstance(values, Mapping):
            raise ParamError(f"parameter group '{group}' wants 'field: value' pairs, got {values!r}")
        changed[group] = _update_group(getattr(params, group), group, values)
    return dataclasses.replace(params, **changed)  # type: ignore[type-var]


def as_dict(params: Any) -> dict[str, dict[str, Any]]:
    """Nested plain values, for logs and YAML."""
    return dataclasses.asdict(params)


def nearest(word: str, known: list[str]) -> str:
    """'; did you mean X?' for an error text, or nothing."""
    match = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{match[0]}'?" if match else f"; known: {', '.join(sorted(known))}"


def _update_group(group: Any, group_name: str, values: Mapping[str, Any]) -> Any:
    fields = {f.name: f for f in dataclasses.fields(group)}
    checked = {}
    for name, value in values.items():
        if name not in fields:
            raise ParamError(f"unknown parameter '{group_name}.{name}'{nearest(name, list(fields))}")
        checked[name] = _check(f"{group_name}.{name}", fields[name], value)
    return dataclasses.replace(group, **checked)


def _check(key: str, field: Any, value: Any) -> Any:
    kind = type(field.default)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise ParamError(f"parameter '{key}' wants {kind.__name__}, got {value!r}")
    if kind in (int, float):
        low, high, unit = field.metadata["low"], field.metadata["high"], field.metadata["unit"]
        if not math.isfinite(value) or (low is not None and value < low) or (high is not None and value > high):
            raise ParamError(f"parameter '{key}' = {value} {unit} is outside [{low}, {high}] {unit}".replace("  ", " "))
    return value
