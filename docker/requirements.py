"""What does the companion need? Prints the requirements of a pyproject.toml: requirements.py FILE [EXTRA ...]."""

import sys
import tomllib
from pathlib import Path


def main(path: str, *extras: str) -> None:
    """One requirement a line."""
    project = tomllib.loads(Path(path).read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *(line for name in extras for line in project["optional-dependencies"][name])]
    print("\n".join(wanted))


if __name__ == "__main__":
    main(*sys.argv[1:])
