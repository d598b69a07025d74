"""What a sensor is to a filter: it takes a row of the run and a target on a plane to a `Prediction`.

Beside its derivatives with respect to the target (north, east, and velocity where it is seen) a prediction
has those with respect to named errors, which a filter may consider. A target that a sensor cannot see has a
prediction of NaN, and a filter leaves the measurement out. Rows of several sensors are `merge`d into one run.

A track may be too uncertain for a linearisation, H 3.4.2. The extended filter takes a measurement for a plane
over the region where the target may be. With the second derivatives ``D_i`` of its elements, an error ``e``
of the position leaves out ``e' D_i e / 2``. For a normal ``e`` with covariance P these have the second
moments

``B_ij = (tr(D_i P) tr(D_j P) + 2 tr(D_i P D_j P)) / 4``.

Of a position that is far less certain than one measurement makes it, the filter takes over the measurement,
and what was left out with it: its posterior has the measurement's noise N and lacks B. Where B is larger than
N in some direction, the error that is not reported is larger than the one that is, and a new start on the
measurement is nearer to the truth than the update.

A camera at the distance d, with the focal length f in pixels and its axis off the plumb line by a, leaves out
about ``f s^2 sin(a) / d^2`` for a standard deviation s of the position: with a noise of n pixels the bound is
``s = d sqrt(n / (f sin(a)))``, near the geometric mean of the distance and what the noise is on the ground.
Straight down over level ground nothing is bent.

Derivatives are taken with respect to the target's position (north, east) and to the six errors of the pose,
in the order of `POSE`: ``dp`` in n and ``da`` in b with ``p = p_hat + dp``, ``q = q_hat * dq(da)``, ``da``
four times the modified Rodrigues parameters (H 7.15-7.17, 7.44-7.45), a rotation vector to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, distortion_jacobian, normalise, project
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, skew, wrap

#: The six errors of a pose: of the position in n (m), and about the axes of b (rad).
POSE = ("platform_north", "platform_east", "platform_down", "roll", "pitch", "heading")


class Prediction(NamedTuple):
    """Expected measurement and its derivatives; leading axes as the input's, or none where all are alike."""

    z: Array  # (..., m)
    H_position: Array  # (..., m, 2) north and east of the target; (..., m, 4) where velocity is seen too
    H_pose: Array  # (..., m, k) with respect to the sensor's named errors: the six of `POSE`, or others


def target_in_camera(position: ArrayLike, poses: CameraPoses, plane_down: ArrayLike) -> Prediction:
    """Target in c, H (6.5), (7.44), with its derivatives. (..., 2) north, east -> (..., 3), NaN nowhere.

    ``plane_down`` is the down coordinate of the target, scalar or (...).
    """
    p = np.asarray(position, float)
    R_nc, R_bc = poses.R_nc, poses.R_bc
    down = np.broadcast_to(np.asarray(plane_down, float), p.shape[:-1])[..., None]
    offset = np.concatenate([p, down], axis=-1) - poses.p_nc
    R_cn = np.swapaxes(R_nc, -1, -2)
    p_c = np.einsum("...ij,...j->...i", R_cn, offset)
    # Seen from b the target stands at R_bc p_c + lever, and b turns about its own origin: H (7.45).
    from_body = np.einsum("...ij,...j->...i", R_bc, p_c) + poses.lever_arm
    by_attitude = np.swapaxes(R_bc, -1, -2) @ skew(from_body)
    R_cn = np.broadcast_to(R_cn, (*p_c.shape, 3))
    return Prediction(p_c, R_cn[..., :2], np.concatenate([-R_cn, by_attitude], axis=-1))


def _through(outer: Array, z: Array, inner: Prediction) -> Prediction:
    """Chain rule: ``outer`` (..., m, k) is the derivative of ``z`` with respect to ``inner.z``."""
    return Prediction(z, outer @ inner.H_position, outer @ inner.H_pose)


def predict_pixel(position: ArrayLike, poses: CameraPoses, plane_down: ArrayLike) -> Prediction:
    """Pixel of a target, H (6.4), (7.42), distortion and skew included; behind the camera NaN.

    Derivatives H (6.7) and those of (7.45).
    """
    camera, inner = poses.camera, target_in_camera(position, poses, plane_down)
    z = np.where(inner.z[..., 2] > 0, inner.z[..., 2], np.nan)
    xy = inner.z[..., :2] / z[..., None]
    J = np.zeros((*xy.shape, 3))
    J[..., 0, 0] = J[..., 1, 1] = 1 / z
    J[..., 2] = -xy / z[..., None]
    if camera.distorts:
        J = distortion_jacobian(xy, camera.distortion) @ J
    return _through(camera.matrix[:2, :2] @ J, project(camera, inner.z), inner)


def azimuth_elevation_of_pixel(camera: Camera, uv: ArrayLike) -> Array:
    """Detected pixels as azimuth and elevation, H (6.10). (..., 2) pixels -> (..., 2) radians.

    The print's ``u`` and ``v`` count from the principal point. On it the azimuth is not defined: NaN.
    """
    x, y = np.moveaxis(normalise(camera, uv), -1, 0)
    level = np.hypot(x, y)
    level = np.where(level > 0, level, np.nan)
    return np.stack([np.arctan2(y, x) + 0 * level, np.arctan2(1.0, level)], axis=-1)


def predict_range_bearing(position: ArrayLike, platform: ArrayLike, yaw: ArrayLike) -> Prediction:
    """Range (m) and bearing (rad, clockwise from the bow) of a target, seen from a level platform.

    Parameters
    ----------
    position
        (..., 2) north, east of the target.
    platform
        (..., 2) north, east of the sensor.
    yaw
        (...) radians from north; zero where bearings are measured from north.

    Returns
    -------
    Prediction with ``H_pose`` for the same six errors as the camera's; on a level platform only north,
    east and the third attitude error (yaw) matter. NaN at zero range.
    """
    offset = np.asarray(position, float) - np.asarray(platform, float)
    north, east = np.moveaxis(offset, -1, 0)
    distance = np.hypot(north, east)
    r = np.where(distance > 0, distance, np.nan)
    H = np.stack(
        [np.stack([north / r, east / r], axis=-1), np.stack([-east / r**2, north / r**2], axis=-1)], axis=-2
    )
    pose = np.zeros((*H.shape[:-1], 6))
    pose[..., :2] = -H
    pose[..., 1, 5] = -1.0
    z = np.stack([r, wrap(np.arctan2(east, north) - np.asarray(yaw, float)) + 0 * r], axis=-1)
    return Prediction(z, H, pose)


def predict_position(position: ArrayLike, platform: ArrayLike) -> Prediction:
    """A target's position as a platform measures it: its own position plus what it sees from there.

    Parameters
    ----------
    position, platform
        (..., 2) north, east of the target and of the platform.

    Returns
    -------
    Prediction of (..., 2): with ``p = p_hat + dp`` the position is measured too far back by ``dp``; with the
    heading too small by a little, turned back about the platform by it.
    """
    p = np.asarray(position, float)
    offset = p - np.asarray(platform, float)
    pose = np.zeros((*offset.shape, 6))
    pose[..., 0, 0] = pose[..., 1, 1] = -1.0
    pose[..., 0, 5], pose[..., 1, 5] = offset[..., 1], -offset[..., 0]
    return Prediction(p, np.broadcast_to(np.eye(2), (*p.shape, 2)), pose)


#: Of the distance over which derivatives are compared, m: small beside any distance to a target, and large
#: beside what rounding does to coordinates of kilometres.
STEP_M = 0.01


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
    considers
        (k,) the errors that ``H_pose`` has derivatives for, by name.
    sizes, row_angles
        (N,) and (N, m): where rows measure different things, how many of the m elements each has, which come
        first, and which of them are angles. None: all rows alike. See `wildlab.tracking.sensors`.
    """

    predict: Callable[[int, Array], Prediction]
    angles: tuple[bool, ...]
    rows: int | None = None
    states: int = 2
    considers: tuple[str, ...] = POSE
    sizes: NDArray[np.int64] | None = None
    row_angles: NDArray[np.bool_] | None = None


def angles_at(sensor: Sensor, row: int) -> tuple[bool, ...]:
    """Which elements of a row's measurement are angles."""
    return sensor.angles if sensor.row_angles is None else tuple(map(bool, sensor.row_angles[row]))


def difference(z: ArrayLike, predicted: ArrayLike, angles: tuple[bool, ...]) -> Array:
    """Innovation (..., m): measurement minus prediction, angles wrapped (H 6.11)."""
    gap = np.asarray(np.asarray(z, float) - np.asarray(predicted, float))
    wrapped = np.asarray(angles, bool)
    if wrapped.any():
        gap[..., wrapped] = wrap(gap[..., wrapped])
    return gap


def on_state(H_position: Array, n: int) -> Array:
    """Derivative with respect to all ``n`` states: zeros behind those that the sensor sees, H (6.7)."""
    H = np.zeros((*H_position.shape[:-1], n))
    H[..., : H_position.shape[-1]] = H_position
    return H


def row_of(values: ArrayLike, row: int, base: int) -> Array:
    """Row of (N, ...), or the one value of all rows; ``base`` is the number of axes of a single value."""
    a = np.asarray(values, float)
    return np.asarray(a[row] if a.ndim > base else a)


def positions() -> Sensor:
    """Georeferenced positions, H (6.3). They have no pose left that could be wrong.

    Returns
    -------
    Sensor
        Of (2,) north and east, m in n; for any number of rows.
    """

    def predict(row: int, position: Array) -> Prediction:
        return Prediction(np.array(position, float), np.eye(2), np.zeros((2, 6)))

    return Sensor(predict, (False, False))


def pixels(poses: CameraPoses, plane_down: ArrayLike) -> Sensor:
    """Pixels (u, v) of a target on a horizontal plane, H (6.4).

    Parameters
    ----------
    poses
        Of the camera, one for each of N rows, or one for all.
    plane_down
        Down coordinate in n of the plane that the target is on, m: a scalar, or (N,).

    Returns
    -------
    Sensor
        Of (2,) pixels, NaN for a target that is not in front of the camera; for N rows, or for any number
        where pose and plane are the same for all.

    Raises
    ------
    WildlabError
        Where there is another number of planes than of poses.
    """
    planes = np.shape(plane_down)
    if planes:
        poses.require_rows(planes, "plane_down")
    rows = poses.rows or planes

    def predict(row: int, position: Array) -> Prediction:
        return predict_pixel(position, poses.take(row), row_of(plane_down, row, 0))

    return Sensor(predict, (False, False), rows[0] if rows else None)


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
    measurements: Array  # (N, K, m); NaN behind the elements that a row has
    R: Array  # (N, K, m, m)
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
        Each made for its own rows only, in their order, or for any number.
    which
        (N,) index of the sensor of each row.

    Returns
    -------
    Sensor
        For N rows, with the errors of all; derivatives for those that a row's sensor does not have are zero.

    Raises
    ------
    WildlabError
        For a sensor of another number of rows.
    """
    kinds = np.asarray(which, np.int64)
    own_row = np.zeros(len(kinds), np.int64)
    for i, sensor in enumerate(sensors):
        mine = np.flatnonzero(kinds == i)
        own_row[mine] = np.arange(len(mine))
        if sensor.rows not in (None, len(mine)):
            raise WildlabError(
                f"sensor {i} is made for {sensor.rows} rows, and has {len(mine)}", "make it for its own rows",
                field="sensors",
            )  # fmt: skip
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

    return Sensor(
        predict, tuple(bool(one.any()) for one in angles.T), len(kinds), states, considers=names,
        sizes=sizes[kinds], row_angles=angles[kinds],
    )  # fmt: skip


def merge(parts: Sequence[SensorMeasurements]) -> Merged:
    """What several sensors measured, in one order of time; at equal times in the order of the sensors.

    Parameters
    ----------
    parts
        Of each sensor; of one alone the sensor stays as it is.

    Returns
    -------
    Merged
        Measurements with their noise, and the combined sensor for them.

    Raises
    ------
    WildlabError
        For shapes that do not fit each other, and as `combined`.
    """
    times = [np.asarray(one.times, float) for one in parts]
    values = [np.asarray(one.measurements, float) for one in parts]
    values = [z[:, None] if z.ndim == 2 else z for z in values]
    shape = tuple(max(z.shape[axis] for z in values) for axis in (1, 2))
    padded = []
    for i, (t, z, one) in enumerate(zip(times, values, parts, strict=True)):
        R = np.asarray(one.R, float)
        if len(z) != len(t) or z.shape[2] != len(one.sensor.angles):
            raise WildlabError(
                f"{t.shape} times and {z.shape} measurements of sensor {i}",
                f"give (N,) and (N, {len(one.sensor.angles)}), or (N, K, {len(one.sensor.angles)})",
                field="parts",
            )
        _, k, size = z.shape
        z_all, R_all = np.full((len(z), *shape), np.nan), np.full((len(z), *shape, shape[1]), np.nan)
        z_all[:, :k, :size], R_all[:, :k, :size, :size] = z, R[:, None] if R.ndim == 3 else R
        padded.append((z_all, R_all))
    which = np.repeat(np.arange(len(parts)), [len(t) for t in times])
    rows = np.concatenate([np.arange(len(t)) for t in times])
    order = np.argsort(np.concatenate(times), kind="stable")
    z, R = (np.concatenate(one)[order] for one in zip(*padded, strict=True))
    which, rows = which[order], rows[order]
    own = [_of_rows(one.sensor, rows[which == i]) for i, one in enumerate(parts)]
    sensor = combined(own, which) if len(own) > 1 else own[0]
    return Merged(np.concatenate(times)[order], z, R, sensor, which, rows)


def head(merged: Merged, count: int) -> Merged:
    """The first rows, so many."""
    sensor = merged.sensor
    part = sensor._replace(
        rows=count,
        sizes=None if sensor.sizes is None else sensor.sizes[:count],
        row_angles=None if sensor.row_angles is None else sensor.row_angles[:count],
    )
    times, z, R, _, which, own = merged
    return Merged(times[:count], z[:count], R[:count], part, which[:count], own[:count])


def _of_rows(sensor: Sensor, rows: NDArray[np.int64]) -> Sensor:
    """The sensor with its rows in another order, which they take when their times were not in order."""
    if sensor.rows is None:
        return sensor
    return sensor._replace(predict=lambda row, state: sensor.predict(int(rows[row]), state), rows=len(rows))


def second_derivatives(sensor: Sensor, row: int, state: ArrayLike) -> Array:
    """Second derivatives of what a sensor should see, by differences of its first.

    Parameters
    ----------
    sensor
        Any.
    row
        Of the run.
    state
        (n,) north, east, m, and velocity where the sensor sees it.

    Returns
    -------
    (m, 2, 2)
        With respect to north and east, in the sensor's units over m^2; NaN where the target is not seen.
    """
    at = np.asarray(state, float)
    columns = []
    for axis in range(2):
        step = np.zeros_like(at)
        step[axis] = STEP_M
        ahead, behind = (
            sensor.predict(row, (at + sign * step)[: sensor.states]).H_position[..., :2] for sign in (1, -1)
        )
        columns.append((ahead - behind) / (2 * STEP_M))
    D = np.stack(columns, axis=-1)
    return np.asarray((D + np.swapaxes(D, -1, -2)) / 2)


def left_out(P: ArrayLike, D: ArrayLike) -> Array:
    """Second moments (m, m) of what a linearisation leaves out: B of the module.

    Parameters
    ----------
    P
        (..., 2, 2) m^2, of the position.
    D
        (..., m, 2, 2) from `second_derivatives`.

    Returns
    -------
    (..., m, m), in the measurement's units squared.

    Examples
    --------
    >>> left_out(np.eye(2), [[[0.0, 0.0], [0.0, 2.0]]]).tolist()
    [[3.0]]
    """
    bent = np.asarray(D, float) @ np.asarray(P, float)[..., None, :, :]
    traces = np.trace(bent, axis1=-2, axis2=-1)
    both = traces[..., :, None] * traces[..., None, :]
    return np.asarray((both + 2 * np.einsum("...iab,...jba->...ij", bent, bent)) / 4)


def share_left_out(P: ArrayLike, D: ArrayLike, noise: ArrayLike) -> float:
    """What a linearisation leaves out over what a measurement is uncertain by.

    Parameters
    ----------
    P
        (2, 2) m^2, of the position.
    D
        (m, 2, 2) from `second_derivatives`.
    noise
        (m, m): all that a measurement may be wrong by, N of the module.

    Returns
    -------
    float
        The largest of the variances' ratio over all directions. Above one the track is too uncertain; NaN
        where that cannot be said.
    """
    B, N = left_out(P, D), np.asarray(noise, float)
    if not (np.isfinite(B).all() and np.isfinite(N).all()):
        return float("nan")
    return float(np.linalg.eigvals(np.linalg.solve(N, B)).real.max())
