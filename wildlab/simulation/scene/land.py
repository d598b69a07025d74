"""Scenes on land: ground with stones, trees and animals as a camera at a pose sees it, with exact labels.

Bodies stand where their centres are, level, on the height of the ground there. They hide one another and the
ground; the ground hides no body, so hills must be gentle for the camera's angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array
from wildlab.simulation.scene import ground_kernels as kernels
from wildlab.simulation.scene.bodies import Body
from wildlab.simulation.scene.ground import SHADOW_DEPTH, SUNLIT_UNEVEN, UNEVEN, Land
from wildlab.simulation.scene.kernels import sampled
from wildlab.simulation.scene.render import SeenBody, check_above, draw_bodies, pixel_coordinates

#: How much colder than the air a clear sky is, and a closed cover of clouds, K.
CLEAR_SKY, CLOUDED_SKY = 35.0, 4.0


@dataclass(frozen=True, eq=False)
class LandScene:
    """Land and what stands on it; temperatures of bodies are over that of the air."""

    land: Land
    bodies: tuple[Body, ...] = ()


class LandView(NamedTuple):
    """A rendered image.

    Attributes
    ----------
    kelvin
        (H, W) apparent temperatures.
    labels
        (H, W): number of the body at the pixel's centre, 0 for none.
    ground
        (H, W): whether a pixel looks at the ground, or at what stands on it; else it is sky.
    seen
        What there is to see of each body whose outline reaches into the image.
    """

    kelvin: NDArray[np.float32]
    labels: NDArray[np.int16]
    ground: NDArray[np.bool_]
    seen: tuple[SeenBody, ...]

    def visible(self, number: int) -> float:
        """Which share of a body shows: neither beyond the image nor behind another, by pixels' centres."""
        one = next((seen for seen in self.seen if seen.number == number), None)
        if one is None:
            return 0.0
        return float(np.clip((self.labels == number).sum() / max(one.covered, 1.0) * one.share, 0.0, 1.0))


def render_land(scene: LandScene, camera: Camera, p_nc: ArrayLike, R_nc: ArrayLike) -> LandView:
    """A scene on land as a camera sees it.

    Parameters
    ----------
    scene
        Land and bodies.
    camera
        Intrinsic parameters.
    p_nc, R_nc
        Pose of the camera, (3,) m and (3, 3); heights of the land count up from zero down.

    Returns
    -------
    LandView

    Raises
    ------
    WildlabError
        Where the camera is not above the ground.

    Examples
    --------
    >>> from wildlab.geometry import Camera
    >>> from wildlab.geometry.mount import R_MC_DOWN
    >>> from wildlab.simulation.scene.bodies import slab
    >>> from wildlab.simulation.scene.ground import EVEN_LAND
    >>> camera = Camera(64, 48, 100.0, 100.0, 31.5, 23.5)
    >>> scene = LandScene(EVEN_LAND, (slab(10.0, 4.0, 8.0),))
    >>> view = render_land(scene, camera, [0.0, 0.0, -50.0], R_MC_DOWN)
    >>> round(view.seen[0].area, 3), view.seen[0].uv.tolist()
    (160.0, [31.5, 23.5])
    """
    p, R, land = np.asarray(p_nc, float), np.asarray(R_nc, float), scene.land
    check_above(p, "ground", height_at(land, p[:2]))
    shape = (camera.height, camera.width)
    kelvin, ground = np.empty(shape, np.float32), np.empty(shape, bool)
    tiles = (land.relief, land.warmth, land.uneven)
    sides = (land.side, land.side, UNEVEN[0])
    scales = np.array([len(tile) / side for tile, side in zip(tiles, sides, strict=True)])
    weather = land.weather
    clear = 1 - weather.clouds
    sky = weather.air - clear * CLEAR_SKY - weather.clouds * CLOUDED_SKY
    kernels.render_ground(
        pixel_coordinates(camera), p, R, float(np.sqrt(camera.fx * camera.fy)), *tiles, scales, _limits(land),
        weather.air, sky, SHADOW_DEPTH * weather.clouds, SUNLIT_UNEVEN, kelvin, ground,
    )  # fmt: skip
    labels = np.zeros(shape, np.int16)
    # A body is drawn about the ground under it: the camera is as much lower as the ground is higher.
    ground_heights = [height_at(land, body.centre(0.0)[:2]) for body in scene.bodies]
    lifted = [p + np.array([0.0, 0.0, high]) for high in ground_heights]
    seen = draw_bodies(scene.bodies, camera, lifted, R, 0.0, weather.air, kelvin, labels)
    return LandView(kelvin, labels, ground, seen)


def _limits(land: Land) -> Array:
    return np.array([land.relief[..., 0].min(), land.relief[..., 0].max()], float)


def height_at(land: Land, place: ArrayLike) -> float:
    """Height of the ground at a place (2,) north and east, m, bilinear between the array's.

    Examples
    --------
    >>> height_at(Land(np.array([[0.0, 2.0], [0.0, 2.0]]), side=8.0), [0.0, 2.0])
    1.0
    """
    north, east = np.asarray(place, float)
    return sampled(land.relief[..., 0], len(land.heights) / land.side, north, east)


def ground_points(land: Land, camera: Camera, p_nc: ArrayLike, R_nc: ArrayLike, uv: ArrayLike) -> Array:
    """Where the rays of pixels meet the ground, without what stands on it.

    Parameters
    ----------
    land
        The ground.
    camera, p_nc, R_nc
        The camera and its pose.
    uv
        (N, 2) px.

    Returns
    -------
    (N, 3) m in n; NaN where a ray meets none.
    """
    xy = normalise(camera, np.asarray(uv, float))
    rays = np.concatenate([xy, np.ones((len(xy), 1))], axis=1) @ np.asarray(R_nc, float).T
    found = np.empty((len(rays), 3))
    scale = len(land.heights) / land.side
    lowest, highest = (float(one) for one in _limits(land))
    kernels.meet_all(
        land.relief, scale, lowest, highest, np.asarray(p_nc, float), np.ascontiguousarray(rays), found
    )
    return found
