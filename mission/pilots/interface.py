"""What is a pilot? A pure function from one scan to one setpoint, on the same vehicle and sensors as everybody else.

A pilot sees what the companion sees (``Inputs``), flies what the companion flies (``Task``) and answers with the same
setpoint. Its memory is a value that only it reads. It is ticked from the hover on; while ``inputs.status.offboard`` is
False it may look round, but what it answers is not flown.
"""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from companion import navigator
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import F64, Setpoint
from sitl.world import World


@dataclass(frozen=True, slots=True)
class PilotNote:
    """What a pilot says of one tick; for tables and pictures, never flown."""

    mode: str  # its own word for what it is doing
    switches: int = 0  # of modes since OFFBOARD
    switches_bound: int | None = None  # most that its rules allow so far; None: it has no such bound
    decided: bool = False  # was a path planned in this tick? its time then counts as a decision's
    path_ne_m: F64 | None = None  # (k, 2) local ned, what it means to fly
    record: navigator.Record | None = None  # the navigator only


class Pilot(Protocol):
    """Stateless; the same object may fly many flights."""

    name: str
    source: str  # where the recipe comes from

    def start(self, params: navigator.Params) -> Any:
        """Its memory before the first scan."""
        ...

    def tick(
        self, memory: Any, inputs: Inputs, task: Task, params: navigator.Params
    ) -> tuple[Any, Setpoint, PilotNote]:
        """One scan in, one setpoint out; local ned. Nothing but the arguments may matter."""
        ...


@runtime_checkable
class Oracle(Protocol):
    """A pilot that knows more than it sees."""

    def told(self, world: World, spawn_ned_m: F64) -> Pilot:
        """The pilot for one flight: what stands where in world ned, and where local ned has its origin."""
        ...
