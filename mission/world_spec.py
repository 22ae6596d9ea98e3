"""What may stand in a world file? Its keys, units and ranges, and the ``World`` that they describe.

Positions are [north, east] in metres, angles in degrees clockwise from north; an obstacle without ``height_m`` is
taller than any flight.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field, Strict, model_validator

from companion.core.types import F64
from mission.strict_yaml import StrictModel
from sitl.world import Mover, World, arc_boxes, wall_box

Real = Annotated[float, Strict()]
Coordinate = Annotated[float, Strict(), Field(ge=-10_000.0, le=10_000.0)]
Place = tuple[Coordinate, Coordinate]  # north, east [m]
Size = Annotated[float, Strict(), Field(gt=0.0, le=1_000.0)]
Thickness = Annotated[float, Strict(), Field(ge=0.02, le=10.0)]
Angle = Annotated[float, Strict(), Field(ge=-360.0, le=360.0)]
Height = Annotated[float, Strict(), Field(gt=0.0, le=200.0)] | None  # above ground; null: taller than any flight


class Bounds(StrictModel):
    """Where the mission takes place: leaving it ends a run; it is no wall."""

    north: tuple[Coordinate, Coordinate]
    east: tuple[Coordinate, Coordinate]

    @model_validator(mode="after")
    def _ordered(self) -> "Bounds":
        if self.north[0] >= self.north[1] or self.east[0] >= self.east[1]:
            raise ValueError("wants north: [min, max] and east: [min, max]")
        return self


class Cylinder(StrictModel):
    """A tree, a post."""

    at: Place
    radius_m: Annotated[float, Strict(), Field(gt=0.0, le=100.0)]
    height_m: Height = None


class Box(StrictModel):
    """A solid box; ``size_m`` is length along its yaw and width across."""

    at: Place
    size_m: tuple[Size, Size]
    yaw_deg: Angle = 0.0
    height_m: Height = None


class _Span(StrictModel):
    between: tuple[Place, Place]

    @model_validator(mode="after")
    def _apart(self) -> "_Span":
        if math.dist(*self.between) < 0.01:
            raise ValueError("between wants two places that are apart")
        return self


class Wall(_Span):
    """A straight wall or fence."""

    thickness_m: Thickness = 0.1
    height_m: Height = None


class Arc(StrictModel):
    """A curved wall: ``radius_m`` from the centre to its middle line, bearings clockwise from north."""

    centre: Place
    radius_m: Size
    from_deg: Angle
    to_deg: Angle
    thickness_m: Thickness = 0.1
    height_m: Height = None

    @model_validator(mode="after")
    def _turns(self) -> "Arc":
        if not 0.0 < self.to_deg - self.from_deg <= 360.0:
            raise ValueError("an arc turns clockwise from from_deg to to_deg, by at most 360")
        if self.thickness_m >= self.radius_m:
            raise ValueError("thickness_m of an arc is below its radius_m")
        return self


class MoverSpec(_Span):
    """A disc that goes to and fro; the seed of a run draws its phase and 60..100 % of its top speed."""

    radius_m: Annotated[float, Strict(), Field(gt=0.0, le=10.0)]
    speed_max_m_s: Annotated[float, Strict(), Field(gt=0.0, le=20.0)]
    speed_m_s: Annotated[float, Strict(), Field(gt=0.0, le=20.0)] | None = None  # null: the top speed
    phase: Annotated[float, Strict(), Field(ge=0.0, lt=1.0)] = 0.0
    height_m: Height = None

    @model_validator(mode="after")
    def _within(self) -> "MoverSpec":
        if self.speed_m_s is not None and self.speed_m_s > self.speed_max_m_s:
            raise ValueError("speed_m_s of a mover is at most its speed_max_m_s")
        return self


class WorldSpec(StrictModel):
    """A world file."""

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9_.-]+$")
    text: str = ""
    start: Place = (0.0, 0.0)
    goal: Place
    bounds: Bounds
    cylinders: tuple[Cylinder, ...] = ()
    boxes: tuple[Box, ...] = ()
    walls: tuple[Wall, ...] = ()
    arcs: tuple[Arc, ...] = ()
    movers: tuple[MoverSpec, ...] = ()


def build(spec: WorldSpec) -> World:
    """The world of a file; walls and arcs become boxes."""
    boxes = [[*b.at, math.radians(b.yaw_deg), b.size_m[0] / 2, b.size_m[1] / 2, _top_m(b.height_m)] for b in spec.boxes]
    boxes += [wall_box(*w.between, w.thickness_m, _top_m(w.height_m)) for w in spec.walls]
    for a in spec.arcs:
        span = (math.radians(a.from_deg), math.radians(a.to_deg))
        boxes += arc_boxes(a.centre, a.radius_m, *span, a.thickness_m, _top_m(a.height_m))
    return World(
        name=spec.name,
        start_ned_m=np.array(spec.start),
        goal_ned_m=np.array(spec.goal),
        bounds_m=(spec.bounds.north[0], spec.bounds.east[0], spec.bounds.north[1], spec.bounds.east[1]),
        circles=_rows([[*c.at, c.radius_m, _top_m(c.height_m)] for c in spec.cylinders], 4),
        boxes=_rows(boxes, 6),
        movers=tuple(_mover(m) for m in spec.movers),
    )


def _mover(spec: MoverSpec) -> Mover:
    speed_m_s = spec.speed_max_m_s if spec.speed_m_s is None else spec.speed_m_s
    return Mover(*spec.between, spec.radius_m, _top_m(spec.height_m), spec.speed_max_m_s, speed_m_s, spec.phase)


def _rows(rows: list[list[float]], columns: int) -> F64:
    return np.array(rows, dtype=np.float64).reshape(len(rows), columns)


def _top_m(height_m: float | None) -> float:
    return math.inf if height_m is None else height_m
