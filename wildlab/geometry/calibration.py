"""Boresight, lens, position and camera clock from known points in the flight's own images (H 5.3.2).

H (5.15)-(5.17) finds three misalignment angles that bring georeferenced points onto known ones, by nonlinear
least squares. Here the residuals may be weighted with each point's ground covariance, a heavy-tailed
likelihood keeps a wrong click from deciding, and the estimate comes with a covariance that knows that clicks
of one image share the image's pose error. What the data cannot tell apart is named and left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.corrections import (
    BORESIGHT,
    CLOCK_STEP,
    PARAMETERS,
    Calibration,
    PosesAt,
    apply_calibration,
    calibration_jacobian,
    georeference_calibrated,
)
from wildlab.geometry.covariances import independent_count
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.robust import fit_linear, student_cost, student_scale

#: Smallest singular value of the normalised derivatives: 0.1 is two columns with a correlation of 0.99.
PARALLEL = 0.1
#: Steps of an estimate, and how often a step that makes it worse is halved.
ROUNDS, HALVINGS = 30, 8
#: Clocks (s) from which the estimate is tried besides zero, as noise of the log makes wells in the
#: likelihood, and the share of the points that has to have a pose there.
CLOCK_STARTS = tuple(float(s) for s in np.linspace(-1.0, 1.0, 21))
START_SHARE = 0.8


class Fit(NamedTuple):
    """An estimate without its covariance, and what it looks like from there.

    Attributes
    ----------
    names
        The P parameters estimated.
    values
        (P,), in the units of `Calibration`.
    undetermined
        As in `Calibration`.
    usable
        (N,) which points have a pose and meet the ground.
    J
        (M, 2, P) derivatives of the M usable residuals, whitened, per unit of each parameter.
    r
        (M, 2) residuals at the estimate, whitened.
    """

    names: tuple[str, ...]
    values: Array
    undetermined: dict[str, tuple[str, ...]]
    usable: np.ndarray
    J: Array
    r: Array


def fit_points(
    poses_at: PosesAt,
    uv: ArrayLike,
    known_points: ArrayLike,
    estimate: Sequence[str] = BORESIGHT,
    covariance: ArrayLike | None = None,
    thing: ArrayLike | None = None,
) -> Fit:
    """The estimate of `calibrate`, which see, without its covariance: a tenth of the work.

    Parameters
    ----------
    poses_at, uv, known_points, estimate, covariance
        As for `calibrate`.
    thing
        (N,) what each pixel is of, where it is not known where that is: residuals are then from the weighted
        mean of its thing, and north and east of the known points are not looked at.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        Unknown parameter, or no usable point.
    WildlabError
        Where there is another number of poses, or of points, than of pixels.
    """
    unknown = set(estimate) - PARAMETERS.keys()
    if unknown:
        raise ValueError(f"unknown parameters {sorted(unknown)}; known are {list(PARAMETERS)}")
    uv, known = np.asarray(uv, float), np.asarray(known_points, float)
    whiten = _whitening(covariance, len(uv))
    centre = None if thing is None else _Centre(thing, whiten)

    def residuals(names: tuple[str, ...], scaled: Array) -> Array:
        trial = Calibration.in_sizes(names, scaled)
        off = georeference_calibrated(trial, poses_at, uv, known[:, 2])[:, :2] - known[:, :2]
        return whitened(off[..., None])[..., 0]

    def whitened(columns: Array) -> Array:
        return np.asarray(whiten @ (columns if centre is None else centre.subtract(columns)))

    wanted = tuple(name for name in PARAMETERS if name in estimate)
    usable = np.asarray(np.isfinite(residuals(wanted, np.zeros(len(wanted)))).all(axis=1))
    if usable.sum() < 2:
        raise ValueError("fewer than two points have a pose and meet the ground: nothing to calibrate with")

    def fit(names: tuple[str, ...], scaled: Array) -> tuple[Array, Array, float]:
        """Scaled estimate (P,) by Gauss and Newton, residuals (N, 2) at it, and their cost."""
        r = at(names, scaled)
        cost = student_cost((r**2).sum(axis=1))
        for _ in range(ROUNDS if names else 0):
            step = fit_linear(derivative(names, scaled), r)
            for _ in range(HALVINGS):
                trial = at(names, scaled + step)
                found = student_cost((trial**2).sum(axis=1))
                if found <= cost:
                    break
                step = step / 2
            else:
                break
            gained, scaled, r, cost = cost - found, scaled + step, trial, found
            if gained < 1e-6 and np.abs(step).max() < 1e-9:
                break
        return scaled, r, cost

    def settle(names: tuple[str, ...], scaled: Array) -> Array:
        """Where derivatives wider than the wells see nothing to gain; as it was where that is not near."""
        first, reach = scaled, 2 * CLOCK_STEP / PARAMETERS["clock"]
        for _ in range(ROUNDS):
            step = fit_linear(derivative(names, scaled), at(names, scaled))
            scaled = scaled + step
            if np.abs(scaled - first).max() > reach:
                return first
            if np.abs(step).max() < 1e-4:
                return scaled
        return first

    def start(names: tuple[str, ...]) -> Array:
        """The clock under which the points fit best, all else taken as linear; scaled (P,)."""
        clock = PARAMETERS["clock"]
        axis = np.array([name == "clock" for name in names], float)
        others = derivative(names, np.zeros(len(names)))[..., axis == 0]
        best, found = np.inf, np.zeros(len(names))
        for seconds in CLOCK_STARTS:
            r = residuals(names, seconds / clock * axis)[usable]
            good = np.isfinite(r).all(axis=1)
            if good.mean() < START_SHARE:
                continue
            x = fit_linear(others[good], r[good])
            cost = student_cost(((r + others @ x)[good] ** 2).sum(axis=1)) / good.sum()
            if cost < best:
                best, found = cost, seconds / clock * axis
                found[axis == 0] = x
        return found

    def at(names: tuple[str, ...], scaled: Array) -> Array:
        # A trial that tips a ray over the horizon is far off; a large residual turns it back.
        return np.nan_to_num(residuals(names, scaled)[usable], nan=1e6)

    def derivative(names: tuple[str, ...], scaled: Array) -> Array:
        """Derivative (M, 2, P) of the residuals; zero for a ray that misses."""
        J = calibration_jacobian(Calibration.in_sizes(names, scaled), poses_at, uv, known[:, 2])
        return np.nan_to_num(whitened(J * [PARAMETERS[name] for name in names])[usable])

    names, undetermined = wanted, dict[str, tuple[str, ...]]()
    starts = [np.zeros(len(names))] + ([start(names)] if "clock" in names else [])
    while True:
        scaled, r, _ = min((fit(names, at_first) for at_first in starts), key=lambda found: found[2])
        if "clock" in names:
            scaled = settle(names, scaled)
            r = at(names, scaled)
        noise = student_scale((r**2).sum(axis=1))
        J = derivative(names, scaled)
        blurred = undetermined_parameter(names, J.reshape(2 * len(J), -1), noise)
        if blurred is None:
            break
        name, partners = blurred
        undetermined[name] = partners
        starts = [scaled[[other != name for other in names]]]
        names = tuple(other for other in names if other != name)
    scale = np.array([PARAMETERS[name] for name in names])
    return Fit(names, scaled * scale, undetermined, usable, J / scale, r)


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
        follows from how far it moves when one draw is left out.

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
    fit = fit_points(poses_at, uv, known_points, estimate, covariance)
    return with_covariance(fit, image, image if draw is None else draw)


def with_covariance(
    fit: Fit, image: Sequence[object] | np.ndarray, draw: Sequence[object] | np.ndarray
) -> Calibration:
    """An estimate with the covariance that follows from how far it moves when one draw is left out.

    Parameters
    ----------
    fit
        From `fit_points`.
    image, draw
        (N,) which image each point belongs to, and which points share their error.

    Returns
    -------
    Calibration
    """
    images, groups = (np.asarray(of)[fit.usable] for of in (image, draw))
    return Calibration(
        names=fit.names,
        values=fit.values,
        covariance=_jackknife(fit.J, fit.r, groups),
        undetermined=fit.undetermined,
        n_points=len(fit.r),
        n_images=len(np.unique(images)),
        n_draws=len(np.unique(groups)),
    )


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


class _Centre:
    """Takes the mean of its thing, weighted by whitening (N, 2, 2), off each point; NaN for one alone."""

    def __init__(self, thing: ArrayLike, whiten: Array) -> None:
        self._of = np.unique(np.asarray(thing), return_inverse=True)[1]
        self._weights = np.swapaxes(whiten, 1, 2) @ whiten

    def subtract(self, columns: Array) -> Array:
        """Columns (N, 2, K) less the mean of their things."""
        good = np.isfinite(columns).all(axis=(1, 2)) & np.isfinite(self._weights).all(axis=(1, 2))
        of, W = self._of[good], self._weights[good]
        total = np.zeros((int(self._of.max()) + 1, 2, 2 + columns.shape[-1]))
        np.add.at(total, of, np.concatenate([W, W @ columns[good]], axis=-1))
        several = np.bincount(of, minlength=len(total)) > 1
        mean = np.full((len(total), 2, columns.shape[-1]), np.nan)
        mean[several] = np.linalg.solve(total[several, :, :2], total[several, :, 2:])
        return np.asarray(columns - mean[self._of])


def undetermined_parameter(
    names: tuple[str, ...], J: Array, noise: float
) -> tuple[str, tuple[str, ...]] | None:
    """The parameter to give up, if any, with those it cannot be told apart from.

    A direction is lost when the data determine it no better than one already knew, or when columns are so
    nearly parallel (correlation beyond 0.99) that only the curvature of the projection keeps them apart. The
    last parameter in rank with a say in it is given up.

    Parameters
    ----------
    names
        P parameters.
    J
        (M, P) whitened derivatives, per usual size of each parameter.
    noise
        Standard deviation of a whitened residual.

    Returns
    -------
    The parameter and its partners; None where the data determine all.
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


def _jackknife(J: Array, r: Array, groups: np.ndarray) -> Array:
    """Covariance (P, P) of a linear fit: how far it moves when one draw is left out, each in turn.

    It knows that residuals of one draw go together, and errs, where there are few draws, on the safe side.
    Draws in time order that are like their neighbours count for fewer.
    """
    labels = np.unique(groups)
    n = len(labels)
    if n < 2 or not J.shape[-1]:
        return np.full((J.shape[-1],) * 2, np.nan)
    without = np.stack([fit_linear(J[groups != g], r[groups != g]) for g in labels])
    apart = without - without.mean(axis=0)
    apart *= np.sqrt([n / independent_count(one) for one in apart.T])
    return np.asarray((n - 1) / n * apart.T @ apart)


#: H 5.3.2: three points in every image, for three angles.
FEWEST_POINTS = 3


class Mounting(NamedTuple):
    """A mount found from known points.

    Attributes
    ----------
    mount
        With the misalignment found.
    calibration
        The angles on top of the mount that it began with, with their covariance.
    residuals
        (N, 2) metres, north and east: where the pixels fall with that mount, less where the points are.
    range
        Mean distance of the lens from the points, metres.
    """

    mount: Mount
    calibration: Calibration
    residuals: Array
    range: float

    @property
    def error(self) -> float:
        """Mean distance of the points from where their pixels fall, metres (0.0229 m in H 5.6.1)."""
        return float(np.nanmean(np.linalg.norm(self.residuals, axis=1)))


def mounting_from_points(
    poses: CameraPoses, uv: ArrayLike, known_points: ArrayLike, image: Sequence[object] | np.ndarray
) -> Mounting:
    """The misalignment that brings pixels onto known points, H (5.15)-(5.17).

    Parameters
    ----------
    poses
        Of the airframe at each of the N pixels, with the mount to begin with.
    uv
        (N, 2) pixels of the points.
    known_points
        (N, 3) metres in n; their down coordinate is the plane each pixel is cut with.
    image
        (N,) which image each pixel belongs to.

    Returns
    -------
    Mounting

    Raises
    ------
    WildlabError
        Where no image has three points, or the angles cannot be told apart.

    Examples
    --------
    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.georeference import ground_to_pixel
    >>> points = np.array([[x, y, 0.0] for x in (-0.2, 0, 0.2) for y in (-0.2, 0, 0.2)])
    >>> camera, p, level = Camera(640, 512, 1160.0, 1160.0, 313.0, 265.0), np.array([0, 0, -1.2]), np.eye(3)
    >>> turned = CameraPoses(camera, Mount(misalignment=(0.03, 0.07, -0.03)), p, level)
    >>> uv = ground_to_pixel(camera, points, turned.p_nc, turned.R_nc)
    >>> found = mounting_from_points(CameraPoses(camera, Mount(), p, level), uv, points, np.zeros(9))
    >>> print(np.round(found.mount.misalignment, 6), round(found.error, 6))
    [ 0.03  0.07 -0.03] 0.0
    """
    uv, known = np.asarray(uv, float), np.asarray(known_points, float)
    most = int(np.unique(np.asarray(image), return_counts=True)[1].max())
    if most < FEWEST_POINTS:
        raise WildlabError(
            f"no image has more than {most} known points, and {FEWEST_POINTS} are needed for three angles",
            "click more points of the board in each image",
        )
    found = calibrate(lambda _: poses, uv, known, image)
    if found.undetermined:
        name, others = next(iter(found.undetermined.items()))
        raise WildlabError(
            f"{name} cannot be told apart from {' and '.join(others) or 'nothing at all'}",
            "take points from several sides, some far from the middle of the image",
        )
    mount = apply_calibration(found, poses.mount)
    turned = replace(poses, mount=mount)
    ground = georeference_pixels(turned, uv, known[:, 2])
    distance = np.linalg.norm(np.broadcast_to(turned.p_nc, known.shape) - known, axis=1)
    return Mounting(mount, found, ground[:, :2] - known[:, :2], float(distance.mean()))
