"""Known points in images: where they were clicked, and where the poses have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.checks.sense.trial import Misfit, halves_of, robust_scale
from wildlab.flight.clocks import between, frame_times, gimbal_angles, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array, Origin
from wildlab.geometry.mount import Mount, camera_pose

#: So many points say all there is to say, and fewer than so many say nothing.
MOST, ENOUGH = 200, 4
POSE = ("time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z", "frame_id")
#: A position makes no angle beyond this (rad): else a point that is near would be expected anywhere.
NEAR = 0.1
#: Points and images in a half that can be looked at by itself.
ENOUGH_HALF, IMAGES_HALF = 4, 2
#: What is usual where neither log nor manifest says: position (m, horizontal and vertical), attitude (rad).
USUAL_HORIZONTAL, USUAL_VERTICAL, USUAL_ATTITUDE, USUAL_PIXEL = 2.0, 3.0, np.radians(1.5), 2.0
#: A mount turned by a few degrees and a position some metres off are no wrong meaning: they are allowed for.
#: Standard deviations (rad, m).
ALLOWED_TURN, ALLOWED_HORIZONTAL, ALLOWED_VERTICAL = np.radians(3.0), 3.0, 5.0
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
    between_s
        Time from one logged pose to the next, s.
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
    between_s: float = 0.0

    def take(self, rows: NDArray[np.bool_]) -> Sightings:
        """Some of the rows; the poses at other times go with them."""

        def looked(shift: float) -> SightingGeometry:
            at = self.looked(shift)
            return SightingGeometry(
                at.p_nb[rows], at.R_nb[rows], at.points[:, rows], at.pan[rows], at.tilt[rows]
            )

        return replace(
            self,
            pan=self.pan[rows],
            tilt=self.tilt[rows],
            uv=self.uv[rows],
            p_nb=self.p_nb[rows],
            R_nb=self.R_nb[rows],
            points=self.points[:, rows],
            image=self.image[rows],
            sd=self.sd[rows],
            looked=looked,
            labels=self.labels[rows],
            frames=self.frames[rows],
        )


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
    manifest = flight.manifest
    if manifest.camera is None or flight.detections is None or flight.truth is None:
        return None
    frames = flight.frames
    if frames is None or frames["frame_id"].duplicated().any() or not len(flight.truth):
        return None
    if "u_px" not in flight.detections:
        return None
    detections = flight.detections
    rows = (detections["kind"] == "pixel").to_numpy() & np.isfinite(detections["u_px"].to_numpy())
    named = "target_id" in detections and manifest.scoring.rule == "labelled"
    if named:
        ids = detections["target_id"]
        labelled = rows & ids.isin(flight.truth["target_id"]).to_numpy()
        # Where none names a target, as a detector's do not, each may be of any of them; or of something else.
        named = bool(labelled.any())
        rows = labelled if named else rows & (ids.isna() | (ids == "")).to_numpy()
    frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(detections["frame_id"]))
    chosen = np.flatnonzero(rows & (frame >= 0))
    if len(chosen) > MOST:
        chosen = chosen[np.linspace(0, len(chosen) - 1, MOST).astype(int)]
    if len(chosen) < ENOUGH:
        return None
    frame, detections = frame[chosen], detections.iloc[chosen]
    if flight.manifest.mount.poses not in ("", source):
        return None  # the mount says nothing of a camera on these poses
    nav = flight.nav[source]
    brief = nav[[name for name in nav if name in POSE]]  # at other times without covariances: those take long
    ids = detections["frame_id"]
    labels = detections["target_id"].to_numpy(object) if named else None
    tracks = _tracks(flight, labels)
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
            return SightingGeometry(p, R, _points(tracks, times + shift, labels), pan, tilt)

        p, R, points, pan, tilt = looked(0.0)
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
        pan=pan,
        tilt=tilt,
        uv=detections[["u_px", "v_px"]].to_numpy(float),
        p_nb=p,
        R_nb=R,
        points=points,
        image=number,
        sd=_expected(flight, P, len(chosen)),
        origin=manifest.origin_tuple(),
        looked=looked,
        labels=np.full(len(chosen), "", object) if labels is None else labels,
        frames=ids.to_numpy(object),
        own_gimbal=flight.gimbal is not None or "pan_rad" in frames,
        named=named,
        between_s=float(np.median(np.diff(nav["time_s"]))) if len(nav) > 1 else 0.0,
    )
    known = np.isfinite(p).all(axis=1) & np.isfinite(R).all(axis=(1, 2))
    known &= np.isfinite(points).all(axis=2).any(axis=0) & np.isfinite(found.pan + found.tilt)
    return found.take(known) if known.sum() >= ENOUGH else None


#: Times (K,) and places (K, 3) of each target; of those that never move, without times.
_Tracks = dict[str, tuple[Array | None, Array]]


def _tracks(flight: Flight, labels: NDArray[np.object_] | None) -> _Tracks:
    truth, offset = flight.table("truth"), flight.manifest.clocks.truth_offset_s
    tracks: _Tracks = {}
    for name, rows in truth.groupby("target_id", sort=False):
        if labels is None or name in labels:
            at = rows["time_s"].to_numpy(float) + offset
            place = rows[["north_m", "east_m", "down_m"]].to_numpy(float)
            tracks[str(name)] = (None, place[:1]) if np.isnan(at).all() else (at, place)
    return tracks


def _points(tracks: _Tracks, times: Array, labels: NDArray[np.object_] | None) -> Array:
    """(M, N, 3) where the targets are; with labels (1, N, 3)."""

    def of(name: str, rows: NDArray[np.bool_]) -> Array:
        at, place = tracks[name]
        if at is None:
            return np.broadcast_to(place, (int(rows.sum()), 3))
        return between(at, place, times[rows], f"truth of {name!r}")

    if labels is None:
        return np.stack([of(name, np.full(len(times), True)) for name in tracks])
    found = np.full((1, len(times), 3), np.nan)
    for name in tracks:
        rows = labels == name
        found[0, rows] = of(name, rows)
    return found


def _expected(flight: Flight, P: Array | None, n: int) -> Array:
    stated = flight.manifest.uncertainty
    level = stated.position_horizontal_m or USUAL_HORIZONTAL
    vertical = stated.position_vertical_m or USUAL_VERTICAL
    angles = [stated.tilt_deg, stated.tilt_deg, stated.heading_deg]
    turn = float(np.mean([USUAL_ATTITUDE if a is None else np.radians(a) for a in angles]))
    least = max(USUAL_ATTITUDE if a is None else np.radians(a) for a in angles)
    place = np.hypot(level, vertical) / np.sqrt(2)
    sd = np.tile([turn, place, stated.pixel_px or USUAL_PIXEL, least], (n, 1))
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


def missed(s: Sightings, offset: Array | None = None) -> Missed:
    """How far the rays of clicks miss the known points, as angles at the lens.

    Other than on the ground or in the image, it is a number also for a ray into the sky, or a point behind
    the lens. With several points that may be meant, it is the nearest one's.
    """
    p, R = camera_pose(s.mount, s.p_nb, s.R_nb, s.pan, s.tilt)
    if offset is not None:
        p = p + offset
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


def allowed_for(m: Missed, rows: NDArray[np.bool_]) -> Array:
    """A small turn of the camera and a small shift of the position, (6,), that take most of the misses away.

    Robust least squares on some of the rows, held near zero by what is usual of both.
    """
    J = _jacobian(m)[rows]
    e, expected = m.turn[rows], m.expected[rows]
    usual = np.array([ALLOWED_TURN] * 3 + [ALLOWED_HORIZONTAL] * 2 + [ALLOWED_VERTICAL])
    value = np.zeros(6)
    for _ in range(ROUNDS):
        left = e - J @ value
        size = np.linalg.norm(left, axis=1)
        scale = np.maximum(robust_scale(size), expected / 3)
        weight = 1 / (1 + (size / (2 * scale)) ** 2) / scale**2
        A = np.einsum("nia,n,nib->ab", J, weight, J) + np.diag(usual**-2.0)
        value = np.linalg.solve(A, np.einsum("nia,n,ni->a", J, weight, e))
    return value


def _jacobian(m: Missed) -> Array:
    """(N, 3, 6): how misses grow with a turn in c and a shift in n."""
    d = m.towards
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    shift = np.cross(np.swapaxes(m.R_nc, 1, 2), d[:, :, None], axisa=1, axisb=1, axisc=1)
    return np.concatenate([across, shift / np.maximum(m.distance, 1.0)[:, None, None]], axis=2)


def finite(m: Missed) -> NDArray[np.bool_]:
    """Rows (N,) whose pixel has a ray."""
    return np.asarray(np.isfinite(m.turn).all(axis=1))


def glance(s: Sightings) -> Array:
    """The misfit of the whole alone, (2,)."""
    m = missed(s)
    good = finite(m)
    if good.mean() < 0.5 or good.sum() < ENOUGH:
        return np.full(2, np.inf)
    plain = np.linalg.norm(m.turn, axis=1) / m.expected
    return np.array([robust_scale((left_over(m, good) / m.expected)[good]), robust_scale(plain[good])])


def misfit(s: Sightings) -> Misfit:
    """Misses of the whole and of each half, (2, 3), in units of what is expected.

    What is allowed for is found on one half and taken off the other; the second row is without.

    NaN where a half is too small, infinite where the lens has no rays.
    """
    m = missed(s)
    good = finite(m)
    if good.mean() < 0.5 or good.sum() < ENOUGH:
        return np.full((2, 3), np.inf)
    first, second = halves_of(s.image)
    plain = np.linalg.norm(m.turn, axis=1) / m.expected
    result = np.full((2, 3), np.nan)
    result[:, 0] = robust_scale((left_over(m, good) / m.expected)[good]), robust_scale(plain[good])
    parts = (first & good, second & good)
    if all(part.sum() >= ENOUGH_HALF and len(np.unique(s.image[part])) >= IMAGES_HALF for part in parts):
        for column, (fit, judged) in enumerate((parts, parts[::-1]), start=1):
            result[0, column] = robust_scale((left_over(m, fit) / m.expected)[judged])
            result[1, column] = robust_scale(plain[judged])
    return result


def left_over(m: Missed, fit: NDArray[np.bool_]) -> Array:
    """Sizes (N,) of the misses less what is allowed for, in radians, by a fit to some rows."""
    return np.asarray(np.linalg.norm(m.turn - _jacobian(m) @ allowed_for(m, fit), axis=1))


def metres(s: Sightings) -> float:
    """Median distance (m) by which the rays pass the known points; all of it for points behind the lens."""
    m = missed(s)
    good = finite(m)
    angle = np.linalg.norm(m.turn[good], axis=1)
    past = m.distance[good] * np.sin(np.minimum(angle, np.pi / 2))
    return float(np.median(past)) if good.any() else float("nan")


def metres_left(s: Sightings) -> float:
    """The same where small constant errors of mount and position are taken off."""
    m = missed(s)
    good = finite(m)
    if not good.any():
        return float("nan")
    return float(np.median((m.distance * np.sin(np.minimum(left_over(m, good), np.pi / 2)))[good]))


def degrees(s: Sightings) -> float:
    """The median angle by which the rays pass the known points, in degrees."""
    m = missed(s)
    good = finite(m)
    return float(np.degrees(np.median(np.linalg.norm(m.turn[good], axis=1)))) if good.any() else float("nan")


def with_attitude(undo: Callable[[Array], Array | None]) -> Callable[[Sightings], Sightings | None]:
    """From a change of attitudes (N, 3, 3) that of sightings."""

    def change(s: Sightings) -> Sightings | None:
        R = undo(s.R_nb)
        return None if R is None else replace(s, R_nb=R)

    return change
