"""Are there scans, of now, all round, and do they point where they say? Pure judgements of what was heard."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.app.preflight.heard import Heard
from companion.app.preflight.rows import Grade, Row
from companion.core import codec
from companion.navigator import Params
from companion.perception.orientation import Fault, Orientation, judge_orientation

RATE_WARN_HZ: Final = 8.0
PER_PATIENCE: Final = 2.0  # scans that must fit into the time after which the scan counts as lost
STALE_FAIL: Final = 0.1  # share of scans
UNKNOWN_WARN, UNKNOWN_FAIL = 0.1, 0.5  # share of sectors
ALWAYS: Final = 0.8  # share of scans in which something sits on the vehicle before it counts as part of it


def lidar_rows(heard: Heard, params: Params) -> Iterator[Row]:
    """What can be said of the LiDAR; only the first row without a scan."""
    yield _scan(heard, params)
    if not heard.ticks:
        return
    yield _age(heard, params)
    yield _view(heard)
    yield _itself(heard, params)
    yield _orientation(judge_orientation(heard.ticks))


def _scan(heard: Heard, params: Params) -> Row:
    name = "scan"
    if heard.scan.count == 0:
        return Row(name, Grade.FAIL, "no OBSTACLE_DISTANCE", "is the LiDAR powered and turning, --lidar right?")
    if not heard.ticks:
        return Row(name, Grade.FAIL, f"{heard.scan.count} scans, none usable", _why_unusable(heard))
    found = f"{heard.scan.rate_hz:.1f} Hz, longest gap {heard.scan.worst_gap_s * 1e3:.0f} ms"
    if heard.scan.worst_gap_s * PER_PATIENCE > params.link.scan_lost_s:
        return Row(name, Grade.FAIL, found, f"scans count as lost after {params.link.scan_lost_s:g} s: more of them")
    if heard.scan.rate_hz < RATE_WARN_HZ:
        return Row(name, Grade.WARN, found, "slow scans: cruise slowly")
    return Row(name, Grade.OK, found)


def _why_unusable(heard: Heard) -> str:
    """The first reason for which no scan came through."""
    message = heard.last_scan
    if message is None or heard.assembler.latest_state() is None:
        return "no state of the vehicle to go with them"
    if message.frame not in (mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_BODY_FRD):
        return f"frame {message.frame}: only GLOBAL (0) and BODY_FRD (12) are understood"
    off_s = codec.from_us(message.time_usec) - heard.assembler.vehicle_time_s
    if abs(off_s) > 1.0:
        return f"stamped {off_s:+.1f} s off the vehicle's clock: link.arrival_stamps: true"
    return "wrong component (link.lidar_component), or increment of zero"


def _age(heard: Heard, params: Params) -> Row:
    stale = sum(not tick.fresh for tick in heard.ticks) / len(heard.ticks)
    found = f"{stale:.0%} of scans older than {params.link.max_scan_age_s:g} s"
    if stale > STALE_FAIL:
        advice = "the navigator would hold: link too slow, or stamps that lag (link.arrival_stamps)"
        return Row("scan's age", Grade.FAIL, found, advice)
    return Row("scan's age", Grade.OK, found)


def _view(heard: Heard) -> Row:
    unknown = float(np.mean([np.isnan(tick.scan.range_m).mean() for tick in heard.ticks]))
    found = f"{1 - unknown:.0%} of sectors known"
    if unknown > UNKNOWN_WARN:
        grade = Grade.FAIL if unknown > UNKNOWN_FAIL else Grade.WARN
        return Row("view", grade, found, "unknown counts as unsafe: is something in front of the LiDAR?")
    return Row("view", Grade.OK, found)


def _itself(heard: Heard, params: Params) -> Row:
    """Does the vehicle see its own arms, legs or antennas?"""
    radius_m = params.vehicle.radius_m
    near = [float(np.nanmin(tick.scan.range_m, initial=math.inf)) for tick in heard.ticks]
    if np.mean([range_m < radius_m for range_m in near]) > ALWAYS:
        last = heard.ticks[-1].scan
        sector = int(np.argmin(np.nan_to_num(last.range_m, nan=math.inf)))
        bearing_deg = math.degrees(last.angle_offset_rad + sector * last.increment_rad)
        found = f"something {min(near):.2f} m away at {bearing_deg:.0f} deg, inside its own radius"
        return Row("sees itself", Grade.FAIL, found, "move the LiDAR, or raise lidar.range_min_m beyond it")
    return Row("sees itself", Grade.OK, f"nothing within its radius of {radius_m:g} m")


def _orientation(seen: Orientation) -> Row:
    name = "LiDAR's orientation"
    if seen.fault is Fault.MIRRORED:
        return Row(name, Grade.FAIL, "turns against the vehicle: mirrored", "lidar.clockwise: false (or upside down?)")
    if seen.fault is Fault.TURNED:
        off_deg = math.degrees(seen.offset_rad)
        found = f"its zero points {off_deg:+.0f} deg off the nose"
        return Row(name, Grade.FAIL, found, f"lidar.mount_yaw_rad: {seen.offset_rad:+.2f} more")
    ways = [] if seen.hand_seen else ["turn it by 90 deg"]
    ways += [] if seen.offset_seen else ["carry it 1 m"]
    if ways:
        found = f"turned {math.degrees(seen.turned_rad):.0f} deg, moved {seen.moved_m:.1f} m: cannot tell"
        return Row(name, Grade.OPEN, found, f"{' and '.join(ways)} while the check listens (--check-time 30)")
    return Row(name, Grade.OK, "agrees with the vehicle's turning and moving")
