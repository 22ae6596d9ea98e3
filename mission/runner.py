"""How is one flight made?  Vehicle and companion as processes, the operator here, the judge at the end.

All ports are PX4's plus the instance. Whatever happens the processes are ended: companion first, the vehicle last, so
that an interrupted flight leaves a vehicle that holds and logs that are closed.
"""

import asyncio
import contextlib
import json
import signal
import socket
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from mission import operator, px4_firmware
from mission.console import FlightConsole
from mission.errors import FlightError, InputError
from mission.flight_folder import write_inputs, write_result
from mission.flight_plan import DECIMALS, FlightPlan
from mission.judge import Result, judge
from mission.processes import INSTANCE_MAX, Child, Children, wait_for_end
from mission.px4_firmware import Px4Build
from mission.simulate import sim_config
from sitl.link import HOST, SPECS
from sitl.server import RunConfig
from sitl.vehicle_config import Firmware, VehicleConfig

REFRESH_WALL_S = 0.1
AFTERWARDS_WALL_S = 5.0  # that the companion has to notice that the flight is over
COMPANION_PORT = 14540  # PX4's API port
OPERATOR_PORT = 14030  # PX4's payload port


@dataclass(frozen=True, slots=True)
class FlySettings:
    """How to fly, not what."""

    speed: float = float("inf")  # times real time
    lockstep: bool = True
    instance: int = 0
    operator_url: str | None = None
    firmware: Firmware = Firmware.EMBEDDED
    px4: Px4Build | None = None  # with firmware PX4: started here; None: somebody else starts one
    sign_key: Path | None = None  # of the companion's and the ground station's link
    companion_program: tuple[str, ...] = ()  # that takes the companion's arguments; empty: ``python -m companion``

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        px4 = str(self.px4.binary) if self.px4 is not None else None
        key = str(self.sign_key) if self.sign_key is not None else None
        return asdict(self) | {"speed": str(self.speed), "px4": px4, "sign_key": key}

    @property
    def run_config(self) -> RunConfig:
        """Vehicle time stops for commands where it does not follow the clients' clocks."""
        return RunConfig(self.speed, self.lockstep, gates=self.lockstep or self.speed > 1.0)


def check_ports(instance: int, firmware: Firmware = Firmware.EMBEDDED) -> None:
    """Raise InputError naming the first port that somebody else holds."""
    if firmware is Firmware.PX4:
        _check_port(px4_firmware.tcp_port(instance), "PX4's simulator link", socket.SOCK_STREAM)
        ports = px4_firmware.udp_ports() | {COMPANION_PORT: "companion"}
    else:
        ports = {spec.local_port: f"vehicle's {spec.name} link" for spec in SPECS}
        ports |= {spec.remote_port: spec.name for spec in SPECS if spec.name != "gcs"}
    for port, user in ports.items():
        _check_port(port + instance, user)
    if firmware is Firmware.PX4:
        _check_port(px4_firmware.OPERATOR_PORT, "operator")  # the same for every instance


def _check_port(port: int, user: str, kind: socket.SocketKind = socket.SOCK_DGRAM) -> None:
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind is socket.SOCK_STREAM:  # a connection that was closed a moment ago is nobody
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("0.0.0.0", port))
        except OSError as error:
            raise InputError(f"port {port} ({user}) is in use: end the other flight or choose --instance N") from error


def free_instance() -> int:
    """The first instance whose ports nobody holds. Raises InputError."""
    for instance in range(INSTANCE_MAX):
        with contextlib.suppress(InputError):
            check_ports(instance)
            return instance
    check_ports(INSTANCE_MAX)
    return INSTANCE_MAX


def fly(plan: FlightPlan, settings: FlySettings, folder: Path, console: FlightConsole) -> Result:
    """Fly, judge, write everything into ``folder``. KeyboardInterrupt passes on after result.json was written."""
    write_inputs(plan, folder, settings.as_dict())
    trouble: str | None = None
    try:
        with Children() as children:
            asyncio.run(_fly(plan, settings, folder, console, children))
    except FlightError as error:
        trouble = str(error)
    except KeyboardInterrupt:
        write_result(judge(plan, folder, "interrupted"), folder)
        raise
    result = judge(plan, folder, trouble)
    write_result(result, folder)
    _draw(plan, folder, result)
    return result


async def _fly(
    plan: FlightPlan, settings: FlySettings, folder: Path, console: FlightConsole, children: Children
) -> None:
    """Both processes and the operator, until the operator is done or something ends before its time."""
    _end_on_sigterm_too()
    companion = _start_companion(plan, settings, folder, children)
    firmware = _start_firmware(settings, folder, children)
    vehicle = children.start("vehicle", "sitl", [str(_write_vehicle(plan, settings, folder))], folder / "vehicle.log")
    config = operator.OperatorConfig(_operator_url(settings), plan.mission.success.time_limit_s)
    flight = asyncio.create_task(operator.fly(config, console.say))
    try:
        while not flight.done():
            await asyncio.wait({flight}, timeout=REFRESH_WALL_S)
            console.refresh()
            _check_running(companion, vehicle, *firmware)
        await flight
    finally:
        flight.cancel()
        await asyncio.gather(flight, return_exceptions=True)
    await asyncio.to_thread(wait_for_end, companion, AFTERWARDS_WALL_S)
    console.refresh()


def _start_companion(plan: FlightPlan, settings: FlySettings, folder: Path, children: Children) -> Child:
    arguments, log = companion_arguments(plan, settings, folder), folder / "companion.log"
    if settings.companion_program:
        return children.start_program("companion", [*settings.companion_program, *arguments], log, {})
    return children.start("companion", "companion", arguments, log)


def _start_firmware(settings: FlySettings, folder: Path, children: Children) -> list[Child]:
    """PX4, where it is ours to start."""
    if settings.px4 is None:
        return []
    return [px4_firmware.start(children, settings.px4, settings.instance, folder / "px4", folder / "px4.log")]


def _operator_url(settings: FlySettings) -> str:
    if settings.operator_url is not None:
        return settings.operator_url
    if settings.firmware is Firmware.PX4:
        return px4_firmware.operator_url()
    return f"udpin://{HOST}:{OPERATOR_PORT + settings.instance}"


def companion_arguments(plan: FlightPlan, settings: FlySettings, folder: Path) -> list[str]:
    """What would be typed after ``python -m companion`` on the drone."""
    goal = [f"{metres:.{DECIMALS}f}" for metres in plan.task.goal_ned_m.tolist()]
    if plan.task.down_m is not None:
        goal.append(repr(plan.task.down_m))
    return [
        *("--vehicle", f"udpin://{HOST}:{COMPANION_PORT + settings.instance}"),
        *("--goal", *goal),
        *("--cruise", repr(plan.task.cruise_m_s)),
        *("--params", str(folder / "params.yaml")),
        *("--log", str(folder)),
        *("--seed", str(plan.seed)),
        *(("--lidar", px4_firmware.lidar_url(settings.instance)) if settings.firmware is Firmware.PX4 else ()),
        *(("--sign-key", str(settings.sign_key)) if settings.sign_key is not None else ()),
    ]


def vehicle_config(plan: FlightPlan, settings: FlySettings, folder: Path | None) -> VehicleConfig:
    """What the vehicle's process is told."""
    return VehicleConfig(
        plan.world,
        sim_config(plan),
        settings.run_config,
        settings.instance,
        log_dir=folder,
        firmware=settings.firmware,
        sign_key=settings.sign_key,
    )


def _write_vehicle(plan: FlightPlan, settings: FlySettings, folder: Path) -> Path:
    path = folder / "vehicle.json"
    path.write_text(json.dumps(vehicle_config(plan, settings, folder).to_json()), encoding="utf-8")
    return path


def _check_running(companion: Child, *vehicle: Child) -> None:
    """Raise FlightError when something of the vehicle has ended, or the companion other than by landing."""
    for child, fine in (*((child, None) for child in vehicle), (companion, 0)):
        code = child.exit_code
        if code is not None and code != fine:
            raise FlightError(f"the {child.name} ended: {f'signal {-code}' if code < 0 else child.last_line() or code}")


def _end_on_sigterm_too() -> None:
    """SIGTERM ends the flight as Ctrl-C does; asyncio has just put its own handler there."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.getsignal(signal.SIGINT))


def _draw(plan: FlightPlan, folder: Path, result: Result) -> None:
    from mission.figures import draw_flight  # matplotlib: loaded while nothing flies

    draw_flight(plan, folder, result)
