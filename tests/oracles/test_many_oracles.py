"""Whose a measurement is, by Stone Soup's joint probabilistic data association on the same tracks."""

from datetime import UTC, datetime

import numpy as np
import pytest

from wildlab.tracking.association import association_probabilities
from wildlab.tracking.multitarget_tracks import compare, weights


@pytest.mark.parametrize("seed", range(6))
def test_joint_probabilities_agree_with_stone_soup(seed):
    pytest.importorskip("stonesoup")
    from stonesoup.dataassociator.probability import JPDA
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.types.track import Track
    from stonesoup.updater.kalman import KalmanUpdater

    rng = np.random.default_rng(seed)
    n, m, detection, clutter, gate = 3, 4, 0.8, 1e-2, 1 - 1e-9
    place, z = rng.uniform(0, 6, (n, 2)), rng.uniform(0, 6, (m, 2))
    P = np.diag([1.0, 1.0, 0.01, 0.01])  # north, east and their velocities
    now = datetime(2026, 1, 1, tzinfo=UTC)
    model = LinearGaussian(4, (0, 2), 0.5 * np.eye(2))
    hypothesiser = PDAHypothesiser(
        KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(0.01)] * 2)),
        KalmanUpdater(model), clutter_spatial_density=clutter, prob_detect=detection, prob_gate=gate,
    )  # fmt: skip
    tracks = [
        Track([GaussianState([[a], [0], [b], [0]], np.diag([1, 0.01, 1, 0.01]), timestamp=now)])
        for a, b in place
    ]
    seen = [Detection(one[:, None], timestamp=now, measurement_model=model) for one in z]
    theirs = np.zeros((n, 1 + m))
    for track, found in JPDA(hypothesiser).associate(set(tracks), set(seen), now).items():
        for one in found:
            column = 1 + seen.index(one.measurement) if one else 0
            theirs[tracks.index(track), column] += float(one.probability)
    x = np.concatenate([place, np.zeros((n, 2))], axis=1)[:, None]
    found = compare(
        x, np.tile(P, (n, 1, 1, 1)), np.zeros((n, 1, 2)), np.zeros((n, 1, 2, 2)), z,
        np.tile(0.5 * np.eye(2), (m, 1, 1)), 1e6,
    )  # fmt: skip
    pairs, none = weights(np.ones(n), np.full(n, gate), detection, found.likelihood[:, 0], clutter)
    assert np.allclose(association_probabilities(pairs / gate, none), theirs, atol=1e-6)
