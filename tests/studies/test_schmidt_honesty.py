"""Verdicts on the Schmidt filter's honesty, on numbers that say the opposite of each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.studies.test_schmidt_claims import flight_with
from wildlab.studies.schmidt import charts, headline, text
from wildlab.studies.schmidt.trial import COVARIANCES, CURVE, FACTORS, SUBJECTS

SIZE = 60


def flights(size: int = SIZE, **changed: Any) -> pd.DataFrame:
    """Flights whose NEES at a drawn moment are as a consistent filter's, but for what is changed."""
    drawn = -2 * np.log((np.arange(size) + 0.5) / size)  # quantiles of chi-square with two degrees of freedom
    rows = []
    for i in range(size):
        row = flight_with() | {(who, "nees_drawn"): drawn[i] for who in SUBJECTS}
        row |= {(who, "nees"): 2.0 + 0.01 * i for who in SUBJECTS}
        row |= {("mekf-data-sheet", f"{what}_{axis}"): 0.005 for what in ("mean_sd", "rms") for axis in AXES}
        row |= {("estimated", f"mean_sd_{axis}"): 0.8 + 0.01 * (i % 5) for axis in AXES}
        row |= {("mekf", f"mean_sd_{axis}"): 0.08 for axis in ("north", "east", "down")}
        for key, value in changed.items():
            who, name = key.split("__")
            row[who, name] = row[who, name] * value if callable(value) is False else value(i, row[who, name])
        rows.append(row)
    return pd.DataFrame(rows)


AXES = ("roll", "pitch", "yaw")


def drawn_times(factor: float) -> dict[str, Any]:
    """For `flights`: NEES of the first covariance, averages and draws, this many times as large."""
    return {"schmidt__nees": factor, "schmidt__nees_drawn": factor}


@pytest.mark.parametrize(
    ("factor", "verdict"),
    [(1.0, headline.CONSISTENT), (4.0, headline.OPTIMISTIC), (0.25, headline.PESSIMISTIC)],
)
def test_a_verdict_follows_the_test_over_flights(factor, verdict):
    spread = flights(**drawn_times(factor))
    found = headline.honesty(spread, "schmidt")
    assert found.verdict == verdict
    assert found.overall == pytest.approx(np.sqrt(spread["schmidt", "nees_drawn"].mean() / 2))
    assert found.ratio == pytest.approx(np.sqrt(spread["schmidt", "nees"].median() / 2))
    table = headline.honesty_table(spread)
    assert len(table) == 1 + len(COVARIANCES) and table["verdict"].tolist()[1] == verdict


def test_four_flights_tell_less_than_sixty():
    few, many = (headline.honesty(flights(n, **drawn_times(0.5)), "schmidt") for n in (4, SIZE))
    assert few.verdict == headline.CONSISTENT and many.verdict == headline.PESSIMISTIC
    assert few.drawn.high > many.drawn.high


def test_a_median_may_lie_on_the_other_side_of_the_test():
    rare = flights(
        schmidt__nees=lambda i, _: 1.0, schmidt__nees_drawn=lambda i, value: 90.0 if i % 10 == 0 else value
    )
    found = headline.honesty(rare, "schmidt")
    assert found.ratio < 1 < found.overall and found.verdict == headline.OPTIMISTIC


def test_the_thesis_yardstick_counts_averages_within_the_bounds_of_single_values():
    half = flights(schmidt__nees=lambda i, _: 7.3 if i % 2 else 7.5)
    assert headline.honesty(half, "schmidt").inside == 0.5


def falling(at_one: float) -> dict[str, Any]:
    """For `flights`: NEES that falls as the stated variance grows, to ``at_one`` at the printed one."""
    changed: dict[str, Any] = {}
    for who, factor in zip(CURVE, FACTORS, strict=True):
        value = at_one / factor**2
        changed[f"{who}__nees"] = lambda i, _, value=value: value
        changed[f"{who}__nees_drawn"] = lambda i, drawn, value=value: drawn * value / 2
    return changed


@pytest.mark.parametrize(
    ("at_one", "where"), [(2.0, "1.4°"), (0.5, "0.7°"), (200.0, "above"), (0.005, "below")]
)
def test_the_curve_says_where_stated_and_true_error_match(at_one, where):
    spread = flights(**falling(at_one))
    assert where in headline.curve_words(spread)[0]
    marks = charts.marks_of(spread)
    assert marks["schmidt"] == (pytest.approx(1.4), pytest.approx(at_one), marks["schmidt"][2])


def test_one_to_two_degrees_are_judged_by_both_yardsticks():
    wrong = flights(**{"schmidt-1-deg__nees": lambda i, _: 20.0, "schmidt-1-deg__nees_drawn": 10.0})
    good, bad = (headline.honesty(spread, "schmidt-1-deg") for spread in (flights(), wrong))
    assert (good.inside, bad.inside) == (1.0, 0.0)
    assert (good.verdict, bad.verdict) == (headline.CONSISTENT, headline.OPTIMISTIC)


def test_a_drawn_flight_is_typical_or_not():
    def like(first: float) -> pd.DataFrame:
        """All that is shown as in the middle, but for one mean error."""
        changed = {f"{who}__{name}": lambda i, _: float(i or 30) for _, who, name, *_ in text.DRAWN}
        return flights(**changed | {"ekf__mae": lambda i, _: float(i or first)})

    typical = text.typical_table(like(30.5))
    assert not typical["typical"].str.startswith("not").any()
    odd = text.typical_table(like(99.0))
    assert "59 of the 59" in odd["typical"][0] and odd["typical"].str.startswith("not").sum() == 1
