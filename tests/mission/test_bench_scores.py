import pytest
from bench_rows import row
from hypothesis import given
from hypothesis import strategies as st

from mission.bench.rows import barn_log
from mission.bench.scores import CLIP_025, CLIP_05, barn_score, read_log, summary
from mission.bench.theory import LATENCY_S, evasion_speed, stop_distance_speed
from mission.errors import InputError


@pytest.mark.parametrize(
    ("time_s", "metric"),
    # world 0 of the published MPPI log: its reference path is 13.597 m, 6.7986 s at 2 m/s
    [(90.9927, 0.1250), (49.1582, 0.1383), (46.9430, 0.1448)],
)
def test_published_scores_come_out_again(time_s, metric):
    assert barn_score(True, time_s, 2.0 * 6.7986, CLIP_05) == pytest.approx(metric, abs=1e-4)


def test_the_best_score_is_reached_at_two_or_four_optimal_times():
    assert barn_score(True, 12.0, 12.0, CLIP_05) == 0.5
    assert barn_score(True, 7.0, 12.0, CLIP_05) == 0.5
    assert barn_score(True, 24.0, 12.0, CLIP_025) == 0.25
    assert barn_score(True, 12.0, 12.0, CLIP_025) == 0.25
    assert barn_score(True, 24.0, 12.0, CLIP_05) == 0.25
    assert barn_score(False, 7.0, 12.0, CLIP_05) == 0.0


@given(time_s=st.floats(0.1, 1e4), reference_m=st.floats(5.0, 30.0))
def test_a_score_lies_between_an_eighth_and_its_best(time_s, reference_m):
    assert 0.125 - 1e-9 <= barn_score(True, time_s, reference_m, CLIP_05) <= 0.5 + 1e-9
    assert 0.125 - 1e-9 <= barn_score(True, time_s, reference_m, CLIP_025) <= 0.25 + 1e-9


def test_scores_are_means_over_the_runs_of_a_world_and_then_over_the_worlds():
    rows = [row(0, "barn_1"), row(1, "barn_1"), row(2, "barn_2", success=False)]
    assert summary(rows)["score_05"] == pytest.approx(0.25)
    assert summary(rows)["success"] == pytest.approx(2 / 3)


def test_a_summary_says_everything_that_is_asked_for():
    figures = summary([row(0), row(1, success=False)])
    asked = ("runs", "success", "collision", "timeout", "spl", "mean_time_s", "score_05", "score_025")
    assert all(name in figures for name in asked)
    assert figures["spl"] == pytest.approx(0.5 * 9.0 / 12.0)
    assert figures["mean_time_s"] == 10.0  # of the successful run
    assert figures["decision_p50_ms"] == 2.0
    assert figures["success_ci95"][0] < 0.5 < figures["success_ci95"][1]


def test_without_a_reference_path_there_is_no_score():
    assert summary([row(reference_m=None)])["score_05"] is None


def test_the_log_has_the_six_columns_of_the_published_ones(tmp_path):
    path = tmp_path / "barn.log"
    path.write_text(barn_log([row(), row(1, success=False)], lambda r: 0.5 * r.success), encoding="utf-8")
    assert path.read_text(encoding="utf-8").splitlines() == ["1 1 0 0 10.0000 0.5000", "1 0 1 0 10.0000 0.0000"]
    first, second = read_log(path)
    assert (first.world, first.success, first.time_s) == (1, True, 10.0)
    assert second.collision


def test_a_log_that_is_none_names_its_line(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("0 1 0 0 7.1 0.5\n0 1 zero\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"log\.txt, line 2"):
        read_log(path)


def test_the_ceilings_are_where_a_prototype_met_them():
    assert 7.1 <= evasion_speed(6.0, 0.75, 0.2, LATENCY_S) <= 7.9  # pole
    assert 8.6 <= evasion_speed(6.0, 0.3, 0.2, LATENCY_S) <= 9.7  # trunk
    assert stop_distance_speed(6.0, 0.2, 0.15, 6.0, 0.45) == pytest.approx(6.0, abs=0.1)
