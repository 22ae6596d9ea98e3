"""What does MAV_CMD_INJECT_FAILURE break? PX4's units and types as faults of ours; pure but for the book of faults."""

from typing import Final

from pymavlink.dialects.v20 import common as mav

from sitl.answers import Result
from sitl.faults import MOTORS, FaultBook

# Unit: fault of each type that it can have.
_SENSORS: Final = {
    mav.FAILURE_UNIT_SENSOR_GYRO: "gyro_off",
    mav.FAILURE_UNIT_SENSOR_ACCEL: "accel_off",
    mav.FAILURE_UNIT_SENSOR_MAG: "mag_off",
    mav.FAILURE_UNIT_SENSOR_BARO: "baro_off",
    mav.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL: "gcs_off",
}
_GPS: Final = {mav.FAILURE_TYPE_OFF: "gps_off", mav.FAILURE_TYPE_STUCK: "gps_stuck"}
_BROKEN: Final = (mav.FAILURE_TYPE_OFF, mav.FAILURE_TYPE_STUCK)


def inject(book: FaultBook, unit: int, kind: int, instance: int) -> Result:
    """Break ``unit``, or put it right again (FAILURE_TYPE_OK). ``instance`` 0: all of them, else counted from 1."""
    if kind != mav.FAILURE_TYPE_OK and kind not in _BROKEN:
        return Result.UNSUPPORTED
    well = kind == mav.FAILURE_TYPE_OK
    if unit in _SENSORS:
        book.inject(_SENSORS[unit], None if well else 1.0)
    elif unit == mav.FAILURE_UNIT_SENSOR_GPS:
        for each, name in _GPS.items():
            book.inject(name, 1.0 if each == kind else None)
    elif unit == mav.FAILURE_UNIT_SYSTEM_BATTERY and kind != mav.FAILURE_TYPE_STUCK:
        book.inject("battery", None if well else 0.0)
    elif unit == mav.FAILURE_UNIT_SYSTEM_MOTOR and kind != mav.FAILURE_TYPE_STUCK and 0 <= instance <= len(MOTORS):
        for name in MOTORS if instance == 0 else MOTORS[instance - 1 : instance]:
            book.inject(name, None if well else 0.0)
    else:
        return Result.UNSUPPORTED
    return Result.ACCEPTED
