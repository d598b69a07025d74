"""A tuning from what a flight says of its own errors, and one target followed with it.

The studies use the tunings that the theses print; this is for flights that have none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.store import Flight
from wildlab.pipeline.georeference import assumed_deviations, covariances_of, georeference, observe
from wildlab.pipeline.track import (
    CvTuning,
    Sighting,
    follow_pixels,
    follow_positions,
    follow_schmidt,
)
from wildlab.tracking.run import Track

Filter = Literal["schmidt", "ekf", "kf"]

#: By name: on pixels with the poses' uncertainty considered, on pixels, on georeferenced positions.
FILTERS: dict[Filter, Callable[[Sighting, CvTuning], Track]] = {
    "schmidt": follow_schmidt,
    "ekf": follow_pixels,
    "kf": follow_positions,
}

#: Standard deviation of the acceleration of a target about which nothing is known, per axis, m/s^2: a boat
#: or an animal that changes its speed by half a metre a second within a second, now and then.
ACCELERATION = 0.5
#: Of its velocity at the start, per axis, m/s: up to 10 m/s is nothing unusual.
START_SPEED = 5.0


def usual_tuning(
    flight: Flight,
    target: str | None = None,
    source: str | None = None,
    *,
    acceleration: float = ACCELERATION,
    velocity: float = START_SPEED,
    seed: int = 0,
) -> CvTuning:
    """A tuning for a target of which nothing but the flight is known.

    Metres on the ground, for measurement and start, are the root mean square of what `georeference` states of
    the target's detections, per axis; pixels are what the manifest states of them, else the usual ones.

    Parameters
    ----------
    flight
        With pixel detections and poses.
    target
        Name of the target; None for all detections.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    acceleration
        Standard deviation per axis, m/s^2.
    velocity
        Standard deviation per axis at the start, m/s.
    seed
        Of the samples that decide ellipses of flat rays.

    Returns
    -------
    CvTuning

    Raises
    ------
    WildlabError
        As `observe`, and where no detection of the target has a covariance on the ground.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> flight = simulate_twin("large-ship", 1, without=("imu", "gnss"))
    >>> tuning = usual_tuning(flight, source="autopilot")
    >>> tuning.acceleration, tuning.measurement == tuning.position_0
    (0.5, True)
    """
    seen = observe(flight, source)
    if target is not None:
        seen = seen.take((seen.table["target_id"] == target).to_numpy())
    P = covariances_of(georeference(flight, seen, np.random.default_rng(seed)))
    variances = np.trace(P, axis1=1, axis2=2) / 2
    known = variances[np.isfinite(variances)]
    if not len(known):
        raise WildlabError(
            "no detection of the target has an error ellipse to tune a filter by",
            "give the standard deviation of a georeferenced position, metres, as measurement",
            file=flight.folder,
            field="detections",
        )
    metres = float(np.sqrt(known.mean()))
    return CvTuning(acceleration, metres, velocity, metres, assumed_deviations(flight)["pixel_px"])
