"""Verdicts on published numbers, from what a run recorded to what the ledger says."""

from pathlib import Path

import pytest

from tests.runner.test_ledger import PUBLISHED, a_study, published, ran
from wildlab.evaluation.replication import SIZES
from wildlab.reporting import metrics
from wildlab.reporting.published import ONE_FLIGHT, quantity_kind
from wildlab.reporting.published_tables import CALCULATIONS, FITTED, PREDICTED, count_answers, group_of, tally
from wildlab.runner.catalogue import load_studies
from wildlab.runner.status import study_status

SPREAD = {"low": 7.0, "high": 12.0, "flights": 100, "centre_low": 9.6, "centre_high": 10.0}


@pytest.mark.parametrize(
    ("kind", "value", "spread", "answers"),
    [
        ("calculated", 8.06, {}, ("not close", "not judged")),
        ("calculated", 8.06, {"low": 8.04, "high": 8.08}, ("close", "not judged")),
        ("one flight", 9.8, SPREAD, ("close", "within")),
        ("one flight", 9.8, SPREAD | {"centre_high": 10.2}, ("cannot tell", "within")),
        ("one flight", 9.8, SPREAD | {"low": 8.1}, ("close", "outside")),
        ("one flight", 9.8, SPREAD | {"flights": 18}, ("close", "too few flights")),
        ("one flight", None, {}, ("not reproduced yet",) * 2),
    ],
)
def test_both_answers_on_a_number(tmp_path, kind, value, spread, answers):
    ran(tmp_path / "reports", metrics.metric("error", "kf/all", value, "m", **spread))
    folder = published(tmp_path / "published", f'kind = "{kind}"\n{PUBLISHED}')
    one = study_status(a_study(), tmp_path / "reports", folder)
    assert one.numbers[0].answers == answers


@pytest.mark.parametrize(
    ("here", "error", "n", "answers"),
    [
        (88.2, 0.08, 10_000, ("not close", "outside")),  # well inside of where single runs fall
        (96.5, 0.08, 10_000, ("close", "within")),
        (96.0, 0.08, 10_000, ("close", "outside")),
        (96.4, 0.08, None, ("not judged",) * 2),
        (96.4, None, 10_000, ("not judged",) * 2),
    ],
)
def test_a_mean_of_runs_is_held_against_a_mean(tmp_path, here, error, n, answers):
    row = '[[number]]\nstudy = "s"\nname = "success_rate"\nsubject = "a"\nvalue = 96.64\nunit = "%"\n'
    row += 'source = "H table 1"\nruns = 10000\nkind = "mean of runs"\n'
    entries = [metrics.metric("success_rate", "a", here, "%", n=n, low=70, high=100)]
    entries += [] if error is None else [metrics.metric("success_rate_se", "a", error, "%")]
    ran(tmp_path, *entries)
    one = study_status(a_study(), tmp_path, published(tmp_path / "published", row))
    assert one.numbers[0].answers == answers
    # One true mean in ten is outside by chance.
    assert tally(one.counted).chance == pytest.approx(0.0 if "not judged" in answers else 0.1)


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


def test_a_mean_whose_sign_nobody_defines_is_held_against_sizes(tmp_path):
    entries = [
        metrics.metric("mae", "kf", 9.4, "m", low=5, high=14),
        metrics.metric("mean_north", "kf", 0.1, "m", low=-5, high=5),
        metrics.metric("size_of_mean_north", "kf", 3.0, "m", low=0.2, high=5, flights=99, power=0.1),
    ]
    folder = published(tmp_path / "published", SIGNED)
    ran(tmp_path, *entries)
    one = study_status(a_study(), tmp_path, folder)
    number = one.numbers[1]
    assert (number.published, number.here, number.low) == (4.1, 3.0, 0.2)
    assert number.answers == ("not judged", "no power")
    ran(tmp_path, entries[0], metrics.metric("mean_north", "kf", -4.0, "m"))
    assert study_status(a_study(), tmp_path, folder).numbers[1].here == 4.0


@pytest.mark.parametrize(("value", "within"), [("5.30", 0.005), ("5.3", 0.05), ("21", 0.5)])
def test_a_calculation_is_granted_half_of_its_last_printed_digit(tmp_path, value, within):
    text = f'kind = "calculated"\n[[number]]\nstudy = "s"\nname = "error"\nsubject = "a"\nvalue = {value}\n'
    folder = published(tmp_path / "published", text + 'unit = "m"\nsource = "H 1"\n')
    for off, verdict in ((0.99, "close"), (-0.99, "close"), (1.1, "not close")):
        ran(tmp_path, metrics.metric("error", "a", float(value) + off * within, "m"))
        assert study_status(a_study(), tmp_path, folder).numbers[0].answers[0] == verdict, off


def test_a_number_is_counted_once_and_what_was_fitted_to_it_is_counted_apart(tmp_path):
    number = PUBLISHED.split("[[number]]")[1].replace("within = 0.15\n", "")
    plain, tuned, twice = (number.replace("kf/all", who) for who in ("plain", "tuned", "twice"))
    text = f'[[number]]{plain}[[number]]{tuned}fitted = "tuned to it"\n[[number]]{twice}again = true\n'
    folder = published(tmp_path / "published", text)
    ours = {"low": 8.5, "high": 9.5, "flights": 99, "centre_low": 8.9, "centre_high": 9.1}
    ran(tmp_path, *(metrics.metric("error", who, 9.0, "m", **ours) for who in ("plain", "tuned", "twice")))
    one = study_status(a_study(), tmp_path, folder)
    # A fit that misses is a finding: it has its verdict, and the mark.
    assert [n.answers for n in one.numbers] == [("close", "outside")] * 3
    assert [n.fitted for n in one.numbers] == ["", "tuned to it", ""]
    counts = count_answers([one])
    assert (counts[PREDICTED].judged, sum(one.all for one in counts.values())) == (1, 2)
    assert counts[FITTED].compatible["outside"] == counts[PREDICTED].compatible["outside"] == 1
    assert counts[PREDICTED].chance == pytest.approx(0.1)


def test_groups_add_up_to_all_numbers():
    """Of the real files, with nothing run."""
    statuses = [study_status(one, Path("nowhere")) for one in load_studies().values()]
    counts = count_answers(statuses)
    for found in (sum(one.all for one in counts.values()), sum(one.waiting for one in counts.values())):
        assert found == sum(len(one.counted) for one in statuses)
    assert {CALCULATIONS, FITTED, PREDICTED} < set(counts)
    for one in (n for status in statuses for n in status.numbers):
        predicted = one.kind == ONE_FLIGHT and quantity_kind(one.name) in SIZES and not one.fitted
        assert (group_of(one) == PREDICTED) == predicted
