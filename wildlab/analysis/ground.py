"""What the ground of a flight is, points on it as files for maps, and what a level plane would have given."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis import Fact, fact
from wildlab.analysis.georeference import Observations, covariances_of
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_csv
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import ellipse_axes
from wildlab.geometry.frames import Array, ned_to_geodetic
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.terrain import Terrain


class Shift(NamedTuple):
    """How far points on terrain lie from those on a level plane, metres, horizontally.

    Attributes
    ----------
    n
        How many points are on both.
    median, largest
        Of the distances; NaN where there is none.
    """

    n: int
    median: float
    largest: float


def level_of(observations: Observations) -> Array:
    """Down coordinate (N,) of the plane that would serve without terrain: as stated, else under the lens."""
    ground: Terrain | None = observations.terrain
    if ground is None or observations.level is None:
        return observations.plane_down
    p_nc = np.broadcast_to(observations.poses.p_nc, (len(observations.uv), 3))
    under = -ground.heights_at(p_nc[:, :2])
    return np.where(np.isfinite(observations.level), observations.level, under)


def on_level(observations: Observations) -> Observations:
    """The same observations as they would be without terrain."""
    return replace(observations, plane_down=level_of(observations), terrain=None, level=None)


def shift_from_level(observations: Observations, points: pd.DataFrame) -> Shift:
    """How far points lie from where a level plane would have put them.

    Parameters
    ----------
    observations
        Of a flight with terrain.
    points
        From `wildlab.analysis.georeference.georeference`, of these.

    Returns
    -------
    Shift
    """
    level = georeference_pixels(observations.poses, observations.uv, level_of(observations))[:, :2]
    off = np.linalg.norm(points[["north_m", "east_m"]].to_numpy(float) - level, axis=1)
    off = off[np.isfinite(off)]
    if not len(off):
        return Shift(0, float("nan"), float("nan"))
    return Shift(len(off), float(np.median(off)), float(off.max()))


def ground_facts(observations: Observations, points: pd.DataFrame) -> list[Fact]:
    """What the points lie on, what became of the rays, and what a plane would have given.

    Parameters
    ----------
    observations, points
        As for `shift_from_level`; without terrain there is less to say.

    Returns
    -------
    list of Fact
        Of ``data/messages/en/terminal.toml``.
    """
    placed, of = int(points["north_m"].notna().sum()), len(points)
    if observations.terrain is None:
        return [fact("ground-level", placed=placed, of=of)]
    became = "; ".join(f"{n} {words}" for words, n in points["ray"].value_counts().items())
    found = [fact("ground-terrain", of=of, became=became or "none")]
    shift = shift_from_level(observations, points)
    if shift.n:
        median, largest = f"{shift.median:.2f}", f"{shift.largest:.2f}"
        found.append(fact("ground-shift", n=shift.n, median=median, largest=largest))
    kinds = points["ellipse"].value_counts()
    sampled, split, unbounded = (int(kinds.get(name, 0)) for name in ("sampled", "split", "unbounded"))
    if sampled + split:
        key = "ground-split" if split else "ground-sampled"
        found.append(fact(key, sampled=sampled + split, split=split, placed=placed))
    if unbounded:
        found.append(fact("ground-unbounded", unbounded=unbounded, placed=placed))
    return found


#: What is written, by the end of the name.
SUFFIXES = (".csv", ".geojson")
#: Share of the truth that the ellipses are to hold, and corners of one as a polygon.
LEVEL, CORNERS = 0.9, 72
#: What heights on a map count from.
ELLIPSOID = "height above the WGS 84 ellipsoid"


def with_axes(points: pd.DataFrame) -> pd.DataFrame:
    """The points with half axes (m) and bearing (deg) of their 90 % ellipses.

    Parameters
    ----------
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        With ``long_90_m``, ``short_90_m`` and ``bearing_deg``.
    """
    long, short, bearing = ellipse_axes(covariances_of(points))
    return points.assign(long_90_m=long, short_90_m=short, bearing_deg=np.degrees(bearing) % 180)


def write_points(flight: Flight, points: pd.DataFrame, path: Path, source: str = "") -> None:
    """Write points as CSV (metres from the flight's origin), or as GeoJSON with their ellipses as polygons
    (WGS84 longitude, latitude, of points the height above the ellipsoid).

    Parameters
    ----------
    flight
        Whose they are.
    points
        From `wildlab.analysis.georeference.georeference`; those without a place are in the CSV alone.
    path
        Ends with one of `SUFFIXES`.
    source
        The poses that they come from.

    Raises
    ------
    WildlabError
        Where it ends otherwise.
    """
    if path.suffix == ".csv":
        table = _described(flight, points, "down from the flight's origin", source)
        write_csv(path, table, "%.3f")
    elif path.suffix == ".geojson":
        write_atomic(path, points_geojson(flight, points, source, ellipses=True))
    else:
        raise WildlabError(
            f"nobody knows how to write {path.suffix!r}", f"end it with {' or '.join(SUFFIXES)}", file=path
        )


def points_geojson(flight: Flight, points: pd.DataFrame, source: str = "", *, ellipses: bool = False) -> str:
    """Points as the text of a GeoJSON file: exact places.

    Parameters
    ----------
    flight, points, source
        As for `write_points`.
    ellipses
        Whether a polygon for each ellipse follows the points.

    Returns
    -------
    str
        One feature for each point that has a place.
    """
    table = _described(flight, points, ELLIPSOID, source)
    placed = table[table["north_m"].notna() & table["down_m"].notna()]
    degrees = _degrees(flight, placed[["north_m", "east_m", "down_m"]].to_numpy(float))
    places: list[object] = [[*row[:2].round(8).tolist(), round(float(row[2]), 3)] for row in degrees]
    features = _features(placed, "Point", places)
    if ellipses:
        known = placed[placed["long_90_m"].notna() & placed["short_90_m"].notna()]
        rings = [[_degrees(flight, one)[:, :2].round(8).tolist()] for one in _rings(known)]
        features += _features(known, "Polygon", rings)
    content = {"type": "FeatureCollection", "features": features}
    return json.dumps(content, allow_nan=False, separators=(",", ":"))


def _features(table: pd.DataFrame, kind: str, places: Sequence[object]) -> list[dict[str, object]]:
    """One feature a row, with what `PROPERTIES` names."""
    rows = table[[name for name in PROPERTIES if name in table]].to_dict("records")
    known = [{key: None if value != value else value for key, value in row.items()} for row in rows]
    return [
        {"type": "Feature", "geometry": {"type": kind, "coordinates": place}, "properties": row}
        for place, row in zip(places, known, strict=True)
    ]


def _described(flight: Flight, points: pd.DataFrame, vertical: str, source: str) -> pd.DataFrame:
    """The points with what they lie on, and how their ellipses were found."""
    ground = "level ground" if flight.terrain is None else "terrain"
    kinds = points["ellipse"].fillna("")
    return with_axes(points).assign(
        level=LEVEL,
        method=[f"{ground}, ellipse {kind}" if kind else ground for kind in kinds],
        vertical_reference=vertical,
        source=source,
        flight=flight.name,
    )


#: What goes along with a point into a map.
PROPERTIES = (
    "detection_id", "frame_id", "target_id", "time_s", "long_90_m", "short_90_m", "bearing_deg", "level",
    "ellipse", "method", "vertical_reference", "source", "flight",
)  # fmt: skip


def _degrees(flight: Flight, place: Array) -> Array:
    llh = ned_to_geodetic(place, flight.manifest.origin_tuple())
    return np.stack([np.degrees(llh[:, 1]), np.degrees(llh[:, 0]), llh[:, 2]], axis=1)


def _rings(placed: pd.DataFrame) -> Array:
    """(N, CORNERS + 1, 3) m in n, closed, the ellipses at the heights of their points."""
    turn = np.linspace(0, 2 * np.pi, CORNERS + 1)
    along = placed["long_90_m"].to_numpy(float)[:, None] * np.cos(turn)
    across = placed["short_90_m"].to_numpy(float)[:, None] * np.sin(turn)
    bearing = np.radians(placed["bearing_deg"].to_numpy(float))[:, None]
    north = along * np.cos(bearing) - across * np.sin(bearing)
    east = along * np.sin(bearing) + across * np.cos(bearing)
    middle = placed[["north_m", "east_m", "down_m"]].to_numpy(float)[:, None, :]
    return middle + np.stack([north, east, np.zeros_like(north)], axis=2)
