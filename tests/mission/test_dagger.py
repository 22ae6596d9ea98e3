"""Cloning the expert by DAgger: what a run leaves, that it can be resumed, and what it refuses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.policy.headings import HEADINGS, headings_rad
from companion.policy.store import read_policy
from mission.errors import InputError
from mission.training.dagger import Standing, drawn, run
from mission.training.dagger_config import DaggerConfig, clone_preset, clone_presets, read_config, write_config
from mission.training.env_config import EnvConfig, flight_spec, navigator_params
from mission.training.episode import Episode
from mission.training.teachers import ExpertTeacher, MapTeacher
from sitl.world import World, wall_box

BRIEF = DaggerConfig(
    world="forest:train:3", rounds=2, flights=1, steps=10, hidden=(8,), time_limit_s=5.0, expert_share=(1.0, 0.0)
)
POCKET = World(  # a wall close ahead that reaches far to the left
    name="pocket",
    start_ned_m=np.zeros(2),
    goal_ned_m=np.array([20.0, 0.0]),
    bounds_m=(-10.0, -20.0, 30.0, 20.0),
    circles=np.zeros((0, 4)),
    boxes=np.array([wall_box((2.5, -15.0), (2.5, 3.0), 0.3, np.inf)]),
)


class KilledError(Exception):
    """Stands for kill -9."""


def weights(folder: Path) -> bytes:
    return (folder / "round-1" / "actor.safetensors").read_bytes()


def test_a_run_that_was_killed_goes_on_and_ends_with_the_same_weights(tmp_path: Path) -> None:
    seen: list[Standing] = []
    run(BRIEF, tmp_path / "whole", seen.append)

    def die(standing: Standing) -> None:
        if standing.round == 1:
            raise KilledError

    with pytest.raises(KilledError):
        run(BRIEF, tmp_path / "cut", die)
    run(BRIEF, tmp_path / "cut", lambda standing: None)
    assert weights(tmp_path / "cut") == weights(tmp_path / "whole")
    assert [standing.clone is not None for standing in seen] == [False, True, False, True]
    card, actor = read_policy(tmp_path / "whole" / "round-1")
    assert card.training["world"] == BRIEF.world
    assert actor.sizes() == (50, 8, 41)


def test_the_expert_teaches_the_heading_of_its_path_and_who_knows_the_map_the_quickest() -> None:
    config = EnvConfig(range_sigma_m=0.0, spawn_jitter_m=0.0, wind_m_s=(0.0, 0.0))
    params, decoder = navigator_params(config), BRIEF.policy_spec().decoder_params
    episode = Episode(flight_spec(POCKET, 1, config, params))
    assert episode.query is not None
    wall = MapTeacher(episode.flight.spec.plan, decoder, 0.1)
    for teacher in (ExpertTeacher(params, decoder, 0.12), wall):
        taught = teacher.taught(episode.query)
        assert taught is not None
        assert taught.labels.shape == (HEADINGS,) and taught.labels.sum() == pytest.approx(1.0)
        assert abs(headings_rad(decoder)[taught.labels.argmax()] - taught.heading_rad) < 0.1
        assert taught.heading_rad > 0.0  # the wall is open to the right
    cost_s = wall.cost_s(episode.query)
    assert np.isinf(cost_s).any() and cost_s[np.isfinite(cost_s)].min() > 20.0 / config.cruise_m_s


def test_the_presets_are_whole_and_tight_flies_with_its_profile() -> None:
    assert clone_presets() == ["forest", "tight"]
    assert clone_preset("forest") == DaggerConfig()
    params = navigator_params(drawn(clone_preset("tight"), np.random.default_rng(1)))
    assert (params.map.cell_m, params.map.sense_m, params.policy.guard) == (0.05, 4.0, False)
    with pytest.raises(InputError, match="did you mean 'tight'"):
        clone_preset("tigth")


def test_the_teachers_share_of_the_last_round_holds_on() -> None:
    shares = [BRIEF.share_of_expert(number) for number in range(4)]
    assert shares == [1.0, 0.0, 0.0, 0.0]


def test_a_run_keeps_its_settings_and_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    write_config(BRIEF, tmp_path)
    assert read_config(tmp_path) == BRIEF
    with pytest.raises(InputError, match="is not empty"):
        write_config(BRIEF, tmp_path)
    with pytest.raises(InputError, match="is no run folder"):
        read_config(tmp_path / "nothing")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"observation": "mop"}, "did you mean 'map'"),
        ({"teacher": "mapp"}, "did you mean 'map'"),
        ({"rounds": 0}, "rounds = 0"),
        ({"random_share": 1.5}, "share of 1.5"),
        ({"expert_share": ()}, "one number a round"),
        ({"headings_m": 0.0}, "headings_m = 0.0"),
        ({"profile": "tigth"}, "did you mean 'tight'"),
    ],
)
def test_settings_out_of_range_are_named(change: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        replace(BRIEF, **change)  # type: ignore[arg-type]
