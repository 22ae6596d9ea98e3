"""How is the vehicle started as a process of its own? ``python -m sitl CONFIG.json`` (see ``sitl.vehicle_config``)."""

import argparse
import sys
from pathlib import Path

from sitl.app import EXIT_BAD_INPUT, run
from sitl.vehicle_config import ConfigError, load


def main(arguments: list[str] | None = None) -> int:
    """Read the configuration and run it. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m sitl", description="PX4-like vehicle on JSBSim physics.")
    parser.add_argument("config", type=Path, help="JSON file, as VehicleConfig.to_json gives it")
    try:
        config = load(parser.parse_args(arguments).config)
    except ConfigError as error:
        print(error, file=sys.stderr)
        return EXIT_BAD_INPUT
    return run(config)


if __name__ == "__main__":
    sys.exit(main())
