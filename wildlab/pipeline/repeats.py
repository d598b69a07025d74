"""A flight without truth: how far apart sightings of the same thing lie, and what that cannot tell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.evaluation.sightings import Spread, spread_of_sightings
from wildlab.flight.store import Flight
from wildlab.pipeline.georeference import Observations, covariances_of, georeference


class Repeats(NamedTuple):
    """Sightings of the same things.

    Attributes
    ----------
    points
        On the ground, one row a detection; lost points are NaN.
    lost
        How many.
    spread
        Of the sightings of things that were seen in two images or more; None where there are none.
    things
        Names of the things, most seen first, with their sightings, images and spread (m per axis).
    """

    points: pd.DataFrame
    lost: int
    spread: Spread | None
    things: pd.DataFrame


def judge_repeats(flight: Flight, observations: Observations, rng: np.random.Generator) -> Repeats:
    """Place a flight's detections and compare the sightings of each thing with each other.

    Parameters
    ----------
    flight
        With detections that name their targets; truth is not looked at.
    observations
        From `observe`.
    rng
        Draws samples of flat rays.

    Returns
    -------
    Repeats

    Raises
    ------
    WildlabError
        Where no detection names a target.
    """
    points = georeference(flight, observations, rng)
    named = points["target_id"].astype(str).to_numpy()
    if not (named != "").any():
        raise WildlabError(
            "no detection names what it is of, so that sightings cannot be compared with each other",
            "name the targets in the detections' target_id, or add truth",
            file=flight.folder,
            field="detections.target_id",
        )
    xy, images = points[["north_m", "east_m"]].to_numpy(float), points["frame_id"].to_numpy(str)
    spread = spread_of_sightings(xy, named, images, covariances_of(points))
    rows = []
    for name in np.unique(named[named != ""]):
        own = (named == name) & np.isfinite(xy).all(axis=1)
        one = spread_of_sightings(xy[own], named[own], images[own])
        rows.append(
            {
                "thing": name,
                "sightings": int(own.sum()),
                "images": len(np.unique(images[own])),
                "sd": one.sd if one is not None else np.nan,
            }
        )
    things = (
        pd.DataFrame(rows).sort_values("sightings", ascending=False, kind="stable").reset_index(drop=True)
    )
    return Repeats(points, int(np.isnan(xy[:, 0]).sum()), spread, things)
