"""What do the sticks say, and is anybody at them? MANUAL_CONTROL as PX4 reads it; time comes with every call."""

import math
from dataclasses import dataclass
from typing import Any, Final

from sitl.px4_params import ParamStore

Message = Any  # a MAVLink_*_message object

RC_ONLY: Final = (0, 4)  # COM_RC_IN_MODE: a receiver only, or no sticks at all
OVERRIDE_AUTO: Final = 1  # COM_RC_OVERRIDE: moving a stick takes over in the autonomous modes
FULL: Final = 1000.0


@dataclass(frozen=True, slots=True)
class Sticks:
    """Deflections from -1 to 1; ``up`` is the throttle, 0 in the middle."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn: float = 0.0  # clockwise


CENTRED: Final = Sticks()


def sticks_of(message: Message) -> Sticks | None:
    """The sticks of a MANUAL_CONTROL; None when a value is out of range (INT16_MAX: axis not there)."""
    values = (message.x, message.y, message.z, message.r)
    if any(abs(value) > FULL for value in values):
        return None
    return Sticks(message.x / FULL, message.y / FULL, message.z / FULL * 2.0 - 1.0, message.r / FULL)


class Pilot:
    """Remembers the sticks."""

    def __init__(self, params: ParamStore) -> None:
        self._params = params
        self._sticks = CENTRED
        self._at_rest = CENTRED  # where the sticks were when the mode began
        self._heard_s = -math.inf

    def hear(self, t_s: float, sticks: Sticks) -> None:
        """Sticks have arrived."""
        if int(self._params["COM_RC_IN_MODE"]) in RC_ONLY:
            return
        if not self.present(t_s):
            self._at_rest = sticks
        self._sticks, self._heard_s = sticks, t_s

    def present(self, t_s: float) -> bool:
        """Have sticks been heard lately?"""
        return t_s - self._heard_s <= self._params["COM_RC_LOSS_T"]

    def sticks(self) -> Sticks:
        """Where the sticks are."""
        return self._sticks

    def held(self, t_s: float) -> Sticks:
        """Where the sticks are, or centred where nobody is at them."""
        return self._sticks if self.present(t_s) else CENTRED

    def rest(self) -> None:
        """A mode begins: sticks that stay where they are now do not take over."""
        self._at_rest = self._sticks

    def takes_over(self, t_s: float) -> bool:
        """Does the pilot move a stick far enough to end an autonomous mode?"""
        if not int(self._params["COM_RC_OVERRIDE"]) & OVERRIDE_AUTO or not self.present(t_s):
            return False
        now, rest = self._sticks, self._at_rest
        moved = max(abs(now.forward - rest.forward), abs(now.right - rest.right), abs(now.turn - rest.turn))
        return moved > self._params["COM_RC_STICK_OV"] / 100.0


def expo(stick: float, share: float, dead_zone: float) -> float:
    """PX4's stick curve: nothing inside the dead zone, cubic by ``share`` outside."""
    sign = math.copysign(1.0, stick)
    value = max(0.0, abs(stick) - dead_zone) / (1.0 - dead_zone)
    return sign * ((1.0 - share) * value + share * value**3)
