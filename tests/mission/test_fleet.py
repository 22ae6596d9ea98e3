"""Several vehicles with companions of their own in one world, over real ports; judged by the truth."""

import contextlib
import dataclasses
import json
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from companion.core.tlog import read_tlog
from mission.cli import main
from mission.flight_log import read_rows
from mission.pilot import Pilot
from mission.processes import Child, Children, wait_for_end
from sitl.formation import fleet
from sitl.link import HOST
from sitl.server import RunConfig
from sitl.simulation import SimConfig
from sitl.vehicle_config import VehicleConfig
from sitl.world import World

FLIGHT_WALL_S = 120.0
CROSSING = ((0.0, 0.0), (16.0, 0.0)), ((13.66, -5.66), (2.34, 5.66))  # start and goal of each, world ned: 135 deg


def crossing_vehicles(instance: int, folder: Path) -> list[VehicleConfig]:
    """Both would be at the crossing at the same time."""
    empty = np.zeros((0, 4)), np.zeros((0, 6))
    world = World("crossing", np.zeros(2), np.array([16.0, 0.0]), (-20.0, -20.0, 30.0, 20.0), *empty)
    run = RunConfig(math.inf, lockstep=True, gates=True)
    members = fleet(VehicleConfig(world, SimConfig(seed=1), run, instance, log_dir=folder), len(CROSSING))
    return [
        dataclasses.replace(member, sim=dataclasses.replace(member.sim, spawn_ned_m=start))
        for member, (start, _) in zip(members, CROSSING, strict=True)
    ]


def start_companion(children: Children, member: VehicleConfig, goal_ned_m: tuple[float, float], folder: Path) -> Child:
    assert member.sim.spawn_ned_m is not None
    goal = [str(there - here) for there, here in zip(goal_ned_m, member.sim.spawn_ned_m, strict=True)]
    log = folder / f"companion_{member.system_id}"
    url = f"udpin://{HOST}:{14540 + member.instance}"
    words = ["--vehicle", url, "--goal", *goal, "--cruise", "3", "--log", str(log)]
    return children.start(log.name, "companion", words, folder / f"{log.name}.log")


def operate(member: VehicleConfig) -> None:
    with contextlib.closing(Pilot(member.instance, system=member.system_id)) as pilot:
        pilot.take_off()
        pilot.hand_over()
        assert pilot.until(lambda: not pilot.armed, FLIGHT_WALL_S), f"vehicle {member.system_id} did not land"


def fly_crossing(instance: int, folder: Path) -> list[VehicleConfig]:
    folder.mkdir(exist_ok=True)
    members = crossing_vehicles(instance, folder)
    paths = [folder / f"{member.system_id}.json" for member in members]
    for path, member in zip(paths, members, strict=True):
        path.write_text(json.dumps(member.to_json()), encoding="utf-8")
    with Children() as children:
        vehicles = children.start("vehicles", "sitl", [str(path) for path in paths], folder / "vehicles.log")
        pairs = zip(members, CROSSING, strict=True)
        companions = [start_companion(children, member, goal, folder) for member, (_, goal) in pairs]
        with ThreadPoolExecutor(len(members)) as pool:
            list(pool.map(operate, members))
        assert all(wait_for_end(companion, 10.0) for companion in companions)
        assert [companion.exit_code for companion in companions] == [0, 0]
        children.end(vehicles)
        assert vehicles.exit_code == 0
    return members


def test_two_vehicles_cross_each_others_way_land_and_never_touch(instance: int, tmp_path: Path) -> None:
    members = fly_crossing(min(instance, 8), tmp_path)
    truth = [list(read_rows(member.log_dir / "truth.jsonl")) for member in members if member.log_dir is not None]
    for rows, (_, goal) in zip(truth, CROSSING, strict=True):
        assert not rows[-1]["contact"]
        assert (rows[-1]["landed"], rows[-1]["armed"]) == ("ON_GROUND", False)
        assert math.dist(rows[-1]["pos_world_ned_m"][:2], goal) < 1.0
        nearest_m = min(row["clearance_m"] for row in rows if row["clearance_m"] is not None)
        assert 0.0 < nearest_m < 3.0  # they met
    for member in members:
        assert speakers(member) == {(member.system_id, 1), (member.system_id, 191)}


def speakers(member: VehicleConfig) -> set[tuple[int, int]]:
    """System and component ids of all that went over the vehicle's companion link (MAVLink 2)."""
    assert member.log_dir is not None
    return {(packet[5], packet[6]) for _, packet in read_tlog(member.log_dir / "vehicle_companion.tlog")}


@pytest.mark.slow
def test_two_vehicles_in_lockstep_fly_the_same_bytes_again(instance: int, tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("first", "again")]
    for folder in folders:
        fly_crossing(min(instance, 8), folder)
    first, again = (sorted(folder.glob("vehicle_*/truth.jsonl")) for folder in folders)
    assert len(first) == 2
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in again]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--count", "2", "--instance", "9"], "beyond instance 9"),
        (["--count", "2", "--firmware", "px4"], "embedded firmware"),
    ],
)
def test_a_fleet_that_cannot_be_is_refused_in_one_line(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sitl", *words]) == 2
    (told,) = capsys.readouterr().err.strip().split("\n")
    assert line in told
