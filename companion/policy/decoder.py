"""Which five waypoints does an action mean? Two decoders, by name; pure; a in [-1, 1]^10, local NED out.

``waypoints`` (the paper's MDP section, eq. action_mat): five places, 3 m * a, relative to the nose.
``detour`` (its exploration section): the first three numbers are side, curvature and spacing. A path of five equal legs
leaves the anchor so that its chord points ``side_rad * a[0]`` off the goal bearing (right is positive), turns by
``turn_rad * a[1]`` on its way, and is ``short_m`` to ``long_m`` long. Zero leads straight at the goal. Goal hints: it
never leads past the goal, and ends there if it comes near. ``encode_detour`` is its inverse, for the teacher.

Both begin where the committed stretch ends. Mirrored query and mirrored action give mirrored waypoints.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from companion.core import geometry
from companion.core.frames import wrap_rad, yaw_rad
from companion.core.types import F64
from companion.policy.goal_frame import goal_frame
from companion.policy.interface import WAYPOINTS, Proposal, Query

ACTION_SIZE = 2 * WAYPOINTS  # eq. action_mat; of a detour, too: an actor always has ten outputs
SIDE, TURN, SPACING = 0, 1, 2
NAMES = ("detour", "waypoints")
FIT_STEP_M = 0.5  # lengths that the encoder tries
ASIDES = (1, -1, 2, -2, 3, -3, 4, -4)  # steps of ``aside_rad`` at which a whole detour is a next choice
SHORT_ASIDES = (0, *ASIDES, 6, -6, 9, -9, 12, -12, 16, -16)  # and a short one: out of a pocket along its wall
SHORT = 0.6  # of a path's length: as far as the gap's mouth, where the whole does not fit through yet
CUT_MAX_M = 0.3  # off a corner
ROUND_LEAST_M = 0.1  # less is no stretch to begin a curve on
ROUND_SHARES = np.array([0.25, 0.5, 0.75, 1.0])
MIRROR = {
    "detour": np.array([-1.0, -1.0, *np.ones(ACTION_SIZE - 2)]),
    "waypoints": np.tile([1.0, -1.0], WAYPOINTS),
}


@dataclass(frozen=True, slots=True)
class DecoderParams:
    """What an action's numbers are multiplied with; part of a policy, kept in its card."""

    reach_m: float = 3.0  # ``waypoints``: [-3, 3] of eq. action_mat
    side_rad: float = 2.8  # less does not lead out of a pocket
    turn_rad: float = 2.0  # between first and last leg
    short_m: float = 2.0
    long_m: float = 6.0
    goal_hint_m: float = 1.0  # a path that ends this near to the goal ends at it
    headings_m: float = 4.0  # length of a path that is just a heading
    aside_rad: float = 0.15  # between a detour's next choices; 0: it has none


def decode(name: str, action: F64, query: Query, params: DecoderParams) -> F64:
    """Five waypoints (5, 2) in local NED for an action (10,); the path begins at the end of the committed stretch."""
    if name == "waypoints":
        return _places(action, query, params)
    return arc(*_meant(action, params), query, params)


def proposal(name: str, action: F64, query: Query, params: DecoderParams) -> Proposal:
    """What the checker is asked about: the committed stretch and the five waypoints of the action.

    A detour comes with next choices, for where it is not kept: the same a little to either side (farther off the goal
    bearing first), then shorter.
    """
    first = joined(query, decode(name, action, query, params))
    if name != "detour" or params.aside_rad == 0.0:
        return Proposal(first)
    side_rad, turn_rad, length_m = _meant(action, params)
    step_rad = math.copysign(params.aside_rad, side_rad)
    nexts = [(side_rad + steps * step_rad, length_m) for steps in ASIDES]
    nexts += [(side_rad + steps * step_rad, SHORT * length_m) for steps in SHORT_ASIDES]
    return Proposal(
        first, Choices(nexts, lambda aside, way_m: joined(query, arc(aside, turn_rad, way_m, query, params)))
    )


class Choices(Sequence[F64]):
    """Next choices, each decoded when it is asked for: mostly the first is kept, and all of them cost a tick's time."""

    def __init__(self, ways: list[tuple[float, float]], decoded: Callable[[float, float], F64]) -> None:
        self._ways, self._decoded = ways, decoded

    def __len__(self) -> int:
        return len(self._ways)

    def __getitem__(self, choice: int | slice) -> Any:
        if isinstance(choice, slice):
            return [self._decoded(*way) for way in self._ways[choice]]
        return self._decoded(*self._ways[choice])


def joined(query: Query, waypoints_ne_m: F64) -> F64:
    """From where the committed stretch begins, that place left out, to the last waypoint; the anchor's corner rounded.

    A parabola, tangent to the stretch where it begins and to the way as far beyond the anchor: a corner between short
    pieces would cost nearly all speed. It cuts the corner by no more than ``CUT_MAX_M``.
    """
    prefix, anchor = query.prefix_ne_m, query.prefix_ne_m[-1]
    way = np.concatenate([anchor[None], waypoints_ne_m])
    stretch_m = geometry.length(prefix)
    reach_m = min(stretch_m, geometry.length(way))
    if reach_m < ROUND_LEAST_M:
        return np.concatenate([prefix[1:], waypoints_ne_m])
    turn_rad = wrap_rad(_course(geometry.tangent_at(way, 0.0)) - _course(geometry.tangent_at(prefix, stretch_m)))
    reach_m = min(reach_m, 2.0 * CUT_MAX_M / max(abs(math.sin(turn_rad / 2.0)), 1e-9))
    enter, leave = geometry.point_at(prefix, stretch_m - reach_m), geometry.point_at(way, reach_m)
    share = ROUND_SHARES[:, None]
    curve = (1.0 - share) ** 2 * enter + 2.0 * share * (1.0 - share) * anchor + share**2 * leave
    before, after = geometry.part(prefix, 0.0, stretch_m - reach_m), geometry.part(way, reach_m)
    return np.concatenate([before[1:], curve, after[1:]])


def _course(direction: F64) -> float:
    return math.atan2(float(direction[1]), float(direction[0]))


def arc(side_rad: float, turn_rad: float, length_m: float, query: Query, params: DecoderParams) -> F64:
    """Five waypoints (5, 2) of a path that leaves ``side_rad`` off the goal bearing; goal hints applied."""
    frame = goal_frame(query)
    ahead = math.cos(side_rad)
    if ahead * length_m > frame.goal_m:
        length_m = frame.goal_m / ahead
    waypoints = frame.to_ne(_legs(side_rad, turn_rad, length_m))
    if math.dist(waypoints[-1].tolist(), query.goal_ne_m.tolist()) < params.goal_hint_m:
        waypoints[-1] = query.goal_ne_m
    return waypoints


def encode_detour(path_ne_m: F64, query: Query, params: DecoderParams, tolerance_m: float = 0.25) -> F64:
    """The action (10,) whose detour follows a path from the anchor on, as far as it can follow it within tolerance.

    Args:
        path_ne_m: (k, 2) waypoints as a teacher proposes them, committed stretch included or not.
        query: what the teacher was asked.
        params: of the decoder.
        tolerance_m: how far the detour may leave the path before a shorter one is preferred.
    """
    rest = goal_frame(query).from_ne(beyond_anchor(path_ne_m, query))
    whole_m = geometry.length(rest)
    length_m = min(params.long_m, whole_m)
    while True:
        side_rad, turn_rad = _chord(geometry.part(rest, 0.0, length_m))
        legs = _legs(side_rad, turn_rad, length_m)
        shorter_m = length_m - FIT_STEP_M
        if shorter_m < params.short_m or geometry.points_to_polyline_distance(rest, legs).max() <= tolerance_m:
            break
        length_m = shorter_m
    spacing = 2.0 * (length_m - params.short_m) / (params.long_m - params.short_m) - 1.0
    action = np.zeros(ACTION_SIZE)
    action[[SIDE, TURN, SPACING]] = side_rad / params.side_rad, turn_rad / params.turn_rad, spacing
    return np.clip(action, -1.0, 1.0)


def beyond_anchor(path_ne_m: F64, query: Query) -> F64:
    """What is left (k, 2) of a teacher's path where the committed stretch ends, from there on."""
    whole = np.concatenate([query.prefix_ne_m[:1], path_ne_m])
    anchor = query.prefix_ne_m[-1]
    rest = geometry.part(whole, geometry.project(whole, anchor).s_m)
    return np.concatenate([anchor[None], rest[1:]])


def mirror_action(name: str, action: F64) -> F64:
    """The action (..., 10) that means the mirror image."""
    mirrored: F64 = action * MIRROR[name]
    return mirrored


def _meant(action: F64, params: DecoderParams) -> tuple[float, float, float]:
    """Side [rad], turn [rad] and length [m] of a detour."""
    length_m = params.short_m + (params.long_m - params.short_m) * (float(action[SPACING]) + 1.0) / 2.0
    return params.side_rad * float(action[SIDE]), params.turn_rad * float(action[TURN]), length_m


def _places(action: F64, query: Query, params: DecoderParams) -> F64:
    yaw = yaw_rad(query.state.q_ned_frd)
    ahead, right = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    places = params.reach_m * np.asarray(action, np.float64).reshape(WAYPOINTS, 2)
    waypoints: F64 = query.prefix_ne_m[-1] + places[:, :1] * ahead + places[:, 1:] * right
    return waypoints


def _legs(side_rad: float, turn_rad: float, length_m: float) -> F64:
    """Ends (5, 2) of five equal legs from the origin whose courses are spread evenly about ``side_rad``."""
    courses = side_rad + turn_rad * (np.arange(WAYPOINTS) / (WAYPOINTS - 1) - 0.5)
    legs = np.stack([np.cos(courses), np.sin(courses)], axis=1) * (length_m / WAYPOINTS)
    ends: F64 = legs.cumsum(axis=0)
    return ends


def _chord(path: F64) -> tuple[float, float]:
    """Bearing of a path's end seen from its start, and the turn of five chords of the circle through its middle."""
    north, east = (path[-1] - path[0]).tolist()
    side_rad, chord_m = math.atan2(east, north), math.hypot(north, east)
    middle = geometry.point_at(path, geometry.length(path) / 2.0) - path[0]
    bulge_m = math.cos(side_rad) * float(middle[1]) - math.sin(side_rad) * float(middle[0])  # right of the chord
    circle_rad = wrap_rad(-4.0 * math.atan2(2.0 * bulge_m, chord_m)) if chord_m > 0.0 else 0.0
    return side_rad, circle_rad * (WAYPOINTS - 1) / WAYPOINTS  # the outer chords are half a turn short of its ends
