"""pymavlink's own connection as a client: what the tests with mavutil share."""

import math
import os
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("MAVLINK20", "1")
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mav

NAN7 = [math.nan] * 7


class Raw:
    """mavutil on one of the vehicle's links; a ground station 255/0 as every pymavlink script is."""

    def __init__(self, port: int) -> None:
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", dialect="common")
        assert self.link.wait_heartbeat(timeout=15) is not None

    def next(self, kind: str | list[str], limit_s: float = 5.0, fits: Callable[[Any], bool] = lambda _m: True) -> Any:
        """The next message of a kind."""
        message = self.maybe(kind, limit_s, fits)
        assert message is not None, f"no {kind} in {limit_s} s"
        return message

    def maybe(self, kind: str | list[str], limit_s: float, fits: Callable[[Any], bool] = lambda _m: True) -> Any:
        """The next message of a kind, or None."""
        deadline_s = time.monotonic() + limit_s
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            message = self.link.recv_match(type=kind, blocking=True, timeout=left_s)
            if message is not None and fits(message):
                return message
        return None

    def during(self, duration_s: float, kind: str | None = None) -> list[Any]:
        """Everything that arrives within a time."""
        deadline_s = time.monotonic() + duration_s
        seen = []
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            message = self.link.recv_match(type=kind, blocking=True, timeout=left_s)
            if message is not None:
                seen.append(message)
        return seen

    def drain(self) -> None:
        """Forget what has arrived."""
        while self.link.recv_match(blocking=False) is not None:
            pass

    def ask(self, command: int, *params: float, target: tuple[int, int] = (1, 1)) -> None:
        """A COMMAND_LONG; the rest is NaN."""
        self.link.mav.command_long_send(*target, command, 0, *[*params, *NAN7][:7])

    def command(self, number: int, *params: float) -> int:
        """Result of a COMMAND_LONG."""
        self.ask(number, *params)
        return int(self.next("COMMAND_ACK", fits=lambda m: m.command == number).result)

    def ready(self) -> "Raw":
        """Wait for the arming checks."""
        bits = mav.MAV_SYS_STATUS_PREARM_CHECK
        self.next("SYS_STATUS", 30.0, lambda m: m.onboard_control_sensors_health & bits != 0)
        return self

    def mode(self, custom_mode: int, limit_s: float = 30.0) -> Any:
        """Wait for a HEARTBEAT with this mode."""
        return self.next("HEARTBEAT", limit_s, lambda m: m.custom_mode == custom_mode)

    def position(self, fits: Callable[[Any], bool], limit_s: float = 60.0) -> Any:
        """Wait for a LOCAL_POSITION_NED."""
        return self.next("LOCAL_POSITION_NED", limit_s, fits)

    def take_off(self, height_m: float) -> None:
        """Arm, climb, hold."""
        value = mav.MAV_PARAM_TYPE_REAL32
        self.link.mav.param_set_send(1, 1, b"MIS_TAKEOFF_ALT", height_m, value)
        self.next("PARAM_VALUE", fits=lambda m: m.param_id == "MIS_TAKEOFF_ALT")
        assert self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0
        assert self.command(mav.MAV_CMD_NAV_TAKEOFF) == 0
        self.mode(33816576)
        self.mode(50593792)

    def close(self) -> None:
        """Free the port."""
        self.link.close()
