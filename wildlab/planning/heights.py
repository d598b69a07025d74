"""Heights of way points over terrain: a stated height above ground, as far as climb and descent allow."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain


class Profile(NamedTuple):
    """Heights along a way.

    Attributes
    ----------
    points
        (M, 3) in n, metres.
    above
        (M,) height above ground, metres: never less than was asked for.
    """

    points: Array
    above: Array

    def at(self, distances: ArrayLike) -> Array:
        """Heights after so many metres of way over ground.

        Parameters
        ----------
        distances
            (N,) metres.

        Returns
        -------
        (N,) metres upwards in n.
        """
        step = np.linalg.norm(np.diff(self.points[:, :2], axis=0), axis=1)
        far = np.concatenate([[0.0], np.cumsum(step)])
        return np.asarray(np.interp(np.asarray(distances, float), far, -self.points[:, 2]))


def follow_terrain(
    terrain: Terrain,
    points: ArrayLike,
    above: float,
    *,
    climb: float = np.inf,
    descent: float = np.inf,
    spacing: float = 5.0,
) -> Profile:
    """The lowest way that keeps a height above ground and neither climbs nor sinks too steeply.

    At each place the height is the greatest of what every other place asks for, less what can be climbed or
    sunk on the way there. So the platform climbs before a hill, and is nowhere lower than asked.

    Parameters
    ----------
    terrain
        In the same n.
    points
        (K, 2) way points, north and east, metres; they are all kept.
    above
        Height above ground, metres.
    climb, descent
        Metres up, and down, for each metre of way; infinite follows every step of the ground.
    spacing
        At most between two points of the profile, metres; not above the terrain's step to miss nothing.

    Returns
    -------
    Profile

    Raises
    ------
    WildlabError
        Where the height or a limit is not above zero, or the way leaves the map or leads over what it does
        not know.

    Examples
    --------
    >>> ground = np.array([[0, 0], [0, 0], [20, 20], [0, 0]], np.float32)
    >>> hill = Terrain(ground, north=0.0, east=0.0, step=100.0)
    >>> way = follow_terrain(hill, [[0.0, 50.0], [300.0, 50.0]], 30.0, climb=0.1, descent=0.4, spacing=100.0)
    >>> print(-way.points[:, 2])
    [30. 40. 50. 30.]
    """
    for value, name in ((above, "above"), (climb, "climb"), (descent, "descent"), (spacing, "spacing")):
        if not value > 0:
            raise WildlabError(f"a value of {value}", "give a number above zero", field=name)
    way = np.asarray(points, float)
    parts = [way[:1]]
    for a, b in pairwise(way):
        count = max(int(np.ceil(np.linalg.norm(b - a) / spacing)), 1)
        parts.append(a + (np.arange(count) + 1)[:, None] / count * (b - a))
    dense = np.concatenate(parts)
    ground = terrain.heights_at(dense)
    lost = int((~np.isfinite(ground)).sum())
    if lost:
        raise WildlabError(
            f"{lost} of {len(dense)} places on the way lie off the map or where it has no height",
            "give terrain that holds the whole way, turns too",
            field="terrain",
        )
    far = np.linalg.norm(np.diff(dense, axis=0), axis=1)
    height = ground + above
    if np.isfinite(climb):
        for k in range(len(far) - 1, -1, -1):
            height[k] = max(height[k], height[k + 1] - climb * far[k])
    if np.isfinite(descent):
        for k in range(len(far)):
            height[k + 1] = max(height[k + 1], height[k] - descent * far[k])
    return Profile(np.column_stack([dense, -height]), height - ground)
