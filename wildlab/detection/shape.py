"""Animals told from other warm things by their shape: a logistic regression over features of regions (F 8.4).

Regions come from the local-contrast chain with low thresholds. Each gets the log odds that it is what was
labelled, from nine features and their squares. It is small enough to be learnt from a dozen labelled frames.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from wildlab.detection.contrast import FEATURES, Contrast, Proposals, propose
from wildlab.detection.detections import Detections, remove_near
from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, Mask

#: What lets through nearly all that is warm: the regression decides.
PERMISSIVE = Contrast(
    window_px=41, peak=4.0, edge=2.5, of_peak=0.6, smallest_px=6.0, largest_px=3000.0, longest=12.0
)
#: Half the weight of a squared coefficient beside the mean log loss: coefficients stay small where regions
#: are few. Chosen, not fitted.
RIDGE = 0.01


@dataclass(frozen=True)
class Shape:
    """A fitted regression, and what its regions come from.

    Attributes
    ----------
    regions
        Thresholds of the chain that gives the regions.
    mean, scale
        Of the features and their squares, that they are brought to one size by.
    weights
        Of each; empty: not fitted.
    bias
        What is added.
    least
        The log odds that a detection has at least.
    apart_px
        Of detections nearer than this the surest stays.
    """

    regions: Contrast = field(default=PERMISSIVE)
    mean: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    weights: tuple[float, ...] = ()
    bias: float = 0.0
    least: float = 0.0
    apart_px: float = 10.0


def fit_shape(features: ArrayLike, wanted: ArrayLike, regions: Contrast) -> Shape:
    """Learn which regions are what was labelled.

    Parameters
    ----------
    features
        (N, F), of `wildlab.detection.contrast.Proposals`.
    wanted
        (N,) bool: which regions belong to a label.
    regions
        What the regions come from.

    Returns
    -------
    Shape

    Raises
    ------
    WildlabError
        Where all regions are wanted, or none is.

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=(200, len(FEATURES)))
    >>> learnt = fit_shape(x, x[:, 1] > 0, PERMISSIVE)
    >>> print(np.mean((log_odds(learnt, x) > 0) == (x[:, 1] > 0)) > 0.95)
    True
    """
    X, y = _expanded(features), np.asarray(wanted, float)
    if not 0 < y.sum() < len(y):
        raise WildlabError(
            f"{int(y.sum())} of {len(y)} warm regions belong to a label",
            "give labelled frames that show what is looked for, and something else that is warm",
        )
    mean, scale = X.mean(axis=0), X.std(axis=0) + 1e-9
    Z = (X - mean) / scale

    def loss(w: Array) -> tuple[float, Array]:
        odds = Z @ w[1:] + w[0]
        over = 1 / (1 + np.exp(-np.clip(odds, -60, 60))) - y
        value = float(np.mean(np.logaddexp(0, odds) - y * odds) + RIDGE * w[1:] @ w[1:])
        return value, np.concatenate([[over.mean()], Z.T @ over / len(y) + 2 * RIDGE * w[1:]])

    w = minimize(loss, np.zeros(Z.shape[1] + 1), jac=True, method="L-BFGS-B").x
    plain = [tuple(float(one) for one in part) for part in (mean, scale, w[1:])]
    return Shape(regions, plain[0], plain[1], plain[2], float(w[0]))


def log_odds(learnt: Shape, features: ArrayLike) -> Array:
    """How sure the regression is of each region.

    Parameters
    ----------
    learnt
        From `fit_shape`.
    features
        (N, F).

    Returns
    -------
    (N,)

    Raises
    ------
    WildlabError
        Where nothing was fitted, or for other features.
    """
    X = _expanded(features)
    if len(learnt.weights) != X.shape[1] or not len(learnt.mean) == len(learnt.scale) == X.shape[1]:
        raise WildlabError(
            f"a classifier of shapes has {len(learnt.weights)} weights, and {X.shape[1]} are needed",
            "fit it to labelled frames, or name the thresholds.json of such a run",
        )
    return np.asarray(
        (X - np.array(learnt.mean)) / np.array(learnt.scale) @ np.array(learnt.weights) + learnt.bias
    )


def find_by_shape(image: NDArray[Any], valid: Mask, thresholds: Shape) -> Detections:
    """Things that stand out and have the shape of what was labelled.

    Parameters
    ----------
    image, valid
        As for `wildlab.detection.contrast.find_by_contrast`.
    thresholds
        From `fit_shape`.

    Returns
    -------
    Detections
        The score is the log odds.

    Raises
    ------
    WildlabError
        As `log_odds`, and where nothing is valid.
    """
    return choose(propose(image, valid, thresholds.regions), thresholds)


def choose(proposals: Proposals, learnt: Shape) -> Detections:
    """Of regions those that are sure enough.

    Parameters
    ----------
    proposals
        From `wildlab.detection.contrast.propose`.
    learnt
        From `fit_shape`.

    Returns
    -------
    Detections
        The score is the log odds.

    Raises
    ------
    WildlabError
        As `log_odds`.
    """
    odds = log_odds(learnt, proposals.features)
    found = proposals.detections.with_score(odds).select(odds >= learnt.least)
    return remove_near(found, learnt.apart_px)


def _expanded(features: ArrayLike) -> Array:
    x = np.asarray(features, float).reshape(-1, len(FEATURES))
    return np.concatenate([x, x**2], axis=1)
