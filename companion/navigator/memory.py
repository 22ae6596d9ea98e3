"""What does the navigator remember from tick to tick? One immutable value."""

import math
from dataclasses import dataclass

from companion.arbiter import arbiter
from companion.core import gridmap
from companion.core.gridmap import GridMap
from companion.core.types import F64, VehicleState
from companion.guidance.landing import LandingState
from companion.guidance.limits import HoldMemory
from companion.guidance.line import GuidanceLine
from companion.guidance.swerve import Swerve
from companion.navigator.params import Params
from companion.perception.movers import Track


@dataclass(frozen=True, slots=True)
class Path:
    """A polyline that passed the checker, and how far along it the vehicle is."""

    vertices_ne_m: F64  # (k, 2)
    s_m: float
    margin_m: float  # beyond the radius, at which it passed
    decided_t_s: float
    lasts_s: float  # then it is planned anew
    used_up_m: float  # also with less than this left
    run_out_m: float = 0.0  # flown as if it went on straight for so long: it is replaced before it ends


@dataclass(frozen=True, slots=True)
class Engagement:
    """What was frozen when the autopilot went to OFFBOARD, and who flies since."""

    start_ne_m: F64  # (2,)
    down_m: float  # cruise altitude
    engaged_t_s: float
    arbiter: arbiter.ArbiterState
    line: GuidanceLine  # of the present or last Travel
    line_s_m: float
    path: Path | None  # RL only
    tried_t_s: float  # last decision, accepted or not
    landing: LandingState | None
    stop: HoldMemory | None  # while braking or holding
    swerve: Swerve | None = None  # the last one
    course_rad: float | None = None  # of the last accepted path, from its anchor to its end


@dataclass(frozen=True, slots=True)
class Tightness:
    """Which parameter set flies (``navigator.tightness``)."""

    since_t_s: float = -math.inf
    aside: GridMap | None = None  # where it is tight: the map of the open, as it was last; None: it is open
    push_ne_m_s2: tuple[float, float] = (0.0, 0.0)  # of the wind
    calm: bool = True
    best_m: float = math.inf  # least distance to the goal so far
    best_t_s: float = 0.0  # when it was reached


@dataclass(frozen=True, slots=True)
class Memory:
    """Everything remembered; ``engaged`` only while the autopilot reports OFFBOARD and armed."""

    grid: GridMap
    tracks: tuple[Track, ...]
    ticks: int
    t_s: float
    yaw_sp_rad: float
    policy: F64 | None  # whatever the policy wants to see again
    guard: F64 | None  # the same of the geometric expert, where it guards another policy
    decisions: int
    state: VehicleState | None  # the last one that could be believed
    ground_down_m: float  # where the autopilot last stood, by its own estimate
    engaged: Engagement | None
    tight: Tightness = Tightness()


def start(params: Params) -> Memory:
    """Nothing seen, nobody flies."""
    return Memory(gridmap.empty(params.map), (), 0, 0.0, 0.0, None, None, 0, None, 0.0, None)
