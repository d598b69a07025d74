"""What may stand in a recipe about what was seen, and what was really there: frames, detections, truth."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from wildlab.flight.files import Strict
from wildlab.flight.recipe.parts import Angle, Length, Pixel, Position, Stamp
from wildlab.flight.recipe.series import Series


class Group(Strict):
    """Label of the sub-flight: straight from a column, or by where a number lies between edges.

    `clear`: no number may come closer to an edge than this; else the groups are not as separate as thought.
    """

    column: str
    edges: tuple[float, ...] = ()
    labels: tuple[str, ...] = ()
    clear: Annotated[float, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _edges_and_labels(self) -> Self:
        edges, labels = len(self.edges), len(self.labels)
        if (edges or labels) and labels != edges + 1:
            raise ValueError(
                f"{edges} edges make {edges + 1} groups, and there are {labels} labels; "
                "give one label more than edges, or neither"
            )
        if any(b <= a for a, b in zip(self.edges, self.edges[1:], strict=False)):
            raise ValueError("the edges do not increase; put them in order")
        return self


class FramesPart(Series):
    """The images: one per row with its `id`, or one per `unique` combination of columns.

    `sensor` names the column that says which of several sensors looked; such frames need no camera.
    """

    id: str | None = None
    unique: tuple[str, ...] = ()
    prefix: str = ""
    time: Stamp | None = None
    group: Group | None = None
    sensor: str | None = None
    pan: Angle | None = None
    tilt: Angle | None = None

    @model_validator(mode="after")
    def _named(self) -> Self:
        if (self.id is None) == (not self.unique):
            raise ValueError("frames are named by either id or unique; give one of both")
        if self.prefix and not self.unique:
            raise ValueError("a prefix is for frames made by unique; leave it out")
        if (self.pan is None) != (self.tilt is None):
            raise ValueError("a gimbal has both pan and tilt; give both, one as a value if it is fixed")
        return self


class PixelPart(Strict):
    """To the right and downwards."""

    u: Pixel
    v: Pixel


class Ground(Strict):
    """How high the ground is at a detection: as down in frame n, or as a height above the ellipsoid, at a
    place (without one: under the camera)."""

    down: Length | None = None
    height: Length | None = None
    latitude: Angle | None = None
    longitude: Angle | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.down is None) == (self.height is None):
            raise ValueError("the ground has either down or height; give one of both")
        place = self.latitude is not None
        if place != (self.longitude is not None) or (place and self.down is not None):
            raise ValueError("a place is a latitude and a longitude beside a height; give both, or neither")
        return self


class Detections(Series):
    """Detections of one source. One of pixel, position, or azimuth says what was measured; with an elevation
    where the sensor has one, and with a range. `counts_from`: whether the azimuth is zero towards north, or
    ahead of the platform, as of a radar whose picture is head up; it grows clockwise either way."""

    source: str
    id: str | None = None
    prefix: str = ""
    frame: str | None = None
    target: str | None = None
    pixel: PixelPart | None = None
    position: Position | None = None
    azimuth: Angle | None = None
    counts_from: Literal["north", "bow"] = "north"
    elevation: Angle | None = None
    range: Length | None = None
    ground: Ground | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        bearing = self.azimuth is not None
        partly = any(part is not None for part in (self.azimuth, self.elevation, self.range))
        if (self.pixel is not None) + (self.position is not None) + partly != 1 or partly != bearing:
            raise ValueError(
                "a detection is a pixel, a position, or an azimuth with or without elevation and range; "
                "give one of these"
            )
        if self.counts_from == "bow" and not bearing:
            raise ValueError("only an azimuth counts from the bow; leave counts_from out")
        if self.prefix and self.id is not None:
            raise ValueError("a prefix is for detections without an id; leave it out")
        return self

    @property
    def kind(self) -> str:
        if self.pixel is not None:
            return "pixel"
        if self.position is not None:
            return "position"
        return "bearing" if self.range is None else "range-bearing"


class Truth(Series):
    """Where targets really were: `id` names the column, or `target` the one target of the whole file. Without
    a time they are points that never move."""

    id: str | None = None
    target: str | None = None
    time: Stamp | None = None
    position: Position
    sd_horizontal: Length | None = None
    sd_vertical: Length | None = None

    @model_validator(mode="after")
    def _named(self) -> Self:
        if (self.id is None) == (self.target is None):
            raise ValueError("truth is named by either id (a column) or target (one name); give one of both")
        return self
