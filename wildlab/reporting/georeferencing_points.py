"""Points on the ground, handed over by the report itself: metres for all, places where they are open."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.ground_file import points_geojson, with_axes
from wildlab.files import csv_text
from wildlab.flight.store import Flight
from wildlab.reporting.report import Report
from wildlab.reporting.tables import MOST_BYTES, data_link

#: What the table has of a point, m and degrees; times count from the first image.
COLUMNS = ("point", "seconds", "north_m", "east_m", "long_90_m", "short_90_m", "bearing_deg")


def points_table(points: pd.DataFrame) -> pd.DataFrame:
    """Places in local metres with their ellipses, without names, dates or anything else that locates them.

    Parameters
    ----------
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        With `COLUMNS`; ``seconds`` is the time since the first point, NaN where that is not known.
    """
    times = points["time_s"].to_numpy(float)
    first = np.nanmin(times) if np.isfinite(times).any() else np.nan
    table = with_axes(points).assign(point=np.arange(1, len(points) + 1), seconds=times - first)
    return table[list(COLUMNS)].round(3)


def points_section(report: Report, flight: Flight, points: pd.DataFrame, source: str) -> None:
    """All points as files within the page; how to get them where they are too many.

    Parameters
    ----------
    report
        Is added to.
    flight
        Whose they are. Only where its locations are open is there a GeoJSON with places.
    points
        From `wildlab.analysis.georeference.georeference`.
    source
        The poses that they come from; "" where the flight has one.
    """
    placed = int(points["north_m"].notna().sum())
    if not placed:
        return
    table = csv_text(points_table(points)).encode("utf-8")
    links = [data_link(table, "text/csv", "points.csv", "CSV, in local metres")]
    open_places = flight.manifest.locations.sensitivity == "open"
    if open_places:
        places = points_geojson(flight, points, source).encode("utf-8")
        links.append(data_link(places, "application/geo+json", "points.geojson", "GeoJSON, exact places"))
    kept = [link for link in links if link]
    lacking = len(links) - len(kept)
    said = f"**All {len(points)} points** with their 90 % ellipses; {placed} have a place."
    if lacking:
        kinds = "One file is" if lacking == 1 else "Both files are"
        said += f" {kinds} larger than the {MOST_BYTES // 1000} kB that a page carries. "
        said += "`wildlab georeference` writes them all."
    report.files(said, kept)
