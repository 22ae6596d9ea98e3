"""Which PX4 parameters are there? Names, types, defaults, units and ranges are PX4's (v1.16, multicopter).

``HONOURED`` change what the vehicle does. ``KEPT`` are there because clients read and write them: they are stored and
given back, nothing more. Ranges are for people; like PX4 the vehicle takes any finite value.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Px4Param:
    """One parameter; the type of ``default`` is its type on the wire (int: INT32, float: REAL32)."""

    default: int | float
    unit: str
    text: str
    low: float | None = None
    high: float | None = None


HONOURED: Final[Mapping[str, Px4Param]] = {
    "BAT_CRIT_THR": Px4Param(0.07, "", "critical charge", 0.05, 0.5),
    "BAT_EMERGEN_THR": Px4Param(0.05, "", "emergency charge", 0.03, 0.5),
    "BAT_LOW_THR": Px4Param(0.15, "", "low charge", 0.12, 0.5),
    "CBRK_FLIGHTTERM": Px4Param(121212, "", "circuit breaker of flight termination", 0, 121212),
    "COM_ACT_FAIL_ACT": Px4Param(
        0, "", "on failure of a motor: 0 warning, 1 Hold, 2 Land, 3 Return, 4 Terminate", 0, 4
    ),
    "COM_DISARM_LAND": Px4Param(2.0, "s", "disarm this long after landing; not above 0: never", -1, 20),
    "COM_DISARM_PRFLT": Px4Param(10.0, "s", "disarm this long after arming without take-off; not above 0: never", -1),
    "COM_DL_LOSS_T": Px4Param(10, "s", "a ground station silent for longer is lost", 5, 300),
    "COM_FAIL_ACT_T": Px4Param(5.0, "s", "seconds of Hold before a failsafe acts", 0, 25),
    "COM_HOME_EN": Px4Param(1, "", "1: home is where the vehicle was armed, or where DO_SET_HOME puts it", 0, 1),
    "COM_LOW_BAT_ACT": Px4Param(
        0, "", "on low battery: 0 warning, 1 Return, 2 Land, 3 Return at critical and Land at emergency charge", 0, 3
    ),
    "COM_OBL_RC_ACT": Px4Param(
        0,
        "",
        "on loss of the OFFBOARD stream: 0 Position, 1 Altitude, 2 Stabilized (all descend and land), 3 Return,"
        " 4 Land, 5 Hold, 6 Terminate, 7 Disarm",
        0,
        7,
    ),
    "COM_OF_LOSS_T": Px4Param(1.0, "s", "a setpoint stream older than this is lost", 0, 60),
    "COM_RC_IN_MODE": Px4Param(1, "", "sticks: 0 receiver only, 1 MANUAL_CONTROL only, 2 and 3 both, 4 none", 0, 4),
    "COM_RC_LOSS_T": Px4Param(0.5, "s", "sticks not heard for longer than this are lost", 0, 35),
    "COM_RC_OVERRIDE": Px4Param(1, "", "bit 0: moving a stick ends an autonomous mode in Position", 0, 3),
    "COM_RC_STICK_OV": Px4Param(30.0, "%", "how far a stick has to move for that", 5, 80),
    "COM_SPOOLUP_TIME": Px4Param(1.0, "s", "motors idle this long between arming and climbing", 0, 30),
    "FD_ACT_EN": Px4Param(1, "", "failure detector: 1 watches the motors", 0, 1),
    "FD_FAIL_P": Px4Param(60, "deg", "failure detector: pitch", 0, 180),
    "FD_FAIL_R": Px4Param(60, "deg", "failure detector: roll", 0, 180),
    "FLW_TGT_ALT_M": Px4Param(
        0, "", "height of Follow Target: 0 above home, 1 above terrain (taken as 0), 2 above the target", 0, 2
    ),
    "FLW_TGT_DST": Px4Param(8.0, "m", "distance to the target", 1),
    "FLW_TGT_FA": Px4Param(
        180.0, "deg", "where to fly as seen from the target: 0 ahead, 90 right, 180 behind", -180, 180
    ),
    "FLW_TGT_HT": Px4Param(8.0, "m", "height of Follow Target", 8),
    "FLW_TGT_MAX_VEL": Px4Param(5.0, "m/s", "speed around the target, on top of the target's own", 0, 20),
    "GF_ACTION": Px4Param(2, "", "on a breach: 0 nothing, 1 warning, 2 Hold, 3 Return, 4 Terminate, 5 Land", 0, 5),
    "GF_MAX_HOR_DIST": Px4Param(0.0, "m", "farthest from home; 0: anywhere", 0, 10000),
    "GF_MAX_VER_DIST": Px4Param(0.0, "m", "highest above home; 0: anywhere", 0, 10000),
    "MC_ACRO_P_MAX": Px4Param(100.0, "deg/s", "pitch rate at full stick in Acro", 0, 1800),
    "MC_ACRO_R_MAX": Px4Param(100.0, "deg/s", "roll rate at full stick in Acro", 0, 1800),
    "MC_ACRO_Y_MAX": Px4Param(100.0, "deg/s", "yaw rate at full stick in Acro", 0, 1800),
    "MC_ORBIT_RAD_MAX": Px4Param(1000.0, "m", "largest radius of an orbit", 1, 10000),
    "MC_ORBIT_YAW_MOD": Px4Param(
        0, "", "nose in an orbit: 0 to the centre, 1 as it was, 2 free, 3 along the circle", 0, 4
    ),
    "MIS_DIST_1WP": Px4Param(10000.0, "m", "farthest first waypoint", -1, 100000),
    "MIS_TAKEOFF_ALT": Px4Param(2.5, "m", "default height of a take-off above where it starts", 0, 80),
    "MIS_YAW_ERR": Px4Param(12.0, "deg", "heading error at which a waypoint counts as reached", 0, 90),
    "MPC_ACC_DOWN_MAX": Px4Param(3.0, "m/s^2", "vertical acceleration of a descent", 2, 15),
    "MPC_ACC_HOR": Px4Param(3.0, "m/s^2", "horizontal acceleration of all modes but OFFBOARD", 2, 15),
    "MPC_ACC_UP_MAX": Px4Param(4.0, "m/s^2", "vertical acceleration of a climb", 2, 15),
    "MPC_HOLD_DZ": Px4Param(0.1, "", "dead zone of the sticks", 0, 1),
    "MPC_HOLD_MAX_XY": Px4Param(0.8, "m/s", "Position locks its place below this speed", 0, 3),
    "MPC_HOLD_MAX_Z": Px4Param(0.6, "m/s", "Position and Altitude lock their height below this speed", 0, 3),
    "MPC_LAND_ALT1": Px4Param(10.0, "m", "height above home below which a descent slows down", 0, 122),
    "MPC_LAND_ALT2": Px4Param(5.0, "m", "height above home below which a descent goes at MPC_LAND_SPEED", 0, 122),
    "MPC_LAND_SPEED": Px4Param(0.7, "m/s", "descent speed near the ground", 0.6),
    "MPC_MANTHR_MIN": Px4Param(0.08, "", "thrust at the lowest throttle in Stabilized and Manual", 0, 1),
    "MPC_MAN_TILT_MAX": Px4Param(35.0, "deg", "tilt at full stick in Altitude, Stabilized and Manual", 1, 70),
    "MPC_MAN_Y_MAX": Px4Param(150.0, "deg/s", "yaw rate at full stick", 0, 400),
    "MPC_TKO_SPEED": Px4Param(1.5, "m/s", "climb speed of a take-off", 1, 5),
    "MPC_VEL_MANUAL": Px4Param(10.0, "m/s", "speed at full stick in Position", 3, 20),
    "MPC_XY_CRUISE": Px4Param(5.0, "m/s", "horizontal speed of the autonomous modes", 3, 20),
    "MPC_XY_MAN_EXPO": Px4Param(0.6, "", "curve of the horizontal sticks: 0 straight, 1 cubic", 0, 1),
    "MPC_YAW_EXPO": Px4Param(0.6, "", "curve of the yaw stick: 0 straight, 1 cubic", 0, 1),
    "MPC_Z_MAN_EXPO": Px4Param(0.6, "", "curve of the throttle: 0 straight, 1 cubic", 0, 1),
    "MPC_Z_V_AUTO_DN": Px4Param(1.5, "m/s", "descent speed above MPC_LAND_ALT1", 0.5, 4),
    "MPC_Z_V_AUTO_UP": Px4Param(3.0, "m/s", "climb speed of the autonomous modes", 0.5, 8),
    "NAV_ACC_RAD": Px4Param(2.0, "m", "radius at which a waypoint counts as reached", 0.05, 200),
    "NAV_DLL_ACT": Px4Param(
        0, "", "on loss of the ground station: 0 nothing, 1 Hold, 2 Return, 3 Land, 5 Terminate, 6 Disarm", 0, 6
    ),
    "NAV_MC_ALT_RAD": Px4Param(0.8, "m", "height error at which a waypoint counts as reached", 0.05, 200),
    "NAV_RCL_ACT": Px4Param(
        2, "", "sticks lost in a mode that needs them: 1 Hold, 2 Return, 3 Land, 5 Terminate, 6 Disarm", 1, 6
    ),
    "RTL_RETURN_ALT": Px4Param(30.0, "m", "height above home of Return; lower near home", 0),
    "SIM_BAT_MIN_PCT": Px4Param(0.0, "%", "the simulated battery is not drawn below this", 0, 100),
    "SYS_FAILURE_EN": Px4Param(0, "", "1: failures may be injected", 0, 1),
}

KEPT: Final[Mapping[str, Px4Param]] = {
    "BAT1_CAPACITY": Px4Param(-1.0, "mAh", "capacity; -1: not known", -1, 100000),
    "BAT1_N_CELLS": Px4Param(4, "", "cells", 0, 16),
    "BAT1_SOURCE": Px4Param(0, "", "where the battery is measured", -1, 2),
    "BAT1_V_CHARGED": Px4Param(4.05, "V", "voltage of a full cell"),
    "BAT1_V_EMPTY": Px4Param(3.6, "V", "voltage of an empty cell"),
    "CAL_ACC0_ID": Px4Param(1310988, "", "calibrated accelerometer"),
    "CAL_BARO0_ID": Px4Param(6620172, "", "calibrated barometer"),
    "CAL_GYRO0_ID": Px4Param(1310988, "", "calibrated gyroscope"),
    "CAL_MAG0_ID": Px4Param(197388, "", "calibrated magnetometer"),
    "CA_AIRFRAME": Px4Param(0, "", "multirotor"),
    "CA_ROTOR_COUNT": Px4Param(4, "", "rotors", 0, 12),
    "CBRK_SUPPLY_CHK": Px4Param(894281, "", "circuit breaker of the supply check", 0, 894281),
    "COM_ARM_MIS_REQ": Px4Param(0, "", "1: arming needs a mission", 0, 1),
    "COM_ARM_WO_GPS": Px4Param(1, "", "arming without GPS: 0 refused, 1 warned, 2 silent", 0, 2),
    "COM_FLTMODE1": Px4Param(-1, "", "mode of the first switch position", -1),
    "COM_OBC_LOSS_T": Px4Param(5.0, "s", "an onboard computer silent for longer is warned of", 0, 60),
    "COM_PREARM_MODE": Px4Param(0, "", "condition of prearming", 0, 2),
    "COM_RCL_EXCEPT": Px4Param(0, "", "modes that fly on without sticks: bit 0 Mission, 1 Hold, 2 Offboard", 0, 31),
    "CP_DELAY": Px4Param(0.4, "s", "collision prevention: delay", 0, 1),
    "CP_DIST": Px4Param(-1.0, "m", "collision prevention: least distance; -1: off", -1, 15),
    "CP_GO_NO_DATA": Px4Param(0, "", "collision prevention: 1 flies where nothing is known", 0, 1),
    "CP_GUIDE_ANG": Px4Param(30.0, "deg", "collision prevention: how far the course may be turned", 0, 90),
    "EKF2_BARO_CTRL": Px4Param(1, "", "estimator: barometer", 0, 1),
    "EKF2_EVA_NOISE": Px4Param(0.1, "rad", "estimator: noise of the external heading", 0.05),
    "EKF2_EVP_NOISE": Px4Param(0.1, "m", "estimator: noise of the external position", 0.01),
    "EKF2_EVV_NOISE": Px4Param(0.1, "m/s", "estimator: noise of the external velocity", 0.01),
    "EKF2_EV_CTRL": Px4Param(0, "", "estimator: external vision", 0, 15),
    "EKF2_EV_DELAY": Px4Param(0.0, "ms", "estimator: delay of external vision", 0, 300),
    "EKF2_EV_NOISE_MD": Px4Param(0, "", "estimator: whose noise counts", 0, 1),
    "EKF2_EV_POS_X": Px4Param(0.0, "m", "estimator: place of the external sensor, forward"),
    "EKF2_EV_POS_Y": Px4Param(0.0, "m", "estimator: place of the external sensor, right"),
    "EKF2_EV_POS_Z": Px4Param(0.0, "m", "estimator: place of the external sensor, down"),
    "EKF2_GPS_CTRL": Px4Param(7, "", "estimator: GNSS", 0, 15),
    "EKF2_HGT_REF": Px4Param(1, "", "estimator: reference of height", 0, 3),
    "EKF2_MAG_TYPE": Px4Param(0, "", "estimator: magnetometer", 0, 6),
    "EKF2_OF_CTRL": Px4Param(1, "", "estimator: optical flow", 0, 1),
    "EKF2_RNG_CTRL": Px4Param(1, "", "estimator: range finder", 0, 2),
    "FLW_TGT_RS": Px4Param(0.1, "", "responsiveness of Follow Target", 0, 1),
    "GF_PREDICT": Px4Param(0, "", "1: the geofence acts before the breach", 0, 1),
    "GF_SOURCE": Px4Param(0, "", "position that the geofence judges", 0, 1),
    "MAV_COMP_ID": Px4Param(1, "", "component id", 1, 250),
    "MAV_PROTO_VER": Px4Param(0, "", "MAVLink version; 0: as the other side", 0, 2),
    "MAV_SYS_ID": Px4Param(1, "", "system id", 1, 250),
    "MAV_TYPE": Px4Param(2, "", "MAV_TYPE", 0, 22),
    "MIS_TKO_LAND_REQ": Px4Param(0, "", "what a mission has to contain", 0, 4),
    "MIS_YAW_TMT": Px4Param(-1.0, "s", "how long to wait for the heading", -1, 20),
    "MPC_JERK_AUTO": Px4Param(4.0, "m/s^3", "jerk of the autonomous modes", 1, 80),
    "MPC_LAND_CRWL": Px4Param(0.3, "m/s", "descent speed close above ground", 0.1),
    "MPC_POS_MODE": Px4Param(4, "", "how sticks act in Position", 0, 4),
    "MPC_TILTMAX_LND": Px4Param(12.0, "deg", "tilt during take-off", 5, 89),
    "MPC_YAWRAUTO_MAX": Px4Param(45.0, "deg/s", "yaw rate of the autonomous modes", 5, 360),
    "MPC_YAW_MODE": Px4Param(0, "", "where the nose points in the autonomous modes", 0, 4),
    "NAV_LOITER_RAD": Px4Param(80.0, "m", "loiter radius of fixed wings", 25, 1000),
    "RC_CHAN_CNT": Px4Param(0, "", "channels of the receiver", 0, 18),
    "RC_MAP_THROTTLE": Px4Param(0, "", "channel of the throttle", 0, 18),
    "RTL_CONE_ANG": Px4Param(45, "deg", "half angle of the cone of Return", 0, 90),
    "RTL_DESCEND_ALT": Px4Param(30.0, "m", "height to which Return comes down before it lands", 0),
    "RTL_LAND_DELAY": Px4Param(0.0, "s", "wait before landing; -1: forever", -1),
    "RTL_MIN_DIST": Px4Param(10.0, "m", "Return nearer to home than this does not climb", 0.5),
    "RTL_TYPE": Px4Param(0, "", "where Return leads", 0, 5),
    "SDLOG_MODE": Px4Param(0, "", "when to log", -1, 4),
    "SYS_AUTOCONFIG": Px4Param(0, "", "reset to the airframe's defaults", 0, 1),
    "SYS_AUTOSTART": Px4Param(10016, "", "airframe: quadrotor x in simulation", 0, 9999999),
    "SYS_HAS_BARO": Px4Param(1, "", "barometers", 0),
    "SYS_HAS_GPS": Px4Param(1, "", "GPS receivers", 0),
    "SYS_HAS_MAG": Px4Param(1, "", "magnetometers", 0),
    "SYS_HITL": Px4Param(0, "", "hardware in the loop", -1, 2),
}

PARAMS: Final[Mapping[str, Px4Param]] = {**HONOURED, **KEPT}
