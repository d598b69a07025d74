"""What a user says of an elevation map, and what a flight keeps on record of it."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from wildlab.flight.files import Strict, leaves_folder

#: Metres by the names of units that a user may state.
UNITS = {"m": 1.0, "ft": 0.3048, "us-ft": 1200 / 3937}

Metres = Annotated[float, Field(gt=0, le=1e6)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class TerrainSays(Strict):
    """The part ``[terrain]`` of a recipe, or the options of the command: the map, and what it does not say.

    Attributes
    ----------
    file
        GeoTIFF, or the 8-bit PNG of F (6.1); a recipe's is below the source folder.
    heights
        What its heights count from: ``ellipsoid``; ``flight``, the same as those that the flight recorded; or
        how many metres the geoid is above the ellipsoid there. Needed unless its CRS says so.
    crs
        Of a file that states none, ``EPSG:32633`` for instance.
    unit
        Of its heights; left out, what the file says, else metres.
    nodata
        A value that stands for a hole and that the file does not declare.
    sd_m
        Standard deviation of its heights, metres.
    step_m, margin_m
        Of the grid in n, and how far it reaches beyond the flight, metres; left out, by the map's cells and
        by the height above ground.
    cell_m, corner
        Of a PNG: the side of a pixel, and easting and northing of its upper left corner, in `crs`.
    """

    file: str
    heights: Literal["ellipsoid", "flight"] | float | None = None
    crs: str | None = None
    unit: Literal["m", "ft", "us-ft"] | None = None
    nodata: float | None = None
    sd_m: Metres | None = None
    step_m: Metres | None = None
    margin_m: Metres | None = None
    cell_m: Metres | None = None
    corner: tuple[float, float] | None = None

    @field_validator("heights")
    @classmethod
    def _geoid(cls, value: str | float | None) -> str | float | None:
        if isinstance(value, float) and abs(value) > 200:
            raise ValueError(
                f"a geoid {value:g} m above the ellipsoid; give its height there, which is between -110 "
                "and 90 m on Earth"
            )
        return value

    @model_validator(mode="after")
    def _picture(self) -> Self:
        if (self.cell_m is None) != (self.corner is None):
            raise ValueError("cell_m and corner belong together; give both, or none for a GeoTIFF")
        return self


class TerrainPart(Strict):
    """What `flight.toml` says of ``terrain.tif``: which map it comes from, and what was done with it.

    Attributes
    ----------
    source, sha256
        The map, by its name, and its digest.
    crs, heights, added_m
        The map's reference, what its heights count from, and what was added for heights above the ellipsoid.
    unit
        Of the map's heights, as it was taken.
    cell_m, averaged
        Its cell's sides, metres, and how many cells a side were averaged.
    step_m, rows, columns, holes
        Of the grid in n; nodes without a height.
    error_rms_m, error_max_m
        How far the grid lies from the map's own nodes: resampling.
    sd_m
        Standard deviation of the map's heights, where it was stated.
    """

    source: str
    sha256: Sha256
    crs: str
    heights: Literal["ellipsoid", "flight", "geoid"]
    added_m: float
    unit: str
    cell_m: tuple[Metres, Metres]
    averaged: Annotated[int, Field(ge=1)] = 1
    step_m: Metres
    rows: Annotated[int, Field(ge=2)]
    columns: Annotated[int, Field(ge=2)]
    holes: Annotated[int, Field(ge=0)]
    error_rms_m: Annotated[float, Field(ge=0)]
    error_max_m: Annotated[float, Field(ge=0)]
    sd_m: Metres | None = None

    @field_validator("source")
    @classmethod
    def _stays(cls, value: str) -> str:
        if leaves_folder(value):
            raise ValueError(f"the path {value!r} leaves its folder; give the name of the map alone")
        return value
