"""The same seeds on Ray give the same weights, and what dies there is told and repaired like a process here."""

import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

pytest.importorskip("ray")

from pendulum_kit import PendulumJob

from mission.cluster import LOCAL, check_address
from mission.errors import InputError
from mission.training.fleet import Member, run_fleet
from mission.training.ray_fleet import read_files, run_ray_fleet, write_files
from mission.training.status import Status

EPISODES = 10


class Dying(PendulumJob):
    """Seed 2 takes its process with it, the first time."""

    def __call__(self, seed: int, folder: Path) -> Iterator[Status]:
        for status in super().__call__(seed, folder):
            yield status
            if seed == 2 and status.progress.episodes == 7 and not (folder / "died").exists():
                os._exit(1)


def _weights(folder: Path) -> str:
    return str(json.loads((folder / "result.json").read_text())["weights_sha256"])


def test_files_travel_whole_and_what_is_gone_goes(tmp_path: Path) -> None:
    files = {"a.txt": b"1", "below/b.bin": b"2"}
    write_files(tmp_path, files)
    assert read_files(tmp_path) == files
    write_files(tmp_path, {"a.txt": b"3"})
    assert read_files(tmp_path) == {"a.txt": b"3"}


@pytest.mark.slow
def test_a_local_ray_trains_the_same_weights_as_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _with_tests_on_path(monkeypatch)
    seen: list[int] = []

    def watch(members: object) -> None:
        assert isinstance(members, list)
        seen.append(sum(m.status.progress.episodes for m in members if m.status))

    job = PendulumJob(EPISODES)
    members = run_ray_fleet(job, [1, 2], tmp_path / "ray", LOCAL, 2, watch)
    assert [member.state for member in members] == ["done", "done"]
    assert max(seen) == 2 * EPISODES
    assert len(set(seen)) > 2  # told as it went
    run_fleet(job, [1, 2], tmp_path / "here", 2, lambda _: None)
    for seed in ("seed_1", "seed_2"):
        assert _weights(tmp_path / "ray" / seed) == _weights(tmp_path / "here" / seed)


@pytest.mark.slow
def test_a_task_that_dies_is_told_and_resumed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _with_tests_on_path(monkeypatch)
    members = run_ray_fleet(Dying(EPISODES), [1, 2], tmp_path / "ray", LOCAL, 2, lambda _: None)
    assert [member.state for member in members] == ["done", "failed"]
    assert members[1].error
    assert list((tmp_path / "ray" / "seed_2").glob("checkpoint-*.pt"))
    (tmp_path / "ray" / "seed_2" / "died").touch()
    members = run_ray_fleet(Dying(EPISODES), [1, 2], tmp_path / "ray", LOCAL, 2, lambda _: None)
    assert [member.state for member in members] == ["done", "done"]
    list(PendulumJob(EPISODES)(2, tmp_path / "alone"))
    assert _weights(tmp_path / "ray" / "seed_2") == _weights(tmp_path / "alone")


def test_a_cluster_that_is_not_there_is_told(tmp_path: Path) -> None:
    for address in ("127.0.0.1:1", "ray://127.0.0.1:1", "127.0.0.1:port"):
        with pytest.raises(InputError, match=f"--cluster '{address}': nobody answers"):
            run_ray_fleet(PendulumJob(1), [1], tmp_path, address, 1, _nobody)


@pytest.mark.parametrize("address", ["nowhere", "ray://nowhere"])
def test_an_address_without_a_port_is_told_what_it_wants(address: str) -> None:
    with pytest.raises(InputError, match=f"--cluster '{address}' wants HOST:PORT, ray://HOST:PORT, auto or local"):
        check_address(address)


def _nobody(members: Sequence[Member]) -> None:
    assert all(isinstance(member, Member) for member in members)


def _with_tests_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks import the job from here."""
    here = str(Path(__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(part for part in (here, os.environ.get("PYTHONPATH")) if part))
