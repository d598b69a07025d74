"""What a search for constant errors gives: models, their order, and whether the best of them is certain."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import covariances_of
from wildlab.evaluation.blocks import Labels, Neighbours, compare_neighbours
from wildlab.evaluation.causes import CHANCE, MARGIN, Gain, Ranked, rank_models
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.errors import ErrorSummary, summarise
from wildlab.evaluation.outliers import Outlier
from wildlab.geometry.calibration import BORESIGHT, BOUNDS, Calibration, Fit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: What may be constantly wrong, each with its parameters. Each of `_LENS` holds the one before.
CAUSES: dict[str, tuple[str, ...]] = {
    "position": ("north", "east"),
    "height": ("down",),
    "boresight": ("roll", "tilt", "pan"),
    "heading": ("heading",),
    "clock": ("clock",),
    "focal length": ("focal",),
    "focal lengths": ("focal", "aspect"),
    "lens": ("focal", "aspect", "centre_u", "centre_v"),
    "distortion": ("radial",),
}
_LENS = ("focal length", "focal lengths", "lens")
#: Images below which nothing is compared: too few to leave some out.
FEWEST_IMAGES = 6
#: Causes of one model at most.
MOST_CAUSES = 4
#: Beyond this share of points far out no cause is certain: who is out depends on who is believed.
MANY_OUT = 0.25


@dataclass(frozen=True)
class Model:
    """A sum of causes, fitted to all points and scored on those that a fit had not seen.

    Attributes
    ----------
    causes
        Names of :data:`CAUSES`; none: the poses as logged.
    fit
        From all points, by generalised least squares; derivatives and residuals in metres.
    covariance
        (P, P) of its values.
    deviance
        Squared length of its residuals in units of their covariance.
    chance
        Probability of so large an estimate without a constant error; of the winner.
    held
        (N, 2) m, held-out errors.
    gain
        Over the poses as logged, of the points that are not far out.
    gain_of_all
        The same of all points.
    """

    causes: tuple[str, ...]
    fit: Fit
    covariance: Array
    deviance: float
    chance: float
    held: Array
    gain: Gain
    gain_of_all: Gain

    @property
    def name(self) -> str:
        """The causes in words, ``nothing`` where there is none; with its parameters where it has not all."""
        lacking = {name for cause in self.causes for name in CAUSES[cause]} - set(self.fit.names)
        alone = f" ({', '.join(self.fit.names)} alone)" if lacking else ""
        return (" and ".join(self.causes) or "nothing") + alone


@dataclass(frozen=True)
class Diagnosis:
    """What is constantly wrong, and what taking it off gained.

    Attributes
    ----------
    scored
        The N points it rests on: of the scored table those that have an error and an ellipse.
    blocks
        (N,) their blocks in time order.
    models
        Every plausible model that was tried, as logged first.
    ranked
        Their order.
    calibration
        Of the winner, from all points, with its covariance under noise that is correlated in time.
    alike
        Pairs of causes that these data cannot tell apart.
    outliers
        Photos, marks and clicks that are far out once the winner is taken off, where it is certain. No model
        was fitted to them or ranked by them.
    inliers
        (N,) bool, the points that are in none of these.
    implausible
        See :func:`find_implausible`.
    noise
        Of poses and pixels, with any constants taken off.
    places_known
        Whether errors are those of known places; otherwise distances of sightings to others of the same
        thing.
    """

    scored: pd.DataFrame
    blocks: Labels
    models: tuple[Model, ...]
    ranked: Ranked
    calibration: Calibration
    alike: tuple[tuple[str, str], ...]
    outliers: tuple[Outlier, ...]
    inliers: Mask
    implausible: tuple[Model, ...] = ()
    noise: WanderNoise | None = None
    places_known: bool = True

    @property
    def winner(self) -> Model:
        """The simplest model within the odds of the best."""
        return self.models[self.ranked.winner]

    @property
    def rivals(self) -> tuple[Model, ...]:
        """Other models that explain the errors as well: the data do not separate them from the winner."""
        return tuple(self.models[m] for m in self.ranked.rivals)

    @property
    def inseparable(self) -> tuple[str, ...]:
        """Causes of the winner and its rivals, where it has any: which of them it is, the data do not say."""
        if not self.rivals:
            return ()
        return tuple(dict.fromkeys(cause for one in (self.winner, *self.rivals) for cause in one.causes))

    @property
    def counts(self) -> bool:
        """Whether the winner is certain: taking it off gained something, its estimate is not chance, nothing
        else explains the errors as well or better, and no more points are far out than :data:`MANY_OUT`."""
        one = self.winner
        certain = bool(one.causes) and one.gain.counts and one.chance < CHANCE and not self.rivals
        return certain and not self.implausible and bool(nonzero(self.calibration)) and not self.too_many_out

    @property
    def too_many_out(self) -> bool:
        """Whether so many points are far out, or so few images are left, that no cause is certain."""
        if self.inliers.all():
            return False
        return (
            bool((~self.inliers).mean() > MANY_OUT) or count_images(self.scored, self.inliers) < FEWEST_IMAGES
        )

    @property
    def shown(self) -> Model:
        """The winner where it gained something for certain, else the poses as logged."""
        return self.winner if self.counts else self.models[0]

    def neighbours(self) -> Neighbours:
        """How alike images that follow each other are once what is shown is taken off."""
        whiten = np.linalg.inv(np.linalg.cholesky(covariances_of(self.scored)))
        left = np.einsum("nij,nj->ni", whiten, self.shown.held)
        return compare_neighbours(left[self.inliers], self.scored["time_s"].to_numpy()[self.inliers])

    def held_summary(self, rows: Mask | None = None) -> ErrorSummary:
        """Held-out errors of what is shown; of rows (N,) or all."""
        return summarise(self.shown.held if rows is None else self.shown.held[rows])


def count_images(scored: pd.DataFrame, rows: Mask) -> int:
    return int(scored.loc[rows, "frame_id"].nunique())


def search_models(
    model: Callable[..., Model], causes: list[str], images: int
) -> tuple[list[Model], list[Model], list[tuple[str, str]]]:
    """All single causes and angles, the best with each other one, and so on while the largest sum is best.

    Plausible ones, others, and pairs of causes that cannot be told apart.
    """
    models, wild = [model(())], list[Model]()
    alike: list[tuple[str, str]] = []
    lost: dict[str, set[str]] = {}
    for cause in causes:
        single = model((cause,))
        lost[cause] = set(single.fit.undetermined)
        if single.fit.names:
            sort_in(single, models, wild)
    for angle in BORESIGHT:
        if "boresight" in causes and angle not in lost["boresight"]:
            single = model(("boresight",), (angle,))
            if single.fit.names and not any(single.fit.names == one.fit.names for one in models):
                sort_in(single, models, wild)
    silent = {cause for cause in causes if lost[cause] >= set(CAUSES[cause])}

    def add(sums: Iterable[tuple[str, ...]]) -> None:
        for one in sums:
            if silent & set(one) or sum(cause in _LENS for cause in one) > 1:
                continue
            if any(pair <= set(one) for pair in map(set, alike)):
                continue
            joint = model(one)
            if joint.fit.undetermined.keys() - {name for cause in one for name in lost[cause]}:
                if len(one) == 2:
                    alike.append((one[0], one[1]))
            else:
                sort_in(joint, models, wild)

    for size in range(1, MOST_CAUSES):
        winner = min(models[1:] or models, key=lambda one: score_model(one, images))
        if len(winner.causes) < size:
            break
        more = [cause for cause in causes if cause not in winner.causes]
        add(tuple(c for c in causes if c in (*winner.causes, one)) for one in more)
    # Another cause in the place of one of the best may explain as much.
    best = min(models, key=lambda one: score_model(one, images)).causes
    tried = {one.causes for one in (*models, *wild)}
    swapped = (
        tuple(c for c in causes if c == other or (c in best and c != one))
        for one in best
        for other in causes
        if other not in best and len(best) > 1
    )
    add(one for one in dict.fromkeys(swapped) if one not in tried)
    return models, wild, alike


def sort_in(model: Model, plausible: list[Model], others: list[Model]) -> None:
    fit = model.fit
    inside = all(abs(v) <= BOUNDS[name] for name, v in zip(fit.names, fit.values, strict=True))
    (plausible if inside else others).append(model)


def find_implausible(
    winner: Model, plausible: list[Model], others: list[Model], images: int
) -> tuple[Model, ...]:
    """Models beyond what is plausible that leave the winner's correction out and explain the errors better.

    Not where that correction beside what is odd explains them better still, by the same odds: the flight then
    has both, and its cause is as certain.
    """
    held, needed = set(winner.fit.names), score_model(winner, images) - MARGIN
    if held:
        with_it = (one for one in (*plausible, *others) if held <= set(one.fit.names))
        needed = min(needed, min(score_model(one, images) for one in with_it) + MARGIN)
    without = (one for one in others if not held or not held <= set(one.fit.names))
    return tuple(one for one in without if score_model(one, images) < needed)


def nonzero(calibration: Calibration) -> tuple[str, ...]:
    """The parameters whose 95 % interval leaves zero out."""
    intervals = {name: calibration.interval(name) for name in calibration.names}
    return tuple(name for name, (low, high) in intervals.items() if low > 0 or high < 0)


def score_model(model: Model, images: int) -> float:
    return float(model.deviance + np.log(images) * len(model.fit.names))


def order_models(models: list[Model], images: int) -> Ranked:
    contents = [frozenset(one.fit.names) for one in models]
    # In level flight a camera that is turned and a heading that is wrong are the same correction.
    return rank_models([one.deviance for one in models], contents, images, {"heading": "pan"})
