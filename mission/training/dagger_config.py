"""What decides a cloning of the expert by DAgger? One frozen value; lies in the run's folder."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from companion.core.params import nearest
from companion.navigator.profiles import profile_named, profile_names
from companion.policy import observations
from companion.policy.decoder import DecoderParams
from companion.policy.learned import RANKINGS, PolicySpec
from mission.errors import InputError
from mission.strict_yaml import read_yaml, write_yaml
from mission.training.configure import configured, plain

FILE = "dagger.yaml"
PRESETS = Path(__file__).parent / "clones"
TEACHERS = ("geometric", "map")
Span = tuple[float, float]  # a flight draws uniformly from it


@dataclass(frozen=True, slots=True)
class DaggerConfig:
    """Everything: the same value, the same weights."""

    name: str = "forest"  # of the policy
    world: str = "mixed:train"  # see ``world_source``
    profile: str | None = None  # of the companion's parameters; None: the defaults
    cruise_m_s: float = 3.0
    spawn_jitter_m: float = 2.0
    headings_m: float = 4.0  # length of a path
    head: str = "headings"  # or ``centred``: paths pushed to the middle between hits
    teacher: str = "geometric"  # the expert; or ``map``: who knows the true map, see ``map_teacher``
    observation: str = "map"  # see ``companion.policy.observations``
    hidden: tuple[int, ...] = (256, 256)
    seed: int = 1
    rounds: int = 6
    flights: int = 60  # a round
    expert_share: tuple[float, ...] = (1.0, 0.3, 0.1, 0.0)  # of the decisions, by round; the last holds on
    random_share: float = 0.05
    steps: int = 4000  # of a cloning
    sigma_rad: float = 0.12  # of the expert's labels: about a heading's width
    temperature_s: float = 0.1  # of those by cost: so much dearer is 1/e as likely
    range_sigma_m: Span = (0.0, 0.04)
    dropout: Span = (0.0, 0.02)
    latency_s: Span = (0.03, 0.1)
    scan_latency_s: Span = (0.0, 0.04)
    wind_m_s: Span = (0.0, 6.0)
    time_limit_s: float = 90.0

    def __post_init__(self) -> None:
        """Raise InputError naming what is unknown or out of range."""
        if self.observation not in observations.SIZES:
            known = list(observations.SIZES)
            raise InputError(f"unknown observation '{self.observation}'{nearest(self.observation, known)}")
        if self.head not in RANKINGS:
            raise InputError(f"unknown head '{self.head}'{nearest(self.head, list(RANKINGS))}")
        if self.teacher not in TEACHERS:
            raise InputError(f"unknown teacher '{self.teacher}'{nearest(self.teacher, list(TEACHERS))}")
        for field in ("rounds", "flights", "steps"):
            if getattr(self, field) < 1:
                raise InputError(f"{field} = {getattr(self, field)} wants at least 1")
        for share in (*self.expert_share, self.random_share):
            if not 0.0 <= share <= 1.0:
                raise InputError(f"a share of {share} is outside [0, 1]")
        if not self.expert_share:
            raise InputError("expert_share wants one number a round; the last one holds on")
        if not 0.2 <= self.headings_m <= 20.0:
            raise InputError(f"headings_m = {self.headings_m} is outside [0.2, 20]")
        if self.profile is not None and self.profile not in profile_names():
            raise InputError(f"unknown profile '{self.profile}'{nearest(self.profile, profile_names())}")

    def params(self) -> dict[str, dict[str, Any]]:
        """Overrides of the companion's parameters."""
        return {} if self.profile is None else profile_named(self.profile)

    def policy_spec(self) -> PolicySpec:
        """What the numbers of the policy mean."""
        return PolicySpec(self.observation, self.head, decoder_params=DecoderParams(headings_m=self.headings_m))

    def share_of_expert(self, number: int) -> float:
        """Share of decisions that the teacher steers in a round, from 0."""
        return self.expert_share[min(number, len(self.expert_share) - 1)]


def clone_presets() -> list[str]:
    """Names that ``clone_preset`` knows."""
    return sorted(path.stem for path in PRESETS.glob("*.yaml"))


def clone_preset(name: str) -> DaggerConfig:
    """The settings of that name. Raises InputError."""
    if name not in clone_presets():
        raise InputError(f"unknown preset '{name}'{nearest(name, clone_presets())}")
    return configured(DaggerConfig, read_yaml(PRESETS / f"{name}.yaml"), f"preset {name}")


def write_config(config: DaggerConfig, folder: Path) -> None:
    """A new run folder; one that holds something is refused. Raises InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError(f"run folder '{folder}' is not empty; 'swiftnav clone --resume {folder}' goes on with it")
        temporary = folder / f".{FILE}"
        write_yaml(temporary, plain(config))
        temporary.replace(folder / FILE)
    except OSError as error:
        raise InputError(f"run folder '{folder}' cannot be written: {error.strerror or error}") from error


def read_config(folder: Path) -> DaggerConfig:
    """The settings of a run that was begun. Raises InputError."""
    path = folder / FILE
    if not path.is_file():
        raise InputError(f"'{folder}' is no run folder: it has no {FILE}")
    return configured(DaggerConfig, read_yaml(path), str(path))
