"""The one picture: a map of given points, an image, or the numbers drawn to scale."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.sharing.edition.flights import EMPTY, NAN, WHOLE
from wildlab.errors import WildlabError
from wildlab.sharing.edition.language import load_language
from wildlab.sharing.edition.picture import (
    FOOT,
    HEIGHT,
    WIDTH,
    ImagePicture,
    MapPicture,
    nice_length,
    picture_html,
)

EN = load_language()
NONE = np.empty((0, 2))


def circles(html: str, name: str) -> list[tuple[float, float, float]]:
    found = re.findall(rf'<circle class="{name}" cx="([\d.-]+)" cy="([\d.-]+)" r="([\d.]+)"', html)
    return [(float(x), float(y), float(r)) for x, y, r in found]


def bar(html: str) -> float:
    """Length of the scale bar in drawn units."""
    found = re.search(r'class="scale" d="[^"h]*h([\d.]+)M', html)
    assert found is not None
    return float(found[1])


def test_circles_are_to_scale() -> None:
    html = picture_html(None, WHOLE, EN)
    (_, _, inner), (_, _, outer) = circles(html, "ring median")[0], circles(html, "ring p90")[0]
    assert outer / inner == pytest.approx(9.57 / 3.47, rel=0.005)
    # The bar is of 10 m.
    assert bar(html) / outer == pytest.approx(10 / 9.57, rel=0.005)


def test_a_map_is_to_scale_with_north_up_and_east_right() -> None:
    path = np.array([[0.0, 0.0], [0.0, 100.0], [50.0, 100.0]])
    html = picture_html(
        MapPicture(path, np.array([[40.0, 80.0], [NAN, 1.0]]), np.array([[10.0, 80.0]])), EMPTY, EN
    )
    ((sx, sy, _),), ((tx, ty, _),), ((ox, oy, _),) = (circles(html, one) for one in ("seen", "true", "start"))
    scale = bar(html) / 20 if ">20" in html else bar(html) / 10 if ">10\u00a0" in html else bar(html) / 50
    assert (sx - ox) == pytest.approx(80 * scale, abs=0.3) and (oy - sy) == pytest.approx(40 * scale, abs=0.3)
    assert all(0 <= x <= WIDTH and 0 <= y <= HEIGHT - FOOT for x, y in ((sx, sy), (tx, ty), (ox, oy)))
    assert sx == pytest.approx(tx, abs=0.15) and (ty - sy) == pytest.approx(30 * scale, abs=0.3)


def test_one_who_walked_elsewhere_does_not_shrink_the_map() -> None:
    """The flight and what was seen set the extent: a tracker may run for long before and after."""
    path = np.array([[0.0, 0.0], [0.0, 100.0], [50.0, 100.0]])
    walk = np.stack([np.linspace(0, 3000, 200), np.full(200, 50.0)], axis=1)
    alone = picture_html(MapPicture(path, NONE, NONE), EMPTY, EN)
    walked = picture_html(MapPicture(path, NONE, walk), EMPTY, EN)
    assert circles(walked, "start") == circles(alone, "start")
    assert 0 < len(circles(walked, "true")) < 10
    assert not circles(picture_html(MapPicture(path, NONE, walk + 9000.0), EMPTY, EN), "true")


def test_what_is_drawn_where_less_is_known() -> None:
    tracked = picture_html(None, WHOLE._replace(compared=3), EN)
    assert "4.1" in tracked and not circles(tracked, "ring p90")
    scattered = picture_html(None, EMPTY._replace(scatter=2.0, sightings=9), EN)
    assert f"{2 * math.sqrt(2 * math.log(2)):.1f}" in scattered
    assert "3 of 4" in picture_html(None, EMPTY._replace(seen=4.0, placed=3.0), EN)
    assert picture_html(None, EMPTY, EN) == ""
    assert picture_html(MapPicture(NONE, NONE, NONE), EMPTY, EN) == ""


def test_an_image_goes_in_as_an_image() -> None:
    html = picture_html(ImagePicture(b"<svg xmlns='x'><script>alert(1)</script></svg>", 'a "map"'), EMPTY, EN)
    assert '<img src="data:image/svg+xml;base64,' in html and "<script" not in html
    assert 'alt="a &quot;map&quot;"' in html
    with pytest.raises(WildlabError, match="neither PNG"):
        picture_html(ImagePicture(b"GIF89a", "x"), EMPTY, EN)
    with pytest.raises(WildlabError, match="no words"):
        picture_html(ImagePicture(b"\x89PNG", " "), EMPTY, EN)


@given(st.floats(1e-3, 1e7))
def test_a_nice_length_is_round_and_most_of_the_room(most: float) -> None:
    found = nice_length(most)
    assert found <= most * (1 + 1e-9) and found > 0.39 * most
    assert f"{found:.0e}"[0] in "125"
