"""Bodies of even-sided layers with temperatures, and vessels.

A body has its own axes, x ahead and y to the right, about its centre on the water. A layer is a convex
outline at a height; the sides below it are not drawn, so tall bodies have several. Each layer is
warmer than the sea by ``excess`` K, with a texture and hot places; cold ones have it negative.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from wildlab.geometry.frames import Array
from wildlab.simulation.camera_detections import moments


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
