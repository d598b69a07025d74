"""Detections of two cameras that look at the same place, joined: which are of one thing, and where that is.

Both are brought into one plane, the image of the first camera (through a homography) or the ground. What lies
within each other's uncertainty is joined one to one and combined by its covariances; what one camera alone
saw stays, and is told apart. The errors of the two detectors must be independent; what both share, as the
pose of the aircraft that carries both cameras, belongs into neither covariance and is added afterwards
(Bar-Shalom, Willett and Tian, Tracking and Data Fusion, 2011).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from wildlab.detection.detections import Detections
from wildlab.detection.ground import Located
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.quantiles import chi2_quantile

Index = NDArray[np.intp]

#: With which probability two detections of one thing are joined, where their covariances are right.
GATE = 0.99


class Fused(NamedTuple):
    """Things that one camera or both saw, the joined ones first.

    Attributes
    ----------
    points
        (N, 2) where they are, in the plane that both were brought into.
    covariance
        (N, 2, 2) of that.
    first, second
        (N,) rows of the first and of the second camera's detections; -1 where that camera did not see it.
    distance2
        (N,) squared Mahalanobis distance of the two that were joined, NaN for what one camera alone saw. Of
        things that belong together it is chi-square with two degrees of freedom.
    """

    points: Array
    covariance: Array
    first: Index
    second: Index
    distance2: Array

    @property
    def by_both(self) -> NDArray[np.bool_]:
        """(N,) whether both cameras saw it."""
        return np.asarray((self.first >= 0) & (self.second >= 0))


def fuse_points(
    first: ArrayLike,
    first_covariance: ArrayLike,
    second: ArrayLike,
    second_covariance: ArrayLike,
    *,
    gate: float = GATE,
    shared: ArrayLike | None = None,
) -> Fused:
    """Join points of two sources in one plane, as many as possible, the nearest by their covariances.

    Parameters
    ----------
    first, second
        (N, 2) and (M, 2), in one unit.
    first_covariance, second_covariance
        (N, 2, 2) and (M, 2, 2), of what the two do not share.
    gate
        With which probability two points of one thing are joined.
    shared
        (2, 2) covariance of the error that all have in common; it is added at the end. None for none.

    Returns
    -------
    Fused

    Raises
    ------
    WildlabError
        Where points and covariances do not fit together, are not finite, a covariance is not positive
        definite, or the gate is no probability.

    Examples
    --------
    >>> found = fuse_points([[0.0, 0.0]], [np.eye(2)], [[1.0, 0.0], [50.0, 0.0]], [np.eye(2), np.eye(2)])
    >>> found.points.tolist(), found.first.tolist(), found.second.tolist()
    ([[0.5, 0.0], [50.0, 0.0]], [0, -1], [0, 1])
    """
    if not 0 < gate < 1:
        raise WildlabError(f"the gate is {gate:g}", "give a probability between 0 and 1")
    a, P = _checked(first, first_covariance, "first")
    b, Q = _checked(second, second_covariance, "second")
    apart = a[:, None] - b[None]
    spread = P[:, None] + Q[None]
    distance2 = (
        np.einsum("nmi,nmi->nm", apart, np.linalg.solve(spread, apart[..., None])[..., 0])
        if apart.size
        else np.zeros((len(a), len(b)))
    )
    limit = chi2_quantile(gate, 2)
    allowed = distance2 <= limit
    # Of all joinings with the most pairs the likeliest: a pair costs its distance, and the size of the
    # ellipse that it has to lie in; one that is not allowed costs more than all the others.
    cost = distance2 + np.linalg.slogdet(spread)[1] if apart.size else distance2
    span = float(np.ptp(cost[allowed])) + 1.0 if allowed.any() else 1.0
    rows, columns = linear_sum_assignment(
        np.where(allowed, cost, (cost[allowed].max() if allowed.any() else 0.0) + span * (len(a) + len(b)))
    )
    fits = allowed[rows, columns]
    rows, columns = rows[fits], columns[fits]
    gain = P[rows] @ np.linalg.inv(spread[rows, columns]) if len(rows) else np.zeros((0, 2, 2))
    joined = a[rows] - (gain @ apart[rows, columns][..., None])[..., 0]
    precise = P[rows] - gain @ P[rows]
    alone_a, alone_b = np.setdiff1d(np.arange(len(a)), rows), np.setdiff1d(np.arange(len(b)), columns)
    covariance = np.concatenate([(precise + np.swapaxes(precise, 1, 2)) / 2, P[alone_a], Q[alone_b]])
    if shared is not None:
        covariance = covariance + _checked(np.zeros((1, 2)), np.asarray(shared, float)[None], "shared")[1][0]
    nobody = np.full(len(alone_a) + len(alone_b), np.nan)
    return Fused(
        np.concatenate([joined, a[alone_a], b[alone_b]]),
        covariance,
        np.concatenate([rows, alone_a, np.full(len(alone_b), -1)]).astype(np.intp),
        np.concatenate([columns, np.full(len(alone_a), -1), alone_b]).astype(np.intp),
        np.concatenate([distance2[rows, columns], nobody]),
    )


def through_homography(
    uv: ArrayLike, covariance: ArrayLike, H: ArrayLike, registration_px: float = 0.0
) -> tuple[Array, Array]:
    """Pixels of one camera in the image of another that sees the same plane.

    Parameters
    ----------
    uv
        (N, 2) px.
    covariance
        (N, 2, 2) px^2.
    H
        (3, 3) from homogeneous pixels of the one to those of the other; its scale is nothing.
    registration_px
        Standard deviation of the registration in the other image, px for each axis: it is added.

    Returns
    -------
    (N, 2) px, (N, 2, 2) px^2
        To first order; NaN where a pixel has no place in the other image.

    Raises
    ------
    WildlabError
        Where the homography is none, or the registration is below zero.

    Examples
    --------
    >>> uv, covariance = through_homography([[10.0, 20.0]], [np.eye(2)], np.diag([2.0, 2.0, 1.0]))
    >>> uv.tolist(), covariance.tolist()
    ([[20.0, 40.0]], [[[4.0, 0.0], [0.0, 4.0]]])
    """
    matrix = np.asarray(H, float)
    if (
        matrix.shape != (3, 3)
        or not np.isfinite(matrix).all()
        or abs(np.linalg.det(matrix)) <= 1e-12 * np.linalg.norm(matrix, axis=1).prod()
    ):
        raise WildlabError(
            "the homography is no invertible matrix of 3 x 3 numbers",
            "register the two cameras again, with four points or more that do not lie on a line",
        )
    if not registration_px >= 0:
        raise WildlabError(f"the registration is {registration_px:g} px", "give zero or more")
    points = np.asarray(uv, float).reshape(-1, 2)
    mapped = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix.T
    with np.errstate(invalid="ignore", divide="ignore"):
        found = mapped[:, :2] / mapped[:, 2:]
        J = (matrix[None, :2, :2] - found[:, :, None] * matrix[None, 2:, :2]) / mapped[:, 2, None, None]
    lost = np.abs(mapped[:, 2]) < 1e-12 * np.abs(matrix[2]).max()
    found[lost], J[lost] = np.nan, np.nan
    P = J @ np.asarray(covariance, float).reshape(-1, 2, 2) @ np.swapaxes(J, 1, 2)
    return found, P + registration_px**2 * np.eye(2)


def fuse_detections(
    first: Detections,
    second: Detections,
    H: ArrayLike,
    *,
    registration_px: float = 0.0,
    gate: float = GATE,
) -> Fused:
    """Detections of two registered cameras, as a thermal and a colour one side by side, in the first's image.

    Parameters
    ----------
    first, second
        Of the two images, taken at one moment.
    H
        (3, 3) from pixels of the second to pixels of the first.
    registration_px
        Standard deviation of the registration, px of the first image for each axis; the residuals of
        the points that were registered by say it.
    gate
        With which probability two detections of one thing are joined.

    Returns
    -------
    Fused
        In pixels of the first image. Rows of the second that have no place in it are left out.

    Raises
    ------
    WildlabError
        As `fuse_points` and `through_homography`.
    """
    uv, covariance = through_homography(second.uv, second.covariance, H, registration_px)
    there = np.flatnonzero(np.isfinite(uv).all(axis=1))
    found = fuse_points(first.uv, first.covariance, uv[there], covariance[there], gate=gate)
    return found._replace(second=_back(found.second, there))


def fuse_located(
    first: Located, second: Located, *, gate: float = GATE, shared: ArrayLike | None = None
) -> Fused:
    """Detections of two cameras that were put on the ground, each with its own pose.

    Parameters
    ----------
    first, second
        From `wildlab.detection.ground.locate`. Where one aircraft carries both cameras, locate with no pose
        covariance: its error is in both.
    gate
        With which probability two detections of one thing are joined.
    shared
        (2, 2) m^2 north-east: what both have in common, as that pose's error on the ground. None for none.

    Returns
    -------
    Fused
        North and east, m. Rows of rays that do not meet the ground are left out.

    Raises
    ------
    WildlabError
        As `fuse_points`.
    """
    there = [
        np.flatnonzero(np.isfinite(one.points).all(axis=1) & np.isfinite(one.covariance).all(axis=(1, 2)))
        for one in (first, second)
    ]
    found = fuse_points(
        first.points[there[0], :2], first.covariance[there[0]],
        second.points[there[1], :2], second.covariance[there[1]], gate=gate, shared=shared,
    )  # fmt: skip
    return found._replace(first=_back(found.first, there[0]), second=_back(found.second, there[1]))


def _back(rows: Index, there: Index) -> Index:
    """Rows of what is there as rows of all; -1 stays."""
    found = np.full(len(rows), -1)
    found[rows >= 0] = there[rows[rows >= 0]]
    return found.astype(np.intp)


def _checked(points: ArrayLike, covariance: ArrayLike, which: str) -> tuple[Array, Array]:
    x, P = np.asarray(points, float), np.asarray(covariance, float)
    x = x.reshape(-1, 2) if not x.size else x
    P = P.reshape(-1, 2, 2) if not P.size else P
    if x.ndim != 2 or x.shape[1] != 2 or P.shape != (len(x), 2, 2):
        raise WildlabError(
            f"the {which} points have the shape {x.shape} and their covariances {P.shape}",
            "give (N, 2) and (N, 2, 2)",
        )
    good = np.isfinite(x).all() and np.isfinite(P).all()
    if not good or (len(P) and not (np.linalg.eigvalsh((P + np.swapaxes(P, 1, 2)) / 2)[:, 0] > 0).all()):
        raise WildlabError(
            f"a point of the {which} is not finite, or its covariance is not positive definite",
            "leave such rows out",
        )
    return x, P
