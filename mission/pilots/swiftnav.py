"""How does the navigator fly a benchmark? Its own tick, unchanged, with the policy of that name."""

import dataclasses
from functools import lru_cache

from companion import navigator
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import Setpoint
from mission.pilots.interface import PilotNote


class SwiftNav:
    """Arbiter, checker, limits and follower round one policy."""

    source = "companion.navigator: the code that flies"

    def __init__(self, policy: str = "geometric") -> None:
        """``policy``: a name that the navigator knows."""
        self.name = policy

    def start(self, params: navigator.Params) -> navigator.Memory:
        """Nothing seen, nobody flies."""
        return navigator.start(params)

    def tick(
        self, memory: navigator.Memory, inputs: Inputs, task: Task, params: navigator.Params
    ) -> tuple[navigator.Memory, Setpoint, PilotNote]:
        """``navigator.tick``."""
        memory, setpoint, record = navigator.tick(memory, inputs, task, _asking(params, self.name))
        engaged = memory.engaged
        note = PilotNote(
            mode=record.mode,
            switches=engaged.arbiter.switches if engaged else 0,
            switches_bound=record.switches_bound,
            decided=record.decision is not None,
            path_ne_m=engaged.path.vertices_ne_m if engaged and engaged.path else None,
            record=record,
        )
        return memory, setpoint, note


@lru_cache(maxsize=8)
def _asking(params: navigator.Params, policy: str) -> navigator.Params:
    return dataclasses.replace(params, policy=dataclasses.replace(params.policy, name=policy))
