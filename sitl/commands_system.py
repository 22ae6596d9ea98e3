"""How are the commands answered that do not fly the vehicle? Reboot, calibration, payload, failures, checks."""

from collections.abc import Mapping
from typing import Final

from pymavlink.dialects.v20 import common as mav

from sitl.answers import CRITICAL, INFO, StatusText
from sitl.command import ACCEPTED, DENIED, Answer, Command, Handler, whole
from sitl.failure_injection import inject
from sitl.link import Link
from sitl.simulation import Simulation

REBOOT: Final = 1
CALIBRATION_VERSION: Final = 2
# MAV_CMD_PREFLIGHT_CALIBRATION: (parameter, value, name in the texts); the first that is asked for is done.
SENSORS: Final = (
    (0, 1, "gyro"),
    (1, 1, "mag"),
    (2, 1, "baro"),
    (4, 1, "accel"),
    (4, 2, "level"),
    (4, 4, "accel"),
)


def _reboot(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Start anew where the vehicle stands (p1 = 1); DENIED while armed, and for switching off."""
    action = whole(command.params[0])
    if action == 0:
        return ACCEPTED
    if action != REBOOT or sim.autopilot.armed:
        return DENIED
    sim.reboot()
    return ACCEPTED


def _calibrate(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Nothing has to be calibrated: says what PX4 says and is done at once; DENIED while armed."""
    ap = sim.autopilot
    if ap.armed:
        return DENIED
    name = next((name for at, value, name in SENSORS if whole(command.params[at]) == value), None)
    if name is None:
        ap.texts.append(StatusText(CRITICAL, "[cal] calibration cancelled"))
        return ACCEPTED
    started = f"[cal] calibration started: {CALIBRATION_VERSION} {name}"
    for text in (started, "[cal] progress <0>", "[cal] progress <100>", f"[cal] calibration done: {name}"):
        ap.texts.append(StatusText(INFO, text))
    return ACCEPTED


def _check(_command: Command, _sim: Simulation, _link: Link) -> Answer:
    """The arming checks run all the time."""
    return ACCEPTED


def _payload(_command: Command, _sim: Simulation, _link: Link) -> Answer:
    """Accepted without effect: there is no payload."""
    return ACCEPTED


def _fail(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Failure injection; DENIED unless SYS_FAILURE_EN is 1."""
    unit, kind, instance = (whole(param) for param in command.params[:3])
    if not sim.autopilot.params["SYS_FAILURE_EN"] or unit is None or kind is None:
        return DENIED
    return Answer(inject(sim.trouble.book, unit, kind, instance or 0))


HANDLERS: Final[Mapping[int, Handler]] = {
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    mav.MAV_CMD_PREFLIGHT_CALIBRATION: _calibrate,
    mav.MAV_CMD_RUN_PREARM_CHECKS: _check,
    mav.MAV_CMD_DO_SET_ACTUATOR: _payload,
    mav.MAV_CMD_DO_SET_ROI_LOCATION: _payload,
    mav.MAV_CMD_DO_SET_ROI_NONE: _payload,
    mav.MAV_CMD_DO_SET_ROI: _payload,
    mav.MAV_CMD_DO_GRIPPER: _payload,
    mav.MAV_CMD_INJECT_FAILURE: _fail,
}
