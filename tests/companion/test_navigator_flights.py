"""What holds at every tick of real flights: the speed clamp, the checked path, the switches. FCL is the oracle."""

import itertools
import math

import fcl
import numpy as np
import pytest
from scene import Flight, flight

from companion.core import geometry
from companion.core.types import F64, NavMode
from companion.guidance.limits import stopping_speed
from companion.navigator import Record

FLIGHTS = [("trajectory2", 1), ("trajectory1_movers", 3)]
GRAIN_M = 1e-5
FCL_SHARE = 4  # every so manieth accepted path is put before the oracle


@pytest.fixture(params=FLIGHTS, ids=lambda chosen: f"{chosen[0]}-{chosen[1]}")
def flown(request: pytest.FixtureRequest) -> Flight:
    return flight(*request.param)


def engaged(flown: Flight) -> list[Record]:
    return [record for record in flown.records if record.memory.engaged is not None]


def accepted(flown: Flight) -> list[Record]:
    """The ticks with a decision that gave a path."""
    decided = [record for record in flown.records if record.decision is not None]
    return [record for record in decided if record.decision.verdict.path_ned_m is not None]


def touches(path: F64, points: F64, radius_m: float) -> bool:
    """Does FCL find a point in the area swept by a disc?"""
    grains = [fcl.CollisionObject(fcl.Sphere(GRAIN_M), fcl.Transform(np.array([*p, 0.0]))) for p in points]
    cloud = fcl.DynamicAABBTreeCollisionManager()
    cloud.registerObjects(grains)
    cloud.setup()
    for a, b in itertools.pairwise(path):
        length = math.dist(a, b)
        if length == 0.0:
            continue
        axis = np.array([*(b - a), 0.0]) / length
        side = np.array([-axis[1], axis[0], 0.0])
        pose = fcl.Transform(np.stack([side, np.cross(axis, side), axis], axis=1), np.array([*(a + b) / 2.0, 0.0]))
        data = fcl.CollisionData()
        cloud.collide(
            fcl.CollisionObject(fcl.Capsule(radius_m - 2 * GRAIN_M, length), pose), data, fcl.defaultCollisionCallback
        )
        if data.result.is_collision:
            return True
    return False


def split(points: F64, start: F64, radius_m: float) -> tuple[F64, F64]:
    """Points outside the radius at the start, and those that the vehicle is too near to already."""
    now = np.hypot(*(points - start).T)
    outside = now > radius_m + geometry.NEARER_M
    return points[outside], points[~outside]


def test_the_flight_got_there(flown: Flight) -> None:
    assert flown.records[-1].mode == "standby"
    assert flown.records[-2].goal_distance_m < 0.5
    assert {record.mode for record in flown.records} >= {"standby", NavMode.TRAVEL, NavMode.RL, NavMode.LANDING}
    assert len(accepted(flown)) > 20


def test_every_setpoint_is_a_number_and_answers_its_scan(flown: Flight) -> None:
    for record in flown.records:
        setpoint = record.setpoint
        assert setpoint.t_s == record.inputs.scan.t_s
        assert setpoint.pos_ned_m is not None and np.isfinite(setpoint.pos_ned_m).all()
        for part in (setpoint.vel_ned_m_s, setpoint.acc_ned_m_s2):
            assert part is None or np.isfinite(part).all()


def test_no_speed_is_asked_for_that_does_not_stop_within_the_free_length(flown: Flight) -> None:
    limits = flown.plan.params.limits
    tracked = [record for record in flown.records if record.tracked is not None]
    assert len(tracked) > 400
    for record in tracked:
        speed = record.tracked.speed_m_s
        assert speed <= stopping_speed(record.tracked.free_m, limits.decel_m_s2, limits.tau_s)
        assert speed <= flown.plan.task.cruise_m_s
        assert math.hypot(*record.setpoint.vel_ned_m_s[:2]) <= speed + 1e-9


def test_the_free_length_is_free_says_fcl(flown: Flight) -> None:
    params = flown.plan.params
    ticks = [record for record in flown.records if record.tracked is not None and record.mode == NavMode.RL]
    for record in ticks[:: max(1, len(ticks) // 20)]:
        path = record.memory.engaged.path
        radius_m = params.vehicle.radius_m + min(params.vehicle.corridor_m, path.margin_m)
        s_m, free_m = record.tracked.s_m, record.tracked.free_m
        corridor = geometry.part(path.vertices_ne_m, s_m, s_m + free_m)
        outside, _ = split(record.percept.points_ne_m, corridor[0], radius_m)
        assert not touches(corridor, outside, radius_m - 1e-6)


def test_an_accepted_path_keeps_its_margin_to_everything_remembered(flown: Flight) -> None:
    params = flown.plan.params
    for record in accepted(flown):
        verdict = record.decision.verdict
        assert verdict.margin_m in params.checker.margins_m()
        path, radius_m = verdict.path_ned_m, params.vehicle.radius_m + verdict.margin_m
        outside, inside = split(record.percept.points_ne_m, path[0], radius_m)
        assert geometry.points_to_polyline_distance(path, outside).min(initial=math.inf) >= radius_m
        if len(inside):  # the vehicle is there already: not nearer by more than a centimetre
            now = np.hypot(*(inside - path[0]).T)
            assert (geometry.points_to_polyline_distance(path, inside) >= now - geometry.NEARER_M - 1e-9).all()


def test_an_accepted_path_touches_nothing_remembered_says_fcl(flown: Flight) -> None:
    params = flown.plan.params
    for record in accepted(flown)[::FCL_SHARE]:
        verdict = record.decision.verdict
        path, radius_m = verdict.path_ned_m, params.vehicle.radius_m + verdict.margin_m
        outside, inside = split(record.percept.points_ne_m, path[0], radius_m)
        assert not touches(path, outside, radius_m)
        outside, _ = split(inside, path[0], params.vehicle.radius_m)
        assert not touches(path, outside, params.vehicle.radius_m)


def test_the_path_flown_is_the_last_one_that_was_accepted(flown: Flight) -> None:
    last = None
    for record in flown.records:
        if record.decision is not None:
            last = record.decision.verdict.path_ned_m
        path = record.memory.engaged.path if record.memory.engaged is not None else None
        if path is not None:
            assert last is not None
            assert path.vertices_ne_m.tobytes() == last.tobytes()


def test_switches_never_pass_their_bound_and_travel_begins_with_the_goal_in_sight(flown: Flight) -> None:
    for before, record in itertools.pairwise(engaged(flown)):
        state = record.memory.engaged.arbiter
        assert state.switches <= record.switches_bound
        if before.memory.engaged.arbiter.mode == NavMode.RL and state.mode == NavMode.TRAVEL:
            assert record.percept.line_of_sight


def test_line_and_altitude_stay_frozen(flown: Flight) -> None:
    first = engaged(flown)[0].memory.engaged
    for before, record in itertools.pairwise(engaged(flown)):
        now, earlier = record.memory.engaged, before.memory.engaged
        assert (now.down_m, now.engaged_t_s, now.start_ne_m.tolist()) == (
            first.down_m,
            first.engaged_t_s,
            first.start_ne_m.tolist(),
        )
        if now.arbiter.switches == earlier.arbiter.switches:
            assert now.line is earlier.line


def test_nothing_that_stands_still_is_taken_for_a_mover() -> None:
    assert not any(len(record.percept.hazard_ne_m) for record in flight("trajectory2", 1).records)
    assert any(len(record.percept.hazard_ne_m) for record in flight("trajectory1_movers", 3).records)
