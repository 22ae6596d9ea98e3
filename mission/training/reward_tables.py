"""How much does each event of a flight pay? The paper's two tables as printed, and as we train; frozen data.

``clock_s``: a *step* of a table is this long, so that the tick rate is no hyper-parameter. The paper's 50 steps are
5 s here. ``scale`` brings sums of rows to what a critic learns well; rows are reported in the table's own units.
Contact ends every episode: the vehicle would fly through what it touches, so there is no recovering from it; the
paper's recoverable collision is paid as printed in the ``_paper`` table.

As printed both tables can be farmed: a bypass pays for 10 s of flight, endpoints and zone exits pay without ever
reaching the goal. The ``default`` variants pay leaving RL mode, and zones, only for ``new_progress_m`` beyond any exit
paid before, and each bonus a few times at most.
"""

from dataclasses import dataclass, replace

from companion.core.params import nearest
from mission.errors import InputError

DEPARTURE_M = 2.0  # assumed: off the guidance line by more than this is a departure; back within half of it re-arms it
ENDPOINT_M = 1.0  # assumed: two RL endpoints nearer than this are the same place
RECENT_ENDPOINTS = 10  # assumed: "recently visited"
NO_PROGRESS_M = 0.5  # table 2
NO_PROGRESS_STEPS = 50  # table 2
PAPER_STEP_S = 0.1  # 50 steps are 5 s
UNLIMITED = 10**9


@dataclass(frozen=True, slots=True)
class RewardTable:
    """Contributions by event; 0 where the table has no such row."""

    name: str
    clock_s: float = PAPER_STEP_S
    scale: float = 1.0
    step: float = 0.0  # every step
    progress: float = 0.0  # per metre nearer to the goal
    way: float = 0.0  # per second less of the way that is left, by the true map
    goal: float = 0.0  # nearer than 2 m for the first time
    crash: float = 0.0  # contact: "any" of table 1, "recoverable" of table 2
    failure: float = 0.0  # out of bounds or attitude
    no_progress: float = 0.0  # displacement below 0.5 m over 50 paper steps
    no_progress_ends: bool = False  # and the episode with it
    proximity: float = 0.0  # per step and metre nearer than ``zone_m``
    zone_m: float = 5.0
    departure: float = 0.0  # off the guidance line
    bypass: float = 0.0  # RL -> Travel without contact (table 1)
    travel: float = 0.0  # the same, one-shot (table 2)
    zone_exit: float = 0.0  # d_min beyond ``zone_m`` again
    endpoint_novel: float = 0.0  # an RL path ends where none has ended
    endpoint_repeated: float = 0.0  # ... or where one of the last ten did
    new_progress_m: float | None = None  # None: bonuses are paid for any exit
    bypass_max: int = UNLIMITED  # how often each bonus is paid in one episode
    zone_exit_max: int = UNLIMITED
    endpoint_novel_max: int = UNLIMITED


TRAJECTORY1_PAPER = RewardTable(
    "trajectory1_paper", step=-1.0, progress=2.0, goal=200.0, crash=-1000.0, departure=-50.0, bypass=100.0, scale=0.01
)
TRAJECTORY2_PAPER = RewardTable(
    "trajectory2_paper",
    step=-0.5,
    progress=1.5,
    goal=3500.0,
    crash=-200.0,
    failure=-1500.0,
    no_progress=-500.0,
    no_progress_ends=True,
    proximity=-1.2,
    endpoint_repeated=-10.0,
    travel=500.0,
    zone_exit=50.0,
    endpoint_novel=20.0,
    scale=0.003,
)
TRAJECTORY1 = replace(
    TRAJECTORY1_PAPER,
    name="trajectory1",
    clock_s=1.0,
    failure=-1000.0,  # leaving the map must not be cheaper than touching something
    new_progress_m=2.0,
    bypass_max=2,
)
TRAJECTORY2 = replace(
    TRAJECTORY2_PAPER,
    name="trajectory2",
    clock_s=1.0,
    crash=-1500.0,  # contact ends an episode here, so it is no cheaper than the other failures
    no_progress=-50.0,  # every 5 s of it, as the episode goes on
    no_progress_ends=False,
    new_progress_m=2.0,
    zone_exit_max=3,
    endpoint_novel_max=5,
)
PLAIN = RewardTable("plain", step=-0.01, goal=5.0, crash=-5.0, failure=-5.0)
WAY = RewardTable("way", step=-0.03, way=0.3, goal=5.0, crash=-5.0, failure=-5.0)
WAY_OPEN = replace(WAY, name="way_open", step=-0.01, failure=-10.0)  # unfenced: flying out must not end a bad day

TABLES = {
    table.name: table
    for table in (TRAJECTORY1, TRAJECTORY2, TRAJECTORY1_PAPER, TRAJECTORY2_PAPER, PLAIN, WAY, WAY_OPEN)
}
VARIANTS = {"default": "", "paper": "_paper"}


def reward_table(name: str, world_name: str = "") -> RewardTable:
    """The table of that name; ``default`` and ``paper`` mean table 1 on trajectory1, table 2 elsewhere.

    Raises InputError with the nearest name.
    """
    if name in VARIANTS:
        number = 1 if world_name.startswith("trajectory1") else 2
        name = f"trajectory{number}{VARIANTS[name]}"
    if name not in TABLES:
        raise InputError(f"unknown reward table '{name}'{nearest(name, [*TABLES, *VARIANTS])}")
    return TABLES[name]
