"""One tick, pure: memory and inputs in, memory, setpoint and record out."""

from companion.navigator.memory import Memory, start
from companion.navigator.params import Params
from companion.navigator.record import Record
from companion.navigator.tick import tick

__all__ = ["Memory", "Params", "Record", "start", "tick"]
