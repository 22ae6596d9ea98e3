"""How are the commands answered that send a flying vehicle somewhere? PX4's rules for goto, orbit, speed and home."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core.types import F64
from sitl.answers import CRITICAL, StatusText
from sitl.command import ACCEPTED, DENIED, FAILED, REJECTED, UNSUPPORTED, Answer, Command, Handler, answer, whole
from sitl.flight_tasks import stopping_point
from sitl.guided_tasks import RADIUS_MIN_M, Circle, Goal, Nose, circle_speed_m_s
from sitl.home import Home, here
from sitl.link import Link
from sitl.modes import FlightMode
from sitl.simulation import Simulation

CHANGE_MODE: Final = 1  # MAV_DO_REPOSITION_FLAGS
ABOVE_HOME: Final = (mav.MAV_FRAME_GLOBAL_RELATIVE_ALT, mav.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
UNCHANGED: Final = 5  # ORBIT_YAW_BEHAVIOUR
ORBIT_M_S: Final = 1.0  # FlightTaskOrbit: _orbit_velocity
DEFAULT_SPEED: Final = -2.0  # DO_CHANGE_SPEED
STANDARD_MODES: Final = {
    1: FlightMode.POSCTL,
    2: FlightMode.ORBIT,
    4: FlightMode.ALTCTL,
    5: FlightMode.RTL,
    6: FlightMode.MISSION,
    7: FlightMode.LAND,
    8: FlightMode.TAKEOFF,
}


def _reposition(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Hold at a place; NaN keeps position, height or heading. Needs the CHANGE_MODE flag."""
    if whole(command.params[1]) != CHANGE_MODE:
        return UNSUPPORTED
    ap = sim.autopilot
    in_hold = ap.mode is FlightMode.HOLD
    before, cruise_m_s = ap.steering.goal, ap.steering.cruise_m_s
    result = ap.command_mode(FlightMode.HOLD)
    if not result.accepted or not ap.armed or ap.state is None:
        return answer(result)
    speed_m_s, yaw_rad = command.params[0], command.params[3]
    pos = before.pos_ned_m.copy() if in_hold and before is not None else stopping_point(ap.state)
    changed = _level(command, sim, pos)
    if math.isfinite(command.params[6]):
        pos[2] = _down_m(command, sim)
    elif changed:
        pos[2] = ap.state.pos_ned_m[2]
    elif math.isnan(yaw_rad):  # pause: brake where it is
        ap.steering.restart()
        return ACCEPTED
    kept_m_s = cruise_m_s if in_hold else None
    ap.steering.reposition(Goal(pos, yaw_rad, speed_m_s if speed_m_s > 0.0 else kept_m_s))
    return ACCEPTED


def _orbit(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Fly round a point: radius (its sign is the direction), speed, where the nose points, centre and height."""
    ap = sim.autopilot
    before = ap.steering.circle if ap.mode is FlightMode.ORBIT else None
    radius_m, speed_m_s, nose = command.params[0], command.params[1], whole(command.params[2])
    if not math.isfinite(radius_m):
        radius_m = math.copysign(before.radius_m, before.speed_m_s) if before is not None else RADIUS_MIN_M
    if not RADIUS_MIN_M <= abs(radius_m) <= ap.params["MC_ORBIT_RAD_MAX"]:
        ap.texts.append(StatusText(CRITICAL, "Orbit radius limit exceeded"))
        return REJECTED
    if not math.isfinite(speed_m_s):
        speed_m_s = abs(before.speed_m_s) if before is not None else ORBIT_M_S
    if nose is None or nose == UNCHANGED or not 0 <= nose <= max(Nose):
        nose = before.nose if before is not None else int(ap.params["MC_ORBIT_YAW_MOD"])
    result = ap.command_mode(FlightMode.ORBIT)
    if result.accepted and ap.state is not None:
        centre = before.centre_ned_m.copy() if before is not None else ap.state.pos_ned_m.copy()
        _level(command, sim, centre)
        if math.isfinite(command.params[6]):
            centre[2] = sim.origin.down_m(command.params[6])  # above sea level in every frame: PX4, MAVSDK
        speed_m_s = circle_speed_m_s(abs(radius_m), math.copysign(speed_m_s, radius_m))
        ap.steering.orbit(Circle(centre, abs(radius_m), speed_m_s, nose))
    return answer(result)


def _change_speed(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Horizontal speed of the autonomous mode being flown, until the mode changes; -2: the default."""
    speed_m_s = command.params[1]
    if speed_m_s > 0.0 and math.isfinite(speed_m_s):
        sim.autopilot.steering.change_speed(speed_m_s)
    elif speed_m_s == DEFAULT_SPEED:
        sim.autopilot.steering.change_speed(None)
    return ACCEPTED


def _set_home(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Home here (p1 = 1) or at a place."""
    ap = sim.autopilot
    if not ap.params["COM_HOME_EN"]:
        return DENIED
    if command.params[0] > 0.5:
        if ap.state is None or not ap.ready:
            return REJECTED
        ap.set_home(here(ap.state))
        return ACCEPTED
    if not all(math.isfinite(p) for p in command.params[4:7]):
        return DENIED
    pos = np.zeros(3)
    _level(command, sim, pos)
    pos[2] = _down_m(command, sim)
    yaw_rad = math.radians(command.params[3]) if math.isfinite(command.params[3]) else 0.0
    ap.set_home(Home(pos, yaw_rad, manual=True))
    return ACCEPTED


def _terminate(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Stop the motors for good, in the air too; DENIED while disarmed."""
    if not (command.params[0] > 0.5 and sim.autopilot.armed):
        return DENIED
    return answer(sim.autopilot.command_mode(FlightMode.TERMINATION))


def _standard_mode(command: Command, sim: Simulation, _link: Link) -> Answer:
    """Change to one of MAVLink's standard modes; FAILED for those that PX4 lacks."""
    number = whole(command.params[0])
    mode = STANDARD_MODES.get(number) if number is not None else None
    return answer(sim.autopilot.command_mode(mode)) if mode is not None else FAILED


HANDLERS: Final[Mapping[int, Handler]] = {
    mav.MAV_CMD_DO_REPOSITION: _reposition,
    mav.MAV_CMD_DO_ORBIT: _orbit,
    mav.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    mav.MAV_CMD_DO_SET_HOME: _set_home,
    mav.MAV_CMD_DO_FLIGHTTERMINATION: _terminate,
    262: _standard_mode,  # MAV_CMD_DO_SET_STANDARD_MODE, of development.xml
}


def _level(command: Command, sim: Simulation, pos_ned_m: F64) -> bool:
    """Put a command's latitude and longitude into ``pos_ned_m``, when it has any."""
    lat_deg, lon_deg = command.params[4], command.params[5]
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        return False
    pos_ned_m[:2] = sim.origin.north_east_m(lat_deg, lon_deg)
    return True


def _down_m(command: Command, sim: Simulation) -> float:
    """Local height of a command's altitude."""
    home = sim.autopilot.home
    if command.frame in ABOVE_HOME:
        return (home.down_m if home is not None else 0.0) - command.params[6]
    return sim.origin.down_m(command.params[6])
