"""How is the companion started on the drone? ``python -m companion``.

argparse, because a goal has two or three numbers.
"""

import argparse
import dataclasses
import gc
import json
import math
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from companion.app.config import VEHICLE_URL, CompanionConfig, Engage
from companion.app.preflight import check
from companion.app.preflight.listen import LISTEN_S
from companion.app.preflight.show import print_json, print_table
from companion.app.run import fly
from companion.app.status import ExitCode
from companion.core import params
from companion.core.params import ParamError
from companion.core.task import Task
from companion.core.url import parse_url
from companion.navigator import Params
from companion.navigator.profiles import merged, profile_named, profile_names

CRUISE_M_S = 3.0
ELSEWHERE = [50.0, 0.0]  # a goal for a check that was not told one
EXAMPLE = """\
example:
  python -m companion --vehicle udpin://127.0.0.1:14540 --goal 55 0 -3 --cruise 4 --log flights/first
  python -m companion --vehicle serial:///dev/serial0:921600 --lidar lds2d:LD19:/dev/ttyUSB0 --check
"""


class InputError(ValueError):
    """A file given on the command line is wrong; one line."""


class OneLineParser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line."""

    def error(self, message: str) -> NoReturn:
        """Say it and exit with 2."""
        self.exit(int(ExitCode.BAD_INPUT), f"{self.prog}: {message} (try --help)\n")


def parser(prog: str = "python -m companion") -> OneLineParser:
    """The options."""
    options = OneLineParser(
        prog=prog,
        description="Fly a PX4-class vehicle with a planar LiDAR to a goal through clutter, and land there.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = options.add_argument
    add("--vehicle", metavar="URL", help=f"the autopilot, as MAVSDK writes it (default: {VEHICLE_URL})")
    lidar_help = "a LiDAR of its own: URL of one that speaks MAVLink, replay:FILE, or lds2d:MODEL:/dev/DEVICE"
    add("--lidar", metavar="URL", help=f"{lidar_help} (default: scans come over the vehicle's link)")
    goal_help = "NORTH EAST [DOWN] from where it booted"
    add("--goal", metavar="M", type=_number, nargs="+", help=goal_help)
    add("--cruise", metavar="M_S", type=_number, default=CRUISE_M_S, help=f"cap of the speed (default: {CRUISE_M_S:g})")
    add("--policy", metavar="NAME", help="who flies in RL mode: geometric, a shipped name, or a folder")
    add("--profile", metavar="NAME", help=f"a named parameter set: {', '.join(profile_names())}")
    add("--params", metavar="FILE", type=Path, help="YAML of {group: {field: value}}, on top of the profile")
    add("--log", metavar="DIR", type=Path, help="log folder (default: flights/<UTC>_companion)")
    add("--engage", choices=list(Engage), type=Engage, default=Engage.WAIT, help="auto: ask for OFFBOARD ourselves")
    add("--connect-timeout", metavar="S", type=_number, default=30.0, help="give up without a vehicle after this")
    add("--instance", metavar="N", type=int, default=0, help="added to the port of the default URL")
    key_help = "key file: sign every MAVLink packet, believe only signed ones (default: believe everybody)"
    add("--sign-key", metavar="FILE", type=Path, help=key_help)
    add("--seed", metavar="N", type=int, default=0, help="kept with the flight's log")
    add("--check", action="store_true", help="do not fly: say what is missing before the take-off, exit 6 if unfit")
    add("--check-time", metavar="S", type=_number, default=LISTEN_S, help="how long to listen (default: %(default)s)")
    add("--json", action="store_true", help="print one JSON object at the end")
    add("--status", action="store_true", help="print a line about the flight now and then")
    return options


def main(arguments: list[str] | None = None, prog: str = "python -m companion") -> int:
    """Parse, fly, give the exit code."""
    options = parser(prog)
    given = options.parse_args(arguments)
    if given.check:
        return check_only(given)
    if given.goal is None:
        options.error("the following arguments are required: --goal")
    try:
        config = config_from(given)
    except (InputError, ParamError) as error:
        print(error, file=sys.stderr)
        return int(ExitCode.BAD_INPUT)
    return launch(config, given)


def check_only(given: argparse.Namespace, tuned: Params | None = None) -> int:
    """Check instead of flying; the exit code. ``tuned``: what a mission changes of the parameters."""
    goal_given, problem, tuned = given.goal is not None, None, tuned or Params()
    try:
        tuned = params.update(tuned, told_params(given))
    except (InputError, ParamError) as error:
        problem = str(error)
    given.params, given.profile, given.policy, given.goal = None, None, None, given.goal or ELSEWHERE
    try:
        config = dataclasses.replace(config_from(given), params=tuned)
    except InputError as error:
        print(error, file=sys.stderr)
        return int(ExitCode.BAD_INPUT)
    report = check(config, given.check_time, problem, goal_given)
    (print_json if given.json else print_table)(report)
    return int(ExitCode.LANDED if report.fit else ExitCode.UNFIT)


def launch(config: CompanionConfig, given: argparse.Namespace) -> int:
    """Fly and print what was asked for; the exit code."""
    gc.collect()
    gc.freeze()  # what the imports made stays for ever: never walk through it in flight, that takes tens of ms
    summary = fly(config, on_status=print_status if given.status else None)
    if given.json:
        print(json.dumps(dataclasses.asdict(summary)))
    return summary.exit_code


def config_from(given: argparse.Namespace) -> CompanionConfig:
    """What the options say. Raises InputError or ParamError."""
    if len(given.goal) not in (2, 3):
        raise InputError(f"--goal wants NORTH EAST [DOWN], got {len(given.goal)} numbers")
    down_m = given.goal[2] if len(given.goal) == 3 else None
    url = parse_url(VEHICLE_URL)
    return CompanionConfig(
        task=Task(np.array(given.goal[:2]), down_m, given.cruise),
        log_dir=given.log or Path("flights") / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}_companion",
        vehicle_url=given.vehicle or str(dataclasses.replace(url, port=url.port + given.instance)),
        lidar_url=given.lidar,
        params=params.update(Params(), told_params(given)),
        engage=given.engage,
        connect_timeout_s=given.connect_timeout,
        sign_key=given.sign_key,
        seed=given.seed,
    )


def told_params(given: argparse.Namespace) -> dict[str, Any]:
    """Profile, parameter file and policy as nested overrides. Raises InputError or ParamError."""
    overrides = profile_named(given.profile) if given.profile else {}
    if given.params is not None:
        overrides = merged(overrides, read_params(given.params))
    return merged(overrides, {"policy": {"name": given.policy}}) if given.policy else overrides


def read_params(path: Path) -> dict[str, Any]:
    """The nested overrides of a YAML file. Raises InputError naming file and line."""
    try:
        overrides = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except (YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: {_first_line(error)}") from error
    if overrides is None:
        return {}
    if not isinstance(overrides, dict):
        raise InputError(f"{path} wants 'group:' with 'field: value' lines below, got {type(overrides).__name__}")
    return overrides


def print_status(line: object) -> None:
    """One line about the flight, on stderr: stdout belongs to ``--json``."""
    print(line, file=sys.stderr, flush=True)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a finite number")
    return value


def _first_line(error: Exception) -> str:
    if isinstance(error, MarkedYAMLError) and error.problem_mark is not None:
        return f"line {error.problem_mark.line + 1}: {error.problem or 'no YAML'}"
    return str(error).splitlines()[0]
