"""What an actor sees: ranges of the map, memory of the flight, the paper's numbers; and their mirror images."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from policy_kit import MAP, NOW_S, mirrored, query, with_movers

from companion.core.types import F64
from companion.perception.observation import observation
from companion.policy import observation_map, recollection
from companion.policy.goal_frame import goal_frame
from companion.policy.observations import NEAR, SIZES, mirror_observation, observe, remember

PLACES = st.lists(st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)), min_size=1, max_size=25)


def test_a_range_is_the_nearest_point_of_its_sector_seen_from_the_anchor() -> None:
    hits = np.array([[5.1, 0.1], [6.1, 0.1], [1.1, 3.1], [-2.1, 0.1]])
    asked = query(hits_ne_m=hits, prefix_ne_m=[(0.0, 0.0), (1.1, 0.1)])
    got = observe("map", asked, None, MAP)[: observation_map.RANGES] * MAP.sense_m
    assert got[0] == pytest.approx(4.0)
    assert got[9] == pytest.approx(3.0)  # right
    assert got[18] == pytest.approx(3.2)  # behind
    assert (np.delete(got, [0, 9, 18]) == MAP.sense_m).all()


def test_what_movers_will_sweep_counts_and_what_was_forgotten_does_not() -> None:
    asked = with_movers(query(), np.array([[3.0, 0.0]]))
    assert observe("map", asked, None, MAP)[0] * MAP.sense_m == pytest.approx(3.0)
    old = query(hits_ne_m=np.array([[3.1, 0.1]]))
    late = query(grid=old.grid, t_s=NOW_S + MAP.forget_s + 1.0)
    assert observe("map", late, None, MAP)[0] == 1.0


def test_a_corridor_ends_where_a_disc_touches() -> None:
    points = np.array([[5.0, 0.3]])
    free = observation_map.corridors(points, 0.5, MAP.sense_m) * MAP.sense_m
    assert free[0] == pytest.approx(5.0 - 0.4)  # 3-4-5
    assert free[18] == MAP.sense_m
    assert (observation_map.corridors(np.empty((0, 2)), 0.5, MAP.sense_m) == 1.0).all()


def test_two_trunks_with_a_gap_are_far_in_the_corridor_and_near_in_the_ranges_beside_it() -> None:
    gap = np.array([[4.0, 0.7], [4.0, -0.7]])
    assert observation_map.corridors(gap, 0.53, MAP.sense_m)[0] == 1.0
    assert observation_map.ranges(gap, MAP.sense_m)[[1, 35]] * MAP.sense_m == pytest.approx([4.06, 4.06], abs=0.01)


def flown(places: list[tuple[float, float]], step_s: float = 0.5, heading: float = 0.3) -> tuple[F64, F64]:
    """Features after decisions at these places, and the memory."""
    memory: F64 | None = None
    for k, place in enumerate(places):
        asked = query(pos_ne_m=place, t_s=NOW_S + k * step_s)
        seen = observe("map", asked, memory, MAP)
        memory = remember(asked, memory, heading, 0.5)
    return seen[observation_map.RANGES :], memory


def test_the_first_decision_remembers_nothing() -> None:
    features, memory = flown([(0.0, 0.0)])
    assert features[2:12] == pytest.approx(np.zeros(10))
    assert memory.shape == (recollection.SIZE,)


def test_the_memory_holds_heading_time_displacement_and_what_was_lost() -> None:
    out_and_back = [(float(n), 0.0) for n in (0, 1, 2, 3, 4, 5, 4, 3, 2)]  # 2 m/s for 2.5 s, then back
    features, _ = flown(out_and_back)
    assert features[2:5] == pytest.approx([math.cos(0.3), math.sin(0.3), 0.5])
    assert features[5] == pytest.approx(4.0 / 30.0)
    assert features[6] == pytest.approx(2.0 / 12.0)  # 4 s ago at the start: 2 m
    assert features[8] == pytest.approx(2.0 / 36.0)
    assert features[10] == pytest.approx(0.3)  # 3 m lost against the best
    assert features[12] == pytest.approx(18.0 / 20.0)


def test_displacement_is_counted_from_where_the_vehicle_was_a_window_ago() -> None:
    straight = [(0.25 * k, 0.1 * k) for k in range(60)]  # 30 s
    features, _ = flown(straight)
    frame = goal_frame(query(pos_ne_m=straight[-1]))
    four, twelve = frame.turned(np.array([2.0, 0.8])), frame.turned(np.array([6.0, 2.4]))
    assert features[6:8] * 12.0 == pytest.approx(four)
    assert features[8:10] * 36.0 == pytest.approx(twelve)


def test_time_between_engagements_counts_as_one_second_at_most() -> None:
    asked, later = query(), query(t_s=NOW_S + 60.0)
    memory = remember(asked, None, 0.0, 0.0)
    assert recollection.entered(later, memory)[recollection.RL_TIME] == recollection.PAUSE_S


def test_offset_from_the_line_is_positive_to_the_right() -> None:
    right = observe("map", query(pos_ne_m=(5.0, 2.0)), None, MAP)[observation_map.RANGES + 11]
    assert right == pytest.approx(0.2)


def test_the_paper_observation_is_the_world_frame_version() -> None:
    asked = query((2.0, 3.0), (20.0, 8.0), yaw_rad=0.7, vel_ne_m_s=(1.0, -2.0), start_ne_m=(-1.0, 1.0))
    hazard = np.array([[4.0, 5.0], [1.0, -3.0]])
    world = observation(asked.state, hazard, asked.start_ne_m, asked.goal_ne_m, paper=True)
    got = observe("paper", with_movers(asked, hazard), None, MAP)
    assert got[:12] * np.array([20, 20, 5, 1, 1, 1, 1, 1, 1, 3, 3, 3]) == pytest.approx(world[:12])
    assert got[12:18] * 10.0 == pytest.approx(world[12:18])
    assert (got[18:] == NEAR).all()


@settings(max_examples=40)
@given(st.sampled_from(sorted(SIZES)), PLACES, st.floats(-2.5, 2.5), st.floats(-1.0, 1.0), st.floats(-1.5, 1.5))
def test_a_mirrored_query_gives_the_mirrored_observation(name, places, yaw: float, east: float, heading: float) -> None:
    hazard = np.array(places)
    first = with_movers(query((0.3, east), goal_ne_m=(18.0, 2.0), yaw_rad=yaw), hazard)
    second = with_movers(
        query((1.2, east + 0.2), (18.0, 2.0), vel_ne_m_s=(1.0, 0.4), yaw_rad=yaw, t_s=NOW_S + 0.5), hazard
    )
    seen = observe(name, second, remember(first, None, heading, 0.2), MAP)
    image = observe(name, mirrored(second), remember(mirrored(first), None, -heading, -0.2), MAP)
    assert seen.shape == (SIZES[name],)
    assert mirror_observation(name, seen) == pytest.approx(image, abs=1e-6)
    assert mirror_observation(name, mirror_observation(name, seen)) == pytest.approx(seen)
