"""What is constantly wrong with a flight's georeferencing? Nested models on images that they have not seen.

The models are constant errors of the position, the height, the boresight, the camera's clock and the lens,
and their sums as far as the data tell these apart: see `wildlab.evaluation.causes` for how they are compared.
Where the one that wins gains something for certain, it is tried once more with only those of its parameters
that are told from zero.

What is far out is kept out of the search, or a few wrong clicks would look like a cause: it is looked for
with all parameters that the data determine taken off, so that no constant error passes for outliers, and
once more with what was found. Gains are of the points that are left; that of all points stands beside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.blocks import Labels, Neighbours, compare_neighbours
from wildlab.evaluation.causes import (
    ROUNDS,
    Gain,
    Linear,
    Ranked,
    distances,
    draw_folds,
    gain_of,
    held_out,
    rank_models,
)
from wildlab.evaluation.errors import ErrorSummary, mean_summary
from wildlab.evaluation.outliers import Outlier, find_outliers
from wildlab.flight.store import Flight
from wildlab.geometry.calibration import (
    Calibration,
    Fit,
    fit_points,
    georeference_calibrated,
    with_covariance,
)
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.pipeline.evaluate import blocks_of, known_points
from wildlab.pipeline.georeference import Observations, covariances_of, shifting_poses, truth_of

Array = NDArray[np.float64]

#: What may be constantly wrong, each with its parameters. Of the last three one holds the next.
CAUSES: dict[str, tuple[str, ...]] = {
    "position": ("north", "east"),
    "height": ("down",),
    "boresight": ("roll", "tilt", "pan"),
    "clock": ("clock",),
    "focal length": ("focal",),
    "focal lengths": ("focal", "aspect"),
    "lens": ("focal", "aspect", "centre_u", "centre_v"),
}
_LENS = ("focal length", "focal lengths", "lens")
#: Images below which nothing is compared: too few to leave some out.
FEWEST_IMAGES = 6
#: Over which a target's speed is measured, either way, s.
STEP_S = 0.1
#: Causes of one model at most.
MOST_CAUSES = 4
#: Searches at most: another where, with the cause taken off, other points are far out than were kept out.
SEARCHES = 3
#: Beyond this share of points far out no cause is certain: who is out depends on who is believed.
MANY_OUT = 0.25
#: Poses at shifted stamps that are kept: the clocks that every fit with one is begun from, and their steps.
_SHIFTS = 64


@dataclass(frozen=True)
class Model:
    """A sum of causes, fitted to all points and scored on those that a fit had not seen.

    Attributes
    ----------
    causes
        Names of :data:`CAUSES`; none: the poses as logged.
    fit
        From all points.
    held
        (R, N, 2) m, held-out errors of R rounds.
    gain
        Over the poses as logged, of the points that are not far out.
    gain_of_all
        The same of all points.
    """

    causes: tuple[str, ...]
    fit: Fit
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
        Every model that was tried, as logged first.
    ranked
        Their order.
    calibration
        Of the winner, from all points, with the covariance from the blocks.
    alike
        Pairs of causes that these data cannot tell apart.
    outliers
        Photos, marks and clicks that are far out once the winner is taken off, where it is certain. No model
        was fitted to them or ranked by them.
    inliers
        (N,) bool, the points that are in none of these.
    """

    scored: pd.DataFrame
    blocks: Labels
    models: tuple[Model, ...]
    ranked: Ranked
    calibration: Calibration
    alike: tuple[tuple[str, str], ...]
    outliers: tuple[Outlier, ...]
    inliers: NDArray[np.bool_]

    @property
    def winner(self) -> Model:
        """The simplest model within one standard error of the best."""
        return self.models[self.ranked.winner]

    @property
    def rivals(self) -> tuple[Model, ...]:
        """Other models that explain the errors as well."""
        return tuple(self.models[m] for m in self.ranked.rivals)

    @property
    def counts(self) -> bool:
        """Whether taking the winner off gained something for certain, and a parameter of it is not zero;
        never where more points are far out than :data:`MANY_OUT`."""
        return _certain(self.winner, self.calibration) and not self.too_many_out

    @property
    def too_many_out(self) -> bool:
        """Whether so many points are far out, or so few images are left, that no cause is certain."""
        if self.inliers.all():
            return False
        return bool((~self.inliers).mean() > MANY_OUT) or _images(self.scored, self.inliers) < FEWEST_IMAGES

    @property
    def shown(self) -> Model:
        """The winner where it gained something for certain, else the poses as logged."""
        return self.winner if self.counts else self.models[0]

    def neighbours(self) -> Neighbours:
        """How alike images that follow each other are once what is shown is taken off."""
        return _neighbours(self.shown, self.scored, self.inliers)

    def held_summary(self, rows: NDArray[np.bool_] | None = None) -> ErrorSummary:
        """Held-out errors of what is shown, each figure the mean over the rounds; of rows (N,) or all."""
        held = self.shown.held if rows is None else self.shown.held[:, rows]
        return mean_summary(held)


def diagnose(
    flight: Flight,
    observations: Observations,
    scored: pd.DataFrame,
    rng: np.random.Generator,
    source: str | None = None,
    rounds: int = ROUNDS,
) -> Diagnosis:
    """Find what is constantly wrong with the poses, the camera or its clock.

    Parameters
    ----------
    flight
        With truth.
    observations
        From `observe`, or with a calibration applied.
    scored
        From `score_points`, of these observations.
    rng
        Draws the folds.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    rounds
        How many times the blocks are put into folds.

    Returns
    -------
    Diagnosis

    Raises
    ------
    WildlabError
        Where fewer than six images have a point with an error and an ellipse.
    """
    scored = scored[np.isfinite(scored["error_m"]) & np.isfinite(scored["cov_nn"])].reset_index(drop=True)
    images = scored["frame_id"].nunique()
    if images < FEWEST_IMAGES:
        raise WildlabError(
            f"the error of a point is known in {images} images, too few to find a cause",
            f"mark known points in at least {FEWEST_IMAGES} images",
            file=flight.folder,
            field="detections",
        )
    chosen, known = known_points(flight, observations, scored)
    scored = scored.set_index("detection_id").loc[chosen.table["detection_id"]].reset_index()
    blocks = blocks_of(flight, scored)
    folds = [draw_folds(blocks, rng) for _ in range(rounds)]
    whiten = covariances_of(scored)
    poses_at = _poses(flight, source, chosen, scored["truth_id"].to_numpy())

    def place(names: tuple[str, ...], values: Array) -> Array:
        trial = Calibration(names, values, np.zeros((len(names),) * 2), {}, 0, 0)
        ground = georeference_calibrated(trial, poses_at, chosen.uv, known[:, 2])
        return np.asarray(ground[:, :2] - known[:, :2])

    logged, every = place((), np.zeros(0)), np.ones(len(scored), bool)
    images_of, marks = (scored[name].to_numpy(str) for name in ("frame_id", "truth_id"))
    whitening = np.linalg.inv(np.linalg.cholesky(whiten))

    def far_out(fit: Fit) -> tuple[tuple[Outlier, ...], NDArray[np.bool_]]:
        metres = place(fit.names, fit.values)
        # A ray that a correction tips over the horizon is out in any case.
        metres = np.where(np.isfinite(metres), metres, np.where(np.isfinite(logged), logged, 0.0))
        return find_outliers(np.einsum("nij,nj->ni", whitening, metres), metres, images_of, marks)

    def search(inliers: NDArray[np.bool_]) -> Diagnosis:
        kept = np.where(inliers[:, None, None], whiten, np.nan)  # what has no covariance is not fitted to

        def model(causes: tuple[str, ...], only: tuple[str, ...] = ()) -> Model:
            wanted = only or [name for cause in causes for name in CAUSES[cause]]
            fit = fit_points(poses_at, chosen.uv, known, wanted, kept)
            held = held_out(Linear(fit.J, fit.r, fit.values, partial(place, fit.names), fit.usable), folds)
            of = gain_of(logged[inliers], held[:, inliers], blocks[inliers])
            return Model(causes, fit, held, of, gain_of(logged, held, blocks))

        models, alike = _search(model, causes, blocks, inliers)
        best = models[_rank(models, blocks, inliers).winner]
        # Only where the whole of it gained something: the best parameter of a chance gain would look certain.
        told = with_covariance(best.fit, images_of, blocks) if best.gain.counts else None
        if told is not None and (only := _told_from_zero(told, models)):
            models.append(model(tuple(c for c in best.causes if set(CAUSES[c]) & set(only)), only))
        ranked = _rank(models, blocks, inliers)
        winner = models[ranked.winner]
        calibration = with_covariance(winner.fit, images_of, blocks)
        # Blocks whose images stay wrong alike are fewer than they are.
        wider = _neighbours(winner, scored, inliers).widening(len(np.unique(blocks[inliers])))
        calibration = replace(calibration, covariance=wider**2 * calibration.covariance)
        gains = winner.gain.widened(wider), winner.gain_of_all.widened(wider)
        models[ranked.winner] = replace(winner, gain=gains[0], gain_of_all=gains[1])
        return Diagnosis(scored, blocks, tuple(models), ranked, calibration, tuple(alike), (), inliers)

    timed = flight.manifest.time.kind == "utc" and "frame_id" not in flight.pose_source(source)[1]
    causes = [cause for cause in CAUSES if timed or cause != "clock"]
    largest = {name for cause in causes for name in CAUSES[cause]}
    outliers, inliers = far_out(fit_points(poses_at, chosen.uv, known, tuple(largest), whiten))
    for _ in range(SEARCHES):
        if _images(scored, inliers) < FEWEST_IMAGES:
            # Too few to search by without what is far out: that is said, and no cause is certain.
            return replace(search(every), outliers=outliers, inliers=inliers)
        found, said = search(inliers), outliers
        outliers, rest = far_out(found.shown.fit)
        if (rest == inliers).all():
            return replace(found, outliers=outliers)
        inliers = rest
    return replace(found, outliers=said)


def _images(scored: pd.DataFrame, rows: NDArray[np.bool_]) -> int:
    return int(scored.loc[rows, "frame_id"].nunique())


def _poses(
    flight: Flight, source: str | None, chosen: Observations, targets: NDArray[np.str_]
) -> Callable[[float], CameraPoses]:
    """Poses at shifted stamps, as seen from each point's target, which moves on at its speed at the time.

    Those as they are, and the last few, are not interpolated again. What a calibration has added to the
    position stays added.
    """
    named = chosen.table.assign(target_id=targets)
    shifted = shifting_poses(flight, source, chosen)

    @lru_cache(maxsize=_SHIFTS)
    def at(shift: float) -> CameraPoses:
        if shift == 0:
            return chosen.poses
        poses = shifted(shift)
        place = poses.p_nb + added
        return replace(poses, p_nb=place - shift * velocity)

    added = chosen.poses.p_nb - shifted(0.0).p_nb
    velocity = np.zeros_like(added)
    if flight.truth is not None and flight.truth["time_s"].notna().any():
        after, before = (
            truth_of(flight, named.assign(time_s=named["time_s"] + s)) for s in (STEP_S, -STEP_S)
        )
        # At the end of a track its target is taken to stand still.
        velocity[:, :2] = np.nan_to_num((after - before)[:, :2] / (2 * STEP_S))
    return at


def _search(
    model: Callable[[tuple[str, ...]], Model], causes: list[str], blocks: Labels, rows: NDArray[np.bool_]
) -> tuple[list[Model], list[tuple[str, str]]]:
    """All single causes, all pairs, and larger sums as long as the largest so far wins."""
    models = [model(())]
    alike: list[tuple[str, str]] = []
    silent: set[str] = set()
    for cause in causes:
        single = model((cause,))
        if single.fit.names:
            models.append(single)
        else:
            silent.add(cause)

    def add(sums: Iterable[tuple[str, ...]]) -> None:
        for one in sums:
            if silent & set(one) or sum(cause in _LENS for cause in one) > 1:
                continue
            if any(pair <= set(one) for pair in map(set, alike)):
                continue
            joint = model(one)
            if joint.fit.undetermined.keys() - _undetermined_alone(models, one):
                if len(one) == 2:
                    alike.append((one[0], one[1]))
            else:
                models.append(joint)

    add(combinations(causes, 2))
    for size in range(2, MOST_CAUSES):
        winner = models[_rank(models, blocks, rows).winner]
        if len(winner.causes) < size:
            break
        more = [cause for cause in causes if cause not in winner.causes]
        add(tuple(c for c in causes if c in (*winner.causes, one)) for one in more)
    return models, alike


def _certain(model: Model, calibration: Calibration) -> bool:
    """Whether taking its causes off gained something for certain, and a parameter of them is not zero."""
    return bool(model.causes) and model.gain.counts and bool(_nonzero(calibration))


def _nonzero(calibration: Calibration) -> tuple[str, ...]:
    """The parameters whose 95 % interval leaves zero out."""
    intervals = {name: calibration.interval(name) for name in calibration.names}
    return tuple(name for name, (low, high) in intervals.items() if low > 0 or high < 0)


def _told_from_zero(calibration: Calibration, models: list[Model]) -> tuple[str, ...]:
    """The parameters whose 95 % interval leaves zero out, where there are some and others do not.

    None where a model of just these was tried already.
    """
    told = _nonzero(calibration)
    if any(set(one.fit.names) == set(told) for one in models):
        return ()
    return told if 0 < len(told) < len(calibration.names) else ()


def _neighbours(model: Model, scored: pd.DataFrame, rows: NDArray[np.bool_]) -> Neighbours:
    """How alike the held-out errors of images are that follow each other."""
    whiten = np.linalg.inv(np.linalg.cholesky(covariances_of(scored)))
    left = np.einsum("nij,nj->ni", whiten, model.held.mean(axis=0))
    return compare_neighbours(left[rows], scored["time_s"].to_numpy()[rows])


def _undetermined_alone(models: list[Model], causes: tuple[str, ...]) -> set[str]:
    """Parameters that the single causes of a sum had lost already."""
    single = {model.causes[0]: model for model in models if len(model.causes) == 1}
    return {name for cause in causes if cause in single for name in single[cause].fit.undetermined}


def _rank(models: list[Model], blocks: Labels, rows: NDArray[np.bool_]) -> Ranked:
    held = [distances(one.held[:, rows]) for one in models]
    return rank_models(held, [frozenset(one.fit.names) for one in models], blocks[rows])
