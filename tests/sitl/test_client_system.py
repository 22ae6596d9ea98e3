"""A client asks: parameters, versions, logs, shell, files, calibration, home, reboot, rates. MAVSDK and pymavlink."""

import asyncio
import math
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mavsdk.asyncio.plugins.calibration import CalibrationAsync
from mavsdk.asyncio.plugins.failure import FailureAsync, FailureError
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.log_files import LogFilesAsync
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError
from mavsdk.plugins.failure import FailureType, FailureUnit
from mavsdk_kit import Pilot, fly, vehicle
from pymavlink.dialects.v20 import common as mav
from raw_kit import Raw

from sitl.message_table import BUILDERS
from sitl.messages_modes import orbit_execution_status
from sitl.param_file import ParamFile, ParamFileError, read_param_file
from sitl.px4_param_table import PARAMS
from sitl.px4_params import ParamStore
from sitl.streams import CURRENT_MODE_ID, ONBOARD_HZ

INSTANCE = 261
PORT = 14540 + INSTANCE
FLYING_ONLY = {mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, mav.MAVLINK_MSG_ID_ATTITUDE_TARGET}
ORBITING_ONLY = {mav.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS}


@pytest.fixture(scope="module")
def standing() -> Iterator[Raw]:
    """A client of a vehicle that stands ready."""
    with vehicle(INSTANCE, 2.0):
        raw = Raw(PORT)
        yield raw.ready()
        raw.close()


def test_mavsdk_reads_and_sets_parameters_versions_and_failures() -> None:
    async def story(pilot: Pilot) -> None:
        params, info = ParamAsync(pilot.system), InfoAsync(pilot.system)
        everything = await params.get_all_params()
        names = {p.name for p in (*everything.int_params, *everything.float_params)}
        assert set(PARAMS) <= names
        await params.set_param_float("RTL_RETURN_ALT", 12.5)
        assert await params.get_param_float("RTL_RETURN_ALT") == pytest.approx(12.5)
        await params.set_param_int("COM_OBL_RC_ACT", 5)
        assert await params.get_param_int("COM_OBL_RC_ACT") == 5
        with pytest.raises(ParamError):
            await params.set_param_int("RTL_RETURN_ALT", 1)
        assert await pilot.action.get_return_to_launch_altitude() == pytest.approx(12.5)
        version = await info.get_version()
        assert (version.flight_sw_major, version.flight_sw_minor) == (1, 16)
        failure = FailureAsync(pilot.system)
        with pytest.raises(FailureError):
            await failure.inject(FailureUnit.SENSOR_GPS, FailureType.OFF, 0)
        await params.set_param_int("SYS_FAILURE_EN", 1)
        await FailureAsync(pilot.system).inject(FailureUnit.SENSOR_MAG, FailureType.OK, 0)
        steps = [step async for step in CalibrationAsync(pilot.system).calibrate_gyro()]
        assert steps[-1][0].name == "SUCCESS", steps

    fly(INSTANCE + 1, story, 2.0)


def test_mavsdk_downloads_the_log_of_a_flight(tmp_path: Path) -> None:
    async def story(pilot: Pilot) -> None:
        await pilot.action.arm()
        await asyncio.sleep(0.6)
        await pilot.action.disarm()
        await pilot.until(lambda: not pilot.armed)
        await asyncio.sleep(1.0)  # the disarm ends the log
        logs = LogFilesAsync(pilot.system)
        entries = await logs.get_entries()
        assert [e.id for e in entries] == [0]
        target = tmp_path / "copy.ulg"
        async for _ in logs.download_log_file(entries[0], str(target)):
            pass
        assert target.read_bytes() == (folder / "flight_000.ulg").read_bytes()
        assert target.read_bytes().startswith(b"ULog\x01\x12\x35")

    folder = tmp_path / "logs"
    folder.mkdir()
    fly(INSTANCE + 2, story, 2.0, folder=folder)


@pytest.mark.parametrize("message_id", sorted(BUILDERS))
def test_every_message_comes_when_it_is_asked_for(standing: Raw, message_id: int) -> None:
    standing.drain()
    standing.ask(mav.MAV_CMD_REQUEST_MESSAGE, message_id)
    ack = standing.next("COMMAND_ACK")
    absent = message_id in FLYING_ONLY | ORBITING_ONLY
    assert ack.result == (mav.MAV_RESULT_DENIED if absent else mav.MAV_RESULT_ACCEPTED)


def test_streams_have_px4s_rates_and_obey_511_and_510(standing: Raw) -> None:
    standing.drain()
    seen = [m.get_type() for m in standing.during(2.0)]
    for kind, hz in {
        "HIGHRES_IMU": 50,
        "ODOMETRY": 30,
        "SERVO_OUTPUT_RAW": 10,
        "TIMESYNC": 10,
        "SYSTEM_TIME": 1,
    }.items():
        assert seen.count(kind) / 2.0 == pytest.approx(hz, rel=0.35, abs=0.5), kind
    for kind in ("ACTUATOR_OUTPUT_STATUS", "HIL_STATE_QUATERNION", "RC_CHANNELS"):
        assert kind not in seen
    assert standing.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, 50_000) == 0
    assert standing.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_HIGHRES_IMU, -1) == 0
    standing.drain()
    seen = [m.get_type() for m in standing.during(1.0)]
    assert seen.count("HIL_STATE_QUATERNION") == pytest.approx(20, rel=0.4)
    assert "HIGHRES_IMU" not in seen
    standing.ask(mav.MAV_CMD_GET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_HIL_STATE_QUATERNION)
    assert standing.next("MESSAGE_INTERVAL").interval_us == 50_000
    assert set(ONBOARD_HZ) <= set(BUILDERS)
    assert CURRENT_MODE_ID in BUILDERS


def test_ping_and_timesync_are_answered_with_vehicle_time(standing: Raw) -> None:
    standing.link.mav.ping_send(77, 5, 0, 0)
    pong = standing.next("PING", fits=lambda m: m.target_system == 255)
    assert (pong.time_usec, pong.seq) == (77, 5)
    standing.link.mav.timesync_send(0, 1234)
    sync = standing.next("TIMESYNC", fits=lambda m: m.ts1 == 1234)
    boot_ms = standing.next("ATTITUDE").time_boot_ms
    assert sync.tc1 / 1e6 == pytest.approx(boot_ms, abs=200)


def test_file_transfer_is_refused_and_the_shell_only_prompts(standing: Raw) -> None:
    open_file = struct.pack("<HBBBBBBI", 9, 0, 4, 5, 0, 0, 0, 0) + b"@PARA"
    standing.link.mav.file_transfer_protocol_send(0, 1, 1, list(open_file.ljust(251, b"\0")))
    reply = bytes(standing.next("FILE_TRANSFER_PROTOCOL").payload)
    sequence, _, opcode, _, asked = struct.unpack_from("<HBBBB", reply)
    assert (sequence, opcode, asked, reply[12]) == (10, 129, 4, 10)
    typed = b"ver all\n"
    standing.link.mav.serial_control_send(10, 6, 0, 0, len(typed), list(typed.ljust(70, b"\0")))
    said = standing.next("SERIAL_CONTROL")
    assert bytes(said.data[: said.count]) == b"\nnsh: ver: command not found\nnsh> "


def test_without_logs_the_list_says_none_and_an_unknown_log_is_silence(standing: Raw) -> None:
    standing.drain()
    standing.link.mav.log_request_list_send(1, 1, 0, 0xFFFF)
    assert standing.maybe("LOG_ENTRY", 0.4) is None, "this vehicle keeps no logs at all"
    standing.link.mav.log_request_data_send(1, 1, 3, 0, 90)
    assert standing.maybe("LOG_DATA", 0.3) is None


def test_the_list_starts_with_the_hash_and_the_hash_follows_the_values(standing: Raw) -> None:
    hashes = []
    for value in (3.0, 4.0):
        standing.link.mav.param_set_send(1, 1, b"MPC_LAND_ALT2", value, mav.MAV_PARAM_TYPE_REAL32)
        standing.next("PARAM_VALUE", fits=lambda m: m.param_id == "MPC_LAND_ALT2")
        standing.drain()
        standing.link.mav.param_request_list_send(1, 1)
        first = standing.next("PARAM_VALUE")
        assert (first.param_id, first.param_index, first.param_type) == ("_HASH_CHECK", 65535, 5)
        got = {m.param_index for m in standing.during(1.5, "PARAM_VALUE")}
        assert got == set(range(first.param_count))
        hashes.append(struct.pack("<f", first.param_value))
    assert hashes[0] != hashes[1]


def test_home_can_be_moved_and_put_back(standing: Raw) -> None:
    here = standing.next("HOME_POSITION")
    standing.link.mav.command_int_send(1, 1, 0, 179, 0, 0, 0, 0, 0, math.nan, 473980000, 85460000, 495.0)
    assert standing.next("COMMAND_ACK").result == 0
    moved = standing.next("HOME_POSITION", fits=lambda m: m.latitude != here.latitude)
    assert (moved.latitude, moved.longitude, moved.altitude) == (
        pytest.approx(473980000, abs=2),
        pytest.approx(85460000, abs=2),
        495000,
    )
    assert standing.command(mav.MAV_CMD_DO_SET_HOME, 1) == 0
    standing.next("HOME_POSITION", fits=lambda m: abs(m.latitude - here.latitude) < 3)


@pytest.mark.parametrize(
    ("number", "params", "result"),
    [
        (185, (1,), 2),
        (192, (-1, 0), 3),
        (192, (-1, 1), 0),
        (246, (0,), 0),
        (246, (2,), 2),
        (262, (99,), 4),
        (262, (6,), 0),
        (241, (1,), 0),
        (203, (1,), 3),
        (183, (1,), 3),
        (187, (1,), 0),
        (34, (1e9,), 1),
        (34, (5, 1), 0),
        (176, (1, 4, 3), 0),
    ],
)
def test_commands_on_the_ground_get_px4s_answers(
    standing: Raw, number: int, params: tuple[float, ...], result: int
) -> None:
    standing.drain()
    assert standing.command(number, *params) == result


def test_a_reboot_starts_time_anew_and_keeps_parameters_and_place() -> None:
    with vehicle(INSTANCE + 3, 4.0) as server:
        raw = Raw(PORT + 3).ready()
        raw.take_off(3.0)
        assert raw.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mav.MAV_RESULT_DENIED, "in the air"
        assert raw.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196) == 0
        raw.next("EXTENDED_SYS_STATE", 20.0, lambda m: m.landed_state == 1)
        before = raw.next("ATTITUDE").time_boot_ms
        assert raw.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == 0
        assert raw.next("ATTITUDE", 5.0, lambda m: m.time_boot_ms < before).time_boot_ms < 8000
        for _ in range(2):  # it can fly again
            raw.next("LOCAL_POSITION_NED", 5.0)
        raw.ready()
        raw.take_off(2.0)
        assert server.sim.autopilot.params["MIS_TAKEOFF_ALT"] == 2.0
        assert orbit_execution_status(server.sim) is None
        assert raw.command(mav.MAV_CMD_DO_FLIGHTTERMINATION, 1) == 0
        raw.mode(10 << 16)
        assert raw.command(mav.MAV_CMD_DO_SET_MODE, 1, 4, 3) == 1, "no way back"
        raw.next("HEARTBEAT", 30.0, lambda m: not m.base_mode & 128)
        raw.close()


def test_parameters_survive_in_a_file_that_ground_stations_read(tmp_path: Path) -> None:
    path, store = tmp_path / "vehicle.params", ParamStore()
    file = ParamFile(path, 1, {name: store[name] for name in store.names()})
    assert read_param_file(path, store) == {}
    store.set("MIS_TAKEOFF_ALT", float(np.float32(3.3)))
    store.set("COM_OBL_RC_ACT", 5)
    file.save(store)
    assert read_param_file(path, ParamStore()) == {"MIS_TAKEOFF_ALT": float(np.float32(3.3)), "COM_OBL_RC_ACT": 5}
    written = path.stat().st_mtime_ns
    file.save(store)
    assert path.stat().st_mtime_ns == written, "nothing new, nothing written"


@pytest.mark.parametrize("line", ["1\t1\tNO_SUCH\t1\t6", "1\t1\tMIS_TAKEOFF_ALT\tx\t9", "MIS_TAKEOFF_ALT 3"])
def test_a_wrong_parameter_file_names_the_line(tmp_path: Path, line: str) -> None:
    path = tmp_path / "bad.params"
    path.write_text(f"# head\n{line}\n", encoding="utf-8")
    with pytest.raises(ParamFileError, match="line 2"):
        read_param_file(path, ParamStore())
