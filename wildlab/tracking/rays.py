"""Where rays meet: a place from directions alone, without a plane that it lies on (H 6.3.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, skew
from wildlab.tracking.consider_parameters import Considered
from wildlab.tracking.predictions import POSE

#: rad. Rays that cross at less are near parallel: an error of them is some ten times as long along them.
LEAST_CROSSING = float(np.radians(5.0))
STEPS, STILL = 50, 1e-6


class Crossing(NamedTuple):
    """Where rays meet.

    Attributes
    ----------
    position, covariance
        (d,) m in n, and (d, d), d = 2 or 3.
    cross
        (d, k) cross-covariance of the position's error (truth minus estimate) with the considered errors.
    angle
        rad, the largest between any two rays.
    misfit
        Sum of squares of the angles left over, in standard deviations: chi-square with (d - 1) r - d degrees
        of freedom, for r rays of one target at rest.
    """

    position: Array
    covariance: Array
    cross: Array
    angle: float
    misfit: float


def intersect_rays(
    origins: ArrayLike,
    directions: ArrayLike,
    sd: ArrayLike,
    *,
    pose: Considered | None = None,
    R_nb: ArrayLike | None = None,
    least_crossing: float = LEAST_CROSSING,
) -> Crossing:
    """The most likely place of a target at rest, from the rays of a moving platform.

    Parameters
    ----------
    origins
        (r, 2) or (r, 3) where each ray starts, m in n.
    directions
        Likewise, of any length; in the plane for two coordinates, as azimuths give them.
    sd
        Of each ray's direction, about each axis across it, rad: a number, or (r,).
    pose
        Errors that all rays have in common, constant while they are taken, with one covariance (k, k):
        ``platform_north``, ``platform_east``, ``platform_down``, ``heading``, ``roll``, ``pitch``.
    R_nb
        (r, 3, 3) attitudes of the frame b about whose axes roll, pitch and heading err; None: those of n.
    least_crossing
        rad, at which rays are far enough from parallel.

    Returns
    -------
    Crossing

    Raises
    ------
    WildlabError
        For fewer than two rays, rays that are near parallel, or meet behind where they start; shapes that do
        not fit each other; an error that rays do not know.

    Examples
    --------
    >>> found = intersect_rays([[0.0, 0.0], [0.0, 100.0]], [[1.0, 0.5], [1.0, -0.5]], 0.01)
    >>> found.position.round(6).tolist()
    [100.0, 50.0]
    """
    o, d = np.asarray(origins, float), np.asarray(directions, float)
    if o.ndim != 2 or o.shape != d.shape or o.shape[1] not in (2, 3):
        raise WildlabError(
            f"origins of the shape {o.shape} and directions {d.shape}", "give (r, 2) or (r, 3) of both",
            field="directions",
        )  # fmt: skip
    there = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & (np.abs(d).sum(axis=1) > 0)
    o, d = o[there], d[there]
    size = o.shape[1]
    widest = largest_angle(d)
    if widest < least_crossing:
        raise near_parallel(len(o), widest, least_crossing)
    unit = d / np.linalg.norm(d, axis=1, keepdims=True)
    weight = 1 / np.broadcast_to(np.asarray(sd, float), there.shape)[there]
    across = _across(unit)
    p = meeting_point(o, d)
    for _ in range(STEPS):
        residual, J = _angles(p, o, unit, across)
        Jw = (J * weight[:, None, None]).reshape(-1, size)
        covariance = np.linalg.inv(Jw.T @ Jw)
        step = covariance @ Jw.T @ -(residual * weight[:, None]).ravel()
        p = p + step
        if (np.abs(step) <= STILL * np.sqrt(np.diag(covariance))).all():
            break
    residual, J = _angles(p, o, unit, across)
    if not (np.einsum("ri,ri->r", p - o, unit) > 0).all():
        raise WildlabError(
            f"{len(o)} rays meet behind where some of them start",
            "check that they are of one target, and the attitudes", field="rays",
        )  # fmt: skip
    Jw = (J * weight[:, None, None]).reshape(-1, size)
    covariance = np.linalg.inv(Jw.T @ Jw)
    left = float(np.sum((residual * weight[:, None]) ** 2))
    cross = np.zeros((size, 0))
    if pose is not None:
        turns = None if R_nb is None else np.asarray(R_nb, float)
        if turns is not None and turns.ndim == 3:
            turns = turns[there]
        J_o = _by_errors(pose, p, o, J, across, turns)
        J_ow = (J_o * weight[:, None, None]).reshape(-1, J_o.shape[2])
        # What is expected moves by J dp + J_o do: the fit takes the second for the first.
        A = -covariance @ Jw.T @ J_ow
        cross = A @ np.asarray(pose.covariance, float)
        covariance = covariance + cross @ A.T
    return Crossing(p, (covariance + covariance.T) / 2, cross, widest, left)


def meeting_point(origins: Array, directions: Array) -> Array:
    """The point with the least squares of distances (m) from all lines, (d,)."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    away = np.eye(origins.shape[1]) - unit[:, :, None] * unit[:, None, :]
    return np.asarray(np.linalg.solve(away.sum(axis=0), np.einsum("rij,rj->i", away, origins)))


def largest_angle(directions: Array) -> float:
    """Largest angle (rad) between the lines of directions (r, d), seen from the two that are far apart."""
    if len(directions) < 2:
        return 0.0
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    cosine = np.abs(unit @ unit[0])
    cosine = np.abs(unit @ unit[int(np.argmin(cosine))])
    return float(np.arccos(np.clip(cosine.min(), 0.0, 1.0)))


def near_parallel(number: int, widest: float, least: float) -> WildlabError:
    """What to say of rays that do not cross."""
    if number < 2:
        return WildlabError(
            f"{number} ray{'s' if number != 1 else ''}",
            "two or more are needed to meet in a point",
            field="rays",
        )
    return WildlabError(
        f"{number} rays are near parallel: they cross at {np.degrees(widest):.2g} degrees at most, "
        f"and {np.degrees(least):.2g} are needed",
        "move across the line of sight, give more of the flight, or give the filter a start of its own",
        field="rays",
    )


def _across(unit: Array) -> Array:
    """Axes across each ray, (r, d - 1, d)."""
    if unit.shape[1] == 2:
        return np.stack([-unit[:, 1], unit[:, 0]], axis=-1)[:, None, :]
    helper = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
    one = np.cross(unit, helper)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.stack([one, np.cross(unit, one)], axis=1)


def _angles(p: Array, o: Array, unit: Array, across: Array) -> tuple[Array, Array]:
    """How far off each ray the point is seen (r, d - 1), rad to first order, and its derivative."""
    offset = p - o
    distance = np.linalg.norm(offset, axis=1)
    line = offset / distance[:, None]
    residual = np.einsum("rad,rd->ra", across, line)
    flat = np.eye(len(p)) - line[:, :, None] * line[:, None, :]
    return residual, across @ flat / distance[:, None, None]


def _by_errors(pose: Considered, p: Array, o: Array, J: Array, across: Array, R_nb: Array | None) -> Array:
    """Derivative (r, d - 1, k) of where the point is seen with respect to what all rays err by."""
    size = o.shape[1]
    line = (p - o) / np.linalg.norm(p - o, axis=1, keepdims=True)
    if size == 2:
        by_turn = np.zeros((len(o), 2, 3))
        # A heading that is too small: what is seen stands further to the left than it should.
        by_turn[:, 0, 2], by_turn[:, 1, 2] = line[:, 1], -line[:, 0]
    else:
        by_turn = skew(line) if R_nb is None else skew(line) @ R_nb
    columns = {name: -J[:, :, i] for i, name in enumerate(POSE[:size])}
    turned = across @ by_turn
    columns |= {name: turned[:, :, i] for i, name in enumerate(POSE[3:]) if size == 3 or i == 2}
    unknown = [name for name in pose.names if name not in columns]
    if unknown:
        raise WildlabError(
            f"rays do not depend on {', '.join(unknown)}", f"consider some of {', '.join(columns)}",
            field="pose.names",
        )  # fmt: skip
    if np.shape(pose.covariance) != (len(pose.names),) * 2:
        raise WildlabError(
            f"a covariance of the shape {np.shape(pose.covariance)}",
            f"give one ({len(pose.names)}, {len(pose.names)}) for all rays", field="pose.covariance",
        )  # fmt: skip
    return np.stack([columns[name] for name in pose.names], axis=-1)
