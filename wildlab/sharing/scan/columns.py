"""Columns of numbers in tables: places row by row, and columns that are latitudes as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from wildlab.sharing.scan.dates import DAY_S
from wildlab.sharing.scan.encodings import Axis, Encoding
from wildlab.sharing.scan.secrets import Array, Secrets

#: Share of a column within reach of the places that makes it a latitude or longitude as a whole.
MOSTLY, ROWS = 0.9, 5
#: A single number of eight bytes must agree to this, m.
ALONE_M = 0.55


def in_columns(
    columns: Sequence[tuple[str, Array]],
    encodings: Sequence[Encoding],
    secrets: Secrets,
    numbers: Sequence[float],
) -> list[str]:
    """What columns of numbers give away.

    Parameters
    ----------
    columns
        Their names, and (N,) numbers.
    encodings
        How places may be written.
    secrets
        How near is near, and what times there are.
    numbers
        Others that locate.

    Returns
    -------
    list
        ``"place: latitude in column 'y'"``: what kind, a colon, how it is written.
    """
    said: dict[str, None] = {}
    columns = [(name, np.abs(np.asarray(values, float))) for name, values in columns]
    for encoding in encodings:
        near = [
            (axis, name, _near(values, axis, secrets.near_m))
            for axis in encoding.axes
            for name, values in columns
        ]
        near = [(axis, name, rows) for axis, name, rows in near if rows.any()]
        for (one, a, first), (other, b, second) in combinations(near, 2):
            if one.name != other.name and a != b and len(first) == len(second) and (first & second).any():
                said[f"place: {one.name} in column {a!r} and {other.name} in {b!r}, {encoding.name}"] = None
        for axis, name, rows in near:
            # A column that varies, and never leaves the place, is not one of metres that passes by.
            if axis.decimals is not None and len(rows) >= ROWS and rows.mean() >= MOSTLY:
                said[f"place: {axis.name} in column {name!r}, {encoding.name}"] = None
            elif axis.decimals is not None and _exact(dict(columns)[name], axis).any():
                said[f"place: one {axis.name} in column {name!r}, {encoding.name}"] = None
    for name, values in columns:
        for true in numbers:
            if true and np.isfinite(true) and (np.abs(values - abs(true)) <= abs(true) * 1e-7).any():
                said[f"number: a number that locates, in column {name!r}"] = None
        if secrets.may_stay != "all":
            for moment in secrets.moments:
                for unit, scale in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
                    if (np.abs(values - moment.timestamp() * scale) <= DAY_S * scale).any():
                        said[f"date: time in {unit} since 1970, in column {name!r}"] = None
    return list(said)


def _near(values: Array, axis: Axis, near_m: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(N,) whether each is within reach of any place."""
    order = np.argsort(axis.values)
    true, tolerance = axis.values[order], near_m * axis.per_metre[order]
    index = np.clip(np.searchsorted(true, values), 1, max(len(true) - 1, 1))
    below, above = np.minimum(index - 1, len(true) - 1), np.minimum(index, len(true) - 1)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (np.abs(values - true[below]) <= tolerance[below])
            | (np.abs(values - true[above]) <= tolerance[above])
        )


def _exact(values: Array, axis: Axis) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(N,) whether each is that of a place, and written with more digits than a round number has."""
    odd = np.abs(values * 1e3 - np.round(values * 1e3)) > 1e-6 if axis.values.max() < 1000 else True
    return np.asarray(_near(values, axis, ALONE_M) & odd)
