"""Where rays meet rolling ground, and how warm it is there, compiled.

All of it stands in one file, for the compiler's cache looks at one file only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled
from wildlab.simulation.scene.kernels import sampled

#: Any array: the types are the compiler's business.
Array = Any

#: The most steps of a ray over the ground; one that needs more looks at the horizon.
MOST_STEPS = 4000
#: How near a ray comes to the ground, m, and after how many refinements of the last step it is near enough.
CLOSE, REFINEMENTS = 1e-6, 60


@compiled
def channels(tile: Array, per_metre: float, north: float, east: float, out: Array) -> None:
    """Bilinear values of all channels (n, n, c), as `sampled` gives them one by one."""
    a, b = north * per_metre, east * per_metre
    fa, fb = np.floor(a), np.floor(b)
    wa, wb = a - fa, b - fb
    last = tile.shape[0] - 1
    i, j = int(fa) & last, int(fb) & last
    k, m = (i + 1) & last, (j + 1) & last
    for c in range(tile.shape[2]):
        low = tile[i, j, c] + wb * (tile[i, m, c] - tile[i, j, c])
        high = tile[k, j, c] + wb * (tile[k, m, c] - tile[k, j, c])
        out[c] = low + wa * (high - low)


@compiled
def above_ground(
    relief: Array, per_metre: float, p: Array, dn: float, de: float, dd: float, t: float
) -> float:
    """How far a ray is above the ground after t, m."""
    high = sampled(relief[:, :, 0], per_metre, p[0] + t * dn, p[1] + t * de)
    return float(-(p[2] + t * dd) - high)


@compiled
def meet(
    relief: Array, per_metre: float, lowest: float, highest: float, p: Array, dn: float, de: float, dd: float
) -> float:
    """Where along a unit vector a ray meets the ground, m; negative where it does not.

    It goes by cells of the relief, as long as it is between the highest and the lowest ground, and looks for
    the place in the step in which it came under it; a crest that a ray only just touches may be passed over.
    """
    if dd <= 1e-4:
        return -1.0
    first = max((-p[2] - highest) / dd, 0.0)
    last = (-p[2] - lowest) / dd + 1e-6
    level = np.sqrt(dn * dn + de * de)
    step = last - first
    if level > 1e-9:
        step = min(step, 1.0 / per_metre / level)
    before, over = first, above_ground(relief, per_metre, p, dn, de, dd, first)
    if over < 0:
        return -1.0 if first <= 0 else first
    for _ in range(MOST_STEPS):
        now = min(before + step, last)
        under = above_ground(relief, per_metre, p, dn, de, dd, now)
        if under <= 0 or now >= last:
            under = min(under, -1e-12)
            # Within a patch the height is smooth along the ray: false position, halved where it is slow.
            for turn in range(REFINEMENTS):
                share = over / (over - under) if turn % 3 < 2 else 0.5
                middle = before + share * (now - before)
                left = above_ground(relief, per_metre, p, dn, de, dd, middle)
                if abs(left) < CLOSE:
                    return float(middle)
                if left > 0:
                    before, over = middle, left
                else:
                    now, under = middle, left
            return float(0.5 * (before + now))
        before, over = now, under
    return -1.0


@compiled
def meet_all(
    relief: Array, per_metre: float, lowest: float, highest: float, p: Array, directions: Array, out: Array
) -> None:
    """Fills ``out`` (N, 3) with where rays along ``directions`` (N, 3) in n meet the ground; NaN for none."""
    for i in range(len(directions)):
        dn, de, dd = directions[i, 0], directions[i, 1], directions[i, 2]
        size = 1 / np.sqrt(dn * dn + de * de + dd * dd)
        dn, de, dd = dn * size, de * size, dd * size
        t = meet(relief, per_metre, lowest, highest, p, dn, de, dd)
        if t < 0:
            out[i] = np.nan
        else:
            out[i, 0], out[i, 1], out[i, 2] = p[0] + t * dn, p[1] + t * de, p[2] + t * dd


@compiled
def render_ground(
    rays: Array, p: Array, R: Array, focal: float, relief: Array, warmth: Array, uneven: Array, scales: Array,
    limits: Array, air: float, sky: float, shaded: float, sunlit: float, out: Array, ground: Array,
) -> None:  # fmt: skip
    """Fills ``out`` (H, W) with temperatures and ``ground`` (H, W) with whether it is ground.

    ``rays`` (H, W, 2) normalised coordinates; ``scales`` (3,) cells per metre of the tiles of relief,
    warmth and unevenness; ``limits`` (2,) lowest and highest ground; ``shaded`` what clouds take of the sun's
    heat; ``sunlit`` unevenness as a share of it.
    """
    rows, columns = out.shape
    slope, warm = np.empty(3), np.empty(5)
    for i in range(rows):
        for j in range(columns):
            x, y = rays[i, j, 0], rays[i, j, 1]
            dn = R[0, 0] * x + R[0, 1] * y + R[0, 2]
            de = R[1, 0] * x + R[1, 1] * y + R[1, 2]
            dd = R[2, 0] * x + R[2, 1] * y + R[2, 2]
            size = 1 / np.sqrt(dn * dn + de * de + dd * dd)
            dn, de, dd = dn * size, de * size, dd * size
            t = meet(relief, scales[0], limits[0], limits[1], p, dn, de, dd)
            ground[i, j] = t >= 0
            if t < 0:
                out[i, j] = sky
                continue
            north, east = p[0] + t * dn, p[1] + t * de
            channels(relief, scales[0], north, east, slope)
            channels(warmth, scales[1], north, east, warm)
            sn, se = slope[1], slope[2]
            norm = 1 / np.sqrt(1 + sn * sn + se * se)
            lit = norm * (warm[3] - sn * warm[1] - se * warm[2])
            lit = max(lit, 0.0) * (1 - shaded)
            # A pixel averages over what is smaller than itself.
            wide = t / (focal * dd) * scales[2] / 4
            rough = (warm[4] + sunlit * lit) / (1 + wide * wide)
            value = warm[0] + lit
            out[i, j] = air + value + rough * sampled(uneven, scales[2], north, east)
