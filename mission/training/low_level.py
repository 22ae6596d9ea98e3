"""``SwiftNavLowLevel-v0``: the baseline that steers by itself. No arbiter, no checker, no guidance, no navigator.

Same vehicle, worlds, draws and rewards as ``SwiftNav-v0``; see ``SwiftNavLowLevelEnv``.
"""

import math
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from companion.core import gridmap
from companion.core.codec import to_ms
from companion.core.frames import yaw_rad
from companion.core.types import F64
from companion.perception.observation import observation
from companion.perception.perceive import representatives
from companion.perception.polar import flatten
from companion.policy.interface import Query
from companion.policy.observations import SIZES, observe
from mission.errors import InputError
from mission.training.env_config import EnvConfig, flight_spec, navigator_params
from mission.training.flight import HANDOVER_S, End, Flight
from mission.training.path_ratio import path_ratio
from mission.training.reward import GOAL_M, TickFacts
from mission.training.training_worlds import Worlds, world_source
from sitl.demand import TrajectorySetpoint, no_axes
from sitl.simulation import Observation

F32 = NDArray[np.float32]
ACTIONS = 3
YAW_RATE_MAX_RAD_S = 1.2  # as fast as the navigator turns the nose
HOLD_S = 0.2  # an action is flown for, in whole scans
OBSERVATIONS = ("goal", "paper")
MODE = "low_level"
STILL = np.zeros(ACTIONS)


class SwiftNavLowLevelEnv(gymnasium.Env[F32, F32]):
    """Fly from start to goal by velocity and yaw rate.

    Observation: ``Box(-inf, inf, (72,), float32)``: ``goal`` or ``paper`` of ``SwiftNav-v0``, from the present scan.

    Action: ``Box(-1, 1, (3,), float32)``, flown for ``hold_ticks`` scans (default: 5 of 40 ms, 2 of 80 ms):

    | number | what |
    |---|---|
    | 0 | velocity ahead, +-cruise (3 m/s) |
    | 1 | velocity to the right, +-cruise |
    | 2 | yaw rate, +-1.2 rad/s |

    The autopilot keeps the height. Reward: the rows of the same table; those of modes and RL endpoints never come.
    ``terminated``: within 2 m of the goal, contact, out of bounds, attitude; ``truncated``: time. ``info`` as there.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own class attribute)

    def __init__(
        self, world: Worlds = "trajectory1", config: EnvConfig | None = None, hold_ticks: int | None = None
    ) -> None:
        """``world``: see ``training_worlds.world_source``. Raises InputError or ParamError."""
        self.config = config or EnvConfig()
        if self.config.observation not in OBSERVATIONS:
            raise InputError(f"observation '{self.config.observation}' needs a map: the baseline has {OBSERVATIONS}")
        self._hold_ticks = ticks_of(self.config) if hold_ticks is None else hold_ticks
        if self._hold_ticks < 1:
            raise InputError(f"hold_ticks {hold_ticks} is below 1")
        self._params = navigator_params(self.config)
        self._source = world_source(world, self._params.vehicle.radius_m)
        self._no_grid = gridmap.empty(self._params.map)
        self._flight: Flight | None = None
        self._seen: Observation
        self._decisions = 0
        self._physics_s = 0.0  # of earlier flights
        self.observation_space = spaces.Box(-np.inf, np.inf, (SIZES[self.config.observation],), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (ACTIONS,), np.float32)

    @property
    def flight(self) -> Flight:
        """The flight under way: truth, for pictures and tests."""
        if self._flight is None:
            raise RuntimeError("no flight yet: reset first")
        return self._flight

    @property
    def physics_s(self) -> float:
        """Wall time spent in the simulator so far."""
        return self._physics_s + (0.0 if self._flight is None else self._flight.physics_s)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[F32, dict[str, Any]]:
        """Take off and hand over."""
        super().reset(seed=seed)
        named = (options or {}).get("world")
        source = self._source if named is None else world_source(named, self._params.vehicle.radius_m)
        world, flight_seed = source.draw(self.np_random), int(self.np_random.integers(2**31))
        self._physics_s = self.physics_s
        flight = self._flight = Flight(flight_spec(world, flight_seed, self.config, self._params))
        self._decisions = 0
        seen = flight.take_off()
        for _ in range(round(HANDOVER_S * flight.sim.config.lidar.rate_hz)):
            self._command(flight, seen, STILL)
            seen = flight.next_scan()
        self._start_ne_m = seen.state.pos_ned_m[:2].copy()
        flight.hand_over()
        seen = self._tick(flight, seen, STILL)
        flight.take_earned()
        info = {"flights_without_decision": 0, "skipped": [], "entered": True, "discount": 1.0, "ticks": 0}
        return self._observed(seen), info

    def step(self, action: F32) -> tuple[F32, float, bool, bool, dict[str, Any]]:
        """Fly the action for ``hold_ticks`` scans or to the end."""
        flight = self.flight
        if flight.end is not None:
            raise RuntimeError("the flight is over: reset first")
        wanted = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        self._decisions += 1
        for _ in range(self._hold_ticks):
            self._seen = self._tick(flight, self._seen, wanted)
            if flight.end is not None:
                break
        earned = flight.take_earned()
        info: dict[str, Any] = {"discount": earned.discount, "ticks": earned.ticks, "entered": False}
        end: End | None = flight.end
        if end is not None:
            ratio = path_ratio(flight, self._source.fixed)
            info["episode"] = flight.figures() | NO_MODES | {"decisions": self._decisions, "path_ratio": ratio}
        timeout = end is End.TIMEOUT
        return self._observed(self._seen), earned.reward, end is not None and not timeout, timeout, info

    def _tick(self, flight: Flight, seen: Observation, action: F64) -> Observation:
        self._command(flight, seen, action)
        seen = self._seen = flight.next_scan()
        state = seen.state
        range_m = self._bearing_range_m(seen)
        d_min_m = float(np.nanmin(range_m, initial=math.inf))
        near_m = d_min_m if d_min_m <= self._params.perception.sense_radius_m else math.inf
        north_m, east_m = state.pos_ned_m[:2].tolist()
        facts = TickFacts(state.t_s, (north_m, east_m), flight.goal_m, near_m, MODE)
        flight.judge(facts, arrived=flight.goal_m < GOAL_M)
        return seen

    def _command(self, flight: Flight, seen: Observation, action: F64) -> None:
        """Velocity relative to the nose as it is, the height of the task, a yaw rate."""
        ahead, right = (self.config.cruise_m_s * action[:2]).tolist()
        yaw = yaw_rad(seen.state.q_ned_frd)
        north = math.cos(yaw) * ahead - math.sin(yaw) * right
        east = math.sin(yaw) * ahead + math.cos(yaw) * right
        down_m = flight.spec.plan.task.down_m
        flight.sim.submit_trajectory(
            TrajectorySetpoint(
                np.array([math.nan, math.nan, math.nan if down_m is None else down_m]),
                np.array([north, east, 0.0]),
                no_axes(),
                math.nan,
                YAW_RATE_MAX_RAD_S * float(action[2]),
            ),
            to_ms(seen.scan.t_s),
        )

    def _bearing_range_m(self, seen: Observation) -> F64:
        perception = self._params.perception
        return flatten(seen.scan, seen.state, perception.lidar_up_m, perception.ground_margin_m).bearing_range_m

    def _observed(self, seen: Observation) -> F32:
        state, goal_ne_m = seen.state, self.flight.spec.plan.task.goal_ned_m
        near_ne_m = representatives(self._bearing_range_m(seen), state, self._params.perception.sense_radius_m)
        query = Query(
            state,
            goal_ne_m,
            self._no_grid,
            np.empty((0, 2)),
            self._params.vehicle.radius_m,
            state.pos_ned_m[None, :2],
            observation(state, near_ne_m, self._start_ne_m, goal_ne_m),
            self._start_ne_m,
        )
        return observe(self.config.observation, query, None, self._params.map).astype(np.float32)


def ticks_of(config: EnvConfig) -> int:
    """Scans that an action is flown for."""
    return round(HOLD_S * config.scan_rate_hz)


NO_MODES: dict[str, Any] = {
    "switches": 0,
    "switches_bound": 0,
    "hasty_switches": 0,
    "kept": 0,
    "next": 0,
    "modified": 0,
    "escaped": 0,
    "refused": 0,
    "guarded": 0,
    "rl_time_s": 0.0,
}
