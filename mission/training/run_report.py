"""What came of a run?  Its seeds, where the wall time went, and the pictures beside them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mission.flight_log import read_rows
from mission.training.figures import GREEDY, draw_learning, draw_trajectories, read_seeds, spread_episodes
from mission.training.fleet import Member, seed_folder
from mission.training.metrics import rows_file
from mission.training.run_folder import RunSpec
from mission.training.status import Status
from mission.world_file import list_worlds, load_world

LEARNING, TRAJECTORIES = "learning.png", "trajectories.png"


def run_report(spec: RunSpec, folder: Path, members: Sequence[Member]) -> dict[str, Any]:
    """JSON-ready; draws ``learning.png``, and ``trajectories.png`` where all episodes were flown in one world."""
    statuses = [member.status for member in members if member.status is not None]
    if any(read_seeds(folder)):
        title = f"{spec.world}, preset {spec.preset.name}"
        draw_learning(folder, folder / LEARNING, title)
        if spec.world in list_worlds():
            _draw_trajectories(spec, folder)
    return {
        "folder": str(folder),
        "world": spec.world,
        "preset": spec.preset.name,
        "until_successes": spec.until.successes,
        "seeds": [_seed_row(member, folder) for member in members],
        "wall_shares": wall_shares(statuses),
    }


def wall_shares(statuses: Sequence[Status]) -> dict[str, float]:
    """Where the wall time of training went, over all seeds; evaluations are not part of it."""
    wall_s = sum(status.wall_s for status in statuses)
    names = dict.fromkeys(name for status in statuses for name in status.shares)
    return {name: sum(s.shares.get(name, 0.0) * s.wall_s for s in statuses) / max(wall_s, 1e-9) for name in names}


def _seed_row(member: Member, folder: Path) -> dict[str, Any]:
    row: dict[str, Any] = {"seed": member.seed, "state": member.state, "error": member.error}
    if member.status is not None:
        progress = member.status.progress
        row |= {
            "episodes": progress.episodes,
            "successes": progress.successes,
            "decisions": progress.decisions,
            "updates": progress.updates,
            "decisions_per_s": member.status.decisions_per_s,
            "wall_s": member.status.wall_s,
            "steps_15": member.status.steps_15,
            "return_15": member.status.return_15,
        }
    last = [one[GREEDY] for one in read_rows(rows_file(seed_folder(folder, member.seed), "evaluations"))][-1:]
    return row | {f"greedy_{name}": value for figures in last for name, value in figures.items()}


def _draw_trajectories(spec: RunSpec, folder: Path) -> None:
    seed = spec.seeds[0]
    episodes = [int(row["episode"]) for row in read_rows(rows_file(seed_folder(folder, seed), "tracks"))]
    if episodes:
        shown = spread_episodes(episodes[-1])
        draw_trajectories(folder, seed, load_world(spec.world), folder / TRAJECTORIES, shown)
