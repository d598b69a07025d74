"""What a sensor is to a filter: it takes a row of the run and a target to a `Prediction`.


Beside its derivatives with respect to the target (north, east; the sensors of H 6.7 see no velocity, but
`positions_or_velocities` does) a prediction has those with respect to named errors, which a filter may
consider: the six of `wildlab.tracking.predictions.POSE` from the sensors here, any number from
`wildlab.tracking.considering`.

A target that a sensor cannot see has a prediction of NaN, and a filter leaves the measurement out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, wrap
from wildlab.tracking.predictions import POSE, Prediction

#: Row and measurement -> where a ray starts and where it goes, (3,) and (3,) in n.
Ray = Callable[[int, Array], tuple[Array, Array]]
#: Row and measurement -> the position (2,) that it speaks of.
Locate = Callable[[int, Array], Array]


class Sensor(NamedTuple):
    """A sensor on its way: ``predict(row, positions)`` of targets at (..., 2) north, east, at a row of a run.

    Attributes
    ----------
    predict
        Row and (..., 2) positions, or (..., 4) where ``states`` says so, to a `Prediction`.
    angles
        (m,) which elements are angles, whose differences are wrapped.
    rows
        For how many rows it was made; None: for any number.
    states
        How many of the first states it is given: 4 are position and velocity.
    elements
        (m,) what the elements are called: the bias of one is ``"<element>_bias"``.
    considers
        (k,) the errors that ``H_pose`` has derivatives for, by name.
    ray, locate
        For a start: the ray of a measurement; the position of one. None where a measurement has none.
    sizes, row_angles
        (N,) and (N, m): where rows measure different things, how many of the m elements each has, which come
        first, and which of them are angles. None: all rows alike. See `wildlab.tracking.combined`.
    """

    predict: Callable[[int, Array], Prediction]
    angles: tuple[bool, ...]
    rows: int | None = None
    states: int = 2
    elements: tuple[str, ...] = ()
    considers: tuple[str, ...] = POSE
    ray: Ray | None = None
    locate: Locate | None = None
    sizes: NDArray[np.int64] | None = None
    row_angles: NDArray[np.bool_] | None = None


def angles_at(sensor: Sensor, row: int) -> tuple[bool, ...]:
    """Which elements of a row's measurement are angles."""
    return sensor.angles if sensor.row_angles is None else tuple(map(bool, sensor.row_angles[row]))


def difference(z: ArrayLike, predicted: ArrayLike, angles: tuple[bool, ...]) -> Array:
    """Innovation (..., m): measurement minus prediction, angles wrapped (H 6.11)."""
    gap = np.asarray(z, float) - np.asarray(predicted, float)
    return np.where(np.asarray(angles), wrap(gap), gap)


def on_state(H_position: Array, n: int) -> Array:
    """Derivative with respect to all ``n`` states: zeros behind those that the sensor sees, H (6.7)."""
    H = np.zeros((*H_position.shape[:-1], n))
    H[..., : H_position.shape[-1]] = H_position
    return H


def check_states(sensor: Sensor, n: int) -> None:
    """Refuse a sensor that sees more than the ``n`` states of a motion model."""
    if sensor.states > n:
        raise WildlabError(
            f"a sensor of {sensor.states} states for a motion model of {n}",
            "use a model with velocity, as constant_velocity",
            field="sensor",
        )


def row_of(values: ArrayLike, row: int, base: int) -> Array:
    """Row of (N, ...), or the one value of all rows; ``base`` is the number of axes of a single value."""
    a = np.asarray(values, float)
    return np.asarray(a[row] if a.ndim > base else a)
