"""The words of the reports on the Schmidt filter, on numbers that say the opposite of each other."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.studies.test_schmidt_claims import flight_with
from wildlab.reporting.report import Report, open_report
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
    ("factor", "verdict", "words"),
    [
        (1.0, headline.CONSISTENT, "not found wrong ({:.1f} times)"),
        (4.0, headline.OPTIMISTIC, "optimistic ({:.1f} times, over all flights)"),
        (0.25, headline.PESSIMISTIC, "pessimistic ({:.1f} times, over all flights)"),
    ],
)
def test_a_verdict_follows_the_test_over_flights(factor: float, verdict: str, words: str) -> None:
    spread = flights(**drawn_times(factor))
    found = headline.honesty(spread, "schmidt")
    assert found.verdict == verdict and headline.honest_words(found) == words.format(found.overall)
    assert found.overall == pytest.approx(np.sqrt(spread["schmidt", "nees_drawn"].mean() / 2))
    assert found.ratio == pytest.approx(np.sqrt(spread["schmidt", "nees"].median() / 2))
    summary = " ".join(headline.summary_words(spread))
    assert (
        f"tuned to H 7.5.3, {verdict}" in summary and f"{found.ratio:.1f} times (tuned to H 7.5.3)" in summary
    )
    table = headline.honesty_table(spread)
    assert table["verdict"].tolist()[1] == verdict and table["told"].tolist()[1] == "tuned to H 7.5.3"
    assert f"{verdict})" in headline.tile_words(spread, {("schmidt", "nees"): 0.4})[0][1]


def test_four_flights_tell_less_than_sixty() -> None:
    few, many = (headline.honesty(flights(n, **drawn_times(0.5)), "schmidt") for n in (4, SIZE))
    assert few.verdict == headline.CONSISTENT and many.verdict == headline.PESSIMISTIC
    assert few.drawn.high > many.drawn.high


def test_a_median_on_the_other_side_of_the_test_is_said() -> None:
    rare = flights(
        schmidt__nees=lambda i, _: 1.0, schmidt__nees_drawn=lambda i, value: 90.0 if i % 10 == 0 else value
    )
    found = headline.honesty(rare, "schmidt")
    assert found.ratio < 1 < found.overall and found.verdict == headline.OPTIMISTIC
    (words, *_) = (words for _, words in headline.tile_words(rare, {("schmidt", "nees"): 0.4}))
    assert f"median flight; over all flights {found.overall:.1f} times: optimistic" in words


def test_the_thesis_yardstick_counts_averages_within_the_bounds_of_single_values() -> None:
    half = flights(schmidt__nees=lambda i, _: 7.3 if i % 2 else 7.5)
    assert headline.honesty(half, "schmidt").inside == 0.5
    assert "50 %, 100 %, 100 % of the flights pass" in headline.summary_words(half)[2]


def test_who_is_nearer_follows_the_errors() -> None:
    for times, who in ((0.5, "Schmidt"), (2.0, "extended")):
        (first, *_) = text.variant_points(flights(schmidt__mae=times))
        assert first.startswith(f"The {who} filter is nearer to the truth on {SIZE} of {SIZE} flights")
        last = headline.summary_words(flights(schmidt__mae=times))[-1]
        assert last.startswith(f"Positions are {times:.1f} m")


def test_what_is_near_the_print_is_called_near() -> None:
    spread = flights()
    ours = {f"mean_sd_{axis}": 1.4 for axis in AXES} | {f"mean_sd_{one}": 0.08 for one in NORTH}
    near = headline.tuned_words(spread, ours | {"mean_sd_yaw": 1.45})
    far = headline.tuned_words(spread, ours | {"mean_sd_down": 0.16})
    assert "all within a tenth" in near and "farthest is yaw, 0.97 times" in near
    assert "not all near" in far and "farthest is down, 0.50 times" in far
    for twin in ("fast-vessel", "slow-vessel-eight", "drifting-vessel-eight"):
        assert set(headline.printed_deviations(twin)) == set(ours)


NORTH = ("north", "east", "down")


def test_an_estimate_is_beside_the_true_errors() -> None:
    assert "0.82 times the true attitude errors" in headline.estimate_words(flights())
    same = flights(estimated__mean_sd_roll=lambda i, _: 1.0)
    assert "as large as the true attitude errors" in headline.estimate_words(same)


def falling(at_one: float) -> dict[str, Any]:
    """For `flights`: NEES that falls as the stated variance grows, to ``at_one`` at the printed one."""
    changed: dict[str, Any] = {}
    for who, factor in zip(CURVE, FACTORS, strict=True):
        value = at_one / factor**2
        changed[f"{who}__nees"] = lambda i, _, value=value: value
        changed[f"{who}__nees_drawn"] = lambda i, drawn, value=value: drawn * value / 2
    return changed


@pytest.mark.parametrize(
    ("at_one", "title"),
    [
        (2.0, "NEES is two where 1.4° are stated"),
        (0.5, "NEES is two where 0.7° are stated"),
        (200.0, "NEES is above two from 0.14° to 4.2°"),
        (0.005, "NEES is below two from 0.14° to 4.2°"),
    ],
)
def test_the_curve_says_where_stated_and_true_error_match(at_one: float, title: str) -> None:
    spread = flights(**falling(at_one))
    found, points = headline.curve_words(spread)
    assert found == title
    curve = headline.curve_table(spread)
    fine = (curve["verdict"] == headline.CONSISTENT).sum()
    assert (f"({fine} of 9 points)" if fine else "at none of the 9 points of the curve") in points[0]
    marks = charts.marks_of(spread)
    assert marks["schmidt"] == (pytest.approx(1.4), pytest.approx(at_one), marks["schmidt"][2])


def test_one_to_two_degrees_are_judged_by_both_yardsticks() -> None:
    wrong = flights(**{"schmidt-1-deg__nees": lambda i, _: 20.0, "schmidt-1-deg__nees_drawn": 10.0})
    _, (_, good) = headline.curve_words(flights())
    _, (_, bad) = headline.curve_words(wrong)
    assert "100 % and 100 % of the flights" in good and "told 1° the filter is not found wrong" in good
    assert (
        "0 % and 100 % of the flights" in bad
        and "told 1° the filter is optimistic (3.2 times, over all flights)" in bad
    )


def test_a_drawn_flight_is_typical_or_not() -> None:
    def like(first: float) -> pd.DataFrame:
        """All that is shown as in the middle, but for one mean error."""
        changed = {f"{who}__{name}": lambda i, _: float(i or 30) for _, who, name, *_ in text.DRAWN}
        return flights(**changed | {"ekf__mae": lambda i, _: float(i or first)})

    typical = text.typical_table(like(30.5))
    assert text.typical_sentence(typical) == "It is typical in all that its figures show."
    odd = text.typical_table(like(99.0))
    assert odd["typical"][0] == "not typical: 59 of the 59 others have a smaller one"
    assert "in 7 of 8 things" in text.typical_sentence(odd)
    assert text.typical_sentence(odd).endswith("It is not in: mean error, extended.")
    assert "in nothing" in text.typical_sentence(odd.assign(typical=odd["typical"][0]))
    assert "no other flight" in text.typical_sentence(text.typical_table(like(1.0)[:1]))


def test_figures_of_the_drawn_flight_say_its_numbers() -> None:
    names = ("mae", "rmse_speed", "rmse_course", "fraction_nees_inside")
    one, other = dict(zip(names, (3.0, 0.5, 0.1, 0.2), strict=True)), dict.fromkeys(names, 1.0)
    errors = {"a": np.array([[3.0, 4.0], [0.0, np.nan]]), "b": np.array([[6.0, 8.0]])}
    there = charts.drawn_words({"ekf": one, "schmidt": other}, {"ekf": errors["a"], "schmidt": errors["b"]})
    back = charts.drawn_words({"ekf": other, "schmidt": one}, {"ekf": errors["b"], "schmidt": errors["a"]})
    assert "extended 3.0 m, Schmidt 1.0 m" in there["errors"][0]
    assert "extended 1.0 m, Schmidt 3.0 m" in back["errors"][0]
    assert "5 m (extended) and 10 m (Schmidt)" in there["map"][0]
    assert "extended filter 20 % of the time, Schmidt filter 100 %" in there["squares"][1]
    for name, (title, alt) in there.items():
        assert title != back[name][0] and alt != back[name][1]


@pytest.fixture
def report() -> Report:
    return open_report(study="schmidt-fast-vessel", kind="twin", flight="made-up")


@pytest.mark.parametrize("size", [3, SIZE])
def test_the_figures_are_drawn_of_few_flights_and_of_many(report: Report, size: int) -> None:
    spread = flights(size, **falling(1.0))
    charts.show_curve(report, spread)
    charts.show_flights(report, spread, {("ekf", "nees"): 7.9, ("schmidt", "nees"): 0.4})
    page = "".join(report.parts)
    assert f"{size} flights" in page and headline.curve_words(spread)[0] in page
    assert ("lowest to highest" in page) == (size == 3) and ("middle 90 %" in page) == (size == SIZE)
    assert "Schmidt 1.0 (100 % within)" in page


def test_tables_name_what_they_show() -> None:
    spread = flights()
    table = text.medians_table(spread)
    assert list(table["filter"]) == list(text.WORDS.values()) and set(text.COLUMNS) <= set(table)
    assert len(headline.honesty_table(spread)) == 1 + len(COVARIANCES)
    assert text.part_of({"a": "A", "b": "B"}, "a") == {"a": "A"}
    assert text.part_of({"a": "A", "b": "B"}, "a", kept=False) == {"b": "B"}


def test_limits_say_what_an_average_is_worth() -> None:
    assert any("worth 5 independent values" in one for one in text.limits_of(flights(), 1000))
    assert any("worth 50 independent" in one for one in text.limits_of(flights(schmidt__nees_worth=10.0), 9))
