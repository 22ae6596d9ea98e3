"""What does a run talk to? Opens the vehicle's link and the LiDAR that the configuration names."""

from contextlib import ExitStack, closing
from dataclasses import dataclass

from pymavlink.dialects.v20 import common as mav

from companion.app.config import CompanionConfig
from companion.core import codec
from companion.core.clock import Clock
from companion.core.keyring import Keyring
from companion.core.mavlink import Connection, PacketLog
from companion.core.signing import COMPANION_UNSIGNED
from companion.core.transport import Transport
from companion.core.url import Url, listens_wide, open_url, parse_url
from companion.link.lidar import Lidar, MavlinkLidar
from companion.link.lidar_replay import ReplayLidar
from companion.link.lidar_serial import SerialLidar
from companion.link.lidar_url import ReplayFile, SerialModel, parse_lidar

VEHICLE_LINK, LIDAR_LINK = 0, 1  # link ids of signatures
SCANS = frozenset({int(mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE)})


@dataclass(frozen=True, slots=True)
class Opened:
    """Ports and devices, before anything was said.

    ``lidar``: a transport is the link of one that speaks MAVLink; None: the vehicle passes scans on.
    """

    vehicle: Transport
    lidar: Transport | ReplayLidar | SerialLidar | None
    keyring: Keyring | None = None  # of signed links


def open_all(config: CompanionConfig, clock: Clock, stack: ExitStack) -> Opened:
    """Open what ``config`` names, closed with the stack. Raises KeyFileError, TransportError or LidarError."""
    keyring = _open_keyring(config, clock, stack)
    vehicle = stack.enter_context(closing(open_url(config.vehicle_url, clock)))
    lidar = _open_lidar(config, clock)
    return Opened(vehicle, stack.enter_context(closing(lidar)) if lidar is not None else None, keyring)


def connect(
    opened: Opened, config: CompanionConfig, log: PacketLog | None, clock: Clock
) -> tuple[Connection, Lidar | None]:
    """MAVLink on what was opened. With a LiDAR of its own the vehicle's scans are not listened to.

    (PX4 streams the map of its collision prevention as OBSTACLE_DISTANCE, which is no scan.)
    """
    ids = (config.system, codec.COMPANION_COMPONENT)
    ignored = SCANS if opened.lidar is not None else frozenset[int]()
    ring = opened.keyring
    signing = [ring.link(i, COMPANION_UNSIGNED) if ring is not None else None for i in (VEHICLE_LINK, LIDAR_LINK)]
    vehicle = Connection(opened.vehicle, *ids, log, clock, ignored, signing[VEHICLE_LINK])
    lidar = opened.lidar
    if lidar is None or isinstance(lidar, ReplayLidar | SerialLidar):
        return vehicle, lidar
    return vehicle, MavlinkLidar(Connection(lidar, *ids, log, clock, signing=signing[LIDAR_LINK]))


def exposed(config: CompanionConfig) -> str | None:
    """A warning, when the whole network may steer."""
    urls = [parse_url(config.vehicle_url)]
    lidar = parse_lidar(config.lidar_url) if config.lidar_url is not None else None
    urls += [lidar] if isinstance(lidar, Url) else []
    wide = [str(url) for url in urls if listens_wide(url)]
    if not wide or config.sign_key is not None:
        return None
    return (
        f"warning: {' and '.join(wide)} believes everybody on the network: give --sign-key FILE, or listen on 127.0.0.1"
    )


def _open_keyring(config: CompanionConfig, clock: Clock, stack: ExitStack) -> Keyring | None:
    if config.sign_key is None:
        return None
    keyring = Keyring(config.sign_key, f"companion_{parse_url(config.vehicle_url).port}", clock)
    stack.callback(keyring.close)
    return keyring


def _open_lidar(config: CompanionConfig, clock: Clock) -> Transport | ReplayLidar | SerialLidar | None:
    if config.lidar_url is None:
        return None
    url = parse_lidar(config.lidar_url)
    if isinstance(url, ReplayFile):
        return ReplayLidar(url.path)
    if isinstance(url, SerialModel):
        return SerialLidar(url.model, url.device, url.baud, config.params.lidar, clock)
    return open_url(url, clock)
