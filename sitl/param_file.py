"""How do parameters survive the end of the program? A file as QGroundControl writes it; only what differs is kept."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from pymavlink.dialects.v20 import common as mav

from companion.core.params import nearest
from sitl.px4_params import ParamStore

HEAD: Final = "# Onboard parameters: vehicle, component, name, value, MAV_PARAM_TYPE\n"


class ParamFileError(ValueError):
    """A parameter file is wrong; the text is one line."""


class ParamFile:
    """Saves a store whenever it has changed."""

    def __init__(self, path: Path, system_id: int, base: Mapping[str, int | float]) -> None:
        """``base``: the values that a vehicle has without the file."""
        self._path = path
        self._system_id = system_id
        self._base = dict(base)
        self._saved: dict[str, int | float] | None = None

    def save(self, params: ParamStore) -> None:
        """Write what differs from the base, unless the file says so already. Raises OSError."""
        changed = {n: params[n] for n in params.names() if params[n] != self._base.get(n)}
        if changed == self._saved:
            return
        lines = (f"{self._system_id}\t1\t{n}\t{v!r}\t{_kind(v)}\n" for n, v in changed.items())
        fresh = self._path.with_name(self._path.name + ".new")
        fresh.write_text(HEAD + "".join(lines), encoding="utf-8")
        fresh.replace(self._path)
        self._saved = changed


def read_param_file(path: Path, known: ParamStore) -> dict[str, int | float]:
    """Values by name; empty when there is no such file. Raises ParamFileError naming file and line."""
    if not path.exists():
        return {}
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ParamFileError(f"{path} cannot be read: {error}") from error
    values: dict[str, int | float] = {}
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        fields = line.split("\t")
        name = fields[2] if len(fields) == 5 else ""
        if name not in known:
            raise ParamFileError(f"{path}, line {number}: unknown parameter '{name}'{nearest(name, known.names())}")
        try:
            values[name] = type(known[name])(fields[3])
        except ValueError as error:
            raise ParamFileError(f"{path}, line {number}: '{fields[3]}' is no value of {name}") from error
    return values


def _kind(value: int | float) -> int:
    return int(mav.MAV_PARAM_TYPE_INT32 if isinstance(value, int) else mav.MAV_PARAM_TYPE_REAL32)
