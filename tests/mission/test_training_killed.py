"""A real training, on the vehicle: killed at ten random moments, or out of disk, it ends with the same weights."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mission.flight_log import read_rows
from mission.training.fleet import seed_folder

CODE = "import sys; from mission import cli; sys.exit(cli.main(sys.argv[1:]))"
EPISODES, KILLS = 24, 10
SMALL = (
    "td3.hidden=[32,32] env.time_limit_s=30 training.batch=32 training.warmup_decisions=16 training.checkpoint_every=2"
)
WATCHED = f"{SMALL} training.evaluate_every=8 training.evaluation_flights=1"
UNWATCHED = f"{SMALL} training.evaluate_every=0"  # a whole flight's log, on its way, is larger than a checkpoint
ROWS = ("episodes", "updates", "evaluations", "tracks")
DISK_EPISODES = 8


def _words(folder: Path, episodes: int, settings_text: str) -> list[str]:
    settings = [word for setting in settings_text.split() for word in ("--set", setting)]
    fixed = ["--world", "trajectory1", "--seeds", "1", "--max-episodes", str(episodes), *settings]
    return [sys.executable, "-c", CODE, "train", *fixed, "--out", str(folder)]


def _resume(folder: Path) -> list[str]:
    return [sys.executable, "-c", CODE, "train", "--resume", str(folder)]


def _end(folder: Path) -> tuple[str, dict[str, list[dict[str, Any]]]]:
    """The weights' fingerprint and every row."""
    at = seed_folder(folder, 1)
    result = json.loads((at / "result.json").read_text())
    return result["weights_sha256"], {name: list(read_rows(at / f"{name}.jsonl")) for name in ROWS}


def _flown(folder: Path) -> int:
    return sum(1 for _ in read_rows(seed_folder(folder, 1) / "episodes.jsonl"))


def _whole(words: list[str], folder: Path, episodes: int) -> float:
    """Train without a break; wall seconds of an episode."""
    began_s = time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    while not _flown(folder):
        assert process.poll() is None
        time.sleep(0.05)
    first_s = time.monotonic() - began_s
    assert process.wait() == 0
    return (time.monotonic() - began_s - first_s) / (episodes - 1)


def _kill(words: list[str], folder: Path, episode: int, after_s: float) -> None:
    """Kill -9 the command with all its processes, so long after an episode was flown (0: while it starts)."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    while _flown(folder) < episode and process.poll() is None:
        time.sleep(0.05)
    time.sleep(after_s)
    assert process.poll() is None, "it ended before it was killed"
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.slow
def test_a_training_killed_at_ten_random_moments_ends_with_the_weights_of_one_never_killed(tmp_path: Path) -> None:
    episode_s = _whole(_words(tmp_path / "whole", EPISODES, WATCHED), tmp_path / "whole", EPISODES)
    rng, stood = np.random.default_rng(), []
    folder, words = tmp_path / "killed", _words(tmp_path / "killed", EPISODES, WATCHED)
    for _ in range(KILLS):
        _kill(words, folder, _flown(folder) + int(rng.integers(3)), rng.uniform(0.0, episode_s))
        stood.append(_flown(folder))
        if (folder / "run.yaml").is_file():
            words = _resume(folder)
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    print(f"killed after episodes {stood}, {episode_s:.1f} s each")
    assert _end(folder) == _end(tmp_path / "whole")


@pytest.mark.slow
def test_a_training_on_a_full_disk_says_so_in_one_line_and_goes_on_once_there_is_room(tmp_path: Path) -> None:
    _whole(_words(tmp_path / "whole", DISK_EPISODES, UNWATCHED), tmp_path / "whole", DISK_EPISODES)
    folder, room = tmp_path / "full", _checkpoints(tmp_path / "whole")[6] - 1
    words = _words(folder, DISK_EPISODES, UNWATCHED)
    ran = subprocess.run(words, check=False, capture_output=True, text=True, preexec_fn=_limit(room))
    assert ran.returncode == 1
    assert ran.stderr.count("\n") == 1, ran.stderr
    assert "File too large" in ran.stderr
    assert f"'swiftnav train --resume {folder}' goes on" in ran.stderr
    assert "the one of episode 4 is whole" in ran.stderr
    assert 4 in _checkpoints(folder)
    subprocess.run(_resume(folder), check=True, stdout=subprocess.DEVNULL)
    assert _end(folder) == _end(tmp_path / "whole")


def _checkpoints(folder: Path) -> dict[int, int]:
    """Bytes by episode."""
    found = seed_folder(folder, 1).glob("checkpoint-*.pt")
    return {int(path.stem.removeprefix("checkpoint-")): path.stat().st_size for path in found}


def _limit(size: int) -> Callable[[], None]:
    """No file grows beyond ``size`` bytes: what a full disk looks like, without being root."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
