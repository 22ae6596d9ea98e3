"""The pictures of a training show what the rows say."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.training.figures import (
    draw_learning,
    draw_trajectories,
    learning_curve,
    moving_average,
    spread_episodes,
)
from mission.world_file import load_world

PNG = b"\x89PNG"


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), st.integers(1, 20))
def test_a_moving_average_is_the_mean_of_the_last_values(values: list[float], window: int) -> None:
    means = moving_average(np.array(values), window)
    expected = [np.mean(values[max(0, k + 1 - window) : k + 1]) for k in range(len(values))]
    assert means == pytest.approx(expected, abs=1e-6)


def test_a_band_is_over_the_seeds_that_got_that_far() -> None:
    seeds = [[{"steps": 10.0}, {"steps": 20.0}], [{"steps": 30.0}]]
    curve = learning_curve(seeds, "steps", window=1)
    assert curve.episode.tolist() == [1.0, 2.0]
    assert curve.mean.tolist() == [20.0, 20.0]
    assert curve.low.tolist() == [10.0, 20.0]
    assert curve.high.tolist() == [30.0, 20.0]


def test_episodes_are_spread_from_first_to_last() -> None:
    assert spread_episodes(100) == [1, 34, 67, 100]
    assert spread_episodes(2) == [1, 2]
    assert spread_episodes(0) == []


def test_pictures_are_drawn(tmp_path: Path) -> None:
    for seed in (1, 2):
        folder = tmp_path / f"seed_{seed}"
        _write(folder / "episodes.jsonl", [{"steps": 80 - k, "return": 10.0 * k + seed} for k in range(20)])
        greedy = [{"episode": k, "greedy": {"success": k / 20}} for k in (0, 10, 20)]
        greedy[0] |= {"straight": {"success": 0.2}, "random": {"success": 0.1}}
        _write(folder / "evaluations.jsonl", greedy)
        _write(folder / "tracks.jsonl", [{"episode": k, "track_ne_m": [[0.0, 0.0], [30.0, k]]} for k in (1, 2, 3)])
    draw_learning(tmp_path, tmp_path / "learning.png", "trajectory1")
    draw_trajectories(tmp_path, 1, load_world("trajectory1"), tmp_path / "tracks.png", [1, 3, 9])
    for name in ("learning.png", "tracks.png"):
        assert (tmp_path / name).read_bytes().startswith(PNG)


def test_a_run_that_has_hardly_begun_can_be_drawn(tmp_path: Path) -> None:
    _write(tmp_path / "seed_1" / "episodes.jsonl", [])
    _write(tmp_path / "seed_1" / "evaluations.jsonl", [])
    draw_learning(tmp_path, tmp_path / "learning.png", "trajectory1")
    assert (tmp_path / "learning.png").read_bytes().startswith(PNG)
