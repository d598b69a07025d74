"""Published numbers beside ours, and the verdicts on claims, on made-up flights."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import share_interval
from wildlab.evaluation.shares import UNDECIDABLE, Check
from wildlab.reporting.published import judge
from wildlab.reporting.report import Report, open_report
from wildlab.studies import page

#: Published there: mean error 9.4, mean north -4.1, of a sign that is not defined.
PUBLISHED = "schmidt-fast-vessel"


@pytest.fixture
def report() -> Report:
    return open_report(study=PUBLISHED, kind="twin")


def recorded(report: Report, **columns: Any) -> pd.DataFrame:
    spread = pd.DataFrame({("ekf", name): np.asarray(values, float) for name, values in columns.items()})
    page.record_spread(report, lambda name: "m", spread, {})
    return spread


def test_a_number_that_needs_what_is_not_printed_is_not_judged(report):
    """Even where ours is the printed one: as printed and turned by a right angle it would say two things."""
    row = report.printed("mae", "ekf")
    assert row is not None
    recorded(report, mae=np.full(101, row["value"]))
    compared = judge(row, report.recorded)
    assert compared is not None and compared.words == "close, within"
    row["unjudged"] = "nobody says which way"
    compared = judge(row, report.recorded)
    assert compared is not None and compared.words == "not judged"


def test_what_is_recorded_is_what_is_judged(report):
    recorded(report, mae=np.linspace(8, 12, 101), mean_north=np.linspace(-5, 5, 101))
    entries = report.recorded
    assert entries["mean_north", "ekf"]["value"] == pytest.approx(0)
    size = entries["size_of_mean_north", "ekf"]
    assert (size["value"], size["low"], size["high"]) == pytest.approx((2.5, 0.25, 4.75), abs=0.06)


def claims_of(*ids: str, **more: Any) -> list[dict[str, Any]]:
    return [{"id": i, "text": f"Claim {i}.", "source": "H 1", **more} for i in ids]


def test_claims_are_decided_by_the_interval_of_their_share(report):
    claims = claims_of("always", "never", "half")
    flights = np.arange(50)
    true = {"always": flights >= 0, "never": flights < 0, "half": flights < 30}
    checks = {name: Check(true=one) for name, one in true.items()}
    table = page.decide_claims(report, claims, checks)
    assert table["verdict"].tolist() == ["holds", "does not hold", "undecided"]
    assert table["share"].tolist()[2] == "30 of 50 (46 to 72 %)"
    assert [c["fraction"] for c in report.claims] == [1.0, 0.0, 0.6]
    assert (report.claims[2]["low"], report.claims[2]["high"]) == share_interval(30, 50)[1:]


@pytest.mark.parametrize(("flights", "reason"), [(3, True), (50, False)])
def test_flights_that_agree_and_decide_nothing_are_said_to_be_few(report, flights, reason):
    (row,) = page.decide_claims(report, claims_of("a"), {"a": Check(true=np.ones(flights, bool))}).to_dict(
        "records"
    )
    assert (row["verdict"] == "undecided") == reason == row["share"].endswith("too few to decide")


@pytest.mark.parametrize(("kind", "claimed"), [("larger", "> 0"), ("smaller", "< 0"), ("measured", "")])
def test_a_difference_says_which_sign_is_claimed(report, kind, claimed):
    first, second = np.array([1.0, 2.0, 4.0]), np.array([2.0, 1.5, 1.0])
    checks = {
        "larger": Check(true=first > second, first=first, second=second),
        "smaller": Check(true=first < second, first=first, second=second),
        "measured": Check(measured=first / second, first=first, second=second),
    }
    claims = claims_of("a", threshold=1.0)
    (row,) = page.decide_claims(report, claims, {"a": checks[kind]}).to_dict("records")
    assert row["difference"].partition("; claimed ")[2] == claimed


def test_a_threshold_is_shown_at_half_and_at_twice(report):
    claims = claims_of("a", threshold=2, reason="as far as one sees")
    measured = np.r_[np.full(50, 1.5), np.full(50, 3.0)]
    (row,) = page.decide_claims(report, claims, {"a": Check(measured=measured)}).to_dict("records")
    assert row["verdict"] == "undecided"
    assert row["threshold"] == "at 1 does not hold, at 4 holds; taken: 2 (as far as one sees)"
    assert (report.claims[0]["half"], report.claims[0]["twice"]) == ("does not hold", "holds")


def test_a_threshold_that_the_measure_cannot_reach_is_left_out(report):
    claims = claims_of("a", threshold=0.7)
    f1 = np.full(50, 0.9)

    def row(check: Check) -> str:
        (one,) = page.decide_claims(report, claims, {"a": check}).to_dict("records")
        return str(one["threshold"])

    assert row(Check(measured=f1, above=True)) == "at 0.35 holds, at 1.4 does not hold; taken: 0.7"
    assert row(Check(measured=f1, above=True, reach=(0, 1))) == "at 0.35 holds; taken: 0.7"
    assert (report.claims[-1]["half"], report.claims[-1].get("twice")) == ("holds", None)
    # A ratio below 1.4 would hold of what does not decrease.
    assert row(Check(measured=f1, reach=(0, 1))) == "at 0.35 does not hold; taken: 0.7"
    assert row(Check(measured=f1, reach=(0.6, 1))) == "0.7"


def test_a_premise_and_a_difference_are_said(report):
    claims = claims_of("a", premise="Errors grow in turns", own=True)
    met, true = np.arange(100) < 80, np.arange(100) < 40
    first, second = np.arange(100.0) % 7, np.zeros(100)
    check = Check(true=true, premise=met, first=first, second=second, unit="m")
    (row,) = page.decide_claims(report, claims, {"a": check}).to_dict("records")
    assert row["share"].startswith("40 of 80 (") and row["share"].endswith("of 100 flights in all")
    assert row["premise"] == "Errors grow in turns: 80 of 100 flights" and "Ours" in row["claim"]
    assert row["difference"].startswith(f"{first.mean():.2f} (") and row["difference"].endswith("m")
    check = Check(true=true, premise=~met)
    (row,) = page.decide_claims(report, claims, {"a": check}).to_dict("records")
    assert (row["verdict"], row["share"]) == ("premise not met", "20 of 100 flights meet the premise")


def test_a_claim_without_a_check_is_named(report):
    claims = claims_of("a")
    with pytest.raises(WildlabError, match="claim 'a'"):
        page.decide_claims(report, claims, {})


def test_shares_of_flights_are_pooled_by_their_images():
    spread = pd.DataFrame({("x", "images"): [10.0, 30.0, 5.0], ("x", "rate"): [1.0, 0.5, np.nan]})
    share, images = page.pooled_share(spread, "x", "rate")
    assert images == 40 and share == share_interval(25, 40)
    alarms = page.pooled_share(spread * [1, 3], "x", "rate")[0]
    assert alarms.estimate == pytest.approx(75 / 40) and alarms.high == 1.0
    assert page.pooled_share(spread * [0, 1], "x", "rate")[1] == 0


def test_a_claim_that_needs_what_no_flight_has_cannot_be_decided(report):
    claims = claims_of("a", needs="recorded paths")
    (row,) = page.decide_claims(report, claims, {}).to_dict("records")
    assert (row["verdict"], row["share"]) == (UNDECIDABLE, "needs recorded paths")
    assert report.claims[0]["verdict"] == UNDECIDABLE
