"""Vehicles of one world see each other, touch each other, and stand apart at the start. In one process, no sockets."""

import json
import math
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.types import Setpoint
from sitl.airspace import Airspace, Hub
from sitl.formation import SPACING_M, fleet, places
from sitl.geo import Origin
from sitl.modes import FlightMode
from sitl.neighbours import HALF_HEIGHT_M, Neighbours, row_of
from sitl.simulation import SimConfig, Simulation
from sitl.truth_log import truth_sha256
from sitl.vehicle_config import ConfigError, VehicleConfig, from_json
from sitl.world import Mover, World

RADIUS_M = 0.33
COORDINATE = st.floats(-50.0, 50.0)


def world(*circles: tuple[float, float, float, float], movers: tuple[Mover, ...] = (), half_m: float = 30.0) -> World:
    rows = np.array(circles, dtype=float).reshape(len(circles), 4)
    bounds = (-half_m, -half_m, half_m, half_m)
    return World("test", np.zeros(2), np.array([20.0, 0.0]), bounds, rows, np.zeros((0, 6)), movers)


def vehicle(north_m: float, east_m: float, seed: int = 0) -> Simulation:
    return Simulation(world(), SimConfig(seed=seed, spawn_ned_m=(north_m, east_m)), Neighbours(RADIUS_M))


def step(sims: list[Simulation]) -> list[np.ndarray]:
    scans = [sim.advance_to_scan().scan for sim in sims]
    rows = [row_of(sim.truth, sim.spawn_ned_m) for sim in sims]
    for own, sim in enumerate(sims):
        assert sim.neighbours is not None
        sim.neighbours.hear(sim.world_s, np.array([row for index, row in enumerate(rows) if index != own]))
    return [scan.range_m for scan in scans]


def send_to(sim: Simulation, north_m: float, east_m: float) -> None:
    """Up to 2.5 m and to a place, local ned."""
    sim.submit(Setpoint(sim.t_s, np.array([north_m, east_m, -2.5]), None, None, 0.0))
    if sim.autopilot.ready and not sim.autopilot.armed and not sim.autopilot.has_flown:
        assert sim.autopilot.command_arm().accepted
        assert sim.autopilot.command_mode(FlightMode.OFFBOARD).accepted


def test_two_vehicles_see_each_other_where_they_are() -> None:
    sims = [vehicle(0.0, 0.0), vehicle(4.0, 0.0, seed=1)]
    for _ in range(5):
        from_south, from_north = step(sims)
    assert np.nanmin(from_south) == pytest.approx(4.0 - RADIUS_M, abs=0.05)
    assert np.nanmin(from_north) == pytest.approx(4.0 - RADIUS_M, abs=0.05)
    assert np.nanargmin(from_south) in (71, 0, 1)
    assert np.nanargmin(from_north) in (35, 36, 37)
    assert [sim.rows[-1].clearance_m for sim in sims] == pytest.approx([4.0 - 2 * RADIUS_M] * 2, abs=0.01)


def test_a_vehicle_that_flies_overhead_is_neither_seen_nor_touched_by_one_on_the_ground() -> None:
    sims = [vehicle(0.0, 0.0), vehicle(3.0, 0.0)]
    for _ in range(300):
        send_to(sims[1], -3.0 if sims[1].t_s > 7.0 else 0.0, 0.0)
        seen, _ = step(sims)
    assert abs(sims[1].truth.pos_ned_m[0] + 3.0) < 0.3
    assert not np.isfinite(seen).any()
    assert not any(sim.contact for sim in sims)
    assert 1.8 < sims[0].rows[-1].clearance_m < 2.6


def test_a_collision_of_two_vehicles_is_a_contact_of_both() -> None:
    sims = [vehicle(0.0, 0.0), vehicle(6.0, 0.0)]
    least_m = math.inf
    for _ in range(450):
        far = sims[0].t_s > 7.0
        send_to(sims[0], 3.0 if far else 0.0, 0.0)
        send_to(sims[1], -3.0 if far else 0.0, 0.0)
        step(sims)
        apart_m = math.dist(*(sim.truth.pos_ned_m + sim.spawn_ned_m for sim in sims))
        least_m = min(least_m, apart_m)
        assert sims[0].contact is sims[1].contact
        assert sims[0].contact or apart_m > 2 * RADIUS_M - 0.02
    assert least_m < 2 * RADIUS_M
    assert all(sim.contact for sim in sims)


def test_vehicles_that_go_in_turn_fly_the_same_bytes_again() -> None:
    def shas() -> list[str]:
        sims = [vehicle(0.0, 0.0), vehicle(3.0, 0.0, seed=1)]
        for _ in range(250):
            for sim in sims:
                send_to(sim, 1.0, 0.0)
            step(sims)
        return [truth_sha256(sim.rows, sim.spawn_ned_m) for sim in sims]

    assert shas() == shas()


def test_a_vehicle_whose_world_has_no_other_flies_as_one_alone() -> None:
    def flown(neighbours: Neighbours | None) -> Simulation:
        sim = Simulation(world((3.0, 1.0, 0.5, math.inf)), SimConfig(seed=4), neighbours)
        for _ in range(200):
            send_to(sim, 1.0, 0.0)
            scans.append(sim.advance_to_scan().scan.range_m)
        return sim

    scans: list[np.ndarray] = []
    alone, among_none = flown(None), flown(Neighbours(RADIUS_M))
    assert truth_sha256(alone.rows, alone.spawn_ned_m) == truth_sha256(among_none.rows, among_none.spawn_ned_m)
    assert np.array_equal(scans[:200], scans[200:], equal_nan=True)


def test_a_reboot_leaves_the_vehicle_in_step_with_the_others() -> None:
    mover = Mover((8.0, -9.0), (8.0, 9.0), 0.3, math.inf, 1.0, 1.0, 0.0)
    sims = [
        Simulation(world(movers=(mover,)), SimConfig(spawn_ned_m=(north_m, 0.0)), Neighbours(RADIUS_M))
        for north_m in (0.0, 4.0)
    ]
    for _ in range(30):
        step(sims)
    sims[0].advance(3)
    sims[0].reboot()
    for _ in range(10):
        step(sims)
    assert sims[0].t_ms == 400
    assert sims[0].world_s == sims[1].world_s == sims[1].t_s


@given(COORDINATE, COORDINATE, COORDINATE, COORDINATE, st.floats(-20.0, 0.0), st.floats(-20.0, 0.0))
def test_clearance_is_the_same_from_both_sides(
    n_one: float, e_one: float, n_two: float, e_two: float, d_one: float, d_two: float
) -> None:
    one, two = np.array([n_one, e_one, d_one]), np.array([n_two, e_two, d_two])
    seen_from_one, seen_from_two = Neighbours(RADIUS_M), Neighbours(RADIUS_M)
    seen_from_one.hear(1.0, np.array([[*two, 0.0, 0.0, 0.0]]))
    seen_from_two.hear(1.0, np.array([[*one, 0.0, 0.0, 0.0]]))
    clearance_m = seen_from_one.clearance_m(1.0, one, RADIUS_M)
    assert clearance_m == pytest.approx(seen_from_two.clearance_m(1.0, two, RADIUS_M))
    apart = math.hypot(n_one - n_two, e_one - e_two) > 2 * RADIUS_M or abs(d_one - d_two) > 2 * HALF_HEIGHT_M
    assert (clearance_m > 0.0) is apart


@given(st.floats(0.0, 0.08), COORDINATE, st.floats(-10.0, 10.0))
def test_neighbours_are_carried_on_by_their_velocity(ahead_s: float, north_m: float, north_m_s: float) -> None:
    neighbours = Neighbours(RADIUS_M)
    neighbours.hear(2.0, np.array([[north_m, 0.0, -2.5, north_m_s, 0.0, 0.0]]))
    ((north, _, _),) = neighbours.positions_ned_m(2.0 + ahead_s)
    assert north == pytest.approx(north_m + ahead_s * north_m_s)
    assert neighbours.speed_max_m_s == pytest.approx(abs(north_m_s))


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 10), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_places_are_apart_and_clear_and_begin_with_the_start(count: int, north_m: float, east_m: float) -> None:
    tree = (4.0, 2.0, 0.4, math.inf)
    mover = Mover((-9.0, 6.0), (9.0, 6.0), 0.5, math.inf, 1.0, 1.0, 0.0)
    at = (north_m, east_m)
    found = places(world(tree, movers=(mover,)), count, RADIUS_M, at)
    assert found[0].tolist() == list(at)
    for index, place in enumerate(found):
        assert all(math.dist(place, other) >= SPACING_M - 1e-9 for other in found[:index])
        if index:
            assert math.dist(place, tree[:2]) > tree[2] + RADIUS_M
            assert abs(place[1] - 6.0) > 0.5 + RADIUS_M


def test_a_start_without_room_for_all_is_refused_with_the_number_that_fits() -> None:
    with pytest.raises(ConfigError, match="room for 9 vehicles at its start, not for 10"):
        places(world(half_m=4.0), 10, RADIUS_M)


def test_the_vehicles_of_a_fleet_are_numbered_as_instances_of_px4() -> None:
    alone = VehicleConfig(world(), instance=2, log_dir=Path("logs"), params_file=Path("params.txt"))
    members = fleet(alone, 3)
    assert [member.instance for member in members] == [2, 3, 4]
    assert [member.system_id for member in members] == [3, 4, 5]
    assert [member.sim.seed for member in members] == [0, 1, 2]
    assert [member.log_dir for member in members] == [Path("logs") / f"vehicle_{i}" for i in (3, 4, 5)]
    assert [str(member.params_file) for member in members] == ["params_3.txt", "params_4.txt", "params_5.txt"]
    for member in members:
        back = from_json(json.loads(json.dumps(member.to_json())))
        assert (back.sim, back.system_id, back.instance) == (member.sim, member.system_id, member.instance)


def test_vehicles_of_a_fleet_are_as_far_apart_on_the_globe_as_in_the_world() -> None:
    first, second, third = fleet(VehicleConfig(world()), 3)
    assert first.sim.origin == Origin()
    for member in (second, third):
        origin = member.sim.origin
        there = Origin().north_east_m(origin.lat_deg, origin.lon_deg)
        assert there == pytest.approx(member.sim.spawn_ned_m, abs=1e-3)


def test_time_goes_on_only_when_everybody_has_come_to_the_instant() -> None:
    channels = [Pipe() for _ in range(3)]
    hub = Hub([ours for ours, _ in channels])
    sims = [vehicle(3.0 * i, 0.0) for i in range(3)]
    spaces = [Airspace(theirs, RADIUS_M) for _, theirs in channels]
    for index, (space, sim) in enumerate(zip(spaces, sims, strict=True)):
        space.tell(sim)
        hub.take(channels[index][0])
        for other in spaces:
            other.listen()
        assert spaces[0].waiting is (index < 2)
    assert spaces[1].neighbours.positions_ned_m(0.0)[:, 0].tolist() == pytest.approx([0.0, 6.0])
    assert not spaces[0].over(sims[0])


def test_a_vehicle_whose_hub_is_gone_knows_it() -> None:
    ours, theirs = Pipe()
    space = Airspace(theirs, RADIUS_M)
    space.tell(vehicle(0.0, 0.0))
    ours.close()
    space.listen()
    assert space.closed
