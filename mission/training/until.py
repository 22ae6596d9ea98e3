"""When is a seed trained enough, and how often is what done on the way?  Values."""

from dataclasses import dataclass, fields

UNLIMITED = 10**12


@dataclass(frozen=True, slots=True)
class Until:
    """Training ends with so many successes, so many episodes, or the episode in which the ticks are used up."""

    successes: int = 100
    episodes: int = 1000
    ticks: int = UNLIMITED  # of the environment

    def __post_init__(self) -> None:
        _at_least(self, 1, [field.name for field in fields(self)])


@dataclass(frozen=True, slots=True)
class TrainingConfig:
    """How often what is done."""

    batch: int = 128
    updates_per_decision: int = 1
    warmup_decisions: int = 128  # in the replay memory before the first update
    mirror: bool = False  # half of every batch mirrored: for worlds that have no preferred side
    prefill_flights: int = 0  # of the geometric expert, kept before the first episode
    checkpoint_every: int = 5  # episodes
    evaluate_every: int = 25  # episodes; 0: never
    evaluation_flights: int = 5

    def __post_init__(self) -> None:
        ones = ["batch", "updates_per_decision", "warmup_decisions", "checkpoint_every", "evaluation_flights"]
        _at_least(self, 1, ones)
        _at_least(self, 0, ["evaluate_every", "prefill_flights"])


def _at_least(config: object, least: int, names: list[str]) -> None:
    """Raises ValueError naming the field."""
    for name in names:
        if getattr(config, name) < least:
            raise ValueError(f"'{name}' = {getattr(config, name)} wants at least {least}")
