"""What happens when the companion dies in flight?  ``python -m mission.kills --runs 20`` kills it at random moments.

Each run kills (SIGKILL) at a moment drawn over the flight, waits for the vehicle's failsafe, starts a new companion and
gives it OFFBOARD again. Judged by the truth, in vehicle time: how soon the failsafe came after the kill, and whether
the vehicle touched anything; and by the ground station: how the mission ended. Every other run has COM_OBL_RC_ACT at
Hold. The others have PX4's default, Position: nobody holds the sticks, the vehicle comes down, and is sent up again.
"""

import argparse
import math
import random
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from companion.core import codec
from companion.core.types import F64
from mission.errors import FlightError
from mission.flight_log import read_rows
from mission.flight_plan import FlightPlan, plan_flight
from mission.rig import Rig, paced
from mission.runner import check_ports
from sitl.collision import CollisionChecker

LOSS_S: Final = 1.0  # COM_OF_LOSS_T by default
SLACK_S: Final = 0.5  # the failsafe has to be there by then
BRAKE_M_S2: Final = 3.0  # of the vehicle in Hold, carefully
LOOK_M: Final = 30.0
STEP_M: Final = 0.05
STANDS_M_S: Final = 0.3  # slower than this counts as standing, also in gusts
HOLD: Final = 5
ACTIONS: Final = {0: "Position", HOLD: "Hold"}  # COM_OBL_RC_ACT
STAND_S: Final = 5.0  # after a kill the vehicle stands by then
FLIGHT_S: Final = (1.0, 20.0)  # after OFFBOARD began; the flight takes a little longer
WALL_S: Final = 240.0


@dataclass(frozen=True, slots=True)
class Kill:
    """One run."""

    seed: int
    action: int
    killed_t_s: float = math.nan  # vehicle time
    speed_m_s: float = math.nan  # horizontal, at that moment
    free_m: float = math.nan  # ahead, along the velocity
    reaction_s: float = math.nan  # until another mode than OFFBOARD was in force
    travelled_m: float = math.nan  # from the kill to standstill
    min_clearance_m: float = math.nan  # from the kill to the new OFFBOARD
    contact: bool = False
    resumed: bool = False  # the new companion flew on
    landing_error_m: float = math.nan
    trouble: str = ""

    @property
    def could_stop(self) -> bool:
        """Was there room to stop after the loss was noticed?"""
        needed_m = self.speed_m_s * LOSS_S + self.speed_m_s**2 / (2.0 * BRAKE_M_S2)
        return self.free_m >= needed_m

    @property
    def fine(self) -> bool:
        """In the failsafe in time, without contact where it could stop, and flown on to the goal."""
        in_time = self.reaction_s <= LOSS_S + SLACK_S
        return in_time and self.resumed and not self.trouble and not (self.contact and self.could_stop)


def run(name: str, seed: int, speed: float, instance: int, folder: Path) -> Kill:
    """One flight with one kill."""
    plan = plan_flight(name, seed)
    rng = random.Random(f"kill {seed}")
    action = list(ACTIONS)[seed % len(ACTIONS)]
    killed_t_s, end_ned_m, trouble = math.nan, None, ""
    with Rig(plan, paced(speed, instance), folder) as rig:
        try:
            killed_t_s = _fly_and_kill(rig, action, rng.uniform(*FLIGHT_S))
            end_ned_m = _fly_on(rig, action, killed_t_s)
        except FlightError as error:
            trouble = str(error)
        rig.end()
    return _judged(plan, folder, Kill(seed, action, killed_t_s, trouble=trouble), end_ned_m)


def _fly_and_kill(rig: Rig, action: int, after_s: float) -> float:
    """Returns the vehicle time of the kill, which is ``after_s`` after OFFBOARD. Raises FlightError."""
    pilot, companion = rig.pilot, rig.start_companion()
    pilot.insist(lambda: pilot.ready, lambda: None, 60.0, "getting ready")
    pilot.set_integer("COM_OBL_RC_ACT", action)
    pilot.take_off()
    pilot.hand_over()
    began_s = pilot.t_s
    if not pilot.until(lambda: pilot.t_s >= began_s + after_s, WALL_S):
        raise FlightError("vehicle time stood still")
    companion.process.kill()
    killed_t_s = pilot.t_s
    companion.process.wait()
    return killed_t_s


def _fly_on(rig: Rig, action: int, killed_t_s: float) -> tuple[float, float, float]:
    """Wait for the failsafe, start a new companion, let it finish the mission; the place. Raises FlightError."""
    pilot = rig.pilot
    if not pilot.until(lambda: pilot.custom_mode != codec.PX4_OFFBOARD, 10.0):
        raise FlightError("no failsafe")
    rig.start_companion()
    if action == HOLD:
        pilot.until(lambda: pilot.t_s >= killed_t_s + STAND_S, WALL_S)
    else:
        pilot.until(lambda: not pilot.armed, WALL_S)
        pilot.take_off()
    pilot.hand_over()
    if not pilot.until(lambda: not pilot.armed, WALL_S):
        raise FlightError("the new companion did not land")
    return pilot.pos_ned_m


def _judged(plan: FlightPlan, folder: Path, kill: Kill, end_ned_m: tuple[float, float, float] | None) -> Kill:
    rows = list(read_rows(folder / "truth.jsonl"))
    after = [row for row in rows if row["t_s"] >= kill.killed_t_s]
    if not after:
        return kill
    place, velocity = np.array(after[0]["pos_world_ned_m"]), np.array(after[0]["vel_ned_m_s"])
    left = next((i for i, row in enumerate(after) if row["mode"] != "OFFBOARD"), None)
    back = next((i for i, row in enumerate(after) if left is not None and i > left and row["mode"] == "OFFBOARD"), None)
    alone = after[:back]
    clearances = [row["clearance_m"] for row in alone if row["clearance_m"] is not None]
    slow = next((row for row in alone if math.hypot(*row["vel_ned_m_s"][:2]) < STANDS_M_S), alone[-1])
    error_m = math.dist(end_ned_m[:2], plan.task.goal_ned_m.tolist()) if end_ned_m is not None else math.inf
    return Kill(
        seed=kill.seed,
        action=kill.action,
        killed_t_s=kill.killed_t_s,
        speed_m_s=math.hypot(*velocity[:2]),
        free_m=_free_m(plan, after[0]["t_s"], place, velocity),
        reaction_s=after[left]["t_s"] - kill.killed_t_s if left is not None else math.inf,
        travelled_m=float(np.linalg.norm((np.array(slow["pos_world_ned_m"]) - place)[:2])),
        min_clearance_m=min(clearances, default=math.inf),
        contact=any(row["contact"] for row in rows),
        resumed=error_m <= plan.mission.success.landing_error_m,
        landing_error_m=error_m,
        trouble=kill.trouble,
    )


def _free_m(plan: FlightPlan, t_s: float, place: F64, velocity: F64) -> float:
    """How far the vehicle could go straight on."""
    checker = CollisionChecker(plan.world, plan.params.vehicle.radius_m)
    speed = math.hypot(*velocity[:2])
    if speed < STEP_M:
        return LOOK_M
    ahead = np.array([*velocity[:2] / speed, 0.0])
    for metres in np.arange(0.0, LOOK_M, STEP_M).tolist():
        if checker.clearance(t_s, place + ahead * metres) <= 0.0:
            return float(metres)
    return LOOK_M


def table(kills: list[Kill]) -> str:
    """One line a run."""
    lines = ["seed  action    killed  speed   free  stop  failsafe  least  contact  resumed  landed  trouble"]
    lines += [
        f"{k.seed:4d}  {ACTIONS[k.action]:<8} {k.killed_t_s:6.1f}s {k.speed_m_s:4.1f}m/s {k.free_m:5.1f}m"
        f" {k.travelled_m:4.1f}m  {k.reaction_s:5.2f} s  {k.min_clearance_m:4.2f}m  {'YES' if k.contact else 'no':<7}"
        f"  {'yes' if k.resumed else 'NO':<7}  {k.landing_error_m:4.2f}m  {k.trouble}"
        for k in kills
    ]
    worst_s = max(k.reaction_s for k in kills)
    lines.append(
        f"{sum(k.fine for k in kills)} of {len(kills)} fine; slowest failsafe {worst_s:.2f} s after the kill;"
        f" contacts {sum(k.contact for k in kills)}, of which {sum(k.contact and k.could_stop for k in kills)} had room"
        f" to stop; flown on {sum(k.resumed for k in kills)}"
    )
    return "\n".join(lines)


def kills(name: str, seeds: list[int], speed: float, instances: list[int], folder: Path) -> list[Kill]:
    """Many runs, one at a time on each of ``instances``."""

    def work(job: int) -> list[Kill]:
        instance = instances[job]
        check_ports(instance)
        return [run(name, seed, speed, instance, folder / f"s{seed}") for seed in seeds[job :: len(instances)]]

    with ThreadPoolExecutor(len(instances)) as pool:
        done = [kill for some in pool.map(work, range(len(instances))) for kill in some]
    return sorted(done, key=lambda kill: kill.seed)


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table. Exit code 0 when every run was fine."""
    parser = argparse.ArgumentParser(prog="python -m mission.kills", description=__doc__)
    parser.add_argument("--mission", default="trajectory1")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first run")
    parser.add_argument("--speed", type=float, default=1.0, help="times real time")
    parser.add_argument("--instance", type=int, nargs="+", default=[0], help="ports; several: that many at a time")
    parser.add_argument("--out", type=Path, help="keep the flights here")
    given = parser.parse_args(arguments)
    seeds = list(range(given.seed, given.seed + given.runs))
    with tempfile.TemporaryDirectory(prefix="swiftnav-kills-") as folder:
        flown = kills(given.mission, seeds, given.speed, given.instance, given.out or Path(folder))
    print(table(flown))
    return 0 if all(kill.fine for kill in flown) else 1


if __name__ == "__main__":
    sys.exit(main())
