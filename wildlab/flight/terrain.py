"""From an elevation map's cells to a grid in frame n, exactly: ellipsoid, curvature, convergence of the grid.

A node of the grid at north N and east E has the height of the point of the map's surface that has these very
coordinates in n. Where that lies in the map depends on how deep it is, a little: n's verticals are parallel,
the Earth's are not. So its depth is sought by iteration, which gains three digits a turn, between two depths.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from wildlab.errors import WildlabError
from wildlab.flight.heights import undulation
from wildlab.flight.manifest import TerrainPart, TerrainSays, replace_in_manifest
from wildlab.flight.readers.terrain import ElevationMap, Heights, open_elevation
from wildlab.flight.schema import POSITION
from wildlab.flight.store import MOST_NODES, Flight
from wildlab.geometry.frames import Origin, geodetic_to_ned, ned_to_geodetic
from wildlab.geometry.terrain import Terrain

Array = NDArray[np.float64]

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
        column, row = ~self.map.transform @ (x, y)
        return np.column_stack([column, row, llh[:, 2] - self.added])

    def of_cells(self, cells: Array, heights: Array) -> Array:
        """(N, 3) in n of columns and rows (N, 2) with heights as in the map."""
        x, y = self.map.transform @ (cells[:, 0], cells[:, 1])
        longitude, latitude = self.from_map(x, y)
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


def depths_of(places: MapPlaces, extent: Extent, heights: tuple[float, float]) -> tuple[float, float]:
    """Down (m) above and below all ground over an extent, whose heights in the map are the lowest and the
    highest."""
    high = -(heights[1] + places.added - places.origin[2]) - 10.0
    # The ground falls behind the horizon: down grows by the square of the distance over twice the radius.
    far = max(map(abs, extent)) ** 2 / 6e6
    return high, -(heights[0] + places.added - places.origin[2]) + far + 10.0


def resample(
    heights: Heights, corner: tuple[int, int], every: int, places: MapPlaces, extent: Extent, step: float
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
    places
        The way to the map.
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
    downs = depths_of(places, extent, (float(np.nanmin(heights)), float(np.nanmax(heights))))
    at_once = max(1, AT_ONCE // columns)
    for first in range(0, rows, at_once):
        north = extent.north + step * np.arange(first, min(first + at_once, rows))
        N, E = (grid.ravel() for grid in np.meshgrid(north, east, indexing="ij"))
        ends = [places.of_points(np.column_stack([N, E, np.full(N.size, down)])).T for down in downs]
        out[first : first + len(north)] = _surface(heights, corner, every, ends, downs).reshape(-1, columns)
    return Terrain(out, extent.north, extent.east, step)


def _surface(
    heights: Heights, corner: tuple[int, int], every: int, ends: list[Array], downs: tuple[float, float]
) -> Array:
    """Heights in n (N,), metres above the plane ``down = 0``, of verticals with ends (3, N) at two depths:
    columns, rows and heights in the map, linear between."""
    top, bottom = ends
    share = np.full(top.shape[1], 0.5)
    for _ in range(3):
        column, row, _height = top + share * (bottom - top)
        found = bilinear(heights, (row - corner[0]) / every - 0.5, (column - corner[1]) / every - 0.5)
        share = (found - top[2]) / (bottom[2] - top[2])
        known = np.isfinite(share)
        share[~known] = 0.5
    down = downs[0] + share * (downs[1] - downs[0])
    return np.where(known, -down, np.nan)


def bilinear(heights: Heights, rows: Array, columns: Array) -> Array:
    """Heights between nodes, (N,); NaN beyond the nodes and beside a hole."""
    # A node that is met but for rounding counts as met.
    at = [np.where(np.abs(a - np.round(a)) < 1e-6, np.round(a), a) for a in (rows, columns)]
    return np.asarray(map_coordinates(heights, at, float, order=1, mode="constant", cval=np.nan))


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


#: How far the terrain reaches beyond the flight: a ray 10 deg below the horizon goes that many heights above
#: ground; at least and at most so many metres.
HEIGHTS_ABOVE, LEAST, MOST = 6.0, 200.0, 5000.0
#: Poses that the ground is looked up under, at most.
LOOKED_UP = 300
#: Cells of the file that are averaged to a side, at most.
COARSEST = 1000
#: Nodes up to which a grid may be finer than its map.
FEW_NODES = 1_000_000


def lay_terrain(flight: Flight, path: Path, says: TerrainSays) -> Flight:
    """A flight with the part of an elevation map that lies about it.

    Parameters
    ----------
    flight
        With poses, or truth.
    path
        Of the map.
    says
        What the user says of it.

    Returns
    -------
    Flight
        With ``terrain``, and ``manifest.terrain`` that says where it comes from. In memory alone.

    Raises
    ------
    WildlabError
        Where the map cannot be used, does not lie under the flight, or the flight lies under the ground.

    Examples
    --------
    >>> says = TerrainSays(file="dem.tif", heights="ellipsoid")
    >>> lay_terrain(flight, Path("dem.tif"), says).terrain.step  # doctest: +SKIP
    1.0
    """
    elevation = open_elevation(path, says)
    origin = flight.manifest.origin_tuple()
    heights, added = _vertical(elevation, says, flight)
    places = places_of(elevation, origin, added)
    positions, is_pose = _positions(flight)
    above = _above_ground(places, positions[is_pose]) if is_pose.any() else np.zeros(0)
    _refuse_elsewhere(places, positions)
    if len(above) and (above < 0).all():
        raise WildlabError(
            f"the whole flight is below the ground, {-np.median(above):.0f} m in the middle",
            "check what both heights count from, and units",
            file=path,
            field="terrain.heights",
        )
    margin = says.margin_m
    if margin is None:
        margin = float(np.clip(HEIGHTS_ABOVE * max(above, default=0.0), LEAST, MOST))
    cut = _cut_out(places, positions, margin, says)
    record = TerrainPart(
        source=path.name,
        sha256=elevation.digest,
        crs=_named(elevation),
        heights=heights,
        added_m=added,
        unit=elevation.unit,
        cell_m=cut.cell,
        averaged=cut.every,
        step_m=cut.terrain.step,
        rows=cut.terrain.height.shape[0],
        columns=cut.terrain.height.shape[1],
        holes=int(np.isnan(cut.terrain.height).sum()),
        error_rms_m=cut.rms,
        error_max_m=cut.largest,
        sd_m=says.sd_m,
    )
    manifest = replace_in_manifest(flight.manifest, {"terrain": record.model_dump(exclude_none=True)})
    return Flight(manifest, flight.nav, flight.tables, flight.folder, cut.terrain)


def terrain_about(path: Path, says: TerrainSays, origin: Origin, points: Array, margin: float) -> CutOut:
    """The part of an elevation map about places that no flight has been to yet.

    Parameters
    ----------
    path
        Of the map.
    says
        What the user says of it. What its heights count from is not asked: they are taken as they are, and
        differences between them are what matters.
    origin
        Of n.
    points
        (N, 2) north and east, metres.
    margin
        How far it reaches beyond them, metres.

    Returns
    -------
    CutOut

    Raises
    ------
    WildlabError
        Where the map cannot be used, or none of the places lies over it.
    """
    places = places_of(open_elevation(path, says), origin, 0.0)
    positions = np.column_stack([points, np.zeros(len(points))])
    _refuse_elsewhere(places, positions, "the areas do not lie", "the order of their coordinates")
    return _cut_out(places, positions, margin if says.margin_m is None else says.margin_m, says)


class CutOut(NamedTuple):
    """A part of an elevation map in n.

    Attributes
    ----------
    terrain
        On its grid.
    cell
        Sides of the map's cell, metres.
    every
        How many cells a side were averaged.
    rms, largest
        How far the grid lies from the map's own nodes, metres.
    """

    terrain: Terrain
    cell: tuple[float, float]
    every: int
    rms: float
    largest: float


def _cut_out(places: MapPlaces, positions: Array, margin: float, says: TerrainSays) -> CutOut:
    """The part of a map that is near positions (N, 3), resampled into n."""
    elevation, path = places.map, places.map.path
    low, high = positions[:, :2].min(axis=0) - margin, positions[:, :2].max(axis=0) + margin
    cell = _cell_sides(places, positions)
    about = _within(places, Extent(*(float(side) for side in (low[0], high[0], low[1], high[1]))))
    extent, step, every = _grid(about, says.step_m, cell)
    row, column, rows, columns = _window(places, extent, every, path)
    found, cells, values = elevation.window(row, column, rows, columns, every)
    if not np.isfinite(found).any():
        raise WildlabError(
            "has holes alone near the flight",
            "give another map",
            file=path,
            field="terrain",
        )
    terrain = _cropped(resample(found, (row, column), every, places, extent, step))
    rms, largest = resampling_error(terrain, places, cells, values)
    # What is known of a height at a node is known no better between nodes.
    sd = math.hypot(says.sd_m, rms) if says.sd_m is not None else math.nan
    terrain = Terrain(terrain.height, terrain.north, terrain.east, terrain.step, sd)
    return CutOut(terrain, cell, every, rms, largest)


def _positions(flight: Flight) -> tuple[Array, NDArray[np.bool_]]:
    """Where the flight and what it saw were, (N, 3) m, and which of these are poses."""
    poses = [table[POSITION].to_numpy(float) for table in flight.nav.values()]
    truth = [] if flight.truth is None else [flight.truth[POSITION].to_numpy(float)]
    every = np.concatenate([*poses, *truth, np.zeros((0, 3))])
    is_pose = np.arange(len(every)) < sum(map(len, poses))
    known = np.isfinite(every).all(axis=1)
    if not known.any():
        raise WildlabError(
            "the flight has no position",
            "add poses or truth",
            file=flight.folder,
            field="nav",
        )
    return every[known], is_pose[known]


def _vertical(
    elevation: ElevationMap, says: TerrainSays, flight: Flight
) -> tuple[Literal["ellipsoid", "flight", "geoid"], float]:
    """What the map's heights count from, and what takes them above the ellipsoid, metres."""
    stated = says.heights
    if isinstance(stated, float):
        return "geoid", stated
    if stated == "flight":
        return "flight", -flight.manifest.vertical.correction_m
    if stated == "ellipsoid" and elevation.vertical not in ("", "ellipsoid"):
        raise WildlabError(
            f"its heights count from {elevation.vertical!r}, not from the ellipsoid",
            "state as heights how far that is above the ellipsoid",
            file=elevation.path,
            field="terrain.heights",
        )
    if "ellipsoid" in (stated, elevation.vertical):
        return "ellipsoid", 0.0
    if not elevation.vertical:
        raise WildlabError(
            "does not say what its heights count from",
            'state heights: "ellipsoid", "flight", or how far the geoid is above the ellipsoid',
            file=elevation.path,
            field="terrain.heights",
        )
    latitude, longitude, _ = flight.manifest.origin_tuple()
    geoid = undulation(math.degrees(latitude), math.degrees(longitude), elevation.whole)
    if geoid is None:
        raise WildlabError(
            f"its heights count from {elevation.vertical!r}, whose grid is not installed",
            "state as heights how far that is above the ellipsoid",
            file=elevation.path,
            field="terrain.heights",
        )
    return "geoid", geoid


def _above_ground(places: MapPlaces, poses: Array) -> Array:
    """Heights of poses above the ground, of those that are over it."""
    some = poses[:: max(1, len(poses) // LOOKED_UP)]
    found = places.of_points(some)
    elevation, ground = places.map, np.full(len(some), np.nan)
    with elevation.opened() as data:
        for k, (column, row, _height) in enumerate(found):
            if not (0.5 <= column < elevation.shape[1] - 0.5 and 0.5 <= row < elevation.shape[0] - 0.5):
                continue
            i, j = int(row - 0.5), int(column - 0.5)
            four = elevation.read(data, i, j, 2, 2)
            elevation.refuse_absurd(four)
            ground[k] = bilinear(four, np.array([row - 0.5 - i]), np.array([column - 0.5 - j]))[0]
    above = found[:, 2] - ground
    return np.asarray(above[np.isfinite(above)])


def _cell_sides(places: MapPlaces, positions: Array) -> tuple[float, float]:
    """Sides of the map's cell nearest to the middle of the flight, metres: across columns, across rows."""
    column, row, _ = places.of_points(positions.mean(axis=0)[None])[0]
    rows, columns = places.map.shape
    middle = np.array([np.clip(column, 0, columns - 1), np.clip(row, 0, rows - 1)])
    corners = middle + np.array([(0, 0), (1, 0), (0, 1)])
    p = places.of_cells(corners, np.zeros(3))
    sides = np.linalg.norm(p[1:] - p[0], axis=1)
    if not (np.isfinite(sides).all() and (sides > 0).all()):
        raise WildlabError(
            "its cells have no size there",
            "check its CRS",
            file=places.map.path,
            field="terrain.crs",
        )
    return float(sides[0]), float(sides[1])


def _within(places: MapPlaces, extent: Extent) -> Extent:
    """The part of an extent that the map reaches, which lies over some of it."""
    rows, columns = places.map.shape
    edge = np.linspace(0, 1, 65)
    border = [
        np.column_stack([x.ravel(), y.ravel()])
        for x, y in (np.meshgrid(edge * columns, [0, rows]), np.meshgrid([0, columns], edge * rows))
    ]
    p = places.of_cells(np.concatenate(border), np.zeros(4 * len(edge)))
    if not np.isfinite(p).all():  # a map beyond the reach of its own CRS
        return extent
    low, high = p.min(axis=0), p.max(axis=0)
    if np.abs(p).max() > 100_000:  # a border of so wide a map is no straight line
        return extent
    return Extent(
        max(extent.north, float(low[0])), min(extent.far_north, float(high[0])),
        max(extent.east, float(low[1])), min(extent.far_east, float(high[1])),
    )  # fmt: skip


def _grid(extent: Extent, step: float | None, cell: tuple[float, float]) -> tuple[Extent, float, int]:
    """Extent, step and cells averaged a side: as fine as the map, but for the most nodes that are kept.

    Nodes of a grid that is turned against the map fall between the map's. Where there are few, a step of half
    or a quarter of the cell keeps its peaks.
    """
    area = (extent.far_north - extent.north) * (extent.far_east - extent.east)
    if step is None:
        finer = (part for part in (4, 2) if area * (part / min(cell)) ** 2 <= FEW_NODES)
        step = min(cell) / next(finer, 1)
    step = max(step, math.sqrt(area / (0.9 * MOST_NODES)))
    every = min(max(1, int(step / max(cell) + 1e-9)), COARSEST)
    # Nodes at whole steps of n.
    low = [math.floor(side / step) * step for side in (extent.north, extent.east)]
    high = [math.ceil(side / step) * step for side in (extent.far_north, extent.far_east)]
    low = [min(a, b - step) for a, b in zip(low, high, strict=True)]
    return Extent(low[0], high[0], low[1], high[1]), step, every


def _cropped(terrain: Terrain) -> Terrain:
    """A terrain without what is holes alone along its borders."""
    known = np.isfinite(terrain.height)
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    # A surface takes two nodes each way.
    i, j = min(rows[0], len(known) - 2), min(columns[0], known.shape[1] - 2)
    height = terrain.height[i : max(rows[-1], i + 1) + 1, j : max(columns[-1], j + 1) + 1]
    return Terrain(height, terrain.north + i * terrain.step, terrain.east + j * terrain.step, terrain.step)


def _window(places: MapPlaces, extent: Extent, every: int, path: Path) -> tuple[int, int, int, int]:
    """Row, column, rows and columns of the file that lie under an extent."""
    edge = np.linspace(0, 1, 33)
    north = extent.north + edge * (extent.far_north - extent.north)
    east = extent.east + edge * (extent.far_east - extent.east)
    N, E = (grid.ravel() for grid in np.meshgrid(north, east, indexing="ij"))
    found = places.of_points(np.column_stack([N, E, np.zeros(N.size)]))[:, :2]
    found = found[np.isfinite(found).all(axis=1)]
    shape = places.map.shape
    margin = 2 * every + 2
    low, high = np.floor(found.min(axis=0)) - margin, np.ceil(found.max(axis=0)) + margin
    column, row = (int(max(0, value)) for value in low)
    far_column, far_row = (int(min(most, value)) for most, value in zip(shape[::-1], high, strict=True))
    rows, columns = ((far_row - row) // every * every, (far_column - column) // every * every)
    if rows < 2 * every or columns < 2 * every:
        raise WildlabError(
            "only touches the surroundings",
            "give a larger map",
            file=path,
            field="terrain",
        )
    return row, column, rows, columns


def _refuse_elsewhere(
    places: MapPlaces,
    positions: Array,
    what: str = "the flight does not lie",
    also: str = "the flight's origin",
) -> None:
    """Refuse a map that no position of the flight lies over, and say how far off it is."""
    rows, columns = places.map.shape

    def over(found: Array) -> bool:
        inside = (found[:, 0] >= 0) & (found[:, 0] <= columns) & (found[:, 1] >= 0) & (found[:, 1] <= rows)
        return bool(inside.any())

    found = places.of_points(positions)
    if over(found):
        return
    middle = len(found) // 2
    column, row = (columns / 2, rows / 2) if np.isnan(found[middle, :2]).any() else found[middle, :2]
    nearest = np.clip([[column, row]], [0, 0], [columns, rows])
    away = places.of_cells(nearest, np.zeros(1))[0, :2] - positions[middle, :2]
    distance = float(np.hypot(*away))
    far = f"{distance / 1000:,.1f} km away" if distance >= 1000 else f"{distance:.0f} m away"
    far = far if math.isfinite(distance) else "beyond the reach of its own CRS"
    fix = f"give another map, or check CRS and {also}"
    longitude, latitude, height = ned_to_geodetic(positions, places.origin).T
    latitude = np.where(np.abs(latitude) <= np.pi / 2, latitude, np.nan)
    if over(places.of_points(geodetic_to_ned(latitude, longitude, height, places.origin))):
        far, fix = f"{far}, but with latitude and longitude exchanged", f"exchange them in {also}"
    raise WildlabError(
        f"{what} over this map, whose nearest cell is {far}",
        fix,
        file=places.map.path,
        field="terrain",
    )


def _named(elevation: ElevationMap) -> str:
    """A short name of a CRS: its code, or what it calls itself."""
    code = elevation.whole.to_authority(min_confidence=70)
    return ":".join(code) if code is not None else elevation.whole.name[:100]
