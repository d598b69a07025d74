"""The page on gating on opposed numbers: text, titles and alt texts turn with them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from wildlab.reporting.published import load_claims
from wildlab.reporting.report import open_report
from wildlab.studies.gating import charts, tables
from wildlab.studies.gating import text as words
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Gated, Outcome
from wildlab.studies.gating.readings import DEFAULT, READINGS, STRESS, subject
from wildlab.studies.gating.variations import standard_error

PUBLISHED = {"position": 96.64, "pixels": 96.83, "angles": 95.99}
WITHIN = dict.fromkeys(FORMS, 1.5)
RUNS = 400


def outcome(
    *means: float,
    sd: float = 1.0,
    mistakes: tuple[float, float, float] = (1.0, 2.0, 3.0),
    same: float = 0.0,
    mostly_wrong: float = 0.0,
) -> Outcome:
    """Runs whose rates have these means; every form errs alike in a run, but for a little of its own."""
    rng = np.random.default_rng(1)
    rates = np.array(means)[:, None] + sd * (rng.standard_normal(RUNS) + 0.1 * rng.standard_normal((4, RUNS)))
    rates += np.array(means)[:, None] - rates.mean(axis=1, keepdims=True)
    low = np.arange(RUNS) < mostly_wrong * RUNS
    rates = np.where(low, 30.0, rates)
    return Outcome(rates, np.tile(np.array(mistakes)[:, None], RUNS), np.arange(RUNS) < same * RUNS)


def found(own: Outcome, stress: Outcome | None = None) -> dict[str, Outcome]:
    return {"own": own, "assigned": stress or outcome(88, 82, 71, 79, mostly_wrong=0.2), "angles": own}


LIKE_PRINT = found(outcome(96.64, 96.83, 95.99, 97.5))
OPPOSED = found(outcome(70, 60, 80, 55), outcome(99, 99, 99, 99))
LEVEL = found(outcome(90, 90, 90, 90))


def title_of(shown: charts.Shown) -> str:
    fig = shown[0]
    return fig.axes[0].get_title(loc="left") or str(fig.get_suptitle())


def single(
    off: float, *, wrong: tuple[int, ...] = (), angles_wrong: tuple[int, ...] = (), apart: bool = False
) -> Gated:
    """One run of ten images whose track is that far off; ``apart``: angles have a track of their own."""
    right = np.ones((4, 1, 10), bool)
    right[:2, 0, list(wrong)] = False
    right[2, 0, list(angles_wrong)] = False
    targets = np.array([[[0.0, 0.0], [10.0, 15.0]]])
    estimate = np.zeros((4, 1, 10, 2)) + np.array([off, 0.0])
    if apart:
        estimate[2] += 1.0
    scatter = off * np.tile([-1.0, 1.0], 5)[:, None, None] * np.ones((1, 10, 2, 2))
    nis = np.ones((4, 1, 10, 2)) * [0.5 * off, 5 * off]
    measured = targets[:, None] + scatter
    return Gated(right, np.ones((1, 10), bool), nis, estimate, measured, measured, targets)


def varied(change: float, se: float, mean: float = 90.0) -> pd.DataFrame:
    rows: dict[str, list[object]] = {"variation": ["as chosen", "lower", "higher"]}
    for form in FORMS:
        by = change if form == "angles" else 0.0
        rows |= {form: [mean, mean, mean + by], f"{form}_change": [0.0, 0.0, by]}
        rows |= {f"{form}_se": [0.0, se, se], f"{form}_mean_se": [se, se, se]}
    return pd.DataFrame(rows)


def test_the_summary_turns_with_the_rates() -> None:
    like, opposed, level = (words.summary_sentences(one, PUBLISHED) for one in (LIKE_PRINT, OPPOSED, LEVEL))
    assert "picked 96 to 97 times in 100" in like[0] and "picked 60 to 80 times in 100" in opposed[0]
    assert "picked 90 times in 100" in level[0] and all(
        "published were 96 to 97" in one[0] for one in (like, level)
    )
    assert like[1].startswith(
        "It is picked most often by pixels, least by azimuth and elevation, 0.8 points apart"
    )
    assert opposed[1].startswith(
        "It is picked most often by azimuth and elevation, least by pixels, 20.0 points"
    )
    assert level[1].startswith("No way of measuring the distance is better than another by more than chance")
    assert all(
        one[1].endswith("in the print it is pixels before azimuth and elevation by 0.8.")
        for one in (like, level)
    )
    assert "20 % of the overflights have the wrong dot" in like[2]
    assert "99 in 100 are right, and 0 % of the overflights" in opposed[2]
    other = words.summary_sentences(LIKE_PRINT, {"position": 90.0, "pixels": 80.0, "angles": 99.0})
    assert other[1].endswith("in the print it is azimuth and elevation before pixels by 19.0.")


def test_tiles_say_what_is_gained_and_how_far_the_print_is() -> None:
    like, opposed = (words.tiles(one[DEFAULT].rate, PUBLISHED) for one in (LIKE_PRINT, OPPOSED))
    assert [value for value, _ in like] == ["96.6 %", "96.8 %", "96.0 %", "97.5 %"]
    assert "difference +0.0" in like[0][1] and "difference −26.6" in opposed[0][1]
    assert "+0.67 ±" in like[3][1] and like[3][1].endswith("beside pixels alone")
    assert "−25.00 ±" in opposed[3][1] and opposed[3][1].endswith("beside azimuth and elevation alone")


def test_a_mean_is_compared_by_both_standard_errors() -> None:
    rates = LIKE_PRINT[DEFAULT].rate
    table = tables.rates_table(rates, PUBLISHED | {"angles": 95.99 + 0.3}).set_index("form")
    row = table.loc[words.NAMES["angles"]]
    sd = rates[2].std(ddof=1)
    assert row["se"] == pytest.approx(sd / np.sqrt(RUNS)) == pytest.approx(standard_error(rates[2]))
    assert row["both_se"] == pytest.approx(sd * np.sqrt(1 / RUNS + 1 / tables.PRINTED_RUNS))
    assert row["difference"] == pytest.approx(-0.3)
    assert table["beyond"].tolist() == ["no", "no", "yes", ""]
    # A quarter of that standard error, or twice of it, and the verdict turns.
    near = tables.rates_table(rates, PUBLISHED | {"angles": 95.99 + 1.9 * row["both_se"]})
    far = tables.rates_table(rates, PUBLISHED | {"angles": 95.99 + 2.1 * row["both_se"]})
    assert (near["beyond"][2], far["beyond"][2]) == ("no", "yes")
    assert words.beside_print_words(near).startswith("No rate differs from the published one")
    assert (
        "1 of 3 rates differ from the published ones: azimuth and elevation (−"
        in words.beside_print_words(far)
    )
    every = words.beside_print_words(tables.rates_table(OPPOSED[DEFAULT].rate, PUBLISHED))
    assert "3 of 3 rates differ" in every and "position (−26.64)" in every


def test_rates_figure_turns() -> None:
    like, opposed, level = (charts.rates_shown(one, PUBLISHED) for one in (LIKE_PRINT, OPPOSED, LEVEL))
    assert title_of(like) == "Most often right: by pixels, 96.8 %\nleast: by azimuth and elevation, 96.0 %"
    assert title_of(opposed) == "Most often right: by azimuth and elevation, 80.0 %\nleast: by pixels, 60.0 %"
    assert title_of(level) == "No form is better by more than chance:\n90.0 % are right"
    assert f"{READINGS[STRESS].short} 62.8 to 76.4 %" in like[2]
    assert f"{READINGS[DEFAULT].short} 60.0 to 80.0 %" in opposed[2]
    hollow = [line for line in like[0].axes[0].lines if line.get_markerfacecolor() == "white"]
    assert [list(np.asarray(line.get_ydata(), float)) for line in hollow] == [list(PUBLISHED.values())]


def test_spread_figure_turns() -> None:
    like, opposed = charts.spread_shown(LIKE_PRINT), charts.spread_shown(OPPOSED)
    assert title_of(like).endswith("0.0 % of the runs, 20.0 % in the stress test")
    assert title_of(opposed).endswith("0.0 % of the runs, 0.0 % in the stress test")
    assert "20.0, 20.0, 20.0 %" in like[2] and "20.0, 20.0, 20.0 %" not in opposed[2]


def test_both_gates_together_are_better_worse_or_neither() -> None:
    better, worse, level = (words.together_words(one[DEFAULT]) for one in (LIKE_PRINT, OPPOSED, LEVEL))
    assert "97.50 % are right: more than by pixels alone (+0.67 ±" in better[1]
    assert "55.00 % are right: fewer than by azimuth and elevation alone (−25.00 ±" in worse[1]
    assert "as many as by" in level[1] and "as far as chance allows" in level[1]
    assert "In 97.00 % of the images both pick the same" in better[2]
    assert "96.91 % of those are right" in better[2] and "right in 97.00 % at best" in better[2]
    few = words.together_words(outcome(96, 96, 96, 96, mistakes=(0.0, 0.0, 0.0), same=1.0))
    assert (
        few[0].startswith("Of all images, 0.00 % are wrong by pixels alone")
        and "In 0 of the 0 runs" in few[0]
    )
    many = words.together_words(outcome(96, 96, 96, 96, mistakes=(50.0, 50.0, 0.0), same=0.25))
    assert "In 300 of the 400 runs" in many[0] and "In 0.00 % of the images" in many[2]


def test_one_run_is_described_by_its_own_numbers() -> None:
    quiet = single(1.0, wrong=(2, 3), angles_wrong=(3,))
    rough = single(4.0, angles_wrong=(1, 2), apart=True)
    assert title_of(charts.right_wrong_shown(quiet)).replace("\n", " ") == (
        "Images wrong by pixels alone: 1, by angles alone: 0, by both: 1"
    )
    assert "80.0, 80.0, 90.0 % were" in charts.right_wrong_shown(quiet)[2]
    assert "alone: 0, by angles alone: 2, by both: 0" in charts.right_wrong_shown(rough)[2]
    assert title_of(charts.estimates_shown(quiet)).endswith("1.0 m by position and pixels and angles")
    assert title_of(charts.estimates_shown(rough)).endswith("4.0 m by position and pixels, 5.1 m by angles")
    assert "1 different track of" in charts.estimates_shown(quiet)[3]
    assert "2 different tracks of" in charts.estimates_shown(rough)[3]
    assert title_of(charts.detections_shown(quiet)).endswith("by 1 m north, 1 m east")
    assert "by 4 m north, 4 m east" in charts.detections_shown(rough)[2]
    for one, said in (
        (quiet, "0.5 of the main object, 5 of the second"),
        (rough, "2 of the main object, 20 of the"),
    ):
        shown = charts.nis_shown(one, "angles", (0.05, 7.4), "6.18b")
        assert said in title_of(shown) and said.split(" of ")[0] in shown[2]


def test_variations_are_said_to_move_what_they_move() -> None:
    assert words.varied_title(varied(-9.0, 0.5), DEFAULT).endswith("most by higher, angles −9.0")
    assert words.varied_title(varied(+3.0, 0.5), STRESS).endswith("most by higher, angles +3.0")
    assert words.varied_title(varied(-9.0, 5.0), DEFAULT).endswith(
        "no change moves a rate by more than chance"
    )
    above = words.varied_words(varied(-9.0, 0.5), PUBLISHED)
    assert "81.0 to 90.0 % (published above all of them)" in above
    among = words.varied_words(varied(+9.0, 0.5), PUBLISHED)
    assert "azimuth and elevation 90.0 to 99.0 % (published among them)" in among
    below = words.varied_words(varied(0.0, 0.5, mean=99.0), PUBLISHED)
    assert below.count("(published below all of them)") == 3
    shown = charts.varied_shown(varied(-9.0, 0.5), PUBLISHED, DEFAULT)
    assert title_of(shown).startswith(f"Updated with {READINGS[DEFAULT].short}") and "angles −9.0" in shown[2]


def test_changes_stand_in_brackets() -> None:
    table = tables.varied_table(varied(-1.25, 0.3))
    assert table.iloc[0].tolist() == ["as chosen", "90.0", "90.0", "90.0"]
    assert table.iloc[2].tolist() == ["higher", "90.0 (+0.0 ± 0.6)", "90.0 (+0.0 ± 0.6)", "88.8 (−1.2 ± 0.6)"]


def test_claims_are_decided_by_the_default_reading() -> None:
    claims = load_claims("gating")

    def verdicts(of: dict[str, Outcome]) -> list[tuple[str, str]]:
        table = tables.claims_table(of, claims)
        assert table["id"].tolist() == [claim["id"] for claim in claims]
        assert set(tables.claim_columns()) <= set(table)
        return list(zip(table["verdict"], table[STRESS], strict=True))

    assert verdicts(LIKE_PRINT) == [("holds", "does not hold"), ("holds", "holds"), ("holds", "holds")]
    turned = found(outcome(70, 60, 80, 55, same=1.0), outcome(96.64, 96.83, 95.99, 97.5))
    assert verdicts(turned) == [
        ("does not hold", "holds"),
        ("does not hold", "holds"),
        ("does not hold", "holds"),
    ]
    assert verdicts(LEVEL)[1][0] == "cannot be decided"
    none = found(outcome(90, 90, 90, 90, mistakes=(0.0, 0.0, 0.0)))
    table = tables.claims_table(none, claims).set_index("id")
    assert table.loc["mistakes-on-different-images", ["verdict", "runs"]].tolist() == ["cannot be decided", 0]


def test_every_mean_is_recorded_with_its_standard_error() -> None:
    report = open_report(study="gating", kind="twin", flight="large-ship")
    tables.record_rates(report, LIKE_PRINT)
    metrics = {(m["name"], m["subject"]): m for m in report._metrics}
    for name, one in LIKE_PRINT.items():
        for gate, runs in zip(GATES, one.rate, strict=True):
            of = subject(name, gate)
            mean, se = metrics["success_rate", of], metrics["success_rate_se", of]
            assert (mean["value"], se["value"]) == (
                pytest.approx(runs.mean()),
                pytest.approx(standard_error(runs)),
            )
            # The spread of single runs is not that of the mean, and is not recorded as if it were.
            assert mean["low"] is None and mean["n"] == RUNS
    assert {form: metrics["success_rate", form]["published"] for form in FORMS} == PUBLISHED
    assert metrics["success_rate", "pixels-and-angles"]["published"] is None
    assert metrics["success_rate", "angles/updated-with-assigned"]["published"] is None
    assert metrics["runs_mostly_wrong", "angles/updated-with-assigned"]["value"] == pytest.approx(20.0)


def test_every_reading_has_something_that_speaks_for_it() -> None:
    assert len(words.readings_points()) == len(READINGS) == 3
    for said, one in zip(words.readings_points(), READINGS.values(), strict=True):
        assert one.short in said and one.speaks_for and one.speaks_against and one.role in said
    rates = tables.readings_rates(LIKE_PRINT, PUBLISHED)
    assert rates["track updated with"].tolist() == ["published", *(one.short for one in READINGS.values())]
    assert rates["position"][0] == "96.64" and rates["position"][2].startswith("76.39 ±")


def test_headings_follow_the_number_of_runs() -> None:
    assert tables.rates_columns(10_000)["range"] == "90 % of runs"
    assert tables.rates_columns(18)["range"] == "lowest to highest of 18 runs"
