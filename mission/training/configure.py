"""How does a part of a YAML file become a frozen dataclass, with one clear line about whatever is wrong in it?"""

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from companion.core.params import nearest
from mission.errors import InputError

T = TypeVar("T")


def configured(kind: type[T], values: Any, where: str) -> T:
    """A ``kind`` with ``values`` in place of its defaults; types are checked strictly. Raises InputError.

    Args:
        kind: a dataclass whose fields all have defaults.
        values: ``{field: value}`` as YAML has it; None for none.
        where: what an error text begins with: file and section.
    """
    values = {} if values is None else values
    if not isinstance(values, Mapping):
        raise InputError(f"{where}: wants 'field: value' pairs, got {values!r}")
    known = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise InputError(f"{where}: unknown key '{key}'{nearest(str(key), known)}")
    for key, value in values.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{where}: '{key}' = {value} wants a finite number")
    try:
        text = json.dumps(values, allow_nan=False)
        return TypeAdapter(kind).validate_json(text, strict=True)
    except ValidationError as error:
        detail = error.errors()[0]
        key = ".".join(str(part) for part in detail["loc"])
        message = detail["msg"].removeprefix("Value error, ")
        raise InputError(
            f"{where}: '{key}' = {detail['input']!r}: {message}" if key else f"{where}: {message}"
        ) from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {error}") from error


def plain(config: Any) -> dict[str, Any]:
    """The inverse: what a YAML file can hold."""
    values: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(config)))
    return values
