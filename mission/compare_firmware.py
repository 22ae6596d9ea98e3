"""Is the embedded flight stack a fair stand-in?  ``PX4_BIN=... python -m mission.compare_firmware trajectory1``

Flies the same mission and seed with the embedded stack (as fast as it goes) and with a real PX4 (in real time), the
companion being the same, and tells how far apart the two paths are: the largest distance of a point of one from the
other, horizontally, from OFFBOARD to touchdown. Without PX4_BIN the firmware has to be started by somebody else.
"""

import argparse
import json
import math
import os
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from companion.core.geometry import points_to_polyline_distance
from companion.core.types import F64
from mission.attack import fly_quietly
from mission.cli_options import json_ready
from mission.errors import FlightError, InputError
from mission.flight_log import read_truth
from mission.flight_plan import FlightPlan, plan_flight
from mission.judge import Result
from mission.px4_firmware import Px4Build, find_build, with_gps_tolerance
from mission.runner import FlySettings, check_ports
from sitl.vehicle_config import Firmware

APART_M: Final = 1.5  # paths further apart than this are not the same flight
SPEED: Final = 1.0  # of a real PX4: it does not wait for the companion


@dataclass(frozen=True, slots=True)
class Comparison:
    """Both flights of one seed."""

    seed: int
    apart_max_m: float  # NaN when one of them never flew
    apart_mean_m: float
    embedded: Result
    px4: Result

    @property
    def fine(self) -> bool:
        """Did both succeed, on the same path?"""
        return self.apart_max_m <= APART_M and self.embedded.success and self.px4.success

    def row(self) -> str:
        """A row of a Markdown table."""
        cells = [f"{self.seed}", f"{self.apart_max_m:.2f}", f"{self.apart_mean_m:.2f}"]
        for result in (self.embedded, self.px4):
            error_m, factor = (math.nan if v is None else v for v in (result.landing_error_m, result.realtime_factor))
            cells += [f"{result.time_s:.1f}", f"{error_m:.2f}", f"{result.collisions}", f"{factor:.1f}"]
        return "| " + " | ".join(cells) + " |"


HEAD: Final = """\
| seed | apart, max, m | mean, m | embedded: s | landed off by, m | contacts | times real time \
| PX4: s | landed off by, m | contacts | times real time |
|---|---|---|---|---|---|---|---|---|---|---|"""


def apart_m(one_ned_m: F64, other_ned_m: F64) -> F64:
    """How far is each corner of two polylines (n, 2), (m, 2) from the other polyline? (n + m,)."""
    if len(one_ned_m) == 0 or len(other_ned_m) == 0:
        return np.array([math.nan])
    one = points_to_polyline_distance(other_ned_m, one_ned_m)
    other = points_to_polyline_distance(one_ned_m, other_ned_m)
    return np.concatenate([one, other])


def compare(plan: FlightPlan, build: Px4Build | None, instance: int, folder: Path) -> Comparison:
    """Both flights."""
    embedded = fly_quietly(plan, FlySettings(instance=instance), folder / "embedded")
    settings = FlySettings(SPEED, False, instance, firmware=Firmware.PX4, px4=build)
    px4 = fly_quietly(with_gps_tolerance(plan), settings, folder / "px4")
    distances = apart_m(_path(folder / "embedded"), _path(folder / "px4"))
    return Comparison(plan.seed, float(distances.max()), float(distances.mean()), embedded, px4)


def _path(folder: Path) -> F64:
    """Horizontal path of a flight (n, 2), world."""
    truth = read_truth(folder / "truth.jsonl")
    path: F64 = truth.pos_ned_m[truth.flown, :2]
    return path


def _seeds(text: str) -> range:
    """``0:10`` are the seeds 0 to 9."""
    first, last = text.split(":")
    return range(int(first), int(last))


def _json(comparison: Comparison) -> dict[str, Any]:
    return asdict(comparison) | {"fine": comparison.fine}


def main(arguments: list[str] | None = None) -> int:
    """Fly all, print the table. Exit code 0 when every seed is fine, 2 where something cannot be flown."""
    parser = argparse.ArgumentParser(prog="python -m mission.compare_firmware", description=__doc__)
    parser.add_argument("mission", nargs="?", default="trajectory1")
    parser.add_argument("--seeds", type=_seeds, default=range(10), help="first:last + 1")
    parser.add_argument("--instance", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="one object a line in place of the table")
    given = parser.parse_args(arguments)
    try:
        return 0 if _all_fine(given) else 1
    except (InputError, FlightError) as error:
        print(error, file=sys.stderr)
        return 2


def _all_fine(given: argparse.Namespace) -> bool:
    binary = os.environ.get("PX4_BIN")
    build = find_build(Path(binary)) if binary else None
    check_ports(given.instance, Firmware.PX4)
    if not given.json:
        print(HEAD, flush=True)
    fine = True
    for seed in given.seeds:
        with tempfile.TemporaryDirectory(prefix="swiftnav-compare-") as folder:
            comparison = compare(plan_flight(given.mission, seed), build, given.instance, Path(folder))
        print(json.dumps(json_ready(_json(comparison))) if given.json else comparison.row(), flush=True)
        fine = fine and comparison.fine
    return fine


if __name__ == "__main__":
    sys.exit(main())
