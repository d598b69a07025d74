"""The map of the page, from a flight: what the other reports draw in colours, here in three."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe
from wildlab.analysis.overviews.overview import look_over
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.sharing.edition.picture import MapPicture

Array = NDArray[np.float64]


def map_of(flight: Flight, source: str | None = None) -> MapPicture | None:
    """Way, sightings and true places of a flight, as it is: generalise it before, where that is needed.

    Parameters
    ----------
    flight
        Whatever it lacks.
    source
        Name of its poses; None for the best known ones.

    Returns
    -------
    MapPicture or None
        None where there is nothing to put on it. Without poses there is no way of the aircraft on it.
    """
    overview = look_over(flight, source)
    path = overview.path
    flown = path is not None and path.who.startswith("nav/")
    way = path.place[:, :2] if flown and path is not None else np.empty((0, 2))
    found = MapPicture(way, _seen(flight, overview.source), _true(flight))
    return found if any(np.isfinite(one).any() for one in found) else None


def _seen(flight: Flight, source: str | None) -> Array:
    if source is None or flight.detections is None or flight.manifest.camera is None:
        return np.empty((0, 2))
    try:
        seen = observe(flight, source)
    except WildlabError:
        return np.empty((0, 2))
    return georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]


def _true(flight: Flight) -> Array:
    if flight.truth is None:
        return np.empty((0, 2))
    return flight.truth[["north_m", "east_m"]].to_numpy(float)
