"""Known points in images: where they were clicked, and where the poses have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import POSE, thin
from wildlab.flight.checks.mistakes import Misfit
from wildlab.flight.clocks import between, frame_times, gimbal_angles, poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array, Origin
from wildlab.geometry.mount import Mount, camera_pose

#: So many points say all there is to say, and fewer than so many say nothing.
MOST, ENOUGH = 200, 4
#: A position makes no angle beyond this (rad): else a point that is near would be expected anywhere.
NEAR = 0.1
#: Points and images in a half that can be looked at by itself.
ENOUGH_HALF, IMAGES_HALF = 4, 2
#: What is usual where neither log nor manifest says: position (m, horizontal and vertical), attitude (rad).
USUAL_HORIZONTAL, USUAL_VERTICAL, USUAL_ATTITUDE, USUAL_PIXEL = 2.0, 3.0, np.radians(1.5), 2.0
#: A mount turned by a few degrees and a position some metres off are no wrong meaning: they are allowed for.
#: Standard deviations (rad, m), of three turns and three shifts.
ALLOWED = np.array([np.radians(3.0)] * 3 + [3.0, 3.0, 5.0])
ROUNDS = 4
#: Attitudes are not known better than this at the lens, whatever is stated: mounts give and clocks differ.
LEAST_ATTITUDE = np.radians(0.3)


class SightingGeometry(NamedTuple):
    """What changes with time: poses, points (M, N, 3), angles of the gimbal."""

    p_nb: Array
    R_nb: Array
    points: Array
    pan: Array
    tilt: Array


@dataclass(frozen=True)
class Sightings:
    """Clicks on known points, N rows.

    Attributes
    ----------
    source
        Name of the nav table.
    camera, mount, pan, tilt
        As the manifest and the log have them; angles (N,) in radians.
    uv
        (N, 2) pixels.
    p_nb, R_nb
        Poses of the airframe, (N, 3) and (N, 3, 3).
    points
        (M, N, 3): where the known point is, or M that it may be, in n.
    image
        (N,) number of the image, in the order of time.
    sd
        (N, 4): expected standard deviations of the attitude (rad, the mean of its angles), the position (m),
        and the click (px); and of the angle that is known least (rad).
    origin
        Of frame n.
    looked
        Poses, angles of the gimbal and known points as they were a shift in seconds later.
    labels, frames
        (N,) name of the point, (N,) name of the image.
    own_gimbal
        Whether its angles are the log's.
    named
        Whether it is said of which point each is.
    """

    source: str
    camera: Camera
    mount: Mount
    pan: Array
    tilt: Array
    uv: Array
    p_nb: Array
    R_nb: Array
    points: Array
    image: NDArray[np.intp]
    sd: Array
    origin: Origin
    looked: Callable[[float], SightingGeometry]
    labels: NDArray[np.object_]
    frames: NDArray[np.object_]
    own_gimbal: bool = False
    named: bool = True

    def take(self, rows: NDArray[np.bool_]) -> Sightings:
        """Some of the rows; the poses at other times go with them."""

        def looked(shift: float) -> SightingGeometry:
            at = self.looked(shift)
            p, R, pan, tilt = (value[rows] for value in (at.p_nb, at.R_nb, at.pan, at.tilt))
            return SightingGeometry(p, R, at.points[:, rows], pan, tilt)

        names = ("pan", "tilt", "uv", "p_nb", "R_nb", "image", "sd", "labels", "frames")
        taken = {name: getattr(self, name)[rows] for name in names}
        return replace(self, points=self.points[:, rows], looked=looked, **taken)

    def shifted(self, by: float) -> Sightings:
        """The same sightings, had the camera's clock been so many seconds later."""
        return replace(self, **self.looked(by)._asdict())


def sightings(flight: Flight, source: str) -> Sightings | None:
    """The clicks on known points, with the poses of one nav source; None where there are too few.

    Parameters
    ----------
    flight
        With frames, pixel detections, poses and truth, or less.
    source
        Name of the nav table.

    Returns
    -------
    Sightings or None
    """
    manifest, frames, detections, truth = flight.manifest, flight.frames, flight.detections, flight.truth
    if manifest.camera is None or detections is None or truth is None or not len(truth):
        return None
    if frames is None or frames["frame_id"].duplicated().any() or "u_px" not in detections:
        return None
    if manifest.mount.poses not in ("", source):
        return None  # the mount says nothing of a camera on these poses
    rows = (detections["kind"] == "pixel").to_numpy() & np.isfinite(detections["u_px"].to_numpy())
    named = "target_id" in detections and manifest.scoring.rule == "labelled"
    if named:
        names = detections["target_id"]
        labelled = rows & names.isin(truth["target_id"]).to_numpy()
        # Where none names a target, as a detector's do not, each may be of any of them; or of something else.
        named = bool(labelled.any())
        rows = labelled if named else rows & (names.isna() | (names == "")).to_numpy()
    frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(detections["frame_id"]))
    chosen = np.flatnonzero(rows & (frame >= 0))
    if len(chosen) < ENOUGH:
        return None
    chosen = chosen[thin(len(chosen), MOST)]
    frame, detections = frame[chosen], detections.iloc[chosen]
    nav = flight.nav[source]
    brief = nav[[name for name in nav if name in (*POSE, "frame_id")]]  # covariances take long
    ids = detections["frame_id"]
    labels = detections["target_id"].to_numpy(object) if named else None
    try:
        times = frame_times(flight)[frame]
        still = tuple(angle[frame] for angle in gimbal_angles(flight))
        moving = None if "pan_rad" in frames else flight.gimbal

        def looked(shift: float) -> SightingGeometry:
            p, R, _ = poses_at(brief, times + shift, ids)
            pan, tilt = still
            if moving is not None:
                turns = np.unwrap(moving[["pan_rad", "tilt_rad"]].to_numpy(float), axis=0)
                pan, tilt = between(moving["time_s"].to_numpy(float), turns, times + shift, "gimbal").T
            return SightingGeometry(p, R, _points(flight, times + shift, labels), pan, tilt)

        at = looked(0.0)
        _, _, P = poses_at(nav, times, ids)
    except (WildlabError, ValueError):  # said by the checks of times
        return None
    order = np.argsort(times, kind="stable")
    number = np.empty(len(times), np.intp)
    number[order] = pd.factorize(ids.to_numpy(object)[order])[0]
    found = Sightings(
        source=source,
        camera=manifest.geometry_camera(),
        mount=manifest.geometry_mount(),
        uv=detections[["u_px", "v_px"]].to_numpy(float),
        **at._asdict(),
        image=number,
        sd=_expected(flight, P, len(chosen)),
        origin=manifest.origin_tuple(),
        looked=looked,
        labels=np.full(len(chosen), "", object) if labels is None else labels,
        frames=ids.to_numpy(object),
        own_gimbal=flight.gimbal is not None or "pan_rad" in frames,
        named=named,
    )
    known = np.isfinite(at.p_nb).all(axis=1) & np.isfinite(at.R_nb).all(axis=(1, 2))
    known &= np.isfinite(at.points).all(axis=2).any(axis=0) & np.isfinite(at.pan + at.tilt)
    return found.take(known) if known.sum() >= ENOUGH else None


def _points(flight: Flight, times: Array, labels: NDArray[np.object_] | None) -> Array:
    """(M, N, 3) where the targets are; with labels (1, N, 3)."""
    truth = flight.table("truth")
    if labels is not None:
        truth = truth[truth["target_id"].isin(labels)]
    names, there = truth_at(truth, times, offset_s=flight.manifest.clocks.truth_offset_s)
    if labels is None:
        return there
    return there[pd.Index(names).get_indexer(pd.Index(labels)), np.arange(len(times))][None]


def _expected(flight: Flight, P: Array | None, n: int) -> Array:
    stated = flight.manifest.uncertainty
    angles = [stated.tilt_deg, stated.tilt_deg, stated.heading_deg]
    turns = [USUAL_ATTITUDE if angle is None else np.radians(angle) for angle in angles]
    level = stated.position_horizontal_m or USUAL_HORIZONTAL
    place = np.hypot(level, stated.position_vertical_m or USUAL_VERTICAL) / np.sqrt(2)
    sd = np.tile([np.mean(turns), place, stated.pixel_px or USUAL_PIXEL, max(turns)], (n, 1))
    if P is not None:
        with np.errstate(invalid="ignore"):
            own = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        good = np.isfinite(own).all(axis=1)
        sd[good, 0], sd[good, 1] = own[good, 3:].mean(axis=1), own[good, :3].mean(axis=1)
        sd[good, 3] = own[good, 3:].max(axis=1)
    sd[:, [0, 3]] = np.maximum(sd[:, [0, 3]], LEAST_ATTITUDE)
    return sd


@dataclass(frozen=True)
class Missed:
    """How far rays miss the known points: rotation vectors in c (N, 3) from the point to the ray, distances
    (N,) m, directions to the point in c (N, 3), attitude of the camera (N, 3, 3), expected angles (N,)."""

    turn: Array
    distance: Array
    towards: Array
    R_nc: Array
    expected: Array

    @property
    def good(self) -> NDArray[np.bool_]:
        """Rows (N,) whose pixel has a ray."""
        return np.asarray(np.isfinite(self.turn).all(axis=1))

    @property
    def angle(self) -> Array:
        """Sizes (N,) of the misses, rad."""
        return np.asarray(np.linalg.norm(self.turn, axis=1))

    @property
    def across(self) -> Array:
        """(N, 3, 3): how misses grow with a turn in c."""
        d = self.towards
        return np.eye(3) - d[:, :, None] * d[:, None, :]


def missed(s: Sightings) -> Missed:
    """How far the rays of clicks miss the known points, as angles at the lens.

    Other than on the ground or in the image, it is a number also for a ray into the sky, or a point behind
    the lens. With several points that may be meant, it is the nearest one's.
    """
    p, R = camera_pose(s.mount, s.p_nb, s.R_nb, s.pan, s.tilt)
    xy = normalise(s.camera, s.uv)
    r = np.column_stack([xy, np.ones(len(xy))])
    r /= np.linalg.norm(r, axis=1)[:, None]
    away = s.points - p
    distance = np.linalg.norm(away, axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        d = np.einsum("nji,mnj->mni", R, away) / distance[..., None]
        cosine = np.einsum("mni,ni->mn", d, r)
    nearest = np.argmax(np.where(np.isfinite(cosine), cosine, -2), axis=0)
    row = np.arange(len(r))
    d, distance = d[nearest, row], distance[nearest, row]
    cross = np.cross(d, r)
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, np.einsum("ni,ni->n", d, r))
    with np.errstate(invalid="ignore", divide="ignore"):
        turn = cross / np.maximum(sine, 1e-12)[:, None] * angle[:, None]
        expected = np.sqrt(
            s.sd[:, 0] ** 2
            + np.minimum(s.sd[:, 1] / np.maximum(distance, 1.0), NEAR) ** 2
            # By the image's width: what is expected must not depend on a focal length that may be wrong.
            + (s.sd[:, 2] / s.camera.width) ** 2
        )
    return Missed(turn, distance, d, R, expected)


def robust_scale(size: Array) -> float:
    """Standard deviation per axis of errors in two dimensions, from the median of their sizes (N,)."""
    return float(np.median(size)) / 1.1774 if len(size) else float("nan")


def left_over(m: Missed, fit: NDArray[np.bool_]) -> Array:
    """Sizes (N,) of the misses less what is allowed for, in radians, by a fit to some rows.

    Allowed for are a small turn of the camera and a small shift of the position: robust least squares, held
    near zero by what is usual of both.
    """
    shift = np.cross(np.swapaxes(m.R_nc, 1, 2), m.towards[:, :, None], axisa=1, axisb=1, axisc=1)
    J = np.concatenate([m.across, shift / np.maximum(m.distance, 1.0)[:, None, None]], axis=2)
    e, expected, rows = m.turn[fit], m.expected[fit], J[fit]
    value = np.zeros(6)
    for _ in range(ROUNDS):
        size = np.linalg.norm(e - rows @ value, axis=1)
        scale = np.maximum(robust_scale(size), expected / 3)
        weight = 1 / (1 + (size / (2 * scale)) ** 2) / scale**2
        A = np.einsum("nia,n,nib->ab", rows, weight, rows) + np.diag(ALLOWED**-2.0)
        value = np.linalg.solve(A, np.einsum("nia,n,ni->a", rows, weight, e))
    return np.asarray(np.linalg.norm(m.turn - J @ value, axis=1))


def misfit(s: Sightings, halves: bool = True) -> Misfit:
    """Misses of the whole and of each half, (2, 3), in units of what is expected.

    What is allowed for is found on one half and taken off the other; the second row is without.

    NaN where a half is too small or not asked for, infinite where the lens has no rays.
    """
    m = missed(s)
    good = m.good
    if good.mean() < 0.5 or good.sum() < ENOUGH:
        return np.full((2, 3), np.inf)
    result = np.full((2, 3), np.nan)
    result[:, 0] = _sizes(m, good, good)
    parts = [half & good for half in halves_of(s.image)] if halves else []
    enough = [part.sum() >= ENOUGH_HALF and len(np.unique(s.image[part])) >= IMAGES_HALF for part in parts]
    if parts and all(enough):
        for column, (fit, judged) in enumerate((parts, parts[::-1]), start=1):
            result[:, column] = _sizes(m, fit, judged)
    return result


def glance(s: Sightings) -> Array:
    """The misfit of the whole alone, (2,)."""
    return misfit(s, halves=False)[:, 0]


def _sizes(m: Missed, fit: NDArray[np.bool_], judged: NDArray[np.bool_]) -> Array:
    sizes = (left_over(m, fit), m.angle)
    return np.array([robust_scale((size / m.expected)[judged]) for size in sizes])


def halves_of(groups: NDArray[np.intp]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Rows of every other group (N,), and the rest: errors that drift are then the same in both."""
    first = np.searchsorted(np.unique(groups), groups) % 2 == 0
    return first, ~first


def metres(s: Sightings, plain: bool = True) -> float:
    """Median distance (m) by which the rays pass the known points, all of it for points behind the lens;
    as it is, or with small constant errors of mount and position taken off."""
    m = missed(s)
    good = m.good
    if not good.any():
        return float("nan")
    angle = m.angle if plain else left_over(m, good)
    return float(np.median((m.distance * np.sin(np.minimum(angle, np.pi / 2)))[good]))
