"""Straight legs of a platform whose camera hangs in a gimbal, and planners that ask nothing of what is known:
way points in their order (F 5.3.3), and a random walk.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.geometry.frames import Array, Mask, euler_to_matrix
from wildlab.geometry.georeference import Terrain
from wildlab.planning.patterns import contains

#: A turn of the camera that is too small to blur an image, rad.
AT_REST = np.radians(0.5)


@dataclass(frozen=True)
class SearchSensor:
    """A camera as a planner sees it: how far its field of view reaches, and what an image tells.

    Attributes
    ----------
    halves
        Tangents of half the angles of view across and down, F (2.23).
    sd
        Standard deviation of both angles of (5.7), rad; a parameter, which F does not print.
    reach
        The ``r`` of (5.9), m: from so far an animal is found in 37 % of the images.
    nearest
        Least horizontal distance at which an azimuth counts, m. Straight below, (5.7) has none, and close to
        it one would tell any amount about a point that stands for a whole cell: half a cell is right.
    """

    halves: tuple[float, float]
    sd: float
    reach: float
    nearest: float = 1.0


@dataclass(frozen=True)
class Flying:
    """What platform and gimbal can do.

    Attributes
    ----------
    speed, height
        Over ground, m/s, and of the camera above the ground below it, m.
    interval
        Between images, s.
    images
        Of one step; a step takes ``images * interval`` seconds.
    slew
        How fast the gimbal turns the camera, rad/s. Images count from when it is at rest: F (5.4) warns that
        those of a fast turn are blurred.
    turn_time
        How long the platform takes to turn round, through 180 degrees, s. It stands still meanwhile, and no
        image is taken; smaller turns take less in proportion.
    """

    speed: float
    height: float
    interval: float = 1.0
    images: int = 3
    slew: float = np.radians(60.0)
    turn_time: float = 0.0

    @property
    def step(self) -> float:
        """Seconds that a step takes, without turns."""
        return self.images * self.interval

    def turning(self, turned: ArrayLike) -> Array:
        """How long turns of the platform take.

        Parameters
        ----------
        turned
            (...) angles, either way, rad.

        Returns
        -------
        (...) s.

        Examples
        --------
        >>> print(Flying(5.0, 60.0, turn_time=4.0).turning(np.radians([0, 45, -180])))
        [0. 1. 4.]
        """
        return np.asarray(self.turn_time * np.abs(turned) / np.pi)

    def taken_at(self, waits: ArrayLike) -> Array:
        """When the images of a step are taken, counted from its beginning.

        Parameters
        ----------
        waits
            (..., images) s that the platform turns before each image.

        Returns
        -------
        (..., images) s.
        """
        each = np.cumsum(np.asarray(waits, float), axis=-1)
        return np.asarray(each + self.interval * np.arange(1, self.images + 1))

    def ready(self, turned: ArrayLike, waits: ArrayLike = 0.0) -> Mask:
        """Which images of a step count where the camera has to turn first.

        Parameters
        ----------
        turned
            (...) by how much the camera turns as the step begins, rad.
        waits
            (...) how long the platform turns before it flies on, s; the gimbal turns meanwhile.

        Returns
        -------
        (..., images) bool.
        """
        at = self.interval * np.arange(1, self.images + 1) + np.asarray(waits, float)[..., None]
        angle = np.asarray(turned, float)[..., None]
        return np.asarray((angle <= AT_REST) | (angle <= self.slew * at))


class Platform(NamedTuple):
    """Where a platform is and how it looks.

    Attributes
    ----------
    north_east
        (2,) m.
    heading
        From north to the east, rad.
    R_nc
        (3, 3) attitude of the camera.
    """

    north_east: Array
    heading: float
    R_nc: Array


class Leg(NamedTuple):
    """One step as it is flown.

    Attributes
    ----------
    p_nc
        (L, 3) where images are taken, m; the last one is where the step ends.
    R_nc
        (L, 3, 3) attitude of the camera in each, or (1, 3, 3) in all.
    counts
        (L,) bool: images for which it is at rest.
    heading
        Of the platform at the end, rad.
    at
        (L,) s from the beginning of the step to each image, with the turns before it.
    """

    p_nc: Array
    R_nc: Array
    counts: Mask
    heading: float
    at: Array

    @property
    def end(self) -> Platform:
        """The platform after the step."""
        return Platform(self.p_nc[-1, :2], self.heading, self.R_nc[-1])


def look_attitude(heading: ArrayLike, side: ArrayLike, ahead: ArrayLike) -> Array:
    """Attitude of a camera whose gimbal turns it away from straight down.

    Parameters
    ----------
    heading
        Of the platform, rad; the top of the image points there.
    side, ahead
        To the right and forward, rad.

    Returns
    -------
    (N, 3, 3) or (3, 3), ``R_nc``.

    Examples
    --------
    >>> print(np.round(look_attitude(0.0, np.radians(90), 0.0)[:, 2], 3) + 0.0)
    [0. 1. 0.]
    """
    return np.asarray(euler_to_matrix(-np.asarray(side, float), ahead, heading) @ R_MC_DOWN)


def turn_between(one: ArrayLike, other: ArrayLike) -> Array:
    """By which angle a camera turns from one attitude to another.

    Parameters
    ----------
    one, other
        (..., 3, 3).

    Returns
    -------
    (...) rad, 0 to pi.
    """
    cos = (np.einsum("...ij,...ij->...", np.asarray(one, float), np.asarray(other, float)) - 1) / 2
    return np.asarray(np.arccos(np.clip(cos, -1.0, 1.0)))


def heading_change(one: ArrayLike, other: ArrayLike) -> Array:
    """By which angle a platform turns from one heading to another, the shorter way.

    Parameters
    ----------
    one, other
        (...) rad.

    Returns
    -------
    (...) rad, 0 to pi.

    Examples
    --------
    >>> print(np.degrees(heading_change(np.radians(170), np.radians(-170))).round(6))
    20.0
    """
    apart = np.asarray(other, float) - np.asarray(one, float)
    return np.asarray(np.abs((apart + np.pi) % (2 * np.pi) - np.pi))


def sideways_limit(R_nc: ArrayLike, depth: ArrayLike, sensor: SearchSensor) -> Array:
    """How far sideways a camera can see ground that is no more than so far below it.

    Parameters
    ----------
    R_nc
        (..., 3, 3).
    depth
        (...) of the lowest ground below the camera, m.
    sensor
        Its field of view.

    Returns
    -------
    (...) m; infinite where a corner of the image is at or above the horizon.
    """
    corners = np.array([[i * sensor.halves[0], j * sensor.halves[1], 1.0] for i in (-1, 1) for j in (-1, 1)])
    rays = np.asarray(R_nc, float) @ corners.T
    level, down = np.hypot(rays[..., 0, :], rays[..., 1, :]), rays[..., 2, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(down > 1e-9, level / down, np.inf).max(axis=-1)
    return np.asarray(ratio * np.asarray(depth, float))


def leg_positions(terrain: Terrain, flying: Flying, starts: ArrayLike, headings: ArrayLike) -> Array:
    """Where images are taken on straight legs that keep their height above the ground.

    Parameters
    ----------
    terrain
        The ground.
    flying
        Speed, height, and how many images a leg has.
    starts
        (K, 2) m.
    headings
        (K,) rad.

    Returns
    -------
    (K, L, 3) m in n; the height is NaN off the map.
    """
    at = flying.interval * np.arange(1, flying.images + 1)
    heading = np.asarray(headings, float)
    along = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    flat = np.asarray(starts, float)[:, None] + flying.speed * at[:, None] * along[:, None]
    up = terrain.heights_at(flat.reshape(-1, 2)).reshape(flat.shape[:2]) + flying.height
    return np.concatenate([flat, -up[..., None]], axis=-1)


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
    """

    def __init__(
        self, way_points: ArrayLike, terrain: Terrain, flying: Flying, sides: ArrayLike = (0.0,)
    ) -> None:
        self.way_points = np.asarray(way_points, float).reshape(-1, 2)
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
