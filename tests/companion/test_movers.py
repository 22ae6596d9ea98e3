"""What moves is tracked from real scans; what stands still never is; the discs that a mover will sweep."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene import CLUTTER, DT_S, PARAMS, Eye, bytes_of, ring, world

from companion.core import gridmap
from companion.core.types import F64
from companion.perception.movers import MoverParams, Track, avoidable, discs, follow, hazards, moving
from companion.perception.perceive import Percept, Remembered, perceive
from sitl.world import Mover

MOVERS = PARAMS.movers
GOAL = np.array([50.0, 0.0])
SETTLED_S = 2.0  # after the first scan


def mover(start: tuple[float, float], velocity: tuple[float, float], radius_m: float = 0.4) -> Mover:
    """A disc at ``start`` at time 1 s that goes on for 40 s."""
    speed = math.hypot(*velocity)
    first = tuple(s - v for s, v in zip(start, velocity, strict=True))
    last = tuple(f + 40.0 * v for f, v in zip(first, velocity, strict=True))
    return Mover((first[0], first[1]), (last[0], last[1]), radius_m, math.inf, speed, speed, 0.0)


def look(eye: Eye, seconds: float, velocity: tuple[float, float] = (0.0, 0.0), yaw: float = 0.3) -> list[Percept]:
    """Percepts of a vehicle that flies on straight."""
    before = Remembered(0.0, gridmap.empty(PARAMS.map), ())
    percepts = []
    for k in range(round(seconds / DT_S)):
        t_s = round(1.0 + DT_S * k, 6)
        pos = (velocity[0] * DT_S * k, velocity[1] * DT_S * k, -2.5)
        inputs = eye.inputs(t_s, pos, (*velocity, 0.0), yaw)
        seen = perceive(before, inputs, GOAL, 0.33, PARAMS.perception, PARAMS.map, MOVERS)
        before = Remembered(t_s, seen.grid, seen.tracks)
        percepts.append(seen)
    return percepts


def believed(percept: Percept) -> list[Track]:
    return [track for track in percept.tracks if moving(track, MOVERS)]


@pytest.mark.parametrize(
    ("start", "velocity"),
    [
        ((4.0, -4.0), (0.0, 1.5)),
        ((5.0, 4.0), (0.0, -1.0)),
        ((3.0, -3.0), (0.3, 1.0)),
        ((9.0, 1.0), (-1.2, 0.0)),
        ((-2.0, -4.0), (0.8, 0.8)),
        ((3.0, -1.5), (0.0, 0.6)),
    ],
)
@pytest.mark.parametrize("own", [(0.0, 0.0), (0.8, 0.2)])
def test_a_disc_of_constant_velocity_is_tracked(start, velocity, own) -> None:
    percepts = look(Eye(world(movers=(mover(start, velocity),)), sigma_m=0.01), 4.0, own)
    off_m, off_m_s, missed = [], [], 0
    for k in range(round(SETTLED_S / DT_S), len(percepts)):
        there = np.array(start) + np.array(velocity) * DT_S * k
        near = [one for one in believed(percepts[k]) if np.hypot(*(one.pos_ne_m - there)) < MOVERS.gate_m]
        off_m += [float(np.hypot(*(one.pos_ne_m - there))) for one in near]
        off_m_s += [float(np.hypot(*(one.vel_ne_m_s - velocity))) for one in near]
        missed += not near
    assert missed <= 3
    assert np.median(off_m) < 0.1
    assert np.median(off_m_s) < 0.25  # more for some ticks, while its rim enters another sector


def test_a_mover_is_believed_within_a_second_and_a_half_and_kept() -> None:
    percepts = look(Eye(world(movers=(mover((4.0, -4.0), (0.0, 1.2)),)), sigma_m=0.01), 4.0)
    first = next(k for k, percept in enumerate(percepts) if believed(percept))
    assert first * DT_S < 1.5
    assert all(len(believed(percept)) == 1 for percept in percepts[first:])


def test_two_movers_are_two_tracks() -> None:
    pair = (mover((4.0, -3.0), (0.0, 1.0)), mover((-4.0, 3.0), (0.0, -1.2)))
    tracks = believed(look(Eye(world(movers=pair), sigma_m=0.01), 2.5)[-1])
    assert sorted(round(float(track.vel_ne_m_s[1])) for track in tracks) == [-1, 1]


def test_a_mover_that_stops_being_seen_is_dropped() -> None:
    eye = Eye(world(movers=(mover((4.0, -3.0), (0.0, 1.0)),)), sigma_m=0.01)
    tracks = look(eye, 2.5)[-1].tracks
    nothing = np.empty((0, 2))
    for k in range(round((MOVERS.coast_s + 0.1) / DT_S)):
        tracks = follow(tracks, nothing, np.zeros(2), 3.5 + DT_S * (k + 1), DT_S, MOVERS)
    assert tracks == ()


@pytest.mark.parametrize("own", [(0.0, 0.0), (2.0, 0.0), (1.5, 0.4), (3.0, -0.3)])
@pytest.mark.parametrize("scene", ["clutter", "avenue", "ring"])
def test_what_stands_still_is_never_taken_for_a_mover(own: tuple[float, float], scene: str) -> None:
    avenue = [(2.0 * k, side * 1.5, 0.35) for k in range(8) for side in (-1, 1)]
    trees = {"clutter": [t for t in CLUTTER if abs(t[1]) > 1.0], "avenue": avenue, "ring": ring(14.0, 40)}[scene]
    percepts = look(Eye(world(trees), sigma_m=0.01), 3.0, own)
    assert not any(believed(percept) for percept in percepts)
    assert not any(len(percept.hazard_ne_m) for percept in percepts)


def test_a_thick_wall_that_is_passed_is_no_mover() -> None:
    wall = Eye(world(boxes=[(6.0, 3.0, 0.0, 3.0, 0.4)]), sigma_m=0.01)
    assert not any(believed(percept) for percept in look(wall, 4.0, (2.0, 0.0)))


def track(pos: tuple[float, float], velocity: tuple[float, float], origin: tuple[float, float], hits: int) -> Track:
    return Track(np.array(pos), np.array(velocity), np.array(origin), 1.0, hits)


@pytest.mark.parametrize(
    ("given", "believable"),
    [
        (track((1.0, 0.0), (0.5, 0.0), (0.0, 0.0), 6), True),
        (track((1.0, 0.0), (0.5, 0.0), (0.0, 0.0), 5), False),  # seen too seldom
        (track((0.2, 0.0), (0.5, 0.0), (0.0, 0.0), 60), False),  # has not travelled
        (track((1.0, 0.0), (0.2, 0.0), (0.0, 0.0), 60), False),  # too slow
    ],
)
def test_a_track_counts_once_it_has_really_travelled(given: Track, believable: bool) -> None:
    assert moving(given, MoverParams()) is believable


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_hazards_lie_evenly_along_the_look_ahead(north: float, east: float, vn: float, ve: float) -> None:
    one = track((north, east), (vn, ve), (north + 3.0, east), 10)
    centres = hazards((one,), MOVERS)
    if not moving(one, MOVERS):
        assert centres.shape == (0, 2)
        return
    assert centres.shape == (MOVERS.steps, 2)
    assert centres[0] == pytest.approx([north, east])
    assert centres[-1] == pytest.approx([north + MOVERS.ahead_s * vn, east + MOVERS.ahead_s * ve])
    steps = np.hypot(*np.diff(centres, axis=0).T)
    assert steps == pytest.approx(np.full(len(steps), math.hypot(vn, ve) * MOVERS.ahead_s / (MOVERS.steps - 1)))
    assert steps.max() <= 2 * MOVERS.radius_m  # at the speeds asked for no path slips between two discs


def test_without_look_ahead_there_are_no_hazards() -> None:
    assert len(hazards((track((1.0, 0.0), (1.0, 0.0), (0.0, 0.0), 10),), MoverParams(ahead_s=0.0))) == 0


@given(st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)), min_size=1, max_size=5))
def test_discs_are_drawn_by_their_middle_and_six_points_of_their_rim(centres: list[tuple[float, float]]) -> None:
    places: F64 = np.array(centres)
    points = discs(places, MOVERS).reshape(-1, 7, 2)
    assert points[:, 0] == pytest.approx(places)
    away = np.hypot(*(points[:, 1:] - places[:, None]).transpose(2, 0, 1))
    assert away == pytest.approx(np.full(away.shape, MOVERS.radius_m))
    gap_m = np.hypot(*(points[:, 1:] - np.roll(points[:, 1:], 1, axis=1)).transpose(2, 0, 1))
    assert gap_m.max() < 2 * 0.33  # no vehicle fits between two of them


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)), max_size=9))
def test_a_disc_that_holds_the_vehicle_already_is_left_and_not_stopped_for(centres: list[tuple[float, float]]) -> None:
    places: F64 = np.array(centres).reshape(-1, 2)
    kept = avoidable(places, np.zeros(2), 0.33, MOVERS)
    reach_m = MOVERS.radius_m + 0.33 + MOVERS.room_m
    assert kept.tolist() == [list(place) for place in centres if math.hypot(*place) > reach_m]


def test_a_longer_gap_between_scans_tells_no_velocity() -> None:
    seen = follow((), np.array([[4.0, 0.0]]), np.zeros(2), 1.0, 0.04, MOVERS)
    late = follow(seen, np.array([[4.4, 0.0]]), np.zeros(2), 1.6, 0.6, MOVERS)
    same = follow(seen, np.array([[4.4, 0.0]]), np.zeros(2), 1.0, 0.0, MOVERS)
    assert np.hypot(*late[0].vel_ne_m_s) <= MOVERS.gain_vel / 0.2 * 0.4 + 1e-9
    assert bytes_of(same) == bytes_of(seen)  # the same instant twice
    assert np.isfinite(late[0].vel_ne_m_s).all()
