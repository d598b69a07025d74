"""Boresight, lens position and camera clock from known points in the flight's own images (H 5.3.2).

H (5.15)-(5.17) finds three misalignment angles that bring georeferenced points onto known ones, by nonlinear
least squares. Here the residuals may be weighted with each point's ground covariance, a robust loss keeps a
wrong click from deciding, and the estimate comes with a covariance that knows that clicks of one image share
the image's pose error. What the data cannot tell apart is named and left alone, not fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix, matrix_to_euler
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.mount import Mount

#: Every parameter that can be estimated, in the order in which they are kept when the data cannot carry all;
#: with the size an error of it would usually have (radians, seconds, metres). A parameter, or a combination,
#: that the data determine no better than that is not worth fitting.
PARAMETERS: dict[str, float] = {
    "roll": np.radians(3.0),
    "tilt": np.radians(3.0),
    "pan": np.radians(3.0),
    "clock": 0.5,
    "down": 5.0,
    "north": 5.0,
    "east": 5.0,
}
BORESIGHT = ("roll", "tilt", "pan")
#: Smallest singular value of the normalised derivatives: 0.1 is two columns with a correlation of 0.99.
PARALLEL = 0.1

#: Poses at the times of N pixels, shifted by so many seconds.
PosesAt = Callable[[float], CameraPoses]


@dataclass(frozen=True)
class Calibration:
    """An estimate of some of :data:`PARAMETERS`.

    Attributes
    ----------
    names
        The parameters estimated.
    values
        Corrections (P,), radians, seconds, metres: angles turn the camera's base on the airframe, ``clock``
        is to be added to the camera's stamps, ``north``/``east``/``down`` to the logged position.
    covariance
        (P, P); clicks of one image count as one draw of the image's error.
    undetermined
        Asked for and not estimated, with the parameters each could not be told apart from (none: it has no
        effect that shows).
    n_points, n_images
        What it rests on.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    undetermined: dict[str, tuple[str, ...]]
    n_points: int
    n_images: int

    def value(self, name: str) -> float:
        """The correction called ``name``, zero where it was not estimated."""
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0

    def sd(self, name: str) -> float:
        """Its standard deviation; NaN where it was not estimated."""
        if name not in self.names:
            return float("nan")
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))


def apply_calibration(calibration: Calibration, mount: Mount) -> Mount:
    """The mount with the estimated angles on top of its own misalignment.

    Parameters
    ----------
    calibration
        The estimate.
    mount
        The one it was estimated with.

    Returns
    -------
    The mount, otherwise unchanged.
    """
    angles = [calibration.value(name) for name in BORESIGHT]
    turned = euler_to_matrix(*angles) @ euler_to_matrix(*mount.misalignment)
    roll, tilt, pan = matrix_to_euler(turned)
    return replace(mount, misalignment=(float(roll), float(tilt), float(pan)))


def calibrated_poses(calibration: Calibration, poses_at: PosesAt) -> CameraPoses:
    """Poses with a calibration applied to clock, position and mount.

    Parameters
    ----------
    calibration
        The estimate.
    poses_at
        Gives the poses, as logged, at the times of the pixels shifted by an offset in seconds.

    Returns
    -------
    The poses; their covariance is that of the logged ones.
    """
    poses = poses_at(calibration.value("clock"))
    shift = np.array([calibration.value(name) for name in ("north", "east", "down")])
    return replace(poses, p_nb=poses.p_nb + shift, mount=apply_calibration(calibration, poses.mount))


def georeference_calibrated(
    calibration: Calibration, poses_at: PosesAt, uv: ArrayLike, plane_down: ArrayLike
) -> Array:
    """Ground points with a calibration applied to clock, position and mount.

    Parameters
    ----------
    calibration
        The estimate.
    poses_at
        Gives the poses, as logged, at the times of the pixels shifted by an offset in seconds.
    uv
        (N, 2) pixels.
    plane_down
        Down coordinate of the plane in n, metres, scalar or (N,).

    Returns
    -------
    (N, 3) metres in n; NaN where a ray misses the plane.

    Raises
    ------
    WildlabError
        Where there is another number of poses, or of planes, than of pixels.
    """
    return georeference_pixels(calibrated_poses(calibration, poses_at), uv, plane_down)


def calibrate(
    poses_at: PosesAt,
    uv: ArrayLike,
    known_points: ArrayLike,
    image: Sequence[object] | np.ndarray,
    estimate: Sequence[str] = BORESIGHT,
    covariance: ArrayLike | None = None,
    draw: Sequence[object] | np.ndarray | None = None,
) -> Calibration:
    """Estimate what is constantly wrong with the camera's pose from points whose position is known.

    Parameters
    ----------
    poses_at
        Gives the poses, as logged, at the times of the N pixels shifted by an offset in seconds.
    uv
        (N, 2) pixels of the points.
    known_points
        (N, 3) metres in n; their down coordinate is the plane each pixel is cut with.
    image
        (N,) which image each pixel belongs to.
    estimate
        Names from :data:`PARAMETERS`.
    covariance
        (N, 2, 2) ground covariances to weight with; without them all points count alike, as in H (5.17).
    draw
        (N,) which points share their error; those of an image, if not given. The covariance of the estimate
        follows from how far different draws disagree.

    Returns
    -------
    The estimate. Parameters that cannot be told apart are in ``undetermined``.

    Raises
    ------
    ValueError
        Unknown parameter, or no usable point.
    WildlabError
        Where there is another number of poses, or of points, than of pixels.
    """
    from scipy.optimize import least_squares  # as long to import as all the rest of geometry

    unknown = set(estimate) - PARAMETERS.keys()
    if unknown:
        raise ValueError(f"unknown parameters {sorted(unknown)}; known are {list(PARAMETERS)}")
    uv, known = np.asarray(uv, float), np.asarray(known_points, float)
    groups = np.unique(np.asarray(image if draw is None else draw), return_inverse=True)[1]
    whiten = _whitening(covariance, len(uv))

    def residuals(names: tuple[str, ...], scaled: Array) -> Array:
        trial = _unscaled(names, scaled)
        ground = georeference_calibrated(trial, poses_at, uv, known[:, 2])
        return np.asarray(np.einsum("nij,nj->ni", whiten, ground[:, :2] - known[:, :2]))

    wanted = tuple(name for name in PARAMETERS if name in estimate)
    usable = np.isfinite(residuals(wanted, np.zeros(len(wanted)))).all(axis=1)
    if usable.sum() < 2:
        raise ValueError("fewer than two points have a pose and meet the ground: nothing to calibrate with")

    def spread(r: Array) -> float:
        """Robust standard deviation of one residual."""
        return max(1.4826 * float(np.median(np.abs(r))), 1e-6)

    def fit(names: tuple[str, ...]) -> tuple[Array, Array, float]:
        """Scaled estimate (P,), residuals (2N,) at it, and the spread of those."""

        def flat(scaled: Array) -> Array:
            # A trial that tips a ray over the horizon is far off; a large residual turns it back.
            return np.nan_to_num(residuals(names, scaled)[usable], nan=1e6).ravel()

        scaled, r = np.zeros(len(names)), flat(np.zeros(len(names)))
        if names:
            # What counts as far out is only known once the constant errors are taken off: hence three rounds.
            for _ in range(3):
                solution = least_squares(flat, scaled, jac="3-point", loss="soft_l1", f_scale=spread(r))
                scaled, r = solution.x, flat(solution.x)
        return scaled, r, spread(r)

    def derivative(names: tuple[str, ...], scaled: Array, step: float = 1e-5) -> Array:
        """Derivative (2N, P) of the residuals by central differences."""
        columns = [
            (residuals(names, scaled + step * axis) - residuals(names, scaled - step * axis))[usable].ravel()
            / (2 * step)
            for axis in np.eye(len(names))
        ]
        return np.stack(columns, axis=-1) if columns else np.zeros((2 * int(usable.sum()), 0))

    names, undetermined = wanted, dict[str, tuple[str, ...]]()
    while True:
        scaled, r, noise = fit(names)
        J = derivative(names, scaled)
        blurred = _undetermined(names, J, noise)
        if blurred is None:
            break
        name, partners = blurred
        undetermined[name] = partners
        names = tuple(other for other in names if other != name)
    scale = np.array([PARAMETERS[name] for name in names])
    clustered = _clustered_covariance(J, r, np.repeat(groups[usable], 2), noise)
    return Calibration(
        names=names,
        values=scaled * scale,
        covariance=clustered * np.outer(scale, scale),
        undetermined=undetermined,
        n_points=int(usable.sum()),
        n_images=len(np.unique(np.asarray(image)[usable])),
    )


def split_images(image: Sequence[object] | np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Halves for cross-validation.

    Whole images move together, for their points share one pose error.

    Parameters
    ----------
    image
        (N,) which image each point belongs to.
    rng
        Shuffles the images.

    Returns
    -------
    (N,) bool, whether the image of each point fell into the first half.
    """
    labels, index = np.unique(np.asarray(image), return_inverse=True)
    first = np.zeros(len(labels), bool)
    first[rng.permutation(len(labels))[: (len(labels) + 1) // 2]] = True
    return np.asarray(first[index])


def _unscaled(names: tuple[str, ...], scaled: Array) -> Calibration:
    values = scaled * np.array([PARAMETERS[name] for name in names])
    return Calibration(names, values, np.zeros((len(names), len(names))), {}, 0, 0)


def _whitening(covariance: ArrayLike | None, n: int) -> Array:
    """(N, 2, 2) factors that give a residual unit covariance; identity without covariances."""
    if covariance is None:
        return np.broadcast_to(np.eye(2), (n, 2, 2))
    C = np.array(covariance, float)
    lost = ~np.isfinite(C).all(axis=(1, 2))
    C[lost] = np.eye(2)
    W = np.linalg.inv(np.linalg.cholesky(C))
    W[lost] = np.nan
    return W


def _undetermined(names: tuple[str, ...], J: Array, noise: float) -> tuple[str, tuple[str, ...]] | None:
    """The parameter to give up, if any, with those it cannot be told apart from.

    ``J`` (2N, P) is per usual size of each parameter. A direction is lost when the data determine it no
    better than one already knew, or when columns are so nearly parallel (correlation beyond 0.99) that only
    the curvature of the projection keeps them apart. The last parameter in rank with a say in it is given up.
    """
    if not names:
        return None
    length = np.linalg.norm(J, axis=0)
    _, singular, directions = np.linalg.svd(J, full_matrices=False)
    if singular[-1] > noise:
        _, parallel, directions = np.linalg.svd(J / length, full_matrices=False)
        if parallel[-1] > PARALLEL:
            return None
    involved = [i for i in range(len(names)) if abs(directions[-1, i]) > 0.3]
    return names[involved[-1]], tuple(names[i] for i in involved[:-1])


def _clustered_covariance(J: Array, r: Array, groups: Array, noise: float) -> Array:
    """Covariance (P, P) of the scaled estimate when residuals of one image go together (the sandwich).

    The loss is soft_l1: its slope at ``r`` is ``r / sqrt(1 + z)`` and its curvature ``(1 + z) ** -1.5`` with
    ``z = (r / noise) ** 2``.
    """
    z = (r / noise) ** 2
    slope, curvature = r / np.sqrt(1 + z), (1 + z) ** -1.5
    bread = np.linalg.pinv(J.T @ (curvature[:, None] * J))
    labels = np.unique(groups)
    scores = np.stack([J[groups == g].T @ slope[groups == g] for g in labels])
    small_sample = len(labels) / max(len(labels) - 1, 1)
    return np.asarray(bread @ (scores.T @ scores) @ bread * small_sample)
