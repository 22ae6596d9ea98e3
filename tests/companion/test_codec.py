"""Is what the wire delivers what the codec promises? Real packing and parsing against ``quantise_*``."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.mavlink import PacketParser
from companion.core.sectors import bin_scan
from companion.core.types import LandedState, Scan, Setpoint, VehicleState

FINITE = st.floats(-1e5, 1e5)
TIMES = st.floats(0.0, 1e5)
VECTORS = st.tuples(FINITE, FINITE, FINITE).map(np.array)
AXES = st.tuples(*[st.one_of(FINITE, st.just(math.nan))] * 3).map(np.array)
RANGES = st.one_of(st.floats(0.0, 60.0), st.just(math.inf), st.just(math.nan))


@st.composite
def scans(draw: st.DrawFn) -> Scan:
    count = draw(st.one_of(st.integers(1, 72), st.sampled_from([72, 73, 100, 180, 360, 500])))
    span_deg = draw(st.floats(min(10.0, count), 360.0))
    return Scan(
        t_s=draw(TIMES),
        range_m=np.array(draw(st.lists(RANGES, min_size=count, max_size=count))),
        angle_offset_rad=draw(st.floats(-math.pi, math.pi)),
        increment_rad=math.radians(span_deg / count),
        range_min_m=draw(st.floats(0.0, 1.0)),
        range_max_m=draw(st.floats(2.0, 50.0)),
    )


@st.composite
def setpoints(draw: st.DrawFn) -> Setpoint:
    part = st.one_of(st.none(), AXES)
    return Setpoint(draw(TIMES), draw(part), draw(part), draw(part), draw(st.one_of(st.none(), st.floats(-7, 7))))


def through_the_wire(message: Any) -> Any:
    packet = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1))
    (parsed,) = PacketParser().feed(packet)
    return parsed


def assert_same(left: Any, right: Any) -> None:
    for field in dataclasses.fields(left):
        a, b = getattr(left, field.name), getattr(right, field.name)
        assert (a is None) == (b is None), field.name
        if a is not None:
            np.testing.assert_array_equal(a, b, err_msg=field.name)


@given(t_s=TIMES, pos=VECTORS, vel=VECTORS, rates=VECTORS, q=st.tuples(*[st.floats(-1, 1)] * 4).map(np.array))
@settings(max_examples=100)
def test_a_quantised_state_is_the_state_that_the_wire_delivers(
    t_s: float, pos: Any, vel: Any, rates: Any, q: Any
) -> None:
    state = VehicleState(t_s, pos, vel, q, rates)
    attitude, position = (through_the_wire(m) for m in (codec.encode_attitude(state), codec.encode_position(state)))
    delivered = codec.decode_state(attitude, position)
    assert_same(delivered, codec.quantise_state(state))
    assert_same(codec.quantise_state(delivered), delivered)
    np.testing.assert_allclose(delivered.pos_ned_m, pos, rtol=1e-6, atol=1e-6)
    assert delivered.t_s == pytest.approx(t_s, abs=0.000501)


@given(scan=scans())
@settings(max_examples=100, deadline=None)
def test_a_quantised_scan_is_the_scan_that_the_wire_delivers(scan: Scan) -> None:
    delivered = codec.decode_scan(through_the_wire(codec.encode_scan(scan)))
    assert_same(delivered, codec.quantise_scan(scan))
    assert_same(codec.quantise_scan(delivered), delivered)
    assert len(delivered.range_m) <= 72


@given(setpoint=setpoints())
@settings(max_examples=100)
def test_a_quantised_setpoint_is_the_setpoint_that_the_wire_delivers(setpoint: Setpoint) -> None:
    delivered = codec.decode_setpoint(through_the_wire(codec.encode_setpoint(setpoint)))
    assert_same(delivered, codec.quantise_setpoint(setpoint))
    assert_same(codec.quantise_setpoint(delivered), delivered)


@pytest.mark.parametrize("k", range(0, 100000, 997))
def test_state_and_scan_of_the_same_instant_carry_the_same_time(k: int) -> None:
    t_s = k * 0.04
    assert codec.from_ms(codec.to_ms(t_s)) == codec.from_us(codec.to_us(t_s))


def test_sector_ranges_mean_hit_free_and_unknown() -> None:
    range_m = np.full(72, math.inf)
    range_m[[0, 1, 2]] = (1.234, 45.0, math.nan)
    message = codec.encode_scan(Scan(1.5, range_m, 0.0, math.radians(5.0), 0.2, 30.0))
    assert message.distances[:4] == [123, 3000, 65535, 3001]
    assert (message.increment, message.increment_f, message.frame) == (5, pytest.approx(5.0), 12)
    assert (message.min_distance, message.max_distance, message.time_usec) == (20, 3000, 1500000)
    np.testing.assert_array_equal(codec.decode_scan(message).range_m[:4], [1.23, 30.0, math.nan, math.inf])


def test_a_counter_clockwise_scan_reads_like_its_clockwise_twin() -> None:
    ranges = np.arange(1.0, 73.0) / 4
    clockwise = codec.decode_scan(codec.encode_scan(Scan(0.0, ranges, -1.0, math.radians(5.0), 0.2, 30.0)))
    message = codec.encode_scan(Scan(0.0, ranges[::-1], 0.0, math.radians(5.0), 0.2, 30.0))
    message.increment_f = -5.0
    message.angle_offset = math.degrees(-1.0) + 71 * 5.0
    turned = codec.decode_scan(message)
    np.testing.assert_array_equal(turned.range_m, clockwise.range_m)
    assert turned.angle_offset_rad == pytest.approx(clockwise.angle_offset_rad)
    assert turned.increment_rad == clockwise.increment_rad


def test_a_north_aligned_scan_is_turned_by_yaw() -> None:
    message = codec.encode_scan(Scan(0.0, np.ones(72), 0.25, math.radians(5.0), 0.2, 30.0))
    message.frame = mav.MAV_FRAME_GLOBAL
    assert codec.decode_scan(message, yaw_rad=0.75).angle_offset_rad == pytest.approx(-0.5)


@pytest.mark.parametrize(("field", "value"), [("frame", 8), ("angle_offset", math.nan), ("increment_f", math.inf)])
def test_a_scan_that_cannot_be_placed_is_refused(field: str, value: float) -> None:
    message = codec.encode_scan(Scan(0.0, np.ones(72), 0.25, math.radians(5.0), 0.2, 30.0))
    setattr(message, field, value)
    with pytest.raises(codec.CodecError, match="OBSTACLE_DISTANCE"):
        codec.decode_scan(message)


def test_a_scan_without_increment_f_uses_the_whole_degrees() -> None:
    message = codec.encode_scan(Scan(0.0, np.ones(36), 0.0, math.radians(10.0), 0.2, 30.0))
    message.increment_f = 0.0
    assert codec.decode_scan(message).increment_rad == pytest.approx(math.radians(10.0))
    message.increment = 0
    with pytest.raises(codec.CodecError):
        codec.decode_scan(message)


def test_five_rays_become_one_sector_with_the_nearest_hit() -> None:
    rays = np.full(360, math.inf)
    rays[2], rays[4], rays[355:360] = 7.0, 6.0, math.nan
    rays[10:12] = math.nan
    rays[15:18] = math.nan
    binned = bin_scan(Scan(0.0, rays, 0.0, math.radians(1.0), 0.2, 30.0))
    assert binned.range_m[0] == 6.0
    assert math.isnan(binned.range_m[71])
    assert math.isinf(binned.range_m[2])  # two of five rays unknown: the sector was seen
    assert math.isnan(binned.range_m[3])  # three of five: it was not
    assert binned.increment_rad == pytest.approx(math.radians(5.0))
    assert binned.angle_offset_rad == pytest.approx(math.radians(2.0))


@given(scan=scans())
@settings(max_examples=50, deadline=None)
def test_binning_never_loses_a_hit_nor_moves_it_out_of_its_sector(scan: Scan) -> None:
    binned = bin_scan(scan)
    for i in np.flatnonzero(np.isfinite(scan.range_m)):
        bearing = scan.angle_offset_rad + i * scan.increment_rad
        sector = round((bearing - binned.angle_offset_rad) / binned.increment_rad)
        assert binned.range_m[min(max(sector, 0), len(binned.range_m) - 1)] <= scan.range_m[i]


def test_position_and_yaw_alone_make_the_type_mask_that_px4_documents() -> None:
    message = codec.encode_setpoint(Setpoint(2.04, np.array([1.0, 2.0, -3.0]), None, None, 0.5))
    assert message.type_mask == 0b100111111000  # velocity, acceleration and yaw rate taken out
    assert (message.time_boot_ms, message.target_system, message.target_component) == (2040, 1, 1)
    assert message.coordinate_frame == mav.MAV_FRAME_LOCAL_NED


@pytest.mark.parametrize(
    ("base_mode", "custom_mode", "armed", "offboard"),
    [
        (29, 50593792, False, False),  # PX4 on the ground in HOLD
        (157, 50593792, True, False),
        (17, 393216, False, True),
        (145, 393216, True, True),  # PX4 flying OFFBOARD
        (209, 196608, True, False),
        (128, 393216, True, False),  # no custom mode flag: custom_mode means nothing
    ],
)
def test_heartbeats_of_px4_are_understood(base_mode: int, custom_mode: int, armed: bool, offboard: bool) -> None:
    heartbeat = through_the_wire(codec.encode_vehicle_heartbeat(base_mode, custom_mode, 4))
    status = codec.decode_status(heartbeat, None)
    assert (status.armed, status.offboard, status.landed) == (armed, offboard, LandedState.UNDEFINED)


@pytest.mark.parametrize("landed", list(LandedState))
def test_landed_state_goes_through(landed: LandedState) -> None:
    assert codec.decode_landed(through_the_wire(codec.encode_extended_state(landed))) is landed


def test_a_landed_state_from_the_future_is_undefined() -> None:
    message = codec.encode_extended_state(LandedState.ON_GROUND)
    message.landed_state = 77
    assert codec.decode_landed(message) is LandedState.UNDEFINED


def test_the_companion_does_not_look_like_a_vehicle() -> None:
    heartbeat = codec.encode_companion_heartbeat()
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.base_mode) == (18, 8, 0)
