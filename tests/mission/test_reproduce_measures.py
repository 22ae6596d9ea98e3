"""A seed's rows become the figures that the claims are judged by."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reproduce_kit import GOAL_NE_M, SWIFT, write_arm

from mission.reproduce.arms import load_table
from mission.reproduce.greedy import gained_m, turning_deg_per_m
from mission.reproduce.measures import SeedRows, figures_of, interval_of, over_seeds, read_seed, smooth
from mission.reproduce.plots import band
from mission.reproduce.run import arm_folder
from mission.training.until import Until

GOAL = np.array(GOAL_NE_M)


def _row(episode: int, steps: int = 100, success: bool = True, **others: Any) -> dict[str, Any]:
    row = {"episode": episode, "success": success, "contact": False, "steps": steps, "ticks": 10, "time_s": 10.0}
    row |= {"path_m": 60.0, "path_ratio": 1.2 if success else None, "return": -float(steps), "switches": 3}
    return row | {"switches_bound": 5, "hasty_switches": 0, "rl_time_s": 5.0} | others


def _seed(rows: list[dict[str, Any]]) -> SeedRows:
    tracks = {row["episode"]: np.array([[0.0, 0.0], [50.0, 0.0]]) for row in rows}
    return SeedRows(1, rows, tracks, [], [], None, {}, None)


def test_a_curve_is_told_by_its_first_and_last_fifteen_episodes() -> None:
    rows = [_row(k, steps=200 if k <= 15 else 100) for k in range(1, 101)]
    figures = figures_of(_seed(rows), Until(100, 300), GOAL)
    assert (figures["steps_first"], figures["steps_last"]) == (200.0, 100.0)
    assert (figures["return_first"], figures["return_last"]) == (-200.0, -100.0)
    assert figures["steps_highest"] == 200.0
    assert figures["steps_tail_width"] == 0.0  # level from episode 30 on
    assert figures["steps_sd_last"] == 0.0
    assert figures["reached"] == 1.0
    assert figures["detour_first"] == pytest.approx(60.0 / 50.0)
    assert figures["rl_share"] == 0.5


def test_a_few_episodes_tell_no_trend_but_their_counts() -> None:
    rows = [_row(k, success=k == 1, switches=6) for k in range(1, 4)]
    figures = figures_of(_seed(rows), Until(100, 300), GOAL)
    assert figures["steps_first"] is None
    assert figures["detour_last"] is None
    assert (figures["episodes"], figures["successes"], figures["reached"]) == (3.0, 1.0, 0.0)
    assert figures["above_bound"] == 3.0
    assert figures["path_ratio_last50"] == 1.2


def test_nothing_flown_is_nothing_told() -> None:
    figures = figures_of(_seed([]), Until(), None)
    assert set(figures) == set(SWIFT), "the figures that the claims are tested with"
    assert figures["success_last50"] is None


def test_greedy_flights_count_paths_of_successes_only(tmp_path: Path) -> None:
    table = load_table()
    write_arm(tmp_path, table, "t1", 1, 40)
    rows = read_seed(arm_folder(tmp_path, table.arm("t1")), 1)
    assert rows.done
    flights = [_row(1) | {"gained_m": 50.0, "turning_deg_per_m": 2.0}, _row(2, success=False) | {"gained_m": 0.0}]
    flights[1]["turning_deg_per_m"] = None
    figures = figures_of(SeedRows(1, rows.episodes, rows.tracks, [], flights, 3.0, {}, {"seconds": {}}), Until(), GOAL)
    assert figures["greedy_success"] == 0.5
    assert figures["greedy_path_ratio"] == 1.2
    assert figures["greedy_detour"] == pytest.approx((1.2 + 60.0) / 2)  # gaining nothing counts as a metre
    assert figures["greedy_turning"] == 2.0


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=10))
def test_the_interval_holds_the_mean_and_shrinks_with_agreement(values: list[float]) -> None:
    interval = over_seeds(values)
    assert interval is not None
    assert interval.low is not None
    assert interval.high is not None
    assert interval.low - 1e-9 <= np.mean(values) <= interval.high + 1e-9
    doubled = over_seeds(values * 2)
    assert doubled is not None
    assert doubled.high is not None
    assert doubled.high <= interval.high + 1e-6


def test_what_no_seed_knows_has_no_interval() -> None:
    assert over_seeds([None, None]) is None
    one = over_seeds([None, 2.0])
    assert one is not None
    assert (one.mean, one.low, one.seeds) == (2.0, None, 1)


def test_shares_and_counts_stay_where_they_can_be() -> None:
    seeds = [{"contact": share, "successes": count, "return_late": -count} for share, count in ((0.0, 0.0), (0.9, 1.0))]
    share, count, total = (interval_of(seeds, name) for name in ("contact", "successes", "return_late"))
    assert share is not None and count is not None and total is not None
    assert (share.low, share.high) == (0.0, 1.0)
    assert count.low == 0.0 and count.high is not None and count.high > 1.0
    assert total.low is not None and total.low < -1.0


def test_the_smooth_curve_has_whole_windows_only() -> None:
    assert smooth([1.0] * 14).size == 0
    assert smooth([float(k) for k in range(16)]).tolist() == [7.0, 8.0]


def test_a_band_ends_where_fewer_than_half_of_the_seeds_go_on() -> None:
    seeds = [_seed([_row(k) for k in range(1, count + 1)]) for count in (10, 20, 30)]
    assert band(seeds, "steps").episode[-1] == 20
    assert band(seeds[:1], "steps").episode[-1] == 10
    assert band([], "steps").episode.size == 0


def test_a_track_tells_what_was_gained_and_how_much_it_turned() -> None:
    straight = np.array([[float(k), 0.0] for k in range(11)])
    assert gained_m(straight, GOAL) == pytest.approx(10.0)
    assert turning_deg_per_m(straight) == 0.0
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    assert turning_deg_per_m(corner) == pytest.approx(45.0)
    assert turning_deg_per_m(np.zeros((5, 2))) is None
