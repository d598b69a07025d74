"""What may stand in a recipe: the models that a `recipe.toml` is checked by.

A recipe says where in plain tables the parts of a flight are. It is data, not a program: columns, units,
signs, constants, and the few operations named here. `data/recipes/README.md` explains it to its writers.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from wildlab.flight.files import SafeName, Strict, check_model, read_toml
from wildlab.flight.manifest_parts import (
    CameraPart,
    ClocksPart,
    LocationsPart,
    MountPart,
    OriginPart,
    PlatformPart,
    ScoringPart,
    TerrainSays,
    UncertaintyPart,
)
from wildlab.flight.recipe.quantities import (
    Angle,
    Attitude,
    Decimal,
    Gimbal,
    Inertial,
    Length,
    LogTable,
    Magnetometer,
    MatlabTable,
    Pixel,
    Position,
    Ruled,
    Satellite,
    Separator,
    Series,
    Spreads,
    Stamp,
    Velocity,
    Zone,
)
from wildlab.flight.tracking_settings import SensorPart, TargetsPart


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
            raise ValueError(f"{edges} edges make {edges + 1} groups; give as many labels, not {labels}")
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

    either = ((("id",), ("unique",)), ((), ("pan", "tilt")))
    rules = ((lambda s: s.prefix and not s.unique, "a prefix is for unique frames; leave it out"),)


class PixelPart(Strict):
    """To the right and downwards."""

    u: Pixel
    v: Pixel


class Ground(Ruled):
    """How high the ground is at a detection: as down in frame n, or as a height above the ellipsoid, at a
    place (without one: under the camera)."""

    down: Length | None = None
    height: Length | None = None
    latitude: Angle | None = None
    longitude: Angle | None = None

    either = ((("down",), ("height",), ("latitude", "longitude", "height")),)


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

    either = (
        (
            ("pixel",),
            ("position",),
            ("azimuth",),
            ("azimuth", "elevation"),
            ("azimuth", "range"),
            ("azimuth", "elevation", "range"),
        ),
    )
    rules = (
        (
            lambda s: s.counts_from == "bow" and s.azimuth is None,
            "only an azimuth counts from the bow; leave counts_from out",
        ),
        (
            lambda s: s.prefix and s.id is not None,
            "a prefix is for detections without id; leave it out",
        ),
    )

    @property
    def kind(self) -> str:
        (what,) = self.given("pixel", "position", "azimuth")
        return {"azimuth": "bearing" if self.range is None else "range-bearing"}.get(what, what)


class Truth(Series):
    """Where targets really were: `id` names the column, or `target` the one target of the whole file. Without
    a time they are points that never move."""

    id: str | None = None
    target: str | None = None
    time: Stamp | None = None
    position: Position
    sd_horizontal: Length | None = None
    sd_vertical: Length | None = None

    either = ((("id",), ("target",)),)


class Poses(Series):
    """A nav source: by time, or one pose per frame (by the column `frame`, or of this very file).

    `position_from` is for logs of attitude alone: their positions are linear between those of the receiver.
    """

    time: Stamp | None = None
    frame: str | None = None
    position: Position | None = None
    position_from: Literal["gnss"] | None = None
    attitude: Attitude
    velocity: Velocity | None = None
    spreads: Spreads | None = None

    either = ((("position",), ("position_from",)),)
    rules = (
        (
            lambda s: s.position_from and s.time is None,
            "position_from is for poses over time; add the time, or give a position",
        ),
    )


Number = float | str


class RecipeCamera(Strict):
    """As in the manifest; a text instead of a number names a column of `file` that holds one constant."""

    name: str
    file: str | None = None
    separator: Separator = ","
    decimal: Decimal = "."
    width_px: Number
    height_px: Number
    fx_px: Number
    fy_px: Number
    cx_px: Number
    cy_px: Number
    skew_px: Number = 0.0
    k1: Number = 0.0
    k2: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0
    k3: Number = 0.0

    @model_validator(mode="after")
    def _file(self) -> Self:
        if self.columns and self.file is None:
            column = next(iter(self.columns))
            raise ValueError(f"{column} names a column; add its file, or give a number")
        return self

    @property
    def columns(self) -> dict[str, str]:
        """Those of the numbers that stand in a column: name of the number -> name of the column."""
        numbers = [name for name in CameraPart.model_fields if name != "name"]
        return {name: value for name in numbers if isinstance(value := getattr(self, name), str)}


class RecipeTime(Strict):
    """As in the manifest; without an epoch, it is the first whole second. `zone` is of stamps without one."""

    kind: Literal["utc", "sequence"]
    epoch: AwareDatetime | None = None
    zone: Zone | None = None


class RecipeVertical(Ruled):
    """What the heights are, and a constant to take off where a source is wrong.

    `taken_off` names which heights: ``poses``, ``gnss``, ``ground`` (of detections), ``positions``
    (detections that are positions), ``truth``.
    """

    reference: str = "ellipsoid"
    correction_m: float = 0.0
    taken_off: tuple[Literal["poses", "gnss", "ground", "positions", "truth"], ...] = ()
    note: str = ""

    rules = (
        (
            lambda s: s.correction_m and not s.taken_off,
            "taken_off does not say which heights the correction is of; "
            "name some of poses, gnss, ground, positions, truth",
        ),
        (
            lambda s: s.correction_m and not s.note,
            "no note says why there is a correction; add it",
        ),
    )


class Recipe(Strict):
    """The whole of a recipe.

    ``camera = "camera.toml"`` in place of the part names a file of `wildlab camera`, and is kept as
    `camera_file`.
    """

    name: SafeName
    description: str = ""
    locations: LocationsPart = LocationsPart()
    origin: OriginPart | None = None
    platform: PlatformPart
    camera: RecipeCamera | None = None
    camera_file: str | None = None
    mount: MountPart = MountPart()
    time: RecipeTime
    clocks: ClocksPart = ClocksPart()
    vertical: RecipeVertical = RecipeVertical()
    terrain: TerrainSays | None = None
    uncertainty: UncertaintyPart = UncertaintyPart()
    scoring: ScoringPart = ScoringPart()
    sensors: dict[str, SensorPart] = Field(default_factory=dict)
    targets: TargetsPart = TargetsPart()
    files: dict[str, str] = Field(default_factory=dict)
    tables: dict[SafeName, MatlabTable] = Field(default_factory=dict)
    logs: dict[SafeName, LogTable] = Field(default_factory=dict)
    frames: FramesPart | None = None
    poses: dict[SafeName, Poses] = Field(default_factory=dict)
    imu: Inertial | None = None
    gnss: Satellite | None = None
    magnetometer: Magnetometer | None = None
    gimbal: Gimbal | None = None
    detections: tuple[Detections, ...] = ()
    truth: tuple[Truth, ...] = ()

    @property
    def on_board(self) -> dict[str, Inertial | Satellite | Magnetometer | Gimbal]:
        """Those on board, by the names of their tables."""
        every = {"imu": self.imu, "gnss": self.gnss, "magnetometer": self.magnetometer, "gimbal": self.gimbal}
        return {name: one for name, one in every.items() if one is not None}

    @model_validator(mode="before")
    @classmethod
    def _camera_by_name(cls, data: Any) -> Any:
        if isinstance(data, dict) and "camera_file" in data:
            raise ValueError('there is no key camera_file; write camera = "camera.toml"')
        if isinstance(data, dict) and isinstance(data.get("camera"), str):
            rest = {key: value for key, value in data.items() if key != "camera"}
            return {**rest, "camera_file": data["camera"]}
        return data

    @property
    def has_camera(self) -> bool:
        """Whether there is a camera, here or in a file of its own."""
        return self.camera is not None or self.camera_file is not None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for problem in self._contradictions():
            raise ValueError(problem)
        return self

    def _contradictions(self) -> Iterator[str]:
        """Where parts contradict each other: ``"problem; fix"``."""
        frames, truth = self.frames, {f"truth[{i}]": one for i, one in enumerate(self.truth)}
        poses = {f"poses.{name}": one for name, one in self.poses.items()}
        detections = {f"detections[{i}]": one for i, one in enumerate(self.detections)}
        for name in sorted(set(self.tables) & set(self.logs))[:1]:
            yield f"{name!r} names a table and a log; rename one"
        for name, one in poses.items():
            if one.position_from and self.gnss is None:
                yield f"[{name}] takes positions from gnss; add [gnss]"
        if not poses and self.gnss is None:
            yield "there are no poses; add [poses.autopilot], or at least [gnss]"
        images = frames is not None and frames.sensor is None
        if not self.has_camera and (images or any(one.pixel for one in self.detections)):
            yield "there are images, and no camera; add [camera]"
        times = {} if frames is None else {"frames": frames.time}
        over_time: dict[str, Any] = {**self.on_board, **poses, **truth}
        times |= {name: one.time for name, one in over_time.items()}
        if self.time.kind == "utc" and frames is not None and frames.time is None:
            yield '[frames] has no time; add it, or set time.kind = "sequence"'
        for name, time in times.items():
            if self.time.kind == "sequence" and time is not None:
                yield f'[{name}] has a time; set time.kind = "utc"'
            if time is not None and time.format == "elapsed" and self.time.epoch is None:
                yield f"[{name}] counts time from an epoch; add epoch to [time]"
        if frames is not None and (frames.where or frames.changed):
            by_row = [name for name, one in poses.items() if one.frame is None and one.time is None]
            for name in [*by_row, *(name for name, one in detections.items() if one.frame is None)]:
                yield f"rows of [frames] are left out, and [{name}] goes by rows; give it frame"
        if self.mount.poses and self.mount.poses not in self.poses:
            known = ", ".join(sorted(self.poses)) or "none"
            yield f"[mount] is on the poses {self.mount.poses!r}, which are not there; name one of {known}"
        for name, one in poses.items():
            if one.time is not None and one.frame is not None:
                yield f"[{name}] has a time and a frame; take one out"
            of_frames = frames is not None and (one.frame or one.file == frames.file)
            if one.time is None and not of_frames:
                yield f"[{name}] has neither time nor frame; add one of them"
            if one.time is None and one.frame is None and (one.where or one.changed):
                yield f"[{name}] goes by the rows of frames, so none may be left out; give it frame"
            local = one.position is None or one.position.form != "wgs84"
            if one.attitude.yaw_from_bearing is not None and (one.time is not None or local):
                yield f"[{name}] has no frames or no latitude for yaw_from_bearing; give a yaw"
        gnss = {} if self.gnss is None else {"gnss": self.gnss}
        placed: dict[str, Any] = {**poses, **truth, **gnss, **detections}
        for name, each in placed.items():
            if each.position and each.position.form != "wgs84" and self.origin is None:
                yield f"[{name}] has local positions and no origin; add [origin]"


def read_recipe(path: Path) -> Recipe:
    """Read a recipe.

    Parameters
    ----------
    path
        Of the TOML file.

    Returns
    -------
    Recipe

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.

    Examples
    --------
    >>> from wildlab.paths import DATA
    >>> read_recipe(DATA / "recipes" / "openathena.toml").name
    'openathena'
    """
    return check_model(Recipe, read_toml(path, "a recipe"), path)
