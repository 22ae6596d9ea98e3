"""What MAVProxy 1.8.75 says, in its order and with its fields, said again: it must find the vehicle it expects."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest
from mavsdk_kit import vehicle
from mission_kit import item_int, place
from pymavlink.dialects.v20 import common as mav
from server_kit import Client

from sitl.mission_items import MissionItem
from sitl.modes import FlightMode

INSTANCE = 41
FTP = struct.Struct("<HBBBBBBI")
REAL32 = mav.MAV_PARAM_TYPE_REAL32
FRAME = mav.MAV_FRAME_GLOBAL_RELATIVE_ALT  # MAVProxy sends it in MISSION_ITEM_INT, too
ZEROS = (0.0, 0.0, 0.0, 0.0)


def in_frame(item: MissionItem) -> MissionItem:
    return MissionItem(FRAME, item.command, ZEROS, item.x, item.y, item.z)


ROUND = tuple(
    in_frame(item)
    for item in (
        place(0, 0, 5, mav.MAV_CMD_NAV_TAKEOFF),
        place(10, 0, 5),
        place(10, 8, 5),
        place(10, 8, 0, mav.MAV_CMD_NAV_LAND),
    )
)


@pytest.fixture(scope="module")
def talker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """255/230 on the ground station's link, heartbeat as a GCS."""
    folder: Path = tmp_path_factory.mktemp("logs")
    with vehicle(INSTANCE, 5.0, folder=folder):
        client = Client(14550 + INSTANCE, 18570 + INSTANCE, 255, 230)
        yield client.ready()
        client.close()


def order(client: Client, number: int, *params: float) -> int:
    """A COMMAND_LONG whose unused parameters are 0, not NaN; its result."""
    client.send(mav.MAVLink_command_long_message(1, 1, number, 0, *[*params, *[0.0] * 7][:7]))
    ack = client.until(lambda m: m.get_type() == "COMMAND_ACK" and m.command == number)
    assert (ack.target_system, ack.target_component) == (255, 230)
    return int(ack.result)


def test_the_file_of_parameters_is_refused_and_the_list_is_complete(talker: Client) -> None:
    name = b"@PARAM/param.pck?withdefaults=1"
    body = FTP.pack(0, 117, 4, len(name), 0, 0, 0, 0) + name
    talker.send(mav.MAVLink_file_transfer_protocol_message(0, 1, 1, list(body.ljust(251, b"\0"))))
    answer = FTP.unpack_from(bytes(talker.message("FILE_TRANSFER_PROTOCOL").payload))
    assert (answer[2], answer[4]) == (129, 4)
    talker.send(mav.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    talker.send(mav.MAVLink_param_request_list_message(1, 1))
    talker.until(lambda m: m.get_type() == "PARAM_VALUE" and m.param_index == m.param_count - 1)
    values = [m for m in talker.seen if m.get_type() == "PARAM_VALUE"]
    names = {m.param_id for m in values}
    assert {"_HASH_CHECK", "MIS_TAKEOFF_ALT", "COM_OF_LOSS_T"} < names
    assert {m.param_index for m in values} == {*range(len(names) - 1), 65535}
    assert {m.param_count for m in values} == {len(names) - 1}


def test_a_parameter_is_set_and_echoed(talker: Client) -> None:
    talker.send(mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 4.0, REAL32))
    echo = talker.until(lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == "MIS_TAKEOFF_ALT")
    assert (echo.param_value, echo.param_type) == (4.0, REAL32)


@pytest.mark.parametrize("whole", [True, False], ids=["MISSION_ITEM_INT", "MISSION_ITEM"])
def test_a_mission_goes_up_and_comes_down(talker: Client, whole: bool) -> None:
    talker.send(mav.MAVLink_mission_count_message(1, 1, len(ROUND), 0))
    for seq, item in enumerate(ROUND):
        assert talker.message("MISSION_REQUEST_INT").seq == seq
        talker.send(item_int(seq, item, current=int(seq == 0)) if whole else item_float(seq, item))
    assert talker.message("MISSION_ACK").type == mav.MAV_MISSION_ACCEPTED
    talker.send(mav.MAVLink_mission_request_list_message(1, 1, 0))
    assert talker.message("MISSION_COUNT").count == len(ROUND)
    for seq, item in enumerate(ROUND):
        ask = mav.MAVLink_mission_request_int_message if whole else mav.MAVLink_mission_request_message
        talker.send(ask(1, 1, seq, 0))
        back = talker.message("MISSION_ITEM_INT" if whole else "MISSION_ITEM")
        scale = 1.0 if whole else 1e7
        assert (back.seq, back.command, back.z) == (seq, item.command, item.z)
        assert back.frame == (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT if whole else FRAME)
        # single floats: the older message knows a place to a few decimetres only
        assert (back.x * scale, back.y * scale) == pytest.approx((item.x, item.y), abs=1.0 if whole else 40.0)
    talker.send(mav.MAVLink_mission_ack_message(1, 1, 0, 0))  # MAVProxy leaves it out and waits for PX4 to give up


def item_float(seq: int, item: MissionItem) -> mav.MAVLink_mission_item_message:
    return mav.MAVLink_mission_item_message(
        1, 1, seq, FRAME, item.command, int(seq == 0), 1, *ZEROS, item.x / 1e7, item.y / 1e7, item.z, 0
    )


def test_it_arms_takes_off_changes_modes_and_flies_the_mission(talker: Client) -> None:
    assert order(talker, mav.MAV_CMD_NAV_TAKEOFF, *[0.0] * 6, math.nan) == 0
    talker.told("Using default takeoff altitude: 4.0 m")
    assert order(talker, mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == 0
    talker.mode(FlightMode.TAKEOFF)
    talker.mode(FlightMode.HOLD)
    talker.until(lambda m: m.get_type() == "LOCAL_POSITION_NED" and abs(m.z + 4.0) < 0.3)
    talker.send(mav.MAVLink_set_mode_message(1, 29, FlightMode.LAND))  # as MAVProxy up to 1.8.70
    talker.until(lambda m: m.get_type() == "COMMAND_ACK" and m.command == mav.MAV_CMD_DO_SET_MODE)
    talker.mode(FlightMode.LAND)
    assert order(talker, mav.MAV_CMD_DO_SET_MODE, 29.0, 4.0, 3.0) == 0
    talker.mode(FlightMode.HOLD)
    assert order(talker, mav.MAV_CMD_MISSION_START) == 0
    talker.until(lambda m: m.get_type() == "MISSION_ITEM_REACHED" and m.seq == 2, 40.0)
    talker.told("Disarmed by landing", 40.0)


def test_starting_the_mission_arms_a_vehicle_on_the_ground(talker: Client) -> None:
    assert order(talker, mav.MAV_CMD_MISSION_START) == 0
    talker.told("Armed by mission start")
    assert order(talker, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0) == 0


def test_the_flight_is_in_the_log(talker: Client) -> None:
    talker.send(mav.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    entry = talker.message("LOG_ENTRY")
    assert entry.num_logs >= 1
    talker.send(mav.MAVLink_log_request_data_message(1, 1, entry.id, 0, 0xFFFFFFFF))
    talker.until(lambda m: m.get_type() == "LOG_DATA" and m.ofs + m.count >= entry.size)
    blocks = {m.ofs: bytes(m.data[: m.count]) for m in talker.seen if m.get_type() == "LOG_DATA"}
    talker.send(mav.MAVLink_log_request_end_message(1, 1))
    assert blocks[0].startswith(b"ULog")
    assert sum(map(len, blocks.values())) >= entry.size
