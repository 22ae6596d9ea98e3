"""What does end-to-end TD3 fly? Scan and goal in, velocity and yaw rate out; no arbiter, no checker, no guidance.

S. Fujimoto, H. van Hoof, D. Meger, "Addressing function approximation error in actor-critic methods", ICML 2018, as the
paper's vanilla baseline: the actor that was trained in ``SwiftNavLowLevel-v0``, with that environment's observation,
action and hold. Landing is everybody's. Kept as ``actor.safetensors`` and ``card.json``, as the other policies are.
"""

import hashlib
import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from companion.core.frames import yaw_rad
from companion.core.types import F64, Setpoint
from companion.perception.observation import observation
from companion.perception.perceive import representatives
from companion.policy.actor import Actor, arrays, from_arrays, squashed
from companion.policy.interface import Query
from companion.policy.observations import SIZES, observe
from companion.policy.store import POLICIES
from mission.errors import InputError
from mission.pilots.cockpit import Recipe, View, Wish, shortened

FOLDER = POLICIES.parent / "baselines" / "td3_vanilla"
ACTOR, CARD = "actor.safetensors", "card.json"
FORMAT = 2
ACTIONS = 3  # velocity ahead and to the right, yaw rate
SLACK_S = 0.005  # less than half a scan


@dataclass(frozen=True, slots=True)
class LowLevelCard:
    """What the numbers mean, and where they come from."""

    observation: str = "goal"  # or paper, see ``companion.policy.observations``
    hold_s: float = 0.2  # that one action is flown for
    yaw_rate_rad_s: float = 1.2  # of action 1
    training: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Own:
    """The action in force."""

    action: F64  # (3,)
    until_t_s: float


class Td3Vanilla(Recipe):
    """Pilot 'td3_vanilla'."""

    name = "td3_vanilla"
    source = "TD3 (Fujimoto, van Hoof, Meger 2018) end to end, trained in SwiftNavLowLevel-v0"

    def __init__(self, folder: Path = FOLDER) -> None:
        """Raises InputError where there is no trained actor, or one that does not fit."""
        self.card, self._actor = load_low_level(folder)

    def steer(self, view: View, own: Own | None) -> tuple[Own, Wish]:
        """See ``Recipe.steer``."""
        due = own is None or view.state.t_s >= own.until_t_s
        if own is None or due:
            own = Own(self._decided(view), view.state.t_s + self.card.hold_s - SLACK_S)
        yaw = yaw_rad(view.state.q_ned_frd)
        ahead, right = (view.task.cruise_m_s * own.action[:2]).tolist()
        velocity = shortened(
            np.array([math.cos(yaw) * ahead - math.sin(yaw) * right, math.sin(yaw) * ahead + math.cos(yaw) * right]),
            view.task.cruise_m_s,
        )
        setpoint = Setpoint(
            view.state.t_s,
            np.array([math.nan, math.nan, view.down_m]),
            np.array([velocity[0], velocity[1], 0.0]),
            None,
            None,
        )
        turn_rad = self.card.yaw_rate_rad_s * float(own.action[2]) * max(view.dt_s, 0.0)
        wish = Wish("td3", setpoint=setpoint, course_rad=view.yaw_sp_rad + turn_rad, decided=due)
        return own, wish

    def _decided(self, view: View) -> F64:
        """The action (3,) for what is seen now; none for what is no number."""
        state, goal = view.state, view.task.goal_ned_m
        near = representatives(view.percept.bearing_range_m, state, view.params.perception.sense_radius_m)
        seen = observation(state, near, view.start_ne_m, goal)
        query = Query(
            state,
            goal,
            view.percept.grid,
            np.empty((0, 2)),
            view.params.vehicle.radius_m,
            state.pos_ned_m[None, :2],
            seen,
            view.start_ne_m,
        )
        output = self._actor.forward(observe(self.card.observation, query, None, view.params.map))
        return squashed(output) if np.isfinite(output).all() else np.zeros(ACTIONS)


def load_low_level(folder: Path) -> tuple[LowLevelCard, Actor]:
    """Card and actor. Raises InputError, one line with file and reason."""
    if not (folder / CARD).is_file():
        raise InputError(f"pilot 'td3_vanilla' has no trained policy: {folder / CARD} does not exist")
    try:
        data = json.loads((folder / CARD).read_text(encoding="utf-8"))
        weights = (folder / ACTOR).read_bytes()
        actor = from_arrays(load(weights))
        card = LowLevelCard(data["observation"], data["hold_s"], data["yaw_rate_rad_s"], data["training"])
        sizes, expected = actor.sizes(), (SIZES[card.observation], ACTIONS)
    except (OSError, ValueError, KeyError, IndexError, TypeError, SafetensorError) as error:
        raise InputError(f"{folder}: no low-level policy: {error!r}") from error
    if data.get("format") != FORMAT or data.get("sha256") != hashlib.sha256(weights).hexdigest():
        raise InputError(f"{folder / CARD}: format or sha256 does not fit {ACTOR}")
    if (sizes[0], sizes[-1]) != expected:
        raise InputError(f"{folder / ACTOR}: sizes {sizes}, expected {expected[0]} in and {expected[1]} out")
    return card, actor


def save_low_level(folder: Path, actor: Actor, card: LowLevelCard) -> None:
    """Write a policy that ``load_low_level`` reads."""
    folder.mkdir(parents=True, exist_ok=True)
    weights = save(arrays(actor), metadata={"format": "np"})
    data = {"format": FORMAT, "sha256": hashlib.sha256(weights).hexdigest(), **asdict(card)}
    (folder / ACTOR).write_bytes(weights)
    (folder / CARD).write_text(json.dumps(data, indent=2, allow_nan=False) + "\n", encoding="utf-8")
