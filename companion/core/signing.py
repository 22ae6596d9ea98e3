"""Did a holder of our key send this packet, and is it new? MAVLink 2 signatures; pure, time comes as ticks.

A signed packet ends in link id (1 byte), timestamp (6 bytes, ticks of 10 us since 2015) and signature: the first 6
bytes of SHA-256 over key, packet, link id and timestamp. A stream is (link id, system, component); in each the
timestamp only ever grows. The signature is judged first: a packet that fails it leaves no trace, whatever its timestamp
says, so that nobody without the key can make the receiver deaf.

A sender with several links signs on each with another link id. Each of our links listens to one of them, so that what
the vehicle tells its ground station cannot be played to the companion.
"""

import hashlib
import hmac
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from pymavlink.dialects.v20 import common as mav

KEY_BYTES: Final = 32
EPOCH_UNIX_S: Final = 1_420_070_400  # 2015-01-01T00:00:00Z, where timestamps begin
TICKS_PER_S: Final = 100_000
NEW_STREAM_TICKS: Final = 60 * TICKS_PER_S  # a stream never heard may be this much behind us (MAVLink's figure)
SILENCE_TICKS: Final = 10 * TICKS_PER_S  # after this another link of a sender may take the place of the one heard
TIMESTAMP_BYTES: Final = 6
SIGNATURE_BYTES: Final = 6

# Told without a signature, as PX4 has it: radios and traffic receivers cannot sign, and links are found by HEARTBEAT.
PX4_UNSIGNED: Final = frozenset(
    int(message_id)
    for message_id in (
        mav.MAVLINK_MSG_ID_HEARTBEAT,
        mav.MAVLINK_MSG_ID_RADIO_STATUS,
        mav.MAVLINK_MSG_ID_ADSB_VEHICLE,
        mav.MAVLINK_MSG_ID_COLLISION,
    )
)
# Between vehicle and companion both have the key, and fly by each other's HEARTBEAT: they want that one signed.
COMPANION_UNSIGNED: Final = frozenset({int(mav.MAVLINK_MSG_ID_RADIO_STATUS)})

Stream = tuple[int, int, int]  # link id, system, component
Place = tuple[int, int, int]  # number of our own link, system, component


class Verdict(Enum):
    """What a packet turned out to be."""

    GOOD = "good"
    UNSIGNED = "unsigned"
    FORGED = "forged"  # signed with another key, or changed on the way
    OLD = "old"  # signed well, but heard before, too long ago, or meant for another link


@dataclass(slots=True)
class Book:
    """Timestamps of one process, shared by all its links: what is heard on one cannot be replayed on another."""

    timestamp: int = 0  # the last that we used or believed
    streams: dict[Stream, int] = field(default_factory=dict)  # the last of each stream, our own among them
    heard_as: dict[Place, int] = field(default_factory=dict)  # by which link id a sender is heard on a link of ours

    def stamp(self, stream: Stream, now: int) -> int:
        """The timestamp of the next packet that we send; a reflected copy of it will be old."""
        self.timestamp = max(self.timestamp + 1, now)
        self.streams[stream] = self.timestamp
        return self.timestamp

    def is_old(self, ours: int, stream: Stream, timestamp: int, now: int) -> bool:
        """Was this timestamp overtaken, is it too far behind for a stream that begins, or was it told elsewhere?"""
        link_id, system, component = stream
        heard = self.heard_as.get((ours, system, component), link_id)
        if heard != link_id and timestamp <= self.streams.get((heard, system, component), 0) + SILENCE_TICKS:
            return True
        last = self.streams.get(stream)
        if last is not None:
            return timestamp <= last
        return timestamp + NEW_STREAM_TICKS < max(self.timestamp, now)

    def believe(self, ours: int, stream: Stream, timestamp: int) -> None:
        """A packet with a good signature carried this timestamp on our link number ``ours``."""
        link_id, system, component = stream
        self.heard_as[(ours, system, component)] = link_id
        self.streams[stream] = timestamp
        self.timestamp = max(self.timestamp, timestamp)


def ticks(unix_us: int) -> int:
    """Timestamp of an instant, microseconds since the UNIX epoch; 0 before 2015."""
    return max(0, unix_us // 10 - EPOCH_UNIX_S * TICKS_PER_S)


def signature(key: bytes, packet: bytes) -> bytes:
    """Signature of a packet given up to and including its timestamp."""
    return hashlib.sha256(key + packet).digest()[:SIGNATURE_BYTES]


def judge(packet: bytes, key: bytes, book: Book, now: int, ours: int = 0) -> Verdict:
    """Judge one whole packet from our link number ``ours``; only a good one changes ``book``."""
    if len(packet) < mav.HEADER_LEN_V2 or packet[0] != mav.PROTOCOL_MARKER_V2:
        return Verdict.UNSIGNED
    if not packet[2] & mav.MAVLINK_IFLAG_SIGNED:
        return Verdict.UNSIGNED
    signed, given = packet[:-SIGNATURE_BYTES], packet[-SIGNATURE_BYTES:]
    if not hmac.compare_digest(signature(key, signed), given):
        return Verdict.FORGED
    stream = (signed[-TIMESTAMP_BYTES - 1], packet[5], packet[6])
    timestamp = int.from_bytes(signed[-TIMESTAMP_BYTES:], "little")
    if book.is_old(ours, stream, timestamp, now):
        return Verdict.OLD
    book.believe(ours, stream, timestamp)
    return Verdict.GOOD
