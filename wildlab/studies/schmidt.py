"""The extended and the Schmidt-Kalman filter on three flights with one tuning: H 7.5.3 and 7.5.4.

The Schmidt filter is as honest as the covariance of the poses that it is told. It is told three: that of an
MEKF tuned so that it states what H prints (``schmidt``), that of an MEKF given all that the data sheets of
its sensors state (``schmidt-data-sheet``), and a constant one from the known positions of the target on
another flight (``schmidt-estimated``). The first is also scaled (`FACTORS`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from wildlab.analysis.georeference import assumed_deviations
from wildlab.analysis.navigate import (
    AXES,
    PLACES,
    PUBLISHED_LIKE,
    NavigationErrors,
    errors_against,
    navigate_mekf,
)
from wildlab.analysis.tracks.pixels import (
    CvTuning,
    PixelMeasurements,
    Scored,
    evaluate_track,
    read_pixels,
    start,
    track_pixels,
    track_schmidt,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    Average,
    average,
    chi_square_interval,
    position_nees,
    share_inside,
    worth,
)
from wildlab.evaluation.errors import SLOWEST_M_S, summarise_track, track_errors
from wildlab.evaluation.intervals import share_interval
from wildlab.evaluation.pose_noise import PRIOR
from wildlab.flight.clocks import frame_times, poses_at
from wildlab.flight.schema import VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Indices, matrix_to_euler, wrap
from wildlab.geometry.uncertainty import ground_jacobians
from wildlab.reporting.charts.drawing import Values, draw_lines, finish, new_strips
from wildlab.reporting.charts.tracks import (
    error_over_time,
    speed_and_course,
    squares_over_time,
    track_map,
)
from wildlab.reporting.figures import GREEN, GREY, INK, colour, plain_numbers
from wildlab.reporting.published import bounds_of
from wildlab.simulation.twins import simulate_twin
from wildlab.studies.page import Shown
from wildlab.tracking.batch import BatchCamera, run_batch
from wildlab.tracking.kalman import Considered
from wildlab.tracking.run import Track
from wildlab.tracking.sensors import POSE

#: A time without detections that is longer is a pause, s.
PAUSE_S = 2.0
#: From this bank on an airframe turns, rad.
TURNING = np.radians(20.0)
#: Columns of `wildlab.analysis.navigate.NavigationErrors` that are a pose's, and their names.
_POSE = [0, 1, 2, 6, 7, 8]
POSE_NAMES = (*PLACES, *AXES)


def pauses(seen: PixelMeasurements) -> list[Indices]:
    """Rows of the frames of each pause, from the first to the last without a detection.

    Parameters
    ----------
    seen
        From `wildlab.analysis.tracks.pixels.read_pixels`.

    Returns
    -------
    list of (K,) arrays
        In order of time; empty where no two detections are further apart than `PAUSE_S`.
    """
    rows = np.flatnonzero(seen.detected)
    long = np.flatnonzero(np.diff(seen.times[rows]) > PAUSE_S)
    return [np.arange(rows[i] + 1, rows[i + 1]) for i in long]


def pose_numbers(own: NavigationErrors) -> dict[str, float]:
    """What poses state of themselves and how far they are off; m and degrees.

    Parameters
    ----------
    own
        Errors of a nav source against the true poses of the camera's airframe, at the frames:
        ``errors_against(flight.nav["truth"], flight.nav[source], seen.times)``.

    Returns
    -------
    dict
        ``mean_sd_north`` to ``mean_sd_yaw``, means of what is stated, and ``rms_north`` to ``rms_yaw``.
    """
    numbers = {}
    for i, name in zip(_POSE, POSE_NAMES, strict=True):
        numbers[f"mean_sd_{name}"] = shown(name, mean(own.sd[:, i]))
        numbers[f"rms_{name}"] = shown(name, rms(own.error[:, i]))
    return numbers


def premise_numbers(
    flight: Flight, seen: PixelMeasurements, source: str, own: NavigationErrors
) -> dict[str, float]:
    """What sentences on the poses speak of; degrees.

    Parameters
    ----------
    flight
        With the nav sources ``autopilot`` and ``source``.
    seen
        With the poses of that source.
    own
        As for `pose_numbers`.

    Returns
    -------
    dict
        ``sd_spread``: the range that nine of ten of a stated deviation lie in over its median, of the
        coordinate or angle that changes most. ``difference_roll`` to ``difference_yaw``: RMS against the
        autopilot; ``outside_...``: share beyond two deviations. ``difference_turning`` and
        ``..._straight``: roll's, while the airframe turns and not. ``shift_px``: RMS over detections and both
        axes of what the pose's error moves the target by in the image; ``largest_shift_px``: the farthest
        that it does.
    """
    sd = own.sd[np.isfinite(own.sd[:, 0])][:, _POSE]
    low, middle, high = np.quantile(sd, (0.05, 0.5, 0.95), axis=0)
    numbers = {"sd_spread": float(((high - low) / middle).max())}
    beside = errors_against(flight.nav["autopilot"], flight.nav[source], seen.times)
    for i, name in enumerate(AXES, 6):
        off = beside.error[:, i]
        beyond = np.where(np.isfinite(off), np.abs(off) > 2 * beside.sd[:, i], np.nan)
        numbers[f"difference_{name}"] = shown(name, rms(off))
        numbers[f"outside_{name}"] = mean(beyond)
    turns = np.abs(matrix_to_euler(seen.poses.R_nb)[:, 0]) > TURNING
    for word, rows in (("turning", turns), ("straight", ~turns)):
        numbers[f"difference_{word}"] = shown("roll", rms(beside.error[rows, 6]))
    rows = np.flatnonzero(seen.detected)
    J = ground_jacobians(seen.poses.take(rows), seen.uv[rows], seen.plane_down[rows])
    shift = np.linalg.solve(J.pixel, J.pose @ own.error[rows][:, _POSE, None])
    far = np.hypot(*shift[:, :, 0].T)
    return numbers | {"shift_px": rms(shift.ravel()), "largest_shift_px": float(np.nanmax(far))}


def flight_numbers(flight: Flight, seen: PixelMeasurements) -> dict[str, float]:
    """How a twin was flown, and over what.

    Parameters
    ----------
    flight
        With the nav source ``truth`` and inertial samples.
    seen
        What its camera saw.

    Returns
    -------
    dict
        ``detections``, ``pauses``; shares of the frames in which the airframe is ``turning`` and the target
        ``moving`` faster than `SLOWEST_M_S`; ``crab`` (deg), RMS of heading minus course on straight legs;
        ``settled``, for how long (s) there were inertial samples when the target was first seen.
    """
    nav = flight.nav["truth"]
    p, R, _ = poses_at(nav, seen.times)
    roll, _, yaw = matrix_to_euler(R).T
    north, east = (np.interp(seen.times, nav["time_s"], nav[name]) for name in VELOCITY[:2])
    turns = np.abs(roll) > TURNING
    crab = wrap(yaw - np.arctan2(east, north))[~turns & np.isfinite(p[:, 0])]
    return {
        "detections": float(seen.detected.sum()),
        "pauses": float(len(pauses(seen))),
        "turning": float(turns.mean()),
        "moving": mean(np.hypot(*seen.truth[:, 2:].T) > SLOWEST_M_S),
        "crab": float(np.degrees(rms(crab))),
        "settled": float(seen.times[0] - flight.table("imu")["time_s"].iloc[0]),
    }


def shown(name: str, value: float) -> float:
    """A number of a pose for a reader: angles (by their name) in degrees, coordinates as they are."""
    return float(np.degrees(value)) if name in AXES else value


def mean(values: ArrayLike) -> float:
    """Mean of the known values; NaN where there is none."""
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    return float(known.mean()) if len(known) else float("nan")


def rms(values: ArrayLike) -> float:
    """Root mean square of the known values; NaN where there is none."""
    return float(np.sqrt(mean(np.square(np.asarray(values, float)))))


#: Images nearer in time than this say the same of a pose whose error wanders over tens of seconds, s.
APART_S = 1.0


#: Which deviation each of the six pose errors has: of north and east, down, roll and pitch, yaw.
_SHARED = [0, 0, 1, 2, 2, 3]


def estimated_covariance(flight: Flight, seen: PixelMeasurements) -> Array:
    """Covariance (6, 6), H (7.39), of the poses of a camera that followed a target whose positions are known.

    Position in n, attitude in b. The deviations, with one of the pixel, are those under which the target's
    errors are likeliest, with a broad prior about what the poses state of themselves. The known positions are
    taken for exact. Images nearer than `APART_S` to the last one are left out.

    Parameters
    ----------
    flight
        What it states of the pixel and of the ground's height is assumed.
    seen
        From `wildlab.analysis.tracks.pixels.read_pixels`, with truth.

    Returns
    -------
    (6, 6) m^2 and rad^2, diagonal.

    Raises
    ------
    WildlabError
        Where the poses have no covariance.
    """
    if seen.poses.covariance is None:
        raise WildlabError(
            "the poses have no covariance to begin with", "use those of the MEKF: navigate_mekf(flight)"
        )
    rows = np.flatnonzero(seen.detected & np.isfinite(seen.truth[:, :2]).all(axis=1))
    slots = np.floor((seen.times[rows] - seen.times[0]) / APART_S)
    rows = rows[np.unique(slots, return_index=True)[1]]
    rows = rows[np.isfinite(seen.positions[rows]).all(axis=1)]
    errors = seen.positions[rows] - seen.truth[rows, :2]
    J = ground_jacobians(seen.poses.take(rows), seen.uv[rows], seen.plane_down[rows])
    stated = np.sqrt(np.nanmean(np.diagonal(seen.poses.covariance, axis1=1, axis2=2), axis=0))
    usual = assumed_deviations(flight)
    own = usual["plane_height_m"] ** 2 * J.plane[:, :, None] * J.plane[:, None, :]
    of_pixel = J.pixel @ np.swapaxes(J.pixel, 1, 2)
    begin = np.log([stated[:2].mean(), stated[2], stated[3:5].mean(), stated[5], usual["pixel_px"]])

    def negative_log_posterior(log_sd: Array) -> float:
        spread = J.pose * np.exp(2 * log_sd[_SHARED]) @ np.swapaxes(J.pose, 1, 2)
        L = np.linalg.cholesky(own + np.exp(2 * log_sd[-1]) * of_pixel + spread)
        squared = (np.linalg.solve(L, errors[..., None]) ** 2).sum(axis=(1, 2))
        likely = np.log(np.diagonal(L, axis1=1, axis2=2)).sum() + (0.5 * squared).sum()
        return float(0.5 * np.sum(((log_sd - begin) / PRIOR) ** 2) + likely)

    # Bounded, for the first step along a steep slope would otherwise leap to where no prior brings it back.
    bounds = [(s - 4 * PRIOR, s + 4 * PRIOR) for s in begin]
    found = minimize(negative_log_posterior, begin, method="L-BFGS-B", bounds=bounds).x
    return np.diag(np.square(np.exp(found[_SHARED])))


Numbers = dict[tuple[str, str], float]

#: The poses that all filters see, and those that one sees whose navigation believes the data sheets.
SOURCE, SHEET = "mekf", "mekf-data-sheet"
#: Whose numbers those of the poses from known points are.
ESTIMATED = "estimated"
#: One tuning for all three flights, printed in H 7.5.3 and kept in 7.5.4: sigma_v 0.05 m/s^2 (6.2), 10 m and
#: 10 m/s at the start, 30 px. Metres on the ground are not used here.
TUNING = CvTuning(acceleration=0.05, position_0=10.0, velocity_0=10.0, measurement=np.nan, pixel=30.0)
#: H 7.5.3: what the pixel noise "must be increased to" for the extended filter to be consistent.
MORE_NOISE = TUNING._replace(pixel=60.0)
#: 95 % of single values of NEES or NIS, two degrees of freedom: the lenient band, also for averages.
BOUNDS = chi_square_interval(2)

#: What the standard deviations of `SOURCE` are multiplied by for the curve; one is ``schmidt`` itself.
FACTORS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
#: H 7.5.4, conclusions: a standard deviation of 1 to 2 deg "in roll, pitch and yaw" (and the middle of that).
DEGREES = (1.0, 1.5, 2.0)
#: The same place: position counts from 5 m on. Half of that, and that, beside the middle of `DEGREES`.
METRES = (2.5, 5.0)
#: The seed of a flight's calibration flight is this much higher; a study's flights are far fewer.
CALIBRATION = 1_000_000
#: How long its camera watches the known target, s: ten minutes, many times what the poses' errors last.
CALIBRATION_S = 600.0


def scaled(factor: float) -> str:
    """The subject of the Schmidt filter with the poses' standard deviations times ``factor``."""
    return "schmidt" if factor == 1 else f"schmidt-x{factor:g}"


def constant(degrees: float, metres: float = 0.0) -> str:
    """The subject of the Schmidt filter with these deviations of each angle and each coordinate."""
    return f"schmidt-{degrees:g}-deg" + (f"-{metres:g}-m" if metres else "")


#: Subjects of the tables; with the other two pose covariances; what else runs on every flight.
PUBLISHED = ("ekf", "schmidt")
COVARIANCES = ("schmidt", "schmidt-data-sheet", "schmidt-estimated")
CURVE = tuple(scaled(factor) for factor in FACTORS)
CONSTANT = (*map(constant, DEGREES), *(constant(DEGREES[1], metres) for metres in METRES))
VARIANTS = ("schmidt-attitude-only", "schmidt-position-only")
FILTERS = ("ekf", *COVARIANCES, *VARIANTS, "ekf-60-pixels")
SUBJECTS = tuple(dict.fromkeys((*FILTERS, *CURVE, *CONSTANT)))
#: What is compared for each; `evaluate` says what they are.
NEES_NAMES = ("nees", "nees_drawn", "nees_worth", "fraction_nees_inside")
#: What is, besides, for all but `CURVE` and `CONSTANT`.
NAMES = (
    *NEES_NAMES, "mean_north", "mean_east", "mae", "nis", "rmse_speed", "rmse_course", "fraction_nis_inside",
    "nis_worth", "nees_predicted",
)  # fmt: skip
#: The same for `PUBLISHED` alone: what claims speak of.
MORE_NAMES = (
    "fraction_nis_above", "mae_predicted", "mae_first_pause", "fraction_above_predicted", "pauses_above",
    "nis_top_after_pauses", "oscillation", "mean_speed", "rmse_speed_start", "rmse_course_start",
)  # fmt: skip


class Compared(NamedTuple):
    """A sighting, each subject's track on it, scored, and numbers of the poses and of the flight."""

    seen: PixelMeasurements
    tracks: dict[str, Track]
    scored: dict[str, Scored]
    beside: Numbers


def navigated_sighting(flight: Flight) -> PixelMeasurements:
    """What the camera saw, with the poses of an MEKF whose mean deviations are those that H prints."""
    flight.nav[SOURCE] = navigate_mekf(flight, tuning=PUBLISHED_LIKE).nav
    return read_pixels(flight, SOURCE)


def sheet_sighting(flight: Flight) -> PixelMeasurements:
    """What the camera saw, with the poses of the MEKF that is given all that the data sheets state: noise,
    biases, axes, and GNSS errors that wander."""
    flight.nav[SHEET] = navigate_mekf(flight).nav
    return read_pixels(flight, SHEET)


def constant_covariance(degrees: float, metres: float = 0.0) -> Array:
    """The (6, 6) covariance of a pose with the same deviation of each angle, and of each coordinate."""
    return np.diag(np.square([metres] * 3 + [np.radians(degrees)] * 3))


def first_part(flight: Flight, seconds: float) -> Flight:
    """A flight of which the inertial samples and satellite positions end so long after the first image."""
    end = float(frame_times(flight).min()) + seconds
    cut = {name: flight.table(name) for name in ("imu", "gnss")}
    tables = {name: table[table["time_s"] <= end] for name, table in cut.items()}
    return Flight(flight.manifest, flight.nav, flight.tables | tables, flight.folder, flight.terrain)


def only(covariance: ArrayLike, attitude: bool) -> Array:
    """Covariances of poses (N, 6, 6) with the other block, and what it shares with this one, at zero."""
    P = np.array(covariance, float)
    drop = slice(0, 3) if attitude else slice(3, 6)
    P[:, drop, :] = 0.0
    P[:, :, drop] = 0.0
    return P


def compare(seen: PixelMeasurements, by_sheet: PixelMeasurements, estimated: Array) -> dict[str, Track]:
    """All of `SUBJECTS` on the same detections; but for ``schmidt-data-sheet`` on the same poses.

    Parameters
    ----------
    seen, by_sheet
        From `navigated_sighting` and `sheet_sighting`.
    estimated
        (6, 6) covariance of a pose, from another flight.

    Raises
    ------
    WildlabError
        Where the poses have no covariance.
    """
    P = seen.poses.covariance
    if P is None:
        raise WildlabError(
            "the poses have no covariance", "use those of the MEKF: navigated_sighting(flight)", field="nav"
        )
    told = {scaled(factor): factor**2 * P for factor in FACTORS}
    told |= {"schmidt-attitude-only": only(P, True), "schmidt-position-only": only(P, False)}
    fixed = {constant(degrees): constant_covariance(degrees) for degrees in DEGREES}
    fixed |= {constant(DEGREES[1], metres): constant_covariance(DEGREES[1], metres) for metres in METRES}
    fixed["schmidt-estimated"] = estimated
    told |= {who: np.tile(one, (len(P), 1, 1)) for who, one in fixed.items()}
    tracks = dict(zip(told, _follow_each(seen, list(told.values())), strict=True)) | {
        "ekf": track_pixels(seen, TUNING),
        "ekf-60-pixels": track_pixels(seen, MORE_NOISE),
        "schmidt-data-sheet": track_schmidt(by_sheet, TUNING),
    }
    return {who: tracks[who] for who in SUBJECTS}


def _follow_each(seen: PixelMeasurements, covariances: list[Array]) -> list[Track]:
    """`track_schmidt` with each of several covariances (N, 6, 6), in one run of the compiled filter."""
    z = np.broadcast_to(seen.uv, (len(covariances), *seen.uv.shape))
    return run_batch(
        seen.times,
        z,
        np.eye(2) * TUNING.pixel**2,
        TUNING.motion,
        start(seen, TUNING),
        view=BatchCamera(seen.poses, seen.plane_down),
        pose=Considered(POSE, np.stack(covariances)),
    )


def compare_flight(flight: Flight, seed: int) -> Compared:
    """A flight of a twin through all filters, with a calibration flight of the same twin before it.

    Parameters
    ----------
    flight
        Of a twin; gets the nav sources `SOURCE` and `SHEET`.
    seed
        The flight's own: the calibration flight and the moment that is drawn follow from it.

    Raises
    ------
    WildlabError
        If the flight is no twin's, or has no inertial samples.
    """
    if flight.manifest.twin is None:
        raise WildlabError("the flight is logged", "use a twin: there is a calibration flight of it")
    other = first_part(simulate_twin(flight.manifest.twin.name, seed + CALIBRATION), CALIBRATION_S)
    covariance = estimated_covariance(other, navigated_sighting(other))
    seen, by_sheet = navigated_sighting(flight), sheet_sighting(flight)
    tracks = compare(seen, by_sheet, covariance)
    moment = float(np.random.default_rng([seed, CALIBRATION]).random())
    scored = {
        who: evaluate(seen, track, moment) if who in FILTERS else evaluate_nees(seen, track, moment)
        for who, track in tracks.items()
    }
    beside: Numbers = {("flight", name): value for name, value in flight_numbers(flight, seen).items()}
    for source in (SOURCE, SHEET):
        own = errors_against(flight.nav["truth"], flight.nav[source], seen.times)
        found = pose_numbers(own)
        found |= premise_numbers(flight, seen, source, own) if source == SOURCE else {}
        beside |= {(source, name): value for name, value in found.items()}
    estimated = zip(POSE_NAMES, np.sqrt(np.diag(covariance)), strict=True)
    beside |= {(ESTIMATED, f"mean_sd_{name}"): shown(name, float(sd)) for name, sd in estimated}
    return Compared(seen, tracks, scored, beside)


def evaluate_nees(seen: PixelMeasurements, track: Track, moment: float) -> Scored:
    """NEES alone, and the numbers of `NEES_NAMES`; see `evaluate`."""
    values = position_nees(seen.truth - track.x[:, :4], track.P[:, :4, :4])
    known = np.flatnonzero(np.isfinite(values))
    numbers = {
        "nees": mean(values),
        "nees_drawn": values[known[int(moment * len(known))]],
        "nees_worth": worth(values),
        "fraction_nees_inside": share_inside(values, BOUNDS),
    }
    return Scored(values, track.nis, numbers)


def evaluate(seen: PixelMeasurements, track: Track, moment: float = 0.0) -> Scored:
    """`evaluate_track` with more numbers; NaN where the flight has no such part.

    ``nees_drawn`` is the NEES at one frame, ``moment`` (0 to 1) of the way through those with a truth: one
    independent value for each flight. ``nees_worth`` and ``nis_worth``: how many independent values the
    averages are worth. Of the pauses: ``nees_predicted`` and ``mae_predicted``, means over their frames;
    ``fraction_above_predicted``, the share of these with a NEES above `BOUNDS`; ``pauses_above``, the share
    of pauses with a median above; ``mae_first_pause``; ``nis_top_after_pauses``, the share of the largest
    NIS, as many as pauses, that stand at the first detection after one. ``rmse_..._start`` are up to the end
    of the first pause. ``oscillation`` is the RMS of the error about its own mean, ``mean_speed`` the
    estimated one, ``fraction_nis_above`` the share above `BOUNDS`.
    """
    found = evaluate_track(seen, track, ("u", "v"))
    nees, nis = found.nees, found.nis
    found.numbers.update(evaluate_nees(seen, track, moment).numbers)
    error = seen.truth[:, :2] - track.x[:, :2]
    distance, empty = np.hypot(*error.T), pauses(seen)
    unseen = np.concatenate(empty) if empty else np.empty(0, np.intp)
    first = np.array([rows[-1] + 1 for rows in empty], int)
    largest = np.argsort(np.where(np.isfinite(nis), nis, -np.inf))[::-1][: len(first)]
    begin = slice(0, empty[0][-1] + 1) if empty else slice(0, 0)
    started = summarise_track(track_errors(seen.truth[begin], track.x[begin, :4]))
    found.numbers.update(
        nis_worth=worth(nis),
        nees_predicted=mean(nees[unseen]),
        mae_predicted=mean(distance[unseen]),
        fraction_above_predicted=_share_above(nees[unseen]),
        pauses_above=_share_above([np.nanmedian(nees[rows]) for rows in empty]),
        mae_first_pause=mean(distance[empty[0]]) if empty else float("nan"),
        nis_top_after_pauses=mean(np.isin(largest, first).astype(float)),
        fraction_nis_above=_share_above(nis),
        oscillation=float(np.sqrt(np.nanvar(error, axis=0).sum())),
        mean_speed=mean(np.hypot(*track.x[:, 2:4].T)),
        rmse_speed_start=started.rmse_speed,
        rmse_course=180 / np.pi * found.numbers["rmse_course"],
        rmse_course_start=180 / np.pi * started.rmse_course,
    )
    return found


def summarise(compared: Compared) -> Numbers:
    """All numbers by (subject, name), and those beside them."""
    asked: dict[str, tuple[str, ...]] = dict.fromkeys(SUBJECTS, NEES_NAMES) | dict.fromkeys(FILTERS, NAMES)
    asked |= dict.fromkeys(PUBLISHED, (*NAMES, *MORE_NAMES))
    scored = compared.scored
    return {
        (who, name): scored[who].numbers[name] for who in SUBJECTS for name in asked[who]
    } | compared.beside


def trial(seed: int, *, twin: str) -> Mapping[tuple[str, str], float]:
    """One simulated flight, summarised as by `summarise`.

    Raises
    ------
    WildlabError
        If there is no such twin, or it has no inertial samples.
    """
    return summarise(compare_flight(simulate_twin(twin, seed), seed))


def _share_above(values: ArrayLike) -> float:
    """Of the known values, those above `BOUNDS`."""
    array = np.asarray(values, float)
    return mean(array[np.isfinite(array)] > BOUNDS[1])


#: Whose deviations are predicted, and whose poses' errors these are to match.
ORIGINS = {
    "schmidt": (SOURCE, SOURCE),
    "schmidt-data-sheet": (SHEET, SHEET),
    "schmidt-estimated": (ESTIMATED, SOURCE),
}
ANGLES = ("roll", "pitch", "yaw")


class PredictedError(NamedTuple):
    """How well a filter's predicted and true errors match over flights.

    ``median`` of the flights' average NEES; ``drawn``, the mean of one value of each flight with the interval
    of a consistent filter's; ``inside``, the share of flights whose average lies within the bounds of single
    values.
    """

    median: float
    drawn: Average
    inside: float

    @property
    def ratio(self) -> float:
        """How many times as large as predicted errors are on the median flight."""
        return float(np.sqrt(self.median / 2))


def predicted_error(runs: pd.DataFrame, who: str) -> PredictedError:
    """`PredictedError` of a filter over flights, one row each."""
    values = runs[who, "nees"]
    drawn = average(runs[who, "nees_drawn"].to_numpy(float), 2)
    return PredictedError(float(values.median()), drawn, share_inside(values, BOUNDS))


def more_metrics(runs: pd.DataFrame) -> list[tuple[str, str, float]]:
    """Name, subject and value of what is recorded of every filter besides the medians of its numbers."""
    found = {who: predicted_error(runs, who) for who in SUBJECTS}
    return [("mean_of_drawn_nees", who, one.drawn.mean) for who, one in found.items()] + [
        ("error_over_stated", who, one.ratio) for who, one in found.items()
    ]


def mean_deviations(runs: pd.DataFrame, source: str, what: str = "mean_sd") -> dict[str, float]:
    """Mean over the flights of each angle's predicted deviation, or its ``rms`` error, deg."""
    return {axis: float(runs[source, f"{what}_{axis}"].mean()) for axis in ANGLES}


def covariances_table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each pose covariance: predicted deviations and true errors (deg), and `PredictedError`."""
    rows = []
    for who in COVARIANCES:
        predicted, true = ORIGINS[who]
        one = predicted_error(runs, who)
        rows.append(
            {
                "who": who,
                **{f"sd_{axis}": value for axis, value in mean_deviations(runs, predicted).items()},
                **{f"rms_{axis}": value for axis, value in mean_deviations(runs, true, "rms").items()},
                "median": one.median,
                "drawn": one.drawn.mean,
                "low": one.drawn.low,
                "high": one.drawn.high,
                "inside": 100 * one.inside,
            }
        )
    return pd.DataFrame(rows)


def filters_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Medians over flights, a row for each filter, with the share of flights within the bounds."""
    columns = ("nees", "nees_predicted", "nis", "mae", "rmse_speed", "rmse_course")
    return pd.DataFrame(
        [
            {"filter": names[who], "inside": 100 * share_inside(runs[who, "nees"], BOUNDS)}
            | {name: float(runs[who, name].median()) for name in columns}
            for who in FILTERS
        ]
    )


def tables(runs: pd.DataFrame, names: Mapping[str, str]) -> dict[str, pd.DataFrame]:
    """Both tables of the page, by the key of their texts."""
    covariances = covariances_table(runs)
    covariances["who"] = covariances["who"].map(names)
    return {"covariances": covariances, "filters": filters_table(runs, names)}


def curve_table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each factor on the poses' deviations: ``sd`` (deg, mean of the angles), ``median``,
    ``inside``, and ``low`` and ``high`` of the flights' NEES (`bounds_of`)."""
    one = float(np.mean(list(mean_deviations(runs, SOURCE).values())))
    found = [predicted_error(runs, who) for who in CURVE]
    bounds = [bounds_of(runs[who, "nees"]) for who in CURVE]
    return pd.DataFrame(
        {
            "sd": one * np.array(FACTORS),
            "median": [each.median for each in found],
            "low": [low for low, _ in bounds],
            "high": [high for _, high in bounds],
            "inside": [each.inside for each in found],
        }
    )


#: Of the three pose covariances, beside the curve of the first.
_MARKS = {"schmidt": "D", "schmidt-data-sheet": "s", "schmidt-estimated": "o"}


def nees_over_pose_sd(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Median NEES and the share of flights that pass, over the predicted deviation of the attitude."""
    curve, flights = curve_table(runs), len(runs)
    fig, (upper, lower) = new_strips(2, 5.4, 5.6)
    sd, share, color = curve["sd"], curve["inside"], colour("schmidt")
    upper.axhspan(*BOUNDS, color=GREEN, alpha=0.12, lw=0)
    upper.axhline(2, color=INK, lw=0.8, ls=(0, (4, 2)))
    line = Values(curve["median"], curve[["low", "high"]].T, color, ".-")
    draw_lines(upper, sd, {"published covariance, scaled": line})
    upper.set_yscale("log")
    limits = np.array([share_interval(round(one * flights), flights)[1:] for one in share])
    draw_lines(lower, sd, {"": Values(100 * share, 100 * limits.T, color, ".-")})
    lower.set(ylim=(-4, 104), ylabel="in the band (%)")
    for who in COVARIANCES:
        at = float(np.mean(list(mean_deviations(runs, ORIGINS[who][0]).values())))
        one = predicted_error(runs, who)
        look: dict[str, Any] = {
            "ls": "none",
            "marker": _MARKS[who],
            "mfc": "white",
            "mec": INK,
            "ms": 7,
            "mew": 1.5,
        }
        upper.plot(at, one.median, label=names[who], **look)
        lower.plot(at, 100 * one.inside, **look)
    for ax in (upper, lower):
        ax.axvspan(DEGREES[0], DEGREES[-1], color=GREY, alpha=0.18, lw=0)
        ax.set_xscale("log")
        plain_numbers(ax.xaxis)
    plain_numbers(upper.yaxis)
    return finish(fig, "predicted SD of attitude, mean of roll, pitch and yaw (°)", "mean NEES")


def flight_figures(compared: Compared, first: int, names: Mapping[str, str]) -> list[Shown]:
    """The flight drawn: counterparts of four figures of H, from 7.``first`` on."""
    seen, tracks, scored, _ = compared
    t = seen.times - seen.times[0]
    states = {who: tracks[who].x[:, :4] for who in PUBLISHED}
    errors = {who: seen.truth[:, :2] - states[who][:, :2] for who in PUBLISHED}
    squares = {
        "NIS": {who: scored[who].nis for who in PUBLISHED},
        "NEES (position)": {who: scored[who].nees for who in PUBLISHED},
    }
    figures = {
        "errors": error_over_time(t, seen.detected, errors, names),
        "map": track_map(seen.truth, states, names, measured=seen.positions[seen.detected]),
        "speed": speed_and_course(t, seen.detected, seen.truth, states, names),
        "squares": squares_over_time(t, seen.detected, squares, names),
    }
    return [Shown(fig, text, f"fig-7-{n}") for n, (text, fig) in enumerate(figures.items(), first)]
