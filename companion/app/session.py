"""What is answered to each scan? The navigator's memory and the reasons to hold instead; no sockets, vehicle time."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Protocol

from companion.core.frames import yaw_rad
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import AutopilotStatus, Setpoint, VehicleState
from companion.guidance import limits
from companion.navigator import Params


class TickRecord(Protocol):
    """What a tick says of itself."""

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready, keys in a fixed order."""


class Navigator(Protocol):
    """The decision core: ``companion.navigator``, or a stand-in."""

    def start(self, params: Params) -> Any:
        """Memory of a navigator that has seen nothing."""

    def tick(self, memory: Any, inputs: Inputs, task: Task, params: Params) -> tuple[Any, Setpoint, TickRecord]:
        """One scan in; next memory, setpoint and record out."""


class HoldReason(StrEnum):
    """Why the process holds, over the navigator's head."""

    SCAN_LOST = "scan lost"
    TICK_FAILED = "navigator failed"
    STOPPING = "stopping"


@dataclass(frozen=True, slots=True)
class Answer:
    """What one tick gives."""

    setpoint: Setpoint
    record: TickRecord
    over: bool  # the vehicle has flown and is disarmed: nothing more to answer

    @property
    def row(self) -> Mapping[str, Any]:
        """The record as it is logged; made when asked for, so that the setpoint does not wait for it."""
        return self.record.as_dict()


class Session:
    """One flight: memory of the navigator, and a hold when the process asks for one."""

    def __init__(self, task: Task, params: Params, navigator: Navigator) -> None:
        self._task = task
        self._params = params
        self._navigator = navigator
        self._memory: Any = navigator.start(params)
        self._stop: limits.HoldMemory | None = None
        self._last_scan_s = -math.inf
        self.hold_reason: HoldReason | None = None
        self.engaged = False  # the autopilot was armed and in OFFBOARD at some tick

    def tick(self, inputs: Inputs) -> Answer:
        """Let the navigator answer a scan. Raises what it trips over, ValueError for a setpoint that is no number.

        A scan older than the last one means that the vehicle has booted: all that was remembered is of another origin.
        """
        if inputs.scan.t_s < self._last_scan_s:
            self._memory, self.engaged = self._navigator.start(self._params), False
        self._last_scan_s = inputs.scan.t_s
        self.engaged = self.engaged or is_flying(inputs.status)
        self._memory, setpoint, record = self._navigator.tick(self._memory, inputs, self._task, self._params)
        if not _is_finite(setpoint):
            raise ValueError(f"setpoint is not finite: {setpoint}")
        return Answer(setpoint, record, over=self.engaged and not inputs.status.armed)

    def hold(self, reason: HoldReason) -> None:
        """From now on hold; where, is decided by the next state."""
        self.hold_reason, self._stop = reason, None

    def release(self) -> None:
        """Back to the navigator."""
        self.hold_reason, self._stop = None, None

    def held(self, state: VehicleState) -> Setpoint:
        """Brake, and stand where that ends."""
        yaw = self._stop.yaw_rad if self._stop is not None else yaw_rad(state.q_ned_frd)
        self._stop, setpoint = limits.hold(state, self._stop, yaw, self._params.limits)
        return setpoint


def is_flying(status: AutopilotStatus | None) -> bool:
    """Does the companion steer? Armed, and the autopilot listens to setpoints."""
    return status is not None and status.armed and status.offboard


def decided(row: Mapping[str, Any]) -> bool:
    """Did this tick ask the policy?"""
    return "verdict" in row


def _is_finite(setpoint: Setpoint) -> bool:
    """The wire would read NaN as 'not controlled': the vehicle would drift."""
    parts = (setpoint.pos_ned_m, setpoint.vel_ned_m_s, setpoint.acc_ned_m_s2)
    values = [value for part in parts if part is not None for value in part.tolist()]
    return all(map(math.isfinite, values)) and (setpoint.yaw_rad is None or math.isfinite(setpoint.yaw_rad))
