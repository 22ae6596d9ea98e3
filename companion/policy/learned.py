"""Which five waypoints does the network propose? Observation, actor, decoder or ranking behind the Policy interface.

Pure but for the weights it holds. With the head ``continuous`` the actor's ten numbers go to a decoder; with
``headings`` its forty-one rank headings, and the next choices go along for the checker.
"""

from dataclasses import dataclass, field

import numpy as np

from companion.core.gridmap import MapParams
from companion.core.types import F64
from companion.policy import decoder, headings, observation_map, recollection
from companion.policy.actor import Actor, squashed
from companion.policy.decoder import ACTION_SIZE, SIDE, TURN, DecoderParams
from companion.policy.goal_frame import goal_frame
from companion.policy.interface import Proposal, Query
from companion.policy.observations import last_heading_rad, observe, remember

RANKINGS = ("headings", "centred")  # the second pushes its paths to the middle between remembered hits
HEADS = {"continuous": ACTION_SIZE, **dict.fromkeys(RANKINGS, headings.HEADINGS)}  # name: outputs of the actor


@dataclass(frozen=True, slots=True)
class PolicySpec:
    """What the numbers that go in and come out mean."""

    observation: str  # see ``observations``
    head: str = "continuous"  # see ``HEADS``
    decoder: str = "detour"  # see ``decoder``; of the continuous head
    decoder_params: DecoderParams = field(default_factory=DecoderParams)


class LearnedPolicy:
    """A trained policy; its memory is that of ``recollection``."""

    def __init__(self, name: str, actor: Actor, spec: PolicySpec, map_params: MapParams) -> None:
        """``map_params``: those of the map that queries come with."""
        self.name = name
        self.spec = spec
        self._actor = actor
        self._map = map_params

    def propose(self, query: Query, memory: F64 | None) -> tuple[Proposal | None, F64 | None]:
        """Five waypoints and, from a ranking, next choices; see ``Policy.propose``. Not finite: no proposal."""
        memory = recalled(query, memory, self.spec)
        output = self._actor.forward(observe(self.spec.observation, query, memory, self._map))
        if not np.isfinite(output).all():
            return None, memory
        if self.spec.head in RANKINGS:
            output = headings.steadied(output, last_heading_rad(query, memory), self.spec.decoder_params)
            proposal, heading_rad = ranked(output, query, self.spec, self._map)
            return proposal, remember(query, memory, heading_rad, 0.0)
        return act(squashed(output), query, memory, self.spec)


def recalled(query: Query, memory: F64 | None, spec: PolicySpec) -> F64 | None:
    """What was remembered as the policy will see it; training's, too.

    ``centred``: what counts as decided last is what is flown. Else a ranking that the checker overruled, its vehicle
    turned round by a next choice, took it for still going on, and led back into the same dead end.
    """
    if spec.head != "centred" or memory is None or query.course_rad is None:
        return memory
    return recollection.flown(memory, query.course_rad)


def ranked(logits: F64, query: Query, spec: PolicySpec, map_params: MapParams) -> tuple[Proposal, float]:
    """What a ranking (41,) proposes, and its heading off the goal bearing; training flies through this, too."""
    hits = observation_map.hits_ne(query, map_params) if spec.head == "centred" else None
    return headings.ranked(logits, query, spec.decoder_params, hits)


def act(action: F64, query: Query, memory: F64 | None, spec: PolicySpec) -> tuple[Proposal, F64]:
    """What an action (10,) proposes, and the memory for the next decision; training acts through this, too."""
    proposal = decoder.proposal(spec.decoder, action, query, spec.decoder_params)
    if spec.decoder == "waypoints":
        heading_rad, turn = _course(proposal, query), 0.0
    else:
        heading_rad, turn = spec.decoder_params.side_rad * float(action[SIDE]), float(action[TURN])
    return proposal, remember(query, memory, heading_rad, turn)


def _course(proposal: Proposal, query: Query) -> float:
    """Bearing of the last waypoint off the goal's, seen from the anchor."""
    end = goal_frame(query).from_ne(proposal.waypoints_ne_m[-1:])[0]
    return float(np.arctan2(end[1], end[0]))
