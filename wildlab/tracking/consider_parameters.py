"""Errors that a filter considers and does not estimate, H 7.4: by name, and as many as there are.

The thesis considers the six errors of a camera's pose. A heading, a bias of the range, a clock or a focal
length are no different: what a filter needs of each is its standard deviation, how long it lasts, and how the
measurement depends on it. The names:

``platform_north``, ``platform_east``, ``platform_down``
    m, of the platform's position in n.
``roll``, ``pitch``, ``heading``
    rad, of its attitude about the axes of b, or those that the sensor's derivatives are for. ``attitude`` is
    all three, ``tilt`` the first two.
``<element>_bias``
    Of what a sensor measures, in the element's own unit: ``range_bias``, ``bearing_bias``, ``u_bias``.
``clock``
    s, what the measurement's stamp is too early by.
``focal``
    No unit: the true focal length is the calibrated one times one plus the error.

An error is what is to be added to the known value for the true one. It fades as a first-order process of its
own correlation time, whose variance stays what the covariance says: ``C -> C M'``, with ``M`` diagonal in
errors that are not correlated. Where errors of different correlation times are correlated a diagonal ``M``
could leave no covariance. There ``M = A D A^-1`` with the symmetric root ``A`` of their covariance, which
shrinks every direction and leaves one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import check_covariance
from wildlab.geometry.frames import Array
from wildlab.tracking import schmidt
from wildlab.tracking.schmidt import Change, PoseUncertainty
from wildlab.tracking.sensors import POSE, Sensor

#: One name for several.
TOGETHER = {"attitude": POSE[3:], "tilt": POSE[3:5], "platform_position": POSE[:3]}


class Considered(NamedTuple):
    """Named errors with what is known of them, for `run_filter` and the other filters.

    Attributes
    ----------
    names
        (k,) of the errors, see `wildlab.tracking.schmidt`.
    covariance
        (N, k, k) at each of N measurements, or (k, k) for all; units of the errors squared.
    correlation_time
        s over which each fades, (k,) or one for all. Infinity is H's constant bias, zero H (7.40)-(7.41).
    change
        What an error does when its covariance changes, see `wildlab.tracking.schmidt`.
    shared
        (k,) whether targets of the same sensor have the error in common. A filter follows one target and does
        not look at it; who compares or joins targets does.
    """

    names: tuple[str, ...]
    covariance: Array
    correlation_time: float | tuple[float, ...] = np.inf
    change: Change = "bias"
    shared: tuple[bool, ...] = ()


#: What a filter takes as ``pose``: the six errors of a pose, or any.
Considers = PoseUncertainty | Considered


def consider_all(*several: Considers) -> Considered:
    """Several sets of errors as one, those of one uncorrelated with those of another.

    Parameters
    ----------
    several
        Errors of different names: a pose's with its covariance from the navigation filter, and others beside.

    Returns
    -------
    Considered
        With the change rule of the first.

    Raises
    ------
    WildlabError
        Where a name comes twice, numbers of rows differ, or there is nothing.
    """
    parts = [as_considered(one) for one in several]
    names = tuple(name for one in parts for name in one.names)
    twice = sorted({name for name in names if names.count(name) > 1})
    lengths = {len(one.covariance) for one in parts if np.ndim(one.covariance) == 3}
    if not parts or twice or len(lengths) > 1:
        raise WildlabError(
            f"{', '.join(twice)} twice" if twice else f"rows of {sorted(lengths)} and {len(parts)} sets",
            "give each error once, with as many rows as the others", field="considered",
        )  # fmt: skip
    k = len(names)
    covariance = np.zeros((*((lengths.pop(),) if lengths else ()), k, k))
    first = 0
    for one in parts:
        last = first + len(one.names)
        covariance[..., first:last, first:last] = one.covariance
        first = last
    times = tuple(float(time) for one in parts for time in _times(one))
    shared = tuple(flag for one in parts for flag in (one.shared or (True,) * len(one.names)))
    return Considered(names, covariance, times, parts[0].change, shared)


def as_considered(pose: Considers) -> Considered:
    """The six errors of a pose as named ones; others as they are."""
    if isinstance(pose, Considered):
        return pose
    return Considered(POSE, np.asarray(pose.covariance, float), pose.correlation_time, pose.change)


def _times(considered: Considered) -> Array:
    return np.broadcast_to(np.asarray(considered.correlation_time, float), (len(considered.names),))


class Errors(NamedTuple):
    """Considered errors as a filter of N rows works with them."""

    covariance: Array  # (N, k, k), NaN where it is not known
    phi: Array  # (N, k, k) from the row known before, see `schmidt.transitions_of_pose`
    times: Array  # (k,) or (), correlation times
    columns: list[int] | None  # of ``H_pose``; None: all, in order
    whitened: bool  # whether errors of different correlation times are correlated

    @property
    def k(self) -> int:
        """How many there are."""
        return int(self.covariance.shape[-1])

    def of(self, H_pose: Array) -> Array:
        """The columns of ``H_pose`` (m, any) that are considered, (m, k)."""
        return H_pose if self.columns is None else H_pose[..., self.columns]

    def carry(self, C: Array, F: Array, row: int, dt: float) -> Array:
        """Cross-covariance (n, k) taken to a row, ``F C Psi'``."""
        if self.times.ndim == 0:
            return np.asarray(F @ C @ self.phi[row].T * schmidt.fade(dt, float(self.times)))
        return np.asarray(F @ C @ self.phi[row].T @ self.left(row, dt).T)

    def left(self, row: int, dt: float) -> Array:
        """``M`` (k, k), see the module: what is left of the errors after ``dt`` seconds."""
        faded = np.diag([schmidt.fade(dt, float(time)) for time in np.broadcast_to(self.times, self.k)])
        P = self.covariance[row]
        if not self.whitened or not np.isfinite(P).all():
            return faded
        sd = np.sqrt(np.maximum(np.diag(P), 0))
        unit = np.divide(1, sd, out=np.zeros_like(sd), where=sd > 0)
        values, vectors = np.linalg.eigh(P * np.outer(unit, unit))
        there = values > schmidt.NEGLIGIBLE * max(float(values[-1]), schmidt.NEGLIGIBLE)
        root = np.sqrt(np.where(there, values, 0))
        inverse = np.divide(1, root, out=np.zeros_like(root), where=there)
        A, back = (vectors * root) @ vectors.T, (vectors * inverse) @ vectors.T
        return np.asarray((sd[:, None] * A) @ faded @ (back * unit))

    def transition(self, row: int, dt: float) -> Array:
        """``Psi`` (k, k) of the errors themselves, from the row before."""
        return np.asarray(self.left(row, dt) @ self.phi[row])


def errors_of(pose: Considers | None, sensor: Sensor, n_rows: int) -> Errors | None:
    """Considered errors ready for a filter, or None.

    Raises
    ------
    WildlabError
        For a covariance of another shape, or that is none; a correlation time below zero; or an error that
        the sensor's prediction has no derivative for.
    """
    if pose is None:
        return None
    given = as_considered(pose)
    k, P = len(given.names), np.asarray(given.covariance, float)
    if isinstance(pose, Considered) and P.shape == (k, k):
        P = np.tile(P, (n_rows, 1, 1))
    by_name = set(given.names) <= set(sensor.considers)
    if not by_name and isinstance(pose, PoseUncertainty) and P.shape[1:] == (len(sensor.considers),) * 2:
        by_name, given, k = True, given._replace(names=sensor.considers), len(sensor.considers)
    if P.shape != (n_rows, k, k):
        raise WildlabError(
            f"shape {P.shape} for {n_rows} rows of measurements",
            f"give one ({k}, {k}) covariance for each measurement", field="pose.covariance",
        )  # fmt: skip
    if not by_name:
        unknown = [name for name in given.names if name not in sensor.considers]
        raise WildlabError(
            f"what is measured has no derivative for {', '.join(unknown)}",
            f"consider some of {', '.join(sensor.considers)}, or add columns with `considering`",
            field="pose.names",
        )
    times = np.asarray(given.correlation_time, float)
    if times.shape not in ((), (k,)) or not (times >= 0).all():
        raise WildlabError(
            f"correlation times {given.correlation_time} for {k} errors",
            "give seconds that are not negative, one or one for each", field="pose.correlation_time",
        )  # fmt: skip
    if isinstance(pose, Considered):
        check_covariance(P[np.isfinite(P).all(axis=(1, 2))], "pose.covariance")
    columns = [sensor.considers.index(name) for name in given.names]
    all_in_order = columns == list(range(len(sensor.considers)))
    phi = schmidt.transitions_of_pose(P, given.change)
    if times.ndim and (times == times[0]).all():
        times = times[0]
    apart: NDArray[np.bool_] = np.broadcast_to(times, k)[:, None] != np.broadcast_to(times, k)
    whitened = bool((np.nan_to_num(P)[:, apart] != 0).any())
    return Errors(P, phi, times, None if all_in_order else columns, whitened)
