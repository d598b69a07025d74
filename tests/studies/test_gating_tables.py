"""Tables, verdicts and metrics of the page on gating, on opposed numbers."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.reporting.published import load_claims
from wildlab.reporting.report import open_report
from wildlab.studies.gating import tables
from wildlab.studies.gating import text as words
from wildlab.studies.gating.monte_carlo import FORMS, GATES, Outcome
from wildlab.studies.gating.readings import DEFAULT, STRESS, subject
from wildlab.studies.gating.variations import standard_error

PUBLISHED = {"position": 96.64, "pixels": 96.83, "angles": 95.99}
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


def test_a_mean_is_compared_by_both_standard_errors():
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


def test_claims_are_decided_by_the_default_reading():
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


def test_every_mean_is_recorded_with_its_standard_error():
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
