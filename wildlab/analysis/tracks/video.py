"""Which boxes of a video are the same animal, and how many animals there are, without poses of the camera.

The tracker of `wildlab.tracking.multitarget` runs in the pixels of the first frame: the camera's own motion
is taken out by homographies of what stands still. Lengths are in metres, by how long an animal is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.detection_scores import BOX, COVARIANCE
from wildlab.analysis.tracks.ground_positions import PlacedScans
from wildlab.analysis.tracks.many import LEAST_FALSE, model_jointly
from wildlab.analysis.tracks.noise_model import model_targets
from wildlab.detection.flow import AGREEMENT_PX, Grey, as_grey, common_homography, followed_corners
from wildlab.flight.manifest import read_settings
from wildlab.flight.readers.frames import Frame
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.paths import DATA
from wildlab.tracking.association import association_probabilities, global_nearest, innovation_squared
from wildlab.tracking.multitarget import Shown, smooth_many
from wildlab.tracking.multitarget_tracks import Count, count_interval, count_probabilities, likelihoods
from wildlab.tracking.target_model import ManyTargetModel, Scan

#: Frames a second where they do not say.
RATE_HZ = 10.0
#: A frame whose scene moved by more of its width, or has less of the corners that others shared with the same
#: frame, is followed from the one before it: a homography by few corners is far off where there are none.
FAR_MOVED, ENOUGH = 0.2, 0.6
#: What is left of the camera's motion in a place, SD of each axis, px: ground is not level, and boxes change
#: as what is warm joins and parts.
LEFT_PX = 1.0
#: px about a box in which nothing stands still.
AROUND = 2
#: Probability that a track's own box is let in.
OWN = 0.999
#: A track that is as probably as this an earlier one gets its number.
SAME = 0.5


class _Key(NamedTuple):
    """A frame that others are followed from, and what takes its pixels to the first one's."""

    grey: Grey
    still: Mask
    to_first: Array


def camera_motion(frames: Iterable[Frame], boxes: Mapping[str, Array]) -> tuple[Array, int]:
    """What takes pixels of each frame to those of the first, (N, 3, 3), and of how many it is not known.

    Many frames are followed from one, so that errors do not add up.

    Parameters
    ----------
    frames
        In order.
    boxes
        By the name of a frame, (M, 4) of what may move by itself.
    """
    found, lost = [np.eye(3)], 0
    key, last, most = None, None, 0
    for frame in frames:
        if not frame.usable:
            found.append(found[-1])
            continue
        still = frame.valid.copy()
        for left, top, width, height in np.rint(boxes.get(frame.name, np.zeros((0, 4)))).astype(int):
            rows = slice(max(top - AROUND, 0), top + height + AROUND)
            still[rows, max(left - AROUND, 0) : left + width + AROUND] = False
        now = _Key(as_grey(frame.image, frame.valid), still, found[-1])
        if key is not None and last is not None:
            moved, agree = _moved(key, now.grey)
            if moved is None or agree < ENOUGH * most:
                key, most = last, 0
                moved, agree = _moved(key, now.grey)
            most = max(most, agree)
            lost += moved is None
            if moved is not None:
                to_first = key.to_first @ np.linalg.inv(moved)
                now = now._replace(to_first=to_first / to_first[2, 2])
        key, last = key or now, now
        found.append(now.to_first)
    return np.array(found[1:]), lost


def _moved(key: _Key, grey: Grey) -> tuple[Array | None, int]:
    """The homography from one frame to another, None where it is not known or far, and how many corners
    agree on it."""
    moved, agree = common_homography(*followed_corners(key.grey, grey, key.still), AGREEMENT_PX)
    height, width = grey.shape
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], float)
    far = np.abs(warped(moved, corners) - corners).max()
    return moved if far < FAR_MOVED * width else None, int(agree.sum())


def warped(homography: Array, uv: Array) -> Array:
    """Where a homography (3, 3) takes pixels (N, 2)."""
    moved = uv @ homography[:, :2].T + homography[:, 2]
    return np.asarray(moved[:, :2] / moved[:, 2:])


def track_video(
    detections: pd.DataFrame, frames: pd.DataFrame, to_first: Array, metres_per_px: float
) -> tuple[pd.DataFrame, Count]:
    """Track all animals of a video.

    Parameters
    ----------
    detections, frames
        As `wildlab.analysis.detectors.Detected` has them.
    to_first
        (N, 3, 3) of `camera_motion`.
    metres_per_px
        On the ground, about.

    Returns
    -------
    table
        A row for each frame from a track's first box to its last: ``frame_id``, ``track``, its middle
        ``u_px`` and ``v_px`` smoothed, ``sd_px`` of each of these, ``existence``, a box (`BOX`), and
        ``detection_id`` of the detection whose box it is, "" where the animal was missed.
    count
        Of animals, 90 %.
    """
    usable = frames["problem"].fillna("") == ""
    frames, to_first = frames[usable], to_first[usable]
    detections = detections.reset_index(drop=True)
    groups = detections.groupby("frame_id", sort=False).indices
    rows = [np.asarray(groups.get(one, ()), np.intp) for one in frames["frame_id"]]
    scans = _scans(detections, frames, rows, to_first, metres_per_px)
    settings = read_settings(DATA / "settings" / "video.toml")
    interval = float(np.median(np.diff([one.time for one in scans]))) if len(scans) > 1 else 1.0
    placed = PlacedScans("camera", "position", scans, [frozenset()] * len(scans), interval, 0)
    targets, (sensor,), _ = model_jointly(settings, model_targets(settings.targets)[0], [placed])
    area = placed.area(sensor.far_m)
    for again in (True, False):
        _, shown = smooth_many(scans, [sensor], targets)
        own = [_own_boxes(scan, one) for scan, one in zip(scans, shown, strict=True)]
        if again:
            # What is detected of tracks in view, and what of all is of none.
            taken = sum(int((one >= 0).sum()) for one in own)
            there = sum(len(one.identity) for one in shown)
            false = max((len(detections) - taken) / len(scans), LEAST_FALSE)
            seen = float(np.clip(taken / max(there, 1), 0.1, 0.99))
            sensor = sensor._replace(clutter=false / area, detection=seen)
    same, count = _returned(shown, own, targets, area)
    numbers = [np.append(mine, -1)[one] for mine, one in zip(rows, own, strict=True)]
    table = _table(detections, frames, to_first, metres_per_px, shown, numbers)
    return table.assign(track=table["track"].map(same)), count


def _scans(
    detections: pd.DataFrame, frames: pd.DataFrame, rows: list[Indices], to_first: Array, metres_per_px: float
) -> list[Scan]:
    """The frames as scans of the plane of the first one, m."""
    times = frames["time_s"].to_numpy(float)
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        times = np.arange(len(frames)) / RATE_HZ
    size = frames[["width_px", "height_px"]].max().to_numpy(float)
    uv = detections[["u_px", "v_px"]].to_numpy(float)
    R = detections[COVARIANCE].to_numpy(float).reshape(-1, 2, 2) + LEFT_PX**2 * np.eye(2)
    scans = []
    for time, mine, H in zip(times, rows, to_first, strict=True):
        at = warped(H, uv[mine])
        J = (H[:2, :2] - at[:, :, None] * H[2, :2]) / (uv[mine] @ H[2, :2] + H[2, 2])[:, None, None]
        spread = metres_per_px**2 * J @ R[mine] @ np.swapaxes(J, 1, 2)
        middle = metres_per_px * warped(H, size[None] / 2)[0]
        sees = partial(_in_frame, np.linalg.inv(H), metres_per_px, size)
        scans.append(Scan(float(time), 0, middle, metres_per_px * at, spread, sees))
    return scans


def _in_frame(from_first: Array, metres_per_px: float, size: Array, places: Array) -> Mask:
    return _inside(warped(from_first, places / metres_per_px), size)


def _inside(uv: Array, size: Array) -> Mask:
    return np.asarray(((uv > -0.5) & (uv < size - 0.5)).all(axis=1))


def _own_boxes(scan: Scan, shown: Shown) -> Indices:
    """(T,) which box of a scan is each track's, -1 none."""
    off = scan.z[:, None] - shown.x[None, :, :2]
    return global_nearest(
        innovation_squared(off, scan.R[:, None] + shown.P[None, :, :2, :2]), gate_threshold(OWN, 2)
    ).measurement


def _returned(
    shown: list[Shown], own: list[Indices], targets: ManyTargetModel, area: float
) -> tuple[dict[int, int], Count]:
    """The number that each track gets, and how many animals there are.

    A track that begins may be an animal whose track ended before: as probable as its place under the earlier
    track's motion, against newcomers anywhere in view.
    """
    begins, ends = dict[int, tuple[float, Array, Array]](), dict[int, tuple[float, Array, Array]]()
    exists = dict[int, float]()
    for one, boxes in zip(shown, own, strict=True):
        for row, name in enumerate(one.identity.tolist()):
            exists[name] = max(exists.get(name, 0.0), float(one.existence[row]))
            if boxes[row] >= 0:
                ends[name] = one.time, one.x[row], one.P[row]
                begins.setdefault(name, ends[name])
    names = sorted(begins)
    times, x, P = (np.array([begins[name][part] for name in names]) for part in range(3))
    weights = np.zeros((len(names), len(names)))
    for i, name in enumerate(names):
        time, state, spread = ends[name]
        later = np.flatnonzero(times > time)
        gap = (times[later] - time)[:, None, None]
        F = np.concatenate([np.ones_like(gap) * np.eye(2), gap * np.eye(2)], axis=2)
        S = F @ spread @ np.swapaxes(F, 1, 2) + targets.density**2 * gap**3 / 3 * np.eye(2)
        near = likelihoods(x[later, :2] - F @ state, S + P[later, :2, :2], np.inf)
        weights[i, later] = np.exp(-gap[:, 0, 0] / targets.lifetime_s) * near * area
    # How many newcomers are to be expected nobody knows: as many as there are tracks, or one.
    missed = np.ones(len(names))
    likely = [association_probabilities(weights / many, missed)[:, 1:] for many in (max(len(names), 1), 1)]
    same = {name: name for name in names}
    for j, new in enumerate(names):
        if likely[0][:, j].max() > SAME:
            same[new] = same[names[int(likely[0][:, j].argmax())]]
    there = np.array([exists[name] for name in names])
    most, least = (
        count_interval(count_probabilities(there * np.clip(1 - back.sum(axis=0), 0, 1))) for back in likely
    )
    return same, most._replace(mean=(most.mean + least.mean) / 2, low=least.low)


def _table(
    detections: pd.DataFrame, frames: pd.DataFrame, to_first: Array, metres_per_px: float, shown: list[Shown],
    numbers: list[Indices],
) -> pd.DataFrame:  # fmt: skip
    """As of `track_video`; ``numbers`` are rows of the detections, -1 none, of each track of each frame."""
    parts = []
    size = frames[["width_px", "height_px"]].max().to_numpy(float)
    for name, one, of, H in zip(frames["frame_id"], shown, numbers, to_first, strict=True):
        uv = warped(np.linalg.inv(H), one.x[:, :2] / metres_per_px)
        sd = np.sqrt(np.trace(one.P[:, :2, :2], axis1=1, axis2=2) / 2) / metres_per_px
        columns = {"frame_id": name, "track": one.identity, "row": of, "u_px": uv[:, 0], "v_px": uv[:, 1]}
        parts.append(pd.DataFrame(columns | {"sd_px": sd, "existence": one.existence}))
    table = pd.concat(parts, ignore_index=True)
    own = detections[[*BOX, "detection_id"]].reindex(table.pop("row")).reset_index(drop=True)
    seen = own["detection_id"].notna()
    sides = own[BOX[2:]].groupby(table["track"])
    # Before its first box and after its last nothing says that it is there.
    between = (sides.ffill() + sides.bfill()) / 2
    middle = table[["u_px", "v_px"]].to_numpy()
    filled = pd.DataFrame(np.hstack([middle - between / 2, between]), columns=BOX)
    table = table.join(own[BOX].fillna(filled))
    table["detection_id"] = own["detection_id"].fillna("")
    known = between.notna().all(axis=1)
    return table[known & (seen | _inside(middle, size))].reset_index(drop=True)
