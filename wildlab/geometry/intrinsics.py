"""Intrinsic parameters of a camera from views of a flat board (H 2.5.1, F 2.4), with what they are worth.

OpenCV estimates camera and views together (Zhang's method). How good the estimate is follows from the views
themselves: each is left out in turn, and the estimate moves. Corners of one view share errors (blur, a warped
board), so that their number says less than the number of views.

The board lies in its own frame, z = 0. A view is a pose that takes a point of the board to c.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, project
from wildlab.geometry.covariances import NamedEstimates
from wildlab.geometry.frames import Array

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
#: Columns of OpenCV's derivatives, behind six of the pose.
_COLUMNS = {name: 6 + i for i, name in enumerate((*PINHOLE, *LENSES["full"]))}
#: What holds a parameter of the lens.
_HELD = {
    "k1": cv2.CALIB_FIX_K1,
    "k2": cv2.CALIB_FIX_K2,
    "p1": cv2.CALIB_ZERO_TANGENT_DIST,
    "k3": cv2.CALIB_FIX_K3,
}
#: Fewest views of an estimate whose uncertainty can be told by leaving one out, and points of a view.
FEWEST, POINTS = 4, 6
#: When an estimate stops: steps, and a change of that share of the parameters.
STOP = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)


class Views(NamedTuple):
    """Poses of V views of a board: ``rotation`` (V, 3, 3) and ``translation`` (V, 3), from the board to c."""

    rotation: Array
    translation: Array


def project_board(camera: Camera, views: Views, board: ArrayLike) -> Array:
    """The board's points in each view, F (2.20).

    Parameters
    ----------
    camera
        Its intrinsic parameters.
    views
        Poses of the board.
    board
        (M, 3) in the frame of the board.

    Returns
    -------
    (V, M, 2) pixels; NaN for points in or behind the plane of the lens.
    """
    turned = np.einsum("vij,mj->vmi", views.rotation, np.asarray(board, float))
    return project(camera, turned + views.translation[:, None])


@dataclass(frozen=True)
class Intrinsics(NamedEstimates):
    """A camera from V views of a board.

    Attributes
    ----------
    camera
        The estimate.
    names
        The P parameters estimated: of `PINHOLE` and of one of `LENSES`.
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
        return _camera(dict(zip(self.names, np.asarray(values, float).tolist(), strict=True)), self.camera)

    def freedom_of(self, name: str) -> float:
        """By the number of views."""
        return len(self.residuals) - 1


def parameters_of(camera: Camera) -> dict[str, float]:
    """The intrinsic parameters of a camera by the names of `PINHOLE` and `LENSES`.

    Parameters
    ----------
    camera
        Its skew is not among them: no lens here has any.

    Returns
    -------
    dict
        Pixels, or no unit.
    """
    values = (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)
    return dict(zip((*PINHOLE, *LENSES["full"]), values, strict=True))


def _camera(values: dict[str, float], like: Camera) -> Camera:
    """A camera of the same size with these parameters; without distortion where they name none."""
    fx, fy = values["fx"], values["fy"]
    k1, k2, p1, p2, k3 = (values.get(name, 0.0) for name in LENSES["full"])
    return Camera(like.width, like.height, fx, fy, values["cx"], values["cy"], 0.0, (k1, k2, p1, p2, k3))


def calibrate_camera(
    board: ArrayLike,
    uv: ArrayLike,
    width: int,
    height: int,
    lens: str = "full",
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
    lens
        One of `LENSES`: what is estimated of its distortion.
    resample
        Whether each view is left out in turn, for the covariance; else that is NaN.

    Returns
    -------
    Intrinsics

    Raises
    ------
    WildlabError
        Where there are fewer than four views, a view has fewer than six points, or no camera fits the views.

    Examples
    --------
    >>> from wildlab.geometry.frames import euler_to_matrix
    >>> board = np.array([[x, y, 0.0] for y in range(5) for x in range(7)])
    >>> tilts = np.radians([[0, 20, 0], [20, 0, 30], [-25, 10, 0], [0, -25, 60], [15, 15, 10]])
    >>> views = Views(euler_to_matrix(*tilts.T), np.tile([-3.0, -2.0, 14.0], (5, 1)))
    >>> seen = Camera(640, 512, 900, 905, 310, 250, 0, (0.1, 0, 0, 0, 0))
    >>> found = calibrate_camera(board, project_board(seen, views, board), 640, 512, "k1")
    >>> [round(float(value), 3) for value in found.values]
    [900.0, 905.0, 310.0, 250.0, 0.1]
    """
    board, uv = np.asarray(board, float), np.asarray(uv, float)
    _check(board, uv)
    names = (*PINHOLE, *LENSES[lens])
    camera, views = _solve(board, uv, names, (width, height))
    values = _values(camera, names)
    seen = np.isfinite(uv).all(axis=-1)
    information = np.array(
        [_information(camera, R, t, board[one], names) for R, t, one in zip(*views, seen, strict=True)]
    )
    without = np.full((len(uv), len(names)), np.nan)
    for left in range(len(uv) if resample else 0):
        rest, _ = _solve(board, np.delete(uv, left, axis=0), names, (width, height), camera)
        without[left] = _values(rest, names)
    apart = without - without.mean(axis=0)
    covariance = (len(uv) - 1) / len(uv) * apart.T @ apart
    r = np.where(seen[..., None], project_board(camera, views, board) - uv, np.nan)
    return Intrinsics(camera, names, values, covariance, views, r, information, without)


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
    bends, rotations, translations = np.array(camera.distortion), [], []
    for one in uv:
        seen = np.isfinite(one).all(axis=1)
        points, pixels = np.ascontiguousarray(board[seen]), np.ascontiguousarray(one[seen])
        _, turn, place = cv2.solvePnP(points, pixels, camera.matrix, bends)
        turn, place = cv2.solvePnPRefineLM(points, pixels, camera.matrix, bends, turn, place, STOP)
        rotations.append(cv2.Rodrigues(turn)[0])
        translations.append(place.ravel())
    views = Views(np.array(rotations), np.array(translations))
    squared = ((project_board(camera, views, board) - uv) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(np.nanmean(squared, axis=1)))


def _check(board: Array, uv: Array) -> None:
    if len(uv) < FEWEST:
        raise WildlabError(
            f"{len(uv)} view{'' if len(uv) == 1 else 's'} of the board, and at least {FEWEST} are needed",
            "take 20 or more, from all sides, tilted by up to 45 degrees, all over the image",
        )
    few = np.isfinite(uv).all(axis=-1).sum(axis=1)
    if few.min() < POINTS:
        raise WildlabError(
            f"view {int(few.argmin())} has {few.min()} points", f"leave out views with fewer than {POINTS}"
        )


def _solve(
    board: Array, uv: Array, names: tuple[str, ...], size: tuple[int, int], near: Camera | None = None
) -> tuple[Camera, Views]:
    """Camera and views of least squared distance; ``near`` is where to begin. OpenCV takes float32."""
    seen = [np.isfinite(view).all(axis=1) for view in uv]
    points = [board[one].astype(np.float32) for one in seen]
    pixels = [view[one].astype(np.float32) for view, one in zip(uv, seen, strict=True)]
    flags = sum(flag for name, flag in _HELD.items() if name not in names) | cv2.CALIB_USE_INTRINSIC_GUESS
    found: list[Any]
    try:
        start, bends = cv2.initCameraMatrix2D(points, pixels, size, 0), np.zeros(5)
        if near is not None:
            start, bends = near.matrix, np.array(near.distortion)
        _, *found = cv2.calibrateCamera(points, pixels, size, start, bends, flags=flags, criteria=STOP)
    except cv2.error:
        found = [np.full((3, 3), np.nan)]
    A = np.asarray(found[0], float)
    if not (np.isfinite(A).all() and A[0, 0] > 0 and A[1, 1] > 0):
        raise WildlabError(
            "no camera fits these views",
            "check that all views are of one camera with one zoom and one focus, and that the board's "
            "columns and rows are right",
        )
    k1, k2, p1, p2, k3 = np.ravel(found[1])[:5].tolist()
    camera = Camera(*size, A[0, 0], A[1, 1], A[0, 2], A[1, 2], 0.0, (k1, k2, p1, p2, k3))
    rotations = np.array([cv2.Rodrigues(turn)[0] for turn in found[2]], float)
    return camera, Views(rotations, np.array(found[3], float)[..., 0])


def _values(camera: Camera, names: tuple[str, ...]) -> Array:
    by_name = parameters_of(camera)
    return np.array([by_name[name] for name in names])


def _derivatives(
    camera: Camera, R: Array, t: Array, points: Array, names: tuple[str, ...]
) -> tuple[Array, Array]:
    """Of the pixels (M, 2) of points (M, 3) in a view: by P parameters (2M, P), by its pose (2M, 6)."""
    bends = np.array(camera.distortion)
    found = np.asarray(cv2.projectPoints(points, cv2.Rodrigues(R)[0], t, camera.matrix, bends)[1], float)
    return np.stack([found[:, _COLUMNS[name]] for name in names], axis=-1), found[:, :6]


def _information(camera: Camera, R: Array, t: Array, points: Array, names: tuple[str, ...]) -> Array:
    """(P, P) what a view's points (M, 3) say of the parameters with its pose eliminated."""
    J, K = _derivatives(camera, R, t, points, names)
    return np.asarray(J.T @ (J - K @ np.linalg.lstsq(K, J, rcond=None)[0]))


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
    for lens in LENSES:
        errors = np.empty(len(uv))
        for block in blocks:
            rest = np.delete(uv, block, axis=0)
            camera = calibrate_camera(board, rest, width, height, lens, resample=False).camera
            errors[block] = view_errors(camera, board, uv[block])
        squared[lens] = errors**2
    means = {lens: float(one.mean()) if np.isfinite(one).all() else np.inf for lens, one in squared.items()}
    best = min(means, key=lambda lens: means[lens])
    for lens in sorted(LENSES, key=lambda lens: len(LENSES[lens])):
        apart = squared[lens] - squared[best]
        if means[lens] - means[best] <= apart.std(ddof=1) / np.sqrt(len(uv)):
            break
    return LensChoice(lens, {name: float(np.sqrt(mean)) for name, mean in means.items()})
