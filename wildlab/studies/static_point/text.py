"""What the report on a point at rest says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.studies.track_text import typical_words

OBSERVER, AUTOPILOT = "observer", "pixhawk-autopilot"
UNSYNCED, UNCALIBRATED = "without-time-synchronization", "without-misalignment-calibration"
_LAGS = [("filter", "lag1_north"), ("filter", "lag1_east")]

METHOD = r"""Pixels are placed on the plane at the target's height by H (5.13). Mean, standard
deviation and mean error are those of the distances to the known position. Without synchronisation the pose is
taken at the stamp that the on-board computer gave the image. The simulated IMU is mounted with the published
misalignment and feels the flight in its own axes. With calibration the observer gets its samples turned to
the axes of the airframe; without, it gets them as they are and takes them for the airframe's, and everything
runs on them. The antennas stand where they stand in both cases.

The observer is the nonlinear one of H 5.5 on the simulated inertial samples and the two receivers' positions
and velocities, with the gains of its defaults.

The filter has the motion model of an object at rest ($\mathbf{F} = \mathbf{I}$, $\mathbf{Q} = \mathbf{0}$)
and the observer's poses; $\mathbf{R}$ is each point's own ground covariance. Autocorrelations are divided by
their value at lag zero; white noise of this length stays within the grey band at 95 % of the lags."""


def path_words(nav: pd.DataFrame, seen: pd.Series) -> str:
    """Alternative text of the map of the path, the antenna being the origin.

    Parameters
    ----------
    nav
        The path, with ``time_s``, ``north_m`` and ``east_m``.
    seen
        When the antenna was seen, s.
    """
    north, east = (nav[f"{axis}_m"].to_numpy(float) for axis in ("north", "east"))
    off = np.interp(seen, nav["time_s"], np.hypot(north, east))
    return (
        f"Map of the path in local metres, {np.ptp(north):.0f} m from south to north and "
        f"{np.ptp(east):.0f} m from west to east, with the {len(off)} places from which the antenna was "
        f"seen, {off.min():.0f} to {off.max():.0f} m beside it."
    )


def summary(spread: pd.DataFrame, bound: float) -> list[str]:
    """Three sentences on what the trial of this case gives, one row for each flight.

    ``bound``: what the autocorrelation of white innovations stays below.
    """
    mae = {column: spread[column, "mae"] for column in (OBSERVER, AUTOPILOT, UNSYNCED, UNCALIBRATED)}
    more = float((mae[UNSYNCED] - mae[OBSERVER]).median())
    unsynced = (
        f"a camera clock that is not synchronised costs {more:.1f} metres beside one that is."
        if not more <= 0
        else "a camera clock that is not synchronised costs nothing on most flights."
    )
    alike = float(spread[_LAGS].median().min())
    watching = (
        ""
        if np.isnan(alike)
        else f"Images taken right after one another are {'' if alike > bound else 'not all '}wrong in the "
        "same way."
    )
    return [
        f"From 350 metres a single thermal image places a point about {mae[OBSERVER].median():.0f} metres "
        f"from where it is, with sensors for navigation beside the camera; with a common autopilot's pose it "
        f"is {mae[AUTOPILOT].median():.0f} metres.",
        f"Where the angles of those sensors are not calibrated it is {mae[UNCALIBRATED].median():.0f} "
        f"metres; {unsynced}",
        watching,
    ]


def sureness(spread: pd.DataFrame) -> str:
    """Whether the filter's last estimate is as near as it states, over all flights."""
    nees = spread["filter", "nees_at_end"].dropna().to_numpy(float)
    flights = len(nees)
    if not flights:
        return "not known"
    above = int((nees > chi_square_interval(2)[1]).sum())
    return f"surer than it may be on {above} of {flights} flight{'s' * (flights > 1)}"


def drawn_words(spread: pd.DataFrame) -> str:
    """How typical the flight of the figures is: in its single images, and in its filtered position."""
    return (
        f"In the mean error of single images, with the observer's pose, the flight of the figures is "
        f"{typical_words(spread[OBSERVER, 'mae'])}; in the filtered position's error at the end it is "
        f"{typical_words(spread['filter', 'at_end'])}, where the median is "
        f"{spread['filter', 'at_end'].median():.1f} m."
    )


def partings(
    spread: pd.DataFrame, published: Mapping[tuple[str, str], float], n: int, bound: float
) -> list[str]:
    """Where simulated flights with ``n`` observations each and the published numbers part.

    ``bound``: what the autocorrelation of white innovations stays below.
    """
    mean_off = np.asarray(np.hypot(spread[OBSERVER, "mean_north"], spread[OBSERVER, "mean_east"]), float)
    published_off = float(np.hypot(published[OBSERVER, "mean_north"], published[OBSERVER, "mean_east"]))
    ours, theirs = spread[OBSERVER, "mae"], published[OBSERVER, "mae"]
    ratio = float((spread[AUTOPILOT, "mae"] / ours).median())
    coverage = 100 * float(spread["filter", "coverage"].median())
    near, met = int((mean_off <= published_off).sum()), int((ours <= theirs).sum())
    known = int(ours.notna().sum()) or np.nan
    alike = float(spread[_LAGS].median().min())
    shared = (
        f" Innovations here are correlated by {alike:.2f} at lag one on the median flight (the less "
        f"correlated of north and east); figure 5.7 shows correlated ones too: errors that neighbouring "
        f"images share average out slowly, also over {n} images."
        if alike > bound and near < len(spread) / 2
        else ""
    )
    return [
        f"The published mean of all positions is {published_off:.1f} m from the truth; {near} of "
        f"{len(spread)} flights come that near, their median is {np.median(mean_off):.1f} m.{shared}",
        f"The published mean error of {theirs:.2f} m or less is met by {met} of {known} flights.",
        f"The autopilot's mean error is {ratio:.1f} times the observer's here, and "
        f"{published[AUTOPILOT, 'mae'] / theirs:.1f} times in print.",
        f"The ellipses computed from the uncertainties that are assumed here hold the truth in "
        f"{coverage:.0f} % of cases instead of 90 %"
        + (": they are wider than the simulated errors ask for." if coverage > 90 else "."),
    ]
