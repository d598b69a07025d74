"""Points on the ground as a file: metres for a table, places for a map."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.store import Flight
from wildlab.geometry.frames import ned_to_geodetic
from wildlab.geometry.uncertainty import ellipse_axes
from wildlab.pipeline.georeference import covariances_of

#: What is written, by the end of the name.
SUFFIXES = (".csv", ".geojson")


def with_axes(points: pd.DataFrame) -> pd.DataFrame:
    """The points with half axes (m) and bearing (deg) of their 90 % ellipses.

    Parameters
    ----------
    points
        From `wildlab.pipeline.georeference.georeference`.

    Returns
    -------
    DataFrame
        With ``long_90_m``, ``short_90_m`` and ``bearing_deg``.
    """
    long, short, bearing = ellipse_axes(covariances_of(points))
    return points.assign(long_90_m=long, short_90_m=short, bearing_deg=np.degrees(bearing) % 180)


def write_points(flight: Flight, points: pd.DataFrame, path: Path) -> None:
    """Write points as CSV (metres from the flight's origin) or GeoJSON (WGS84 longitude, latitude, height).

    Parameters
    ----------
    flight
        Whose they are.
    points
        From `wildlab.pipeline.georeference.georeference`; those without a place are in the CSV alone.
    path
        Ends with one of `SUFFIXES`.

    Raises
    ------
    WildlabError
        Where it ends otherwise.
    """
    table = with_axes(points)
    if path.suffix == ".csv":
        write_atomic(path, table.to_csv(index=False, float_format="%.3f"))
    elif path.suffix == ".geojson":
        write_atomic(path, json.dumps(_geojson(flight, table), allow_nan=False))
    else:
        raise WildlabError(
            f"nobody knows how to write {path.suffix!r}", "end it with .csv or .geojson", file=path
        )


def _geojson(flight: Flight, table: pd.DataFrame) -> dict[str, object]:
    placed = table[table["north_m"].notna() & table["down_m"].notna()]
    llh = ned_to_geodetic(
        placed[["north_m", "east_m", "down_m"]].to_numpy(float), flight.manifest.origin_tuple()
    )
    kept = [
        n
        for n in (
            "detection_id",
            "frame_id",
            "target_id",
            "long_90_m",
            "short_90_m",
            "bearing_deg",
            "ellipse",
        )
    ]
    features = []
    for (latitude, longitude, height), row in zip(llh, placed[kept].to_dict("records"), strict=True):
        properties = {
            key: None if isinstance(v, float) and not np.isfinite(v) else v for key, v in row.items()
        }
        place = [
            round(float(np.degrees(longitude)), 8),
            round(float(np.degrees(latitude)), 8),
            round(float(height), 3),
        ]
        features.append(
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": place}, "properties": properties}
        )
    return {"type": "FeatureCollection", "features": features}
