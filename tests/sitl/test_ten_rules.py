"""Ten rules that break clients when missed: one test each, with pymavlink's mavutil over UDP."""

import math
import struct
import time
from collections.abc import Iterator

import pytest
from mavsdk_kit import vehicle
from pymavlink.dialects.v20 import common as mav
from raw_kit import Raw

from sitl.commands import HANDLERS
from sitl.modes import TITLES, FlightMode

INSTANCE = 241
PORT = 14550 + INSTANCE
MOVES = {mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, mav.MAV_CMD_COMPONENT_ARM_DISARM}


@pytest.fixture(scope="module")
def standing() -> Iterator[Raw]:
    """A client of a vehicle that stands ready at real time."""
    with vehicle(INSTANCE, 1.0):
        raw = Raw(PORT)
        yield raw.ready()
        raw.close()


def test_rule_1_the_heartbeat_is_an_autopilots_once_a_second(standing: Raw) -> None:
    standing.drain()
    beats = standing.during(4.2, "HEARTBEAT")
    assert 4 <= len(beats) <= 6
    for beat in beats:
        assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
        assert (beat.type, beat.autopilot) == (mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4)
        assert beat.base_mode & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED


def test_rule_2_health_bits_and_home_say_that_it_can_fly(standing: Raw) -> None:
    status = standing.next("SYS_STATUS")
    gps, prearm, sensors = 0x20, 0x10000000, 0x7
    assert status.onboard_control_sensors_present & (gps | sensors) == gps | sensors
    assert status.onboard_control_sensors_health & (gps | prearm | sensors) == gps | prearm | sensors
    home = standing.next("HOME_POSITION")
    assert home.latitude == pytest.approx(473977420, abs=100)


@pytest.mark.parametrize("number", sorted(set(HANDLERS) - MOVES))
def test_rule_3_a_command_full_of_nan_is_answered(standing: Raw, number: int) -> None:
    standing.drain()
    assert standing.command(number) in range(6)
    assert standing.command(mav.MAV_CMD_DO_SET_MODE, 1, 4, 3) == 0, "back to Hold"


def test_rule_4_component_0_is_meant_too_and_foreign_systems_are_not(standing: Raw) -> None:
    for target, answers in (((1, 0), 1), ((2, 1), 0), ((1, 7), 0), ((0, 0), 0)):
        standing.drain()
        standing.ask(mav.MAV_CMD_REQUEST_MESSAGE, 148, target=target)
        assert len(standing.during(0.6, "COMMAND_ACK")) == answers, target


def test_rule_5_exactly_one_answer_to_the_sender_within_half_a_second(standing: Raw) -> None:
    for number in (mav.MAV_CMD_REQUEST_MESSAGE, mav.MAV_CMD_DO_SET_MODE, mav.MAV_CMD_NAV_LAND, 31999):
        standing.drain()
        asked_s = time.monotonic()
        standing.ask(number, 1, 4, 3)
        ack = standing.next("COMMAND_ACK")
        assert time.monotonic() - asked_s < 0.5
        assert (ack.get_srcComponent(), ack.command) == (1, number)
        assert (ack.target_system, ack.target_component) == (255, standing.link.source_component)
        assert not standing.during(0.4, "COMMAND_ACK")


@pytest.mark.parametrize(("name", "kind", "value"), [("MIS_TAKEOFF_ALT", 9, 3.3), ("COM_FLTMODE1", 6, -1)])
def test_rule_6_parameters_come_back_byte_by_byte(standing: Raw, name: str, kind: int, value: float) -> None:
    raw = struct.pack("<f" if kind == 9 else "<i", value)
    sent = struct.unpack("<f", raw)[0]
    standing.drain()
    standing.link.mav.param_set_send(1, 1, name.encode(), sent, kind)
    echo = standing.next("PARAM_VALUE", fits=lambda m: m.param_id == name)
    assert (echo.param_type, struct.pack("<f", echo.param_value)) == (kind, raw)


def test_rule_7_missions_are_asked_for_with_whole_numbers(standing: Raw) -> None:
    standing.drain()
    standing.link.mav.mission_count_send(1, 1, 1, 0)
    ask = standing.next(["MISSION_REQUEST", "MISSION_REQUEST_INT"])
    assert ask.get_type() == "MISSION_REQUEST_INT"
    standing.link.mav.mission_item_int_send(1, 1, 0, 6, 16, 1, 1, 0, 2, 0, math.nan, 473977420, 85455940, 5.0, 0)
    assert standing.next("MISSION_ACK").type == mav.MAV_MISSION_ACCEPTED
    standing.link.mav.mission_clear_all_send(1, 1, 255)
    assert standing.next("MISSION_ACK").type == mav.MAV_MISSION_ACCEPTED


def test_rule_9_at_real_time_the_clock_runs_forward_and_true(standing: Raw) -> None:
    standing.drain()
    begun_s = time.monotonic()
    stamps = [m.time_boot_ms for m in standing.during(3.0, "ATTITUDE")]
    assert stamps == sorted(stamps)
    wall_s = time.monotonic() - begun_s
    assert (stamps[-1] - stamps[0]) / 1e3 == pytest.approx(wall_s, rel=0.25)


def test_rule_10_all_modes_are_there_one_by_one(standing: Raw) -> None:
    numbers = []
    for index in (1, 0):
        standing.drain()
        standing.ask(mav.MAV_CMD_REQUEST_MESSAGE, 435, index)
        seen = (m for m in standing.during(1.0) if m.get_msgId() == 435 or m.get_type() == "UNKNOWN_435")
        numbers += [bytes(m.get_msgbuf())[10:] for m in seen]
    modes = {struct.unpack_from("<I", body)[0] for body in numbers}
    assert modes == {int(mode) for mode in TITLES}
    assert len(numbers) == 1 + len(TITLES)
    assert standing.command(mav.MAV_CMD_REQUEST_MESSAGE, 435, 99) == mav.MAV_RESULT_DENIED


def test_rule_8_heartbeat_landed_state_and_disarming_follow_the_flight() -> None:
    with vehicle(INSTANCE + 1, 2.0):
        raw = Raw(PORT + 1).ready()
        raw.link.mav.set_position_target_local_ned_send(0, 1, 1, 1, 2552, 0, 0, -3, 0, 0, 0, 0, 0, 0, 0, 0)
        assert raw.command(mav.MAV_CMD_DO_SET_MODE, 1, 6) == 0
        raw.mode(FlightMode.OFFBOARD, 1.0)
        raw.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, 245, 20_000)
        assert raw.command(mav.MAV_CMD_DO_SET_MODE, 1, 4, 3) == 0
        assert raw.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        assert raw.command(mav.MAV_CMD_NAV_TAKEOFF) == 0
        seen, landed_ms, disarmed_ms = [1], 0, 0
        while not disarmed_ms:
            message = raw.next(["EXTENDED_SYS_STATE", "HEARTBEAT", "LOCAL_POSITION_NED"])
            kind = message.get_type()
            if kind == "LOCAL_POSITION_NED":
                now_ms = message.time_boot_ms
            elif kind == "EXTENDED_SYS_STATE" and message.landed_state != seen[-1]:
                seen.append(message.landed_state)
                landed_ms = now_ms
                if message.landed_state == mav.MAV_LANDED_STATE_IN_AIR:
                    raw.ask(mav.MAV_CMD_NAV_LAND)
            elif kind == "HEARTBEAT" and len(seen) == 5 and not message.base_mode & 128:
                disarmed_ms = now_ms
        raw.close()
    assert seen == [1, 3, 2, 4, 1]
    assert (disarmed_ms - landed_ms) / 1e3 == pytest.approx(2.0, abs=0.3)
