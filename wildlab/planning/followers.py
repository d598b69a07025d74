"""Planners that ask nothing of what is known: way points in their order (F 5.3.3), and a random walk."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.planning.areas import contains
from wildlab.planning.legs import (
    Flying,
    Leg,
    Platform,
    heading_change,
    leg_positions,
    look_attitude,
    turn_between,
)


class PatternPlanner:
    """Flies to way points in their order and marks those that it has visited, F 5.3.3.

    Whoever calls it may fly elsewhere in between: the next leg leads to the first way point not visited.

    Parameters
    ----------
    way_points
        (M, 2) m.
    terrain
        Ground over which the platform keeps its height.
    flying
        What platform and gimbal can do.
    sides
        (S,) of the camera to the right of straight down, one after the other, an image each, over and over,
        rad.

    Raises
    ------
    WildlabError
        Where there is no way point.
    """

    def __init__(
        self, way_points: ArrayLike, terrain: Terrain, flying: Flying, sides: ArrayLike = (0.0,)
    ) -> None:
        self.way_points = np.asarray(way_points, float).reshape(-1, 2)
        if not len(self.way_points):
            raise WildlabError("there is no way point", "give one at least", field="way_points")
        self.terrain, self.flying = terrain, flying
        self.sides = np.atleast_1d(np.asarray(sides, float))
        self.visited = 0
        self._images = 0

    @property
    def done(self) -> bool:
        """Whether every way point was visited."""
        return self.visited == len(self.way_points)

    def choose(self, platform: Platform) -> Leg:
        """The next leg; one that stays where it is when all is done.

        Parameters
        ----------
        platform
            Where it is, and how the camera looks.

        Returns
        -------
        Leg
        """
        flying = self.flying
        way = np.concatenate([platform.north_east[None], self.way_points[self.visited :]])
        pieces = np.diff(way, axis=0)
        ends = np.concatenate([[0.0], np.cumsum(np.hypot(*pieces.T))])
        at = flying.speed * flying.interval * np.arange(1, flying.images + 1)
        flat = np.stack([np.interp(at, ends, way[:, axis]) for axis in (0, 1)], axis=-1)
        # An image on a way point is taken as one flies up to it.
        piece = np.clip(np.searchsorted(ends, at, side="left") - 1, 0, max(len(pieces) - 1, 0))
        self.visited += int((ends[1:] <= at[-1]).sum())
        heading, waits = np.full(len(at), platform.heading), np.zeros(len(at))
        if len(pieces):
            headings = _headings(pieces, platform.heading)
            heading = headings[piece + 1]
            turns = flying.turning(heading_change(headings[:-1], headings[1:]))
            waits = np.diff(np.cumsum(turns)[piece], prepend=0.0)
        sides = self.sides[(self._images + np.arange(len(at))) % len(self.sides)]
        self._images += len(at)
        R = look_attitude(heading, sides, 0.0)
        turned = turn_between(R, np.concatenate([platform.R_nc[None], R[:-1]]))
        up = self.terrain.heights_at(flat) + flying.height
        p = np.concatenate([flat, -up[:, None]], axis=-1)
        rest = turned <= flying.slew * (flying.interval + waits)
        return Leg(p, R, rest, float(heading[-1]), flying.taken_at(waits))


def _headings(pieces: Array, before: float) -> Array:
    """(P + 1,) headings along pieces (P, 2) of a way, that before it first; no way keeps it."""
    headings = [before]
    for north, east in pieces:
        headings.append(float(np.arctan2(east, north)) if north or east else headings[-1])
    return np.array(headings)


class RandomWalk:
    """Flies on and turns by chance; where that leads out of all areas, it heads for a random spot in one.

    Parameters
    ----------
    areas
        Each (K, 2) north and east, m.
    terrain
        Ground over which the platform keeps its height.
    flying
        What platform and gimbal can do.
    rng
        What chance there is.
    turn_sd
        Of the turn before each leg, rad.
    """

    def __init__(
        self,
        areas: list[Array],
        terrain: Terrain,
        flying: Flying,
        rng: np.random.Generator,
        turn_sd: float = np.radians(45.0),
    ) -> None:
        self.areas, self.terrain, self.flying, self.rng, self.turn_sd = areas, terrain, flying, rng, turn_sd
        self._aim: Array | None = None

    def choose(self, platform: Platform) -> Leg:
        """The next leg, the camera straight down.

        Parameters
        ----------
        platform
            Where it is, and how the camera looks.

        Returns
        -------
        Leg
        """
        here = platform.north_east
        heading = platform.heading + self.rng.normal(0.0, self.turn_sd)
        p = leg_positions(self.terrain, self.flying, here[None], [heading])[0]
        if self._inside(p[-1, :2]):
            self._aim = None
        else:
            # One spot until it is inside again: new ones all the time would keep it between two areas.
            if self._aim is None or not self._inside(self._aim):
                self._aim = self._spot()
            heading = float(np.arctan2(*(self._aim - here)[::-1]))
            p = leg_positions(self.terrain, self.flying, here[None], [heading])[0]
        R = look_attitude(heading, 0.0, 0.0)[None]
        wait = float(self.flying.turning(heading_change(platform.heading, heading)))
        waits = np.append(wait, np.zeros(self.flying.images - 1))
        rest = self.flying.ready(turn_between(R[0], platform.R_nc), wait)
        return Leg(p, R, rest, float(heading), self.flying.taken_at(waits))

    def _inside(self, spot: Array) -> bool:
        return any(contains(area, spot[None])[0] for area in self.areas)

    def _spot(self) -> Array:
        """(2,) anywhere in one of the areas."""
        area = self.areas[int(self.rng.integers(len(self.areas)))]
        while True:
            spot: Array = self.rng.uniform(area.min(axis=0), area.max(axis=0))
            if contains(area, spot[None])[0]:
                return spot
