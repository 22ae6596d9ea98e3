"""Are the environments what Gymnasium, the paper and a repeatable experiment ask of them? On the full vehicle."""

import math
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from companion.core.frames import yaw_rad
from companion.navigator.params import Params
from mission.errors import InputError
from mission.training.env import SwiftNavEnv
from mission.training.env_config import EnvConfig, navigator_params
from mission.training.low_level import SwiftNavLowLevelEnv
from sitl.world import World

IDS = ("SwiftNav-v0", "SwiftNavLowLevel-v0")
ZERO = np.zeros(10, np.float32)
FEW = 12  # decisions of the quick check of repeatability


def lane(*trees: tuple[float, float], goal_m: float = 14.0, radius_m: float = 0.4) -> World:
    """A short way north with some trees."""
    return World(
        name="lane",
        start_ned_m=np.zeros(2),
        goal_ned_m=np.array([goal_m, 0.0]),
        bounds_m=(-5.0, -8.0, goal_m + 5.0, 8.0),
        circles=np.array([(n, e, radius_m, math.inf) for n, e in trees]).reshape(-1, 4),
        boxes=np.empty((0, 6)),
    )


CALM = EnvConfig(wind_m_s=(0.0, 0.0), turbulence="none", spawn_jitter_m=0.0)
WAY = lane((6.0, 1.2), (6.5, -1.4), (9.0, 0.1))


def flown(env: gymnasium.Env[Any, Any], action: np.ndarray, seed: int = 0) -> tuple[list[float], dict[str, Any]]:
    """Rewards and the last info of one flight with always the same action."""
    _, info = env.reset(seed=seed)
    rewards = []
    while "episode" not in info:
        _, reward, terminated, truncated, info = env.step(action)
        rewards.append(float(reward))
        assert ("episode" in info) is (terminated or truncated)
        info["terminated"], info["truncated"] = terminated, truncated
    return rewards, info


def signature(env: gymnasium.Env[Any, Any], decisions: int, seed: int) -> list[Any]:
    """Everything that an agent is told, over some flights with random actions."""
    rng = np.random.default_rng(seed)
    out: list[Any] = []
    obs, info = env.reset(seed=seed)
    for _ in range(decisions):
        out.append((obs.tobytes(), info))
        obs, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, env.action_space.shape).astype("f4"))
        out.append((float(reward), terminated, truncated))
        if terminated or truncated:
            obs, info = env.reset()
    return out


def nose_rad(env: SwiftNavLowLevelEnv) -> float:
    return yaw_rad(env.flight.sim.truth.q_ned_frd)


def bearing_rad(north_m: float, east_m: float) -> float:
    return math.atan2(east_m, north_m)


def in_parallel(name: str, world: str | World, decisions: int) -> None:
    """Two copies side by side, each step of one between two of the other."""
    envs = [gymnasium.make(f"mission.training:{name}", world=world).unwrapped for _ in range(2)]
    rngs = [np.random.default_rng(7) for _ in envs]
    seen = [env.reset(seed=11) for env in envs]
    for _ in range(decisions):
        moves = [
            env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
            for env, rng in zip(envs, rngs, strict=True)
        ]
        (obs, *first), (other, *second) = moves
        assert np.array_equal(obs, other)
        assert repr(first) == repr(second)
        if first[1] or first[2]:
            seen = [env.reset() for env in envs]
            assert np.array_equal(seen[0][0], seen[1][0])
            assert repr(seen[0][1]) == repr(seen[1][1])


@pytest.mark.filterwarnings("ignore:.*Box observation space.*infinity.*")
@pytest.mark.parametrize("name", IDS)
def test_gymnasium_finds_nothing_to_complain_about(name: str) -> None:
    check_env(gymnasium.make(f"mission.training:{name}", world=WAY).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", IDS)
def test_two_copies_flown_side_by_side_stay_equal(name: str) -> None:
    in_parallel(name, WAY, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("name", IDS)
def test_two_copies_flown_side_by_side_stay_equal_for_a_thousand_decisions(name: str) -> None:
    in_parallel(name, "trajectory2", 1000)


def test_another_seed_is_another_flight() -> None:
    env = SwiftNavEnv(WAY)
    assert signature(env, 3, seed=1) == signature(env, 3, seed=1)
    assert signature(env, 3, seed=1) != signature(env, 3, seed=2)


def test_straight_through_a_few_trees_ends_in_landing_mode_above_the_goal() -> None:
    _, info = flown(SwiftNavEnv(WAY, CALM), ZERO)
    episode = info["episode"]
    assert episode["end"] == "goal"
    assert episode["success"] and info["terminated"] and not info["truncated"]
    assert not episode["contact"] and not episode["timeout"] and not episode["out_of_bounds"]
    assert math.dist(episode["track_ne_m"][-1], (14.0, 0.0)) < 0.5
    assert episode["steps"] == round(10 * episode["time_s"])
    assert episode["ticks"] == round(25 * episode["time_s"])
    assert 1.0 <= episode["path_ratio"] < 1.2
    assert 0.05 < episode["min_clearance_m"] < 1.2
    assert episode["decisions"] == sum(episode[k] for k in ("kept", "next", "modified", "escaped", "refused"))
    assert 0.0 < episode["rl_time_s"] < episode["time_s"]
    assert 2 <= episode["switches"] <= episode["switches_bound"]
    assert episode["hasty_switches"] == 0
    assert episode["return"] == pytest.approx(sum(episode["rows"].values()))


def test_every_tick_after_the_first_decision_is_paid_for_and_discounted() -> None:
    """Reward of the plain table, no discount: a hundredth each tenth of a second, and five at the goal."""
    env = SwiftNavEnv(WAY, replace(CALM, reward="plain", discount_per_s=1.0))
    rewards, info = flown(env, ZERO)
    first = SwiftNavEnv(WAY, replace(CALM, reward="plain", discount_per_s=1.0))
    first.reset(seed=0)
    before_s = first.flight.time_s
    assert sum(rewards) == pytest.approx(5.0 - 0.1 * (info["episode"]["time_s"] - before_s), abs=1e-6)


def test_the_discount_says_how_long_the_decision_lasted() -> None:
    env = SwiftNavEnv(WAY, replace(CALM, discount_per_s=0.9))
    env.reset(seed=0)
    before_s = env.flight.time_s
    _, _, _, _, info = env.step(ZERO)
    lasted_s = env.flight.time_s - before_s
    assert info["ticks"] == round(25 * lasted_s)
    assert info["discount"] == pytest.approx(0.9**lasted_s)


def test_the_time_limit_truncates() -> None:
    _, info = flown(SwiftNavEnv(WAY, replace(CALM, time_limit_s=4.0)), ZERO)
    assert info["truncated"] and not info["terminated"]
    assert info["episode"]["timeout"]
    assert info["episode"]["time_s"] == pytest.approx(4.0, abs=0.05)
    assert info["episode"]["path_ratio"] is None


def test_a_flight_may_be_asked_to_go_on_until_it_stands() -> None:
    _, info = flown(SwiftNavEnv(WAY, replace(CALM, until="landed")), ZERO)
    assert info["episode"]["success"]
    _, above = flown(SwiftNavEnv(WAY, CALM), ZERO)
    assert info["episode"]["time_s"] > above["episode"]["time_s"] + 2.0


def test_flights_in_which_rl_never_comes_up_are_passed_over_and_told_of() -> None:
    env = SwiftNavEnv([lane(), WAY], CALM)
    passed_over = 0
    for seed in range(4):
        _, info = env.reset(seed=seed)
        assert len(info["skipped"]) == info["flights_without_decision"]
        assert all(flight["success"] and flight["decisions"] == 0 for flight in info["skipped"])
        passed_over += info["flights_without_decision"]
    assert passed_over > 0


def test_a_world_may_be_chosen_at_reset() -> None:
    env = SwiftNavEnv("trajectory2", CALM)
    env.reset(seed=0, options={"world": WAY})
    assert env.flight.spec.plan.world.name == "lane"


@pytest.mark.parametrize(("name", "size"), [("goal", 72), ("paper", 72), ("map", 50), ("corridors", 86)])
def test_every_observation_has_its_size_and_is_of_order_one(name: str, size: int) -> None:
    env = SwiftNavEnv(WAY, replace(CALM, observation=name))
    obs, _ = env.reset(seed=0)
    assert obs.shape == (size,) == env.observation_space.shape
    assert np.abs(obs).max() < 20.0


def test_without_stability_nothing_waits() -> None:
    params = navigator_params(EnvConfig(stability=False)).arbiter
    assert (params.debounce_ticks, params.debounce_s, params.dwell_s) == (1, 0.0, 0.0)
    assert params.d_exit_m - params.d_enter_m < 1e-5 and params.s_exit - params.s_enter < 1e-5
    assert navigator_params(EnvConfig()).arbiter == Params().arbiter


def test_without_the_checker_a_path_through_a_tree_is_flown_and_the_stop_rule_alone_prevents_contact() -> None:
    wall = lane(*((6.0, 0.5 * k) for k in range(-8, 9)))
    checked, bare = (
        flown(SwiftNavEnv(wall, replace(CALM, checker=on, time_limit_s=15.0)), ZERO)[1]["episode"]
        for on in (True, False)
    )
    assert bare["kept"] == bare["decisions"] > 0
    assert checked["next"] > 0
    assert not bare["contact"] and bare["timeout"]


def test_a_path_that_will_be_replaced_is_flown_through_its_end_without_braking() -> None:
    avenue = lane(*((float(north), side) for north in range(2, 30, 3) for side in (-2.2, 2.2)), goal_m=32.0)

    def slowest_m_s(run_out_m: float) -> float:
        env = SwiftNavEnv(avenue, replace(CALM, params={"policy": {"learned_run_out_m": run_out_m}}))
        env.reset(seed=0)
        speeds = []
        while True:
            _, _, terminated, truncated, info = env.step(ZERO)
            if terminated or truncated:
                assert info["episode"]["success"]
                return min(speeds[2:])
            speeds.append(math.hypot(*env.query.state.vel_ned_m_s[:2].tolist()))

    assert slowest_m_s(0.0) < 2.75 < 2.9 < slowest_m_s(4.0)


def test_the_guard_is_off_unless_asked_for() -> None:
    assert not navigator_params(EnvConfig()).policy.guard
    assert navigator_params(EnvConfig(guard=True)).policy.guard


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"reward": "papper"}, "unknown reward table 'papper'"),
        ({"observation": "maps"}, "did you mean 'map'"),
        ({"decoder": "detours"}, "did you mean 'detour'"),
        ({"time_limit_s": 0.0}, "time_limit_s"),
        ({"discount_per_s": 1.5}, "discount_per_s"),
    ],
)
def test_a_configuration_that_is_none_is_refused_with_the_reason(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        EnvConfig(**changes)


def test_a_step_needs_a_flight_under_way() -> None:
    with pytest.raises(RuntimeError, match="reset first"):
        SwiftNavEnv(WAY).step(ZERO)
    with pytest.raises(RuntimeError, match="reset first"):
        SwiftNavLowLevelEnv(WAY).step(np.zeros(3, np.float32))


def test_the_baseline_flies_where_it_steers() -> None:
    """Nose east of north by some angle: velocity is relative to it, so ahead is not north."""
    env = SwiftNavLowLevelEnv(lane(goal_m=40.0), CALM)
    env.reset(seed=3)
    for _ in range(10):
        env.step(np.array([1.0, 0.0, 0.0], np.float32))
    assert math.hypot(*env.flight.world_ne_m) > 3.0
    assert bearing_rad(*env.flight.world_ne_m) == pytest.approx(nose_rad(env), abs=0.1)
    assert abs(nose_rad(env)) > 0.3


def test_the_baseline_reaches_a_goal_before_its_nose_and_touches_a_tree_before_it() -> None:
    env = SwiftNavLowLevelEnv(lane(goal_m=12.0), CALM)
    for seed in range(100):
        env.reset(seed=seed)
        if abs(nose_rad(env)) < 0.05:
            break
    ahead = np.array([1.0, 0.0, 0.0], np.float32)
    _, info = flown(env, ahead, seed)
    assert info["episode"]["end"] == "goal" and info["terminated"]
    assert info["episode"]["switches"] == 0
    _, info = flown(SwiftNavLowLevelEnv(lane((6.0, 0.0), goal_m=12.0, radius_m=1.5), CALM), ahead, seed)
    assert info["episode"]["end"] == "contact" and info["terminated"]
    assert info["episode"]["rows"]["crash"] == -1500.0


def test_the_baseline_may_leave_the_map() -> None:
    _, info = flown(SwiftNavLowLevelEnv(lane(), CALM), np.array([0.0, 1.0, 0.0], np.float32), seed=1)
    assert info["episode"]["end"] == "out_of_bounds" and info["episode"]["rows"]["failure"] == -1500.0


@pytest.mark.parametrize("env_class", [SwiftNavEnv, SwiftNavLowLevelEnv])
def test_scans_come_as_often_as_the_configuration_says(env_class: Any) -> None:
    env = env_class(WAY, replace(CALM, scan_rate_hz=12.5))
    env.reset(seed=0)
    at_s = [env.flight.sim.t_s, env.flight.next_scan().state.t_s]
    assert at_s[1] - at_s[0] == pytest.approx(0.08)
    with pytest.raises(InputError, match=r"scan_rate_hz: LiDAR: 24.0 Hz is no whole number of 4 ms physics steps"):
        EnvConfig(scan_rate_hz=24.0)
    with pytest.raises(InputError, match=r"scan_rate_hz 60.0 is outside \[5, 50\]"):
        EnvConfig(scan_rate_hz=60.0)


def test_the_baseline_declares_how_long_an_action_lasts() -> None:
    env = SwiftNavLowLevelEnv(WAY, CALM, hold_ticks=3)
    env.reset(seed=0)
    assert env.step(np.zeros(3, np.float32))[4]["ticks"] == 3
    with pytest.raises(InputError, match="hold_ticks"):
        SwiftNavLowLevelEnv(WAY, CALM, hold_ticks=0)
    with pytest.raises(InputError, match="needs a map"):
        SwiftNavLowLevelEnv(WAY, replace(CALM, observation="map"))
