"""Which pilot flies a suite, with which parameters, under which stress? And one of its runs as a row."""

import math
import zlib
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from companion import navigator
from companion.core import params as core_params
from companion.navigator.profiles import profile_named
from companion.policy.store import digest_of, shipped
from mission.bench.course import Course
from mission.bench.flight import End, Flown, fly
from mission.bench.pictures import failure_picture
from mission.bench.rows import Row
from mission.bench.stress import stress_named
from mission.pilots.registry import pilot_named
from mission.shortest_path import shortest_path_m
from sitl.world import World

FINE_M, CELL_M = 0.05, 0.1  # cells of the search for the shortest way, among narrow gaps and elsewhere


@dataclass(frozen=True, slots=True)
class Entry:
    """Who flies, and how; a value that goes to every process."""

    pilot: str = "geometric"
    profile: str | None = None  # None: the defaults
    stress: str = "none"
    guard: bool = True  # off: a learned policy flies without the expert beside it
    overrides: dict[str, dict[str, Any]] = field(default_factory=dict)  # of the companion's parameters
    px4_params: dict[str, float] = field(default_factory=dict)

    def settings(self) -> dict[str, Any]:
        """What must be the same for runs to be counted together."""
        return {
            "pilot": self.pilot,
            "policy_sha256": digest_of(self.pilot) if self.pilot in shipped() else None,
            "profile": self.profile,
            "stress": self.stress,
            "profile_params": profile_named(self.profile) if self.profile is not None else {},
            "guard": self.guard,
            "params": self.overrides,
            "px4_params": self.px4_params,
        }

    def params_for(self, course: Course) -> navigator.Params:
        """Defaults, then the profile, the suite's own, the user's. Raises ParamError."""
        params = navigator.Params()
        if self.profile is not None:
            params = core_params.update(params, profile_named(self.profile))
        params = core_params.update(params, {"vehicle": {"radius_m": course.rules.radius_m}, **course.rules.params})
        if not self.guard:
            params = core_params.update(params, {"policy": {"guard": False}})
        return core_params.update(params, self.overrides)


@dataclass(frozen=True, slots=True)
class Run:
    """What one run leaves."""

    row: Row
    picture: bytes | None  # PNG, where it failed


def fly_run(course: Course, run: int, entry: Entry, commit: str) -> Run:
    """One run, judged; a picture where it failed."""
    seed = run_seed(course.cell, run)
    params = entry.params_for(course)
    flown = fly(course, pilot_named(entry.pilot), params, seed, stress_named(entry.stress), entry.px4_params)
    picture = None if flown.end is End.GOAL else failure_picture(course, flown, run)
    return Run(row_of(course, run, seed, flown, commit), picture)


def run_seed(cell: str, run: int) -> int:
    """Seed of start, noise and gusts: the same for every pilot."""
    return zlib.crc32(f"{cell}/{run}".encode())


def row_of(course: Course, run: int, seed: int, flown: Flown, commit: str) -> Row:
    """The figures of one flight."""
    steps = np.hypot(*np.diff(flown.track[:, 1:3], axis=0).T)
    clearance = flown.min_clearance_m
    return Row(
        cell=course.cell,
        run=run,
        world=course.name,
        seed=seed,
        end=str(flown.end),
        success=flown.end is End.GOAL,
        collision=flown.end is End.CONTACT,
        struck=flown.end is End.STRUCK,
        timeout=flown.end is End.TIMEOUT,
        time_s=flown.time_s,
        path_m=float(steps.sum()),
        shortest_m=_shortest_m(course),
        reference_m=course.reference_m,
        mean_m_s=_mean_speed(course, flown),
        min_clearance_m=clearance if math.isfinite(clearance) else None,
        jerk_m2_s6=_jerk(flown),
        switches=flown.switches,
        switches_bound=flown.switches_bound,
        start_m_s=flown.start_speed_m_s,
        decision_ms=" ".join(f"{ms:.2f}" for ms in flown.decision_ms[1:]),  # the first loads what is imported late
        tick_p50_ms=float(np.percentile(flown.tick_ms, 50)) if flown.tick_ms else None,
        tick_p99_ms=float(np.percentile(flown.tick_ms, 99)) if flown.tick_ms else None,
        commit=commit,
    )


def _shortest_m(course: Course) -> float | None:
    """Shortest way from the world's start to where a flight is finished; straight on where that is a line."""
    rules, start = course.rules, course.world.start_ned_m
    if rules.goal_radius_m is None:
        return None if rules.finish_north_m is None else rules.finish_north_m - float(start[0])
    cell_m = FINE_M if course.reference_m is not None else CELL_M
    length_m = _length_m(course.world, rules.radius_m, cell_m)
    return length_m - rules.goal_radius_m if math.isfinite(length_m) else None


@lru_cache(maxsize=512)
def _length_m(world: World, radius_m: float, cell_m: float) -> float:
    """A world is itself only: what a suite keeps is looked at once."""
    return shortest_path_m(world, world.start_ned_m, world.goal_ned_m, radius_m, cell_m)


def _mean_speed(course: Course, flown: Flown) -> float | None:
    """Path over time, from ``measure_from_m`` beyond the start on."""
    along = np.hypot(*(flown.track[:, 1:3] - course.world.start_ned_m).T)
    track = flown.track[along >= course.rules.measure_from_m]
    if len(track) < 2 or track[-1, 0] <= track[0, 0]:
        return None
    return float(np.hypot(*np.diff(track[:, 1:3], axis=0).T).sum() / (track[-1, 0] - track[0, 0]))


def _jerk(flown: Flown) -> float | None:
    """Mean square, horizontal, from velocities at the scans' instants."""
    t_s = flown.track[:, 0]
    if len(t_s) < 3:
        return None
    dt_s = np.diff(t_s)[:, None]
    acc = np.diff(flown.vel_ned_m_s, axis=0) / dt_s
    jerk = np.diff(acc, axis=0) / dt_s[1:]
    return float(np.mean(np.sum(jerk**2, axis=1)))
