"""What else do clients talk to? A shell without commands, file transfer without files, the origin of the map."""

import struct
from collections.abc import Callable, Mapping
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl.link import COMPONENT, Link
from sitl.messages import gps_global_origin
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object

PROMPT: Final = "nsh> "
SHELL_BLOCK: Final = 70  # bytes of one SERIAL_CONTROL

# FILE_TRANSFER_PROTOCOL: sequence, session, opcode, size, opcode asked, burst complete, padding, offset
FTP_HEADER: Final = struct.Struct("<HBBBBBBI")
FTP_BYTES: Final = 251
FTP_ACK, FTP_NAK = 128, 129
FTP_ENDS: Final = (1, 2)  # TerminateSession, ResetSessions
FTP_FILES: Final = (3, 4, 6, 8, 10, 13, 14, 15)  # opcodes that name a file or folder
UNKNOWN_COMMAND, FILE_NOT_FOUND = 7, 10


class SideServices:
    """Serves every link of one vehicle."""

    def __init__(self, sim: Simulation, system_id: int) -> None:
        self._sim = sim
        self._system_id = system_id
        self._lines: dict[str, str] = {}  # by link: what was typed since the last line end
        self.handlers: Mapping[int, Callable[[Link, Message], None]] = {
            mav.MAVLINK_MSG_ID_SERIAL_CONTROL: self._shell,
            mav.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self._files,
            mav.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: self._origin,
        }

    def _shell(self, link: Link, message: Message) -> None:
        """A prompt; every command is unknown."""
        if message.device != mav.SERIAL_CONTROL_DEV_SHELL or message.flags & mav.SERIAL_CONTROL_FLAG_REPLY:
            return
        typed = bytes(message.data[: min(message.count, SHELL_BLOCK)]).decode("ascii", "replace")
        *lines, rest = (self._lines.get(link.name, "") + typed).replace("\r", "\n").split("\n")
        self._lines[link.name] = rest[:SHELL_BLOCK]
        words = [line.split()[0] for line in lines if line.split()]
        text = "".join(f"nsh: {word[:SHELL_BLOCK]}: command not found\n" for word in words) + PROMPT
        raw = ("\n" + text if lines else text).encode("ascii", "replace")
        for at in range(0, len(raw), SHELL_BLOCK):
            part = raw[at : at + SHELL_BLOCK]
            reply = mav.MAVLink_serial_control_message(
                mav.SERIAL_CONTROL_DEV_SHELL,
                mav.SERIAL_CONTROL_FLAG_REPLY,
                0,
                0,
                len(part),
                list(part.ljust(SHELL_BLOCK, b"\0")),
            )
            link.connection.send(reply)

    def _files(self, link: Link, message: Message) -> None:
        """Always NAK: there are no files. Ending a session is acknowledged."""
        if message.target_system != self._system_id or message.target_component not in (0, COMPONENT):
            return
        sequence, session, opcode, _, _, _, _, offset = FTP_HEADER.unpack_from(bytes(message.payload))
        if opcode in FTP_ENDS:
            answer, data = FTP_ACK, b""
        else:
            answer, data = FTP_NAK, bytes([FILE_NOT_FOUND if opcode in FTP_FILES else UNKNOWN_COMMAND])
        head = FTP_HEADER.pack((sequence + 1) & 0xFFFF, session, answer, len(data), opcode, 0, 0, offset)
        payload = list((head + data).ljust(FTP_BYTES, b"\0"))
        link.connection.send(
            mav.MAVLink_file_transfer_protocol_message(0, message.get_srcSystem(), message.get_srcComponent(), payload)
        )

    def _origin(self, link: Link, message: Message) -> None:
        """The origin stays where it is: GPS_GLOBAL_ORIGIN says so."""
        if message.target_system == self._system_id:
            link.connection.send(gps_global_origin(self._sim))
