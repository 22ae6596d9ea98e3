"""How is MAVLink traffic kept? Telemetry logs (.tlog) as QGroundControl and MAVProxy read them.

One record is a time stamp (8 bytes, big-endian, microseconds since the UNIX epoch) and one whole MAVLink packet. Both
directions of a link go into the same file, in the order in which they were handled.
"""

import struct
from collections.abc import Iterator
from pathlib import Path

from pymavlink.dialects.v20 import common as mav

_STAMP = struct.Struct(">Q")
_V2_MIN_BYTES: int = mav.HEADER_LEN_V2 + 2
_V1_MIN_BYTES: int = mav.HEADER_LEN_V1 + 2


class TlogError(ValueError):
    """A file is no telemetry log; the text names file and place."""


class TlogWriter:
    """Appends packets to a new file."""

    def __init__(self, path: Path) -> None:
        """Create ``path``. Raises OSError when that is not possible."""
        self._file = path.open("wb")

    def write(self, wall_us: int, packet: bytes | bytearray) -> None:
        """Append one packet."""
        self._file.write(_STAMP.pack(wall_us))
        self._file.write(packet)

    def flush(self) -> None:
        """Hand everything to the system."""
        self._file.flush()

    def close(self) -> None:
        """Flush and close; may be called twice."""
        self._file.close()


def read_tlog(path: Path) -> Iterator[tuple[int, bytes]]:
    """Time stamp and packet of every record; a record cut off at the end of the file is left out.

    Raises TlogError where no packet follows a time stamp.
    """
    data = path.read_bytes()
    at = 0
    while at + _STAMP.size < len(data):
        start = at + _STAMP.size
        length = packet_length(data[start : start + 3])
        if length == 0:
            raise TlogError(f"{path.name} is no telemetry log: no MAVLink packet at byte {start}")
        if length < 0 or start + length > len(data):
            return
        yield _STAMP.unpack_from(data, at)[0], data[start : start + length]
        at = start + length


def packet_length(head: bytes | bytearray) -> int:
    """Bytes of the packet that starts with ``head``: 0 = no packet starts so, -1 = more of the head is needed."""
    if not head:
        return -1
    if head[0] == mav.PROTOCOL_MARKER_V1:
        return _V1_MIN_BYTES + head[1] if len(head) > 1 else -1
    if head[0] != mav.PROTOCOL_MARKER_V2:
        return 0
    if len(head) < 3:
        return -1
    if head[2] & ~mav.MAVLINK_IFLAG_SIGNED:  # flags nobody has defined: not a packet that we could read
        return 0
    signature_bytes: int = mav.MAVLINK_SIGNATURE_BLOCK_LEN if head[2] else 0
    return _V2_MIN_BYTES + head[1] + signature_bytes
