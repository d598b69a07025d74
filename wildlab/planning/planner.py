"""Where to fly and look next, by what is to be learnt: the receding horizon of F 5.3.2.

A planner looks some steps ahead, of which the first is flown; then it plans anew. A step is a straight leg of
a few seconds on one of several headings, with the camera at one of several angles. All that a planner knows
is the grid with its information, the ground, and the camera; where animals are it is not told.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Indices, Mask
from wildlab.geometry.terrain import Terrain
from wildlab.geometry.viewsheds import lines_clear
from wildlab.planning.information import SearchSensor, trace_of_inverse
from wildlab.planning.legs import (
    Flying,
    Leg,
    Platform,
    heading_change,
    leg_positions,
    look_attitude,
    sideways_limit,
    turn_between,
)


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
    asked
        How many candidate steps were weighed.
    """

    leg: Leg
    gain: float
    asked: int


class InformationPlanner:
    """A grid with what is known of it, and how to learn more. F 5.3.2.

    Parameters
    ----------
    points
        (N, 3) of the grid in n, m.
    Y
        (N, 3, 3) information of each at the beginning, 1/m^2, as
        `wildlab.planning.information.initial_information` has it.
    terrain
        Ground over which the platform keeps its height.
    sensor, flying, horizon
        What the camera sees, what the platform can do, and how steps are chosen.
    hides
        Whether the ground can hide points from where candidate steps look; without, candidates take all lines
        of sight for clear, which is exact where no slope is as steep as a line of sight, and far quicker.

    Raises
    ------
    WildlabError
        Where there are not as many matrices as points, or nothing is known of a point at all.
    """

    def __init__(
        self,
        points: ArrayLike,
        Y: ArrayLike,
        terrain: Terrain,
        sensor: SearchSensor,
        flying: Flying,
        horizon: Horizon,
        *,
        hides: bool = False,
    ) -> None:
        self.points = np.ascontiguousarray(points, float)
        self.Y = np.array(Y, float)
        if self.Y.shape != (len(self.points), 3, 3):
            raise WildlabError(
                f"{len(self.points)} points and matrices of the shape {self.Y.shape}",
                "give one matrix (3, 3) for each point",
                field="Y",
            )
        self.left = np.array(trace_of_inverse(self.Y))
        if not np.isfinite(self.left).all():
            raise WildlabError(
                f"of {int((~np.isfinite(self.left)).sum())} points nothing is known in some direction",
                "begin with a small value on the diagonal (initial_information)",
                field="Y",
            )
        self.weights = np.ones(len(self.points))
        self.terrain, self.sensor, self.flying, self.horizon = terrain, sensor, flying, horizon
        self.hides = hides
        self._near = horizon.steps * flying.speed * flying.step
        # What lies beyond the horizon is weighed by blocks, two steps wide.
        corner = np.floor(self.points[:, :2] / (2 * flying.speed * flying.step)).astype(np.int64)
        _, self._block = np.unique(corner, axis=0, return_inverse=True)
        self._block = self._block.ravel()
        each = np.bincount(self._block)
        sums = [np.bincount(self._block, self.points[:, axis]) for axis in (0, 1)]
        self._middles = np.stack(sums, axis=-1) / each[:, None]
        self._half = np.array([sensor.half_width, sensor.half_height])

    def add(self, leg: Leg, clear: Mask | None = None) -> None:
        """Add what the images of a leg tell, F (5.10).

        Parameters
        ----------
        leg
            As flown.
        clear
            (L, N) whether nothing hides each point; None asks the terrain, whatever candidates do.
        """
        from wildlab.planning.information_kernels import after_images

        if clear is None:
            clear = self._lines(leg.p_nc[None], self._reach(leg.p_nc[None], leg.R_nc[None]))[0]
        s = self.sensor
        after_images(
            self.Y, self.left, self.weights, self.points, leg.p_nc, leg.R_nc, leg.counts, clear, self._half,
            s.sd, s.reach, s.nearest,
        )  # fmt: skip

    def wait(self, q: float) -> None:
        """Let what is known wear off, F (5.5), by a walk of the variance ``q`` (m^2) each way."""
        from wildlab.planning.information_kernels import grow_old_all

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
        from wildlab.planning.information_kernels import after_images, gains_of_steps, worth_beyond

        h, s = self.horizon, self.sensor
        states = [platform]
        Y, left = self.Y[None], self.left[None]
        worth, gained, late = np.zeros(1), np.zeros(1), np.zeros(1)
        first: list[Leg] = []
        asked = 0
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
            reach = self._reach(cams, R)
            clear = self._clear(cams, reach)
            limits = reach.max(axis=1) + self.flying.speed * self.flying.step
            gains = gains_of_steps(
                Y, left, self.weights, self.points, parents, cams, R, counts, limits, clear, self._half,
                s.sd, s.reach, s.nearest,
            )  # fmt: skip
            asked += gains.size
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
                for n, (k, leg) in enumerate(zip(ks, legs, strict=True)):
                    lines = clear[k] if len(clear) else np.zeros((0, 0), bool)
                    after_images(
                        Y[n], left[n], self.weights, self.points, leg.p_nc, leg.R_nc, leg.counts, lines,
                        self._half, s.sd, s.reach, s.nearest,
                    )  # fmt: skip
                states = [leg.end for leg in legs]
        return Chosen(first[0], float(gained[0]), asked)

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

    def _clear(self, cams: Array, reach: Array) -> Mask:
        """As `_lines`, or (0, 0, 0) where candidates take all lines of sight for clear."""
        return self._lines(cams, reach) if self.hides else np.zeros((0, 0, 0), bool)

    def _lines(self, cams: Array, reach: Array) -> Mask:
        """(K, L, N) whether nothing hides a point that counts and lies within reach (K, L)."""
        away = np.linalg.norm(self.points[:, :2] - cams[:, :, None, :2], axis=-1)
        k, image, i = np.nonzero((away <= reach[..., None]) & (self.weights > 0))
        clear = np.zeros(away.shape, bool)
        clear[k, image, i] = lines_clear(self.terrain, self.points[i], cams[k, image])
        return clear
