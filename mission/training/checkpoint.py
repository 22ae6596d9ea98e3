"""How does a run survive kill -9, a full disk and a damaged file?  Checkpoints: whole, hashed, written in one move.

A checkpoint is ``NAME.pt`` with ``NAME.pt.sha256`` beside it. Both are written to a temporary name, synced and renamed,
data first; so a file without its hash is a save that was cut off, and the checkpoint before it counts. Pickle is not
trusted: files are read with ``weights_only``.
"""

import hashlib
import io
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mission.errors import FlightError

KEPT = 2  # checkpoints that stay on disk
NAME = re.compile(r"checkpoint-(\d+)\.pt")
ARRAY = "__ndarray__"  # marks a NumPy array that travels as a tensor

State = dict[str, Any]  # nested dicts and lists of numbers, texts, tensors and arrays


@dataclass(frozen=True, slots=True)
class Loaded:
    """The newest good checkpoint, and what was wrong with newer ones."""

    episode: int
    state: State
    refused: tuple[str, ...]  # one line each


def save(folder: Path, episode: int, state: State) -> Path:
    """Write the state after ``episode``, drop all but the newest ``KEPT``. Raises FlightError; older ones survive."""
    path = folder / f"checkpoint-{episode:06d}.pt"
    buffer = io.BytesIO()
    torch.save(_packed(state), buffer)
    data = buffer.getvalue()
    try:
        write_whole(path, data)
        write_whole(_hash_file(path), f"{hashlib.sha256(data).hexdigest()}  {path.name}\n".encode())
    except OSError as error:
        path.unlink(missing_ok=True)
        last = _numbered(folder)
        kept = f"the one of episode {last[-1][0]} is whole" if last else "there is none before it"
        raise FlightError(f"checkpoint {path}: {error.strerror or error}; {kept}") from error
    for _, old in _numbered(folder)[:-KEPT]:
        _hash_file(old).unlink(missing_ok=True)
        old.unlink(missing_ok=True)
    return path


def load_newest(folder: Path) -> Loaded | None:
    """The newest checkpoint that is whole; None where none was ever finished. Raises FlightError if all are damaged."""
    refused: list[str] = []
    for episode, path in reversed(_numbered(folder)):
        if not _hash_file(path).is_file():
            continue  # cut off while it was saved
        trouble = damage(path)
        if trouble is None:
            return Loaded(episode, read(path), tuple(refused))
        refused.append(trouble)
    if refused:
        raise FlightError("; ".join(refused) + "; no good checkpoint is left")
    return None


def damage(path: Path) -> str | None:
    """One line about what is wrong with the file; None when it matches its hash."""
    try:
        data, expected = path.read_bytes(), _hash_file(path).read_text(encoding="ascii").split()[:1]
    except (OSError, UnicodeDecodeError) as error:
        return f"checkpoint {path}: {error}"
    if expected != [hashlib.sha256(data).hexdigest()]:
        return f"checkpoint {path}: truncated or changed, its sha256 does not match {_hash_file(path).name}"
    return None


def read(path: Path) -> State:
    """The state in a checkpoint whose hash was looked at."""
    state: State = _unpacked(torch.load(path, map_location="cpu", weights_only=True))
    return state


def fingerprint(value: Any) -> str:
    """One sha256 over a nested state, bit for bit: equal only where every number in it is."""
    digest = hashlib.sha256()
    _feed(digest, _packed(value))
    return digest.hexdigest()


def write_whole(path: Path, data: bytes) -> None:
    """Either all of ``data`` is in ``path`` afterwards, or what was there before. Raises OSError."""
    temporary = path.with_name(f".{path.name}.part")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """The rename itself onto the disk, where folders can be opened."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _feed(digest: "hashlib._Hash", value: Any) -> None:
    if isinstance(value, dict):
        for key in sorted(value, key=str):
            digest.update(repr(key).encode())
            _feed(digest, value[key])
    elif isinstance(value, list | tuple):
        for item in value:
            _feed(digest, item)
    elif isinstance(value, torch.Tensor):
        data = value.detach().cpu().contiguous().numpy()
        digest.update(f"{data.dtype}{data.shape}".encode())
        digest.update(data.tobytes())
    else:
        digest.update(repr(value).encode())


def _hash_file(path: Path) -> Path:
    return path.with_name(path.name + ".sha256")


def _numbered(folder: Path) -> list[tuple[int, Path]]:
    """(episode, file), oldest first."""
    found = ((NAME.fullmatch(path.name), path) for path in folder.glob("checkpoint-*.pt"))
    return sorted((int(match.group(1)), path) for match, path in found if match)


def _packed(value: Any) -> Any:
    """Arrays as tensors, which can be read back without trusting pickle."""
    if isinstance(value, dict):
        return {key: _packed(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_packed(item) for item in value)
    if isinstance(value, np.ndarray):
        return {ARRAY: torch.from_numpy(np.ascontiguousarray(value).copy())}
    return value.item() if isinstance(value, np.generic) else value


def _unpacked(value: Any) -> Any:
    if isinstance(value, dict):
        if set(value) == {ARRAY}:
            return value[ARRAY].numpy()
        return {key: _unpacked(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(_unpacked(item) for item in value)
    return value
