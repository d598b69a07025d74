"""The offset of a camera's clock, by how images moved as it turned."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import Akima1DInterpolator

from wildlab.geometry.frames import Array

#: Offsets (s) that are tried: in steps that a flight's turns are longer than.
FAR_S = 30.0
#: Steps (s) near the best offset.
MOTION_STEP_S = 0.005
#: Samples of the log closer than this (s) are thinned.
LOG_STEP_S = 0.01
#: Another peak is one that is so many times the width of the best away, and so many seconds.
WIDTHS, PEAKS_APART_S = 2.0, 0.3
#: Pairs of images that are needed, and the share of those with the most that an offset must have of them.
FEWEST, PAIRS_SHARE = 30, 0.7
#: Stretches of time whose errors are taken to be independent.
DRAWS = 20
#: The correlation that a peak has to have, and the logarithm of how much more likely it has to be than any
#: other, for each draw of the errors.
LEAST, MOTION_CERTAIN = 0.3, 5.0
#: Standard deviation that all pairs share, by the time between two images: where the axis of the turn turns
#: too, the mean of the rates is not quite the motion.
INTERVAL_SHARE = 0.01
#: Height (m) above the ground that translation is divided by at least: the log's ground may lie elsewhere.
LOWEST_M = 10.0


class ClockByMotion(NamedTuple):
    """What to add to the camera's stamps, from the motion of images.

    Attributes
    ----------
    offset_s, sd_s
        s; the standard deviation follows from how far the peak moves when one stretch of time is left out,
        and is at least `INTERVAL_SHARE` of the time between images.
    offsets, correlation
        (K,) s and the curve: how well motion seen and motion logged go together under each offset, from 0 to
        1, negative where they go against each other. NaN where too few pairs have both.
    rival_s, rival_correlation, margin
        The next best peak, and how much less likely it is, as a logarithm by draws.
    gain
        Motion seen for a motion logged: about 1 where camera, mount and log belong together.
    pairs
        Of images that it rests on.
    """

    offset_s: float
    sd_s: float
    offsets: Array
    correlation: Array
    rival_s: float
    rival_correlation: float
    margin: float
    gain: float
    pairs: int

    @property
    def peak(self) -> float:
        """The best correlation."""
        return float(np.nanmax(self.correlation))

    @property
    def certain(self) -> bool:
        """Whether one peak stands out, of a height that means something and not at the edge."""
        tried = self.offsets[np.isfinite(self.correlation)]
        inside = tried.min() + PEAKS_APART_S < self.offset_s < tried.max() - PEAKS_APART_S
        likely = self.peak >= LEAST and self.margin > MOTION_CERTAIN and 0.3 < self.gain < 3.0
        return bool(inside and likely and np.isfinite(self.sd_s))


def translation_over_ground(p_nc: Array, R_nc: Array) -> Array:
    """Integrate the image motion that travel over level ground causes, at the optical axis.

    With the velocity ``v`` in c, down ``n`` in c and the height ``h``, a plane's homography has the rate
    ``-v n^T / h``: a motion of ``(-v_x n_z, -v_y n_z, (v_x n_y - v_y n_x) / 2) / h``.

    Parameters
    ----------
    p_nc, R_nc
        (T, 3) m and (T, 3, 3), of the camera; ground is at zero.

    Returns
    -------
    (T, 3)
        Two tangents and a turn (rad), zero at first.
    """
    R, height = (R_nc[:-1] + R_nc[1:]) / 2, -(p_nc[:-1, 2] + p_nc[1:, 2]) / 2
    v, n = np.einsum("nji,nj->in", R, np.diff(p_nc, axis=0)), R[:, 2].T
    steps = np.stack([-v[0] * n[2], -v[1] * n[2], (v[0] * n[1] - v[1] * n[0]) / 2], axis=1)
    steps /= np.maximum(height, LOWEST_M)[:, None]
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def clock_by_motion(
    spans: ArrayLike, motion: ArrayLike, times: ArrayLike, turned: ArrayLike, moved: ArrayLike
) -> ClockByMotion | None:
    """The offset of the camera's clock by the peak of the correlation of two motions.

    What is seen is ``g (-w_y, w_x, -w_z) + k m + c``: of the camera's angular velocity ``w`` in c and of its
    travel, ``m`` from `translation_over_ground`. Gains ``g``, ``k`` and constants ``c`` (3,) are fitted under
    each offset, so that neither the log's scale nor a bias of gyros nor the height of the ground counts.

    Parameters
    ----------
    spans
        (N, 2) s by the camera's clock, of two images each.
    motion
        (N, 3) how the scene moved between them, from `wildlab.detection.flow`; NaN is left out.
    times
        (T,) s of the log, increasing.
    turned
        (T, 3) rad, the integral of the camera's angular velocity in c up to each.
    moved
        (T, 3) from `translation_over_ground`.

    Returns
    -------
    ClockByMotion, or None where fewer than `FEWEST` pairs lie within the log under any offset.
    """
    span, seen = np.asarray(spans, float), np.asarray(motion, float)
    good = np.isfinite(span).all(axis=1) & np.isfinite(seen).all(axis=1) & (span[:, 1] > span[:, 0])
    span = span[good]
    if len(span) < FEWEST:
        return None
    apart = (span[:, 1] - span[:, 0])[:, None]
    seen = seen[good] / apart
    # A pair that is followed wrongly is far out; half of the scatter tells how far.
    middle = np.median(seen, axis=0)
    scale = 1.4826 * np.median(np.abs(seen - middle), axis=0)
    seen = np.clip(seen, middle - 8 * scale, middle + 8 * scale)
    t = np.asarray(times, float)
    sums = np.hstack([np.asarray(turned, float), np.asarray(moved, float)])
    # Between samples closer than these, integrals are as good as straight.
    near = (t >= span.min() - FAR_S - 1) & (t <= span.max() + FAR_S + 1)
    if near.sum() < 2:
        return None
    t, sums = t[near], sums[near]
    every = max(1, int(LOG_STEP_S / max(float(np.median(np.diff(t))), 1e-6)))
    t, sums = np.append(t[:-1:every], t[-1]), np.vstack([sums[:-1:every], sums[-1]])
    integral = Akima1DInterpolator(t, sums)

    def logged(offset: float) -> tuple[Array, Array]:
        """Which pairs lie within the log, and mean rates (n, 6) of these."""
        at = span + offset
        inside = (at[:, 0] >= t[0]) & (at[:, 1] <= t[-1])
        return inside, (integral(at[inside, 1]) - integral(at[inside, 0])) / apart[inside]

    def fit(offset: float) -> tuple[float, float, Array]:
        """Correlation, gain and squares (N,) left over, NaN outside; whitened by the scatter seen."""
        inside, rates = logged(offset)
        left = np.full(len(span), np.nan)
        if inside.sum() < FEWEST or inside.sum() < PAIRS_SHARE * most:
            return np.nan, np.nan, left
        y = seen[inside] - seen[inside].mean(axis=0)
        weight = 1 / np.maximum(y.std(axis=0), 1e-12)
        w, v = np.split(rates - rates.mean(axis=0), 2, axis=1)
        turning = (np.stack([-w[:, 1], w[:, 0], -w[:, 2]], axis=1) * weight).ravel()
        moving, target = (v * weight).ravel(), (y * weight).ravel()
        # Translation alone explains some of it under any offset; what turning adds is the signal.
        along = float(moving @ moving)
        if along > 0:
            turning = turning - moving * (moving @ turning) / along
            target = target - moving * (moving @ target) / along
        power = float(turning @ turning)
        gain = float(turning @ target) / power if power > 0 else 0.0
        over = target - gain * turning
        total = float(target @ target)
        share = 1 - float(over @ over) / total if total > 0 else 0.0
        left[inside] = (over.reshape(-1, 3) ** 2).sum(axis=1) / total
        return float(np.sign(gain) * np.sqrt(max(share, 0.0))), gain, left

    step = float(np.clip(np.median(apart) / 2, 0.02, 0.25))
    far = np.arange(-FAR_S, FAR_S + step / 2, step)
    within = [((span[:, 0] + o >= t[0]) & (span[:, 1] + o <= t[-1])).sum() for o in far]
    most = max(within)
    if most < FEWEST:
        return None
    coarse = np.array([fit(float(o))[0] for o in far])
    if not np.isfinite(coarse).any():
        return None
    top = float(far[np.nanargmax(coarse)])
    fine = np.arange(top - 2 * step, top + 2 * step + MOTION_STEP_S / 2, MOTION_STEP_S)
    fits = [fit(float(o)) for o in fine]
    heights = np.array([one[0] for one in fits])
    k = int(np.nanargmax(heights)) if np.isfinite(heights).any() else 0
    offset = _vertex(fine, 1 - heights**2, k)
    offsets, curve = np.append(far, fine), np.append(coarse, heights)
    order = np.argsort(offsets, kind="stable")
    offsets, curve = offsets[order], curve[order]
    rival = _other_peak(offsets, curve, offset)
    best, other = float(np.nanmax(curve)), float(curve[rival]) if rival is not None else 0.0
    margin = DRAWS / 2 * float(np.log((1 - max(other, 0.0) ** 2) / max(1 - best**2, 1e-9)))
    spread = _spread(fine, np.array([one[2] for one in fits]), span.mean(axis=1))
    return ClockByMotion(
        offset,
        float(np.hypot(spread, INTERVAL_SHARE * np.median(apart))),
        offsets,
        curve,
        float(offsets[rival]) if rival is not None else float("nan"),
        other,
        margin,
        fits[k][1],
        int(np.isfinite(fits[k][2]).sum()),
    )


def _vertex(x: Array, y: Array, k: int) -> float:
    """Where the parabola through some values about the least has its vertex."""
    half = max(3, len(x) // 8)
    a, b = max(k - half, 0), min(k + half + 1, len(x))
    good = np.isfinite(y[a:b])
    if good.sum() < 3:
        return float(x[k])
    square, line, _ = np.polyfit(x[a:b][good] - x[k], y[a:b][good], 2)
    moved = -line / (2 * square) if square > 0 else 0.0
    return float(np.clip(x[k] + moved, x[a], x[b - 1]))


def _other_peak(offsets: Array, curve: Array, offset: float) -> int | None:
    """The highest local peak that is not the flank of the best."""
    best = float(np.nanmax(curve))
    wide = np.abs(offsets - offset)[np.isfinite(curve) & (curve < best / 2)]
    width = max(WIDTHS * float(wide.min()) if len(wide) else np.inf, PEAKS_APART_S)
    outside = np.flatnonzero(np.isfinite(curve) & (np.abs(offsets - offset) > width))
    if not len(outside):
        # A peak so wide that nothing lies beside it: the whole curve is its flank.
        return int(np.nanargmin(curve))
    return int(outside[np.argmax(curve[outside])])


def _spread(offsets: Array, squares: Array, at: Array) -> float:
    """Standard deviation of the offset, by leaving out one stretch of time after the other."""
    known = np.isfinite(squares).all(axis=0)
    if known.sum() < FEWEST:
        return float("nan")
    order = np.argsort(at[known], kind="stable")
    parts = np.array_split(np.flatnonzero(known)[order], DRAWS)
    total = squares[:, known].sum(axis=1)
    moved = []
    for part in parts:
        without = total - squares[:, part].sum(axis=1)
        moved.append(_vertex(offsets, without, int(np.argmin(without))))
    apart = np.array(moved) - np.mean(moved)
    return float(np.sqrt((len(parts) - 1) / len(parts) * (apart**2).sum()))
