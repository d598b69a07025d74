"""A flight's inertial samples and satellite positions as poses: one more ``nav`` table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.analysis.navigation_inputs import (
    POSITION,
    VELOCITY,
    Receiver,
    axis_errors,
    filter_of,
    heading_from,
    imu_noise,
    inputs_of,
    receiver_noise,
    second_vector,
    told,
    without_gross,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    Average,
    autocorrelation,
    average,
    chi_square_interval,
    effective_sample_size,
    nees,
    share_inside,
    white_bound,
)
from wildlab.flight.checks.inertial import FLYING
from wildlab.flight.clocks import covariance_columns, covariances, frame_times, gnss_times, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.navigation.mekf import pose_covariance, signs_of_trouble
from wildlab.navigation.observer import Gains, run_observer
from wildlab.navigation.receiver import ReceiverNoise

BIASES = ["accelerometer_x_m_s2", "accelerometer_y_m_s2", "accelerometer_z_m_s2"] + [
    f"gyro_{axis}_rad_s" for axis in "xyz"
]


#: Probability that the filter lets a good measurement in.
GATE = 0.9999
#: Gain of the observer on a course that stands in for the heading, rad/s. It is off by the crab angle, which
#: changes sides from one leg to the next: slow enough to see both, half a minute.
COURSE_GAIN = 1 / 30


class Navigated(NamedTuple):
    """What a navigation filter made of a flight.

    Attributes
    ----------
    nav
        A ``nav`` table; with covariance columns where the filter has one.
    biases
        ``time_s`` and the estimated biases; for the filter their standard deviations too (``sd_...``).
    innovations
        For the filter, one row for each measurement: ``time_s``, ``source`` (words), ``nis``,
        ``verdict``, the innovation's elements (``first`` to ``third``) and the standard deviations that the
        filter expects of them (``sd_...``); empty for the observer.
    velocity_covariance
        (M, 3, 3) of the velocities in n, (m/s)^2; None for the observer.
    signs
        Of trouble: sentences about why the estimate should not be believed; none where nothing is wrong, nor
        for the observer.
    """

    nav: pd.DataFrame
    biases: pd.DataFrame
    innovations: pd.DataFrame
    velocity_covariance: Array | None = None
    signs: tuple[str, ...] = ()


class MekfTuning(NamedTuple):
    """Noise that a filter is told of in place of what the flight states.

    Attributes
    ----------
    velocity_random_walk
        Of the accelerometers, m/s/sqrt(s).
    angle_random_walk_deg
        Of the gyros, deg/sqrt(s).
    horizontal, vertical
        Standard deviations of a GNSS position, per axis, m.
    """

    velocity_random_walk: float
    angle_random_walk_deg: float
    horizontal: float
    vertical: float


#: H prints no tuning of its MEKF, only what standard deviations came of it. This one gives a twin with
#: antennas a metre apart 8, 8 and 7 cm and 1.4, 1.4 and 2.5 deg (roll, pitch, yaw); H 7.5.3 prints 8, 8 and
#: 7 cm and 1.35, 1.30 and 2.65 deg. It was found from those figures alone, not from any error of a twin. Its
#: walks are far above a data sheet's: vibration, flexing, and what else a sheet leaves out. It is the one for
#: tracking, on all flights: from hundreds of metres attitudes make the error, and theirs hardly differ.
PUBLISHED_LIKE = MekfTuning(0.1, 1.2, 0.2, 0.2)

#: The same for H 7.5.4, flight 1: "the IMU was weighted more in the navigation filter", for its turns, and
#: positions count for little. Printed are 43, 43 and 68 cm and 1.22, 1.24 and 2.63 deg; here come out 43, 43
#: and 69 cm and 1.20, 1.20 and 2.73 deg.
PUBLISHED_LIKE_TURNING = MekfTuning(0.38, 0.46, 1.5, 2.9)
#: The same for flight 2: 87, 87 and 142 cm and 1.73, 1.78 and 2.48 deg printed, 89, 89 and 142 cm and 1.73,
#: 1.69 and 2.57 deg here. The text does not say that it was tuned otherwise than flight 1; with flight 1's
#: tuning its deviations come out like those of flight 1.
PUBLISHED_LIKE_LONG = MekfTuning(0.25, 0.75, 3.6, 8.5)


def navigate_mekf(
    flight: Flight,
    times: ArrayLike | None = None,
    *,
    tuning: MekfTuning | None = None,
    receiver: ReceiverNoise | None = None,
) -> Navigated:
    """Poses with covariance by the error-state filter of H 7.3.

    Without a tuning the filter is told what the manifest states of the sensors: white noise, biases, axes
    that are not where they should be (``[imu]``), the part of GNSS errors that wanders (``[gnss]``). Its
    covariance is then meant to be true of the pose of the IMU; how the airframe gives is not in it.

    Parameters
    ----------
    flight
        With the tables ``imu`` and ``gnss``.
    times
        Flight times (M,) at which poses are wanted; if not given those of the frames, or, of a flight without
        any, those of the inertial samples.
    tuning
        Noise in place of what the manifest states, for a filter as H has it: fifteen states, white noise, and
        positions only. ``PUBLISHED_LIKE`` gives standard deviations like those of H 7.5.3 and is what the
        tracking of H 7.5.3 and 7.5.4 is to be repeated with.
    receiver
        How the receiver errs, in place of what is stated; `receiver_noise` finds it. All fixes are then used
        but those that no noise explains (`without_gross`): a gate would leave out what this noise is of.

    Returns
    -------
    Navigated

    Raises
    ------
    WildlabError
        Where the flight lacks inertial samples, satellite positions, or what is known of their errors.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> navigate_mekf(simulate_twin("fast-vessel", 1), tuning=PUBLISHED_LIKE).signs  # doctest: +SKIP
    ()
    """
    noise, axes = imu_noise(flight), axis_errors(flight)
    if tuning is not None:
        walks = tuning.velocity_random_walk, float(np.radians(tuning.angle_random_walk_deg))
        noise, axes = noise._replace(velocity_random_walk=walks[0], angle_random_walk=walks[1]), None
    position_sd = None if tuning is None else (tuning.horizontal, tuning.vertical)
    given = inputs_of(flight, velocity=tuning is None, noise=noise, position_sd=position_sd)
    if receiver is not None:
        given = given._replace(aiding=told(without_gross(flight, given), receiver))
    filtered = filter_of(flight, given)._replace(noise=noise, axes=axes)
    gate = GATE if receiver is None else 1.0
    found = filtered.run(given.aiding, _wanted(flight, times), gate)
    nav = _nav_table(found.times, found.position, found.velocity, found.quaternion)
    nav = nav.join(covariance_columns(pose_covariance(found.covariance)))
    bias = np.hstack([found.accelerometer_bias, found.gyro_bias])
    sd = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2)[:, 9:15])
    biases = pd.DataFrame(np.hstack([bias, sd]), columns=[*BIASES, *(f"sd_{name}" for name in BIASES)])
    names = np.array(list(given.aiding), object)
    what = found.innovations
    innovations = pd.DataFrame(
        {
            "time_s": what.times,
            "source": names[what.source] if len(what.source) else np.empty(0, object),
            "nis": what.nis,
            "verdict": what.verdict,
            "first": what.innovation[:, 0],
            "second": what.innovation[:, 1],
            "third": what.innovation[:, 2],
        }
        | {f"sd_{name}": np.sqrt(what.S[:, i, i]) for i, name in enumerate(("first", "second", "third"))}
    )
    biases = biases.assign(time_s=found.times)
    signs = tuple(signs_of_trouble(found, list(given.aiding.values())))
    return _known(Navigated(nav, biases, innovations, found.covariance[:, 3:6, 3:6], signs))


def navigate_observer(
    flight: Flight,
    times: ArrayLike | None = None,
    *,
    accelerometer_bias: ArrayLike = (0.0, 0.0, 0.0),
) -> Navigated:
    """Poses by the nonlinear observer of H 5.5, which has no covariance. Parameters as `navigate_mekf`.

    Its second vector is the baseline of two antennas, else the magnetic field where the flight has it and the
    manifest says how it lies, else the course. It has no state for the accelerometers' bias, which leans its
    attitude by a degree for every 0.17 m/s^2: ``accelerometer_bias`` (3,) m/s^2 is what a calibration found.

    Parameters
    ----------
    flight
        As for `navigate_mekf`.
    times
        As for `navigate_mekf`.
    accelerometer_bias
        (3,) m/s^2, what a calibration found.

    Returns
    -------
    Navigated
        Without covariances.
    """
    given = inputs_of(flight, accelerometer_bias=accelerometer_bias)
    by_course = heading_from(flight) == "course"
    found = run_observer(
        given.imu,
        given.start,
        flight.manifest.origin_tuple(),
        [*given.aiding.values(), second_vector(flight)],
        _wanted(flight, times),
        gains=Gains(k2=COURSE_GAIN) if by_course else Gains(),
    )
    biases = pd.DataFrame(found.gyro_bias, columns=BIASES[3:]).assign(time_s=found.times)
    nav = _nav_table(found.times, found.position, found.velocity, found.quaternion)
    return _known(Navigated(nav, biases, pd.DataFrame()))


def _wanted(flight: Flight, times: ArrayLike | None) -> Array:
    if times is None:
        times = frame_times(flight) if "frames" in flight.tables else flight.table("imu")["time_s"].to_numpy()
    return np.unique(np.asarray(times, float))


def _nav_table(times: Array, p: Array, v: Array, q: Array) -> pd.DataFrame:
    columns = ["time_s", *POSITION, *VELOCITY, "q_w", "q_x", "q_y", "q_z"]
    return pd.DataFrame(np.column_stack([times, p, v, q]), columns=columns)


def _known(found: Navigated) -> Navigated:
    """Without the times at which there is no estimate."""
    rows = np.isfinite(found.nav["north_m"].to_numpy())
    P = found.velocity_covariance
    return found._replace(
        nav=found.nav[rows].reset_index(drop=True),
        biases=found.biases[rows].reset_index(drop=True),
        velocity_covariance=None if P is None else P[rows],
    )


#: What a flight's navigation may be compared with, best first. Only the first is the truth.
REFERENCES = ("truth-payload", "onboard", "autopilot")
#: Poses a second that are compared: errors of attitude and position wander over seconds.
RATE_HZ = 5.0
#: Until the filters have forgotten their start, s.
SETTLING_S = 60.0
#: What calibrated accelerometers are off by at switching on, m/s^2: it leans an attitude by half a degree.
CALIBRATED = 0.1
AXES = ("roll", "pitch", "yaw")
PLACES = ("north", "east", "down")
#: Blocks of an error: columns of `NavigationErrors.error`, and what they are called.
BLOCKS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9)}
#: The filter with the tunings that are compared with print, by the subject of their numbers.
TUNINGS = {
    "mekf-published-like": PUBLISHED_LIKE,
    "mekf-published-like-turning": PUBLISHED_LIKE_TURNING,
    "mekf-published-like-long": PUBLISHED_LIKE_LONG,
}


class NavigationErrors(NamedTuple):
    """Errors (K, 9) at K times: position (m) and velocity (m/s) in n, attitude (rad) in b; see the module.

    ``sd`` (K, 9) is what the estimate states of them and ``nees`` has (K,) for each block, not divided by its
    three degrees of freedom; both NaN where nothing is stated.
    """

    times: Array
    error: Array
    sd: Array
    nees: dict[str, Array]


class Studied(NamedTuple):
    """A flight, navigated and scored at certain times (K,) against one of its nav sources.

    ``receiver`` is how the receiver of a logged flight errs, or None where ``refusal`` says why not. What is
    judged first is ``mekf``, with what is stated of the sensors: ``mekf-receiver``, where there is one, has a
    noise that was found on the flight itself.
    """

    flight: Flight
    reference: str
    times: Array
    found: dict[str, Navigated]
    scored: dict[str, NavigationErrors]
    receiver: Receiver | None = None
    refusal: str = ""


def reference_of(flight: Flight) -> str:
    """The nav source to compare with, by `REFERENCES`.

    Raises
    ------
    WildlabError
        Where the flight has none of them.
    """
    for name in REFERENCES:
        if name in flight.nav:
            return name
    raise WildlabError(
        "the flight has no pose to compare with",
        f"give it a nav table named {' or '.join(REFERENCES)}",
        file=flight.folder,
        field="nav",
    )


def comparison_times(flight: Flight, reference: str) -> Array:
    """Stamps (K,) of the reference, thinned to `RATE_HZ`, within the inertial samples."""
    stamps = flight.nav[reference]["time_s"].to_numpy(float)
    felt = flight.table("imu")["time_s"].to_numpy(float)
    every = max(1, round(1 / (RATE_HZ * float(np.median(np.diff(stamps))))))
    return stamps[(stamps >= felt[0]) & (stamps <= felt[-1])][::every]


def flown_part(flight: Flight, times: ArrayLike) -> tuple[str, float, float]:
    """The part of a flight to judge where nobody names one: what to call it, and from when to when, s.

    In the air, where the receiver's speeds tell; else from a minute after the first of ``times`` on.
    """
    t, gnss = np.asarray(times, float), flight.table("gnss")
    if set(VELOCITY) <= set(gnss.columns):
        speed = np.hypot(*gnss[["v_north_m_s", "v_east_m_s"]].to_numpy(float).T)
        fast = gnss_times(flight)[speed >= FLYING]
        if len(fast):
            return "in the air", float(max(fast[0], t[0])), float(min(fast[-1], t[-1]))
    return "after the first minute", float(t[0]) + SETTLING_S, float(t[-1])


def errors_against(
    reference: pd.DataFrame,
    nav: pd.DataFrame,
    times: ArrayLike,
    velocity_covariance: Array | None = None,
) -> NavigationErrors:
    """Errors of one nav table against another at given times (K,).

    Parameters
    ----------
    reference
        A nav table; without velocities, there are no errors of velocity.
    nav
        The estimate.
    times
        (K,) s.
    velocity_covariance
        (M, 3, 3) of its rows, which tables of poses have no place for.

    Returns
    -------
    Errors
        Reference minus estimate.
    """
    t = np.asarray(times, float)
    p_true, R_true, _ = poses_at(reference, t)
    p, R, _ = poses_at(nav, t)
    error = np.full((len(t), 9), np.nan)
    known = np.isfinite(p[:, 0]) & np.isfinite(p_true[:, 0])
    error[:, :3] = p_true - p
    error[:, 3:6] = _velocities(reference, t) - _velocities(nav, t)
    turn = Rotation.from_matrix(np.swapaxes(R[known], 1, 2) @ R_true[known])
    error[known, 6:] = 4 * turn.as_mrp()
    P = np.full((len(t), 9, 9), np.nan)
    poses = covariances(nav)
    rows = np.clip(np.searchsorted(nav["time_s"], t), 0, len(nav) - 1)
    at = np.abs(nav["time_s"].to_numpy(float)[rows] - t) < 1e-6  # a covariance is not interpolated
    if poses is not None:
        pose = np.ix_([0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8])
        for k in np.flatnonzero(at & known):
            P[k][pose] = poses[rows[k]]
    if velocity_covariance is not None:
        P[at, 3:6, 3:6] = velocity_covariance[rows[at]]
    blocks = {name: nees(error[:, part], P[:, part, part]) for name, part in BLOCKS.items()}
    return NavigationErrors(t, error, np.sqrt(np.diagonal(P, axis1=1, axis2=2)), blocks)


def _velocities(nav: pd.DataFrame, times: Array) -> Array:
    if not set(VELOCITY) <= set(nav):
        return np.full((len(times), 3), np.nan)
    stamps = nav["time_s"].to_numpy(float)
    return np.stack(
        [np.interp(times, stamps, nav[name], left=np.nan, right=np.nan) for name in VELOCITY], axis=-1
    )


def summarise(errors: NavigationErrors, begin: float = -np.inf, end: float = np.inf) -> dict[str, float]:
    """Numbers of a part of a flight, by the names under which they are recorded.

    ``rms_...`` and ``mean_sd_...`` of position (m) and attitude (degrees) about each axis, ``rms_velocity``
    (m/s, of all three), ``nees_...`` of each block (ideally 3).
    """
    part = (errors.times >= begin) & (errors.times < end)
    e, sd = errors.error[part], errors.sd[part]
    result: dict[str, float] = {}
    for prefix, values in (("rms", _rms(e)), ("mean_sd", _mean(sd))):
        result |= {f"{prefix}_{name}": float(values[i]) for i, name in enumerate(PLACES)}
        result |= {f"{prefix}_{name}": float(np.degrees(values[6 + i])) for i, name in enumerate(AXES)}
    result["rms_velocity"] = float(np.sqrt((_rms(e)[3:6] ** 2).sum()))
    result |= {f"nees_{name}": float(_mean(values[part])) for name, values in errors.nees.items()}
    return result


def _mean(values: Array) -> Array:
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    count = known.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _rms(values: Array) -> Array:
    return np.sqrt(_mean(values**2))


def summarise_innovations(found: Navigated, begin: float = -np.inf, end: float = np.inf) -> pd.DataFrame:
    """NIS and whiteness of each source's innovations between two times (s), one row for each source.

    Columns: ``source``, ``n``, ``nis`` (mean, ideally 3), ``inside`` (share within the 95 %
    interval of one), ``left_out`` (share), ``lag1`` (largest autocorrelation of an element of the innovation,
    in units of what the filter expects of it, at lag 1) and ``bound`` (what white noise stays below).
    """
    rows = []
    stamps = found.innovations["time_s"]
    inside = found.innovations[(stamps >= begin) & (stamps < end)]
    for source, part in inside.groupby("source", sort=False):
        whitened = normalised_innovations(part)
        rows.append(
            {
                "source": source,
                "n": len(part),
                "nis": float(part["nis"].mean()),
                "inside": share_inside(part["nis"], chi_square_interval(3)),
                "left_out": float((part["verdict"] == 0).mean()),
                "lag1": max((float(autocorrelation(column, 1)[1]) for column in whitened.T), key=abs),
                "bound": white_bound(len(part)),
            }
        )
    return pd.DataFrame(rows)


def normalised_innovations(innovations: pd.DataFrame) -> Array:
    """Elements (N, 3) of one source's innovations in units of the deviations that the filter expects."""
    names = ["first", "second", "third"]
    expected = innovations[[f"sd_{name}" for name in names]].to_numpy(float)
    return innovations[names].to_numpy(float) / expected


def calibrated(flight: Flight) -> bool:
    """Whether the flight's manifest says that its accelerometers are off by no more than `CALIBRATED`."""
    stated = flight.manifest.imu.accelerometer_turn_on_m_s2
    return stated is not None and stated <= CALIBRATED


def navigate_all(flight: Flight, times: ArrayLike) -> dict[str, Navigated]:
    """Every estimate that is compared, by its subject: the filter by what is stated, and the observer; with
    two antennas also the filter with the tunings of `TUNINGS`.

    The observer of H is for calibrated accelerometers. Where these are not (see `calibrated`), their
    calibration is the bias that the filter found, the median over the flight.
    """
    filtered, off = navigate_mekf(flight, times), np.zeros(3)
    if not calibrated(flight):
        off = filtered.biases[BIASES[:3]].median().to_numpy(float)
    found = {"mekf": filtered, "observer": navigate_observer(flight, times, accelerometer_bias=off)}
    if "second_north_m" in flight.table("gnss"):
        found |= {name: navigate_mekf(flight, times, tuning=tuning) for name, tuning in TUNINGS.items()}
    return found


def evaluate_all(
    flight: Flight, found: Mapping[str, Navigated], times: ArrayLike, reference: str
) -> dict[str, NavigationErrors]:
    """Errors of each estimate against the reference, and on a twin those of its autopilot.

    The autopilot is scored by the airframe it sits on, not by the payload with the IMU and the antennas.
    """
    table = flight.nav[reference]
    scored = {
        name: errors_against(table, one.nav, times, one.velocity_covariance) for name, one in found.items()
    }
    if "truth" in flight.nav and "autopilot" in flight.nav:
        scored["autopilot"] = errors_against(flight.nav["truth"], flight.nav["autopilot"], times)
    return scored


def study_navigation(flight: Flight) -> Studied:
    """A flight navigated in every way that is compared, and scored by the best reference it has.

    Of a logged flight, whose receiver nobody knows, that one's noise is found as well; a twin states its own.

    Raises
    ------
    WildlabError
        Where it has no reference, or lacks what navigation needs.
    """
    reference = reference_of(flight)
    times = comparison_times(flight, reference)
    found, receiver, refusal = navigate_all(flight, times), None, ""
    if flight.manifest.kind == "logged":
        try:
            receiver = receiver_noise(flight)
        except WildlabError as refused:
            refusal = refused.problem
        if receiver is not None and receiver.noise is not None:
            found["mekf-receiver"] = navigate_mekf(flight, times, receiver=receiver.noise)
    scored = evaluate_all(flight, found, times, reference)
    return Studied(flight, reference, times, found, scored, receiver, refusal)


def numbers_of(studied: Studied, begin: float, end: float = np.inf) -> dict[tuple[str, str], float]:
    """What is compared over flights, by (subject, name): `summarise`; of the filter ``nis_<source>``, and of
    logged flights ``lag1_<source>``; on twins of the tuned filters how often they have the autopilot within
    their bounds (`shares_within`).

    There is no NEES without a truth, and no error of position where the reference has no velocity: its
    positions are then those of the receiver, which the estimate is made from.
    """
    table = studied.flight.nav[studied.reference]
    hidden = [] if studied.reference == REFERENCES[0] else ["nees"]
    hidden += [] if set(VELOCITY) <= set(table) else [f"rms_{place}" for place in PLACES]
    numbers = {
        (subject, name): value
        for subject, errors in studied.scored.items()
        for name, value in summarise(errors, begin, end).items()
        if np.isfinite(value) and not name.startswith(tuple(hidden))
    }
    for subject in ("mekf", "mekf-receiver"):
        if subject not in studied.found:
            continue
        for row in summarise_innovations(studied.found[subject], begin, end).to_dict(orient="records"):
            source = row["source"].replace(" ", "_")
            numbers[subject, f"nis_{source}"] = row["nis"]
            if studied.flight.manifest.kind == "logged":
                numbers[subject, f"lag1_{source}"] = row["lag1"]
    if "autopilot" in studied.scored:
        for subject in [name for name in TUNINGS if name in studied.found]:
            shares = shares_within(against_autopilot(studied, subject), begin)
            numbers |= {(subject, name): value for name, value in shares.items()}
    return numbers


def shares_within(errors: NavigationErrors, begin: float = -np.inf) -> dict[str, float]:
    """Share of the errors within two of the stated standard deviations, of ``roll``, ``pitch``, ``yaw`` and
    ``velocity`` (all three axes), from a time on."""
    late = errors.times >= begin
    e, two = errors.error[late], 2 * errors.sd[late]
    known = np.isfinite(e) & np.isfinite(two)
    inside = np.where(known, np.abs(e) <= two, np.nan)
    shares = {f"inside_{name}": float(_mean(inside[:, 6 + i])) for i, name in enumerate(AXES)}
    return shares | {"inside_velocity": float(_mean(inside[:, 3:6].ravel()))}


def against_autopilot(studied: Studied, subject: str) -> NavigationErrors:
    """Differences of an estimate from the autopilot, as H 7.5 has them: neither of the two is the truth."""
    one = studied.found[subject]
    return errors_against(studied.flight.nav["autopilot"], one.nav, studied.times, one.velocity_covariance)


def corrections(flight: Flight, found: Navigated) -> Array:
    """What turned the estimate from one row to the next besides the gyros, rad, (M - 1,).

    Zero but for what measurements correct. Meant for estimates at all inertial samples: across the vertical,
    where Euler angles jump, this does not.
    """
    imu, times = flight.table("imu"), found.nav["time_s"].to_numpy(float)
    rows = np.searchsorted(imu["time_s"].to_numpy(float), times)
    rate = imu[[f"w_{axis}_rad_s" for axis in "xyz"]].to_numpy(float)[rows]
    bias = found.biases[[f"gyro_{axis}_rad_s" for axis in "xyz"]].to_numpy(float)
    felt = (rate[1:] + rate[:-1]) / 2 - bias[1:]
    attitude = Rotation.from_quat(found.nav[["q_w", "q_x", "q_y", "q_z"]].to_numpy(float), scalar_first=True)
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec()
    return np.linalg.norm(turned - felt * np.diff(times)[:, None], axis=1)


def unit_of(name: str) -> str:
    """The unit of one of those numbers."""
    if name.startswith(("nees", "nis", "lag1", "inside")):
        return "1"
    return "deg" if name.endswith(AXES) else "m/s" if name.endswith("velocity") else "m"


class Series(NamedTuple):
    """NEES or NIS (N,) of one run over its times (N,), s, with ``dof`` degrees of freedom; NaN: none.

    ``worth``: at most so many independent values, where the errors themselves say so: one that lasts is one,
    however much its square wavers.
    """

    name: str
    dof: float
    times: Array
    values: Array
    worth: float = np.inf


def worth(values: ArrayLike) -> float:
    """How many independent values those of one run (N,) are worth for their mean; NaN are left out.

    Parameters
    ----------
    values
        (N,) in the order of time.

    Returns
    -------
    float
        From 1 to N, or 0 where there is none.

    Examples
    --------
    >>> worth([2.0, 1.0, float("nan")])
    2.0
    """
    array = np.asarray(values, float)
    known = array[np.isfinite(array)]
    if len(known) < 4 or np.ptp(known) == 0:
        return float(len(known))
    return float(np.clip(effective_sample_size(known, len(known) - 1), 1.0, len(known)))


def mean_of_runs(runs: Sequence[Series]) -> Average:
    """Mean of the same quantity over independent runs, and the 95 % interval of a consistent filter's.

    Parameters
    ----------
    runs
        One series for each run; degrees of freedom that differ are averaged over the values.

    Returns
    -------
    Average
        ``worth`` is the sum of what each run is worth.

    Examples
    --------
    >>> run = Series("NEES", 2, np.arange(3.0), np.array([1.0, 2.0, 3.0]))
    >>> mean = mean_of_runs([run, run])
    >>> mean.mean, mean.n, mean.worth, mean.inside
    (2.0, 6, 6.0, True)
    """
    values = np.concatenate([np.asarray(run.values, float) for run in runs])
    known = np.array([np.isfinite(run.values).sum() for run in runs])
    dof = float(np.average([run.dof for run in runs], weights=known)) if known.any() else runs[0].dof
    return average(values, dof, sum(min(worth(run.values), run.worth) for run in runs))


def navigation_series(errors: NavigationErrors, begin: float = -np.inf, end: float = np.inf) -> list[Series]:
    """NEES of position, velocity and attitude, three degrees of freedom each, of a part of a flight.

    Parameters
    ----------
    errors
        Against a reference that is the truth: else it is the difference of two estimates that is scored.
    begin, end
        s.

    Returns
    -------
    list of Series
        Those blocks that have values.

    Examples
    --------
    >>> nothing = np.full((2, 9), np.nan)
    >>> blocks = {"position": np.array([3.0, 2.0]), "velocity": nothing[:, 0], "attitude": nothing[:, 0]}
    >>> [s.name for s in navigation_series(NavigationErrors(np.arange(2.0), nothing, nothing, blocks))]
    ['NEES position']
    """
    part = (errors.times >= begin) & (errors.times < end)
    all_blocks = [Series(f"NEES {name}", 3, errors.times[part], errors.nees[name][part]) for name in BLOCKS]
    return [one for one in all_blocks if np.isfinite(one.values).any()]
