"""Motions of aeroplanes and multirotors, and what small autopilots log of them, with correlated errors.

Everything is computed from the motion with SciPy's rotations, so that no check is held against its own
formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d
from scipy.signal import fftconvolve, lfilter
from scipy.spatial.transform import Rotation

Array = np.ndarray
#: Samples of the motion and of the inertial sensor per second; of how many one is a pose, or a fix; m/s^2.
RATE, NAV_EVERY, GNSS_EVERY, GRAVITY = 25, 3, 5, 9.82
NED = ["north_m", "east_m", "down_m"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
QUATERNION = ["q_w", "q_x", "q_y", "q_z"]


@dataclass(frozen=True)
class Motion:
    """Times (N,), positions (N, 3) in n and attitudes of the platform."""

    t: Array
    p: Array
    R: Rotation

    @property
    def v(self) -> Array:
        return np.asarray(np.gradient(self.p, self.t, axis=0))


@dataclass(frozen=True)
class Level:
    """Standard deviations of a log: tilts and heading (rad), position, level and vertical (m)."""

    tilt: float
    heading: float
    level: float
    vertical: float


# -- processes


def gauss_markov(rng: Any, n: int, sd: Any, seconds: float, columns: int = 1) -> Array:
    """(N, columns) at `RATE`, in its steady state from the first sample on."""
    keep = np.exp(-1 / (RATE * seconds))
    new = rng.normal(size=(n, columns)) * np.sqrt(1 - keep**2)
    new[0] /= np.sqrt(1 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], new, axis=0) * np.asarray(sd))


def smooth(rng: Any, n: int, sd: float, seconds: float, columns: int = 1) -> Array:
    """(N, columns) of a process that can be differentiated, as a motion is; its time scale in seconds."""
    wide = int(4 * seconds * RATE)
    weight = np.exp(-0.5 * (np.arange(-wide, wide + 1) / (seconds * RATE)) ** 2)[:, None]
    weight *= sd / np.linalg.norm(weight)
    return np.asarray(fftconvolve(rng.normal(size=(n + 2 * wide, columns)), weight, "valid", axes=0))


def sample_times(rng: Any, low: float = 90.0, high: float = 150.0) -> Array:
    return np.arange(int(rng.uniform(low, high) * RATE)) / RATE


def from_euler(roll: Any, pitch: Any, yaw: Any) -> Rotation:
    return Rotation.from_euler("ZYX", np.column_stack(np.broadcast_arrays(yaw, pitch, roll)))


def fly_turns(rng: Any, t: Array, fastest: float) -> Array:
    """Heading (N,) of straight legs and turns to both sides, rad."""
    rate, at, side = np.zeros(len(t)), rng.uniform(4, 10), rng.choice([-1, 1])
    while at < t[-1]:
        turn, speed = rng.uniform(0.7, 1.2) * np.pi, rng.uniform(0.6, 1.0) * fastest
        rate[(t >= at) & (t < at + turn / speed)] = side * speed
        at += turn / speed + rng.uniform(8, 20)
        side = -side if rng.random() < 0.7 else side
    rate = gaussian_filter1d(rate, 0.8 * RATE)
    return np.asarray(rng.uniform(-np.pi, np.pi) + np.cumsum(rate) / RATE)


# -- platforms


def fly_wing(rng: Any, t: Array, height: float) -> Motion:
    """An aeroplane in wind: it points where it goes through the air, and banks as the turn asks."""
    heading, n = fly_turns(rng, t, 0.35), len(t)
    speed, wind, wind_to = rng.uniform(15, 20), rng.uniform(0, 8), rng.uniform(-np.pi, np.pi)
    air = speed + smooth(rng, n, 0.4, 3.0)[:, 0]
    gust = smooth(rng, n, 0.6, 4.0, 2)
    v = np.column_stack([air * np.cos(heading), air * np.sin(heading)]) + gust
    v += wind * np.array([np.cos(wind_to), np.sin(wind_to)])
    p = np.column_stack([np.cumsum(v, axis=0) / RATE, -height + smooth(rng, n, 2.0, 6.0)])
    p[:, :2] -= p[:, :2].mean(axis=0)
    climb = -np.gradient(p[:, 2], t)
    bank = np.arctan(speed * np.gradient(heading, t) / GRAVITY) + smooth(rng, n, 0.025, 0.5)[:, 0]
    pitch = 0.05 + np.arcsin(np.clip(climb / speed, -0.3, 0.3)) + smooth(rng, n, 0.015, 0.5)[:, 0]
    return Motion(t, p, from_euler(bank, pitch, heading + smooth(rng, n, 0.02, 0.7)[:, 0]))


def fly_copter(rng: Any, t: Array, height: float, speed: float, yaw: Array, course: Any = 0.0) -> Motion:
    """A multirotor: it goes any way whatever its yaw, and leans as thrust, drag and wind ask.

    `course`: places (N, 2) about which it moves at `speed`, m and m/s.
    """
    n = len(t)
    way = np.cumsum(smooth(rng, n, speed / np.sqrt(2), 5.0, 2), axis=0) / RATE
    p = np.column_stack([course + way - way.mean(axis=0), -height + smooth(rng, n, 1.0, 6.0)])
    v = np.gradient(p[:, :2], t, axis=0)
    wind = rng.normal(0, 3, 2)
    thrust = np.gradient(np.gradient(p, t, axis=0), t, axis=0) - [0, 0, GRAVITY]
    thrust[:, :2] += 0.12 * (v - wind)  # against the drag
    z = -thrust / np.linalg.norm(thrust, axis=1)[:, None]
    x = np.column_stack([np.cos(yaw), np.sin(yaw), 0 * yaw])
    y = np.cross(z, x)
    y /= np.linalg.norm(y, axis=1)[:, None]
    R = Rotation.from_matrix(np.stack([np.cross(y, z), y, z], axis=2))
    shaken = smooth(rng, n, 0.008, 0.4, 2)
    return Motion(t, p, R * from_euler(shaken[:, 0], shaken[:, 1], 0.0))


def copter_yaw(rng: Any, t: Array, mode: int) -> Array:
    """One way all the time, turning slowly, or from one way to another."""
    first = rng.uniform(-np.pi, np.pi)
    if mode == 0:
        return np.asarray(first + smooth(rng, len(t), 0.02, 2.0)[:, 0])
    if mode == 1:
        return np.asarray(first + rng.choice([-1, 1]) * rng.uniform(0.05, 0.15) * t)
    return np.asarray(first + smooth(rng, len(t), 1.0, 8.0)[:, 0])


# -- sensors


def draw_level(rng: Any) -> Level:
    tilt, heading = np.radians([rng.uniform(0.3, 0.8), rng.uniform(0.6, 1.5)]).tolist()
    return Level(tilt, heading, rng.uniform(0.5, 1.2), rng.uniform(0.7, 1.5))


def attitude_error(rng: Any, n: int, level: Level) -> Rotation:
    """Of the world as the log has it: two tilts and a heading."""
    seconds = rng.uniform(15, 50)
    return Rotation.from_rotvec(gauss_markov(rng, n, [level.tilt, level.tilt, level.heading], seconds, 3))


def log_motion(rng: Any, m: Motion, level: Level) -> tuple[pd.DataFrame, pd.DataFrame, Rotation]:
    """Poses, and the satellite positions that they go along with; and the logged attitudes at all times."""
    n = len(m.t)
    drift = gauss_markov(rng, n, [level.level, level.level, level.vertical], rng.uniform(40, 120), 3)
    R = attitude_error(rng, n, level) * m.R
    at = np.arange(0, n, NAV_EVERY)
    own = 0.3 * gauss_markov(rng, n, [level.level, level.level, level.vertical], 10.0, 3)
    v = m.v + gauss_markov(rng, n, 0.1, 5.0, 3)
    nav = pd.DataFrame(np.column_stack([m.t, m.p + drift + own, R.as_quat(scalar_first=True), v])[at],
                       columns=["time_s", *NED, *QUATERNION, *VELOCITY])  # fmt: skip
    at = np.arange(0, n, GNSS_EVERY)
    noise = rng.normal(0, [0.1, 0.1, 0.2, 0.1, 0.1, 0.15], (len(at), 6))
    late = rng.uniform(0.0, 0.12)
    fixes = np.column_stack([m.t + late, m.p + drift, m.v])[at]
    fixes[:, 1:] += noise
    return nav, pd.DataFrame(fixes, columns=["time_s", *NED, *VELOCITY]), R


def measure_inertial(rng: Any, m: Motion) -> pd.DataFrame:
    """A small sensor: noise, vibration and constant biases."""
    f = m.R.inv().apply(np.gradient(m.v, m.t, axis=0) - [0, 0, GRAVITY])
    w = (m.R[:-1].inv() * m.R[1:]).as_rotvec() * RATE
    n = len(m.t)
    f = f + rng.normal(0, 0.08, 3) + rng.normal(0, 0.3, (n, 3))
    w = np.vstack([w, w[-1:]]) + rng.normal(0, 0.004, 3) + rng.normal(0, 0.01, (n, 3))
    names = ["time_s", *(f"f_{a}_m_s2" for a in "xyz"), *(f"w_{a}_rad_s" for a in "xyz")]
    return pd.DataFrame(np.column_stack([m.t, f, w]), columns=names)
