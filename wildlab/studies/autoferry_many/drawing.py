"""Numbers drawn at random from ranges, for what a tracker is told."""

from __future__ import annotations

import numpy as np


def scale(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between two above zero, evenly over their logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def even(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between two others."""
    return float(rng.uniform(low, high))
