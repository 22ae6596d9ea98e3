"""Which velocity gives way to what moves? Pure; local ned.

Two questions about every velocity that might be asked for now. May it be: braking one tick later, would the vehicle
stand before anything that moves can be where it is? That is passive safety (Macek et al. 2009; Bouraine, Fraichard,
Salhi 2012). Which is the best of those: near to the velocity wanted, and long free of contact if everything goes on as
now, as with velocity obstacles (Fiorini, Shiller 1998)? Where none may be asked for, and what comes is near: out of the
way (``dodge``), if everything going on as now leaves room for that; else brake. What comes then comes to a vehicle that
stands.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.core import geometry
from companion.core.params import param
from companion.core.types import F64, Setpoint, VehicleState

SHARES = np.array([1.0, 0.75, 0.5, 0.25, 0.0])  # of the velocity that is wanted
WAYS = 16  # other courses
SPEEDS = np.array([0.35, 0.7, 1.0])  # on them, shares of the cruise
BRAKING_STEPS = 6
LOOK_STEPS = 12
STATIC_S = 1.0  # off the planned way, so long must stay free of what stands
SETTLE_S = 0.15  # the last of the speed goes more slowly
ACC_GAIN_1_S = 2.2  # acceleration asked for per velocity that is missing
SOON_S = 0.05  # no contact counts as sooner
DODGE_S = 1.5  # a velocity out of the way is good for so long; the next tick asks again
DODGE_STEPS = 24  # fewer, and what passes between two of them seems to leave room
DODGE_M_PER_M_S = 0.1  # room that being slower may cost


@dataclass(frozen=True, slots=True)
class YieldParams:
    """Giving way to what moves."""

    ahead_s: float = param(
        0.0, "SN_YL_AHEAD", "contacts are looked for so far ahead (0: no way is given)", "s", 0.0, 5.0
    )
    lag_s: float = param(0.2, "SN_YL_LAG", "scan age, link, tick and tilt lag before a velocity bites", "s", 0.0, 1.0)
    acc_m_s2: float = param(4.0, "SN_YL_ACC", "how fast the velocity changes then", "m/s^2", 0.5, 7.0)
    room_m: float = param(0.1, "SN_YL_ROOM", "kept between hull and what moves", "m", 0.0, 1.0)
    turn: float = param(1.0, "SN_YL_TURN", "share of its speed with which it may turn back at once", "", 0.0, 1.0)
    weight_m: float = param(6.0, "SN_YL_WEIGHT", "cost of a contact soon against a change of velocity", "m", 0.0, 50.0)
    dodge: bool = param(False, "SN_YL_DODGE", "go out of the way of what comes too near to stand for")


@dataclass(frozen=True, slots=True)
class Moving:
    """What moves, or may."""

    pos_ne_m: F64  # (m, 2) centres
    vel_ne_m_s: F64  # (m, 2)
    doubt_m_s: F64  # (m,) how far off that may be
    radius_m: float


@dataclass(frozen=True, slots=True)
class Hull:
    """What gives way."""

    radius_m: float
    cruise_m_s: float  # fastest that may be asked for
    step_s: float  # until the next choice takes over


def give_way(
    state: VehicleState, wanted_ne_m_s: F64, moving: Moving, static_ne_m: F64, hull: Hull, params: YieldParams
) -> F64 | None:
    """The velocity (2,) to ask for instead of the wanted one, zero: brake; None: the wanted one is as good as any.

    Args:
        state: where and how fast the vehicle is; NaN: brake.
        wanted_ne_m_s: (2,) what its path asks for.
        moving: what moves or may.
        static_ne_m: (k, 2) what stands.
        hull: what gives way.
        params: tunables.
    """
    here, vel = state.pos_ned_m[:2], state.vel_ned_m_s[:2]
    if not (np.isfinite(here).all() and np.isfinite(vel).all() and np.isfinite(wanted_ne_m_s).all()):
        return np.zeros(2)
    asked = _candidates(wanted_ne_m_s, hull.cruise_m_s)
    reach_m = hull.cruise_m_s * (STATIC_S + params.lag_s) + hull.radius_m
    static = geometry.points_near(here[None], static_ne_m, reach_m) - here
    centres = moving.pos_ne_m - here
    safe = _stands_in_time(vel, asked, centres, moving, static, hull, params)
    if not safe.any():
        return _aside(vel, asked, centres, moving, static, hull, params) if params.dodge else np.zeros(2)
    free_s = _free_s(vel, asked, centres, moving, static, hull.radius_m, params)
    cost = np.hypot(*(asked - wanted_ne_m_s).T)
    cost += params.weight_m * (1.0 / np.maximum(free_s, SOON_S) - 1.0 / params.ahead_s)
    best = int(np.argmin(np.where(safe, cost, math.inf)))
    return None if best == 0 else asked[best]


def setpoint(state: VehicleState, vel_ne_m_s: F64, down_m: float, yaw_rad: float, params: YieldParams) -> Setpoint:
    """Asks for that velocity. The place asked for is the vehicle's own: it pulls nowhere, least of all back."""
    change = ACC_GAIN_1_S * (vel_ne_m_s - state.vel_ned_m_s[:2])
    acc = change * min(1.0, params.acc_m_s2 / max(math.hypot(change[0], change[1]), 1e-9))
    return Setpoint(
        state.t_s,
        np.array([*state.pos_ned_m[:2], down_m]),
        np.array([*vel_ne_m_s, 0.0]),
        np.array([*acc, 0.0]),
        yaw_rad,
    )


def _candidates(wanted: F64, cruise_m_s: float) -> F64:
    """(c, 2) the wanted velocity first, slower ones, standstill, then other courses."""
    course = math.atan2(wanted[1], wanted[0]) + np.arange(WAYS) * (math.tau / WAYS)
    ways = np.stack([np.cos(course), np.sin(course)], axis=1)
    others = (SPEEDS[:, None, None] * cruise_m_s * ways).reshape(-1, 2)
    return np.concatenate([SHARES[:, None] * wanted, others])


def _stands_in_time(
    vel: F64, asked: F64, centres: F64, moving: Moving, static: F64, hull: Hull, params: YieldParams
) -> NDArray[np.bool_]:
    """(c,) asked for during one step, then braked from: does the vehicle stand before anything can touch it?"""
    change = asked - vel
    size = np.hypot(*change.T)
    bite_s = params.lag_s + hull.step_s
    begun = vel * bite_s + change * _share(size, np.array([bite_s]), params)
    then = vel + change * np.minimum(1.0, params.acc_m_s2 * hull.step_s / np.maximum(size, 1e-9))[:, None]
    speed = np.hypot(*then.T)[:, None]
    brake_s = speed / params.acc_m_s2
    after_s = (brake_s + SETTLE_S) * (np.arange(BRAKING_STEPS + 1) / BRAKING_STEPS)  # (c, k)
    moved_s = np.minimum(after_s, brake_s)
    way = speed * moved_s - params.acc_m_s2 * moved_s * moved_s / 2.0
    places = begun[:, None] + way[..., None] * (then / np.maximum(speed, 1e-9))[:, None]  # (c, k, 2)
    t_s = (bite_s + after_s)[..., None]
    away = _from_their_lines(places, t_s, centres, moving.vel_ne_m_s, params.turn)
    keep = _kept(hull.radius_m + moving.radius_m + params.room_m, centres)
    safe: NDArray[np.bool_] = (away >= keep + moving.doubt_m_s * t_s).all(axis=(1, 2))
    safe &= (_apart(places, static) >= _kept(hull.radius_m + params.room_m, static)).all(axis=(1, 2))
    return safe


def _free_s(
    vel: F64, asked: F64, centres: F64, moving: Moving, static: F64, radius_m: float, params: YieldParams
) -> F64:
    """(c,) seconds until a contact if everything goes on as now, at most ``ahead_s``.

    The planned way is known to lead past what stands, off it the next second must.
    """
    times = params.ahead_s * (np.arange(LOOK_STEPS) + 1) / LOOK_STEPS
    places = _places(vel, asked, times, params)
    met = _from_movers(places, times, centres, moving) < radius_m + params.room_m
    soon = times <= STATIC_S
    met[len(SHARES) :, soon] |= _from_static(places[len(SHARES) :, soon], static) < radius_m + params.room_m
    first = np.where(met.any(axis=1), met.argmax(axis=1), LOOK_STEPS - 1)
    return times[first]


def _aside(vel: F64, asked: F64, centres: F64, moving: Moving, static: F64, hull: Hull, params: YieldParams) -> F64:
    """The velocity (2,) that stays farthest from everything that goes on as now; zero where that is too near."""
    times = DODGE_S * (np.arange(DODGE_STEPS) + 1) / DODGE_STEPS
    places = _places(vel, asked, times, params)
    room = _from_movers(places, times, centres, moving).min(axis=1)
    room = np.minimum(room, _from_static(places[:, times <= STATIC_S], static).min(axis=1))
    best = int(np.argmax(room - DODGE_M_PER_M_S * np.hypot(*asked.T)))
    return asked[best] if room[best] >= hull.radius_m + params.room_m else np.zeros(2)


def _places(vel: F64, asked: F64, times: F64, params: YieldParams) -> F64:
    """(c, t, 2) where the vehicle is then, from here."""
    change = asked - vel
    return vel * times[:, None] + change[:, None] * _share(np.hypot(*change.T), times, params)[..., None]


def _from_movers(places: F64, times: F64, centres: F64, moving: Moving) -> F64:
    """(c, t) distance to the nearest surface of what goes on as now; inf if there is nothing."""
    there = centres + moving.vel_ne_m_s * times[:, None, None]  # (t, m, 2)
    nearest: F64 = _apart(places, there).min(axis=2, initial=math.inf)
    return nearest - moving.radius_m


def _from_static(places: F64, static: F64) -> F64:
    """(c, t) distance to the nearest of what stands; inf if there is nothing."""
    nearest: F64 = _apart(places, static).min(axis=2, initial=math.inf)
    return nearest


def _share(size: F64, times: F64, params: YieldParams) -> F64:
    """(c, t) integral over time of how much of a change of velocity is there."""
    since = np.maximum(times - params.lag_s, 0.0)[None, :]
    ramp = (np.maximum(size, 1e-9) / params.acc_m_s2)[:, None]
    return np.where(since < ramp, since * since / (2.0 * ramp), since - ramp / 2.0)


def _from_their_lines(places: F64, t_s: F64, centres: F64, vel: F64, turn: float) -> F64:
    """(c, k, m) distance of each place from where each thing may be by then: it goes on, stops, or turns back."""
    speed = np.hypot(*vel.T)
    way = vel / np.maximum(speed, 1e-9)[:, None]
    offset = places[:, :, None] - centres
    along = (offset * way).sum(axis=3)
    reach = speed * t_s
    on_line = centres + np.clip(along, -turn * reach, reach)[..., None] * way
    away: F64 = np.sqrt(((places[:, :, None] - on_line) ** 2).sum(axis=3))
    return away


def _apart(places: F64, points: F64) -> F64:
    """(c, k, n) distance of places (c, k, 2) from points (n, 2) or (k, n, 2)."""
    away: F64 = np.sqrt(((places[:, :, None] - points) ** 2).sum(axis=3))
    return away


def _kept(radius_m: float, points: F64) -> F64:
    """(n,) distance to keep from points seen from the origin: what is nearer already must not come nearer."""
    kept: F64 = np.minimum(radius_m, np.maximum(np.hypot(*points.T) - geometry.NEARER_M, 0.0))
    return kept
