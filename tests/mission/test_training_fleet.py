"""Seeds train in processes of their own: what one does, the others do not feel."""

import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

from mission.errors import FlightError, InputError
from mission.training import fleet
from mission.training.fleet import Member, folder_lock, run_fleet
from mission.training.fleet_view import FleetView, fleet_table, member_line
from mission.training.status import Progress, Status

EPISODES = 3


def _status(seed: int, episode: int) -> Status:
    state = "done" if episode == EPISODES else "training"
    return Status(seed, state, Progress(episode, episode), 80.0, 12.0, 31.4, 2.0 * episode, 4.0, {"updates": 0.25})


def train(seed: int, folder: Path) -> Iterator[Status]:
    """Does nothing but tell; seed 2 dies the hard way, seed 3 complains, seed 4 has a bug."""
    for episode in range(1, EPISODES + 1):
        yield _status(seed, episode)
        if (folder / "healed").exists() or episode == EPISODES:
            continue
        if seed == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        if seed == 3:
            raise FlightError("no space left")
        if seed == 4:
            raise ZeroDivisionError("a bug")


def test_a_seed_whose_process_dies_stops_no_other_and_is_reported(tmp_path: Path) -> None:
    members = run_fleet(train, [1, 2, 3, 4, 5], tmp_path, 2, lambda _: None)
    assert [member.state for member in members] == ["done", "failed", "failed", "failed", "done"]
    assert members[1].error == "killed by SIGKILL"
    assert members[2].error == "no space left"
    assert members[3].error == "ZeroDivisionError: a bug"
    assert members[0].status is not None
    assert members[0].status.progress.episodes == EPISODES
    for seed in (2, 3, 4):
        (tmp_path / f"seed_{seed}" / "healed").touch()
    assert {member.state for member in run_fleet(train, [1, 2, 3, 4, 5], tmp_path, 5, lambda _: None)} == {"done"}


def test_no_more_processes_than_asked_for_run_at_a_time(tmp_path: Path) -> None:
    most = 0

    def count(members: object) -> None:
        nonlocal most
        assert isinstance(members, list)
        most = max(most, sum(member.state == "training" for member in members))

    run_fleet(train, [1, 5, 6], tmp_path, 1, count)
    assert most <= 1


def test_a_folder_that_another_process_trains_in_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "LOCK_S", 0.2)
    with folder_lock(tmp_path), pytest.raises(InputError, match="another process"), folder_lock(tmp_path):
        pass


def test_a_person_sees_all_seeds_and_what_went_wrong_with_them() -> None:
    members = [
        Member(1, "training", _status(1, 2)),
        Member(2, "failed", _status(2, 1), "killed by SIGKILL"),
        Member(3),
    ]
    out = io.StringIO()
    Console(file=out, width=160).print(fleet_table("trajectory1", members))
    for word in ("trajectory1", "training", "failed", "waiting", "seed 2: killed by SIGKILL", "31.4", "80"):
        assert word in out.getvalue()
    assert "killed by SIGKILL" in member_line(members[1])


def test_without_a_terminal_there_are_lines_and_quiet_says_nothing() -> None:
    members = [Member(1, "training", _status(1, 2))]
    for quiet in (False, True):
        out = io.StringIO()
        with FleetView("a run", quiet, Console(file=out, width=160)) as view:
            view.update(members)
            view.update(members)  # nothing new: no second line so soon
            view.update([Member(1, "done", _status(1, 3))])
        lines = out.getvalue().splitlines()
        assert len(lines) == (0 if quiet else 3)
        assert quiet or ("done" in lines[2] and "successes 3" in lines[2])


def patient(seed: int, folder: Path) -> Iterator[Status]:
    """An episode every tenth of a second, for a minute."""
    for _ in range(600):
        time.sleep(0.1)
        (folder / "alive").touch()
        yield _status(seed, 1)


def test_no_orphan_goes_on_training_when_the_fleet_is_killed(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from test_training_fleet import patient\n"
        "from mission.training.fleet import run_fleet; run_fleet(patient, [1], Path(sys.argv[1]), 1, lambda _: None)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    parent = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], env=environment)
    while not (tmp_path / "seed_1" / "alive").exists():
        assert parent.poll() is None
        time.sleep(0.05)
    parent.kill()
    parent.wait()
    with folder_lock(tmp_path / "seed_1"):  # waits for an orphan to notice, not for a minute
        pass
