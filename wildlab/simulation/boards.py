"""Images of a calibration board as a camera would take them: the pattern seen along each pixel's ray.

The board is a chessboard or a grid of circles (H 2.5.1, F 2.4) with a margin, on an even ground. Each pixel
is the mean of rays spread over it; blur and noise are for the caller to add.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wildlab.geometry.camera import Camera, in_image, normalise, normalise_jacobian, project
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.intrinsics import Views

#: How far the margin reaches beyond the outermost squares or circles, in spacings.
MARGIN = 0.6
#: Shade all around a board, and rays across each pixel.
GROUND, SAMPLES = 120.0, 4
#: Radius of a circle, in spacings.
RADIUS = 0.28


def board_views(
    rng: np.random.Generator, camera: Camera, points: Array, n: int, tilt: float = np.radians(40.0)
) -> Views:
    """Poses of a board held before a camera as people do: tilted, turned, near and far, all over the image.

    Parameters
    ----------
    rng
        Where the poses come from.
    camera
        It sees the whole board in each view.
    points
        (M, 3) of the board, metres.
    n
        How many views.
    tilt
        The most that the board is tilted about either axis of the image, radians.

    Returns
    -------
    Views
    """
    middle, size = points.mean(axis=0), np.ptp(points, axis=0).max()
    rotations: list[Array] = []
    translations: list[Array] = []
    while len(rotations) < n:
        R = euler_to_matrix(rng.uniform(-tilt, tilt), rng.uniform(-tilt, tilt), rng.uniform(-np.pi, np.pi))
        share = rng.uniform(0.35, 0.8)  # of the image's height that the board takes
        distance = size * camera.fy / (share * camera.height)
        place = rng.uniform([0, 0], [camera.width, camera.height])
        xy = normalise(camera, place[None])[0]
        t = distance * np.array([*xy, 1.0]) - R @ middle
        uv = project(camera, points @ R.T + t)
        if in_image(camera, uv, border=0.02 * camera.width).all():
            rotations.append(R)
            translations.append(t)
    return Views(np.array(rotations), np.array(translations))


def board_image(
    camera: Camera,
    rotation: Array,
    translation: Array,
    points: Array,
    spacing: float,
    *,
    circles: bool = False,
    warm: float = 200.0,
    cold: float = 50.0,
) -> NDArray[np.float64]:
    """One image without noise: which side of the pattern is the warm one is said by `warm` and `cold`.

    Parameters
    ----------
    camera
        Intrinsic parameters; pixel (0, 0) is the centre of the upper left one.
    rotation, translation
        (3, 3) and (3,) metres, from the board to c.
    points
        (M, 3) inner corners or centres of circles, metres.
    spacing
        Side of a square, or what the radius of the circles is a share of, metres.
    circles
        Whether the points are centres of circles, else corners of squares.
    warm, cold
        Shades: of the margin and every other square, and of the others (or the circles).

    Returns
    -------
    (height, width) shades.
    """
    step = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    beyond = (MARGIN + (0.0 if circles else 1.0)) * spacing
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    centre = normalise(camera, np.column_stack([u.ravel(), v.ravel()]))
    # Rays of a pixel lie so near its middle one that a straight line between them will do.
    per_pixel = normalise_jacobian(camera, centre)
    # The plane z = 0 of the board, R x + t along the ray, solved for x.
    inverse = np.linalg.inv(np.column_stack([rotation[:, :2], translation]))
    tree = KDTree(points[:, :2])
    image = np.full(len(centre), GROUND * SAMPLES**2)
    near = _on_board(centre, inverse, low - 2 * beyond, high + 2 * beyond)[1]
    for du in step:
        for dv in step:
            rays = centre[near] + per_pixel[near] @ np.array([du, dv])
            xy, inside = _on_board(rays, inverse, low - beyond, high + beyond)
            shade = np.full(len(rays), GROUND)
            if circles:
                hit = tree.query(xy[inside])[0] < RADIUS * spacing
                shade[inside] = np.where(hit, cold, warm)
            else:
                shade[inside] = np.where(_cold_square(xy[inside], low, high, spacing), cold, warm)
            image[near] += shade - GROUND
    return image.reshape(camera.height, camera.width) / SAMPLES**2


def _on_board(rays: Array, inverse: Array, low: Array, high: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Where rays (N, 2) meet the board (N, 2), metres, and which do between two corners of it."""
    found = np.column_stack([rays, np.ones(len(rays))]) @ inverse.T
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = found[:, :2] / found[:, 2:]
    return xy, (found[:, 2] > 0) & ((xy > low) & (xy < high)).all(axis=1)


def _cold_square(xy: Array, low: Array, high: Array, spacing: float) -> NDArray[np.bool_]:
    square = np.floor((xy - low) / spacing).astype(int)
    last = np.rint((high - low) / spacing).astype(int)
    inside = ((square >= -1) & (square <= last)).all(axis=1)
    return np.asarray(inside & (square.sum(axis=1) % 2 == 0))
