"""What does a person see of a seed while it trains?  Values that travel between processes; light to import."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a seed has come."""

    episodes: int = 0
    successes: int = 0
    decisions: int = 0
    updates: int = 0
    ticks: int = 0


@dataclass(frozen=True, slots=True)
class Status:
    """One seed after an episode."""

    seed: int
    state: str  # training | done
    progress: Progress
    steps_15: float  # means over the last 15 episodes
    return_15: float
    decisions_per_s: float
    wall_s: float  # of training; evaluations not counted
    time_left_s: float | None
    shares: dict[str, float]  # of the wall time: physics, navigator, updates, rest
    note: str = ""
