"""A colour image of the ground with a tarpaulin on it, from a true pose, with exact labels (H 4.4.2).

The ground is a plane at zero down with patches that stay where they are; the tarpaulin is a rectangle on
it whose colour fades towards its rim; above the horizon there is sky. All of it is chosen; nothing in it
knows of a detector.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.camera_detections import visible_part
from wildlab.simulation.scene.render import check_above, pixel_coordinates

Colour = tuple[float, float, float]

#: Cells of the patches' tile, and parts of a pixel's side that are looked at where the tarpaulin may be.
_CELLS, _PARTS = 256, 4


@dataclass(frozen=True)
class Tarpaulin:
    """A rectangle on the ground.

    Attributes
    ----------
    length, width
        m, along its course and across.
    colour
        Red, green and blue, 0 to 255.
    rim
        Over how many metres from its edge the colour goes from `faded` of the way to the ground's to its own.
    faded
        Share of the ground's colour at the edge.
    north, east, course
        Where its middle is (m), and where it points (rad).
    """

    length: float
    width: float
    colour: Colour = (12.0, 120.0, 240.0)
    rim: float = 0.0
    faded: float = 0.5
    north: float = 0.0
    east: float = 0.0
    course: float = 0.0

    def corners(self) -> Array:
        """Corners in order, (4, 3) m in n."""
        x = np.array([1, 1, -1, -1]) * self.length / 2
        y = np.array([-1, 1, 1, -1]) * self.width / 2
        cos, sin = np.cos(self.course), np.sin(self.course)
        return np.stack([self.north + cos * x - sin * y, self.east + sin * x + cos * y, 0 * x], axis=1)


@dataclass(frozen=True)
class Ground:
    """What a tarpaulin lies on, and the sky.

    Attributes
    ----------
    colour
        Red, green and blue of the ground, 0 to 255.
    patch_sd, patch_length
        Standard deviation of the ground's brightness and, half as much, of each colour, 0 to 255, and over
        how many metres it changes.
    horizon, sky, sky_from
        Colours of the sky at the horizon, and from so many rad above it on.
    light
        What all colours are multiplied by.
    noise_sd
        Of the camera, for each pixel and colour, 0 to 255.
    seed
        Of the patches.
    """

    colour: Colour = (105.0, 115.0, 80.0)
    patch_sd: float = 12.0
    patch_length: float = 1.5
    horizon: Colour = (200.0, 220.0, 245.0)
    sky: Colour = (50.0, 130.0, 240.0)
    sky_from: float = 0.25
    light: float = 1.0
    noise_sd: float = 6.0
    seed: int = 0


class ColourView(NamedTuple):
    """A rendered colour image.

    Attributes
    ----------
    image
        (H, W, 3) uint8: red, green, blue.
    labels
        (H, W) bool: whether the pixel's centre is on the tarpaulin.
    sky
        (H, W) bool: whether a pixel looks above the horizon.
    centre
        (2,) where the tarpaulin's middle is, px, maybe outside of the image; NaN behind the camera.
    outline
        (4, 2) its corners, px; NaN behind the camera.
    share
        Visible share of the outline.
    """

    image: NDArray[np.uint8]
    labels: NDArray[np.bool_]
    sky: NDArray[np.bool_]
    centre: Array
    outline: Array
    share: float


def render_colour(
    ground: Ground,
    tarpaulin: Tarpaulin | None,
    camera: Camera,
    p_nc: ArrayLike,
    R_nc: ArrayLike,
    rng: np.random.Generator,
) -> ColourView:
    """The ground as a colour camera sees it.

    Parameters
    ----------
    ground, tarpaulin
        What there is to see; None where there is no tarpaulin.
    camera
        Intrinsic parameters.
    p_nc, R_nc
        Pose of the camera, (3,) m and (3, 3); the ground is at zero down.
    rng
        Of the camera's noise.

    Returns
    -------
    ColourView

    Raises
    ------
    WildlabError
        Where the camera is not above the ground.

    Examples
    --------
    >>> from wildlab.geometry.camera_poses import R_MC_DOWN
    >>> camera = Camera(64, 36, 100.0, 100.0, 31.5, 17.5)
    >>> rng = np.random.default_rng(1)
    >>> view = render_colour(Ground(), Tarpaulin(8.0, 4.0), camera, [0.0, 0.0, -50.0], R_MC_DOWN, rng)
    >>> view.centre.tolist(), int(view.labels.sum())
    ([31.5, 17.5], 128)
    """
    p, R = np.asarray(p_nc, float), np.asarray(R_nc, float)
    check_above(p, "ground")
    rays = _rays(camera)
    down = _component(rays, R[2])
    sky = np.asarray(down <= 1e-6)
    away = np.float32(-p[2]) / np.where(sky, np.float32(1), down)
    cell = ground.patch_length / 2
    north, east = (
        np.float32(p[axis] / cell % _CELLS) + away * _component(rays, R[axis] / cell) for axis in (0, 1)
    )
    patches = cv2.remap(
        _patches(ground.seed), north % _CELLS, east % _CELLS, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
    )
    # Far away a pixel sees many patches, and their mean.
    patches *= (ground.patch_sd / np.maximum(1.0, away / (camera.fx * cell)))[..., None].astype(np.float32)
    colours = np.asarray(patches + np.asarray(ground.colour), np.float32)
    labels = np.zeros(sky.shape, bool)
    centre, outline, share = np.full(2, np.nan), np.full((4, 2), np.nan), 0.0
    if tarpaulin is not None:
        middle = np.array([[tarpaulin.north, tarpaulin.east, 0.0]])
        centre = ground_to_pixel(camera, middle, p, R)[0]
        outline = ground_to_pixel(camera, tarpaulin.corners(), p, R)
        if np.isfinite(outline).all():
            share = _draw(tarpaulin, camera, p, R, outline, colours, labels)
    if sky.any():
        up = np.clip(-down[sky] / np.sqrt(1 + (rays[sky] ** 2).sum(axis=1)) / np.sin(ground.sky_from), 0, 1)
        low, high = np.asarray(ground.horizon), np.asarray(ground.sky)
        colours[sky] = low + up[:, None] * (high - low)
    colours *= ground.light
    if ground.noise_sd:
        # OpenCV's own generator is several times as quick; the seed is drawn from ours.
        cv2.setRNGSeed(int(rng.integers(2**31)))
        colours += cv2.randn(np.empty_like(colours), np.zeros(3), np.full(3, ground.noise_sd))
    image = np.asarray(cv2.convertScaleAbs(np.maximum(colours, 0)), np.uint8)
    return ColourView(image, labels, sky, centre, outline, share)


@lru_cache(maxsize=4)
def _rays(camera: Camera) -> NDArray[np.float32]:
    return pixel_coordinates(camera).astype(np.float32)


def _component(rays: NDArray[Any], row: Array) -> NDArray[Any]:
    """One component in n of the rays (H, W, 2) with depth one, as precise as they are."""
    a, b, c = row.astype(rays.dtype)
    return np.asarray(rays[..., 0] * a + rays[..., 1] * b + c)


@lru_cache(maxsize=8)
def _patches(seed: int) -> NDArray[np.float32]:
    """Brightness and colours of the ground (n, n, 3) that repeat, two cells coarse; of unit variance."""
    rng = np.random.default_rng([seed, 7])
    white = rng.standard_normal((_CELLS, _CELLS, 4)).astype(np.float32)
    k = np.fft.fftfreq(_CELLS) * 2 * np.pi
    filtered = np.exp(-(k[:, None] ** 2 + k[None] ** 2) / 2)
    smooth = np.fft.ifft2(np.fft.fft2(white, axes=(0, 1)) * filtered[..., None], axes=(0, 1)).real
    smooth /= smooth.std(axis=(0, 1))
    return np.asarray(smooth[..., :1] + 0.5 * smooth[..., 1:], np.float32)


def _draw(
    tarpaulin: Tarpaulin,
    camera: Camera,
    p: Array,
    R: Array,
    outline: Array,
    colours: NDArray[np.float32],
    labels: NDArray[np.bool_],
) -> float:
    """Draw the tarpaulin, each pixel by the parts of it that lie on it; its visible share."""
    low = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 2, [camera.width, camera.height])
    if (low >= high).any():
        return 0.0
    parts = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    u = (np.arange(low[0], high[0])[:, None] + parts).ravel()
    v = (np.arange(low[1], high[1])[:, None] + parts).ravel()
    inside, depth = _on(tarpaulin, camera, p, R, *np.meshgrid(u, v))
    own = np.asarray(tarpaulin.colour)
    faded = tarpaulin.faded * np.clip(1 - depth / tarpaulin.rim, 0, 1) if tarpaulin.rim else 0 * depth
    shape = (high[1] - low[1], _PARTS, high[0] - low[0], _PARTS)
    weight = (inside * (1 - faded)).reshape(shape).mean(axis=(1, 3))[..., None]
    part = (slice(low[1], high[1]), slice(low[0], high[0]))
    colours[part] = (1 - weight) * colours[part] + weight * own
    columns, rows = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    labels[part] = _on(tarpaulin, camera, p, R, columns, rows)[0]
    seen = visible_part(outline + 0.5, camera.width, camera.height).area
    return min(1.0, seen / visible_part(outline - outline.min(axis=0), np.inf, np.inf).area)


def _on(
    tarpaulin: Tarpaulin, camera: Camera, p: Array, R: Array, u: Array, v: Array
) -> tuple[NDArray[np.bool_], Array]:
    """Whether pixels look at the tarpaulin, and how far inside its edge, m."""
    rays = normalise(camera, np.stack([u, v], axis=-1).astype(float))
    away = -p[2] / _component(rays, R[2])
    x = p[0] + away * _component(rays, R[0]) - tarpaulin.north
    y = p[1] + away * _component(rays, R[1]) - tarpaulin.east
    cos, sin = np.cos(tarpaulin.course), np.sin(tarpaulin.course)
    depth = np.minimum(
        tarpaulin.length / 2 - np.abs(cos * x + sin * y), tarpaulin.width / 2 - np.abs(-sin * x + cos * y)
    )
    return (depth >= 0) & (away > 0), depth
