"""Elevation maps as files: GeoTIFF, and the 8-bit PNG of F (6.1). Only what is asked for is read of them."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.files import sha256
from wildlab.flight.files import gdal, printable, regular_size
from wildlab.flight.manifest import UNITS, TerrainSays
from wildlab.geometry.frames import Indices

if TYPE_CHECKING:
    from pyproj import CRS
    from rasterio import Affine

Heights = NDArray[np.float32]

#: Metres above the sea: the Dead Sea's shore lies at -430, mount Everest at 8849.
LOWEST, HIGHEST = -500.0, 9000.0
#: Of one block of the file (a tile, a strip) in memory, bytes: GDAL reads no less than that at once.
LARGEST_BLOCK = 256_000_000
#: Cells a side that are believed.
LARGEST_SIDE = 500_000
#: Of cells that are read at once.
STRIP = 4_000_000
#: F (6.1): a grey level is 0.2 m, black is 71 m.
GREY_M, BLACK_M = 0.2, 71.0
#: Words of a band's unit, lower case, and the metres of each.
_WORDS = {
    "m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0,
    "ft": UNITS["ft"], "foot": UNITS["ft"], "feet": UNITS["ft"],
    "us survey foot": UNITS["us-ft"], "us-ft": UNITS["us-ft"], "ftus": UNITS["us-ft"],
    "us_survey_foot": UNITS["us-ft"], "foot_us": UNITS["us-ft"], "us survey feet": UNITS["us-ft"],
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ElevationMap:
    """An elevation map that can be read, and what it says of itself.

    Attributes
    ----------
    path, digest
        The file and its SHA-256.
    crs
        Horizontal.
    vertical
        What its heights count from, as its CRS says: ``"ellipsoid"``, the name of a vertical CRS, or nothing.
    whole
        The CRS with its vertical part, where it has one.
    transform
        From column and row, counted from the corner of the first cell, to the CRS.
    shape
        Rows and columns.
    factor, unit
        Metres of one unit of height, and the unit's name.
    scale, offset
        A height in its unit is ``scale * value + offset``.
    nodata
        Stands for a hole where the file does not declare it.
    """

    path: Path
    digest: str
    crs: CRS
    vertical: str
    whole: CRS
    transform: Affine
    shape: tuple[int, int]
    factor: float
    unit: str
    scale: float
    offset: float
    nodata: float | None

    @contextlib.contextmanager
    def opened(self) -> Iterator[Any]:
        """The file, for `read`."""
        with gdal(), _dataset(self.path) as data:
            yield data

    def read(self, data: Any, row: int, column: int, rows: int, columns: int) -> Heights:
        """Heights of a window in metres, NaN in holes.

        Raises
        ------
        WildlabError
            Where the file is cut off or damaged there.
        """
        from rasterio.windows import Window

        try:
            found = data.read(1, window=Window(column, row, columns, rows), masked=True)
        except Exception as error:  # rasterio's errors share no base but Exception
            raise _damaged(self.path, error) from None
        values = np.ma.getdata(found)
        hole = np.ma.getmaskarray(found).copy()
        if self.nodata is not None:
            # A value as the file would round it; one that its whole numbers cannot hold is in none of them.
            hole |= values == (np.float32(self.nodata) if values.dtype == np.float32 else self.nodata)
        heights: Heights = (values.astype(float) * self.scale + self.offset).astype(np.float32)
        heights *= np.float32(self.factor)
        hole |= ~np.isfinite(heights)
        heights[hole] = np.nan
        return heights

    def window(
        self, row: int, column: int, rows: int, columns: int, every: int
    ) -> tuple[Heights, Indices, Heights]:
        """Heights of a window, cells averaged ``every`` by ``every``, and some of the cells themselves.

        Parameters
        ----------
        row, column, rows, columns
            The window; its sides are multiples of ``every``.
        every
            1 for the cells as they are. A hole is where fewer than half of the cells have a height.

        Returns
        -------
        heights
            (rows / every, columns / every) metres.
        cells
            (K, 2) rows and columns in the file, of cells all over the window.
        values
            (K,) metres, their heights.

        Raises
        ------
        WildlabError
            Where the file is cut off or damaged there, or a height is absurd.
        """
        out = np.empty((rows // every, columns // every), np.float32)
        cells, values = [], []
        at_once = max(1, STRIP // columns // every) * every
        rng = np.random.default_rng(0)
        with self.opened() as data:
            for first in range(0, rows, at_once):
                n = min(at_once, rows - first)
                strip = self.read(data, row + first, column, n, columns)
                self.refuse_absurd(strip)
                k = max(1, int(SAMPLES * n / rows))
                i, j = rng.integers(0, n, k), rng.integers(0, columns, k)
                cells.append(np.column_stack([i + row + first, j + column]))
                values.append(strip[i, j])
                if every > 1:
                    strip = _averaged(strip, every)
                out[first // every : first // every + len(strip)] = strip
        return out, np.concatenate(cells), np.concatenate(values)

    def refuse_absurd(self, heights: Heights) -> None:
        """Refuse heights that no land on Earth has.

        Raises
        ------
        WildlabError
            Naming one of them.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a strip of holes
            low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
        if low < LOWEST or high > HIGHEST:
            found = low if low < LOWEST else high
            raise WildlabError(
                f"has heights of {found:g} m, and on Earth land lies between {LOWEST:g} and {HIGHEST:g} m",
                "state it as nodata, or check the unit of heights",
                file=self.path,
                field="terrain.nodata",
            )


#: Cells that are kept to be compared with.
SAMPLES = 20_000


def open_elevation(path: Path, says: TerrainSays) -> ElevationMap:
    """Look at an elevation map without reading its heights.

    Parameters
    ----------
    path
        Of a GeoTIFF or PNG.
    says
        What the user says of it.

    Returns
    -------
    ElevationMap

    Raises
    ------
    WildlabError
        Where it is no such file, has several bands or no CRS, claims more than can be, or contradicts what is
        said of it.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        regular_size(path)
    except FileNotFoundError:
        raise WildlabError("there is no such file", "check the path of the map", file=path) from None
    with gdal(), _dataset(path) as data:
        picture = data.driver == "PNG"
        _refuse_layout(data, path)
        stated = says.crs if says.crs is not None else (data.crs.to_wkt() if data.crs else None)
        if stated is None:
            raise WildlabError(
                "states no CRS",
                "name it as crs, EPSG:32633 for instance",
                file=path,
                field="terrain.crs",
            )
        try:
            whole = CRS.from_user_input(stated)
        except CRSError:
            raise WildlabError(
                f"the CRS {printable(str(stated))[:60]} is not known to PROJ",
                "give an EPSG code, EPSG:32633 for instance",
                file=path,
                field="terrain.crs",
            ) from None
        if says.crs is not None and data.crs:
            _refuse_other_crs(CRS.from_wkt(data.crs.to_wkt()), whole, path)
        transform = _placed(data, says, path, picture)
        factor, unit = _unit(data, whole, says, path)
        scale, offset = (float(data.scales[0]), float(data.offsets[0]))
        if picture:
            scale, offset = GREY_M, BLACK_M
        shape = (int(data.height), int(data.width))
    horizontal, vertical = _split(whole, path)
    return ElevationMap(
        path=path,
        digest=sha256(path),
        crs=horizontal,
        vertical=vertical,
        whole=whole,
        transform=transform,
        shape=shape,
        factor=factor,
        unit=unit,
        scale=scale,
        offset=offset,
        nodata=says.nodata,
    )


@contextlib.contextmanager
def _dataset(path: Path) -> Iterator[Any]:
    import rasterio
    from rasterio.errors import RasterioError

    try:
        # No other drivers: some of them follow what a file says to other files and to the network.
        data = rasterio.open(path, driver=_driver(path))
    except (RasterioError, ValueError) as error:
        raise WildlabError(
            f"cannot be read as GeoTIFF or PNG ({_first_line(error)})",
            "give the elevation map, whole, as GeoTIFF",
            file=path,
        ) from None
    with data:
        yield data


def _driver(path: Path) -> str:
    """GDAL's name of the format, by the first bytes."""
    with path.open("rb") as stream:
        begins = stream.read(8)
    if begins[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return "GTiff"
    if begins == b"\x89PNG\r\n\x1a\n":
        return "PNG"
    raise WildlabError("is neither TIFF nor PNG", "give the elevation map as GeoTIFF", file=path)


def _refuse_layout(data: Any, path: Path) -> None:
    """What a map of heights does not look like."""
    if data.count != 1:
        raise WildlabError(
            f"has {data.count} bands, and a map of heights has one",
            "give the band of heights alone",
            file=path,
        )
    kind = np.dtype(data.dtypes[0]) if data.dtypes[0] in np.sctypeDict else None
    if kind is None or kind.kind not in "iuf" or (data.driver == "PNG" and kind != np.uint8):
        wanted = "8 bits, as in F (6.1)" if data.driver == "PNG" else "real numbers"
        raise WildlabError(f"holds {data.dtypes[0]}, and heights are {wanted}", "convert it", file=path)
    rows, columns = data.height, data.width
    block = math.prod(data.block_shapes[0]) * kind.itemsize
    if data.driver == "PNG":
        block = rows * columns
    if max(rows, columns) > LARGEST_SIDE or block > LARGEST_BLOCK:
        raise WildlabError(
            f"claims {columns:,} x {rows:,} cells in blocks of {block:,} bytes, {LARGEST_BLOCK:,} at most",
            "cut and tile it (gdalwarp -co TILED=YES -te ...)",
            file=path,
        )
    if min(rows, columns) < 2:
        raise WildlabError(
            f"has {columns} x {rows} cells, and a surface takes two each way", "give another", file=path
        )


def _refuse_other_crs(states: CRS, said: CRS, path: Path) -> None:
    """Refuse a CRS that is not the file's own; one that adds what its heights count from is welcome."""
    one, other = _split(states, path)[0], _split(said, path)[0]
    if not one.equals(other, ignore_axis_order=True):
        raise WildlabError(
            f"states the CRS {printable(states.name)[:60]}, and {printable(said.name)[:60]} is said of it",
            "leave crs out, or mend the file (gdal_edit -a_srs)",
            file=path,
            field="terrain.crs",
        )


def _placed(data: Any, says: TerrainSays, path: Path, picture: bool) -> Affine:
    from rasterio import Affine

    if says.cell_m is not None and says.corner is not None:
        return Affine(says.cell_m, 0.0, says.corner[0], 0.0, -says.cell_m, says.corner[1])
    found: Affine = data.transform
    if picture or found.is_identity:
        raise WildlabError(
            "does not say where its cells lie",
            "state cell_m and corner (upper left, easting and northing)",
            file=path,
            field="terrain.corner",
        )
    if not all(math.isfinite(value) for value in found[:6]) or found.is_degenerate:
        raise WildlabError("its cells have no area", "write it again with a sound transform", file=path)
    return found


def _unit(data: Any, whole: CRS, says: TerrainSays, path: Path) -> tuple[float, str]:
    """Metres of a unit of height, and what the unit is called."""
    if says.unit is not None:
        return UNITS[says.unit], says.unit
    word = (data.units[0] or "").strip() if data.units else ""
    of_crs = [axis for axis in whole.axis_info if axis.direction == "up"]
    if of_crs:
        return float(of_crs[0].unit_conversion_factor), of_crs[0].unit_name
    if not word:
        return 1.0, "metre, for want of another"
    if word.lower() not in _WORDS:
        raise WildlabError(
            f"its heights are in {printable(word)[:30]!r}, which is no unit of length known here",
            "state unit: m, ft or us-ft",
            file=path,
            field="terrain.unit",
        )
    return _WORDS[word.lower()], word


def _split(whole: CRS, path: Path) -> tuple[CRS, str]:
    """The horizontal part of a CRS, and what its heights count from."""
    if whole.is_compound:
        horizontal, vertical = whole.sub_crs_list[0], whole.sub_crs_list[1].name
    else:
        horizontal, vertical = whole, ("ellipsoid" if len(whole.axis_info) == 3 else "")
        if vertical:
            horizontal = whole.to_2d()
    if not (horizontal.is_geographic or horizontal.is_projected):
        raise WildlabError(
            f"its CRS ({printable(horizontal.name)[:60]}) is not one of places on Earth",
            "name the right one as crs, EPSG:32633 for instance",
            file=path,
            field="terrain.crs",
        )
    return horizontal, vertical


def _averaged(heights: Heights, every: int) -> Heights:
    rows, columns = (side // every for side in heights.shape)
    blocks = heights.reshape(rows, every, columns, every)
    known = np.isfinite(blocks)
    n = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3), dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(2 * n >= every * every, total / n, np.nan)
    return mean.astype(np.float32)


def _damaged(path: Path, error: Exception) -> WildlabError:
    return WildlabError(
        f"breaks off or is damaged ({_first_line(error)})",
        "get the map again, and compare its size",
        file=path,
    )


def _first_line(error: Exception) -> str:
    cause = error.__cause__ or error
    return printable((str(cause).strip() or type(cause).__name__).splitlines()[0])[:120]
