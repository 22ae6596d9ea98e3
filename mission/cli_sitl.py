"""``swiftnav sitl``: the vehicle alone, on the ports where PX4 would be."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.cli_options import (
    Faults,
    FirmwareName,
    Instance,
    Json,
    Lockstep,
    Px4Bin,
    Seed,
    SignKey,
    Speed,
    parse_firmware,
    parse_speed,
    print_json,
    require_extra,
)
from mission.errors import InputError
from mission.processes import INSTANCE_MAX

if TYPE_CHECKING:
    from sitl.vehicle import Wind
    from sitl.vehicle_config import VehicleConfig

World = Annotated[str, typer.Option(help="A world's name or a YAML file.")]
Spawn = Annotated[tuple[float, float] | None, typer.Option(help="North and east in the world, m; default its start.")]
Yaw = Annotated[float, typer.Option(help="Where the nose points at first, deg clockwise from north.")]
WindOption = Annotated[tuple[float, float], typer.Option(help="Where the air moves to, north and east, m/s.")]
Turbulence = Annotated[str, typer.Option(help="none, light, moderate or severe; needs wind to be felt.")]
Out = Annotated[Path | None, typer.Option("--out", help="Folder for truth and MAVLink logs; default: no logs.")]

Count = Annotated[
    int, typer.Option(min=1, max=INSTANCE_MAX + 1, help="Vehicles in this world, ports and system ids one up for each.")
]
Params = Annotated[Path | None, typer.Option("--params", help="File that keeps PX4 parameters over the end.")]


def sitl(
    world: World = "open",
    seed: Seed = 0,
    speed: Speed = "1",
    lockstep: Lockstep = False,
    spawn: Spawn = None,
    yaw: Yaw = 0.0,
    wind: WindOption = (0.0, 0.0),
    turbulence: Turbulence = "none",
    fault: Faults = None,
    instance: Instance = 0,
    count: Count = 1,
    params: Params = None,
    firmware: FirmwareName = "embedded",
    px4_bin: Px4Bin = None,
    sign_key: SignKey = None,
    out: Out = None,
    json: Json = False,
) -> int:
    """The vehicle alone, as PX4 would be: companion udp 14540, ground station 14550. Ends with Ctrl-C.

    With --firmware px4 the aircraft alone, for a real PX4 at tcp 4560; its LiDAR goes to udp 14650.
    With --count vehicles stand 3 m apart, system ids from instance + 1; they see each other, and time is one for all.
    """
    require_extra("sitl", "sitl")
    from mission.px4_firmware import running
    from mission.world_file import load_world
    from sitl.app import run
    from sitl.server import RunConfig
    from sitl.simulation import SimConfig
    from sitl.vehicle_config import VehicleConfig

    times, in_step = parse_speed(speed, lockstep)
    who, px4 = parse_firmware(firmware, px4_bin)
    place = load_world(world, start=spawn)
    sim = SimConfig(
        seed, spawn, math.radians(_finite(yaw, "--yaw")), _wind(wind, turbulence), faults=tuple(fault or ())
    )
    config = VehicleConfig(
        place.seeded(seed),
        sim,
        RunConfig(times, in_step, gates=in_step),  # paced, any client may fly it, as often as it likes: no gates
        instance,
        log_dir=out,
        params_file=params,
        firmware=who,
        sign_key=sign_key,
    )
    if count > 1:
        return _fleet(config, count, json)
    if json:
        print_json(config.to_json())
    with running(px4, instance, out):
        return run(config)


def _fleet(config: "VehicleConfig", count: int, json: bool) -> int:
    from sitl import fleet, formation
    from sitl.vehicle_config import ConfigError, Firmware

    if config.firmware is Firmware.PX4:
        raise InputError("--count is for the embedded firmware: start one 'swiftnav sitl --firmware px4' for each PX4")
    if config.instance + count - 1 > INSTANCE_MAX:
        raise InputError(f"--count {count} from --instance {config.instance} on goes beyond instance {INSTANCE_MAX}")
    try:
        configs = formation.fleet(config, count)
    except ConfigError as error:
        raise InputError(str(error)) from error
    if json:
        print_json({"vehicles": [member.to_json() for member in configs]})
    return fleet.run(configs)


def _wind(towards_m_s: tuple[float, float], turbulence: str) -> "Wind":
    from companion.core.params import nearest
    from sitl.vehicle import Turbulence, Wind

    names = [strength.name.lower() for strength in Turbulence]
    if turbulence not in names:
        raise InputError(f"--turbulence '{turbulence}' is unknown{nearest(turbulence, names)}")
    north, east = (_finite(speed, "--wind") for speed in towards_m_s)
    return Wind((north, east, 0.0), Turbulence[turbulence.upper()])


def _finite(value: float, option: str) -> float:
    if not math.isfinite(value):
        raise InputError(f"{option} {value} is not a finite number")
    return value
