"""Tracking filters held against the one that takes errors for white: consistency gained, accuracy paid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.consistency import chi_square_interval
from wildlab.pipeline.sensor_tracks import WHITE

Array = NDArray[np.float64]

#: Degrees of freedom of the NEES of a position, and so what its mean should be.
IDEAL = 2.0
#: How much larger the error of a filter may be that is to count as better for its consistency.
PRICE = 1.1
#: Elements of a measurement, by kind.
ELEMENTS = {"position": 2, "bearing": 1}
WHITES = tuple(WHITE.values())
_LAG1 = ["lag1_autocorrelation_north", "lag1_autocorrelation_east", "lag1_autocorrelation"]


def off_ideal(anees: ArrayLike) -> Array:
    """By what factor a mean NEES is too large or too small, as a logarithm: 0 is ideal."""
    return np.abs(np.log(np.asarray(anees, float) / IDEAL))


def beside_white(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Every track of another filter beside the same one of the filter with white noise.

    Parameters
    ----------
    table
        Rows of `wildlab.pipeline.sensor_tracks.table`, of one flight or many.
    keys
        Columns that name a case: what was followed, by what, when.

    Returns
    -------
    The rows of the other filters, with the columns of the white one as ``*_white``, ``rmse_ratio`` and
    ``nearer`` (whether the mean NEES is nearer its ideal). Cases without a track are left out.
    """
    known = table[np.isfinite(table["rmse"]) & np.isfinite(table["anees"])]
    white = known[known["filter"].isin(WHITES)]
    both = known[~known["filter"].isin(WHITES)].merge(white, on=list(keys), suffixes=("", "_white"))
    compared: pd.DataFrame = both.assign(
        rmse_ratio=both["rmse"] / both["rmse_white"],
        nearer=off_ideal(both["anees"]) < off_ideal(both["anees_white"]),
    )
    return compared


def pooled(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Tracks of several targets as one case: RMSE and mean NEES over all scans that were compared.

    Returns
    -------
    One row for each combination of ``keys`` and ``filter``, with ``compared``, ``rmse``, ``anees``.
    """
    known = table[np.isfinite(table["rmse"]) & np.isfinite(table["anees"])]
    n = known["compared"]
    sums = known.assign(square=known["rmse"] ** 2 * n, nees=known["anees"] * n)
    total = sums.groupby([*keys, "filter"], sort=False)[["square", "nees", "compared"]].sum()
    return pd.DataFrame(
        {
            "compared": total["compared"],
            "rmse": np.sqrt(total["square"] / total["compared"]),
            "anees": total["nees"] / total["compared"],
        }
    ).reset_index()


def gains(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """For each case, the other filter with the mean NEES nearest its ideal among those whose error is at most
    `PRICE` times that of the filter with white noise.

    Returns
    -------
    One row for each case: ``keys``, ``anees_white``, ``rmse_white``, ``filter`` (empty where none is within
    the price), ``anees``, ``rmse``, ``rmse_ratio``, and ``gained``: whether it is nearer than the white one.
    """
    rows = []
    for key, group in beside_white(table, keys).groupby(list(keys), sort=False):
        within = group[group["rmse_ratio"] <= PRICE]
        row = dict(zip(keys, key, strict=True)) | dict(group.iloc[0][["anees_white", "rmse_white"]])
        best = within.iloc[int(np.argmin(off_ideal(within["anees"])))] if len(within) else None
        for name in ("anees", "rmse", "rmse_ratio"):
            row[name] = np.nan if best is None else best[name]
        row["filter"] = "" if best is None else best["filter"]
        rows.append(row | {"gained": best is not None and bool(best["nearer"])})
    return pd.DataFrame(rows)


def check_claims(table: pd.DataFrame, keys: Sequence[str]) -> dict[str, NDArray[np.bool_]]:
    """In which cases each claim of H 7.5 is true, by the claim's id; cases without a track are left out."""
    both = beside_white(table, keys)
    differenced, considered = both[both["filter"] == "coloured"], both[both["filter"] == "schmidt"]
    white = table[table["filter"].isin(WHITES) & np.isfinite(table["anees"])]
    single = np.array([chi_square_interval(ELEMENTS[kind]) for kind in white["kind"]]).reshape(-1, 2)
    correlated = differenced.dropna(subset=_LAG1[:2])
    checks = {
        "white-noise-overconfident": white["anees"] > white["nees_high"],
        "white-noise-nis-within": (white["anis"] >= single[:, 0]) & (white["anis"] <= single[:, 1]),
        "differencing-whitens": _largest(correlated, "") < _largest(correlated, "_white"),
        "differencing-nearer-ideal": differenced["nearer"],
        "differencing-costs-accuracy": differenced["rmse_ratio"] > 1,
        "schmidt-nearer-ideal": considered["nearer"],
        "schmidt-as-accurate": considered["rmse_ratio"] <= 1,
    }
    return {claim: np.asarray(true, bool) for claim, true in checks.items()}


def _largest(both: pd.DataFrame, suffix: str) -> Array:
    """Largest magnitude of the autocorrelation of the innovations at lag one over their elements."""
    return np.asarray(both[[name + suffix for name in _LAG1]].abs().max(axis=1), float)
