"""Small rendered pictures of animals on even ground."""

from dataclasses import replace

import numpy as np

from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN
from wildlab.simulation.scene.drawn import animal
from wildlab.simulation.scene.flights import IDEAL, expose, sensor_of, to_counts
from wildlab.simulation.scene.land import EVEN_LAND, LandScene, Weather, render_land
from wildlab.studies.wildlife_detection import (
    Picture,
)

CAMERA = Camera(180, 120, 320.0, 320.0, 89.5, 59.5)
DARK = Weather(hour=2.0)


def picture_of(*bodies, height=30.0, weather=DARK, window=(-5.0, 20.0)):
    """Over even ground as warm as the air; the window in K about it."""
    land = replace(EVEN_LAND, weather=weather)
    view = render_land(LandScene(land, bodies), CAMERA, [0.0, 0.0, -height], R_MC_DOWN)
    counts = expose(view.kelvin, IDEAL, sensor_of(IDEAL, (120, 180), np.random.default_rng(1)), None)
    low, high = to_counts(weather.air + np.array(window), IDEAL).tolist()
    return Picture(view, counts, (low, high), height)


def rhino(north=0.0, east=0.0, course=0.0):
    return animal("rhinoceros", DARK, 1).at(north, east, course)
