"""What is a policy asked, and what does it answer? Values; the same for the learned policy and the geometric expert."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from companion.core.gridmap import GridMap
from companion.core.types import F64, VehicleState

WAYPOINTS = 5  # eq. action_mat


@dataclass(frozen=True, slots=True)
class Query:
    """Everything a policy may look at when RL mode asks for a path."""

    state: VehicleState
    goal_ne_m: F64  # (2,)
    grid: GridMap
    hazard_ne_m: F64  # (h, 2) what movers will sweep
    radius_m: float  # of the vehicle
    prefix_ne_m: F64  # (k, 2) already committed: ends where the new path has to begin, k = 1 is the vehicle's place
    observation: F64  # (72,)
    start_ne_m: F64  # (2,) where OFFBOARD began: the line to the goal starts there
    cruise_m_s: float = 3.0  # cap of the horizontal speed
    course_rad: float | None = None  # over ground, from anchor to end of the path that is flown; None: none yet


@dataclass(frozen=True, slots=True)
class Proposal:
    """Waypoints in local NED, (k, 2): the committed stretch if there is one, then five new ones (fewer near the goal).

    ``others_ne_m`` are next choices, best first: where the checker does not keep the first, it is asked about these.
    ``lasts_s``: the policy wants to be asked again after so long; None: as the parameters have it.
    """

    waypoints_ne_m: F64
    others_ne_m: Sequence[F64] = ()
    lasts_s: float | None = None


class Policy(Protocol):
    """A pure function with a name; ``memory`` is whatever it handed back last (None at first)."""

    name: str

    def propose(self, query: Query, memory: F64 | None) -> tuple[Proposal | None, F64 | None]:
        """Five waypoints, or None when there is no way; and the memory for the next call."""
        ...
