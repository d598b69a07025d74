"""How well predicted and true errors match, by the pose covariance that the Schmidt filter is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.evaluation.consistency import Average, average, share_inside
from wildlab.reporting.spread import bounds_of
from wildlab.studies.schmidt.trial import (
    BOUNDS,
    COVARIANCES,
    CURVE,
    ESTIMATED,
    FACTORS,
    FILTERS,
    SHEET,
    SOURCE,
    SUBJECTS,
)

#: Whose deviations are predicted, and whose poses' errors these are to match.
ORIGINS = {
    "schmidt": (SOURCE, SOURCE),
    "schmidt-data-sheet": (SHEET, SHEET),
    "schmidt-estimated": (ESTIMATED, SOURCE),
}
ANGLES = ("roll", "pitch", "yaw")


class PredictedError(NamedTuple):
    """How well a filter's predicted and true errors match over flights.

    ``median`` of the flights' average NEES; ``drawn``, the mean of one value of each flight with the interval
    of a consistent filter's; ``inside``, the share of flights whose average lies within the bounds of single
    values.
    """

    median: float
    drawn: Average
    inside: float

    @property
    def ratio(self) -> float:
        """How many times as large as predicted errors are on the median flight."""
        return float(np.sqrt(self.median / 2))


def predicted_error(runs: pd.DataFrame, who: str) -> PredictedError:
    """`PredictedError` of a filter over flights, one row each."""
    values = runs[who, "nees"]
    drawn = average(runs[who, "nees_drawn"].to_numpy(float), 2)
    return PredictedError(float(values.median()), drawn, share_inside(values, BOUNDS))


def more_metrics(runs: pd.DataFrame) -> list[tuple[str, str, float]]:
    """Name, subject and value of what is recorded of every filter besides the medians of its numbers."""
    found = []
    for who in SUBJECTS:
        one = predicted_error(runs, who)
        found += [
            ("share_of_flights_inside", who, one.inside),
            ("mean_of_drawn_nees", who, one.drawn.mean),
            ("error_over_stated", who, one.ratio),
        ]
    return found


def mean_deviations(runs: pd.DataFrame, source: str, what: str = "mean_sd") -> dict[str, float]:
    """Mean over the flights of each angle's predicted deviation, or its ``rms`` error, deg."""
    return {axis: float(runs[source, f"{what}_{axis}"].mean()) for axis in ANGLES}


def covariances_table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each pose covariance: predicted deviations and true errors (deg), and `PredictedError`."""
    rows = []
    for who in COVARIANCES:
        predicted, true = ORIGINS[who]
        one = predicted_error(runs, who)
        rows.append(
            {
                "who": who,
                **{f"sd_{axis}": value for axis, value in mean_deviations(runs, predicted).items()},
                **{f"rms_{axis}": value for axis, value in mean_deviations(runs, true, "rms").items()},
                "median": one.median,
                "ratio": one.ratio,
                "drawn": one.drawn.mean,
                "low": one.drawn.low,
                "high": one.drawn.high,
                "inside": 100 * one.inside,
            }
        )
    return pd.DataFrame(rows)


def filters_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """Medians over flights, a row for each filter, with the share of flights within the bounds."""
    columns = ("nees", "nees_predicted", "nis", "mae", "rmse_speed", "rmse_course")
    return pd.DataFrame(
        [
            {"filter": names[who], "inside": 100 * share_inside(runs[who, "nees"], BOUNDS)}
            | {name: float(runs[who, name].median()) for name in columns}
            for who in FILTERS
        ]
    )


def tables(runs: pd.DataFrame, names: Mapping[str, str]) -> dict[str, pd.DataFrame]:
    """Both tables of the page, with courses in degrees, by the key of their texts."""
    covariances = covariances_table(runs)
    filters = filters_table(runs, names)
    filters["rmse_course"] = np.degrees(filters["rmse_course"])
    return {"covariances": covariances.assign(who=covariances["who"].map(names)), "filters": filters}


def curve_table(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each factor on the poses' deviations: ``sd`` (deg, mean of the angles), ``median``,
    ``inside``, and ``low`` and ``high`` of the flights' NEES (`bounds_of`)."""
    one = float(np.mean(list(mean_deviations(runs, SOURCE).values())))
    found = [predicted_error(runs, who) for who in CURVE]
    bounds = [bounds_of(runs[who, "nees"]) for who in CURVE]
    return pd.DataFrame(
        {
            "sd": one * np.array(FACTORS),
            "median": [each.median for each in found],
            "low": [low for low, _ in bounds],
            "high": [high for _, high in bounds],
            "inside": [each.inside for each in found],
        }
    )
