"""The update worked by hand, the same net in numpy, ONNX and torch, resumption, a toy that is learned, cloning."""

import io
from pathlib import Path

import numpy as np
import pytest
import torch

from companion.policy import store
from companion.policy.actor import Actor, squashed
from companion.policy.decoder import ACTION_SIZE, DecoderParams
from companion.policy.headings import HEADINGS, headings_rad
from companion.policy.learned import PolicySpec
from companion.policy.observations import SIZES, mirror_observation
from companion.policy.store import Card, save_policy
from mission.training import bc, export
from mission.training.adam import Adam
from mission.training.mirror import half_mirrored
from mission.training.networks import TwinCritic, actor_net, as_numpy
from mission.training.replay import Batch, Replay, ReplayConfig
from mission.training.td3 import TD3, TD3Config

OBS, ACTION = 6, 4


def batch(count: int = 32, seed: int = 0, obs: int = OBS, action: int = ACTION) -> Batch:
    rng = np.random.default_rng(seed)
    seen, after = rng.normal(size=(2, count, obs)).astype(np.float32)
    return Batch(
        np.arange(count),
        rng.uniform(0.3, 1.0, count),
        seen,
        rng.uniform(-1.0, 1.0, (count, action)).astype(np.float32),
        rng.normal(size=count).astype(np.float32),
        after,
        rng.uniform(0.5, 1.0, count).astype(np.float32),
        (rng.random(count) < 0.2).astype(np.float32),
    )


def test_the_actor_says_the_same_in_numpy_as_in_torch() -> None:
    net = actor_net(50, ACTION_SIZE, (256, 256), seed=3)
    obs = np.random.default_rng(0).normal(size=(500, 50))
    with torch.no_grad():
        expected = torch.tanh(net(torch.from_numpy(obs.astype(np.float32)))).numpy()
    assert np.abs(squashed(as_numpy(net).forward(obs)) - expected).max() < 1e-6
    one_by_one = np.array([as_numpy(net).forward(row) for row in obs[:20]])
    assert np.abs(np.tanh(one_by_one) - expected[:20]).max() < 1e-6


def test_two_critics_in_one_are_two_critics() -> None:
    critic = TwinCritic(OBS + ACTION, (16, 8), seed=0)
    obs, action = torch.randn(10, OBS), torch.rand(10, ACTION)
    values = critic(obs, action)
    for k in range(2):
        x = torch.cat((obs, action), dim=1)
        for layer in range(3):
            x = x @ critic.weights[layer][k] + critic.biases[layer][k]
            x = torch.relu(x) if layer < 2 else x
        assert torch.allclose(values[k], x[:, 0], atol=1e-6)
    assert torch.allclose(critic.first(obs, action), values[0], atol=1e-6)
    assert not torch.allclose(values[0], values[1])


def test_the_target_is_reward_and_what_the_less_hopeful_critic_expects() -> None:
    """No hidden layer, critics that only have a constant: 3 and 2."""
    learner = TD3(1, 1, TD3Config(hidden=(), reward_scale=0.1, tau=0.0), seed=0)
    state = learner.state_dict()
    for name in ("critic", "critic_target"):
        state[name]["weights.0"].zero_()
        state[name]["biases.0"][:] = torch.tensor([3.0, 2.0]).reshape(2, 1, 1)
    learner.load_state_dict(state)
    column = np.zeros((3, 1), np.float32)
    reward = np.array([10.0, 10.0, -5.0], np.float32)
    discount, terminated = np.array([0.5, 0.5, 0.9], np.float32), np.array([0.0, 1.0, 0.0], np.float32)
    weights = np.array([1.0, 0.5, 0.25])
    figures = learner.update(Batch(np.arange(3), weights, column, column, reward, column, discount, terminated))
    targets = np.array([1.0 + 0.5 * 2.0, 1.0, -0.5 + 0.9 * 2.0])
    assert figures["td_errors"] == pytest.approx(np.abs(3.0 - targets))
    squares = (3.0 - targets) ** 2 + (2.0 - targets) ** 2
    assert figures["critic_loss"] == pytest.approx(float((weights * squares).mean()))
    assert figures["q"] == pytest.approx(2.5)


def test_target_noise_is_clipped_and_so_is_the_action() -> None:
    """A target critic that is the action itself, an actor at its bound: what comes in is within [.5, 1]."""
    learner = TD3(1, 1, TD3Config(hidden=(), smoothing_sigma=5.0, reward_scale=1.0), seed=0)
    state = learner.state_dict()
    state["actor_target"]["0.bias"].fill_(20.0)
    state["critic_target"]["weights.0"][:] = torch.tensor([0.0, 1.0]).reshape(1, 2, 1)
    state["critic_target"]["biases.0"].zero_()
    state["critic"]["weights.0"].zero_()
    state["critic"]["biases.0"].zero_()
    learner.load_state_dict(state)
    n = 4000
    column, ones = np.zeros((n, 1), np.float32), np.ones(n, np.float32)
    figures = learner.update(Batch(np.arange(n), np.ones(n), column, column, 0 * ones, column, ones, 0 * ones))
    targets = figures["td_errors"]
    assert targets.min() == pytest.approx(0.5) and targets.max() == pytest.approx(1.0)


def test_actor_and_targets_move_every_second_update_only() -> None:
    learner = TD3(OBS, ACTION, TD3Config(hidden=(16,), tau=0.1), seed=0)
    before = learner.state_dict()
    learner.update(batch())
    after = learner.state_dict()
    for name in ("actor", "actor_target", "critic_target"):
        assert all(torch.equal(before[name][key], after[name][key]) for key in before[name])
    figures = learner.update(batch(seed=1))
    moved = learner.state_dict()
    assert "saturated" in figures
    assert not torch.equal(moved["actor"]["2.bias"], before["actor"]["2.bias"])
    expected = 0.9 * before["critic_target"]["weights.0"] + 0.1 * moved["critic"]["weights.0"]
    assert torch.allclose(moved["critic_target"]["weights.0"], expected, atol=1e-7)


def test_the_actor_waits_while_only_the_critics_learn() -> None:
    learner = TD3(OBS, ACTION, TD3Config(hidden=(16,), actor_after=10, zero_last=False), seed=0)
    first = learner.actor()
    for k in range(10):
        learner.update(batch(seed=k))
    assert (learner.actor().weights[0] == first.weights[0]).all()
    for k in range(2):
        learner.update(batch(seed=k))
    assert not (learner.actor().weights[0] == first.weights[0]).all()


def test_what_flies_follows_what_learns_slowly_and_no_other_weight_knows() -> None:
    plain, averaged = (TD3(OBS, ACTION, TD3Config(hidden=(16,), average=share), seed=0) for share in (0.0, 0.25))
    expected = plain.actor().biases[-1]
    for k in range(6):
        for learner in (plain, averaged):
            learner.update(batch(seed=k))
        if k % 2 == 1:
            expected = 0.75 * expected + 0.25 * plain.actor().biases[-1]
    assert averaged.actor().biases[-1] == pytest.approx(expected, abs=1e-7)
    assert not np.allclose(plain.actor().biases[-1], expected)
    obs = np.ones(OBS, np.float32)
    assert (averaged.act(obs) == plain.act(obs)).all()


def test_rates_fall_evenly_to_a_tenth_and_stay_there() -> None:
    config = TD3Config(hidden=(8,), actor_every=1, actor_rate=1e-3, critic_rate=2e-3, rates_fall_over=4)
    learner = TD3(OBS, ACTION, config, seed=0)
    rates = []
    for k in range(7):
        learner.update(batch(seed=k))
        state = learner.state_dict()
        rates.append([state[f"{name}_optimiser"]["param_groups"][0]["lr"] for name in ("critic", "actor")])
    shares = np.array([1.0, 0.775, 0.55, 0.325, 0.1, 0.1, 0.1, 0.1])
    assert np.array(rates)[:, 0] == pytest.approx(2e-3 * shares[:-1])
    assert np.array(rates)[:, 1] == pytest.approx(1e-3 * shares[1:])


def test_a_step_is_that_of_torch() -> None:
    ours, theirs = (actor_net(OBS, ACTION, (16,), seed=1) for _ in range(2))
    adam, known = Adam(ours), torch.optim.Adam(theirs.parameters())
    for k in range(20):
        obs = torch.from_numpy(batch(seed=k).obs)
        adam.step(ours(obs).square().mean(), rate=1e-3)
        known.zero_grad()
        theirs(obs).square().mean().backward()
        known.step()
    assert all(torch.allclose(a, b, atol=1e-6) for a, b in zip(ours.parameters(), theirs.parameters(), strict=True))


def test_an_untrained_actor_says_zero() -> None:
    assert (TD3(OBS, ACTION, TD3Config(), 0).act(np.ones(OBS, np.float32)) == 0.0).all()


def test_the_penalty_pulls_the_action_from_its_bounds() -> None:
    shares = {}
    for penalty in (0.0, 0.3):
        learner = TD3(OBS, ACTION, TD3Config(hidden=(32,), saturation_penalty=penalty, actor_rate=1e-2), seed=0)
        full = batch(128)
        uphill = Batch(*(getattr(full, name) for name in Batch.__slots__[:4]), full.action.sum(axis=1) * 100.0,
                       full.next_obs, 0.0 * full.discount, full.terminated)  # fmt: skip
        for _ in range(300):
            figures = learner.update(uphill)
        shares[penalty] = figures["saturated"]
    assert shares[0.0] > 0.9 > 0.1 > shares[0.3]


def bytes_of(learner: TD3) -> bytes:
    file = io.BytesIO()
    torch.save(learner.state_dict(), file)
    return file.getvalue()


@pytest.mark.parametrize("kind", ["per", "uniform"])
def test_training_goes_on_bit_for_bit_from_the_middle(kind: str, tmp_path: Path) -> None:
    config = TD3Config(hidden=(32, 32), huber=True, rates_fall_over=80, average=0.05)

    def started(seed: int) -> tuple[TD3, Replay]:
        replay = Replay(kind, 256, OBS, ACTION, ReplayConfig(), seed)
        rows = batch(200, seed=4)
        for k in range(200):
            replay.add(rows.obs[k], rows.action[k], float(rows.reward[k]), rows.next_obs[k], 0.9, k % 7 == 0)
        return TD3(OBS, ACTION, config, seed), replay

    def train(learner: TD3, replay: Replay, updates: int) -> None:
        for _ in range(updates):
            sampled = replay.sample(32)
            replay.update_priorities(sampled.indices, learner.update(sampled)["td_errors"])

    whole, memory = started(0)
    train(whole, memory, 50)
    torch.save(whole.state_dict(), tmp_path / "learner.pt")
    kept = memory.state_dict()
    train(whole, memory, 50)
    resumed, other = started(1)
    resumed.load_state_dict(torch.load(tmp_path / "learner.pt", weights_only=True))
    other.load_state_dict(kept)
    train(resumed, other, 50)
    assert bytes_of(resumed) == bytes_of(whole)
    assert (resumed.actor().weights[0] == whole.actor().weights[0]).all()


def test_td3_learns_where_to_point() -> None:
    """A bandit: the best action is a function of the observation; and what follows counts through the discount."""
    rng = np.random.default_rng(0)
    learner = TD3(
        2,
        2,
        TD3Config(hidden=(32, 32), reward_scale=1.0, saturation_penalty=0.0, critic_rate=2e-3, actor_rate=1e-3),
        seed=0,
    )
    replay = Replay("per", 4096, 2, 2, ReplayConfig(), 0)

    def best(obs: np.ndarray) -> np.ndarray:
        return 0.6 * np.tanh(obs[..., ::-1] * np.array([1.0, -1.0]))

    for k in range(1400):
        obs = rng.normal(size=2).astype(np.float32)
        noise = rng.normal(size=2) * 0.4
        action = np.clip(learner.act(obs) + noise, -1.0, 1.0).astype(np.float32)
        reward = -float(np.square(action - best(obs)).sum())
        replay.add(obs, action, reward, rng.normal(size=2).astype(np.float32), 0.5, False)
        if k >= 100:
            sampled = replay.sample(64)
            replay.update_priorities(sampled.indices, learner.update(sampled)["td_errors"])
    judged = rng.normal(size=(300, 2)).astype(np.float32)
    missed = np.array([learner.act(obs) - best(obs) for obs in judged])
    assert np.sqrt(np.square(missed).sum(axis=1)).mean() < 0.15


def test_a_mirrored_batch_is_half_as_it_was() -> None:
    size = SIZES["goal"]
    rows = batch(9, obs=size, action=ACTION_SIZE)
    image = half_mirrored(rows, "goal", "waypoints")
    assert (image.obs[::2] == rows.obs[::2]).all() and (image.action[::2] == rows.action[::2]).all()
    assert image.obs[1] == pytest.approx(mirror_observation("goal", rows.obs[1].astype(np.float64)), abs=1e-6)
    assert (image.action[1] == rows.action[1] * np.tile([1.0, -1.0], 5)).all()
    again = half_mirrored(image, "goal", "waypoints")
    assert again.next_obs == pytest.approx(rows.next_obs)
    assert (again.reward == rows.reward).all()


@pytest.mark.parametrize(("head", "outputs"), [("continuous", ACTION_SIZE), ("headings", HEADINGS)])
def test_onnx_says_what_the_policy_says(head: str, outputs: int, tmp_path: Path) -> None:
    net = actor_net(SIZES["map"], outputs, (32, 16), seed=0)
    save_policy(tmp_path / "p", as_numpy(net), Card("p", PolicySpec("map", head)))
    assert export.export_onnx(tmp_path / "p", tmp_path / "p.onnx") < export.PARITY
    assert (tmp_path / "p.onnx").stat().st_size > 4 * 50 * 32


def test_a_graph_of_other_weights_is_noticed() -> None:
    one, other = (as_numpy(actor_net(4, 2, (8,), seed)) for seed in (0, 1))
    assert export.parity(one, export.graph(one, True, "one")) < export.PARITY
    assert export.parity(one, export.graph(other, True, "other")) > 0.01


def taught(count: int = 600) -> tuple[np.ndarray, np.ndarray]:
    """A teacher that goes round on the freer side: observations of ``map``, headings."""
    rng = np.random.default_rng(0)
    obs = np.zeros((count, SIZES["map"]), np.float32)
    obs[:, :36] = rng.random((count, 36))
    return obs, np.where(obs[:, 4] > obs[:, 32], 0.7, -0.7)


def test_a_ranking_is_cloned_and_knows_left_from_right() -> None:
    obs, headings = taught()
    data = bc.Dataset(obs, bc.spread(headings, DecoderParams()))
    config = bc.CloneConfig(hidden=(32,), steps=300, batch=64)
    got = bc.clone(data, config, seed=0)
    assert got.agreement > 0.8
    again = bc.clone(data, config, seed=0)
    assert all((a == b).all() for a, b in zip(got.actor.weights, again.actor.weights, strict=True))


def test_actions_are_cloned_as_far_as_the_decoder_reads_them() -> None:
    obs, _ = taught()
    labels = np.zeros((len(obs), ACTION_SIZE), np.float32)
    labels[:, 0] = 0.5 * (obs[:, 4] - obs[:, 32])
    labels[:, 5] = 9.0  # a detour has three numbers
    config = bc.CloneConfig(head="continuous", hidden=(32,), steps=300, batch=64)
    got = bc.clone(bc.Dataset(obs, labels), config, seed=0)
    assert got.held_out_loss < 0.01 and got.agreement > 0.8


def test_labels_that_do_not_fit_the_head_are_refused() -> None:
    obs, _ = taught(10)
    with pytest.raises(ValueError, match="for head 'headings'"):
        bc.clone(bc.Dataset(obs, np.zeros((10, ACTION_SIZE), np.float32)), bc.CloneConfig(), seed=0)


def test_chances_peak_at_the_teachers_heading_and_at_the_least_cost() -> None:
    ways = headings_rad(DecoderParams())
    chances = bc.spread(np.array([0.0, ways[30]]), DecoderParams())
    assert chances.argmax(axis=1).tolist() == [20, 30]
    assert chances.sum(axis=1) == pytest.approx([1.0, 1.0])
    cost = np.full((1, HEADINGS), np.inf)
    cost[0, [3, 30]] = 5.0, 5.5
    assert bc.by_cost(cost, temperature=0.5)[0, [3, 30]] == pytest.approx(np.array([np.e, 1.0]) / (1.0 + np.e))


def test_a_trained_actor_can_be_shipped(tmp_path: Path) -> None:
    learner = TD3(SIZES["goal"], ACTION_SIZE, TD3Config(hidden=(16,)), seed=0)
    save_policy(tmp_path / "t", learner.actor(), Card("t", PolicySpec("goal"), {"seed": 0}))
    card, loaded = store.read_policy(tmp_path / "t")
    assert card.training == {"seed": 0}
    assert isinstance(loaded, Actor) and (loaded.forward(np.ones(72)) == 0.0).all()
