"""The magnetic field as a direction: beyond H, whose second vector is the baseline between two antennas."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

#: Largest standard deviation of a centre, over the radius: a heading by it is then good to some two degrees.
SURE = 0.03
#: Samples that are wrong in the same way, motor currents change no faster: what they count as one.
CORRELATED = 50


def hard_iron(field_b: ArrayLike) -> Array:
    """The part of the field that turns with the airframe (3,), in the unit of ``field_b`` (N, 3).

    The Earth's field has one length, so measurements lie on a sphere around it: its centre by linear least
    squares. Rows with NaN are left out.

    Raises
    ------
    WildlabError
        Where the measurements cover too little of a sphere to say where its centre is.
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
    """Direction of the Earth's field in n, (3,): turned from north towards east, then down (rad)."""
    level = np.cos(inclination)
    return np.array([level * np.cos(declination), level * np.sin(declination), np.sin(inclination)])
