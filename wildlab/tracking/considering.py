"""Sensors whose predictions have derivatives for more errors than those of a pose."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array
from wildlab.tracking.consider_parameters import TOGETHER
from wildlab.tracking.predictions import POSE, Prediction
from wildlab.tracking.sensors import Sensor, row_of


def considering(
    sensor: Sensor,
    names: Collection[str],
    *,
    moves: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    camera: Camera | None = None,
) -> Sensor:
    """The same sensor with derivatives for these errors, in this order.

    Parameters
    ----------
    sensor
        From `wildlab.tracking.measurement` or `wildlab.tracking.platforms`.
    names
        Errors that the sensor knows; and ``clock``, ``focal``, or a bias of one of its elements.
    moves
        For the clock: how the platform's pose changes, (N, 2) or (N, 3) its velocity in n, m/s, or (N, 6)
        with its angular rates about the axes of b behind, rad/s; or one for all rows. None: it does not.
    velocity
        For the clock: (N, 2) of the target in n, m/s, or (2,). None: the filter's own, for motion models
        with velocity.
    camera
        For the focal length, of a sensor that measures pixels.

    Returns
    -------
    Sensor
        Its ``H_pose`` has the columns ``names``.

    Raises
    ------
    WildlabError
        For a name that cannot be had from this sensor, or rows of another number than the sensor's.

    Examples
    --------
    >>> from wildlab.tracking import ranges_bearings
    >>> sensor = considering(ranges_bearings([0.0, 0.0], 0.0), ("heading", "range_bias"))
    >>> sensor.predict(0, np.array([30.0, 40.0])).H_pose.tolist()
    [[0.0, 1.0], [-1.0, 0.0]]
    """
    wanted = tuple(one for name in names for one in TOGETHER.get(name, (name,)))
    biases = {f"{element}_bias": i for i, element in enumerate(sensor.elements)}
    lens = (camera is not None and sensor.elements == ("u", "v")) or sensor.elements == (
        "azimuth",
        "elevation",
    )
    extra = {*biases, "clock", *(["focal"] if lens else [])} - set(sensor.considers)
    for name in wanted:
        if name not in sensor.considers and name not in extra:
            raise WildlabError(
                f"a sensor of {' and '.join(sensor.elements) or 'something else'} has no {name}",
                f"take from {', '.join([*sensor.considers, *sorted(extra)])}", field="names",
            )  # fmt: skip
    gone, own = (None if a is None else np.asarray(a, float) for a in (moves, velocity))
    for field, rows in (("moves", gone), ("velocity", own)):
        if rows is not None and rows.ndim == 2 and sensor.rows not in (None, len(rows)):
            raise WildlabError(
                f"{len(rows)} rows for a sensor of {sensor.rows}", "give one for each row", field=field
            )
    by_state = "clock" in wanted and "clock" not in sensor.considers and own is None

    def predict(row: int, state: Array) -> Prediction:
        seen = sensor.predict(row, state[..., : sensor.states])
        columns = []
        for name in wanted:
            if name in sensor.considers:
                columns.append(seen.H_pose[..., sensor.considers.index(name)])
            elif name in biases:
                columns.append(np.eye(len(sensor.elements))[biases[name]])
            elif name == "focal":
                columns.append(_by_focal(seen.z, camera))
            else:
                v = state[..., 2:4] if own is None else row_of(own, row, 1)
                columns.append(_by_clock(seen, sensor, v, None if gone is None else row_of(gone, row, 1)))
        return seen._replace(H_pose=np.stack(np.broadcast_arrays(*columns), axis=-1))

    known_rows = [len(a) for a in (gone, own) if a is not None and a.ndim == 2]
    return sensor._replace(
        predict=predict,
        considers=wanted,
        states=max(sensor.states, 4) if by_state else sensor.states,
        rows=sensor.rows if sensor.rows is not None or not known_rows else known_rows[0],
    )


def _by_clock(seen: Prediction, sensor: Sensor, velocity: Array, moves: Array | None) -> Array:
    """(..., m) derivative for a stamp that is too early: target and platform have gone on."""
    at = np.asarray(np.einsum("...ij,...j->...i", seen.H_position[..., :2], velocity))
    if moves is not None:
        place = POSE[: len(moves)]
        for name, rate in zip(place, moves, strict=True):
            if name in sensor.considers:
                at = at + seen.H_pose[..., sensor.considers.index(name)] * rate
    return at


def _by_focal(z: Array, camera: Camera | None) -> Array:
    """(..., m) derivative for the relative error of the focal length: pixels move out, elevations down."""
    if camera is not None:
        return np.asarray(z - np.array([camera.cx, camera.cy]))
    return np.stack([np.zeros(z.shape[:-1]), -np.sin(z[..., 1]) * np.cos(z[..., 1])], axis=-1)


def renamed(sensor: Sensor, names: Mapping[str, str]) -> Sensor:
    """The same sensor with other names for some errors, which are then its own and not another sensor's.

    Parameters
    ----------
    sensor
        Any.
    names
        From the old name to the new.

    Returns
    -------
    Sensor
    """
    return sensor._replace(considers=tuple(names.get(one, one) for one in sensor.considers))
