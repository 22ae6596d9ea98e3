"""How long does one flight take, from the command line on, and what does it cost the companion?"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from companion.navigator.record import STANDBY
from mission.errors import FlightError
from mission.flight_log import read_rows
from mission.runner import free_instance

SWIFTNAV = "import sys; from mission.cli import main; sys.exit(main())"  # the console script, wherever it lies


class Flown(NamedTuple):
    """One flight over UDP in lockstep; what the names mean stands in ``bench_speed.FIGURES``."""

    udp_lockstep_rtf: float
    flight_tick_p50_ms: float
    flight_tick_p99_ms: float
    flight_decision_p99_ms: float
    companion_rss_mb: float
    first_setpoint_s: float
    flight_wall_s: float


def fly_once(mission: str, seed: int, policy: str) -> Flown:
    """``swiftnav fly``. Raises InputError when no ports are free, FlightError when the flight did not end well."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arguments = ["fly", mission, "--policy", policy, "--seed", str(seed), "--instance", str(free_instance())]
        arguments += ["--out", name, "--json"]
        began_s = time.monotonic()
        ended = subprocess.run(
            [sys.executable, "-c", SWIFTNAV, *arguments], capture_output=True, text=True, check=False
        )
        wall_s = time.monotonic() - began_s
        if ended.returncode != 0:
            raise FlightError(f"the flight over UDP failed: {ended.stderr.strip() or ended.returncode}")
        return _flown(folder, json.loads(ended.stdout)["realtime_factor"], began_s, wall_s)


def _flown(folder: Path, realtime_factor: float, began_s: float, wall_s: float) -> Flown:
    timing = list(read_rows(folder / "timing.jsonl"))
    steered = {row["t_s"] for row in read_rows(folder / "navigator.jsonl") if row["mode"] != STANDBY}
    ticks = [row for row in timing if row["t_s"] in steered]
    plain_ms = [row["tick_ms"] for row in ticks if not row["decision"]]
    end = next(row for row in read_rows(folder / "companion.jsonl") if row.get("event") == "end")
    return Flown(
        realtime_factor,
        float(np.median(plain_ms)),
        float(np.percentile(plain_ms, 99)),
        float(np.percentile([row["tick_ms"] for row in ticks if row["decision"]], 99)),
        end["max_rss_mb"],
        timing[0]["wall_s"] + timing[0]["loop_ms"] / 1e3 - began_s,  # both by the machine's monotonic clock
        wall_s,
    )
