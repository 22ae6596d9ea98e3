"""Does a world file describe what it says, survive the way through a file, and get refused when it cannot be flown?"""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mission.world_check import WorldError, check_world, clearance_m, widest_way_m
from mission.world_file import list_worlds, load_world, world_from_data, world_hash, world_yaml
from sitl.collision import CollisionChecker
from sitl.world import World

YARD = {
    "name": "yard",
    "goal": [20.0, 0.0],
    "bounds": {"north": [-5.0, 25.0], "east": [-5.0, 5.0]},
    "cylinders": [{"at": [10.0, 0.0], "radius_m": 0.5}],
}
DOOR = ([[12.0, -5.5], [12.0, -0.3]], [[12.0, 0.3], [12.0, 5.5]])  # 0.6 m wide


def yard(**changes: object) -> World:
    return world_from_data({**YARD, **changes}, "world yard")


def refusal(world: World) -> str:
    with pytest.raises(WorldError) as error:
        check_world(world)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_every_kind_of_obstacle_stands_where_the_file_says() -> None:
    world = yard(
        boxes=[{"at": [3.0, 3.0], "size_m": [2.0, 1.0], "yaw_deg": 90.0, "height_m": 2}],
        walls=[{"between": [[0.0, -4.0], [4.0, -4.0]], "thickness_m": 0.2}],
        arcs=[{"centre": [15.0, 0.0], "radius_m": 3.0, "from_deg": -60.0, "to_deg": 60.0}],
        movers=[{"between": [[6.0, -3.0], [6.0, 3.0]], "radius_m": 0.4, "speed_max_m_s": 1.5}],
    )
    assert world.circles.tolist() == [[10.0, 0.0, 0.5, math.inf]]
    assert world.boxes[0] == pytest.approx([3.0, 3.0, math.pi / 2, 1.0, 0.5, 2.0])
    assert world.boxes[1] == pytest.approx([2.0, -4.0, 0.0, 2.0, 0.1, math.inf])
    assert np.hypot(world.boxes[2:, 0] - 15.0, world.boxes[2:, 1]) == pytest.approx(3.0)
    assert world.movers[0].position_ned_m(1.0) == pytest.approx((6.0, -1.5))


def test_start_is_the_origin_unless_the_file_says_otherwise() -> None:
    assert yard().start_ned_m.tolist() == [0.0, 0.0]
    assert yard(start=[1.0, -2.0]).start_ned_m.tolist() == [1.0, -2.0]


@pytest.mark.parametrize("name", list_worlds())
def test_a_written_world_loads_to_the_same_world(name: str, tmp_path: Path) -> None:
    world = load_world(name).seeded(5)
    path = tmp_path / "copy.yaml"
    path.write_text(world_yaml(world), encoding="utf-8")
    assert world_hash(load_world(path)) == world_hash(world)
    assert load_world(path).name == name


@given(column=st.integers(0, 3), row=st.integers(0, 2))
def test_the_hash_notices_a_millimetre(column: int, row: int) -> None:
    world = load_world("trajectory1")
    circles = world.circles.copy()
    circles[row, column] = 5.0 if column == 3 else circles[row, column] + 0.001
    assert world_hash(dataclasses.replace(world, circles=circles)) != world_hash(world)


def test_the_hash_does_not_notice_the_name() -> None:
    world = load_world("trajectory1")
    assert world_hash(dataclasses.replace(world, name="other")) == world_hash(world)


def test_an_unknown_name_gets_the_nearest_one() -> None:
    with pytest.raises(WorldError, match=r"unknown world 'trajectroy2'; did you mean 'trajectory2'\?"):
        load_world("trajectroy2")


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match=r"nowhere\.yaml: No such file"):
        load_world(tmp_path / "nowhere.yaml")


def test_broken_yaml_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text("goal: [1, 2]\nbounds: {north: [0, 1\n", encoding="utf-8")
    with pytest.raises(WorldError, match=r"broken\.yaml, line \d"):
        load_world(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"goal": [30.0, 0.0]}, "goal (30, 0) is outside the bounds north -5..25, east -5..5 m"),
        ({"start": [0.0, -9.0]}, "start (0, -9) is outside the bounds"),
        ({"goal": [10.0, 0.2]}, "goal (10, 0.2) is inside an obstacle, 0.30 m deep"),
        ({"goal": [10.0, 0.6]}, "goal (10, 0.6) has 0.10 m to the nearest obstacle, the vehicle needs 0.38 m: 0.28 m"),
        ({"start": [10.0, 0.1]}, "start (10, 0.1) is inside an obstacle"),
        (
            {"movers": [{"between": [[20.0, -4.0], [20.0, 4.0]], "radius_m": 0.3, "speed_max_m_s": 1.0}]},
            "goal (20, 0) is in the way of a mover",
        ),
        (
            {"walls": [{"between": [[12.0, -6.0], [12.0, 6.0]]}]},
            "goal is not reachable: the vehicle needs 0.38 m to either side (radius 0.33 + margin 0.05),"
            " no way is open at all, 0.38 m are missing",
        ),
        ({"walls": [{"between": d} for d in DOOR]}, "the widest way has 0.30 m to either side, 0.08 m are missing"),
    ],
)
def test_a_world_that_cannot_be_flown_is_refused_with_the_reason(changes: dict[str, object], message: str) -> None:
    assert message in refusal(yard(**changes))


def test_a_smaller_vehicle_fits_where_a_larger_is_refused() -> None:
    world = yard(walls=[{"between": d} for d in DOOR])
    check_world(world, radius_m=0.2)
    with pytest.raises(WorldError, match="not reachable"):
        check_world(world, radius_m=0.3)


def test_a_low_wall_can_be_overflown_but_not_landed_on() -> None:
    low = {"between": [[12.0, -6.0], [12.0, 6.0]], "thickness_m": 0.4, "height_m": 1.5}
    check_world(yard(walls=[low]))
    assert "inside an obstacle" in refusal(yard(walls=[low], goal=[12.0, 0.0]))


def test_start_and_goal_can_be_moved_and_are_checked_again() -> None:
    world = load_world("trajectory1", start=(1.0, 1.0), goal=(50.0, 0.0))
    assert (world.start_ned_m.tolist(), world.goal_ned_m.tolist()) == ([1.0, 1.0], [50.0, 0.0])
    with pytest.raises(WorldError, match="inside an obstacle"):
        load_world("trajectory1", goal=(35.0, -0.4))


@settings(max_examples=60, deadline=None)
@given(half_width=st.floats(0.1, 1.0), along=st.floats(3.0, 17.0), across=st.floats(-2.0, 2.0))
def test_the_widest_way_through_a_door_is_half_its_width(half_width: float, along: float, across: float) -> None:
    doors = [[[along, -6.0], [along, across - half_width]], [[along, across + half_width], [along, 6.0]]]
    world = yard(cylinders=[], walls=[{"between": d, "thickness_m": 0.02} for d in doors])
    assert widest_way_m(world, 2.0) == pytest.approx(half_width, abs=0.08)  # grid of 0.1 m


@settings(max_examples=40, deadline=None)
@given(north=st.floats(-5.0, 60.0), east=st.floats(-12.0, 12.0))
def test_the_file_check_and_the_judge_measure_the_same(north: float, east: float) -> None:
    world = load_world("trajectory2")
    checked = clearance_m(world, np.array([[north, east]]))[0]
    judged = CollisionChecker(world, radius_m=0.33).clearance(0.0, np.array([north, east, -3.0])) + 0.33
    assert judged == pytest.approx(max(checked, 0.0), abs=1e-9)
