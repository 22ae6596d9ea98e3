import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mission_kit import ORIGIN, open_world, place
from pymavlink.dialects.v20 import common as mav

from sitl.geofence import NOT_AT_HOME, NOT_HERE, Area, Breach, Geofence, accept, areas_of
from sitl.mission_items import MissionItem, MissionType
from sitl.modes import FlightMode
from sitl.px4_params import ParamStore
from sitl.simulation import SimConfig, Simulation

INSIDE, OUTSIDE = mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION, mav.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
ROUND_IN, ROUND_OUT = mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mav.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION
HOME = np.zeros(3)


def polygon(command: int, *corners: tuple[float, float]) -> tuple[MissionItem, ...]:
    return tuple(place(n, e, 0, command, (float(len(corners)), 0.0, 0.0, 0.0)) for n, e in corners)


def circle(command: int, north_m: float, east_m: float, radius_m: float) -> tuple[MissionItem, ...]:
    return (place(north_m, east_m, 0, command, (radius_m, 0.0, 0.0, 0.0)),)


def square(command: int, half_m: float, north_m: float = 0.0) -> tuple[MissionItem, ...]:
    n, h = north_m, half_m
    return polygon(command, (n - h, -h), (n + h, -h), (n + h, h), (n - h, h))


def _wound_round(corners: np.ndarray, point: np.ndarray) -> bool:
    """Oracle: the winding number, by summed angles."""
    arms = corners - point
    angles = np.arctan2(arms[:, 1], arms[:, 0])
    turns = np.angle(np.exp(1j * (np.roll(angles, -1) - angles)))
    return bool(abs(turns.sum()) > math.pi)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.floats(1.0, 50.0), st.floats(0.05, 1.0)), min_size=3, max_size=8),
    st.floats(-60, 60),
    st.floats(-60, 60),
)
def test_a_star_shaped_polygon_contains_what_winds_round_it(
    rays: list[tuple[float, float]], north_m: float, east_m: float
) -> None:
    turns = np.cumsum([share for _, share in rays])
    bearings = turns / turns[-1] * math.tau
    corners = np.array([(r * math.cos(b), r * math.sin(b)) for (r, _), b in zip(rays, bearings, strict=True)])
    nearest = np.min(np.linalg.norm(corners - (north_m, east_m), axis=1))
    edges = np.roll(corners, -1, axis=0) - corners
    offsets = (north_m, east_m) - corners
    across = np.abs(edges[:, 0] * offsets[:, 1] - edges[:, 1] * offsets[:, 0]) / np.linalg.norm(edges, axis=1)
    if nearest < 1e-3 or across.min() < 1e-6:
        return  # on the border either answer is right
    inside = _wound_round(corners, np.array([north_m, east_m]))
    assert Area(True, corners).allows(north_m, east_m) is inside
    assert Area(False, corners).allows(north_m, east_m) is not inside


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.5, 60))
def test_a_circle_contains_what_is_nearer_than_its_radius(north_m: float, east_m: float, radius_m: float) -> None:
    area = Area(True, np.array([[3.0, -4.0]]), radius_m)
    assert area.allows(north_m, east_m) is (math.hypot(north_m - 3.0, east_m + 4.0) < radius_m)


def test_an_uploaded_fence_has_its_areas_in_order() -> None:
    items = (*square(INSIDE, 50.0), *circle(ROUND_OUT, 20, 0, 5), *polygon(OUTSIDE, (-9, -9), (-9, -5), (-5, -5)))
    one, two, three = areas_of(items, ORIGIN)
    assert (one.inclusion, two.inclusion, three.inclusion) == (True, False, False)
    assert two.radius_m == 5.0
    fence = Geofence((one, two, three))
    assert fence.allows(0.0, 0.0)
    assert not fence.allows(22.0, 0.0)
    assert not fence.allows(60.0, 0.0)
    assert not fence.allows(-8.0, -7.5)


def test_areas_that_home_or_the_vehicle_violates_are_dropped_with_px4s_texts() -> None:
    around, elsewhere = areas_of((*square(INSIDE, 50.0), *circle(ROUND_IN, 300, 0, 10)), ORIGIN)
    fence, texts = accept((around, elsewhere), HOME, None)
    assert fence.areas == (around,)
    assert texts == (NOT_AT_HOME,)
    fence, texts = accept((around,), HOME, np.array([70.0, 0.0, -5.0]))
    assert fence.areas == ()
    assert texts == (NOT_HERE,)


def test_the_example_with_a_circle_of_no_size_is_accepted_and_has_no_effect() -> None:
    (area,) = areas_of((MissionItem(5, ROUND_IN, (0.0, 0, 0, 0), 0, 0, 0.0),), ORIGIN)
    assert accept((area,), HOME, None)[0].areas == ()


@pytest.mark.parametrize(
    ("pos", "breach"),
    [
        ((0, 0, -5), None),
        ((19, 0, -5), None),
        ((21, 0, -5), Breach.DISTANCE),
        ((0, 0, -31), Breach.ALTITUDE),
        ((0, 12, -5), Breach.AREA),
    ],
)
def test_distance_height_and_areas_are_watched(pos: tuple[float, ...], breach: Breach | None) -> None:
    params = ParamStore({"GF_MAX_HOR_DIST": 20.0, "GF_MAX_VER_DIST": 30.0})
    fence = Geofence(areas_of(square(INSIDE, 11.0, 10.0), ORIGIN))
    assert fence.breach(np.array(pos, float), HOME, params) is breach


# --- in flight ----------------------------------------------------------------------------------------------------


class Flight:
    """Hovering at 5 m, with a fence."""

    def __init__(self, fence: tuple[MissionItem, ...] = (), **params: float) -> None:
        self.sim = Simulation(open_world(), SimConfig(seed=1, px4_params={"MIS_TAKEOFF_ALT": 5.0, **params}))
        self.ap = self.sim.autopilot
        self.texts: list[str] = []
        self.run(3.0)
        self.ap.plans.replace(MissionType.FENCE, fence)
        self.ap.command_arm()
        self.ap.command_takeoff()
        self.run(12.0)
        assert self.ap.mode is FlightMode.HOLD
        self.texts.clear()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 25)):
            self.sim.advance_to_scan()
            self.texts += [text.text for text in self.ap.texts]
            self.ap.texts.clear()

    def out(self) -> None:
        """Fly a mission that leaves every fence."""
        self.ap.plans.replace(MissionType.MISSION, (place(0, 0, 5), place(60, 0, 5)))
        assert self.ap.command_mode(FlightMode.MISSION).accepted


@pytest.mark.parametrize(
    ("action", "mode", "delay_s"),
    [
        (0, FlightMode.MISSION, 0.0),
        (1, FlightMode.MISSION, 0.0),
        (2, FlightMode.HOLD, 0.0),
        (3, FlightMode.RTL, 5.0),
        (5, FlightMode.LAND, 5.0),
    ],
)
def test_the_action_of_gf_action_follows_a_breach(action: int, mode: FlightMode, delay_s: float) -> None:
    flight = Flight(GF_ACTION=action, GF_MAX_HOR_DIST=20.0)
    flight.out()
    while flight.sim.truth.pos_ned_m[0] < 20.0:
        flight.run(0.04)
    flight.run(0.2)
    assert (Breach.DISTANCE.value in flight.texts) is (action > 0)
    if delay_s:
        assert flight.ap.mode is FlightMode.HOLD
        assert "Failsafe activated, entering Hold for 5 seconds" in flight.texts
        flight.run(delay_s)
    assert flight.ap.mode is mode
    assert ("Failsafe activated" in flight.texts) is (action > 0)
    assert (flight.ap.failsafe is not None) is (action > 1)


def test_termination_at_the_fence_stops_the_motors() -> None:
    flight = Flight(GF_ACTION=4, GF_MAX_VER_DIST=7.0)
    flight.ap.command_takeoff(-12.0)
    flight.run(6.0)
    assert not flight.ap.armed
    assert flight.sim.truth.vel_ned_m_s[2] > 1.0 or flight.sim.truth.on_ground


def test_a_person_may_leave_the_hold_at_the_fence_by_choosing_a_mode() -> None:
    flight = Flight(square(INSIDE, 15.0))
    flight.ap.plans.replace(MissionType.MISSION, (place(0, 0, 5), place(10, 0, 5)))
    flight.ap.params.set("GF_MAX_HOR_DIST", 8.0)
    assert flight.ap.command_mode(FlightMode.MISSION).accepted
    flight.run(9.0)
    assert flight.ap.failsafe is not None
    assert flight.ap.command_land().accepted
    flight.run(0.5)
    assert (flight.ap.mode, flight.ap.failsafe) == (FlightMode.LAND, None)


def test_a_mission_that_leaves_the_fence_is_not_flown() -> None:
    flight = Flight(square(INSIDE, 15.0))
    flight.ap.plans.replace(MissionType.MISSION, (place(0, 0, 5), place(30, 0, 5)))
    assert flight.ap.texts[-1].text == "Geofence violation for waypoint 2"
    assert not flight.ap.command_mode(FlightMode.MISSION).accepted
