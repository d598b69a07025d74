"""A gimbal that swings the camera from side to side while the airframe flies on (F 5.4.1)."""

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
    forward (yaw rotation), about the airframe's length for one hung by its back (roll rotation).
    """
    phase = 2 * math.pi * np.asarray(times, float) / gimbal.period.si
    pan = gimbal.limit.si * np.arcsin(_SHARPNESS * np.sin(phase)) / math.asin(_SHARPNESS)
    return pan, np.full(len(phase), gimbal.tilt.si)


def gimbal_table(gimbal: Gimbal, duration: float, seed: int) -> pd.DataFrame:
    """What the gimbal says about its angles."""
    times = np.arange(math.floor(duration * gimbal.rate.si + 1e-9) + 1) / gimbal.rate.si
    pan, tilt = gimbal_angles(gimbal, times)
    error = gimbal.noise.si * stream(seed, "gimbal").standard_normal((2, len(times)))
    return pd.DataFrame({"time_s": times, "pan_rad": pan + error[0], "tilt_rad": tilt + error[1]})
