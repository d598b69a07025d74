"""What the operator of F 6.3.3 sees, at moments like those of its screenshots."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from wildlab.evaluation.consistency import position_nees
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT
from wildlab.flight.clocks import truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.replay.scene import Estimates, Points, ReplayScene
from wildlab.reporting.charts.forms import draw_heights
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
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study
from wildlab.studies.replay import trial
from wildlab.studies.replay.trial import CLOCK, NONE, ONE, SINGLE, Moments
from wildlab.tracking.run import Start, run_filter
from wildlab.tracking.sensors import positions

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
        first = points.times[rows[0]]
        ticks = np.arange(first + EVERY_S, end, EVERY_S)
        times = np.concatenate([points.times[rows], ticks])
        z = np.concatenate([points.places[rows, :2], np.full((len(ticks), 2), np.nan)])
        R = np.concatenate([points.covariance[rows], np.tile(np.eye(2), (len(ticks), 1, 1))])
        order = np.argsort(times, kind="stable")
        times, z, R = times[order], z[order], R[order]
        start = Start(float(times[0]), z[0].copy(), R[0].copy())
        z[0] = np.nan  # it is where the track starts, and counts once
        track = run_filter(times, z, R, positions(), random_walk, start)
        down = np.interp(times, points.times[rows], points.places[rows, 2])
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


_CLOCK = {HOLDS: "better", MOSTLY: "better", MOSTLY_NOT: "no-better", FAILS: "no-better"}


def answer(facts: Facts) -> list[str]:
    """How often several tracks run and no animal is in view, then what setting the clock by hand changes."""
    empty = facts.value(NONE, "share_of_frames")
    gain = facts.value(CLOCK, "error_unset") - facts.value(CLOCK, "error_set")
    view = "unknown" if math.isnan(empty) else "empty" if empty > 0.5 else "other"
    verdict = facts.verdicts.get("manual-sync-increases-precision", "")
    clock = "unknown" if math.isnan(gain) else _CLOCK.get(verdict, "open")
    return [f"view-{view}", f"clock-{clock}"]


STUDY = Study("replay", trial.trial, trial.check_claims, trial.RECORDED.get, answer)
