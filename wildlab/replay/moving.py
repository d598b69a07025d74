"""A flight as a small picture that moves in its report, for those who do not open a replay."""

from __future__ import annotations

import numpy as np

from wildlab.analysis.overviews.overview import length_of_way
from wildlab.analysis.tracks.judged import LEADING, read_estimates
from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.names import listed
from wildlab.replay.gather import scene_of
from wildlab.replay.scene import Estimates, ReplayScene
from wildlab.replay.words import minutes, plain
from wildlab.reporting.animation import Course, Ellipses, Outlines, ShownFlight
from wildlab.reporting.report import Report

#: Bytes of the picture, and targets whose truth or estimate it shows, at most.
MOST_BYTES, MOST_TARGETS = 400_000, 12


def show_moving(report: Report, flight: Flight, source: str | None = None) -> None:
    """Add the flight, moving, to its report; nothing where it knows no time or no path.

    Parameters
    ----------
    report
        Of that flight. Where it left a table of tracks, one filter's are shown, else single detections alone.
    flight
        With anything missing.
    source
        Name of the ``nav`` table; left out, the best known one.
    """
    estimates = None
    if report.out is not None and (report.out / "estimates.parquet").is_file():
        estimates = read_estimates(report.out / "estimates.parquet")
        # The filter that the page speaks of, where it names one.
        leading = {who for name, who in report.recorded if name == LEADING}
        if estimates["filter"].isin(leading).any():
            estimates = estimates[estimates["filter"].isin(leading)]
    try:
        scene = scene_of(flight, source if source in flight.nav else None, estimates, ellipses=False)
        shown = moving_flight(scene)
    except WildlabError:
        return
    report.animation(
        shown, alt=alt(scene), most_bytes=MOST_BYTES, fold="The flight, moving", intro=said(scene)
    )


def moving_flight(scene: ReplayScene) -> ShownFlight:
    """The arrays of an animation of a scene.

    Parameters
    ----------
    scene
        From `wildlab.replay.gather.scene_of`.

    Returns
    -------
    ShownFlight
        North and east only; every second corner of an outline.

    Raises
    ------
    WildlabError
        Where the flight has no path, or times that are no times.
    """
    path, views, points = scene.path, scene.views, scene.points
    if path is None or not scene.timed:
        raise WildlabError(
            "there is no path over time to show", "give the flight poses with times", field="nav"
        )
    outlines = None
    if views is not None and np.isfinite(views.outlines).any():
        corners = views.outlines[:, :: views.outlines.shape[1] // 4, :2]
        outlines = Outlines(views.times, corners)
    tracks = one_filter(scene.tracks)
    return ShownFlight(
        Course(path.times, path.places[:, :2]),
        outlines,
        None if points is None else Course(points.times, points.places[:, :2]),
        [Ellipses(one.times, one.places[:, :2], one.covariance) for one in tracks],
        [
            Course(np.zeros(1) if one.still else one.times, one.places[:, :2])
            for one in scene.truth[:MOST_TARGETS]
        ],
    )


def one_filter(tracks: tuple[Estimates, ...]) -> tuple[Estimates, ...]:
    """Of several filters' tracks those of the first that considers errors, else of the first."""
    names = dict.fromkeys(one.filter for one in tracks)
    chosen = "schmidt" if "schmidt" in names else next(iter(names), "")
    return tuple(one for one in tracks if one.filter == chosen)[:MOST_TARGETS]


def said(scene: ReplayScene) -> str:
    """The sentence above the picture: what moves in it."""
    parts = ["the aircraft"]
    if scene.views is not None and np.isfinite(scene.views.outlines).any():
        parts.append("what its camera sees of the ground")
    if scene.points is not None:
        parts.append("each detection where it lies on the ground")
    tracks = one_filter(scene.tracks)
    if tracks:
        parts.append(f"the 90 % ellipse of the filter {plain(tracks[0].filter)}")
    if scene.truth:
        parts.append("a cross where a target really was")
    if len(scene.truth) > MOST_TARGETS:
        parts[-1] += f" (the first {MOST_TARGETS} of {len(scene.truth)})"
    return f"{minutes(scene.length)} of flight, over and over: {listed(parts)}. North is up."


def alt(scene: ReplayScene) -> str:
    """What the picture shows, in numbers, for who cannot see it."""
    assert scene.path is not None  # noqa: S101 - for the type checker
    low, high = scene.path.places[:, :2].min(axis=0), scene.path.places[:, :2].max(axis=0)
    way = length_of_way(scene.path.times, scene.path.places[:, :2])
    text = (
        f"Map of the flight: the aircraft goes {way:.0f} m in {minutes(scene.length)}, "
        f"within {high[0] - low[0]:.0f} m north-south and {high[1] - low[1]:.0f} m east-west"
    )
    if scene.points is not None:
        text += f"; {len(scene.points.times)} detections land on the ground"
    if scene.truth:
        text += (
            f"; {len(scene.truth)} true {'place' if len(scene.truth) == 1 else 'places or ways'} of targets"
        )
    return f"{text}."
