"""``SwiftNav-v0``: the RL decisions of a mission as a Gymnasium environment, on the full vehicle.

One step is one decision (semi-MDP): the action becomes a path, the checker judges it, the navigator flies on, in
whatever mode, until RL mode asks again or the flight ends. See ``SwiftNavEnv``.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from companion.policy.decoder import ACTION_SIZE
from companion.policy.interface import Query
from companion.policy.learned import act
from companion.policy.observations import SIZES, observe
from mission.errors import InputError
from mission.training.env_config import EnvConfig, flight_spec, navigator_params
from mission.training.episode import Episode
from mission.training.flight import End, Flight
from mission.training.path_ratio import path_ratio
from mission.training.training_worlds import Worlds, world_source
from sitl.world import World

F32 = NDArray[np.float32]
FLIGHTS_MAX = 100  # without a decision, in a row


class SwiftNavEnv(gymnasium.Env[F32, F32]):
    """Fly from start to goal; decide where RL mode asks.

    Observation: ``Box(-inf, inf, (n,), float32)``, of order one, by ``EnvConfig.observation``:

    | name | n | numbers |
    |---|---|---|
    | ``goal`` | 72 | 0-1 position in the goal frame / 20 m, 2 down / 5 m, 3-5 roll, pitch, yaw off the line [rad], |
    | | | 6-8 body rates [rad/s], 9-11 velocity in the goal frame / 3 m/s, |
    | | | 12-71 the twenty nearest obstacles (ahead, right, distance) / 10 m; 2 where there is none |
    | ``paper`` | 72 | the same in the world frame |
    | ``map`` | 50 | 0-35 ranges of the remembered map round the goal bearing, 36-49 memory of the flight |
    | ``corridors`` | 86 | 0-35 ranges, 36-71 free corridors of the vehicle's width, 72-85 memory |

    Action: ``Box(-1, 1, (10,), float32)``, by ``EnvConfig.decoder``:

    | decoder | numbers |
    |---|---|
    | ``detour`` | 0 side: +-2.8 rad off the goal bearing, 1 turn: +-2 rad along the way, 2 length: 2 to 6 m; |
    | | the rest is ignored; zero flies straight at the goal |
    | ``waypoints`` | five places (ahead, right), 3 m each way, off the nose |

    Reward: rows of the table of all ticks since the decision, discounted by the tick and scaled (``reward_tables``).
    ``info["discount"]`` is what the next value has to be multiplied with. ``terminated``: goal, contact, out of bounds,
    attitude, on the ground elsewhere, no progress where the table ends there. ``truncated``: the time limit.

    ``info`` at every step: ``discount``, ``ticks``, ``entered`` (this observation is the first since RL was entered);
    after ``reset`` also ``flights_without_decision`` and ``skipped`` (their figures: they end inside ``reset``, which
    then draws the next flight); at the end ``episode``, the figures of the flight.

    ``reset(seed=..., options={"world": name or World})``; a flight is a function of the seed and the actions.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own class attribute)

    def __init__(self, world: Worlds = "trajectory2", config: EnvConfig | None = None) -> None:
        """``world``: see ``training_worlds.world_source``. Raises InputError or ParamError."""
        self.config = config or EnvConfig()
        self._params = navigator_params(self.config)
        self._spec = self.config.policy_spec()
        self._radius_m = self._params.vehicle.radius_m
        self._source = self._drawn_from = world_source(world, self._radius_m)
        self._episode: Episode | None = None
        self._physics_s = 0.0  # of earlier flights
        self.observation_space = spaces.Box(-np.inf, np.inf, (SIZES[self.config.observation],), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)

    @property
    def flight(self) -> Flight:
        """The flight under way: truth, for pictures and tests."""
        return self._flying.flight

    @property
    def query(self) -> Query:
        """What a policy is asked now: for teachers, who see more than the observation."""
        query = self._flying.query
        if query is None:
            raise RuntimeError("the flight is over: reset first")
        return query

    @property
    def physics_s(self) -> float:
        """Wall time spent in the simulator so far."""
        return self._physics_s + (0.0 if self._episode is None else self._episode.flight.physics_s)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[F32, dict[str, Any]]:
        """The first decision of the next flight that has one."""
        super().reset(seed=seed)
        skipped: list[dict[str, Any]] = []
        while len(skipped) < FLIGHTS_MAX:
            world = self._world((options or {}).get("world"))
            flight_seed = int(self.np_random.integers(2**31))
            self._physics_s = self.physics_s
            self._episode = Episode(
                flight_spec(world, flight_seed, self.config, self._params), self.config.until, self.config.checker
            )
            if self._episode.query is not None:
                self._episode.flight.take_earned()  # earned before the first decision: by nobody
                info = {"flights_without_decision": len(skipped), "skipped": skipped, "entered": True}
                return self._observed(self._episode.query), info | {"discount": 1.0, "ticks": 0}
            skipped.append(self._figures())
        raise InputError(f"none of {FLIGHTS_MAX} flights needed a decision: there is nothing to learn in these worlds")

    def step(self, action: F32) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        """Fly this decision, up to the next one."""
        episode, query = self._flying, self.query
        wanted = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        episode.decide(*act(wanted, query, episode.memory, self._spec))
        earned, end = episode.flight.take_earned(), episode.flight.end
        info: dict[str, Any] = {"discount": earned.discount, "ticks": earned.ticks, "entered": episode.entered}
        if end is not None:
            info["episode"] = self._figures()
        seen = self._observed(episode.query or episode.last_view())
        return seen, earned.reward, end is not None and end is not End.TIMEOUT, end is End.TIMEOUT, info

    @property
    def _flying(self) -> Episode:
        if self._episode is None:
            raise RuntimeError("no flight yet: reset first")
        return self._episode

    def _world(self, named: str | World | None) -> World:
        self._drawn_from = self._source if named is None else world_source(named, self._radius_m)
        return self._drawn_from.draw(self.np_random)

    def _observed(self, query: Query) -> F32:
        return observe(self._spec.observation, query, self._flying.memory, self._params.map).astype(np.float32)

    def _figures(self) -> dict[str, Any]:
        episode = self._flying
        return episode.figures() | {"path_ratio": path_ratio(episode.flight, self._drawn_from.fixed)}
