"""The arms are run once each, whatever stops the run; budgets come from the arm that they are taken of."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from reproduce_kit import TINY, finish, write_arm

from mission.errors import InputError
from mission.pilots.td3_vanilla import Td3Vanilla
from mission.reproduce import run
from mission.reproduce.arms import load_table
from mission.reproduce.document import text_of, write_docs, write_readme
from mission.reproduce.findings import findings
from mission.reproduce.measures import read_seed
from mission.reproduce.pictures import Picture, draw_all
from mission.reproduce.run import Task, TaskJob, arm_folder, prepare, run_all, tasks_of
from mission.training.fleet import Member, OnUpdate
from mission.training.run_folder import open_run
from mission.training.until import UNLIMITED

PNG = b"\x89PNG"
DOCS_MAX_BYTES = 200_000


class Fleet:
    """In place of processes: each task is done at once, but for those that are to fail."""

    def __init__(self) -> None:
        self.trained: list[tuple[str, int, int]] = []
        self.fails: set[tuple[str, int]] = set()

    def run(self, job: TaskJob, numbers: Sequence[int], folder: Path, jobs: int, on_update: OnUpdate) -> list[Member]:
        members = [self._one(job.tasks[number], number) for number in numbers]
        on_update(members)
        return members

    def _one(self, task: Task, number: int) -> Member:
        if (task.arm, task.seed) in self.fails:
            return Member(number, "failed", None, "killed by SIGKILL")
        self.trained.append((task.arm, task.seed, task.spec.until.ticks))
        finish(task.folder, task.seed, [{"ticks": 1000 + task.seed}], [{"success": True}])
        return Member(number, "done")


@pytest.fixture
def fleet(monkeypatch: pytest.MonkeyPatch) -> Fleet:
    made = Fleet()
    monkeypatch.setattr(run, "run_fleet", made.run)
    return made


def _run(out: Path, only: str, seeds: int) -> list[str]:
    table = load_table()
    arms = table.chosen(only)
    prepare(out, arms, range(1, seeds + 1))
    return run_all(out, table, arms, range(1, seeds + 1), 2, lambda members: None)


def test_a_seed_broken_off_and_taken_up_again_ends_like_one_never_broken_off(tmp_path: Path) -> None:
    (tmp_path / "tiny.yaml").write_text(TINY)
    table = load_table(tmp_path / "tiny.yaml")
    for arm in table.arms:
        ends = []
        for out in (tmp_path / "whole", tmp_path / "broken"):
            prepare(out, [arm], (1,))
            tasks = tuple(tasks_of(out, table, arm, (1,)))
            if out.name == "broken":
                assert next(TaskJob(tasks)(0, out)).progress.episodes == 1
                assert not tasks[0].done
            statuses = list(TaskJob(tasks)(0, out))
            assert tasks[0].done
            seed = read_seed(arm_folder(out, arm), 1)
            assert seed.done
            assert seed.result is not None
            ends.append((statuses[-1].progress, seed.result["weights_sha256"], seed.episodes, seed.flights))
        assert ends[0] == ends[1]
    swift, vanilla = (read_seed(arm_folder(tmp_path / "whole", arm), 1).result for arm in table.arms)
    assert swift is not None
    assert vanilla is not None
    longest = 6 * 25 + 1  # ticks of an episode at most
    assert 0 <= vanilla["ticks"] - swift["ticks"] <= longest or vanilla["episodes"] == 3
    steers = Td3Vanilla(arm_folder(tmp_path / "whole", table.arm("vanilla")) / "seed_1" / "policy")
    assert steers.card.hold_s == pytest.approx(0.16)  # two scans of 80 ms


def test_what_is_done_is_not_done_again(tmp_path: Path, fleet: Fleet) -> None:
    assert _run(tmp_path, "t1,t2", 2) == []
    assert len(fleet.trained) == 4
    assert _run(tmp_path, "t1,t2", 2) == []
    assert len(fleet.trained) == 4
    assert _run(tmp_path, "t1", 3) == []
    assert [(arm, seed) for arm, seed, _ in fleet.trained[4:]] == [("t1", 3)]
    assert open_run(tmp_path / "arms" / "t1").seeds == (1, 2, 3)
    assert _run(tmp_path, "t1", 1) == []
    assert open_run(tmp_path / "arms" / "t1").seeds == (1, 2, 3), "fewer seeds forget none"


def test_an_arm_of_fewer_seeds_trains_its_first_ones(tmp_path: Path, fleet: Fleet) -> None:
    _run(tmp_path, "epsilon_none", 5)
    assert [(arm, seed) for arm, seed, _ in fleet.trained] == [("epsilon_none", seed) for seed in (1, 2, 3)]
    assert open_run(tmp_path / "arms" / "epsilon_none").seeds == (1, 2, 3)


def test_arms_that_share_a_training_train_once(tmp_path: Path, fleet: Fleet) -> None:
    _run(tmp_path, "t2,replay_per", 1)
    assert [(arm, seed) for arm, seed, _ in fleet.trained] == [("t2", 1)]


def test_each_seed_of_the_baseline_gets_the_ticks_of_the_same_seed(tmp_path: Path, fleet: Fleet) -> None:
    _run(tmp_path, "vanilla", 2)
    expected = [("t1", 1, UNLIMITED), ("t1", 2, UNLIMITED), ("vanilla", 1, 1001), ("vanilla", 2, 1002)]
    assert fleet.trained == expected


def test_a_seed_that_dies_stops_no_other_and_the_next_run_repairs_it(tmp_path: Path, fleet: Fleet) -> None:
    fleet.fails = {("t1", 2)}
    troubles = _run(tmp_path, "vanilla", 2)
    assert troubles == ["t1 seed 2: killed by SIGKILL", "vanilla seed 2: waits for t1"]
    assert ("vanilla", 1, 1001) in fleet.trained
    fleet.fails = set()
    assert _run(tmp_path, "vanilla", 2) == []
    assert fleet.trained[-2:] == [("t1", 2, UNLIMITED), ("vanilla", 2, 1002)]


def test_an_arm_begun_with_other_settings_is_refused_naming_the_setting(tmp_path: Path, fleet: Fleet) -> None:
    _run(tmp_path, "t1", 1)
    quick = load_table(quick=True)
    with pytest.raises(InputError, match=r"was begun with env\.time_limit_s = 90\.0, now 40\.0: go on with another"):
        prepare(tmp_path, quick.chosen("t1"), (1,))


def test_a_task_names_its_folder_by_arm_and_seed(tmp_path: Path) -> None:
    table = load_table()
    tasks = tasks_of(tmp_path, table, table.arm("t1"), (1, 2))
    assert [task.folder for task in tasks] == [tmp_path / "arms" / "t1" / f"seed_{seed}" for seed in (1, 2)]
    assert tasks_of(tmp_path, table, table.arm("vanilla"), (1, 2)) == [], "no budget is known yet"


@pytest.fixture
def reproduced(tmp_path: Path) -> Path:
    table = load_table()
    out = tmp_path / "reproduce"
    for name in ("t1", "t2", "replay_uniform"):
        write_arm(out, table, name, 3, 110)
    write_arm(out, table, "vanilla", 3, 60, good=0.0)
    write_arm(out, table, "no_stability", 2, 110, good=0.6)
    return out


def test_the_document_has_every_claim_every_begun_arm_and_its_pictures(reproduced: Path) -> None:
    found = findings(reproduced, load_table())
    pictures = draw_all(found, reproduced)
    text = write_readme(found, pictures, reproduced, "swiftnav reproduce --seeds 3").read_text()
    for outcome in found.outcomes:
        assert f"| {outcome.claim.text} | {outcome.claim.place} | {outcome.settings} |" in text
    for name in ("t1", "t2", "vanilla", "no_stability", "replay_per", "replay_uniform"):
        assert f"| `{name}` |" in text
    assert "| `t1_paper` |" not in text
    assert "Not run: `no_checker`, `t1_paper`" in text
    assert len(pictures) == 6
    for picture in pictures:
        assert f"(figures/{picture.path.name})" in text
        assert picture.path.read_bytes().startswith(PNG)
        assert picture.path.stat().st_size < DOCS_MAX_BYTES
    assert sum(found.counts().values()) == len(found.outcomes)


def test_the_documents_of_a_repository_have_pictures_of_their_own(reproduced: Path, tmp_path: Path) -> None:
    drawn = tmp_path / "curves.png"
    drawn.write_bytes(PNG)
    (tmp_path / "docs").mkdir()
    found = findings(reproduced, load_table())
    picture = Picture(drawn, "Curves", "What they show.")
    text = write_docs(found, [picture], tmp_path / "docs", "swiftnav reproduce").read_text()
    assert "![Curves](figures/reproduction_curves.png)" in text
    assert (tmp_path / "docs" / "figures" / "reproduction_curves.png").read_bytes() == PNG


def test_a_quick_run_gives_no_verdict(tmp_path: Path) -> None:
    table = load_table(quick=True)
    for name in ("t1", "t2"):
        write_arm(tmp_path, table, name, 1, 3)
    found = findings(tmp_path, table)
    assert found.counts() == {"holds": 0, "does not hold here": 0, "not measured": len(found.outcomes)}
    assert "A quick run" in text_of(found, [], "swiftnav reproduce --quick")


def test_findings_are_json_ready(reproduced: Path) -> None:
    def numbers(value: Any) -> None:
        assert isinstance(value, dict | list | str | int | float | bool | None)
        for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
            numbers(item)

    found = findings(reproduced, load_table()).as_dict()
    numbers(found)
    assert found["arms"]["t1"]["finished"] == 3
    assert found["arms"]["replay_per"]["run"] == "t2"
