"""What could come at the vehicle: a mover is found again wherever it passes, soon known, and told from what stands."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene import CLUTTER, DT_S, PARAMS, Eye, world

from companion.core import gridmap
from companion.core.types import F64
from companion.perception.movers import Track
from companion.perception.perceive import Percept, Remembered, perceive
from companion.perception.threats import follow_seen, narrow, threats
from sitl.world import Mover

MOVERS = dataclasses.replace(PARAMS.movers, again_m=0.45, link_m=0.5)
GOAL = np.array([50.0, 0.0])


def to_and_fro(a: tuple[float, float], b: tuple[float, float], speed: float, phase: float = 0.0) -> Mover:
    return Mover(a, b, 0.3, math.inf, speed, speed, phase)


def look(eye: Eye, seconds: float, velocity: tuple[float, float] = (0.0, 0.0)) -> list[Percept]:
    before = Remembered(0.0, gridmap.empty(PARAMS.map), ())
    percepts = []
    for k in range(round(seconds / DT_S)):
        t_s = round(1.0 + DT_S * k, 6)
        inputs = eye.inputs(t_s, (velocity[0] * DT_S * k, velocity[1] * DT_S * k, -2.5), (*velocity, 0.0), 0.3)
        seen = perceive(before, inputs, GOAL, 0.33, PARAMS.perception, PARAMS.map, MOVERS)
        before = Remembered(t_s, seen.grid, seen.tracks)
        percepts.append(seen)
    return percepts


def known(percept: Percept, t_s: float, place: tuple[float, float]) -> list[Track]:
    near = [t for t in percept.tracks if math.dist(t.pos_ne_m.tolist(), place) < 0.5]
    return [t for t in near if t.hits >= MOVERS.settled and t_s - t.seen_t_s < 0.1]


def test_within_a_second_of_being_seen_its_velocity_is_known() -> None:
    mover = to_and_fro((4.0, -4.0), (4.0, 36.0), 1.0, phase=0.0)
    percepts = look(Eye(world(movers=(mover,)), sigma_m=0.01), 2.4)
    first = next(k for k, percept in enumerate(percepts) if percept.tracks)
    for k in range(first + 25, len(percepts)):
        t_s = 1.0 + DT_S * k
        (track,) = known(percepts[k], t_s, mover.position_ned_m(t_s))
        assert np.hypot(*(track.vel_ne_m_s - [0.0, 1.0])) < 0.4


def test_one_that_turns_back_is_known_again_within_half_a_second() -> None:
    mover = to_and_fro((3.0, -2.0), (3.0, 1.0), 1.0)  # turns back at 3 s, off again at 6 s
    percepts = look(Eye(world(movers=(mover,)), sigma_m=0.01), 3.0)
    t_s = 3.6
    (track,) = [t for t in percepts[round((t_s - 1.0) / DT_S)].tracks if t.hits > 1]
    assert track.vel_ne_m_s[1] < -0.5


def test_one_that_passes_close_by_a_post_keeps_its_track() -> None:
    mover = to_and_fro((3.0, -3.0), (3.0, 37.0), 1.0)
    eye = Eye(world([(4.2, 0.0, 0.2)], movers=(mover,)), sigma_m=0.01)
    percepts = look(eye, 4.5)
    for k in range(40, len(percepts)):
        t_s = 1.0 + DT_S * k
        assert len(known(percepts[k], t_s, mover.position_ned_m(t_s))) == 1


@pytest.mark.parametrize("own", [(0.0, 0.0), (1.5, 0.4)])
def test_what_stands_is_no_threat_for_long(own: tuple[float, float]) -> None:
    percepts = look(Eye(world([t for t in CLUTTER if abs(t[1]) > 1.0]), sigma_m=0.01), 3.0, own)
    lots = [threats(p.tracks, p.static_ne_m, 1.0 + DT_S * k, MOVERS) for k, p in enumerate(percepts)]
    assert sum(len(one.pos_ne_m) for one in lots) <= 0.1 * len(lots)


@given(st.lists(st.tuples(st.floats(-4, 4), st.floats(-4, 4)), max_size=12), st.integers(0, 6))
@settings(max_examples=60, deadline=None)
def test_tracks_stay_apart_finite_and_no_faster_than_anything_is(places, count) -> None:
    hits: F64 = np.array(places).reshape(-1, 2)
    tracks: tuple[Track, ...] = ()
    for k in range(5):
        tracks = follow_seen(
            tracks, hits[:count] + 0.03 * k, hits + 0.03 * k, np.zeros(2), 1.0 + DT_S * k, DT_S, MOVERS
        )
    for track in tracks:
        assert np.isfinite(track.pos_ne_m).all()
        assert math.hypot(*track.vel_ne_m_s) <= MOVERS.fast_m_s + 1e-9


def test_narrow_things_have_centres_and_walls_have_none() -> None:
    post = np.array([[3.0, -0.1], [2.97, 0.0], [3.0, 0.1]])
    wall = np.stack([np.full(15, -4.0), np.linspace(2.0, -2.0, 15)], axis=1)
    (centre,) = narrow(np.concatenate([post, wall]), np.zeros(2), MOVERS)
    assert centre == pytest.approx([2.99 + MOVERS.radius_m, 0.0], abs=0.02)
    assert len(narrow(np.empty((0, 2)), np.zeros(2), MOVERS)) == 0


def test_hits_of_what_moves_are_not_taken_for_what_stands() -> None:
    track = Track(np.array([3.0, 0.0]), np.array([0.0, 1.0]), np.array([3.0, -2.0]), 1.0, 30)
    found = threats((track,), np.array([[2.7, 0.0], [3.0, 1.5]]), 1.04, MOVERS)
    assert found.static_ne_m.tolist() == [[3.0, 1.5]]
    assert found.doubt_m_s.tolist() == [MOVERS.doubt_m_s]
