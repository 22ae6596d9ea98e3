"""Who else can be asked?  Policies that learned nothing, for every table: ``geometric``, ``straight``, ``random``.

``policy_for`` finds them and the learned ones by name or folder.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from companion.core.params import nearest
from companion.core.types import F64
from companion.navigator import Params
from companion.navigator.decide import policy_named
from companion.policy import decoder
from companion.policy.decoder import ACTION_SIZE, DecoderParams
from companion.policy.expert import GeometricExpert
from companion.policy.interface import Policy, Proposal, Query
from companion.policy.store import is_folder, load_policy, shipped
from mission.errors import InputError

STRAIGHT, RANDOM = "straight", "random"
BASELINES = (GeometricExpert.name, STRAIGHT, RANDOM)


@dataclass(slots=True)
class StraightPolicy:
    """Straight at the goal, whatever stands there: what the checker alone makes of it."""

    name: str = STRAIGHT
    params: DecoderParams = field(default_factory=DecoderParams)

    def propose(self, query: Query, memory: F64 | None) -> tuple[Proposal | None, F64 | None]:
        """Five waypoints along the goal bearing."""
        return decoder.proposal("detour", np.zeros(ACTION_SIZE), query, self.params), memory


@dataclass(slots=True)
class RandomPolicy:
    """A uniform action at every decision; its memory counts them."""

    seed: int
    decoder_name: str = "detour"
    name: str = RANDOM
    params: DecoderParams = field(default_factory=DecoderParams)

    def propose(self, query: Query, memory: F64 | None) -> tuple[Proposal | None, F64 | None]:
        """What a uniform action decodes to."""
        count = 0 if memory is None else int(memory[0])
        action = np.random.default_rng([self.seed, count]).uniform(-1.0, 1.0, ACTION_SIZE)
        return decoder.proposal(self.decoder_name, action, query, self.params), np.array([count + 1.0])


def policy_for(name: str, params: Params, seed: int) -> Policy:
    """A baseline, a shipped policy, or one in a folder; ``seed`` is for ``random``. Raises InputError or ParamError."""
    if name == STRAIGHT:
        return StraightPolicy()
    if name == RANDOM:
        return RandomPolicy(seed)
    if name == GeometricExpert.name:
        return policy_named(name, params)
    check_policy(name)
    return load_policy(name, params.map)


def check_policy(name: str) -> None:
    """Raises InputError where there is no such policy; what is in its files is checked when they are read."""
    known = [*BASELINES, *shipped()]
    if name in known:
        return
    if not is_folder(name):
        raise InputError(f"unknown policy '{name}'{nearest(name, known)}")
    if not Path(name).is_dir():
        raise InputError(f"policy folder '{name}' does not exist")
