"""What a person types to train, to evaluate and to export, and the one line they get when it is wrong."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mission import cli, cli_options

BAD_INPUT = [
    ("train --preset defualt", "did you mean 'default'?"),
    ("train --preset mine.yaml", "unknown section 'tdd3'; did you mean 'td3'?"),
    ("train --preset nowhere.yaml", "nowhere.yaml: No such file"),
    ("train --set td3.tou=0.1", "unknown key 'tou'; did you mean 'tau'?"),
    ("train --set td3.tau=big", "'tau' = 'big'"),
    ("train --set tau", "wants SECTION.FIELD=VALUE"),
    ("train --world trajectry1", "did you mean 'trajectory1'?"),
    ("train --world barrier:trian", "wants KIND[:SPLIT[:COUNT]]"),
    ("train --seeds 0", "--seeds"),
    ("train --until-successes 0", "--until-successes"),
    ("train --device cudda", "--device 'cudda'"),
    ("train --out full", "not empty"),
    ("train --resume nowhere", "'nowhere' is no run folder"),
    ("train --resume full --world trajectory1", "--resume goes on with a run as it was begun: no --world beside it"),
    ("train --resume full --set td3.tau=0.1", "no --set beside it"),
    ("train --resume full --seeds 3", "no --seeds beside it"),
    ("train --resume full --until-successes 7", "no --until-successes beside it"),
    ("clone --resume full --rounds 7", "no --rounds beside it"),
    ("train --set training.prefill_flights=3 --set env.decoder=waypoints", "needs the decoder 'detour'"),
    ("eval geometrc", "did you mean 'geometric'?"),
    ("eval geometric --world barier", "did you mean 'barrier'?"),
    ("eval geometric --world nowhere.yaml", "nowhere.yaml"),
    ("eval geometric --episodes 0", "--episodes"),
    ("eval geometric --guard maybe", "wants on or off"),
    ("eval ./full", "card.json"),
    ("export ./full --onnx out.onnx", "card.json"),
]
EVALUATED = [
    *("success", "contact", "timeout", "spl", "path_ratio", "time_s", "min_clearance_m", "switches_per_min"),
    *("switches_bound_per_min", "kept", "modified", "refused", "decision_p50_ms", "decision_p99_ms"),
]
TINY = "--set training.evaluate_every=0 --set td3.hidden=[8,8] --set env.time_limit_s=8"


BAD_CLUSTER = [
    ("nowhere", "--cluster 'nowhere' wants HOST:PORT"),
    ("127.0.0.1:1", "--cluster '127.0.0.1:1': nobody answers there"),
]


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a few files in it."""
    (tmp_path / "mine.yaml").write_text("text: mine\ntdd3: {tau: 0.1}\n")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "something").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("address", "expected"), BAD_CLUSTER)
@pytest.mark.parametrize("command", ["train", "bench pole"])
def test_a_cluster_that_cannot_be_reached_is_one_clear_line_and_leaves_nothing_behind(
    command: str, address: str, expected: str, desk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("ray")
    test_bad_input_is_one_clear_line_and_leaves_nothing_behind(f"{command} --cluster {address}", expected, desk, capfd)


@pytest.mark.parametrize(("words", "expected"), BAD_INPUT)
def test_bad_input_is_one_clear_line_and_leaves_nothing_behind(
    words: str, expected: str, desk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = sorted(desk.rglob("*"))
    assert cli.main(words.split()) == 2
    out, err = capfd.readouterr()
    assert expected in err
    assert err.count("\n") == 1
    assert out == ""
    assert sorted(desk.rglob("*")) == before


@pytest.mark.parametrize("words", ["train", "export full --onnx a.onnx", "train --cluster local"])
def test_a_missing_extra_is_named(
    words: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    extra = "scale" if "cluster" in words else "train"
    monkeypatch.setitem(cli_options.EXTRA_MODULES, extra, ("a_package_that_is_not_there",))
    assert cli.main(words.split()) == 2
    assert f"needs the '{extra}' extra: pip install 'swiftnav[{extra}]'" in capfd.readouterr().err


@pytest.mark.parametrize("words", ["train --help", "eval --help", "export --help"])
def test_every_command_explains_itself_with_an_example(words: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert cli.main(words.split()) == 0
    assert "Example: swiftnav" in capfd.readouterr().out


def test_help_imports_no_torch() -> None:
    code = (
        "import sys, mission.cli; print([m for m in ('torch', 'gymnasium', 'tensorboard', 'ray') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


def test_an_evaluation_prints_one_object_and_needs_no_torch(desk: Path) -> None:
    code = (
        "import sys; from mission import cli; code = cli.main(sys.argv[1:])\n"
        "assert not {'torch', 'tensorboard', 'ray'} & set(sys.modules); sys.exit(code)"
    )
    words = ["eval", "straight", "--world", "trajectory1", "--episodes", "1", "--seed", "2", "--json"]
    ran = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True)
    figures = json.loads(ran.stdout)
    assert set(EVALUATED) <= set(figures)
    assert figures["success"] == 1.0
    assert 1.0 <= figures["path_ratio"] < 1.2
    assert sum(figures[kind] for kind in ("kept", "next", "modified", "escape", "refused")) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_run_whose_seed_is_killed_reports_it_and_resume_repairs_it(desk: Path) -> None:
    code = "import sys; from mission import cli; sys.exit(cli.main(sys.argv[1:]))"
    words = f"train --world trajectory1 --seeds 2 --max-episodes 4 --jobs 2 {TINY}".split()
    subprocess.run([sys.executable, "-c", code, *words, "--out", "whole"], check=True)
    process = subprocess.Popen([sys.executable, "-c", code, *words, "--out", "broken"], stderr=subprocess.PIPE)
    victim = _child_training(desk / "broken" / "seed_2")
    os.kill(victim, signal.SIGKILL)
    assert process.wait(600) == 1
    assert process.stderr is not None
    assert b"seed 2: killed by SIGKILL" in process.stderr.read()
    resume = [sys.executable, "-c", code, "train", "--resume", "broken", "--json"]
    resumed = subprocess.run(resume, capture_output=True, check=True)
    assert {row["state"] for row in json.loads(resumed.stdout)["seeds"]} == {"done"}
    for seed in ("seed_1", "seed_2"):
        weights = [json.loads((desk / run / seed / "result.json").read_text()) for run in ("whole", "broken")]
        assert weights[0]["weights_sha256"] == weights[1]["weights_sha256"]
        assert (desk / "broken" / seed / "policy" / "actor.safetensors").is_file()
    assert (desk / "broken" / "learning.png").is_file()


def _child_training(folder: Path) -> int:
    """Process id of whoever holds the seed's folder, once it has flown an episode."""
    deadline_s = time.monotonic() + 300.0
    rows = folder / "episodes.jsonl"
    while not (rows.is_file() and rows.stat().st_size):
        assert time.monotonic() < deadline_s
        time.sleep(0.1)
    return int((folder / ".lock").read_text())
