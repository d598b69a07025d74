"""Detections too near one another: removed as F does it, or merged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wildlab.detection.detections import Detections


def remove_near(found: Detections, apart_px: float) -> Detections:
    """Of detections that are too near one another only the one with the largest score stays (F 3.2.6).

    Parameters
    ----------
    found
        Of one image.
    apart_px
        How far centroids are apart at least; 0 removes nothing.

    Returns
    -------
    Detections
        In the order of the score, largest first.

    Notes
    -----
    F removes detections too near to each other and takes them for one target; which of them stays is not
    said. Here it is the surest.
    """
    order = np.argsort(-found.score, kind="stable")
    found = found.select(order)
    if apart_px <= 0 or len(found) < 2:
        return found
    keep = np.ones(len(found), bool)
    pairs = cKDTree(found.uv).query_pairs(np.nextafter(apart_px, 0), output_type="ndarray")
    # The surer comes first in each pair; it removes others only where it was not removed itself.
    for row, other in pairs[np.lexsort(pairs.T[::-1])]:
        if keep[row]:
            keep[other] = False
    return found.select(keep)


def merge_near(found: Detections, apart_px: float) -> Detections:
    """Detections that hang together by steps shorter than a distance become one.

    Parameters
    ----------
    found
        Of one image.
    apart_px
        Centroids that are nearer than this are linked.

    Returns
    -------
    Detections
        Centroid, intensity and second moments are those of all their pixels together, the score is the
        largest. Hu's moments are those of the largest part: they cannot be had from parts.
    """
    if apart_px <= 0 or len(found) < 2:
        return found
    pairs = cKDTree(found.uv).query_pairs(np.nextafter(apart_px, 0), output_type="ndarray")
    group = _linked(len(found), pairs)
    merged = [_merge(found.select(group == one)) for one in np.unique(group)]
    names = list(Detections.__dataclass_fields__)
    return Detections(*(np.concatenate([getattr(one, name) for one in merged]) for name in names))


def _linked(count: int, pairs: NDArray[np.intp]) -> NDArray[np.intp]:
    group = np.arange(count)
    for _ in range(count):
        before = group.copy()
        for a, b in pairs:
            group[a] = group[b] = min(group[a], group[b])
        if (before == group).all():
            break
    return group


def _merge(parts: Detections) -> Detections:
    if len(parts) == 1:
        return parts
    largest = parts.select([int(np.argmax(parts.area))])
    area = parts.area.sum()
    weight = parts.area / area
    uv = weight @ parts.uv
    turn = np.stack([np.cos(parts.orientation), np.sin(parts.orientation)], axis=1)
    across = np.stack([-turn[:, 1], turn[:, 0]], axis=1)
    own = np.einsum("n,ni,nj->nij", (parts.axes[:, 0] / 4) ** 2, turn, turn)
    own += np.einsum("n,ni,nj->nij", (parts.axes[:, 1] / 4) ** 2, across, across)
    off = parts.uv - uv
    second = np.einsum("n,nij->ij", weight, own + np.einsum("ni,nj->nij", off, off))
    powers, directions = np.linalg.eigh(second)
    corner = parts.box[:, :2].min(axis=0)
    far = (parts.box[:, :2] + parts.box[:, 2:]).max(axis=0)
    covariance = np.einsum("n,nij->ij", weight**2, parts.covariance)
    return replace(
        largest,
        uv=uv[None],
        covariance=covariance[None],
        area=np.array([area]),
        intensity=np.array([weight @ parts.intensity]),
        box=np.concatenate([corner, far - corner])[None],
        axes=4 * np.sqrt(powers[::-1])[None],
        orientation=np.array(
            [np.arctan(directions[1, 1] / directions[0, 1]) if directions[0, 1] else np.pi / 2]
        ),
        score=np.array([parts.score.max()]),
    )
