"""What does the autopilot say back? Results of commands and texts for people; values."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from pymavlink.dialects.v20 import common as mav

CRITICAL: Final = mav.MAV_SEVERITY_CRITICAL
INFO: Final = mav.MAV_SEVERITY_INFO
EMERGENCY: Final = mav.MAV_SEVERITY_EMERGENCY


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = mav.MAV_RESULT_ACCEPTED
    TEMPORARILY_REJECTED = mav.MAV_RESULT_TEMPORARILY_REJECTED
    DENIED = mav.MAV_RESULT_DENIED
    UNSUPPORTED = mav.MAV_RESULT_UNSUPPORTED
    FAILED = mav.MAV_RESULT_FAILED


@dataclass(frozen=True, slots=True)
class StatusText:
    """One STATUSTEXT to be."""

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class CommandResult:
    """The answer to a command and the reason, empty when there is nothing to say."""

    result: Result
    text: str = ""

    @property
    def accepted(self) -> bool:
        """Was the command carried out?"""
        return self.result is Result.ACCEPTED


ACCEPTED: Final = CommandResult(Result.ACCEPTED)
