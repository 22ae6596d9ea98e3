"""Are our own settings, disk and computer fit? Judgements; the disk and the clock are read by the shell."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from companion.app.preflight.rows import Grade, Row
from companion.core.inputs import Inputs
from companion.core.mavlink import LinkCounts
from companion.core.params import ParamError, as_dict, infos
from companion.core.task import Task
from companion.core.types import AutopilotStatus, LandedState
from companion.navigator import Params
from companion.navigator.decide import policy_named

FREE_WARN_BYTES, FREE_FAIL_BYTES = 10**9, 10**8  # an hour of flight writes some 200 MB
DIGEST_CHARS: Final = 12  # enough to tell two parameter sets apart
TICK_WARN_MS: Final = 20.0
TICK_FAIL_MS: Final = 60.0
FLYING: Final = AutopilotStatus(armed=True, offboard=True, landed=LandedState.IN_AIR)


def params_row(params: Params, problem: str | None) -> Row:
    """Are the parameters valid? ``problem``: what their file was refused for."""
    if problem is not None:
        return Row("parameters", Grade.FAIL, problem, "below, defaults are used in their place")
    entries = list(infos(params))
    values = {info.key: getattr(getattr(params, info.key.split(".")[0]), info.key.split(".")[1]) for info in entries}
    changed = [f"{info.key} {values[info.key]}" for info in entries if values[info.key] != info.default]
    digest = hashlib.sha256(json.dumps(as_dict(params), sort_keys=True).encode()).hexdigest()[:DIGEST_CHARS]
    found = f"{len(entries)} valid, sha256 {digest}; changed: {', '.join(changed) or 'none'}"
    return Row("parameters", Grade.OK, found)


def policy_row(params: Params) -> Row:
    """Is there a policy of that name?"""
    try:
        policy = policy_named(params.policy.name, params)
    except ParamError as error:
        return Row("policy", Grade.FAIL, str(error), "policy.name")
    return Row("policy", Grade.OK, f"{policy.name}, built in: no weights to compare")


def task_row(task: Task | None) -> Row:
    """Where would it go?"""
    if task is None:
        return Row("goal", Grade.OPEN, "not given", "--goal NORTH EAST [DOWN], as for the flight")
    north_m, east_m = task.goal_ned_m.tolist()
    height = "the altitude at the start" if task.down_m is None else f"{-task.down_m:g} m"
    found = f"{math.hypot(north_m, east_m):.1f} m off where it booted, at {task.cruise_m_s:g} m/s and {height}"
    return Row("goal", Grade.OK, found)


def log_row(folder: str, free_bytes: int | None, problem: str | None) -> Row:
    """Can the flight be logged? ``problem``: why the folder cannot be written."""
    if problem is not None or free_bytes is None:
        return Row("log folder", Grade.FAIL, problem or f"{folder} cannot be written", "--log DIR")
    found = f"{folder}: {free_bytes / 1e9:.1f} GB free"
    grade = Grade.FAIL if free_bytes < FREE_FAIL_BYTES else Grade.WARN if free_bytes < FREE_WARN_BYTES else Grade.OK
    return Row("log folder", grade, found, "" if grade is Grade.OK else "make room")


def belief_row(signed: bool, warning: str | None, counts: LinkCounts) -> Row:
    """Whose packets are believed? ``warning``: why everybody's are who should not be."""
    name, refused = "who is believed", counts.unsigned + counts.forged + counts.old
    if warning is not None:
        return Row(name, Grade.WARN, "everybody on the network", "--sign-key FILE, or listen on 127.0.0.1")
    if refused and not counts.received:
        found = f"nobody: {counts.unsigned} unsigned, {counts.forged} forged, {counts.old} old packets refused"
        return Row(name, Grade.FAIL, found, "the vehicle needs the same key")
    if refused:
        return Row(name, Grade.WARN, f"who has the key; {refused} packets refused", "somebody else speaks on this link")
    return Row(name, Grade.OK, "who has the key" if signed else "this computer and its cables: no key given")


def as_if_flying(ticks: Sequence[Inputs]) -> list[Inputs]:
    """The same inputs, had the vehicle been armed and in OFFBOARD: what a rehearsal is made of."""
    return [replace(tick, status=FLYING) for tick in ticks]


def rehearsal_row(tick_ms: Sequence[float], problem: str | None) -> Row:
    """Does the navigator keep up on this computer? From a rehearsal with the scans just heard."""
    name = "navigator"
    if problem is not None:
        return Row(name, Grade.FAIL, f"trips over these scans: {problem}", "please report it, with the log")
    if not tick_ms:
        return Row(name, Grade.OPEN, "no scan to rehearse with")
    worst_ms = float(np.percentile(tick_ms, 99))
    found = f"{np.median(tick_ms):.1f} ms a scan, {worst_ms:.1f} ms at worst (p99)"
    grade = Grade.FAIL if worst_ms > TICK_FAIL_MS else Grade.WARN if worst_ms > TICK_WARN_MS else Grade.OK
    return Row(name, grade, found, "" if grade is Grade.OK else "computer too slow, throttled or busy")
