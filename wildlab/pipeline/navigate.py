"""A flight's inertial samples and satellite positions as poses: one more ``nav`` table."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.flight.schema import LEVER_COLUMNS, SECOND_COLUMNS
from wildlab.flight.store import Flight
from wildlab.flight.sync import covariance_columns, frame_times, gnss_times
from wildlab.geometry.gravity import local_earth
from wildlab.navigation.aiding import Aiding, positions, velocities
from wildlab.navigation.mekf import Start, pose_covariance, run_mekf
from wildlab.navigation.noise import AxisErrors, ImuNoise, with_turn_on
from wildlab.navigation.observer import Gains, baseline_reference, course_reference, run_observer
from wildlab.navigation.start import start_from_baseline, start_from_course
from wildlab.navigation.timeline import Imu
from wildlab.navigation.trouble import signs_of_trouble

Array = NDArray[np.float64]

POSITION = ["north_m", "east_m", "down_m"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
BIASES = ["accelerometer_x_m_s2", "accelerometer_y_m_s2", "accelerometer_z_m_s2"] + [
    f"gyro_{axis}_rad_s" for axis in "xyz"
]


#: How much wider than the fixes behind it the heading at the start is taken to be.
LOOSE = 5.0
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


class Tuning(NamedTuple):
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
PUBLISHED_LIKE = Tuning(0.1, 1.2, 0.2, 0.2)

#: The same for H 7.5.4, flight 1: "the IMU was weighted more in the navigation filter", for its turns. With
#: half the walks, and positions that count for little, 43, 43 and 68 cm come out as printed, and 1.1, 1.1 and
#: 3.1 deg where 1.22, 1.24 and 2.63 are printed. Nothing is said of flight 2 that explains why its deviations
#: in position are twice these.
PUBLISHED_LIKE_TURNING = Tuning(0.05, 0.6, 1.7, 5.5)


class _Inputs(NamedTuple):
    imu: Imu
    aiding: dict[str, Aiding]
    reference: Aiding
    start: Start


def navigate_mekf(
    flight: Flight, times: ArrayLike | None = None, *, velocity: bool = True, tuning: Tuning | None = None
) -> Navigated:
    """Poses with covariance by the error-state filter of H 7.3.

    Without a tuning the filter is told what the manifest states of the sensors: white noise, biases, axes
    that are not where they should be (``[imu]``), the part of GNSS errors that wanders (``[gnss]``). Its
    covariance is then meant to be true of the pose of the IMU; how the airframe gives is not in it.

    Parameters
    ----------
    times
        Flight times (M,) at which poses are wanted; if not given those of the frames, or, of a flight without
        any, those of the inertial samples.
    velocity
        Whether to use GNSS velocities where the flight has them; H uses positions only.
    tuning
        Noise in place of what the manifest states, for a filter as H has it: fifteen states, white noise, and
        positions only. ``PUBLISHED_LIKE`` gives standard deviations like those of H 7.5.3 and is what the
        tracking of H 7.5.3 and 7.5.4 is to be repeated with.

    Raises
    ------
    WildlabError
        Where the flight lacks inertial samples, satellite positions, or what is known of their errors.
    """
    noise, axes = imu_noise(flight), axis_errors(flight)
    if tuning is not None:
        walks = tuning.velocity_random_walk, float(np.radians(tuning.angle_random_walk_deg))
        noise, axes = noise._replace(velocity_random_walk=walks[0], angle_random_walk=walks[1]), None
    given = _inputs(flight, velocity, noise, tuning)
    latitude, _, height = flight.manifest.origin_tuple()
    found = run_mekf(
        given.imu,
        given.start,
        noise,
        local_earth(latitude, height),
        list(given.aiding.values()),
        _wanted(flight, times),
        axes=axes,
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


def navigate_observer(flight: Flight, times: ArrayLike | None = None, *, velocity: bool = True) -> Navigated:
    """Poses by the nonlinear observer of H 5.5, which has no covariance. Parameters as `navigate_mekf`."""
    given = _inputs(flight, velocity)
    found = run_observer(
        given.imu,
        given.start,
        flight.manifest.origin_tuple(),
        [*given.aiding.values(), given.reference],
        _wanted(flight, times),
        gains=Gains() if "second position" in given.aiding else Gains(k2=COURSE_GAIN),
    )
    biases = pd.DataFrame(found.gyro_bias, columns=BIASES[3:]).assign(time_s=found.times)
    nav = _nav_table(found.times, found.position, found.velocity, found.quaternion)
    return _known(Navigated(nav, biases, pd.DataFrame()))


def imu_noise(flight: Flight) -> ImuNoise:
    """How the flight's inertial sensor errs, from ``[imu]`` of the manifest, with its biases at switching on.

    Raises
    ------
    WildlabError
        Where one of the figures is not stated there.
    """
    stated = flight.manifest.imu
    hour = 3600.0
    figures = {
        "velocity_random_walk_m_s_sqrt_h": 1 / np.sqrt(hour),
        "angle_random_walk_deg_sqrt_h": np.radians(1.0) / np.sqrt(hour),
        "accelerometer_bias_m_s2": 1.0,
        "accelerometer_bias_time_s": 1.0,
        "gyro_bias_deg_h": np.radians(1.0) / hour,
        "gyro_bias_time_s": 1.0,
    }
    missing = [name for name in figures if getattr(stated, name) is None]
    if missing:
        raise WildlabError(
            f"how the inertial sensor errs is not stated ({missing[0]} and {len(missing) - 1} more)"
            if len(missing) > 1
            else f"how the inertial sensor errs is not stated ({missing[0]})",
            "take the figures from its data sheet, or from the log's own standstill",
            file=flight.folder,
            field=f"imu.{missing[0]}",
        )
    noise = ImuNoise(*(float(getattr(stated, name)) * scale for name, scale in figures.items()))
    gyro = np.radians(stated.gyro_turn_on_deg_h or 0.0) / hour
    return with_turn_on(noise, stated.accelerometer_turn_on_m_s2 or 0.0, float(gyro))


def axis_errors(flight: Flight) -> AxisErrors | None:
    """How far the inertial sensor's axes may be off, from ``[imu]`` of the manifest, where it says so.

    Stated are limits; anything up to them counts as equally likely.
    """
    stated = flight.manifest.imu
    limits = (
        np.radians(stated.misalignment_deg or 0.0),
        np.radians(stated.axis_misalignment_deg or 0.0),
        (stated.scale_error_percent or 0.0) / 100,
    )
    return AxisErrors(*(float(limit / np.sqrt(3)) for limit in limits)) if any(limits) else None


def _inputs(
    flight: Flight, velocity: bool, noise: ImuNoise | None = None, tuning: Tuning | None = None
) -> _Inputs:
    imu, gnss = flight.table("imu"), flight.table("gnss")
    samples = Imu(
        imu["time_s"].to_numpy(float),
        imu[["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]].to_numpy(float),
        imu[["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]].to_numpy(float),
    )
    t, p = gnss_times(flight), gnss[POSITION].to_numpy(float)
    sd = _position_sd(flight, gnss)
    spread = float(np.sqrt(2) * np.nanmedian(sd))
    wander, wander_time = _wander(flight)
    if tuning is not None:
        velocity, wander = False, np.zeros(3)
        sd = np.tile([tuning.horizontal, tuning.horizontal, tuning.vertical], (len(t), 1))
    white = np.sqrt(np.maximum(sd**2 - wander**2, (0.01 * sd) ** 2))
    arms = [_lever(flight, gnss, LEVER_COLUMNS[:3]), _lever(flight, gnss, LEVER_COLUMNS[3:])]
    aiding = {"position": positions(t, p, white, arms[0], 0.0, wander, wander_time)}
    two = set(SECOND_COLUMNS) <= set(gnss.columns)
    moving = set(VELOCITY) <= set(gnss.columns)
    v = gnss[VELOCITY].to_numpy(float) if moving else np.gradient(p, t, axis=0)
    spread_v = _velocity_sd(flight, gnss)
    if velocity and moving and spread_v is not None:
        aiding["velocity"] = velocities(t, v, spread_v, arms[0])
    gravity = local_earth(flight.manifest.origin_tuple()[0], flight.manifest.origin_tuple()[2]).gravity
    known: dict[str, float] = {}
    if noise is not None:  # where nobody says what biases are at switching on, they may be anything usual
        if flight.manifest.imu.accelerometer_turn_on_m_s2 is not None:
            known["accelerometer_bias_sd"] = noise.accelerometer_bias_sd
        if flight.manifest.imu.gyro_turn_on_deg_h is not None:
            known["gyro_bias_sd"] = noise.gyro_bias_sd
    if two:
        second = gnss[list(SECOND_COLUMNS)].to_numpy(float)
        aiding["second position"] = positions(t, second, white, arms[1], 0.0, wander, wander_time)
        reference = baseline_reference(t, p, second, *arms)
        # The fixes that it starts from are taken in once more: loosely here, so that they count once.
        known["baseline_sd"] = LOOSE * spread
        start = start_from_baseline(samples, t, p, second, *arms, gravity=gravity, **known)
    else:
        reference = course_reference(t, v)
        start = start_from_course(samples, t, p, v, gravity=gravity, **known)
    return _Inputs(samples, aiding, reference, start)


def _position_sd(flight: Flight, gnss: pd.DataFrame) -> Array:
    """(N, 3) from the log, else from the manifest's ``[uncertainty]``."""
    sds = []
    for column, stated in (
        ("sd_horizontal_m", flight.manifest.uncertainty.position_horizontal_m),
        ("sd_vertical_m", flight.manifest.uncertainty.position_vertical_m),
    ):
        known = gnss[column].to_numpy(float) if column in gnss else np.full(len(gnss), np.nan)
        known = np.where(known > 0, known, np.nan if stated is None else stated)
        if not np.isfinite(known).any():
            raise WildlabError(
                "how uncertain the satellite positions are is not stated",
                f"add the column {column}, or [uncertainty] position_horizontal_m and position_vertical_m",
                file=flight.folder,
                field=f"gnss.{column}",
            )
        sds.append(np.where(np.isnan(known), np.nanmax(known), known))
    return np.stack([sds[0], sds[0], sds[1]], axis=-1)


def _wander(flight: Flight) -> tuple[Array, float]:
    """The part of a position's deviation that fixes share (3,) m, and for how long, s; from the manifest."""
    stated = flight.manifest.gnss
    if stated.wander_time_s is None:
        return np.zeros(3), np.inf
    level, vertical = stated.wander_horizontal_m or 0.0, stated.wander_vertical_m or 0.0
    return np.array([level, level, vertical]), stated.wander_time_s


def _velocity_sd(flight: Flight, gnss: pd.DataFrame) -> Array | None:
    """(N, 1) from the log, else (3,) from the manifest's ``[uncertainty]``; None if neither says."""
    if "sd_velocity_m_s" in gnss:
        return gnss["sd_velocity_m_s"].to_numpy(float)[:, None]
    stated = flight.manifest.uncertainty
    level, vertical = stated.velocity_horizontal_m_s, stated.velocity_vertical_m_s
    return None if level is None or vertical is None else np.array([level, level, vertical])


def _lever(flight: Flight, gnss: pd.DataFrame, columns: tuple[str, ...]) -> Array:
    if set(columns) <= set(gnss.columns):
        return np.asarray(gnss[list(columns)].iloc[0].to_numpy(float))
    return np.array(flight.manifest.gnss.lever_arm_m)


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
