"""Surveyed points out of KML: placemarks with a point."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.kml import read_kml_points
from wildlab.flight.readers.logs.log import RawLog
from wildlab.flight.readers.marks.marks import marks_log, marks_part


def recognise(head: bytes, name: str) -> bool:
    """Whether a file is KML, by its first element."""
    return head.lstrip(b"\xef\xbb\xbf \r\n\t")[:1] == b"<" and b"<kml" in head


def read(path: Path, data: bytes, zone: str | None = None) -> RawLog:
    """Points of placemarks; a height counts from sea level, and only where its mode is ``absolute``.

    Raises
    ------
    WildlabError
        Where it is no KML, or has no point.
    """
    points, others = read_kml_points(data, path)
    if not points:
        what = f"has {others} lines or areas and no point" if others else "has no point"
        raise WildlabError(what, "give placemarks with a point for each mark", file=path)
    place = np.array([one.place for one in points], float)
    absolute = np.array([one.mode == "absolute" for one in points], bool)
    part = marks_part(
        {
            "name": [one.name for one in points],
            "longitude_deg": place[:, 0],
            "latitude_deg": place[:, 1],
            "height_sea_m": np.where(absolute, place[:, 2], np.nan),
        },
        range(1, len(points) + 1),
        "point",
    )
    notes = []
    ground = int((~absolute & (place[:, 2] != 0) & np.isfinite(place[:, 2])).sum())
    if ground:
        notes.append(
            f"{ground} of {len(points)} heights are not used: their altitudeMode is not absolute, so that "
            "they count from the ground, or not at all"
        )
    if not absolute.all():
        notes.append(
            f"{int((~absolute).sum())} of {len(points)} points have no height above sea level: where theirs "
            "count from sea level, write <altitudeMode>absolute</altitudeMode> before <coordinates>; or give "
            "a table with the columns name, latitude, longitude and height_sea"
        )
    lost = [f"{others} lines, areas or models: only points are marks"] if others else []
    return marks_log("marks-kml", part, lost, notes)
