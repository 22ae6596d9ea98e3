"""What does a bad radio do to a flight?  ``python -m mission.bad_radio`` puts one between vehicle and companion.

30 % of the datagrams are lost, the others come 200 to 300 ms late, overtake each other, one in ten twice; both ways. A
flight has to end landed or safely holding, and never in contact. Paced, because delays are wall time.
"""

import argparse
import dataclasses
import sys
import tempfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from companion.core import codec
from companion.core.lossy import Loss
from mission.errors import FlightError
from mission.flight_log import read_rows
from mission.flight_plan import plan_flight
from mission.judge import Result, judge
from mission.relay import BAD_RADIO, Relay
from mission.rig import Rig, paced
from mission.runner import COMPANION_PORT, check_ports
from sitl.link import HOST

BEHIND: Final = 1000  # the companion listens this much above the vehicle's port
PATIENCE_S: Final = 3.0  # vehicle time over the mission's limit


@dataclass(frozen=True, slots=True)
class Flight:
    """One flight over a bad radio."""

    seed: int
    result: Result
    end_mode: str
    airborne: bool  # at the end
    passed: dict[str, int]
    lost_s: float  # longest time without OFFBOARD after it began

    @property
    def safe(self) -> bool:
        """Landed, or holding in the air; nothing touched."""
        return self.result.collisions == 0 and (self.result.landed or self.end_mode == "HOLD")


def fly(name: str, seed: int, loss: Loss, instance: int, folder: Path) -> Flight:
    """One flight at real time; the pilot's link is good."""
    plan = plan_flight(name, seed)
    port = COMPANION_PORT + instance
    limit_s = plan.mission.success.time_limit_s * PATIENCE_S
    trouble: str | None = None
    with (
        Relay(port, port + BEHIND, loss, seed) as relay,
        Rig(plan, paced(1.0, instance), folder, f"udpin://{HOST}:{port + BEHIND}") as rig,
    ):
        pilot = rig.pilot
        try:
            companion = rig.start_companion()
            pilot.take_off()
            pilot.hand_over()
            began_s = pilot.t_s
            while pilot.armed and pilot.t_s < began_s + limit_s and companion.exit_code is None:
                pilot.until(lambda: not pilot.armed or pilot.custom_mode != codec.PX4_OFFBOARD, 1.0)
                if pilot.armed and pilot.custom_mode != codec.PX4_OFFBOARD:
                    pilot.until(lambda: not pilot.armed, 2.0)
                    pilot.hand_over()
        except FlightError as error:
            trouble = str(error)
        rig.end()
    rows = list(read_rows(folder / "truth.jsonl"))
    result = judge(plan, folder, trouble)
    return Flight(seed, result, rows[-1]["mode"], rows[-1]["armed"], relay.passed, _longest_without(rows))


def _longest_without(rows: list[dict[str, object]]) -> float:
    """Seconds that another mode was in force between the first and the last row in OFFBOARD."""
    times = [float(str(row["t_s"])) for row in rows if row["mode"] == "OFFBOARD"]
    return max((b - a for a, b in pairwise(times)), default=0.0)


def table(flights: list[Flight]) -> str:
    """One line a flight."""
    lines = ["seed  safe  end       least clearance  time    out of OFFBOARD  datagrams        reason"]
    for flight in flights:
        least = flight.result.min_clearance_m
        end = "landed" if flight.result.landed else flight.end_mode
        lines.append(
            f"{flight.seed:4d}  {'yes' if flight.safe else 'NO':<4}  {end:<8}"
            f"  {f'{least:.2f} m' if least is not None else '-':<15}  {flight.result.time_s:4.1f} s"
            f"  {flight.lost_s:5.2f} s at most  {flight.passed['onward']:6d} {flight.passed['back']:5d}"
            f"     {flight.result.reason}"
        )
    lines.append(f"{sum(flight.safe for flight in flights)} of {len(flights)} safe")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Fly, print the table. Exit code 0 when every flight was safe."""
    parser = argparse.ArgumentParser(prog="python -m mission.bad_radio", description=__doc__)
    parser.add_argument("--mission", default="trajectory1")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0, help="of the first flight")
    parser.add_argument("--instance", type=int, default=0)
    parser.add_argument("--loss", type=float, default=BAD_RADIO.loss)
    parser.add_argument("--delay", type=float, default=BAD_RADIO.delay_s, help="s, each way")
    parser.add_argument("--out", type=Path, help="keep the flights here")
    given = parser.parse_args(arguments)
    loss = dataclasses.replace(BAD_RADIO, loss=given.loss, delay_s=given.delay)
    check_ports(given.instance)
    seeds = range(given.seed, given.seed + given.runs)
    with tempfile.TemporaryDirectory(prefix="swiftnav-radio-") as folder:
        flights = [
            fly(given.mission, seed, loss, given.instance, (given.out or Path(folder)) / f"s{seed}") for seed in seeds
        ]
    print(table(flights))
    return 0 if all(flight.safe for flight in flights) else 1


if __name__ == "__main__":
    sys.exit(main())
