"""Particle filters: many animals at once, seen, not seen, and kept in by a fence (F chapter 4).

Animals are the first axis, particles the second: states (A, N, n), weights (A, N). A step of the filter is
`move` (or `move_by_sight`) and `stay_inside`; then `weigh` with a `log_likelihood`, or `weigh_unseen` where
an image looked and found nothing; then `moments`, and `resample`. Always resampling is SIR, by the effective
size alone SIS.

- `start_gaussian`, `start_inside`: where it begins, the second knowing only the enclosure.
- `walk_of`: F (4.5) with the step that its noise depends on; `drift`: to water holes, F 8.4.
- `sight_of`: a footprint from a mask.
- `step_nearest`, `step_counting`: many animals image after image, by F's rule and by one that counts, with
  `nearest_animal` and `one_to_one` behind them; `count_interval`: how many there are.
- `wildlab.tracking.particles.grid`: the exact answer in small worlds.

>>> import numpy as np
>>> from wildlab.tracking.particles import *
>>> rng = np.random.default_rng(1)
>>> cloud = start_gaussian([[0.0, 0.0]], 400 * np.eye(2), 2000, rng)
>>> cloud = move(cloud, walk_of(0.5, 1.0), 10.0, rng)
>>> cloud, log_evidence = weigh(cloud, log_likelihood(cloud.x, [[12.0, 3.0]], 4 * np.eye(2)))
>>> cloud, resampled = resample(cloud, rng, "systematic")
>>> mean, covariance = moments(cloud)
>>> bool(np.hypot(*(mean[0] - [12.0, 3.0])) < 1.0), resampled
(True, array([ True]))
"""

from wildlab.tracking.particles.association import mahalanobis_squared, nearest_animal, one_to_one
from wildlab.tracking.particles.clouds import (
    Cloud,
    Weighed,
    effective_size,
    moments,
    start_gaussian,
    start_inside,
    weigh,
    weigh_unseen,
)
from wildlab.tracking.particles.counting import (
    Count,
    count_interval,
    count_probabilities,
    existence_after,
)
from wildlab.tracking.particles.grid import Grid, grid_moments, grid_over, grid_weigh, walk_matrix
from wildlab.tracking.particles.likelihoods import log_likelihood, sight_of
from wildlab.tracking.particles.moves import drift, move, move_by_sight, stay_inside, walk_of
from wildlab.tracking.particles.particle_sets import Herd, ImageLook, Rules, expect, no_herd
from wildlab.tracking.particles.resampling import SCHEMES, draw, resample
from wildlab.tracking.particles.steps import step_counting, step_nearest

__all__ = [
    "SCHEMES",
    "Cloud",
    "Count",
    "Grid",
    "Herd",
    "ImageLook",
    "Rules",
    "Weighed",
    "count_interval",
    "count_probabilities",
    "draw",
    "drift",
    "effective_size",
    "existence_after",
    "expect",
    "grid_moments",
    "grid_over",
    "grid_weigh",
    "log_likelihood",
    "mahalanobis_squared",
    "moments",
    "move",
    "move_by_sight",
    "nearest_animal",
    "no_herd",
    "one_to_one",
    "resample",
    "sight_of",
    "start_gaussian",
    "start_inside",
    "stay_inside",
    "step_counting",
    "step_nearest",
    "walk_matrix",
    "walk_of",
    "weigh",
    "weigh_unseen",
]
