"""What must the companion be told before it may start? A value, and the check that refuses a wrong one."""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from companion.core.task import Task
from companion.core.url import UrlError, parse_url
from companion.link.lidar_url import parse_lidar
from companion.navigator import Params

VEHICLE_URL = "udpin://127.0.0.1:14540"  # where PX4 sends to a companion, if it runs on this machine
CRUISE_MAX_M_S = 20.0  # top speed of the aircraft in models/


class ConfigError(ValueError):
    """A setting is wrong; one line that names it."""


class Engage(StrEnum):
    """Who asks the autopilot for OFFBOARD?"""

    WAIT = "wait"  # the pilot or operator
    AUTO = "auto"  # the companion, once, when the vehicle holds in the air


@dataclass(frozen=True, slots=True)
class CompanionConfig:
    """One run of the companion."""

    task: Task
    log_dir: Path
    vehicle_url: str = VEHICLE_URL
    lidar_url: str | None = None  # as ``link.lidar_url`` reads it; None: scans come over the vehicle's link
    params: Params = field(default_factory=Params)
    engage: Engage = Engage.WAIT
    connect_timeout_s: float = 30.0  # wall time until the vehicle must have been heard
    lost_timeout_s: float = 3.0  # wall time of silence after which it counts as lost (MAVSDK's figure)
    system: int = 1  # MAVLink system id until the vehicle's own is known
    sign_key: Path | None = (
        None  # file of the key that signs and judges every MAVLink link; None: everybody is believed
    )
    seed: int = 0  # kept with the flight; the navigator draws nothing


def check(config: CompanionConfig) -> None:
    """Raises ConfigError naming the first wrong setting."""
    task = config.task
    if task.goal_ned_m.shape != (2,) or not all(math.isfinite(v) for v in task.goal_ned_m):
        raise ConfigError(f"goal {task.goal_ned_m.tolist()} must be two finite numbers: north and east in metres")
    if task.down_m is not None and not (math.isfinite(task.down_m) and task.down_m < 0.0):
        raise ConfigError(f"cruise altitude D = {task.down_m} must be negative: metres down from the start")
    if not 0.0 < task.cruise_m_s <= CRUISE_MAX_M_S:
        raise ConfigError(f"cruise = {task.cruise_m_s} m/s is outside (0, {CRUISE_MAX_M_S}] m/s")
    for name in ("connect_timeout_s", "lost_timeout_s"):
        value = getattr(config, name)
        if not (math.isfinite(value) and value > 0.0):
            raise ConfigError(f"{name} = {value} must be a positive number of seconds")
    try:
        parse_url(config.vehicle_url)
        if config.lidar_url is not None:
            parse_lidar(config.lidar_url)
    except UrlError as error:
        raise ConfigError(str(error)) from error
