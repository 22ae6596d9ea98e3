"""Which LiDAR does ``--lidar`` name?

``udpin://0.0.0.0:14600`` and the other connection URLs: OBSTACLE_DISTANCE over MAVLink. ``replay:FILE``: a recording.
``lds2d:MODEL:DEVICE[:BAUD]``: a serial LiDAR, for example ``lds2d:LD19:/dev/ttyUSB0``.
"""

from dataclasses import dataclass
from pathlib import Path

from companion.core.url import Url, UrlError, parse_url


@dataclass(frozen=True, slots=True)
class ReplayFile:
    """A recording."""

    path: Path


@dataclass(frozen=True, slots=True)
class SerialModel:
    """A LiDAR on a serial port."""

    model: str
    device: str
    baud: int | None  # None: the model's own


LidarUrl = Url | ReplayFile | SerialModel


def parse_lidar(text: str) -> LidarUrl:
    """Take it apart. Raises UrlError with one line that quotes it."""
    scheme, _, rest = text.strip().partition(":")
    if scheme == "replay":
        if not rest:
            raise UrlError(f"'{text}': replay needs a file, for example replay:flight/companion.tlog")
        return ReplayFile(Path(rest))
    if scheme == "lds2d":
        return _serial(text, rest)
    try:
        return parse_url(text)
    except UrlError as error:
        raise UrlError(f"{error} (or replay:FILE, or lds2d:MODEL:/dev/DEVICE)") from error


def _serial(text: str, rest: str) -> SerialModel:
    model, _, place = rest.partition(":")
    device, _, baud = place.partition(":")
    if not model or not device.startswith("/"):
        raise UrlError(f"'{text}': expected lds2d:MODEL:/dev/DEVICE[:BAUD], for example lds2d:LD19:/dev/ttyUSB0")
    if baud and not (baud.isascii() and baud.isdigit() and int(baud) > 0):
        raise UrlError(f"'{text}': baud rate '{baud}' must be a number above 0")
    return SerialModel(model, device, int(baud) if baud else None)
