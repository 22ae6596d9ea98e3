"""``swiftnav companion``: the drone's own door (``python -m companion``), with ``--mission`` in place of ``--goal``.

The arguments are the companion's, and argparse reads them as it does there: a goal has two or three numbers.
"""

import argparse
import dataclasses

from companion.app.command_line import CRUISE_M_S, check_only, config_from, launch, parser, told_params
from companion.app.command_line import InputError as CompanionInputError
from companion.core import params
from companion.navigator import Params
from mission.errors import InputError

PROG = "swiftnav companion"


def companion(arguments: list[str]) -> int:
    """Run the companion until it has landed or was stopped. Returns its exit code. Raises InputError or ParamError."""
    options = parser(PROG)
    options.add_argument(
        "--mission", metavar="FILE", help="goal, cruise and parameters of a mission, instead of --goal"
    )
    options.set_defaults(cruise=None)
    given = options.parse_args(arguments)
    if (given.goal is not None and given.mission is not None) or not (given.goal or given.mission or given.check):
        options.error("wants either --goal NORTH EAST [DOWN] or --mission FILE")
    tuned = _take_mission(given) if given.mission is not None else Params()
    given.cruise = CRUISE_M_S if given.cruise is None else given.cruise
    if given.check:
        return check_only(given, tuned)
    try:
        config = config_from(given)
        overrides = told_params(given)
    except CompanionInputError as error:
        raise InputError(str(error)) from error
    return launch(dataclasses.replace(config, params=params.update(tuned, overrides)), given)


def _take_mission(given: argparse.Namespace) -> Params:
    """Fill in the goal, relative to where the mission starts, and the cruise speed; the mission's parameters."""
    from mission.flight_plan import mission_params, mission_world
    from mission.mission_file import load_mission

    mission = load_mission(given.mission)
    tuned = mission_params(mission)
    world = mission_world(mission, given.seed, tuned.vehicle.radius_m)
    given.goal = (world.goal_ned_m - world.start_ned_m).tolist()
    if mission.down_m is not None:
        given.goal.append(mission.down_m)
    if given.cruise is None:
        given.cruise = mission.cruise_m_s
    return tuned
