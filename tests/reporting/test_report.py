"""Report: order, files, numbers, and the mistakes it does not let through."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bs4 import BeautifulSoup

from wildlab.errors import WildlabError
from wildlab.reporting.figures import QUICK, new_figure
from wildlab.reporting.report import Report, open_report


def report(out: Path | None = None, study: str = "consistency-bounds") -> Report:
    return open_report(study=study, kind="computed", seed=1, out=str(out or ""))


def test_only_the_name_of_a_flight_folder_is_shown() -> None:
    one = open_report(study="s", kind="logged", flight="/home/someone/flights/tuesday")
    one.head("Title", "sub")
    assert "<b>tuesday</b>" in one.parts[0] and "someone" not in one.parts[0]
    assert "logged flight" in one.parts[0]


def test_figure_is_shown_with_alt_and_written_as_pdf_and_png(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(QUICK, raising=False)
    one = report(tmp_path)
    one.figure(new_figure(5, 3)[0], name="fig-5-04a", alt="A line.", caption="It **rises**.")
    soup = BeautifulSoup(one.parts[0], "html.parser")
    assert soup.img is not None and soup.img["alt"] == "A line."
    assert str(soup.img["src"]).startswith("data:image/png;base64,")
    for ending, begins in (("pdf", b"%PDF"), ("png", b"\x89PNG")):
        assert (tmp_path / "figures" / f"fig-5-04a.{ending}").read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("name", "alt", "sentence"),
    [("../escape", "a", "escape"), ("Fig 1", "a", "Fig 1"), ("fig", "  ", "alt")],
)
def test_figures_that_are_refused(tmp_path: Path, name: str, alt: str, sentence: str) -> None:
    with pytest.raises(WildlabError, match=sentence):
        report(tmp_path).figure(new_figure()[0], name=name, alt=alt)
    assert list(tmp_path.iterdir()) == []


def test_table_has_digits_and_says_what_is_not_known() -> None:
    one = report()
    frame = pd.DataFrame({"who": ["a", None], "error": [1.234, np.nan], "good": [True, False]})
    one.table(frame, columns={"good": "good", "who": "name", "error": "error (m)"}, digits={"error": 1})
    rows = BeautifulSoup(one.parts[0], "html.parser").select("tr")
    found = [[cell.text for cell in row.find_all(["th", "td"])] for row in rows]
    assert found == [["good", "name", "error (m)"], ["yes", "a", "1.2"], ["no", "–", "–"]]
    with pytest.raises(WildlabError, match="no column 'nope'"):
        one.table(frame, columns={"nope": "x"})


def test_published_values_are_looked_up(tmp_path: Path) -> None:
    one = report(tmp_path)
    one.metric("interval_low", "nees-1-run", 0.4844, "")
    one.metric("interval_low", "something-else", 0.1, "m")
    one.save()
    content = json.loads((tmp_path / "metrics.json").read_text())
    known, unknown = content["metrics"]
    assert (known["published"], known["source"], unknown["published"]) == (0.48, "H example 3.1", None)
    assert (content["study"], content["kind"]) == ("consistency-bounds", "computed")


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: report().summary(["a"], level="great"), "great"),
        (lambda: report().summary([]), "empty"),
        (lambda: open_report(study="s", kind="dream"), "dream"),
        (lambda: report().metric("interval_low", "nees-1-run", 0.4844, "m"), "published in ''"),
    ],
)
def test_mistakes_are_named(make: Callable[[], object], named: str) -> None:
    with pytest.raises(WildlabError, match=named):
        make()


def test_a_number_that_is_not_known_is_nowhere_on_a_page(tmp_path: Path) -> None:
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
