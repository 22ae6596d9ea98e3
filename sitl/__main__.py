"""How is the vehicle started as a process of its own? ``python -m sitl CONFIG.json`` (see ``sitl.vehicle_config``).

Several configurations are vehicles of one world that see each other (see ``sitl.fleet``).
"""

import argparse
import sys
from pathlib import Path

from sitl import fleet
from sitl.app import EXIT_BAD_INPUT, run
from sitl.vehicle_config import ConfigError, load


def main(arguments: list[str] | None = None) -> int:
    """Read the configurations and run them. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m sitl", description="PX4-like vehicle on JSBSim physics.")
    parser.add_argument(
        "config", type=Path, nargs="+", help="JSON file, as VehicleConfig.to_json gives it; one for each vehicle"
    )
    try:
        configs = [load(path) for path in parser.parse_args(arguments).config]
    except ConfigError as error:
        print(error, file=sys.stderr)
        return EXIT_BAD_INPUT
    return run(configs[0]) if len(configs) == 1 else fleet.run(configs)


if __name__ == "__main__":
    sys.exit(main())
