"""What must hold over many seeds? The slow tests fly whole tables, as ``python -m mission.tables`` does."""

import dataclasses
import json
from pathlib import Path

import pytest
from rich.console import Console
from typer import Typer
from typer.testing import CliRunner

from companion.app.logs import RECORDS
from mission import tables
from mission.errors import InputError
from mission.flight_plan import plan_flight
from mission.judge import Result
from mission.tables import chosen_seeds, fly_and_judge, fly_rows, print_table, summary, table_named

JOBS = 2
FINE = Result(
    record_sha256="", truth_sha256="", success=True, reason="landed 0.10 m from the goal", time_s=30.0, path_m=55.0,
    path_ratio=1.02, min_clearance_m=0.5, collisions=0, switches=3, switches_bound=32, landed=True,
    landing_error_m=0.1, rl_decisions=50, tick_p50_ms=None, tick_p99_ms=None, realtime_factor=None, log_dir="", seed=0,
    world="trajectory1", policy="geometric",
)  # fmt: skip


def seeds(count: int, *changed: Result) -> list[Result]:
    results = [dataclasses.replace(FINE, seed=seed) for seed in range(count)]
    return [*changed, *results[len(changed) :]]


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", tables.tables())
def test_the_table_holds_what_is_asked_for(name: str) -> None:
    asked = table_named(name)
    figures = summary(name, list(fly_rows(asked.mission, asked.seeds, JOBS)))
    print_table(figures, Console())
    print(json.dumps(figures))
    assert figures["missed"] == []


def test_the_tables_ask_for_what_the_first_flight_promises() -> None:
    asked = {name: table_named(name) for name in tables.tables()}
    assert {name: len(table.seeds) for name, table in asked.items()} == {
        "trajectory1": 50,
        "trajectory2": 50,
        "trajectory1_movers": 50,
        "forest100": 100,
    }
    assert [table.success_share * len(table.seeds) for table in asked.values()] == [50, 50, 48, 98]
    assert [table.median_switches for table in asked.values()] == [6, 15, None, None]
    for name in ("trajectory1", "trajectory2"):
        success = plan_flight(name, 0).mission.success
        assert (success.time_ratio, success.landing_error_m) == (2.0, 0.5)
        assert plan_flight(name, 0).mission.cruise_m_s >= 3.0


def test_a_table_without_failures_misses_nothing() -> None:
    assert summary("trajectory1", seeds(50))["missed"] == []


@pytest.mark.parametrize(
    ("name", "changed", "missed"),
    [
        ("trajectory1", {"success": False}, "49 of 50 succeeded, asked for are 50"),
        ("trajectory1", {"collisions": 1}, "1 with contact, allowed are 0"),
        ("trajectory1_movers", {"switches": 33}, "1 above their switch bound"),
    ],
)
def test_one_bad_flight_is_named(name: str, changed: dict[str, object], missed: str) -> None:
    bad = dataclasses.replace(FINE, reason="because", **changed)  # type: ignore[arg-type]
    figures = summary(name, seeds(50, bad))
    assert figures["missed"] == [missed]
    expected = [] if bad.success else [{"seed": 0, "world": "trajectory1", "reason": "because"}]
    assert figures["failures"] == expected


def test_two_failures_of_fifty_are_allowed_among_movers_and_three_are_not() -> None:
    bad = dataclasses.replace(FINE, success=False)
    assert summary("trajectory1_movers", seeds(50, bad, bad))["missed"] == []
    assert summary("trajectory1_movers", seeds(50, bad, bad, bad))["missed"] != []


def test_too_many_switches_on_the_median_are_named() -> None:
    many = [dataclasses.replace(FINE, switches=7)] * 26
    assert summary("trajectory1", seeds(50, *many))["missed"] == ["median of 7.0 switches, allowed are 6"]


def test_seeds_are_a_half_open_range_out_of_the_table() -> None:
    assert list(chosen_seeds("3:5", table_named("trajectory1"))) == [3, 4]
    assert chosen_seeds(None, table_named("forest100"))[0] == 1000
    for text in ("5:3", "0:51", "7", "a:b", "-1:3", ":"):
        with pytest.raises(InputError, match="wants FIRST:END within 0:50"):
            chosen_seeds(text, table_named("trajectory1"))


def test_a_row_is_judged_from_logs_as_a_flight_over_mavlink_leaves_them(tmp_path: Path) -> None:
    plan = plan_flight("trajectory1", 5)
    success = plan.mission.success.model_copy(update={"time_limit_s": 2.0})
    hurried = dataclasses.replace(plan, mission=plan.mission.model_copy(update={"success": success}))
    result = fly_and_judge(hurried, tmp_path)
    assert (result.success, result.reason) == (False, "time limit of 2 s reached")
    assert result.time_s == pytest.approx(2.0, abs=0.1)
    rows = [json.loads(line) for line in (tmp_path / RECORDS).read_text().splitlines()]
    assert rows[-1]["mode"] == "travel"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["trajectory3"], "tables: unknown table 'trajectory3'; did you mean 'trajectory2'?"),
        (["forest100", "--seeds", "0:5"], "tables: --seeds '0:5' wants FIRST:END within 1000:1100, END excluded"),
    ],
)
def test_a_wrong_table_or_range_is_one_line(arguments: list[str], line: str) -> None:
    app = Typer()
    app.command()(tables.main)
    done = CliRunner().invoke(app, arguments)
    assert (done.exit_code, done.stderr.strip()) == (2, line)
