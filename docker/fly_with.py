"""Does a companion fly that is not of this checkout? ``python docker/fly_with.py FOLDER PROGRAM...``, trajectory1.

Vehicle, operator and judge run here; PROGRAM (``docker run ... swiftnav-companion``) gets the companion's arguments and
must see FOLDER under the same name. Exit code 0 when it has landed at the goal without contact.
"""

import sys
from pathlib import Path

from mission.console import FlightConsole, LogTail, print_result
from mission.flight_folder import make_folder
from mission.flight_plan import plan_flight
from mission.runner import FlySettings, fly, free_instance

MISSION, SEED = "trajectory1", 0
EVERYBODY = 0o777  # an image's user is not ours


def main(folder: str, *program: str) -> int:
    """Fly once."""
    plan = plan_flight(MISSION, SEED)
    settings = FlySettings(instance=free_instance(), companion_program=program)
    place = make_folder(plan, Path(folder))
    place.chmod(EVERYBODY)
    with FlightConsole(f"{MISSION} by {program[0]}", LogTail(place / "navigator.jsonl")) as console:
        result = fly(plan, settings, place, console)
    print_result(result)
    return 0 if result.success else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
