"""Which set of parameters flies: when does it change, how often, and what does the map take along?"""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene import HOVERING, PARAMS, Eye, Pilot, ring, world

from companion.core.frames import quaternion
from companion.core.gridmap import occupied_points
from companion.core.params import ParamError, update
from companion.core.types import AutopilotStatus, VehicleState
from companion.navigator.memory import Tightness
from companion.navigator.profiles import profile_named
from companion.navigator.tightness import GRAVITY_M_S2, felt, sets, tight_set
from mission.mission_file import WindSpec, load_mission
from mission.simulate import fly_in_process
from mission.training.flights import plan_world
from sitl.simulation import Simulation
from sitl.world import World

BOTH, ONE = PARAMS, update(PARAMS, {"tight": {"profile": ""}})
OPEN, CLOSE = Eye(world([(6.0, 5.0, 0.3)])), Eye(world(ring(1.2)))
DWELL_TICKS = 51  # of 40 ms: a little more than 2 s
CALM = {"wind": WindSpec(mean_m_s=(0.0, 0.0), turbulence="none")}


def is_tight(pilot: Pilot) -> bool:
    return pilot.memory.tight.aside is not None


def test_the_other_set_flies_where_most_is_blocked_near_by_and_no_longer_than_that() -> None:
    pilot = Pilot(OPEN, params=BOTH)
    pilot.ticks(3)
    assert not is_tight(pilot) and pilot.memory.grid.cell_m == PARAMS.map.cell_m
    pilot.eye = CLOSE
    pilot.ticks(2)
    assert is_tight(pilot) and pilot.memory.grid.cell_m == tight_set(BOTH).map.cell_m
    assert pilot.tick().as_dict()["tight"] is True
    pilot.eye = OPEN
    pilot.ticks(DWELL_TICKS)
    assert not is_tight(pilot) and pilot.memory.grid.cell_m == PARAMS.map.cell_m
    assert "tight" not in pilot.tick().as_dict()


def test_what_could_not_be_flown_with_the_margins_of_the_open_is_tried_with_those_of_the_tight() -> None:
    cage = Eye(world([(n, e, 0.2) for n, e in ((0.65, 0.0), (-0.65, 0.0), (0.0, 0.65), (0.0, -0.65))]))
    rule = {"profile": "tight", "density_enter": 1.0}  # density alone would not do it
    pilot = Pilot(cage, params=update(PARAMS, {"tight": rule, "arbiter": {"d_enter_m": 3.0}}))
    records = pilot.ticks(60)
    assert any(record.decision is not None and not is_ok(record) for record in records)
    assert is_tight(pilot)


def is_ok(record) -> bool:
    return record.decision.verdict.kind in ("kept", "next", "modified")


@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(1, 70), min_size=2, max_size=5))
def test_two_changes_are_never_nearer_than_the_dwell(stays: list[int]) -> None:
    pilot, changes_s = Pilot(OPEN, params=BOTH), []
    before = False
    for eye, ticks in zip(itertools.cycle((OPEN, CLOSE)), stays, strict=False):
        pilot.eye = eye
        for _ in range(ticks):
            pilot.tick()
            if is_tight(pilot) is not before:
                before = not before
                changes_s.append(pilot.t_s)
    assert all(b - a >= BOTH.tight.dwell_s - 1e-6 for a, b in itertools.pairwise(changes_s))


def test_where_the_goal_comes_no_nearer_the_open_set_has_its_turn_and_later_the_other_again() -> None:
    pilot = Pilot(CLOSE, params=BOTH)
    seen = [(pilot.t_s, is_tight(pilot)) for _ in range(round(30.0 / 0.04)) if pilot.tick()]
    until_s, again_s = BOTH.tight.vain_s, BOTH.tight.vain_s + BOTH.tight.again_s
    assert all(tight for t_s, tight in seen if 1.0 < t_s - seen[0][0] < until_s - 0.1)
    assert not any(tight for t_s, tight in seen if until_s + 0.1 < t_s - seen[0][0] < again_s - 0.1)
    assert all(tight for t_s, tight in seen if t_s - seen[0][0] > again_s + 0.1)


def test_what_was_in_vain_does_not_count_once_a_pilot_has_had_the_vehicle() -> None:
    pilot = Pilot(CLOSE, params=BOTH)
    pilot.ticks(round((BOTH.tight.vain_s + 3.0) / 0.04))
    assert not is_tight(pilot)
    pilot.tick(status=HOVERING)
    pilot.ticks(2)
    assert is_tight(pilot)


def test_hits_are_taken_along_both_ways_and_the_open_map_is_kept() -> None:
    pilot = Pilot(OPEN, params=BOTH)
    pilot.ticks(10)
    far = occupied_points(pilot.memory.grid, pilot.t_s, PARAMS.map)
    assert len(far) and math.dist(far.mean(axis=0), (6.0, 5.0)) < 0.6
    pilot.eye = CLOSE
    pilot.ticks(2)
    near = occupied_points(pilot.memory.grid, pilot.t_s, tight_set(BOTH).map)
    assert len(near) and (np.hypot(*near.T) < 2.0).all()
    pilot.eye = Eye(world())
    pilot.ticks(DWELL_TICKS)
    after = occupied_points(pilot.memory.grid, pilot.t_s, PARAMS.map)
    assert not is_tight(pilot)
    assert {tuple(point) for point in after} <= {tuple(point) for point in far}  # and what has gone was forgotten


@pytest.mark.parametrize(
    "overrides",
    [
        {"tight": {"profile": ""}},
        {"policy": {"name": "forest", "guard": False}},
    ],
)
def test_without_a_profile_and_for_a_policy_on_its_own_nothing_ever_changes(overrides) -> None:
    pilot = Pilot(CLOSE, params=update(BOTH, overrides))
    for record in pilot.ticks(DWELL_TICKS):
        assert record.memory.tight.aside is None and record.percept.grid.cell_m == PARAMS.map.cell_m


def test_a_disarmed_vehicle_begins_in_the_open() -> None:
    pilot = Pilot(CLOSE, params=BOTH)
    pilot.ticks(3)
    assert is_tight(pilot)
    pilot.tick(status=HOVERING)
    assert is_tight(pilot)
    pilot.tick(status=AutopilotStatus(False, False, HOVERING.landed))
    assert not is_tight(pilot) and pilot.memory.grid.cell_m == PARAMS.map.cell_m


def test_the_other_set_is_the_profile_on_top_of_ones_own_and_what_was_chosen_holds_in_both() -> None:
    theirs = {group: fields for group, fields in profile_named("tight").items() if group != "tight"}
    assert tight_set(BOTH) == update(BOTH, theirs)
    mine = update(BOTH, {"limits": {"decel_m_s2": 1.5}, "checker": {"margin_full_m": 0.5}})
    del theirs["checker"]["margin_full_m"]
    assert tight_set(mine) == update(mine, theirs)
    assert tight_set(ONE) is ONE
    with pytest.raises(ParamError, match="unknown profile 'tigth'; did you mean 'tight'"):
        tight_set(update(PARAMS, {"tight": {"profile": "tigth"}}))


@pytest.mark.parametrize(
    ("tilt_rad", "acc_m_s2", "push_m_s2"),
    [
        (0.0, 0.0, 0.0),
        (-0.1, GRAVITY_M_S2 * math.tan(0.1), 0.0),  # nose down: it gains speed as fast as that tilts the thrust
        (-0.1, 0.0, -GRAVITY_M_S2 * math.tan(0.1)),  # and where it gains none, the air holds it back
        (0.0, 0.5, 0.5),
    ],
)
def test_the_push_of_the_wind_is_what_the_tilt_does_not_account_for(
    tilt_rad: float, acc_m_s2: float, push_m_s2: float
) -> None:
    rule = replace(BOTH.tight, drag_1_s=0.0)
    now, before = Tightness(), None
    for tick in range(250):
        t_s = 1.0 + 0.04 * tick
        vel = np.array([acc_m_s2 * t_s, 0.0, 0.0])
        state = VehicleState(t_s, np.zeros(3), vel, quaternion(0.0, tilt_rad, 0.0), np.zeros(3))
        now, before = felt(now, before, state, rule), state
    assert now.push_ne_m_s2 == pytest.approx((push_m_s2, 0.0), abs=1e-3)
    assert now.calm is (abs(push_m_s2) < BOTH.tight.calm_m_s2)


def test_still_air_pushes_nobody() -> None:
    vel = np.array([2.0, 0.0, 0.0])
    tilt_rad = -math.atan(BOTH.tight.drag_1_s * 2.0 / GRAVITY_M_S2)  # holds the speed against the drag
    now, before = Tightness(), None
    for tick in range(250):
        state = VehicleState(1.0 + 0.04 * tick, np.zeros(3), vel, quaternion(0.0, tilt_rad, 0.0), np.zeros(3))
        now, before = felt(now, before, state, BOTH.tight), state
    assert now.push_ne_m_s2 == pytest.approx((0.0, 0.0), abs=1e-9) and now.calm


def test_by_name_the_profile_flies_alone() -> None:
    alone = update(PARAMS, profile_named("tight"))
    assert sets(alone) == (alone,) * 3
    pilot = Pilot(CLOSE, params=alone)
    pilot.ticks(DWELL_TICKS)
    assert not is_tight(pilot)


def test_in_wind_the_margins_stay_those_of_the_open() -> None:
    windy, calm = tight_set(BOTH, calm=False), tight_set(BOTH)
    assert windy.map == calm.map and windy.limits == calm.limits
    assert windy.checker.margins_m() == PARAMS.checker.margins_m() != calm.checker.margins_m()
    assert (windy.expert.margin_m, windy.expert.tight_m) == (PARAMS.expert.margin_m, PARAMS.expert.tight_m)


def gap_flown(profile: str, wide_m: float, seed: int, conditions: dict[str, Any]) -> Simulation:
    """Through a wall with one gap, or not."""
    half = 12.0
    walls = [(6.0, side * (wide_m / 2 + half), math.pi / 2, half, 0.1, math.inf) for side in (-1, 1)]
    bounds = (-4.0, -6.0, 16.0, 6.0)
    world = World("gap", np.zeros(2), np.array([12.0, 0.0]), bounds, np.empty((0, 4)), np.array(walls))
    mission = load_mission("forest").model_copy(update=conditions)
    overrides = {"tight": {"profile": profile}, "policy": {"name": "geometric"}}
    return fly_in_process(plan_world(mission, world, seed, overrides), lambda record: None).sim


def test_a_gap_too_narrow_for_the_defaults_is_flown_in_calm_air_with_both_sets_and_not_with_one() -> None:
    for profile, passes in (("tight", True), ("", False)):
        sim = gap_flown(profile, 0.76, 1, CALM)
        assert not sim.contact and bool(sim.truth.pos_ned_m[0] > 6.5) is passes


def test_in_wind_the_vehicle_stays_out_of_that_gap() -> None:
    sim = gap_flown("tight", 0.76, 1, {})  # 2.9 m/s, light turbulence
    assert not sim.contact and sim.truth.pos_ned_m[0] < 6.0
