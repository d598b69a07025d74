"""The page: safe, on one sheet of A4 and on a phone in every language, readable by everybody."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

from tests.sharing.edition.flights import EMPTY, WHOLE
from wildlab.reporting.page import POLICY
from wildlab.sharing.edition.edition import Place, edition_html
from wildlab.sharing.edition.facts import Alarm
from wildlab.sharing.edition.picture import MapPicture
from wildlab.sharing.edition.said import Day

MAP = MapPicture(
    np.array([[0.0, 0.0], [0.0, 400.0], [300.0, 400.0], [300.0, 0.0]]),
    np.random.default_rng(1).normal(150, 9, (60, 2)),
    np.array([[150.0, 150.0]]),
)
CASES = {
    "whole": (WHOLE, MAP),
    "circles": (WHOLE._replace(verdict="sound", gains=(), twin=True), None),
    "alarm": (WHOLE._replace(verdict="went wrong", alarms=(Alarm("leans", 120.0, 1),)), MAP),
    "look": (WHOLE._replace(verdict="look closer", gains=(), alarms=(Alarm("shakes", 70.0, 1),)), None),
    "empty": (EMPTY._replace(failed=("georeferencing",)), None),
}


@pytest.fixture
def pages(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """``pages(html, width)`` opens a page offline."""
    contexts = []

    def opened(html: str, width: int = 1200, **options: Any) -> Any:
        path = tmp_path / "page.html"
        path.write_text(html, encoding="utf-8")
        context = browser.new_context(viewport={"width": width, "height": 844}, offline=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.goto(path.as_uri())
        return page

    yield opened
    for context in contexts:
        context.close()


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_seen_by_everybody(case: str, pages: Any) -> None:
    facts, picture = CASES[case]
    html = edition_html(facts, name="f", place=Place("withheld"), picture=picture)
    for options in ({}, {"color_scheme": "dark"}):
        page = pages(html, 1200, **options)
        assert [one["id"] for one in Axe().run(page).response["violations"]] == []
    phone = pages(html, 390)
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390
    small = phone.evaluate(
        """[...document.querySelectorAll('svg text')].map(one => {
          const box = one.ownerSVGElement.getBoundingClientRect()
          const units = one.ownerSVGElement.viewBox.baseVal.width
          return parseFloat(getComputedStyle(one).fontSize) * box.width / units
        })"""
    )
    assert all(size >= 11 for size in small)
    inside = phone.evaluate(
        """[...document.querySelectorAll('svg text')].every(one => {
          const box = one.ownerSVGElement.getBoundingClientRect(), text = one.getBoundingClientRect()
          return text.left >= box.left && text.right <= box.right && text.bottom <= box.bottom })"""
    )
    assert inside


@pytest.mark.parametrize("case", CASES)
def test_it_asks_nobody_and_runs_nothing(case: str) -> None:
    facts, picture = CASES[case]
    html = edition_html(facts, name="f", place=Place("withheld"), picture=picture)
    assert POLICY in html and "<script" not in html and "http" not in html.replace("http-equiv", "")
    assert len(html) < 200_000


def test_names_are_harmless() -> None:
    html = edition_html(
        WHOLE, name="<script>x</script>{p90}", place=Place("generalised", 1600.0, '<img src="x">')
    )
    assert "<script" not in html and "<img" not in html and "&lt;script&gt;x&lt;/script&gt;{p90}" in html


def test_places_and_days_are_said_as_far_as_they_are_given() -> None:
    told = edition_html(WHOLE, name="f", place=Place("generalised", 1600.0, "Rounded.", (-24.9, 31.5)))
    assert "24.9° S, 31.5° E" in told and "1.6\u00a0km" in told and "Rounded." in told and "2026" not in told
    month = edition_html(WHOLE, name="f", place=Place("withheld"), day=Day(date(2026, 3, 14), False))
    assert (
        "March 2026" in month
        and "14" not in re.sub(r"<style>.*?</style>", "", month, flags=re.S).split("<h1>")[0]
    )
    # A distance from what is not shown says nothing.
    nowhere = edition_html(WHOLE, name="f", place=Place("generalised", 1600.0))
    assert "1.6" not in nowhere.partition("<main>")[2]
    norwegian = edition_html(
        WHOLE, name="f", place=Place("generalised", 920.0, "", (58.66, -16.4)), language="nb"
    )
    assert "58,66° N, 16,4° V" in norwegian
