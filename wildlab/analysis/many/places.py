"""Where on the ground a sensor's detections lie, look by look: what a tracker of many targets is given."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.following.noise_model import NoiseModel
from wildlab.analysis.georeference import covariances_of, georeference, observe
from wildlab.analysis.many.errors import (
    NO_ERRORS,
    LastingErrors,
    of_elements,
    of_pixels,
    of_poses,
    told_errors,
)
from wildlab.analysis.scans import Scans
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.geometry.camera import in_image, project
from wildlab.tracking.filters import thin
from wildlab.tracking.many import Scan
from wildlab.tracking.many.target_model import Sees

Array = NDArray[np.float64]

#: Kinds of detections that tell a place, and what tells of the place of a target that is known already.
PLACED = ("position", "range-bearing", "pixel")
ABLE = (*PLACED, "bearing")
#: Looks, and places about the platform, by which it is found how much of the ground an image shows.
MOST_LOOKS, PLACES = 50, 4000


def _disc(count: int) -> Array:
    """(count, 2) places of a disc of radius one, evenly spread: a spiral whose turns never fall in line."""
    number = np.arange(count) + 0.5
    angle = np.pi * (3 - np.sqrt(5)) * number
    return np.asarray(np.sqrt(number / count)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


_DISC = _disc(PLACES)


class PlacedLooks(NamedTuple):
    """Looks of one sensor.

    Attributes
    ----------
    sensor, kind
        Its name, and what it detects.
    scans
        N looks; ``sensor`` of each is ``order``.
    named
        For each look the targets that its detections name: never told to the tracker.
    interval_s
        The usual time between two.
    without
        How many detections have no place: rays that miss the ground, looks outside of the platform's log.
    errors
        What the detections of a look have in common, as ``shared`` of each look has it.
    """

    sensor: str
    kind: str
    scans: list[Scan]
    named: list[frozenset[str]]
    interval_s: float
    without: int
    errors: LastingErrors = NO_ERRORS

    @property
    def bearings(self) -> bool:
        """Whether it measures bearings, which tell no place alone."""
        return self.kind not in PLACED

    def distances(self) -> Array:
        """(D,) m of all detections from the platform; none of bearings."""
        if self.bearings:
            return np.zeros(0)
        return np.concatenate(
            [np.zeros(0), *(np.linalg.norm(one.z - one.platform, axis=1) for one in self.scans)]
        )

    def area(self, far: float) -> float:
        """Square metres that one look covers: of all around as far as it sees, what its camera shows."""
        disc = float(np.pi * far**2)
        looked = [one for one in self.scans if one.sees is not None]
        shares = [
            float(one.sees(one.platform + far * _DISC).mean())
            for one in looked[:: max(len(looked) // MOST_LOOKS, 1)]
            if one.sees is not None
        ]
        return disc * max(float(np.median(shares)), 1 / len(_DISC)) if shares else disc


def places_of(
    flight: Flight, scans: Scans, beliefs: NoiseModel, order: int, source: str | None, lasting_s: float = 0.0
) -> PlacedLooks:
    """The looks of a sensor as places, what each is wrong by alone, and what they have in common.

    Parameters
    ----------
    scans, beliefs
        Of the sensor; noise and considered errors are those of the filters of one target. Bearings have none
        that last.
    order
        Which of the sensors it is.
    lasting_s
        For how long errors of the pose last, of a camera.
    source
        Name of the ``nav`` table, for pixels.

    Raises
    ------
    WildlabError
        Where its detections tell nothing of a place.
    """
    if scans.kind not in ABLE:
        raise WildlabError(
            f"the sensor {scans.sensor!r} detects {scans.kind!r}, which tells nothing of a place",
            f"follow many targets by sensors that detect {', '.join(ABLE)}; name them with --sensor",
            file=flight.folder,
            field="detections.kind",
        )
    shared, errors = np.zeros((*scans.detections.shape[:2], 2, 0)), NO_ERRORS
    if scans.kind == "pixel":
        z, R, shared, errors = _of_pixels(flight, scans, beliefs, source, lasting_s)
    elif scans.kind == "position":
        z = scans.detections
        R = np.broadcast_to(np.diag(beliefs.noise**2), (*z.shape, 2))
    elif scans.kind == "bearing":
        z = scans.detections[..., :1]
        R = np.broadcast_to(np.diag(beliefs.noise[:1] ** 2), (*z.shape, 1))
    else:
        z, R = _of_ranges(scans, beliefs)
    if scans.kind in ("position", "range-bearing"):
        shared, errors = of_elements(scans, beliefs, z)
    usable = np.isfinite(scans.platform).all(axis=1)
    looks, named, without = [], [], 0
    for row in np.flatnonzero(usable):
        there = np.isfinite(scans.detections[row]).all(axis=-1)
        good = there & np.isfinite(z[row]).all(axis=-1) & np.isfinite(R[row]).all(axis=(-2, -1))
        good &= np.isfinite(shared[row]).all(axis=(-2, -1))
        without += int((there & ~good).sum())
        time, platform = float(scans.times[row]), scans.platform[row]
        sees, common = sees_of(scans, int(row)), shared[row][good] if errors.names else None
        looks.append(Scan(time, order, platform, z[row][good], R[row][good], sees, common))
        named.append(frozenset(str(one) for one in scans.labels[row] if one))
    without += int(np.isfinite(scans.detections[~usable]).all(axis=-1).sum())
    return PlacedLooks(scans.sensor, scans.kind, looks, named, scans.interval_s, without, errors)


def thinned(places: PlacedLooks, apart_s: float) -> PlacedLooks:
    """Only looks at least so far apart, see `wildlab.tracking.filters.thin`."""
    kept = np.flatnonzero(thin([scan.time for scan in places.scans], apart_s))
    return places._replace(
        scans=[places.scans[row] for row in kept], named=[places.named[row] for row in kept]
    )


def _of_ranges(scans: Scans, beliefs: NoiseModel) -> tuple[Array, Array]:
    """Range on the level and bearing from north as a place; the covariance to first order.

    A range no longer than the drop tells no place: NaN.
    """
    distance, azimuth = scans.detections[..., 0], scans.detections[..., 1]
    drop = np.nan_to_num(scans.drop)[:, None] if len(scans.drop) else 0.0
    with np.errstate(invalid="ignore"):
        level = np.sqrt(np.maximum(distance**2 - drop**2, 0.0))
        level = np.where(level > 0, level, np.nan)
        stretch = distance / level
    c, s = np.cos(azimuth), np.sin(azimuth)
    z = scans.platform[:, None] + np.stack([level * c, level * s], axis=-1)
    J = np.stack(
        [np.stack([stretch * c, -level * s], axis=-1), np.stack([stretch * s, level * c], axis=-1)], axis=-2
    )
    return z, J @ np.diag(beliefs.noise[:2] ** 2) @ np.swapaxes(J, -1, -2)


def _of_pixels(
    flight: Flight, scans: Scans, beliefs: NoiseModel, source: str | None, lasting_s: float
) -> tuple[Array, Array, Array, LastingErrors]:
    """Rays where they meet the ground, what each is wrong by alone, and what the poses do to all."""
    observed = observe(flight, source, clock_shift=beliefs.offset_s)
    told = told_errors(flight, observed, beliefs)
    points = georeference(flight, observed, np.random.default_rng(0), told)
    of_pose = of_poses(flight, observed, told, beliefs, lasting_s)
    own, shared, errors = of_pixels(observed, told, of_pose, covariances_of(points), lasting_s)
    ids = pd.Index(points["detection_id"])
    row = pd.Index(ids[~ids.duplicated()]).get_indexer(pd.Index(scans.ids.ravel()))
    row = np.where(row < 0, -1, np.flatnonzero(~ids.duplicated())[row])
    z = points[["north_m", "east_m"]].to_numpy(float)
    found = [np.where((row < 0).reshape(-1, *[1] * (part.ndim - 1)), np.nan, part[row])
             for part in (z, own, shared)]  # fmt: skip
    z, own, shared = (part.reshape(*scans.ids.shape, *part.shape[1:]) for part in found)
    return z, own, shared, errors


def sees_of(scans: Scans, row: int) -> Sees | None:
    """What the image of a look shows of the plane that targets move on; None where it is of no camera."""
    poses = scans.poses
    if poses is None:
        return None
    down, origin, R_nc = scans.plane_down[row], poses.p_nc[row], poses.R_nc[row]

    def sees(places: Array) -> NDArray[np.bool_]:
        at = np.concatenate([places, np.full((len(places), 1), down)], axis=1)
        return in_image(poses.camera, project(poses.camera, (at - origin) @ R_nc))

    return sees
