"""Navigation and tracks for a notebook, and whether their filters are honest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.accuracy import observe_calibrated
from wildlab.analysis.georeference import (
    assumed_deviations,
    assumed_pose_covariance,
    georeference,
)
from wildlab.analysis.navigate import (
    BLOCKS,
    REFERENCES,
    MekfTuning,
    Navigated,
    NavigationErrors,
    comparison_times,
    errors_against,
    flown_part,
    navigate_mekf,
    navigate_observer,
    summarise,
)
from wildlab.analysis.tracks import tracker
from wildlab.analysis.tracks.pixels import FILTERS, CvTuning, read_pixels, track_schmidt
from wildlab.analysis.tracks.single_target import SMOOTHED, TOGETHER, SensorTrack
from wildlab.analysis.tracks.tracker import (
    WHITE,
    TrackingResult,
    nis_worth,
    seen_of,
    verdict,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    Average,
    Series,
    mean_of_runs,
    position_nees,
    whiten,
    worth_of_errors,
)
from wildlab.evaluation.errors import summarise_track, track_errors
from wildlab.flight.clocks import frame_times
from wildlab.flight.files import check_model
from wildlab.flight.manifest import Settings, read_settings
from wildlab.flight.store import Flight
from wildlab.summary_table import Brief, Summary

Array = NDArray[np.float64]
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
    errors: NavigationErrors | None
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
        Noise that the filter is given of in place of what the manifest states, for instance
        `wildlab.analysis.navigate.PUBLISHED_LIKE`; for ``"mekf"`` only.

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
    """One target followed by one filter, scan by scan.

    Attributes
    ----------
    flight, sensor, target, filter
        Their names; the sensor is ``"together"`` where several look.
    times
        (N,) of the scans, s.
    estimate, covariance
        (N, 4) north, east (m) and their velocities (m/s), and (N, 4, 4); NaN where there is no track.
    error
        (N, 4) truth minus estimate; NaN without a track or truth.
    used
        (N,) scans whose detection the filter used, the one that it starts on among them.
    judged
        (N,) scans that the numbers are of: at which the target was in sight; all, with a tuning, as in H.
    measured
        (N, 2) north and east, m, of the detection that was used; NaN where there was none, or it is no place
        by itself.
    innovation
        (N, m) in the unit of the detections; NaN where none was used.
    nees, nis
        (N,) of the position, and of the detections.
    nis_worth
        How many independent values of NIS there are, as far as their mean goes.
    dof
        Elements of a detection, on average: what the mean NIS should be.
    given
        What the filter was given: what, how much and who says so.
    """

    flight: str
    sensor: str
    target: str
    filter: str
    times: Array
    estimate: Array
    covariance: Array
    error: Array
    used: NDArray[np.bool_]
    judged: NDArray[np.bool_]
    measured: Array
    innovation: Array
    nees: Array
    nis: Array
    nis_worth: float
    dof: float
    given: tuple[tuple[str, str], ...]

    @property
    def truth(self) -> Array:
        """(N, 4) where the target was while it was followed; NaN where that is not known."""
        return self.estimate + self.error

    @property
    def numbers(self) -> dict[str, float]:
        """``mae`` and ``rmse`` (m, horizontal), mean ``nees`` and ``nis``; NaN where they are not known."""
        rows = self.judged
        summary = summarise_track(track_errors(self.truth[rows], self.estimate[rows]))
        means = {"nees": _mean(self.nees[rows]), "nis": _mean(self.nis)}
        return {"mae": summary.mae, "rmse": summary.rmse} | means

    def brief(self) -> Summary:
        """What was followed with what, and how far off it was."""
        n = self.numbers
        rows = [("filter", f"{self.filter}, by {self.sensor}"), *self.given]
        rows.append(("detections used", f"{int(self.used.sum())} in {np.ptp(self.times):.0f} s"))
        if np.isfinite(n["mae"]):
            where = "with or without a detection" if self.judged.all() else "while it was in sight"
            rows.append(("distance from the truth", f"{n['mae']:.2f} m mean, {n['rmse']:.2f} m RMS, {where}"))
        known = [f"{n[name]:.2f} ({name.upper()})" for name in ("nees", "nis") if np.isfinite(n[name])]
        if known:
            rows.append(("mean", f"{', '.join(known)}; see consistency"))
        return Summary(f"Track on {self.flight}", rows)


def track(
    flight: Flight,
    target: str | None = None,
    source: str | None = None,
    filter: str | None = None,
    *,
    sensor: str | None = None,
    settings: Settings | Mapping[str, Any] | Path | None = None,
    smooth: bool = False,
    tuning: CvTuning | None = None,
) -> Tracked:
    """Follow one target, as `wildlab track` does; or with a tuning as H prints it, as the studies do.

    Parameters
    ----------
    flight
        With detections, and poses or positions of the platform.
    target
        Its name; may be left out where there is one only.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    filter
        Of `wildlab.analysis.tracks.single_target`: ``"ekf"``, ``"schmidt"``, ``"ukf"``, ``"imm"``,
        ``"coloured"``, ``"thinned"``. Left out: the Schmidt filter where there are errors to consider, else
        the extended one. With a ``tuning``: ``"schmidt"``, ``"ekf"`` on pixels (H 7.4, 6.3), or ``"kf"`` on
        georeferenced positions (H 6.2).
    sensor
        Its name. Left out: the one that detected something, or all of several together.
    settings
        What is given of sensors and targets: a ``settings.toml``, or the same as a mapping.
    smooth
        Backwards in time as well.
    tuning
        In place of ``settings``, for pixels of one camera.

    Returns
    -------
    Tracked

    Raises
    ------
    WildlabError
        Where there is no such target, source, sensor or filter, or several to choose from.

    Examples
    --------
    >>> import wildlab
    >>> flight = wildlab.simulate("large-ship", without=("imu", "gnss"))
    >>> followed = wildlab.track(flight, settings={"targets": {"acceleration_m_s_sqrt_s": 0.1}})
    >>> followed.filter, followed.estimate.shape[1]
    ('schmidt', 4)
    """
    if tuning is not None:
        if settings is not None or sensor is not None or smooth:
            raise WildlabError(
                "a tuning goes without settings, sensor and smoothing",
                "leave these out, or the tuning",
                field="tuning",
            )
        return _as_tuned(flight, target, source, filter or "schmidt", tuning)
    stated = settings
    if stated is not None and not isinstance(stated, (str, Path, Mapping, Settings)):
        raise WildlabError(
            f"settings are a {type(stated).__name__}", "give a file or a mapping", field="settings"
        )
    if isinstance(stated, (str, Path)):
        stated = read_settings(Path(stated))
    elif isinstance(stated, Mapping):
        stated = check_model(Settings, stated, None)
    found = tracker.track(
        flight,
        settings=stated,
        filters=[] if filter is None else [filter],
        targets=[] if target is None else [target],
        sensors=[] if sensor is None else [sensor],
        source=source,
        smooth=smooth,
    )
    names = sorted({one.target for one in found.tracks})
    if len(names) > 1:
        raise WildlabError(
            f"there are {len(names)} targets", f"name one of {', '.join(names)}", field="target"
        )
    by = found.tracks[-1].sensor if len(found.scans) == 1 else TOGETHER
    by_filter = {one.filter.removesuffix(SMOOTHED): one for one in found.tracks if one.sensor == by}
    wanted = WHITE if filter == "kf" else filter or ("schmidt" if "schmidt" in by_filter else WHITE)
    if wanted not in by_filter:
        raise WildlabError(
            f"the filter {wanted!r} was not used: {' '.join(found.notes)}",
            f"use one of {', '.join(by_filter)}",
            field="filter",
        )
    return _as_followed(flight, found, by_filter[wanted], source)


def _as_followed(flight: Flight, found: TrackingResult, one: SensorTrack, source: str | None) -> Tracked:
    of = {"targets", *(found.scans if one.sensor == TOGETHER else (one.sensor,))}
    about = [each for each in found.given if each.subject in of]
    several = len(of) > 2
    given = [
        (f"{each.subject}: {each.what}" if several else each.what, f"{each.value} ({each.source})")
        for each in about
    ]
    given += [("note", note) for note in found.notes]
    return Tracked(
        flight.name, one.sensor, one.target, one.filter, one.times, one.estimate, one.covariance, one.error,
        one.detection != "", seen_of(one), _places(flight, found, one, source), one.innovation, one.nees,
        one.nis, nis_worth(one), one.dof, tuple(given),
    )  # fmt: skip


def _places(flight: Flight, found: TrackingResult, one: SensorTrack, source: str | None) -> Array:
    """(N, 2) of the detections used, where they are places by themselves."""
    nothing = np.full((len(one.times), 2), np.nan)
    scans = found.scans.get(one.sensor)
    if scans is None:
        return nothing
    if scans.kind == "position":
        which = np.argmax((scans.ids == one.detection[:, None]) & (scans.ids != ""), axis=1)
        chosen = scans.detections[np.arange(len(one.times)), which]
        return np.where((one.detection != "")[:, None], chosen, np.nan)
    # With a clock that is corrected the poses of other times count.
    if scans.kind == "pixel" and not found.beliefs[one.sensor].offset_s:
        points = georeference(observe_calibrated(flight, source)[0], np.random.default_rng(0))
        places = points.set_index("detection_id")[["north_m", "east_m"]]
        return places.reindex(one.detection).to_numpy(float)
    return nothing


def _as_tuned(
    flight: Flight, target: str | None, source: str | None, filter: str, tuning: CvTuning
) -> Tracked:
    if filter not in FILTERS:
        raise WildlabError(
            f"there is no filter {filter!r} with a tuning", f"use one of {', '.join(FILTERS)}", field="filter"
        )
    name, _ = flight.pose_source(source)
    seen = read_pixels(flight, name, target)
    assumed = filter == "schmidt" and seen.poses.covariance is None
    if assumed:
        P = assumed_pose_covariance(seen.poses.R_nb, assumed_deviations(flight))
        found = track_schmidt(seen, tuning, P)
    else:
        found = FILTERS[filter](seen, tuning)
    error = seen.truth - found.x[:, :4]
    noise = f"{tuning.measurement:.3g} m" if filter == "kf" else f"{tuning.pixel:.3g} px"
    given = (
        ("acceleration, measurement", f"{tuning.acceleration:g} m/s^2, {noise}"),
        ("at the start", f"{tuning.position_0:.3g} m, {tuning.velocity_0:.3g} m/s"),
        ("poses", f"{name}, uncertainty assumed" if assumed else name),
    )
    nees = position_nees(error[:, :2], found.P[:, :2, :2])
    pixels = flight.table("detections").query("kind == 'pixel'")
    if target is not None:
        pixels = pixels[pixels["target_id"] == target]
    sensor, called = (str(pixels[column].iloc[0]) for column in ("source", "target_id"))
    return Tracked(
        flight.name, sensor, called, filter, seen.times, found.x[:, :4], found.P[:, :4, :4], error,
        seen.detected, np.ones(len(seen.times), bool), seen.positions, found.innovation, nees, found.nis,
        worth_of_errors(whiten(found.innovation, found.S)), 2.0, given,
    )  # fmt: skip


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


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
            count = f"{a.n}, worth {a.worth:.0f}"
            rows.append(
                (name, f"{a.mean:.2f}", f"{a.dof:.3g}", f"{a.low:.2f} to {a.high:.2f}", count, verdict(a))
            )
        head = ("mean of", "is", "should be", "95 % interval", "values", "so the filter is")
        return Summary("Consistency", rows, head)


def consistency(
    *results: Tracked | Navigation, errors: ArrayLike | None = None, covariances: ArrayLike | None = None
) -> Consistency:
    """Mean NEES and NIS of one run, or of several independent ones, beside what they should be.

    Of a track: the NEES of its position (two degrees of freedom) at the scans that it is judged at, and the
    NIS of its detections (as many as they have elements). Of a navigation: the NEES of position, velocity and
    attitude (three each) in that part of the flight which counts. Values of one run are correlated, so each
    run counts as what its values are worth, an error that lasts as one. That is an estimate from the same
    errors: an honest filter's mean falls outside of the interval in 2 to 9 % of cases. Where the interval
    would also hold half or twice what the mean should be, being inside decides nothing. More runs help.

    Parameters
    ----------
    *results
        All from `track`, or all from `navigate`; of different flights, or seeds, where there are several.
    errors, covariances
        Of anybody's filter, in place of results: (N, n) truth minus estimate and (N, n, n), in the order of
        time; or (M, N, n) and (M, N, n, n) of M independent runs. Innovations and theirs do as well.

    Returns
    -------
    Consistency

    Raises
    ------
    WildlabError
        Where nothing is given, tracks are mixed with navigation, shapes do not fit, a covariance is none, or
        there is nothing to judge.

    Examples
    --------
    >>> import wildlab
    >>> e = np.random.default_rng(1).normal(0.0, 2.0, (500, 2))
    >>> found = wildlab.consistency(errors=e, covariances=np.tile(4 * np.eye(2), (500, 1, 1)))
    >>> found.means["NEES"].inside
    True
    """
    gathered: dict[str, list[Series]] = {}
    if errors is not None and covariances is not None and not results:
        e, P = np.asarray(errors, float), np.asarray(covariances, float)
        if e.ndim not in (2, 3) or 0 in e.shape or P.shape != (*e.shape, e.shape[-1]):
            raise WildlabError(
                f"errors are {e.shape}, covariances {P.shape}",
                "give (N, n) and (N, n, n), or (M, N, n) and (M, N, n, n) of M runs",
                field="covariances",
            )
        runs = zip(e.reshape(-1, *e.shape[-2:]), P.reshape(-1, *P.shape[-3:]), strict=True)
        found = [_series_of("NEES", np.arange(float(e.shape[-2])), whiten(one, its)) for one, its in runs]
        known = [one for one in found if np.isfinite(one.values).any()]
        gathered = {"NEES": known} if known else {}
    elif (errors is None) != (covariances is None):
        missing = "errors" if errors is None else "covariances"
        raise WildlabError("errors and covariances go together", f"give {missing} too", field=missing)
    elif errors is not None or len({type(one) for one in results}) != 1:
        raise WildlabError(
            "results of one kind are needed",
            "give tracks, navigations, or errors with covariances",
            field="results",
        )
    for one in results:
        for series in _series(one):
            gathered.setdefault(series.name, []).append(series)
    if not gathered:
        raise WildlabError(
            "there is nothing to judge: no truth, covariance or innovation",
            "give a flight with truth",
            field="results",
        )
    means = {name: mean_of_runs(runs) for name, runs in gathered.items()}
    return Consistency(means, {name: tuple(runs) for name, runs in gathered.items()})


def navigation_series(errors: NavigationErrors, begin: float, end: float) -> list[Series]:
    """NEES of position, velocity and attitude, three degrees of freedom each, between two times, s.

    Those blocks that have values; of a reference that is the truth, else two estimates' difference is scored.
    """
    during = (errors.times >= begin) & (errors.times < end)
    blocks = [
        _series_of(f"NEES {name}", errors.times[during], errors.white[during, part])
        for name, part in BLOCKS.items()
    ]
    return [one for one in blocks if np.isfinite(one.values).any()]


def _series_of(name: str, times: Array, white: Array) -> Series:
    return Series(name, white.shape[1], times, (white**2).sum(axis=1), worth_of_errors(white))


def _series(one: Tracked | Navigation) -> list[Series]:
    if isinstance(one, Navigation):
        scored = one.errors is not None and one.reference == REFERENCES[0]
        return navigation_series(one.errors, *one.part[1:]) if one.errors is not None and scored else []
    rows = one.judged
    worth = worth_of_errors(whiten(one.error[rows, :2], one.covariance[rows, :2, :2]))
    both = [
        Series("NEES position", 2, one.times, np.where(rows, one.nees, np.nan), worth),
        Series("NIS", one.dof, one.times, one.nis, one.nis_worth),
    ]
    return [each for each in both if np.isfinite(each.values).any()]
