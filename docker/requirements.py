"""Which libraries does a part of the project need? Prints what a pyproject.toml asks for: FILE [EXTRA ...]."""

import sys
import tomllib
from pathlib import Path
from typing import Any


def main(path: str, *extras: str) -> None:
    """One requirement a line."""
    project = tomllib.loads(Path(path).read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *(line for name in extras for line in extra(project, name))]
    print("\n".join(dict.fromkeys(wanted)))


def extra(project: dict[str, Any], name: str) -> list[str]:
    """What one extra asks for, the project's other extras within it resolved."""
    found: list[str] = []
    for line in project["optional-dependencies"][name]:
        own, _, inside = line.partition("[")
        if own == project["name"]:
            found += [need for other in inside.rstrip("]").split(",") for need in extra(project, other)]
        else:
            found.append(line)
    return found


if __name__ == "__main__":
    main(*sys.argv[1:])
