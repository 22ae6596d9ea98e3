"""How are the commands answered that run a mission? Start, and jump to an item."""

from collections.abc import Mapping
from typing import Final

from pymavlink.dialects.v20 import common as mav

from sitl.command import ACCEPTED, DENIED, Answer, Command, Handler, answer, whole
from sitl.link import Link
from sitl.simulation import Simulation


def _start(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Fly the mission from item p1 on, and arm for it; p2, the last item, is ignored as in PX4. DENIED without one."""
    first = whole(command.params[0])
    if first is not None and first > 0 and not sim.autopilot.plans.jump_to(first):
        return DENIED
    return answer(sim.autopilot.command_mission())


def _jump(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Make item p1 the current one; -1 leaves it."""
    seq = whole(command.params[0])
    if seq is None or seq < -1:
        return DENIED
    return ACCEPTED if seq == -1 or sim.autopilot.plans.jump_to(seq) else DENIED


HANDLERS: Final[Mapping[int, Handler]] = {
    mav.MAV_CMD_MISSION_START: _start,
    mav.MAV_CMD_DO_SET_MISSION_CURRENT: _jump,
}
