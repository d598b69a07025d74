"""Scenes drawn at random: vessels of many sizes and temperatures, seas of many winds, cameras of many views.

For tests and studies that judge a detector over everything a flight may meet; `Draw` says over what.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.mount import Mount
from wildlab.simulation.scene.bodies import ANIMALS, KINDS, Body, animal, scatter, stone, tree, vessel
from wildlab.simulation.scene.ground import Weather, rolling_land
from wildlab.simulation.scene.land import LandScene, ground_points, height_at
from wildlab.simulation.scene.render import Scene
from wildlab.simulation.scene.sea import Sea

#: Places that are tried for what stands on the land.
_TRIES = 400


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
    stone_size, crown
        Lengths of stones and widths of crowns, m.
    border
        How far from the image's border centres of animals are, px.
    shares
        Of grass, sand and rock.
    """

    height: float = 30.0
    tilt: float = float(np.radians(15.0))
    spread: float = float(np.radians(10.0))
    animals: tuple[int, int] = (2, 6)
    stones: tuple[int, int] = (3, 8)
    trees: tuple[int, int] = (0, 3)
    kinds: tuple[str, ...] = tuple(ANIMALS)
    stone_size: tuple[float, float] = (0.4, 2.0)
    crown: tuple[float, float] = (3.0, 6.0)
    border: float = 30.0
    shares: tuple[float, float, float] = (0.7, 0.2, 0.1)


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
    seed, shares
        Of the land.
    things
        Animals first.
    p_nc, R_nc
        Of the camera, (3,) m and (3, 3).
    distance
        From the camera to the ground along the middle of the image, m.
    """

    seed: int
    shares: tuple[float, float, float]
    things: tuple[Thing, ...]
    p_nc: Array
    R_nc: Array
    distance: float

    def scene(self, weather: Weather, with_animals: bool = True) -> LandScene:
        """The place in that weather."""
        things = [one for one in self.things if with_animals or one.kind not in ANIMALS]
        land = rolling_land(weather, self.seed, shares=self.shares)
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
    land = rolling_land(Weather(), seed, shares=draw.shares)
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
    sizes = rng.uniform(*draw.stone_size, int(rng.integers(*draw.stones, endpoint=True)))
    crowns = rng.uniform(*draw.crown, int(rng.integers(*draw.trees, endpoint=True)))
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
    return Layout(seed, draw.shares, tuple(things), p, R, float(np.linalg.norm(middle - p)))


@dataclass(frozen=True)
class Draw:
    """Ranges from which scenes are drawn; those of lengths and heights evenly on a log axis.

    Attributes
    ----------
    length, slender
        Of vessels, m, and how many times their beam that is.
    excess, engine
        Of deck and engine over the sea, K.
    speed
        m/s.
    height, tilt
        Of the camera above the sea, m, and from straight down, either way and to both sides, rad.
    wind
        m/s.
    inside
        How far from the border of the image centres are put, px; negative is beyond it.
    seas
        How many different seas there are; None is one for each scene, whose waves take longer than the rest
        of a small image.
    """

    length: tuple[float, float] = (5.0, 40.0)
    slender: tuple[float, float] = (2.5, 5.0)
    excess: tuple[float, float] = (2.0, 10.0)
    engine: tuple[float, float] = (0.0, 25.0)
    speed: tuple[float, float] = (0.0, 6.0)
    height: tuple[float, float] = (80.0, 400.0)
    tilt: float = float(np.radians(30.0))
    wind: tuple[float, float] = (1.0, 8.0)
    inside: float = 40.0
    seas: int | None = None


class Drawn(NamedTuple):
    """A scene with one thing in it, and the one pose it is seen from."""

    scene: Scene
    poses: CameraPoses
    height: float


def draw_vessel(rng: np.random.Generator, draw: Draw) -> Body:
    """A vessel within the ranges, at the origin."""
    length = float(np.exp(rng.uniform(*np.log(draw.length))))
    return vessel(
        length,
        length / float(rng.uniform(*draw.slender)),
        float(rng.uniform(*draw.excess)),
        speed=float(rng.uniform(*draw.speed)),
        engine=float(rng.uniform(*draw.engine)),
        seed=int(rng.integers(2**31)),
    )


def draw_scene(rng: np.random.Generator, camera: Camera, draw: Draw, kind: str = "vessel") -> Drawn:
    """A scene with one vessel, or one of the small things of `KINDS`, somewhere in the image.

    Parameters
    ----------
    rng
        Of the scene.
    camera
        That sees it.
    draw
        Ranges.
    kind
        ``"vessel"``, or a name of `KINDS`.

    Returns
    -------
    Drawn
    """
    height = float(np.exp(rng.uniform(*np.log(draw.height))))
    roll, pitch = rng.uniform(-draw.tilt, draw.tilt, 2)
    R_nb = euler_to_matrix(roll, pitch, rng.uniform(-np.pi, np.pi))
    poses = CameraPoses(camera, Mount("down"), np.array([0.0, 0.0, -height]), R_nb)
    low, high = draw.inside - 0.5, np.array([camera.width, camera.height]) - draw.inside - 0.5
    pixel: Array = rng.uniform(low, high)
    north, east, _ = georeference_pixels(poses, pixel[None], 0.0)[0]
    body = draw_vessel(rng, draw) if kind == "vessel" else KINDS[kind](seed=int(rng.integers(2**31)))
    body = body.at(float(north), float(east), float(rng.uniform(-np.pi, np.pi)), body.speed)
    if draw.seas is not None:
        rng = np.random.default_rng([17, int(rng.integers(draw.seas))])
    return Drawn(Scene(draw_sea(rng, draw), (body,)), poses, height)


def draw_sea(rng: np.random.Generator, draw: Draw) -> Sea:
    """A sea with a wind within the range, and the sun out in every second one."""
    sun = float(rng.uniform(np.radians(10.0), np.radians(60.0))) if rng.random() < 0.5 else None
    return Sea(
        wind_speed=float(rng.uniform(*draw.wind)),
        wind_from=float(rng.uniform(-np.pi, np.pi)),
        sun_azimuth=float(rng.uniform(-np.pi, np.pi)),
        sun_elevation=sun,
        seed=int(rng.integers(2**31)),
    )
