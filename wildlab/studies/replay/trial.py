"""Moments of a flight like those of F's screenshots (figures 7.20, B.1, B.2), and a clock set by hand.

What is in view is told by the truth: a target whose place the image shows. What is detected is what the
flight's detections name. A track runs from a target's first detection on: the thesis never ends one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe, truth_of
from wildlab.evaluation.shares import Check
from wildlab.flight.clocks import frame_times, gimbal_angles, poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry import CameraPoses, in_image, widest_view
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel
from wildlab.geometry.terrain import pixels_to_terrain
from wildlab.simulation.error_models import stream
from wildlab.simulation.twins import simulate_twin

#: The poses that the program had, and those that tell what was in view.
SOURCE, TRUE = "autopilot", "truth"
#: What the screenshots show, and the clock of the images.
ONE, SINGLE, NONE, CLOCK = "one-of-several", "one-detected", "none-in-view", "clock"
RECORDED = {"share_of_frames": "1", "error_unset": "m", "error_set": "m"}
#: Tracks that "several" and "a number of" are read as, at least.
SEVERAL = 2
#: How far the stamps of images from another computer are off, s, either way; and the steps of the parameter
#: that sets them right by hand.
OFF_S, STEP_S = 1.0, 0.1


class Moments(NamedTuple):
    """Frames of a flight, in the order of time.

    Attributes
    ----------
    times
        (N,) s.
    in_view, detected, running
        (N,) how many targets the image shows, how many are detected in it, and how many tracks run.
    right
        (N,) whether what is detected is all that is in view.
    """

    times: Array
    in_view: NDArray[np.intp]
    detected: NDArray[np.intp]
    running: NDArray[np.intp]
    right: NDArray[np.bool_]

    def of(self, kind: str) -> NDArray[np.bool_]:
        """(N,) which frames are like the screenshot: one of `ONE`, `SINGLE`, `NONE`."""
        if kind == ONE:
            alone = (self.in_view == 1) & (self.detected == 1)
            return np.asarray(alone & self.right & (self.running >= SEVERAL))
        if kind == SINGLE:
            return np.asarray(self.detected == 1)
        return np.asarray((self.in_view == 0) & (self.detected == 0) & (self.running >= SEVERAL))


def moments_of(flight: Flight) -> Moments:
    """What is in view and detected in each frame of a simulated flight.

    Parameters
    ----------
    flight
        With true poses, the truth of its targets, and detections that name them.

    Returns
    -------
    Moments
    """
    frames, seen = flight.table("frames"), flight.table("detections")
    times = frame_times(flight)
    order = np.argsort(times, kind="stable")
    names, where = truth_at(flight.table("truth"), times, offset_s=flight.manifest.clocks.truth_offset_s)
    p, R, _ = poses_at(flight.nav[TRUE], times, frames["frame_id"])
    m = flight.manifest
    poses = CameraPoses(m.geometry_camera(), m.geometry_mount(), p, R, *gimbal_angles(flight))
    shown = np.stack([_shown(poses, one) for one in where], axis=1)
    row = pd.Index(frames["frame_id"]).get_indexer(pd.Index(seen["frame_id"]))
    column = pd.Index(names).get_indexer(pd.Index(seen["target_id"].fillna("")))
    found = np.zeros_like(shown)
    known = (row >= 0) & (column >= 0)
    found[row[known], column[known]] = True
    found, shown = found[order], shown[order]
    every = np.bincount(row[row >= 0], minlength=len(times))[order]
    return Moments(
        times[order],
        shown.sum(axis=1),
        every,
        np.maximum.accumulate(found, axis=0).sum(axis=1),
        (found == shown).all(axis=1),
    )


def _shown(poses: CameraPoses, places: Array) -> NDArray[np.bool_]:
    """(N,) whether each image shows the place that a target has then."""
    camera = poses.camera
    offset = np.einsum("ni,nij->nj", places - poses.p_nc, poses.R_nc)
    with np.errstate(invalid="ignore"):
        # Far outside the image a lens's polynomial may fold back into it.
        ahead = (offset[:, 2] > 0) & (np.hypot(*offset[:, :2].T) <= widest_view(camera) * offset[:, 2])
    found = np.zeros(len(places), bool)
    which = np.flatnonzero(ahead)
    if len(which):
        uv = ground_to_pixel(camera, places[which], poses.p_nc[which], poses.R_nc[which])
        found[which] = in_image(camera, uv)
    return found


def clock_errors(flight: Flight, off_s: float) -> tuple[float, float]:
    """Median distance from the truth, m, with stamps of the images that are off, and set right by hand.

    Parameters
    ----------
    flight
        Whose stamps are right.
    off_s
        What is added to them; by hand that is taken off to the nearest `STEP_S`.
    """
    true = observe(flight, SOURCE)
    where = truth_of(flight, true.table)
    left = off_s - STEP_S * round(off_s / STEP_S)
    found = []
    for shift in (off_s, left):
        seen = observe(flight, SOURCE, clock_shift=shift)
        if seen.terrain is not None:
            points = pixels_to_terrain(seen.poses, seen.uv, seen.terrain).points
        else:
            points = georeference_pixels(seen.poses, seen.uv, seen.plane_down)
        distance = np.hypot(*(points - where)[:, :2].T)
        found.append(float(np.nanmedian(distance)))
    return found[0], found[1]


def off_of(seed: int) -> float:
    """How far the stamps of the images of a flight are off, s: even within `OFF_S` either way."""
    return float(stream(seed, "clock of the images").uniform(-OFF_S, OFF_S))


def trial(seed: int, *, twin: str) -> dict[tuple[str, str], float]:
    """Shares of the frames that are like each screenshot, and errors before and after the clock is set."""
    return numbers_of(simulate_twin(twin, seed, ("imu", "gnss")), seed)


def numbers_of(flight: Flight, seed: int) -> dict[tuple[str, str], float]:
    """The numbers of `trial` of a flight."""
    moments = moments_of(flight)
    numbers = {(kind, "share_of_frames"): moments.of(kind).mean() for kind in (ONE, SINGLE, NONE)}
    unset, after = clock_errors(flight, off_of(seed))
    return numbers | {(CLOCK, "error_unset"): unset, (CLOCK, "error_set"): after}


def check_claims(runs: pd.DataFrame) -> dict[str, Check]:
    """What the flights give for each claim, by the claim's id.

    Parameters
    ----------
    runs
        What `trial` gives, one row for each flight.
    """
    unset, after = (runs[CLOCK, name].to_numpy(float) for name in ("error_unset", "error_set"))
    ids = {"one-of-several-in-view": ONE, "one-detected": SINGLE, "none-in-view-several-tracks": NONE}
    return {
        **{id: Check(true=runs[kind, "share_of_frames"].to_numpy(float) > 0) for id, kind in ids.items()},
        "manual-sync-increases-precision": Check(true=after < unset, first=unset, second=after, unit="m"),
    }
