"""Does every row of the reward tables pay what the paper says, when it says so, and no more than that by default?

Each expectation is worked by hand from the tables of the paper.
"""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.errors import InputError
from mission.training import reward
from mission.training.reward import RewardState, TickFacts
from mission.training.reward_tables import TABLES, RewardTable, reward_table

HERE = TickFacts(t_s=0.0, pos_ne_m=(0.0, 0.0), goal_distance_m=50.0, d_min_m=math.inf, mode="travel")
ONE = reward_table("trajectory1_paper")
TWO = reward_table("trajectory2_paper")


def after(table: RewardTable, *moments: TickFacts) -> list[dict[str, float]]:
    """Rows of each moment after the first."""
    state, rows = reward.start(moments[0]), []
    for facts in moments[1:]:
        state, row = reward.step(state, facts, table)
        rows.append(row)
    return rows


def total(table: RewardTable, *moments: TickFacts) -> dict[str, float]:
    sums: dict[str, float] = {}
    for rows in after(table, *moments):
        for name, value in rows.items():
            sums[name] = sums.get(name, 0.0) + value
    return sums


def at(t_s: float, **changes: object) -> TickFacts:
    return replace(HERE, t_s=t_s, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(("table", "of_two_steps"), [(ONE, -2.0), (TWO, -1.0)])
def test_a_step_of_the_paper_is_a_tenth_of_a_second(table: RewardTable, of_two_steps: float) -> None:
    assert total(table, HERE, at(0.2)) == {"step": pytest.approx(of_two_steps)}


@pytest.mark.parametrize("name", ["trajectory1", "trajectory2", "plain", "trajectory2_paper"])
@given(ticks=st.integers(1, 50))
def test_the_tick_rate_does_not_change_what_time_costs(name: str, ticks: int) -> None:
    moments = [at(2.0 * k / ticks, d_min_m=3.0) for k in range(ticks + 1)]
    table = replace(reward_table(name), no_progress=0.0)
    whole = total(table, at(0.0, d_min_m=3.0), at(2.0, d_min_m=3.0))
    assert total(table, *moments) == pytest.approx(whole)


@pytest.mark.parametrize(("table", "of_three_m"), [(ONE, 6.0), (TWO, 4.5)])
def test_progress_pays_by_the_metre_and_takes_back(table: RewardTable, of_three_m: float) -> None:
    nearer, farther = after(table, HERE, at(0.0, goal_distance_m=47.0), at(0.0, goal_distance_m=50.0))
    assert nearer == {"progress": pytest.approx(of_three_m)}
    assert farther == {"progress": pytest.approx(-of_three_m)}


@pytest.mark.parametrize(("table", "bonus"), [(ONE, 200.0), (TWO, 3500.0)])
def test_the_goal_pays_once_below_two_metres(table: RewardTable, bonus: float) -> None:
    table = replace(table, progress=0.0)
    rows = after(table, HERE, *(at(0.0, goal_distance_m=d) for d in (2.0, 1.99, 2.5, 1.0)))
    assert rows == [{}, {"goal": bonus}, {}, {}]


@pytest.mark.parametrize(("table", "malus"), [(ONE, -1000.0), (TWO, -200.0)])
def test_contact_pays_when_it_begins(table: RewardTable, malus: float) -> None:
    rows = after(table, HERE, at(0.0, contact=True), at(0.0, contact=True), at(0.0), at(0.0, contact=True))
    assert rows == [{"crash": malus}, {}, {}, {"crash": malus}]


def test_leaving_the_map_or_tipping_over_is_the_terminal_failure_of_table_two() -> None:
    assert after(TWO, HERE, at(0.0, failure=True), at(0.0, failure=True)) == [{"failure": -1500.0}, {}]
    assert after(ONE, HERE, at(0.0, failure=True)) == [{}]  # table 1 has no such row


def test_less_than_half_a_metre_in_fifty_steps_is_no_progress() -> None:
    table = replace(TWO, step=0.0)
    creeping = [at(k / 10, pos_ne_m=(0.0099 * k, 0.0)) for k in range(51)]
    state = reward.start(creeping[0])
    for facts in creeping[1:-1]:
        state, rows = reward.step(state, facts, table)
        assert rows == {}
    state, rows = reward.step(state, creeping[-1], table)
    assert rows == {"no_progress": -500.0}
    assert reward.ends(state, table)
    assert not reward.ends(state, reward_table("trajectory2"))


def test_half_a_metre_in_fifty_steps_is_progress_and_so_is_landing() -> None:
    table = replace(TWO, step=0.0)
    moving = [at(k / 10, pos_ne_m=(0.0101 * k, 0.0)) for k in range(200)]
    assert total(table, *moving) == {}
    landing = [at(k / 10, mode="landing") for k in range(200)]
    assert total(table, *landing) == {}


def test_two_metres_into_the_zone_for_five_steps() -> None:
    rows = total(TWO, at(0.0, d_min_m=3.0), at(0.5, d_min_m=3.0))
    assert rows["proximity"] == pytest.approx(-1.2 * 2.0 * 5)
    assert "proximity" not in total(TWO, HERE, at(0.5, d_min_m=5.0))
    assert "proximity" not in total(ONE, HERE, at(0.5, d_min_m=0.1))


def test_a_departure_pays_once_until_the_line_is_found_again() -> None:
    rows = after(ONE, HERE, *(at(0.0, cross_track_m=x) for x in (1.9, 2.1, -2.5, 1.5, 2.2, 0.9, -2.1)))
    assert [row.get("departure", 0.0) for row in rows] == [0.0, -50.0, 0.0, 0.0, 0.0, 0.0, -50.0]
    assert after(ONE, HERE, at(0.0, cross_track_m=9.0, mode="landing")) == [{}]


def leg(distance_m: float, contact: bool = False) -> tuple[TickFacts, TickFacts]:
    """Into RL and out of it, this far from the goal."""
    there = at(0.0, goal_distance_m=distance_m, contact=contact)
    return replace(there, mode="rl"), there


def test_a_safe_bypass_pays_each_time_in_the_paper() -> None:
    rows = total(ONE, HERE, *leg(50.0), *leg(50.0), *leg(50.0))
    assert rows == {"bypass": 300.0}


def test_a_bypass_with_contact_is_not_safe() -> None:
    assert "bypass" not in total(ONE, HERE, *leg(40.0, contact=True))


def test_by_default_a_bypass_pays_for_two_metres_beyond_any_paid_before_and_twice_at_most() -> None:
    table = replace(reward_table("trajectory1"), progress=0.0)
    rows = after(table, HERE, *leg(48.1), *leg(47.9), *leg(46.0), *leg(49.0), *leg(45.9), *leg(10.0))
    assert [row.get("bypass", 0.0) for row in rows[1::2]] == [0.0, 100.0, 0.0, 0.0, 100.0, 0.0]


def test_hold_in_between_does_not_hide_a_bypass() -> None:
    into, out = leg(40.0)
    assert total(ONE, HERE, into, replace(into, mode="hold"), out)["bypass"] == 100.0


def test_landing_from_rl_is_no_bypass() -> None:
    into, out = leg(1.0)
    assert "bypass" not in total(ONE, HERE, into, replace(out, mode="landing"))


def test_the_safe_switch_of_table_two_is_one_shot() -> None:
    assert total(replace(TWO, progress=0.0), HERE, *leg(40.0), *leg(30.0)) == {"travel": 500.0}
    assert "travel" not in total(reward_table("trajectory2"), HERE, *leg(49.0))


def test_leaving_the_obstacle_zone_pays() -> None:
    table = replace(TWO, proximity=0.0)
    rows = after(table, HERE, *(at(0.0, d_min_m=d) for d in (5.1, 4.9, 5.0, 5.1, 6.0, 4.0, 7.0)))
    assert [row.get("zone_exit", 0.0) for row in rows] == [0.0, 0.0, 0.0, 50.0, 0.0, 0.0, 50.0]


def test_by_default_zones_pay_for_new_progress_and_three_times_at_most() -> None:
    table = replace(reward_table("trajectory2"), progress=0.0, proximity=0.0)
    moments = [at(0.0, d_min_m=d, goal_distance_m=far) for far in (49.0, 47.0, 46.0, 40.0, 30.0, 20.0) for d in (4, 6)]
    rows = after(table, HERE, *moments)
    assert [row.get("zone_exit", 0.0) for row in rows[1::2]] == [0.0, 50.0, 0.0, 50.0, 50.0, 0.0]


def test_a_novel_endpoint_pays_and_a_repeated_one_costs() -> None:
    ends = [(0.0, 0.0), (1.1, 0.0), (1.05, 0.9), (5.0, 0.0)]
    rows = after(TWO, HERE, *(at(0.0, endpoint_ne_m=place) for place in ends))
    assert rows == [
        {"endpoint_novel": 20.0},
        {"endpoint_novel": 20.0},
        {"endpoint_repeated": -10.0},
        {"endpoint_novel": 20.0},
    ]


def test_a_place_of_long_ago_is_neither_novel_nor_repeated() -> None:
    ends = [(0.0, 0.0), *((10.0 * k, 0.0) for k in range(1, 11)), (0.0, 0.5)]
    assert after(TWO, HERE, *(at(0.0, endpoint_ne_m=place) for place in ends))[-1] == {}


def test_by_default_novelty_pays_five_times_at_most() -> None:
    ends = [at(0.0, endpoint_ne_m=(10.0 * k, 0.0)) for k in range(20)]
    assert total(reward_table("trajectory2"), HERE, *ends) == {"endpoint_novel": 100.0}


def test_plain_counts_time_goal_and_failure_only() -> None:
    plain = reward_table("plain")
    busy = replace(at(1.0), mode="travel", goal_distance_m=1.0, d_min_m=1.0, endpoint_ne_m=(1.0, 1.0))
    assert total(plain, *leg(50.0), busy) == {"step": pytest.approx(-0.1), "goal": 5.0}
    assert total(plain, HERE, at(0.0, contact=True)) == {"crash": -5.0}


def test_a_flight_without_goal_cannot_earn_more_than_the_goal_pays_by_default() -> None:
    """The farmer of the printed tables: in and out of RL, zones and new endpoints, for a minute and a half."""
    moments = [HERE]
    for k in range(450):
        place = (10.0 * k, 0.0)
        near = at(0.2 * k, mode="rl", d_min_m=4.9, pos_ne_m=place, endpoint_ne_m=place)
        moments += [near, replace(near, t_s=0.2 * k + 0.1, mode="travel", d_min_m=5.1, endpoint_ne_m=None)]
    for name in ("trajectory1", "trajectory2"):
        printed, ours = reward_table(f"{name}_paper"), reward_table(name)
        assert sum(total(printed, *moments).values()) > printed.goal
        assert sum(total(ours, *moments).values()) < ours.goal / 10


@given(
    st.lists(
        st.builds(
            TickFacts,
            t_s=st.just(0.0),
            pos_ne_m=st.tuples(st.floats(-50, 50), st.floats(-50, 50)),
            goal_distance_m=st.floats(0, 100),
            d_min_m=st.one_of(st.just(math.inf), st.floats(0, 20)),
            mode=st.sampled_from(["travel", "rl", "landing", "hold"]),
            endpoint_ne_m=st.one_of(st.none(), st.tuples(st.floats(-50, 50), st.floats(-50, 50))),
            cross_track_m=st.one_of(st.none(), st.floats(-10, 10)),
            contact=st.booleans(),
            failure=st.booleans(),
        ),
        min_size=2,
        max_size=60,
    )
)
def test_default_bonuses_are_bounded_whatever_happens(moments: list[TickFacts]) -> None:
    moments = [replace(facts, t_s=0.04 * k) for k, facts in enumerate(moments)]
    for table in (reward_table("trajectory1"), reward_table("trajectory2")):
        sums = total(table, *moments)
        bonuses = sum(sums.get(row, 0.0) for row in ("bypass", "travel", "zone_exit", "endpoint_novel"))
        assert bonuses <= 750.0
        assert all(math.isfinite(value) for value in sums.values())


def test_a_step_changes_nothing_that_it_was_given() -> None:
    state = reward.start(HERE)
    before = replace(state)
    reward.step(state, at(1.0, contact=True, endpoint_ne_m=(1.0, 2.0)), TWO)
    assert isinstance(state, RewardState)
    assert state == before


def test_tables_are_chosen_by_name_and_variants_by_the_world() -> None:
    assert reward_table("paper", "trajectory1").name == "trajectory1_paper"
    assert reward_table("default", "trajectory1_movers").name == "trajectory1"
    assert reward_table("default", "forest_3").name == "trajectory2"
    papers = {"trajectory1_paper", "trajectory2_paper"}
    assert set(TABLES) == papers | {"trajectory1", "trajectory2", "plain", "way", "way_open"}
    with pytest.raises(InputError, match=r"unknown reward table 'papper'.*'paper'"):
        reward_table("papper")


def test_seconds_saved_of_the_way_that_is_left_are_paid() -> None:
    table = RewardTable("t", way=0.5)
    state = reward.start(replace(HERE, way_s=20.0))
    state, rows = reward.step(state, replace(HERE, t_s=1.0, way_s=17.0), table)
    assert rows == {"way": 1.5}
    assert reward.step(state, replace(HERE, t_s=2.0, way_s=18.0), table)[1] == {"way": -0.5}
