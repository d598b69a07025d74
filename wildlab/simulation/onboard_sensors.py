"""What sensors on the airframe write down: the autopilot's poses, inertial measurements, satellite fixes."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.gravity import local_earth
from wildlab.simulation import kernels
from wildlab.simulation.error_models import gauss_markov, rounded, stream, with_attitude_error
from wildlab.simulation.imu import ideal_imu, read_imu
from wildlab.simulation.parameter_groups import Gimbal, Gnss, TargetGps
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.trajectory import (
    AttitudeDisturbance,
    Motion,
    Trajectory,
    angular_rates,
    attitude_along,
    band_limited_disturbance,
)

_SHARPNESS = 0.98  # of a triangle's corners: the gimbal turns round within about a tenth of its swing


def gimbal_angles(gimbal: Gimbal, times: Array) -> tuple[Array, Array]:
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


def gimbal_table(gimbal: Gimbal, duration: float, seed: int) -> pd.DataFrame:
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


def position_fixes(position: ArrayLike, receiver: Gnss | TargetGps, rng: np.random.Generator) -> Array:
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
    if b is None:
        raise ValueError("this twin carries no payload")
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
    if twin.imu is None:
        raise ValueError("this twin carries no inertial unit")
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


def gnss_table(
    twin: TwinParameters, payload: Trajectory, seed: int, stated: Gnss | None = None
) -> pd.DataFrame:
    """Fixes of the two receivers over the whole flight, and the velocity that the first one gives.

    What the columns say of its accuracy is that of the receivers as ``stated``; left out, as they are.
    """
    g = twin.gnss
    if g is None:
        raise ValueError("this twin carries no receivers")
    sheet = g if stated is None else stated
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
        ("horizontal", sheet.horizontal_noise.si, sheet.horizontal_correlated_sd.si),
        ("vertical", sheet.vertical_noise.si, sheet.vertical_correlated_sd.si),
    ):
        columns[f"sd_{axis}_m"] = np.full(len(times), math.hypot(noise, correlated))
    columns["sd_velocity_m_s"] = np.full(len(times), sheet.velocity_noise.si)
    for which, arm in arms.items():
        columns |= {f"{which}lever_{axis}_m": np.full(len(times), arm[i]) for i, axis in enumerate("xyz")}
    return pd.DataFrame(columns)
