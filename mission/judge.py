"""Was the flight a success, and what are its figures?  From the simulator's truth alone; the navigator's own count of
switches and decisions is reported, never believed."""

import dataclasses
import hashlib
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from companion.core.types import F64, LandedState
from companion.navigator.record import STANDBY
from mission.flight_log import NavigatorLog, TruthLog, read_navigator, read_rows, read_truth
from mission.flight_plan import FlightPlan
from mission.shortest_path import shortest_path_m


@dataclass(frozen=True, slots=True)
class Result:
    """``fly --json`` and ``result.json``, in this order; None where there is nothing to say."""

    record_sha256: str
    truth_sha256: str
    success: bool
    reason: str
    time_s: float  # vehicle time from the first row in OFFBOARD to touchdown
    path_m: float  # horizontal, over the same rows
    path_ratio: float | None  # to the shortest way for the vehicle
    min_clearance_m: float | None  # from take-off to touchdown; None in an empty world
    collisions: int
    switches: int
    switches_bound: int
    landed: bool
    landing_error_m: float | None
    rl_decisions: int
    tick_p50_ms: float | None
    tick_p99_ms: float | None
    realtime_factor: float | None
    log_dir: str
    seed: int
    world: str
    policy: str
    policy_sha256: str | None = None  # of its weights

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        return dataclasses.asdict(self)


@dataclass(frozen=True, slots=True)
class Flown:
    """What the truth says of one flight."""

    time_s: float
    path_m: float
    began_ned_m: F64 | None  # (2,) where OFFBOARD began, if it did
    min_clearance_m: float
    contact_t_s: float | None  # of the first contact
    collisions: int
    landed: bool
    landing_error_m: float | None


def judge(plan: FlightPlan, folder: Path, trouble: str | None) -> Result:
    """The verdict on the logs in ``folder``; ``trouble`` is what the operator could not do, if anything."""
    truth, nav = read_truth(folder / "truth.jsonl"), read_navigator(folder / "navigator.jsonl", plan.draws.spawn_ned_m)
    flown = measure(truth, plan.world.goal_ned_m)
    shortest_m = _shortest_m(plan, flown)
    failure = failure_of(flown, plan, shortest_m, trouble)
    return Result(
        record_sha256=file_sha256(folder / "navigator.jsonl"),
        truth_sha256=file_sha256(folder / "truth.jsonl"),
        success=failure is None,
        reason=failure or f"landed {flown.landing_error_m:.2f} m from the goal",
        time_s=flown.time_s,
        path_m=flown.path_m,
        path_ratio=flown.path_m / shortest_m if shortest_m else None,
        min_clearance_m=flown.min_clearance_m if math.isfinite(flown.min_clearance_m) else None,
        collisions=flown.collisions,
        switches=nav.switches,
        switches_bound=nav.switches_bound,
        landed=flown.landed,
        landing_error_m=flown.landing_error_m,
        rl_decisions=nav.rl_decisions,
        **read_timing(folder / "timing.jsonl", nav),
        log_dir=str(folder),
        seed=plan.seed,
        world=plan.world.name,
        policy=plan.params.policy.name,
        policy_sha256=plan.policy_sha256(),
    )


def measure(truth: TruthLog, goal_ned_m: F64) -> Flown:
    """The figures of one flight."""
    window = truth.flown
    track = truth.pos_ned_m[window, :2]
    touching = truth.clearance_m <= 0.0
    began = np.flatnonzero(touching & ~np.concatenate([[False], touching[:-1]]))
    landed = bool(len(track)) and truth.landed[-1] == LandedState.ON_GROUND and not truth.armed[-1]
    airborne = truth.clearance_m[truth.landed != LandedState.ON_GROUND]
    return Flown(
        time_s=round(float(truth.t_s[window][-1] - truth.t_s[window][0]), 3) if len(track) else 0.0,
        path_m=float(np.hypot(*np.diff(track, axis=0).T).sum()) if len(track) else 0.0,
        began_ned_m=track[0] if len(track) else None,
        min_clearance_m=float(np.min(airborne, initial=math.inf)),
        contact_t_s=float(truth.t_s[began[0]]) if len(began) else None,
        collisions=len(began),
        landed=bool(landed),
        landing_error_m=math.dist(truth.pos_ned_m[-1, :2], goal_ned_m) if landed else None,
    )


def failure_of(flown: Flown, plan: FlightPlan, shortest_m: float | None, trouble: str | None) -> str | None:
    """Why the flight is no success, most severe first; None when it is one."""
    if flown.contact_t_s is not None:
        return f"contact with an obstacle at {flown.contact_t_s:.2f} s"
    if trouble is not None:
        return trouble
    if flown.landing_error_m is None:
        return "not landed and disarmed"
    success = plan.mission.success
    if not flown.landing_error_m < success.landing_error_m:
        return f"landed {flown.landing_error_m:.2f} m from the goal, allowed are {success.landing_error_m:g} m"
    limit_s = success.time_limit_s
    if success.time_ratio is not None and shortest_m is not None:
        limit_s = min(limit_s, success.time_ratio * shortest_m / plan.mission.cruise_m_s)
    return None if flown.time_s <= limit_s else f"took {flown.time_s:.1f} s, allowed are {limit_s:.1f} s"


def read_timing(path: Path, nav: NavigatorLog) -> dict[str, float | None]:
    """Wall-clock figures of the companion's ticks in OFFBOARD; None without any."""
    steered = {t_s for t_s, mode in zip(nav.t_s.tolist(), nav.mode, strict=True) if mode != STANDBY}
    rows = [row for row in read_rows(path) if row["t_s"] in steered]
    if len(rows) < 2:
        return {"tick_p50_ms": None, "tick_p99_ms": None, "realtime_factor": None}
    p50, p99 = np.percentile([row["tick_ms"] for row in rows], [50, 99])
    wall_s = max(rows[-1]["wall_s"] - rows[0]["wall_s"], 1e-9)
    factor = (rows[-1]["t_s"] - rows[0]["t_s"]) / wall_s
    return {"tick_p50_ms": float(p50), "tick_p99_ms": float(p99), "realtime_factor": factor}


def file_sha256(path: Path) -> str:
    """Of the bytes; of nothing for a file that is not there."""
    return hashlib.sha256(path.read_bytes() if path.is_file() else b"").hexdigest()


def _shortest_m(plan: FlightPlan, flown: Flown) -> float | None:
    if flown.began_ned_m is None:
        return None
    shortest_m = shortest_path_m(plan.world, flown.began_ned_m, plan.world.goal_ned_m, plan.params.vehicle.radius_m)
    return shortest_m if 0.0 < shortest_m < math.inf else None
