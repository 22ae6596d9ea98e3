"""How is a training flight set up? One frozen value, and the flight plan that follows from it, a world and a seed."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from companion.core import params as core_params
from companion.core.params import nearest
from companion.core.task import Task
from companion.navigator.params import Params
from companion.policy import decoder, observations
from companion.policy.decoder import DecoderParams
from companion.policy.learned import PolicySpec
from mission.errors import InputError
from mission.flight_plan import DECIMALS, FlightPlan, draw
from mission.mission_file import Mission, NoiseSpec, Success, Turbulence, WindSpec
from mission.training.episode import Until
from mission.training.flight import FlightSpec
from mission.training.reward_tables import reward_table
from sitl.lidar import LidarParams
from sitl.simulation import scan_steps
from sitl.world import World

NAME = "training"  # of mission and policy: as a policy's it gives paths a learned policy's horizon
CRUISE_DOWN_M = -2.5  # where the autopilot's own take-off ends
NO_STABILITY = {  # hysteresis, debounce and dwell off: the smallest values that the arbiter takes
    "debounce_ticks": 1,
    "debounce_s": 0.0,
    "dwell_s": 0.0,
}
HYSTERESIS = (("d_enter_m", "d_exit_m"), ("s_enter", "s_exit"))  # without it an exit lies this far beyond its entry:
HAIR = 1e-6
RANGES = {  # as for missions
    "range_sigma_m": (0.0, 0.5),
    "dropout": (0.0, 0.99),
    "latency_s": (0.0, 1.0),
    "scan_latency_s": (0.0, 1.0),
    "scan_rate_hz": (5.0, 50.0),
    "spawn_jitter_m": (0.0, 10.0),
    "cruise_m_s": (0.3, 15.0),
}
WIND_MAX_M_S = 20.0


@dataclass(frozen=True, slots=True)
class EnvConfig:
    """What an environment is, but for its worlds.

    ``checker=False``: proposals are flown as they are; nothing is corrected, refused or replaced by an escape. What
    stays on: the speed clamp along the path, the stop rule along the velocity, and that a path seen to be blocked is
    asked for anew. ``stability=False``: no hysteresis, no debounce, no dwell; line of sight stays.
    """

    reward: str = "default"  # see ``reward_table``
    observation: str = "goal"  # see ``companion.policy.observations``
    decoder: str = "detour"  # see ``companion.policy.decoder``
    decoder_params: DecoderParams = field(default_factory=DecoderParams)
    guard: bool = False  # the geometric expert's proposal is one more candidate of the checker
    checker: bool = True
    stability: bool = True
    range_sigma_m: float = 0.01
    dropout: float = 0.0
    latency_s: float = 0.05  # from scan to setpoint in force
    scan_latency_s: float = 0.0  # besides
    scan_rate_hz: float = 25.0  # fewer scans: flights that cost less, and a slower vehicle
    wind_m_s: tuple[float, float] = (1.0, 5.0)  # the mean is drawn from this range
    turbulence: Turbulence = "light"
    spawn_jitter_m: float = 2.0
    cruise_m_s: float = 3.0
    time_limit_s: float = 90.0  # from the hand-over
    discount_per_s: float = 0.98
    until: Until = "above"  # see ``episode``
    low_level: bool = False  # who trains makes ``SwiftNavLowLevel-v0`` of it: the policy steers by itself
    params: dict[str, dict[str, Any]] = field(default_factory=dict)  # overrides of the navigator's, by group

    def __post_init__(self) -> None:
        """Raise InputError naming what is unknown or out of range."""
        for what, value, known in (
            ("observation", self.observation, list(observations.SIZES)),
            ("decoder", self.decoder, list(decoder.NAMES)),
            ("until", self.until, ["above", "landed"]),
        ):
            if value not in known:
                raise InputError(f"unknown {what} '{value}'{nearest(value, known)}")
        reward_table(self.reward)
        if not 0.0 < self.discount_per_s <= 1.0:
            raise InputError(f"discount_per_s {self.discount_per_s} is outside (0, 1]")
        for name, (least, most) in RANGES.items():
            if not least <= getattr(self, name) <= most:
                raise InputError(f"{name} {getattr(self, name)} is outside [{least:g}, {most:g}]")
        try:
            scan_steps(LidarParams(rate_hz=self.scan_rate_hz))
        except ValueError as error:
            raise InputError(f"scan_rate_hz: {error}") from error
        if not 0.0 <= self.wind_m_s[0] <= self.wind_m_s[1] <= WIND_MAX_M_S:
            raise InputError(f"wind_m_s {list(self.wind_m_s)} wants [low, high] in [0, {WIND_MAX_M_S:g}]")
        if not 0.0 < self.time_limit_s <= 3600.0:
            raise InputError(f"time_limit_s {self.time_limit_s} is outside (0, 3600]")

    def policy_spec(self) -> PolicySpec:
        """What the numbers of observation and action mean, for a policy trained here."""
        return PolicySpec(self.observation, decoder=self.decoder, decoder_params=self.decoder_params)


def navigator_params(config: EnvConfig) -> Params:
    """The navigator's parameters. Raises ParamError."""
    params = core_params.update(Params(), {"policy": {"name": NAME, "guard": config.guard}})
    if not config.stability:
        arbiter = params.arbiter
        exits = {upper: getattr(arbiter, lower) + HAIR for lower, upper in HYSTERESIS}
        params = core_params.update(params, {"arbiter": NO_STABILITY | exits})
    return core_params.update(params, config.params)


def flight_spec(world: World, seed: int, config: EnvConfig, params: Params) -> FlightSpec:
    """What is flown: start, nose, wind and noise drawn from the seed as for every mission."""
    mission = Mission(
        name=NAME,
        world=world.name,
        cruise_m_s=config.cruise_m_s,
        spawn_jitter_m=config.spawn_jitter_m,
        wind=WindSpec(mean_m_s=config.wind_m_s, turbulence=config.turbulence),
        noise=NoiseSpec(range_sigma_m=config.range_sigma_m, dropout=config.dropout),
        success=Success(time_limit_s=config.time_limit_s),
    )
    draws = draw(mission, world, seed, params.vehicle.radius_m)
    goal_ned_m = np.round(world.goal_ned_m - np.array(draws.spawn_ned_m), DECIMALS)
    task = Task(goal_ned_m, CRUISE_DOWN_M, mission.cruise_m_s)
    seeded = world.seeded(draws.mover_seed) if world.movers else world  # the same world keeps its shortest way
    plan = FlightPlan(mission, seeded, params, seed, draws, task)
    return FlightSpec(
        plan,
        reward_table(config.reward, world.name),
        config.time_limit_s,
        config.latency_s,
        config.scan_latency_s,
        config.scan_rate_hz,
        config.discount_per_s,
    )
