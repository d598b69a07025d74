"""Ellipses and ground as lines and triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Corners of an ellipse, and vertices of the ground along its longer side at most.
CORNERS, MOST_NODES = 32, 200


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
