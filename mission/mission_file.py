"""Where to fly, in which world, under which conditions, and what counts as success?

A mission is a name (``trajectory2``), a YAML file, or a QGroundControl ``.plan``. Positions are world NED metres.
"""

from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, field_validator, model_validator

from companion.core.params import nearest
from companion.policy.expert import GeometricExpert
from companion.policy.store import is_folder, shipped
from mission.errors import InputError
from mission.plan_file import read_plan
from mission.strict_yaml import StrictModel, checked, read_yaml
from sitl.faults import parse

Real = Annotated[float, Strict()]
TIME_LIMIT_MAX_S = 3600.0
Turbulence = Literal["none", "light", "moderate", "severe"]


class WindSpec(StrictModel):
    """Wind of a run: the mean is drawn from the range, its direction from the full circle."""

    mean_m_s: tuple[Real, Real] = (1.0, 5.0)
    turbulence: Turbulence = "light"

    @model_validator(mode="after")
    def _ordered(self) -> "WindSpec":
        low, high = self.mean_m_s
        if not 0.0 <= low <= high <= 20.0:
            raise ValueError("mean_m_s wants [low, high] with 0 <= low <= high <= 20")
        return self


class NoiseSpec(StrictModel):
    """What the LiDAR adds to the truth."""

    range_sigma_m: Real = Field(default=0.01, ge=0.0, le=0.5)
    dropout: Real = Field(default=0.0, ge=0.0, lt=1.0)


class Success(StrictModel):
    """What the judge asks for, beside no contact at all."""

    time_limit_s: Real = Field(
        gt=0.0, le=TIME_LIMIT_MAX_S
    )  # vehicle time, from the first tick in OFFBOARD to touchdown
    time_ratio: Real | None = Field(default=None, ge=1.0, le=100.0)  # the same time, over the shortest way at cruise
    landing_error_m: Real = Field(default=0.5, gt=0.0, le=100.0)  # horizontal, touchdown to goal


class ForestSpec(StrictModel):
    """A world that the seed of the flight draws: trunks at random, start and goal on the long axis."""

    density_per_m2: Real = Field(default=0.05, ge=0.0, le=1.0)
    size_m: tuple[Real, Real] = (60.0, 40.0)  # north, east
    trunk_diameter_m: Real = Field(default=0.6, gt=0.0, le=10.0)
    seed: int | None = Field(default=None, ge=0)  # null: the flight's


class Mission(StrictModel):
    """One mission; ``None`` for start and goal means the world's own."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_.-]+$")
    text: str = ""
    world: str | None = None  # a name or a file; or else:
    forest: ForestSpec | None = None
    start: tuple[Real, Real] | None = None
    goal: tuple[Real, Real] | None = None
    down_m: Real | None = Field(
        default=None, ge=-100.0, le=-1.0
    )  # cruise altitude, negative above start; null: as taken off
    cruise_m_s: Real = Field(default=3.0, ge=0.3, le=15.0)
    spawn_jitter_m: Real = Field(
        default=2.0, ge=0.0, le=10.0
    )  # radius of the disc in which the seed places the vehicle
    wind: WindSpec = WindSpec()
    noise: NoiseSpec = NoiseSpec()
    faults: tuple[str, ...] = ()  # NAME[=VALUE][@START[..END]], see sitl.faults
    policy: str = "forest"  # or another shipped one, geometric, or the folder of one
    success: Success
    params: dict[str, dict[str, Any]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_world(self) -> "Mission":
        if (self.world is None) == (self.forest is None):
            raise ValueError("wants either 'world' or 'forest'")
        return self

    @field_validator("faults")
    @classmethod
    def _known_faults(cls, specs: tuple[str, ...]) -> tuple[str, ...]:
        for spec in specs:
            parse(spec)
        return specs

    @field_validator("policy")
    @classmethod
    def _known_policy(cls, name: str) -> str:
        known = [GeometricExpert.name, *shipped()]
        if not is_folder(name) and name not in known:
            raise ValueError(f"unknown policy{nearest(name, known)}")
        return name


def list_missions() -> list[str]:
    """Names that ``load_mission`` knows without a path."""
    return sorted(item.name.removesuffix(".yaml") for item in _folder().iterdir() if item.name.endswith(".yaml"))


def load_mission(name_or_path: str) -> Mission:
    """The mission of that name or in that file (.yaml, .yml, .plan). Raises InputError."""
    if name_or_path in list_missions():
        with resources.as_file(_folder() / f"{name_or_path}.yaml") as path:
            return _from_yaml(path)
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml", ".plan"):
        raise InputError(f"unknown mission '{name_or_path}'{nearest(name_or_path, list_missions())}")
    if not path.is_file():
        raise InputError(f"mission file '{name_or_path}' does not exist")
    return _from_plan(path) if path.suffix == ".plan" else _from_yaml(path)


def _folder() -> Any:
    return resources.files("mission") / "missions"


def _from_yaml(path: Path) -> Mission:
    data = read_yaml(path)
    data.setdefault("name", path.stem)
    mission = checked(Mission, data, str(path))
    world = mission.world
    if world is not None and Path(world).suffix and (path.parent / world).is_file():
        return mission.model_copy(update={"world": str(path.parent / world)})  # as seen from where the mission lies
    return mission


def _from_plan(path: Path) -> Mission:
    plan = read_plan(path)
    data = {
        "name": "".join(c if c.isalnum() or c in "_.-" else "_" for c in path.stem) or "plan",
        "world": "open",
        "start": (0.0, 0.0),
        "goal": plan.goal_ned_m,
        "down_m": plan.down_m,
        "cruise_m_s": plan.speed_m_s,
        "success": {"time_limit_s": min(plan.time_limit_s, TIME_LIMIT_MAX_S)},
    }
    return checked(Mission, data, str(path))
