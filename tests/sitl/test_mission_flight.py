import math
from itertools import pairwise

import numpy as np
import pytest
from mission_kit import ORIGIN, do, open_world, place
from pymavlink.dialects.v20 import common as mav

from companion.core.types import LandedState
from sitl.mission_items import MissionItem, MissionType
from sitl.modes import FlightMode
from sitl.simulation import SimConfig, Simulation

TAKEOFF, LAND = mav.MAV_CMD_NAV_TAKEOFF, mav.MAV_CMD_NAV_LAND
RTL, SPEED, JUMP = mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, mav.MAV_CMD_DO_CHANGE_SPEED, mav.MAV_CMD_DO_JUMP
DELAY, MOUNT = mav.MAV_CMD_NAV_DELAY, mav.MAV_CMD_DO_MOUNT_CONTROL


class Flight:
    """A vehicle in an open world with a mission in its store."""

    def __init__(self, *items: MissionItem, **params: float) -> None:
        self.sim = Simulation(open_world(), SimConfig(seed=3, px4_params=params))
        self.ap = self.sim.autopilot
        self.texts: list[str] = []
        self.track: list[np.ndarray] = []
        self.reached: list[int] = []
        self.run(3.0)
        if items:
            self.ap.plans.replace(MissionType.MISSION, items)

    def go(self) -> "Flight":
        assert self.ap.command_arm().accepted
        assert self.ap.command_mode(FlightMode.MISSION).accepted
        return self

    def run(self, seconds: float, until: object = None) -> float:
        """Fly on; stops early when ``until()`` holds. Returns the time it took."""
        start_s = self.sim.t_s
        while self.sim.t_s - start_s < seconds - 1e-9:
            self.sim.advance_to_scan()
            self.texts += [text.text for text in self.ap.texts]
            self.ap.texts.clear()
            self.track.append(self.sim.truth.pos_ned_m)
            if self.ap.mission.reached is not None and self.ap.mission.reached not in self.reached[-1:]:
                self.reached.append(self.ap.mission.reached)
            if callable(until) and until():
                return self.sim.t_s - start_s
        assert until is None, f"not in {seconds} s: {self.texts}"
        return self.sim.t_s - start_s

    def mode(self, mode: FlightMode, seconds: float = 120.0) -> float:
        return self.run(seconds, lambda: self.ap.mode is mode)

    def item(self, seq: int, seconds: float = 120.0) -> float:
        return self.run(seconds, lambda: self.ap.mission.reached == seq)

    def down(self, seconds: float = 120.0) -> None:
        self.run(seconds, lambda: not self.ap.armed)


def test_a_square_is_flown_and_the_vehicle_returns_and_lands() -> None:
    """PX4's own case: track within 5 m of the square, everything reached, landed at home."""
    corners = [(0, 0), (20, 0), (20, 20), (0, 20)]
    flight = Flight(*(place(n, e, 10) for n, e in corners), do(RTL), RTL_RETURN_ALT=12.0).go()
    flight.mode(FlightMode.RTL)
    away_m = [_from_square(pos, corners) for pos in flight.track if pos[2] < -9.0]
    assert max(away_m) < 2.0
    flight.down()
    assert np.linalg.norm(flight.sim.truth.pos_ned_m) < 0.3
    assert flight.reached == [0, 1, 2, 3]
    for said in (
        "Executing Mission",
        "Climb to 10.0 meters above home",
        "RTL: land at destination",
        "Disarmed by landing",
    ):
        assert said in flight.texts
    assert any(text.startswith("RTL: start return at") for text in flight.texts)


def _from_square(pos: np.ndarray, corners: list[tuple[int, int]]) -> float:
    """Distance to the nearest leg."""
    legs = pairwise(corners)
    return min(_from_leg(pos[:2], np.array(a, float), np.array(b, float)) for a, b in legs)


def _from_leg(pos: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    share = float(np.clip((pos - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0))
    return float(np.linalg.norm(pos - a - share * (b - a)))


def test_a_mission_without_return_ends_in_hold_at_its_last_place() -> None:
    flight = Flight(place(0, 0, 6), place(15, 5, 6)).go()
    flight.mode(FlightMode.HOLD)
    assert flight.texts[-1] == "Mission finished, loitering"
    flight.run(6.0)
    assert flight.sim.truth.pos_ned_m == pytest.approx([15.0, 5.0, -6.0], abs=0.3)
    assert flight.ap.plans.current == 1


def test_take_off_waypoint_and_land_items_make_a_flight() -> None:
    flight = Flight(place(0, 0, 6, TAKEOFF), place(12, 0, 6), place(12, 12, 0, LAND)).go()
    flight.run(60.0, lambda: flight.ap.landed_state is LandedState.LANDING)
    assert flight.sim.truth.pos_ned_m[:2] == pytest.approx([12.0, 12.0], abs=2.0)
    flight.down()
    assert flight.sim.truth.pos_ned_m == pytest.approx([12.0, 12.0, 0.0], abs=0.3)
    assert "Mission finished, landed" in flight.texts
    assert flight.ap.mission.reached == 2
    # armed again, the mission begins anew
    flight.go()
    flight.run(3.0)
    assert flight.ap.plans.current == 0


def test_holds_and_delays_take_their_time() -> None:
    flight = Flight(place(0, 0, 5, params=(3.0, 0.0, 0.0, math.nan)), do(DELAY, 4.0), place(8, 0, 5)).go()
    flight.run(30.0, lambda: -flight.sim.truth.pos_ned_m[2] > 4.0)
    assert flight.item(0) == pytest.approx(3.3, abs=0.7)
    assert flight.item(1) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("speed_m_s", [1.5, 4.0])
def test_a_change_of_speed_is_flown(speed_m_s: float) -> None:
    flight = Flight(place(0, 0, 5), do(SPEED, 1.0, speed_m_s, -1.0), place(30, 0, 5)).go()
    flight.item(1)
    fastest = 0.0
    while flight.ap.mission.reached != 2:
        flight.run(0.2)
        fastest = max(fastest, float(np.hypot(*flight.sim.truth.vel_ned_m_s[:2])))
    assert fastest == pytest.approx(speed_m_s, abs=0.35, rel=0.12)


def test_a_jump_repeats_its_leg_the_given_number_of_times() -> None:
    flight = Flight(place(0, 0, 5), place(8, 0, 5), do(JUMP, 0.0, 2.0), place(0, 8, 5)).go()
    flight.mode(FlightMode.HOLD)
    assert flight.reached == [0, 1, 0, 1, 0, 1, 3]


def test_items_of_gimbals_and_cameras_are_passed_over() -> None:
    items = (place(0, 0, 5), do(MOUNT, 0.0), do(mav.MAV_CMD_IMAGE_START_CAPTURE, 0.0), place(6, 0, 5))
    flight = Flight(*items).go()
    flight.mode(FlightMode.HOLD)
    assert flight.ap.mission.reached == 3


def test_a_pause_holds_and_the_mission_goes_on_at_the_same_item() -> None:
    flight = Flight(place(0, 0, 5), place(40, 0, 5), place(40, 10, 5)).go()
    flight.run(60.0, lambda: flight.sim.truth.pos_ned_m[0] > 10.0)
    flight.ap.command_mode(FlightMode.HOLD)
    flight.run(5.0)
    where = flight.sim.truth.pos_ned_m
    flight.run(2.0)
    assert flight.sim.truth.pos_ned_m == pytest.approx(where, abs=0.2)
    assert flight.ap.plans.current == 1
    assert flight.ap.command_mode(FlightMode.MISSION).accepted
    flight.mode(FlightMode.HOLD)
    assert flight.ap.mission.reached == 2
    assert flight.sim.truth.pos_ned_m == pytest.approx([40.0, 10.0, -5.0], abs=2.5)


def test_a_client_jumps_to_another_item_in_flight() -> None:
    flight = Flight(place(0, 0, 5), place(60, 0, 5), place(0, 12, 5)).go()
    flight.item(0)
    flight.run(3.0)
    assert flight.ap.plans.jump_to(2)
    flight.mode(FlightMode.HOLD)
    assert max(pos[0] for pos in flight.track) < 20.0
    assert 1 not in flight.reached


def test_the_nose_points_along_the_way_or_where_the_item_says() -> None:
    flight = Flight(place(0, 0, 5), place(0, 15, 5), place(0, 15, 5, params=(0, 0, 0, -90.0))).go()
    flight.item(0)
    flight.run(4.0)
    yaw_deg = math.degrees(2 * math.atan2(flight.sim.truth.q_ned_frd[3], flight.sim.truth.q_ned_frd[0]))
    assert yaw_deg == pytest.approx(90.0, abs=10.0)
    flight.item(2)
    w, _, _, z = flight.sim.truth.q_ned_frd
    assert math.degrees(2 * math.atan2(z, w)) == pytest.approx(-90.0, abs=13.0)


def test_no_mission_means_no_mission_mode() -> None:
    flight = Flight()
    flight.ap.command_mode(FlightMode.MISSION)  # disarmed: allowed
    assert not flight.ap.command_arm().accepted
    flight.ap.command_mode(FlightMode.HOLD)
    assert flight.ap.command_arm().accepted
    assert not flight.ap.command_mode(FlightMode.MISSION).accepted
    assert flight.ap.texts[-1].text == "Switching to Mission is currently not available"


@pytest.mark.parametrize(
    ("items", "text"),
    [
        ((place(0, 0, 0, LAND),), "Mission rejected: starts with landing"),
        ((place(0, 0, 2.5, TAKEOFF),), "Mission rejected: Takeoff altitude too low!"),
        ((place(0, 0, 9), place(0, 0, 9, TAKEOFF)), "Mission rejected: takeoff not first waypoint item"),
        ((place(20000, 0, 9),), "First waypoint too far away: 20000m, 10000 max"),
    ],
)
def test_a_mission_that_cannot_be_flown_is_rejected_with_px4s_text(items: tuple[MissionItem, ...], text: str) -> None:
    flight = Flight(*items)
    assert [said.text for said in flight.ap.texts] == [text]
    flight.ap.command_arm()
    assert not flight.ap.command_mode(FlightMode.MISSION).accepted


def test_return_leads_to_the_nearest_rally_point() -> None:
    flight = Flight(place(0, 0, 5), place(30, 0, 5), RTL_RETURN_ALT=6.0)
    rally = tuple(place(n, 0, 0, mav.MAV_CMD_NAV_RALLY_POINT) for n in (25.0, -40.0))
    flight.ap.plans.replace(MissionType.RALLY, rally)
    flight.go().item(1)
    flight.ap.command_mode(FlightMode.RTL)
    flight.down()
    assert flight.sim.truth.pos_ned_m[:2] == pytest.approx([25.0, 0.0], abs=0.4)


def test_heights_above_sea_level_and_above_home_are_told_apart() -> None:
    low = place(0, 0, 4.0)
    high = MissionItem(5, low.command, low.params, low.x, low.y, ORIGIN.alt_amsl_m + 7.0)
    flight = Flight(low, high).go()
    flight.item(0)
    assert -flight.sim.truth.pos_ned_m[2] == pytest.approx(4.0, abs=0.9)
    flight.mode(FlightMode.HOLD)
    flight.run(3.0)
    assert -flight.sim.truth.pos_ned_m[2] == pytest.approx(7.0, abs=0.1)


def test_the_same_mission_gives_the_same_flight() -> None:
    def fly() -> list[float]:
        flight = Flight(place(0, 0, 5), place(12, 3, 6), do(RTL), RTL_RETURN_ALT=8.0).go()
        flight.run(30.0)
        return [float(x) for pos in flight.track for x in pos]

    assert fly() == fly()


@pytest.mark.slow
def test_a_vehicle_takes_off_and_holds_ten_metres_within_ten_centimetres_for_a_minute() -> None:
    flight = Flight(MIS_TAKEOFF_ALT=10.0)
    flight.ap.command_arm()
    flight.ap.command_takeoff()
    flight.mode(FlightMode.HOLD)
    flight.run(1.0)
    flight.track.clear()
    flight.run(60.0)
    heights_m = [-float(pos[2]) for pos in flight.track]
    assert max(abs(height_m - 10.0) for height_m in heights_m) < 0.1
