"""How does a YAML file become a checked value, with one clear line about whatever is wrong in it?"""

from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from companion.core.params import nearest
from mission.errors import InputError


class StrictModel(BaseModel):
    """Base of what is read from files: frozen, no unknown keys, no NaN, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


Model = TypeVar("Model", bound=StrictModel)


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file. Raises InputError."""
    try:
        data = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file in UTF-8") from error
    except MarkedYAMLError as error:
        where = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise InputError(f"{path}{where}: {error.problem or error.context or 'not YAML'}") from error
    except YAMLError as error:
        raise InputError(f"{path}: {' '.join(str(error).split())}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path}: wants 'key: value' pairs at the top, got {type(data).__name__}")
    return data


def write_yaml(path: Path, data: dict[str, Any]) -> None:
    """``data`` (plain values only) as block YAML."""
    yaml = YAML(typ="safe")
    yaml.default_flow_style = False
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(data, file)


def checked(model: type[Model], data: dict[str, Any], where: str) -> Model:
    """``data`` as a ``model``. Raises InputError about the first thing that is wrong, prefixed with ``where``."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        details = error.errors()
        first = next((d for d in details if d["type"] == "extra_forbidden"), details[0])  # a typo explains a gap
        raise InputError(f"{where}: {_one_line(model, first)}") from error


def _one_line(model: type[BaseModel], detail: ErrorDetails) -> str:
    key = ".".join(str(part) for part in detail["loc"])
    if detail["type"] == "extra_forbidden":
        return f"unknown key '{key}'{nearest(str(detail['loc'][-1]), _keys_beside(model, detail['loc']))}"
    if detail["type"] == "missing":
        return f"key '{key}' is missing"
    text = detail["msg"].removeprefix("Value error, ")
    return f"'{key}' = {detail['input']!r}: {text[:1].lower()}{text[1:]}" if key else text


def _keys_beside(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """The known keys at the place of an unknown one."""
    for part in location[:-1]:
        if isinstance(part, int):
            continue  # the items of a list share the keys of their type
        field = model.model_fields.get(part)
        inner = _model_in(field.annotation) if field else None
        if inner is None:
            break
        model = inner
    return list(model.model_fields)


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model that a field holds: itself, or as items of a tuple."""
    kinds = [kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type)]
    return next((kind for kind in kinds if issubclass(kind, BaseModel)), None)
