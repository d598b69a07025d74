"""From an elevation map's cells to a grid in frame n, exactly: ellipsoid, curvature, convergence of the grid.

A node of the grid at north N and east E has the height of the point of the map's surface that has these very
coordinates in n. Where that lies in the map depends on how deep it is, a little: n's verticals are parallel,
the Earth's are not. So its depth is sought by iteration, which gains three digits a turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates

from wildlab.errors import WildlabError
from wildlab.flight.manifest import TerrainPart, TerrainSays, replace_in_manifest
from wildlab.flight.readers.log import Stream
from wildlab.flight.readers.terrain import ElevationMap, Heights, open_elevation
from wildlab.flight.schema import POSITION
from wildlab.flight.store import MOST_NODES, Flight
from wildlab.geometry.frames import Array, Indices, Mask, Origin, geodetic_to_ned, ned_to_geodetic
from wildlab.geometry.terrain import Terrain
from wildlab.names import listed

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
    middle = places.origin[2] - places.added - float(np.nanmean(heights))
    at_once = max(1, AT_ONCE // columns)
    for first in range(0, rows, at_once):
        north = extent.north + step * np.arange(first, min(first + at_once, rows))
        N, E = (grid.ravel() for grid in np.meshgrid(north, east, indexing="ij"))
        p = np.column_stack([N, E, np.full(N.size, middle)])
        for _ in range(3):
            column, row, height = places.of_points(p).T
            ground = bilinear(heights, (row - corner[0]) / every - 0.5, (column - corner[1]) / every - 0.5)
            p[:, 2] += np.nan_to_num(height - ground)
        out[first : first + len(north)] = np.where(np.isnan(ground), np.nan, -p[:, 2]).reshape(-1, columns)
    return Terrain(out, extent.north, extent.east, step)


def bilinear(heights: Heights, rows: Array, columns: Array) -> Array:
    """Heights between nodes, (N,); NaN beyond the nodes and beside a hole."""
    # A node that is met but for rounding counts as met.
    at = [np.where(np.abs(a - np.round(a)) < 1e-6, np.round(a), a) for a in (rows, columns)]
    return np.asarray(map_coordinates(heights, at, float, order=1, mode="constant", cval=np.nan))


def resampling_error(
    terrain: Terrain, places: MapPlaces, cells: Indices, heights: Heights
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
    code = elevation.whole.to_authority(min_confidence=70)
    record = TerrainPart(
        source=path.name,
        sha256=elevation.digest,
        crs=":".join(code) if code is not None else elevation.whole.name[:100],
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


def _positions(flight: Flight) -> tuple[Array, Mask]:
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
    corner = np.array(places.map.shape[::-1], float)
    found = places.of_points(positions)[:, :2]
    if ((found >= 0) & (found <= corner)).all(axis=1).any():
        return
    middle = len(found) // 2
    nearest = np.clip(np.nan_to_num(found[middle], nan=0.0), 0.0, corner)
    away = places.of_cells(nearest[None], np.zeros(1))[0, :2] - positions[middle, :2]
    far = f"{np.hypot(*away) / 1000:,.1f} km away"
    raise WildlabError(
        f"{what} over this map, whose nearest cell is {far}",
        f"give another map, or check CRS and {also}",
        file=places.map.path,
        field="terrain",
    )


# -- what heights count from, and how those of several logs are brought to one reference, never by a guess

#: Heights above the geoid of EGM96, and what to do where PROJ's grid of it is not there.
EGM96 = "EPSG:4326+5773"
NO_GRID = "no grid of EGM96 is installed (`projsync --file us_nga_egm96_15`)"
#: The geoid is nowhere further from the ellipsoid than this, m.
FARTHEST_M = 110.0
#: A column of heights is there where so large a share of the rows used has it.
MOST_ROWS = 0.9

_COUNTED = {
    "height_ellipsoid_m": "the ellipsoid",
    "height_sea_m": "sea level",
    "height_home_m": "take-off",
}


class HeightUse(NamedTuple):
    """Which heights of a stream are used: the column, m to add to each, and why, in a clause."""

    column: str
    add_m: float
    reason: str


class HeightPlan(NamedTuple):
    """One reference for the heights of a flight.

    Attributes
    ----------
    reference
        What they all count from then.
    uses
        By the streams' names.
    without
        Names of streams that have places and no heights.
    """

    reference: str
    uses: dict[str, HeightUse]
    without: tuple[str, ...] = ()


def undulation(latitude_deg: float, longitude_deg: float, heights: Any = EGM96) -> float | None:
    """How far that which heights count from is above the ellipsoid of WGS84 at a place, by a grid of PROJ.

    Parameters
    ----------
    latitude_deg, longitude_deg
        Of WGS84.
    heights
        A CRS with heights.

    Returns
    -------
    m; None where no grid is installed, or it does not reach there. Nothing is fetched.
    """
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    crs = CRS.from_user_input(heights)
    try:
        flat = Transformer.from_crs(CRS.from_epsg(4326), crs.to_2d(), always_xy=True)
        up = Transformer.from_crs(crs, CRS.from_epsg(4979), always_xy=True, allow_ballpark=False)
        found = float(up.transform(*flat.transform(longitude_deg, latitude_deg), 0.0)[2])
    except ProjError:  # no grid, or a file that is none
        return None
    return found if np.isfinite(found) and abs(found) <= FARTHEST_M else None


def choose_reference(
    streams: Mapping[str, Stream],
    own: Collection[str] = (),
    geoid_m: float | None = None,
    home_sea_m: float | None = None,
) -> HeightPlan:
    """One reference for heights: the ellipsoid where all streams can get there, else sea level, else refused.

    From sea level to the ellipsoid leads the geoid's height: as stated, else as a receiver of these streams
    logged it (the stream's own first), else PROJ's grid. From take-off to sea level leads the first used fix
    of the own flight, or what is stated.

    Parameters
    ----------
    streams
        By a name for messages; those without places and heights are passed over.
    own
        Names of the streams of one vehicle: heights above take-off are tied by these alone.
    geoid_m
        Height of the geoid above the ellipsoid there, stated, m.
    home_sea_m
        Height of the take-off above sea level, stated, m.

    Returns
    -------
    HeightPlan
        No sentence in it says how high the geoid is: that tells of a place.

    Raises
    ------
    WildlabError
        Where there is no one reference for all; it names streams, and what to state.
    """
    there = {name: _columns(stream) for name, stream in streams.items()}
    names = [name for name in streams if there[name]]
    ways = {
        name: {
            kind: HeightUse(column, 0.0, f"counts from {_COUNTED[column]}")
            for kind in ("ellipsoid", "sea")
            if (column := f"height_{kind}_m") in there[name]
        }
        for name in names
    }
    for name in names:
        if not ways[name]:
            tied = _tie(name, streams, there, [one for one in own if one in names], home_sea_m)
            if name in own and tied is not None:
                ways[name][tied[0]] = tied[1]
    homeless = [name for name in names if not ways[name]]
    if homeless:
        raise WildlabError(
            f"the heights of {listed(homeless)} count from take-off of unknown height",
            "state the take-off's height above sea level",
            field="heights",
        )
    geoid = {name: _geoid(name, streams, geoid_m) for name in names}
    for name in names:
        found = geoid[name]
        if found is None:
            continue
        way = ways[name]
        for has, lacks, sign, done in (
            ("sea", "ellipsoid", 1, "added"),
            ("ellipsoid", "sea", -1, "taken off"),
        ):
            if lacks not in way:
                reason = f"{way[has].reason}, and the geoid's height {found[1]} is {done}"
                way[lacks] = way[has]._replace(add_m=way[has].add_m + sign * found[0], reason=reason)
    for reference in ("ellipsoid", "sea"):
        if all(reference in ways[name] for name in names):
            return HeightPlan(
                reference, {name: ways[name][reference] for name in names}, tuple(streams.keys() - names)
            )
    low = [name for name in names if "ellipsoid" not in ways[name]]
    high = [name for name in names if "sea" not in ways[name]]
    raise WildlabError(
        f"the heights of {listed(low)} count from sea level, those of {listed(high)} from the ellipsoid",
        f"state the geoid's height above the ellipsoid; {NO_GRID}",
        field="heights",
    )


def _columns(stream: Stream) -> list[str]:
    """Columns of heights that most of the rows used have, or of all rows where none is used."""
    rows = stream.used if stream.used.any() else np.ones(len(stream), bool)
    return [
        name
        for name in _COUNTED
        if name in stream.columns and len(stream) and np.isfinite(_of(stream, name)[rows]).mean() >= MOST_ROWS
    ]


def _of(stream: Stream, column: str) -> Array:
    return np.asarray(stream.columns[column], float)


def _geoid(name: str, streams: Mapping[str, Stream], stated: float | None) -> tuple[float, str] | None:
    """The geoid's height for a stream, and where it is from."""
    if stated is not None:
        return stated, "as stated"
    for other in sorted(streams, key=lambda one: one != name):
        logged = _logged(streams[other])
        if logged is not None:
            return logged, f"as {'its own receiver' if other == name else other} has it"
    stream = streams[name]
    if {"latitude_deg", "longitude_deg"} <= stream.columns.keys():
        rows = stream.used
        latitude, longitude = (_of(stream, f"{axis}_deg")[rows] for axis in ("latitude", "longitude"))
        good = np.isfinite(latitude) & np.isfinite(longitude)
        if good.any():
            grid = undulation(float(np.median(latitude[good])), float(np.median(longitude[good])))
            return None if grid is None else (grid, "of EGM96")
    return None


def _logged(stream: Stream) -> float | None:
    """The geoid's height as a receiver has it; None where it has none, or a placeholder."""
    rows, columns = stream.used, stream.columns
    if "undulation_m" in columns:
        values = _of(stream, "undulation_m")[rows]
        values = values[np.isfinite(values) & (np.abs(values) <= FARTHEST_M) & (values != 0)]
        if len(values):
            return float(np.median(values))
    if {"height_ellipsoid_m", "height_sea_m"} <= columns.keys():
        apart = (_of(stream, "height_ellipsoid_m") - _of(stream, "height_sea_m"))[rows]
        apart = apart[np.isfinite(apart) & (np.abs(apart) <= FARTHEST_M)]
        # Two columns of the very same numbers are one reference written down twice.
        if len(apart) and (apart != 0).any():
            return float(np.median(apart))
    return None


def _tie(
    name: str,
    streams: Mapping[str, Stream],
    there: Mapping[str, list[str]],
    own: list[str],
    stated: float | None,
) -> tuple[str, HeightUse] | None:
    """What leads from heights above take-off to another reference."""
    column = "height_home_m"
    if stated is not None:
        use = HeightUse(column, stated, "counts from take-off, as stated")
        return "sea", use
    home = streams[name]
    for reference in ("sea", "ellipsoid"):
        fixed = f"height_{reference}_m"
        # A column that is there in too few rows to be used may still have the first fix.
        for other in [name, *(one for one in own if one != name)]:
            if fixed not in streams[other].columns or (other != name and fixed not in there[other]):
                continue
            apart = _first_fix(home, streams[other], fixed)
            if apart is not None:
                at = "its own first used fix" if other == name else f"the first used fix of {other}"
                counted = _COUNTED[fixed]
                return reference, HeightUse(column, apart, f"counts from take-off, tied to {counted} by {at}")
    return None


def _first_fix(home: Stream, fixes: Stream, fixed: str) -> float | None:
    """Height of the fix minus that above take-off, at the first used fix that both know."""
    above = np.where(home.used, _of(home, "height_home_m"), np.nan)
    height = np.where(fixes.used, _of(fixes, fixed), np.nan)
    if home is not fixes:
        clocks = [
            one for one in ("time_s", "time_log_s") if {one} <= home.columns.keys() & fixes.columns.keys()
        ]
        clock = next((one for one in clocks if np.isfinite(_of(home, one)[home.used]).any()), None)
        if clock is None:
            return None
        known = np.isfinite(above) & np.isfinite(_of(home, clock))
        stamps = _of(home, clock)[known]
        above = np.interp(_of(fixes, clock), stamps, above[known], left=np.nan, right=np.nan)
    both = np.flatnonzero(np.isfinite(above) & np.isfinite(height))
    return float(height[both[0]] - above[both[0]]) if len(both) else None
