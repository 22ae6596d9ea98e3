"""What was heard while we listened? Counts, ages and last words, by our clock and the vehicle's; no sockets."""

import math
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.inputs import Inputs
from companion.core.param_codec import decode_param
from companion.core.types import AutopilotStatus
from companion.link.assembler import Assembler
from companion.link.params import LinkParams

Message = Any  # a MAVLink_*_message object

SEVERITY_TOLD = mav.MAV_SEVERITY_WARNING  # texts this grave or graver are shown
TEXTS_MAX = 5


@dataclass(slots=True)
class Stream:
    """How regularly one message came."""

    count: int = 0
    first_s: float = math.nan  # our clock
    last_s: float = math.nan
    last_vehicle_s: float = math.nan
    worst_gap_s: float = 0.0  # vehicle time

    def put(self, now_s: float, vehicle_s: float = math.nan) -> None:
        """One more."""
        gap_s = vehicle_s - self.last_vehicle_s
        if gap_s > self.worst_gap_s:
            self.worst_gap_s = gap_s
        self.first_s = now_s if self.count == 0 else self.first_s
        self.last_s, self.last_vehicle_s = now_s, vehicle_s
        self.count += 1

    @property
    def rate_hz(self) -> float:
        """Mean rate by our clock; 0 for fewer than two."""
        span_s = self.last_s - self.first_s
        return (self.count - 1) / span_s if self.count > 1 and span_s > 0.0 else 0.0


@dataclass(slots=True)
class Heard:
    """Everything that the judgements look at. Feed it every message, in order."""

    assembler: Assembler
    heartbeat: Stream = field(default_factory=Stream)
    attitude: Stream = field(default_factory=Stream)
    position: Stream = field(default_factory=Stream)
    scan: Stream = field(default_factory=Stream)
    ticks: list[Inputs] = field(default_factory=list)  # what the navigator would have been given
    autopilot: int | None = None  # MAV_AUTOPILOT
    systems: set[int] = field(default_factory=set)  # with an autopilot
    companions: set[tuple[int, int]] = field(default_factory=set)  # others like us
    bad_estimates: int = 0  # states that are not numbers
    last_scan: Message | None = None
    health: Message | None = None  # SYS_STATUS
    system_time: tuple[float, float] | None = None  # UTC of the vehicle and of us, in seconds, when it was heard
    texts: list[str] = field(default_factory=list)
    params: dict[str, float] = field(default_factory=dict)  # of the autopilot, that were asked for
    first_vehicle_s: float | None = None  # vehicle time of the first attitude

    @classmethod
    def nothing(cls, params: LinkParams) -> "Heard":
        """Before the first message."""
        return cls(Assembler(params))

    @property
    def status(self) -> AutopilotStatus | None:
        """What the autopilot last said of itself."""
        return self.assembler.status

    @property
    def system(self) -> int | None:
        """System id of the vehicle."""
        return self.assembler.vehicle_system

    @property
    def time_factor(self) -> float | None:
        """Vehicle seconds a second of ours; None while too little was heard."""
        span_s = self.attitude.last_s - self.attitude.first_s
        if not span_s > 1.0 or self.first_vehicle_s is None:
            return None
        return (self.attitude.last_vehicle_s - self.first_vehicle_s) / span_s

    def feed(self, message: Message, now_s: float, wall_s: float) -> None:
        """Take one message in; ``wall_s`` is our UTC."""
        inputs = self.assembler.feed(message)
        if inputs is not None:
            self.ticks.append(inputs)
        kind = message.get_msgId()
        if kind == mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE:
            self.scan.put(now_s, codec.from_us(message.time_usec))
            self.last_scan = message
        elif kind == mav.MAVLINK_MSG_ID_HEARTBEAT:
            self._take_heartbeat(message, now_s)
        elif message.get_srcSystem() == self.system and message.get_srcComponent() == codec.VEHICLE_COMPONENT:
            self._take_word(kind, message, now_s, wall_s)

    def _take_heartbeat(self, message: Message, now_s: float) -> None:
        sender = message.get_srcSystem(), message.get_srcComponent()
        if sender[1] == codec.VEHICLE_COMPONENT and message.autopilot != mav.MAV_AUTOPILOT_INVALID:
            self.systems.add(sender[0])
            if sender[0] == self.system:
                self.autopilot = message.autopilot
                self.heartbeat.put(now_s)
        elif sender[1] == codec.COMPANION_COMPONENT:
            self.companions.add(sender)

    def _take_word(self, kind: int, message: Message, now_s: float, wall_s: float) -> None:
        if kind == mav.MAVLINK_MSG_ID_ATTITUDE_QUATERNION:
            self.attitude.put(now_s, codec.from_ms(message.time_boot_ms))
            if self.first_vehicle_s is None:
                self.first_vehicle_s = self.attitude.last_vehicle_s
            self.bad_estimates += not math.isfinite(message.q1)
        elif kind == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            self.position.put(now_s, codec.from_ms(message.time_boot_ms))
            self.bad_estimates += not all(map(math.isfinite, (message.x, message.y, message.z)))
        elif kind == mav.MAVLINK_MSG_ID_SYS_STATUS:
            self.health = message
        elif kind == mav.MAVLINK_MSG_ID_SYSTEM_TIME and message.time_unix_usec > 0:
            self.system_time = message.time_unix_usec / 1e6, wall_s
        elif kind == mav.MAVLINK_MSG_ID_PARAM_VALUE:
            name, value = decode_param(message)
            self.params[name] = value
        elif kind == mav.MAVLINK_MSG_ID_STATUSTEXT and message.severity <= SEVERITY_TOLD:
            self.texts = list(dict.fromkeys([*self.texts, message.text]))[-TEXTS_MAX:]
