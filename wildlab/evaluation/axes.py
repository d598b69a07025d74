"""Errors split along axes: what is constant along one of them is a cause that a parameter can take off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.evaluation.blocks import PROBABILITY, block_mean
from wildlab.evaluation.runs import Interval

#: Share of the squared error below which a constant is of no consequence.
NEGLIGIBLE = 0.05


class AlongAxis(NamedTuple):
    """Errors along one axis.

    Attributes
    ----------
    mean
        Of the component, m, with its interval from the blocks: those of all axes hold at once, where blocks
        are longer than errors last.
    share
        Of the mean square of the whole error that a constant of that size takes off, 0 to 1.
    n
        Points that have the axis.
    """

    mean: Interval
    share: float
    n: int

    @property
    def told(self) -> bool:
        """Whether the interval of the mean leaves zero out."""
        return bool(self.mean.low > 0 or self.mean.high < 0)

    @property
    def constant(self) -> bool:
        """Whether it does, and the constant matters; what wanders more slowly than the flight does, too."""
        return self.told and self.share >= NEGLIGIBLE


def split_along(
    errors: ArrayLike, axes: Mapping[str, ArrayLike], blocks: ArrayLike, probability: float = PROBABILITY
) -> dict[str, AlongAxis]:
    """Mean error along each axis, by name.

    Parameters
    ----------
    errors
        (N, 2) north-east, m; rows with NaN are left out.
    axes
        Unit vectors (N, 2) or (2,), by name; a point with NaN there has no such axis.
    blocks
        (N,) from `wildlab.evaluation.blocks.time_blocks`.
    probability
        With which all the intervals hold at once.

    Returns
    -------
    dict
        An `AlongAxis` for each axis that any point has.

    Examples
    --------
    >>> split_along([[3.0, 0.0], [3.0, 1.0]], {"north": [1.0, 0.0]}, [0, 1])["north"].mean.estimate
    3.0
    """
    e = np.asarray(errors, float)
    squares = float(np.nansum((e**2).sum(axis=1)))
    found = {}
    each = 1 - (1 - probability) / max(len(axes), 1)
    for name, vectors in axes.items():
        component = (e * np.asarray(vectors, float)).sum(axis=1)
        n = int(np.isfinite(component).sum())
        if n:
            mean = block_mean(component, blocks, each)
            share = n * mean.estimate**2 / squares if squares > 0 else 0.0
            found[name] = AlongAxis(mean, float(share), n)
    return found
