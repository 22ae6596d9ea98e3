"""Made-up arms: rows as a training would have left them, and figures as the paper tells its story."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from mission.reproduce.arms import Table
from mission.reproduce.greedy import GREEDY
from mission.reproduce.measures import Figures
from mission.reproduce.run import arm_folder, prepare
from mission.training.fleet import seed_folder
from mission.training.trainer import RESULT

GOAL_NE_M = (54.0, 0.0)
TINY = """
until: {successes: 9, episodes: 3}
flights: 1
arms:
  t1:
    group: paper
    text: SWIFT-Nav
    world: trajectory1
    settings: &tiny
      env.time_limit_s: 6.0
      td3.hidden: [8, 8]
      training.batch: 4
      training.warmup_decisions: 2
      training.checkpoint_every: 1
      training.evaluate_every: 0
  vanilla:
    group: paper
    text: vanilla
    world: trajectory1
    settings:
      <<: *tiny
      env.low_level: true
    ticks_of: t1
"""


def write_arm(out: Path, table: Table, name: str, seeds: int, episodes: int, good: float = 1.0) -> None:
    """An arm that was trained: steps fall and return rises by ``good`` of what the paper shows."""
    arm = table.arm(name)
    prepare(out, [arm], range(1, seeds + 1))
    for seed in range(1, seeds + 1):
        folder = seed_folder(arm_folder(out, arm), seed)
        folder.mkdir(parents=True, exist_ok=True)
        rng = np.random.default_rng([seed, *name.encode()])
        rows = [_row(rng, k, good * min(1.0, k / 80)) for k in range(1, episodes + 1)]
        tracks = [{"episode": row["episode"], "track_ne_m": row.pop("track_ne_m")} for row in rows]
        _write_rows(folder / "episodes.jsonl", rows)
        _write_rows(folder / "tracks.jsonl", tracks)
        _write_rows(folder / "evaluations.jsonl", [_evaluation(k, good * min(1.0, k / 80)) for k in (0, 50, 100)])
        finish(folder, seed, rows, [_row(rng, 1, good) | {"gained_m": 54.0, "turning_deg_per_m": 3.0}])


def finish(folder: Path, seed: int, rows: list[dict[str, Any]], flights: list[dict[str, Any]]) -> None:
    """What a seed leaves behind once it is done."""
    folder.mkdir(parents=True, exist_ok=True)
    ticks = sum(row["ticks"] for row in rows)
    result = {"seed": seed, "ticks": ticks, "seconds": {"physics": 2.0, "evaluation": 1.0}}
    (folder / RESULT).write_text(json.dumps(result))
    stamp = {"date": "2026-11-22", "commit": "abc", "machine": "a desk"}
    (folder / GREEDY).write_text(json.dumps({**stamp, "decision_p99_ms": 3.0, "flights": flights}))


def _row(rng: np.random.Generator, episode: int, skill: float) -> dict[str, Any]:
    success = bool(rng.random() < 0.2 + 0.78 * skill)
    aside = 8.0 * (1.0 - skill) * rng.normal()
    end = GOAL_NE_M[0] if success else rng.uniform(18.0, 40.0)
    along = np.linspace(0.0, 1.0, 12)
    track = np.stack([end * along, aside * np.sin(np.pi * along)], axis=1)
    steps = round(700 - 450 * skill + rng.normal() * (90 - 60 * skill))
    return {
        "episode": episode,
        "success": success,
        "contact": False,
        "steps": steps,
        "ticks": 2 * steps,
        "time_s": steps / 10,
        "path_m": float(np.sum(np.hypot(*np.diff(track, axis=0).T))) * (2.0 - skill),
        "path_ratio": 1.8 - 0.7 * skill if success else None,
        "return": -2000.0 + 6000.0 * skill + rng.normal() * (700 - 500 * skill),
        "switches": int(rng.integers(2, 7)),
        "switches_bound": 30,
        "hasty_switches": 0,
        "rl_time_s": steps / 20,
        "track_ne_m": track.tolist(),
    }


def _evaluation(episode: int, skill: float) -> dict[str, Any]:
    row: dict[str, Any] = {"episode": episode, "greedy": {"success": skill, "path_ratio": 1.8 - 0.7 * skill}}
    if episode == 0:
        row |= {"straight": {"success": 0.0, "path_ratio": None}, "random": {"success": 0.2, "path_ratio": 2.0}}
    return row


def _write_rows(path: Path, rows: list[dict[str, Any]]) -> None:
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def curve(name: str, first: float, last: float, sd: tuple[float, float], wobble: float) -> Figures:
    """The figures of one curve."""
    return {
        f"{name}_first": first,
        f"{name}_last": last,
        f"{name}_sd_first": sd[0],
        f"{name}_sd_last": sd[1],
        f"{name}_highest": max(first, last),
        f"{name}_tail_width": 0.1,
        f"{name}_wobble": wobble,
        f"{name}_wobble_mid": wobble,
        f"{name}_wobble_late": wobble / 2,
    }


SWIFT: Figures = {
    "episodes": 110.0,
    "successes": 100.0,
    "reached": 1.0,
    "ticks": 6e4,
    "successes_first100": 92.0,
    "success_last50": 0.98,
    "contact": 0.0,
    "switches": 4.0,
    "above_bound": 0.0,
    "hasty": 0.0,
    "rl_share": 0.3,
    "path_ratio_last50": 1.1,
    **curve("steps", 500.0, 300.0, (60.0, 20.0), 10.0),
    **curve("return", -5000.0, 5000.0, (900.0, 200.0), 300.0),
    "detour_first": 2.0,
    "detour_last": 1.1,
    "greedy_success": 1.0,
    "greedy_contact": 0.0,
    "greedy_path_ratio": 1.08,
    "greedy_time_s": 22.0,
    "greedy_switches": 4.0,
    "greedy_hasty": 0.0,
    "greedy_detour": 1.1,
    "greedy_turning": 4.0,
    "decision_p99_ms": 3.0,
    "wall_s": 60.0,
}
VANILLA = SWIFT | {"successes": 2.0, "reached": 0.0, "success_last50": 0.04, "greedy_success": 0.0}
VANILLA |= {"greedy_path_ratio": None, "greedy_detour": 5.0, "greedy_turning": 60.0}
NO_STABILITY = (
    SWIFT | curve("steps", 400.0, 450.0, (60.0, 90.0), 40.0) | curve("return", 0.0, -900.0, (9.0, 9.0), 900.0)
)
NO_STABILITY |= {"switches": 20.0, "above_bound": 7.0, "success_last50": 0.5, "episodes": 250.0}
NO_CHECKER = SWIFT | curve("steps", 600.0, 590.0, (60.0, 60.0), 10.0) | curve("return", 0.0, 90.0, (9.0, 9.0), 90.0)
NO_CHECKER |= {"path_ratio_last50": 1.6, "episodes": 300.0, "success_last50": 0.4}

AS_TOLD: dict[str, list[Figures]] = {  # by the paper
    "t1": [SWIFT] * 5,
    "t1_paper": [SWIFT] * 5,
    "t2": [SWIFT | {"rl_share": 0.7}] * 5,
    "t2_paper": [SWIFT | {"rl_share": 0.7}] * 5,
    "vanilla": [VANILLA] * 5,
    "vanilla_paper": [VANILLA] * 5,
    "no_stability": [NO_STABILITY] * 5,
    "no_checker": [NO_CHECKER] * 5,
    "replay_per": [SWIFT] * 5,
    "replay_uniform": [SWIFT | {"successes_first100": 70.0}] * 5,
    "world_forest": [SWIFT] * 5,
    "vanilla_forest": [VANILLA] * 5,
}
BACKWARDS = SWIFT | curve("steps", 300.0, 950.0, (20.0, 60.0), 10.0) | curve("return", 9.0, 5.0, (2.0, 9.0), 9.0)
BACKWARDS |= {"reached": 0.0, "detour_first": 1.1, "detour_last": 2.0, "greedy_path_ratio": 1.5, "greedy_switches": 9.0}
BACKWARDS |= {"steps_tail_width": 0.9, "return_wobble_late": 30.0, "decision_p99_ms": 90.0, "rl_share": 0.9}
WELL = SWIFT | {"contact": 0.4}  # without what the paper calls essential
OTHERWISE: dict[str, list[Figures]] = {  # nothing as the paper tells it
    **dict.fromkeys(("t1", "t1_paper", "t2", "t2_paper"), [BACKWARDS] * 5),
    **dict.fromkeys(("vanilla", "vanilla_paper", "vanilla_forest"), [SWIFT] * 5),
    **dict.fromkeys(("no_stability", "no_checker"), [WELL] * 5),
    **dict.fromkeys(("replay_per", "replay_uniform", "world_forest"), [SWIFT] * 5),
}
