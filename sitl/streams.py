"""Which messages are due on a link now? Rates by message id, as PX4 has them by default; pure, time in microseconds."""

import math
from collections.abc import Iterable, Mapping
from typing import Final

from pymavlink.dialects.v20 import common as mav

CURRENT_MODE_ID: Final = 436

# What a companion navigates by: on its own link these keep vehicle time, however fast that runs.
NAVIGATION: Final = frozenset({mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED})

# Hz. What a flight in lockstep needs: nothing that would cost it time.
LEAN_HZ: Final[Mapping[int, float]] = {
    mav.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mav.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
    mav.MAVLINK_MSG_ID_ATTITUDE: 100.0,
    mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 50.0,
    mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
    mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT: 8.0,
    mav.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
    mav.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    mav.MAVLINK_MSG_ID_ALTITUDE: 10.0,
    mav.MAVLINK_MSG_ID_VFR_HUD: 10.0,
    mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 1.0,
    mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: 10.0,
    mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: 1.0,
}
# PX4 v1.16 as measured; LOCAL_POSITION_NED at 50 instead of 30 Hz so that one falls on every scan.
ONBOARD_HZ: Final[Mapping[int, float]] = {
    **LEAN_HZ,
    mav.MAVLINK_MSG_ID_ATTITUDE_TARGET: 10.0,
    mav.MAVLINK_MSG_ID_ODOMETRY: 30.0,
    mav.MAVLINK_MSG_ID_HIGHRES_IMU: 50.0,
    mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 10.0,
    mav.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 10.0,
    mav.MAVLINK_MSG_ID_VIBRATION: 0.5,
    mav.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
    mav.MAVLINK_MSG_ID_WIND_COV: 1.0,
    mav.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: 5.0,
    mav.MAVLINK_MSG_ID_TIMESYNC: 10.0,
    mav.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mav.MAVLINK_MSG_ID_PING: 1.0,
    CURRENT_MODE_ID: 0.5,
}
GCS_HZ: Final[Mapping[int, float]] = {
    **LEAN_HZ,
    mav.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
    mav.MAVLINK_MSG_ID_ATTITUDE: 50.0,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
    mav.MAVLINK_MSG_ID_ALTITUDE: 1.0,
    mav.MAVLINK_MSG_ID_VFR_HUD: 4.0,
    mav.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 0.5,
    mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: 1.0,
    mav.MAVLINK_MSG_ID_ATTITUDE_TARGET: 50.0,
    mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 50.0,
    mav.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 50.0,
    mav.MAVLINK_MSG_ID_VIBRATION: 0.1,
    mav.MAVLINK_MSG_ID_SCALED_PRESSURE: 1.0,
    mav.MAVLINK_MSG_ID_WIND_COV: 0.5,
    mav.MAVLINK_MSG_ID_ORBIT_EXECUTION_STATUS: 2.0,
    mav.MAVLINK_MSG_ID_PING: 0.1,
    CURRENT_MODE_ID: 0.5,
}


class StreamSchedule:
    """When each message is due next; a stream that fell behind does not catch up."""

    def __init__(self, rates_hz: Mapping[int, float]) -> None:
        self._default_us = {message_id: round(1e6 / hz) for message_id, hz in rates_hz.items()}
        self._interval_us = dict(self._default_us)
        self._due_us: dict[int, int] = dict.fromkeys(self._interval_us, 0)
        self._next_us = 0
        self._now_us = 0

    @property
    def next_us(self) -> float:
        """When the next message is due; inf when there is none."""
        return self._next_us if self._due_us else math.inf

    def interval_us(self, message_id: int) -> int:
        """The interval in force: 0 when the message is not streamed."""
        return self._interval_us.get(message_id, 0)

    def set_interval(self, message_id: int, interval_us: int) -> None:
        """Change a rate: microseconds; 0 gives the default back, a negative value stops the stream."""
        if interval_us == 0:
            interval_us = self._default_us.get(message_id, -1)
        if interval_us < 0:
            self._interval_us.pop(message_id, None)
            self._due_us.pop(message_id, None)
            return
        self._interval_us[message_id] = interval_us
        self._due_us[message_id] = self._next_us = 0

    def due(self, now_us: int) -> list[int]:
        """Ids of the messages to send now."""
        if now_us < self._now_us:  # time starts anew
            self._due_us = dict.fromkeys(self._due_us, now_us)
            self._next_us = now_us
        self._now_us = now_us
        if now_us < self._next_us:
            return []
        ids = [message_id for message_id, due_us in self._due_us.items() if due_us <= now_us]
        self.sent(ids, now_us)
        return ids

    def sent(self, message_ids: Iterable[int], now_us: int) -> None:
        """These go out now: each is due again one interval after it was due, or from now on if that has passed."""
        for message_id in message_ids:
            interval_us = self._interval_us.get(message_id)
            if interval_us is not None:
                due_us = self._due_us[message_id] + interval_us
                self._due_us[message_id] = due_us if due_us > now_us else now_us + interval_us
        self._next_us = min(self._due_us.values(), default=now_us)
