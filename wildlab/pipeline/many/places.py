"""Where on the ground a sensor's detections lie, look by look: what a tracker of many targets is given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.pipeline.following.beliefs import Beliefs
from wildlab.pipeline.georeference import covariances_of, georeference, observe
from wildlab.pipeline.scans import Scans
from wildlab.tracking.many import Scan

Array = NDArray[np.float64]

#: Kinds of detections that tell a place.
ABLE = ("position", "range-bearing", "pixel")


class Places(NamedTuple):
    """Looks of one sensor.

    Attributes
    ----------
    sensor, kind
        Its name, and what it detects.
    scans
        N looks; ``sensor`` of each is ``order``.
    ids
        For each look the names of its detections, in their order.
    interval_s
        The usual time between two.
    without
        How many detections have no place: rays that miss the ground, looks outside of the platform's log.
    """

    sensor: str
    kind: str
    scans: list[Scan]
    ids: list[list[str]]
    interval_s: float
    without: int

    def distances(self) -> Array:
        """(D,) m of all detections from the platform."""
        return np.concatenate(
            [np.zeros(0), *(np.linalg.norm(one.z - one.platform, axis=1) for one in self.scans)]
        )

    def area(self, far: float) -> float:
        """Square metres that one look covers: of the camera's view, else all around as far as it sees."""
        views = [_area(one.view) for one in self.scans if one.view is not None]
        return float(np.median(views)) if views else float(np.pi * far**2)


def places_of(flight: Flight, scans: Scans, beliefs: Beliefs, order: int, source: str | None) -> Places:
    """The looks of a sensor as places with covariances.

    Parameters
    ----------
    scans, beliefs
        Of the sensor; the noise is that of the filters of one target.
    order
        Which of the sensors it is.
    source
        Name of the ``nav`` table, for pixels.

    Raises
    ------
    WildlabError
        Where its detections tell no place.
    """
    if scans.kind not in ABLE:
        raise WildlabError(
            f"the sensor {scans.sensor!r} detects {scans.kind!r}, which tells no place alone",
            f"follow many targets by sensors that detect {', '.join(ABLE)}; name them with --sensor",
            file=flight.folder,
            field="detections.kind",
        )
    if scans.kind == "pixel":
        z, R = _of_pixels(flight, scans, source)
    elif scans.kind == "position":
        z = scans.detections
        R = np.broadcast_to(np.diag(beliefs.noise**2), (*z.shape, 2))
    else:
        z, R = _of_ranges(scans, beliefs)
    usable = np.isfinite(scans.platform).all(axis=1)
    views = _views(scans)
    looks, ids, without = [], [], 0
    for row in np.flatnonzero(usable):
        there = np.isfinite(scans.detections[row]).all(axis=-1)
        good = there & np.isfinite(z[row]).all(axis=-1) & np.isfinite(R[row]).all(axis=(-2, -1))
        without += int((there & ~good).sum())
        time, platform = float(scans.times[row]), scans.platform[row]
        looks.append(Scan(time, order, platform, z[row][good], R[row][good], views[row]))
        ids.append([str(one) for one in scans.ids[row][good]])
    without += int(np.isfinite(scans.detections[~usable]).all(axis=-1).sum())
    return Places(scans.sensor, scans.kind, looks, ids, scans.interval_s, without)


def _of_ranges(scans: Scans, beliefs: Beliefs) -> tuple[Array, Array]:
    """Range on the level and bearing from north as a place; the covariance to first order."""
    distance, azimuth = scans.detections[..., 0], scans.detections[..., 1]
    drop = np.nan_to_num(scans.drop)[:, None] if len(scans.drop) else 0.0
    with np.errstate(invalid="ignore"):
        level = np.sqrt(np.maximum(distance**2 - drop**2, 0.0))
        stretch = np.divide(distance, level, out=np.ones_like(distance), where=level > 0)
    c, s = np.cos(azimuth), np.sin(azimuth)
    z = scans.platform[:, None] + np.stack([level * c, level * s], axis=-1)
    J = np.stack(
        [np.stack([stretch * c, -level * s], axis=-1), np.stack([stretch * s, level * c], axis=-1)], axis=-2
    )
    return z, J @ np.diag(beliefs.noise[:2] ** 2) @ np.swapaxes(J, -1, -2)


def _of_pixels(flight: Flight, scans: Scans, source: str | None) -> tuple[Array, Array]:
    """Rays where they meet the ground, with the errors of the pose: taken for each detection by itself."""
    observed = observe(flight, source)
    points = georeference(flight, observed, np.random.default_rng(0))
    points = points[points["source"] == scans.sensor] if "source" in points else points
    points = points.drop_duplicates("detection_id").set_index("detection_id")
    row = points.index.get_indexer(pd.Index(scans.ids.ravel()))
    z = points[["north_m", "east_m"]].to_numpy(float)[row]
    R = covariances_of(points.reset_index())[row]
    z[row < 0], R[row < 0] = np.nan, np.nan
    return z.reshape(*scans.ids.shape, 2), R.reshape(*scans.ids.shape, 2, 2)


def _views(scans: Scans) -> list[Array | None]:
    """The ground that each image shows; None where that is not known, or a corner looks past it."""
    if scans.poses is None:
        return [None] * len(scans.times)
    width, height = scans.poses.camera.width, scans.poses.camera.height
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    n = len(scans.times)
    each = scans.poses.take(np.repeat(np.arange(n), 4))
    ground = georeference_pixels(each, np.tile(corners, (n, 1)), np.repeat(scans.plane_down, 4))
    outline = ground[:, :2].reshape(n, 4, 2)
    return [one if np.isfinite(one).all() else None for one in outline]


def _area(corners: Array) -> float:
    x, y = corners.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
