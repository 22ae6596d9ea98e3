"""Every pilot flies: to the goal where that is easy, nowhere where it is walled in, never faster than it may."""

import dataclasses
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import quaternion
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import AutopilotStatus, LandedState, VehicleState
from companion.navigator import Params
from companion.policy import store
from companion.policy.actor import Actor
from companion.policy.learned import PolicySpec
from companion.policy.observations import SIZES
from mission.bench.course import Course, Rules
from mission.bench.entry import Entry
from mission.bench.flight import End, Flown, fly
from mission.errors import InputError
from mission.pilots.interface import Oracle, Pilot
from mission.pilots.ompl_path import ompl_path
from mission.pilots.registry import PILOTS, grounded, pilot_named, pilot_names
from mission.pilots.td3_vanilla import LowLevelCard, Td3Vanilla, save_low_level
from mission.shortest_path import shortest_path_m
from mission.world_check import clearance_m
from sitl.lidar import Lidar, LidarParams
from sitl.world import World

PARAMS = Params()
CLASSICAL = ("brake", "dwa", "vfh", "astar", "ompl")
TREES = ((5.0, 0.3, 0.3), (9.0, -1.4, 0.3), (10.0, 2.2, 0.3))
CAP_M_S = 2.0
FLYING = AutopilotStatus(armed=True, offboard=True, landed=LandedState.IN_AIR)
FORESTS = st.lists(st.tuples(st.floats(-6.0, 12.0), st.floats(-8.0, 8.0), st.floats(0.2, 0.6)), max_size=14)


def world(circles: Any = (), boxes: Any = ()) -> World:
    """Circles are (north, east, radius), boxes (north, east, yaw, half length, half width); the goal is 15 m north."""
    return World(
        "scene",
        np.zeros(2),
        np.array([15.0, 0.0]),
        (-15.0, -15.0, 25.0, 15.0),
        np.array([(*row, np.inf) for row in circles], dtype=float).reshape(-1, 4),
        np.array([(*row, np.inf) for row in boxes], dtype=float).reshape(-1, 6),
    )


WALLED_IN = world(
    boxes=[(n, e, math.pi / 2 if n else 0.0, 4.0, 0.1) for n, e in ((4.0, 0.0), (-4.0, 0.0), (0.0, 4.0), (0.0, -4.0))]
)


@cache
def flown(name: str, walled_in: bool) -> Flown:
    """One flight on the full vehicle."""
    rules = Rules(CAP_M_S, 0.33, 8.0 if walled_in else 25.0, 1.0)
    around = WALLED_IN if walled_in else world(TREES)
    return fly(Course("easy", around.name, around, rules), pilot_named(name), PARAMS, seed=3)


@pytest.mark.parametrize("name", CLASSICAL)
def test_every_classical_pilot_reaches_the_goal_past_three_trees(name: str) -> None:
    assert flown(name, False).end is End.GOAL


@pytest.mark.parametrize("name", CLASSICAL)
def test_none_touches_a_wall_that_has_no_way_through(name: str) -> None:
    flight = flown(name, True)
    assert flight.end is End.TIMEOUT
    assert flight.min_clearance_m > 0.0


@pytest.mark.parametrize("name", CLASSICAL)
def test_none_flies_faster_than_the_cap_but_for_the_vehicles_overshoot(name: str) -> None:
    assert flown(name, False).track[:, 3].max() < 1.05 * CAP_M_S


def inputs(around: World, t_s: float, vel_m_s: tuple[float, float]) -> Inputs:
    pos, q = np.array([0.03, 0.07, -2.5]), quaternion(0.0, 0.0, 0.2)
    state = VehicleState(t_s, pos, np.array([*vel_m_s, 0.0]), q, np.zeros(3))
    return Inputs(state, Lidar(around, LidarParams(sigma_m=0.0), 0).scan(t_s, pos, q), FLYING)


def vanilla(folder: Path) -> Td3Vanilla:
    """An actor that was never trained."""
    rng = np.random.default_rng(1)
    weights = tuple(rng.normal(0.0, 0.5, shape).astype(np.float32) for shape in ((16, 72), (3, 16)))
    actor = Actor(weights, tuple(np.zeros(n, np.float32) for n in (16, 3)))
    save_low_level(folder, actor, LowLevelCard())
    return Td3Vanilla(folder)


@pytest.mark.parametrize("name", ("brake", "dwa", "vfh", "astar", "td3_vanilla"))
@given(trees=FORESTS, vel=st.tuples(st.floats(-1.4, 1.4), st.floats(-1.4, 1.4)))
@settings(max_examples=12, deadline=None)
def test_no_setpoint_asks_for_more_than_the_cap_and_the_same_tick_gives_the_same(
    name: str, trees: Any, vel: tuple[float, float], tmp_path_factory: pytest.TempPathFactory
) -> None:
    pilot: Pilot = vanilla(tmp_path_factory.mktemp("td3")) if name == "td3_vanilla" else pilot_named(name)
    around = world([t for t in trees if math.hypot(t[0], t[1]) > t[2] + 0.4])
    task = Task(np.array([15.0, 0.0]), None, CAP_M_S)
    memory = pilot.start(PARAMS)
    for k in range(4):
        seen = inputs(around, 1.0 + 0.04 * k, vel)
        again = pilot.tick(memory, seen, task, PARAMS)[1]
        memory, setpoint, _ = pilot.tick(memory, seen, task, PARAMS)
        for mine, its in zip(dataclasses.astuple(setpoint), dataclasses.astuple(again), strict=True):
            np.testing.assert_array_equal(mine, its)
        velocity = np.zeros(2) if setpoint.vel_ned_m_s is None else setpoint.vel_ned_m_s[:2]
        assert np.hypot(*velocity) <= CAP_M_S + 1e-9


@pytest.mark.parametrize("name", ("brake", "dwa", "vfh", "astar"))
def test_a_stale_scan_is_held_for(name: str) -> None:
    pilot, task = pilot_named(name), Task(np.array([15.0, 0.0]), None, CAP_M_S)
    memory = pilot.start(PARAMS)
    for k in range(3):
        seen = dataclasses.replace(inputs(world(TREES), 1.0 + 0.04 * k, (0.0, 0.0)), fresh=False)
        memory, setpoint, note = pilot.tick(memory, seen, task, PARAMS)
    assert note.mode == "hold"
    np.testing.assert_allclose(setpoint.vel_ned_m_s, 0.0, atol=1e-9)


def test_ompl_finds_nearly_the_shortest_way_and_the_same_each_time() -> None:
    around = world([*TREES, (6.0, 0.8, 0.5), (12.0, 0.0, 1.0)])
    path = ompl_path(around, around.start_ned_m, around.goal_ned_m, 0.5)
    assert path is not None
    again = ompl_path(around, around.start_ned_m, around.goal_ned_m, 0.5)
    np.testing.assert_array_equal(path, again)
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    assert length < 1.01 * shortest_path_m(around, around.start_ned_m, around.goal_ned_m, 0.5)
    assert clearance_m(around, path).min() > 0.5 - 0.05


def test_ompl_says_where_there_is_no_way() -> None:
    assert ompl_path(WALLED_IN, WALLED_IN.start_ned_m, WALLED_IN.goal_ned_m, 0.33) is None


def test_an_oracle_flies_only_where_it_is_told_the_world() -> None:
    oracle = pilot_named("ompl")
    assert isinstance(oracle, Oracle)
    with pytest.raises(InputError, match="told the world"):
        oracle.start(PARAMS)


def test_the_registry_names_what_can_fly_and_says_what_the_others_lack(tmp_path: Path) -> None:
    assert {*pilot_names(), *grounded()} == {*PILOTS, *store.shipped()}
    assert {*CLASSICAL, "geometric"} <= set(pilot_names())
    with pytest.raises(InputError, match="did you mean 'astar'"):
        pilot_named("a_star")
    with pytest.raises(InputError, match="no trained policy"):
        Td3Vanilla(tmp_path)


def test_a_shipped_policy_is_a_pilot_whose_weights_are_part_of_what_was_flown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "POLICIES", tmp_path)
    flown = []
    for number in (0.0, 0.1):
        actor = Actor((np.full((10, SIZES["goal"]), number, np.float32),), (np.zeros(10, np.float32),))
        store.save_policy(tmp_path / "learned", actor, store.Card("learned", PolicySpec("goal")))
        flown.append(Entry("learned").settings()["policy_sha256"])
    assert None not in flown and flown[0] != flown[1] == store.digest_of("learned")
    assert pilot_names()[-1] == pilot_named("learned").name == "learned"
    assert Entry("geometric").settings()["policy_sha256"] is None
    (tmp_path / "learned" / "actor.safetensors").write_bytes(b"other weights")
    with pytest.raises(store.PolicyError, match="sha256"):
        pilot_named("learned")


def test_a_low_level_policy_with_other_weights_is_refused(tmp_path: Path) -> None:
    vanilla(tmp_path)
    (tmp_path / "actor.safetensors").write_bytes((tmp_path / "actor.safetensors").read_bytes()[:-1] + b"x")
    with pytest.raises(InputError, match="sha256"):
        Td3Vanilla(tmp_path)
