"""Can somebody without the key change a flight? ``python -m mission.attack`` flies twice, alone and under attack.

Both flights are in lockstep over signed links. During the second one, orders that would hurt arrive at every port that
is signed, forged and replayed (from the first flight, and from this one as it goes). Navigator's record and truth have
to stay the same, byte for byte.
"""

import argparse
import json
import random
import secrets
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from companion.core.signing import KEY_BYTES
from mission.console import FlightConsole, LogTail
from mission.flight_plan import FlightPlan, plan_flight
from mission.hostile import Siege, forgeries, replays
from mission.judge import Result
from mission.runner import COMPANION_PORT, FlySettings, fly, free_instance
from sitl.link import SPECS

OVER_WALL_S: Final = 4.0  # a flight in lockstep takes a little longer
RECORDED: Final = ("companion.tlog", "vehicle_companion.tlog", "vehicle_gcs.tlog")


Counts = dict[str, dict[str, int]]


@dataclass(frozen=True, slots=True)
class Attacked:
    """One flight under attack."""

    result: Result
    sent: dict[int, int]  # datagrams by port
    counts: Counts  # by link


def make_key(folder: Path) -> Path:
    """A new key in a file that nobody else can read."""
    path = folder / "key"
    path.touch(mode=0o600)
    path.write_text(secrets.token_hex(KEY_BYTES), encoding="utf-8")
    return path


def fly_quietly(plan: FlightPlan, settings: FlySettings, folder: Path) -> Result:
    """One flight without a console."""
    folder.mkdir(parents=True, exist_ok=True)
    with FlightConsole("", LogTail(folder / "navigator.jsonl"), quiet=True) as console:
        return fly(plan, settings, folder, console)


def besieged(
    plan: FlightPlan,
    settings: FlySettings,
    folder: Path,
    each: int,
    source: Callable[[int], Iterator[bytes]],
    ports: list[int],
    over_wall_s: float = OVER_WALL_S,
) -> Attacked:
    """A flight while ``each`` datagrams of ``source`` arrive at each of ``ports``, from the first scan on."""
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "navigator.jsonl"
    siege = Siege(ports, each, source, over_wall_s, lambda: record.exists() and record.stat().st_size > 0)
    with siege if each else nullcontext():
        result = fly_quietly(plan, settings, folder)
    return Attacked(result, siege.sent, counters(folder))


def signed_ports(instance: int) -> list[int]:
    """Where signed links of a flight listen."""
    return [COMPANION_PORT + instance, *(spec.local_port + instance for spec in SPECS if spec.signs)]


def all_ports(instance: int) -> list[int]:
    """Where vehicle and companion listen."""
    return [COMPANION_PORT + instance, *(spec.local_port + instance for spec in SPECS)]


def counters(folder: Path) -> Counts:
    """What each link of a flight has counted, the vehicle's by name and the companion's by URL."""
    counts: Counts = json.loads((folder / "links.json").read_text(encoding="utf-8"))
    last = json.loads((folder / "companion.jsonl").read_text(encoding="utf-8").splitlines()[-1])
    heard: Counts = last["links"]
    return counts | heard


def hostile(seed: int, recordings: list[Path]) -> Callable[[int], Iterator[bytes]]:
    """Forged and replayed packets in turn, other ones for each port."""

    def source(port: int) -> Iterator[bytes]:
        rng = random.Random(f"{seed}/{port}")
        forged, replayed = forgeries(rng), replays(rng, recordings)
        while True:
            yield next(forged)
            yield next(replayed) or next(forged)

    return source


def attack(plan: FlightPlan, instance: int, folder: Path, packets: int) -> tuple[Result, Attacked]:
    """The flight alone, and under attack with ``packets`` at each signed port."""
    settings = FlySettings(instance=instance, sign_key=make_key(folder))
    alone = fly_quietly(plan, settings, folder / "alone")
    recordings = [folder / name / log for name in ("alone", "attacked") for log in RECORDED]
    source = hostile(plan.seed, recordings)
    return alone, besieged(plan, settings, folder / "attacked", packets, source, signed_ports(instance))


def main(arguments: list[str] | None = None) -> int:
    """Fly both, print the comparison. Exit code 0 when nothing changed."""
    parser = argparse.ArgumentParser(prog="python -m mission.attack", description=__doc__)
    parser.add_argument("--mission", default="trajectory1")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--packets", type=int, default=1000, help="to each signed port")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="swiftnav-attack-") as folder:
        plan = plan_flight(given.mission, given.seed)
        alone, attacked = attack(plan, free_instance(), Path(folder), given.packets)
    same = (alone.record_sha256, alone.truth_sha256) == (attacked.result.record_sha256, attacked.result.truth_sha256)
    print(f"alone:    {alone.reason}; record {alone.record_sha256[:16]}, truth {alone.truth_sha256[:16]}")
    under = attacked.result
    print(f"attacked: {under.reason}; record {under.record_sha256[:16]}, truth {under.truth_sha256[:16]}")
    print("sent:     " + ", ".join(f"{count} to port {port}" for port, count in attacked.sent.items()))
    for link, counts in attacked.counts.items():
        print(f"refused:  {link}: {counts['unsigned']} unsigned, {counts['forged']} forged, {counts['old']} replayed")
    print("the flight is unchanged" if same else "THE FLIGHT HAS CHANGED")
    return 0 if same and alone.success else 1


if __name__ == "__main__":
    sys.exit(main())
