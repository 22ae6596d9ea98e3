"""What a person types to reproduce the paper, what they get, and that a run killed goes on where it was."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from reproduce_kit import TINY, write_arm

from mission import cli, cli_options
from mission.reproduce.arms import QUICK_ARMS, load_table

BAD_INPUT = [
    ("reproduce --only vanila", "unknown arm 'vanila'; did you mean 'vanilla'?"),
    ("reproduce --only papre", "did you mean 'paper'?"),
    ("reproduce --seeds 0", "--seeds"),
    ("reproduce --jobs 0", "--jobs"),
    ("reproduce --arms nowhere.yaml", "nowhere.yaml: No such file"),
    ("reproduce --arms mine.yaml", "mine.yaml: arm 'a': preset default: td3: unknown key 'tou'; did you mean 'tau'?"),
    ("reproduce --report", "'reproduce' holds no reproduction"),
    ("reproduce --report --docs", "--docs writes into ./docs"),
]
MINE = (
    "until: {successes: 1, episodes: 1}\nflights: 1\narms:\n  a: {group: paper, text: a, world: trajectory1, settings: "
)
CODE = "import sys; from mission import cli; sys.exit(cli.main(sys.argv[1:]))"


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mine.yaml").write_text(f"{MINE}{{td3.tou: 0.1}}}}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("words", "expected"), BAD_INPUT)
def test_bad_input_to_reproduce_is_one_clear_line_and_leaves_nothing_behind(
    words: str, expected: str, desk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = sorted(desk.rglob("*"))
    assert cli.main(words.split()) == 2
    out, err = capfd.readouterr()
    assert expected in err
    assert err.count("\n") == 1
    assert out == ""
    assert sorted(desk.rglob("*")) == before


def test_reproduce_needs_the_training_extra(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(cli_options.EXTRA_MODULES, "train", ("a_package_that_is_not_there",))
    assert cli.main(["reproduce"]) == 2
    assert "needs the 'train' extra: pip install 'swiftnav[train]'" in capfd.readouterr().err


def test_reproduce_explains_itself_with_an_example(capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["reproduce", "--help"]) == 0
    assert "Example: swiftnav reproduce" in capfd.readouterr().out


def test_the_arms_are_listed_for_people_and_machines(desk: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["reproduce", "--list", "--only", "paper", "--json"]) == 0
    arms = json.loads(capfd.readouterr().out)["arms"]
    assert {arm["group"] for arm in arms} == {"paper"}
    vanilla = next(arm for arm in arms if arm["name"] == "vanilla")
    assert vanilla["settings"]["env.low_level"] is True
    assert (vanilla["ticks_of"], vanilla["seeds"]) == ("t1", None)
    assert cli.main(["reproduce", "--list", "--only", "worlds"]) == 0
    assert "forest:train:300" in capfd.readouterr().out
    assert not (desk / "reproduce").exists()


def test_a_report_is_written_from_what_is_there(desk: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_arm(desk / "reproduce", load_table(), "t1", 2, 60)
    (desk / "docs").mkdir()
    assert cli.main(["reproduce", "--report", "--docs", "--json"]) == 0
    figures = json.loads(capfd.readouterr().out)
    assert figures["documents"] == ["reproduce/README.md", "docs/reproduction.md"]
    assert figures["arms"]["t1"]["finished"] == 2
    assert sum(figures["verdicts"].values()) == len(figures["claims"])
    assert (desk / "docs" / "figures" / "reproduction_curves.png").is_file()


@pytest.mark.slow
def test_a_quick_reproduction_runs_all_main_arms(desk: Path) -> None:
    words = [sys.executable, "-c", CODE, "reproduce", "--quick", "--jobs", "2", "--json"]
    found = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)
    assert {name for name in found["arms"] if found["arms"][name]["run"] == name} == set(QUICK_ARMS)
    assert all(arm["finished"] == 1 for arm in found["arms"].values())
    assert found["verdicts"]["not measured"] == len(found["claims"])
    assert (desk / "reproduce_quick" / "README.md").is_file()


@pytest.mark.slow
def test_a_reproduction_killed_and_taken_up_again_ends_like_one_never_killed(desk: Path) -> None:
    (desk / "tiny.yaml").write_text(TINY)
    words = [sys.executable, "-c", CODE, "reproduce", "--arms", "tiny.yaml", "--seeds", "1", "--json"]
    subprocess.run([*words, "--out", "whole"], capture_output=True, check=True)
    broken = [*words, "--out", "broken"]
    for awaited in ("t1/seed_1/episodes.jsonl", "t1/seed_1/greedy.json", "vanilla/seed_1/episodes.jsonl"):
        process = subprocess.Popen(broken, stdout=subprocess.DEVNULL, start_new_session=True)
        _await(desk / "broken" / "arms" / awaited, process)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    written_ns = (desk / "broken/arms/t1/seed_1/greedy.json").stat().st_mtime_ns
    subprocess.run(broken, capture_output=True, check=True)
    assert (desk / "broken/arms/t1/seed_1/greedy.json").stat().st_mtime_ns == written_ns, "done is done"
    for arm in ("t1", "vanilla"):
        whole, again = (desk / out / "arms" / arm / "seed_1" for out in ("whole", "broken"))
        assert _weights(whole) == _weights(again)
        assert _flights(whole) == _flights(again)


def _await(path: Path, process: "subprocess.Popen[bytes]") -> None:
    while not path.is_file():
        assert process.poll() is None
        time.sleep(0.1)


def _weights(seed: Path) -> object:
    return json.loads((seed / "result.json").read_text())["weights_sha256"]


def _flights(seed: Path) -> object:
    return json.loads((seed / "greedy.json").read_text())["flights"]
