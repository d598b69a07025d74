"""Scenes drawn at random: vessels of many sizes and temperatures, seas of many winds, cameras of many views.

For tests and studies that judge a detector over everything a flight may meet; `Draw` says over what.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.mount import Mount
from wildlab.simulation.scene.bodies import KINDS, Body, vessel
from wildlab.simulation.scene.render import Scene
from wildlab.simulation.scene.sea import Sea


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
