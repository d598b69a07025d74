"""Known points: where they were clicked, whether the poses have them there, and what mistake if not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation
from scipy.special import bdtrc

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import (
    ALIKE,
    FAR_BETTER,
    MOST_NAMED,
    Change,
    Finding,
    Misfit,
    Mistake,
    attitudes_in,
    blame,
    change_by,
    change_columns,
    change_geodetic,
    explain,
    mistake,
    number,
    one_row,
    places_in,
    raise_by,
    rotations_of_axes,
    rows_of,
    shift_clock,
    shift_poses,
    state,
    thin,
    undo_in,
)
from wildlab.flight.clocks import (
    frame_times,
    gimbal_angles,
    pose_finder,
    poses_at,
    truth_at,
    truth_deviations,
)
from wildlab.flight.schema import POSITION
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.camera_poses import R_MC_DOWN, R_MC_FORWARD, Looks, Mount, camera_pose, camera_rotation
from wildlab.geometry.frames import Array, Indices, Mask, Origin, euler_to_matrix, matrix_to_euler
from wildlab.geometry.robust import student_cost
from wildlab.names import listed

#: So many points say all there is to say, and fewer than so many say nothing.
MOST, ENOUGH = 200, 4
#: A position makes no angle beyond this (rad): else a point that is near would be expected anywhere.
NEAR = 0.1
#: Points and images in a half that can be looked at by itself.
ENOUGH_HALF, IMAGES_HALF = 4, 2
#: What is usual where nothing says so: position (m, horizontal and vertical), attitude (rad), click (px).
USUAL_HORIZONTAL, USUAL_VERTICAL, USUAL_ATTITUDE, USUAL_PIXEL = 2.0, 3.0, np.radians(1.5), 2.0
#: Small turns of a mount and shifts of a position are no wrong meaning: standard deviations (rad, m).
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
    source, camera, mount, pan, tilt
        The nav table, and as the manifest and the log have them; angles (N,) in radians.
    uv, p_nb, R_nb
        (N, 2) pixels, and poses of the airframe, (N, 3) and (N, 3, 3).
    points, image
        (M, N, 3): where the known point is, or M that it may be, in n; (N,) image, in the order of time.
    sd
        (N, 4): expected standard deviations of the attitude (rad, the mean of its angles), the position less
        the known point's (m), and the click (px); and of the angle that is known least (rad).
    origin
        Of frame n.
    looked
        Poses, angles of the gimbal and known points as they were a shift in seconds later.
    labels, frames
        (N,) name of the point, (N,) name of the image.
    own_gimbal, named
        Whether its angles are the log's; whether it is said of which point each is.
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
    image: Indices
    sd: Array
    origin: Origin
    looked: Callable[[float], SightingGeometry]
    labels: NDArray[np.object_]
    frames: NDArray[np.object_]
    own_gimbal: bool = False
    named: bool = True

    def take(self, rows: Mask) -> Sightings:
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
    """The clicks on known points, with the poses of one nav source; None where there are too few."""
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
    ids = detections["frame_id"]
    labels = detections["target_id"].to_numpy(object) if named else None
    if labels is not None:
        truth = truth[truth["target_id"].isin(labels)]
    late = manifest.clocks.truth_offset_s
    try:
        times, find = frame_times(flight)[frame], pose_finder(nav, ids)

        def looked(shift: float) -> SightingGeometry:
            at = times + shift
            names, points = truth_at(truth, at, late)
            if labels is not None:
                points = points[pd.Index(names).get_indexer(pd.Index(labels)), np.arange(len(at))][None]
            pan, tilt = gimbal_angles(flight, at, frame)
            p, R = find(at)
            return SightingGeometry(p, R, points, pan, tilt)

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
        sd=_expected(flight, P, labels, len(chosen)),
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


def _expected(flight: Flight, P: Array | None, labels: NDArray[np.object_] | None, n: int) -> Array:
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
    of_truth = truth_deviations(flight, flight.table("truth")["target_id"] if labels is None else labels)
    sd[:, 1] = np.hypot(sd[:, 1], np.median(of_truth) if labels is None else of_truth)
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
    def good(self) -> Mask:
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


def constant_of(m: Missed, fit: Mask, allowed: Array) -> tuple[Array, Array]:
    """A small turn of the camera and a small shift of the position (6,), by robust least squares over some
    rows, held near zero by what is allowed of both; and how misses grow with them (N, 3, 6)."""
    shift = np.cross(np.swapaxes(m.R_nc, 1, 2), m.towards[:, :, None], axisa=1, axisb=1, axisc=1)
    J = np.concatenate([m.across, shift / np.maximum(m.distance, 1.0)[:, None, None]], axis=2)
    e, expected, rows = m.turn[fit], m.expected[fit], J[fit]
    value = np.zeros(6)
    for _ in range(ROUNDS):
        size = np.linalg.norm(e - rows @ value, axis=1)
        scale = np.maximum(robust_scale(size), expected / 3)
        weight = 1 / (1 + (size / (2 * scale)) ** 2) / scale**2
        A = np.einsum("nia,n,nib->ab", rows, weight, rows) + np.diag(allowed**-2.0)
        value = np.linalg.solve(A, np.einsum("nia,n,ni->a", rows, weight, e))
    return value, J


def left_over(m: Missed, fit: Mask) -> Array:
    """Sizes (N,) of the misses less what is allowed for, in radians, by a fit to some rows."""
    value, J = constant_of(m, fit, ALLOWED)
    return np.asarray(np.linalg.norm(m.turn - J @ value, axis=1))


def misfit(s: Sightings, halves: bool = True) -> Misfit:
    """Misses of the whole and of each half, (2, 3), in units of what is expected.

    What is allowed for is found on one half and taken off the other; the second row is without. NaN
    where a half is too small or not asked for, infinite where the lens has no rays.
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


def _sizes(m: Missed, fit: Mask, judged: Mask) -> Array:
    sizes = (left_over(m, fit), m.angle)
    return np.array([robust_scale((size / m.expected)[judged]) for size in sizes])


def halves_of(groups: Indices) -> tuple[Mask, Mask]:
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


#: Without a known mistake, misses this many times what is expected and this large (deg) are still said.
UNEXPLAINED, UNEXPLAINED_DEG = 4.0, 8.0
#: A single photo or mark is named where most of its misses are so many times those of all, by at least so
#: many points, and so many times what is expected.
SINGLE, SINGLE_POINTS, SINGLE_EXPECTED = 6.0, 2, 5.0
#: Rays that pass known points by less than this (m) are not told apart.
CLOSE_M = 0.1
#: So many photos of a flight in which all is as stated may be named, in the mean.
BY_CHANCE = 0.05
#: Heights are looked for this far (m) and clocks this far (s); finer steps near zero.
HEIGHTS = np.sinh(np.linspace(-7.5, 7.5, 41)) * 2.0
CLOCKS = np.sinh(np.linspace(-5.0, 5.0, 41)) * 0.8
HOURS = tuple(h for h in np.arange(-14.0, 14.25, 0.25) if h)
LEAP_S = (18.0, -18.0, 19.0, -19.0, 37.0, -37.0)
#: A mount is off by a few degrees and no wrong meaning; beyond the second, a turn is one of the usual ones.
TURNED_DEG, LARGEST_TURN_DEG = 5.0, 40.0
ALLOWED_TURN = np.array([1.0] * 3 + [1e-6] * 3)
#: Known points tell a clock where it makes them so much likelier (logarithm).
TOLD = 20.0
#: A lever arm is no longer than this, m.
LONGEST_LEVER = 5.0


def known_points(flight: Flight) -> Iterator[Finding]:
    """Clicks on known points against the poses, for each nav source."""
    for name in flight.nav:
        if name.startswith("truth"):  # a twin's own, no log
            continue
        given = sightings(flight, name)
        if given is not None:
            yield from judge(flight, given)


def judge(flight: Flight, given: Sightings) -> Iterator[Finding]:
    """The findings about one nav source."""
    if not given.named:
        if flight.manifest.targets.others:
            return  # most of what is detected may be of those whose places nobody knows
        yield from nameless(flight, given)
        if flight.manifest.scoring.rule == "nearest":
            yield from _single(given)
        return
    named = explain(misfit, given, camera_mistakes(flight, given), glance)
    # Misfits are in units of what is expected, which a mistake may change too: metres have to fall as well.
    named = [
        one for one in named if _plain(given, one.undone) or metres(one.undone, False) < metres(given, False)
    ]
    if named:
        yield _finding(given, named)
        given = named[0].undone
    else:
        m = missed(given)
        angle = np.degrees(np.median(m.angle[m.good])) if m.good.any() else np.nan
        if misfit(given)[0, 0] > UNEXPLAINED and angle > UNEXPLAINED_DEG:
            facts = {"metres": metres(given), "angle": angle}
            yield Finding("warning", f"nav/{given.source}", "", "points-missed", facts)
    yield from _single(given)


def _plain(given: Sightings, undone: Sightings) -> bool:
    """Whether the distance falls by far with nothing else taken off."""
    return metres(undone) * FAR_BETTER <= metres(given)


def _finding(given: Sightings, named: list[Mistake[Sightings]]) -> Finding:
    # Where other small errors hide what is gained, it is the distance without these that shows it.
    plain = _plain(given, named[0].undone)
    # What is as good in angles and leaves ten times the distance explains it less.
    left = np.nan_to_num([metres(one.undone, plain) for one in named], nan=np.inf)
    chosen = [
        (one, off) for one, off in zip(named, left, strict=True) if off <= ALIKE * max(left.min(), CLOSE_M)
    ]
    first = chosen[0][0]
    alike = [f"{one.said} ({number(off)} m)" for one, off in chosen[1:]]
    return blame(
        "problem",
        f"nav/{given.source}",
        "",
        "points-explained",
        [one for one, _ in chosen],
        {
            "first": first.said,
            "plain": plain,
            "before": metres(given, plain),
            "after": metres(first.undone, plain),
            "alike": f"; as well explained: {listed(alike, 'or')}" if alike else "",
        },
        [
            correct
            for one, _ in chosen
            for correct in one.corrections or (_stated(one.undone.camera, one.undone.mount),)
        ],
    )


def _stated(camera: Camera, mount: Mount) -> Callable[[Flight], Flight | None]:
    """State another calibration and another mount."""
    turned = zip(("roll", "tilt", "pan"), np.degrees(mount.misalignment).tolist(), strict=True)
    return state(
        {
            "camera": {
                **{f"{name}_px": float(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy")},
                **dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=True)),
            },
            "mount": {
                "looks": mount.looks,
                "lever_arm_m": mount.lever_arm,
                **{f"misalignment_{name}_deg": angle for name, angle in turned},
            },
        }
    )


def camera_mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    """All usual mistakes that change where known points are seen."""
    yield from mount_mistakes(s)
    yield from attitudes_in(s.source, "", "R_nb")
    yield from pixel_mistakes(s)
    yield from calibration_mistakes(s)
    yield from places_in(f"nav/{s.source}", s.origin, "poses", "p_nb")
    yield from places_in("truth", s.origin, "truth", "points")
    yield from shared_place_mistakes(s)
    yield from height_mistakes(s)
    yield from turn_and_clock_mistakes(s, flight)


def shared_place_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Mistakes about latitude and longitude that poses, truth and the origin share: the points stay near, and
    north lies elsewhere."""
    for row in rows_of("geodetic"):
        change = change_by(row)
        there = change(np.array(s.origin))
        if there is None or abs(there[0]) > np.pi / 2:
            continue
        at: Origin = tuple(there.tolist())
        moved = partial(change_geodetic, change, origin=s.origin, to=at)

        def undo(x: Sightings, moved: Change = moved, at: Origin = at) -> Sightings | None:
            done = undo_in(moved, "p_nb", "points")(x)
            return None if done is None else replace(done, origin=at)

        def correct(flight: Flight, moved: Change = moved, at: Origin = at) -> Flight | None:
            placed = [one for one in ("gnss", "truth") if one in flight.tables]
            for table in (*(f"nav/{name}" for name in flight.nav), *placed):
                changed = change_columns(table, POSITION, moved)(flight)
                if changed is None:
                    return None
                flight = changed
            latitude, longitude = np.degrees(at[:2]).tolist()
            return state({"origin": {"latitude_deg": latitude, "longitude_deg": longitude}})(flight)

        of = mistake(row, undo, part=f"poses.{s.source}.position] and [truth")
        yield of.within("poses and truth", undo, correct)


# -- mount, pixels and calibration


def mount_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """The other of down and forward, and the 24 ways in which a camera can be turned by quarter turns."""

    def mounted(**parts: Any) -> Callable[[Sightings], Sightings]:
        return lambda x: replace(x, mount=replace(x.mount, **parts))

    mount = s.mount
    other: Looks = "forward" if mount.looks == "down" else "down"
    yield mistake(one_row("looks"), mounted(looks=other), other=other, looks=mount.looks)
    base = euler_to_matrix(*mount.misalignment)
    turns = {"down": R_MC_DOWN, "forward": R_MC_FORWARD}
    done = [camera_rotation(replace(mount, misalignment=(0.0, 0.0, 0.0), pan=0.0, tilt=0.0)), turns[other]]
    # Those with the fewest words first.
    by_words = sorted(rotations_of_axes(), key=lambda R: int((np.abs(matrix_to_euler(R)) > 1e-6).sum()))
    for way in by_words:
        for looks, R_mc in turns.items():
            R_bc = way @ R_mc
            if any(np.allclose(R_bc, one) for one in done):
                continue
            done.append(R_bc)
            turned = tuple(matrix_to_euler(base @ way))
            lines = [f'looks = "{looks}"'] + [
                f"misalignment_{key}_deg = {np.degrees(angle):.4g}"
                for key, angle in zip(("roll", "tilt", "pan"), turned, strict=True)
                if abs(angle) > 1e-6
            ]
            yield mistake(
                one_row("mounted"),
                mounted(looks=looks, misalignment=turned),
                lens=_side(R_bc @ [0.0, 0.0, 1.0]),
                top=_side(R_bc @ [0.0, -1.0, 0.0]),
                lines=", ".join(lines),
            )
    if any(abs(angle) > 1e-9 for angle in mount.misalignment):
        for row in rows_of("misalignment"):
            yield mistake(row, mounted(misalignment=_changed(row, mount.misalignment)))
    if (np.abs([s.pan, s.tilt]) > 1e-9).any():
        for row in rows_of("gimbal"):
            change = change_by(row, np.radians(1.0))
            yield mistake(row, _gimbal(change), where="[gimbal]" if s.own_gimbal else "[mount]")
    if max(map(abs, mount.lever_arm)) > LONGEST_LEVER:
        for row in rows_of("lever-arm"):
            arm = _changed(row, mount.lever_arm)
            yield mistake(row, mounted(lever_arm=arm), what="camera", part="mount")


def _changed(row: Any, numbers: tuple[float, ...]) -> tuple[float, ...]:
    changed = change_by(row)(np.array(numbers))
    return numbers if changed is None else tuple(changed.tolist())


def _gimbal(change: Callable[[Array], Array | None]) -> Callable[[Sightings], Sightings | None]:
    def undo(s: Sightings) -> Sightings | None:
        angles = change(np.column_stack([s.pan, s.tilt]))
        return None if angles is None else replace(s, pan=angles[:, 0], tilt=angles[:, 1])

    return undo


def _side(direction: Array) -> str:
    names = ("forward", "right", "down"), ("backward", "left", "up")
    axis = int(np.argmax(np.abs(direction)))
    return names[0 if direction[axis] > 0 else 1][axis]


def pixel_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Where pixels are counted from, which is which, and in what."""
    for row in rows_of("pixels"):
        yield mistake(row, undo_in(change_by(row, [s.camera.width, s.camera.height]), "uv"))


def calibration_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """Focal length (no lens shows as little as half a degree), principal point, distortion."""
    camera = s.camera
    numbers = (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)
    size = np.array([0, 0, camera.width, camera.height, 0, 0, 0, 0, 0])
    for row in rows_of("calibration"):
        right = change_by(row, size)(np.array(numbers))
        if right is not None and tuple(right) != numbers and right[0] < 100 * camera.width:
            fx, fy, cx, cy, *distortion = right.tolist()
            changed = replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, distortion=tuple(distortion))
            yield mistake(row, lambda x, c=changed: replace(x, camera=c), camera=changed)  # type: ignore[misc]


# -- constants that are fitted: height, clock, turn


def best_of(cost: Callable[[float], float], grid: Array) -> float:
    """Where a cost is least: the best of a grid, refined between its neighbours."""
    costs = np.array([cost(x) for x in grid])
    if not np.isfinite(costs).any():
        return 0.0
    k = int(np.nanargmin(np.where(np.isfinite(costs), costs, np.inf)))
    about = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
    return float(minimize_scalar(cost, bounds=about, options={"maxiter": 14}).x)


def sighting_cost(s: Sightings) -> float:
    """How badly sightings fit beside small constant errors, which are fitted along and held near zero."""
    m = missed(s)
    good = m.good
    if good.mean() < 0.5 or good.sum() < ENOUGH:
        return np.inf
    value, J = constant_of(m, good, ALLOWED)
    size = np.linalg.norm(m.turn - J @ value, axis=1) / m.expected
    return (student_cost(size[good] ** 2) + float(((value / ALLOWED) ** 2).sum()) / 2) / good.sum()


def _raised(s: Sightings, by: float) -> Sightings:
    return replace(s, p_nb=s.p_nb - np.array([0.0, 0.0, by]))


def height_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """A constant by which the poses are too high or too low."""
    by = best_of(lambda h: sighting_cost(_raised(s, h)), HEIGHTS)
    if abs(by) >= 3.0:
        yield mistake(
            one_row("constant-height"),
            lambda x: _raised(x, by),
            raise_by(f"nav/{s.source}", by),
            fitted=True,
            source=s.source,
            by=by,
            correction=-by,
        )


def turn_and_clock_mistakes(s: Sightings, flight: Flight) -> Iterator[Mistake[Sightings]]:
    """A camera that is turned against its mount by a constant, as a tilt that was not stated; and a clock of
    the camera that is late or early by a constant, by leap seconds or by a zone.

    On one course both move points alike: where these tell the clock, the turn is what is left beside it. A
    small one comes off with the clock, and the clock with a large one.
    """
    timed, offset_s = flight.timed, flight.manifest.clocks.camera_offset_s
    late = best_of(lambda t: sighting_cost(s.shifted(t)), CLOCKS) if timed else 0.0
    m, other = missed(s), s.shifted(late)
    told = (sighting_cost(s) - sighting_cost(other)) * m.good.sum() > TOLD
    m = missed(other) if told else m
    e = constant_of(m, m.good, ALLOWED_TURN)[0][:3]
    size = np.degrees(np.linalg.norm(e))

    def turned(x: Sightings) -> Sightings:
        _, R_nc = camera_pose(x.mount, x.p_nb, x.R_nb, x.pan, x.tilt)
        R_cb = np.swapaxes(R_nc, 1, 2) @ x.R_nb
        return replace(x, R_nb=R_nc @ Rotation.from_rotvec(-e).as_matrix() @ R_cb)

    if TURNED_DEG < size < LARGEST_TURN_DEG:
        tilt, pan, roll = np.degrees(e)
        facts = {"size": size, "tilt": tilt, "pan": pan, "roll": roll}
        undo = (lambda x: turned(x.shifted(late))) if told else turned
        yield mistake(one_row("constant-turn"), undo, fitted=True, **facts)
    if not timed:
        return

    def clock(row: Any, by: float, fitted: bool = False, **facts: Any) -> Mistake[Sightings]:
        corrections = (shift_clock("camera_offset_s", by), shift_poses(s.source, -by))
        facts |= {"by": by, "offset": offset_s + by}
        return mistake(row, lambda x: x.shifted(by), *corrections, fitted=fitted, **facts)

    if abs(late) > 0.05:
        alone = clock(one_row("camera-clock"), late, fitted=True)
        small = told and size <= TURNED_DEG
        yield replace(alone, undo=lambda x: turned(x.shifted(late))) if small else alone
    for seconds in LEAP_S:
        yield clock(one_row("leap-seconds"), seconds)
    for hours in HOURS:
        yield replace(clock(one_row("zone"), 3600.0 * hours, hours=hours), corrections=())


# -- pixels without names

#: A ray meets a target that it passes by no more than so many times what is expected, and no more than this.
MEETS, MEETS_DEG = 3.0, 6.0
#: Undone, a mistake has to bring so many times as many rays to a target, on the whole and on either half, and
#: this share at least, which where all is right needs no explanation; where a number was chosen to make it
#: fit, twice as many times.
MORE, LEAST = 2.0, 0.3
#: Mistakes are named together whose shares are so near each other.
ALIKE_SHARE = 0.9
#: Clocks that are looked for where turns of a flight are short, s.
NEAR_CLOCKS = np.arange(-30.0, 30.5, 0.5)


def shares(s: Sightings) -> Array:
    """(3,) of all rays, and of those of either half of the images, the share that meets a known target."""
    m = missed(s)
    with np.errstate(invalid="ignore"):
        meets = m.good & (m.angle < np.minimum(MEETS * m.expected, np.radians(MEETS_DEG)))
    return np.array([meets[rows].mean() for rows in (slice(None), *halves_of(s.image))])


def nameless(flight: Flight, given: Sightings) -> Iterator[Finding]:
    """What is wrong with a detector's flight, where a usual mistake says why few of its rays meet a target.

    What a detector saw may be a known target, another one, or nothing. So it is not asked by how far rays
    pass the nearest known target, which where most of what is seen is something else says nothing, but what
    share of them meets one; and only mistakes are tried that change what is seen as a whole. Lengths, places
    and heights are left out: with these, what is beside a known target is easily brought to it.
    """
    before = shares(given)
    if before[0] >= LEAST:
        return
    found: list[tuple[bool, float, Mistake[Sightings]]] = []
    for one in _nameless_mistakes(flight, given):
        undone = one.undo(given)
        if undone is not None:
            after = shares(undone)
            more = MORE**2 if one.fitted else MORE
            if after[0] >= LEAST and (after >= more * before).all():
                found.append((one.fitted, -after[0], one))
    best = min((less for _, less, _ in found), default=0.0)
    alike = sorted((one for one in found if one[1] <= ALIKE_SHARE * best), key=lambda one: one[:2])
    if alike:
        named = alike[:MOST_NAMED]
        then = " or ".join(f"{-100 * less:.0f} % were if {one.said}" for _, less, one in named)
        facts = {"share": 100 * before[0], "then": then}
        mistakes = [one for _, _, one in named]
        yield blame("warning", f"nav/{given.source}", "", "few-meet-a-target", mistakes, facts, [])


def _nameless_mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    yield from mount_mistakes(s)
    yield from attitudes_in(s.source, "", "R_nb")
    yield from pixel_mistakes(s)
    by = best_of(lambda t: -float(shares(s.shifted(t)).min()), NEAR_CLOCKS)
    if flight.manifest.time.kind == "utc" and abs(by) >= 1.0:
        offset = flight.manifest.clocks.camera_offset_s + by
        yield mistake(one_row("camera-clock"), lambda x: x.shifted(by), fitted=True, by=by, offset=offset)


# -- one photo or mark


def _single(s: Sightings) -> Iterator[Finding]:
    """One photo, or one mark, that is off while the others are not."""
    m = missed(s)
    good = m.good
    if good.sum() < 8:
        return
    angle = left_over(m, good)
    size = angle / m.expected
    # What is expected takes the mean of the angles; one photo may be off by the one that is known least.
    least = np.sqrt(m.expected**2 - s.sd[:, 0] ** 2 + s.sd[:, 3] ** 2)
    for what, names, table, field in (
        ("photo", s.frames, "frames", "frame_id"),
        ("mark", s.labels, "truth", "target_id"),
    ):
        count = len(set(names))
        most = np.sqrt(2 * np.log(max(count, 1) / BY_CHANCE))
        far = (size > SINGLE * np.median(size[good])) & (size > SINGLE_EXPECTED)
        off = _off(far & (angle > most * least), names, good)
        if off and len(off) <= max(1, count // 5):
            misses = {one: np.degrees(np.nanmedian(m.angle[names == one])) for one in off[:5]}
            which = [f"{one!r} ({number(miss)} deg)" for one, miss in misses.items()]
            facts = {"source": s.source, "n": len(off), "which": which}
            yield Finding("warning", table, field, f"one-{what}-off", facts, (f"one {what} off",))


def _off(far: Mask, names: NDArray[np.object_], good: Mask) -> list[str]:
    """Those whose points are for the most part far, where so many of them are hardly together by chance.

    Far ones are everywhere: wrong clicks, and detections of what is no known point.
    """
    rows = {str(name): (names == name) & good for name in dict.fromkeys(names) if name != ""}
    rows = {name: of for name, of in rows.items() if of.sum() >= SINGLE_POINTS}
    # More than half of them: one wrong click is not a wrong photo.
    off = [name for name, of in rows.items() if far[of].mean() > 0.5]
    others = good & ~np.isin(names.astype(str), off)
    # As if there had been half a far one more, so that none seen is not none ever.
    share = (far[others].sum() + 0.5) / (others.sum() + 1)

    def by_chance(of: Mask) -> float:
        return len(rows) * float(bdtrc(far[of].sum() - 1, of.sum(), share))

    return [name for name in off if by_chance(rows[name]) < BY_CHANCE]
