"""Moments of a flight like those of F's screenshots (figures 7.20, B.1, B.2), and a clock set by hand.

What is in view is told by the truth: a target whose place the image shows. What is detected is what the
flight's detections name. A track runs from a target's first detection on: the thesis never ends one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe, truth_of
from wildlab.evaluation.consistency import position_nees
from wildlab.flight.clocks import frame_times, gimbal_angles, poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera import in_image
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel, pixels_to_terrain
from wildlab.geometry.viewsheds import widest_view
from wildlab.replay.scene import Estimates, Points, ReplayScene
from wildlab.reporting.charts.drawing import draw_heights
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    VERMILLION,
    colour,
    ellipse,
    map_axes,
    new_figure,
)
from wildlab.simulation.error_models import stream
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import positions

#: The poses that the program had, and those that tell what was in view.
SOURCE, TRUE = "autopilot", "truth"
#: What the screenshots show, and the clock of the images.
ONE, SINGLE, NONE, CLOCK = "one-of-several", "one-detected", "none-in-view", "clock"
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


#: Variance that a place gains in a second, m^2, along each axis: a metre in a second, chosen.
WALK = 1.0
#: Seconds between estimates where nothing is detected.
EVERY_S = 2.0
FILTER = "kf"


def random_walk(dt: float) -> tuple[Array, Array]:
    """Transition and noise of a place that wanders, F (4.5)."""
    return np.eye(2), WALK * dt * np.eye(2)


def track_targets(flight: Flight, points: Points, begin: float, end: float) -> tuple[Estimates, ...]:
    """A track for each target that detections name, from its first detection to the end.

    Parameters
    ----------
    flight
        Its truth is what errors are counted from.
    points
        Detections on the ground, with covariances; seconds from `begin`.
    begin
        Flight time of the scene's zero, s.
    end
        Last time of the scene, s.

    Returns
    -------
    tuple of Estimates
    """
    found = []
    truth = {} if flight.truth is None else dict(tuple(flight.truth.groupby("target_id", sort=False)))
    usable = np.isfinite(points.covariance).all(axis=(1, 2))
    for name in dict.fromkeys(points.names[usable]):
        if not name:
            continue
        rows = np.flatnonzero(usable & (points.names == name))
        seen, z, R = points.times[rows], points.places[rows, :2], points.covariance[rows]
        times = np.union1d(seen, np.arange(seen[0] + EVERY_S, end, EVERY_S))
        start = Start(float(seen[0]), z[0], R[0], row=0)
        track = run_filter(seen, z, R, positions(), random_walk, start, output_times=times)
        down = np.interp(times, seen, points.places[rows, 2])
        error = np.full((len(times), 2), np.nan)
        if name in truth:
            offset = flight.manifest.clocks.truth_offset_s
            where = truth_at(truth[name], times + begin, offset_s=offset)[1][0, :, :2]
            error = where - track.x[:, :2]
        found.append(
            Estimates(
                str(name),
                FILTER,
                "camera",
                times,
                np.column_stack([track.x[:, :2], down]),
                track.P[:, :2, :2],
                np.hypot(*error.T),
                position_nees(error, track.P[:, :2, :2]),
            )
        )
    return tuple(found)


#: Half of the side of the map, m.
AROUND = 170.0
#: The screenshots of F: kind of moment, and the figure.
SCREENSHOTS = {ONE: "fig-7-20", SINGLE: "fig-b-1", NONE: "fig-b-2"}


def screenshots(scene: ReplayScene, moments: Moments, begin: float) -> list[Shown]:
    """A view of the middle moment of each kind that the flight has; the scene begins at ``begin``, s."""
    found = {kind: np.flatnonzero(moments.of(kind)) for kind in SCREENSHOTS}
    return [
        Shown(
            operator_view(scene, float(moments.times[rows[len(rows) // 2]]) - begin), kind, SCREENSHOTS[kind]
        )
        for kind, rows in found.items()
        if len(rows)
    ]


def operator_view(scene: ReplayScene, t: float) -> Figure:
    """The map about the aircraft, and below it the image.

    Parameters
    ----------
    scene
        With a path, views, a camera and tracks.
    t
        When, s.
    """
    assert scene.path is not None and scene.views is not None and scene.camera is not None  # noqa: S101
    fig, (ax, image) = new_figure(5.6, 7.4, rows=2, height_ratios=[3, 2])
    path, views = scene.path, scene.views
    row = int(np.abs(views.times - t).argmin())
    here = np.array([np.interp(t, path.times, path.places[:, k]) for k in range(2)])
    if scene.terrain is not None:
        draw_heights(ax, scene.terrain)
    flown = path.times <= t
    ax.plot(path.places[flown, 1], path.places[flown, 0], lw=1.0, color=BLUE, label="flown so far")
    outline = views.outlines[row]
    if np.isfinite(outline).all():
        ax.add_patch(Polygon(outline[:, 1::-1], fc=GREEN, ec=GREEN, alpha=0.35, lw=1.5, label="camera sees"))
    ax.plot(*here[::-1], "o", ms=7, color=BLUE, label="aircraft")
    shown = False
    for one in scene.tracks:
        k = int(np.searchsorted(one.times, t, side="right")) - 1
        if k < 0:
            continue
        ellipse(ax, one.places[k, 1::-1], one.covariance[k][::-1, ::-1], color=VERMILLION, lw=1.0, alpha=0.9)
        ax.plot(*one.places[k, 1::-1], "x", ms=4, color=VERMILLION, label=None if shown else "tracks, 90 %")
        shown = True
    for i, target in enumerate(scene.truth):
        place = _at(target.times, target.places, t, still=target.still)
        ax.plot(*place[1::-1], "+", ms=6, color=colour("truth"), label=None if i else "truth")
    ax.set_xlim(here[1] - AROUND, here[1] + AROUND)
    ax.set_ylim(here[0] - AROUND, here[0] + AROUND)
    map_axes(ax)
    w, h = scene.camera.width, scene.camera.height
    image.add_patch(Rectangle((-0.5, -0.5), w, h, fc="#eef2f4", ec=GREY))
    count = 0
    if scene.sightings is not None:
        uv = scene.sightings.uv[scene.sightings.frame == row]
        count = len(uv)
        image.plot(*uv.T, "o", ms=8, mfc="none", mec=ORANGE, mew=2.0)
    image.set(xlim=(-0.5, w - 0.5), ylim=(h - 0.5, -0.5), aspect="equal", xticks=[], yticks=[])
    image.grid(visible=False)
    image.set_title(f"image: {count} detected")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig


def _at(times: np.ndarray, places: np.ndarray, t: float, *, still: bool) -> np.ndarray:
    if still:
        return np.asarray(places[0])
    return np.array([np.interp(t, times, places[:, k]) for k in range(3)])
