"""Courses of platforms that search: rows over enclosures, and heights along a cable."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.geometry.frames import Array
from wildlab.simulation.animal_motion import enclosure_axes
from wildlab.simulation.platform_parameters import Cable
from wildlab.simulation.target_parameters import Enclosure


def rows(enclosure: Enclosure, distance: float) -> Array:
    """Corners of a course back and forth over one enclosure, along its length (F 5.2, fig 5.1). (2 K, 2) m.

    As many rows as are needed for no point within the fence to be further than half the distance from one;
    they are evenly spaced and reach from fence to fence.
    """
    count = max(int(np.ceil(enclosure.width.si / distance - 1e-9)), 1)
    aside = (np.arange(count) + 0.5) * enclosure.width.si / count - enclosure.width.si / 2
    ends = np.tile([-0.5, 0.5, 0.5, -0.5], count)[: 2 * count] * enclosure.length.si
    middle, along, across = enclosure_axes(enclosure)
    return np.asarray(middle + np.outer(ends, along) + np.outer(np.repeat(aside, 2), across))


def survey_course(enclosures: Sequence[Enclosure], distance: float) -> Array:
    """Rows over one enclosure after the other, in their order, and back to the first corner. (M, 2) m.

    Each enclosure is entered at the corner nearest to where the one before was left.
    """
    course: list[Array] = []
    for enclosure in enclosures:
        there = rows(enclosure, distance)
        # Rows from either side, each from either end: four ways round, each with its own way out.
        ways = [there, there[::-1], _mirrored(there), _mirrored(there)[::-1]]
        if course:
            ways.sort(key=lambda way: float(np.linalg.norm(way[0] - course[-1][-1])))
        course.append(ways[0])
    points = np.concatenate(course)
    return np.concatenate([points, points[:1]])


def _mirrored(corners: Array) -> Array:
    """The same rows, each flown the other way."""
    return np.asarray(corners.reshape(-1, 2, 2)[:, ::-1].reshape(-1, 2))


def cable_heights(cable: Cable, lap: float, duration: float) -> Array:
    """Times and heights over the ground, (K, 2) s and m, lowest at the start of each span of a lap (s)."""
    count = int(np.ceil(duration / lap * cable.spans.number)) * 16 + 1
    span = np.arange(count) / 16
    middle, swing = (cable.highest.si + cable.lowest.si) / 2, (cable.highest.si - cable.lowest.si) / 2
    return np.stack([span * lap / cable.spans.number, middle - swing * np.cos(2 * np.pi * span)], axis=-1)
