"""`flight.toml`: what a flight is, apart from its tables.

Degrees and metres stand in the file, and the names say so; the functions at the end give radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import SafeName, Strict, check_model, dump_toml, parse_toml, read_toml
from wildlab.flight.manifest_parts import (
    CameraPart,
    ClocksPart,
    GnssPart,
    ImuPart,
    LocationsPart,
    MagnetometerPart,
    MountPart,
    OriginPart,
    PlatformPart,
    ScoringPart,
    Sha256,
    SourcePart,
    TerrainPart,
    TimePart,
    TwinPart,
    UncertaintyPart,
    VerticalPart,
)
from wildlab.flight.tracking_settings import SensorPart, TargetsPart
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Origin
from wildlab.geometry.mount import Mount

FILE_NAME = "flight.toml"


class Manifest(Strict):
    """The whole of `flight.toml`."""

    name: SafeName
    kind: Literal["logged", "twin"]
    description: str = ""
    locations: LocationsPart = LocationsPart()
    origin: OriginPart
    platform: PlatformPart
    camera: CameraPart | None = None
    mount: MountPart = MountPart()
    imu: ImuPart = ImuPart()
    gnss: GnssPart = GnssPart()
    magnetometer: MagnetometerPart = MagnetometerPart()
    time: TimePart
    clocks: ClocksPart = ClocksPart()
    vertical: VerticalPart = VerticalPart()
    terrain: TerrainPart | None = None
    uncertainty: UncertaintyPart = UncertaintyPart()
    scoring: ScoringPart = ScoringPart()
    #: What tracking filters are told, see `wildlab.flight.tracking_settings`.
    sensors: dict[str, SensorPart] = Field(default_factory=dict)
    targets: TargetsPart = TargetsPart()
    twin: TwinPart | None = None
    sources: tuple[SourcePart, ...] = ()
    #: Of the tables by file name, see `wildlab.flight.checksums`. A flight in memory has none.
    checksums: dict[str, Sha256] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _twin_is_a_twin(self) -> Manifest:
        if (self.kind == "twin") != (self.twin is not None):
            raise ValueError('kind = "twin" and a part [twin] go together; give both or neither')
        return self

    def geometry_camera(self) -> Camera:
        """The camera, as geometry takes it.

        Raises
        ------
        WildlabError
            Where the flight has none.
        """
        c = self.camera
        if c is None:
            fix = "add [camera] to flight.toml"
            raise WildlabError(f"the flight {self.name} has no camera", fix, field="camera")
        distortion = (c.k1, c.k2, c.p1, c.p2, c.k3)
        return Camera(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.skew_px, distortion)

    def geometry_mount(self, source: str | None = None) -> Mount:
        """The mount, in radians and metres, to be used on the poses of ``source``; None: by itself.

        Raises
        ------
        WildlabError
            Where it belongs to other poses.
        """
        m = self.mount
        if source is not None and m.poses not in ("", source):
            raise WildlabError(
                f"[mount] is of a camera on the poses {m.poses!r}, and those of {source!r} are used",
                f"use --source {m.poses}; or state the mount on {source!r} in [mount], with poses = "
                f'"{source}"',
                field="mount.poses",
            )
        turn = math.radians
        return Mount(
            looks=m.looks,
            pan=turn(m.pan_deg),
            tilt=turn(m.tilt_deg),
            misalignment=(
                turn(m.misalignment_roll_deg),
                turn(m.misalignment_tilt_deg),
                turn(m.misalignment_pan_deg),
            ),
            lever_arm=m.lever_arm_m,
        )

    def origin_tuple(self) -> Origin:
        """Latitude, longitude (radians) and ellipsoidal height (metres) of the origin of frame n."""
        o = self.origin
        return math.radians(o.latitude_deg), math.radians(o.longitude_deg), o.height_m


def make_manifest(data: Mapping[str, Any], path: Path | None = None) -> Manifest:
    """A manifest from nested mappings; `path` is only for messages.

    Parameters
    ----------
    data
        As `flight.toml` has it, read.
    path
        Where it comes from, for messages.

    Returns
    -------
    Manifest

    Raises
    ------
    WildlabError
        Naming the key that is unknown, missing or wrong.

    Examples
    --------
    >>> place = {"latitude_deg": 60.0, "longitude_deg": 10.0, "height_m": 0.0}
    >>> parts = {"origin": place, "platform": {"name": "kite"}, "time": {"kind": "sequence"}}
    >>> manifest = make_manifest({"name": "lake", "kind": "logged"} | parts)
    >>> manifest.locations.sensitivity, manifest.origin
    ('withheld', OriginPart())
    """
    return check_model(Manifest, dict(data), path)


def read_manifest(path: Path) -> Manifest:
    """Read `flight.toml`.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    return make_manifest(read_toml(path, "the manifest of a flight"), path)


def parse_manifest(text: str, path: Path) -> Manifest:
    """The manifest in the text of a `flight.toml`; `path` is only for messages.

    Raises
    ------
    WildlabError
        Where it is not TOML, or a key is unknown, missing or wrong.
    """
    return make_manifest(parse_toml(text, path), path)


def manifest_toml(manifest: Manifest) -> str:
    """The manifest as TOML text, every value written out, defaults too.

    Parameters
    ----------
    manifest
        The manifest.

    Returns
    -------
    str
    """
    data = manifest.model_dump(exclude_none=True)
    return dump_toml({key: value for key, value in data.items() if value not in ((), {})})


def replace_in_manifest(manifest: Manifest, changes: Mapping[str, Mapping[str, Any] | Any]) -> Manifest:
    """A manifest with some values changed: ``replace_in_manifest(m, {"clocks": {"camera_offset_s": 0.2}})``.

    Parameters
    ----------
    manifest
        Is not changed.
    changes
        New values, by part and key.

    Returns
    -------
    Manifest

    Raises
    ------
    WildlabError
        Where a changed key is unknown or its value is wrong.
    """
    data = manifest.model_dump(exclude_none=True)
    for key, value in changes.items():
        if isinstance(value, Mapping) and isinstance(data.get(key), dict):
            data[key] = {**data[key], **value}
        else:
            data[key] = value
    return make_manifest(data)
