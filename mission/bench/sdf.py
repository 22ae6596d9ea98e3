"""Which obstacles stand in a Gazebo world file? SDF 1.x in, upright circles and boxes out; world ned (x east, y north).

Reads cylinders, spheres and boxes of static models; planes are the ground. What cannot be turned into an upright
obstacle, a mesh above all, is refused by name: a world with a hole in it would be another world.
"""

import math
import xml.etree.ElementTree as ElementTree  # standard library: the files are the user's own
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from companion.core.types import F64
from mission.world_check import WorldError

UPRIGHT_RAD = 1e-3  # roll and pitch up to this are rounding
IGNORED = ("plane", "empty")
Pose = tuple[float, float, float, float]  # x, y, z [m], yaw [rad]
ORIGIN: Pose = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Obstacles:
    """Rows of ``World.circles`` and ``World.boxes``; all taller than any flight."""

    circles: F64  # (n, 4)
    boxes: F64  # (b, 6)


def read_sdf(path: Path) -> Obstacles:
    """The obstacles of a world file. Raises WorldError naming the file and what is wrong with it."""
    try:
        root = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise WorldError(f"{path.name}: {error.strerror}") from error
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise WorldError(f"{path.name} is no SDF: {error}") from error
    world = root if root.tag == "world" else root.find("world")
    if root.tag not in ("sdf", "gazebo", "world") or world is None:
        raise WorldError(f"{path.name} is no SDF: no <world> in <{root.tag}>")
    included = world.find("include")
    if included is not None:
        uri = included.findtext("uri", "?").strip()
        raise WorldError(f"{path.name}: <include> of '{uri}': only what stands in the file itself is read")
    circles: list[list[float]] = []
    boxes: list[list[float]] = []
    for model in world.iter("model"):
        if _within_state(world, model):
            continue
        _add_model(model, path.name, circles, boxes)
    return Obstacles(np.array(circles).reshape(-1, 4), np.array(boxes).reshape(-1, 6))


def _within_state(world: ElementTree.Element, model: ElementTree.Element) -> bool:
    """<state> repeats the models as poses, without geometry."""
    return model.find(".//collision") is None and all(child is not model for child in world.findall("model"))


def _add_model(model: ElementTree.Element, file: str, circles: list[list[float]], boxes: list[list[float]]) -> None:
    name = model.get("name", "?")
    at = _pose(model, f"{file}: model '{name}'")
    for link in model.findall("link"):
        link_at = _onto(at, _pose(link, f"{file}: model '{name}'"))
        for collision in link.findall("collision"):
            here = _onto(link_at, _pose(collision, f"{file}: model '{name}'"))
            _add_shape(collision, here, f"{file}: model '{name}'", circles, boxes)


def _add_shape(
    collision: ElementTree.Element, at: Pose, where: str, circles: list[list[float]], boxes: list[list[float]]
) -> None:
    geometry = collision.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    if shape is None or shape.tag in IGNORED:
        return
    x, y, _, yaw = at
    if shape.tag in ("cylinder", "sphere"):
        circles.append([y, x, _number(shape, "radius", where), math.inf])
    elif shape.tag == "box":
        length, width, _ = _numbers(shape.findtext("size"), 3, where, "size")
        boxes.append([y, x, math.pi / 2 - yaw, length / 2, width / 2, math.inf])
    else:
        uri = shape.findtext("uri", "").strip()
        raise WorldError(
            f"{where} is a <{shape.tag}>{f' ({uri})' if uri else ''}: only cylinder, sphere and box are read"
        )


def _pose(element: ElementTree.Element, where: str) -> Pose:
    text = element.findtext("pose")
    if text is None:
        return ORIGIN
    x, y, z, roll, pitch, yaw = _numbers(text, 6, where, "pose")
    if max(abs(roll), abs(pitch)) > UPRIGHT_RAD:
        raise WorldError(f"{where} is tilted (roll {roll:g}, pitch {pitch:g}): only upright obstacles are read")
    return (x, y, z, yaw)


def _onto(base: Pose, relative: Pose) -> Pose:
    cos, sin = math.cos(base[3]), math.sin(base[3])
    x, y, z, yaw = relative
    return (base[0] + cos * x - sin * y, base[1] + sin * x + cos * y, base[2] + z, base[3] + yaw)


def _number(shape: ElementTree.Element, key: str, where: str) -> float:
    value = _numbers(shape.findtext(key), 1, where, key)[0]
    if value <= 0.0:
        raise WorldError(f"{where}: {key} {value:g} is not above 0")
    return value


def _numbers(text: str | None, count: int, where: str, key: str) -> list[float]:
    try:
        values = [float(word) for word in (text or "").split()]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise WorldError(f"{where}: {key} wants {count} numbers, got '{(text or '').strip()}'")
    return values
