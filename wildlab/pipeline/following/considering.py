"""Errors that last, as the Schmidt filter takes them: a covariance for each look."""

from __future__ import annotations

import numpy as np

from wildlab.geometry.frames import Array
from wildlab.pipeline.following.beliefs import Beliefs
from wildlab.pipeline.following.expected import SLOTS
from wildlab.pipeline.scans import Scans


def covariances_of(scans: Scans, beliefs: Beliefs) -> Array | None:
    """(N, 6, 6) of the errors of `SLOTS`: those considered, else the poses' own; None where there is none."""
    if beliefs.considered:
        variance = np.zeros(6)
        for one in beliefs.considered:
            variance[SLOTS[scans.kind].index(one.name)] = one.sd**2
        return np.tile(np.diag(variance), (len(scans.times), 1, 1))
    if scans.poses is not None and scans.poses.covariance is not None:
        P = np.asarray(scans.poses.covariance, float)
        return P if np.isfinite(P).any() else None
    return None
