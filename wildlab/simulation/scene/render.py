"""A scene as a camera at a pose sees it, in kelvin, with exact labels: before lens blur, noise and 14 bits.

Pixels are squares about their centres, the upper left one's at (0, 0), as in OpenCV and in
`wildlab.detection`; projection is that of `wildlab.geometry`, both ways.

The sea is waves and ripples that stand still and tilt a mirror of the sky, patches, and sun glint. Of a wind
sea only the slopes are wanted, which come out of one inverse Fourier transform per tile. Tiles repeat: the
long one every 256 m, the one of ripples every 16 m.

A body has its own axes, x ahead and y to the right, about its centre on the water. A layer is a convex
outline at a height; the sides below it are not drawn, so tall bodies have several. Each layer is
warmer than the sea by ``excess`` K, with a texture and hot places; cold ones have it negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy.spatial import ConvexHull

from wildlab.errors import WildlabError
from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.simulation.camera_detections import moments, visible_part
from wildlab.simulation.scene import kernels

#: Side (m) and cells along it of the tiles of waves, of ripples, and of patches.
WAVES, RIPPLES, PATCHES = (256.0, 512), (16.0, 256), (512.0, 128)
_GRAVITY = 9.81
Tile = NDArray[np.float32]


@dataclass(frozen=True)
class Hot:
    """A hot place, a Gaussian over the layer: where (m in the body's axes), how wide (m), by how much (K)."""

    ahead: float
    right: float
    width: float
    excess: float


@dataclass(frozen=True)
class Layer:
    """One level of a body.

    Attributes
    ----------
    outline
        Corners (x ahead, y right), m, convex, in order.
    height
        Above the sea, m.
    excess
        Warmer than the sea by that, K.
    texture_sd, texture_length
        Of what is uneven on it, K, and over how many metres.
    hot
        Hot places.
    """

    outline: tuple[tuple[float, float], ...]
    height: float
    excess: float
    texture_sd: float = 0.0
    texture_length: float = 1.0
    hot: tuple[Hot, ...] = ()


@dataclass(frozen=True)
class Wake:
    """What a moving vessel leaves behind: a band that widens and fades, warmer or colder than the sea (K)."""

    length: float
    width: float
    excess: float


@dataclass(frozen=True)
class Body:
    """Something that floats.

    Attributes
    ----------
    kind
        What it is, as labels say it.
    layers
        From the water up.
    north, east, course
        Where its centre is (m), and where it points (rad).
    wake
        None where there is none.
    texture_seed
        Of its unevenness.
    """

    kind: str
    layers: tuple[Layer, ...]
    north: float = 0.0
    east: float = 0.0
    course: float = 0.0
    wake: Wake | None = None
    texture_seed: int = 0

    def at(self, north: float, east: float, course: float = 0.0) -> Body:
        """The same body elsewhere, m and rad."""
        return replace(self, north=north, east=east, course=course)

    def place(self, x: ArrayLike, y: ArrayLike, height: float = 0.0) -> Array:
        """Places (K, 3) m in n that are so far ahead and to the right (K,) of its centre, m."""
        ahead, right = np.asarray(x, float), np.asarray(y, float)
        cos, sin = np.cos(self.course), np.sin(self.course)
        north, east = self.north + cos * ahead - sin * right, self.east + sin * ahead + cos * right
        return np.stack([north, east, np.full(len(ahead), -height)], axis=1)

    @property
    def centre(self) -> Array:
        """Its centre on the water, (3,) m in n."""
        return np.array([self.north, self.east, 0.0])

    @property
    def top(self) -> Array:
        """The same at the height of its uppermost layer."""
        return self.centre - [0.0, 0.0, max(layer.height for layer in self.layers)]

    def corners(self, layer: Layer) -> Array:
        """Corners of one of its layers, (K, 3) m in n."""
        x, y = np.array(layer.outline, float).T
        return self.place(x, y, layer.height)


def rectangle(length: float, beam: float, excess: float, height: float = 0.0) -> Body:
    """An even rectangle on the water: what it looks like is known in closed form.

    Parameters
    ----------
    length, beam
        m.
    excess
        Over the sea, K.
    height
        Above the water, m.

    Returns
    -------
    Body
        About the origin, its length to the north.
    """
    x, y = length / 2, beam / 2
    outline = ((x, -y), (x, y), (-x, y), (-x, -y))
    return Body("rectangle", (Layer(outline, height, excess),))


def hull(length: float, beam: float) -> tuple[tuple[float, float], ...]:
    """Outline of a hull about the centre of its area: straight sides, a blunt stern, a bow of a quarter."""
    x, y, shoulder = length / 2, beam / 2, length / 4
    corners = np.array(
        [
            (x, 0.0),
            (x - 0.35 * 0.25 * length, 0.62 * y),
            (shoulder, y),
            (-x, 0.9 * y),
            (-x, -0.9 * y),
            (shoulder, -y),
            (x - 0.35 * 0.25 * length, -0.62 * y),
        ]
    )
    ahead = moments(corners)[1][0]
    return tuple((float(a - ahead), float(b)) for a, b in corners)


def oval(
    length: float, width: float, ahead: float = 0.0, corners: int = 12
) -> tuple[tuple[float, float], ...]:
    """Corners on an ellipse, its middle so far ahead, m in the body's axes."""
    angles = 2 * np.pi * np.arange(corners) / corners
    return tuple((float(ahead + length / 2 * np.cos(a)), float(width / 2 * np.sin(a))) for a in angles)


def vessel(
    length: float,
    beam: float,
    excess: float = 6.0,
    *,
    speed: float = 0.0,
    engine: float = 15.0,
    seed: int = 0,
) -> Body:
    """A vessel: hull, deck with texture, a house behind the middle, a warm engine, and a wake if it moves.

    Parameters
    ----------
    length, beam
        m.
    excess
        Its deck above the sea's temperature, K.
    speed
        m/s; the wake follows from it.
    engine
        What the engine's place on deck has more, K.
    seed
        Of its texture.

    Returns
    -------
    Body
        At the origin, pointing north.
    """
    freeboard = max(0.06 * length, 0.4)
    outline = hull(length, beam)
    house = rectangle(0.22 * length, 0.75 * beam, 1.0).layers[0].outline
    back = tuple((x - 0.2 * length, y) for x, y in house)
    texture = 0.3 * abs(excess)
    width = max(0.12 * length, 0.5)
    levels = tuple(
        Layer(outline, height, 0.7 * excess, texture, 0.2 * length)
        for height in np.linspace(0.0, 0.6 * freeboard, 2)
    )
    deck = Layer(
        outline, freeboard, excess, texture, 0.12 * length, (Hot(-0.3 * length, 0.0, width, engine),)
    )
    top = Layer(back, 1.8 * freeboard, 1.2 * excess, texture, 0.1 * length)
    wake = None if speed == 0 else Wake(min(12.0 * speed, 8 * length), 1.1 * beam, 0.25 * np.sqrt(speed))
    return Body("vessel", (*levels, deck, top), wake=wake, texture_seed=seed)


def fitted_out(body: Body, count: int, excess: float, rng: np.random.Generator) -> Body:
    """The same body with small things, warm and cold, on its deck, the layer below the uppermost one.

    Parameters
    ----------
    body
        With two layers or more.
    count
        How many.
    excess
        Standard deviation of what they have over the deck, K.
    rng
        Of where they are and how warm.

    Returns
    -------
    Body
    """
    deck = body.layers[-2]
    corners = np.array(deck.outline)
    low, high = corners.min(axis=0), corners.max(axis=0)
    places = low + (high - low) * rng.uniform(0.05, 0.95, (count, 2))
    warmer = excess * rng.standard_normal(count)
    width = float(high[0] - low[0]) / 100
    hot = tuple(Hot(float(x), float(y), width, float(k)) for (x, y), k in zip(places, warmer, strict=True))
    return replace(body, layers=(*body.layers[:-2], replace(deck, hot=(*deck.hot, *hot)), body.layers[-1]))


@dataclass(frozen=True)
class Sea:
    """State of the sea and the sky above it; all chosen, none of H's flights says.

    Attributes
    ----------
    temperature
        Of the water, K.
    wind_speed, wind_from
        m/s, and where the wind comes from, rad.
    patches_sd
        Of slow changes of the temperature from place to place, K.
    air, zenith
        What the sky is like near the horizon and straight up, K.
    sun_azimuth, sun_elevation
        rad; None for the elevation is no sun.
    glint
        How much warmer a facet looks that mirrors the sun straight down, K.
    glint_width
        Over which angle about the mirrored sun, rad: ripples that no tile has.
    seed
        Of waves and patches.
    """

    temperature: float = 286.0
    wind_speed: float = 4.0
    wind_from: float = float(np.radians(225.0))
    patches_sd: float = 0.08
    air: float = 283.0
    zenith: float = 245.0
    sun_azimuth: float = float(np.radians(180.0))
    sun_elevation: float | None = None
    glint: float = 1.0
    glint_width: float = 0.06
    seed: int = 0


#: An even sea, as a test's truth wants it: no waves, no patches, and a sky that is as warm as the water.
EVEN = Sea(wind_speed=0.0, patches_sd=0.0, air=286.0, zenith=286.0)


class Tiles(NamedTuple):
    """Slopes north and east of waves and of ripples, (n, n, 2), and temperatures of patches, (n, n)."""

    waves: Tile
    ripples: Tile
    patches: Tile


def mean_square_slope(wind_speed: float) -> float:
    """Of a sea under that wind, upwind and crosswind together: Cox and Munk (1954)."""
    return 0.003 + 0.00512 * wind_speed if wind_speed > 0 else 0.0


def _slopes(side: float, cells: int, sea: Sea, variance: float) -> Tile:
    if variance <= 0:
        return np.zeros((cells, cells, 2), np.float32)
    k = 2 * np.pi * fft.fftfreq(cells, side / cells)
    kn, ke = np.meshgrid(k, k, indexing="ij")
    size = np.hypot(kn, ke)
    size[0, 0] = 1.0
    towards = sea.wind_from + np.pi
    along = (kn * np.cos(towards) + ke * np.sin(towards)) / size
    peak = _GRAVITY / max(sea.wind_speed, 0.5) ** 2  # wave number below which such a wind raises none
    # Slope spectrum of a wind sea: k^-2 per unit area, cut below the peak; most waves run with the wind.
    spectrum = np.exp(-0.7 * (peak / size) ** 2) / size**2 * (0.1 + np.where(along > 0, along**2, 0.05))
    spectrum[0, 0] = 0.0
    rng = np.random.default_rng([sea.seed, cells])
    noise = rng.standard_normal((cells, cells)) + 1j * rng.standard_normal((cells, cells))
    amplitude = np.sqrt(spectrum) * noise
    slopes = [fft.ifft2(amplitude * (part / size)).real for part in (kn, ke)]
    factor = np.sqrt(variance) / np.sqrt(slopes[0].var() + slopes[1].var())
    return np.stack([one * factor for one in slopes], axis=-1).astype(np.float32)


@lru_cache(maxsize=8)
def tiles_of(sea: Sea) -> Tiles:
    """The sea's tiles."""
    variance = mean_square_slope(sea.wind_speed)
    waves = _slopes(*WAVES, sea, 0.4 * variance)
    ripples = _slopes(*RIPPLES, sea, 0.6 * variance)
    return Tiles(waves, ripples, _patches(sea.patches_sd, sea.seed))


@lru_cache(maxsize=8)
def _patches(sd: float, seed: int) -> Tile:
    cells = PATCHES[1]
    k = fft.fftfreq(cells) * cells
    size2 = k[:, None] ** 2 + k[None, :] ** 2
    spectrum = np.where(size2 > 0, 1 / (1 + size2), 0.0)
    rng = np.random.default_rng([seed, 7])
    field = fft.ifft2(spectrum * fft.fft2(rng.standard_normal((cells, cells)))).real
    return np.asarray(sd * field / field.std(), np.float32)


#: Pixels around a body's projected outlines that are looked at too.
_MARGIN = 3
_TEXTURE = 128


@dataclass(frozen=True)
class Scene:
    """A sea and what floats on it."""

    sea: Sea
    bodies: tuple[Body, ...] = ()


class SeenBody(NamedTuple):
    """What an image shows of a body.

    Attributes
    ----------
    number
        Its label: the place in `Scene.bodies`, from 1.
    kind
        Its `Body.kind`.
    uv
        (2,) where its centre on the water is, px; maybe outside of the image.
    centre
        (2,) centre of its whole outline, px; maybe outside too.
    middle
        (2,) centre of the visible part of its outline, px.
    outline
        (K, 2) convex hull of the projected corners of all layers, px.
    area
        Visible part of that, px^2: exact, by cutting the polygon.
    share
        Visible share of the whole outline.
    covered
        Pixels of the image that it covers, in parts.
    """

    number: int
    kind: str
    uv: Array
    centre: Array
    middle: Array
    outline: Array
    area: float
    share: float
    covered: float

    @property
    def whole(self) -> bool:
        """Whether the entire contour is in view."""
        return self.share > 1 - 1e-9


class RenderedView(NamedTuple):
    """A rendered image.

    Attributes
    ----------
    kelvin
        (H, W) apparent temperatures.
    labels
        (H, W): number of the body at the pixel's centre, 0 for none.
    water
        (H, W): whether a pixel looks down at the sea; else it is sky.
    seen
        What there is to see of each body whose outline reaches into the image.
    """

    kelvin: NDArray[np.float32]
    labels: NDArray[np.int16]
    water: NDArray[np.bool_]
    seen: tuple[SeenBody, ...]


def render(scene: Scene, camera: Camera, p_nc: ArrayLike, R_nc: ArrayLike) -> RenderedView:
    """A scene as a camera sees it.

    Parameters
    ----------
    scene
        Sea and bodies.
    camera
        Intrinsic parameters.
    p_nc, R_nc
        Pose of the camera, (3,) m and (3, 3); the sea is at zero down.

    Returns
    -------
    View

    Raises
    ------
    WildlabError
        Where the camera is not above the sea.

    Examples
    --------
    >>> from wildlab.geometry.camera import Camera
    >>> from wildlab.geometry.camera_poses import R_MC_DOWN
    >>> from wildlab.simulation.scene.render import rectangle
    >>> from wildlab.simulation.scene.render import EVEN
    >>> camera = Camera(64, 48, 100.0, 100.0, 31.5, 23.5)
    >>> view = render(Scene(EVEN, (rectangle(10.0, 4.0, 8.0),)), camera, [0.0, 0.0, -50.0], R_MC_DOWN)
    >>> round(view.seen[0].area, 3), view.seen[0].uv.tolist()
    (160.0, [31.5, 23.5])
    """
    p, R = np.asarray(p_nc, float), np.asarray(R_nc, float)
    check_above(p, "sea")
    rays = pixel_coordinates(camera)
    kelvin = np.empty((camera.height, camera.width), np.float32)
    water = np.empty(kelvin.shape, bool)
    sea = scene.sea
    weather = np.array([sea.temperature, sea.air, sea.zenith, sea.glint])
    scales = np.array([cells / side for side, cells in (WAVES, RIPPLES, PATCHES)])
    focal = float(np.sqrt(camera.fx * camera.fy))
    kernels.render_sea(rays, p, R, focal, *tiles_of(sea), scales, weather, _sun(sea), kelvin, water)
    labels = np.zeros(kelvin.shape, np.int16)
    places = [p] * len(scene.bodies)
    seen = draw_bodies(scene.bodies, camera, places, R, sea.temperature, kelvin, labels)
    return RenderedView(kelvin, labels, water, seen)


def check_above(p: Array, what: str, height: float = 0.0) -> None:
    """Refuses a camera that is not above what it looks at.

    Parameters
    ----------
    p
        (3,) position of the camera, m.
    what
        It looks at, for the sentence.
    height
        Of that below the camera, m above zero down.

    Raises
    ------
    WildlabError
        Where the camera is not above it.
    """
    over = float(-p[2] - height) + 0.0  # no minus zero
    if not over > 0:
        raise WildlabError(
            f"a camera {over:g} m above the {what}",
            f"raise the camera: down counts from zero, and must be below {0.0 - height:g} m",
            field="p_nc",
        )


def draw_bodies(
    bodies: tuple[Body, ...],
    camera: Camera,
    places: Sequence[Array],
    R: Array,
    temperature: float,
    kelvin: NDArray[np.float32],
    labels: NDArray[np.int16],
) -> tuple[SeenBody, ...]:
    """Draws bodies over an image, the farther ones first.

    Parameters
    ----------
    bodies
        Numbered from 1.
    camera
        Intrinsic parameters.
    places
        Of the camera, (3,) m for each body: from where it is seen, if its ground is at zero down.
    R
        (3, 3) attitude of the camera.
    temperature
        What excesses are over, K.
    kelvin, labels
        (H, W), drawn on.

    Returns
    -------
    tuple of Seen
    """
    seen = []
    # Those whose tops are further away first, so that nearer ones hide them.
    order = sorted(range(len(bodies)), key=lambda k: -float(np.linalg.norm(bodies[k].top - places[k])))
    rays = pixel_coordinates(camera)
    for k in order:
        body, p = bodies[k], places[k]
        found = outline_of(body, camera, p, R)
        if found is None:
            continue
        _draw_wake(body, camera, rays, p, R, kelvin)
        covered = _draw(body, camera, rays, p, R, found, k + 1, temperature, kelvin, labels)
        size = visible_part(found + 0.5, camera.width, camera.height)  # a pixel reaches half a pixel around
        if not size.area > 0:
            continue
        whole = visible_part(found - found.min(axis=0), np.inf, np.inf)
        uv = ground_to_pixel(camera, body.centre[None], p, R)[0]
        seen.append(
            SeenBody(
                k + 1, body.kind, uv, whole.centre + found.min(axis=0), size.centre - 0.5, found, size.area,
                min(size.area / whole.area, 1.0), covered,
            )
        )  # fmt: skip
    return tuple(seen)


def outline_of(body: Body, camera: Camera, p: Array, R: Array) -> Array | None:
    """Convex hull (K, 2) px of a body's projected corners, exact; None where one is behind the camera.

    Parameters
    ----------
    body
        With one layer or more.
    camera
        Intrinsic parameters.
    p, R
        Pose of the camera, (3,) m and (3, 3).

    Returns
    -------
    (K, 2) px in order, or None.
    """
    corners = np.concatenate([body.corners(layer) for layer in body.layers])
    pixels = ground_to_pixel(camera, corners, p, R)
    return pixels[ConvexHull(pixels).vertices] if np.isfinite(pixels).all() else None


@lru_cache(maxsize=4)
def pixel_coordinates(camera: Camera) -> NDArray[np.float64]:
    """Normalised coordinates (H, W, 2) of all pixels' centres."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(float)
    return np.ascontiguousarray(normalise(camera, np.stack([u, v], axis=-1)))


def _sun(sea: Sea) -> Array:
    """Unit vector towards the sun in n, and the width of its glint; zeros without a sun."""
    if sea.sun_elevation is None:
        return np.zeros(4)
    level = np.cos(sea.sun_elevation)
    direction = [
        level * np.cos(sea.sun_azimuth), level * np.sin(sea.sun_azimuth), -np.sin(sea.sun_elevation),
    ]  # fmt: skip
    return np.array([*direction, sea.glint_width])


@lru_cache(maxsize=64)
def _texture(seed: int) -> NDArray[np.float32]:
    """An uneven surface of unit variance (n, n), a few cells coarse, that repeats."""
    rng = np.random.default_rng([seed, 3])
    k = np.fft.fftfreq(_TEXTURE) * _TEXTURE
    size2 = k[:, None] ** 2 + k[None, :] ** 2
    field = np.fft.ifft2(
        np.exp(-size2 / (2 * 9.0**2)) * np.fft.fft2(rng.standard_normal((_TEXTURE,) * 2))
    ).real
    return np.asarray(field / field.std(), np.float32)


def _frame(body: Body) -> Array:
    return np.array([body.north, body.east, np.cos(body.course), np.sin(body.course)])


def _box(pixels: Array, camera: Camera) -> NDArray[np.int64]:
    """First and last rows and columns of the image about pixels (N, 2)."""
    low = np.floor(pixels.min(axis=0)) - _MARGIN
    high = np.ceil(pixels.max(axis=0)) + _MARGIN + 1
    columns = np.clip([low[0], high[0]], 0, camera.width)
    rows = np.clip([low[1], high[1]], 0, camera.height)
    return np.array([*rows, *columns], np.int64)


def _draw(
    body: Body,
    camera: Camera,
    rays: Array,
    p: Array,
    R: Array,
    outline: Array,
    number: int,
    temperature: float,
    kelvin: NDArray[np.float32],
    labels: NDArray[np.int16],
) -> float:
    box = _box(outline, camera)
    if box[0] >= box[1] or box[2] >= box[3]:
        return 0.0
    edges: list[list[float]] = []
    spans: list[list[int]] = []
    hot: list[list[float]] = []
    for layer_number, layer in enumerate(body.layers):
        first = len(edges)
        edges += _edges(np.array(layer.outline, float))
        spans.append([first, len(edges)])
        hot += [[layer_number, h.ahead, h.right, h.width, h.excess] for h in layer.hot]
    values = np.array(
        [[v.excess, v.texture_sd, _TEXTURE / (24.0 * v.texture_length)] for v in body.layers], float
    )
    # How long a pixel is on the water, at most within the box: at its top, where the camera looks flattest.
    corners = rays[[box[0], box[0], box[1] - 1, box[1] - 1], [box[2], box[3] - 1, box[2], box[3] - 1]]
    down = corners @ R[2, :2] + R[2, 2]
    flat = max(float(down.min()), 0.02)
    focal = min(camera.fx, camera.fy)
    metres = 1.5 * -p[2] / (focal * flat**2)
    step = np.array([1 / camera.fx, 1 / camera.fy])
    return float(
        kernels.render_body(
            rays, step, p, R, box, _frame(body), np.array(edges), np.array(spans, np.int64),
            np.array([layer.height for layer in body.layers], float), values,
            np.array(hot, float).reshape(-1, 5), _texture(body.texture_seed), temperature, metres, number,
            kelvin, labels,
        )
    )  # fmt: skip


def _edges(corners: Array) -> list[list[float]]:
    """Half planes (normal x, normal y, offset) of a convex outline, normals outward."""
    middle = corners.mean(axis=0)
    found = []
    for here, there in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = there - here
        normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        if normal @ (here - middle) < 0:
            normal = -normal
        found.append([float(normal[0]), float(normal[1]), float(normal @ here)])
    return found


def _draw_wake(
    body: Body,
    camera: Camera,
    rays: Array,
    p: Array,
    R: Array,
    kelvin: NDArray[np.float32],
) -> None:
    if body.wake is None:
        return
    stern = min(x for layer in body.layers for x, _ in layer.outline)
    half = 2.0 * body.wake.width
    x = [stern, stern, stern - body.wake.length, stern - body.wake.length]
    corners = body.place(x, [-half, half, half, -half])
    pixels = ground_to_pixel(camera, corners, p, R)
    everything = np.array([0, camera.height, 0, camera.width], np.int64)
    box = _box(pixels, camera) if np.isfinite(pixels).all() else everything
    wake = np.array([stern, body.wake.length, body.wake.width, body.wake.excess])
    kernels.render_wake(rays, p, R, box, _frame(body), wake, kelvin)
