"""Published numbers, studies, where each stands, and the ledger that shows it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.reporting import metrics
from wildlab.reporting import notebook_pages as html
from wildlab.reporting.front_page import ledger_page
from wildlab.reporting.published import load_claims, load_published
from wildlab.reporting.published_tables import tally
from wildlab.runner.catalogue import StudyEntry, load_studies
from wildlab.runner.status import as_plain, study_status

PUBLISHED = """
[[number]]
study = "s"
name = "error"
subject = "kf/all"
value = 7.90
unit = "m"
source = "H table 1"
within = 0.15
[[number]]
study = "s"
name = "error"
subject = "observer/all"
value = 5
unit = "m"
source = "H table 1"
[[claim]]
study = "s"
id = "c1"
text = "The <b>KF</b> is better."
source = "H 1"
"""


def a_study(**more: Any) -> StudyEntry:
    return StudyEntry(**({"name": "s", "title": "A study?", "notebook": "s.ipynb"} | more))


def published(folder: Path, text: str = PUBLISHED) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "s.toml").write_text(text)
    return folder


def ran(reports: Path, *entries: dict[str, Any], study: str = "s", state: str = "done", **more: Any) -> Path:
    """The folder a run leaves."""
    folder = reports / study
    folder.mkdir(parents=True, exist_ok=True)
    content = {"study": study, "flight": "f", "kind": "twin", "seed": 1, "seeds": 20, "claims": []} | more
    write_json(folder / "metrics.json", metrics.document(**(content | {"metrics": entries})))
    (folder / "report.html").write_text("report")
    status = {
        "study": study,
        "state": state,
        "reason": "It <b>broke</b>." * (state == "failed"),
        "seconds": 1.5,
    }
    (folder / "status.json").write_text(json.dumps(status))
    return folder


def test_the_shipped_files_are_in_order():
    studies = load_studies()
    assert "consistency-bounds" in studies
    for name in studies:
        load_published(name)
        load_claims(name)


def test_published_numbers_keep_the_digits_they_are_printed_with(tmp_path):
    frame = load_published("s", published(tmp_path))
    assert frame["value"].tolist() == [7.9, 5.0] and frame["digits"].tolist() == [2, 0]
    assert frame["rounding"].tolist() == [0.15, 0.5]
    assert len(load_published("other", tmp_path)) == 0
    assert load_claims("s", tmp_path)[0]["id"] == "c1"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('unit = "m"\n', "", "unit"),
        ("within = 0.15", "tolerance = 0.15", "tolerance"),
        ("value = 7.90", "value = nan", "finite"),
        ('subject = "kf/all"', 'subject = "kf all"', "blank"),
        ('subject = "observer/all"', 'subject = "kf/all"', "twice"),
    ],
)
def test_published_files_that_are_wrong_are_named(tmp_path, old, new, sentence):
    folder = published(tmp_path, PUBLISHED.replace(old, new, 1))
    with pytest.raises(WildlabError, match=sentence):
        load_published("s", folder)
        load_claims("s", folder)


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ('[Bad]\ntitle = "a"\nnotebook = "a.ipynb"', "Bad"),
        ('[a]\ntitle = "a"\nnotebook = "a.ipynb"\nparameters = {seed = 2}', "'seed'"),
        ("[a", "read"),
    ],
)
def test_studies_that_are_wrong_are_named(tmp_path, entry, sentence):
    path = tmp_path / "studies.toml"
    path.write_text(entry)
    with pytest.raises(WildlabError, match=sentence):
        load_studies(path)


def tiles(page: str) -> list[tuple[str, list[str]]]:
    """The numbers at the top: each with those in the words below it."""
    found = re.findall(r"<li><b>([^<]*)</b><span>([^<]*)</span></li>", page)
    return [(value, re.findall(r"\d+", words)) for value, words in found]


def test_only_what_holds_counts_as_holding(tmp_path):
    """What is undecided is not held, what failed is not done, and ours are not the theses'."""
    verdicts = ["holds", "holds on most flights", "undecided", "premise not met", "does not hold", "holds"]
    text, claims = "", []
    for i, verdict in enumerate(verdicts):
        text += f'[[claim]]\nstudy = "s"\nid = "c{i}"\ntext = "T{i}."\nsource = "H 1"\n'
        text += "own = true\n" * (i == 5)
        share = {} if verdict == "premise not met" else {"fraction": 0.5, "low": 0.4, "high": 0.6}
        claims.append(metrics.claim(f"c{i}", "x", verdict, seeds=200, met=50 + 150 * bool(share), **share))
    # One that is decided, but by no share of flights.
    text += '[[claim]]\nstudy = "s"\nid = "c6"\ntext = "T6."\nsource = "H 1"\nown = true\n'
    claims.append(metrics.claim("c6", "x", "holds"))
    ran(tmp_path, claims=claims)
    ran(tmp_path, study="t", state="failed")
    folder = published(tmp_path / "published", text)
    statuses = [study_status(a_study(name=name), tmp_path, folder) for name in ("s", "t")]
    whole = ledger_page(statuses)
    assert tiles(whole)[0] == ("1 / 2", ["1"])
    # Of the theses: one holds, one more on most flights, one has no verdict.
    assert ("1 / 4", ["1", "1"]) in tiles(whole)
    assert re.search(r"<p>5 claims\b.* 4 of .* 1 of ", whole)
    assert "50\u00a0% (40 to 60) of 200 runs" in whole and "50 of 200 runs" in whole


def test_without_tolerance_or_spread_no_difference_is_claimed(tmp_path):
    ran(tmp_path / "reports", metrics.metric("error", "observer/all", 5.0, "m"))
    one = study_status(a_study(), tmp_path / "reports", published(tmp_path / "published"))
    assert one.numbers[1].answers == ("cannot tell", "too few flights")
    ran(tmp_path / "reports", metrics.metric("error", "observer/all", 50.0, "m"))
    one = study_status(a_study(), tmp_path / "reports", published(tmp_path / "published"))
    assert one.numbers[1].answers == ("cannot tell", "too few flights")
    folder = published(tmp_path / "calculated", f'kind = "calculated"\n{PUBLISHED}')
    # What rounding leaves open needs no statement.
    assert study_status(a_study(), tmp_path / "reports", folder).numbers[1].answers == (
        "not close",
        "not judged",
    )


@pytest.mark.parametrize("damage", ["no status", "no metrics", "broken status", "status is a list"])
def test_a_run_that_was_broken_off_counts_as_to_be_done_again(tmp_path, damage):
    folder = ran(tmp_path, metrics.metric("error", "kf/all", 7.9, "m"))
    if damage == "no metrics":
        (folder / "metrics.json").unlink()
    elif damage == "no status":
        (folder / "status.json").unlink()
    else:
        (folder / "status.json").write_text("[1]" if "list" in damage else '{"state"')
    one = study_status(a_study(), tmp_path)
    assert one.state == "broken off" and not one.has_report


def test_ledger_of_every_state_opens_offline(tmp_path, faults):
    first = PUBLISHED.split("[[number]]")[1]
    many = PUBLISHED + "".join(f"[[number]]{first}".replace("kf/all", f"kf/{i}") for i in range(15))
    folder = published(tmp_path / "published", many)
    entries = [metrics.metric("error", f"kf/{i}", 7.9 + i, "m", low=5, high=9 + i) for i in range(15)]
    ran(tmp_path, *entries, claims=[metrics.claim("c1", "x", "does not hold", fraction=0.25, seeds=20)])
    failed = ran(tmp_path, study="failed", state="failed")
    statuses = [
        study_status(a_study(twin="<i>twin"), tmp_path, folder),
        study_status(a_study(name="failed"), tmp_path, folder),
        study_status(
            a_study(name="never", dataset="d", recipe="r.toml", title="<script>alert(1)</script>"), tmp_path
        ),
    ]
    whole = ledger_page(statuses)
    assert "<script" not in whole and "It &lt;b&gt;broke" in whole and failed.is_dir()
    assert "25\u00a0%" in whole and "5.000 to 23.000" in whole
    html.examine(whole, "ledger", alone=False)
    path = tmp_path / "index.html"
    path.write_text(whole, encoding="utf-8")
    assert faults(path) == []


def first_look(reports: Path, **more: Any) -> None:
    """A first look as a run leaves it, whose number would count as reproduced and whose claim as holding."""
    claims = [metrics.claim("c1", "x", "holds", fraction=1.0, seeds=5)]
    folder = ran(reports, metrics.metric("error", "kf/all", 7.9, "m"), seeds=5, claims=claims)
    status = json.loads((folder / "status.json").read_text()) | {"first_look": {"seeds": [5, 200]}} | more
    (folder / "status.json").write_text(json.dumps(status))


def test_a_first_look_is_shown_and_counts_as_nothing(tmp_path):
    folder = published(tmp_path / "published")
    first_look(tmp_path)
    one = study_status(a_study(), tmp_path, folder)
    assert (one.state, one.first_look, one.has_report) == ("first look", "5 of 200 flights", True)
    assert [number.answers[0] for number in one.numbers] == ["first look", "not reproduced yet"]
    assert one.numbers[0].here == 7.9 and tally(one.counted).waiting == 2
    assert (one.claims[0].verdict, one.claims[0].fraction) == ("first look", 1.0)
    whole = ledger_page([one])
    assert tiles(whole) == [("0 / 1", ["1"]), ("0 / 0", ["0", "1"])]
    assert "wildlab run s" in whole and "5 of 200 flights" in whole
    assert ">close</span></td>" not in whole and ">holds</span>" not in whole
    assert as_plain(one)["first_look"] == "5 of 200 flights"
    first_look(tmp_path, first_look={})
    whole = ledger_page([study_status(a_study(), tmp_path, folder)])
    assert ("0 / 1", ["1"]) in tiles(whole) and ("1 / 1", ["0"]) in tiles(whole)
    assert "first look</span>" not in whole


@pytest.mark.parametrize("said", [[1], {"seeds": [5]}, {"seeds": ["<b>", 1]}])
def test_nonsense_about_a_first_look_counts_as_no_full_report(tmp_path, said):
    first_look(tmp_path, first_look=said)
    assert study_status(a_study(), tmp_path).state == "broken off"
    first_look(tmp_path, first_look=None)
    assert study_status(a_study(), tmp_path).state == "done"


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("metrics.json", '"study": "s"', '"study": "other"'),
        ("metrics.json", '"seeds": 5', '"seeds": "5"'),
        ("status.json", "", "[" * 100_000),
    ],
)
def test_a_damaged_report_is_one_to_be_run_again(tmp_path, name, old, new):
    first_look(tmp_path, first_look={})
    (path,) = tmp_path.rglob(name)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new) if old else new, encoding="utf-8")
    one = study_status(a_study(), tmp_path)
    assert one.state == "broken off"
