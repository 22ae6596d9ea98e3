"""Cloning the expert by DAgger: what a run leaves, that it can be resumed, and what it refuses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from companion.policy.headings import headings_rad
from companion.policy.store import read_policy
from mission.errors import InputError
from mission.training.dagger import Lesson, Standing, dataset, run
from mission.training.dagger_config import DaggerConfig, read_config, write_config

BRIEF = DaggerConfig(
    world="forest:train:3", rounds=2, flights=1, steps=10, hidden=(8,), time_limit_s=5.0, expert_share=(1.0, 0.0)
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


def test_labels_peak_at_the_teachers_heading() -> None:
    params = BRIEF.policy_spec().decoder_params
    lesson = Lesson(np.zeros((3, 50), np.float32), headings_rad(params)[[0, 20, 33]], {})
    data = dataset([lesson, lesson], params, 0.12)
    assert data.labels.argmax(axis=1).tolist() == [0, 20, 33] * 2
    assert np.allclose(data.labels.sum(axis=1), 1.0)


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
        ({"rounds": 0}, "rounds = 0"),
        ({"random_share": 1.5}, "share of 1.5"),
        ({"expert_share": ()}, "one number a round"),
    ],
)
def test_settings_out_of_range_are_named(change: dict[str, object], told: str) -> None:
    with pytest.raises(InputError, match=told):
        replace(BRIEF, **change)  # type: ignore[arg-type]
