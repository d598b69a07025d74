"""Where to fly and look next, and when to go back to an animal that is known: F 5.3.1 and 5.3.2.

Where an animal stands that is at a grid point is known with the covariance P (3, 3), and Y is its inverse. An
image that shows the point adds what two angles tell (5.4), less where an animal may be missed (5.10), and
with time it wears off (5.5); `kernels` has both. What is left to be known is the sum of all tr(Y^-1), (5.6).
F writes this in east-north-up; here it is n, north-east-down. Where the print contradicts itself,
``docs/contradictions.md`` says what holds.

A planner looks some steps ahead, of which the first is flown; then it plans anew. A step is a straight leg of
a few seconds on one of several headings, with the camera at one of several angles. All that a planner knows
is the grid with its information, the ground, and the camera; where animals are it is not told.

The high-level planner takes estimates as they are: positions (m, 2) north and east, m, and covariances
(m, 2, 2), m^2, of the animals that are known. Its objective (5.2) is here, the rule by which an enclosure is
done, and both rules by which an animal that was known is lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.geometry.georeference import Terrain
from wildlab.geometry.viewsheds import in_field_of_view, lines_clear
from wildlab.planning.legs import (
    Flying,
    Leg,
    Platform,
    SearchSensor,
    heading_change,
    leg_positions,
    look_attitude,
    sideways_limit,
    turn_between,
)


@compiled
def inverse_trace(y: Any) -> float:
    """tr(y^-1) of a symmetric matrix (3, 3); infinite where it is not positive definite.

    By pivots rather than by the determinant: where one direction is known ten million times better than
    another, that loses all digits.
    """
    a, b, c = y[0, 0], y[0, 1], y[0, 2]
    if not a > 0:
        return np.inf
    l2, l3 = b / a, c / a
    d2 = y[1, 1] - b * l2
    if not d2 > 0:
        return np.inf
    rest = y[1, 2] - c * l2
    m = rest / d2
    d3 = y[2, 2] - c * l3 - m * rest
    if not d3 > 0:
        return np.inf
    return 1 / a + (l2 * l2 + 1) / d2 + ((l2 * m - l3) ** 2 + m * m + 1) / d3


@compiled
def inverse_traces(Y: Any) -> Any:
    """tr(Y^-1) of each matrix (N, 3, 3), (N,)."""
    return np.array([inverse_trace(y) for y in Y])


@compiled
def add_image(
    points: Any, near: Any, cam: Any, R: Any, clear: Any, half: Any, sd: float, reach: float,
    nearest: float, into: Any, seen: Any,
) -> None:  # fmt: skip
    """Add to ``into`` (N, 3, 3) what an image tells of the points ``near``, and mark those that it shows.

    ``near`` counts points, ``cam`` (3,), ``R`` (3, 3), ``clear`` (N,) or (0,) where nothing hides anything,
    ``seen`` (N,) bool.
    """
    all_clear = len(clear) == 0
    for i in near:
        x, y, z = points[i, 0] - cam[0], points[i, 1] - cam[1], points[i, 2] - cam[2]
        depth = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
        if not depth > 0 or abs(R[0, 0] * x + R[1, 0] * y + R[2, 0] * z) > half[0] * depth:
            continue
        if abs(R[0, 1] * x + R[1, 1] * y + R[2, 1] * z) > half[1] * depth or not (all_clear or clear[i]):
            continue
        seen[i] = True
        rho2 = x * x + y * y
        rho = np.sqrt(rho2)
        r2 = rho2 + z * z
        told = np.exp(-r2 / (reach * reach)) / (sd * sd)
        cos, sin = (x / rho, y / rho) if rho > 0 else (1.0, 0.0)
        turn = told / max(rho, nearest) ** 2
        aside, up = (sin, -cos, 0.0), (cos * z / r2, sin * z / r2, -rho / r2)
        for a in range(3):
            for b in range(3):
                into[i, a, b] += aside[a] * aside[b] * turn + told * up[a] * up[b]


@compiled
def close_points(points: Any, weights: Any, cam: Any, limit: float) -> Any:
    """Which points count and lie within ``limit`` of a camera, seen from above."""
    near = np.empty(len(points), np.int64)
    count = 0
    for i in range(len(points)):
        x, y = points[i, 0] - cam[0], points[i, 1] - cam[1]
        if weights[i] > 0 and not x * x + y * y > limit * limit:
            near[count] = i
            count += 1
    return near[:count]


@compiled
def gains_of_steps(
    Y: Any, left: Any, weights: Any, points: Any, parents: Any, cams: Any, R: Any,
    counts: Any, limits: Any, half: Any, sd: float, reach: float, nearest: float,
) -> Any:  # fmt: skip
    """By how much candidate steps would lower what is left to know, (K, G) m^2.

    ``Y`` (B, N, 3, 3) and ``left`` (B, N) are those of the states that steps begin in, ``parents`` (K,) says
    which. ``cams`` (K, L, 3) are the images' positions of a step, ``R`` (K, G, 3, 3) and ``counts``
    (K, G, L) the attitudes to choose from; no image of a step shows a point further than ``limits`` (K,) from
    where the step ends, seen from above. Nothing hides anything.
    """
    out = np.zeros((len(parents), R.shape[1]))
    into = np.zeros((len(points), 3, 3))
    seen = np.zeros(len(points), np.bool_)
    free = np.ones(0, np.bool_)
    for k in range(len(parents)):
        one = parents[k]
        near = close_points(points, weights, cams[k, cams.shape[1] - 1], limits[k])
        for g in range(R.shape[1]):
            for image in range(cams.shape[1]):
                if counts[k, g, image]:
                    add_image(
                        points, near, cams[k, image], R[k, g], free, half, sd, reach, nearest, into, seen
                    )
            for i in near:
                if not seen[i]:
                    continue
                into[i] += Y[one, i]
                out[k, g] += weights[i] * (left[one, i] - inverse_trace(into[i]))
                seen[i] = False
                into[i] = 0.0
    return out


@compiled
def after_images(
    Y: Any, left: Any, weights: Any, points: Any, cams: Any, R: Any, counts: Any, clear: Any,
    half: Any, sd: float, reach: float, nearest: float,
) -> Any:  # fmt: skip
    """Add what images tell of points that count to ``Y`` (N, 3, 3) and ``left`` (N,), in place.

    ``cams`` (L, 3), ``R`` (L, 3, 3), or (1, 3, 3) for all, ``counts`` (L,), ``clear`` (L, N) or (0, 0). Gives
    (N,) bool, which points the images show.
    """
    into = np.zeros((len(points), 3, 3))
    seen = np.zeros(len(points), np.bool_)
    free = np.ones(0, np.bool_)
    near = close_points(points, weights, cams[0], np.inf)
    for image in range(len(cams)):
        if counts[image]:
            lines = clear[image] if len(clear) else free
            add_image(
                points, near, cams[image], R[min(image, len(R) - 1)], lines, half, sd, reach, nearest, into,
                seen,
            )  # fmt: skip
    for i in range(len(points)):
        if seen[i]:
            Y[i] += into[i]
            left[i] = inverse_trace(Y[i])
    return seen


def worth_beyond(left: Any, middles: Any, parents: Any, ends: Any, length: float) -> Any:
    """What is left to know in blocks, counted less the further they are from where a step ends, (K,) m^2.

    ``left`` (B, S) of each state's blocks, ``middles`` (S, 2), ``ends`` (K, 2) or more columns, ``length``
    the distance at which a block counts 1/e.
    """
    away = np.hypot(*(middles[:, None] - ends[:, :2]).T)
    return (np.maximum(left[parents], 0.0) * np.exp(-away / length)).sum(axis=1)


@compiled
def grow_old_all(Y: Any, left: Any, q: float) -> None:
    """F (5.5) in place, for a walk with the variance ``q`` both ways; and nothing for its height.

    With A the 2 x 2 block of Y for the ground and n the column beside it, A becomes (I + qA)^-1 A and n
    (I + qA)^-1 n, written out so that nothing is subtracted from what is nearly the same.
    """
    for i in range(len(Y)):
        y = Y[i]
        a, b, d, n0, n1 = y[0, 0], y[0, 1], y[1, 1], y[0, 2], y[1, 2]
        det = (1 + q * a) * (1 + q * d) - q * q * b * b
        both = q * (a * d - b * b)
        m0 = ((1 + q * d) * n0 - q * b * n1) / det
        m1 = ((1 + q * a) * n1 - q * b * n0) / det
        y[0, 0], y[0, 1], y[1, 1] = (a + both) / det, b / det, (d + both) / det
        y[2, 2] -= q * (n0 * m0 + n1 * m1)
        y[0, 2], y[1, 2] = m0, m1
        y[1, 0], y[2, 0], y[2, 1] = y[0, 1], m0, m1
        left[i] = inverse_trace(y)


def detection_probability(
    points: ArrayLike,
    p_nc: ArrayLike,
    R_nc: ArrayLike,
    sensor: SearchSensor,
) -> Array:
    """With which probability an animal at a point is found in one image, F (5.8) with (5.9).

    Parameters
    ----------
    points
        (N, 3) in n, m.
    p_nc
        Of the camera, (3,), m.
    R_nc
        (3, 3), takes a vector from c to n.
    sensor
        Field of view and reach; what hides the point is not asked.

    Returns
    -------
    (N,) from 0 to 1; 0 outside of the field of view.

    Examples
    --------
    >>> down = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> sensor = SearchSensor((0.3, 0.2), sd=0.01, reach=100.0)
    >>> ground = [[0.0, 0.0, 0.0], [0.0, 80.0, 0.0]]
    >>> print(np.round(detection_probability(ground, [0.0, 0.0, -50.0], down, sensor), 2))
    [0.78 0.  ]
    """
    away = np.asarray(points, float) - np.asarray(p_nc, float)
    seen = in_field_of_view(sensor.halves, points, p_nc, R_nc)
    return np.where(seen, np.exp(-(away**2).sum(axis=-1) / sensor.reach**2), 0.0)


def initial_information(count: int, sd: ArrayLike) -> Array:
    """What is known before the first image: a small value on the diagonal, for F (5.10) asks for an inverse.

    Parameters
    ----------
    count
        N, of grid points.
    sd
        How far off an animal may be in each direction, m: one number as F has it, or (3,) north, east, down.
        Where the terrain is known, the third is its own standard deviation.

    Returns
    -------
    (N, 3, 3) 1/m^2.

    Examples
    --------
    >>> print(np.diag(initial_information(1, [50.0, 50.0, 1.0])[0]))
    [4.e-04 4.e-04 1.e+00]
    """
    each = np.broadcast_to(np.asarray(sd, float), (3,))
    return np.tile(np.diag(1 / each**2), (count, 1, 1))


@dataclass(frozen=True)
class Horizon:
    """How a planner chooses.

    Attributes
    ----------
    turns
        (H,) of the platform at the beginning of a step, rad to the right. One more candidate is the heading
        to where most is left to know, near points counted more.
    looks
        (G, 2) of the camera away from straight down, rad: to the right side, and ahead.
    steps
        M of F (5.6): how many are looked ahead.
    beam
        How many beginnings are followed up at each step.
    fades
        What is learnt a step later counts so much of what is learnt now, from 0 to 1. A turn delays all that
        comes after it by the time it takes.
    beyond
        What is left to know beyond the horizon counts so much of what it would if it could all be seen on the
        way; F has 0, and then a planner whose horizon holds nothing new flies anywhere.
    """

    turns: tuple[float, ...] = tuple(np.radians([0.0, -45.0, 45.0, -90.0, 90.0, 180.0]))
    looks: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    steps: int = 3
    beam: int = 4
    fades: float = 0.9
    beyond: float = 0.3


class Chosen(NamedTuple):
    """What a planner chose.

    Attributes
    ----------
    leg
        To be flown.
    gain
        By how much all steps of the horizon lower F (5.6), m^2, without fading.
    """

    leg: Leg
    gain: float


class InformationPlanner:
    """A grid with what is known of it, and how to learn more. F 5.3.2.

    Parameters
    ----------
    points
        (N, 3) of the grid in n, m.
    Y
        (N, 3, 3) information of each at the beginning, 1/m^2, as
        `initial_information` has it.
    terrain
        Ground over which the platform keeps its height.
    sensor, flying, horizon
        What the camera sees, what the platform can do, and how steps are chosen.

    Candidate steps take all lines of sight for clear, which is exact where no slope is as steep as one.
    """

    def __init__(
        self,
        points: ArrayLike,
        Y: ArrayLike,
        terrain: Terrain,
        sensor: SearchSensor,
        flying: Flying,
        horizon: Horizon,
    ) -> None:
        self.points = np.ascontiguousarray(points, float)
        self.Y = np.array(Y, float)
        self.left = inverse_traces(self.Y)
        self.weights = np.ones(len(self.points))
        self.terrain, self.sensor, self.flying, self.horizon = terrain, sensor, flying, horizon
        self._near = horizon.steps * flying.speed * flying.step
        # What lies beyond the horizon is weighed by blocks, two steps wide.
        corner = np.floor(self.points[:, :2] / (2 * flying.speed * flying.step)).astype(np.int64)
        _, self._block = np.unique(corner, axis=0, return_inverse=True)
        self._block = self._block.ravel()
        each = np.bincount(self._block)
        sums = [np.bincount(self._block, self.points[:, axis]) for axis in (0, 1)]
        self._middles = np.stack(sums, axis=-1) / each[:, None]
        self._half = np.array(sensor.halves)

    def add(self, leg: Leg, clear: Mask | None = None) -> None:
        """Add what the images of a leg tell, F (5.10).

        Parameters
        ----------
        leg
            As flown.
        clear
            (L, N) whether nothing hides each point; None asks the terrain, whatever candidates do.
        """
        if clear is None:
            clear = self._lines(leg.p_nc[None], self._reach(leg.p_nc[None], leg.R_nc[None]))[0]
        s = self.sensor
        after_images(
            self.Y, self.left, self.weights, self.points, leg.p_nc, leg.R_nc, leg.counts, clear, self._half,
            s.sd, s.reach, s.nearest,
        )  # fmt: skip

    def wait(self, q: float) -> None:
        """Let what is known wear off, F (5.5), by a walk of the variance ``q`` (m^2) each way."""
        grow_old_all(self.Y, self.left, float(q))

    def choose(self, platform: Platform) -> Chosen:
        """The step to be flown next.

        Parameters
        ----------
        platform
            Where it is, and how the camera looks.

        Returns
        -------
        Chosen

        Raises
        ------
        WildlabError
            Where every candidate leaves the map.
        """
        h, s = self.horizon, self.sensor
        states = [platform]
        Y, left = self.Y[None], self.left[None]
        worth, gained, late = np.zeros(1), np.zeros(1), np.zeros(1)
        first: list[Leg] = []
        length = self.flying.speed * self.flying.step / -np.log(h.fades) if h.fades < 1 else np.inf
        for ahead in range(h.steps):
            blocks = self._in_blocks(left)
            parents, headings = self._headings(states, blocks)
            cams = self._positions(states, parents, headings)
            R = self._attitudes(headings)
            before = np.stack([one.R_nc for one in states])[parents]
            was = np.array([one.heading for one in states])[parents]
            waits = self.flying.turning(heading_change(was, headings))
            counts = self.flying.ready(turn_between(R, before[:, None]), waits[:, None])
            # In steps, as fading is: turns up to here delay what follows.
            delay = late[parents] + waits / self.flying.step
            fade = h.fades ** (ahead + delay)
            limits = self._reach(cams, R).max(axis=1) + self.flying.speed * self.flying.step
            gains = gains_of_steps(
                Y, left, self.weights, self.points, parents, cams, R, counts, limits, self._half, s.sd,
                s.reach, s.nearest,
            )  # fmt: skip
            off = ~np.isfinite(cams).all(axis=(1, 2))
            tail = worth_beyond(blocks, self._middles, parents, cams[:, -1], length)
            value = worth[parents][:, None] + fade[:, None] * gains
            # What a step itself learns is no longer left beyond it; where it looks is near where it ends.
            total = value + h.beyond * h.fades * fade[:, None] * (tail[:, None] - gains)
            total[off] = -np.inf
            best = np.argsort(-total, axis=None, kind="stable")[: h.beam if ahead + 1 < h.steps else 1]
            best = best[np.isfinite(total.ravel()[best])]
            if not len(best):
                raise WildlabError("every step leads off the map", "give a map that reaches further")
            ks, gs = np.unravel_index(best, total.shape)
            legs = [
                Leg(cams[k], R[k, g : g + 1], counts[k, g], float(headings[k]), self._at(waits[k]))
                for k, g in zip(ks, gs, strict=True)
            ]
            first = [first[parents[k]] for k in ks] if ahead else legs
            worth, gained, late = value[ks, gs], gained[parents[ks]] + gains[ks, gs], delay[ks]
            if ahead + 1 < h.steps:
                Y, left = Y[parents[ks]].copy(), left[parents[ks]].copy()
                for n, leg in enumerate(legs):
                    after_images(
                        Y[n], left[n], self.weights, self.points, leg.p_nc, leg.R_nc, leg.counts,
                        np.zeros((0, 0), bool), self._half, s.sd, s.reach, s.nearest,
                    )  # fmt: skip
                states = [leg.end for leg in legs]
        return Chosen(first[0], float(gained[0]))

    def _at(self, wait: float) -> Array:
        """(L,) s when images of a step are taken that begins with a turn."""
        return self.flying.taken_at(np.append(wait, np.zeros(self.flying.images - 1)))

    def _in_blocks(self, left: Array) -> Array:
        """(B, S) what is left to know in each block of each state."""
        count = len(self._middles)
        whole = self._block + count * np.arange(len(left))[:, None]
        sums = np.bincount(whole.ravel(), (left * self.weights).ravel(), len(left) * count)
        return np.asarray(sums.reshape(-1, count), float)

    def _headings(self, states: list[Platform], blocks: Array) -> tuple[Indices, Array]:
        """Candidates (K,): which state each begins in, and its heading."""
        each = np.array([one.heading for one in states])[:, None] + np.array(self.horizon.turns)
        away = self._middles - np.stack([one.north_east for one in states])[:, None]
        pull = blocks * np.exp(-np.hypot(away[..., 0], away[..., 1]) / self._near)
        best = away[np.arange(len(states)), np.argmax(pull, axis=1)]
        headings = np.concatenate([each, np.arctan2(best[:, 1], best[:, 0])[:, None]], axis=1)
        parents = np.repeat(np.arange(len(states)), headings.shape[1])
        return parents, headings.ravel()

    def _positions(self, states: list[Platform], parents: Indices, headings: Array) -> Array:
        """(K, L, 3) where images are taken."""
        starts = np.stack([one.north_east for one in states])[parents]
        return leg_positions(self.terrain, self.flying, starts, headings)

    def _attitudes(self, headings: Array) -> Array:
        looks = np.array(self.horizon.looks)
        return look_attitude(headings[:, None], looks[None, :, 0], looks[None, :, 1])

    def _reach(self, cams: Array, R: Array) -> Array:
        """(K, L) how far sideways images with the attitudes (K, G, 3, 3) show any point, m."""
        depth = np.nan_to_num(float(self.points[:, 2].max()) - cams[..., 2])
        return np.asarray(sideways_limit(R, 1.0, self.sensor).max(axis=1)[:, None] * depth)

    def _lines(self, cams: Array, reach: Array) -> Mask:
        """(K, L, N) whether nothing hides a point that counts and lies within reach (K, L)."""
        away = np.linalg.norm(self.points[:, :2] - cams[:, :, None, :2], axis=-1)
        k, image, i = np.nonzero((away <= reach[..., None]) & (self.weights > 0))
        clear = np.zeros(away.shape, bool)
        clear[k, image, i] = lines_clear(self.terrain, self.points[i], cams[k, image])
        return clear


#: What `best_goal` gives where the search for new animals is worth more: F's m + 1.
SEARCH = -1


def utilities(
    positions: ArrayLike,
    covariances: ArrayLike,
    platform: ArrayLike,
    way_point: ArrayLike | None,
    *,
    alpha: float,
    c: float,
) -> Array:
    """What each goal is worth for what it costs, F (5.2).

    The print's exponent of Tr(P) is not readable as anything but the design parameter that its text calls
    alpha, and its C is the text's c.

    Parameters
    ----------
    positions, covariances
        Of the animals that are known, (m, 2) m and (m, 2, 2) m^2.
    platform
        (2,) m.
    way_point
        (2,) the next one of the search, m; None where the search is over.
    alpha
        How much more an animal is worth that is known worse.
    c
        What the search is worth, in the unit of Tr(P)^alpha.

    Returns
    -------
    (m + 1,) the last one is that of the search; infinite for a goal that is reached, none for no way point.

    Examples
    --------
    >>> print(utilities([[30.0, 40.0]], [50 * np.eye(2)], [0.0, 0.0], [0.0, 10.0], alpha=1.0, c=30.0))
    [2. 3.]
    """
    at, here = np.asarray(positions, float).reshape(-1, 2), np.asarray(platform, float)
    spread = np.trace(np.asarray(covariances, float).reshape(-1, 2, 2), axis1=1, axis2=2) ** alpha
    with np.errstate(divide="ignore"):
        known = spread / np.hypot(*(at - here).T)
        if way_point is None:
            return np.append(known, -np.inf)
        return np.append(known, np.divide(c, np.hypot(*(np.asarray(way_point, float) - here))))


def best_goal(
    positions: ArrayLike,
    covariances: ArrayLike,
    platform: ArrayLike,
    way_point: ArrayLike | None,
    *,
    alpha: float,
    c: float,
) -> int:
    """Which animal to go back to, or `SEARCH`, by F (5.3): the greatest of `utilities` as things stand now.

    Parameters
    ----------
    positions, covariances, platform, way_point, alpha, c
        As `utilities` has them.

    Returns
    -------
    int

    Raises
    ------
    WildlabError
        Where there is neither an animal nor a way point.
    """
    worth = utilities(positions, covariances, platform, way_point, alpha=alpha, c=c)
    if worth.max() == -np.inf:
        raise WildlabError("there is no goal left", "end the search when all is done")
    k = int(np.argmax(worth))
    return SEARCH if k == len(worth) - 1 else k
