"""Errors that last, as the filters take them: by name, with a covariance."""

from __future__ import annotations

import numpy as np

from wildlab.analysis.following.expected import SLOTS
from wildlab.analysis.following.noise_model import NoiseModel
from wildlab.analysis.scans import Scans
from wildlab.geometry.attitude_uncertainty import level_axes
from wildlab.geometry.frames import Array
from wildlab.tracking.consider_parameters import Considered
from wildlab.tracking.predictions import POSE


def errors_of(scans: Scans, beliefs: NoiseModel) -> Considered | None:
    """Those considered; of poses that have a covariance, that and what is considered beside it."""
    names, blocks, times, shared = [], [], [], []
    poses = scans.poses
    own = poses is not None and poses.covariance is not None and bool(np.isfinite(poses.covariance).any())
    n = len(scans.times)
    if own and poses is not None:
        names += list(POSE)
        turn = np.tile(np.eye(6), (n, 1, 1))
        turn[:, 3:, 3:] = level_axes(poses.R_nb)
        blocks.append(np.swapaxes(turn, 1, 2) @ np.asarray(poses.covariance, float) @ turn)
        times += [np.inf] * len(POSE)
        shared += [True] * len(POSE)
    for one in beliefs.considered:
        if own and one.name in POSE:
            # What is stated comes on top of what the poses say of themselves.
            i = POSE.index(one.name)
            blocks[0][:, i, i] += one.sd**2
            continue
        names.append(one.name)
        blocks.append(np.full((n, 1, 1), one.sd**2))
        times.append(one.correlation_time_s)
        shared.append(one.shared)
    if not names:
        return None
    covariance = np.zeros((n, len(names), len(names)))
    first = 0
    for block in blocks:
        last = first + block.shape[-1]
        covariance[:, first:last, first:last] = block
        first = last
    return Considered(tuple(names), covariance, tuple(times), "bias", tuple(shared))


def spread_of(scans: Scans, beliefs: NoiseModel, H_pose: Array) -> Array | None:
    """(N, m, m) what the errors add to measurements with derivatives (N, m, k); None where there are none."""
    errors = errors_of(scans, beliefs)
    if errors is None:
        return None
    H = H_pose[..., [SLOTS[scans.kind].index(name) for name in errors.names]]
    return np.asarray(H @ errors.covariance @ np.swapaxes(H, -1, -2))
