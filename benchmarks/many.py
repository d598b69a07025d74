"""Fifty targets and a hundred measurements a scan on one core; and whose a measurement is, beside Stone Soup.

The first row is everything: predicting, gating, probabilities, existence, estimates, new and ended tracks;
the second has trajectories smoothed too. The others are one scan of targets in a row, near enough for each to
compete with the next: probabilities summed over all ways, the same way by way for six of them, and Stone
Soup's joint probabilistic data association for as many as it can enumerate in a second.
"""

from __future__ import annotations

import datetime
import importlib.util

import numpy as np

from benchmarks.timing import best_of
from tests.tracking.many.enumeration import association_probabilities_by_enumeration
from wildlab.geometry.frames import Array
from wildlab.tracking.association import association_probabilities
from wildlab.tracking.multitarget import run_many, smooth_many
from wildlab.tracking.target_model import POINT, ManySensorModel, ManyTargetModel, Scan

TARGETS, MEASUREMENTS, SCANS = 50, 100, 60
EYE = ManySensorModel("eye", 0.9, 50 / 1e6, 0.0, 1e9, 5.0, (0.0,), (0.0,), (0.0,))
POINTS = ManyTargetModel(
    (POINT,), density=0.1, start_speed_m_s=3.0, lifetime_s=600.0, birth=0.05, visible_s=100.0, hidden_s=5.0,
    gate=4.0, confirmed=0.95, hits=3, shown=0.5, forgotten=0.02, lost_m=30.0, fastest_m_s=30.0, moves_m=0.0,
    over_s=15.0, apart_m=2.0,
)  # fmt: skip


def scans() -> list[Scan]:
    """Targets that walk about on a square kilometre, nine in ten seen, and clutter."""
    rng = np.random.default_rng(0)
    x, v = rng.uniform(-500, 500, (TARGETS, 2)), rng.normal(0, 2, (TARGETS, 2))
    found = []
    for t in range(SCANS):
        x = x + v
        own = x[rng.random(TARGETS) < 0.9]
        clutter = rng.uniform(-500, 500, (MEASUREMENTS - len(own), 2))
        z = np.concatenate([own + rng.normal(size=own.shape), clutter])
        found.append(Scan(float(t), 0, np.zeros(2), z, np.tile(np.eye(2), (len(z), 1, 1))))
    return found


def in_a_row(n: int) -> tuple[Array, Array]:
    """Weights of n targets 2 m apart and a measurement of each, whose noise is 1 m; and of none."""
    rng = np.random.default_rng(1)
    place = np.stack([2.0 * np.arange(n), np.zeros(n)], axis=1)
    z = place + rng.normal(size=(n, 2))
    square = ((z[None] - place[:, None]) ** 2).sum(axis=2) / 2
    likely = np.where(square < 16, np.exp(-square / 2) / (4 * np.pi), 0.0)
    return 0.9 * likely / 1e-3, np.full(n, 0.1)


def stone_soup(n: int) -> object:
    """The same scan by Stone Soup, ready to be called."""
    from stonesoup.dataassociator.probability import JPDA
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.types.track import Track
    from stonesoup.updater.kalman import KalmanUpdater

    now = datetime.datetime(2026, 1, 1)
    model = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=np.eye(2))
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.01), ConstantVelocity(0.01)])
    hypotheses = PDAHypothesiser(
        predictor=KalmanPredictor(motion), updater=KalmanUpdater(model), clutter_spatial_density=1e-3,
        prob_detect=0.9, prob_gate=0.9997,
    )  # fmt: skip
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(n, 2))
    tracks = {
        Track([GaussianState([[2.0 * i], [0], [0], [0]], np.diag([1, 0.01, 1, 0.01]), timestamp=now)])
        for i in range(n)
    }
    seen = {
        Detection([[2.0 * i + noise[i, 0]], [noise[i, 1]]], timestamp=now, measurement_model=model)
        for i in range(n)
    }
    associator = JPDA(hypothesiser=hypotheses)
    return lambda: associator.associate(tracks, seen, now)


def run() -> tuple[str, list[tuple[str, float, float, str]]]:
    """Title and rows (what, seconds, ratio to summing way by way, what is wanted)."""
    given = scans()
    each = best_of(lambda: run_many(given, [EYE], POINTS), repeats=3) / SCANS
    both = best_of(lambda: smooth_many(given, [EYE], POINTS), repeats=3) / SCANS
    few, many = in_a_row(6), in_a_row(10)
    slow = best_of(lambda: association_probabilities_by_enumeration(*few), repeats=3)
    rows = [
        (f"a scan of {TARGETS} targets, {1 / each:.0f} scans/s", each, each / slow, "at least 20 scans/s"),
        (f"and back over it, {1 / both:.0f} scans/s", both, both / slow, "at least 20 scans/s"),
        ("6 in a row, way by way", slow, 1.0, ""),
    ]
    for words, weights in (("6", few), ("10", many)):

        def call(weights: tuple[Array, Array] = weights) -> object:
            return association_probabilities(*weights)

        fast = best_of(call)
        rows.append((f"{words} in a row, wildlab", fast, fast / slow, ""))
    if importlib.util.find_spec("stonesoup") is not None:
        for n in (4, 6):
            call_it = stone_soup(n)
            theirs = best_of(call_it, repeats=3)  # type: ignore[arg-type]
            rows.append((f"{n} in a row, Stone Soup, gating and predicting too", theirs, theirs / slow, ""))
    return "Many targets at once", rows
