"""What does the companion leave behind? One folder: packets, one record a tick, wall timings, events.

``companion.tlog`` every packet, both directions, all links. ``navigator.jsonl`` one object a tick, vehicle time only,
bytewise comparable. ``timing.jsonl`` how long ticks took. ``companion.jsonl`` what happened, with wall time.
A disk that fills up in flight ends the logs, not the flight.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import structlog

from companion.core.tlog import TlogWriter

PACKETS, RECORDS, TIMINGS, EVENTS = "companion.tlog", "navigator.jsonl", "timing.jsonl", "companion.jsonl"


class LogFolderError(OSError):
    """The log folder cannot be written; one line that names it."""


class FlightLogs:
    """The open log files of one run."""

    def __init__(self, folder: Path) -> None:
        """Create folder and files. Raises LogFolderError."""
        self.folder = folder
        self.problem: str | None = None  # why writing ended, if it did
        self.ticks = 0
        self._sha256 = hashlib.sha256()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._packets = TlogWriter(folder / PACKETS)
            self._records = (folder / RECORDS).open("wb")
            self._timings = (folder / TIMINGS).open("wb")
            self._events = (folder / EVENTS).open("w", encoding="utf-8")
        except OSError as error:
            raise LogFolderError(f"log folder {folder} cannot be written: {error.strerror or error}") from error
        self._logger = structlog.wrap_logger(
            structlog.WriteLogger(self._events),
            wrapper_class=structlog.BoundLogger,
            processors=[
                structlog.processors.add_log_level,
                structlog.processors.TimeStamper(fmt="iso", utc=True, key="wall"),
                structlog.processors.format_exc_info,
                structlog.processors.JSONRenderer(),
            ],
        )

    @property
    def record_sha256(self) -> str:
        """Digest of ``navigator.jsonl`` so far."""
        return self._sha256.hexdigest()

    def write(self, wall_us: int, packet: bytes | bytearray) -> None:
        """Keep one MAVLink packet."""
        self._attempt(lambda: self._packets.write(wall_us, packet))

    def tick(self, row: Mapping[str, Any], timing: Mapping[str, Any]) -> None:
        """Keep the record and the wall timing of one tick."""
        line = record_line(row)
        self._sha256.update(line)
        self.ticks += 1
        self._attempt(lambda: self._records.write(line))
        self._attempt(lambda: self._timings.write(record_line(timing)))

    def event(self, event: str, **fields: Any) -> None:
        """Keep something that happened; ``exc_info=True`` adds the traceback in hand."""
        log = self._logger.error if "exc_info" in fields else self._logger.info
        self._attempt(lambda: log(event, **fields))

    def flush(self) -> None:
        """Hand everything to the system, so that others can follow."""
        for file in (self._packets, self._records, self._timings, self._events):
            self._attempt(file.flush)

    def close(self) -> None:
        """Flush and close; may be called twice."""
        for file in (self._packets, self._records, self._timings, self._events):
            self._attempt(file.close)

    def _attempt(self, write: Callable[[], object]) -> None:
        try:
            write()
        except OSError as error:
            self.problem = self.problem or f"logs in {self.folder} end here: {error.strerror or error}"


def record_line(row: Mapping[str, Any]) -> bytes:
    """One line of ``navigator.jsonl``: compact, keys in the order given, floats as ``repr`` writes them."""
    return json.dumps(row, separators=(",", ":"), default=_plain).encode() + b"\n"


def _plain(value: Any) -> Any:
    """numpy values as Python's; a log line must not end a flight, so anything else as text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
