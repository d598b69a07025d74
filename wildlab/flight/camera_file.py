"""A calibrated camera as a file that recipes name: ``camera.toml``, checked like any file of a stranger."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.files import Strict, check_model, parse_toml, read_toml
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.toml import dump_toml

WHAT = "what `wildlab camera` wrote"
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0)]


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
    """The whole file. ``covariance`` is that of the parameters, in their order and units."""

    format: Literal[1] = 1
    camera: CameraPart
    board: BoardPart
    evidence: EvidencePart
    covariance: tuple[tuple[float, ...], ...] = ()
    parameter: tuple[ParameterPart, ...] = ()
    view: tuple[ViewPart, ...] = ()

    @model_validator(mode="after")
    def _fits(self) -> CameraFile:
        n = len(self.parameter)
        if len(self.covariance) != n or any(len(row) != n for row in self.covariance):
            raise ValueError(
                f"the covariance does not fit the {n} parameters; give a row and a column for each of them"
            )
        return self


def read_camera(path: Path) -> CameraFile:
    """Read a ``camera.toml``.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(CameraFile, read_toml(path, WHAT), path)


def parse_camera(text: str, path: Path) -> CameraFile:
    """The same from its text; `path` is only for messages.

    Raises
    ------
    WildlabError
        Where it is not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(CameraFile, parse_toml(text, path), path)


def write_camera(camera: CameraFile, path: Path) -> None:
    """Write a ``camera.toml``, whole or not at all.

    Raises
    ------
    WildlabError
        Where it cannot be written.
    """
    try:
        write_atomic(path, dump_toml(camera.model_dump(exclude_none=True)))
    except OSError as error:
        fix = "name a file in a folder that is there and may be written to"
        raise WildlabError(f"cannot be written ({error.strerror})", fix, file=path) from None
