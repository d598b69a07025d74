"""Interacting multiple models, H 3.2.3: each kind of hull goes lively or calm, and changes now and then.

Inside of the tracker a kind of hull with two motions is two columns, side by side, which share their hull.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wildlab.tracking.many.target_model import Hull, ManySensorModel, ManyTargetModel

Array = NDArray[np.float64]


def densities_of(targets: ManyTargetModel) -> tuple[float, ...]:
    """Of each of the M motions: the usual one and, where there is one, the calm one."""
    return (targets.density,) if targets.calm >= 1 else (targets.density, targets.calm * targets.density)


def each_motion(
    sensors: Sequence[ManySensorModel], targets: ManyTargetModel
) -> tuple[tuple[ManySensorModel, ...], ManyTargetModel]:
    """The same with a column for each motion of each hull."""
    count = len(densities_of(targets))
    if count == 1:
        return tuple(sensors), targets

    def twice(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(value for value in values for _ in range(count))

    eyes = tuple(
        one._replace(
            rough_m=twice(one.rough_m),
            along_m=twice(one.along_m),
            near_side_m=twice(one.near_side_m),
            near_end_m=twice(one.near_end_m),
        )
        for one in sensors
    )
    hulls = tuple(hull._replace(share=hull.share / count) for hull in targets.hulls for _ in range(count))
    return eyes, targets._replace(hulls=hulls)


def of_hulls(kinds: Array, targets: ManyTargetModel) -> Array:
    """(T, K) of columns as (T, H) of hulls."""
    count = len(densities_of(targets))
    return np.asarray(kinds.reshape(len(kinds), kinds.shape[1] // count, count).sum(axis=-1))


def largest_of(hulls: tuple[Hull, ...]) -> NDArray[np.bool_]:
    """(K,) which columns are of the largest kind of hull."""
    largest = max(hulls, key=lambda hull: hull.length_m)
    return np.array([hull == largest for hull in hulls], bool)


def at_least(kinds: Array, least: float, targets: ManyTargetModel) -> Array:
    """(T, K) with no hull less probable than that, beside another; sums may exceed one."""
    count = len(densities_of(targets))
    parts = kinds.reshape(len(kinds), kinds.shape[1] // count, count)
    hulls = parts.sum(axis=-1, keepdims=True)
    if hulls.shape[1] < 2:
        return kinds
    within = np.divide(parts, hulls, out=np.full_like(parts, 1 / count), where=hulls > 0)
    return np.asarray((np.maximum(hulls, least) * within).reshape(kinds.shape))


def interact(
    x: Array, P: Array, C: Array, kinds: Array, dt: float, stay_s: float
) -> tuple[Array, Array, Array, Array]:
    """Both motions of each hull mixed, by how many targets change from one to the other within ``dt`` s.

    Parameters
    ----------
    x, P, C, kinds
        (T, K, 4), (T, K, 4, 4), (T, K, 4, k) and (T, K) of `wildlab.tracking.many.tracks.Tracks`, with two
        columns for each hull.
    stay_s
        For how long each lasts, in the mean.

    Returns
    -------
    The same after mixing.
    """
    stays = (1 + np.exp(-2 * dt / stay_s)) / 2
    change = np.array([[stays, 1 - stays], [1 - stays, stays]])
    T, K = kinds.shape

    def by_hull(values: Array) -> Array:
        return values.reshape(T, K // 2, 2, *values.shape[2:])

    joint = change * by_hull(kinds)[..., None]
    after = joint.sum(axis=2)
    share = np.divide(joint, after[:, :, None], out=np.zeros_like(joint), where=after[:, :, None] > 0)
    x, P, C = by_hull(x), by_hull(P), by_hull(C)
    mean = np.einsum("thij,this->thjs", share, x)
    off = x[:, :, :, None] - mean[:, :, None]
    P = np.einsum("thij,thisr->thjsr", share, P) + np.einsum("thij,thijs,thijr->thjsr", share, off, off)
    C = np.einsum("thij,thisk->thjsk", share, C)
    return mean.reshape(T, K, 4), P.reshape(T, K, 4, 4), C.reshape(T, K, *C.shape[3:]), after.reshape(T, K)
