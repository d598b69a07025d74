"""Calibrations as files that recipes name: ``camera.toml`` of a camera, ``calibration.toml`` of a flight."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from wildlab.errors import WildlabError, system_error
from wildlab.files import write_atomic
from wildlab.flight.files import Strict, check_model, dump_toml, parse_toml, read_toml
from wildlab.flight.manifest import CameraPart, Manifest, MountPart, Spread

WHAT = "what `wildlab camera` wrote"
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0)]


def _refuse_misfit(covariance: tuple[tuple[float, ...], ...], n: int) -> None:
    if len(covariance) != n or any(len(row) != n for row in covariance):
        raise ValueError(f"the covariance does not fit {n} parameters; give it as many rows and columns")


class BoardPart(Strict):
    """What was photographed: inner corners or circles, and their spacing."""

    pattern: Literal["chessboard", "circles", "staggered circles"]
    columns: Count
    rows: Count
    spacing_m: Annotated[float, Field(gt=0)]


class EvidencePart(Strict):
    """What the estimate rests on: images and those with the board in them, and how well it fits."""

    images: Count
    views: Count
    points: Count
    lens: str
    rms_px: Share
    covered: Annotated[float, Field(ge=0, le=1)]


class ParameterPart(Strict):
    """An estimate with its standard deviation and 95 % interval; pixels, or no unit."""

    name: str
    value: float
    sd: Share
    low: float
    high: float


class ViewPart(Strict):
    """An image with a board: root mean squared distance of its points from where they should be."""

    name: str
    rms_px: Share
    inverted: bool


class CameraFile(Strict):
    """The whole file. ``covariance`` is that of the parameters, in their order and units; one that is written
    by hand has ``[camera]`` alone."""

    format: Literal[1] = 1
    camera: CameraPart
    board: BoardPart | None = None
    evidence: EvidencePart | None = None
    covariance: tuple[tuple[float, ...], ...] = ()
    parameter: tuple[ParameterPart, ...] = ()
    view: tuple[ViewPart, ...] = ()

    @model_validator(mode="after")
    def _fits(self) -> CameraFile:
        _refuse_misfit(self.covariance, len(self.parameter))
        return self


def read_camera(path: Path) -> CameraFile:
    """Read a ``camera.toml``.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(CameraFile, read_toml(path, WHAT), path)


#: Focal lengths and principal points that differ by no more than this share of the focal length are the same.
SAME_CAMERA = 1e-3
#: Zones are whole quarters of an hour, s; offsets that differ by less than the second are the same.
ZONE_S, SAME_CLOCK_S = 900.0, 1e-4
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
#: Units of the parameters, by name; the file is for people, so angles are in degrees and shares in percent.
UNITS: dict[str, str] = {
    "roll": "deg", "tilt": "deg", "pan": "deg", "heading": "deg", "clock": "s",
    "down": "m", "north": "m", "east": "m", "focal": "%", "aspect": "%", "centre_u": "px", "centre_v": "px",
    "radial": "1",
}  # fmt: skip


class LearntOn(Strict):
    """Which flight, told again by a hash of its clicks and poses, how much of it, and the offset of the
    camera's clock that it stated, which a correction of the clock is on top of."""

    flight: str
    source: str
    fingerprint: Sha256
    images: Annotated[int, Field(gt=0)]
    points: Annotated[int, Field(gt=0)]
    blocks: Annotated[int, Field(gt=0)]
    camera_offset_s: float = 0.0


class Conditions(Strict):
    """Under which it was learnt: least and greatest."""

    height_m: tuple[float, float]
    depression_deg: tuple[float, float]


class LearntGain(Strict):
    """Mean error on images that it was not estimated from, without and with it; the gain, low and high."""

    without_m: float
    with_m: float
    gain_m: float
    low_m: float
    high_m: float


class LearntParameter(Strict):
    """A correction, to be added, with its 95 % interval."""

    name: str
    value: float
    low: float
    high: float
    unit: str

    @model_validator(mode="after")
    def _known(self) -> LearntParameter:
        if UNITS.get(self.name) != self.unit:
            known = ", ".join(f"{name} ({unit})" for name, unit in UNITS.items())
            raise ValueError(f"there is no parameter {self.name!r} in {self.unit!r}; use one of: {known}")
        return self


class LearntNoise(Strict):
    """Standard deviations of poses and pixels, learnt with the corrections taken off."""

    pixel_px: Spread
    position_horizontal_m: Spread
    position_vertical_m: Spread
    tilt_deg: Spread
    heading_deg: Spread


class Learnt(Strict):
    """The whole file. ``covariance`` is that of the parameters, in their order and units."""

    format: Literal[1] = 1
    learnt_on: LearntOn
    conditions: Conditions
    camera: CameraPart
    mount: MountPart
    noise: LearntNoise
    gain: LearntGain | None = None
    covariance: tuple[tuple[float, ...], ...] = ()
    parameter: tuple[LearntParameter, ...] = ()

    @model_validator(mode="after")
    def _fits(self) -> Learnt:
        _refuse_misfit(self.covariance, len(self.parameter))
        if len({one.name for one in self.parameter}) != len(self.parameter):
            raise ValueError("a parameter stands there twice; take one out")
        return self


def read_learnt(path: Path) -> Learnt:
    """Read a ``calibration.toml``.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(Learnt, read_toml(path, "what `wildlab calibrate` wrote"), path)


def parse_learnt(text: str) -> Learnt:
    """The same from its text, as a notebook is given it.

    Raises
    ------
    WildlabError
        Where it is not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(Learnt, parse_toml(text, Path("calibration.toml")), None)


def calibration_toml(calibration: CameraFile | Learnt) -> str:
    """The file's text."""
    return dump_toml(calibration.model_dump(exclude_none=True))


def write_calibration(calibration: CameraFile | Learnt, path: Path) -> None:
    """Write a ``camera.toml`` or a ``calibration.toml``, whole or not at all.

    Raises
    ------
    WildlabError
        Where it cannot be written.
    """
    try:
        write_atomic(path, calibration_toml(calibration))
    except OSError as error:
        raise system_error(error, path) from None


def without_own_clock(manifest: Manifest, learnt: Learnt) -> Learnt:
    """A calibration less its clock where a flight's own is set, or is stated to be off by another amount than
    where it was learnt: what a flight states was found on itself. Zones are no such offset."""
    apart = manifest.clocks.camera_offset_s - learnt.learnt_on.camera_offset_s
    own = manifest.clocks.camera_set or abs(beside_zone(apart)) >= SAME_CLOCK_S
    kept = [i for i, one in enumerate(learnt.parameter) if one.name != "clock"]
    if not own or len(kept) == len(learnt.parameter):
        return learnt
    covariance = np.array(learnt.covariance)[np.ix_(kept, kept)].tolist()
    update = {"parameter": tuple(learnt.parameter[i] for i in kept), "covariance": covariance}
    return learnt.model_copy(update=update)


def beside_zone(offset_s: float) -> float:
    """What an offset of a clock has beside whole quarters of an hour, of which zones are made, s."""
    return math.remainder(offset_s, ZONE_S)


def refuse_other_camera(manifest: Manifest, learnt: Learnt) -> None:
    """Refuse a calibration that belongs to another camera, or to one that sits in another way.

    Raises
    ------
    WildlabError
        Which part differs, and how.
    """
    here, there = manifest.camera, learnt.camera
    fix = "learn one with this camera: wildlab calibrate"
    if here is None:
        raise WildlabError("this flight has no camera for the calibration", "leave it out")
    for name in CameraPart.model_fields:
        one, other = getattr(here, name), getattr(there, name)
        if name == "name":
            continue
        pixels = here.fx_px if name in ("fx_px", "fy_px", "cx_px", "cy_px", "skew_px") else 0.0
        if abs(one - other) > SAME_CAMERA * max(abs(other), pixels):
            raise WildlabError(
                f"the calibration was learnt with another camera: {name} is {other:g} there and {one:g} here",
                fix,
            )
    for name in MountPart.model_fields:
        one, other = getattr(manifest.mount, name), getattr(learnt.mount, name)
        if name == "poses" and "" in (one, other):
            continue  # a flight with poses of one kind need not say whose its mount is
        same = one == other if isinstance(one, str) else np.allclose(one, other, atol=1e-6)
        if not same:
            raise WildlabError(
                f"the calibration was learnt with another mount: {name} is {other} there and {one} here",
                "give both the same [mount], or learn one with this",
            )
