"""Which pictures does the document show?  Each drawn where its arms were begun, with the words below it."""

from dataclasses import dataclass
from pathlib import Path

from mission.reproduce.findings import ArmFindings, Findings
from mission.reproduce.plots import (
    SWIFT_COLOUR,
    VANILLA_COLOUR,
    draw_ablations,
    draw_arms,
    draw_baseline,
    draw_compared,
    draw_curves,
    draw_episodes,
)
from mission.world_file import load_world

FIGURES = "figures"
CURVES_TEXT = (
    "15-episode moving averages of episode length (steps of 0.1 s) and return: mean and 95 % interval over seeds, thin "
    "lines the seeds"
)


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG file and what is said of it."""

    path: Path
    title: str
    text: str


def draw_all(found: Findings, out: Path) -> list[Picture]:
    """Into ``OUT/figures``; what there is nothing for is left out."""
    (out / FIGURES).mkdir(parents=True, exist_ok=True)
    made = (_compared, _episodes, _curves, _curves_paper, _baseline, _ablations, _beyond)
    return [picture for draw in made if (picture := draw(found, out)) is not None]


def file_of(out: Path, name: str) -> Path:
    """Where a picture lies."""
    return out / FIGURES / f"{name}.png"


def _begun(found: Findings, *names: str) -> list[ArmFindings]:
    """These arms, as far as anything was flown in them."""
    arms = [found.arms[name] for name in names if name in found.arms]
    return [arm for arm in arms if any(seed.episodes for seed in arm.seeds)]


def _compared(found: Findings, out: Path) -> Picture | None:
    arms = [arm for arm in _begun(found, "vanilla", "t1") if arm.done]
    if len(arms) < 2:
        return None
    vanilla, swift = arms
    path = file_of(out, "baseline_trajectories")
    panels = [("vanilla TD3", vanilla.done, VANILLA_COLOUR), ("SWIFT-Nav", swift.done, SWIFT_COLOUR)]
    draw_compared(load_world("trajectory1"), panels, path)
    text = "Greedy flights after training with the same ticks, all seeds; a green end is the goal (Fig. traj1_compare)."
    return Picture(path, "Trajectory 1: baseline against SWIFT-Nav", text)


def _episodes(found: Findings, out: Path) -> Picture | None:
    arms = _begun(found, "t2", "t2_paper")
    if not arms:
        return None
    path = file_of(out, "episodes_t2")
    panels = [(f"{_settings(arm)}, seed {arm.seeds[0].seed}", arm.seeds[0]) for arm in arms]
    draw_episodes(load_world("trajectory2"), panels, path)
    return Picture(
        path, "Trajectory 2: trajectories over episodes", "From the first to the last (Fig. complex_together)."
    )


def _curves(found: Findings, out: Path) -> Picture | None:
    return _curves_of(found, out, ("t1", "t2"), "curves", "Steps and return")


def _curves_paper(found: Findings, out: Path) -> Picture | None:
    return _curves_of(found, out, ("t1_paper", "t2_paper"), "curves_paper", "Steps and return, settings as printed")


def _curves_of(found: Findings, out: Path, names: tuple[str, str], name: str, title: str) -> Picture | None:
    arms = _begun(found, *names)
    if not arms:
        return None
    draw_curves([(f"{arm.arm.text} ({_seeds(arm)})", arm.seeds) for arm in arms], file_of(out, name))
    return Picture(
        file_of(out, name),
        title,
        f"{CURVES_TEXT} (Fig. perf_both). Right, greedy flights at checkpoints, a line a seed.",
    )


def _baseline(found: Findings, out: Path) -> Picture | None:
    arms = _begun(found, "t1", "vanilla")
    if len(arms) < 2:
        return None
    path = file_of(out, "baseline_learning")
    draw_baseline(arms[0].seeds, arms[1].seeds, path)
    text = "Trajectory 1, a line a seed; each seed of the baseline ends with the ticks that SWIFT-Nav used."
    return Picture(path, "Baseline against SWIFT-Nav under equal ticks", text)


def _ablations(found: Findings, out: Path) -> Picture | None:
    arms = _begun(found, "t2", "no_stability", "no_checker")
    if len(arms) < 2:
        return None
    path = file_of(out, "ablations")
    titles = {"t2": "both on", "no_stability": "No-Stability", "no_checker": "No-Checker"}
    draw_ablations([(f"{titles[arm.arm.name]} ({_seeds(arm)})", arm.seeds) for arm in arms], path)
    return Picture(path, "Ablations on Trajectory 2", f"{CURVES_TEXT}; switches of nav modes below (Fig. ablation).")


def _beyond(found: Findings, out: Path) -> Picture | None:
    beyond = [arm for arm in found.arms.values() if arm.figures and arm.arm.group != "paper"]
    if all(arm.arm.run != arm.arm.name for arm in beyond):  # nothing but other names of what is shown above
        return None
    names = {"t2", *(arm.arm.name for arm in beyond)}
    shown = [name for name in found.arms if name in names and found.arms[name].figures]
    path = file_of(out, "beyond")
    draw_arms({name: found.arms[name].over_seeds() for name in shown}, path)
    return Picture(path, "What the paper left for later", "Mean and 95 % interval over seeds; t2 is the reference.")


def _settings(arm: ArmFindings) -> str:
    return "settings as printed" if arm.arm.preset.name == "paper" else arm.arm.preset.name


def _seeds(arm: ArmFindings) -> str:
    count = sum(bool(seed.episodes) for seed in arm.seeds)
    return f"{count} seed{'' if count == 1 else 's'}"
