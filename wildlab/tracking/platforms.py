"""Sensors of a platform that is no camera: positions, ranges and angles, level or tilted."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.predictions import Prediction, predict_polar, predict_position, predict_range_bearing
from wildlab.tracking.sensors import Ray, Sensor, row_of


def ranges_bearings(platform: ArrayLike, yaw: ArrayLike) -> Sensor:
    """Range and bearing of a target, seen from a level platform.

    Parameters
    ----------
    platform
        (N, 2) north, east of the sensor in n, m; or (2,) for all rows.
    yaw
        (N,) or a scalar: of the platform, rad clockwise from north; zero where bearings are measured from
        north.

    Returns
    -------
    Sensor
        Of (2,) range, m, and bearing, rad clockwise from the bow; NaN at zero range. For N rows, or for any
        number where position and yaw are the same for all. Differences of the bearing are wrapped.

    Raises
    ------
    WildlabError
        Where both have rows, and not equally many.
    """

    def predict(row: int, position: Array) -> Prediction:
        return predict_range_bearing(position, row_of(platform, row, 1), row_of(yaw, row, 0))

    def locate(row: int, z: Array) -> Array:
        bearing = z[1] + row_of(yaw, row, 0)
        return np.asarray(row_of(platform, row, 1) + z[0] * np.array([np.cos(bearing), np.sin(bearing)]))

    return Sensor(
        predict, (False, True), _platform_rows(platform, yaw), elements=("range", "bearing"),
        ray=_level_ray(platform, yaw, 1), locate=locate,
    )  # fmt: skip


def bearings(platform: ArrayLike, yaw: ArrayLike) -> Sensor:
    """Bearing alone of a target, seen from a level platform.

    Parameters
    ----------
    platform
        (N, 2) north, east of the sensor in n, m; or (2,) for all rows.
    yaw
        (N,) or a scalar: of the platform, rad clockwise from north; zero where bearings are measured from
        north.

    Returns
    -------
    Sensor
        Of (1,) bearing, as `ranges_bearings`; measurements for it are (N, 1).

    Raises
    ------
    WildlabError
        Where both have rows, and not equally many.
    """

    def predict(row: int, position: Array) -> Prediction:
        both = predict_range_bearing(position, row_of(platform, row, 1), row_of(yaw, row, 0))
        return Prediction(both.z[..., 1:], both.H_position[..., 1:, :], both.H_pose[..., 1:, :])

    return Sensor(
        predict, (True,), _platform_rows(platform, yaw), elements=("bearing",),
        ray=_level_ray(platform, yaw, 0),
    )  # fmt: skip


def measured_from(platform: ArrayLike) -> Sensor:
    """Positions (north, east) that a platform measures: its own plus what it sees from there.

    Unlike `positions` they have a pose that may be wrong: an error of the platform's position shifts them,
    one of its heading turns them about it.

    Parameters
    ----------
    platform
        (N, 2) north, east of the platform in n, m; or (2,) for all rows.

    Returns
    -------
    Sensor
        Of (2,) metres in n, for N rows, or for any number where the platform stays.
    """

    def predict(row: int, position: Array) -> Prediction:
        return predict_position(position, row_of(platform, row, 1))

    return Sensor(
        predict, (False, False), _platform_rows(platform, 0.0), elements=("north", "east"),
        locate=lambda row, z: np.array(z, float),
    )  # fmt: skip


def polar(
    platform: ArrayLike,
    R_nb: ArrayLike,
    plane_down: ArrayLike,
    elements: tuple[str, ...] = ("range", "azimuth", "elevation"),
) -> Sensor:
    """Range, azimuth and elevation of a target on a plane, or some of them, from a tilted platform.

    Parameters
    ----------
    platform
        (N, 3) position of the sensor in n, m; or (3,) for all rows.
    R_nb
        (N, 3, 3) or (3, 3): attitude of the frame b that the angles are counted in; the identity where they
        are counted from north and from the horizon.
    plane_down
        Down coordinate in n of the plane that the target is on, m: a scalar, or (N,).
    elements
        Which of the three are measured, in that order: ``range``, along the line of sight, m; ``azimuth``,
        from the first axis of b to the second, rad; ``elevation``, above their plane, rad.

    Returns
    -------
    Sensor
        Of so many elements, NaN where an angle is not defined; for N rows, or for any number where all is the
        same for all rows. Differences of the azimuth are wrapped.

    Raises
    ------
    WildlabError
        For elements that there are not, or that are out of order; or where numbers of rows differ.

    Examples
    --------
    >>> sensor = polar([0.0, 0.0, -30.0], np.eye(3), 0.0, ("range", "azimuth"))
    >>> sensor.predict(0, np.array([0.0, 40.0])).z.round(4).tolist()
    [50.0, 1.5708]
    """
    known = ("range", "azimuth", "elevation")
    if not elements or elements != tuple(one for one in known if one in elements):
        raise WildlabError(
            f"the elements {elements}", f"give some of {known} in that order", field="elements"
        )
    which = [known.index(one) for one in elements]

    def predict(row: int, position: Array) -> Prediction:
        whole = predict_polar(
            position, row_of(platform, row, 1), row_of(R_nb, row, 2), row_of(plane_down, row, 0)
        )
        return Prediction(whole.z[..., which], whole.H_position[..., which, :], whole.H_pose[..., which, :])

    def ray(row: int, z: Array) -> tuple[Array, Array]:
        azimuth = z[elements.index("azimuth")]
        elevation = z[elements.index("elevation")] if "elevation" in elements else 0.0
        level = np.cos(elevation)
        direction = np.array([level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)])
        return row_of(platform, row, 1), np.asarray(row_of(R_nb, row, 2) @ direction)

    def locate(row: int, z: Array) -> Array:
        origin, direction = ray(row, z)
        drop = row_of(plane_down, row, 0) - origin[2]
        if "range" in elements:  # nothing is asked of the elevation, which is worse known at sea
            level = np.sqrt(np.maximum(z[0] ** 2 - drop**2, 0.0)) / np.hypot(*direction[:2])
            return np.asarray(origin[:2] + level * direction[:2])
        down = drop / direction[2] if drop * direction[2] > 0 else np.nan
        return np.asarray(origin[:2] + down * direction[:2])

    rows = _same_rows({"platform": (platform, 1), "R_nb": (R_nb, 2), "plane_down": (plane_down, 0)})
    angles = tuple(one == "azimuth" for one in elements)
    sighted, placed = "azimuth" in elements, "azimuth" in elements and len(elements) > 1
    return Sensor(
        predict, angles, rows, elements=elements, ray=ray if sighted else None,
        locate=locate if placed else None,
    )  # fmt: skip


def _same_rows(given: dict[str, tuple[ArrayLike, int]]) -> int | None:
    """How many rows all have that have any; ``given`` is by name, with the axes of a single value."""
    numbers = {name: len(np.asarray(a)) for name, (a, base) in given.items() if np.ndim(a) > base}
    for name, number in numbers.items():
        if number != next(iter(numbers.values())):
            raise WildlabError(
                f"{number} rows beside {next(iter(numbers.values()))}", "give one of each for each row",
                field=name,
            )  # fmt: skip
    return next(iter(numbers.values()), None)


def _level_ray(platform: ArrayLike, yaw: ArrayLike, element: int) -> Ray:
    """Rays of bearings, in the horizontal plane."""

    def ray(row: int, z: Array) -> tuple[Array, Array]:
        bearing = z[element] + row_of(yaw, row, 0)
        origin = np.append(row_of(platform, row, 1), 0.0)
        return origin, np.array([np.cos(bearing), np.sin(bearing), 0.0])

    return ray


def _platform_rows(platform: ArrayLike, yaw: ArrayLike) -> int | None:
    """How many rows a platform has; None where it is the same for all rows."""
    numbers = {len(np.asarray(a)) for a, base in ((platform, 1), (yaw, 0)) if np.ndim(a) > base}
    if len(numbers) > 1:
        raise WildlabError(
            f"{np.shape(platform)} positions and {np.shape(yaw)} yaws", "give one of each for each row",
            field="yaw",
        )  # fmt: skip
    return numbers.pop() if numbers else None
