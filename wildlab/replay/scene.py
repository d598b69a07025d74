"""What a replay shows of a flight: arrays in local metres over seconds since its first pose.

Everything here is in n (north, east, down from an origin that is not told). Nothing in it says where on Earth
or on what day that was.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.geometry.camera import Camera
from wildlab.geometry.terrain import Terrain

Array = NDArray[np.float64]
Names = NDArray[np.object_]
#: Corners of an ellipse, and vertices of the ground along its longer side at most.
CORNERS, MOST_NODES = 32, 200


class Path(NamedTuple):
    """Where the aircraft was: (N,) s, (N, 3) m; and what the poses are called."""

    times: Array
    places: Array
    source: str


class Views(NamedTuple):
    """The frames of the camera, in the order of time. NaN where a pose or a footprint is not known.

    Attributes
    ----------
    ids
        (N,) what the flight calls them; never shown.
    times
        (N,) s.
    p_nc, R_nc
        (N, 3) m, (N, 3, 3): the camera's pose; takes a vector from c to n.
    outlines
        (N, B, 3) m, the border of each image on the ground, in order, not closed.
    """

    ids: Names
    times: Array
    p_nc: Array
    R_nc: Array
    outlines: Array


class Sightings(NamedTuple):
    """Detections in images.

    Attributes
    ----------
    frame
        (M,) row of `Views`.
    uv
        (M, 2) px, the middle of the first pixel being (0, 0).
    names
        (M,) the target that each names, "" none.
    """

    frame: NDArray[np.intp]
    uv: Array
    names: Names


class Points(NamedTuple):
    """Detections on the ground.

    Attributes
    ----------
    times, places, covariance
        (K,) s, (K, 3) m, (K, 2, 2) m^2 north before east; a covariance may be NaN.
    names
        (K,) the target, "" none.
    error, nees
        (K,) m and 1, point beside truth; NaN where that is not known.
    """

    times: Array
    places: Array
    covariance: Array
    names: Names
    error: Array
    nees: Array


class Estimates(NamedTuple):
    """One target as one filter follows it: as `Points`, one row for each look, in the order of time."""

    target: str
    filter: str
    sensor: str
    times: Array
    places: Array
    covariance: Array
    error: Array
    nees: Array


class Target(NamedTuple):
    """Where a target really was: (T,) s and (T, 3) m; one row and the time NaN where it never moves."""

    name: str
    times: Array
    places: Array

    @property
    def still(self) -> bool:
        """Whether it never moves."""
        return len(self.times) == 1 and bool(np.isnan(self.times[0]))


@dataclass(frozen=True)
class ReplayScene:
    """All that a replay shows.

    Attributes
    ----------
    name, kind
        Of the flight: what it is called, and ``twin`` or ``logged``.
    timed
        Whether times are times; else they number the images.
    path, camera, views, sightings, points, tracks, truth, terrain
        What there is; None or empty where there is nothing of it.
    ground
        Down coordinate of level ground, m, where there is no terrain; NaN where it is not known.
    lacks
        Clauses: what is not shown, and why.
    """

    name: str
    kind: str
    timed: bool
    path: Path | None = None
    camera: Camera | None = None
    views: Views | None = None
    sightings: Sightings | None = None
    points: Points | None = None
    tracks: tuple[Estimates, ...] = ()
    truth: tuple[Target, ...] = ()
    terrain: Terrain | None = None
    ground: float = float("nan")
    lacks: tuple[str, ...] = field(default=())

    @property
    def length(self) -> float:
        """The last time at which anything happens, s; zero where nothing does."""
        times = [one.times for one in (self.path, self.views, self.points, *self.tracks) if one is not None]
        known = [float(np.nanmax(t)) for t in times if np.isfinite(t).any()]
        return max([0.0, *known])

    @property
    def extent(self) -> tuple[Array, Array]:
        """The least and the greatest north, east and down of what is shown, (3,) m each; the sea not."""
        parts = [np.empty((0, 3))]
        parts += [self.path.places] if self.path is not None else []
        parts += [self.views.outlines.reshape(-1, 3)] if self.views is not None else []
        parts += [self.points.places] if self.points is not None else []
        parts += [one.places for one in self.tracks]
        parts += [one.places for one in self.truth]
        known = np.concatenate(parts)
        known = known[np.isfinite(known).all(axis=1)]
        if not len(known):
            return np.full(3, -50.0), np.full(3, 50.0)
        return known.min(axis=0), known.max(axis=0)


def heights(scene: ReplayScene) -> Array:
    """Heights (N,) m of the path above the ground that is known, else above the origin of n; never NaN.

    Parameters
    ----------
    scene
        With a path.

    Returns
    -------
    (N,) m
    """
    assert scene.path is not None  # noqa: S101 - for the type checker
    up = -scene.path.places[:, 2]
    if scene.terrain is not None:
        ground = scene.terrain.heights_at(scene.path.places[:, :2])
        # Beside the map the ground is taken to be as high as the map is in the mean.
        return np.asarray(up - np.where(np.isfinite(ground), ground, np.nanmean(scene.terrain.height)))
    return np.asarray(up + (scene.ground if np.isfinite(scene.ground) else 0.0))


def ellipse_rings(places: Array, covariance: Array, share: float = 0.9) -> Array:
    """The ellipses about points on the ground.

    Parameters
    ----------
    places
        (N, 3) m in n.
    covariance
        (N, 2, 2) m^2, north before east.
    share
        Of a normal distribution that an ellipse holds.

    Returns
    -------
    (N, CORNERS + 1, 3) m in n, closed.
    """
    size = float(np.sqrt(-2.0 * np.log(1.0 - share)))  # the chi-square with two degrees of freedom
    values, vectors = np.linalg.eigh(covariance)
    turn = np.linspace(0.0, 2 * np.pi, CORNERS + 1)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    ring = np.einsum("nij,kj->nki", vectors * (size * np.sqrt(np.maximum(values, 0.0)))[:, None, :], circle)
    rings = np.repeat(places[:, None, :], len(turn), axis=1)
    rings[..., :2] += ring
    return rings


def mesh(
    height: NDArray[np.float32], north: float, east: float, step: float
) -> tuple[Array, NDArray[np.uint32], NDArray[np.uint8], Array]:
    """Terrain as triangles, thinned to `MOST_NODES` along its longer side and shaded from the north-west.

    Parameters
    ----------
    height
        (R, C) m, NaN where nothing is known; rows run north.
    north, east
        Of its first node, m.
    step
        Between nodes, m.

    Returns
    -------
    vertices, triangles, colours, normals
        (V, 3) m east, north, up; (T, 3); (V, 3); (V, 3). A triangle with an unknown corner is left out.
    """
    every = max(1, -(-max(height.shape) // MOST_NODES))
    h = np.asarray(height[::every, ::every], float)
    rows, columns = h.shape
    x, y = np.meshgrid(east + every * step * np.arange(columns), north + every * step * np.arange(rows))
    vertices = np.stack([x, y, np.nan_to_num(h)], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel()
    c, d = corner[1:, :-1].ravel(), corner[1:, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    triangles = triangles[np.isfinite(h.ravel())[triangles].all(axis=1)]
    up_north, up_east = np.gradient(np.nan_to_num(h), every * step) if min(h.shape) > 1 else (0 * h, 0 * h)
    normals = np.stack([-up_east, -up_north, np.ones_like(h)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    light = normals @ (np.array([-1.0, 1.0, 1.2]) / np.linalg.norm([-1.0, 1.0, 1.2]))
    tone = np.clip(0.75 + 0.5 * (light - np.median(light)), 0.45, 1.0)
    colours = (tone[..., None] * np.array([222, 226, 206])).clip(0, 255).astype(np.uint8)
    return vertices, triangles.astype(np.uint32), colours.reshape(-1, 3), normals.reshape(-1, 3)
