"""Verdicts on published numbers, from what a run recorded to what the ledger says."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.runner.test_ledger import PUBLISHED, a_study, published, ran
from wildlab.reporting import metrics
from wildlab.reporting.ledger import ledger_page
from wildlab.reporting.published import load_published
from wildlab.runner.catalogue import load_studies
from wildlab.runner.record.status import study_status


@pytest.mark.parametrize(
    ("kind", "value", "spread", "verdict"),
    [
        ("calculated", 8.05, {}, "agrees"),
        ("calculated", 8.06, {}, "differs"),
        # The flights' spread says nothing of a calculation, and rounding nothing of a flight.
        ("calculated", 9.9, {"low": 7.0, "high": 12.0}, "differs"),
        ("one flight", 9.8, {"low": 9.7, "high": 9.9}, "agrees"),
        ("one flight", 9.9, {"low": 7.0, "high": 12.0}, "possible"),
        ("one flight", 9.9, {"low": 4.0, "high": 12.1}, "too vague to tell"),
        ("one flight", 9.9, {"low": 8.0, "high": 12.0}, "differs"),
        ("one flight", None, {}, "not reproduced yet"),
    ],
)
def test_when_a_number_agrees(
    tmp_path: Path, kind: str, value: float | None, spread: dict[str, float], verdict: str
) -> None:
    ran(tmp_path / "reports", metrics.metric("error", "kf/all", value, "m", **spread))
    folder = published(tmp_path / "published", f'kind = "{kind}"\n{PUBLISHED}')
    one = study_status(a_study(), tmp_path / "reports", folder)
    assert one.numbers[0].verdict == verdict


@pytest.mark.parametrize(
    ("here", "error", "n", "verdict"),
    [
        (88.2, 0.08, 10_000, "differs"),  # well inside of where single runs fall
        (96.4, 0.08, 10_000, "agrees"),
        (96.4, 0.08, None, "not judged"),
        (96.4, None, 10_000, "not judged"),
    ],
)
def test_a_mean_of_runs_is_held_against_a_mean(
    tmp_path: Path, here: float, error: float | None, n: int | None, verdict: str
) -> None:
    row = '[[number]]\nstudy = "s"\nname = "success_rate"\nsubject = "a"\nvalue = 96.64\nunit = "%"\n'
    row += 'source = "H table 1"\nwithin = 0.1\nruns = 10000\nkind = "mean of runs"\n'
    entries = [metrics.metric("success_rate", "a", here, "%", n=n, low=70, high=100)]
    entries += [] if error is None else [metrics.metric("success_rate_se", "a", error, "%")]
    ran(tmp_path, *entries)
    one = study_status(a_study(), tmp_path, published(tmp_path / "published", row))
    assert one.numbers[0].verdict == verdict


SIGNED = """signs = "undefined"
[[number]]
study = "s"
name = "mae"
subject = "kf"
value = 9.4
unit = "m"
source = "H table 1"
[[number]]
study = "s"
name = "mean_north"
subject = "kf"
value = -4.1
unit = "m"
source = "H table 1"
"""


def test_a_mean_whose_sign_nobody_defines_is_held_against_sizes(tmp_path: Path) -> None:
    entries = [
        metrics.metric("mae", "kf", 9.4, "m", low=5, high=14),
        metrics.metric("mean_north", "kf", 0.1, "m", low=-5, high=5, below=0.1),
        metrics.metric("size_of_mean_north", "kf", 3.0, "m", low=0.2, high=5, below=0.8),
    ]
    folder = published(tmp_path / "published", SIGNED)
    ran(tmp_path, *entries)
    one = study_status(a_study(), tmp_path, folder)
    number = one.numbers[1]
    assert (number.published, number.here, number.low, number.below) == (4.1, 3.0, 0.2, 0.8)
    assert number.verdict == "agrees" and "mean north, by size" in ledger_page([one])
    ran(tmp_path, entries[0], metrics.metric("mean_north", "kf", -4.0, "m"))
    assert study_status(a_study(), tmp_path, folder).numbers[1].here == 4.0


def test_a_mean_whose_deviation_is_printed_is_held_against_that(tmp_path: Path) -> None:
    """Off by half the deviation: too far for it, and near beside the size of the errors."""
    extra = '[[number]]\nstudy = "s"\nname = "{}"\nsubject = "obs"\nvalue = {}\nunit = "m"\nsource = "H 1"\n'
    numbers = [("mean_north", 38.0), ("mae", 41.0), ("sd_east", 90.0)]
    for sd, verdict in ((None, "agrees"), (5.0, "differs"), (50.0, "agrees")):
        more = numbers if sd is None else [*numbers, ("sd_north", sd)]
        text = "\n".join(extra.format(*one) for one in more)
        ran(tmp_path, metrics.metric("mean_north", "obs", 35.5, "m", low=34, high=37))
        one = study_status(a_study(), tmp_path, published(tmp_path / "published", text))
        assert one.numbers[0].verdict == verdict, sd


@pytest.mark.parametrize(("value", "within"), [("5.30", 0.005), ("5.3", 0.05), ("21", 0.5)])
def test_a_calculation_is_granted_half_of_its_last_printed_digit(
    tmp_path: Path, value: str, within: float
) -> None:
    text = f'kind = "calculated"\n[[number]]\nstudy = "s"\nname = "error"\nsubject = "a"\nvalue = {value}\n'
    folder = published(tmp_path / "published", text + 'unit = "m"\nsource = "H 1"\n')
    for off, verdict in ((0.99, "agrees"), (-0.99, "agrees"), (1.1, "differs")):
        ran(tmp_path, metrics.metric("error", "a", float(value) + off * within, "m"))
        assert study_status(a_study(), tmp_path, folder).numbers[0].verdict == verdict, off


def test_a_printed_number_is_counted_once_and_what_was_fitted_to_it_not_at_all(tmp_path: Path) -> None:
    number = PUBLISHED.split("[[number]]")[1].replace("within = 0.15\n", "")
    plain, tuned = (number.replace("kf/all", who) for who in ("plain", "tuned"))
    text = f'[[number]]{plain}[[number]]{tuned}again = true\nfitted = "tuned to it"\n'
    folder = published(tmp_path / "published", text)
    ran(tmp_path, *(metrics.metric("error", who, 7.9, "m", low=7, high=8) for who in ("plain", "tuned")))
    one = study_status(a_study(), tmp_path, folder)
    assert [n.verdict for n in one.numbers] == ["agrees", "not judged"] and one.count("not judged") == 0
    whole = ledger_page([one])
    assert "<b>1 / 1</b><span>published numbers agree</span>" in whole
    assert "tuned to it; counted once" in whole
    assert "1 published number: 1 agree; 1 beside other tunings, not counted again" in whole


def test_each_number_that_is_not_counted_is_counted_elsewhere() -> None:
    for name in load_studies():
        rows = load_published(name)
        again = rows["again"].astype(bool)
        counted = {tuple(row) for row in rows[~again][["source", "name", "value"]].to_numpy()}
        for row in rows[again][["source", "name", "value"]].to_numpy():
            assert tuple(row) in counted
