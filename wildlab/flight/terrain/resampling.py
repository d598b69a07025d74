"""From an elevation map's cells to a grid in frame n, exactly: ellipsoid, curvature, convergence of the grid.

A node of the grid at north N and east E has the height of the point of the map's surface that has these very
coordinates in n. Where that lies in the map depends on how deep it is, a little: n's verticals are parallel,
the Earth's are not. So its depth is sought by iteration, which gains three digits a turn. Going from n to
the map is smooth; it is worked out on a lattice, at two depths, and linear between, and checked elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.readers.terrain import ElevationMap, Heights
from wildlab.geometry.frames import Origin, geodetic_to_ned, ned_to_geodetic
from wildlab.geometry.terrain import Terrain

Array = NDArray[np.float64]

#: Between nodes of the lattice, metres, at most; halved until the lattice is good to `GOOD` metres.
LATTICE = 200.0
GOOD = 0.002
#: Nodes of the grid that are worked on at once.
AT_ONCE = 1_000_000


class Extent(NamedTuple):
    """Least and greatest north and east, metres."""

    north: float
    far_north: float
    east: float
    far_east: float


@dataclass(frozen=True, eq=False)
class MapPlaces:
    """Where points of n lie in a map, and the other way round.

    Attributes
    ----------
    to_map, from_map
        Longitude and latitude (degrees, WGS84) to the CRS, and back.
    """

    map: ElevationMap
    origin: Origin
    added: float
    to_map: Callable[[Array, Array], tuple[Array, Array]]
    from_map: Callable[[Array, Array], tuple[Array, Array]]

    def of_points(self, p_n: Array) -> Array:
        """(N, 3): column and row, counted from the corner of the first cell, and height as in the map."""
        llh = ned_to_geodetic(p_n, self.origin)
        x, y = self.to_map(np.degrees(llh[:, 1]), np.degrees(llh[:, 0]))
        column, row = self.map.to_cells(np.asarray(x), np.asarray(y))
        return np.column_stack([column, row, llh[:, 2] - self.added])

    def of_cells(self, cells: Array, heights: Array) -> Array:
        """(N, 3) in n of columns and rows (N, 2) with heights as in the map."""
        x, y = self.map.to_crs(cells[:, 0], cells[:, 1])
        longitude, latitude = self.from_map(np.asarray(x), np.asarray(y))
        return geodetic_to_ned(np.radians(latitude), np.radians(longitude), heights + self.added, self.origin)


def places_of(elevation: ElevationMap, origin: Origin, added: float) -> MapPlaces:
    """The way between n and a map.

    Parameters
    ----------
    elevation
        The map.
    origin
        Of n.
    added
        Metres that take the map's heights to heights above the ellipsoid.

    Returns
    -------
    Places
    """
    from pyproj import CRS, Transformer

    there = Transformer.from_crs(CRS.from_epsg(4326), elevation.crs, always_xy=True)
    back = Transformer.from_crs(elevation.crs, CRS.from_epsg(4326), always_xy=True)
    return MapPlaces(elevation, origin, added, there.transform, back.transform)


@dataclass(frozen=True, eq=False)
class Lattice:
    """`MapPlaces.of_points` of an even lattice at two depths: (2, A, B, 3)."""

    extent: Extent
    downs: tuple[float, float]
    values: Array

    def at(self, north: Array, east: Array) -> tuple[Array, Array]:
        """Columns, rows and heights (3, N) at either depth, linear between the lattice's nodes."""
        a, b = self.values.shape[1:3]
        e = self.extent
        y = (north - e.north) / (e.far_north - e.north) * (a - 1)
        x = (east - e.east) / (e.far_east - e.east) * (b - 1)
        i = np.clip(y.astype(int), 0, a - 2)
        j = np.clip(x.astype(int), 0, b - 2)
        v, u = (y - i)[:, None], (x - j)[:, None]

        def between(level: Array) -> Array:
            low = level[i, j] + u * (level[i, j + 1] - level[i, j])
            high = level[i + 1, j] + u * (level[i + 1, j + 1] - level[i + 1, j])
            return np.asarray((low + v * (high - low)).T)

        return between(self.values[0]), between(self.values[1])


def lattice_of(places: MapPlaces, extent: Extent, heights: tuple[float, float], cell: float) -> Lattice:
    """A lattice over an extent for ground between two heights of the map, metres.

    Parameters
    ----------
    places
        The way from n to the map.
    extent
        In n.
    heights
        Lowest and highest, in the map.
    cell
        The map's cell, metres: by it columns are metres.

    Returns
    -------
    Lattice
        Linear between its nodes to `GOOD` metres, or as fine as is sensible.
    """
    high = -(heights[1] + places.added - places.origin[2]) - 10.0
    # The ground falls behind the horizon: down grows by the square of the distance over twice the radius.
    far = max(map(abs, extent)) ** 2 / 6e6
    downs = (high, -(heights[0] + places.added - places.origin[2]) + far + 10.0)
    rng = np.random.default_rng(0)
    trial = np.column_stack([rng.uniform(*extent[:2], 100), rng.uniform(*extent[2:], 100)])
    spacing = LATTICE
    while True:
        lattice = _lattice(places, extent, downs, spacing)
        worst = 0.0
        for level, down in enumerate(downs):
            exact = places.of_points(np.column_stack([trial, np.full(len(trial), down)]))
            off = lattice.at(trial[:, 0], trial[:, 1])[level].T - exact
            worst = max(worst, float(np.abs(off * [cell, cell, 1.0]).max()))
        if worst <= GOOD or spacing < 20.0:
            return lattice
        spacing /= 2


def _lattice(places: MapPlaces, extent: Extent, downs: tuple[float, float], spacing: float) -> Lattice:
    e = extent
    a, b = (int(np.ceil(side / spacing)) + 1 for side in (e.far_north - e.north, e.far_east - e.east))
    north, east = np.linspace(e.north, e.far_north, max(a, 2)), np.linspace(e.east, e.far_east, max(b, 2))
    N, E = np.meshgrid(north, east, indexing="ij")
    levels = [
        places.of_points(np.column_stack([N.ravel(), E.ravel(), np.full(N.size, down)])) for down in downs
    ]
    return Lattice(extent, downs, np.stack(levels).reshape(2, *N.shape, 3))


def resample(
    heights: Heights, corner: tuple[int, int], every: int, lattice: Lattice, extent: Extent, step: float
) -> Terrain:
    """The grid in n of a window of a map.

    Parameters
    ----------
    heights
        (R, C) metres, of cells ``every`` by ``every`` of the file.
    corner
        Row and column in the file of the window's first cell.
    every
        See `heights`.
    lattice
        The way to the map, over the extent at least.
    extent
        Of the grid.
    step
        Between its nodes, metres.

    Returns
    -------
    Terrain
        Bilinear between the map's nodes; NaN beyond them and about holes.
    """
    rows = int(np.floor((extent.far_north - extent.north) / step)) + 1
    columns = int(np.floor((extent.far_east - extent.east) / step)) + 1
    out = np.empty((rows, columns), np.float32)
    east = extent.east + step * np.arange(columns)
    at_once = max(1, AT_ONCE // columns)
    for first in range(0, rows, at_once):
        north = extent.north + step * np.arange(first, min(first + at_once, rows))
        N, E = (grid.ravel() for grid in np.meshgrid(north, east, indexing="ij"))
        out[first : first + len(north)] = _surface(heights, corner, every, lattice, N, E).reshape(-1, columns)
    return Terrain(out, extent.north, extent.east, step)


def _surface(
    heights: Heights, corner: tuple[int, int], every: int, lattice: Lattice, north: Array, east: Array
) -> Array:
    """Heights in n (N,), metres above the plane ``down = 0``."""
    top, bottom = lattice.at(north, east)
    share = np.full(len(north), 0.5)
    for _ in range(3):
        column, row, _height = top + share * (bottom - top)
        found = bilinear(heights, (row - corner[0]) / every - 0.5, (column - corner[1]) / every - 0.5)
        share = (found - top[2]) / (bottom[2] - top[2])
        known = np.isfinite(share)
        share[~known] = 0.5
    down = lattice.downs[0] + share * (lattice.downs[1] - lattice.downs[0])
    return np.where(known, -down, np.nan)


def bilinear(heights: Heights, rows: Array, columns: Array) -> Array:
    """Heights between nodes, (N,); NaN beyond the nodes and beside a hole."""
    R, C = heights.shape
    # A node that is met but for rounding counts as met.
    rows, columns = (np.where(np.abs(a - np.round(a)) < 1e-6, np.round(a), a) for a in (rows, columns))
    inside = (rows >= 0) & (rows <= R - 1) & (columns >= 0) & (columns <= C - 1)
    i = np.clip(np.where(inside, rows, 0).astype(int), 0, R - 2)
    j = np.clip(np.where(inside, columns, 0).astype(int), 0, C - 2)
    v, u = np.where(inside, rows - i, np.nan), np.where(inside, columns - j, np.nan)
    with np.errstate(invalid="ignore"):
        low = heights[i, j] + u * (heights[i, j + 1].astype(float) - heights[i, j])
        high = heights[i + 1, j] + u * (heights[i + 1, j + 1].astype(float) - heights[i + 1, j])
        return np.asarray(low + v * (high - low))


def resampling_error(
    terrain: Terrain, places: MapPlaces, cells: NDArray[np.int64], heights: Heights
) -> tuple[float, float]:
    """How far a grid in n lies from the map's own nodes: root mean square, and the largest, metres.

    Parameters
    ----------
    terrain
        The grid.
    places
        The way from the map to n: each node is taken there by itself.
    cells
        (K, 2) rows and columns in the file.
    heights
        (K,) metres, of these cells.

    Returns
    -------
    Two numbers, zero where no node can be compared.
    """
    known = np.isfinite(heights)
    centres = np.asarray(cells[known][:, ::-1] + 0.5, np.float64)
    p = places.of_cells(centres, heights[known].astype(float))
    off = -p[:, 2] - terrain.heights_at(p[:, :2])
    off = off[np.isfinite(off)]
    return (float(np.sqrt((off**2).mean())), float(np.abs(off).max())) if len(off) else (0.0, 0.0)
