"""One seed trains: stopped at any moment it goes on bit for bit, and what is damaged is found out."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pendulum_kit import CONFIG, STEPS, PendulumJob, parts

from mission.errors import FlightError
from mission.flight_log import read_rows
from mission.training.checkpoint import fingerprint, load_newest, save
from mission.training.status import Status
from mission.training.trainer import RESULT, Trainer, episode_seed
from mission.training.until import Until

EPISODES = 14
FILES = ("episodes", "updates", "evaluations", "tracks")


def _train(folder: Path, stop_after: int | None = None, kind: str = "per", episodes: int = EPISODES) -> list[Status]:
    """Statuses of a training, dropped without a word after so many episodes."""
    trainer = Trainer(parts(5, kind), CONFIG, Until(1000, episodes), 5, folder)
    statuses = []
    for status in trainer.run():
        statuses.append(status)
        if stop_after is not None and len(statuses) == stop_after:
            break
    return statuses


def _weights(folder: Path) -> str:
    return str(json.loads((folder / RESULT).read_text())["weights_sha256"])


def _rows(folder: Path) -> dict[str, list[dict[str, Any]]]:
    return {name: list(read_rows(folder / f"{name}.jsonl")) for name in FILES}


@pytest.mark.parametrize("kind", ["per", "lap", "uniform"])
def test_a_training_broken_off_and_taken_up_again_ends_like_one_never_broken_off(tmp_path: Path, kind: str) -> None:
    _train(tmp_path / "whole", kind=kind)
    for stops in (1, 4, 2):
        _train(tmp_path / "broken", stops, kind)
    _train(tmp_path / "broken", kind=kind)
    assert _weights(tmp_path / "broken") == _weights(tmp_path / "whole")
    assert _rows(tmp_path / "broken") == _rows(tmp_path / "whole")


def test_other_seeds_learn_other_weights(tmp_path: Path) -> None:
    _train(tmp_path / "a")
    list(Trainer(parts(6), CONFIG, Until(1000, EPISODES), 6, tmp_path / "b").run())
    assert _weights(tmp_path / "a") != _weights(tmp_path / "b")
    assert len({episode_seed(seed, episode) for seed in range(20) for episode in range(50)}) == 1000


def test_rows_are_written_once_on_disk_and_on_the_board(tmp_path: Path) -> None:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    for stops in (5, 5, None):
        statuses = _train(tmp_path, stops)
    rows = _rows(tmp_path)
    assert [row["episode"] for row in rows["episodes"]] == list(range(1, EPISODES + 1))
    assert [row["episode"] for row in rows["evaluations"]] == [0, 4, 8, 12, 14]
    assert statuses[-1].state == "done"
    assert statuses[-1].progress.decisions == EPISODES * STEPS
    board = EventAccumulator(str(tmp_path / "tensorboard"))
    board.Reload()
    assert [event.step for event in board.Scalars("episodes/return")] == list(range(1, EPISODES + 1))
    assert [event.step for event in board.Scalars("evaluations/greedy.action")] == [0, 4, 8, 12, 14]


def test_wall_time_is_accounted_for(tmp_path: Path) -> None:
    status = _train(tmp_path)[-1]
    assert set(status.shares) == {"navigator", "physics", "updates", "rest"}
    assert sum(status.shares.values()) == pytest.approx(1.0)
    assert status.shares["updates"] > 0.2
    assert status.decisions_per_s > 0.0


def test_training_ends_with_its_successes(tmp_path: Path) -> None:
    trainer = Trainer(parts(5), CONFIG, Until(2, 200), 5, tmp_path)
    statuses = list(trainer.run())
    assert statuses[-1].progress.successes == 2
    assert statuses[-1].progress.episodes < 200
    again = list(Trainer(parts(5), CONFIG, Until(2, 200), 5, tmp_path).run())
    assert [status.progress for status in again] == [statuses[-1].progress]


def test_training_ends_with_the_episode_that_uses_up_the_ticks(tmp_path: Path) -> None:
    statuses = list(Trainer(parts(5), CONFIG, Until(1000, 1000, ticks=2 * STEPS + 1), 5, tmp_path).run())
    assert [status.progress.episodes for status in statuses] == [1, 2, 3]
    assert [status.time_left_s == 0.0 for status in statuses] == [False, False, True]


def test_a_damaged_checkpoint_is_told_and_the_one_before_it_counts(tmp_path: Path) -> None:
    _train(tmp_path / "whole")
    _train(tmp_path / "damaged", 9)
    newest = max((tmp_path / "damaged").glob("checkpoint-*.pt"))
    newest.write_bytes(newest.read_bytes()[:-7])
    statuses = _train(tmp_path / "damaged")
    assert newest.name in statuses[0].note
    assert "sha256" in statuses[0].note
    assert _weights(tmp_path / "damaged") == _weights(tmp_path / "whole")


def test_without_any_good_checkpoint_the_training_is_refused(tmp_path: Path) -> None:
    _train(tmp_path, 9)
    for path in tmp_path.glob("checkpoint-*.pt"):
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        path.write_bytes(data)
    with pytest.raises(FlightError, match=r"sha256 does not match.*no good checkpoint is left"):
        _train(tmp_path)


def test_rows_that_were_lost_are_noticed(tmp_path: Path) -> None:
    _train(tmp_path, 9)
    (tmp_path / "episodes.jsonl").write_text("")
    with pytest.raises(FlightError, match=r"episodes\.jsonl is shorter"):
        _train(tmp_path)


def test_a_save_cut_off_before_its_hash_leaves_the_one_before(tmp_path: Path) -> None:
    save(tmp_path, 5, {"a": 1})
    save(tmp_path, 10, {"a": 2})
    (tmp_path / "checkpoint-000010.pt.sha256").unlink()
    loaded = load_newest(tmp_path)
    assert loaded is not None
    assert (loaded.episode, loaded.refused) == (5, ())


def test_a_full_disk_leaves_the_checkpoint_before_it(tmp_path: Path) -> None:
    save(tmp_path, 5, {"a": np.zeros(10)})
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))  # files end here, as on a full disk
    try:
        with pytest.raises(FlightError, match="the one of episode 5 is whole"):
            save(tmp_path, 10, {"a": np.zeros(100_000)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    loaded = load_newest(tmp_path)
    assert loaded is not None
    assert loaded.episode == 5
    assert sorted(path.name for path in tmp_path.iterdir()) == ["checkpoint-000005.pt", "checkpoint-000005.pt.sha256"]


def test_a_state_comes_back_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    state = {
        "arrays": [rng.normal(size=(3, 2)), rng.integers(9, size=4), np.array([True, False])],
        "generator": rng.bit_generator.state,
        "nested": {"text": "a", "none": None, "number": 0.1 + 0.2, "share": np.float64(1 / 3)},
    }
    save(tmp_path, 1, state)
    loaded = load_newest(tmp_path)
    assert loaded is not None
    assert fingerprint(loaded.state) == fingerprint(state)
    assert fingerprint(state) != fingerprint({**state, "nested": {}})


def _kill_and_resume(folder: Path, rng: np.random.Generator, kills: int, episodes: int) -> None:
    """Train in a process of its own, kill -9 it at random moments, at last let it end."""
    code = (
        "import sys; from pathlib import Path; from pendulum_kit import PendulumJob\n"
        f"for status in PendulumJob({episodes})(5, Path(sys.argv[1])): print(status.progress.episodes, flush=True)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    for _ in range(kills):
        process = subprocess.Popen(
            [sys.executable, "-c", code, str(folder)], env=environment, stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        process.stdout.readline()  # it has begun
        time.sleep(rng.uniform(0.0, 0.4))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
    subprocess.run([sys.executable, "-c", code, str(folder)], env=environment, check=True, stdout=subprocess.DEVNULL)


def test_a_training_killed_at_a_random_moment_ends_with_the_weights_of_one_never_killed(tmp_path: Path) -> None:
    list(PendulumJob(40)(5, tmp_path / "whole"))
    _kill_and_resume(tmp_path / "killed", np.random.default_rng(), 1, 40)
    assert _weights(tmp_path / "killed") == _weights(tmp_path / "whole")
    assert _rows(tmp_path / "killed") == _rows(tmp_path / "whole")


@pytest.mark.slow
def test_a_training_killed_at_ten_random_moments_ends_with_the_weights_of_one_never_killed(tmp_path: Path) -> None:
    list(PendulumJob(200)(5, tmp_path / "whole"))
    _kill_and_resume(tmp_path / "killed", np.random.default_rng(), 10, 200)
    assert _weights(tmp_path / "killed") == _weights(tmp_path / "whole")
    assert _rows(tmp_path / "killed") == _rows(tmp_path / "whole")
