"""Stone Soup's joint probabilistic data association on the scans that our tracker is given.

Its own parts as they are: constant velocity, positions with normal errors, `PDAHypothesiser`, `JPDAwithEHM2`
(the exact probabilities, without listing every joint hypothesis), `MultiMeasurementInitiator`, deleters by
time and covariance, all in a `MultiTargetMixtureTracker`. Stone Soup is in the extra ``oracles``: it is
imported only where it is used, and nothing of our own numbers comes from it.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.studies.autoferry_many.tuning import even, scale
from wildlab.tracking.many import Scan, Shown
from wildlab.tracking.many.run import in_reach
from wildlab.tracking.many.tracks import moves

#: A track is followed as north, its velocity, east, its velocity; these are in our order of a state.
_OURS = np.array([0, 2, 1, 3])
_EPOCH = datetime(2000, 1, 1, tzinfo=UTC)


class Eye(NamedTuple):
    """What is told of one sensor.

    ``noise_m`` of each axis; ``detection`` probability; ``clutter_per_m2`` false measurements for each square
    metre and scan; it is used between ``near_m`` and ``far_m`` from the platform.
    """

    noise_m: float
    detection: float
    clutter_per_m2: float
    near_m: float
    far_m: float


class Choice(NamedTuple):
    """Everything that Stone Soup is told.

    Attributes
    ----------
    eyes
        By sensor.
    density
        m/s per square root of a second: standard deviation of each axis of the velocity that grows in one.
    start_speed_m_s
        Standard deviation of each axis of the velocity of a new track.
    gate
        How many standard deviations a measurement may be off.
    hits, held_s
        A track is believed after so many measurements, none more than so long after the one before.
    patience_s
        For how long it lives without one afterwards.
    lost_m
        It ends where the standard deviation of its position is larger.
    moves_m, over_s
        It is shown once it has moved so far within so long; 0 m: always.
    """

    eyes: Mapping[str, Eye]
    density: float
    start_speed_m_s: float
    gate: float
    hits: int
    held_s: float
    patience_s: float
    lost_m: float
    moves_m: float
    over_s: float


def installed() -> bool:
    """Whether Stone Soup is there."""
    return importlib.util.find_spec("stonesoup") is not None


def run_stone_soup(scans: Sequence[Scan], names: Sequence[str], choice: Choice) -> list[Shown]:
    """Follow all targets of all scans.

    Parameters
    ----------
    scans
        In order of time. Their covariances are not used: noise is one of the choices.
    names
        Of the sensors; `Scan.sensor` is a place among them.
    choice
        What is told.

    Returns
    -------
    list[Shown]
        One for each scan. Existence is 1, and there is one kind of hull.

    Raises
    ------
    WildlabError
        Where Stone Soup is not installed.
    """
    if not installed():
        raise WildlabError(
            "Stone Soup is not installed here",
            "install it: python -m pip install 'stonesoup>=1.9' (in a checkout: pip install -e '.[oracles]')",
        )
    eyes = [choice.eyes[name] for name in names]
    shown: list[Shown] = []
    known: dict[Any, int] = {}
    trails: dict[Any, Array] = {}
    moving: dict[Any, bool] = {}
    for scan, tracks in _followed(scans, eyes, choice):
        # Sets have no order: new tracks are numbered from south to north.
        for one in sorted(tracks - known.keys(), key=_place):
            known[one] = len(known)
        rows, mine = [], sorted(tracks, key=known.__getitem__)
        for one in mine:
            at = np.asarray(one.state_vector, float).ravel()[[0, 2]]
            trail = np.concatenate([trails.get(one, np.zeros((0, 3))), [[scan.time, *at]]])
            trails[one] = trail = trail[trail[:, 0] > scan.time - choice.over_s]
            moving[one] = moves(trail, moving.get(one, False), choice.moves_m, choice.over_s)
            inside = np.linalg.norm(at - scan.platform) < max(eye.far_m for eye in eyes)
            if inside and (moving[one] or choice.moves_m <= 0):
                rows.append(one)
        shown.append(_shown(scan, rows, [known[one] for one in rows]))
    return shown


def _place(one: Any) -> tuple[float, ...]:
    """What orders tracks, and detections."""
    return tuple(float(value) for value in one.state_vector)


def _shown(scan: Scan, tracks: Sequence[Any], identity: Sequence[int]) -> Shown:
    x = np.array([np.asarray(one.state_vector, float).ravel()[_OURS] for one in tracks]).reshape(-1, 4)
    P = np.array([np.asarray(one.covar, float)[np.ix_(_OURS, _OURS)] for one in tracks]).reshape(-1, 4, 4)
    count = len(tracks)
    names, one, no_errors = np.array(identity, np.int64), np.ones(count), np.zeros((count, 4, 0))
    return Shown(scan.time, scan.sensor, names, x, P, one, one[:, None], no_errors)


def _followed(scans: Sequence[Scan], eyes: Sequence[Eye], choice: Choice) -> Iterator[tuple[Scan, set[Any]]]:
    """Its tracks after each scan."""
    from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
    from stonesoup.dataassociator.probability import JPDAwithEHM2
    from stonesoup.deleter.error import CovarianceBasedDeleter
    from stonesoup.deleter.multi import CompositeDeleter
    from stonesoup.deleter.time import UpdateTimeDeleter
    from stonesoup.hypothesiser.distance import DistanceHypothesiser
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.initiator.simple import MultiMeasurementInitiator
    from stonesoup.measures import Mahalanobis
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.tracker.simple import MultiTargetMixtureTracker
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    class Remembered(CombinedLinearGaussianTransitionModel):  # type: ignore[misc]
        """All tracks go on by the same time at a scan: its matrices are made once."""

        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self.matrices: dict[Any, tuple[Any, Any]] = {}

        def both(self, after: timedelta) -> tuple[Any, Any]:
            if after not in self.matrices:
                self.matrices[after] = super().matrix(time_interval=after), super().covar(time_interval=after)
            return self.matrices[after]

        def matrix(self, *, time_interval: timedelta, **_: Any) -> Any:
            return self.both(time_interval)[0]

        def covar(self, *, time_interval: timedelta, **_: Any) -> Any:
            return self.both(time_interval)[1]

    class Ordered(JPDAwithEHM2):  # type: ignore[misc]
        """Sums over sets, which have no order, differ in the last digit; by place they are the same."""

        def generate_hypotheses(self, tracks: Any, detections: Any, *args: Any, **kwargs: Any) -> Any:
            mine, seen = (sorted(several, key=_place) for several in (tracks, detections))
            return super().generate_hypotheses(mine, seen, *args, **kwargs)

    models = [LinearGaussian(4, (0, 2), eye.noise_m**2 * np.eye(2)) for eye in eyes]
    predictor = KalmanPredictor(Remembered([ConstantVelocity(choice.density**2)] * 2))
    updater = KalmanUpdater(None)
    associators = [
        Ordered(
            PDAHypothesiser(
                predictor, updater, clutter_spatial_density=eye.clutter_per_m2, prob_detect=eye.detection,
                prob_gate=1 - float(np.exp(-(choice.gate**2) / 2)),
            )
        )
        for eye in eyes
    ]  # fmt: skip

    def deleter(patience_s: float) -> Any:
        known = CovarianceBasedDeleter(2 * choice.lost_m**2, mapping=[0, 2])
        return CompositeDeleter([UpdateTimeDeleter(timedelta(seconds=patience_s)), known], intersect=False)

    fast = choice.start_speed_m_s**2
    nearest = GNNWith2DAssignment(DistanceHypothesiser(predictor, updater, Mahalanobis(), choice.gate))
    initiator = MultiMeasurementInitiator(
        GaussianState(np.zeros(4), np.diag([0.0, fast, 0.0, fast])), deleter(choice.held_s), nearest, updater,
        min_points=choice.hits,
    )  # fmt: skip
    start = scans[0].time if scans else 0.0

    def looks() -> Iterator[tuple[datetime, set[Any]]]:
        for scan in scans:
            at, which = _EPOCH + timedelta(seconds=scan.time - start), scan.sensor
            tracker.data_associator = associators[which]
            yield (
                at,
                {
                    Detection(place[:, None], timestamp=at, measurement_model=models[which])
                    for place in _within_reach(scan, eyes[which])
                },
            )

    tracker = MultiTargetMixtureTracker(
        initiator, deleter(choice.patience_s), looks(), associators[0] if associators else None, updater
    )
    for scan, (_, tracks) in zip(scans, tracker, strict=True):
        yield scan, tracks


def _within_reach(scan: Scan, eye: Eye) -> Array:
    """(M, 2) what it uses of a scan: as our tracker does."""
    z = np.asarray(scan.z, float).reshape(-1, 2)
    return np.asarray(z[in_reach(z, scan.platform, eye.near_m, eye.far_m)])


def draw_choice(rng: np.random.Generator, far_m: Mapping[str, tuple[float, float]]) -> Choice:
    """Everything that it is told, from ranges that are wide and mean something.

    Scales are drawn evenly over their logarithm, shares and distances evenly.

    Parameters
    ----------
    far_m
        By sensor, between which distances it may see no farther, m.
    """
    return Choice(
        eyes={
            name: Eye(
                noise_m=scale(rng, 0.7, 8),
                detection=even(rng, 0.5, 0.95),
                clutter_per_m2=scale(rng, 5e-7, 1e-3),
                near_m=even(rng, 5, 20),
                far_m=even(rng, *far),
            )
            for name, far in far_m.items()
        },
        density=float(np.sqrt(scale(rng, 0.01, 0.3))),
        start_speed_m_s=even(rng, 2, 5),
        gate=even(rng, 2.0, 4.5),
        hits=int(rng.integers(2, 7)),
        held_s=scale(rng, 1.5, 10),
        patience_s=scale(rng, 2, 20),
        lost_m=scale(rng, 5, 30),
        moves_m=float(rng.choice([0.0, even(rng, 4, 12)])),
        over_s=even(rng, 8, 20),
    )
