"""Is the vehicle there, does it know where it is, will its failsafes hold? Pure judgements of what was heard."""

import math
from collections.abc import Iterator
from typing import Final

from pymavlink.dialects.v20 import common as mav

from companion.app.preflight.heard import Heard, Stream
from companion.app.preflight.rows import Grade, Row
from companion.core.mavlink import LinkCounts
from companion.core.types import LandedState
from companion.navigator import Params

STATE_WARN_HZ: Final = 20.0
LOST_WARN, LOST_FAIL = 0.02, 0.2  # share of packets
GARBAGE_WARN: Final = 0.01  # bad bytes for each good message, times 100 bytes
PACE_TOLERANCE: Final = 0.02
CLOCK_WARN_S: Final = 5.0

# PX4 parameters that decide what happens when we fall silent.
LOSS_TIME: Final = "COM_OF_LOSS_T"
LOSS_ACTION: Final = "COM_OBL_RC_ACT"
SPEED_MAX: Final = "MPC_XY_VEL_MAX"
PX4_PARAMS: Final = (LOSS_TIME, LOSS_ACTION, SPEED_MAX)
LOSS_TIME_MAX_S: Final = 2.0
LOSS_ACTIONS: Final = {0: "position", 1: "altitude", 2: "manual", 3: "return", 4: "land", 5: "hold"}
UNGUARDED: Final = (1, 2)  # no brake: the vehicle drifts until the pilot flies it


def vehicle_rows(heard: Heard, counts: LinkCounts, url: str, params: Params, cruise_m_s: float) -> Iterator[Row]:
    """What can be said of the vehicle; only the first row when it was not heard."""
    yield _vehicle(heard, url)
    if heard.system is None:
        return
    yield _link(counts)
    yield _alone(heard)
    yield _status(heard)
    yield _health(heard)
    yield _state("attitude", "ATTITUDE_QUATERNION", heard.attitude, heard, params)
    yield _state("position", "LOCAL_POSITION_NED", heard.position, heard, params)
    yield _vehicle_clock(heard)
    yield _our_clock(heard)
    yield _offboard_loss(heard)
    yield _speed(heard, cruise_m_s)


def _vehicle(heard: Heard, url: str) -> Row:
    name = "vehicle"
    if heard.system is None:
        return Row(name, Grade.FAIL, f"no autopilot heard on {url}", "power, cable, baud rate, MAV_x_CONFIG?")
    found = f"system {heard.system}, HEARTBEAT at {heard.heartbeat.rate_hz:.1f} Hz"
    if len(heard.systems) > 1:
        several = ", ".join(map(str, sorted(heard.systems)))
        return Row(name, Grade.FAIL, f"autopilots {several} on one link", "one link for each vehicle")
    if heard.autopilot != mav.MAV_AUTOPILOT_PX4:
        return Row(name, Grade.WARN, f"{found}, autopilot type {heard.autopilot}", "made for PX4 (type 12)")
    return Row(name, Grade.OK, f"PX4, {found}")


def _link(counts: LinkCounts) -> Row:
    lost = counts.lost / max(1, counts.received + counts.lost)
    garbage = counts.bad_bytes / (100 * max(1, counts.received))
    found = f"{counts.received} messages, {lost:.1%} lost, {counts.bad_bytes} bytes of garbage"
    grade = Grade.FAIL if lost > LOST_FAIL else Grade.WARN if lost > LOST_WARN or garbage > GARBAGE_WARN else Grade.OK
    return Row("vehicle link", grade, found, "" if grade is Grade.OK else "a higher baud rate, or fewer streams")


def _alone(heard: Heard) -> Row:
    others = sorted(heard.companions)
    if others:
        ids = ", ".join(f"{system}/{component}" for system, component in others)
        return Row("other companions", Grade.FAIL, f"{ids} on this link", "two would both steer: stop the other")
    return Row("other companions", Grade.OK, "none on this link")


def _status(heard: Heard) -> Row:
    name, status = "state", heard.status
    if status is None or status.landed is LandedState.UNDEFINED:
        return Row(name, Grade.FAIL, "landed or flying is not known", "stream EXTENDED_SYS_STATE at 1 Hz or more")
    landed = status.landed.name.lower().replace("_", " ")
    if status.offboard:
        return Row(name, Grade.FAIL, f"{landed}, already in OFFBOARD", "take another mode first")
    if status.armed:
        return Row(name, Grade.WARN, f"armed, {landed}", "this check is for before arming")
    return Row(name, Grade.OK, f"disarmed, {landed}")


def _health(heard: Heard) -> Row:
    name, health = "autopilot's own checks", heard.health
    if health is None:
        return Row(name, Grade.OPEN, "no SYS_STATUS", "look at the ground station")
    watched = health.onboard_control_sensors_present & health.onboard_control_sensors_enabled
    ill = watched & ~health.onboard_control_sensors_health
    names = [_sensor(1 << bit) for bit in range(32) if ill >> bit & 1]
    said = "; ".join(heard.texts)
    ready = health.onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK
    if not ready:
        return Row(name, Grade.FAIL, "not ready to arm", said or ", ".join(names) or "look at the ground station")
    if names:
        return Row(name, Grade.WARN, f"not healthy: {', '.join(names)}", said)
    return Row(name, Grade.OK, "ready to arm")


def _sensor(bit: int) -> str:
    entry = mav.enums["MAV_SYS_STATUS_SENSOR"].get(bit)
    return str(entry.name).removeprefix("MAV_SYS_STATUS_").removeprefix("SENSOR_").lower() if entry else hex(bit)


def _state(name: str, message: str, stream: Stream, heard: Heard, params: Params) -> Row:
    advice = f"raise {message} on this link to 30 Hz or more (MAV_x_MODE Onboard)"
    if stream.count == 0:
        return Row(name, Grade.FAIL, f"no {message}", advice)
    found = f"{stream.rate_hz:.0f} Hz, longest gap {stream.worst_gap_s * 1e3:.0f} ms"
    if heard.assembler.latest_state() is None or heard.bad_estimates:
        return Row(name, Grade.FAIL, "no valid estimate", "wait for GPS or another position source")
    if stream.worst_gap_s > params.link.max_state_age_s:
        return Row(name, Grade.FAIL, found, advice)
    return Row(name, Grade.WARN, found, advice) if stream.rate_hz < STATE_WARN_HZ else Row(name, Grade.OK, found)


def _vehicle_clock(heard: Heard) -> Row:
    name = "vehicle's clock"
    if heard.assembler.reboots:
        return Row(name, Grade.FAIL, "started again while we listened", "did it boot? check its power")
    factor = heard.time_factor
    if factor is None:
        return Row(name, Grade.OPEN, "too little heard to judge", "listen longer: --check-time 10")
    found = f"{factor:.3f} of ours"
    if abs(factor - 1.0) > PACE_TOLERANCE:
        return Row(name, Grade.WARN, found, "a simulator at its own pace, or packets that pile up")
    return Row(name, Grade.OK, found)


def _our_clock(heard: Heard) -> Row:
    name = "our clock"
    if heard.system_time is None:
        return Row(name, Grade.OPEN, "the vehicle told no UTC", "only the stamps of the logs depend on it")
    vehicle_s, ours_s = heard.system_time
    off_s = ours_s - vehicle_s
    if abs(off_s) > CLOCK_WARN_S:
        return Row(name, Grade.WARN, f"{off_s:+.0f} s off the vehicle's UTC", "logs carry wrong times: chrony, RTC")
    return Row(name, Grade.OK, f"{off_s:+.1f} s off the vehicle's UTC")


def _offboard_loss(heard: Heard) -> Row:
    name = "when we fall silent"
    after_s, action = heard.params.get(LOSS_TIME), heard.params.get(LOSS_ACTION)
    if after_s is None or action is None:
        return Row(name, Grade.OPEN, f"{LOSS_TIME}, {LOSS_ACTION} not told", "look them up in the ground station")
    found = f"after {after_s:g} s: {LOSS_ACTIONS.get(int(action), f'action {action:g}')}"
    if not after_s <= LOSS_TIME_MAX_S:
        return Row(name, Grade.WARN, found, f"{LOSS_TIME} of 1 s: the vehicle keeps its speed until then")
    if int(action) in UNGUARDED:
        return Row(name, Grade.WARN, found, f"{LOSS_ACTION} 5 (hold) or 4 (land): this one does not brake")
    return Row(name, Grade.OK, found)


def _speed(heard: Heard, cruise_m_s: float) -> Row:
    name, limit_m_s = "speed", heard.params.get(SPEED_MAX, math.nan)
    if math.isnan(limit_m_s):
        return Row(name, Grade.OPEN, f"{SPEED_MAX} not told", "look it up in the ground station")
    found = f"cruise {cruise_m_s:g} m/s, {SPEED_MAX} {limit_m_s:g} m/s"
    if cruise_m_s > limit_m_s:
        return Row(name, Grade.WARN, found, f"the autopilot flies {limit_m_s:g} m/s at most")
    return Row(name, Grade.OK, found)
