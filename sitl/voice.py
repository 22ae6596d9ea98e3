"""What does the vehicle say, to whom and when? Streams, changes, texts, and the scan with what belongs to it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core.mavlink import Parcel
from sitl import messages
from sitl.home import Home
from sitl.link import Link
from sitl.message_table import BUILDERS
from sitl.simulation import Simulation
from sitl.streams import NAVIGATION

Message = Any  # a MAVLink_*_message object

READY_NEWS: Final = (mav.MAVLINK_MSG_ID_SYS_STATUS,)
DATAGRAM_MESSAGES: Final = 8  # at most 2048 bytes, which is what MAVSDK reads of a datagram
SCAN: Final = mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE  # to the companion with every scan, not by the schedule


@dataclass(frozen=True, slots=True)
class ScanBundle:
    """The companion's inputs of one scan instant, the scan last; packed already."""

    t_ms: int
    parcel: Parcel | None  # None: there is no link to a companion
    finished: bool = False  # the vehicle had flown and disarmed


class Voice:
    """Speaks for one simulation on all its links."""

    def __init__(self, sim: Simulation, links: Sequence[Link], say: Callable[[str], None]) -> None:
        self._sim = sim
        self._links = list(links)
        self._companion = next((link for link in links if link.companion), None)
        self._say = say
        self._told: tuple[object, ...] = ()  # what the last heartbeats said
        self._told_ready = False
        self._told_home: Home | None = None
        self._texts = 0

    def bundle(self, with_status: bool) -> ScanBundle:
        """What goes to the companion with the scan taken now; ``with_status``: HEARTBEAT and EXTENDED_SYS_STATE too."""
        sim, link = self._sim, self._companion
        if link is None:
            return ScanBundle(sim.t_ms, None, sim.finished)
        status = (messages.heartbeat(sim), messages.extended_sys_state(sim)) if with_status else ()
        state = (messages.attitude_quaternion(sim), messages.local_position_ned(sim))
        scan = (messages.obstacle_distance(sim),) if link.wall.interval_us(SCAN) else ()
        return ScanBundle(sim.t_ms, link.connection.pack(*status, *state, *scan), sim.finished)

    def deliver(self, bundle: ScanBundle) -> None:
        """To the companion, in one datagram."""
        if self._companion is not None and bundle.parcel is not None:
            self._companion.vehicle.sent(NAVIGATION, bundle.t_ms * 1000)
            self._companion.connection.send_parcel(bundle.parcel)

    def stream_by_wall(self, now_us: int) -> None:
        """What is due by wall time, on every link."""
        for link in self._links:
            self._send(link, link.wall.due(now_us))

    @property
    def next_by_wall_us(self) -> float:
        """When ``stream_by_wall`` has more to say; inf when nothing is streamed."""
        return min((link.wall.next_us for link in self._links), default=math.inf)

    def stream_by_vehicle(self) -> None:
        """What is due by vehicle time, on the companion's link."""
        if self._companion is not None:
            self._send(self._companion, self._companion.vehicle.due(self._sim.t_ms * 1000))

    def tell_changes(self) -> None:
        """Texts at once; HEARTBEAT and EXTENDED_SYS_STATE at once when they say something new."""
        ap = self._sim.autopilot
        told = (ap.mode, ap.armed, ap.failsafe is not None, ap.ready, ap.landed_state)
        if told != self._told:
            self._told = told
            self._to_all(messages.heartbeat(self._sim), messages.extended_sys_state(self._sim))
        if ap.ready is not self._told_ready:
            self._told_ready = ap.ready
            news = (BUILDERS[message_id](self._sim) for message_id in READY_NEWS)
            self._to_all(*(message for message in news if message is not None))
        if ap.home is not self._told_home:
            self._told_home = ap.home
            moved = messages.home_position(self._sim)
            self._to_all(*([moved] if moved is not None else []))
        texts, ap.texts[:] = list(ap.texts), []
        for text in texts:
            self._texts = self._texts % 0xFFFF + 1
            self._say(text.text)
            self._to_all(*messages.status_texts(text.severity, text.text, self._texts))

    def _to_all(self, *to_send: Message) -> None:
        for link in self._links:
            link.connection.send(*to_send)

    def _send(self, link: Link, message_ids: list[int]) -> None:
        built = (BUILDERS[i](self._sim) for i in message_ids if not (link.companion and i == SCAN))
        present = [message for message in built if message is not None]
        for at in range(0, len(present), DATAGRAM_MESSAGES):
            link.connection.send(*present[at : at + DATAGRAM_MESSAGES])
