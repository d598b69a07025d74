"""Ellipses drawn by the pixels whose centres lie within them."""

import numpy as np


def inside(centre, axes, angle, shape):
    """Mask of the shape of an image; whole axes and centre in px, the angle from right to down."""
    v, u = np.mgrid[: shape[0], : shape[1]].astype(float)
    along = (u - centre[0]) * np.cos(angle) + (v - centre[1]) * np.sin(angle)
    across = -(u - centre[0]) * np.sin(angle) + (v - centre[1]) * np.cos(angle)
    return (2 * along / axes[0]) ** 2 + (2 * across / axes[1]) ** 2 <= 1
