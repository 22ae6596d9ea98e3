"""How does a flight on a real PX4 differ?  Its ports, its process, and how well it knows where it is.

PX4 is not part of this package: a build of it (``bin/px4`` beside ``etc``) is named by PX4_BIN, or somebody else starts
one. Its parameters stay as its airframe file has them.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from mission.errors import InputError
from mission.flight_plan import FlightPlan
from mission.processes import Child, Children
from sitl.px4_airframe import NONE_IRIS
from sitl.px4_bridge import HIL_PORT, LIDAR_PORT
from sitl.px4_ear import EAR_PORT

OPERATOR_PORT = 14550  # PX4's ground station link, the same for every instance; its payload link has 4 kB/s only
PX4_LOCAL_PORTS = {14580: "API", 14280: "payload", 13030: "gimbal", 18570: "ground station"}
LANDING_ERROR_M = 1.0  # PX4 lands where it believes the goal to be, by GPS


@dataclass(frozen=True, slots=True)
class Px4Build:
    """A build of PX4 for SITL."""

    binary: Path
    etc: Path  # its start scripts


def find_build(binary: Path) -> Px4Build:
    """The build around ``bin/px4``. Raises InputError naming what is missing."""
    resolved = binary.expanduser().resolve()
    if not (resolved.is_file() and os.access(resolved, os.X_OK)):
        raise InputError(f"PX4_BIN '{binary}' is no program: it wants .../px4_sitl_default/bin/px4")
    etc = resolved.parent.parent / "etc"
    if not (etc / "init.d-posix" / "rcS").is_file():
        raise InputError(f"PX4_BIN '{binary}': no start scripts in {etc}")
    return Px4Build(resolved, etc)


@contextmanager
def running(build: Px4Build | None, instance: int, folder: Path | None) -> Iterator[None]:
    """PX4 while the context lasts, its files in ``folder``/px4 or nowhere; without a build nothing."""
    with tempfile.TemporaryDirectory(prefix="swiftnav_px4_") as scratch, Children() as children:
        if build is not None:
            place = folder if folder is not None else Path(scratch)
            start(children, build, instance, place / "px4", place / "px4.log")
        yield


def start(children: Children, build: Px4Build, instance: int, rootfs: Path, log: Path) -> Child:
    """PX4 as a process of its own, with ``rootfs`` (parameters, logs, missions) to itself."""
    rootfs = rootfs.resolve()
    rootfs.mkdir(parents=True, exist_ok=True)
    arguments = [str(build.binary), "-d", "-i", str(instance), "-w", str(rootfs), str(build.etc)]
    return children.start_program("PX4", arguments, log, {"PX4_SIM_MODEL": NONE_IRIS.name}, rootfs)


def operator_url() -> str:
    """Where the operator waits for PX4."""
    return f"udpin://0.0.0.0:{OPERATOR_PORT}"


def lidar_url(instance: int) -> str:
    """Where the companion waits for the LiDAR."""
    return f"udpin://0.0.0.0:{LIDAR_PORT + instance}"


def udp_ports() -> dict[int, str]:
    """UDP ports that a flight takes besides the companion's; the ground station's is not moved by the instance."""
    px4 = {port: f"PX4's {name} link" for port, name in PX4_LOCAL_PORTS.items()}
    return px4 | {LIDAR_PORT: "LiDAR", EAR_PORT: "PX4's gimbal link, heard by the bridge"}


def tcp_port(instance: int) -> int:
    """PX4's simulator port."""
    return HIL_PORT + instance


def with_gps_tolerance(plan: FlightPlan) -> FlightPlan:
    """The plan with a landing tolerance that an autopilot with GPS can keep."""
    success = plan.mission.success
    wider = success.model_copy(update={"landing_error_m": max(success.landing_error_m, LANDING_ERROR_M)})
    return replace(plan, mission=plan.mission.model_copy(update={"success": wider}))
