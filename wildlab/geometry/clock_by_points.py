"""The offset of a camera's clock under which known points appear where they were seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.calibration import BORESIGHT, BOUNDS, PARAMETERS, Fit, with_covariance
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.corrections import Calibration, apply_calibration
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.geometry.robust import fit_linear, student_cost

#: Poses of the camera at N sightings, and the points (N, 3) m in n that they are of, had the camera's clock
#: been so many seconds later.
SeenAt = Callable[[float], tuple[CameraPoses, Array]]

#: Offsets (s) that are tried: far ones in steps that a flight's turns are longer than, near ones finely.
FAR_S, FAR_STEP_S, FINE_STEP_S = 30.0, 0.5, 0.05
#: Share of the sightings that has to have a pose under an offset.
SHARE = 0.8
#: Half of the stretch (s) that the derivative by the clock is taken over: see `wildlab.geometry.calibration`.
STEP_S = 0.2
#: An offset this far away (s) is another one, not the flank of the best.
APART_S = 1.5
#: Logarithm of how much more likely the best offset has to be than any other, for each draw of the errors.
CERTAIN = 5.0


class ClockByPoints(NamedTuple):
    """What to add to the camera's stamps, from known points.

    Attributes
    ----------
    offset_s, sd_s
        s; the standard deviation follows from how far the estimate moves when one draw is left out. NaN where
        there are fewer than two.
    angles
        (3,) rad, the boresight that goes with it: roll, tilt, pan of the camera's base, to be added.
    offsets, cost
        (K,) s and the curve: negative log-likelihood of a sighting, on average, under each offset with the
        boresight that suits it best. NaN where too few have a pose.
    rival_s, margin
        The best offset that is not the flank of this one, and how much less likely all sightings together are
        under it, as a logarithm by draws: errors of one draw are counted once.
    points, images, draws
        What it rests on.
    """

    offset_s: float
    sd_s: float
    angles: Array
    offsets: Array
    cost: Array
    rival_s: float
    margin: float
    points: int
    images: int
    draws: int

    @property
    def certain(self) -> bool:
        """Whether one offset stands out, with a known uncertainty, a boresight that can be, and inside of
        what was tried."""
        tried = self.offsets[np.isfinite(self.cost)]
        inside = tried.min() + APART_S / 2 < self.offset_s < tried.max() - APART_S / 2
        can_be = (np.abs(self.angles) <= [BOUNDS[name] for name in BORESIGHT]).all()
        return bool(np.isfinite(self.sd_s) and self.margin > CERTAIN and inside and can_be)


def clock_by_points(
    seen_at: SeenAt,
    uv: ArrayLike,
    image: Sequence[object] | NDArray[np.generic],
    draw: Sequence[object] | NDArray[np.generic] | None = None,
) -> ClockByPoints | None:
    """The offset of the camera's clock that minimises robust reprojection residuals.

    Under each offset the boresight (three angles) is the best there: a misaligned camera shifts points along
    the track, as a late clock does, but the same way on every course.

    Parameters
    ----------
    seen_at
        Poses and points under an offset, NaN where one is not known.
    uv
        (N, 2) pixels at which the points were seen.
    image
        (N,) which image each is in.
    draw
        (N,) which share their error; those of an image, if not given.

    Returns
    -------
    ClockByPoints, or None where fewer than four sightings have a pose and a point under any offset.
    """
    pixels = np.asarray(uv, float)

    kept: dict[float, tuple[CameraPoses, Array]] = {}

    def residuals(offset: float, angles: Array) -> Array:
        if offset not in kept:
            kept.clear()
            kept[offset] = seen_at(offset)
        poses, points = kept[offset]
        trial = Calibration(BORESIGHT, angles, np.zeros((3, 3)), {}, 0, 0)
        turned = replace(poses, mount=apply_calibration(trial, poses.mount))
        return np.asarray(ground_to_pixel(poses.camera, points, turned.p_nc, turned.R_nc) - pixels)

    def best_angles(offset: float, start: Array, rounds: int) -> tuple[Array, Array]:
        """Angles and residuals (N, 2) there, NaN for what has none."""
        angles, r = start, residuals(offset, start)
        for _ in range(rounds):
            good = np.isfinite(r).all(axis=1)
            if good.sum() < 4:
                break
            J = _derivatives(partial(residuals, offset), angles)[good]
            step = fit_linear(np.nan_to_num(J), r[good]).x
            trial = residuals(offset, angles + step)
            if not np.isfinite(trial[good]).all() or student_cost(_squares(trial[good])) > student_cost(
                _squares(r[good])
            ):
                break
            angles, r = angles + step, trial
        return angles, r

    def curve(offsets: Array, start: Array) -> tuple[Array, list[Array]]:
        found = [best_angles(float(o), start, 3) for o in offsets]
        good = [np.isfinite(r).all(axis=1) for _, r in found]
        enough = max(4.0, SHARE * max(int(g.sum()) for g in good))
        cost = [
            student_cost(_squares(r[g])) / g.sum() if g.sum() >= enough else np.nan
            for (_, r), g in zip(found, good, strict=True)
        ]
        return np.array(cost), [angles for angles, _ in found]

    far = np.arange(-FAR_S, FAR_S + FAR_STEP_S / 2, FAR_STEP_S)
    cost, angles = curve(far, np.zeros(3))
    if not np.isfinite(cost).any():
        return None
    k = int(np.nanargmin(cost))
    fine = far[k] + np.arange(-2 * FAR_STEP_S, 2 * FAR_STEP_S + FINE_STEP_S / 2, FINE_STEP_S)
    fine_cost, fine_angles = curve(fine, angles[k])
    if np.isfinite(fine_cost).any():
        k = int(np.nanargmin(fine_cost))
        offset, turn = float(fine[k]), fine_angles[k]
    else:
        offset, turn = float(far[k]), angles[k]
    offset, turn, fit = _settled(residuals, offset, turn)
    groups = np.asarray(image if draw is None else draw)
    calibration = with_covariance(fit, np.asarray(image), groups)
    offsets, every = np.append(far, fine), np.append(cost, fine_cost)
    order = np.argsort(offsets, kind="stable")
    rival, margin = _rival(far, cost, offset, float(np.nanmin(every)), calibration.n_draws)
    return ClockByPoints(
        offset,
        calibration.sd("clock"),
        turn,
        offsets[order],
        every[order],
        rival,
        margin,
        calibration.n_points,
        calibration.n_images,
        calibration.n_draws,
    )


def _settled(
    residuals: Callable[[float, Array], Array], offset: float, turn: Array
) -> tuple[float, Array, Fit]:
    """Offset and angles where derivatives wider than the log's noise see nothing to gain."""
    near = np.stack([residuals(offset + step, turn) for step in (0.0, -STEP_S, STEP_S)])
    usable = np.asarray(np.isfinite(near).all(axis=(0, 2)), np.bool_)
    sizes = np.array([PARAMETERS["clock"]] + [PARAMETERS[name] for name in BORESIGHT])
    start, x = offset, np.concatenate([[offset], turn])
    for _ in range(12):
        r = residuals(x[0], x[1:])[usable]
        by_clock = (residuals(x[0] + STEP_S, x[1:]) - residuals(x[0] - STEP_S, x[1:]))[usable] / (2 * STEP_S)
        by_angle = _derivatives(partial(residuals, float(x[0])), x[1:])[usable]
        J = np.nan_to_num(np.concatenate([by_clock[..., None], by_angle], axis=-1))
        r = np.nan_to_num(r, nan=1e4)
        step = fit_linear(J, r).x if len(r) else np.zeros(4)
        if abs(x[0] + step[0] - start) > APART_S:
            break
        x = x + step
        if (np.abs(step) < 1e-4 * sizes).all():
            break
    return float(x[0]), x[1:], Fit(("clock", *BORESIGHT), x, {}, usable, J, r)


def _derivatives(residuals: Callable[[Array], Array], angles: Array) -> Array:
    """(N, 2, 3) by each angle."""
    return np.stack(
        [(residuals(angles + 1e-5 * e) - residuals(angles - 1e-5 * e)) / 2e-5 for e in np.eye(3)], axis=-1
    )


def _squares(r: Array) -> Array:
    return np.asarray((r**2).sum(axis=1))


def _rival(offsets: Array, cost: Array, best: float, least: float, draws: int) -> tuple[float, float]:
    """The best offset that is apart from the best of all, and by how much that is less likely."""
    other = np.where(np.abs(offsets - best) > APART_S, cost, np.nan)
    if not np.isfinite(other).any():
        return float("nan"), 0.0
    k = int(np.nanargmin(other))
    return float(offsets[k]), float((other[k] - least) * draws)
