"""What an animated flight shows, as arrays: each part has its own times, all of one clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError

Array = NDArray[np.float64]


class Course(NamedTuple):
    """Places over time: of the aircraft, of a target, of points on the ground.

    Attributes
    ----------
    times
        (N,) s, in order; one row with any time stands for what does not move.
    points
        (N, 2) m north and east; NaN where the place is not known.
    """

    times: Array
    points: Array


class Outlines(NamedTuple):
    """What the camera sees of the ground over time.

    Attributes
    ----------
    times
        (N,) s, in order.
    corners
        (N, K, 2) m north and east, in order about the image, not closed; rows of NaN where the image shows no
        ground.
    """

    times: Array
    corners: Array


class Ellipses(NamedTuple):
    """Where something is held to be over time.

    Attributes
    ----------
    times
        (N,) s, in order.
    centres
        (N, 2) m north and east; NaN where there is no estimate.
    covariances
        (N, 2, 2) m^2, north before east.
    """

    times: Array
    centres: Array
    covariances: Array


class ShownFlight(NamedTuple):
    """A flight, or a part of it, to be animated.

    Attributes
    ----------
    path
        The aircraft's.
    footprints
        Of its camera; None without one.
    points
        Places on the ground, each at the time at which it was measured; None without any.
    ellipses, truth
        One a target.
    """

    path: Course
    footprints: Outlines | None = None
    points: Course | None = None
    ellipses: Sequence[Ellipses] = ()
    truth: Sequence[Course] = ()


def checked(shown: ShownFlight) -> ShownFlight:
    """The same with arrays of floats whose shapes and times are in order.

    Raises
    ------
    WildlabError
        Where shapes do not fit together, a time is not finite or goes back, or the path has less than two
        known places.
    """
    path = _course(shown.path, "path")
    known = np.isfinite(path.points).all(axis=1)
    if known.sum() < 2:
        raise WildlabError(f"the path has {int(known.sum())} known places", "give two at least", field="path")
    return ShownFlight(
        path,
        None if shown.footprints is None else Outlines(*_aligned(shown.footprints, "footprints", (-1, 2))),
        None if shown.points is None else _course(shown.points, "points"),
        [Ellipses(*_aligned(one, "ellipses", (2,), (2, 2))) for one in shown.ellipses if len(one.times)],
        [_course(one, "truth") for one in shown.truth if len(one.times)],
    )


def _course(given: Course, field: str) -> Course:
    return Course(*_aligned(given, field, (2,)))


def _aligned(given: Sequence[ArrayLike], field: str, *shapes: tuple[int, ...]) -> list[Array]:
    """Times and arrays of a part; each row of the arrays is shaped as told (-1: any)."""
    times, *arrays = (np.asarray(one, float) for one in given)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise WildlabError(
            "its times are no increasing row of seconds",
            "sort the rows by time, drop those without",
            field=field,
        )
    for array, shape in zip(arrays, shapes, strict=True):
        fits = array.ndim == 1 + len(shape) and all(
            want in (-1, have) for want, have in zip((len(times), *shape), array.shape, strict=True)
        )
        if not fits:
            wanted = ", ".join(["N", *("K" if one < 0 else str(one) for one in shape)])
            raise WildlabError(
                f"an array of shape {array.shape} beside {len(times)} times",
                f"give one of shape ({wanted})",
                field=field,
            )
    return [times, *arrays]
