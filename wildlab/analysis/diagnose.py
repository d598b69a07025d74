"""What is constantly wrong with a flight's georeferencing? Nested models against noise correlated in time.

The models are constant errors of the position, the height, the boresight, the camera's clock and the lens,
and their sums as far as the data tell these apart: see `wildlab.evaluation.causes` for how they are compared.
What takes a correction beyond `wildlab.geometry.corrections.BOUNDS` is not offered. Places may be known
(truth), or things seen from several images, whose places are then estimated along with everything else.

What is far out is kept out of the search, or a few wrong clicks would look like a cause: it is looked for
with all parameters that the data determine taken off, so that no constant error passes for outliers, and
once more with what was found. Gains are of the points that are left; that of all points stands beside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import (
    FEWEST_IMAGES,
    Observations,
    blocks_of,
    error_covariances,
    known_points,
    pose_errors,
    shifting_poses,
    truth_of,
)
from wildlab.errors import WildlabError
from wildlab.evaluation.causes import (
    CHANCE,
    MARGIN,
    Gain,
    Linear,
    Ranked,
    chance_of,
    gain_of,
    held_out,
    leave_out,
    rank_models,
    told_parameters,
)
from wildlab.evaluation.correlated_errors import (
    LASTS_IMAGES,
    LASTS_S,
    Covariance,
    LinearFit,
    Places,
    PosePoints,
    WanderNoise,
    degrees_of_freedom,
    estimate_wander,
    fit_generalised,
)
from wildlab.evaluation.errors import ErrorSummary, summarise
from wildlab.evaluation.intervals import Labels
from wildlab.evaluation.outliers import Outlier, find_outliers
from wildlab.evaluation.pose_noise import KINDS
from wildlab.geometry.calibration import Fit, fit_points, undetermined_parameter
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.corrections import (
    BORESIGHT,
    BOUNDS,
    PARAMETERS,
    Calibration,
    calibrated_poses,
    calibration_jacobian,
    georeference_calibrated,
)
from wildlab.geometry.covariances import chi2_quantile
from wildlab.geometry.frames import Array, Mask
from wildlab.geometry.robust import student_scale
from wildlab.geometry.uncertainty import ground_jacobians

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
#: Causes of one model at most.
MOST_CAUSES = 4
#: Beyond this share of points far out no cause is certain: who is out depends on who is believed.
MANY_OUT = 0.25
#: Deviance for each residual beyond which the noise does not explain what a cause leaves: none is certain.
MISFIT = 3.0


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
        Over the poses as logged, of the points with the best known truth that are not far out.
    """

    causes: tuple[str, ...]
    fit: Fit
    covariance: Array
    deviance: float
    chance: float
    held: Array
    gain: Gain

    @property
    def name(self) -> str:
        """The causes in words, ``nothing`` where there is none; with its parameters where it has not all."""
        lacking = {name for cause in self.causes for name in CAUSES[cause]} - set(self.fit.names)
        alone = f" ({', '.join(self.fit.names)} alone)" if lacking else ""
        return (" and ".join(self.causes) or "nothing") + alone

    def value(self, name: str) -> float:
        """The estimate of a parameter; zero where the model has it not."""
        return float(dict(zip(self.fit.names, self.fit.values, strict=True)).get(name, 0.0))


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
    extended
        Whether the border of the image cuts more than :data:`MANY_OUT` of what was found: targets are longer
        than a point, and the centre of what is seen of one depends on how it lies.
    misfit
        Whether what the winner leaves is far more than the noise explains: see :data:`MISFIT`.
    """

    scored: pd.DataFrame
    blocks: Labels
    models: tuple[Model, ...]
    ranked: Ranked
    calibration: Calibration
    alike: tuple[tuple[str, str], ...]
    outliers: tuple[Outlier, ...]
    inliers: Mask
    implausible: tuple[Model, ...]
    noise: WanderNoise
    places_known: bool = True
    extended: bool = False
    misfit: bool = False

    @property
    def winner(self) -> Model:
        """The simplest model within the odds of the best."""
        return self.models[self.ranked.winner]

    @property
    def rivals(self) -> tuple[Model, ...]:
        """Other models that explain the errors as well: the data do not separate them from the winner."""
        return tuple(self.models[m] for m in self.ranked.rivals)

    def most_likely_with(self, name: str) -> Model | None:
        """The winner, or where it lacks a parameter the most likely model that has it, if any."""
        order = [self.ranked.winner, *np.argsort(self.ranked.scores, kind="stable")]
        return next((self.models[m] for m in order if name in self.models[m].fit.names), None)

    @property
    def inseparable(self) -> tuple[str, ...]:
        """Causes of the winner and its rivals, where it has any: which of them it is, the data do not say."""
        if not self.rivals:
            return ()
        return tuple(dict.fromkeys(cause for one in (self.winner, *self.rivals) for cause in one.causes))

    @property
    def certain(self) -> tuple[str, ...]:
        """Causes that are certain: no rival lacks them, and a parameter of theirs differs from zero.

        None where taking the winner off gained nothing, its estimate may be chance, or no model fits.
        """
        one, found = self.winner, set(nonzero(self.calibration))
        if not (one.gain.counts and one.chance < CHANCE and self.fits):
            return ()
        shared = (cause for cause in one.causes if all(cause in rival.causes for rival in self.rivals))
        return tuple(cause for cause in shared if found & set(CAUSES[cause]))

    @property
    def counts(self) -> bool:
        """Whether the winner is certain: its cause is, and nothing else explains the errors as well."""
        return bool(self.certain) and not self.rivals

    @property
    def fits(self) -> bool:
        """Whether what is tried can explain the errors: they do not depend on how targets lie, the noise
        explains what is left, nothing implausible explains them better, and no more points are far out than
        :data:`MANY_OUT`."""
        return not (self.extended or self.misfit or self.implausible or self.too_many_out)

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

    def held_summary(self, rows: Mask | bool = True) -> ErrorSummary:
        """Held-out errors of what is shown, of points with the best known truth; of rows (N,) or all."""
        return summarise(self.shown.held[self.scored["best_truth"].to_numpy() & rows])


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


def order_models(models: list[Model], images: int, rows: Mask, blocks: Labels) -> Ranked:
    contents = [frozenset(one.fit.names) for one in models]
    # In level flight a camera that is turned and a heading that is wrong are the same correction.
    held = [one.held[rows] for one in models]
    deviances = [one.deviance for one in models]
    return rank_models(deviances, contents, images, {"heading": "pan"}, held, blocks[rows])


#: Over which a target's speed is measured, either way, s.
STEP_S = 0.1

#: Searches at most: another where, with the cause taken off, other points are far out than were kept out.
SEARCHES = 3

#: Images left out one by one where places are not known; of more, so many groups.
MOST_FOLDS = 40
#: Poses at shifted stamps that are kept: the clocks that every fit with one is begun from, and their steps.
_SHIFTS = 64
#: Steps of an estimate, and how often one that makes it worse is halved.
_STEPS, _HALVINGS = 8, 4
#: A parameter is tried where the data determine it to so many usual sizes: it may explain what others do.
BROAD = 3.0
#: Deviance that is not worth another step.
SETTLED = 0.02
#: From a robust estimate that is further from zero than this (usual sizes) fits are begun too.
FAR_START = 0.4
#: Least standard deviations: two of positions (m), two of angles (rad), and of the pixel (px).
LEAST = (0.01, 0.01, 1e-4, 1e-4, 0.05)


def diagnose(observations: Observations, scored: pd.DataFrame, places_known: bool = True) -> Diagnosis:
    """Find what is constantly wrong with the poses, the camera or its clock.

    Parameters
    ----------
    observations
        From `observe`, or with a calibration applied.
    scored
        From `score_points`, or `wildlab.analysis.accuracy.compare_sightings`, of these observations.
    places_known
        Whether the places that the points are of are known (truth). Otherwise only their names are used.

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
            file=observations.flight.folder,
            field="detections",
        )
    if places_known:
        chosen, known = known_points(observations, scored)
    else:
        chosen = observations.of(scored)
        known = np.column_stack([np.zeros((len(chosen.uv), 2)), chosen.plane_down])
    scored = scored.set_index("detection_id").loc[chosen.table["detection_id"]].reset_index()
    search = _Search(chosen, known, scored, places_known)
    largest = search.fit_robustly(np.ones(len(scored), bool))
    outliers, inliers = search.far_out(largest)
    if count_images(scored, inliers) < FEWEST_IMAGES:
        # Too few to search by without what is far out: that is said, and no cause is certain.
        return replace(search.run(np.ones(len(scored), bool)), outliers=outliers, inliers=inliers)
    for _ in range(SEARCHES):
        found, said = search.run(inliers), outliers
        outliers, rest = search.far_out(found.shown.fit)
        if (rest == inliers).all():
            return replace(found, outliers=outliers)
        if count_images(scored, rest) < FEWEST_IMAGES:
            break
        inliers = rest
    return replace(found, outliers=said)


class _Search:
    """What is shared by the searches of one flight: N points, their poses, and how they are placed."""

    def __init__(self, chosen: Observations, known: Array, scored: pd.DataFrame, places_known: bool) -> None:
        flight = chosen.flight
        self.scored, self.chosen, self.known, self.places_known = scored, chosen, known, places_known
        self.names_of = scored["truth_id"].to_numpy(str)
        self.things = None if places_known else self.names_of
        self.blocks, self.ellipses = blocks_of(flight, scored), error_covariances(scored)
        self.poses_at = _poses(chosen, self.names_of)
        timed = flight.manifest.time.kind == "utc" and "frame_id" not in flight.nav[chosen.source]
        self.causes = [cause for cause in CAUSES if timed or cause != "clock"]
        if not places_known:
            self.causes.remove("position")  # moves all sightings alike
        seconds = flight.manifest.time.kind == "utc" and bool(np.isfinite(scored["time_s"]).all())
        frames = pd.Index(flight.table("frames")["frame_id"]).get_indexer(pd.Index(scored["frame_id"]))
        self.order = scored["time_s"].to_numpy(float) if seconds else frames.astype(float)
        self.lasts = LASTS_S if seconds else LASTS_IMAGES
        sd, logged = np.full(len(scored), np.inf), np.zeros(len(scored), bool)
        if places_known:
            sd, truth = scored["truth_sd_m"].to_numpy(float), flight.table("truth")
            logged = np.isin(self.names_of, truth.loc[truth["time_s"].notna(), "target_id"].astype(str))
        self.places = Places(self.names_of, sd, logged) if sd.any() else None
        self.assumed = _pose_points(chosen, self.order)[1]
        self.logged = self.place((), np.zeros(0))
        self.cut = _cut(chosen)
        self._robust: tuple[Mask, Fit] | None = None
        images = np.unique(self.order, return_inverse=True)[1]
        self.groups = self.blocks
        if not places_known:
            self.groups = images * min(MOST_FOLDS, int(images.max()) + 1) // (int(images.max()) + 1)

    def place(self, names: tuple[str, ...], scaled: Array) -> Array:
        """Errors (N, 2) m with corrections in their usual sizes; positions where places are not known."""
        trial = Calibration.in_sizes(names, scaled)
        ground = georeference_calibrated(trial, self.poses_at, self.chosen.uv, self.known[:, 2])
        return ground[:, :2] - self.known[:, :2]

    def slopes(self, names: tuple[str, ...], scaled: Array) -> Array:
        """Derivatives (N, 2, P) of these errors, m, by corrections in their usual sizes."""
        J = calibration_jacobian(
            Calibration.in_sizes(names, scaled), self.poses_at, self.chosen.uv, self.known[:, 2]
        )
        return J * [PARAMETERS[name] for name in names]

    def fit_robustly(self, inliers: Mask) -> Fit:
        """All parameters that the data determine, by their robust likelihood."""
        if self._robust is not None and (self._robust[0] == inliers).all():
            return self._robust[1]
        largest = {name for cause in self.causes for name in CAUSES[cause]}
        kept = np.where(inliers[:, None, None], self.ellipses, np.nan)
        fit = fit_points(self.poses_at, self.chosen.uv, self.known, tuple(largest), kept, self.things)
        self._robust = inliers, fit
        return fit

    def far_out(self, fit: Fit) -> tuple[tuple[Outlier, ...], Mask]:
        """What is far out with a fit taken off, and which points (N,) are not."""
        off, logged = map(self._about_things, (self.place(*_scaled(fit)), self.logged))
        # A ray that a correction tips over the horizon is out in any case.
        off = np.where(np.isfinite(off), off, np.where(np.isfinite(logged), logged, 0.0))
        whitened = np.einsum("nij,nj->ni", np.linalg.inv(np.linalg.cholesky(self.ellipses)), off)
        # Nothing tells a wrong mark where places are not known.
        marks = self.names_of if self.places_known else np.full(len(off), "")
        return find_outliers(whitened, off, self.scored["frame_id"].to_numpy(str), marks)

    def _about_things(self, positions: Array) -> Array:
        if self.places_known:
            return positions
        middle = pd.DataFrame(positions).groupby(self.names_of).transform("median").to_numpy()
        return positions - middle

    def run(self, inliers: Mask) -> Diagnosis:
        """Search for the cause of the errors of the inliers (N,)."""
        robust = self.fit_robustly(inliers)
        used = inliers & robust.usable & np.isfinite(self.logged).all(axis=1)
        squared = (robust.r**2).sum(axis=1)
        # Of normal errors one in a hundred counts for less (Huber): weights of all would make noise small.
        weights = np.ones(len(used))
        far = student_scale(squared) ** 2 * chi2_quantile(0.99, 2)
        weights[robust.usable] = far / np.maximum(squared, far)
        names, start = _scaled(robust)
        bounds = np.array([BOUNDS[name] / PARAMETERS[name] for name in names])
        start = np.clip(start, -bounds, bounds)
        # Derivatives with what is constant taken off: at logged poses a large error would look like another.
        corrected = replace(
            self.chosen, poses=calibrated_poses(Calibration.in_sizes(names, start), self.poses_at)
        )
        points = _pose_points(corrected, self.order)[0]
        # A ray that this tips over the horizon says nothing, nor does a thing that is left with one sighting.
        used &= np.isfinite(points.derivatives).all(axis=(1, 2))
        if not self.places_known:
            used &= pd.Series(used).groupby(self.names_of).transform("sum").to_numpy() > 1
        points = points.take(used)
        points = points._replace(
            own=points.own / weights[used, None, None], pixel=points.pixel / weights[used, None, None]
        )
        places = None if self.places is None else self.places.take(used)

        def residuals(of: tuple[str, ...], scaled: Array) -> Array:
            # A trial that tips a ray over the horizon is far off; a large residual turns it back.
            return np.nan_to_num(self.place(of, scaled)[used], nan=1e4)

        def derivatives(of: tuple[str, ...], scaled: Array) -> Array:
            return np.nan_to_num(self.slopes(of, scaled)[used])

        r, J = residuals(names, start), derivatives(names, start)
        wander = estimate_wander(points, r, J * bounds, self.assumed, self.lasts, places)
        noise = wander.noise
        covariance = Covariance(points, noise, places)
        folds = leave_out(self.groups, used, points, noise, places)
        without = held_out(
            Linear(J[..., :0], r, np.zeros(0), lambda x: self.place((), x)), folds, used, self.things
        )

        def descend(of: tuple[str, ...], scaled: Array) -> tuple[Linear, LinearFit]:
            """Where the deviance is least, and the linear fit there."""
            r, here = residuals(of, scaled), np.inf
            for _ in range(_STEPS):
                J = derivatives(of, scaled)
                fit = fit_generalised(J, r, covariance)
                now = _deviance(r, covariance)
                gained, here = here - now, now
                # Steps that the deviance does not show are not taken.
                if gained < SETTLED or here - fit.deviance < SETTLED:
                    break
                for halved in range(_HALVINGS):
                    trial = scaled + fit.x / 2**halved
                    there = residuals(of, trial)
                    if _deviance(there, covariance) <= here:
                        scaled, r = trial, there
                        break
                else:
                    break
            return Linear(J, r, scaled, lambda x: self.place(of, x)), fit._replace(deviance=here)

        def model(causes: tuple[str, ...], only: tuple[str, ...] = ()) -> Model:
            wanted = only or {name for cause in causes for name in CAUSES[cause]}
            of, lost = tuple(name for name in PARAMETERS if name in wanted), dict[str, tuple[str, ...]]()
            while True:
                begin = [np.zeros(len(of))]
                robustly = np.array([start[names.index(n)] if n in names else 0.0 for n in of])
                if (np.abs(robustly) > FAR_START).any():
                    begin.append(robustly)
                linear, fit = min((descend(of, x) for x in begin), key=lambda found: found[1].deviance)
                blurred = undetermined_parameter(of, _root(fit.information), 1 / BROAD)
                if blurred is None:
                    break
                lost[blurred[0]] = blurred[1]
                of = tuple(name for name in of if name != blurred[0])
            size = np.array([PARAMETERS[name] for name in of])
            held = held_out(linear, folds, used, self.things)
            return Model(
                causes,
                Fit(of, linear.values * size, lost, used, linear.J / size, linear.r),
                np.asarray(np.linalg.inv(fit.information) * np.outer(size, size), float),
                fit.deviance,
                1.0,
                held,
                gain_of(without[judged], held[judged], self.blocks[judged]),
            )

        judged = inliers & self.scored["best_truth"].to_numpy()
        images = count_images(self.scored, used)
        models, wild, alike = search_models(model, self.causes, images)
        tried = len(models) + len(wild)
        while True:
            ranked = order_models(models, images, inliers, self.blocks)
            winner = models[ranked.winner]
            calibration, fit = self._calibration(winner, used), winner.fit
            if not winner.causes:
                break
            joint, freedom = degrees_of_freedom(fit.J, fit.values, points, wander, places)
            sd = np.sqrt(np.diagonal(winner.covariance))
            told = np.array(fit.names)[told_parameters(fit.values, sd, freedom, images)].tolist()
            if told and len(told) < len(fit.names):
                # The rest is no part of the cause: the noise that it is told from is hardly known itself.
                del models[ranked.winner]
                if not any(set(one.fit.names) == set(told) for one in models):
                    causes = tuple(cause for cause in winner.causes if set(CAUSES[cause]) & set(told))
                    sort_in(model(causes, tuple(told)), models, wild)
                continue
            wald = float(fit.values @ np.linalg.solve(winner.covariance, fit.values))
            models[ranked.winner] = replace(winner, chance=chance_of(wald, len(fit.names), joint, tried))
            calibration = replace(calibration, freedom=freedom)
            break
        implausible = find_implausible(winner, models, wild, images)
        return Diagnosis(
            self.scored, self.blocks, tuple(models), ranked, calibration, tuple(alike), (), inliers,
            implausible, noise, self.places_known, bool(self.cut[used].mean() > MANY_OUT),
            winner.deviance > MISFIT * winner.fit.r.size,
        )  # fmt: skip

    def _calibration(self, model: Model, used: Mask) -> Calibration:
        return Calibration(
            model.fit.names,
            model.fit.values,
            model.covariance,
            model.fit.undetermined,
            int(used.sum()),
            count_images(self.scored, used),
            len(np.unique(self.blocks[used])),
        )


def _pose_points(chosen: Observations, order: Array) -> tuple[PosePoints, dict[str, float]]:
    """Points as their covariance depends on them, and the standard deviations that log or manifest state."""
    J, stated = ground_jacobians(chosen.poses, chosen.uv, chosen.plane_down), pose_errors(chosen)
    R = np.broadcast_to(chosen.poses.R_nb, (len(order), 3, 3))
    in_n = J.pose.copy()
    in_n[..., 3:] = J.pose[..., 3:] @ np.swapaxes(R, 1, 2)
    pose = np.broadcast_to(stated.pose, (len(order), 6, 6))
    turned = R @ pose[:, 3:, 3:] @ np.swapaxes(R, 1, 2)
    place, turn = (np.nanmean(np.diagonal(of, axis1=1, axis2=2), axis=0) for of in (pose[:, :3, :3], turned))
    pixel = np.trace(np.atleast_2d(stated.pixel)) / 2
    variances = [place[:2].mean(), place[2], turn[:2].mean(), turn[2], pixel]
    assumed = {
        kind: max(float(np.sqrt(variance)), least)
        for kind, variance, least in zip(KINDS, variances, LEAST, strict=True)
    }
    own = stated.plane * J.plane[:, :, None] * J.plane[:, None, :]
    return PosePoints(in_n, J.pixel @ np.swapaxes(J.pixel, 1, 2), own, order), assumed


def _cut(chosen: Observations) -> Mask:
    """(N,) which detections say that the border of the image cuts what they are of."""
    table, names = chosen.flight.table("detections"), chosen.table["detection_id"]
    if "touches_border" not in table:
        return np.zeros(len(names), bool)
    return table.set_index("detection_id").loc[names, "touches_border"].to_numpy(float) > 0


def _scaled(fit: Fit) -> tuple[tuple[str, ...], Array]:
    """Names and values in their usual sizes."""
    return fit.names, fit.values / np.array([PARAMETERS[name] for name in fit.names])


def _root(information: Array) -> Array:
    """A matrix (P, P) whose square, transposed first, is the information."""
    values, vectors = np.linalg.eigh(information)
    return np.sqrt(np.clip(values, 0, None))[:, None] * vectors.T


def _deviance(r: Array, covariance: Covariance) -> float:
    return float(covariance.weigh(r[..., None])[0][0, 0])


def _poses(chosen: Observations, targets: NDArray[np.str_]) -> Callable[[float], CameraPoses]:
    """Poses at shifted stamps, as seen from each point's target, which moves on at its speed at the time.

    Those as they are, and the last few, are not interpolated again. What a calibration has added to the
    position stays added.
    """
    flight, named = chosen.flight, chosen.table.assign(target_id=targets)
    shifted = shifting_poses(chosen)

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
