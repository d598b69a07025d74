"""Several sensors into one track: rows of different kinds, each with its own number of elements and noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.predictions import Prediction
from wildlab.tracking.sensors import Sensor, on_state


class SensorMeasurements(NamedTuple):
    """What one sensor measured.

    Attributes
    ----------
    times
        (N,) s, in order.
    measurements
        (N, m), or (N, K, m) with up to K detections in a frame; NaN where there are fewer.
    R
        (m, m), (N, m, m) or (N, K, m, m).
    sensor
        For N rows, or for any number.
    """

    times: ArrayLike
    measurements: ArrayLike
    R: ArrayLike
    sensor: Sensor


class Merged(NamedTuple):
    """Several sensors' rows in order of time, as a filter takes them; see `merge`."""

    times: Array  # (N,)
    measurements: Array  # (N, m), or (N, K, m); NaN behind the elements that a row has
    R: Array  # (N, m, m), or (N, K, m, m)
    sensor: Sensor
    which: NDArray[np.int64]  # (N,) the sensor of a row
    rows: NDArray[np.int64]  # (N,) its row there


def combined(sensors: Sequence[Sensor], which: ArrayLike) -> Sensor:
    """One sensor whose rows belong to different ones.

    Measurements for it are (N, m) with m the most elements that any of them has: a row has its own first,
    and what is behind them is not looked at, neither there nor in ``R``. The errors of the same name are the
    same for all; `renamed` makes those of one sensor its own.

    Parameters
    ----------
    sensors
        Each made for all N rows, or for its own rows only, in their order, or for any number.
    which
        (N,) index of the sensor of each row.

    Returns
    -------
    Sensor
        For N rows, with the errors of all; derivatives for those that a row's sensor does not have are zero.

    Raises
    ------
    WildlabError
        For indices that there are no sensors for, or a sensor of another number of rows.

    Examples
    --------
    A range and a bearing, then a position:

    >>> from wildlab.tracking import positions, ranges_bearings
    >>> both = combined([ranges_bearings([0.0, 0.0], 0.0), positions()], [0, 1])
    >>> [both.predict(row, np.array([0.0, 5.0])).z.round(2).tolist() for row in (0, 1)]
    [[5.0, 1.57], [0.0, 5.0]]
    """
    kinds = np.asarray(which, np.int64)
    if (
        kinds.ndim != 1
        or not len(sensors)
        or (len(kinds) and not (0 <= kinds.min() <= kinds.max() < len(sensors)))
    ):
        raise WildlabError(
            f"rows of the sensors {sorted(set(kinds.ravel().tolist()))} of {len(sensors)}",
            "give the index of a sensor for each row", field="which",
        )  # fmt: skip
    N, own_row = len(kinds), np.arange(len(kinds))
    for i, sensor in enumerate(sensors):
        mine = np.flatnonzero(kinds == i)
        if sensor.sizes is not None:
            raise WildlabError(f"sensor {i} is a combined one", "combine all at once", field="sensors")
        if sensor.rows not in (None, N, len(mine)):
            raise WildlabError(
                f"sensor {i} is made for {sensor.rows} rows, and has {len(mine)} of {N}",
                "make it for its own rows, or for all", field="sensors",
            )  # fmt: skip
        if sensor.rows is not None and sensor.rows != N:
            own_row[mine] = np.arange(len(mine))
    m = max(len(sensor.angles) for sensor in sensors)
    states = max(sensor.states for sensor in sensors)
    names = tuple(dict.fromkeys(name for sensor in sensors for name in sensor.considers))
    columns = [[names.index(name) for name in sensor.considers] for sensor in sensors]
    angles = np.array([[*sensor.angles, *[False] * (m - len(sensor.angles))] for sensor in sensors], bool)
    sizes = np.array([len(sensor.angles) for sensor in sensors], np.int64)

    def predict(row: int, state: Array) -> Prediction:
        i = kinds[row]
        seen = sensors[i].predict(int(own_row[row]), state[..., : sensors[i].states])
        size = sizes[i]
        z, H, H_pose = (np.zeros((*state.shape[:-1], m, *more)) for more in ((), (states,), (len(names),)))
        z[..., :size], H[..., :size, :] = seen.z, on_state(seen.H_position, states)
        H_pose[..., :size, columns[i]] = seen.H_pose
        return Prediction(z, H, H_pose)

    def ray(row: int, z: Array) -> tuple[Array, Array]:
        sensor: Sensor = sensors[int(kinds[row])]
        if sensor.ray is None:
            return np.full(3, np.nan), np.full(3, np.nan)
        return sensor.ray(int(own_row[row]), z[: sizes[kinds[row]]])

    def locate(row: int, z: Array) -> Array:
        sensor: Sensor = sensors[int(kinds[row])]
        if sensor.locate is None:
            return np.full(2, np.nan)
        return sensor.locate(int(own_row[row]), z[: sizes[kinds[row]]])

    return Sensor(
        predict, tuple(bool(one.any()) for one in angles.T), N, states, considers=names, ray=ray,
        locate=locate, sizes=sizes[kinds], row_angles=angles[kinds],
    )  # fmt: skip


def merge(parts: Sequence[SensorMeasurements]) -> Merged:
    """What several sensors measured, in one order of time; at equal times in the order of the sensors.

    Parameters
    ----------
    parts
        Of each sensor.

    Returns
    -------
    Merged
        Measurements with their noise, and the combined sensor for them.

    Raises
    ------
    WildlabError
        For nothing, shapes that do not fit each other, and as `combined`.
    """
    if not parts:
        raise WildlabError("no sensor", "give what one measured, or more", field="parts")
    times = [np.asarray(one.times, float) for one in parts]
    values = [np.asarray(one.measurements, float) for one in parts]
    values = [z[:, None] if z.ndim == 2 else z for z in values]
    for i, (t, z, one) in enumerate(zip(times, values, parts, strict=True)):
        if t.ndim != 1 or z.ndim != 3 or len(z) != len(t) or z.shape[2] != len(one.sensor.angles):
            raise WildlabError(
                f"{t.shape} times and {np.shape(one.measurements)} measurements of sensor {i}",
                f"give (N,) and (N, {len(one.sensor.angles)}), or (N, K, {len(one.sensor.angles)})",
                field="parts",
            )
    K, m = max(z.shape[1] for z in values), max(z.shape[2] for z in values)
    which = np.concatenate([np.full(len(t), i) for i, t in enumerate(times)])
    rows = np.concatenate([np.arange(len(t)) for t in times])
    order = np.argsort(np.concatenate(times), kind="stable")
    N = len(which)
    z_all, R_all = np.full((N, K, m), np.nan), np.full((N, K, m, m), np.nan)
    for i, (z, one) in enumerate(zip(values, parts, strict=True)):
        _, k, size = z.shape
        R = np.asarray(one.R, float)
        R = R[:, None] if R.ndim == 3 else R
        mine = which == i
        z_all[mine, :k, :size] = z
        try:
            block = np.broadcast_to(R, (len(z), k, size, size))
        except ValueError as error:
            raise WildlabError(
                f"R of the shape {np.shape(one.R)} for {z.shape} measurements of sensor {i}",
                "give (m, m), (N, m, m) or (N, K, m, m)", field="R",
            ) from error  # fmt: skip
        padded = np.full((len(z), K, m, m), np.nan)
        padded[:, :k, :size, :size] = block
        R_all[mine] = padded
    which, rows = which[order], rows[order]
    sensor = combined([_of_rows(one.sensor, rows[which == i]) for i, one in enumerate(parts)], which)
    z_all, R_all = z_all[order], R_all[order]
    if K == 1:
        z_all, R_all = z_all[:, 0], R_all[:, 0]
    return Merged(np.concatenate(times)[order], z_all, R_all, sensor, which, rows)


def _of_rows(sensor: Sensor, rows: NDArray[np.int64]) -> Sensor:
    """The sensor with its rows in another order, which they take when their times were not in order."""
    if sensor.rows is None:
        return sensor
    ray, locate = sensor.ray, sensor.locate
    return sensor._replace(
        predict=lambda row, state: sensor.predict(int(rows[row]), state),
        rows=len(rows),
        ray=None if ray is None else lambda row, z: ray(int(rows[row]), z),
        locate=None if locate is None else lambda row, z: locate(int(rows[row]), z),
    )
