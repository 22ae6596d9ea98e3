"""Do the documents say what the code does? Parameters, file formats, examples, commands, links."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel
from typer.testing import CliRunner

from companion.app.command_line import parser
from mission.cli import app
from mission.mission_file import ForestSpec, Mission, NoiseSpec, Success, WindSpec, load_mission
from mission.world_file import load_world
from mission.world_spec import Arc, Bounds, Box, Cylinder, MoverSpec, Wall, WorldSpec
from sitl.faults import FAULTS

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("docker/*.md")])
FORMATS: list[tuple[str, str, type[BaseModel]]] = [
    ("missions", "mission", Mission),
    ("missions", "forest", ForestSpec),
    ("missions", "wind", WindSpec),
    ("missions", "noise", NoiseSpec),
    ("missions", "success", Success),
    ("worlds", "world", WorldSpec),
    ("worlds", "bounds", Bounds),
    ("worlds", "cylinders", Cylinder),
    ("worlds", "boxes", Box),
    ("worlds", "walls", Wall),
    ("worlds", "arcs", Arc),
    ("worlds", "movers", MoverSpec),
]


def text_of(document: str) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def blocks(document: Path, *languages: str) -> list[str]:
    """The blocks of code in these languages; "" is none."""
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", document.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [block for language, block in fenced if language in languages]


def examples(document: str) -> list[str]:
    return blocks(ROOT / document, "yaml")


def commands() -> Iterator[list[str]]:
    """Every command of ours in a block of code; comments are taken off, continued lines joined."""
    for document in DOCUMENTS:
        for block in blocks(document, "", "sh"):
            for line in block.replace("\\\n", " ").splitlines():
                typed = line.removeprefix("$ ")
                if typed.startswith(("swiftnav ", "make ", "python -m companion ")):
                    yield shlex.split(typed, comments=True)


def test_the_parameter_reference_is_what_the_code_prints() -> None:
    printed = CliRunner().invoke(app, ["params", "docs"]).stdout
    assert text_of("docs/parameters.md") == printed, "out of date, run: make docs"


def documented(document: str, section: str) -> list[str]:
    """What stands in the first column of a section's table."""
    part = re.search(rf"^### {section}\n(.*?)(?=^##|\Z)", text_of(document), re.DOTALL | re.MULTILINE)
    assert part is not None
    cells = re.findall(r"^\| ((?:`\w+` ?)+)\|", part.group(1), re.MULTILINE)
    return sorted(name for cell in cells for name in re.findall(r"`(\w+)`", cell))


@pytest.mark.parametrize(("document", "section", "model"), FORMATS)
def test_every_key_of_a_file_format_is_documented_and_no_other(
    document: str, section: str, model: type[BaseModel]
) -> None:
    assert documented(f"docs/{document}.md", section) == sorted(model.model_fields)


def test_every_fault_is_documented_and_no_other() -> None:
    assert documented("docs/missions.md", "faults") == sorted(FAULTS)


def test_the_examples_of_file_formats_load(tmp_path: Path) -> None:
    for i, example in enumerate(examples("docs/missions.md")):
        path = tmp_path / f"mission{i}.yaml"
        path.write_text(example, encoding="utf-8")
        assert load_mission(str(path)).world is not None
    for i, example in enumerate(examples("docs/worlds.md")):
        path = tmp_path / f"world{i}.yaml"
        path.write_text(example, encoding="utf-8")
        load_world(path)


def test_every_documented_command_parses() -> None:
    targets = set(re.findall(r"^([a-z]+):", text_of("Makefile"), re.MULTILINE))
    tree = typer.main.get_command(app)
    seen = 0
    for words in commands():
        seen += 1
        if words[0] == "make":
            assert {word for word in words[1:] if "=" not in word} <= targets, words
        elif words[0] == "python":
            _parse_companion(words[3:])
        elif words[1] == "companion":
            _parse_companion(words[2:])
        else:
            _parse(tree, words[1:])
    assert seen > 10


def test_every_link_between_documents_leads_somewhere() -> None:
    for document in DOCUMENTS:
        for target in re.findall(r"(?:\]\(|src=\")([^)\"#:]+)", document.read_text(encoding="utf-8")):
            assert (document.parent / target).exists(), f"{document.name}: {target}"


def _parse(command: Any, words: list[str]) -> None:
    """As the console script would, without running anything. Raises what the parser complains of."""
    while getattr(command, "commands", None):
        assert words[0] in command.commands, words
        command, words = command.commands[words[0]], words[1:]
    command.make_context("documented", words)


def _parse_companion(words: list[str]) -> None:
    if "--mission" in words:
        at = words.index("--mission")
        words = words[:at] + words[at + 2 :]
    parser().parse_args(words)
