"""What is tried instead of the actor's action: bounds, decay, how long, and resumption."""

import numpy as np
import pytest

from companion.policy.decoder import ACTION_SIZE
from mission.training.exploration import Exploration, ExplorationConfig

GREEDY = np.full(ACTION_SIZE, 0.25, np.float32)
ENTERED, INSIDE = {"entered": True}, {"entered": False}


def explorer(seed: int = 0, **given: object) -> Exploration:
    return Exploration(ExplorationConfig(**given), ACTION_SIZE, seed)  # type: ignore[arg-type]


def test_epsilon_falls_by_a_factor_an_episode_down_to_its_least() -> None:
    exploring = explorer(decay=0.995)
    seen = []
    for episode in (0, 1, 100, 2000):
        exploring.start_episode(episode)
        seen.append(exploring.epsilon)
    assert seen == pytest.approx([1.0, 0.995, 0.995**100, 0.05])


def test_geometric_offsets_of_each_pair_stay_in_their_disc_and_shrink() -> None:
    exploring = explorer(kind="geometric", radius=0.4, decay=0.9, hold=1)
    for episode in (0, 10):
        exploring.start_episode(episode)
        offsets = np.array([exploring.explore(GREEDY, INSIDE) - GREEDY for _ in range(500)]).reshape(-1, 2)
        sizes = np.hypot(offsets[:, 0], offsets[:, 1])
        bound = 0.4 * 0.9**episode
        assert sizes.max() <= bound + 1e-6
        assert sizes.max() > 0.95 * bound
        assert np.abs(offsets.mean(axis=0)).max() < 0.05 * bound
        assert (sizes < bound / np.sqrt(2.0)).mean() == pytest.approx(0.5, abs=0.04)  # even in area


def test_geometric_offsets_never_leave_the_range_of_actions() -> None:
    exploring = explorer(kind="geometric", radius=1.0)
    actions = np.array([exploring.explore(np.ones(ACTION_SIZE, np.float32), INSIDE) for _ in range(100)])
    assert np.abs(actions).max() <= 1.0


def test_epsilon_greedy_replaces_the_action_so_often() -> None:
    exploring = explorer(decay=0.5, hold=1)
    exploring.start_episode(2)
    drawn = [not np.array_equal(exploring.explore(GREEDY, INSIDE), GREEDY) for _ in range(4000)]
    assert np.mean(drawn) == pytest.approx(0.25, abs=0.03)


def test_drawn_actions_are_even_and_the_first_two_reach_further() -> None:
    exploring = explorer(hold=1, scales=(1.5, 1.5))
    drawn = np.array([exploring.explore(GREEDY, INSIDE) for _ in range(4000)])
    at_bounds = (np.abs(drawn) == 1.0).mean(axis=0)
    assert at_bounds[:2] == pytest.approx([1.0 / 3.0] * 2, abs=0.03)
    assert at_bounds[2:].max() == 0.0
    assert drawn[:, 2:].std() == pytest.approx(1.0 / np.sqrt(3.0), abs=0.02)


def test_a_draw_lasts_for_so_many_decisions_and_ends_on_entering_rl_mode_again() -> None:
    exploring = explorer(hold=4)
    seen = [exploring.explore(GREEDY, INSIDE).tobytes() for _ in range(8)]
    assert len(set(seen[:4])) == len(set(seen[4:])) == 1 and seen[3] != seen[4]
    again = exploring.explore(GREEDY, ENTERED).tobytes()
    assert again != seen[7]
    assert exploring.explore(GREEDY, ENTERED).tobytes() != again


def test_at_entry_only_the_first_decision_is_drawn_as_in_the_paper() -> None:
    exploring = explorer(at_entry_only=True, hold=1)
    assert not np.array_equal(exploring.explore(GREEDY, ENTERED), GREEDY)
    assert all(np.array_equal(exploring.explore(GREEDY, INSIDE), GREEDY) for _ in range(50))


@pytest.mark.parametrize("kind", ["geometric", "epsilon_greedy"])
def test_a_loaded_exploration_goes_on_bit_for_bit(kind: str) -> None:
    one, other = explorer(0, kind=kind), explorer(7, kind=kind)
    one.start_episode(3)
    for _ in range(9):
        one.explore(GREEDY, INSIDE)
    other.load_state_dict(one.state_dict())
    assert [one.explore(GREEDY, INSIDE).tobytes() for _ in range(20)] == [
        other.explore(GREEDY, INSIDE).tobytes() for _ in range(20)
    ]
    assert one.epsilon == other.epsilon


@pytest.mark.parametrize("wrong", [{"kind": "gaussian"}, {"decay": 0.0}, {"epsilon_least": 2.0}, {"hold": 0}])
def test_what_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="exploration"):
        explorer(**wrong)
