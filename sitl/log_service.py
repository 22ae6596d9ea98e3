"""How are flight logs downloaded? PX4's side of the log protocol; a transfer goes on with every tick."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl.flight_logs import FlightLogs
from sitl.link import COMPONENT, Link

Message = Any  # a MAVLink_*_message object

BLOCK: Final = 90  # bytes of one LOG_DATA
BURST: Final = 40  # messages a tick


@dataclass(slots=True)
class _Transfer:
    number: int
    at: int  # next byte
    end: int  # first byte not wanted


class LogService:
    """Serves every link of one vehicle."""

    def __init__(self, logs: FlightLogs | None, system_id: int) -> None:
        self._logs = logs
        self._system_id = system_id
        self._transfers: dict[str, _Transfer] = {}  # by the name of the link
        self.handlers: Mapping[int, Callable[[Link, Message], None]] = {
            mav.MAVLINK_MSG_ID_LOG_REQUEST_LIST: self._list,
            mav.MAVLINK_MSG_ID_LOG_REQUEST_DATA: self._data,
            mav.MAVLINK_MSG_ID_LOG_ERASE: self._erase,
            mav.MAVLINK_MSG_ID_LOG_REQUEST_END: self._end,
        }

    def tick(self, links: Sequence[Link]) -> None:
        """Send the next blocks of every transfer."""
        for link in links:
            transfer = self._transfers.get(link.name)
            if transfer is not None:
                self._send(link, transfer)

    def _list(self, link: Link, message: Message) -> None:
        """LOG_ENTRY of every log asked for; one empty entry when there is none."""
        if not self._for_us(message) or self._logs is None:
            return
        logs = self._logs.logs
        self._logs.flush()
        if not logs:
            link.connection.send(mav.MAVLink_log_entry_message(0, 0, 0, 0, 0))
        for number in range(message.start, min(message.end, len(logs) - 1) + 1):
            log = logs[number]
            link.connection.send(
                mav.MAVLink_log_entry_message(number, len(logs), len(logs) - 1, log.utc_s, log.path.stat().st_size)
            )

    def _data(self, link: Link, message: Message) -> None:
        """A part of one log, as LOG_DATA."""
        if self._for_us(message) and self._logs is not None and message.id < len(self._logs.logs):
            self._logs.flush()
            self._transfers[link.name] = _Transfer(message.id, message.ofs, message.ofs + message.count)

    def _erase(self, _link: Link, message: Message) -> None:
        """Forgets all logs."""
        if self._for_us(message) and self._logs is not None:
            self._transfers.clear()
            self._logs.erase()

    def _end(self, link: Link, message: Message) -> None:
        """Ends a download."""
        if self._for_us(message):
            self._transfers.pop(link.name, None)

    def _send(self, link: Link, transfer: _Transfer) -> None:
        assert self._logs is not None
        with self._logs.logs[transfer.number].path.open("rb") as file:
            file.seek(transfer.at)
            for _ in range(BURST):
                data = file.read(min(BLOCK, transfer.end - transfer.at))
                padded = list(data.ljust(BLOCK, b"\0"))
                link.connection.send(mav.MAVLink_log_data_message(transfer.number, transfer.at, len(data), padded))
                transfer.at += len(data)
                if len(data) < BLOCK:
                    del self._transfers[link.name]
                    return

    def _for_us(self, message: Message) -> bool:
        return message.target_system == self._system_id and message.target_component in (0, COMPONENT)
