"""Animated flights: where and when things are drawn, that they move, and stand still where that is asked."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from wildlab.errors import WildlabError
from wildlab.reporting.animation import (
    Course,
    Ellipses,
    Outlines,
    ShownFlight,
    animated_flight,
    with_pause,
)
from wildlab.reporting.page import page

TIMES = np.linspace(0.0, 60.0, 241)


def circle(radius: float = 120.0, rounds: float = 2.0) -> Course:
    """Clockwise seen from above, which on a map with north up is to the right on the northern side."""
    angle = 2 * np.pi * rounds * TIMES / TIMES[-1]
    return Course(TIMES, radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def shown(**parts: Any) -> ShownFlight:
    """A circle about a target that goes east."""
    path = circle()
    east = np.stack([np.zeros_like(TIMES), 0.5 * TIMES], axis=1)
    square = np.array([[20.0, -20.0], [20.0, 20.0], [-20.0, 20.0], [-20.0, -20.0]])
    whole = ShownFlight(
        path,
        Outlines(TIMES, path.points[:, None, :] + square),
        Course(TIMES[::24], east[::24] + 3.0),
        [Ellipses(TIMES, east, np.tile(np.diag([4.0, 9.0]), (len(TIMES), 1, 1)))],
        [Course(TIMES, east)],
    )
    return whole._replace(**parts)


def metres_per_unit(svg: str) -> float:
    """By the scale that the picture itself shows."""
    x0, x1 = re.search(r'class="rule" d="M([\d.]+) [\d.]+v-6v6H([\d.]+)', svg).groups()  # type: ignore[union-attr]
    words = re.search(r">([\d.]+) (k?m)</text>", svg)
    assert words is not None
    return float(words[1]) * (1000 if words[2] == "km" else 1) / (float(x1) - float(x0))


def values(svg: str, after: str, attribute: str) -> list[list[float]]:
    """Of the first animation of an attribute (or kind of transform) behind a piece of the text."""
    part = svg[svg.index(after) :]
    found = re.search(rf'(?:attributeName|type)="{attribute}" values="([^"]+)"', part)
    assert found is not None
    return [[float(one) for one in re.split(r"[ ,]", value)] for value in found[1].split(";")]


def test_the_aircraft_is_where_it_was(tmp_path):
    """By the scale drawn: it goes round a circle of 120 m, twice, its nose in the direction it goes."""
    svg = animated_flight(shown(), alt="A flight.")
    moving = svg[svg.index('class="moves"') :]
    at = np.array(values(moving[moving.rindex("<g><animateTransform") :], "<g>", "translate"))
    middle = (at.max(axis=0) + at.min(axis=0)) / 2
    away = np.hypot(*(at - middle).T) * metres_per_unit(svg)
    assert away == pytest.approx(120.0, abs=1.5)
    angle = np.unwrap(np.arctan2(at[:, 0] - middle[0], middle[1] - at[:, 1]))
    assert angle[-1] - angle[0] == pytest.approx(4 * np.pi, abs=0.05) and np.all(np.diff(angle) > 0)
    turned = np.array(values(moving, 'class="craft"', "rotate"))[:, 0]
    # On a circle flown clockwise the nose is a quarter turn ahead of the bearing from its middle.
    assert (turned - np.degrees(angle) - 90 + 180) % 360 - 180 == pytest.approx(0.0, abs=6)


@settings(max_examples=25)
@given(st.floats(0.5, 400.0), st.floats(0.5, 400.0), st.floats(-0.9, 0.9))
def test_ellipses_have_the_size_that_their_covariance_says(a, b, rho):
    P = np.array([[a, rho * np.sqrt(a * b)], [rho * np.sqrt(a * b), b]])
    where = np.zeros((2, 2))
    held = Ellipses(np.array([0.0, 60.0]), where, np.stack([P, P]))
    svg = animated_flight(shown(ellipses=[held], points=None, footprints=None), alt="x", probability=0.9)
    scale = metres_per_unit(svg)
    rx, ry = (values(svg, 'class="held"', name)[3][0] * scale for name in ("rx", "ry"))
    axes = np.sqrt(np.linalg.eigvalsh(P) * chi2.ppf(0.9, 2))
    # The ends of the scale are drawn to a tenth of a unit, as the axes are.
    assert [rx, ry] == pytest.approx(axes.tolist(), abs=0.06 * scale, rel=2e-3)
    turn = np.radians(values(svg, "<g><animateTransform", "rotate")[3][0])
    along = np.array([np.cos(turn), np.sin(turn)])  # north, east of the long axis
    if axes[1] > 1.2 * axes[0]:
        assert along @ P @ along == pytest.approx(np.linalg.eigvalsh(P)[1], rel=0.01)


def test_points_land_at_their_time_and_place():
    points = Course(np.array([15.0, 30.0]), np.array([[0.0, 0.0], [0.0, 100.0]]))
    svg = animated_flight(shown(points=points), alt="x", seconds=20.0)
    circles = re.findall(r'<circle class="point" cx="([\d.]+)" cy="([\d.]+)".*?keyTimes="([^"]+)"', svg)
    (x0, y0, keys0), (x1, y1, keys1) = circles
    assert float(keys0.split(";")[1]) == 0.25 and float(keys1.split(";")[1]) == 0.5
    assert (float(x1) - float(x0)) * metres_per_unit(svg) == pytest.approx(100, abs=0.5) and y0 == y1
    for keys in (keys0, keys1):
        at = [float(one) for one in keys.split(";")]
        assert at == sorted(at) and at[0] == 0 and at[-1] == 1
    assert 'dur="20.00s"' in svg


def test_what_is_not_known_is_not_shown():
    gap = shown().truth[0].points.copy()
    gap[: len(gap) // 2] = np.nan
    svg = animated_flight(shown(truth=[Course(TIMES, gap)]), alt="x")
    cross = svg[svg.index('class="cross"') :]
    hidden = re.search(r'attributeName="opacity" values="([01;]+)" calcMode="discrete"', cross)
    assert hidden is not None
    there = [int(one) for one in hidden[1].split(";")]
    assert there[0] == 0 and there[-1] == 1 and sum(there) == pytest.approx(len(there) / 2, abs=2)
    assert "nan" not in svg
    nothing = ShownFlight(circle(), Outlines(TIMES, np.full((len(TIMES), 4, 2), np.nan)))
    assert "<polygon" not in animated_flight(nothing, alt="x")


def test_no_alt_text_no_picture():
    with pytest.raises(WildlabError, match="no alt text"):
        animated_flight(shown(), alt=" ")
    assert 'aria-label="&lt;script&gt;&quot;"' in animated_flight(shown(), alt='<script>"')


@pytest.mark.slow
def test_a_long_flight_fits_into_its_bytes():
    """25 minutes of rounds, with 3000 points and two targets."""
    t = np.arange(0.0, 1500.0, 0.5)
    round_ = 2 * np.pi * t / 37
    path = Course(t, np.stack([150 * np.cos(round_), 300 * np.sin(round_)], axis=1))
    seen = np.sort(np.random.default_rng(0).uniform(0, 1500, 3000))
    covariance = np.tile(np.eye(2) * 50, (len(t), 1, 1))
    long = ShownFlight(
        path,
        Outlines(t, np.repeat(path.points[:, None], 16, axis=1)),
        Course(seen, np.zeros((3000, 2))),
        [Ellipses(t, path.points / k, covariance) for k in (2, 3)],
        [Course(t, path.points / k) for k in (2, 3)],
    )
    drawn = animated_flight(long, alt="x")
    assert 100_000 < len(drawn.encode()) <= 1_000_000
    small = animated_flight(long, alt="x", most_bytes=300_000)
    assert len(small.encode()) <= 300_000
    assert small.count("<circle") < drawn.count("<circle") <= 400
    with pytest.raises(WildlabError, match="bytes at 48 instants"):
        animated_flight(long, alt="x", most_bytes=5_000)


def opened(browser: Any, tmp_path: Path, **context: Any) -> Any:
    """The picture alone on a page, in a browser that is offline."""
    path = tmp_path / "flight.html"
    path.write_text(
        page(title="x", body=f"<h1>x</h1>{with_pause(animated_flight(shown(), alt='A flight.'))}"), "utf-8"
    )
    tab = browser.new_context(viewport={"width": 700, "height": 700}, offline=True, **context).new_page()
    tab.goto(path.as_uri())
    return tab


def pictures(tab: Any) -> tuple[bytes, bytes]:
    """The picture, and once more 1.2 s later."""
    svg = tab.locator("svg.flown")
    before = svg.screenshot()
    tab.wait_for_timeout(1200)
    return before, svg.screenshot()


@pytest.mark.slow
@pytest.mark.parametrize("still", ["asked", "stopped", "paper"])
def test_it_stands_still(browser, tmp_path, still):
    tab = opened(browser, tmp_path, **({"reduced_motion": "reduce"} if still == "asked" else {}))
    if still == "stopped":
        tab.locator("summary").click()
    if still == "paper":
        tab.emulate_media(media="print")
    before, after = pictures(tab)
    assert before == after
    assert tab.locator("svg.flown .still").is_visible() and not tab.locator("svg.flown .moves").is_visible()
    if still == "stopped":
        tab.locator("summary").click()
        before, after = pictures(tab)
        assert before != after
