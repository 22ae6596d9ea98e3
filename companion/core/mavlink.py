"""How do chunks of bytes become MAVLink messages, and back? Survives garbage: it is counted, never raised.

The framing is our own: pymavlink throws a whole bad frame away, and with it the good ones that follow a stray start
byte. Here a bad frame costs one byte and the search goes on with the next start byte, but not for ever: who sends
nothing but start bytes must not keep us from our work.
"""

import re
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from pymavlink.dialects.v20 import common as mav

from companion.core.clock import Clock, SystemClock
from companion.core.keyring import LinkSigning
from companion.core.signing import Verdict
from companion.core.tlog import packet_length
from companion.core.transport import Transport, Vouchable, wait_readable

Message = Any  # a MAVLink_*_message object; pymavlink's classes share no useful static type

BUFFER_MAX_BYTES = 1 << 16  # a stream without a single packet in this much is thrown away
BAD_FRAMES_MAX = 100  # one after the other; what is left of a chunk is thrown away then
START_BYTE = re.compile(bytes([ord("["), mav.PROTOCOL_MARKER_V1, mav.PROTOCOL_MARKER_V2, ord("]")]))
SEQUENCES = 256  # packet sequence numbers wrap here


@dataclass(slots=True)
class LinkCounts:
    """What a connection has seen so far."""

    received: int = 0  # messages delivered
    unknown: int = 0  # packets with an id that the dialect does not know
    bad_bytes: int = 0  # bytes that belonged to no valid packet
    lost: int = 0  # gaps in the senders' sequence numbers
    sent: int = 0
    unsigned: int = 0  # whole packets refused on a signed link: without a signature,
    forged: int = 0  # with one that our key did not make,
    old: int = 0  # or with a timestamp that was overtaken: heard before


class PacketParser:
    """Cuts a stream of chunks into decoded messages; on a signed link only those that may be believed."""

    def __init__(self, counts: LinkCounts | None = None, signing: LinkSigning | None = None) -> None:
        self.counts = counts or LinkCounts()
        self.signed = 0  # messages with a good signature so far
        self._signing = signing
        self._mavlink = mav.MAVLink(None)
        self._buffer = bytearray()

    def feed(self, chunk: bytes) -> list[Message]:
        """Every message completed by ``chunk``."""
        if self._buffer and self._starts_packet(chunk):
            self.counts.bad_bytes += len(self._buffer)  # what was left over is no beginning of anything
            self._buffer.clear()
        self._buffer += chunk
        messages: list[Message] = []
        at = bad_frames = 0
        while at < len(self._buffer):
            length = packet_length(self._buffer[at : at + 3])
            if length < 0 or (length > 0 and at + length > len(self._buffer)):
                break
            message = self._decode(at, length) if length else None
            if message is None:
                bad_frames += 1
                start = START_BYTE.search(self._buffer, at + 1) if bad_frames < BAD_FRAMES_MAX else None
                end = start.start() if start is not None else len(self._buffer)
                self.counts.bad_bytes += end - at
                at = end
                continue
            at += length
            bad_frames = 0
            if message.get_msgId() == mav.MAVLINK_MSG_ID_UNKNOWN:
                self.counts.unknown += 1
            elif self._believed(message):
                messages.append(message)
        del self._buffer[:at]
        self._limit_buffer()
        self.counts.received += len(messages)
        return messages

    def _believed(self, message: Message) -> bool:
        """May this message be acted upon? Counts it where not."""
        if self._signing is None:
            return True
        verdict = self._signing.judge(bytes(message.get_msgbuf()))
        if verdict is Verdict.GOOD:
            self.signed += 1
            return True
        if verdict is Verdict.UNSIGNED:
            if message.get_msgId() in self._signing.unsigned:
                return True
            self.counts.unsigned += 1
        elif verdict is Verdict.FORGED:
            self.counts.forged += 1
        else:
            self.counts.old += 1
        return False

    def _starts_packet(self, chunk: bytes) -> bool:
        """True when ``chunk`` by itself begins with a whole packet of a known kind."""
        length = packet_length(chunk[:3])
        if length <= 0 or length > len(chunk):
            return False
        message = decode_packet(self._mavlink, chunk[:length])
        return message is not None and message.get_msgId() != mav.MAVLINK_MSG_ID_UNKNOWN

    def _decode(self, at: int, length: int) -> Message | None:
        message = decode_packet(self._mavlink, self._buffer[at : at + length])
        if message is None or message.get_msgId() != mav.MAVLINK_MSG_ID_UNKNOWN:
            return message
        # The checksum of an unknown id cannot be tested: believe it only when a packet or nothing follows.
        end = at + length
        return message if end == len(self._buffer) or packet_length(self._buffer[end : end + 3]) else None

    def _limit_buffer(self) -> None:
        if len(self._buffer) > BUFFER_MAX_BYTES:
            self.counts.bad_bytes += len(self._buffer)
            self._buffer.clear()


def decode_packet(mavlink: mav.MAVLink, packet: bytes | bytearray) -> Message | None:
    """The message of one whole packet, or None when its length or checksum is wrong."""
    try:
        return mavlink.decode(bytearray(packet))
    except mav.MAVError:
        return None


class PacketLog(Protocol):
    """Where a connection keeps what it hears and says, for example a TlogWriter."""

    def write(self, wall_us: int, packet: bytes | bytearray) -> None:
        """Keep one packet."""


class Parcel(NamedTuple):
    """Messages packed before it is time to send them."""

    messages: tuple[Message, ...]
    packets: tuple[bytes, ...]
    sequence: int  # number of the first packet


class Connection:
    """A transport that speaks MAVLink 2 under one system and component id, with an optional log."""

    def __init__(
        self,
        transport: Transport,
        system: int,
        component: int,
        log: PacketLog | None = None,
        clock: Clock | None = None,
        ignored: frozenset[int] = frozenset(),
        signing: LinkSigning | None = None,
    ) -> None:
        """``ignored``: ids that are neither delivered nor logged. ``signing`` None: everybody is believed."""
        self.transport = transport
        self.counts = LinkCounts()
        self._mavlink = mav.MAVLink(None, srcSystem=system, srcComponent=component)
        self._signing = signing
        self._parser = PacketParser(self.counts, signing)
        self._reader = mav.MAVLink(None)
        self._log = log
        self._clock = clock or SystemClock()
        self._ignored = ignored
        self._sequence: dict[tuple[int, int], int] = {}

    def send(self, *messages: Message) -> None:
        """Send messages as one chunk (one datagram on UDP)."""
        self.send_parcel(self.pack(*messages))

    def pack(self, *messages: Message) -> Parcel:
        """Messages made ready for ``send_parcel``."""
        packets, sequence = [], self._mavlink.seq
        for message in messages:
            if self._signing is not None:
                self._signing.prepare(self._mavlink)
            packets.append(bytes(message.pack(self._mavlink)))
            self._mavlink.seq = (self._mavlink.seq + 1) % SEQUENCES
        self._mavlink.seq = sequence
        return Parcel(messages, tuple(packets), sequence)

    def send_parcel(self, parcel: Parcel) -> None:
        """Send as one chunk; packed anew when something else was sent since, so that the numbers stay in order."""
        if parcel.sequence != self._mavlink.seq:
            parcel = self.pack(*parcel.messages)
        if self._log is not None:
            wall_us = self._clock.wall_us()
            for packet in parcel.packets:
                self._log.write(wall_us, packet)
        self._mavlink.seq = (parcel.sequence + len(parcel.packets)) % SEQUENCES
        self.counts.sent += len(parcel.packets)
        self.transport.send(b"".join(parcel.packets))

    def relay(self, message: Message) -> Message:
        """Send a message that we take in ourselves, too; gives it as the other end reads it: rounded, with our ids."""
        self.send(message)
        return self._reader.decode(bytearray(message.get_msgbuf()))

    def receive(self, timeout_s: float = 0.0) -> list[Message]:
        """Messages that have arrived, oldest first; waits up to ``timeout_s`` for the first."""
        if timeout_s > 0.0:
            wait_readable([self.transport], timeout_s, self._clock)
        messages = [message for chunk in self.transport.receive() for message in self._feed(chunk)]
        if self._signing is not None:
            self._signing.tend()
        for message in messages:
            self._count_lost(message)
        if self._ignored:
            messages = [message for message in messages if message.get_msgId() not in self._ignored]
        for message in messages:
            if self._log is not None:
                self._log.write(self._clock.wall_us(), message.get_msgbuf())
        return messages

    def speak_as(self, system: int, component: int) -> None:
        """Send under other ids from now on."""
        self._mavlink.srcSystem = system
        self._mavlink.srcComponent = component

    def close(self) -> None:
        """Close the transport; the log belongs to whoever opened it."""
        self.transport.close()
        if self._signing is not None:
            self._signing.close()

    def _feed(self, chunk: bytes) -> list[Message]:
        """The messages of a chunk; whoever signed one well is a partner, other strangers are not."""
        before = self._parser.signed
        messages = self._parser.feed(chunk)
        if self._parser.signed > before and isinstance(self.transport, Vouchable):
            self.transport.vouch(chunk)
        return messages

    def _count_lost(self, message: Message) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        sequence = message.get_seq()
        expected = self._sequence.get(sender)
        self._sequence[sender] = (sequence + 1) % SEQUENCES
        if expected is not None:
            gap = (sequence - expected) % SEQUENCES
            self.counts.lost += gap if gap < SEQUENCES // 2 else 0  # a larger gap: a packet that came late or twice
