"""Which options do the commands share, and how is a missing extra told?"""

import importlib.util
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.errors import InputError
from mission.processes import INSTANCE_MAX

if TYPE_CHECKING:
    from mission.px4_firmware import Px4Build
    from sitl.vehicle_config import Firmware

EXTRA_MODULES = {  # as pyproject.toml lists them
    "sitl": ("jsbsim", "mavsdk", "numba", "fcl", "matplotlib"),
    "train": ("jsbsim", "matplotlib", "torch", "gymnasium", "tensorboard", "onnx"),
    "scale": ("ray",),
}
SWITCH = {"on": True, "off": False}
SPEED_MIN, SPEED_MAX = 0.1, 100.0

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for machines.")]
Seed = Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Draws wind, start, noise and movers.")]
Speed = Annotated[str, typer.Option("--speed", help="Times real time (1, 5, ...), or 'max': lockstep, unpaced.")]
Lockstep = Annotated[bool, typer.Option("--lockstep", help="The vehicle waits for the answer to each scan.")]
Instance = Annotated[int, typer.Option("--instance", min=0, max=INSTANCE_MAX, help="Added to every port.")]
ParamSet = Annotated[
    list[str] | None, typer.Option("--param", metavar="GROUP.FIELD=VALUE", help="Override one parameter; repeatable.")
]
Faults = Annotated[
    list[str] | None,
    typer.Option(
        "--fault", metavar="NAME[=VALUE][@START[..END]]", help="Break something, e.g. gps_off@30; repeatable."
    ),
]
SignKey = Annotated[
    Path | None, typer.Option("--sign-key", metavar="FILE", help="Sign the MAVLink links with the key of this file.")
]
ParamFile = Annotated[Path | None, typer.Option("--params", metavar="FILE", help="YAML with {group: {field: value}}.")]
FirmwareName = Annotated[str, typer.Option("--firmware", help="Who flies: embedded, or px4 (a real one).")]
Px4Bin = Annotated[
    Path | None, typer.Option(envvar="PX4_BIN", help="With --firmware px4: start this .../bin/px4; else wait for one.")
]


def require_extra(extra: str, command: str) -> None:
    """Raise InputError with the line that says what to install, when a package of the extra is missing."""
    if any(importlib.util.find_spec(module) is None for module in EXTRA_MODULES[extra]):
        raise InputError(f"swiftnav {command} needs the '{extra}' extra: pip install 'swiftnav[{extra}]'")


def refuse_beside_resume(context: typer.Context, *allowed: str) -> None:
    """A run that goes on keeps its settings. Raises InputError naming the option that was given beside ``--resume``."""
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in ("resume", *allowed) and source is not None and source.name == "COMMANDLINE":
            option = {"setting": "set"}.get(name, name.replace("_", "-"))
            raise InputError(f"--resume goes on with a run as it was begun: no --{option} beside it")


def parse_switch(text: str, option: str) -> bool:
    """On or off. Raises InputError."""
    if text not in SWITCH:
        raise InputError(f"{option} '{text}' wants on or off")
    return SWITCH[text]


def parse_speed(text: str, lockstep: bool) -> tuple[float, bool]:
    """Factor over real time (inf: unpaced), and whether in lockstep. Raises InputError."""
    if text == "max":
        return math.inf, True
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not SPEED_MIN <= speed <= SPEED_MAX:
        raise InputError(f"--speed '{text}' wants a number in [{SPEED_MIN:g}, {SPEED_MAX:g}] or 'max'")
    return speed, lockstep


def parse_firmware(name: str, px4_bin: Path | None) -> tuple["Firmware", "Px4Build | None"]:
    """Who flies, and the build to start. Raises InputError."""
    from companion.core.params import nearest
    from mission.px4_firmware import find_build
    from sitl.vehicle_config import Firmware

    names = [firmware.value for firmware in Firmware]
    if name not in names:
        raise InputError(f"--firmware '{name}' is unknown{nearest(name, names)}")
    firmware = Firmware(name)
    return firmware, find_build(px4_bin) if firmware is Firmware.PX4 and px4_bin is not None else None


def parse_overrides(
    file: Path | None, settings: list[str] | None, option: str = "--param", form: str = "GROUP.FIELD=VALUE"
) -> dict[str, dict[str, Any]]:
    """The parameter file with the settings of an option on top, nested, unchecked. Raises InputError."""
    from mission.strict_yaml import read_yaml

    overrides: dict[str, dict[str, Any]] = read_yaml(file) if file else {}
    for setting in settings or []:
        key, separator, text = setting.partition("=")
        group, dot, field = key.partition(".")
        if not (separator and dot):
            raise InputError(f"{option} '{setting}' wants {form}")
        overrides[group] = {**(overrides.get(group) or {}), field: _value(text)}
    return overrides


def print_json(value: Any) -> None:
    """One JSON object on stdout; infinite and NaN become null, which JSON can say."""
    typer.echo(json.dumps(json_ready(value)))


def json_ready(value: Any) -> Any:
    """``value`` with what JSON cannot say turned into null."""
    if isinstance(value, dict):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(item) for item in value]
    if isinstance(value, float) and not -float("inf") < value < float("inf"):
        return None
    return value


def _value(text: str) -> Any:
    """A number or truth value as YAML would read it, else the text."""
    try:
        return json.loads(text)
    except ValueError:
        return text
