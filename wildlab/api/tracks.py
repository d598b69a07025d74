"""Navigation and tracks for a notebook, and whether their filters are honest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from wildlab.brief import Brief, Summary
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import Average
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.pipeline.consistency import Series, mean_of_runs, navigation_series
from wildlab.pipeline.follow import ACCELERATION, FILTERS, START_SPEED, Filter, usual_tuning
from wildlab.pipeline.following.judged import FEW_INDEPENDENT, verdict
from wildlab.pipeline.georeference import assumed_deviations
from wildlab.pipeline.navigate import MekfTuning, Navigated, navigate_mekf, navigate_observer
from wildlab.pipeline.navigation_errors import (
    REFERENCES,
    Errors,
    comparison_times,
    errors_against,
    flown_part,
    summarise,
)
from wildlab.pipeline.track import CvTuning, Scored, Sighting, evaluate_track, sighting
from wildlab.tracking.run import Track

Method = Literal["mekf", "observer"]


@dataclass(frozen=True, repr=False)
class Navigation(Brief):
    """Poses from inertial samples and satellite positions.

    Attributes
    ----------
    flight
        The flight with one more ``nav`` table.
    source
        The name of that table.
    found
        What the filter gave: poses, biases, innovations, signs of trouble.
    reference
        The poses it is compared with, the truth where there is one; None where there is nothing.
    errors
        Reference minus estimate; None where there is no reference.
    part
        What part of the flight counts, and from when to when, s.
    """

    flight: Flight
    source: str
    found: Navigated
    reference: str | None
    errors: Errors | None
    part: tuple[str, float, float]

    def brief(self) -> Summary:
        """How many poses there are, how far off they are, and signs of trouble."""
        rows = [("poses", f"{len(self.found.nav)}, by the {self.source}")]
        if self.errors is not None:
            what, begin, end = self.part
            n = summarise(self.errors, begin, end)
            rows += [
                (f"RMS against {self.reference}", what),
                (
                    "north, east, down",
                    ", ".join(f"{n[f'rms_{k}']:.2f}" for k in ("north", "east", "down")) + " m",
                ),
                (
                    "roll, pitch, yaw",
                    ", ".join(f"{n[f'rms_{k}']:.2f}" for k in ("roll", "pitch", "yaw")) + " deg",
                ),
            ]
        rows += [("sign of trouble", sign) for sign in self.found.signs]
        return Summary(f"Navigation of {self.flight.name}", rows)


def navigate(flight: Flight, method: Method = "mekf", tuning: MekfTuning | None = None) -> Navigation:
    """Find a flight's poses from its inertial samples and satellite positions.

    Velocities of the receiver are used where there are any. Poses are found at the frames, and at the times
    of the reference at which they are compared.

    Parameters
    ----------
    flight
        With the tables ``imu`` and ``gnss``. It is not changed: the result holds one with the new poses.
    method
        ``"mekf"``, the error-state filter of H 7.3, with covariance; or ``"observer"``, the nonlinear
        observer of H 5.5, without.
    tuning
        Noise that the filter is told of in place of what the manifest states, for instance
        `wildlab.pipeline.navigate.PUBLISHED_LIKE`; for ``"mekf"`` only.

    Returns
    -------
    Navigation

    Raises
    ------
    WildlabError
        Where the flight lacks inertial samples, satellite positions, or what is known of their errors; where
        the method is not known, or takes no tuning.

    Examples
    --------
    >>> import wildlab
    >>> nav = wildlab.navigate(wildlab.simulate("fast-vessel"))  # doctest: +SKIP
    >>> nav.found.nav.columns[0]  # doctest: +SKIP
    'time_s'
    """
    if method not in ("mekf", "observer") or (method == "observer" and tuning is not None):
        raise WildlabError(
            f"there is no method {method!r}" if tuning is None else f"the {method} takes no tuning",
            "use 'mekf', or 'observer' without a tuning",
            field="method",
        )
    reference = next((name for name in REFERENCES if name in flight.nav), None)
    compared = np.empty(0) if reference is None else comparison_times(flight, reference)
    frames = frame_times(flight) if flight.frames is not None else np.empty(0)
    wanted = np.union1d(frames[np.isfinite(frames)], compared)
    times = wanted if len(wanted) else None
    found = (
        navigate_mekf(flight, times, tuning=tuning) if method == "mekf" else navigate_observer(flight, times)
    )
    more = Flight(
        flight.manifest, flight.nav | {method: found.nav}, flight.tables, flight.folder, flight.terrain
    )
    errors = None
    if reference is not None:
        errors = errors_against(flight.nav[reference], found.nav, compared, found.velocity_covariance)
    return Navigation(more, method, found, reference, errors, flown_part(flight, found.nav["time_s"]))


@dataclass(frozen=True, repr=False)
class Tracked(Brief):
    """One target followed through a flight.

    Attributes
    ----------
    flight, source, filter
        The flight, the poses that the filter saw, and the filter.
    tuning
        What it was told.
    seen
        What the camera saw of the target.
    track
        Estimates with covariances, innovations.
    scored
        Beside the truth; None where the target has none.
    """

    flight: Flight
    source: str
    filter: Filter
    tuning: CvTuning
    seen: Sighting
    track: Track
    scored: Scored | None

    def brief(self) -> Summary:
        """What was followed with what, and how far off it was."""
        t = self.tuning
        noise = f"{t.measurement:.3g} m" if self.filter == "kf" else f"{t.pixel:.3g} px"
        rows = [
            ("filter", f"{self.filter}, poses from {self.source}"),
            ("tuning", f"acceleration {t.acceleration:g} m/s^2, measurement {noise}"),
            ("at the start", f"{t.position_0:.3g} m, {t.velocity_0:.3g} m/s"),
            ("detections", f"{int(self.seen.seen.sum())} in {np.ptp(self.seen.times):.0f} s"),
        ]
        if self.scored is not None:
            n = self.scored.numbers
            far = f"{n['mae']:.2f} m mean, {n['rmse']:.2f} m RMS, with or without a detection"
            rows.append(("distance from the truth", far))
            rows.append(("mean NEES and NIS", f"{n['nees']:.2f} and {n['nis']:.2f} (see consistency)"))
        return Summary(f"Track on {self.flight.name}", rows)


def track(
    flight: Flight,
    target: str | None = None,
    source: str | None = None,
    filter: Filter = "schmidt",
    *,
    acceleration: float = ACCELERATION,
    velocity: float = START_SPEED,
    position: float | None = None,
    measurement: float | None = None,
    pixel: float | None = None,
) -> Tracked:
    """Follow one target with constant velocity (H 6.2, 6.3, 7.4). All noise is standard deviations per axis.

    Parameters
    ----------
    flight
        With frames, pixel detections and poses.
    target
        Its name; may be left out where the detections name one only.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    filter
        ``"schmidt"`` on pixels, with the poses' uncertainty considered; ``"ekf"`` on pixels, poses taken for
        true; ``"kf"`` on georeferenced positions.
    acceleration
        Of the target, m/s^2.
    velocity
        At the start, m/s; the track starts at rest on the first detection.
    position
        At the start, m. Left out: as ``measurement``.
    measurement
        Of a georeferenced position, m. Left out: what `georeference` states of this target's detections, root
        mean square.
    pixel
        Of a detection, px. Left out: what the manifest states, else 2.

    Returns
    -------
    Tracked

    Raises
    ------
    WildlabError
        Where there is no such target or source or filter, several to choose from, or for ``"schmidt"`` no
        covariance of the poses.

    Examples
    --------
    >>> import wildlab
    >>> flight = wildlab.simulate("large-ship")
    >>> followed = wildlab.track(flight, source="autopilot", filter="kf", acceleration=0.1)
    >>> followed.track.x.shape[1], followed.tuning.acceleration
    (4, 0.1)
    """
    if filter not in FILTERS:
        raise WildlabError(
            f"there is no filter {filter!r}", f"use one of {', '.join(FILTERS)}", field="filter"
        )
    name, _ = flight.pose_source(source)
    seen = sighting(flight, name, target)
    if filter == "schmidt" and seen.poses.covariance is None:
        raise WildlabError(
            f"the poses {name!r} have no covariance, and the Schmidt filter considers it",
            "use those of navigate(flight).flight, source 'mekf'; or the filter 'ekf' or 'kf'",
            field="source",
        )
    if measurement is None:
        usual = usual_tuning(flight, target, name, acceleration=acceleration, velocity=velocity)
    else:
        usual = CvTuning(
            acceleration, measurement, velocity, measurement, assumed_deviations(flight)["pixel_px"]
        )
    tuning = usual._replace(
        position_0=usual.measurement if position is None else position,
        pixel=usual.pixel if pixel is None else pixel,
    )
    found = FILTERS[filter](seen, tuning)
    known = np.isfinite(seen.truth[:, :2]).all(axis=1) & np.isfinite(found.x[:, :2]).all(axis=1)
    axes = ("north", "east") if filter == "kf" else ("u", "v")
    scored = evaluate_track(seen, found, axes) if known.any() else None
    return Tracked(flight, name, filter, tuning, seen, found, scored)


@dataclass(frozen=True, repr=False)
class Consistency(Brief):
    """Whether filters know how wrong they are.

    Attributes
    ----------
    means
        By what it is a mean of: NEES and NIS beside the 95 % interval of a consistent filter's, for as many
        values as the correlated ones are worth.
    series
        The values, by the same names, one series for each run.
    """

    means: dict[str, Average]
    series: dict[str, tuple[Series, ...]]

    def brief(self) -> Summary:
        """A row for each mean."""
        rows = []
        for name, a in self.means.items():
            said = verdict(a)
            if not a.inside and a.worth < FEW_INDEPENDENT:
                said += ", but on few independent values"
            count = f"{a.n}, worth {a.worth:.0f}"
            dof = str(self.series[name][0].dof)
            rows.append((name, f"{a.mean:.2f}", dof, f"{a.low:.2f} to {a.high:.2f}", count, said))
        head = ("mean of", "is", "should be", "95 % interval", "values", "so the filter is")
        return Summary("Consistency", rows, head)


def consistency(*results: Tracked | Navigation) -> Consistency:
    """Mean NEES and NIS of one run, or of several independent ones, beside what they should be.

    Of a track: the NEES of its position (two degrees of freedom) and the NIS of its detections (two). Of a
    navigation: the NEES of position, velocity and attitude (three each) in that part of the flight which
    counts. Values of one run are correlated, so each run counts as what its values are worth. That is an
    estimate from the same values: where it is below `FEW_INDEPENDENT`, an honest filter's mean falls outside
    of the interval not in 5 % of cases but in 10 to 30 %, and the verdict says so. More runs help.

    Parameters
    ----------
    *results
        All from `track`, or all from `navigate`; of different flights, or seeds, where there are several.

    Returns
    -------
    Consistency

    Raises
    ------
    WildlabError
        Where nothing is given, tracks are mixed with navigation, or there is nothing to judge.

    Examples
    --------
    >>> import wildlab
    >>> followed = wildlab.track(wildlab.simulate("large-ship"), source="autopilot", filter="kf")
    >>> list(wildlab.consistency(followed).means)
    ['NEES position', 'NIS']
    """
    if len({type(one) for one in results}) != 1:
        raise WildlabError(
            "results of one kind are needed", "give tracks, or give navigations", field="results"
        )
    gathered: dict[str, list[Series]] = {}
    for one in results:
        for series in _series(one):
            gathered.setdefault(series.name, []).append(series)
    if not gathered:
        raise WildlabError(
            "there is nothing to judge: no truth, no covariance and no innovation",
            "give results of a flight with truth, or a filter with a covariance",
            field="results",
        )
    means = {name: mean_of_runs(runs) for name, runs in gathered.items()}
    return Consistency(means, {name: tuple(runs) for name, runs in gathered.items()})


def _series(one: Tracked | Navigation) -> list[Series]:
    if isinstance(one, Navigation):
        scored = one.errors is not None and one.reference == REFERENCES[0]
        return navigation_series(one.errors, *one.part[1:]) if one.errors is not None and scored else []
    nis = Series("NIS", 2, one.seen.times, one.track.nis)
    nees = [] if one.scored is None else [Series("NEES position", 2, one.seen.times, one.scored.nees)]
    return [each for each in (*nees, nis) if np.isfinite(each.values).any()]
