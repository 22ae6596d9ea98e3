"""Does a claim of the paper hold here?  A stated rule on figures of arms, seed by seed; pure.

A claim about a curve holds where at least four seeds in five agree (``AGREED``); one that sets two arms against each
other compares their means over seeds. ``not measured``: an arm of it has no finished seed, trained too few episodes, or
has one seed where the rule wants an interval.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from mission.reproduce.measures import Figures, interval_of

AGREED = 0.8
Seeds = Sequence[Figures]  # of one arm, one an entry
Measured = tuple[bool, str]


class Verdict(StrEnum):
    """Every possible answer."""

    HOLDS = "holds"
    FAILS = "does not hold here"
    NOT_MEASURED = "not measured"


class UnmeasuredError(Exception):
    """A figure that a rule needs is missing."""


@dataclass(frozen=True, slots=True)
class Claim:
    """``settings``: the arms that the rule compares, once a set of settings; ``judge`` takes their seeds in order."""

    name: str
    place: str  # in the paper
    text: str
    rule: str
    settings: Mapping[str, tuple[str, ...]]
    judge: Callable[..., Measured]


@dataclass(frozen=True, slots=True)
class Outcome:
    """One line of the table."""

    claim: Claim
    settings: str
    measured: str
    seeds: str  # how many of which arm
    verdict: Verdict


def judge_all(claims: Sequence[Claim], arms: Mapping[str, Seeds]) -> list[Outcome]:
    """Every claim under each of its settings; ``arms`` holds the finished seeds of those that were run."""
    return [_judge(claim, settings, names, arms) for claim in claims for settings, names in claim.settings.items()]


def agree(seeds: Seeds, holds: Callable[[Figures], bool]) -> bool:
    """Do four seeds in five say so?"""
    return sum(holds(seed) for seed in seeds) >= AGREED * len(seeds)


def value(seed: Figures, name: str) -> float:
    """A figure of one seed. Raises UnmeasuredError."""
    found = seed[name]
    if found is None:
        raise UnmeasuredError(name)
    return found


def mean(seeds: Seeds, name: str) -> float:
    """Over the seeds that have it. Raises UnmeasuredError where none has."""
    interval = interval_of(seeds, name)
    if interval is None:
        raise UnmeasuredError(name)
    return interval.mean


def told(seeds: Seeds, name: str, digits: int | None = 2) -> str:
    """Mean and interval for people; ``digits`` None: as many decimals as make sense, two at most."""
    interval = interval_of(seeds, name)
    if interval is None:
        return "-"
    if digits is None:
        digits = decimals(interval.mean)
    text = f"{interval.mean:.{digits}f}"
    if interval.low is None or interval.high is None:
        return text
    return f"{text} [{interval.low:.{digits}f}, {interval.high:.{digits}f}]"


def decimals(value: float) -> int:
    """Of a number of unknown size: three digits in all, or the whole number."""
    return 0 if abs(value) >= 100.0 else 1 if abs(value) >= 10.0 else 2


def _judge(claim: Claim, settings: str, names: tuple[str, ...], arms: Mapping[str, Seeds]) -> Outcome:
    counts = {name: len(arms.get(name, ())) for name in names}
    seeds = ", ".join(f"{name} {count}" for name, count in counts.items())
    missing = [name for name in names if not counts[name]]
    if missing:
        return Outcome(claim, settings, f"no finished seed of {', '.join(missing)}", seeds, Verdict.NOT_MEASURED)
    try:
        holds, measured = claim.judge(*(arms[name] for name in names))
    except UnmeasuredError as figure:
        return Outcome(claim, settings, f"too little was flown to tell {figure}", seeds, Verdict.NOT_MEASURED)
    return Outcome(claim, settings, measured, seeds, Verdict.HOLDS if holds else Verdict.FAILS)
