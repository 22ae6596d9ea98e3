import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mission_kit import open_world, place
from pymavlink.dialects.v20 import common as mav

from companion.core.types import LandedState
from sitl.failsafe import Action, Charge, Facts
from sitl.failsafe_keeper import FailsafeKeeper
from sitl.failure_injection import inject
from sitl.faults import FaultBook
from sitl.mission_items import MissionType
from sitl.modes import FlightMode
from sitl.px4_params import ParamStore
from sitl.simulation import SimConfig, Simulation

FLYING = Facts(0.0, True, FlightMode.HOLD, armed_for_s=60.0)


def keeper(**params: float) -> FailsafeKeeper:
    found = FailsafeKeeper(ParamStore(params))
    found.update(FLYING)
    return found


# --- which action, as a table -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("params", "trouble", "action"),
    [
        ({}, {"gcs_lost": True}, Action.NONE),
        ({"NAV_DLL_ACT": 1}, {"gcs_lost": True}, Action.HOLD),
        ({"NAV_DLL_ACT": 2}, {"gcs_lost": True}, Action.RETURN),
        ({"NAV_DLL_ACT": 3}, {"gcs_lost": True}, Action.LAND),
        ({"NAV_DLL_ACT": 5}, {"gcs_lost": True}, Action.TERMINATE),
        ({"NAV_DLL_ACT": 6}, {"gcs_lost": True}, Action.DISARM),
        ({}, {"charge": Charge.LOW}, Action.WARN),
        ({}, {"charge": Charge.EMERGENCY}, Action.WARN),
        ({"COM_LOW_BAT_ACT": 1}, {"charge": Charge.CRITICAL}, Action.RETURN),
        ({"COM_LOW_BAT_ACT": 1}, {"charge": Charge.EMERGENCY}, Action.RETURN),
        ({"COM_LOW_BAT_ACT": 2}, {"charge": Charge.CRITICAL}, Action.LAND),
        ({"COM_LOW_BAT_ACT": 3}, {"charge": Charge.LOW}, Action.WARN),
        ({"COM_LOW_BAT_ACT": 3}, {"charge": Charge.CRITICAL}, Action.RETURN),
        ({"COM_LOW_BAT_ACT": 3}, {"charge": Charge.EMERGENCY}, Action.LAND),
        ({"GF_ACTION": 1}, {"breached": True}, Action.WARN),
        ({}, {"breached": True}, Action.HOLD),
        ({}, {"attitude_failed": True}, Action.WARN),
        ({"CBRK_FLIGHTTERM": 0}, {"attitude_failed": True}, Action.TERMINATE),
        ({}, {"attitude_failed": True, "armed_for_s": 2.0}, Action.DISARM),
        ({}, {"motor_failed": True}, Action.WARN),
        ({"COM_ACT_FAIL_ACT": 1}, {"motor_failed": True}, Action.HOLD),
        ({"COM_ACT_FAIL_ACT": 2}, {"motor_failed": True}, Action.LAND),
        ({"COM_ACT_FAIL_ACT": 3}, {"motor_failed": True}, Action.RETURN),
        ({"COM_ACT_FAIL_ACT": 4}, {"motor_failed": True}, Action.TERMINATE),
        ({}, {"position_ok": False}, Action.DESCEND),
        ({}, {"position_ok": False, "needs_position": False}, Action.NONE),
        ({}, {"attitude_ok": False}, Action.TERMINATE),
        ({}, {"offboard_lost": True, "position_ok": False}, Action.DESCEND),
        *(({"COM_OBL_RC_ACT": n}, {"offboard_lost": True}, a) for n, a in enumerate(
            (Action.POSITION, Action.ALTITUDE, Action.STABILIZED, Action.RETURN, Action.LAND, Action.HOLD,
             Action.TERMINATE, Action.DISARM)
        )),
    ],
)  # fmt: skip
def test_each_trouble_leads_to_the_action_of_its_parameter(
    params: dict[str, float], trouble: dict[str, object], action: Action
) -> None:
    guard = keeper(COM_FAIL_ACT_T=0.0, **params)
    assert guard.update(replace(FLYING, t_s=1.0, **trouble)) is action  # type: ignore[arg-type]
    assert (guard.text == "Failsafe activated") is (action is not Action.NONE)


_TROUBLES = st.fixed_dictionaries(
    {
        "gcs_lost": st.booleans(),
        "breached": st.booleans(),
        "charge": st.sampled_from(Charge),
        "attitude_failed": st.booleans(),
        "motor_failed": st.booleans(),
        "position_ok": st.booleans(),
        "offboard_lost": st.booleans(),
        "mode_changed": st.booleans(),
    }
)
_SETTINGS = st.fixed_dictionaries(
    {
        "NAV_DLL_ACT": st.integers(0, 3),
        "GF_ACTION": st.sampled_from([0, 1, 2, 3, 5]),
        "COM_LOW_BAT_ACT": st.integers(0, 3),
        "COM_ACT_FAIL_ACT": st.integers(0, 3),
        "COM_OBL_RC_ACT": st.integers(0, 5),
        "COM_FAIL_ACT_T": st.sampled_from([0.0, 5.0]),
    }
)


@given(_SETTINGS, st.lists(_TROUBLES, min_size=1, max_size=12))
def test_the_worst_action_wins_and_nothing_needs_a_position_that_is_not_there(
    params: dict[str, float], history: list[dict[str, object]]
) -> None:
    guard = keeper(**params)
    for tick, trouble in enumerate(history):
        action = guard.update(replace(FLYING, t_s=1.0 + tick, **trouble))  # type: ignore[arg-type]
        if not trouble["position_ok"]:
            assert action >= Action.DESCEND
        alone = keeper(**{**params, "COM_FAIL_ACT_T": 0.0})
        least = alone.update(replace(FLYING, t_s=1.0, offboard_lost=bool(trouble["offboard_lost"])))
        taken_over = action is Action.WARN
        assert action >= min(least, Action.HOLD) or taken_over
    assert guard.update(replace(FLYING, t_s=99.0, armed=False)) is Action.NONE


def test_an_action_waits_in_hold_for_com_fail_act_t() -> None:
    guard = keeper(NAV_DLL_ACT=2)
    lost = replace(FLYING, gcs_lost=True)
    assert guard.update(replace(lost, t_s=1.0)) is Action.HOLD
    assert guard.text == "Failsafe activated, entering Hold for 5 seconds"
    assert guard.update(replace(lost, t_s=5.9)) is Action.HOLD
    assert guard.update(replace(lost, t_s=6.1)) is Action.RETURN
    assert guard.text == "Failsafe activated"


def test_return_stands_when_the_link_is_back_until_a_mode_is_chosen() -> None:
    guard = keeper(NAV_DLL_ACT=2, COM_FAIL_ACT_T=0.0)
    guard.update(replace(FLYING, t_s=1.0, gcs_lost=True))
    assert guard.update(replace(FLYING, t_s=2.0)) is Action.RETURN
    assert guard.update(replace(FLYING, t_s=3.0, mode_changed=True)) is Action.NONE


def test_a_person_takes_over_from_return_but_not_from_termination() -> None:
    guard = keeper(NAV_DLL_ACT=2, COM_FAIL_ACT_T=0.0)
    guard.update(replace(FLYING, t_s=1.0, gcs_lost=True))
    assert guard.update(replace(FLYING, t_s=2.0, gcs_lost=True, mode_changed=True)) is Action.WARN
    assert guard.update(replace(FLYING, t_s=3.0, gcs_lost=True)) is Action.WARN
    worse = replace(FLYING, t_s=4.0, gcs_lost=True, charge=Charge.CRITICAL)
    guard = keeper(NAV_DLL_ACT=5)
    guard.update(replace(FLYING, t_s=1.0, gcs_lost=True))
    assert guard.update(replace(worse, mode_changed=True)) is Action.TERMINATE


# --- in flight ----------------------------------------------------------------------------------------------------


class Flight:
    """Hovering at 5 m."""

    def __init__(self, faults: tuple[str, ...] = (), **params: float) -> None:
        config = SimConfig(seed=1, px4_params={"MIS_TAKEOFF_ALT": 5.0, **params}, faults=faults)
        self.sim = Simulation(open_world(), config)
        self.ap = self.sim.autopilot
        self.texts: list[str] = []
        self.run(3.0)
        assert self.ap.command_arm().accepted
        self.ap.command_takeoff()
        self.run(10.0)
        self.texts.clear()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 25)):
            self.sim.advance_to_scan()
            self.texts += [text.text for text in self.ap.texts]
            self.ap.texts.clear()

    def down(self, seconds: float = 60.0) -> None:
        while self.ap.armed:
            self.run(0.2)
            seconds -= 0.2
            assert seconds > 0.0, self.texts

    def break_(self, unit: int, kind: int = mav.FAILURE_TYPE_OFF, instance: int = 0) -> None:
        assert inject(self.sim.trouble.book, unit, kind, instance).name == "ACCEPTED"


def test_without_a_ground_station_the_vehicle_returns() -> None:
    flight = Flight(NAV_DLL_ACT=2)
    flight.ap.guardian.hear_link(gcs_lost=True)
    flight.run(0.2)
    assert flight.texts == ["Connection to ground station lost", "Failsafe activated, entering Hold for 5 seconds"]
    assert flight.ap.mode is FlightMode.HOLD
    flight.run(5.0)
    assert flight.ap.mode is FlightMode.RTL
    flight.down()
    assert flight.texts[-1] == "Disarmed by landing"


def test_a_battery_that_runs_down_warns_then_returns_then_lands() -> None:
    flight = Flight(COM_LOW_BAT_ACT=3, COM_FAIL_ACT_T=0.0)
    battery = flight.sim.trouble.battery
    for charge, text, mode in (
        (0.14, "Low battery", FlightMode.HOLD),
        (0.06, "Critical battery", FlightMode.RTL),
        (0.04, "Emergency battery level", FlightMode.LAND),
    ):
        battery.remaining = charge
        flight.run(0.2)
        assert text in flight.texts
        assert flight.ap.mode is mode
    flight.down()
    assert not flight.ap.command_arm().accepted


def test_the_battery_is_drawn_by_thrust() -> None:
    flight = Flight()
    before = flight.sim.trouble.battery.remaining
    flight.run(10.0)
    hover = before - flight.sim.trouble.battery.remaining
    assert hover == pytest.approx(10.0 / (31 * 60.0), rel=0.05)
    before = flight.sim.trouble.battery.remaining
    flight.ap.command_takeoff(-60.0)
    flight.run(10.0)
    assert before - flight.sim.trouble.battery.remaining > 1.005 * hover


def test_gps_lost_during_a_mission_lands_the_vehicle() -> None:
    flight = Flight(SYS_FAILURE_EN=1)
    flight.ap.plans.replace(MissionType.MISSION, (place(0, 0, 5), place(90, 0, 5)))
    flight.ap.command_mode(FlightMode.MISSION)
    flight.run(5.0)
    flight.break_(mav.FAILURE_UNIT_SENSOR_GPS)
    flight.run(4.0)
    assert flight.ap.mode is FlightMode.MISSION  # coasting
    flight.run(2.0)
    assert (flight.ap.mode, flight.ap.landed_state) == (FlightMode.LAND, LandedState.LANDING)
    assert "Failsafe activated" in flight.texts
    flight.down()


@pytest.mark.parametrize("unit", [mav.FAILURE_UNIT_SENSOR_MAG, mav.FAILURE_UNIT_SENSOR_BARO])
@pytest.mark.parametrize("kind", [mav.FAILURE_TYPE_OFF, mav.FAILURE_TYPE_STUCK])
def test_magnetometer_or_barometer_lost_during_a_mission_does_not_end_it(unit: int, kind: int) -> None:
    flight = Flight()
    flight.ap.plans.replace(MissionType.MISSION, (place(0, 0, 5), place(12, 0, 5)))
    flight.ap.command_mode(FlightMode.MISSION)
    flight.run(1.0)
    flight.break_(unit, kind)
    flight.run(12.0)
    assert "Mission finished, loitering" in flight.texts
    assert not flight.ap.ready  # but nobody takes off like this


def test_gps_lost_high_up_lands_as_well_though_the_velocity_drifts_by_then() -> None:
    flight = Flight(MIS_TAKEOFF_ALT=20.0)
    flight.run(15.0)
    flight.break_(mav.FAILURE_UNIT_SENSOR_GPS)
    flight.down()
    north_m_s, east_m_s, _ = flight.sim.state.vel_ned_m_s
    assert math.hypot(north_m_s, east_m_s) > 1.5, "more than the land detector calls rest"
    assert flight.texts[-2:] == ["Landing detected", "Disarmed by landing"]


def test_a_gps_that_returns_gives_the_mode_back() -> None:
    flight = Flight()
    flight.break_(mav.FAILURE_UNIT_SENSOR_GPS, mav.FAILURE_TYPE_STUCK)
    flight.run(5.6)
    assert flight.ap.failsafe is not None
    flight.break_(mav.FAILURE_UNIT_SENSOR_GPS, mav.FAILURE_TYPE_OK)
    flight.run(0.2)
    assert flight.ap.failsafe is None
    assert flight.ap.mode is FlightMode.HOLD


def test_without_gyroscope_the_flight_is_terminated() -> None:
    flight = Flight()
    flight.break_(mav.FAILURE_UNIT_SENSOR_GYRO)
    flight.run(0.2)
    assert not flight.ap.armed


def test_too_much_tilt_is_said_and_terminates_where_the_breaker_is_out() -> None:
    told, ended = Flight(), Flight(CBRK_FLIGHTTERM=0)
    for flight in (told, ended):
        flight.break_(mav.FAILURE_UNIT_SYSTEM_MOTOR, instance=1)
        flight.run(2.0)
        assert "Attitude failure detected" in flight.texts
    assert told.ap.armed
    assert not ended.ap.armed


def test_a_landing_vehicle_does_not_turn_back_for_a_lost_ground_station() -> None:
    flight = Flight(NAV_DLL_ACT=2)
    flight.ap.command_land()
    flight.ap.guardian.hear_link(gcs_lost=True)
    flight.run(6.0)
    assert flight.ap.mode is FlightMode.LAND


def test_nothing_is_injected_by_an_unknown_unit_or_type() -> None:
    book = FaultBook()
    for unit, kind, instance in ((7, 1, 0), (4, 3, 0), (101, 1, 5), (101, 2, 1), (-1, 1, 0)):
        assert inject(book, unit, kind, instance).name == "UNSUPPORTED"
    assert book.quiet
    assert math.isclose(book.at(1.0).get("gps_off", 0.0), 0.0)
