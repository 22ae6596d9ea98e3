"""The judge believes the truth alone; the shortest way; the flight folder."""

import hashlib
import json
import math
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mission.errors import InputError
from mission.flight_folder import make_folder, write_inputs, write_result
from mission.flight_plan import FlightPlan, plan_flight
from mission.judge import Result, judge
from mission.mission_file import load_mission
from mission.shortest_path import shortest_path_m
from mission.world_file import load_world, world_hash
from sitl.world import World

HZ = 25
GOAL_M = 40.0


def open_plan(folder: Path, seed: int = 3) -> FlightPlan:
    path = folder / "straight.yaml"
    path.write_text("world: open\nsuccess: {time_limit_s: 30, time_ratio: 2.0}\nspawn_jitter_m: 0.0\n")
    return plan_flight(str(path), seed)


def truth_rows(speed_m_s: float = 2.0, end_m: float = GOAL_M) -> list[dict[str, Any]]:
    """Two seconds on the ground, straight to ``end_m``, three seconds landing there, disarmed."""
    rows = [row(0.0, -i / HZ, "HOLD", False, "ON_GROUND") for i in range(2 * HZ)]
    count = round(end_m / speed_m_s * HZ)
    rows += [row(end_m * i / count, 0.0, "OFFBOARD", True, "IN_AIR") for i in range(count + 1)]
    rows += [row(end_m, 0.0, "OFFBOARD", True, "IN_AIR") for _ in range(3 * HZ)]
    rows += [row(end_m, 0.0, "OFFBOARD", i < HZ, "ON_GROUND") for i in range(HZ + 1)]
    return [{**r, "t_s": i / HZ} for i, r in enumerate(rows)]


def row(north_m: float, down_m: float, mode: str, armed: bool, landed: str) -> dict[str, Any]:
    return {
        "t_s": 0.0,
        "pos_world_ned_m": [north_m, 0.0, down_m],
        "vel_ned_m_s": [0.0, 0.0, 0.0],
        "clearance_m": None,
        "contact": False,
        "mode": mode,
        "armed": armed,
        "landed": landed,
    }


def verdict(folder: Path, rows: list[dict[str, Any]], trouble: str | None = None) -> Result:
    (folder / "truth.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    return judge(open_plan(folder), folder, trouble)


def test_a_straight_flight_that_lands_on_the_goal_is_a_success(tmp_path: Path) -> None:
    result = verdict(tmp_path, truth_rows())
    assert result.success
    assert result.reason == "landed 0.00 m from the goal"
    assert result.time_s == pytest.approx(23.0, abs=0.1)  # 40 m at 2 m/s and 3 s of landing
    assert result.path_m == pytest.approx(40.0)
    assert result.path_ratio == pytest.approx(1.0, abs=1e-6)
    assert (result.collisions, result.landed, result.min_clearance_m) == (0, True, None)
    assert result.truth_sha256 == hashlib.sha256((tmp_path / "truth.jsonl").read_bytes()).hexdigest()


def test_a_contact_fails_the_flight_whatever_else_it_did(tmp_path: Path) -> None:
    rows = truth_rows()
    for i in (200, 201, 300):
        rows[i]["clearance_m"] = -0.01
    result = verdict(tmp_path, rows, trouble="time limit of 30 s reached")
    assert not result.success
    assert result.reason == "contact with an obstacle at 8.00 s"
    assert result.collisions == 2
    assert result.min_clearance_m == -0.01


def test_the_trouble_of_the_operator_is_the_reason_when_there_was_no_contact(tmp_path: Path) -> None:
    result = verdict(tmp_path, truth_rows()[:400], trouble="the vehicle was lost in flight")
    assert (result.success, result.landed, result.landing_error_m) == (False, False, None)
    assert result.reason == "the vehicle was lost in flight"


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        (truth_rows(end_m=39.2), "landed 0.80 m from the goal, allowed are 0.5 m"),
        (truth_rows(speed_m_s=1.5), "took 29.7 s, allowed are 26.7 s"),  # twice 40 m at 3 m/s
        (truth_rows()[:-1], "not landed and disarmed"),
        (truth_rows()[:400], "not landed and disarmed"),
        (truth_rows()[:30], "not landed and disarmed"),
        ([], "not landed and disarmed"),
    ],
)
def test_what_is_missing_for_success_is_named(tmp_path: Path, rows: list[dict[str, Any]], reason: str) -> None:
    result = verdict(tmp_path, rows)
    assert not result.success
    assert result.reason == reason


def test_a_line_cut_off_by_a_kill_is_left_out(tmp_path: Path) -> None:
    text = "".join(json.dumps(r) + "\n" for r in truth_rows()[:400]) + '{"t_s": 16.0, "pos_wor'
    (tmp_path / "truth.jsonl").write_text(text)
    assert judge(open_plan(tmp_path), tmp_path, None).path_m > 0.0


def test_a_bounce_does_not_end_the_flight(tmp_path: Path) -> None:
    rows = truth_rows()
    rows[300]["landed"] = "ON_GROUND"
    assert verdict(tmp_path, rows).path_m == pytest.approx(40.0)


def single_obstacle(radius_m: float) -> World:
    circles = np.array([[25.0, 0.0, radius_m, np.inf]])
    return World("one", np.zeros(2), np.array([50.0, 0.0]), (-5.0, -20.0, 55.0, 20.0), circles, np.empty((0, 6)))


@pytest.mark.parametrize("radius_m", [0.5, 3.25, 7.0])
def test_the_shortest_way_round_a_disc_is_two_tangents_and_an_arc(radius_m: float) -> None:
    world, reach_m = single_obstacle(radius_m), radius_m + 0.33
    arc_rad = math.pi - 2 * math.acos(reach_m / 25.0)
    exact_m = 2 * math.sqrt(25.0**2 - reach_m**2) + reach_m * arc_rad
    found_m = shortest_path_m(world, world.start_ned_m, world.goal_ned_m, 0.33)
    assert found_m == pytest.approx(exact_m, rel=1e-3)


def test_no_way_is_infinitely_long() -> None:
    world = single_obstacle(3.0)
    wall = np.array([[25.0, 0.0, 0.0, 0.1, 30.0, np.inf]])
    closed = World("shut", world.start_ned_m, world.goal_ned_m, world.bounds_m, world.circles, wall)
    assert shortest_path_m(closed, closed.start_ned_m, closed.goal_ned_m, 0.33) == math.inf


def test_a_flight_folder_holds_what_is_needed_to_fly_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    plan = plan_flight("trajectory1_movers", seed=5)
    now = datetime(2027, 1, 2, 3, 4, 5, tzinfo=UTC)
    folder = make_folder(plan, None, now)
    assert folder == Path("flights/20270102T030405Z_trajectory1_movers_s5")
    assert make_folder(plan, None, now).name == "20270102T030405Z_trajectory1_movers_s5_2"
    write_inputs(plan, folder, {"speed": "max"})
    assert load_mission(str(folder / "mission.yaml")) == plan.mission
    assert world_hash(load_world(folder / "world.yaml")) == world_hash(plan.world)
    versions = json.loads((folder / "versions.json").read_text())
    assert versions["spawn_ned_m"] == list(plan.draws.spawn_ned_m)


def test_result_json_holds_the_fields_that_fly_prints(tmp_path: Path) -> None:
    result = verdict(tmp_path, truth_rows())
    write_result(result, tmp_path)
    assert list(json.loads((tmp_path / "result.json").read_text())) == [
        *("record_sha256", "truth_sha256", "success", "reason", "time_s", "path_m", "path_ratio", "min_clearance_m"),
        *("collisions", "switches", "switches_bound", "landed", "landing_error_m", "rl_decisions", "tick_p50_ms"),
        *("tick_p99_ms", "realtime_factor", "log_dir", "seed", "world", "policy", "policy_sha256"),
    ]


def test_a_flight_folder_is_never_mixed_with_something_else(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        make_folder(open_plan(tmp_path), tmp_path)
    with pytest.raises(InputError, match="cannot be written"):
        make_folder(open_plan(tmp_path), tmp_path / "notes.txt" / "flight")
