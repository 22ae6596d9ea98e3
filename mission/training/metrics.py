"""What happened in training, row by row?  JSON lines and TensorBoard, each row once, however often a run is resumed.

The JSON lines are the truth: a checkpoint remembers how long each file was, a resumed run cuts it back to that, and the
TensorBoard files are written anew from the rows that are left.
"""

import json
import os
from pathlib import Path
from typing import Any, BinaryIO

from torch.utils.tensorboard import SummaryWriter

from companion.core.params import nearest
from mission.errors import FlightError
from mission.flight_log import read_rows

FILES = ("episodes", "updates", "evaluations", "tracks")
BOARD = ("episodes", "updates", "evaluations")  # numbers only
STEP = "episode"  # the key that TensorBoard takes as its abscissa

Row = dict[str, Any]


class Metrics:
    """Row files of one seed, open for appending."""

    def __init__(self, folder: Path, sizes: dict[str, int] | None = None) -> None:
        """``sizes`` in bytes, as ``flush`` gave them to a checkpoint; None: begin anew. Raises FlightError."""
        self._files: dict[str, BinaryIO] = {}
        for name in FILES:
            path = rows_file(folder, name)
            path.touch()
            size = (sizes or {}).get(name, 0)
            if path.stat().st_size < size:
                raise FlightError(f"{path} is shorter than when the checkpoint was written")
            os.truncate(path, size)
            self._files[name] = path.open("ab")
        board = folder / "tensorboard"
        for old in board.glob("events.*"):
            old.unlink()
        self._board = SummaryWriter(str(board))
        for name in BOARD:
            for row in read_rows(rows_file(folder, name)):
                self._show(name, row)

    def add(self, name: str, row: Row) -> None:
        """One row into ``NAME.jsonl`` and its numbers onto the board."""
        if name not in FILES:
            raise ValueError(f"unknown rows '{name}'{nearest(name, list(FILES))}")
        self._files[name].write(json.dumps(row, separators=(",", ":")).encode() + b"\n")
        self._files[name].flush()
        if name in BOARD:
            self._show(name, row)

    def flush(self) -> dict[str, int]:
        """Everything onto the disk; how long each file is now, for the checkpoint."""
        for file in self._files.values():
            file.flush()
            os.fsync(file.fileno())
        self._board.flush()
        return {name: file.tell() for name, file in self._files.items()}

    def close(self) -> None:
        """No more rows."""
        for file in self._files.values():
            file.close()
        self._board.close()

    def _show(self, name: str, row: Row) -> None:
        for key, value in _numbers("", row):
            if key != STEP:
                self._board.add_scalar(f"{name}/{key}", value, row[STEP])


def rows_file(folder: Path, name: str) -> Path:
    """Where the rows of that name lie."""
    return folder / f"{name}.jsonl"


def _numbers(prefix: str, row: Row) -> list[tuple[str, float]]:
    """Every number in a row, nested names joined by a dot; truth values count as 0 and 1."""
    found: list[tuple[str, float]] = []
    for key, value in row.items():
        if isinstance(value, dict):
            found += _numbers(f"{prefix}{key}.", value)
        elif isinstance(value, int | float):
            found.append((f"{prefix}{key}", float(value)))
    return found
