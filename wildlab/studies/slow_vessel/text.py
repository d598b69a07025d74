"""What the report on a slowly moving vessel says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

#: Height of the first case, m (H 5.6.1).
FIRST_HEIGHT = 350.0
#: Words for the subjects of the tables, in the order of `wildlab.studies.slow_vessel.trial.SUBJECTS`.
NAMES = ("Observer", "Autopilot", "Observer, subset", "Autopilot, subset")

METHOD = r"""Pixels are placed on the plane of the sea by H (5.13) and compared with the vessel's
single-frequency receiver, linear in time between its fixes. Its errors, metres that wander over minutes, and
its place a metre behind the middle of the vessel count as errors of the images, as in the thesis.

The observer is the nonlinear one of H 5.5 on the simulated inertial samples and the two receivers' positions
and velocities, with the gains of its defaults.

The filter is a Kalman filter with constant velocity, H (6.1) to (6.3), on the positions by the observer's
pose, started on the first one with zero speed. H 5.6.2 prints no tuning. It has that of H table 7.3, filter
1, for the same kind of vessel from 200 to 300 m: $\sigma_v = 0.01$ m/s² (as in H 6.4.2, flight 2),
$\mathbf{R} = (13\,\mathrm{m})^2$, $\mathbf{P}(0)$ of 13 m and 1 m/s. An acceleration is held for an image's
interval of 1/7.5 s.

The first case is the twin of H 5.6.1, an antenna from 350 m, flown with the same seeds."""

LIMITS = [
    "The flight of the thesis was never published; this one is like it in everything that is printed, and "
    "chosen in the rest: the vessel's manoeuvres, the wind, how far off its receiver is.",
    "How much the payload, which carries the sensors, turns against the airframe, which carries the camera, "
    "is not known; the observer cannot see it. Nor is it known how much the camera turns against the "
    "airframe after changes of bank, and why: that it does was fitted, to tables of other flights.",
    "Every detection is one of the vessel: what else a detector takes for one is not simulated.",
    "An error of the vessel's receiver cannot be told from one of the images, on a logged flight.",
]


def heights(spread: pd.DataFrame) -> str:
    """The mean height of the aircraft when it saw the vessel, in words."""
    return f"{round(spread['observer', 'height'].median(), -1):.0f} metres"


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what `wildlab.studies.slow_vessel.trial.trial` gives, one row for each flight."""
    middle = spread.median()
    reference, track = middle["reference", "mae"], middle["filter", "mean"]
    images, exact = middle["observer", "mae"], middle["observer-exact", "mae"]
    return [
        f"From {heights(spread)} on average a single thermal image places a drifting vessel about "
        f"{images:.0f} metres from where its own receiver says it is.",
        f"Against where the vessel really is the images are {exact:.1f} metres off; the receiver is "
        f"{reference:.1f} metres off itself.",
        f"A filter that follows the vessel is {track:.1f} metres off on average, "
        f"{'less' if track < images else 'more'} than the images it is made of.",
    ]


def tracking(spread: pd.DataFrame) -> tuple[str, str]:
    """Title and first paragraph of what is said about the filter."""
    middle = spread.median()
    images, track = middle["observer", "mae"], middle["filter", "mean"]
    loose = middle["filter-by-detections", "mean"]
    verdict = "nearer than single images" if track < images else "no nearer than single images"
    return (
        f"The track: {verdict} with a tuning of the thesis",
        "The thesis prints no tuning for this filter; it has the one of table 7.3, made for a vessel that "
        f"drifts. With it the estimate is {track:.1f} m off on average (median of the flights), single "
        f"images {images:.1f} m. How the filter cuts time matters: stepping from detection to detection, so "
        f"that an acceleration is held through the pauses, the same tuning gives {loose:.1f} m. The thesis "
        "does not say which of the two it did.",
    )


def partings(spread: pd.DataFrame, published: Mapping[tuple[str, str], float]) -> list[str]:
    """Where simulated flights and published numbers part, and what a smaller or larger height makes of it."""
    middle = spread.median()
    ours, theirs = middle["observer", "mae"], published["observer", "mae"]
    reached = 100 * float((spread["observer", "mae"] >= theirs).mean())
    offs = float(np.median(np.hypot(spread["observer", "mean_north"], spread["observer", "mean_east"])))
    printed = float(np.hypot(published["observer", "mean_north"], published["observer", "mean_east"]))
    first, height = middle["first-case", "mae"], middle["observer", "height"]
    carried = first * height / FIRST_HEIGHT
    more = "more" if middle["observer-exact", "mae"] > carried else "no more"
    return [
        f"The published mean error is {theirs:.2f} m, the median here {ours:.1f} m; {reached:.0f} % of the "
        "flights come up to the published one.",
        f"The same errors of angles weigh {height:.0f}/{FIRST_HEIGHT:.0f} as much from here as in the first "
        f"case, where they made {first:.1f} m: {carried:.1f} m. Against where the vessel really is the "
        f"images are {middle['observer-exact', 'mae']:.1f} m off, {more} than that.",
        f"The mean of all positions is {offs:.1f} m off here (median), {printed:.1f} m in print.",
    ]
