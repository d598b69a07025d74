"""Particle filters: many animals at once, seen, not seen, and kept in by a fence (F chapter 4).

Animals are the first axis, particles the second: states (A, N, n), weights (A, N). A step of the filter is
`move` and `stay_inside`; then `weigh` with a `log_likelihood`, or `weigh_unseen` where an image looked and
found nothing; then `moments`, and `resample`. Always resampling is SIR, by the effective size alone SIS.

- `walk_of`: F (4.5) with the step that its noise depends on. `sight_of`: a footprint from a mask.
- `step_nearest`: many animals image after image, by F's rule, with `nearest_animal` behind it.

>>> import numpy as np
>>> from wildlab.tracking.particles import *
>>> rng = np.random.default_rng(1)
>>> cloud = start_gaussian([[0.0, 0.0]], 400 * np.eye(2), 2000, rng)
>>> cloud = move(cloud, walk_of(0.5, 1.0), 10.0, rng)
>>> cloud, log_evidence = weigh(cloud, log_likelihood(cloud.x, [[12.0, 3.0]], 4 * np.eye(2)))
>>> cloud, resampled = resample(cloud, rng)
>>> mean, covariance = moments(cloud)
>>> bool(np.hypot(*(mean[0] - [12.0, 3.0])) < 1.0), resampled
(True, array([ True]))
"""

from wildlab.tracking.particles.clouds import (
    Cloud,
    Weighed,
    draw,
    effective_size,
    log_likelihood,
    moments,
    move,
    resample,
    sight_of,
    start_gaussian,
    stay_inside,
    walk_of,
    weigh,
    weigh_unseen,
)
from wildlab.tracking.particles.steps import (
    Herd,
    ImageLook,
    Rules,
    mahalanobis_squared,
    nearest_animal,
    no_herd,
    step_nearest,
)

__all__ = [
    "Cloud",
    "Herd",
    "ImageLook",
    "Rules",
    "Weighed",
    "draw",
    "effective_size",
    "log_likelihood",
    "mahalanobis_squared",
    "moments",
    "move",
    "nearest_animal",
    "no_herd",
    "resample",
    "sight_of",
    "start_gaussian",
    "stay_inside",
    "step_nearest",
    "walk_of",
    "weigh",
    "weigh_unseen",
]
