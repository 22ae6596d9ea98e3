"""Does the LiDAR point where it says? Judged from how its scans change while the vehicle moves; pure; local ned.

Seen from two poses the same surroundings must lie in the same place. Every way of being mounted (counted the wrong way
round or not, zero turned off the nose by so much) is tried; the one under which the scans agree best is how it sits.
Turning tells a mirrored LiDAR, moving tells a turned one; a vehicle that stands still tells nothing.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from companion.core.frames import wrap_rad, yaw_rad
from companion.core.inputs import Inputs
from companion.core.types import F64

STEP_DEG: Final = 15  # between the tried offsets
FRAMES_MAX: Final = 8
POINTS_MIN: Final = 8  # hits of a scan below which it shows too little
RANGE_MAX_M: Final = 12.0  # farther hits are too coarse: a sector is a metre wide there
DISTANCE_MAX_M: Final = 1.0  # a point without a partner counts this much
TURN_MIN_RAD: Final = math.radians(25.0)
MOVE_MIN_M: Final = 0.8
BETTER: Final = 0.7  # another mounting must fit with at most this share of the misfit to be believed
ALIKE: Final = 1.15  # the mounting as given may fit worse than the best by this, and still be it


class Fault(StrEnum):
    """What is wrong with the mounting."""

    MIRRORED = "mirrored"
    TURNED = "turned"


@dataclass(frozen=True, slots=True)
class Orientation:
    """The answer; ``hand_seen`` and ``offset_seen`` tell which of the two could be judged at all."""

    fault: Fault | None
    offset_rad: float  # where its zero points from the nose, as far as the scans show
    hand_seen: bool
    offset_seen: bool
    turned_rad: float  # how far the vehicle turned between the scans
    moved_m: float


def judge_orientation(ticks: Sequence[Inputs]) -> Orientation:
    """Judge scans taken in motion; any number of them, in order of time."""
    frames = _keyframes([tick for tick in ticks if _hits(tick) >= POINTS_MIN])
    turned_rad, moved_m = _motion(frames)
    turns, moves = turned_rad >= TURN_MIN_RAD, moved_m >= MOVE_MIN_M
    if not (turns or moves):
        return Orientation(None, 0.0, False, False, turned_rad, moved_m)
    offsets_deg = list(range(0, 360, STEP_DEG))
    plain = np.array([_misfit_m(frames, False, math.radians(deg)) for deg in offsets_deg])
    mirrored = np.array([_misfit_m(frames, True, math.radians(deg)) for deg in offsets_deg]) if turns else None
    if mirrored is not None and mirrored.min() < BETTER * plain.min():
        return Orientation(Fault.MIRRORED, 0.0, True, False, turned_rad, moved_m)
    hand_seen = mirrored is not None and plain.min() < BETTER * mirrored.min()
    best = int(plain.argmin())
    if moves and plain[best] < BETTER * plain[0]:
        offset_rad = wrap_rad(math.radians(offsets_deg[best]))
        return Orientation(Fault.TURNED, offset_rad, hand_seen, True, turned_rad, moved_m)
    away = plain[_is_far_off(offsets_deg)].min()
    offset_seen = moves and plain[0] <= ALIKE * plain[best] and plain[0] < BETTER * away
    return Orientation(None, 0.0, hand_seen, offset_seen, turned_rad, moved_m)


def _is_far_off(offsets_deg: list[int]) -> list[bool]:
    """Offsets that a good mounting must be told from: more than two steps."""
    return [min(deg, 360 - deg) > 2 * STEP_DEG for deg in offsets_deg]


def _hits(tick: Inputs) -> int:
    return int(np.count_nonzero(tick.scan.range_m < RANGE_MAX_M))


def _keyframes(ticks: list[Inputs]) -> list[Inputs]:
    """A few poses, as different as there are: each next one is the farthest from those already chosen."""
    if not ticks:
        return []
    poses = np.array([_pose(tick) for tick in ticks])
    chosen = [0]
    nearest = _apart(poses, poses[0])
    while len(chosen) < FRAMES_MAX and nearest.max() > 0.25:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, _apart(poses, poses[chosen[-1]]))
    return [ticks[i] for i in sorted(chosen)]


def _pose(tick: Inputs) -> tuple[float, float, float]:
    north_m, east_m, _ = tick.state.pos_ned_m.tolist()
    return north_m, east_m, yaw_rad(tick.state.q_ned_frd)


def _apart(poses: F64, pose: F64) -> F64:
    """How different poses are, in units of the least motion that tells something."""
    moved = np.hypot(poses[:, 0] - pose[0], poses[:, 1] - pose[1]) / MOVE_MIN_M
    turned = np.abs((poses[:, 2] - pose[2] + math.pi) % math.tau - math.pi) / TURN_MIN_RAD
    apart: F64 = moved + turned
    return apart


def _motion(frames: list[Inputs]) -> tuple[float, float]:
    """The largest turn and the largest way between any two."""
    turned_rad, moved_m = 0.0, 0.0
    for one, other in itertools.combinations([_pose(frame) for frame in frames], 2):
        turned_rad = max(turned_rad, abs(wrap_rad(one[2] - other[2])))
        moved_m = max(moved_m, math.hypot(one[0] - other[0], one[1] - other[1]))
    return turned_rad, moved_m


def _misfit_m(frames: list[Inputs], mirrored: bool, offset_rad: float) -> float:
    """Mean distance from the hits of one scan to those of another, over all pairs, for one way of being mounted."""
    clouds = [_points_ne_m(frame, mirrored, offset_rad) for frame in frames]
    trees = [cKDTree(cloud) for cloud in clouds]
    misfits = []
    for i, j in itertools.permutations(range(len(frames)), 2):
        distance_m, _ = trees[i].query(clouds[j], distance_upper_bound=DISTANCE_MAX_M)
        misfits.append(float(np.minimum(distance_m, DISTANCE_MAX_M).mean()))
    return float(np.mean(misfits))


def _points_ne_m(frame: Inputs, mirrored: bool, offset_rad: float) -> F64:
    """Hits in local ned, level flight assumed."""
    scan = frame.scan
    hit = np.flatnonzero(scan.range_m < RANGE_MAX_M)
    bearing_rad = scan.angle_offset_rad + hit * scan.increment_rad
    north_m, east_m, yaw = _pose(frame)
    way_rad = yaw + (-bearing_rad if mirrored else bearing_rad) + offset_rad
    range_m = scan.range_m[hit]
    return np.stack([north_m + range_m * np.cos(way_rad), east_m + range_m * np.sin(way_rad)], axis=1)
