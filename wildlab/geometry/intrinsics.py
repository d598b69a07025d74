"""Intrinsic parameters of a camera from views of a flat board (H 2.5.1, F 2.4), with what they are worth.

Zhang's method: homographies give a start, and Levenberg and Marquardt bring camera and views together to the
least squared distance in the image. How good the estimate is follows from the views themselves: each is left
out in turn, and the estimate moves. Corners of one view share errors (blur, a warped board), so that their
number says less than the number of views.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from wildlab.errors import WildlabError
from wildlab.geometry.board_views import (
    INTRINSICS,
    Views,
    camera_of,
    parameters_of,
    project_board,
    start_camera,
    start_views,
)
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array, rotation_vector_to_matrix

#: What may be estimated: each intrinsic parameter, or "f", one focal length for columns and rows.
ESTIMATED = ("f", *INTRINSICS)
#: The pinhole, and lenses that bend more and more.
PINHOLE = ("fx", "fy", "cx", "cy")
LENSES: dict[str, tuple[str, ...]] = {
    "none": (),
    "k1": ("k1",),
    "k1-k2": ("k1", "k2"),
    "k1-k2-k3": ("k1", "k2", "k3"),
    "tangential": ("k1", "k2", "p1", "p2"),
    "full": ("k1", "k2", "p1", "p2", "k3"),
}
#: Fewest views of an estimate whose uncertainty can be told by leaving one out.
FEWEST = 4
#: Steps of an estimate, at most; of one that begins near its end; and which gain is too small to go on, as a
#: share of the summed squares.
ROUNDS, AGAIN, SETTLED = 200, 20, 1e-10
#: How much an estimate is damped at first, far from its end and near it.
FAR, NEAR = 1e-3, 1e-9
#: Smallest singular value of the normalised derivatives of parameters that views tell apart: 0.1 is two
#: parameters with a correlation of 0.99.
PARALLEL = 0.1


@dataclass(frozen=True)
class Intrinsics:
    """A camera from V views of a board.

    Attributes
    ----------
    camera
        The estimate.
    names
        The P parameters estimated, some of `ESTIMATED`; the others were held.
    values
        (P,) pixels, or no unit.
    covariance
        (P, P), from how far the estimate moves when a view is left out.
    views
        Poses of the board.
    residuals
        (V, M, 2) pixels, projected less seen; NaN where a point was not seen.
    information
        (V, P, P) what each view says of the parameters once its pose is free, per squared pixel.
    without
        (V, P) the estimate without each view.
    """

    camera: Camera
    names: tuple[str, ...]
    values: Array
    covariance: Array
    views: Views
    residuals: Array
    information: Array
    without: Array

    @property
    def rms(self) -> float:
        """Root mean squared distance of projected and seen points, pixels (OpenCV's reprojection error)."""
        return float(np.sqrt(np.nanmean((self.residuals**2).sum(axis=-1))))

    @property
    def view_rms(self) -> Array:
        """(V,) the same of each view, pixels."""
        return np.asarray(np.sqrt(np.nanmean((self.residuals**2).sum(axis=-1), axis=1)))

    def camera_with(self, values: ArrayLike) -> Camera:
        """The camera with other values (P,) of what was estimated."""
        free = free_columns(self.names)
        theta = np.where(free.any(axis=1), free @ np.asarray(values, float), parameters_of(self.camera))
        return camera_of(theta, self.camera.width, self.camera.height)

    def value(self, name: str) -> float:
        """The estimate called ``name``; what it was held at where it was not estimated."""
        if name in self.names:
            return float(self.values[self.names.index(name)])
        return float(parameters_of(self.camera)[INTRINSICS.index("fx" if name == "f" else name)])

    def sd(self, name: str) -> float:
        """Its standard deviation; NaN where it was held."""
        if name not in self.names:
            return float("nan")
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    def interval(self, name: str, probability: float = 0.95) -> tuple[float, float]:
        """Student's interval of the parameter called ``name``, by the number of views."""
        half = float(stdtrit(len(self.residuals) - 1, (1 + probability) / 2)) * self.sd(name)
        return self.value(name) - half, self.value(name) + half


def calibrate_camera(
    board: ArrayLike,
    uv: ArrayLike,
    width: int,
    height: int,
    estimate: Sequence[str] = (*PINHOLE, *LENSES["full"]),
    held: Camera | None = None,
    resample: bool = True,
) -> Intrinsics:
    """Estimate a camera from views of a flat board.

    Parameters
    ----------
    board
        (M, 3) points in the board's frame, any unit of length, all z = 0.
    uv
        (V, M, 2) their pixels; NaN where one is not seen.
    width, height
        Of the image, pixels.
    estimate
        Which parameters, some of `ESTIMATED`; "f" stands for fx = fy.
    held
        What the others are held at; left out, no skew, no distortion and the middle of the image.
    resample
        Whether each view is left out in turn, for the covariance; else that is NaN.

    Returns
    -------
    Intrinsics

    Raises
    ------
    WildlabError
        Where there are fewer than four views, a view has fewer than six points, the shapes do not fit, a
        parameter is not known, or no camera fits the views.

    Examples
    --------
    >>> from wildlab.geometry.board_views import Views, project_board
    >>> from wildlab.geometry import euler_to_matrix
    >>> board = np.array([[x, y, 0.0] for y in range(5) for x in range(7)])
    >>> tilts = np.radians([[0, 20, 0], [20, 0, 30], [-25, 10, 0], [0, -25, 60], [15, 15, 10]])
    >>> views = Views(euler_to_matrix(*tilts.T), np.tile([-3.0, -2.0, 14.0], (5, 1)))
    >>> uv = project_board([900, 905, 310, 250, 0, 0.1, 0, 0, 0, 0], views, board).uv
    >>> found = calibrate_camera(board, uv, 640, 512, ("fx", "fy", "cx", "cy", "k1"))
    >>> [round(float(value), 3) for value in found.values]
    [900.0, 905.0, 310.0, 250.0, 0.1]
    """
    board, uv = np.asarray(board, float), np.asarray(uv, float)
    names = _checked(board, uv, estimate)
    first = start_camera(board, uv, width, height)
    free = free_columns(names)
    begin = parameters_of(first)
    if held is not None:
        kept = [i for i in range(len(INTRINSICS)) if not free[i].any()]
        begin[kept] = parameters_of(held)[kept]
    if "f" in names:
        begin[:2] = begin[:2].mean()
    views = start_views(camera_of(begin, width, height), board, uv)
    theta, views = _solve(begin, views, board, uv, free)
    if not np.isfinite(theta).all() or not (theta[:2] > 0).all():
        raise WildlabError(
            "no camera fits these views",
            "check that all views are of one camera with one zoom and one focus, and that the board's "
            "columns and rows are right",
        )
    r, J, K = _linear(theta, views, board, uv, free)
    information = _reduced(J, K)
    without = np.full((len(uv), len(theta)), np.nan)
    for left in range(len(uv) if resample else 0):
        keep = np.arange(len(uv)) != left
        rest = Views(views.rotation[keep], views.translation[keep])
        without[left] = _solve(theta, rest, board, uv[keep], free, AGAIN)[0]
    pick = free / free.sum(axis=0)
    moved = without @ pick
    apart = moved - moved.mean(axis=0)
    covariance = (len(uv) - 1) / len(uv) * apart.T @ apart
    camera = camera_of(theta, width, height)
    r[~np.isfinite(uv).all(axis=-1)] = np.nan
    return Intrinsics(camera, names, theta @ pick, covariance, views, r, information, moved)


def view_errors(camera: Camera, board: ArrayLike, uv: ArrayLike) -> Array:
    """How well a given camera fits views that it was not estimated from: only their poses are.

    Parameters
    ----------
    camera
        The camera, held.
    board
        (M, 3) points of the flat board.
    uv
        (V, M, 2) their pixels; NaN where one is not seen.

    Returns
    -------
    (V,) root mean squared distance of projected and seen points, pixels.
    """
    board, uv = np.asarray(board, float), np.asarray(uv, float)
    theta, free = parameters_of(camera), np.zeros((len(INTRINSICS), 0))
    _, views = _solve(theta, start_views(camera, board, uv), board, uv, free)
    squared = ((project_board(theta, views, board).uv - uv) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(np.nanmean(squared, axis=1)))


def confused(found: Intrinsics) -> list[tuple[str, ...]]:
    """Groups of parameters that the views cannot tell apart: changed together, they do nothing that shows.

    Parameters
    ----------
    found
        From `calibrate_camera`.

    Returns
    -------
    list of tuple of str
        Names with a say in each lost direction, the strongest first; none where all is told apart.
    """
    S = found.information.sum(axis=0)
    size = np.sqrt(np.diag(S))
    size[size == 0] = 1.0
    power, directions = np.linalg.eigh(S / np.outer(size, size))
    groups = []
    for value, direction in zip(power, directions.T, strict=True):
        if value > PARALLEL**2:
            break
        order = np.argsort(-np.abs(direction))
        groups.append(tuple(found.names[i] for i in order if abs(direction[i]) > 0.3))
    return groups


def _checked(board: Array, uv: Array, estimate: Sequence[str]) -> tuple[str, ...]:
    if board.ndim != 2 or board.shape[1] != 3 or uv.ndim != 3 or uv.shape[1:] != (len(board), 2):
        raise WildlabError(
            f"a board of shape {board.shape} and pixels of shape {uv.shape} do not fit",
            "give the board as (M, 3) and the pixels as (V, M, 2)",
        )
    unknown = set(estimate) - set(ESTIMATED)
    if unknown or ("f" in estimate and {"fx", "fy"} & set(estimate)) or not estimate:
        raise WildlabError(
            f"cannot estimate {', '.join(estimate) or 'nothing'} together",
            f"name some of {', '.join(ESTIMATED)}, and f only without fx and fy",
            field="estimate",
        )
    if len(uv) < FEWEST:
        raise WildlabError(
            f"{len(uv)} view{'' if len(uv) == 1 else 's'} of the board, and at least {FEWEST} are needed",
            "take 20 or more, from all sides, tilted by up to 45 degrees, all over the image",
        )
    few = np.isfinite(uv).all(axis=-1).sum(axis=1)
    if few.min() < 6:
        raise WildlabError(
            f"view {int(few.argmin())} has {few.min()} points", "leave out views with fewer than 6"
        )
    return tuple(name for name in ESTIMATED if name in estimate)


def free_columns(names: Sequence[str]) -> Array:
    """From estimated parameters to all intrinsic ones: "f" goes into both focal lengths.

    Parameters
    ----------
    names
        The P parameters, some of `ESTIMATED`.

    Returns
    -------
    (10, P) zeros and ones.
    """
    free = np.zeros((len(INTRINSICS), len(names)))
    for column, name in enumerate(names):
        for one in ("fx", "fy") if name == "f" else (name,):
            free[INTRINSICS.index(one), column] = 1.0
    return free


def _linear(theta: Array, views: Views, board: Array, uv: Array, free: Array) -> tuple[Array, Array, Array]:
    """Residuals (V, M, 2), derivatives (V, 2M, P) and (V, 2M, 6); zero for points that are not seen."""
    found = project_board(theta, views, board)
    r = found.uv - uv
    lost = np.asarray(~np.isfinite(uv).all(axis=-1))
    r = np.where(lost[..., None], 0.0, r)
    J = np.where(lost[..., None, None], 0.0, found.by_intrinsics @ free)
    K = np.where(lost[..., None, None], 0.0, found.by_pose)
    rows = (len(uv), 2 * len(board))
    return r, J.reshape(*rows, free.shape[1]), K.reshape(*rows, 6)


def _reduced(J: Array, K: Array) -> Array:
    """(V, P, P) information on the intrinsics with the pose of each view eliminated."""
    turned = np.swapaxes(K, 1, 2)
    cross = turned @ J
    return np.asarray(
        np.swapaxes(J, 1, 2) @ J - np.swapaxes(cross, 1, 2) @ np.linalg.solve(turned @ K, cross)
    )


def _solve(
    theta: Array, views: Views, board: Array, uv: Array, free: Array, rounds: int = ROUNDS
) -> tuple[Array, Views]:
    """Camera and views of least squared distance, by Levenberg and Marquardt; the poses are eliminated."""
    damping = FAR if rounds == ROUNDS else NEAR
    r, J, K = _linear(theta, views, board, uv, free)
    cost = float((r**2).sum())
    for _ in range(rounds):
        flat = r.reshape(len(r), -1, 1)
        JJ, KK = np.swapaxes(J, 1, 2) @ J, np.swapaxes(K, 1, 2) @ K
        KJ, gj, gk = (
            np.swapaxes(K, 1, 2) @ J,
            np.swapaxes(J, 1, 2) @ flat,
            np.swapaxes(K, 1, 2) @ flat,
        )
        gained = 0.0
        while damping < 1e12:
            KKd = KK + damping * KK * np.eye(6)
            solved = np.linalg.solve(KKd, np.concatenate([KJ, gk], axis=-1))
            S = (JJ.sum(axis=0)) * (1 + damping * np.eye(J.shape[-1])) - (
                np.swapaxes(KJ, 1, 2) @ solved[..., :-1]
            ).sum(axis=0)
            g = (gj - np.swapaxes(KJ, 1, 2) @ solved[..., -1:]).sum(axis=0)
            step = -np.linalg.lstsq(S, g, rcond=None)[0][:, 0]
            pose = -(solved[..., -1] + solved[..., :-1] @ step)
            trial = theta + free @ step
            moved = Views(
                rotation_vector_to_matrix(pose[:, :3]) @ views.rotation, views.translation + pose[:, 3:]
            )
            with np.errstate(all="ignore"):
                r_, J_, K_ = _linear(trial, moved, board, uv, free)
                found = float((r_**2).sum())
            if np.isfinite(found) and found <= cost and np.isfinite(J_).all() and np.isfinite(K_).all():
                gained, theta, views, r, J, K = cost - found, trial, moved, r_, J_, K_
                cost, damping = found, max(damping / 10, 1e-12)
                break
            damping *= 10
        if gained <= SETTLED * cost:
            break
    return theta, views


#: Blocks of views that are held out in turn, and what is taken where there are too few views for that.
BLOCKS, TOO_FEW_FOR_CHOICE = 5, "k1"


class LensChoice(NamedTuple):
    """The lens model taken, one of `LENSES`, and by model the root mean squared distance on views that it was
    not estimated from, pixels; empty where there were too few to hold any out."""

    lens: str
    held_out: dict[str, float]


def choose_lens(board: ArrayLike, uv: ArrayLike, width: int, height: int) -> LensChoice:
    """The simplest lens model that is no worse than the best on views held out.

    No worse: by less than one standard error of the difference over views. Held-out views lie next to one
    another, for pictures taken in a row are alike.

    Parameters
    ----------
    board
        (M, 3) points of the flat board.
    uv
        (V, M, 2) their pixels, views in the order in which they were taken; NaN where one is not seen.
    width, height
        Of the image, pixels.

    Returns
    -------
    LensChoice
    """
    uv = np.asarray(uv, float)
    blocks = np.array_split(np.arange(len(uv)), min(BLOCKS, len(uv)))
    if len(uv) - max(len(block) for block in blocks) < FEWEST:
        return LensChoice(TOO_FEW_FOR_CHOICE, {})
    squared: dict[str, Array] = {}
    for lens, bends in LENSES.items():
        errors = np.empty(len(uv))
        for block in blocks:
            rest = np.delete(uv, block, axis=0)
            camera = calibrate_camera(board, rest, width, height, (*PINHOLE, *bends), resample=False).camera
            errors[block] = view_errors(camera, board, uv[block])
        squared[lens] = errors**2
    means = {lens: float(one.mean()) if np.isfinite(one).all() else np.inf for lens, one in squared.items()}
    best = min(means, key=lambda lens: means[lens])
    for lens in sorted(LENSES, key=lambda lens: len(LENSES[lens])):
        apart = squared[lens] - squared[best]
        if means[lens] - means[best] <= apart.std(ddof=1) / np.sqrt(len(uv)):
            break
    return LensChoice(lens, {name: float(np.sqrt(mean)) for name, mean in means.items()})


#: Columns and rows of the raster over which the turn is taken off.
RASTER = (33, 25)


def direction_sd(found: Intrinsics, uv: ArrayLike) -> Array:
    """How far off the estimate puts what is seen in a fixed direction, apart from a turn of the whole camera.

    The turn is the one that takes up most over the image: a calibration of the mount does the same.

    Parameters
    ----------
    found
        From `calibrate_camera`.
    uv
        (N, 2) pixels.

    Returns
    -------
    (N,) root of the summed variances of both axes, pixels; NaN where the lens sees nothing.
    """
    J, K = _by_direction(found, image_raster(found.camera))
    seen = np.isfinite(J).all(axis=(1, 2))
    turn = np.linalg.lstsq(K[seen].reshape(-1, 3), J[seen].reshape(-1, J.shape[-1]), rcond=None)[0]
    J, K = _by_direction(found, np.asarray(uv, float))
    left = J - K @ turn
    return np.asarray(np.sqrt(np.einsum("nip,pq,niq->n", left, found.covariance, left)))


def _by_direction(found: Intrinsics, uv: Array) -> tuple[Array, Array]:
    """How pixels (N, 2) of fixed directions move with the estimate, (N, 2, P), and a turn, (N, 2, 3)."""
    xy = normalise(found.camera, uv)
    rays = np.column_stack([xy, np.ones(len(xy))])
    at = project_board(parameters_of(found.camera), Views(np.eye(3)[None], np.zeros((1, 3))), rays)
    return at.by_intrinsics[0] @ free_columns(found.names), at.by_pose[0, ..., :3]


def image_raster(camera: Camera) -> Array:
    """Pixels in even rows and columns over the image, its borders included.

    Parameters
    ----------
    camera
        Of the image.

    Returns
    -------
    (825, 2) pixels.
    """
    columns, rows = RASTER
    u, v = np.meshgrid(np.linspace(0, camera.width, columns), np.linspace(0, camera.height, rows))
    return np.column_stack([u.ravel(), v.ravel()])
