"""Figures of a soak from samples that were made up."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.soak import main
from mission.soak_figures import Memory, Traffic, family_of, summary

ATTITUDE = 30


@given(st.floats(0.0, 10.0), st.floats(50.0, 200.0))
def test_growth_counts_from_when_memory_had_settled(mb_per_hour: float, start_mb: float) -> None:
    samples = [(s, start_mb + (40.0 if s < 200.0 else 50.0) + mb_per_hour * s / 3600.0) for s in range(0, 3600, 3)]
    growth_mb = Memory("vehicle", [(float(s), mb) for s, mb in samples]).growth_mb()
    assert growth_mb == pytest.approx(mb_per_hour * 0.9 * 3300.0 / 3600.0, rel=0.02, abs=0.01)


def test_a_life_of_one_sample_tells_no_growth() -> None:
    assert Memory("vehicle", [(0.0, 1.0)]).growth_mb() is None


def test_a_vehicle_that_falls_behind_and_a_rate_that_sinks_are_seen() -> None:
    fine = Traffic("1", [(0.0, 5.0), (40.0, 45.0)], [(10.0, Counter({ATTITUDE: 1000}))] * 4)
    slow = Traffic("2", [(0.0, 5.0), (40.0, 41.0)], [(10.0, Counter({ATTITUDE: n})) for n in (1000, 1000, 800, 800)])
    figures = summary([], [fine, slow], {ATTITUDE: 100.0})
    assert figures["realtime_factor"] == pytest.approx(0.9)
    assert figures["rate_error_max"] == pytest.approx(0.1)
    assert figures["rate_drift_max"] == pytest.approx(0.2, abs=0.001)


def test_a_message_that_fell_into_the_next_window_is_no_drift() -> None:
    cut = Traffic("1", [(0.0, 5.0), (40.0, 45.0)], [(10.0, Counter({ATTITUDE: n})) for n in (10, 10, 11, 10)])
    assert summary([], [cut], {ATTITUDE: 1.0})["rate_drift_max"] == pytest.approx(0.0, abs=1e-9)


def test_children_of_children_belong_to_the_family_and_strangers_do_not() -> None:
    told = "  1 0 100 init\n 10 1 1000 soak run\n 11 10 2000 hub\n 12 11 4000 vehicle a b\n 20 1 9 other\n"
    family = family_of(told, 10)
    assert [command for _, command in family.values()] == ["soak run", "hub", "vehicle a b"]
    assert family[12][0] == pytest.approx(4.096)


def test_a_speed_of_nothing_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--speed", "0"])
    assert ended.value.code == 2
    assert "above 0" in capsys.readouterr().err
