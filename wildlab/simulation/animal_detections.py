"""Animals in the images: each one that is in view is found more often than not."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.geometry.camera import in_image
from wildlab.simulation.animal_motion import animal_paths
from wildlab.simulation.camera_view import Exposures, marks, numbered
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.target_parameters import Animals


def animal_detections(
    twin: TwinParameters, animals: Animals, view: Exposures, frames: pd.DataFrame, seed: int
) -> pd.DataFrame:
    """Animals as they are marked. What is known of the ground is where it is, not how high a body is above.

    Raises
    ------
    WildlabError
        Where no image shows any.
    """
    tables = []
    for name, path in animal_paths(twin, seed).items():
        uv = view.pixels(path(view.times))
        rng = stream(seed, f"marking of {name}")
        inside = in_image(view.poses.camera, uv, animals.border.si)
        found = inside & (rng.random(len(uv)) < animals.detected.number)
        images = np.flatnonzero(found)
        marked = view.marked(uv[images], rng)
        tables.append(marks(frames, images, marked, animals.marked_by.text, name, 0.0))
    detections = numbered(tables)
    if detections.empty:
        raise WildlabError(
            "no animal comes into view",
            "lay the course over the enclosures, or raise camera.images",
            field="animals",
        )
    return detections
