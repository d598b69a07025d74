"""What a flight was like: its paths, attitude, velocity and speed, and when its target was tracked."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.navigation_errors import Studied
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.reporting.charts.georeferencing import aircraft_map
from wildlab.reporting.charts.navigation import (
    NAMES,
    mark_period,
    poses_between,
    span_words,
    speed_chart,
    strips,
    velocities_of,
)
from wildlab.reporting.report import Report

Array = NDArray[np.float64]
Period = tuple[float, float]
#: The map of a flight by the first of its other figures; that of 7.13 on is another case's figure 7.2.
MAPS = {23: 22, 33: 32}


def observation_times(flight: Flight) -> Array:
    """Times of the images with a detection of a target that is named, (K,) s in order; none without any."""
    frames, detections = flight.frames, flight.detections
    if frames is None or detections is None:
        return np.empty(0)
    if "target_id" in detections:
        detections = detections[detections["target_id"].fillna("") != ""]
    times = frame_times(flight)[frames["frame_id"].isin(detections["frame_id"]).to_numpy()]
    return np.sort(times[np.isfinite(times)])


def tracking_period(flight: Flight) -> Period | None:
    """First and last observation of a target, s; None where there are none."""
    times = observation_times(flight)
    return (float(times[0]), float(times[-1])) if len(times) else None


def period_words(period: Period | None) -> str:
    """What the two lines in a figure are, as a sentence to be put behind another."""
    if period is None:
        return ""
    return f" Between the black lines, {period[0]:.0f} to {period[1]:.0f} s, the target was tracked."


def counterpart_words(number: int | None) -> str:
    """Which figure of H it answers to, as a sentence to be put behind another; nothing for None."""
    return "" if number is None else f" Counterpart of H figure 7.{number}."


def show_paths(report: Report, studied: Studied, window: Period, figures: int) -> None:
    """Paths of aircraft and target on a map, with from where the target was seen: H 7.2, 7.22, 7.32.

    Parameters
    ----------
    report
        Is added to.
    studied
        Of a flight with a target's true path; without one nothing is shown.
    window
        Of the path, s.
    figures
        The first figure of H's chapter 7 that the flight's attitude and velocity answer to.
    """
    flight, number = studied.flight, MAPS.get(figures)
    seen = observation_times(flight)
    if flight.truth is None or not len(flight.truth) or not len(seen):
        return
    nav = studied.found["mekf"].nav
    nav = nav[nav["time_s"].between(*window)]
    path = nav[["north_m", "east_m", "down_m"]].to_numpy(float)
    places = np.stack([np.interp(seen, nav["time_s"], column) for column in path.T], axis=1)
    truth = flight.truth.sort_values("time_s")
    below = truth[["north_m", "east_m", "down_m"]].to_numpy(float)
    inside = truth["time_s"].between(float(seen[0]), float(seen[-1])).to_numpy()
    below = below[inside] if inside.sum() > 1 else below
    moved = float(np.linalg.norm(below[-1, :2] - below[0, :2]))
    low, high = np.quantile(below[:, 2].mean() - places[:, 2], [0.05, 0.95])
    title = f"Seen from {low:.0f} to {high:.0f} m above"
    size = np.ptp(path[:, :2], axis=0)
    report.figure(
        aircraft_map(path[:, :2], places[:, :2], below[:, :2], title, "target"),
        name="paths" if number is None else f"fig-7-{number}",
        alt=f"Map in local metres: the path of the aircraft, {size[0]:.0f} m from south to north and "
        f"{size[1]:.0f} m from west to east; the places from which the target was seen in {len(seen)} "
        f"images, {low:.0f} to {high:.0f} m above it; and the target's path, which ends {moved:.0f} m from "
        "its start.",
        caption="Path by the filter (grey), where the target was in view (orange), the target's path by its "
        "receiver from the first to the last observation (black)."
        + (counterpart_words(number) or " H shows such a map in figure 7.2."),
    )


def show_flight(report: Report, studied: Studied, window: Period, figures: int | None) -> None:
    """Attitude, velocity and speed over time, each with the tracking period.

    Parameters
    ----------
    report
        Is added to.
    studied
        Of the flight.
    window
        From when to when, s.
    figures
        The first figure of H's chapter 7 that they answer to; None for a public flight, whose figures have
        names of their own.
    """
    nav, period = _sources(studied, twin=figures is not None), tracking_period(studied.flight)
    moving = {name: table for name, table in nav.items() if "v_north_m_s" in table}
    attitude, _ = poses_between(
        {name: t.reindex(columns=nav["mekf"].columns) for name, t in nav.items()}, *window
    )
    _, velocity = poses_between(moving, *window)
    speeds = {name: velocities_of(table[table["time_s"].between(*window)]) for name, table in moving.items()}
    size = np.linalg.norm(speeds["mekf"][1], axis=1)
    lean = np.abs(np.stack([attitude["mekf"][1][axis] for axis in ("roll (°)", "pitch (°)")]))
    roll, pitch = np.nanmax(lean, axis=1)
    sinks = np.nanmax(np.abs(np.asarray(velocity["mekf"][1]["down (m/s)"], float)))
    speed_words = f"{size.min():.0f} to {size.max():.0f} m/s"
    when = f"{window[0]:.0f} to {window[1]:.0f} s"
    shown = [
        (
            strips(attitude, f"Rolls by up to {roll:.0f}°, pitches by up to {pitch:.0f}°"),
            (0, "attitude"),
            f"Roll, pitch and yaw over time. {span_words(attitude)}.",
            f"Roll, pitch and yaw, {when}.",
        ),
        (
            strips(velocity, f"Climbs or sinks by up to {sinks:.1f} m/s"),
            (1, "velocity"),
            f"Velocity north, east and down over time. {span_words(velocity)}.",
            "Velocity over the same time.",
        ),
        (
            speed_chart(speeds, f"Speed over ground, {speed_words}"),
            (4, "speed"),
            f"Speed over ground over time by {_names(moving)}: {speed_words} by the filter.",
            "Total speed.",
        ),
    ]
    for figure, (offset, name), alt, caption in shown:
        number = None if figures is None else figures + offset
        mark_period(figure, period)
        report.figure(
            figure,
            name=name if number is None else f"fig-7-{number}",
            alt=alt + period_words(period),
            caption=caption + period_words(period) + counterpart_words(number),
        )


def _names(sources: Iterable[str]) -> str:
    return ", ".join(NAMES.get(name, name) for name in sources)


def _sources(studied: Studied, *, twin: bool) -> dict[str, pd.DataFrame]:
    """Filter and autopilot as in H; on a public flight filter, observer, and what was found on board."""
    mekf = studied.found["mekf"].nav
    if twin and "autopilot" in studied.flight.nav:
        return {"mekf": mekf, "autopilot": studied.flight.nav["autopilot"]}
    reference = studied.flight.nav[studied.reference]
    return {
        "mekf": mekf,
        "observer": studied.found["observer"].nav,
        "truth" if twin else "onboard": reference.iloc[:: max(1, len(reference) // 3000)],
    }
