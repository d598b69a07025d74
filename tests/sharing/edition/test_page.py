"""The one sheet: from reports to a page that is safe and readable, and its picture."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe

from tests.flight.conftest import make_flight  # noqa: F401 - a fixture of another room
from tests.sharing.edition.flights import EMPTY, NAN, WHOLE
from tests.sharing.left import leave_report
from wildlab.analysis.georeference import observe
from wildlab.analysis.overview import Alarm
from wildlab.geometry.georeference import georeference_pixels
from wildlab.messages.catalogue import Day, load_language
from wildlab.reporting.metrics import metric
from wildlab.reporting.text import POLICY
from wildlab.runner.ledger import own_flights
from wildlab.sharing.edition import (
    FOOT,
    HEIGHT,
    WIDTH,
    MapPicture,
    edition_html,
    facts_of,
    map_of,
    picture_html,
)
from wildlab.sharing.tiers import Cell

MAP = MapPicture(
    np.array([[0.0, 0.0], [0.0, 400.0], [300.0, 400.0], [300.0, 0.0]]),
    np.random.default_rng(1).normal(150, 9, (60, 2)),
    np.array([[150.0, 150.0]]),
)
SHAKES = Alarm("shakes", 1, NAN, 70.0, NAN)
CASES = {
    "whole": (WHOLE, MAP),
    "twin": (WHOLE._replace(verdict="sound", gains=(), twin=True), None),
    "alarm": (WHOLE._replace(verdict="went wrong", alarms=(Alarm("leans", 1, NAN, 120.0, NAN),)), MAP),
    "look": (
        WHOLE._replace(verdict="look closer", gains=(), alarms=(SHAKES,)),
        None,
    ),
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
def test_seen_by_everybody(case, pages):
    facts, picture = CASES[case]
    html = edition_html(facts, name="f", place=None, picture=picture)
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
def test_it_asks_nobody_and_runs_nothing(case):
    facts, picture = CASES[case]
    html = edition_html(facts, name="f", place=None, picture=picture)
    assert POLICY in html and "<script" not in html and "http" not in html.replace("http-equiv", "")
    assert len(html) < 200_000


def test_names_are_harmless():
    html = edition_html(WHOLE, name="<script>x</script>{p90}", place=None)
    assert "<script" not in html and "<img" not in html and "&lt;script&gt;x&lt;/script&gt;{p90}" in html


def test_places_and_days_are_said_as_far_as_they_are_given():
    told = edition_html(WHOLE, name="f", place=Cell(-24.9, 31.5, 0.1, 1600.0))
    assert "24.9° S, 31.5° E" in told and "1.6\u00a0km" in told and "2026" not in told
    month = edition_html(WHOLE, name="f", place=None, day=Day(date(2026, 3, 14), False))
    assert (
        "March 2026" in month
        and "14" not in re.sub(r"<style>.*?</style>", "", month, flags=re.S).split("<h1>")[0]
    )
    norwegian = edition_html(WHOLE, name="f", place=Cell(58.66, -16.4, 0.01, 920.0), language="nb")
    assert "58,66° N, 16,4° V" in norwegian


def leave(folder: Path, **numbers: tuple[str, float]) -> None:
    entries = [metric(name, subject, value, "1", n=50) for name, (subject, value) in numbers.items()]
    leave_report(folder, "f", metrics=entries)


def sound(reports: Path) -> None:
    counts = dict.fromkeys(("problems", "worth_fixing", "troubled", "broken", "alarmed"), ("flight", 0.0))
    leave(reports / "f-overview", **counts, reports_beside=("flight", 1.0))


def made(reports: Path, **more: Any) -> str:
    (own,) = own_flights(reports, ())
    return edition_html(facts_of(own), name="flight 1", place=None, **more)


def test_the_page_of_a_folder_of_reports(tmp_path):
    sound(tmp_path)
    error = {"horizontal_error_median": ("logged-pose", 6.4), "horizontal_error_p90": ("logged-pose", 9.0)}
    leave(tmp_path / "f", **error)
    html = made(tmp_path)
    assert "6.4\u00a0metres" in html and "flight 1" in html
    assert "6,4\u00a0meter" in made(tmp_path, language="nb")


def test_the_map_of_a_flight(make_flight, tmp_path):  # noqa: F811
    flight = make_flight()
    drawn = map_of(flight)
    assert drawn is not None
    nav = flight.nav["autopilot"]
    assert np.array_equal(drawn.path, nav[["north_m", "east_m"]].to_numpy())
    seen = observe(flight, "autopilot")
    expected = georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]
    assert np.array_equal(drawn.seen, expected, equal_nan=True) and len(drawn.truth) == 3
    sound(tmp_path)
    html = made(tmp_path, picture=map_of(flight))
    assert len(re.findall('<path class="way"', html)) == 1 and '<circle class="true"' in html


EN = load_language()


def circles(html: str, name: str) -> list[tuple[float, float, float]]:
    found = re.findall(rf'<circle class="{name}" cx="([\d.-]+)" cy="([\d.-]+)" r="([\d.]+)"', html)
    return [(float(x), float(y), float(r)) for x, y, r in found]


def bar(html: str) -> float:
    """Length of the scale bar in drawn units."""
    found = re.search(r'class="scale" d="[^"h]*h([\d.]+)M', html)
    assert found is not None
    return float(found[1])


def test_a_map_is_to_scale_with_north_up_and_east_right():
    path = np.array([[0.0, 0.0], [0.0, 100.0], [50.0, 100.0]])
    html = picture_html(MapPicture(path, np.array([[40.0, 80.0], [NAN, 1.0]]), np.array([[10.0, 80.0]])), EN)
    ((sx, sy, _),), ((tx, ty, _),), ((ox, oy, _),) = (circles(html, one) for one in ("seen", "true", "start"))
    scale = bar(html) / 20 if ">20" in html else bar(html) / 10 if ">10\u00a0" in html else bar(html) / 50
    assert (sx - ox) == pytest.approx(80 * scale, abs=0.3) and (oy - sy) == pytest.approx(40 * scale, abs=0.3)
    assert all(0 <= x <= WIDTH and 0 <= y <= HEIGHT - FOOT for x, y in ((sx, sy), (tx, ty), (ox, oy)))
    assert sx == pytest.approx(tx, abs=0.15) and (ty - sy) == pytest.approx(30 * scale, abs=0.3)
