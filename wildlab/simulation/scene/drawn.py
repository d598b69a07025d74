"""What stands on land, animals, stones and trees, and places drawn at random with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.simulation.scene.land import (
    ROCK,
    SHADOW_DEPTH,
    Cover,
    LandScene,
    Weather,
    ground_points,
    height_at,
    rolling_land,
)
from wildlab.simulation.scene.render import Body, Hot, Layer, oval, rectangle

#: Temperature of the blood, K.
BLOOD = 310.15
#: Of a tree's leaves, which transpire.
LEAVES = Cover(heating=4.0, cooling=0.5, lag=0.3, texture_sd=0.3)
#: How much of its height an animal's trunk has, from the belly up; the rest is legs.
_BELLY_TO_BACK = 0.65
#: How warm head and tail are, as shares of the trunk's back: extremities are cooler.
HEAD, TAIL = 0.75, 0.5
#: What the sun adds to an animal's back, K, for a sun straight above.
SUNNED = 4.0


@dataclass(frozen=True)
class Kind:
    """An animal seen from above.

    Attributes
    ----------
    length, width, height
        Of the trunk and of the back above the ground, m.
    bare
        How far the skin is from the air's temperature towards the blood's, as a share.
    head
        Length of head and neck, as a share of the trunk's.
    """

    length: float
    width: float
    height: float
    bare: float
    head: float = 0.35


#: A rhinoceros has no coat; an antelope has one; a calf is half as long as a rhinoceros.
ANIMALS = {
    "rhinoceros": Kind(3.2, 1.3, 1.7, 0.45, 0.3),
    "calf": Kind(1.6, 0.65, 0.9, 0.5, 0.3),
    "antelope": Kind(1.5, 0.5, 1.2, 0.35, 0.4),
}


def animal(kind: str, weather: Weather, seed: int = 0) -> Body:
    """An animal: a trunk, warmest over the shoulders, with a cooler head and tail.

    Parameters
    ----------
    kind
        A name of `ANIMALS`.
    weather
        For the temperature of its skin.
    seed
        Of what is uneven on it.

    Returns
    -------
    Body
        At the origin, looking north.
    """
    k = ANIMALS[kind]
    sun = SUNNED * float(weather.kept(0.3)[2]) * (1 - SHADOW_DEPTH * weather.clouds)
    skin = k.bare * (BLOOD - weather.air) + sun
    uneven = 0.06 * k.bare * (BLOOD - weather.air)
    front = k.length / 2
    head = oval(k.head * k.length, 0.5 * k.width, ahead=front + 0.2 * k.head * k.length, corners=8)
    tail = oval(0.2 * k.length, 0.1 * k.width, ahead=-front - 0.05 * k.length, corners=4)
    shoulders = Hot(0.2 * k.length, 0.0, 0.3 * k.width, 0.12 * skin)
    # The trunk in as many levels that a camera 60 degrees aside sees no ground between them.
    levels = int(np.ceil(_BELLY_TO_BACK * k.height * np.tan(np.radians(60)) / (0.6 * k.width)))
    trunk = []
    for share in np.linspace(0.0, 1.0, levels):
        slim = 1 - 0.2 * share**2
        outline = oval(slim * k.length, slim * k.width, corners=10)
        high = (1 - _BELLY_TO_BACK * (1 - share)) * k.height
        hot = (shoulders,) if share == 1 else ()
        trunk.append(
            Layer(outline, float(high), float(0.85 + 0.15 * share) * skin, uneven, 0.2 * k.length, hot)
        )
    ends = (
        Layer(tail, 0.65 * k.height, TAIL * skin),
        Layer(head, 0.65 * k.height, HEAD * skin, uneven, 0.1 * k.length),
    )
    layers = tuple(sorted((*ends, *trunk), key=lambda layer: layer.height))
    return Body(kind, layers, texture_seed=seed)


def slab(length: float, beam: float, excess: float) -> Body:
    """An even rectangle on the ground: with `EVEN_LAND` a scene whose image is known in closed form.

    Parameters
    ----------
    length, beam
        m.
    excess
        Over the air, K.

    Returns
    -------
    Body
    """
    return replace(rectangle(length, beam, excess), kind="slab")


def stone(size: float, weather: Weather, seed: int = 0) -> Body:
    """A boulder with the warmth of rock.

    Parameters
    ----------
    size
        Its length, m.
    weather
        What it was heated by.
    seed
        Of its form.

    Returns
    -------
    Body
    """
    rng = np.random.default_rng([seed, 5])
    excess = weather.level(ROCK) - weather.air
    angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    while np.diff(angles, append=angles[0] + 2 * np.pi).max() > 0.9 * np.pi:
        angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
    wide = float(rng.uniform(0.6, 1.0))
    # Corners on an oval, so that the outline is convex.
    outline = tuple((float(size / 2 * np.cos(a)), float(wide * size / 2 * np.sin(a))) for a in angles)
    top = tuple((0.7 * x, 0.7 * y) for x, y in outline)
    texture = 0.1 * abs(excess) + 0.2
    layers = (
        Layer(outline, 0.0, 0.9 * excess, texture, 0.3 * size),
        Layer(top, 0.35 * size, excess, texture, 0.3 * size),
    )
    return Body("stone", layers, texture_seed=seed)


def tree(crown: float, weather: Weather, seed: int = 0) -> Body:
    """A tree: a crown near the temperature of the air, that hides what is under it.

    Parameters
    ----------
    crown
        Its width, m; it is as high.
    weather
        What it was heated by.
    seed
        Of what is uneven on it.

    Returns
    -------
    Body
    """
    excess = weather.level(LEAVES) - weather.air
    layers = tuple(
        Layer(oval(share * crown, share * crown, corners=10), high * crown, excess, 0.5, 0.15 * crown)
        for share, high in ((1.0, 0.5), (0.7, 0.85))
    )
    return Body("tree", layers, texture_seed=seed)


def scatter(
    rng: np.random.Generator,
    bodies: Sequence[Body],
    places: Array,
    apart: float,
    taken: Sequence[Array] = (),
) -> tuple[Body, ...]:
    """Bodies at places that keep their distance, with courses at random.

    Parameters
    ----------
    rng
        Of the courses.
    bodies
        To be placed, in this order.
    places
        (N, 2) or (N, 3) m, north and east first; NaN for none. They are tried in their order.
    apart
        Distance of centres at least, m.
    taken
        Places that are kept free too.

    Returns
    -------
    tuple of Body
        Those for which there was a place.
    """
    kept = [np.asarray(one, float)[:2] for one in taken]
    waiting, put = list(bodies), []
    for place in np.asarray(places, float):
        if not waiting:
            break
        at = place[:2]
        if np.isfinite(at).all() and all(np.hypot(*(at - one)) >= apart for one in kept):
            kept.append(at)
            put.append(waiting.pop(0).at(float(at[0]), float(at[1]), float(rng.uniform(-np.pi, np.pi))))
    return tuple(put)


#: Places that are tried for what stands on the land.
_TRIES = 400
#: Lengths of stones and widths of crowns, m.
STONE_SIZE, CROWN = (0.4, 2.0), (3.0, 6.0)


@dataclass(frozen=True)
class LandDraw:
    """Ranges from which scenes on land are drawn, evenly.

    Attributes
    ----------
    height
        Of the camera above the ground under it, m.
    tilt, spread
        Of the camera from straight down, rad, and how far from that it may be.
    animals, stones, trees
        How many there are, both ends included.
    kinds
        Of animals, names of `wildlab.simulation.scene.drawn.ANIMALS`, each as likely as another.
    border
        How far from the image's border centres of animals are, px.
    """

    height: float = 30.0
    tilt: float = float(np.radians(15.0))
    spread: float = float(np.radians(10.0))
    animals: tuple[int, int] = (2, 6)
    stones: tuple[int, int] = (3, 8)
    trees: tuple[int, int] = (0, 3)
    kinds: tuple[str, ...] = tuple(ANIMALS)
    border: float = 30.0


class Thing(NamedTuple):
    """Something that stands somewhere: its kind, its size (m; of stones and trees), its seed, and where."""

    kind: str
    size: float
    seed: int
    at: Body

    def body(self, weather: Weather) -> Body:
        """As it is in that weather."""
        if self.kind == "stone":
            made = stone(self.size, weather, self.seed)
        elif self.kind == "tree":
            made = tree(self.size, weather, self.seed)
        else:
            made = animal(self.kind, weather, self.seed)
        return made.at(self.at.north, self.at.east, self.at.course)


class Layout(NamedTuple):
    """A place with what stands there, and the pose that it is seen from.

    Attributes
    ----------
    seed
        Of the land.
    things
        Animals first.
    p_nc, R_nc
        Of the camera, (3,) m and (3, 3).
    distance
        From the camera to the ground along the middle of the image, m.
    """

    seed: int
    things: tuple[Thing, ...]
    p_nc: Array
    R_nc: Array
    distance: float

    def scene(self, weather: Weather, with_animals: bool = True) -> LandScene:
        """The place in that weather."""
        things = [one for one in self.things if with_animals or one.kind not in ANIMALS]
        land = rolling_land(weather, self.seed)
        return LandScene(land, tuple(one.body(weather) for one in things))


def draw_layout(rng: np.random.Generator, camera: Camera, draw: LandDraw) -> Layout:
    """A place with animals, stones and trees in view.

    Parameters
    ----------
    rng
        Of all of it.
    camera
        That sees it.
    draw
        Ranges.

    Returns
    -------
    Layout
    """
    seed = int(rng.integers(2**20))
    land = rolling_land(Weather(), seed)
    place = rng.uniform(0, land.side, 2)
    p = np.array([*place, -height_at(land, place) - draw.height])
    tilt = draw.tilt + rng.uniform(-draw.spread, draw.spread)
    R_nb = euler_to_matrix(rng.uniform(-draw.spread, draw.spread) / 2, tilt, rng.uniform(-np.pi, np.pi))
    R = np.asarray(CameraPoses(camera, Mount("down"), p, R_nb).R_nc, float).reshape(3, 3)
    size = np.array([camera.width, camera.height], float)
    middle = ground_points(land, camera, p, R, [size / 2])[0]

    def somewhere(border: float) -> Array:
        uv = rng.uniform(border, size - border, (_TRIES, 2))
        return ground_points(land, camera, p, R, uv)

    kinds = [str(one) for one in rng.choice(draw.kinds, int(rng.integers(*draw.animals, endpoint=True)))]
    longest = max((ANIMALS[kind].length for kind in kinds), default=1.0)
    sizes = rng.uniform(*STONE_SIZE, int(rng.integers(*draw.stones, endpoint=True)))
    crowns = rng.uniform(*CROWN, int(rng.integers(*draw.trees, endpoint=True)))
    wanted = [(kind, 0.0) for kind in kinds]
    wanted += [("stone", float(one)) for one in sizes] + [("tree", float(one)) for one in crowns]
    things: list[Thing] = []
    places = {True: somewhere(draw.border), False: somewhere(0.0)}
    mark = replace(animal("calf", Weather()), kind="mark")
    for kind, metres in wanted:
        taken = [one.at.centre for one in things]
        apart = 1.2 * longest if kind in ANIMALS else 0.7 * (metres + 1.0)
        put = scatter(rng, [mark], places[kind in ANIMALS], apart, taken)
        if put:
            things.append(Thing(kind, metres, int(rng.integers(2**31)), put[0]))
    return Layout(seed, tuple(things), p, R, float(np.linalg.norm(middle - p)))
