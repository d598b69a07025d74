"""What to add to the stamps of a flight's images: from points that were seen, or from their motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis import Fact, fact
from wildlab.analysis.evaluate import blocks_of
from wildlab.analysis.georeference import camera_poses_at, truth_of
from wildlab.detection.flow import as_grey, image_motion
from wildlab.errors import WildlabError
from wildlab.flight.clocks import frame_times
from wildlab.flight.readers.frames import Frame
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_clock import (
    FEWEST,
    ClockByMotion,
    ClockByPoints,
    clock_by_motion,
    clock_by_points,
    translation_over_ground,
)
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, Indices, Mask, matrix_to_rotation_vector

#: Images further apart in time (s) are not compared: between them the camera may have turned to and fro.
LONGEST_PAIR_S = 1.0


def refuse_without_clock(flight: Flight, source: str | None = None) -> None:
    """Refuse a flight whose images have no clock of their own.

    Raises
    ------
    WildlabError
        Where its times merely number the images, or its poses belong to images by name.
    """
    if flight.manifest.time.kind == "sequence":
        raise WildlabError(
            "the images carry no time, so there is no clock to estimate",
            "import with times if the images have any",
            file=flight.folder,
            field="time.kind",
        )
    name, nav = flight.pose_source(source)
    if "frame_id" in nav:
        raise WildlabError(
            "these poses belong to images by name, whatever their clock says",
            "choose other poses with --source, if there are any",
            file=flight.folder,
            field=f"nav/{name}",
        )


def camera_clock_by_points(flight: Flight, source: str | None = None) -> ClockByPoints:
    """What to add to the stamps of the images so that known points appear where they were seen.

    Parameters
    ----------
    flight
        With frames, poses, pixel detections that name targets, and truth of these.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Returns
    -------
    ClockByPoints
        All its offsets are whole ones, as ``clocks.camera_offset_s`` has them: not on top of the manifest's.

    Raises
    ------
    WildlabError
        Where the images have no clock, or fewer than four sightings have a pose.
    """
    refuse_without_clock(flight, source)
    frames, pixels, truth = flight.table("frames"), flight.detections, flight.truth
    if pixels is None or truth is None or "target_id" not in pixels:
        pixels = pd.DataFrame()
    else:
        known = pixels["target_id"].isin(truth["target_id"]) & pixels["frame_id"].isin(frames["frame_id"])
        pixels = pixels[(pixels["kind"] == "pixel") & known].reset_index(drop=True)
    if len(pixels) < 4:
        raise WildlabError(
            f"{len(pixels)} detections are of a target whose position is known, at least 4 are needed",
            "name the targets of detections and add their truth, or give the images with --images",
            file=flight.folder,
            field="detections",
        )
    at = pd.Index(frames["frame_id"]).get_indexer(pd.Index(pixels["frame_id"]))
    stated = flight.manifest.clocks.camera_offset_s
    times = frame_times(flight)[at]
    table = pd.DataFrame({"target_id": pixels["target_id"].to_numpy(object), "frame_id": pixels["frame_id"]})

    def seen_at(offset: float) -> tuple[CameraPoses, Array]:
        poses = camera_poses_at(flight, times + offset, source)
        if "pan_rad" in frames:
            angles = {name: frames[f"{name}_rad"].to_numpy(float)[at] for name in ("pan", "tilt")}
            poses = replace(poses, **angles)
        return poses, truth_of(flight, table.assign(time_s=times + offset))

    found = clock_by_points(
        seen_at,
        pixels[["u_px", "v_px"]].to_numpy(float),
        pixels["frame_id"].to_numpy(object),
        blocks_of(flight, table.assign(time_s=times)),
    )
    if found is None:
        raise WildlabError(
            "fewer than four sightings of known points have a pose, with any offset of the camera's clock",
            "check that images and poses are of the same time: wildlab check says what overlaps",
            file=flight.folder,
            field="detections",
        )
    return found._replace(
        offset_s=found.offset_s + stated, offsets=found.offsets + stated, rival_s=found.rival_s + stated
    )


def image_motions(frames: Iterable[Frame], flight: Flight, camera: Camera) -> tuple[Indices, Array]:
    """How the scene moved from each image of a flight to the next that follows it closely.

    Parameters
    ----------
    frames
        Images in any order of names that the flight's frames have: by file name, with or without its ending.
    flight
        With frames.
    camera
        Its lens.

    Returns
    -------
    (pairs, motion)
        (N, 2) rows of the table ``frames``, and (N, 3) as from `image_motion`.
    """
    names = flight.table("frames")["frame_id"].astype(str)
    rows = {name: number for number, name in enumerate(names)}
    for number, name in enumerate(names):
        rows.setdefault(Path(name).stem, number)
    stamps = flight.table("frames")["time_s"].to_numpy(float)
    pairs: list[tuple[int, int]] = []
    motion: list[Array] = []
    before: tuple[int, NDArray[np.uint8], Mask] | None = None
    for frame in frames:
        row = rows.get(frame.name, rows.get(Path(frame.name).stem))
        if row is None or not frame.usable:
            before = None
            continue
        grey = as_grey(frame.image, frame.valid)
        if before is not None and before[1].shape == grey.shape:
            apart = stamps[row] - stamps[before[0]]
            if 0 < apart <= LONGEST_PAIR_S:
                pairs.append((before[0], row))
                motion.append(image_motion(before[1], grey, camera, before[2]))
        before = row, grey, frame.valid
    return np.array(pairs, np.intp).reshape(-1, 2), np.array(motion, float).reshape(-1, 3)


def camera_clock_by_motion(
    flight: Flight, pairs: Indices, motion: Array, source: str | None = None
) -> ClockByMotion:
    """What to add to the stamps of the images so that they moved as the log says that the camera turned.

    Parameters
    ----------
    flight
        With frames and poses; gyros are used where it has them and the camera is fixed to the airframe.
    pairs, motion
        From `image_motions`.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

    Returns
    -------
    ClockByMotion
        All its offsets are whole ones, as ``clocks.camera_offset_s`` has them.

    Raises
    ------
    WildlabError
        Where the images have no clock, or too few of them could be followed within the log.
    """
    refuse_without_clock(flight, source)
    times, turned, moved = _camera_motion(flight, source)
    spans = frame_times(flight)[pairs].reshape(-1, 2)
    found = clock_by_motion(spans, motion, times, turned, moved)
    if found is None:
        followed = int(np.isfinite(motion).all(axis=1).sum())
        raise WildlabError(
            f"{followed} of {len(pairs)} pairs of images that follow each other within {LONGEST_PAIR_S:g} s "
            f"could be followed, and {FEWEST} within the log are needed",
            "give more images of a stretch in which the camera turns, or state the offset",
            file=flight.folder,
            field="frames",
        )
    stated = flight.manifest.clocks.camera_offset_s
    return found._replace(
        offset_s=found.offset_s + stated, offsets=found.offsets + stated, rival_s=found.rival_s + stated
    )


def _camera_motion(flight: Flight, source: str | None) -> tuple[Array, Array, Array]:
    """Times (T,), and integrals (T, 3) of the camera's angular velocity in c and of what its travel shows."""
    _, nav = flight.pose_source(source)
    t = nav["time_s"].to_numpy(float)
    poses = camera_poses_at(flight, t, source)
    good = np.isfinite(poses.p_nc).all(axis=1) & np.isfinite(poses.R_nc).all(axis=(1, 2))
    t, p, R = t[good], poses.p_nc[good], poses.R_nc[good]
    if len(t) < 2:
        raise WildlabError(
            "the poses are too few to tell how the camera turned", "import more of the log", field="nav"
        )
    steps = matrix_to_rotation_vector(np.einsum("nji,njk->nik", R[:-1], R[1:]))
    turned = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    moved = translation_over_ground(p, R)
    if flight.imu is None or flight.gimbal is not None or "pan_rad" in flight.table("frames"):
        return t, turned, moved
    imu = flight.imu
    rates = imu[["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]].to_numpy(float)
    at = imu["time_s"].to_numpy(float)
    known = np.isfinite(rates).all(axis=1) & (at >= t[0]) & (at <= t[-1])
    known &= np.diff(np.fmax.accumulate(at), prepend=-np.inf) > 0
    if known.sum() < len(t):
        return t, turned, moved
    at, rates = at[known], rates[known] @ camera_rotation(flight)
    between = (rates[1:] + rates[:-1]) / 2 * np.diff(at)[:, None]
    by_gyro = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    return at, by_gyro, np.stack([np.interp(at, t, one) for one in moved.T], axis=1)


def camera_rotation(flight: Flight) -> Array:
    """(3, 3) `R_bc` of a camera that is fixed to the airframe."""
    still = CameraPoses(
        flight.manifest.geometry_camera(), flight.manifest.geometry_mount(), np.zeros((1, 3)), np.eye(3)
    )
    return np.asarray(still.R_bc).reshape(-1, 3, 3)[0]


class CameraClock(NamedTuple):
    """An estimate of what to add to the stamps of the images.

    Attributes
    ----------
    numbers
        ``offset_s`` (for ``clocks.camera_offset_s``), ``sd_s``, ``certain``, ``method``, the next best offset
        ``rival_s`` and what the estimate rests on.
    curve
        ``offset_s``, and ``cost`` or ``correlation``.
    facts
        What is said of it; the words are in ``data/messages/en/terminal.toml``.
    """

    numbers: dict[str, object]
    curve: pd.DataFrame
    facts: tuple[Fact, ...]


def clock_from_points(flight: Flight, source: str | None = None) -> CameraClock:
    """`camera_clock_by_points` with its facts.

    Raises
    ------
    WildlabError
        As that.
    """
    found = camera_clock_by_points(flight, source)
    rests = {"points": found.points, "images": found.images, "blocks": found.draws}
    curve = pd.DataFrame({"offset_s": found.offsets, "cost": found.cost})
    return _told("points", "known points", found, rests, curve)


def clock_from_motion(
    flight: Flight,
    frames: Iterable[Frame],
    source: str | None = None,
) -> CameraClock:
    """`camera_clock_by_motion` of images, with its facts.

    Raises
    ------
    WildlabError
        As that.
    """
    refuse_without_clock(flight, source)
    pairs, motion = image_motions(frames, flight, flight.manifest.geometry_camera())
    found = camera_clock_by_motion(flight, pairs, motion, source)
    rests = {"pairs": found.pairs, "correlation": found.peak, "rival_correlation": found.rival_correlation}
    curve = pd.DataFrame({"offset_s": found.offsets, "correlation": found.correlation})
    return _told("motion", "image motion", found, rests | {"gain": found.gain}, curve)


def _told(
    way: str,
    method: str,
    found: ClockByPoints | ClockByMotion,
    rests: Mapping[str, float],
    curve: pd.DataFrame,
) -> CameraClock:
    numbers: dict[str, object] = {
        "offset_s": found.offset_s,
        "sd_s": found.sd_s,
        "certain": found.certain,
        "method": method,
        "rival_s": found.rival_s,
        **rests,
    }
    shown = {name: f"{one:.2f}" if isinstance(one, float) else str(one) for name, one in rests.items()}
    shown |= {name: f"{getattr(found, name):+.3f}" for name in ("offset_s", "rival_s")}
    key = f"clock-{way}-{'certain' if found.certain else 'open'}"
    return CameraClock(numbers, curve, (fact(key, sd_s=f"{found.sd_s:.3f}", **shown),))
