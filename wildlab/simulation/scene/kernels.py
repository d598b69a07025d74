"""What each pixel sees, compiled: the sea, the sky, and the layers of bodies; where rays meet rolling
ground, and how warm it is there.

The tests hold it against closed forms: projected outlines, areas, layers, horizon, mirrored sun. All of it
stands in one file, for the compiler's cache looks at one file only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wildlab.geometry.compilation import compiled

#: Any array: the types are the compiler's business.
Array = Any

#: Reflectance of water straight down, in the long-wave infrared.
STRAIGHT = 0.01
#: Samples along each side of a pixel that an outline crosses.
FINE = 5


@compiled
def sky(up: float, air: float, zenith: float) -> float:
    """Temperature of a clear sky by the sine of the elevation, K: as the air at the horizon, colder above."""
    return float(zenith + (air - zenith) * np.exp(-4.0 * max(up, 0.0)))


@compiled
def cell(tile: Array, per_metre: float, north: float, east: float) -> tuple[int, int, int, int, float, float]:
    """Rows i and k, columns j and m of the nodes about a place on a tile that repeats, whose side is a power
    of two, and how far it is from the first to the second."""
    a, b = north * per_metre, east * per_metre
    fa, fb = np.floor(a), np.floor(b)
    last = tile.shape[0] - 1
    i, j = int(fa) & last, int(fb) & last
    return i, (i + 1) & last, j, (j + 1) & last, a - fa, b - fb


@compiled
def sampled(tile: Array, per_metre: float, north: float, east: float) -> float:
    """Bilinear value of a tile."""
    i, k, j, m, wa, wb = cell(tile, per_metre, north, east)
    low = tile[i, j] + wb * (tile[i, m] - tile[i, j])
    high = tile[k, j] + wb * (tile[k, m] - tile[k, j])
    return float(low + wa * (high - low))


@compiled
def channels(tile: Array, per_metre: float, north: float, east: float, out: Array) -> None:
    """Bilinear values of all channels (n, n, c), as `sampled` gives them one by one."""
    i, k, j, m, wa, wb = cell(tile, per_metre, north, east)
    for c in range(tile.shape[2]):
        low = tile[i, j, c] + wb * (tile[i, m, c] - tile[i, j, c])
        high = tile[k, j, c] + wb * (tile[k, m, c] - tile[k, j, c])
        out[c] = low + wa * (high - low)


@compiled
def turned(R: Array, x: float, y: float) -> tuple[float, float, float]:
    """A direction of depth one in c, in n."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2],
        R[1, 0] * x + R[1, 1] * y + R[1, 2],
        R[2, 0] * x + R[2, 1] * y + R[2, 2],
    )


@compiled
def unit(dn: float, de: float, dd: float) -> tuple[float, float, float]:
    """The same direction with length one."""
    size = 1 / np.sqrt(dn * dn + de * de + dd * dd)
    return dn * size, de * size, dd * size


@compiled
def render_sea(
    rays: Array, p: Array, R: Array, focal: float, waves: Array, ripples: Array, patches: Array,
    scales: Array, weather: Array, sun: Array, out: Array, horizon: Array,
) -> None:  # fmt: skip
    """Fills ``out`` (H, W) with apparent temperatures and ``horizon`` (H, W) with whether it is the sea.

    ``rays`` (H, W, 2) normalised coordinates; ``scales`` (3,) cells per metre of the tiles of waves, ripples
    and patches; ``weather`` (4,) temperatures of sea, air, zenith, and glint; ``sun`` (4,) a unit vector
    towards it in n and the width of the glint, zero for none.
    """
    rows, columns = out.shape
    water, air, zenith, glint = weather
    near, wave, ripple = 18 * sun[3] ** 2, np.empty(2), np.empty(2)
    for i in range(rows):
        for j in range(columns):
            dn, de, dd = unit(*turned(R, rays[i, j, 0], rays[i, j, 1]))
            if dd <= 1e-4:
                out[i, j] = sky(-dd, air, zenith)
                horizon[i, j] = False
                continue
            horizon[i, j] = True
            distance = -p[2] / dd
            north, east = p[0] + distance * dn, p[1] + distance * de
            wide = distance / (focal * dd)  # how long a pixel is on the water
            # A pixel averages over what is smaller than itself.
            large, small = wide * scales[0] / 4, wide * scales[1] / 4
            channels(waves, scales[0], north, east, wave)
            channels(ripples, scales[1], north, east, ripple)
            large, small = 1 / (1 + large * large), 1 / (1 + small * small)
            sn, se = large * wave[0] + small * ripple[0], large * wave[1] + small * ripple[1]
            norm = 1 / np.sqrt(1 + sn * sn + se * se)
            nn, ne, nd = -sn * norm, -se * norm, -norm
            cos = max(-(dn * nn + de * ne + dd * nd), 0.02)
            miss = 1 - cos
            square = miss * miss
            reflectance = STRAIGHT + (1 - STRAIGHT) * square * square * miss
            un, ue, ud = dn + 2 * cos * nn, de + 2 * cos * ne, dd + 2 * cos * nd
            value = water + sampled(patches, scales[2], north, east)
            value += reflectance * (sky(-ud, air, zenith) - value)
            if near > 0:
                off = 2 * (1 - (un * sun[0] + ue * sun[1] + ud * sun[2]))  # squared angle, where it is small
                if off < near:
                    bright = min(reflectance / STRAIGHT, 20.0)
                    value += glint * bright * np.exp(-off / (2 * sun[3] * sun[3]))
            out[i, j] = value


@compiled
def outside(edges: Array, first: int, last: int, x: float, y: float) -> float:
    """How far a point is outside of a convex outline, m; negative inside."""
    far = -1e30
    for k in range(first, last):
        d = edges[k, 0] * x + edges[k, 1] * y - edges[k, 2]
        if d > far:
            far = d
    return far


@compiled
def layer_at(
    rx: float, ry: float, p: Array, R: Array, frame: Array, edges: Array, spans: Array, heights: Array,
    found: Array,
) -> int:  # fmt: skip
    """Uppermost layer that a ray meets, or -1; ``found`` gets its place on it and the distance from its edge.

    Seen from above, what meets the higher layer first hides the lower one. ``frame`` (4,) north and east of
    the body, cosine and sine of its course.
    """
    dn, de, dd = turned(R, rx, ry)
    nearest = 1e30
    hit = -1
    for layer in range(len(heights) - 1, -1, -1):
        if dd <= 1e-6:
            continue
        t = (-heights[layer] - p[2]) / dd
        if t <= 0:
            continue
        n, e = p[0] + t * dn - frame[0], p[1] + t * de - frame[1]
        x, y = frame[2] * n + frame[3] * e, -frame[3] * n + frame[2] * e
        far = outside(edges, spans[layer, 0], spans[layer, 1], x, y)
        if abs(far) < nearest:
            nearest = abs(far)
        if far <= 0:
            hit = layer
            found[0], found[1] = x, y
            break
    found[2] = nearest
    return hit


@compiled
def warmth(layer: int, x: float, y: float, values: Array, hot: Array, texture: Array, origin: float) -> float:
    """Excess of a place on a layer, K: even part, texture, and hot places.

    ``values`` (K, 3) excess, texture's deviation and its cells per metre; ``hot`` (M, 5) layer, x, y, width,
    excess.
    """
    value = values[layer, 0]
    if values[layer, 1] > 0:
        value += values[layer, 1] * sampled(texture, values[layer, 2], x + origin, y)
    for k in range(len(hot)):
        if int(hot[k, 0]) == layer:
            a, b = x - hot[k, 1], y - hot[k, 2]
            value += hot[k, 4] * np.exp(-(a * a + b * b) / (2 * hot[k, 3] ** 2))
    return float(value)


@compiled
def render_body(
    rays: Array, step: Array, p: Array, R: Array, box: Array, frame: Array, edges: Array, spans: Array,
    heights: Array, values: Array, hot: Array, texture: Array, water: float, metres: float, number: int,
    out: Array, labels: Array,
) -> float:  # fmt: skip
    """Draws a body over ``out`` (H, W) and ``labels`` (H, W); the number of pixels it covers, with parts.

    Within ``box`` (4,) first and last row and column. ``step`` (2,) how far rays of neighbours are apart;
    ``metres`` how large a pixel is on the body, at most. A pixel that no outline crosses takes one sample,
    the others `FINE` by `FINE`.
    """
    found = np.empty(3)
    covered = 0.0
    for i in range(box[0], box[1]):
        for j in range(box[2], box[3]):
            hit = layer_at(rays[i, j, 0], rays[i, j, 1], p, R, frame, edges, spans, heights, found)
            if hit >= 0:
                labels[i, j] = number
            if found[2] > metres:
                if hit >= 0:
                    covered += 1
                    value = warmth(hit, found[0], found[1], values, hot, texture, 1000.0)
                    out[i, j] = water + value
                continue
            total, hits = 0.0, 0
            for a in range(FINE):
                for b in range(FINE):
                    rx = rays[i, j, 0] + ((b + 0.5) / FINE - 0.5) * step[0]
                    ry = rays[i, j, 1] + ((a + 0.5) / FINE - 0.5) * step[1]
                    one = layer_at(rx, ry, p, R, frame, edges, spans, heights, found)
                    if one >= 0:
                        hits += 1
                        total += water + warmth(one, found[0], found[1], values, hot, texture, 1000.0)
            part = hits / (FINE * FINE)
            covered += part
            if hits:
                out[i, j] = (1 - part) * out[i, j] + part * total / hits
    return covered


@compiled
def render_wake(rays: Array, p: Array, R: Array, box: Array, frame: Array, wake: Array, out: Array) -> None:
    """Adds a wake to ``out``: ``wake`` (4,) where it begins (m ahead of the centre), length, width, K."""
    for i in range(box[0], box[1]):
        for j in range(box[2], box[3]):
            dn, de, dd = turned(R, rays[i, j, 0], rays[i, j, 1])
            if dd <= 1e-6:
                continue
            t = -p[2] / dd
            n, e = p[0] + t * dn - frame[0], p[1] + t * de - frame[1]
            ahead, right = frame[2] * n + frame[3] * e, -frame[3] * n + frame[2] * e
            behind = wake[0] - ahead
            if behind < 0 or behind > wake[1]:
                continue
            width = wake[2] * (0.4 + 0.8 * behind / wake[1])
            fade = 1 - behind / wake[1]
            out[i, j] += wake[3] * fade * np.exp(-((right / width) ** 2))


#: The most steps of a ray over the ground; one that needs more looks at the horizon.
MOST_STEPS = 4000
#: How near a ray comes to the ground, m, and after how many refinements of the last step it is near enough.
CLOSE, REFINEMENTS = 1e-6, 60


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
        dn, de, dd = unit(directions[i, 0], directions[i, 1], directions[i, 2])
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
            dn, de, dd = unit(*turned(R, rays[i, j, 0], rays[i, j, 1]))
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
