"""Scenes on land: ground with stones, trees and animals as a camera at a pose sees it, with exact labels.

The sun heats covers of the ground and a clear night cools them, by the time of day. A cover's temperature is
that of the air, less what it radiates away, plus what the sun gave it. The sun's heat is kept for a while: a
vector towards the sun, averaged over the past with an exponential weight, whose product with the normal of
the ground is the heat that a slope has. All numbers are chosen; covers differ by what is known of them: dry
sand becomes hottest, grass cools itself, rock keeps its warmth into the night.

Bodies stand where their centres are, level, on the height of the ground there. They hide one another and the
ground; the ground hides no body, so hills must be gentle for the camera's angle.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array
from wildlab.simulation.scene import kernels
from wildlab.simulation.scene.render import Body, SeenBody, check_above, draw_bodies, pixel_coordinates

Tile = NDArray[np.float32]

#: Side (m) and cells along it of the tile of unevenness.
UNEVEN = (64.0, 1024)
#: What a cloud takes of the sun's heat: the rest is diffuse, or was kept from before.
SHADOW_DEPTH = 0.75
#: What clouds take of the night's cooling: they radiate nearly as the ground does.
CLOUD_BLANKET = 0.8
#: How uneven sunlit ground is, as a share of its heat: tufts and stones throw shadows.
SUNLIT_UNEVEN = 0.08
#: Of a day's average for the sun's heat, minutes.
_STEP = 2.0
#: Elevation of the sun at 12, rad; the air's mean over the day and how far it goes from it, K, warmest at 15.
NOON_ELEVATION, AIR_MEAN, AIR_SWING = float(np.radians(55.0)), 288.0, 5.0


@dataclass(frozen=True)
class Cover:
    """What lies on the ground.

    Attributes
    ----------
    heating
        How much warmer than the air it would become under a sun straight above its surface, K.
    cooling
        How much colder than the air a clear sky makes it, K.
    lag
        How long it keeps its heat, h.
    texture_sd
        Of what is uneven on it without sun, K.
    """

    heating: float
    cooling: float
    lag: float
    texture_sd: float


#: Grass evaporates water and keeps little heat; sand heats most; rock keeps it for hours.
GRASS = Cover(heating=12.0, cooling=4.0, lag=0.5, texture_sd=0.5)
SAND = Cover(heating=26.0, cooling=3.0, lag=1.0, texture_sd=0.3)
ROCK = Cover(heating=24.0, cooling=0.5, lag=4.0, texture_sd=0.4)


@dataclass(frozen=True)
class Weather:
    """Time of day, clouds, and air.

    Attributes
    ----------
    hour
        Local solar time: the sun rises at 6, is highest at 12, and sets at 18.
    clouds
        Share of the sky that clouds cover; they shade all of the ground as much.
    """

    hour: float = 12.0
    clouds: float = 0.0

    @property
    def air(self) -> float:
        """Temperature of the air, K."""
        return AIR_MEAN + AIR_SWING * float(np.cos(2 * np.pi * (self.hour - 15) / 24))

    @property
    def sun(self) -> Array:
        """Unit vector towards the sun, (3,) north, east, up; below the horizon at night."""
        return np.asarray(_sun(np.array([self.hour]))[0])

    def kept(self, lag: float) -> Array:
        """The sun's vector averaged over the past with that lag (h), (3,); zero while it is below."""
        return np.asarray(_kept(self.hour, lag))

    def heat(self, cover: Cover) -> Array:
        """What the sun gives level ground of a cover, and slopes by their normal: (3,) K."""
        return np.asarray(cover.heating * self.kept(cover.lag))

    def loss(self, cover: Cover) -> float:
        """What a cover loses to the sky, K."""
        return cover.cooling * (1 - CLOUD_BLANKET * self.clouds)

    def level(self, cover: Cover) -> float:
        """Temperature of level ground of a cover, as an average over what clouds shade, K."""
        lit = 1 - SHADOW_DEPTH * self.clouds
        return self.air - self.loss(cover) + float(self.heat(cover)[2]) * lit


def _sun(hours: Array) -> Array:
    """(N, 3) north, east, up: the way of the sun at an equinox."""
    angle = np.pi * (np.asarray(hours, float) - 6) / 12
    high = np.sin(angle)
    return np.stack([-np.cos(NOON_ELEVATION) * high, np.cos(angle), np.sin(NOON_ELEVATION) * high], axis=-1)


@lru_cache(maxsize=64)
def _kept(hour: float, lag: float) -> Array:
    if lag <= 0:
        sun = _sun(np.array([hour]))[0]
        return sun if sun[2] > 0 else np.zeros(3)
    back = (np.arange(0, 72 * 60, _STEP) + _STEP / 2) / 60
    sun = _sun(hour - back)
    weight = np.exp(-back / lag)
    weight /= weight.sum()
    return np.asarray((weight * (sun[:, 2] > 0)) @ sun)


@dataclass(frozen=True, eq=False)
class Land:
    """Ground with relief and covers, that repeats every `side` metres both ways.

    Attributes
    ----------
    heights
        (n, n) m above zero, first axis north, second east; n a power of two. The plane is zeros.
    cover
        (m, m), number of the cover in ``covers``; m a power of two.
    side
        m.
    covers
        By number.
    weather
        Time of day, clouds, air.
    seed
        Of unevenness.
    """

    heights: Array = field(default_factory=lambda: np.zeros((4, 4)))
    cover: NDArray[np.integer] = field(default_factory=lambda: np.zeros((4, 4), np.int64))
    side: float = 256.0
    covers: tuple[Cover, ...] = (GRASS, SAND, ROCK)
    weather: Weather = field(default_factory=Weather)
    seed: int = 0

    @cached_property
    def relief(self) -> Tile:
        """(n, n, 3) height and slopes to the north and east, by central differences."""
        cell = self.side / len(self.heights)
        high = np.asarray(self.heights, float)
        north, east = (
            (np.roll(high, -1, axis) - np.roll(high, 1, axis)) / (2 * cell) for axis in (0, 1)
        )  # the tile repeats
        return np.stack([high, north, east], axis=-1).astype(np.float32)

    @cached_property
    def warmth(self) -> Tile:
        """(m, m, 5) by place: K over the air without sun, the sun's heat (3), and unevenness (K)."""
        values = [[-self.weather.loss(one), *self.weather.heat(one), one.texture_sd] for one in self.covers]
        return np.asarray(np.array(values, np.float32)[np.asarray(self.cover)])

    @property
    def uneven(self) -> Tile:
        """(k, k) of unit deviation; a tile of `UNEVEN`."""
        if all(one.texture_sd == 0 for one in self.covers):
            return np.zeros((2, 2), np.float32)
        return smooth_tile(UNEVEN[1], 1.5 * UNEVEN[1] / UNEVEN[0], self.seed % 8)


#: Even ground as warm as the air, flat: what stands on it is known in closed form.
EVEN_LAND = Land(covers=(Cover(heating=0.0, cooling=0.0, lag=1.0, texture_sd=0.0),))


@lru_cache(maxsize=8)
def smooth_tile(cells: int, coarse: float, seed: int) -> Tile:
    """A random tile (cells, cells) that repeats, of zero mean and unit deviation; small things are weaker.

    Parameters
    ----------
    cells
        Along a side.
    coarse
        Above so many cells things are equally strong.
    seed
        Of it.

    Returns
    -------
    (cells, cells) float32
    """
    k = fft.fftfreq(cells)
    size2 = (k[:, None] ** 2 + k[None, : cells // 2 + 1] ** 2) * (2 * np.pi * coarse) ** 2
    noise = np.random.default_rng([seed, cells]).standard_normal((cells, cells), np.float32)
    spectrum = fft.rfft2(noise) * (1 / (1 + size2) ** 0.75).astype(np.float32)
    spectrum[0, 0] = 0
    made = fft.irfft2(spectrum, (cells, cells))
    return np.asarray(made / made.std(), np.float32)


#: Of the heights of `rolling_land`, m, over hills some 60 m long; how much of it grass, sand and rock have.
RELIEF_M, SHARES = 2.0, (0.7, 0.2, 0.1)


def rolling_land(weather: Weather, seed: int = 0) -> Land:
    """Gently rolling ground with patches of grass, sand and rock.

    Parameters
    ----------
    weather
        Time of day, clouds, air.
    seed
        Of its forms and patches: sand and rock lie together where a smooth random field is highest.

    Returns
    -------
    Land

    Examples
    --------
    >>> land = rolling_land(Weather(hour=13.0), seed=3)
    >>> [round(float((land.cover == one).mean()), 1) for one in range(3)]
    [0.7, 0.2, 0.1]
    """
    k = fft.fftfreq(64) * 64
    size2 = k[:, None] ** 2 + k[None, :] ** 2
    noise = np.random.default_rng([seed, 1]).standard_normal((64, 64))
    high = fft.ifft2(np.exp(-size2 / (2 * 2.5**2)) * (size2 > 0) * fft.fft2(noise)).real
    field_of_patches = smooth_tile(512, 20.0, seed + 1000)
    edges = np.quantile(field_of_patches, np.cumsum(SHARES)[:2])
    cover = np.searchsorted(edges, field_of_patches)
    return Land(RELIEF_M * high / high.std(), cover, weather=weather, seed=seed)


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
    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.camera_poses import R_MC_DOWN
    >>> from wildlab.simulation.scene.drawn import slab
    >>> from wildlab.simulation.scene.land import EVEN_LAND
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
    ground_heights = [height_at(land, body.centre[:2]) for body in scene.bodies]
    lifted = [p + np.array([0.0, 0.0, high]) for high in ground_heights]
    seen = draw_bodies(scene.bodies, camera, lifted, R, weather.air, kelvin, labels)
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
    return kernels.sampled(land.relief[..., 0], len(land.heights) / land.side, north, east)


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
