"""A flight's inertial samples and satellite positions as poses: one more ``nav`` table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis.navigation_inputs import (
    POSITION,
    VELOCITY,
    axis_errors,
    heading_from,
    headings_of,
    imu_noise,
    inputs_of,
    second_vector,
    told,
    without_gross,
)
from wildlab.flight.clocks import covariance_columns, frame_times
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import local_earth
from wildlab.navigation.mekf import log_likelihood, pose_covariance, run_mekf, signs_of_trouble
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
        For the filter, one row for each measurement: ``time_s``, ``source`` (words), ``nis``, ``dof``,
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
    velocity: bool = True,
    magnetometer: bool = False,
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
    velocity
        Whether to use GNSS velocities where the flight has them; H uses positions only.
    magnetometer
        Whether to use headings by the magnetic field as well, with what ``[magnetometer]`` states of them.
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
    given = inputs_of(flight, velocity=velocity and tuning is None, noise=noise, position_sd=position_sd)
    if receiver is not None:
        given = given._replace(aiding=told(without_gross(flight, given), receiver))
    if magnetometer:
        given.aiding["heading"] = headings_of(flight)
    latitude, _, height = flight.manifest.origin_tuple()
    found = run_mekf(
        given.imu,
        given.start,
        noise,
        local_earth(latitude, height),
        list(given.aiding.values()),
        _wanted(flight, times),
        axes=axes,
        gate_probability=GATE if receiver is None else 1.0,
    )
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
            "dof": np.isfinite(what.innovation).sum(axis=1),
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
    velocity: bool = True,
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
    velocity
        As for `navigate_mekf`.
    accelerometer_bias
        (3,) m/s^2, what a calibration found.

    Returns
    -------
    Navigated
        Without covariances.
    """
    given = inputs_of(flight, velocity=velocity, accelerometer_bias=accelerometer_bias)
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


def likelihoods_of_latency(flight: Flight, latencies: ArrayLike) -> Array:
    """How likely the flight's satellite positions and velocities are, were the receiver so late: the log
    likelihood of the filter's innovations, up to a constant, for each of the latencies (L,) s.

    Nothing but the flight's own sensors goes into it: a latency chosen by it owes nothing to a reference.

    Raises
    ------
    WildlabError
        As `navigate_mekf`.
    """
    noise, axes = imu_noise(flight), axis_errors(flight)
    latitude, _, height = flight.manifest.origin_tuple()
    found = []
    for latency in np.atleast_1d(np.asarray(latencies, float)):
        late = replace_in_manifest(flight.manifest, {"gnss": {"latency_s": float(latency)}})
        given = inputs_of(Flight(late, flight.nav, flight.tables, flight.folder, flight.terrain), noise=noise)
        end = given.imu.times[-1:]
        earth = local_earth(latitude, height)
        run = run_mekf(given.imu, given.start, noise, earth, list(given.aiding.values()), end, axes=axes)
        with np.errstate(invalid="ignore"):  # under some, the filter is lost altogether
            likelihood = log_likelihood(run.innovations)
        found.append(likelihood if np.isfinite(likelihood) else -np.inf)
    return np.array(found)


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
