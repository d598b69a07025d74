"""Animals in the images: each one that is in view is found more often than not."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.geometry.camera import in_image
from wildlab.geometry.viewsheds import lines_clear
from wildlab.simulation.animal_motion import animal_paths
from wildlab.simulation.camera_view import Exposures, marks, numbered
from wildlab.simulation.error_models import stream
from wildlab.simulation.land import ground_heights, twin_land
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.target_parameters import Animals


def animal_detections(
    twin: TwinParameters, animals: Animals, view: Exposures, frames: pd.DataFrame, seed: int
) -> pd.DataFrame:
    """Animals as they are marked, where no hill hides them. How high a body is above the ground is not known.

    Raises
    ------
    WildlabError
        Where no image shows any.
    """
    tables, land = [], twin_land(twin)
    for name, path in animal_paths(twin, seed).items():
        points = path(view.times)
        uv = view.pixels(points)
        rng = stream(seed, f"marking of {name}")
        inside = in_image(view.poses.camera, uv, animals.border.si)
        found = inside & (rng.random(len(uv)) < animals.detected.number)
        if land is not None:
            there = np.flatnonzero(found)
            found[there] = lines_clear(land, points[there], view.poses.p_nc[there])
        images = np.flatnonzero(found)
        marked = view.marked(uv[images], rng)
        # Without a map of the ground one would take it for as high as it is under the aircraft.
        under = -ground_heights(twin, view.poses.p_nc[images, :2])
        tables.append(marks(frames, images, marked, animals.marked_by.text, name, under))
    detections = numbered(tables)
    if detections.empty:
        raise WildlabError(
            "no animal comes into view",
            "lay the course over the enclosures, or raise camera.images",
            field="animals",
        )
    return detections
