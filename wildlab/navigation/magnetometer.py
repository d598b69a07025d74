"""The magnetic field as a direction: beyond H, whose second vector is the baseline between two antennas."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, quaternion_to_matrix
from wildlab.geometry.gravity import flat_earth
from wildlab.navigation.strapdown import ImuSamples, checked_imu, integrate_strapdown

#: Largest standard deviation of a centre, over the radius: a heading by it is then good to some two degrees.
SURE = 0.03
#: Samples that are wrong in the same way, motor currents change no faster: what they count as one.
CORRELATED = 50


def hard_iron(field_b: ArrayLike) -> Array:
    """The part of the field that turns with the airframe.

    The Earth's field has one length, so measurements lie on a sphere around it: its centre by linear least
    squares.

    Parameters
    ----------
    field_b
        (N, 3) in b, as measured, of any unit; rows with NaN are left out.

    Returns
    -------
    (3,) in b, in the unit of ``field_b``.

    Raises
    ------
    WildlabError
        Where there are fewer than ten measurements, or they cover too little of a sphere to say where its
        centre is.
    """
    m = np.asarray(field_b, float)
    m = m[np.isfinite(m).all(axis=1)]
    if len(m) >= 10:
        sphere = np.column_stack([2 * m, np.ones(len(m))])
        square = (m**2).sum(axis=1)
        found, _, rank, _ = np.linalg.lstsq(sphere, square, rcond=None)
        centre, radius = found[:3], float(np.median(np.linalg.norm(m - found[:3], axis=1)))
        if rank == 4:
            missed = float(np.var(square - sphere @ found))
            spread = missed * np.linalg.inv(sphere.T @ sphere)[:3, :3]
            if np.sqrt(np.linalg.eigvalsh(spread)[-1] * CORRELATED) < SURE * radius:
                return np.asarray(centre)
    raise WildlabError(
        "the magnetic field was seen from too few sides to tell the Earth's from that of the airframe",
        "log turns with bank to both sides, or state hard_iron_ut in [magnetometer]",
        field="magnetometer",
    )


def earth_field(declination: float, inclination: float) -> Array:
    """Direction of the Earth's field.

    Parameters
    ----------
    declination
        From true north, positive towards east, rad.
    inclination
        From the horizontal, positive downwards, rad.

    Returns
    -------
    (3,) in n, of length one.
    """
    level = np.cos(inclination)
    return np.array([level * np.cos(declination), level * np.sin(declination), np.sin(inclination)])


def share_turned(times: ArrayLike, field_b: ArrayLike, imu: ImuSamples, step: float = 2.0) -> float:
    """How much of the field's turning in b the gyros explain: near one where both are in the same axes.

    The Earth's field stands still in n, so in b it turns as the airframe does, the other way round. With an
    axis flipped or exchanged it turns in ways that no gyro felt, and the share falls, below zero even.

    Parameters
    ----------
    times, field_b
        (N,) s and (N, 3) in b, of any unit, without the part that turns with the airframe.
    imu
        Of the same flight.
    step
        From one sample compared to the next, s: long enough to turn by more than the field's noise.

    Returns
    -------
    float
        One less the ratio of what is left unexplained to all change; NaN where nothing turns.

    Raises
    ------
    WildlabError
        For inertial samples that cannot be used; see `timeline.checked_imu`.
    """
    t, m = np.asarray(times, float), np.asarray(field_b, float)
    samples = checked_imu(imu)
    every = max(1, round(step / float(np.median(np.diff(t))))) if len(t) > 1 else 1
    t, m = t[::every], m[::every]
    inside = (t >= samples.times[0]) & (t <= samples.times[-1]) & np.isfinite(m).all(axis=1)
    t, m = t[inside], m[inside]
    if len(t) < 2:
        return float("nan")
    none = np.zeros(3)
    moved = integrate_strapdown(samples, none, none, [1.0, 0.0, 0.0, 0.0], flat_earth(0.0), max_gap=np.inf)
    R = quaternion_to_matrix(moved.quaternion[np.searchsorted(samples.times, t)])
    expected = np.einsum("kji,kjl,kl->ki", R[1:], R[:-1], m[:-1])
    change = float(((m[1:] - m[:-1]) ** 2).sum())
    return 1 - float(((m[1:] - expected) ** 2).sum()) / change if change > 0 else float("nan")
