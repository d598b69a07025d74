"""Outlines as rows are laid over them: without the small turns of a fence that no row can follow."""

from __future__ import annotations

import numpy as np

from wildlab.flight.readers.rings import crossing, ring_area
from wildlab.geometry.frames import Array


def simplified(ring: Array, tolerance: float) -> Array:
    """A ring with fewer corners, none of which lies further from it than a tolerance (Douglas and Peucker).

    Parameters
    ----------
    ring
        (K, 2) metres, not closed, that does not cross itself.
    tolerance
        Metres; corners that lie nearer to the simpler ring are left out.

    Returns
    -------
    (L, 2) metres, some of the corners in their order. The ring itself where the simpler one would cross
    itself or bound next to nothing.

    Examples
    --------
    >>> ring = np.array([[0.0, 0.0], [0.0, 50.0], [0.2, 100.0], [100.0, 100.0], [100.0, 0.0]])
    >>> print(len(simplified(ring, 1.0)))
    4
    """
    if len(ring) <= 4:
        return ring
    # Two corners far apart are kept for certain; each half between them is thinned by itself.
    first = int(np.argmax(((ring - ring.mean(axis=0)) ** 2).sum(axis=1)))
    turned = np.roll(ring, -first, axis=0)
    far = int(np.argmax(((turned - turned[0]) ** 2).sum(axis=1)))
    closed = np.concatenate([turned, turned[:1]])
    kept = {0, far}
    todo = [(0, far), (far, len(closed) - 1)]
    while todo:
        begin, end = todo.pop()
        if end - begin < 2:
            continue
        off = _distances(closed[begin + 1 : end], closed[begin], closed[end])
        worst = int(np.argmax(off))
        if off[worst] > tolerance:
            middle = begin + 1 + worst
            kept.add(middle)
            todo += [(begin, middle), (middle, end)]
    simpler = turned[sorted(kept)]
    if len(simpler) < 3 or ring_area(simpler) < ring_area(ring) / 2 or crossing(simpler) is not None:
        return ring
    return simpler


def _distances(points: Array, a: Array, b: Array) -> Array:
    """How far points (N, 2) are from the segment a-b, metres."""
    along = b - a
    share = np.clip((points - a) @ along / max(float(along @ along), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(points - a - share[:, None] * along, axis=1))
