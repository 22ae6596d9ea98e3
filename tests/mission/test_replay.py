"""Which transitions are sampled, how often, with what weight; and that the tree keeps its sums."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.types import F64
from mission.training.replay import LAP_LEAST, Batch, Replay, ReplayConfig
from mission.training.sum_tree import SumTree


def filled(kind: str, count: int, capacity: int = 64, config: ReplayConfig | None = None, seed: int = 0) -> Replay:
    """Transition k has reward k."""
    replay = Replay(kind, capacity, 3, 2, config or ReplayConfig(), seed)
    for k in range(count):
        obs = np.full(3, k, np.float32)
        replay.add(obs, np.array([k, -k], np.float32), float(k), obs + 1.0, 0.9, k % 2 == 1)
    return replay


@settings(max_examples=60)
@given(
    st.integers(1, 40),
    st.lists(st.tuples(st.integers(0, 39), st.floats(0.0, 100.0)), min_size=1, max_size=60),
    st.integers(0, 1000),
)
def test_the_tree_finds_what_a_running_sum_finds(capacity: int, changes: list[tuple[int, float]], seed: int) -> None:
    tree, naive = SumTree(capacity), np.zeros(capacity)
    for index, weight in changes:
        tree.set(np.array([index % capacity]), np.array([weight]))
        naive[index % capacity] = weight
    assert tree.total == pytest.approx(naive.sum())
    assert tree.get(np.arange(capacity)).tolist() == naive.tolist()
    if tree.total > 0.0:
        shares = np.random.default_rng(seed).random(50) * tree.total
        found = tree.find(shares)
        assert (naive[found] > 0.0).all()
        ends = naive.cumsum()
        slack = 1e-9 * tree.total
        assert (shares <= ends[found] + slack).all() and (shares >= (ends - naive)[found] - slack).all()


def test_many_weights_at_once_are_as_good_as_one_by_one() -> None:
    rng = np.random.default_rng(1)
    indices, weights = rng.integers(0, 500, 200), rng.random(200)
    together, apart = SumTree(500), SumTree(500)
    together.set(indices, weights)
    for index, weight in zip(indices, weights, strict=True):
        apart.set(np.array([index]), np.array([weight]))
    assert together.total == apart.total
    assert (together.get(np.arange(500)) == apart.get(np.arange(500))).all()


def counts(replay: Replay, size: int, batches: int = 400) -> F64:
    """How often each was sampled, as a share."""
    seen = np.concatenate([replay.sample(128).indices for _ in range(batches)])
    return np.bincount(seen, minlength=size) / len(seen)


def test_per_samples_by_the_power_of_the_error() -> None:
    replay = filled("per", 6)
    errors = np.array([0.1, 0.5, 1.0, 2.0, 4.0, 0.0])
    replay.update_priorities(np.arange(6), errors)
    expected = np.maximum(errors, 1e-6) ** 0.6
    assert counts(replay, 6) == pytest.approx(expected / expected.sum(), abs=0.005)


def test_importance_weights_are_worked_by_hand() -> None:
    replay = filled("per", 2, config=ReplayConfig(alpha=1.0, beta_first=0.5, beta_last=0.5))
    replay.update_priorities(np.array([0, 1]), np.array([1.0, 3.0]))
    batch = replay.sample(16)
    # P = 1/4 and 3/4, N = 2: (2/4)^-.5 and (6/4)^-.5, over the larger: 1 and sqrt(1/3)
    expected = np.where(batch.indices == 0, 1.0, np.sqrt(1.0 / 3.0))
    assert batch.weights == pytest.approx(expected)


def test_beta_rises_to_its_last_value() -> None:
    replay = filled("per", 4, config=ReplayConfig(beta_batches=10))
    seen = []
    for _ in range(12):
        seen.append(replay.beta)
        replay.sample(4)
    assert seen[0] == 0.4 and seen[5] == pytest.approx(0.7) and seen[10:] == [1.0, 1.0]


def test_a_new_sample_comes_with_the_largest_error_of_the_last_update() -> None:
    replay = filled("per", 4, config=ReplayConfig(alpha=1.0))
    replay.update_priorities(np.arange(4), np.array([0.1, 0.2, 0.3, 0.6]))
    replay.add(np.zeros(3, np.float32), np.zeros(2, np.float32), 0.0, np.zeros(3, np.float32), 0.9, False)
    assert counts(replay, 5)[4] == pytest.approx(0.6 / 1.8, abs=0.005)


def test_lap_treats_small_errors_alike_and_weighs_nothing() -> None:
    replay = filled("lap", 4, config=ReplayConfig(alpha=0.4))
    errors = np.array([0.0, 0.5, LAP_LEAST, 8.0])
    replay.update_priorities(np.arange(4), errors)
    expected = np.array([1.0, 1.0, 1.0, 8.0]) ** 0.4
    assert counts(replay, 4) == pytest.approx(expected / expected.sum(), abs=0.005)
    assert (replay.sample(32).weights == 1.0).all()


def test_uniform_samples_evenly_whatever_the_errors() -> None:
    replay = filled("uniform", 5)
    replay.update_priorities(np.arange(5), np.array([0.0, 0.0, 0.0, 0.0, 9.0]))
    assert counts(replay, 5) == pytest.approx(np.full(5, 0.2), abs=0.01)
    assert (replay.sample(32).weights == 1.0).all()


def test_a_batch_holds_rows_as_they_were_added_and_the_oldest_give_way() -> None:
    replay = filled("per", 100, capacity=64)
    assert len(replay) == 64
    batch = replay.sample(256)
    assert batch.reward.min() >= 36.0
    assert (batch.obs[:, 0] == batch.reward).all() and (batch.next_obs[:, 1] == batch.reward + 1.0).all()
    assert (batch.action[:, 1] == -batch.reward).all()
    assert (batch.terminated == batch.reward % 2).all() and (batch.discount == np.float32(0.9)).all()


def same(one: Batch, other: Batch) -> bool:
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in Batch.__slots__)


@pytest.mark.parametrize("kind", ["per", "lap", "uniform"])
def test_a_loaded_replay_goes_on_bit_for_bit(kind: str) -> None:
    one = filled(kind, 90)
    rng = np.random.default_rng(3)
    for _ in range(5):
        one.update_priorities(one.sample(16).indices, rng.random(16))
    other = Replay(kind, 64, 3, 2, ReplayConfig(), seed=99)
    other.load_state_dict(one.state_dict())
    for _ in range(20):
        a, b = one.sample(16), other.sample(16)
        assert same(a, b)
        errors = rng.random(16)
        for replay in (one, other):
            replay.update_priorities(a.indices, errors)
            replay.add(a.obs[0], a.action[0], 1.0, a.obs[1], 0.5, False)
    assert json.dumps(one.state_dict()["generator"]) == json.dumps(other.state_dict()["generator"])


def test_an_unknown_kind_and_a_smaller_memory_are_refused() -> None:
    with pytest.raises(ValueError, match="expected one of per, lap, uniform"):
        Replay("prioritised", 8, 3, 2, ReplayConfig(), 0)
    with pytest.raises(ValueError, match="capacity = 8, but 20"):
        Replay("per", 8, 3, 2, ReplayConfig(), 0).load_state_dict(filled("per", 20).state_dict())
