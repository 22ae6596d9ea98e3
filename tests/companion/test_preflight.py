"""Does the check before a flight find what is wrong, one fault at a time? A made-up vehicle heard for five seconds."""

import json
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pretend_vehicle import DISARMED
from pymavlink.dialects.v20 import common as mav

from companion.app import preflight
from companion.app.command_line import main
from companion.app.config import CompanionConfig
from companion.app.preflight.heard import Heard
from companion.app.preflight.lidar_rows import lidar_rows
from companion.app.preflight.own_rows import belief_row, log_row, params_row, policy_row, rehearsal_row
from companion.app.preflight.rows import Grade, Report, Row
from companion.app.preflight.vehicle_rows import vehicle_rows
from companion.core import codec, params
from companion.core.frames import quaternion
from companion.core.mavlink import LinkCounts
from companion.core.task import Task
from companion.core.types import LandedState, Scan, VehicleState
from companion.navigator import Params

PREARM = mav.MAV_SYS_STATUS_PREARM_CHECK
GPS, GYRO = mav.MAV_SYS_STATUS_SENSOR_GPS, mav.MAV_SYS_STATUS_SENSOR_3D_GYRO
PX4_SAID = {"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 5, "MPC_XY_VEL_MAX": 12.0}


def clutter(bearing_rad: np.ndarray) -> np.ndarray:
    """A yard: a wall on one side, two poles, the rest open."""
    off = (bearing_rad + math.pi) % math.tau - math.pi
    range_m = np.full(len(off), math.inf)
    wall = np.abs(off - 1.2) < 0.8
    range_m[wall] = 3.0 / np.cos(off[wall] - 1.2)
    range_m[np.abs(off + 0.6) < 0.15] = 2.0
    range_m[np.abs(off + 2.4) < 0.15] = 4.5
    return range_m


@dataclass
class Yard:
    """What a good vehicle says on the ground; tests spoil single things."""

    seconds: float = 5.0
    autopilot: int = mav.MAV_AUTOPILOT_PX4
    custom_mode: int = codec.PX4_HOLD
    base_mode: int = DISARMED
    state_hz: float = 50.0
    scan_hz: float = 10.0
    health: int = PREARM | GPS | GYRO
    px4_params: dict[str, float] = field(default_factory=lambda: dict(PX4_SAID))
    pace: float = 1.0  # vehicle seconds a second
    utc_off_s: float = 0.0
    leave_out: frozenset[str] = frozenset()
    late_s: float = 0.0  # of the scan stamps
    frame: int = mav.MAV_FRAME_BODY_FRD
    hides: Callable[[np.ndarray], np.ndarray] = lambda range_m: range_m
    texts: tuple[str, ...] = ()
    reboot_at_s: float = math.inf
    north_m: float = 0.0
    strangers: tuple[tuple[int, int, int], ...] = ()  # system, component, autopilot

    def heard(self) -> Heard:
        """Everything it says, in steps of 10 ms."""
        heard = Heard.nothing(Params().link)
        for k in range(1, round(self.seconds * 100)):
            now_s = k / 100
            t_s = 100.0 + now_s * self.pace if now_s < self.reboot_at_s else now_s - self.reboot_at_s
            for message, sender in self._due(k, t_s):
                heard.feed(arrived(message, *sender), now_s, 1.8e9 + now_s)
        return heard

    def _due(self, k: int, t_s: float) -> list[tuple[Any, tuple[int, int]]]:
        vehicle, lidar = (1, 1), (1, 191)
        due: list[tuple[Any, tuple[int, int]]] = []
        if k % 100 == 1:
            heartbeat = mav.MAVLink_heartbeat_message(2, self.autopilot, self.base_mode, self.custom_mode, 3, 3)
            due += [(heartbeat, vehicle), (codec.encode_extended_state(LandedState.ON_GROUND), vehicle)]
            due += [(self._status(), vehicle)]
            due += [(self._utc(k), vehicle)] if "utc" not in self.leave_out else []
            due += [(mav.MAVLink_statustext_message(2, text.encode()), vehicle) for text in self.texts]
            due += [(param_value(*item), vehicle) for item in self.px4_params.items()]
            due += [
                (mav.MAVLink_heartbeat_message(18, autopilot, 0, 0, 4, 3), (system, component))
                for system, component, autopilot in self.strangers
            ]
        if k % round(100 / self.state_hz) == 0:
            pos = np.array([self.north_m, 0.0, 0.0])
            state = VehicleState(t_s, pos, np.zeros(3), quaternion(0.0, 0.0, 0.3), np.zeros(3))
            due += [(codec.encode_attitude(state), vehicle), (codec.encode_position(state), vehicle)]
        if k % round(100 / self.scan_hz) == 0:
            due.append((self._scan(t_s - self.late_s), lidar))
        named = [(message, sender, message.get_type()) for message, sender in due]
        return [(message, sender) for message, sender, name in named if name not in self.leave_out]

    def _scan(self, t_s: float) -> Any:
        range_m = self.hides(clutter(np.arange(72) * math.radians(5.0)))
        message = codec.encode_scan(Scan(max(0.0, t_s), range_m, 0.0, math.radians(5.0), 0.1, 12.0))
        message.frame = self.frame
        return message

    def _status(self) -> Any:
        every = PREARM | GPS | GYRO
        return mav.MAVLink_sys_status_message(every, every, self.health, 0, 16000, -1, 90, 0, 0, 0, 0, 0, 0)

    def _utc(self, k: int) -> Any:
        return mav.MAVLink_system_time_message(round((1.8e9 + k / 100 - self.utc_off_s) * 1e6), 0)


def arrived(message: Any, system: int, component: int) -> Any:
    """Over the wire."""
    packet = message.pack(mav.MAVLink(None, system, component))
    return mav.MAVLink(None).decode(bytearray(packet))


def param_value(name: str, value: float) -> Any:
    """As PX4 sends it: an integer's bits in the float."""
    if isinstance(value, int):
        bits = struct.unpack("<f", struct.pack("<i", value))[0]
        return mav.MAVLink_param_value_message(name.encode(), bits, mav.MAV_PARAM_TYPE_INT32, 900, 1)
    return mav.MAVLink_param_value_message(name.encode(), value, mav.MAV_PARAM_TYPE_REAL32, 900, 1)


def rows_of(heard: Heard, tuned: Params | None = None, counts: LinkCounts | None = None) -> dict[str, Row]:
    tuned = tuned or Params()
    counts = counts or LinkCounts(received=5000)
    rows = [*vehicle_rows(heard, counts, "udpin://:14540", tuned, 3.0), *lidar_rows(heard, tuned)]
    assert len({row.name for row in rows}) == len(rows)
    return {row.name: row for row in rows}


def test_a_good_vehicle_is_fit_and_only_what_needs_motion_is_not_seen() -> None:
    rows = rows_of(Yard().heard())
    assert {row.name for row in rows.values() if row.grade is not Grade.OK} == {"LiDAR's orientation"}
    assert rows["LiDAR's orientation"].grade is Grade.OPEN
    assert "turn it by 90 deg and carry it 1 m" in rows["LiDAR's orientation"].advice
    assert Report(list(rows.values())).fit
    assert rows["attitude"].found == "50 Hz, longest gap 20 ms"
    assert rows["when we fall silent"].found == "after 1 s: hold"


FAULTS: list[tuple[str, dict[str, Any], str, Grade, str]] = [
    ("no heartbeat", {"leave_out": frozenset({"HEARTBEAT"})}, "vehicle", Grade.FAIL, "no autopilot heard"),
    ("another autopilot", {"autopilot": 3}, "vehicle", Grade.WARN, "autopilot type 3"),
    ("two vehicles", {"strangers": ((2, 1, 12),)}, "vehicle", Grade.FAIL, "autopilots 1, 2 on one link"),
    ("a second companion", {"strangers": ((1, 191, 8),)}, "other companions", Grade.FAIL, "1/191"),
    ("landed unknown", {"leave_out": frozenset({"EXTENDED_SYS_STATE"})}, "state", Grade.FAIL, "is not known"),
    ("armed", {"base_mode": 157}, "state", Grade.WARN, "armed, on ground"),
    ("in offboard", {"custom_mode": codec.PX4_OFFBOARD}, "state", Grade.FAIL, "already in OFFBOARD"),
    ("not armable", {"health": GPS | GYRO}, "autopilot's own checks", Grade.FAIL, "not ready to arm"),
    ("gyro ill", {"health": PREARM | GPS}, "autopilot's own checks", Grade.WARN, "not healthy: 3d_gyro"),
    ("no health", {"leave_out": frozenset({"SYS_STATUS"})}, "autopilot's own checks", Grade.OPEN, "no SYS_STATUS"),
    (
        "no attitude",
        {"leave_out": frozenset({"ATTITUDE_QUATERNION"})},
        "attitude",
        Grade.FAIL,
        "no ATTITUDE_QUATERNION",
    ),
    ("no position", {"leave_out": frozenset({"LOCAL_POSITION_NED"})}, "position", Grade.FAIL, "no LOCAL_POSITION_NED"),
    ("slow state", {"state_hz": 10.0}, "attitude", Grade.WARN, "10 Hz"),
    ("very slow state", {"state_hz": 4.0}, "position", Grade.FAIL, "longest gap 250 ms"),
    ("no estimate", {"north_m": math.nan}, "position", Grade.FAIL, "no valid estimate"),
    ("at its own pace", {"pace": 1.5}, "vehicle's clock", Grade.WARN, "1.5"),
    ("boots", {"reboot_at_s": 2.5}, "vehicle's clock", Grade.FAIL, "started again"),
    ("wrong date", {"utc_off_s": 3600.0}, "our clock", Grade.WARN, "+3600 s off"),
    ("no date", {"leave_out": frozenset({"SYSTEM_TIME"})}, "our clock", Grade.OPEN, "told no UTC"),
    ("params silent", {"px4_params": {}}, "when we fall silent", Grade.OPEN, "not told"),
    (
        "slow failsafe",
        {"px4_params": PX4_SAID | {"COM_OF_LOSS_T": 5.0}},
        "when we fall silent",
        Grade.WARN,
        "after 5 s",
    ),
    ("no brake", {"px4_params": PX4_SAID | {"COM_OBL_RC_ACT": 2}}, "when we fall silent", Grade.WARN, "manual"),
    ("slower than asked", {"px4_params": PX4_SAID | {"MPC_XY_VEL_MAX": 2.0}}, "speed", Grade.WARN, "cruise 3 m/s"),
    ("no scan", {"leave_out": frozenset({"OBSTACLE_DISTANCE"})}, "scan", Grade.FAIL, "no OBSTACLE_DISTANCE"),
    ("scan on another clock", {"late_s": 90.0}, "scan's age", Grade.FAIL, "100% of scans older"),
    ("scan ahead", {"late_s": -90.0}, "scan", Grade.FAIL, "none usable"),
    ("scan in no frame", {"frame": mav.MAV_FRAME_BODY_NED}, "scan", Grade.FAIL, "none usable"),
    ("slow scan", {"scan_hz": 5.0}, "scan", Grade.WARN, "5.0 Hz"),
    ("very slow scan", {"scan_hz": 2.0}, "scan", Grade.FAIL, "2.0 Hz"),
]


@pytest.mark.parametrize(
    ("spoilt", "row", "grade", "says"), [fault[1:] for fault in FAULTS], ids=[f[0] for f in FAULTS]
)
def test_one_fault_is_found_where_it_is(spoilt: dict[str, Any], row: str, grade: Grade, says: str) -> None:
    rows = rows_of(Yard(**spoilt).heard())
    assert rows[row].grade is grade
    assert says in rows[row].found
    assert rows[row].advice or row == "autopilot's own checks"
    assert Report(list(rows.values())).fit == all(r.grade is not Grade.FAIL for r in rows.values())


def test_the_autopilots_own_words_say_why_it_will_not_arm() -> None:
    heard = Yard(health=GPS, texts=("Preflight Fail: ekf2 missing data",)).heard()
    assert rows_of(heard)["autopilot's own checks"].advice == "Preflight Fail: ekf2 missing data"


def test_a_scan_on_another_clock_is_told_which_parameter_helps() -> None:
    assert "link.arrival_stamps" in rows_of(Yard(late_s=-90.0).heard())["scan"].advice
    tuned = params.update(Params(), {"link": {"arrival_stamps": True}})
    assert rows_of(Yard().heard(), tuned)["scan"].grade is Grade.OK


def test_a_blind_lidar_and_one_that_sees_its_own_arm_are_found() -> None:
    def blind(range_m: np.ndarray) -> np.ndarray:
        return np.where(np.arange(72) < 50, math.nan, range_m)

    def arm(range_m: np.ndarray) -> np.ndarray:
        return np.where(np.arange(72) == 9, 0.15, range_m)

    assert rows_of(Yard(hides=blind).heard())["view"].grade is Grade.FAIL
    itself = rows_of(Yard(hides=arm).heard())["sees itself"]
    assert (itself.grade, itself.found) == (Grade.FAIL, "something 0.15 m away at 45 deg, inside its own radius")


@pytest.mark.parametrize(
    ("counts", "grade"),
    [
        (LinkCounts(received=1000), Grade.OK),
        (LinkCounts(received=1000, lost=50), Grade.WARN),
        (LinkCounts(received=1000, lost=500), Grade.FAIL),
        (LinkCounts(received=1000, bad_bytes=5000), Grade.WARN),
    ],
)
def test_a_bad_link_is_found(counts: LinkCounts, grade: Grade) -> None:
    assert rows_of(Yard(seconds=2.0).heard(), counts=counts)["vehicle link"].grade is grade


def test_our_own_settings_are_judged() -> None:
    tuned = params.update(Params(), {"vehicle": {"radius_m": 0.5}})
    assert "changed: vehicle.radius_m 0.5" in params_row(tuned, None).found
    assert params_row(Params(), "unknown parameter group 'x'").grade is Grade.FAIL
    assert policy_row(Params()).grade is Grade.OK
    lost = params.update(Params(), {"policy": {"name": "geometrik"}})
    assert policy_row(lost).grade is Grade.FAIL
    assert "did you mean 'geometric'?" in policy_row(lost).found
    assert [log_row("f", free, None).grade for free in (10**7, 5 * 10**8, 10**10)] == [
        Grade.FAIL,
        Grade.WARN,
        Grade.OK,
    ]
    assert log_row("f", None, "may not be written").grade is Grade.FAIL
    assert [rehearsal_row([ms] * 9, None).grade for ms in (1.0, 30.0, 90.0)] == [Grade.OK, Grade.WARN, Grade.FAIL]
    assert rehearsal_row([], "ZeroDivisionError: x").grade is Grade.FAIL
    assert rehearsal_row([], None).grade is Grade.OPEN


def test_who_is_believed_is_told() -> None:
    assert belief_row(False, None, LinkCounts(received=9)).grade is Grade.OK
    assert belief_row(False, "warning: the whole network may steer", LinkCounts(received=9)).grade is Grade.WARN
    assert belief_row(True, None, LinkCounts(received=9)).found == "who has the key"
    assert belief_row(True, None, LinkCounts(received=9, forged=2)).grade is Grade.WARN
    keyless = belief_row(True, None, LinkCounts(unsigned=40))
    assert (keyless.grade, keyless.advice) == (Grade.FAIL, "the vehicle needs the same key")


def test_a_port_in_use_is_a_row_and_not_the_end(tmp_path: Path) -> None:
    config = CompanionConfig(Task(np.array([50.0, 0.0]), None, 3.0), tmp_path, "tcpout://127.0.0.1:9")
    rows = {row.name: row for row in preflight.check(config, 0.1).rows}
    assert rows["links"].grade is Grade.FAIL
    assert "tcp 127.0.0.1:9 cannot be reached" in rows["links"].found
    assert rows["log folder"].grade is Grade.OK


def test_nothing_heard_is_unfit_as_a_table_and_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "params.yaml").write_text("vehicel:\n  radius_m: 1\n")
    (tmp_path / "file").touch()
    arguments = ["--check", "--check-time", "0.1", "--vehicle", "udpin://127.0.0.1:14539"]
    assert main([*arguments, "--log", str(tmp_path / "file" / "log"), "--json"]) == 6
    told = json.loads(capsys.readouterr().out)
    grades = {row["name"]: row["grade"] for row in told["rows"]}
    assert (told["fit"], grades["vehicle"], grades["log folder"], grades["goal"]) == (False, "fail", "fail", "not seen")
    assert main([*arguments, "--log", str(tmp_path / "log"), "--params", str(tmp_path / "params.yaml")]) == 6
    out = capsys.readouterr().out
    assert "no autopilot heard on udpin://127.0.0.1:14539" in out
    assert "unknown parameter group 'vehicel'; did you mean 'vehicle'?" in out
    assert "NOT fit to fly: 2 to be seen to" in out
    assert not (tmp_path / "log").exists()
