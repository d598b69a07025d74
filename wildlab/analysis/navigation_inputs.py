"""What of a flight the navigation filters take: samples, aiding, how they err, and where to start."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.flight.checks.inertial import FLYING
from wildlab.flight.clocks import gnss_times
from wildlab.flight.schema import LEVER_COLUMNS, SECOND_COLUMNS
from wildlab.flight.store import Flight
from wildlab.geometry.gravity import local_earth
from wildlab.navigation.aiding import Aiding, headings, positions, velocities
from wildlab.navigation.alignment import align_at_rest, align_from_baseline, align_from_course, find_rest
from wildlab.navigation.magnetometer import earth_field, hard_iron, share_turned
from wildlab.navigation.mekf import InitialState
from wildlab.navigation.noise import AxisErrors, ImuNoise, with_turn_on
from wildlab.navigation.observer import baseline_reference, course_reference, field_reference
from wildlab.navigation.strapdown import ImuSamples

Array = NDArray[np.float64]

POSITION = ["north_m", "east_m", "down_m"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
FIELD = ("field_x_ut", "field_y_ut", "field_z_ut")
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
        return np.asarray(gnss[VELOCITY].to_numpy(float))
    return np.asarray(np.gradient(gnss[POSITION].to_numpy(float), times, axis=0))


def _levers(flight: Flight, gnss: pd.DataFrame) -> list[Array]:
    """From b to the first antenna and to the second one, (3,) m in b each."""
    return [_lever(flight, gnss, LEVER_COLUMNS[:3]), _lever(flight, gnss, LEVER_COLUMNS[3:])]


def _lever(flight: Flight, gnss: pd.DataFrame, columns: tuple[str, ...]) -> Array:
    if set(columns) <= set(gnss.columns):
        return np.asarray(gnss[list(columns)].iloc[0].to_numpy(float))
    return np.array(flight.manifest.gnss.lever_arm_m)


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


def headings_of(flight: Flight) -> Aiding:
    """The magnetic heading as an update of the error-state filter.

    Raises
    ------
    WildlabError
        Where the flight has no magnetometer, or the manifest does not say where north is, or how sure.
    """
    stated = flight.manifest.magnetometer
    known = []
    for name in ("declination_deg", "heading_sd_deg"):
        value = getattr(stated, name)
        if value is None:
            raise WildlabError(
                f"headings by the magnetometer are asked for, and {name} is not stated",
                "add it to [magnetometer], or navigate without the magnetometer",
                file=flight.folder,
                field=f"magnetometer.{name}",
            )
        known.append(float(np.radians(value)))
    declination, sd = known
    return headings(*_field(flight), sd, declination)


def _field(flight: Flight) -> tuple[Array, Array]:
    """Times (N,) and the field (N, 3) in b, less what is magnetic on board: stated or found in the air.

    Raises
    ------
    WildlabError
        Where the field does not turn as the gyros say: its axes are not those of the inertial samples.
    """
    table, gnss = flight.table("magnetometer"), flight.table("gnss")
    times, field = table["time_s"].to_numpy(float), table[list(FIELD)].to_numpy(float)
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
