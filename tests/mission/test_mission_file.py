"""Mission files, QGroundControl plans, and the draws of a seed."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.params import ParamError
from mission.errors import InputError
from mission.flight_plan import plan_flight
from mission.mission_file import list_missions, load_mission
from mission.plan_file import flat_earth_ned_m, read_plan

GOOD = """\
name: mine
world: open
goal: [30, 5]
cruise_m_s: 2.5
wind: {mean_m_s: [0.0, 2.0], turbulence: none}
success: {time_limit_s: 40}
"""
ZURICH_DEG = (47.397742, 8.545594)


def written(folder: Path, text: str, name: str = "mine.yaml") -> str:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", list_missions())
def test_every_mission_that_ships_can_be_planned(name: str) -> None:
    plan = plan_flight(name, seed=1)
    assert math.dist(plan.world.start_ned_m, plan.world.goal_ned_m) >= 50.0
    assert plan.task.cruise_m_s >= 3.0


def test_a_yaml_file_is_read_as_written(tmp_path: Path) -> None:
    mission = load_mission(written(tmp_path, GOOD))
    assert (mission.name, mission.goal, mission.cruise_m_s) == ("mine", (30.0, 5.0), 2.5)
    assert mission.wind.turbulence == "none"
    assert mission.success.landing_error_m == 0.5


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("cruise_m_s", "cruse_m_s", "unknown key 'cruse_m_s'; did you mean 'cruise_m_s'?"),
        ("turbulence", "turbulance", "did you mean 'turbulence'?"),
        ("time_limit_s", "tim_limit_s", "did you mean 'time_limit_s'?"),
        ("2.5", ".nan", "'cruise_m_s' = nan"),
        ("2.5", "-1", "greater than or equal to 0.3"),
        ("2.5", "'2.5'", "valid number"),
        ("[30, 5]", "[30]", "'goal.1'"),
        ("world: open", "text: nowhere", "either 'world' or 'forest'"),
        ("[30, 5]", "[30, .inf]", "finite"),
        ("[0.0, 2.0]", "[3.0, 2.0]", "low <= high"),
        ("{time_limit_s: 40}", "{}", "key 'success.time_limit_s' is missing"),
        ("{mean_m_s", "{mean_m_s: [", "line"),
        ("name: mine", "policy: geometrc", "did you mean 'geometric'?"),
    ],
)
def test_a_wrong_mission_is_refused_in_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new))
    with pytest.raises(InputError) as refused:
        load_mission(path)
    text = str(refused.value)
    assert text.startswith(path)
    assert expected in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("trajectry2", "did you mean 'trajectory2'?"),
        ("nowhere.yaml", "does not exist"),
        ("nowhere.plan", "does not exist"),
    ],
)
def test_an_unknown_mission_is_refused_with_the_nearest_name(name: str, expected: str) -> None:
    with pytest.raises(InputError, match=r"mission") as refused:
        load_mission(name)
    assert expected in str(refused.value)


def test_a_world_file_is_found_beside_its_mission(tmp_path: Path) -> None:
    written(tmp_path, "goal: [9, 0]\nbounds: {north: [-5, 20], east: [-5, 5]}\n", "yard.yaml")
    mission = load_mission(written(tmp_path, GOOD.replace("open", "yard.yaml").replace("[30, 5]", "[9, 1]")))
    assert Path(mission.world) == tmp_path / "yard.yaml"
    assert plan_flight(str(tmp_path / "mine.yaml"), seed=0).world.goal_ned_m.tolist() == [9.0, 1.0]


def test_parameters_of_a_mission_reach_the_plan_and_overrides_win(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD + "params: {arbiter: {dwell_s: 2.0}, vehicle: {radius_m: 0.4}}\n")
    plan = plan_flight(path, seed=0, overrides={"arbiter": {"dwell_s": 3.0}})
    assert (plan.params.arbiter.dwell_s, plan.params.vehicle.radius_m) == (3.0, 0.4)
    with pytest.raises(ParamError, match=r"did you mean 'dwell_s'"):
        plan_flight(path, seed=0, overrides={"arbiter": {"dwel_s": 3.0}})


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_draws_are_repeatable_and_inside_what_the_mission_allows(seed: int) -> None:
    first, again = plan_flight("trajectory2", seed), plan_flight("trajectory2", seed)
    assert first.draws == again.draws
    assert math.dist(first.draws.spawn_ned_m, first.world.start_ned_m) <= 2.0
    assert 1.0 <= math.hypot(*first.draws.wind_ned_m_s) <= 5.0
    assert -math.pi <= first.draws.yaw_rad <= math.pi
    goal_ned_m = first.task.goal_ned_m + np.array(first.draws.spawn_ned_m)
    assert np.allclose(goal_ned_m, first.world.goal_ned_m, atol=1e-6)


def test_seeds_differ() -> None:
    draws = [plan_flight("trajectory1_movers", seed).draws for seed in range(20)]
    assert len({d.spawn_ned_m for d in draws}) == len({d.sim_seed for d in draws}) == 20


def plan_text(items: list[dict[str, object]], home: object = (*ZURICH_DEG, 488.0), speed: object = 4.0) -> str:
    mission = {"plannedHomePosition": home, "hoverSpeed": speed, "items": items}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission})


def waypoint(lat_deg: float, lon_deg: float, alt_m: float, command: int = 16, frame: int = 3) -> dict[str, object]:
    return {
        "type": "SimpleItem",
        "command": command,
        "frame": frame,
        "params": [0, 0, 0, None, lat_deg, lon_deg, alt_m],
    }


def test_the_last_waypoint_of_a_plan_is_the_goal(tmp_path: Path) -> None:
    takeoff = waypoint(*ZURICH_DEG, 5.0, command=22)
    first = waypoint(ZURICH_DEG[0] + 1e-4, ZURICH_DEG[1], 6.0)
    last = waypoint(ZURICH_DEG[0] + 3e-4, ZURICH_DEG[1] - 2e-4, 7.0)
    path = written(tmp_path, plan_text([takeoff, first, last]), "field trip.plan")
    mission = load_mission(path)
    assert mission.name == "field_trip"
    assert mission.goal == pytest.approx((33.36, -15.10), abs=0.02)  # geodesic (Karney) 33.355 m, 15.098 m
    assert (mission.down_m, mission.cruise_m_s) == (-7.0, 4.0)
    assert plan_flight(path, seed=0).task.goal_ned_m.shape == (2,)


def test_an_altitude_above_sea_level_is_taken_from_home(tmp_path: Path) -> None:
    path = written(tmp_path, plan_text([waypoint(*ZURICH_DEG, 500.0, frame=0)]), "a.plan")
    assert read_plan(Path(path)).down_m == -12.0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{", "not JSON"),
        ("[]", "not a QGroundControl plan"),
        (plan_text([]), "no waypoint"),
        (plan_text([waypoint(math.nan, 8.0, 5.0)]), "finite"),
        (plan_text([waypoint(*ZURICH_DEG, 5.0)], home=None), "plannedHomePosition"),
        (plan_text([waypoint(*ZURICH_DEG, 5.0)], speed=0), "hoverSpeed"),
        (plan_text([waypoint(*ZURICH_DEG, 5.0)], speed=99), "cruise_m_s"),
        (plan_text([waypoint(0.0, 0.0, 5.0)]), "goal"),
    ],
)
def test_a_wrong_plan_is_refused_in_one_line(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(InputError) as refused:
        plan_flight(written(tmp_path, text, "a.plan"), seed=0)
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


@given(
    lat_deg=st.floats(-60.0, 60.0),
    lon_deg=st.floats(-180.0, 180.0),
    north_m=st.floats(-500.0, 500.0),
    east_m=st.floats(-500.0, 500.0),
)
def test_flat_earth_agrees_with_earth_centred_coordinates(
    lat_deg: float, lon_deg: float, north_m: float, east_m: float
) -> None:
    """Against the exact ECEF -> local tangent plane transformation, an independent formula."""
    lat2_deg = lat_deg + math.degrees(north_m / 6.37e6)
    lon2_deg = lon_deg + math.degrees(east_m / (6.37e6 * math.cos(math.radians(lat_deg))))
    flat = flat_earth_ned_m((lat_deg, lon_deg), 0.0, (lat2_deg, lon2_deg))
    delta = ecef(lat2_deg, lon2_deg) - ecef(lat_deg, lon_deg)
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    north = np.array([-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    assert flat == pytest.approx((delta @ north, delta @ east), abs=0.1)


def ecef(lat_deg: float, lon_deg: float) -> np.ndarray:
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    n_m = 6378137.0 / math.sqrt(1 - 6.69437999014e-3 * math.sin(lat) ** 2)
    horizontal_m = n_m * math.cos(lat)
    return np.array(
        [horizontal_m * math.cos(lon), horizontal_m * math.sin(lon), n_m * (1 - 6.69437999014e-3) * math.sin(lat)]
    )
