"""Where do the key and the timestamps of signed links live? Files; one ring for all links of a process.

The key file holds 64 hexadecimal digits, or a passphrase whose SHA-256 is the key (as MAVProxy, Mission Planner and
QGroundControl make it). Next to it each program keeps its timestamps, written once a second and replaced in one step: a
program that starts again goes on above them, and still knows what it has heard.
"""

import hashlib
import json
import os
import stat
import string
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from companion.core.clock import Clock, SystemClock
from companion.core.signing import KEY_BYTES, TICKS_PER_S, Book, Verdict, judge, ticks

PASSPHRASE_MIN: Final = 8  # characters
SAVE_S: Final = 1.0
MARGIN_TICKS: Final = 2 * TICKS_PER_S  # more than what can go by between two saves


class KeyFileError(ValueError):
    """A key file or its timestamps cannot be used; one line that names the file."""


class Keyring:
    """Key and timestamps of one program."""

    def __init__(self, key_file: Path, program: str, clock: Clock | None = None) -> None:
        """``program`` names the file of timestamps: programs that share a key do not share it. Raises KeyFileError."""
        self.key = read_key(key_file)
        self.clock = clock or SystemClock()
        self._path = key_file.with_name(f"{key_file.name}.{program}")
        self.book = _load(self._path, ticks(self.clock.wall_us()))
        try:
            self._save(clean=False)
        except OSError as error:
            raise KeyFileError(f"timestamps {self._path} cannot be written: {error.strerror or error}") from error
        self._saved_s = self.clock.now_s()

    def link(self, link_id: int, unsigned: frozenset[int]) -> "LinkSigning":
        """What one link needs; ids of ``unsigned`` messages are believed without a signature."""
        return LinkSigning(self, link_id, unsigned)

    def tend(self) -> None:
        """Keep the timestamps when it is time to."""
        if self.clock.now_s() - self._saved_s >= SAVE_S:
            self._saved_s = self.clock.now_s()
            with suppress(OSError):  # a full disk in flight: the margin at the next start is all that is lost
                self._save(clean=False)

    def close(self) -> None:
        """Keep the timestamps, exact ones."""
        with suppress(OSError):
            self._save(clean=True)

    def _save(self, clean: bool) -> None:
        streams = [[*stream, timestamp] for stream, timestamp in self.book.streams.items()]
        heard_as = [[*place, link_id] for place, link_id in self.book.heard_as.items()]
        kept = {"timestamp": self.book.timestamp, "streams": streams, "heard_as": heard_as, "clean": clean}
        beside = self._path.with_name(f"{self._path.name}.{os.getpid()}")
        try:
            beside.write_text(json.dumps(kept) + "\n", encoding="utf-8")
            beside.replace(self._path)
        finally:
            beside.unlink(missing_ok=True)


class LinkSigning:
    """Signs and judges the packets of one link."""

    def __init__(self, ring: Keyring, link_id: int, unsigned: frozenset[int]) -> None:
        self.unsigned = unsigned
        self._ring = ring
        self._link_id = link_id

    def prepare(self, mavlink: Any) -> None:
        """Let a pymavlink ``MAVLink`` sign its next packet."""
        stream = (self._link_id, mavlink.srcSystem, mavlink.srcComponent)
        signing = mavlink.signing
        signing.secret_key, signing.link_id, signing.sign_outgoing = self._ring.key, self._link_id, True
        signing.timestamp = self._ring.book.stamp(stream, self._now())

    def judge(self, packet: bytes) -> Verdict:
        """Judge one whole packet that arrived."""
        return judge(packet, self._ring.key, self._ring.book, self._now(), self._link_id)

    def tend(self) -> None:
        """Keep the timestamps when it is time to."""
        self._ring.tend()

    def close(self) -> None:
        """Keep the timestamps."""
        self._ring.close()

    def _now(self) -> int:
        return ticks(self._ring.clock.wall_us())


def read_key(path: Path) -> bytes:
    """The key that a file holds. Raises KeyFileError."""
    try:
        mode = path.stat().st_mode
        text = path.read_text(encoding="utf-8").strip()
    except OSError as error:
        raise KeyFileError(f"key file {path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise KeyFileError(f"key file {path} is no text: 64 hexadecimal digits or a passphrase are wanted") from error
    if os.name == "posix" and mode & stat.S_IROTH:
        raise KeyFileError(f"key file {path} can be read by everybody: chmod 600 {path}")
    if text and all(letter in string.hexdigits for letter in text):
        if len(text) != 2 * KEY_BYTES:
            raise KeyFileError(f"key file {path} has {len(text)} hexadecimal digits, a key has {2 * KEY_BYTES}")
        return bytes.fromhex(text)
    if len(text) < PASSPHRASE_MIN:
        raise KeyFileError(f"key file {path}: a passphrase of {len(text)} characters, at least {PASSPHRASE_MIN} wanted")
    return hashlib.sha256(text.encode()).digest()


def _load(path: Path, now: int) -> Book:
    """The timestamps of the last run; above what it may have used when it could not say goodbye."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        clean = bool(data["clean"])
        streams = {(int(link), int(system), int(part)): int(last) for link, system, part, last in data["streams"]}
        heard_as = {(int(ours), int(system), int(part)): int(i) for ours, system, part, i in data["heard_as"]}
        book = Book(int(data["timestamp"]), streams, heard_as)
    except FileNotFoundError:
        return Book()
    except OSError as error:
        raise KeyFileError(f"timestamps {path} cannot be read: {error.strerror or error}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise KeyFileError(f"timestamps {path} are damaged: put the file away once you know who changed it") from error
    if clean:
        return book
    streams = {stream: _above(last, now) for stream, last in book.streams.items()}
    return Book(_above(book.timestamp, now), streams, heard_as)


def _above(kept: int, now: int) -> int:
    """At or above everything that was used until the crash, and no further ahead of the clock than needed."""
    return kept + MARGIN_TICKS if now < kept else min(kept + MARGIN_TICKS, now)
