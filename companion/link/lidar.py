"""Who scans? One interface, whether the LiDAR speaks MAVLink, hangs on a serial port of this computer, or is a file.

Every LiDAR gives messages, its scans as OBSTACLE_DISTANCE in vehicle time and in the body frame, so that the rest of
the companion, the flight log and its replay know one form only. What is attached to this computer is unknown to the
autopilot: the process hands those messages on.
"""

from collections.abc import Sequence
from typing import Any, Protocol

from companion.core import codec
from companion.core.mavlink import Connection
from companion.core.transport import Waitable
from companion.core.types import Scan
from companion.link.vehicle_clock import VehicleClock

Message = Any  # a MAVLink_*_message object


class LidarError(OSError):
    """A LiDAR cannot be opened; one line that names it."""


class Lidar(Protocol):
    """A source of scans."""

    @property
    def name(self) -> str:
        """As it was written on the command line, for logs."""

    @property
    def local(self) -> bool:
        """True when the autopilot hears of its scans only through us."""

    def receive(self, clock: VehicleClock) -> list[Message]:
        """Messages since the last call, oldest first; never blocks."""

    def waits_on(self) -> Sequence[Waitable]:
        """What tells that there is something to receive; empty where vehicle time tells."""

    def links(self) -> Sequence[Connection]:
        """MAVLink connections of its own, on which the companion introduces itself."""

    def close(self) -> None:
        """Free port or file; may be called twice."""


class MavlinkLidar:
    """A LiDAR that speaks MAVLink on a link of its own: its scans are in vehicle time already."""

    local = False

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def name(self) -> str:
        """The URL."""
        return self._connection.transport.name

    def receive(self, clock: VehicleClock) -> list[Message]:
        """Whatever came over the link."""
        del clock  # time stamps are the sender's
        return self._connection.receive()

    def waits_on(self) -> Sequence[Waitable]:
        """The link."""
        return (self._connection.transport,)

    def links(self) -> Sequence[Connection]:
        """The link."""
        return (self._connection,)

    def close(self) -> None:
        """Close the link."""
        self._connection.close()


def scan_message(scan: Scan) -> Message:
    """What a LiDAR of this computer says: OBSTACLE_DISTANCE of a scan that is in vehicle time."""
    return codec.encode_scan(scan)
