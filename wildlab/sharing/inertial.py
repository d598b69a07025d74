"""What the sensors on board would have measured had the same flight been flown elsewhere.

Gravity, the turning of the Earth and its magnetic field tell the latitude, and more. A copy with another
origin would contradict its own sensors, and its numbers would not be those of the flight; so the difference
between the two places is added to what was measured, in the axes in which it was.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clocks import poses_at
from wildlab.flight.manifest_parts import MagnetometerPart
from wildlab.flight.schema import COVARIANCE_COLUMNS
from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import Earth
from wildlab.navigation.magnetometer import earth_field

_FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
_RATE = ["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
FIELD = ["field_x_ut", "field_y_ut", "field_z_ut"]
_VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
#: The field that stands for the true one: due north, 60 degrees down, uT.
USUAL_FIELD, USUAL_DECLINATION_DEG, USUAL_INCLINATION_DEG = 50.0, 0.0, 60.0


def gravity_at(earth: Earth, p: Array) -> Array:
    """Gravity in n at places (N, 3) in n, m/s^2, as `wildlab.navigation` reckons with it."""
    g = earth.gravity + earth.gradient * p[:, 2]
    return np.column_stack([-g * earth.curvature * p[:, 0], -g * earth.curvature * p[:, 1], g])


def moved_imu(
    imu: pd.DataFrame, nav: pd.DataFrame | None, shift: Array, here: Earth, there: Earth
) -> pd.DataFrame:
    """Inertial samples as they would have been at another place, with the same motion.

    Parameters
    ----------
    imu
        Of the flight.
    nav
        Poses over time, with attitudes; None where there are none: then the specific force is stretched by
        the ratio of both gravities, and the turning of the Earth stays.
    shift
        (3,) m: the new origin of n in the old one.
    here, there
        The Earth at the true origin and at the one that stands for it.

    Returns
    -------
    DataFrame
    """
    f, w = imu[_FORCE].to_numpy(float), imu[_RATE].to_numpy(float)
    moved = f * (there.gravity / here.gravity)
    known: NDArray[np.bool_] = np.zeros(len(imu), np.bool_)
    if nav is not None and len(nav) > 1:
        times = imu["time_s"].to_numpy(float)
        p, R, v = _motion(nav, times)
        known = np.asarray(np.isfinite(p).all(axis=1) & np.isfinite(R).all(axis=(1, 2)))
        turning = np.array(there.rate) - np.array(here.rate)
        more = gravity_at(here, p) - gravity_at(there, p - shift)
        more += 2 * np.cross(np.broadcast_to(turning, v.shape), v)
        moved[known] = f[known] + np.einsum("nji,nj->ni", R[known], more[known])
        w[known] += np.einsum("nji,j->ni", R[known], turning)
    return imu.assign(**dict(zip(_FORCE, moved.T, strict=True)), **dict(zip(_RATE, w.T, strict=True)))


def _motion(nav: pd.DataFrame, times: Array) -> tuple[Array, Array, Array]:
    """Places (N, 3), attitudes (N, 3, 3) and velocities (N, 3); NaN, and no velocity, where not known."""
    lean = nav.drop(columns=[name for name in (*COVARIANCE_COLUMNS, "frame_id") if name in nav])
    try:
        p, R, _ = poses_at(lean, times)
    except WildlabError:
        # Poses that cannot be used are none.
        return (
            np.full((len(times), 3), np.nan),
            np.full((len(times), 3, 3), np.nan),
            np.zeros((len(times), 3)),
        )
    v = np.zeros((len(times), 3))
    if set(_VELOCITY) <= set(nav):
        known = nav[["time_s", *_VELOCITY]].dropna()
        if len(known):
            stamps = known["time_s"].to_numpy(float)
            v = np.column_stack([np.interp(times, stamps, known[name].to_numpy(float)) for name in _VELOCITY])
    return p, R, v


def moved_field(
    table: pd.DataFrame,
    nav: pd.DataFrame | None,
    stated: MagnetometerPart,
) -> tuple[pd.DataFrame, float] | None:
    """Magnetic measurements as they would have been in the usual field, and what they were stretched by.

    What is magnetic on board stays in them, stretched likewise.

    Parameters
    ----------
    table
        Of the magnetometer.
    nav
        Poses over time.
    stated
        What the manifest says of the true field, and of what is magnetic on board.

    Returns
    -------
    (DataFrame, float) or None
        None where it cannot be told what the field there did to them: they had better be left out.
    """
    declination, inclination = stated.declination_deg, stated.inclination_deg
    if nav is None or len(nav) < 2 or declination is None or inclination is None:
        return None
    _, R, _ = _motion(nav, table["time_s"].to_numpy(float))
    field = table[FIELD].to_numpy(float)
    iron = np.zeros(3) if stated.hard_iron_ut is None else np.array(stated.hard_iron_ut)
    strength = float(np.nanmedian(np.linalg.norm(field - iron, axis=1)))
    known = np.asarray(np.isfinite(R).all(axis=(1, 2)))
    if not strength > 0 or not known.any():
        return None
    there = earth_field(*np.radians([USUAL_DECLINATION_DEG, USUAL_INCLINATION_DEG]))
    here = earth_field(*np.radians([declination, inclination]))
    field = field + strength * np.einsum("nji,j->ni", R, there - here)
    stretch = USUAL_FIELD / strength
    moved = table.assign(**dict(zip(FIELD, (field * stretch).T, strict=True)))
    return moved.loc[known].reset_index(drop=True), stretch
