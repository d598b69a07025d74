"""A flight's inertial samples and satellite positions as poses: one more ``nav`` table, and its errors."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    whiten,
)
from wildlab.flight.checks.inertial import FLYING
from wildlab.flight.clocks import covariance_columns, covariances, frame_times, gnss_times, poses_at
from wildlab.flight.schema import FIELD, LEVER_COLUMNS, POSITION, QUATERNION, SECOND_COLUMNS, VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, local_earth
from wildlab.navigation.aiding import Aiding, earth_field, hard_iron, positions, share_turned, velocities
from wildlab.navigation.alignment import align_at_rest, align_from_baseline, align_from_course, find_rest
from wildlab.navigation.mekf import InitialState, pose_covariance, run_mekf, signs_of_trouble
from wildlab.navigation.observer import (
    Gains,
    baseline_reference,
    course_reference,
    field_reference,
    run_observer,
)
from wildlab.navigation.strapdown import AxisErrors, ImuNoise, ImuSamples, with_turn_on

#: Share of the magnetic field's turning that gyros in the same axes explain at least; it is nearer one.
TURNED = 0.6
#: How much wider than the fixes behind it the heading at the start is taken to be.
LOOSE = 5.0


#: See `heading_from`.
Heading = Literal["antennas", "field", "course"]


class Inputs(NamedTuple):
    """Samples, aiding by what it is called in a report, and the start."""

    imu: ImuSamples
    aiding: dict[str, Aiding]
    start: InitialState


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
    missing = stated.unstated_noise()
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


def inputs_of(
    flight: Flight,
    *,
    velocity: bool = True,
    noise: ImuNoise | None = None,
    position_sd: tuple[float, float] | None = None,
    accelerometer_bias: ArrayLike = (0.0, 0.0, 0.0),
) -> Inputs:
    """What both filters need of a flight.

    Parameters
    ----------
    velocity
        Whether to use GNSS velocities where the flight has them.
    noise
        As `imu_noise` gives it: says how far biases at the start may be off, where the manifest states that.
    position_sd
        Of each level axis and of the height, m, in place of what is stated; positions then count as white.
    accelerometer_bias
        (3,) m/s^2, taken off what the accelerometers measured.

    Raises
    ------
    WildlabError
        Where the flight lacks inertial samples, satellite positions, or what is known of their errors.
    """
    gnss, samples = flight.table("gnss"), samples_of(flight)
    off = np.asarray(accelerometer_bias, float)
    samples = samples._replace(specific_force=samples.specific_force - off)
    t, p = gnss_times(flight), gnss[POSITION].to_numpy(float)
    sd = _position_sd(flight, gnss)
    spread = float(np.sqrt(2) * np.nanmedian(sd))
    wander, wander_time = _wander(flight)
    if position_sd is not None:
        wander = np.zeros(3)
        sd = np.tile([position_sd[0], position_sd[0], position_sd[1]], (len(t), 1))
    white = np.sqrt(np.maximum(sd**2 - wander**2, (0.01 * sd) ** 2))
    arms = _levers(flight, gnss)
    aiding = {"position": positions(t, p, white, arms[0], 0.0, wander, wander_time)}
    moving = set(VELOCITY) <= set(gnss.columns)
    v = _velocities(gnss, t)
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
    if set(SECOND_COLUMNS) <= set(gnss.columns):
        second = gnss[list(SECOND_COLUMNS)].to_numpy(float)
        aiding["second position"] = positions(t, second, white, arms[1], 0.0, wander, wander_time)
        # The fixes that it starts from are taken in once more: loosely here, so that they count once.
        known["baseline_sd"] = LOOSE * spread
        start = align_from_baseline(samples, t, p, second, *arms, gravity=gravity, **known)
    else:
        rest = find_rest(samples, t, v) if moving else None
        if rest is None:
            start = align_from_course(samples, t, p, v, gravity=gravity, **known)
        else:
            start = align_at_rest(samples, t, p, v, rest=rest, gravity=gravity, min_speed=FLYING, **known)
    return Inputs(samples, aiding, start)


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


def _velocities(gnss: pd.DataFrame, times: Array) -> Array:
    """(N, 3) m/s, as logged or else from the positions."""
    if set(VELOCITY) <= set(gnss.columns):
        return gnss[VELOCITY].to_numpy(float)
    return np.gradient(gnss[POSITION].to_numpy(float), times, axis=0)


def _levers(flight: Flight, gnss: pd.DataFrame) -> list[Array]:
    """From b to the first antenna and to the second one, (3,) m in b each: logged, else stated."""
    stated = np.array(flight.manifest.gnss.lever_arm_m)
    both = (list(LEVER_COLUMNS[:3]), list(LEVER_COLUMNS[3:]))
    return [gnss[one].iloc[0].to_numpy(float) if {*one} <= {*gnss} else stated for one in both]


def samples_of(flight: Flight) -> ImuSamples:
    """The flight's inertial samples."""
    imu = flight.table("imu")
    return ImuSamples(
        imu["time_s"].to_numpy(float),
        imu[["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]].to_numpy(float),
        imu[["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]].to_numpy(float),
    )


def heading_from(flight: Flight) -> Heading:
    """What shows the observer the heading, the best that the flight has: two antennas, the magnetic field
    where the manifest says how the Earth's lies there, or the course."""
    stated = flight.manifest.magnetometer
    if set(SECOND_COLUMNS) <= set(flight.table("gnss").columns):
        return "antennas"
    known = None not in (stated.inclination_deg, stated.declination_deg)
    return "field" if known and "magnetometer" in flight.tables else "course"


def second_vector(flight: Flight) -> Aiding:
    """The observer's second vector, of what `heading_from` names.

    Raises
    ------
    WildlabError
        Where it is the magnetic field, and that cannot be used.
    """
    gnss, t, stated = flight.table("gnss"), gnss_times(flight), flight.manifest.magnetometer
    which = heading_from(flight)
    if which == "antennas":
        both = (gnss[columns].to_numpy(float) for columns in (POSITION, list(SECOND_COLUMNS)))
        return baseline_reference(t, *both, *_levers(flight, gnss))
    if which == "field":
        lies = np.radians([stated.declination_deg or 0.0, stated.inclination_deg or 0.0])
        return field_reference(*_field(flight), earth_field(*lies))
    return course_reference(t, _velocities(gnss, t), FLYING)


def _field(flight: Flight) -> tuple[Array, Array]:
    """Times (N,) and the field (N, 3) in b, less what is magnetic on board: stated or found in the air.

    Raises
    ------
    WildlabError
        Where the field does not turn as the gyros say: its axes are not those of the inertial samples.
    """
    table, gnss = flight.table("magnetometer"), flight.table("gnss")
    times, field = table["time_s"].to_numpy(float), table[FIELD].to_numpy(float)
    flown = np.full(len(times), True)
    if set(VELOCITY) <= set(gnss.columns):
        t, v = gnss_times(flight), gnss[VELOCITY].to_numpy(float)
        fast = t[np.hypot(v[:, 0], v[:, 1]) >= FLYING]
        if len(fast):
            flown = (times >= fast[0]) & (times <= fast[-1])
    stated = flight.manifest.magnetometer.hard_iron_ut
    field = field - (hard_iron(field[flown]) if stated is None else stated)
    share = share_turned(times[flown], field[flown], samples_of(flight))
    if share < TURNED:
        raise WildlabError(
            f"of the magnetic field's turning in the air, the gyros explain {100 * max(share, 0):.0f} %",
            "check axes and signs of [magnetometer.field], and that both are on the same clock",
            file=flight.folder,
            field="magnetometer",
        )
    return times, field


BIASES = ["accelerometer_x_m_s2", "accelerometer_y_m_s2", "accelerometer_z_m_s2"] + [
    f"gyro_{axis}_rad_s" for axis in "xyz"
]

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


def navigate_mekf(
    flight: Flight,
    times: ArrayLike | None = None,
    *,
    tuning: MekfTuning | None = None,
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
    latitude, _, height = flight.manifest.origin_tuple()
    earth, sources = local_earth(latitude, height), list(given.aiding.values())
    found = run_mekf(given.imu, given.start, noise, earth, sources, _wanted(flight, times), axes=axes)
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
    signs = tuple(signs_of_trouble(found, sources))
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
    columns = ["time_s", *POSITION, *VELOCITY, *QUATERNION]
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


class NavigationErrors(NamedTuple):
    """Errors (K, 9) at K times: position (m) and velocity (m/s) in n, attitude (rad) in b; see the module.

    ``sd`` (K, 9) is what the estimate states of them, and ``white`` (K, 9) has the errors of each block in
    units of their own standard deviations; both NaN where nothing is stated.
    """

    times: Array
    error: Array
    sd: Array
    white: Array

    @property
    def nees(self) -> dict[str, Array]:
        """(K,) of each block, not divided by its three degrees of freedom."""
        return {name: (self.white[:, part] ** 2).sum(axis=1) for name, part in BLOCKS.items()}


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
    error[:, 3:6] = _nav_velocities(reference, t) - _nav_velocities(nav, t)
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
    white = np.concatenate([whiten(error[:, part], P[:, part, part]) for part in BLOCKS.values()], axis=1)
    return NavigationErrors(t, error, np.sqrt(np.diagonal(P, axis1=1, axis2=2)), white)


def _nav_velocities(nav: pd.DataFrame, times: Array) -> Array:
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
    for prefix, values in (("rms", _rms(e)), ("mean_sd", known_mean(sd))):
        result |= {f"{prefix}_{name}": float(values[i]) for i, name in enumerate(PLACES)}
        result |= {f"{prefix}_{name}": float(np.degrees(values[6 + i])) for i, name in enumerate(AXES)}
    result["rms_velocity"] = float(np.sqrt((_rms(e)[3:6] ** 2).sum()))
    result |= {f"nees_{name}": float(known_mean(values[part])) for name, values in errors.nees.items()}
    return result


def known_mean(values: Array) -> Array:
    """Mean over the first axis of what is finite; NaN where nothing is."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    count = known.sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _rms(values: Array) -> Array:
    return np.sqrt(known_mean(values**2))


def calibrated(flight: Flight) -> bool:
    """Whether the flight's manifest says that its accelerometers are off by no more than `CALIBRATED`."""
    stated = flight.manifest.imu.accelerometer_turn_on_m_s2
    return stated is not None and stated <= CALIBRATED
