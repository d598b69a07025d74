"""What the camera sees of a map's grid points, as F 2.5 works it out.

A field of view by two angles (2.22)-(2.23), rays in fixed steps (algorithm 1), and depression angles along a
line of grid points (2.24, the extended Bresenham). They are kept because they are F's, beside the exact line
of sight of `wildlab.geometry.viewsheds`, which is what everything else here uses. As there, what the map
does not know counts as high as its highest node.

Coordinates of the compiled loops are those of the grid: ``x`` in columns (east), ``y`` in rows (north), ``z``
metres upwards.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera
from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain


@compiled
def cast_all(
    height: Any,
    rows: Any,
    columns: Any,
    lens: Any,
    metres: float,
    step: float,
    near: float,
    top: float,
    lone: float,
) -> tuple[Any, Any]:
    """F algorithm 1 for each node: whether a ray to it ends near it, and how many steps that took.

    Rays begin at the height ``top``; where a node is missing, the ground is as high as ``lone``.
    """
    last_row, last_column = height.shape[0] - 1, height.shape[1] - 1
    clear, steps = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    x, y, z = lens
    for n in range(len(rows)):
        i, j = rows[n], columns[n]
        dx, dy, dz = j - x, i - y, height[i, j] - z
        length = np.sqrt((dx * dx + dy * dy) * metres * metres + dz * dz)
        if not length > 0:
            clear[n] = length == 0
            continue
        dx, dy, dz = dx / length, dy / length, dz / length
        # Nothing is above the highest ground: a ray from above begins there.
        t = (top - z) / dz if dz < 0 and z > top else 0.0
        while True:
            at_x, at_y = x + t * dx, y + t * dy
            if 0 <= at_x <= last_column and 0 <= at_y <= last_row:
                a, b = min(int(at_y), last_row - 1), min(int(at_x), last_column - 1)
                u, v = at_x - b, at_y - a
                low = (1 - u) * height[a, b] + u * height[a, b + 1]
                high = (1 - u) * height[a + 1, b] + u * height[a + 1, b + 1]
                ground = (1 - v) * low + v * high
                if not z + t * dz > (ground if ground == ground else lone):
                    break
            elif t >= length:
                break  # it has left the map; one that begins beside it goes on
            t += step
            steps[n] += 1
        clear[n] = abs(t - length) <= near
    return clear, steps


@compiled
def compare_all(
    height: Any,
    rows: Any,
    columns: Any,
    lens: Any,
    metres: float,
    itself: bool,
    signed: bool,
    lone: float,
) -> tuple[Any, Any]:
    """F (2.24) for each node: whether no grid point before it has an angle as small, and how many were asked.

    A count of -1 is a line that has no direction. A missing node counts as high as ``lone``.
    """
    last_row, last_column = height.shape[0] - 1, height.shape[1] - 1
    clear, asked = np.zeros(len(rows), np.bool_), np.zeros(len(rows), np.int32)
    x, y, z = lens
    for n in range(len(rows)):
        i, j = rows[n], columns[n]
        if height[i, j] != height[i, j]:
            continue
        dx, dy = x - j, y - i
        own = np.arctan2(z - height[i, j], metres * np.sqrt(dx * dx + dy * dy))
        furthest = max(abs(dx), abs(dy))
        along_y = dx <= dy if signed else abs(dx) <= abs(dy)
        span = abs(dy) if along_y else abs(dx)
        if span == 0:
            # Straight below the camera there is nothing between; by the letter it is a division by zero.
            clear[n], asked[n] = furthest == 0 and not itself, -1 if signed else 0
            continue
        clear[n] = True
        for k in range(0 if itself else 1, int(np.ceil(furthest))):
            b, a = int(np.floor(j + k * dx / span + 0.5)), int(np.floor(i + k * dy / span + 0.5))
            if not (0 <= a <= last_row and 0 <= b <= last_column):
                continue
            asked[n] += 1
            ex, ey = x - b, y - a
            there = height[a, b] if height[a, b] == height[a, b] else lone
            if np.arctan2(z - there, metres * np.sqrt(ex * ex + ey * ey)) <= own:
                clear[n] = False
                break
    return clear, asked


def field_of_view(camera: Camera) -> tuple[float, float]:
    """Angles of view ``alpha_u`` and ``alpha_v`` of F (2.23), of a camera centred and without distortion.

    Parameters
    ----------
    camera
        Its principal point, skew and distortion are left aside: (2.23) has none.

    Returns
    -------
    tuple of float
        Across and down the image, radians.

    Examples
    --------
    >>> wide, high = field_of_view(Camera(640, 480, fx=320.0, fy=240.0, cx=320.0, cy=240.0))
    >>> print(np.round(np.degrees([wide, high]), 6))
    [90. 90.]
    """
    wide, high = camera.width / (2 * camera.fx), camera.height / (2 * camera.fy)
    return float(2 * np.arctan(wide)), float(2 * np.arctan(high))


def in_field_of_view(
    angles: tuple[float, float], points: ArrayLike, p_nc: ArrayLike, R_nc: ArrayLike
) -> NDArray[np.bool_]:
    """Which points lie within the angles of view, F (2.22)-(2.23); what hides them is not asked.

    F's camera looks along its x axis: its ``(y_cam, z_cam) / x_cam`` is ``(x, y) / z`` here. By the print, a
    point behind the camera can lie inside, for a quotient does not know that both signs are turned; here it
    lies outside.

    Parameters
    ----------
    angles
        ``alpha_u`` and ``alpha_v``, radians, as of `field_of_view`.
    points
        (N, 3) metres in n.
    p_nc, R_nc
        Of the camera, (3,) metres and (3, 3).

    Returns
    -------
    (N,) bool; False of a point that is NaN.

    Raises
    ------
    WildlabError
        Where an angle is not between 0 and 180 degrees.

    Examples
    --------
    >>> right_angles = (np.pi / 2, np.pi / 2)
    >>> in_field_of_view(right_angles, [[9.0, 0.0, 0.0], [11.0, 0.0, 0.0]], [0.0, 0.0, -10.0], np.eye(3))
    array([ True, False])
    """
    halves = np.asarray(angles, float) / 2
    if halves.shape != (2,) or not ((halves > 0) & (halves < np.pi / 2)).all():
        raise WildlabError(
            f"angles of view of {np.degrees(2 * halves)} degrees",
            "give two between 0 and 180, in radians",
            field="angles",
        )
    p_c = (np.asarray(points, float) - np.asarray(p_nc, float)) @ np.asarray(R_nc, float)
    with np.errstate(invalid="ignore", divide="ignore"):
        inside = np.abs(np.arctan(p_c[..., :2] / p_c[..., 2:])) <= halves
        return np.asarray(inside.all(axis=-1) & (p_c[..., 2] > 0))


class Looked(NamedTuple):
    """What a line of sight of F says of grid points, and what it took.

    Attributes
    ----------
    clear
        (N,) bool, whether the camera sees the point; False where its own height is not known.
    steps
        (N,) int32, steps of the ray, or grid points whose angle was asked; -1 where the line by the letter
        has no direction.
    """

    clear: NDArray[np.bool_]
    steps: NDArray[np.int32]


def cast_rays(
    terrain: Terrain,
    nodes: ArrayLike,
    p_nc: ArrayLike,
    step: float,
    tolerance: float,
    *,
    shorten: bool = True,
) -> Looked:
    """Line of sight by rays in fixed steps: F algorithm 1.

    A ray runs from the camera to the grid point in equal steps until it is below the ground; the point is
    seen if the ray ends near it. On a crest a ray may run over the point and end far behind it, and ground
    that is thinner than a step is run through: both are F's.

    Parameters
    ----------
    terrain
        In the same n; between nodes it is bilinear.
    nodes
        (N, 2) rows and columns of the grid points, those of the field of view.
    p_nc
        Of the camera, (3,) metres.
    step
        Of the ray, metres.
    tolerance
        How near the ray has to end, metres: "if the distance is too large" is all that F prints.
    shorten
        Whether rays begin at the height of the highest of these points (F's optimisation), or at the camera.

    Returns
    -------
    Looked

    Raises
    ------
    WildlabError
        Where a node is not on the map, the camera is not one known point, or a length is not above zero.

    Examples
    --------
    A wall of 9 m, itself in view, between the camera and the last point:

    >>> height = np.zeros((2, 6), np.float32)
    >>> height[:, 3] = 9.0
    >>> wall = Terrain(height, north=0.0, east=0.0, step=10.0)
    >>> print(cast_rays(wall, [[0, 2], [0, 3], [0, 5]], [0.0, 0.0, -12.0], step=0.5, tolerance=1.0).clear)
    [ True  True False]
    """
    rows, columns, lens = _prepared(terrain, nodes, p_nc)
    for name, length in (("step", step), ("tolerance", tolerance)):
        if not 0 < length < np.inf:
            raise WildlabError(f"a {name} of {length} m", "give metres above zero", field=name)
    # Compiled functions are imported where they are called: a compiler takes its time to be imported.
    from wildlab.geometry.compilation import announced
    from wildlab.geometry.line_of_sight import cast_all

    known = terrain.height[rows, columns]
    top = float(np.nanmax(known, initial=-np.inf)) if shorten else np.inf
    with announced("lines of sight"):
        found = cast_all(
            terrain.height,
            rows,
            columns,
            lens,
            terrain.step,
            float(step),
            float(tolerance),
            top,
            terrain._top,
        )
    return Looked(*found)


def compare_angles(
    terrain: Terrain, nodes: ArrayLike, p_nc: ArrayLike, *, itself: bool = False, signed: bool = False
) -> Looked:
    """Line of sight by depression angles along a line of grid points: F (2.24), the extended Bresenham.

    From the point towards the camera, one step along the longer of both sides each, the nearest grid point is
    taken. A point is hidden where one before it has an angle as small as its own or smaller. The print says
    something else in two places, which the last two arguments restore: both True is the letter.

    Parameters
    ----------
    terrain
        In the same n.
    nodes
        (N, 2) rows and columns of the grid points.
    p_nc
        Of the camera, (3,) metres.
    itself
        Whether the point is among those compared. No point has an angle larger than its own, so "exists
        theta <= theta_0" then hides everything.
    signed
        Whether the longer side is chosen by ``dx <= dy``, without absolute values: where dx is below zero
        that may be the shorter one. The line is then scaled to the wrong side, leaves points out, and runs on
        behind the camera; where that side is zero it has no direction.

    Returns
    -------
    Looked

    Raises
    ------
    WildlabError
        Where a node is not on the map, or the camera is not one known point.

    Examples
    --------
    >>> height = np.zeros((2, 6), np.float32)
    >>> height[:, 3] = 9.0
    >>> wall = Terrain(height, north=0.0, east=0.0, step=10.0)
    >>> compare_angles(wall, [[0, 2], [0, 5]], [0.0, 0.0, -12.0]).clear
    array([ True, False])
    >>> compare_angles(wall, [[0, 2], [0, 5]], [0.0, 0.0, -12.0], itself=True, signed=True).clear
    array([False, False])
    """
    rows, columns, lens = _prepared(terrain, nodes, p_nc)
    from wildlab.geometry.compilation import announced
    from wildlab.geometry.line_of_sight import compare_all

    with announced("lines of sight"):
        found = compare_all(terrain.height, rows, columns, lens, terrain.step, itself, signed, terrain._top)
    return Looked(*found)


def _prepared(
    terrain: Terrain, nodes: ArrayLike, p_nc: ArrayLike
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Rows and columns, and the camera in columns, rows and metres upwards."""
    asked, p = np.asarray(nodes, np.int64).reshape(-1, 2), np.asarray(p_nc, float)
    if ((asked < 0) | (asked >= terrain.height.shape)).any():
        raise WildlabError(
            f"a grid point beyond the map of {terrain.height.shape[0]} by {terrain.height.shape[1]} nodes",
            "give rows and columns of the terrain, counted from 0",
            field="nodes",
        )
    if p.shape != (3,) or not np.isfinite(p).all():
        raise WildlabError(f"a camera at {p}", "give one known point: north, east and down", field="p_nc")
    north, east = (p[0] - terrain.north) / terrain.step, (p[1] - terrain.east) / terrain.step
    rows, columns = np.ascontiguousarray(asked[:, 0]), np.ascontiguousarray(asked[:, 1])
    return rows, columns, np.array([east, north, -p[2]])
