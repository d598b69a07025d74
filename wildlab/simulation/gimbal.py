"""A gimbal that swings the camera while the airframe flies on: to the sides (F 5.4.1), or to and fro."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from wildlab.geometry.frames import Array
from wildlab.simulation.error_models import stream
from wildlab.simulation.sensor_parameters import Gimbal

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
