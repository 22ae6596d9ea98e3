"""Whom does the vehicle talk to, over which ports, and how often? PX4's links; each has rates and a log of its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from companion.core.clock import Clock
from companion.core.keyring import Keyring
from companion.core.mavlink import Connection
from companion.core.signing import COMPANION_UNSIGNED, PX4_UNSIGNED
from companion.core.tlog import TlogWriter
from companion.core.transport import Transport, TransportError
from companion.core.udp import udp_out
from sitl.streams import GCS_HZ, LEAN_HZ, NAVIGATION, ONBOARD_HZ, StreamSchedule

Message = Any  # a MAVLink_*_message object

HOST: Final = "127.0.0.1"
COMPONENT: Final = 1  # MAV_COMP_ID_AUTOPILOT1


@dataclass(frozen=True, slots=True)
class LinkSpec:
    """One of PX4's MAVLink instances; instance N of the vehicle adds N to both ports."""

    name: str
    local_port: int
    remote_port: int
    rates_hz: Mapping[int, float]
    companion: bool = False
    signs: bool = True  # when there is a key


SPECS: Final = (
    LinkSpec("companion", 14580, 14540, ONBOARD_HZ, companion=True),
    # PX4's payload port, here at full rate. MAVSDK, which our operator uses, cannot sign: this link never leaves HOST.
    LinkSpec("operator", 14280, 14030, ONBOARD_HZ, signs=False),
    LinkSpec("gcs", 18570, 14550, GCS_HZ),
)


class Link:
    """One connection with its stream rates: ``wall`` by wall time, ``vehicle`` by vehicle time (companion only)."""

    def __init__(
        self, spec: LinkSpec, connection: Connection, tlog: TlogWriter | None = None, lean: bool = False
    ) -> None:
        """``lean``: only the streams that a flight needs."""
        self.name = spec.name
        self.companion = spec.companion
        self.connection = connection
        by_vehicle = NAVIGATION if spec.companion else frozenset[int]()
        rates_hz = {i: hz for i, hz in spec.rates_hz.items() if i in LEAN_HZ or not lean}
        self.wall = StreamSchedule({i: hz for i, hz in rates_hz.items() if i not in by_vehicle})
        self.vehicle = StreamSchedule({i: hz for i, hz in rates_hz.items() if i in by_vehicle})
        self._tlog = tlog

    def schedule_of(self, message_id: int) -> StreamSchedule:
        """The schedule that a message of this id belongs to."""
        return self.vehicle if self.companion and message_id in NAVIGATION else self.wall

    def flush(self) -> None:
        """Bring the log to the disk."""
        if self._tlog is not None:
            self._tlog.flush()

    def close(self) -> None:
        """Free the port, close the log."""
        self.connection.close()
        if self._tlog is not None:
            self._tlog.close()


def bind(instance: int, clock: Clock) -> list[tuple[LinkSpec, Transport]]:
    """The ports of one vehicle. Raises TransportError naming a port in use; nothing stays open then."""
    bound: list[tuple[LinkSpec, Transport]] = []
    try:
        for spec in SPECS:
            udp = udp_out(HOST, spec.remote_port + instance, spec.local_port + instance, clock)
            bound.append((spec, udp))
    except TransportError:
        for _, transport in bound:
            transport.close()
        raise
    return bound


def open_links(
    bound: list[tuple[LinkSpec, Transport]],
    system_id: int,
    log_dir: Path | None,
    clock: Clock,
    keyring: Keyring | None = None,
    lean: bool = False,
) -> list[Link]:
    """Links over bound ports, each with a log in ``log_dir``. Raises OSError when that cannot be written.

    With ``keyring`` all sign that can; link ids are PX4's instance numbers. A companion is found by a signed HEARTBEAT
    only (in lockstep the vehicle's clock waits for it), a ground station as PX4 has it.
    """
    links = []
    for link_id, (spec, transport) in enumerate(bound):
        unsigned = COMPANION_UNSIGNED if spec.companion else PX4_UNSIGNED
        signing = keyring.link(link_id, unsigned) if keyring is not None and spec.signs else None
        tlog = TlogWriter(log_dir / f"vehicle_{spec.name}.tlog") if log_dir is not None else None
        connection = Connection(transport, system_id, COMPONENT, tlog, clock, signing=signing)
        links.append(Link(spec, connection, tlog, lean))
    return links
