"""Places in every spelling, anywhere on Earth; codes by published examples."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tests.sharing.scan.spelt import LATITUDE, LONGITUDE, SPELLINGS, secrets
from wildlab.sharing.scan import Secrets, scan
from wildlab.sharing.scan.codes import (
    geohash_cell,
    geohash_of,
    locator_of,
    plus_cell,
    plus_of,
)
from wildlab.sharing.scan.look import SoughtPlaces

# Off the equator and the meridian, where a coordinate is a small number like any other.
# A round number says nothing of a place either: 2.0 stands everywhere.
LATITUDES, LONGITUDES = (
    some.integers(1_500_000, most).filter(lambda a: a % 10_000 > 99).map(lambda a: a / 1e6)
    .flatmap(lambda a: some.sampled_from([a, -a]))
    for most in (78_000_000, 178_000_000)
)  # fmt: skip


def kinds(text: str, known: Secrets) -> set[str]:
    return {hit.written for hit in SoughtPlaces(replace(known, moments=(), words=())).in_text(text)}


def places(text: str, known: Secrets) -> list[str]:
    found = SoughtPlaces(replace(known, moments=(), words=(), numbers=())).in_text(text)
    return [hit.written for hit in found if hit.kind == "place"]


def read(tmp_path: Path, text: str, known: Secrets) -> list[str]:
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    return [str(finding) for finding in scan([tmp_path / "page.html"], replace(known, moments=()))]


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_each_spelling_is_found(tmp_path, spelling):
    for latitude, longitude in ((LATITUDE, LONGITUDE), (-24.113587, 31.472936), (19.436257, -99.131264)):
        text = f"<p>it was at {SPELLINGS[spelling](latitude, longitude)} then</p>"
        found = read(tmp_path, text, secrets(latitude, longitude))
        assert any(": place: " in finding for finding in found), text


ANYWHERE = sorted(one for one in SPELLINGS if "entities" not in one and "alone" not in one)


@given(latitude=LATITUDES, longitude=LONGITUDES)
@settings(max_examples=15)
def test_each_spelling_is_found_anywhere(latitude, longitude):
    look = SoughtPlaces(replace(secrets(latitude, longitude), moments=(), words=(), numbers=()))
    missed = [
        (spelling, text)
        for spelling in ANYWHERE
        for text in [SPELLINGS[spelling](latitude, longitude)]
        if not any(hit.kind == "place" for hit in look.in_text(text))
    ]
    assert missed == []


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_a_place_elsewhere_is_none(spelling):
    text = SPELLINGS[spelling](LATITUDE + 0.31, LONGITUDE - 0.27)
    assert places(text, secrets()) == [], text


def test_how_near_is_near():
    known = secrets()
    inside, outside = (f"{LATITUDE + off / 111_320:.6f} {LONGITUDE:.3f}" for off in (900, 1100))
    assert places(inside, known)
    assert not places(outside, known)
    assert places(outside, replace(known, near_m=1500.0))


def test_the_latitude_of_one_place_and_the_longitude_of_another_are_none():
    two = replace(secrets(), places=np.array([[LATITUDE, LONGITUDE, 0.0], [58.662064, 16.433337, 0.0]]))
    assert places(f"{LATITUDE:.3f} {LONGITUDE:.3f}", two) and places("58.662 16.433", two)
    assert not places(f"{LATITUDE:.3f} 16.433", two)


def test_a_place_on_the_grid_of_what_may_be_told_is_none():
    known = replace(secrets(63.4003, 10.3997), near_m=20_000.0)
    told, finer = "63.40 N 10.40 E", "63.41 N 10.42 E"
    assert places(told, known)
    assert not places(told, replace(known, cell_deg=0.1))
    assert places(finer, replace(known, cell_deg=0.1))


# Published: https://en.wikipedia.org/wiki/Geohash
@pytest.mark.parametrize(
    ("code", "latitude", "longitude"),
    [("u4pruydqqvj", 57.64911, 10.40744), ("ezs42", 42.605, -5.603), ("6gkzwgjz", -25.38262, -49.26561)],
)
def test_geohash_as_published(code, latitude, longitude):
    there = geohash_cell(code)
    assert abs(there[0] - latitude) <= there[2] + 6e-4 and abs(there[1] - longitude) <= there[3] + 6e-4
    assert geohash_of(there[0], there[1], len(code)) == code


# From the test data of the Open Location Code's own project (encoding).
@pytest.mark.parametrize(
    ("before", "after", "latitude", "longitude"),
    [
        ("7FG49QCJ", "2V", 20.3700625, 2.7821875),
        ("7FG49QCJ", "2VX", 20.3701125, 2.782234375),
        ("7FG49QCJ", "2VXGJ", 20.3701135, 2.78223535156),
        ("8FVC2222", "22", 47.0000625, 8.0000625),
        ("4VCPPQGP", "Q9", -41.2730625, 174.7859375),
    ],
)
def test_plus_codes_as_published(before, after, latitude, longitude):
    there = plus_cell(before, after)
    assert there[:2] == pytest.approx((latitude, longitude), abs=1e-9)
    assert plus_of(latitude, longitude) == before


def test_locators_as_published():
    # Munich and Washington, of the locator's own description; Montevideo; the station W1AW.
    assert locator_of(48.14666, 11.60833) == "JN58td"
    assert locator_of(-34.91, -56.21166) == "GF15vc"
    assert locator_of(41.714775, -72.727260) == "FN31pr"


# As two programs with no code in common (GEOTRANS and PyGeodesy) write these places, to a metre.
MGRS = {
    "32VKN9735300648": (60.3913, 5.3221),  # Bergen: zone 32 reaches west to 3 degrees
    "31UEC9357105982": (55.99, 4.5),  # south of that exception
    "31WEL7336097988": (64.001, 4.5),  # north of it
    "31VDG9944251411": (60.0, 2.99),
    "32WME6549288103": (71.99, 8.0),  # south of the exceptions of Svalbard
    "31XFV7218297198": (72.01, 8.0),
    "31XFG3651587681": (78.2, 8.99),
    "33XUG6348487681": (78.2, 9.01),
    "33XVH3402763342": (78.925, 11.9222),  # Ny-Alesund
    "33XXG3879565473": (78.0, 20.99),
    "35XLG6120465473": (78.0, 21.01),
    "35XPJ1592187559": (80.0, 32.99),
    "37XCJ8407887559": (80.0, 33.01),
    "37XEJ5619682986": (80.0, 41.9),
    "38XMP4380382986": (80.0, 42.1),
    "35XNP3505227890": (83.99, 30.0),
    "36JUU4592943693": (-24.0113, 31.4852),
    "33KXV4003814624": (-18.8556, 16.3293),
    "21HUB7331770036": (-34.6037, -58.3816),
    "37MBV2172399955": (-0.0004, 36.5),  # either side of the equator
    "37NBA2172300044": (0.0004, 36.5),
    "60KZF1805229394": (-17.8, 179.9999),  # and of the antimeridian
    "01KAA8194729394": (-17.8, -179.9999),
    "58CEU3923257811": (-77.85, 166.67),
    "36CVS4181018029": (-79.99, 30.0),
    "YRJ9867108737": (84.5, -100.25),  # around the poles
    "ZAP0562344441": (84.2, 179.5),
    "ZGE3418852343": (85.5, 60.3),
    "YZF9874055668": (88.7, -0.5),
    "ZAH0000000000": (90.0, 0.0),
    "AUX3673392671": (-80.5, -20.1),
    "BPM1879711529": (-81.7, 95.5),
    "AZM5558923079": (-89.2, -150.0),
    "BAS9522722556": (-86.1, 12.7),
    "AJN9831413460": (-80.1, -89.3),
}


@pytest.mark.parametrize("code", MGRS)
def test_mgrs_as_others_write_it(code):
    latitude, longitude = MGRS[code]
    known = replace(secrets(latitude, longitude), near_m=2.0)
    coarse = f"{code[:-10]} {code[-10:-7]} {code[-5:-2]}"
    assert "MGRS" in kinds(f"at {code}.", known) and "MGRS" in kinds(f"at {coarse}", known)
    # Ten metres to the east, or to the north, is not within two.
    for place in (slice(-10, -5), slice(-5, None)):
        metres = int(code[place])
        moved = f"{metres + 10 if metres < 50_000 else metres - 10:05d}"
        other = code[:-10] + (moved + code[-5:] if place.stop else code[-10:-5] + moved)
        assert "MGRS" not in kinds(f"at {other}.", known), other


def test_around_the_poles_places_are_found_as_metres_of_their_grid():
    # By GEOTRANS: ZGE 34188 52343, whose square begins 2 400 km east and 1 700 km north.
    assert places("E 2434188 N 1752343", secrets(85.5, 60.3))
    assert not places("E 2534188 N 1752343", secrets(85.5, 60.3))
    assert not places("E 2434188 N 1752343", secrets(80.5, 60.3))


@given(latitude=some.floats(-84, 84), longitude=some.floats(-179, 179))
@settings(max_examples=20)
def test_codes_are_found_anywhere(latitude, longitude):
    known = secrets(latitude, longitude)
    assert "a geohash" in kinds(f"see {geohash_of(latitude, longitude, 9)}!", known)
    assert "a geohash" in kinds(geohash_of(latitude, longitude, 8).upper(), known)
    assert "a Maidenhead locator" in kinds(f"from {locator_of(latitude, longitude)}", known)
    plus = plus_of(latitude, longitude)
    assert "a plus code" in kinds(f"{plus}+6X", known)
    assert "a plus code" in kinds(f"{plus[4:]}+6X Oslo", known)


# The zone that maps use there, and the one by longitude alone.
@pytest.mark.parametrize(
    ("latitude", "longitude", "zones"),
    [
        (60.3913, 5.3221, {31, 32}),  # Bergen
        (55.9, 5.3221, {31}),
        (64.1, 5.3221, {31}),
        (78.2, 8.9, {32, 31}),  # Svalbard
        (78.2, 9.1, {32, 33}),
        (78.2, 20.9, {34, 33}),
        (78.2, 21.1, {34, 35}),
        (80.0, 32.9, {36, 35}),
        (80.0, 33.1, {36, 37}),
        (71.9, 8.9, {32}),
        (-24.0, 31.5, {36}),
    ],
)
def test_the_zone_by_the_exceptions_of_norway_and_svalbard(latitude, longitude, zones):
    known = secrets(latitude, longitude)
    found = {zone for zone in range(1, 61) if "the zone of UTM" in kinds(f"EPSG:{32600 + zone}", known)}
    assert found == zones


def test_numbers_that_follow_from_the_place_are_found():
    from wildlab.geometry.gravity import normal_gravity

    gravity = float(normal_gravity(np.radians(LATITUDE), 152.738))
    assert "a number that locates" in kinds(f"g = {gravity:.5f} m/s2", secrets())
    assert "a number that locates" not in kinds("g = 9.80665 m/s2, or 9.81", secrets())
    # Cells of a table in one row, as they are where no tag stands between them.
    assert "a number that locates" not in kinds("autopilot120010.00.00.0000.0–0frames", secrets())


def test_the_zone_is_found_and_others_are_not():
    for text in ("EPSG:32632", "EPSG 25832", "UTM zone 32V", "utm32"):
        assert "the zone of UTM" in kinds(text, secrets()), text
    assert "the zone of UTM" not in kinds("EPSG:32634, UTM zone 3, UTM zone 322", secrets())


@pytest.mark.parametrize(
    ("drawn", "found"),
    [
        ('<path d="M4 6 224.4L12.6 41.3h0M300.9 2"/>', False),
        ('<animate values="6,334.6 141.3;62.4 12.7" keyTimes="0;0.4138;0.6838;1"/>', False),
        ('<path d="M62.4138 12.6838"/>', True),
        ('<polyline points="1,2 6224.828,1241.028"/>', True),
        ('<path d="M6224.8 1241.0"/>', True),
        ("<text>62.4138 12.6838</text>", True),
        ('<path data-x="62.4138 12.6838" d="M1 2"/>', True),
    ],
)
def test_lines_of_a_drawing_are_no_places_and_places_among_them_are(tmp_path, drawn, found):
    """Pixels to a tenth hold no place; what is finer or larger in a drawing may."""
    known = replace(secrets(62.4138, 12.6838), words=("M300",))
    said = read(tmp_path, f"<p>a</p><svg viewBox='0 0 900 600'>{drawn}</svg>", known)
    assert any(": place: " in one for one in said) == found, said
    assert not any(": name: " in one or "name" in one.split(": ")[1:2] for one in said), said
