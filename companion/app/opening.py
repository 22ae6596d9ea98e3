"""What does a run talk to? Opens the vehicle's link and the LiDAR that the configuration names."""

from contextlib import ExitStack, closing
from dataclasses import dataclass

from pymavlink.dialects.v20 import common as mav

from companion.app.config import CompanionConfig
from companion.core import codec
from companion.core.clock import Clock
from companion.core.mavlink import Connection, PacketLog
from companion.core.transport import Transport
from companion.core.url import open_url
from companion.link.lidar import Lidar, MavlinkLidar
from companion.link.lidar_replay import ReplayLidar
from companion.link.lidar_serial import SerialLidar
from companion.link.lidar_url import ReplayFile, SerialModel, parse_lidar

SCANS = frozenset({int(mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE)})


@dataclass(frozen=True, slots=True)
class Opened:
    """Ports and devices, before anything was said."""

    vehicle: Transport
    lidar: (
        Transport | ReplayLidar | SerialLidar | None
    )  # a transport: a LiDAR that speaks MAVLink; None: the vehicle passes scans on


def open_all(config: CompanionConfig, clock: Clock, stack: ExitStack) -> Opened:
    """Open what ``config`` names, closed with the stack. Raises TransportError or LidarError."""
    vehicle = stack.enter_context(closing(open_url(config.vehicle_url, clock)))
    lidar = _open_lidar(config, clock)
    return Opened(vehicle, stack.enter_context(closing(lidar)) if lidar is not None else None)


def connect(
    opened: Opened, config: CompanionConfig, log: PacketLog | None, clock: Clock
) -> tuple[Connection, Lidar | None]:
    """MAVLink on what was opened. With a LiDAR of its own the vehicle's scans are not listened to.

    (PX4 streams the map of its collision prevention as OBSTACLE_DISTANCE, which is no scan.)
    """
    ids = (config.system, codec.COMPANION_COMPONENT)
    ignored = SCANS if opened.lidar is not None else frozenset[int]()
    vehicle = Connection(opened.vehicle, *ids, log, clock, ignored)
    lidar = opened.lidar
    if lidar is None or isinstance(lidar, ReplayLidar | SerialLidar):
        return vehicle, lidar
    return vehicle, MavlinkLidar(Connection(lidar, *ids, log, clock))


def _open_lidar(config: CompanionConfig, clock: Clock) -> Transport | ReplayLidar | SerialLidar | None:
    if config.lidar_url is None:
        return None
    url = parse_lidar(config.lidar_url)
    if isinstance(url, ReplayFile):
        return ReplayLidar(url.path)
    if isinstance(url, SerialModel):
        return SerialLidar(url.model, url.device, url.baud, config.params.lidar, clock)
    return open_url(url, clock)
