"""Reports: files, numbers, tables and texts, and the mistakes that are not let through."""

from __future__ import annotations

import base64
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bs4 import BeautifulSoup
from hypothesis import given
from hypothesis import strategies as st

from wildlab.errors import WildlabError
from wildlab.files import write_json
from wildlab.messages.quantities import known, percent, percent_between
from wildlab.reporting.figures import QUICK, new_figure
from wildlab.reporting.metrics import claim, document, metric, read_metrics
from wildlab.reporting.report import Report, open_report
from wildlab.reporting.text import (
    csv_link,
    escape,
    inline,
    maths,
    prose,
)


def report(out: Path | None = None, study: str = "consistency-bounds") -> Report:
    return open_report(study=study, kind="computed", seed=1, out=str(out or ""))


def test_only_the_name_of_a_flight_folder_is_shown():
    one = open_report(study="s", kind="logged", flight="/home/someone/flights/tuesday")
    one.head("Title", "sub")
    assert "<b>tuesday</b>" in one.parts[0] and "someone" not in one.parts[0]
    assert "logged flight" in one.parts[0]


def test_figure_is_shown_with_alt_and_written_as_pdf_and_png(tmp_path, monkeypatch):
    monkeypatch.delenv(QUICK, raising=False)
    one = report(tmp_path)
    one.figure(new_figure(5, 3)[0], name="fig-5-04a", alt="A line.", caption="It **rises**.")
    soup = BeautifulSoup(one.parts[0], "html.parser")
    assert soup.img is not None and soup.img["alt"] == "A line."
    assert str(soup.img["src"]).startswith("data:image/png;base64,")
    for ending, begins in (("pdf", b"%PDF"), ("png", b"\x89PNG")):
        assert (tmp_path / "figures" / f"fig-5-04a.{ending}").read_bytes().startswith(begins)


def test_table_has_digits_and_says_what_is_not_known():
    one = report()
    frame = pd.DataFrame({"who": ["a", None], "error": [1.234, np.nan], "good": [True, False]})
    one.table(frame, columns={"good": "good", "who": "name", "error": "error (m)"}, digits={"error": 1})
    rows = BeautifulSoup(one.parts[0], "html.parser").select("tr")
    found = [[cell.text for cell in row.find_all(["th", "td"])] for row in rows]
    assert found == [["good", "name", "error (m)"], ["yes", "a", "1.2"], ["no", "–", "–"]]
    with pytest.raises(WildlabError, match="no column 'nope'"):
        one.table(frame, columns={"nope": "x"})


def test_of_a_long_table_the_first_rows_are_in_sight_and_all_are_in_the_file():
    shown = report()
    shown.table(pd.DataFrame({"track": [f"track {k}" for k in range(45)], "m": np.arange(45.0)}))
    shown.table(pd.DataFrame({"m": np.arange(24.0)}))
    long, short = (BeautifulSoup(part, "html.parser") for part in shown.parts)
    assert len(long.select("figure > details tbody tr")) == 36 and short.details is None
    link = str(long.find("a", class_="data")["href"]).partition(",")[2]
    assert len(base64.b64decode(link).splitlines()) == 46


def test_published_values_are_looked_up(tmp_path):
    one = report(tmp_path)
    one.metric("interval_low", "nees-1-run", 0.4844, "")
    one.metric("interval_low", "something-else", 0.1, "m")
    one.claim("c", "It holds.", "holds", fraction=0.9, seeds=10)
    one.save()
    content = json.loads((tmp_path / "metrics.json").read_text())
    known, unknown = content["metrics"]
    assert (known["published"], known["source"], unknown["published"]) == (0.48, "H example 3.1", None)
    assert content["claims"][0]["verdict"] == "holds"
    assert (content["study"], content["kind"]) == ("consistency-bounds", "computed")


def test_a_number_that_is_not_known_is_nowhere_on_a_page(tmp_path):
    one, nan = report(tmp_path), float("nan")
    fig, ax = new_figure(5, 3)
    ax.set_title(f"It is {nan:.1f} m off")
    one.summary([f"It is {nan:.1f} m off.", "Two flights."])
    one.tiles([(f"{nan:.1f} m", "off"), ("2", "flights")])
    one.section("How far off", f"By {nan:.0f} m. There are two.")
    one.points([f"{nan:.2f} m", "It is so."])
    one.table(pd.DataFrame({"a": [f"{nan:.1f} to {nan:.1f}", "1 to 2"]}), caption=f"Of {nan:.0f} flights.")
    one.figure(fig, name="off", alt=f"{nan:.1f} m", caption=f"{nan:.1f} m.")
    page = BeautifulSoup("".join(one.parts), "html.parser")
    assert "nan" not in page.get_text() and page.img is not None and page.img["alt"]
    assert ax.get_title(loc="left") == "" == ax.get_title()
    assert {"Two flights.", "2", "There are two.", "It is so.", "1 to 2", "–"} <= set(page.stripped_strings)


def whole(**changes: Any) -> dict[str, Any]:
    given: dict[str, Any] = {"study": "s", "flight": "", "kind": "twin", "seed": 1, "seeds": None}
    given |= {"metrics": [metric("a", "b", 1.0, "m")], "claims": [claim("c", "It holds.", "holds")]}
    return document(**(given | changes))


def test_round_trip(tmp_path):
    content = whole(metrics=[metric("a", "b/c", np.float64(0.5), "m", n=3, low=0.1, high=0.9, source="H 1")])
    write_json(tmp_path / "metrics.json", content)
    assert read_metrics(tmp_path / "metrics.json") == content
    assert [path.name for path in tmp_path.iterdir()] == ["metrics.json"]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: metric("Error", "b", 1.0, "m"), "not made of a-z"),
        (lambda: metric("a", "two words", 1.0, "m"), "has a blank"),
        (lambda: metric("a", "b", math.inf, "m"), "infinite"),
        (lambda: metric("a", "b", 1.0, "m", low=2.0, high=1.0), "above the high one"),
        (lambda: whole(kind="dream"), "kind 'dream'"),
        (lambda: whole(metrics=[metric("a", "b", 1.0, "m")] * 2), "given twice"),
    ],
)
def test_refusals(make, sentence):
    with pytest.raises(WildlabError, match=f"(?i){sentence}"):
        make()


@pytest.mark.parametrize("content", ["", "[]", '{"study": 1}', '{"metrics": NaN}', "\x00"])
def test_a_file_that_is_none_is_named(tmp_path, content):
    path = tmp_path / "metrics.json"
    path.write_text(content)
    with pytest.raises(WildlabError, match=r"metrics\.json: this is not a metrics file"):
        read_metrics(path)
    path.write_text(json.dumps(whole() | {"metrics": [{"name": "a"}]}))
    with pytest.raises(WildlabError, match="not a metrics file"):
        read_metrics(path)


def content(link: str) -> str:
    anchor = BeautifulSoup(link, "html.parser").a
    assert anchor is not None and str(anchor["href"]).startswith("data:text/csv;base64,")
    return base64.b64decode(str(anchor["href"]).split(",", 1)[1]).decode("utf-8")


def test_the_link_holds_the_table_to_the_last_digit():
    rng = np.random.default_rng(0)
    frame = pd.DataFrame({"name": ["ä", "b,c", '"'], "value": rng.normal(size=3) * 1e5})
    back = pd.read_csv(io.StringIO(content(csv_link(frame, "Study/../x", "words"))))
    pd.testing.assert_frame_equal(back, frame)
    assert 'download="study-x.csv"' in csv_link(frame, "Study/../x", "words")


def test_no_cell_and_no_column_is_a_formula():
    text = content(csv_link(pd.DataFrame({"=1+1": ["@x", "-3"]}), "a"))
    assert text.splitlines() == ["'=1+1", "'@x", "'-3"]


@pytest.mark.parametrize("column", ["lat", "lon_deg", "Latitude", "longitude", "utm_zone", "ecef_x", "mgrs"])
def test_where_on_earth_something_is_gets_into_no_link(column):
    assert csv_link(pd.DataFrame({"name": ["a"], column: [1.0]}), "a") == ""


@given(st.text())
def test_whatever_the_text_no_element_comes_out_of_it(text):
    shown = inline(text)
    for mark in ("<b>", "</b>", "<code>", '<code class="short">', "</code>"):
        shown = shown.replace(mark, "")
    assert "<" not in shown and ">" not in shown and '"' not in shown and "'" not in shown
    assert "<" not in escape(text) and "\x00" not in escape(text)


def test_prose_has_paragraphs_and_maths_but_no_html():
    shown = prose("One <i>.\n\nTwo $x_k$ and\n\n$$P^{-1}$$\n\nThree costs \\$5.")
    assert shown.startswith("<p>One &lt;i&gt;.</p><p>Two <math")
    assert shown.count("<math") == 2 and "costs $5." in shown and "<p></p>" not in shown


@pytest.mark.parametrize(
    "latex", [r"x^", r"\left( x", r"\nosuchcommand{x}", r"\text{<script>}", r"\text{a < b}"]
)
def test_maths_that_cannot_be_shown_is_refused(latex):
    with pytest.raises(WildlabError, match="formula"):
        maths(latex)


@given(st.floats(1e-8, 1 - 1e-8), st.integers(0, 2))
def test_a_share_is_rounded_by_less_than_itself_and_never_to_all_or_none(share, digits):
    shown = float(percent(share, digits).removesuffix(" %")) / 100
    assert 0 < shown < 1
    assert abs(shown - share) <= max(0.5 * 10.0 ** -(digits + 2), min(share, 1 - share)) + 1e-12


def test_what_is_not_known_is_not_said():
    assert percent(0.004, 0) == "0.4 %"
    for words in (percent(math.nan), percent(math.inf), percent_between([math.nan] * 3), f"{math.nan:.1f} m"):
        assert known(words) == "" and known(f"Two. It is {words} off; 3 m are left. H (5.1) is kept.") == (
            "Two. H (5.1) is kept."
        )
    for said in ("Tirza Nan-Ek and nana-nan5", "", "It is 3.1 m."):
        assert known(said) == said
