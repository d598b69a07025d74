"""The second wall: secrets in every common spelling, anywhere on Earth, and what is none of them."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tests.sharing.canary import HERE, canary
from tests.sharing.spelt import DATES, LATITUDE, LEAKS, LONGITUDE, NAME, NUMBER, SPELLINGS, WHEN, secrets
from wildlab.geometry.frames import normal_gravity
from wildlab.paths import DATA
from wildlab.sharing.generalisation import generalise
from wildlab.sharing.recomputation import Source
from wildlab.sharing.scan import Secrets, SecretSearch, flight_secrets, search_limits
from wildlab.sharing.tiers import treatment_of

# Off the equator and the meridian, where a coordinate is a small number like any other.
# A round number says nothing of a place either: 2.0 stands everywhere.
LATITUDES, LONGITUDES = (
    some.integers(1_500_000, most).filter(lambda a: a % 10_000 > 99).map(lambda a: a / 1e6)
    .flatmap(lambda a: some.sampled_from([a, -a]))
    for most in (78_000_000, 178_000_000)
)  # fmt: skip


def found(text: str, known: Secrets, name: str = "a") -> set[str]:
    """The kinds of secrets that are found in a text."""
    return {one.kind for one in SecretSearch(known).scan({name: text})}


def placed(latitude: float = LATITUDE, longitude: float = LONGITUDE) -> Secrets:
    """A place, and nothing else."""
    return replace(secrets(latitude, longitude), moments=(), words={}, numbers=())


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_each_spelling_is_found_and_a_place_elsewhere_is_none(spelling):
    for latitude, longitude in ((LATITUDE, LONGITUDE), (-24.113587, 31.472936), (19.436257, -99.131264)):
        text = f"<p>it was at {SPELLINGS[spelling](latitude, longitude)} then</p>"
        assert found(text, placed(latitude, longitude)), text
        assert not found(text, placed(latitude + 0.31, longitude - 0.27)), text


ANYWHERE = sorted(one for one in SPELLINGS if "entities" not in one and "alone" not in one)


@given(latitude=LATITUDES, longitude=LONGITUDES)
@settings(max_examples=15)
def test_each_spelling_is_found_anywhere(latitude, longitude):
    look = SecretSearch(placed(latitude, longitude))
    texts = {spelling: SPELLINGS[spelling](latitude, longitude) for spelling in ANYWHERE}
    assert {one.file for one in look.scan(texts)} == set(ANYWHERE)


# Where maps take the zone of a neighbour: Bergen is in 32, Svalbard in 33 and 35.
@pytest.mark.parametrize(
    ("latitude", "longitude", "east", "north"),
    [(60.3913, 5.3221, 297353, 6700648), (78.2, 9.01, 363484, 8687681), (78.0, 21.01, 361204, 8665473)],
)
def test_utm_by_the_exceptions_of_norway_and_svalbard(latitude, longitude, east, north):
    """As two programs with no code in common (GEOTRANS and PyGeodesy) write these places, to a metre."""
    assert found(f"E {east} N {north}", placed(latitude, longitude)) == {"place"}
    assert not found(f"E {east + 20_000} N {north}", placed(latitude, longitude))


def test_the_latitude_of_one_place_and_the_longitude_of_another_are_none():
    two = replace(placed(), places=np.array([[LATITUDE, LONGITUDE, 0.0], [58.662064, 16.433337, 0.0]]))
    assert found(f"{LATITUDE:.3f} {LONGITUDE:.3f}", two) and found("58.662 16.433", two)
    assert not found(f"{LATITUDE:.3f} 16.433", two)


def test_a_place_on_the_grid_of_what_may_be_told_is_none():
    known = replace(placed(63.4003, 10.3997), near_m=20_000.0)
    told, finer = "63.40 N 10.40 E", "63.41 N 10.42 E"
    assert found(told, known)
    assert not found(told, replace(known, cell_deg=0.1))
    assert found(finer, replace(known, cell_deg=0.1))


@pytest.mark.parametrize(
    ("drawn", "there"),
    [
        ('<path d="M4 6 224.4L12.6 41.3h0M300.9 2"/>', False),
        ('<path d="M62.4138 12.6838"/>', True),
        ('<text>62.4138 12.6838</text>', True),
        ('<path data-x="62.4138 12.6838" d="M1 2"/>', True),
    ],
)  # fmt: skip
def test_lines_of_a_drawing_are_no_places_and_places_among_them_are(drawn, there):
    """Pixels to a tenth hold no place; what is finer or larger in a drawing may."""
    known = replace(placed(62.4138, 12.6838), words={"M300": "x"})
    text = f"<p>a</p><svg viewBox='0 0 900 600'>{drawn}</svg>"
    assert found(text, known) == ({"place"} if there else set())


@pytest.mark.parametrize("way", DATES)
def test_the_day_is_found_and_others_are_not(way):
    known = Secrets(moments=(WHEN,))
    assert found(f"at {WHEN.strftime(way)}, or", known) == {"date"}
    # Far enough for another day everywhere on Earth, and another time of day.
    for days in (9.3, -9.3, 40.3):
        other = (WHEN + timedelta(days)).strftime(way)
        assert not found(f"at {other}, or", known), other


def test_the_month_may_be_said():
    assert not found("Flown in May 2023 (UTC), 2023-05", secrets())


@pytest.mark.parametrize(
    "text",
    [
        NAME, NAME.upper(), "vesle-trollholmen", "VesleTrollholmen", "vesle_trollholmen.bin", "Trollholmen",
        "near Bjornoya", "x<b>Bjørn</b>øya",
    ],
)  # fmt: skip
def test_names_are_found_and_others_are_not(text):
    known = Secrets(words={NAME: "x", "Bjørnøya": "x"})
    assert found(f"seen from {text}!", known) == {"name"}
    for other in ("Store Trollhol", "a vessel", "Bjerkøya"):
        assert not found(other, known)


def test_a_name_within_a_word_of_ours_is_none_and_one_that_stands_out_says_whose_it_is():
    known = SecretSearch(Secrets(words={"Mage": "flight.toml: platform.name"}))
    assert not known.scan({"a": "an image, <td>images</td><td>image</td><td>12</td>"})
    (finding,) = known.scan({"a": "an image of Mages"})
    assert finding.word == "'Mage', flight.toml: platform.name" and "Mage" not in repr(finding)


def test_a_secret_of_a_flight_is_told_by_its_field():
    flight = canary(imu=False)
    treatment = treatment_of(flight.manifest.locations, "public")
    made, source = generalise(flight, treatment), Source("kifaru-ridge", (), logged=True)
    words = flight_secrets(flight, made, treatment, source, Path("flights/kifaru-ridge")).words
    assert words[flight.manifest.name] == "flight.toml: name"
    assert words["Thandi"] == "a target of the flight's tables"


@pytest.mark.parametrize("text", [f"{NUMBER}", f"{NUMBER:.3f} m", f"undulation {NUMBER:.2f}", f"-{NUMBER}"])
def test_its_heights_are_found_and_others_are_not(text):
    known = Secrets(numbers=(NUMBER,))
    assert found(text, known) == {"number"}
    # The last are cells of a table in one row, as they are where no tag stands between them.
    for other in (f"{NUMBER + 0.05:.4f}", f"geoid {NUMBER + 1:.2f}", "autopilot120010.00.00.0000.0–0frames"):
        assert not found(other, known), other


@pytest.mark.parametrize("kind", LEAKS)
def test_a_finding_hides_what_it_found(kind):
    (finding, *_) = SecretSearch(secrets()).scan({"a.html": LEAKS[kind][1]})
    assert finding.kind == LEAKS[kind][0] and finding.found
    assert finding.found not in repr(finding) and finding.found not in str(finding)
    assert "63.4" not in repr(secrets())


def test_what_is_known_of_a_flight_is_looked_for():
    """Its place, names and day, and what follows from the place: height, gravity, the map's cells."""
    flight = canary(locations={"category": 2}, imu=False)
    treatment = treatment_of(flight.manifest.locations, "public")
    made, source = generalise(flight, treatment), Source("kifaru-ridge", (), logged=True)
    known = flight_secrets(flight, made, treatment, source, Path("flights/kifaru-ridge"))
    gravity = float(normal_gravity(np.radians(HERE[0]), HERE[2]))
    for text, kind in (
        (f"{HERE[0]:.3f}, {HERE[1]:.3f}", "place"), ("Thandi", "name"), ("EPSG:32736", "name"),
        ("17 September 2023", "date"), (f"at {HERE[2]:.2f} m", "number"), (f"g = {gravity:.5f}", "number"),
        ("cells of 30.87 by 28.02 m on a terrain", "number"),
    ):  # fmt: skip
        assert found(text, known) == {kind}, text
    assert not found("g = 9.80665 m/s2, 24.9 S, 31.5 E, September 2023", known)


@pytest.mark.parametrize("language", ["en", "nb", "sv"])
def test_words_of_the_sheets_are_no_names_of_a_flight_and_are_told_to_the_sender(language):
    """A terrain called dem.tif is no secret that "av dem" gives away."""
    sheet = (DATA / "messages" / "edition" / f"{language}.toml").read_text(encoding="utf-8")
    words = ("maps/dem.tif", *re.findall(r"[^\W\d_]{5,}", sheet))
    assert SecretSearch(Secrets(words=dict.fromkeys(words, "x"))).scan({"sheet.html": sheet}) == []
    assert any("dem" in line for line in search_limits(Secrets(words={"dem": "x"})))
    assert SecretSearch(Secrets(words={"Skukuza": "x"})).scan({"sheet.html": f"{sheet} Skukuza"})
