"""Which way the geometric expert leads: out of pockets, without turning round, not through walls."""

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core import geometry, gridmap
from companion.core.gridmap import GridMap, MapParams
from companion.core.types import F64, VehicleState
from companion.policy.expert import ExpertParams, GeometricExpert
from companion.policy.interface import WAYPOINTS, Query

MAP = MapParams()
EXPERT = GeometricExpert(ExpertParams(), MAP)
RADIUS_M = 0.33
NOW_S = 10.0
GOAL = np.array([10.0, 0.0])
NOTHING = np.empty((0, 2))


def line(start: tuple[float, float], end: tuple[float, float], step_m: float = 0.1) -> F64:
    count = max(2, math.ceil(math.dist(start, end) / step_m) + 1)
    return np.linspace(start, end, count)


POCKET = np.concatenate([line((5.0, -2.5), (5.0, 2.5)), line((2.0, -2.5), (5.0, -2.5)), line((2.0, 2.5), (5.0, 2.5))])
BARRIER = line((4.0, -2.5), (4.0, 2.5))


def known(hits: F64, seen: bool = True) -> GridMap:
    """A map round the origin that holds exactly these hits; all the rest free or never seen."""
    grid = gridmap.empty(MAP)
    if seen:
        grid.free_t[:] = NOW_S
    cells, inside = gridmap.cells_of(grid, hits)
    grid.hit_t.ravel()[cells[inside]] = NOW_S
    grid.hit_ne_m.reshape(-1, 2)[cells[inside]] = hits[inside]
    return grid


def query(grid: GridMap, pos: F64, prefix: F64 | None = None, goal: F64 = GOAL, hazard: F64 = NOTHING) -> Query:
    state = VehicleState(NOW_S, np.array([*pos, -2.5]), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))
    prefix = pos[None] if prefix is None else prefix
    return Query(state, goal, grid, hazard, RADIUS_M, prefix, np.zeros(72), np.zeros(2))


def way(hits: F64, pos: F64, **given: F64) -> F64 | None:
    """Start and waypoints proposed from there, nothing remembered."""
    proposal, _ = EXPERT.propose(query(known(hits), pos, **given), None)
    return None if proposal is None else np.concatenate([pos[None], proposal.waypoints_ne_m])


@dataclass
class Walk:
    """Proposals followed one after another, as far as a path is good for."""

    hits: F64
    pos: F64
    policy: F64 | None = None
    trail: list[F64] = field(default_factory=list)
    plans: list[F64] = field(default_factory=list)

    def go(self, legs: int, leg_m: float = 1.0, goal: F64 = GOAL) -> bool:
        """Up to ``legs`` decisions; did it arrive?"""
        grid = known(self.hits)
        for _ in range(legs):
            proposal, self.policy = EXPERT.propose(query(grid, self.pos, goal=goal), self.policy)
            assert proposal is not None
            path = np.concatenate([self.pos[None], proposal.waypoints_ne_m])
            self.plans.append(path)
            self.trail += list(geometry.resample(geometry.part(path, 0.0, leg_m), 0.1))
            self.pos = geometry.point_at(path, leg_m)
            if math.dist(self.pos, goal) < 0.3:
                return True
        return False

    def clearance_m(self) -> float:
        return float(geometry.points_to_polyline_distance(np.array(self.trail), self.hits).min())


def test_with_nothing_in_the_way_it_leads_straight_to_the_goal() -> None:
    path = way(np.array([[0.0, 9.0]]), np.zeros(2))
    assert path is not None
    assert np.abs(path[:, 1]).max() < 0.25
    assert (np.diff(path[:, 0]) > 0.0).all()


def test_it_leaves_a_concave_pocket_and_reaches_the_goal_behind_it() -> None:
    walk = Walk(POCKET, np.array([4.0, 0.4]))
    assert walk.go(40)
    assert min(place[0] for place in walk.trail) < 2.0  # back out through the mouth
    assert walk.clearance_m() > RADIUS_M + ExpertParams().margin_m - 0.1


def test_the_pocket_is_left_as_well_with_everything_behind_it_unknown() -> None:
    grid = known(POCKET)
    north, _ = gridmap.centres(grid)
    grid.free_t[north > 5.2, :] = gridmap.NEVER
    proposal, _ = EXPERT.propose(query(grid, np.array([4.0, 0.4])), None)
    assert proposal is not None
    path = np.concatenate([[[4.0, 0.4]], proposal.waypoints_ne_m])
    assert geometry.points_to_polyline_distance(path, POCKET).min() > RADIUS_M
    assert path[-1, 0] < 4.0


def test_it_keeps_to_the_side_that_it_has_chosen() -> None:
    rng = np.random.default_rng(3)
    grid, memory, sides = known(BARRIER), None, []
    for k in range(25):
        pos = np.array([0.05 * k, 0.0]) + rng.normal(0.0, 0.08, 2)  # in front of the middle, a little to and fro
        proposal, memory = EXPERT.propose(query(grid, pos), memory)
        assert proposal is not None
        sides.append(float(np.sign(proposal.waypoints_ne_m[-1, 1])))
    assert len(set(sides)) == 1


def test_without_its_memory_it_would_take_turns() -> None:
    grid = known(BARRIER)
    sides = set()
    for east in (-0.3, 0.3):
        proposal, _ = EXPERT.propose(query(grid, np.array([0.0, east])), None)
        assert proposal is not None
        sides.add(float(np.sign(proposal.waypoints_ne_m[-1, 1])))
    assert sides == {-1.0, 1.0}


def test_it_gives_up_its_path_once_that_is_blocked() -> None:
    first, memory = EXPERT.propose(query(known(BARRIER), np.array([0.0, 0.3])), None)
    assert first is not None and first.waypoints_ne_m[-1, 1] > 0.0
    longer = np.concatenate([BARRIER, line((4.0, 2.5), (4.0, 9.0))])
    second, _ = EXPERT.propose(query(known(longer), np.array([0.0, 0.3])), memory)
    assert second is not None and second.waypoints_ne_m[-1, 1] < 0.0


def test_it_gives_up_its_path_for_one_that_is_clearly_cheaper() -> None:
    long_way = np.concatenate([BARRIER, line((4.0, 2.5), (4.0, 7.0)), line((4.0, -9.0), (4.0, -2.5))])
    _, memory = EXPERT.propose(query(known(long_way), np.zeros(2)), None)
    opened = long_way[np.abs(long_way[:, 1]) > 1.2]
    proposal, _ = EXPERT.propose(query(known(opened), np.zeros(2)), memory)
    assert proposal is not None
    assert np.abs(proposal.waypoints_ne_m[:, 1]).max() < 1.2


@pytest.mark.parametrize("room_m", [0.45, 0.6, 1.0, 3.0])
def test_enclosed_there_is_no_way_out(room_m: float) -> None:
    around = np.arange(200) * math.tau / 200
    cage = room_m * np.stack([np.cos(around), np.sin(around)], axis=1)
    path = way(cage, np.zeros(2))
    if path is not None:  # a room is walked up to the wall that is nearest to the goal, never through it
        assert np.hypot(*path.T).max() < max(room_m - RADIUS_M, 0.1)
    far = way(cage, np.zeros(2), goal=np.array([40.0, 0.0]))
    assert far is None  # no way off the map


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.floats(-6.0, 9.0), st.floats(-7.0, 7.0)), max_size=25),
    st.floats(-12.0, 12.0),
    st.floats(-30.0, 30.0),
)
def test_five_waypoints_at_most_that_keep_their_distance(trees, goal_north, goal_east) -> None:
    around = np.arange(16) * math.tau / 16
    rim = 0.3 * np.stack([np.cos(around), np.sin(around)], axis=1)
    hits = np.concatenate([NOTHING, *[rim + tree for tree in trees if math.hypot(*tree) > 1.0]])
    path = way(hits, np.zeros(2), goal=np.array([goal_north, goal_east]))
    if path is None:
        return
    assert len(path) - 1 <= WAYPOINTS
    assert len(path) > 1 or math.hypot(goal_north, goal_east) < 1.5 * MAP.cell_m or len(hits)
    assert np.isfinite(path).all()
    assert geometry.length(path) < ExpertParams().length_m + 20 * MAP.cell_m * math.sqrt(2)
    near = hits[np.hypot(*hits.T) < ExpertParams().hard_range_m - 0.5]
    inside = geometry.part(path, 0.0, 4.0)
    assert geometry.points_to_polyline_distance(inside, near).min(initial=math.inf) > RADIUS_M - 0.15


def test_a_new_path_begins_where_the_committed_stretch_ends() -> None:
    prefix = np.array([[0.0, 0.0], [0.0, 1.2]])
    grid = known(BARRIER)
    proposal, memory = EXPERT.propose(query(grid, np.zeros(2), prefix), None)
    assert proposal is not None and memory is not None
    assert memory[0] == pytest.approx(prefix[-1])
    whole = np.concatenate([prefix[:1], proposal.waypoints_ne_m])
    assert geometry.points_to_polyline_distance(whole, prefix[-1:]).min() < 0.25
    assert proposal.waypoints_ne_m[0, 1] > 0.5  # along the stretch first, not straight off to the goal


def test_it_ends_at_a_goal_that_is_near() -> None:
    path = way(np.array([[0.0, 9.0]]), np.zeros(2), goal=np.array([2.0, 1.0]))
    assert path is not None
    assert path[-1] == pytest.approx([2.0, 1.0])


def test_never_seen_cells_cost_something_and_do_not_block() -> None:
    grid = known(np.array([[0.0, 9.0]]), seen=False)
    assert EXPERT.propose(query(grid, np.zeros(2)), None)[0] is not None
    _, east = gridmap.centres(grid)
    grid.free_t[:, east > 1.0] = NOW_S  # seen: everything a metre to the right
    proposal, _ = EXPERT.propose(query(grid, np.zeros(2)), None)
    assert proposal is not None
    assert proposal.waypoints_ne_m[:, 1].max() > 0.8


def test_hits_far_away_cost_something_and_do_not_block() -> None:
    far = ExpertParams().hard_range_m + 2.0
    across = line((far, -14.3), (far, 14.3))  # from one end of the map to the other: a sector minimum seen from afar
    path = way(across, np.zeros(2))
    assert path is not None and path[-1, 0] > 4.0
    gap = across[np.abs(across[:, 1] - 5.0) > 1.5]
    path = way(gap, np.zeros(2))
    assert path is not None and path[-1, 1] > 1.5  # rather through the gap


def test_where_movers_will_be_is_not_gone_through() -> None:
    swept = line((3.0, -1.5), (3.0, 1.5), 0.3)
    path = way(np.array([[0.0, 9.0]]), np.zeros(2), hazard=swept)
    assert path is not None
    assert geometry.points_to_polyline_distance(path, swept).min() > RADIUS_M


def test_a_tight_gap_is_taken_where_there_is_no_other() -> None:
    half = RADIUS_M + 0.17  # wider than the tight margin, narrower than the one that is preferred
    wall = np.concatenate([line((3.0, -15.0), (3.0, -half)), line((3.0, half), (3.0, 15.0))])
    path = way(wall, np.zeros(2))
    assert path is not None
    assert geometry.points_to_polyline_distance(path, wall).min() > RADIUS_M


def test_from_too_near_it_leads_away() -> None:
    trunk = np.array([0.45, 0.0]) + 0.05 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    path = way(trunk, np.zeros(2))
    assert path is not None
    assert geometry.points_to_polyline_distance(path[1:], trunk).min() > RADIUS_M


@given(st.permutations(range(3)))
@settings(max_examples=5, deadline=None)
def test_it_is_a_pure_function_of_question_and_memory(order: list[int]) -> None:
    questions = [query(known(hits), np.array([0.0, 0.1])) for hits in (POCKET - [3.0, 0.0], BARRIER, NOTHING)]
    expected = [EXPERT.propose(question, None) for question in questions]
    for k in order:
        proposal, memory = EXPERT.propose(questions[k], None)
        assert proposal is not None and expected[k][0] is not None
        assert proposal.waypoints_ne_m.tobytes() == expected[k][0].waypoints_ne_m.tobytes()
        assert memory.tobytes() == expected[k][1].tobytes()


def test_chords_stay_near_the_path_that_they_cut() -> None:
    _, memory = EXPERT.propose(query(known(BARRIER), np.zeros(2)), None)
    path = way(BARRIER, np.zeros(2))
    assert memory is not None and path is not None
    flown = memory[geometry.arc_lengths(memory) < geometry.length(path) - 0.2]
    off = geometry.points_to_polyline_distance(path, flown)
    assert off.max() < 4 * ExpertParams().chord_m + 1e-9
    assert all(math.dist(a, b) > 0.05 for a, b in itertools.pairwise(path))


def wall_seen(end_east_m: float, opening_east_m: float | None = None) -> GridMap:
    """A wall 4 m north, seen from 4 m west up to an end; unseen beyond, and behind it except through an opening."""
    hits = line((4.0, -4.0), (4.0, end_east_m))
    if opening_east_m is not None:
        hits = hits[np.abs(hits[:, 1] - opening_east_m) > 0.6]
    grid = known(hits, seen=False)
    north, east = gridmap.centres(grid)
    grid.free_t[(north < 3.8)[:, None] & ((east > -4.0) & (east < end_east_m))[None, :]] = NOW_S
    if opening_east_m is not None:
        grid.free_t[(north < 8.0)[:, None] & (np.abs(east - opening_east_m) < 0.6)[None, :]] = NOW_S
    return grid


def crossing_m(grid: GridMap, pos: F64, params: ExpertParams) -> float:
    """East of the place where the way passes the wall, or leaves the map before."""
    _, path = GeometricExpert(params, MAP).propose(query(grid, pos, goal=np.array([60.0, 0.0])), None)
    assert path is not None
    beyond = np.flatnonzero(path[:, 0] > 4.0)
    return float(path[beyond[0] if len(beyond) else -1, 1])


def test_an_opening_that_was_seen_comes_before_the_unseen_end_of_a_wall() -> None:
    grid, pos = wall_seen(6.0, opening_east_m=1.5), np.array([2.0, 6.0])
    assert crossing_m(grid, pos, ExpertParams()) > 5.0
    assert abs(crossing_m(grid, pos, ExpertParams(wall_m=3.0)) - 1.5) < 0.5
