import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mav
from server_kit import Client, vehicle

from companion.core.clock import SystemClock
from companion.core.transport import TransportError
from companion.core.udp import Udp
from sitl.link import bind
from sitl.modes import FlightMode
from sitl.server import RunConfig

NAN6 = [math.nan] * 6


@pytest.fixture(scope="module")
def standing() -> Iterator[Client]:
    """A client of a vehicle that stands on the ground, ready, at twice real time."""
    with vehicle(211, RunConfig(speed=2.0)):
        client = Client(14030 + 211, 14280 + 211)
        yield client.ready()
        client.close()


def sp_message(time_boot_ms: int, x: float, y: float, z: float, target: tuple[int, int] = (1, 1)) -> Any:
    return mav.MAVLink_set_position_target_local_ned_message(
        time_boot_ms, *target, 1, 0b100111111000, x, y, z, 0, 0, 0, 0, 0, 0, 0, 0
    )


@pytest.mark.parametrize(
    ("number", "params", "result"),
    [
        (mav.MAV_CMD_REQUEST_MESSAGE, (148,), 0),
        (mav.MAV_CMD_REQUEST_MESSAGE, (242,), 0),
        (mav.MAV_CMD_REQUEST_MESSAGE, (300,), 0),
        (mav.MAV_CMD_REQUEST_MESSAGE, (435, 0), 0),
        (mav.MAV_CMD_REQUEST_MESSAGE, (435, 99), 2),
        (mav.MAV_CMD_REQUEST_MESSAGE, (397,), 2),
        (mav.MAV_CMD_REQUEST_MESSAGE, (math.nan,), 2),
        (mav.MAV_CMD_REQUEST_MESSAGE, (1e30,), 2),
        (mav.MAV_CMD_SET_MESSAGE_INTERVAL, (32, 1e5), 0),
        (mav.MAV_CMD_SET_MESSAGE_INTERVAL, (9999, 1e5), 4),
        (mav.MAV_CMD_SET_MESSAGE_INTERVAL, (0, 1e5), 4),
        (mav.MAV_CMD_SET_MESSAGE_INTERVAL, (32, 1e5, 1.0), 4),
        (mav.MAV_CMD_GET_MESSAGE_INTERVAL, (32,), 0),
        (mav.MAV_CMD_REQUEST_PROTOCOL_VERSION, (1,), 0),
        (mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, (1,), 0),
        (mav.MAV_CMD_GET_HOME_POSITION, (), 0),
        (mav.MAV_CMD_DO_SET_MODE, (1, 6), 0),
        (mav.MAV_CMD_DO_SET_MODE, (1, 4, 3), 0),
        (mav.MAV_CMD_DO_SET_MODE, (1, 77), 1),
        (mav.MAV_CMD_DO_SET_MODE, (math.nan, 4, 3), 1),
        (mav.MAV_CMD_COMPONENT_ARM_DISARM, (0,), 0),
        (mav.MAV_CMD_COMPONENT_ARM_DISARM, (math.nan,), 1),
        (mav.MAV_CMD_DO_DIGICAM_CONTROL, (), 3),
        (65000, (), 3),
    ],
)
def test_every_command_gets_the_answer_of_px4(
    standing: Client, number: int, params: tuple[float, ...], result: int
) -> None:
    assert standing.command(number, *params) == result


@pytest.mark.parametrize(("target", "answered"), [((1, 0), True), ((0, 0), False), ((2, 1), False), ((1, 25), False)])
def test_only_commands_to_this_autopilot_are_answered(
    standing: Client, target: tuple[int, int], answered: bool
) -> None:
    standing.poll()
    standing.send(mav.MAVLink_command_long_message(*target, 512, 0, 148, *NAN6))
    deadline_s = time.monotonic() + 0.3
    acks = []
    while time.monotonic() < deadline_s:
        acks += [m for m in standing.poll() if m.get_type() == "COMMAND_ACK"]
    assert bool(acks) is answered


def test_a_broadcast_question_for_the_version_is_answered(standing: Client) -> None:
    assert standing.command(mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1, target=(0, 0)) == 0


def test_set_mode_and_command_int_are_answered_like_command_long(standing: Client) -> None:
    standing.send(mav.MAVLink_set_mode_message(1, 1, int(FlightMode.HOLD)))
    assert standing.message("COMMAND_ACK").result == 0
    standing.send(mav.MAVLink_command_int_message(1, 1, 0, 512, 0, 0, 148, *[math.nan] * 3, 0, 0, math.nan))
    assert standing.message("AUTOPILOT_VERSION").capabilities & mav.MAV_PROTOCOL_CAPABILITY_MISSION_INT


def test_parameters_are_read_set_and_listed_bytewise(standing: Client) -> None:
    standing.send(mav.MAVLink_param_request_list_message(1, 1))
    first = standing.message("PARAM_VALUE")
    while len({m.param_id for m in standing.seen if m.get_type() == "PARAM_VALUE"}) < first.param_count:
        standing.poll()
    standing.send(mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 3.3, mav.MAV_PARAM_TYPE_REAL32))
    assert standing.message("PARAM_VALUE").param_value == np.float32(3.3)
    standing.send(mav.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", math.nan, mav.MAV_PARAM_TYPE_REAL32))
    standing.send(mav.MAVLink_param_set_message(1, 1, b"NO_SUCH", 1.0, mav.MAV_PARAM_TYPE_REAL32))
    standing.send(mav.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", 5.0, mav.MAV_PARAM_TYPE_REAL32))
    five = float(np.array([5], dtype="<i4").view("<f4")[0])
    standing.send(mav.MAVLink_param_set_message(1, 0, b"COM_OBL_RC_ACT", five, mav.MAV_PARAM_TYPE_INT32))
    echo = standing.message("PARAM_VALUE")
    assert (echo.param_id, echo.param_value, echo.param_type) == ("COM_OBL_RC_ACT", five, mav.MAV_PARAM_TYPE_INT32)
    standing.send(mav.MAVLink_param_request_read_message(1, 1, b"MIS_TAKEOFF_ALT", -1))
    assert standing.message("PARAM_VALUE").param_value == np.float32(3.3)


def test_ping_timesync_and_mission_list_are_answered(standing: Client) -> None:
    standing.send(mav.MAVLink_ping_message(77, 5, 0, 0))
    ping = standing.message("PING")
    assert (ping.time_usec, ping.seq, ping.target_system, ping.target_component) == (77, 5, 245, 190)
    standing.send(mav.MAVLink_timesync_message(0, 1234))
    sync = standing.message("TIMESYNC")
    assert sync.ts1 == 1234
    assert sync.tc1 > 0
    standing.send(mav.MAVLink_mission_request_list_message(1, 1, 0))
    assert standing.message("MISSION_COUNT").count == 0


def test_a_setpoint_in_an_unknown_frame_is_refused_with_px4s_text(standing: Client) -> None:
    wrong = mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, 7, 0, *[0.0] * 11)
    standing.send(wrong)
    standing.told("SET_POSITION_TARGET_LOCAL_NED coordinate frame 7 unsupported")


def test_garbage_neither_stops_the_vehicle_nor_its_answers(standing: Client) -> None:
    rng = np.random.default_rng(0)
    packet = mav.MAVLink_command_long_message(1, 1, 512, 0, 148, *NAN6).pack(mav.MAVLink(None, 245, 190))
    for _ in range(200):
        broken = bytearray(packet)
        broken[rng.integers(len(broken))] = rng.integers(256)
        standing._connection.transport.send(bytes(broken[: rng.integers(1, len(broken))]))
        standing._connection.transport.send(rng.bytes(int(rng.integers(1, 300))))
    assert standing.command(mav.MAV_CMD_REQUEST_MESSAGE, 148) == 0


def test_a_vehicle_that_is_not_ready_says_so_and_does_not_arm() -> None:
    with vehicle(212, RunConfig(speed=0.2)):
        client = Client(14030 + 212, 14280 + 212)
        assert client.command(400, 1.0) == 1
        first = client.message("HEARTBEAT")
        assert (first.type, first.autopilot, first.system_status) == (2, 12, 0)
        client.told("Arming denied: Resolve system health failures first")
        assert client.command(512, 242) == 2, "no home yet"
        client.close()


def test_streams_keep_px4s_rates_at_real_time() -> None:
    with vehicle(213, RunConfig(speed=1.0)):
        clients = {n: Client(port + 213, own + 213) for n, port, own in (("api", 14540, 14580), ("gcs", 14550, 18570))}
        for client in clients.values():
            client.message("HEARTBEAT")
        rates = {}
        deadline_s = time.monotonic() + 3.0
        for client in clients.values():
            client.seen.clear()
        while time.monotonic() < deadline_s:
            for client in clients.values():
                client.poll(0.005)
        for name, client in clients.items():
            kinds = [m.get_type() for m in client.seen]
            rates[name] = {kind: kinds.count(kind) / 3.0 for kind in set(kinds)}
            client.close()
    for kind, hz in {"ATTITUDE": 100, "ATTITUDE_QUATERNION": 50, "LOCAL_POSITION_NED": 50, "SYS_STATUS": 5}.items():
        assert rates["api"][kind] == pytest.approx(hz, rel=0.25)
    assert rates["api"]["OBSTACLE_DISTANCE"] == pytest.approx(25, rel=0.25)
    for kind, hz in {"ATTITUDE": 50, "GLOBAL_POSITION_INT": 50, "GPS_RAW_INT": 5, "VFR_HUD": 4}.items():
        assert rates["gcs"][kind] == pytest.approx(hz, rel=0.35)


def test_a_fast_vehicle_does_not_flood_its_operator() -> None:
    with vehicle(214, RunConfig(speed=20.0)):
        client = Client(14030 + 214, 14280 + 214)
        client.message("HEARTBEAT")
        client.seen.clear()
        deadline_s = time.monotonic() + 1.0
        while time.monotonic() < deadline_s:
            client.poll()
        stamps = [m.time_boot_ms for m in client.seen if m.get_type() == "LOCAL_POSITION_NED"]
        client.close()
    assert 20 <= len(stamps) <= 60
    assert stamps[-1] - stamps[0] > 10_000, "twenty seconds of flight in one"


def test_a_port_in_use_is_named_and_nothing_stays_open() -> None:
    clock = SystemClock()
    taken = Udp("taken", ("0.0.0.0", 14280 + 215))
    with pytest.raises(TransportError, match=str(14280 + 215)):
        bind(215, clock)
    taken.close()
    for _, transport in bind(215, clock):
        transport.close()


def test_a_rate_asked_for_is_kept_and_can_be_taken_back() -> None:
    with vehicle(220, RunConfig(speed=1.0)):
        client = Client(14540 + 220, 14580 + 220)
        client.message("HEARTBEAT")
        counts = []
        for interval_us in (100_000.0, -1.0, 0.0):
            assert client.command(511, 32, interval_us) == 0
            client.seen.clear()
            deadline_s = time.monotonic() + 1.0
            while time.monotonic() < deadline_s:
                client.poll()
            counts.append(sum(m.get_type() == "LOCAL_POSITION_NED" for m in client.seen))
        client.close()
    scans = 25  # each scan brings its position with it
    assert counts == [pytest.approx(c, rel=0.3) for c in (scans, scans, 50)]


def test_a_lost_stream_lands_the_vehicle_by_px4s_default() -> None:
    with vehicle(219, RunConfig(speed=6.0)) as server:
        client = Client(14540 + 219, 14580 + 219).ready()
        assert client.command(400, 1.0) == 0
        assert client.command(22) == 0
        client.mode(FlightMode.HOLD)
        for _ in range(5):
            client.send(sp_message(1, 1.0, 0.0, -2.5))
            client.poll()
        assert client.command(176, 1.0, 6.0) == 0
        client.until(lambda m: m.get_type() == "HEARTBEAT" and m.system_status == mav.MAV_STATE_CRITICAL)
        client.mode(FlightMode.POSCTL)
        client.until(lambda m: m.get_type() == "HEARTBEAT" and not m.base_mode & 128, 15.0)
        assert "Failsafe activated" in client.texts()
        assert not server.sim.contact
        client.close()
