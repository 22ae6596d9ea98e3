"""What did a LiDAR see once? Scans from a file, played into vehicle time: bench tests without a LiDAR.

``.tlog``: the OBSTACLE_DISTANCE messages of a flight log, body frame only. ``.jsonl``: one object a line with ``t_s``,
``range_m`` (null: unknown; beyond ``range_max_m``: free), ``angle_offset_rad``, ``increment_rad``, ``range_min_m`` and
``range_max_m``. The first scan is played when the vehicle is first heard, the others as long after it as they were
taken; then silence, as of a LiDAR that has failed.
"""

import dataclasses
import json
import math
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.mavlink import Connection, PacketParser
from companion.core.tlog import TlogError, read_tlog
from companion.core.transport import Waitable
from companion.core.types import Scan
from companion.link.lidar import LidarError, scan_message
from companion.link.vehicle_clock import VehicleClock

Message = Any  # a MAVLink_*_message object

FIELDS = ("t_s", "range_m", "angle_offset_rad", "increment_rad", "range_min_m", "range_max_m")


class ReplayLidar:
    """Plays a file once, by vehicle time alone."""

    local = True

    def __init__(self, path: Path) -> None:
        """Read the file. Raises LidarError naming it."""
        self.name = f"replay:{path}"
        self._scans = deque(read_scans(path))
        self._recorded_s = self._scans[0].t_s  # of the first scan
        self._began_s: float | None = None  # in vehicle time
        self._newest_s = -math.inf

    def receive(self, clock: VehicleClock) -> list[Message]:
        """The scans that are due by the newest state of the vehicle."""
        if self._began_s is None and math.isfinite(clock.newest_s):
            self._began_s = clock.newest_s
        if self._began_s is None:
            return []
        if clock.newest_s < self._newest_s:  # the vehicle has booted: go on from here
            self._began_s += clock.newest_s - self._newest_s
        self._newest_s = clock.newest_s
        messages = []
        while self._scans and self._due_s(self._began_s) <= clock.newest_s:
            t_s = self._due_s(self._began_s)
            messages.append(scan_message(dataclasses.replace(self._scans.popleft(), t_s=t_s)))
        return messages

    def waits_on(self) -> Sequence[Waitable]:
        """Nothing: the vehicle's own messages move its time on."""
        return ()

    def links(self) -> Sequence[Connection]:
        """None."""
        return ()

    def close(self) -> None:
        """The file was closed when it had been read."""

    def _due_s(self, began_s: float) -> float:
        """Vehicle time of the next scan."""
        return began_s + self._scans[0].t_s - self._recorded_s


def read_scans(path: Path) -> list[Scan]:
    """The scans of a file in order of time. Raises LidarError naming file and place."""
    try:
        found = list(_from_tlog(path) if path.suffix == ".tlog" else _from_json_lines(path))
    except OSError as error:
        raise LidarError(f"{path} cannot be read: {error.strerror or error}") from error
    except (TlogError, ValueError) as error:
        raise LidarError(f"{path}: {error}") from error
    if not found:
        raise LidarError(f"{path} has no scan that could be replayed")
    return sorted(found, key=lambda scan: scan.t_s)


def write_scans(path: Path, scans: Sequence[Scan]) -> None:
    """Write ``.jsonl``. Raises OSError."""
    lines = [json.dumps(_as_json(scan), separators=(",", ":")) for scan in scans]
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _from_tlog(path: Path) -> Iterator[Scan]:
    """Every scan once: LiDAR and autopilot may both have said it."""
    parser = PacketParser()
    heard_s: set[float] = set()
    for _, packet in read_tlog(path):
        for message in parser.feed(packet):
            if message.get_msgId() != mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE or message.frame != mav.MAV_FRAME_BODY_FRD:
                continue
            scan = codec.decode_scan(message)
            if scan.t_s not in heard_s:
                heard_s.add(scan.t_s)
                yield scan


def _from_json_lines(path: Path) -> Iterator[Scan]:
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            yield _from_json(json.loads(line))
        except (TypeError, ValueError, KeyError) as error:
            raise ValueError(f"line {number} is no scan: it wants an object with {', '.join(FIELDS)}") from error


def _from_json(row: dict[str, Any]) -> Scan:
    values = {name: float(row[name]) for name in FIELDS if name != "range_m"}
    range_m = np.array([math.nan if value is None else value for value in row["range_m"]], dtype=np.float64)
    range_m[range_m > values["range_max_m"]] = math.inf
    if len(range_m) == 0 or not all(map(math.isfinite, values.values())) or values["increment_rad"] <= 0.0:
        raise ValueError
    return Scan(range_m=range_m, **values)


def _as_json(scan: Scan) -> dict[str, Any]:
    row: dict[str, Any] = {name: getattr(scan, name) for name in FIELDS}
    free_m = scan.range_max_m + 1.0
    row["range_m"] = [
        None if math.isnan(range_m) else free_m if math.isinf(range_m) else range_m for range_m in scan.range_m.tolist()
    ]
    return row
