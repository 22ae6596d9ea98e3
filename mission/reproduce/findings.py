"""What lies in the folder of a reproduction, in figures?  Arms, seeds, verdicts; JSON-ready and for the document."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from companion.core.types import F64
from mission.reproduce.arms import Arm, Table
from mission.reproduce.claims import Outcome, Verdict, judge_all
from mission.reproduce.measures import Figures, Interval, SeedRows, figures_of, interval_of, read_seed
from mission.reproduce.paper_claims import CLAIMS
from mission.reproduce.run import arm_folder
from mission.training.run_folder import RUN_FILE, open_run
from mission.world_file import list_worlds, load_world

QUICK = "quick run, no verdict: {}"


@dataclass(frozen=True, slots=True)
class ArmFindings:
    """One arm: every seed that was asked for, the figures of those that are done."""

    arm: Arm
    seeds: tuple[SeedRows, ...]
    figures: tuple[Figures, ...]

    @property
    def done(self) -> list[SeedRows]:
        """The finished seeds."""
        return [seed for seed in self.seeds if seed.done]

    def over_seeds(self) -> dict[str, Interval | None]:
        """Each figure with its interval."""
        names = dict.fromkeys(name for seed in self.figures for name in seed)
        return {name: interval_of(self.figures, name) for name in names}


@dataclass(frozen=True, slots=True)
class Findings:
    """Everything; ``arms`` by name, those that were begun."""

    quick: bool
    arms: dict[str, ArmFindings]
    outcomes: list[Outcome]
    not_run: list[str]  # arms of the table of which nothing is there

    def counts(self) -> dict[str, int]:
        """How many claims have which verdict."""
        return {str(verdict): sum(o.verdict is verdict for o in self.outcomes) for verdict in Verdict}

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "quick": self.quick,
            "arms": {name: _arm_dict(found) for name, found in self.arms.items()},
            "not_run": self.not_run,
            "claims": [_outcome_dict(outcome) for outcome in self.outcomes],
            "verdicts": self.counts(),
        }


def findings(out: Path, table: Table) -> Findings:
    """From whatever is there, finished or not. Raises InputError about a damaged ``run.yaml``."""
    arms = {arm.name: _read(out, arm) for arm in table.arms if (arm_folder(out, arm) / RUN_FILE).is_file()}
    outcomes = judge_all(CLAIMS, {name: found.figures for name, found in arms.items()})
    if table.quick:
        outcomes = [
            replace(outcome, measured=QUICK.format(outcome.measured), verdict=Verdict.NOT_MEASURED)
            for outcome in outcomes
        ]
    return Findings(table.quick, arms, outcomes, [arm.name for arm in table.arms if arm.name not in arms])


def _read(out: Path, arm: Arm) -> ArmFindings:
    folder = arm_folder(out, arm)
    seeds = tuple(read_seed(folder, seed) for seed in open_run(folder).seeds)
    goal = _goal_ne_m(arm)
    return ArmFindings(arm, seeds, tuple(figures_of(seed, arm.until, goal) for seed in seeds if seed.done))


def _goal_ne_m(arm: Arm) -> F64 | None:
    return load_world(arm.world).goal_ned_m[:2] if arm.world in list_worlds() else None


def _arm_dict(found: ArmFindings) -> dict[str, Any]:
    arm = found.arm
    return {
        "group": arm.group,
        "text": arm.text,
        "world": arm.world,
        "preset": arm.preset.name,
        "settings": dict(arm.settings),
        "run": arm.run,
        "seeds": len(found.seeds),
        "finished": len(found.done),
        "figures": {
            name: None if i is None else {"mean": i.mean, "low": i.low, "high": i.high, "seeds": i.seeds}
            for name, i in found.over_seeds().items()
        },
    }


def _outcome_dict(outcome: Outcome) -> dict[str, Any]:
    claim = outcome.claim
    return {
        "name": claim.name,
        "settings": outcome.settings,
        "place": claim.place,
        "claim": claim.text,
        "rule": claim.rule,
        "measured": outcome.measured,
        "seeds": outcome.seeds,
        "verdict": str(outcome.verdict),
    }
