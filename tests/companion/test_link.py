"""Do the inputs of a tick carry the state of the scan's very instant, whatever the order and the gaps?"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.frames import quaternion, yaw_rad
from companion.core.inputs import Inputs
from companion.core.mavlink import PacketParser
from companion.core.tlog import TlogWriter
from companion.core.types import LandedState, Scan, VehicleState
from companion.link.assembler import Assembler
from companion.link.params import LinkParams
from companion.link.replay import replay
from companion.link.samples import Samples, state_at

ARMED_OFFBOARD = (145, codec.PX4_OFFBOARD, 4)


def state(t_s: float) -> VehicleState:
    """A vehicle that flies east and turns right."""
    pos = np.array([0.1 * t_s * t_s, 2.0 * t_s, -3.0])
    return VehicleState(
        t_s, pos, np.array([0.2 * t_s, 2.0, 0.0]), quaternion(0.05, -0.1, 0.4 * t_s), np.array([0.0, 0.0, 0.4])
    )


def scan(t_s: float, offset_rad: float = 0.0) -> Scan:
    return Scan(t_s, np.full(72, 4.0 + t_s), offset_rad, math.radians(5.0), 0.2, 30.0)


def sent_by(message: Any, component: int = 1, system: int = 1) -> Any:
    (parsed,) = PacketParser().feed(message.pack(mav.MAVLink(None, srcSystem=system, srcComponent=component)))
    return parsed


def greeting() -> list[Any]:
    return [codec.encode_vehicle_heartbeat(*ARMED_OFFBOARD), codec.encode_extended_state(LandedState.IN_AIR)]


def state_messages(t_s: float) -> list[Any]:
    return [codec.encode_attitude(state(t_s)), codec.encode_position(state(t_s))]


def feed(assembler: Assembler, *messages: Any, component: int = 1) -> list[Inputs]:
    fed = [assembler.feed(sent_by(message, component)) for message in messages]
    return [inputs for inputs in fed if inputs is not None]


def greeted(params: LinkParams | None = None) -> Assembler:
    assembler = Assembler(params or LinkParams())
    feed(assembler, *greeting())
    return assembler


def assert_same_state(left: VehicleState, right: VehicleState) -> None:
    for name in ("t_s", "pos_ned_m", "vel_ned_m_s", "q_ned_frd", "rates_frd_rad_s"):
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name), err_msg=name)


@pytest.mark.parametrize("k", range(0, 2000, 37))
def test_a_state_sampled_at_the_scans_instant_goes_in_bit_for_bit(k: int) -> None:
    t_s = k * 0.04
    (inputs,) = feed(greeted(), *state_messages(t_s), codec.encode_scan(scan(t_s)))
    assert_same_state(inputs.state, codec.quantise_state(state(t_s)))
    np.testing.assert_array_equal(inputs.scan.range_m, codec.quantise_scan(scan(t_s)).range_m)
    assert inputs.fresh
    assert (inputs.status.armed, inputs.status.offboard, inputs.status.landed) == (True, True, LandedState.IN_AIR)


@given(share=st.floats(0.05, 0.95), late=st.booleans())
@settings(max_examples=50, deadline=None)
def test_between_two_samples_the_state_is_interpolated(share: float, late: bool) -> None:
    before_s, after_s = 10.0, 10.03
    t_s = before_s + share * (after_s - before_s)
    order = (after_s, before_s) if late else (before_s, after_s)
    assembler = greeted()
    feed(assembler, *state_messages(order[0]), *state_messages(order[1]))
    (inputs,) = feed(assembler, codec.encode_scan(scan(t_s)))
    np.testing.assert_allclose(inputs.state.pos_ned_m, state(t_s).pos_ned_m, atol=2e-4)
    np.testing.assert_allclose(inputs.state.q_ned_frd, state(t_s).q_ned_frd, atol=1e-5)
    assert np.linalg.norm(inputs.state.q_ned_frd) == pytest.approx(1.0)
    assert inputs.fresh


def test_a_scan_a_little_newer_than_the_state_gets_it_carried_forward() -> None:
    assembler = greeted()
    feed(assembler, *state_messages(5.0))
    (inputs,) = feed(assembler, codec.encode_scan(scan(5.03)))
    assert inputs.fresh
    assert inputs.state.t_s == 5.03
    np.testing.assert_allclose(inputs.state.pos_ned_m, state(5.03).pos_ned_m, atol=1e-3)
    assert yaw_rad(inputs.state.q_ned_frd) == pytest.approx(0.4 * 5.03, abs=5e-3)


def test_quaternions_of_opposite_sign_are_interpolated_the_short_way() -> None:
    attitude, position = Samples(), Samples()
    zero = np.zeros(3)
    position.put(0.0, zero, zero)
    attitude.put(0.0, quaternion(0.0, 0.0, 1.0), zero)
    attitude.put(1.0, -quaternion(0.0, 0.0, 1.2), zero)
    assert yaw_rad(state_at(position, attitude, 0.5, 0.2).q_ned_frd) == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("state_s", "scan_s", "fresh"),
    [(10.0, 10.2, True), (10.0, 10.25, False), (10.0, 10.9, False), (10.15, 10.0, True), (10.9, 10.0, False)],
)
def test_state_and_scan_that_are_too_far_apart_are_not_fresh(state_s: float, scan_s: float, fresh: bool) -> None:
    (inputs,) = feed(greeted(), *state_messages(state_s), codec.encode_scan(scan(scan_s)))
    assert inputs.fresh is fresh


def test_a_scan_that_took_long_is_not_fresh_although_its_state_is_known() -> None:
    assembler = greeted()
    for k in range(20):
        feed(assembler, *state_messages(10.0 + 0.04 * k))
    (inputs,) = feed(assembler, codec.encode_scan(scan(10.0)))
    assert not inputs.fresh
    assert_same_state(inputs.state, codec.quantise_state(state(10.0)))


def test_nothing_is_released_before_status_and_state_were_heard() -> None:
    assembler = Assembler(LinkParams())
    assert feed(assembler, *state_messages(1.0), codec.encode_scan(scan(1.0))) == []
    assert feed(assembler, *greeting(), codec.encode_scan(scan(1.04))) == []  # state came before its sender was known
    assert feed(assembler, codec.encode_position(state(1.08)), codec.encode_scan(scan(1.08))) == []
    assert len(feed(assembler, *state_messages(1.12), codec.encode_scan(scan(1.12)))) == 1
    assert assembler.dropped_scans == 3


def test_a_lidar_on_another_connection_is_merged_by_time_stamp() -> None:
    assembler = greeted()
    for k in range(5):
        feed(assembler, *state_messages(2.0 + 0.02 * k))
    (inputs,) = feed(assembler, codec.encode_scan(scan(2.05)), component=195)
    np.testing.assert_allclose(inputs.state.pos_ned_m, state(2.05).pos_ned_m, atol=1e-4)


def test_only_the_lidar_named_by_its_component_is_listened_to() -> None:
    assembler = greeted(LinkParams(lidar_component=195))
    feed(assembler, *state_messages(2.0))
    assert feed(assembler, codec.encode_scan(scan(2.0))) == []
    assert len(feed(assembler, codec.encode_scan(scan(2.0)), component=195)) == 1
    assert assembler.dropped_scans == 0


def test_a_lidar_that_does_not_know_vehicle_time_is_stamped_on_arrival() -> None:
    unix_s = 1.8e9
    assert feed(greeted(), *state_messages(2.0), codec.encode_scan(scan(unix_s))) == []  # of another clock
    assembler = greeted(LinkParams(arrival_stamps=True))
    (inputs,) = feed(assembler, *state_messages(2.0), codec.encode_scan(scan(unix_s)))
    assert inputs.scan.t_s == inputs.state.t_s == 2.0
    assert feed(assembler, codec.encode_scan(scan(unix_s + 0.04))) == []  # no newer state: nothing new to say


def test_repeated_and_late_scans_are_dropped_and_counted() -> None:
    assembler = greeted()
    feed(assembler, *state_messages(2.0), *state_messages(2.04))
    assert len(feed(assembler, codec.encode_scan(scan(2.04)))) == 1
    assert feed(assembler, codec.encode_scan(scan(2.04)), codec.encode_scan(scan(2.0))) == []
    assert assembler.dropped_scans == 2


def test_other_vehicles_and_ground_stations_are_not_listened_to() -> None:
    assembler = greeted()
    feed(assembler, *state_messages(2.0))
    other = codec.encode_vehicle_heartbeat(29, 50593792, 3)
    for system, component in ((2, 1), (1, 191), (255, 190)):
        assembler.feed(sent_by(other, component, system))
        assembler.feed(sent_by(codec.encode_position(state(2.04)), component, system))
    assert assembler.vehicle_system == 1
    assert assembler.vehicle_time_s == 2.0
    assert assembler.status is not None
    assert assembler.status.offboard


def test_a_heartbeat_without_an_autopilot_is_no_vehicle() -> None:
    assembler = Assembler(LinkParams())
    feed(assembler, codec.encode_companion_heartbeat())
    assert assembler.vehicle_system is None
    assert assembler.status is None


def test_a_vehicle_that_reboots_is_followed_into_its_new_time() -> None:
    assembler = greeted()
    feed(assembler, *state_messages(500.0), codec.encode_scan(scan(500.0)))
    for k in range(1, 6):
        feed(assembler, *state_messages(k / 50))
    assert assembler.reboots == 1
    assert assembler.status is None  # who was armed and in OFFBOARD is not any more
    heartbeat = codec.encode_vehicle_heartbeat(29, codec.PX4_HOLD, 3)
    (inputs,) = feed(assembler, heartbeat, *state_messages(1.0), codec.encode_scan(scan(1.0)))
    assert_same_state(inputs.state, codec.quantise_state(state(1.0)))
    assert not inputs.status.armed


def test_a_few_packets_that_come_seconds_late_are_no_reboot() -> None:
    assembler = greeted()
    feed(assembler, *state_messages(500.0))
    for k in range(1, 20):
        late = state_messages(490.0 + k / 50)
        assert feed(assembler, *late, *late, *state_messages(500.0 + k / 50)) == []
    assert assembler.reboots == 0
    assert assembler.vehicle_time_s == 500.38


@pytest.mark.parametrize("broken", ["position", "attitude"])
def test_an_estimate_that_is_not_a_number_counts_as_nothing_heard(broken: str) -> None:
    assembler = greeted()
    feed(assembler, *state_messages(2.0))
    attitude, position = state_messages(2.4)
    if broken == "position":
        position.x = math.nan
    else:
        attitude.q1 = math.inf
    (inputs,) = feed(assembler, attitude, position, codec.encode_scan(scan(2.4)))
    assert not inputs.fresh
    assert np.isfinite(inputs.state.pos_ned_m).all()


def test_an_unreadable_scan_is_dropped_and_counted() -> None:
    assembler = greeted()
    message = codec.encode_scan(scan(2.0))
    message.frame = 8
    assert feed(assembler, *state_messages(2.0), message) == []
    assert assembler.dropped_scans == 1


def test_a_north_aligned_scan_is_turned_into_the_body_frame() -> None:
    message = codec.encode_scan(scan(2.0))
    message.frame = mav.MAV_FRAME_GLOBAL
    (inputs,) = feed(greeted(), *state_messages(2.0), message)
    assert inputs.scan.angle_offset_rad == pytest.approx(-0.8, abs=1e-6)


def test_samples_stay_bounded() -> None:
    samples = Samples()
    for k in range(1000):
        samples.put(k * 0.01, np.zeros(3), np.zeros(3))
    assert samples.newest_s == 9.99
    assert samples.gap_s(0.0) > 8.0


@given(data=st.binary(max_size=400), seed=st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_whatever_parses_never_raises(data: bytes, seed: int) -> None:
    rng = np.random.default_rng(seed)
    assembler = greeted()
    for _ in range(10):
        t_s = float(rng.uniform(0.0, 3.0))
        messages = [*state_messages(t_s), codec.encode_scan(scan(t_s, offset_rad=float(rng.uniform(-9, 9))))]
        for message in rng.permutation(np.array(messages, dtype=object)):
            packet = bytearray(message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1)))
            for parsed in PacketParser().feed(data + bytes(packet)):
                assembler.feed(parsed)


def test_a_replay_of_the_log_gives_the_same_inputs(tmp_path: Path) -> None:
    path = tmp_path / "companion.tlog"
    log = TlogWriter(path)
    live: list[Inputs] = []
    assembler, parser = Assembler(LinkParams()), PacketParser()
    rng = np.random.default_rng(1)
    for k in range(200):
        t_s = 0.04 * k
        batch = [*greeting(), *state_messages(t_s)] if rng.random() < 0.7 else []
        batch += [codec.encode_scan(scan(t_s - float(rng.choice([0.0, 0.013]))))] if rng.random() < 0.8 else []
        for message in batch:
            packet = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1))
            log.write(k, packet)
            live += [i for m in parser.feed(packet) if (i := assembler.feed(m)) is not None]
        log.write(k, codec.encode_companion_heartbeat().pack(mav.MAVLink(None, srcSystem=1, srcComponent=191)))
    log.close()
    again = list(replay(path))
    assert len(again) == len(live) > 100
    for left, right in zip(live, again, strict=True):
        assert_same_state(left.state, right.state)
        np.testing.assert_array_equal(left.scan.range_m, right.scan.range_m)
        assert (left.scan.t_s, left.status, left.fresh) == (right.scan.t_s, right.status, right.fresh)
