"""What sensors on the airframe write down: inertial measurements, the autopilot's poses, satellite fixes.

The errors of an inertial unit are those of a data sheet (H tables A.5 and A.6): white noise whose integral
walks (angle and velocity random walk), a bias that differs from one switching-on to the next and drifts
during the run, axes that are not where they are said to be, a range and a resolution.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import USUAL_GRAVITY, Array, Earth, euler_to_matrix, flat_earth, local_earth
from wildlab.simulation import kernels
from wildlab.simulation.error_models import gauss_markov, rounded, stream, with_attitude_error
from wildlab.simulation.parameters import Group, TwinParameters
from wildlab.simulation.trajectory import (
    AttitudeDisturbance,
    Motion,
    Trajectory,
    angular_rates,
    attitude_along,
    band_limited_disturbance,
)

#: The n of a trajectory, by itself.
INERTIAL = flat_earth(USUAL_GRAVITY)

_CHUNK = 16_384  # samples at a time: their motion then fits into the processor's cache
_ASIDE = 4  # samples on either side of a difference of fourth order with a step of two samples


class TriadDataSheet(NamedTuple):
    """Errors of three gyros or accelerometers, in SI units.

    Attributes
    ----------
    random_walk
        Noise density, in the unit of a reading times the root of a second: the SD of the integral after 1 s.
    bias_stability, bias_time
        SD and correlation time (s) of the bias in the run, a first-order Gauss-Markov process.
    turn_on_bias
        SD of the bias that stays from switching on to switching off.
    axis_misalignment, package_misalignment
        As in :func:`misaligned_triad`, rad.
    limit, resolution
        Beyond the one the reading stands still, and it is a multiple of the other.
    """

    random_walk: float
    bias_stability: float
    bias_time: float
    turn_on_bias: float
    axis_misalignment: float
    package_misalignment: float
    limit: float
    resolution: float


def ideal_imu(
    trajectory: Trajectory, rate: float, count: int, earth: Earth = INERTIAL
) -> tuple[Array, Array]:
    """Specific force and angular rate of a body, as ideal sensors feel them.

    The angular rate is a central difference of fourth order over the samples themselves, so that the motion
    is asked for once per sample only. With a step of two samples of 10 ms at most, motion with periods of two
    seconds and more has a relative error of some 1e-7, far below any sensor's.

    Parameters
    ----------
    trajectory
        Of the body in n.
    rate
        Samples per second, Hz, at least 100.
    count
        N samples, the first at time 0.
    earth
        What pulls, and how n turns: by itself n counts as inertial, as it does for the trajectory.

    Returns
    -------
    force
        (N, 3) m/s^2, in the body.
    angular_rate
        (N, 3) rad/s, of the body, in the body.
    """
    force, spin = np.empty((count, 3)), np.empty((count, 3))
    inside = slice(_ASIDE, -_ASIDE)
    for first in range(0, count, _CHUNK):
        some = slice(first, min(first + _CHUNK, count))
        m = trajectory(np.arange(some.start - _ASIDE, some.stop + _ASIDE) / rate)
        R = m.R_nb
        kernels.body_rates(R[:-8], R[2:-6], R[6:-2], R[8:], 2 / rate, spin[some])
        moving = (m.position[inside], m.velocity[inside], m.acceleration[inside])
        kernels.felt_on_earth(R[inside], *moving, earth.as_array(), force[some], spin[some])
    return force, spin


def misaligned_triad(axis: float, package: float, rng: np.random.Generator) -> Array:
    """What three axes that are not where they should be read of a vector: (3, 3), to be multiplied by it.

    Parameters
    ----------
    axis
        Each axis leans towards each of the other two by an angle drawn evenly from -axis to axis, rad.
    package
        All three together are turned about each axis of the package by an angle drawn likewise, rad.
    """
    lean = rng.uniform(-axis, axis, (3, 3))
    np.fill_diagonal(lean, 0.0)
    turned = Rotation.from_rotvec(rng.uniform(-package, package, 3)).as_matrix()
    axes = np.eye(3) + lean
    return np.asarray((axes / np.linalg.norm(axes, axis=1, keepdims=True)) @ turned.T)


def read_triad(true: ArrayLike, rate: float, sheet: TriadDataSheet, rng: np.random.Generator) -> Array:
    """What three gyros or accelerometers read of the true values.

    Parameters
    ----------
    true
        (N, 3), in SI units.
    rate
        Hz.

    Returns
    -------
    (N, 3).
    """
    x = np.ascontiguousarray(true, float)
    triad = misaligned_triad(sheet.axis_misalignment, sheet.package_misalignment, rng)
    turn_on = sheet.turn_on_bias * rng.standard_normal(3)
    drift = gauss_markov(len(x), 1 / rate, [sheet.bias_stability] * 3, sheet.bias_time, rng)
    noise = rng.standard_normal(x.shape)
    limits = np.array([sheet.limit, sheet.resolution])
    kernels.read_triad(x, triad, turn_on, drift, noise, float(sheet.random_walk * np.sqrt(rate)), limits)
    return noise


def triad_data_sheet(imu: Group, triad: str) -> TriadDataSheet:
    """Of a unit's triad, ``accelerometer`` or ``gyro``."""
    names = ("random_walk", "bias_stability", "bias_time", "turn_on_bias", "range", "resolution")
    own = [getattr(imu, f"{triad}_{name}").si for name in names]
    return TriadDataSheet._make([*own[:4], imu.axis_misalignment.si, imu.package_misalignment.si, *own[4:]])


def read_imu(
    force: ArrayLike, angular_rate: ArrayLike, imu: Group, stream: Callable[[str], np.random.Generator]
) -> tuple[Array, Array]:
    """Readings of a unit with that data sheet, calibrated to the body: (N, 3) m/s^2 and (N, 3) rad/s.

    ``stream`` gives the random numbers of each triad by its name.
    """
    force, rate = (
        read_triad(true, imu.rate.si, triad_data_sheet(imu, triad), stream(f"{triad}s"))
        for true, triad in ((force, "accelerometer"), (angular_rate, "gyro"))
    )
    return force, rate


_SHARPNESS = 0.98  # of a triangle's corners: the gimbal turns round within about a tenth of its swing


def gimbal_angles(gimbal: Group, times: Array) -> tuple[Array, Array]:
    """True pan and tilt at times (N,) s: (N,) rad each.

    Pan goes to and fro at an even pace but for the ends, where it turns round smoothly; at time 0 it passes
    the middle. Which way that turns the camera is the mount's matter: about the vertical for one that looks
    forward (yaw rotation), about the airframe's length for one hung by its back (roll rotation). Tilt, where
    it moves, does alike; at ``tilt_middle`` it passes its middle on the way back.
    """
    t = np.asarray(times, float)
    pan = gimbal.limit.si * _swing(t / gimbal.period.si)
    tilt = np.full(len(t), gimbal.tilt.si)
    if gimbal.tilt_limit is not None and gimbal.tilt_period is not None and gimbal.tilt_middle is not None:
        tilt -= gimbal.tilt_limit.si * _swing((t - gimbal.tilt_middle.si) / gimbal.tilt_period.si)
    return pan, tilt


def _swing(periods: Array) -> Array:
    """A triangle of height one with rounded corners, zero and rising at zero; (N,) periods -> (N,)."""
    return np.asarray(np.arcsin(_SHARPNESS * np.sin(2 * math.pi * periods)) / math.asin(_SHARPNESS))


def gimbal_table(gimbal: Group, duration: float, seed: int) -> pd.DataFrame:
    """What the gimbal says about its angles."""
    times = np.arange(math.floor(duration * gimbal.rate.si + 1e-9) + 1) / gimbal.rate.si
    pan, tilt = gimbal_angles(gimbal, times)
    error = gimbal.noise.si * stream(seed, "gimbal").standard_normal((2, len(times)))
    return pd.DataFrame({"time_s": times, "pan_rad": pan + error[0], "tilt_rad": tilt + error[1]})


def antenna_motion(motion: Motion, angular_rate: ArrayLike, arm: ArrayLike) -> tuple[Array, Array]:
    """Position and velocity in n of an antenna that is rigidly fixed to b.

    Parameters
    ----------
    motion
        Of b, at N times.
    angular_rate
        Of b against n, in b, (N, 3) rad/s.
    arm
        From b to the antenna, in b, (3,) m.

    Returns
    -------
    (N, 3) m and (N, 3) m/s.
    """
    r = np.asarray(arm, float)
    around = np.cross(np.asarray(angular_rate, float), r)
    return motion.position + motion.R_nb @ r, motion.velocity + np.einsum("nij,nj->ni", motion.R_nb, around)


def position_fixes(position: ArrayLike, receiver: Group, rng: np.random.Generator) -> Array:
    """Positions as a receiver gives them: with a time-correlated error, and noise from fix to fix.

    Parameters
    ----------
    position
        True positions of the antenna in n at the receiver's rate, (N, 3) m.

    Returns
    -------
    (N, 3) m, in n.
    """
    p, r = np.asarray(position, float), receiver
    spread = np.array([r.horizontal_correlated_sd.si] * 2 + [r.vertical_correlated_sd.si])
    noise_sd = np.array([r.horizontal_noise.si] * 2 + [r.vertical_noise.si])
    correlated = gauss_markov(len(p), 1 / r.rate.si, spread, r.correlation_time.si, rng)
    return rounded(p + correlated + noise_sd * rng.standard_normal(p.shape), r.resolution.si)


def sample_times(rate: float, duration: float) -> Array:
    """Sample times from 0 to the end of the flight, (N,) s."""
    return np.arange(math.floor(duration * rate + 1e-9) + 1) / rate


def nav_table(motion: Motion) -> pd.DataFrame:
    q = np.empty((len(motion.times), 4))
    kernels.quaternions(np.ascontiguousarray(motion.R_nb), q)
    columns = {"time_s": motion.times}
    columns |= {f"{axis}_m": motion.position[:, i] for i, axis in enumerate(("north", "east", "down"))}
    columns |= {f"q_{part}": q[:, i] for i, part in enumerate("wxyz")}
    columns |= {f"v_{axis}_m_s": motion.velocity[:, i] for i, axis in enumerate(("north", "east", "down"))}
    return pd.DataFrame(columns)


def autopilot_tables(
    twin: TwinParameters, true: Motion, seed: int
) -> tuple[pd.DataFrame, pd.DataFrame | None]:
    """The logged pose with the IMU's misalignment taken out, and left in: same errors, one difference.

    The second one only where that misalignment is known.
    """
    a, count, step = twin.autopilot, len(true.times), 1 / twin.autopilot.rate.si
    rng = stream(seed, "autopilot attitude")
    turn = gauss_markov(
        count, step, [a.roll_sd.si, a.pitch_sd.si, a.yaw_sd.si], a.attitude_correlation_time.si, rng
    ) + a.attitude_noise.si * rng.standard_normal((count, 3))
    rng = stream(seed, "autopilot position")
    spread = [a.horizontal_sd.si, a.horizontal_sd.si, a.vertical_sd.si]
    shift = gauss_markov(count, step, spread, a.position_correlation_time.si, rng)
    shift += a.position_noise.si * rng.standard_normal((count, 3))
    rng = stream(seed, "autopilot velocity")
    slip = gauss_markov(count, step, [a.velocity_sd.si] * 3, a.velocity_correlation_time.si, rng)
    logged = Motion(
        true.times,
        rounded(true.position + shift, a.position_resolution.si),
        true.velocity + slip,
        true.acceleration,
        with_attitude_error(true.R_nb, turn),
    )
    imu = mounted_imu(twin)
    if imu is None:
        return nav_table(logged), None
    left_in = Motion(logged.times, logged.position, logged.velocity, logged.acceleration, logged.R_nb @ imu)
    return nav_table(logged), nav_table(left_in)


def mounted_imu(twin: TwinParameters) -> Array | None:
    """How the IMU is turned against the airframe: ``R_bi`` (3, 3), from its axes to b; None if not known."""
    a = twin.autopilot
    if a.imu_roll is None or a.imu_pitch is None or a.imu_yaw is None:
        return None
    # Of a level airframe the IMU reads these angles, so they are its attitude against the airframe.
    return euler_to_matrix(a.imu_roll.si, a.imu_pitch.si, a.imu_yaw.si)


def payload_boresight(twin: TwinParameters, seed: int) -> AttitudeDisturbance:
    """How the payload, which carries the IMU and the antennas, turns against the airframe with the camera."""
    b, rng = twin.boresight, stream(seed, "boresight")
    band = (b.shortest_period.si, b.longest_period.si)
    roll, pitch, yaw = (
        band_limited_disturbance(sd.si, *band, rng) for sd in (b.roll_sd, b.pitch_sd, b.yaw_sd)
    )
    return roll, pitch, yaw


def imu_table(twin: TwinParameters, payload: Trajectory, seed: int) -> pd.DataFrame:
    """Stream of the inertial unit over the whole flight, calibrated: turned from its axes to those of b.

    It feels the motion in its own axes, as it is mounted, and errs in these. `as_mounted` gives its readings
    as they were before the calibration.
    """
    times = sample_times(twin.imu.rate.si, twin.flight.duration.si)
    # The airframe flies as if n were inertial; its sensors feel the Earth turn, and where on it they are.
    earth = local_earth(twin.place.latitude.si, twin.place.height.si)
    true = ideal_imu(payload, twin.imu.rate.si, len(times), earth)
    R_bi = mounted_imu(twin)
    if R_bi is None:
        R_bi = np.eye(3)
    force, rate = (vectors @ R_bi for vectors in true)
    read = read_imu(force, rate, twin.imu, lambda triad: stream(seed, f"imu {triad}"))
    force, rate = (vectors @ R_bi.T for vectors in read)
    columns = {"time_s": times}
    columns |= {f"f_{axis}_m_s2": force[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"w_{axis}_rad_s": rate[:, i] for i, axis in enumerate("xyz")}
    return pd.DataFrame(columns)


def as_mounted(readings: pd.DataFrame, R_bi: Array) -> pd.DataFrame:
    """Calibrated readings of an inertial unit as it gave them, in its own axes.

    Parameters
    ----------
    readings
        A table ``imu``, in the axes of b.
    R_bi
        (3, 3), from the unit's axes to b: see `mounted_imu`.

    Returns
    -------
    pandas.DataFrame
        The same table in the axes of the unit, as if nobody had calibrated how it is mounted.
    """
    triads = ([f"f_{axis}_m_s2" for axis in "xyz"], [f"w_{axis}_rad_s" for axis in "xyz"])
    own = {
        name: column
        for triad in triads
        for name, column in zip(triad, (readings[triad].to_numpy(float) @ R_bi).T, strict=True)
    }
    return readings.assign(**own)


def gnss_table(twin: TwinParameters, payload: Trajectory, seed: int, stated: Group) -> pd.DataFrame:
    """Fixes of the two receivers over the whole flight, and the velocity that the first one gives.

    What the columns say of its accuracy is that of the receivers as ``stated``.
    """
    g = twin.gnss
    times = sample_times(g.rate.si, twin.flight.duration.si)
    motion, rate = payload(times), angular_rates(attitude_along(payload), times)
    arms = {
        "": (g.first_x.si, g.first_y.si, g.first_z.si),
        "second_": (g.second_x.si, g.second_y.si, g.second_z.si),
    }
    columns = {"time_s": times + g.latency.si}
    for which, arm in arms.items():
        position, velocity = antenna_motion(motion, rate, arm)
        rng = stream(seed, f"gnss {which or 'first_'}antenna")
        fix = position_fixes(position, g, rng)
        columns |= {f"{which}{axis}_m": fix[:, i] for i, axis in enumerate(("north", "east", "down"))}
        if not which:
            slip = g.velocity_noise.si * stream(seed, "gnss velocity").standard_normal(velocity.shape)
            columns |= {
                f"v_{axis}_m_s": (velocity + slip)[:, i] for i, axis in enumerate(("north", "east", "down"))
            }
    for axis, noise, correlated in (
        ("horizontal", stated.horizontal_noise.si, stated.horizontal_correlated_sd.si),
        ("vertical", stated.vertical_noise.si, stated.vertical_correlated_sd.si),
    ):
        columns[f"sd_{axis}_m"] = np.full(len(times), math.hypot(noise, correlated))
    columns["sd_velocity_m_s"] = np.full(len(times), stated.velocity_noise.si)
    for which, arm in arms.items():
        columns |= {f"{which}lever_{axis}_m": np.full(len(times), arm[i]) for i, axis in enumerate("xyz")}
    return pd.DataFrame(columns)
