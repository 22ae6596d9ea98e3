"""Ours and stable-baselines3's TD3 get the same flights and as many updates; the comparison itself is a command."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from mission.reproduce.measures import Interval
from mission.training import compare_sb3
from mission.training.compare_sb3 import GAMMA, Flights, GaussianNoise, overlap, train_ours, train_sb3
from mission.training.until import TrainingConfig

WARMUP, EPISODES = 30, 3


def test_intervals_overlap_where_they_share_a_point() -> None:
    low, high = Interval(0.4, 0.2, 0.6, 5), Interval(0.8, 0.6, 1.0, 5)
    apart = Interval(0.9, 0.7, 1.0, 5)
    assert overlap(low, high)
    assert overlap(high, low)
    assert not overlap(low, apart)
    assert not overlap(apart, low)


def test_exploration_is_even_until_learning_starts_and_small_after() -> None:
    noise = GaussianNoise(10, 1)
    zero = np.zeros(10, np.float32)
    drawn = np.array([noise.explore(zero, {}) for _ in range(400)])
    first, then = np.split(drawn, [compare_sb3.TRAINING.warmup_decisions])
    assert 0.5 < first.std() < 0.65  # even in [-1, 1]: 0.58
    assert 0.09 < then.std() < 0.11
    assert np.abs(drawn).max() <= 1.0


@pytest.mark.slow
def test_flights_are_numbered_whoever_asks() -> None:
    one, other = Flights(3), Flights(3)
    assert np.array_equal(one.reset(seed=5)[0], other.reset()[0])
    assert one.step(np.zeros(10, np.float32))[4]["discount"] == GAMMA
    assert not np.array_equal(one.reset()[0], Flights(3).reset()[0])


@pytest.mark.slow
def test_sb3_and_ours_fly_and_learn_equally_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        compare_sb3, "TRAINING", TrainingConfig(warmup_decisions=WARMUP, updates_per_decision=2, evaluate_every=0)
    )
    for trained in (train_ours(1, EPISODES, 1), train_sb3(1, EPISODES, 1)):
        assert trained.decisions > WARMUP
        assert abs(trained.updates - 2 * (trained.decisions - WARMUP)) <= 2
        assert 0.0 <= trained.success <= 1.0
        assert trained.greedy in (0.0, 1.0)
