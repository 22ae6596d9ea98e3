"""Do container files, unit and docs/deploy.md fit the code? Read, not run; `make images` builds and runs the images."""

import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML
from test_documents import _parse_companion

from companion.app.status import ExitCode
from companion.core import params
from companion.navigator import Params
from mission.mission_file import load_mission
from mission.world_file import load_world
from sitl.link import SPECS
from sitl.px4_bridge import HIL_PORT, LIDAR_PORT

ROOT = Path(__file__).resolve().parents[2]
DOCKER = ROOT / "docker"
DEPLOY = (ROOT / "docs/deploy.md").read_text(encoding="utf-8")
COMPOSE = YAML(typ="safe").load((DOCKER / "compose.yaml").read_text(encoding="utf-8"))
TOOLS = Path(sys.executable).parent


def test_every_failure_of_the_table_is_held_by_a_test_that_exists() -> None:
    section = DEPLOY.split("## 9. ")[1]
    rows = [row for row in section.splitlines() if row.startswith("| ") and not row.startswith("| failure")]
    named = [re.findall(r"`(test_\w+)`", row) for row in rows]
    assert len(rows) >= 15
    assert all(len(names) == 1 for names in named)
    source = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    written = set(re.findall(r"^def (test_\w+)", source, re.MULTILINE))
    assert {names[0] for names in named} <= written


def test_the_exit_codes_are_those_of_the_code() -> None:
    line = DEPLOY.split("Exit codes:")[1]
    told = {int(code) for code in re.findall(r"\b(\d+) ", line.split("130")[0])}
    assert told == {int(code) for code in ExitCode}


def test_every_parameter_named_exists_and_the_example_is_taken() -> None:
    known = {info.key for info in params.infos(Params())}
    named = set(re.findall(r"`((?:link|lidar|limits|vehicle)\.\w+)`", DEPLOY))
    assert len(named) >= 4
    assert named <= known
    example = re.search(r"```yaml\n(.*?)```", DEPLOY, re.DOTALL)
    assert example is not None
    assert params.update(Params(), YAML(typ="safe").load(example.group(1))).lidar.range_min_m == 0.35


def test_the_unit_and_its_settings_start_the_companion() -> None:
    options = re.search(r"echo 'OPTIONS=(.*?)'", DEPLOY)
    assert options is not None
    _parse_companion(shlex.split(options.group(1)))
    unit = (DOCKER / "swiftnav-companion.service").read_text(encoding="utf-8")
    assert "ExecStart=/opt/swiftnav/bin/python -m companion $OPTIONS" in unit
    assert f"RestartPreventExitStatus={int(ExitCode.BAD_INPUT)}" in unit


def resolved(text: str) -> str:
    """A value of compose.yaml with the defaults of its variables."""
    return re.sub(r"\$\{\w+:-(.*?)\}", r"\1", text)


@pytest.mark.parametrize("name", ["companion", "companion-px4"])
def test_the_companion_of_compose_is_told_the_goal_of_the_vehicles_world(name: str) -> None:
    words = [resolved(str(word)) for word in COMPOSE["services"][name]["command"]]
    _parse_companion(words)
    world = load_world(load_mission("trajectory2").world)
    at = words.index("--goal")
    assert [float(word) for word in words[at + 1 : at + 3]] == (world.goal_ned_m - world.start_ned_m).tolist()
    urls = [word for word in words if "://" in word]
    ports = [spec.remote_port for spec in SPECS if spec.companion] + ([LIDAR_PORT] if name.endswith("px4") else [])
    assert urls == [f"udpin://127.0.0.1:{port}" for port in ports]
    assert COMPOSE["services"][name]["network_mode"].startswith("service:")


def test_health_checks_look_at_the_ports_that_are_opened() -> None:
    local = next(spec.local_port for spec in SPECS if spec.companion)
    assert f":{local:X} " in (DOCKER / "sitl.Dockerfile").read_text(encoding="utf-8")
    assert f":{HIL_PORT:X} " in COMPOSE["services"]["aircraft"]["healthcheck"]["test"]


def test_the_companions_image_has_its_dependencies_and_nothing_of_the_other_houses() -> None:
    text = (DOCKER / "companion.Dockerfile").read_text(encoding="utf-8")
    copied = [word for line in re.findall(r"^COPY (.*)$", text, re.MULTILINE) for word in line.split()]
    assert not {"sitl", "mission", ".", "./"} & set(copied[:-1]) - {"./"}
    assert re.search(r"^USER 10001$", text, re.MULTILINE)
    printed = subprocess.run(
        [sys.executable, DOCKER / "requirements.py", ROOT / "pyproject.toml", "hw"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    project: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert printed == project["dependencies"] + project["optional-dependencies"]["hw"]


def tool(name: str) -> str:
    found = shutil.which(name, path=str(TOOLS)) or shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


@pytest.mark.parametrize("dockerfile", sorted(DOCKER.glob("*.Dockerfile")), ids=lambda path: path.name)
def test_every_dockerfile_passes_hadolint(dockerfile: Path) -> None:
    done = subprocess.run([tool("hadolint"), dockerfile], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_compose_passes_its_schema() -> None:
    command = [tool("check-jsonschema"), "--builtin-schema", "vendor.compose-spec", DOCKER / "compose.yaml"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
