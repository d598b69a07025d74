"""A flight without truth: how far apart sightings of the same thing lie, and which constant error is why."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.diagnose import FEWEST_IMAGES, Diagnosis, diagnose
from wildlab.analysis.georeference import Observations, covariances_of, georeference
from wildlab.errors import WildlabError
from wildlab.evaluation.causes import mean_of_others
from wildlab.evaluation.sightings import Spread, spread_of_sightings
from wildlab.flight.store import Flight


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
    diagnosis
        Which constant error makes sightings of the same thing lie apart; None where fewer than six images
        show a thing that another image shows too.
    """

    points: pd.DataFrame
    lost: int
    spread: Spread | None
    things: pd.DataFrame
    diagnosis: Diagnosis | None = None


def compare_sightings(points: pd.DataFrame) -> pd.DataFrame:
    """Distance of each sighting to the mean of those of the same thing in other images.

    Parameters
    ----------
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        The points that name a thing, with ``truth_id`` (its name), ``error_north_m``, ``error_east_m`` and
        ``error_m``, as from `wildlab.analysis.evaluate.score_points`; NaN where no other image shows it.
    """
    named = points[points["target_id"].astype(str) != ""].reset_index(drop=True)
    xy, things = named[["north_m", "east_m"]].to_numpy(float), named["target_id"].to_numpy(str)
    images, error = named["frame_id"].to_numpy(str), np.full((len(named), 2), np.nan)
    for image in np.unique(images):
        own = images == image
        error[own] = (xy - mean_of_others(xy, things, ~own))[own]
    return named.assign(
        truth_id=things, error_north_m=error[:, 0], error_east_m=error[:, 1], error_m=np.hypot(*error.T)
    )


def judge_repeats(
    flight: Flight, observations: Observations, rng: np.random.Generator, source: str | None = None
) -> Repeats:
    """Place a flight's detections and compare the sightings of each thing with each other.

    Parameters
    ----------
    flight
        With detections that name their targets; truth is not looked at.
    observations
        From `observe`.
    rng
        Draws samples of flat rays.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.

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
    compared = compare_sightings(points)
    located = np.isfinite(compared["error_m"]) & np.isfinite(compared["cov_nn"])
    enough = compared.loc[located, "frame_id"].nunique() >= FEWEST_IMAGES
    diagnosis = diagnose(flight, observations, compared, source, places_known=False) if enough else None
    return Repeats(points, int(np.isnan(xy[:, 0]).sum()), spread, things, diagnosis)
