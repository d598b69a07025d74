"""``terrain.tif`` of a flight folder: heights above the plane ``down = 0`` of n, on a grid in n."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.files import printable, regular_size
from wildlab.geometry.terrain import Terrain

#: Nodes that are kept of a terrain, and read of a file that claims more.
MOST_NODES = 25_000_000
#: The tag of the standard deviation.
_SD = "WILDLAB_SD_M"
_FIX = "lay the terrain again: wildlab terrain"


def write_terrain(terrain: Terrain, path: Path) -> None:
    """Write a terrain: 32-bit heights in metres, columns east and rows south, no CRS and so no place.

    Parameters
    ----------
    terrain
        In the flight's n.
    path
        Of the file.
    """
    import rasterio
    from rasterio import Affine

    rows, columns = terrain.height.shape
    far_north = terrain.north + (rows - 1) * terrain.step
    half = terrain.step / 2
    transform = Affine(terrain.step, 0.0, terrain.east - half, 0.0, -terrain.step, far_north + half)
    with _gdal(), rasterio.open(
        path, "w", driver="GTiff", width=columns, height=rows, count=1, dtype="float32", nodata=math.nan,
        transform=transform, compress="deflate", predictor=3, tiled=True, blockxsize=256, blockysize=256,
    ) as data:  # fmt: skip
        data.write(terrain.height[::-1], 1)
        # The first node again: the transform has it with the rounding of a sum.
        data.update_tags(
            **{
                _SD: repr(float(terrain.sd)),
                "NORTH_M": repr(float(terrain.north)),
                "EAST_M": repr(float(terrain.east)),
            }
        )


def read_terrain(path: Path) -> Terrain:
    """Read a terrain that `write_terrain` wrote.

    Parameters
    ----------
    path
        Of the file.

    Returns
    -------
    Terrain

    Raises
    ------
    WildlabError
        Where it is no such file, or damaged.
    """
    import rasterio

    regular_size(path)
    with _gdal():
        try:
            with rasterio.open(path, driver="GTiff") as data:
                terrain = _terrain(data, path)
        except WildlabError:
            raise
        except Exception as error:  # rasterio's errors share no base but Exception
            said = printable((str(error.__cause__ or error).strip() or "?").splitlines()[0])[:120]
            raise WildlabError(f"is not a terrain that can be read ({said})", _FIX, file=path) from None
    return terrain


def _terrain(data: Any, path: Path) -> Terrain:
    t, tags = data.transform, data.tags()
    sound = data.count == 1 and data.dtypes == ("float32",) and data.crs is None and _SD in tags
    if not sound or t.b or t.d or t.a <= 0 or not math.isclose(t.a, -t.e):
        raise WildlabError("is not a grid of heights in frame n", _FIX, file=path)
    if data.width * data.height > MOST_NODES or math.prod(data.block_shapes[0]) > MOST_NODES:
        raise WildlabError(
            f"claims {data.width:,} x {data.height:,} nodes, and {MOST_NODES:,} are the most", _FIX, file=path
        )
    try:
        north, east, sd = float(tags["NORTH_M"]), float(tags["EAST_M"]), float(tags[_SD])
    except (KeyError, ValueError):
        raise WildlabError("does not say where its first node is", _FIX, file=path) from None
    return Terrain(np.ascontiguousarray(data.read(1)[::-1]), north, east, float(t.a), sd)


@contextlib.contextmanager
def _gdal() -> Iterator[None]:
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with warnings.catch_warnings(), rasterio.Env(GDAL_CACHEMAX=64, GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"):
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        yield
