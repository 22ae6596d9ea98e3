"""What a person types, and the one line they get when it is wrong."""

import contextlib
import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from mission import cli, cli_options

BAD_INPUT = [
    ("flyy", "Did you mean 'fly'?"),
    ("fly --sed 3", "--seed"),
    ("fly --seed x", "--seed"),
    ("fly --seed -1", "greater than or equal to 0"),
    ("fly trajectry2", "did you mean 'trajectory2'?"),
    ("fly nowhere.yaml", "'nowhere.yaml' does not exist"),
    ("fly --world trajectry1", "did you mean 'trajectory1'?"),
    ("fly --policy geometrc", "did you mean 'geometric'?"),
    ("fly --policy forst", "did you mean 'forest'?"),
    ("fly --profile tigth", "did you mean 'tight'?"),
    ("fly --guard maybe", "--guard"),
    ("fly --speed nan", "wants a number in [0.1, 100] or 'max'"),
    ("fly --speed fast", "wants a number in [0.1, 100] or 'max'"),
    ("fly --instance 12", "less than or equal to 9"),
    ("fly --param arbiter.dwel_s=1", "did you mean 'dwell_s'?"),
    ("fly --param arbitr.dwell_s=1", "did you mean 'arbiter'?"),
    ("fly --param arbiter.dwell_s=NaN", "outside [0.0, 60.0] s"),
    ("fly --param arbiter.dwell_s=-1", "outside [0.0, 60.0] s"),
    ("fly --param arbiter.dwell_s=long", "wants float"),
    ("fly --param dwell", "wants GROUP.FIELD=VALUE"),
    ("fly --params nowhere.yaml", "nowhere.yaml: No such file"),
    ("fly mission.yaml", "unknown key 'golf'; did you mean 'goal'?"),
    ("fly blocked.yaml", "inside an obstacle"),
    ("fly outside.yaml", "outside the bounds"),
    ("fly nan.yaml", "finite number"),
    ("fly --instance N --out notes.txt/flight", "cannot be written"),
    ("fly --instance N --out full", "is not empty"),
    ("sitl --world trajectry1", "did you mean 'trajectory1'?"),
    ("sitl --turbulence lite", "did you mean 'light'?"),
    ("sitl --wind nan 0", "not a finite number"),
    ("sitl --world trajectory2 --spawn 500 0", "outside the bounds"),
    ("companion", "--goal NORTH EAST [DOWN] or --mission FILE"),
    ("companion --goal 1", "NORTH EAST [DOWN]"),
    ("companion --goal 1 nan", "'nan' is not a finite number"),
    ("companion --mission trajectry2", "did you mean 'trajectory2'?"),
    ("companion --goal 1 2 --vehicle udpim://x:1", "did you mean 'udpin'?"),
    ("companion --goal 1 2 --params nowhere.yaml", "nowhere.yaml"),
    ("companion --goal 1 2 --profile tigth", "did you mean 'tight'?"),
    ("companion --goal 1 2 --policy forst", "did you mean 'forest'?"),
    ("worlds show nowhere", "unknown world 'nowhere'"),
    ("worlds generate --density nan", "density nan"),
    ("worlds generate --out nowhere/x.yaml", "cannot be written"),
    ("params show arbiter.dwel_s", "did you mean 'arbiter.dwell_s'?"),
]

FILES = {
    "mission.yaml": "world: open\ngolf: [5, 0]\nsuccess: {time_limit_s: 9}\n",
    "blocked.yaml": "world: trajectory2\ngoal: [24, 0]\nsuccess: {time_limit_s: 9}\n",
    "outside.yaml": "world: trajectory2\ngoal: [240, 0]\nsuccess: {time_limit_s: 9}\n",
    "nan.yaml": "world: trajectory2\ngoal: [.nan, 0]\nsuccess: {time_limit_s: 9}\n",
    "notes.txt": "mine",
}


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a few files in it."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "something").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(words: str) -> int:
    try:
        return cli.main(words.split())
    except SystemExit as ended:  # argparse of the companion
        assert isinstance(ended.code, int)
        return ended.code


@pytest.mark.parametrize(("words", "expected"), BAD_INPUT)
def test_bad_input_is_one_clear_line_and_leaves_nothing_behind(
    words: str, expected: str, desk: Path, instance: int, capfd: pytest.CaptureFixture[str]
) -> None:
    before = sorted(desk.rglob("*"))
    assert run(words.replace(" N ", f" {instance} ")) == 2
    out, err = capfd.readouterr()
    assert expected in err
    assert err.count("\n") == 1
    assert out == ""
    assert sorted(desk.rglob("*")) == before


@pytest.mark.parametrize("words", ["fly --instance {}", "sitl --instance {}", "companion --goal 9 0 --instance {}"])
def test_a_port_in_use_is_one_clear_line(
    words: str, desk: Path, instance: int, capfd: pytest.CaptureFixture[str]
) -> None:
    before = sorted(desk.rglob("*"))
    with contextlib.ExitStack() as stack:
        for port in (14540, 14580):  # the companion's, the vehicle's
            taken = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            taken.bind(("0.0.0.0", port + instance))
        assert run(words.format(instance)) == 2
    out, err = capfd.readouterr()
    assert "is in use" in err
    assert err.count("\n") == 1
    assert out == ""
    assert sorted(desk.rglob("*")) == before


def test_a_file_that_cannot_be_written_is_one_clear_line(
    desk: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "notes.txt")

    monkeypatch.setattr(cli, "app", lambda *_, **__: full())
    assert run("params list") == 1
    assert capfd.readouterr().err == "swiftnav: notes.txt: No space left on device\n"


def test_a_missing_extra_is_named(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(cli_options.EXTRA_MODULES, "sitl", ("jsbsim_that_is_not_there",))
    assert run("fly") == 2
    assert capfd.readouterr().err == "swiftnav: swiftnav fly needs the 'sitl' extra: pip install 'swiftnav[sitl]'\n"


def test_help_is_quick_because_nothing_heavy_is_imported() -> None:
    code = "import sys, mission.cli; print([m for m in %r if m in sys.modules])"
    heavy = ["numpy", "scipy", "pydantic", "ruamel.yaml", "matplotlib", "mavsdk", "jsbsim", "numba", "pymavlink", "fcl"]
    ran = subprocess.run([sys.executable, "-c", code % heavy], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


@pytest.mark.parametrize("words", ["", "worlds", "params", "bench", "fly --help", "sitl --help", "companion --help"])
def test_every_command_explains_itself_with_an_example(words: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(words) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert "sage" in out
    assert "xample" in out or words in ("worlds", "params", "bench")


def test_every_parameter_is_documented(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("params list --json") == 0
    rows = json.loads(capfd.readouterr().out)
    assert len({row["name"] for row in rows}) == len(rows)
    assert all(row["text"] and len(row["name"]) <= 16 for row in rows)
    assert run("params docs") == 0
    docs = capfd.readouterr().out
    assert all(f"`{row['name']}`" in docs for row in rows)
    assert run("params show arbiter.dwell_s") == 0
    assert "ARB_DWELL" in capfd.readouterr().out


def test_a_generated_forest_can_be_shown_and_flown_in(desk: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("worlds generate --seed 4 --density 0.03 --out forest4.yaml --picture forest4.png --json") == 0
    made = json.loads(capfd.readouterr().out)
    assert run("worlds show forest4.yaml --json") == 0
    shown = json.loads(capfd.readouterr().out)
    assert shown["sha256"] == made["sha256"]
    assert shown["cylinders"] == made["cylinders"] > 20
    assert (desk / "forest4.png").read_bytes().startswith(b"\x89PNG")


def test_worlds_are_listed_with_their_hashes(capfd: pytest.CaptureFixture[str]) -> None:
    assert run("worlds list --json") == 0
    worlds = {world["name"]: world for world in json.loads(capfd.readouterr().out)}
    assert {"trajectory1", "trajectory1_movers", "trajectory2"} <= set(worlds)
    assert worlds["trajectory2"]["distance_m"] >= 50.0
