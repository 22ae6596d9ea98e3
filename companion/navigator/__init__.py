"""One tick, pure: memory and inputs in, memory, setpoint and record out."""

from companion.navigator.decide import Answer
from companion.navigator.memory import Memory, start
from companion.navigator.params import Params
from companion.navigator.record import Record
from companion.navigator.tick import Pending, act, sense, tick

__all__ = ["Answer", "Memory", "Params", "Pending", "Record", "act", "sense", "start", "tick"]
