"""Places on land drawn at random, with animals, stones and trees, for whoever judges a detector."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.mount import Mount
from wildlab.simulation.scene.bodies import ANIMALS, Body, animal, scatter, stone, tree
from wildlab.simulation.scene.ground import Weather, rolling_land
from wildlab.simulation.scene.land import LandScene, ground_points, height_at

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
        Of animals, names of `wildlab.simulation.scene.bodies.ANIMALS`, each as likely as another.
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
        taken = [one.at.centre(0.0) for one in things]
        apart = 1.2 * longest if kind in ANIMALS else 0.7 * (metres + 1.0)
        put = scatter(rng, [mark], places[kind in ANIMALS], apart, taken)
        if put:
            things.append(Thing(kind, metres, int(rng.integers(2**31)), put[0]))
    return Layout(seed, tuple(things), p, R, float(np.linalg.norm(middle - p)))
