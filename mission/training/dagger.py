"""How does a ranking of headings learn a teacher's ways? DAgger: who learns flies, the teacher says what it would do.

Each round flies missions with the policy of the round before, on the full vehicle with noise, latency and wind drawn
for each flight. At every decision the teacher, asked the same, ranks the headings: that is the label. Then all that was
ever seen is cloned anew. In a declared share of decisions the teacher steers itself, and in a few chance does, so that
places are seen that neither would have come to.

Everything lies in the run's folder: a flight is a function of (settings, number, policy of the round before), so a run
that was killed goes on with the next flight and ends with the same weights.
"""

import dataclasses
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.core.types import F64
from companion.navigator import Params
from companion.policy import headings
from companion.policy.actor import Actor
from companion.policy.decoder import DecoderParams
from companion.policy.learned import PolicySpec, ranked, recalled
from companion.policy.observations import SIZES, last_heading_rad, observe, remember
from companion.policy.store import Card, read_policy, save_policy
from mission.errors import InputError
from mission.training import bc
from mission.training.bc import Clone, CloneConfig, Dataset
from mission.training.checkpoint import write_whole
from mission.training.dagger_config import DaggerConfig
from mission.training.env_config import EnvConfig, flight_spec, navigator_params
from mission.training.episode import Episode
from mission.training.teachers import ExpertTeacher, MapTeacher, Teacher
from mission.training.training_worlds import WorldSource, world_source

F32 = NDArray[np.float32]
KEPT = ("success", "contact", "time_s", "path_m", "decisions", "world", "end")  # of a flight's figures


@dataclass(frozen=True, slots=True)
class Lesson:
    """What one flight taught."""

    observations: F32  # (n, size)
    labels: F32  # (n, 41) the teacher's chances of the headings
    figures: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Standing:
    """How far a run has come: after every flight, and after every cloning."""

    round: int
    flights: int  # of this round
    decisions: int  # of all rounds
    successes: int  # of this round
    clone: Clone | None = None  # after the cloning


@dataclass(slots=True)
class _Steering:
    """Who steers in a flight: the teacher, chance, or the policy; a draw at each decision."""

    actor: Actor | None
    spec: PolicySpec
    expert_share: float
    random_share: float
    sigma_rad: float
    rng: np.random.Generator

    def logits(self, seen: F64, taught_rad: float, last_rad: float | None) -> F64:
        """A ranking of the headings; ``last_rad``: the one decided last, off the goal bearing."""
        draw = self.rng.uniform()
        params = self.spec.decoder_params
        if draw < self.random_share:
            return _peak(float(self.rng.uniform(-params.side_rad, params.side_rad)), self.sigma_rad, params)
        if self.actor is None or draw < self.random_share + self.expert_share:
            return _peak(taught_rad, self.sigma_rad, params)
        return headings.steadied(self.actor.forward(seen), last_rad, params)


def run(config: DaggerConfig, folder: Path, shown: Callable[[Standing], None]) -> Clone:
    """Fly and clone until the last round is done; what lies in the folder already is not done again.

    The policies lie in ``folder/round-K``. Raises InputError, PolicyError, OSError.
    """
    source = world_source(config.world)
    lessons: list[Lesson] = []
    actor: Actor | None = None
    taught: Clone | None = None
    for number in range(config.rounds):
        for index in range(config.flights):
            lessons.append(_lesson(config, folder, number, index, actor, source))
            ours = lessons[number * config.flights :]
            won = sum(lesson.figures["success"] for lesson in ours)
            shown(Standing(number, index + 1, sum(len(lesson.labels) for lesson in lessons), won))
        kept = folder / f"round-{number}"
        taught = _cloned(config, number, lessons, kept)
        actor = taught.actor
        shown(Standing(number, config.flights, sum(len(lesson.labels) for lesson in lessons), won, taught))
    assert taught is not None  # at least one round
    return taught


def flown(config: DaggerConfig, number: int, index: int, actor: Actor | None, source: WorldSource) -> Lesson:
    """One flight of a round. Raises InputError."""
    seed = [config.seed, number, index]
    rng = np.random.default_rng(seed)
    env = drawn(config, rng)
    params = navigator_params(env)
    spec = config.policy_spec()
    steering = _Steering(actor, spec, config.share_of_expert(number), config.random_share, config.sigma_rad, rng)
    episode = Episode(flight_spec(source.draw(rng), int(rng.integers(2**31)), env, params))
    return _taught(episode, steering, _teacher(config, episode, params), params)


def drawn(config: DaggerConfig, rng: np.random.Generator) -> EnvConfig:
    """Noise, latency and wind of one flight."""
    return EnvConfig(
        observation=config.observation,
        range_sigma_m=float(rng.uniform(*config.range_sigma_m)),
        dropout=float(rng.uniform(*config.dropout)),
        latency_s=float(rng.uniform(*config.latency_s)),
        scan_latency_s=float(rng.uniform(*config.scan_latency_s)),
        wind_m_s=config.wind_m_s,
        spawn_jitter_m=config.spawn_jitter_m,
        cruise_m_s=config.cruise_m_s,
        time_limit_s=config.time_limit_s,
        params=config.params(),
    )


def dataset(lessons: list[Lesson]) -> Dataset:
    """All lessons as one."""
    return Dataset(
        np.concatenate([lesson.observations for lesson in lessons]),
        np.concatenate([lesson.labels for lesson in lessons]),
    )


def _teacher(config: DaggerConfig, episode: Episode, params: Params) -> Teacher:
    decoder_params = config.policy_spec().decoder_params
    if config.teacher == "map":
        return MapTeacher(episode.flight.spec.plan, decoder_params, config.temperature_s)
    return ExpertTeacher(params, decoder_params, config.sigma_rad)


def _taught(episode: Episode, steering: _Steering, teacher: Teacher, params: Params) -> Lesson:
    """Fly to the end; where the teacher knows no way nothing is learned."""
    spec = steering.spec
    seen_all: list[F64] = []
    labels_all: list[F32] = []
    memory: F64 | None = None
    while (query := episode.query) is not None:
        taught = teacher.taught(query)
        if taught is None:
            episode.decide(None, memory)
            continue
        memory = recalled(query, memory, spec)
        seen = observe(spec.observation, query, memory, params.map)
        logits = steering.logits(seen, taught.heading_rad, last_heading_rad(query, memory))
        proposal, heading_rad = ranked(logits, query, spec, params.map)
        seen_all.append(seen)
        labels_all.append(taught.labels)
        memory = remember(query, memory, heading_rad, 0.0)
        episode.decide(proposal, memory)
    figures = episode.figures()
    observations = np.array(seen_all, np.float32).reshape(-1, SIZES[spec.observation])
    labels = np.array(labels_all, np.float32).reshape(-1, headings.HEADINGS)
    return Lesson(observations, labels, {key: figures[key] for key in KEPT})


def _lesson(
    config: DaggerConfig, folder: Path, number: int, index: int, actor: Actor | None, source: WorldSource
) -> Lesson:
    """As it was flown before, or flown now and kept."""
    path = folder / "flights" / f"{number}-{index:04d}.npz"
    if path.is_file():
        with np.load(path) as kept:
            figures = json.loads(str(kept["figures"]))
            return Lesson(kept["observations"], kept["labels"], figures)
    lesson = flown(config, number, index, actor, source)
    buffer = io.BytesIO()
    np.savez(
        buffer,
        observations=lesson.observations,
        labels=lesson.labels,
        figures=np.array(json.dumps(lesson.figures)),
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, buffer.getvalue())
    return lesson


def _cloned(config: DaggerConfig, number: int, lessons: list[Lesson], folder: Path) -> Clone:
    """The policy of a round, as it was kept before or cloned now."""
    spec = config.policy_spec()
    if (folder / "card.json").is_file():
        card, actor = read_policy(folder)
        return Clone(actor, *(float(card.training[key]) for key in ("loss", "held_out_loss", "agreement")))
    told = [lesson for lesson in lessons if len(lesson.labels)]
    if not told:
        raise InputError(f"no flight needed a decision: there is nothing to learn in '{config.world}'")
    clone_config = CloneConfig(observation=config.observation, hidden=config.hidden, steps=config.steps)
    result = bc.clone(dataset(told), clone_config, config.seed)
    training = {
        **dataclasses.asdict(config),
        "round": number,
        "decisions": sum(len(lesson.labels) for lesson in lessons),
        "loss": result.loss,
        "held_out_loss": result.held_out_loss,
        "agreement": result.agreement,
    }
    save_policy(folder, result.actor, Card(config.name, spec, training))
    return result


def _peak(heading_rad: float, sigma_rad: float, params: DecoderParams) -> F64:
    """A ranking whose best is this heading, as it is taught."""
    away: F64 = (headings.headings_rad(params) - heading_rad) / sigma_rad
    return -0.5 * away * away
