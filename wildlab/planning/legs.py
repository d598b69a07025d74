"""Straight legs of a platform whose camera hangs in a gimbal: where images are taken, and which count."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.mount import R_MC_DOWN
from wildlab.geometry.terrain import Terrain
from wildlab.planning.information import SearchSensor

#: A turn of the camera that is too small to blur an image, rad.
AT_REST = np.radians(0.5)


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
    stops_beyond
        None, or the angle beyond which any turn takes the whole ``turn_time``, and up to which none, rad.

    Raises
    ------
    WildlabError
        Where ``turn_time`` is below zero, or one of those before it not above zero.
    """

    speed: float
    height: float
    interval: float = 1.0
    images: int = 3
    slew: float = np.radians(60.0)
    turn_time: float = 0.0
    stops_beyond: float | None = None

    def __post_init__(self) -> None:
        for name in ("speed", "height", "interval", "images", "slew"):
            if not getattr(self, name) > 0:
                raise WildlabError(f"{name} is {getattr(self, name)}", "give a number above zero", field=name)
        if not self.turn_time >= 0:
            raise WildlabError(
                f"turn_time is {self.turn_time}", "give seconds, or 0 for turns in no time", field="turn_time"
            )

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
        angle = np.abs(np.asarray(turned, float))
        if self.stops_beyond is None:
            return np.asarray(self.turn_time * angle / np.pi)
        return np.where(angle > self.stops_beyond, self.turn_time, 0.0)

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

    def ready(self, turned: ArrayLike, waits: ArrayLike = 0.0) -> NDArray[np.bool_]:
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
    counts: NDArray[np.bool_]
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
    corners = np.array(
        [[i * sensor.half_width, j * sensor.half_height, 1.0] for i in (-1, 1) for j in (-1, 1)]
    )
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
