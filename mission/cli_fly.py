"""``swiftnav fly``: one command, one flight. Vehicle, companion and operator; judged; exit 0 only on success."""

from pathlib import Path
from typing import Annotated

import typer

from mission.cli_options import (
    Faults,
    FirmwareName,
    Instance,
    Json,
    Lockstep,
    ParamFile,
    ParamSet,
    Px4Bin,
    Seed,
    SignKey,
    parse_firmware,
    parse_overrides,
    parse_speed,
    parse_switch,
    print_json,
    require_extra,
)
from mission.errors import FlightError

DEFAULT_MISSION = "trajectory2"
DEFAULT_SPEED = {"embedded": "max", "px4": "1"}  # a real PX4 does not wait for the companion

FlySpeed = Annotated[
    str | None, typer.Option("--speed", help="Times real time, or 'max': unpaced. Default max; on a real PX4 1.")
]

World = Annotated[str | None, typer.Option(help="Fly in this world (a name or a YAML file) instead of the mission's.")]
Policy = Annotated[
    str | None,
    typer.Option(help="Who flies in RL mode, instead of the mission's: geometric, a shipped name, a folder."),
]
Guard = Annotated[
    str | None, typer.Option(help="on: a learned policy only where the expert knows no better; off: it flies alone.")
]
Profile = Annotated[
    str | None, typer.Option(help="A named parameter set of the companion: outdoor, tight, adaptive; --params on top.")
]
OperatorUrl = Annotated[str | None, typer.Option(help="Link of the operator, instead of udpin port 14030.")]
Out = Annotated[Path | None, typer.Option("--out", help="Flight folder, new or empty; default below ./flights.")]
MissionName = Annotated[str, typer.Argument(help="A mission's name, a YAML file, or a QGroundControl .plan.")]


def fly(
    mission: MissionName = DEFAULT_MISSION,
    seed: Seed = 0,
    speed: FlySpeed = None,
    lockstep: Lockstep = False,
    world: World = None,
    policy: Policy = None,
    guard: Guard = None,
    profile: Profile = None,
    param: ParamSet = None,
    params: ParamFile = None,
    fault: Faults = None,
    instance: Instance = 0,
    operator_url: OperatorUrl = None,
    firmware: FirmwareName = "embedded",
    px4_bin: Px4Bin = None,
    sign_key: SignKey = None,
    out: Out = None,
    json: Json = False,
) -> None:
    """Fly a mission over MAVLink, judge it, leave a flight folder. Exit code 0 only on success."""
    require_extra("sitl", "fly")
    from companion.navigator.profiles import merged, profile_named
    from mission.console import FlightConsole, LogTail, print_result
    from mission.flight_folder import make_folder
    from mission.flight_plan import plan_flight
    from mission.px4_firmware import with_gps_tolerance
    from mission.runner import FlySettings, check_ports
    from mission.runner import fly as run

    who, px4 = parse_firmware(firmware, px4_bin)
    times, in_step = parse_speed(speed or DEFAULT_SPEED[who.value], lockstep)
    settings = FlySettings(times, in_step, instance, operator_url, who, px4, sign_key)
    overrides = merged(profile_named(profile) if profile else {}, parse_overrides(params, param))
    if guard is not None:
        overrides["policy"] = {**(overrides.get("policy") or {}), "guard": parse_switch(guard, "--guard")}
    plan = plan_flight(mission, seed, overrides, world, policy, fault or ())
    if who.value == "px4":
        plan = with_gps_tolerance(plan)
    check_ports(instance, who)
    folder = make_folder(plan, out)
    title = f"{plan.mission.name}, seed {seed}, {plan.params.policy.name}"
    with FlightConsole(title, LogTail(folder / "navigator.jsonl"), quiet=json) as console:
        result = run(plan, settings, folder, console)
    if json:
        print_json(result.as_dict())
    else:
        print_result(result)
    if not result.success:
        raise FlightError(f"flight failed: {result.reason}")
