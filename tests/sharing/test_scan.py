"""The second wall: secrets in every spelling that it claims, anywhere on Earth, and what is none of them."""

from __future__ import annotations

import base64
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tests.sharing.spelt import (
    DATES,
    HEIGHT,
    LATITUDE,
    LEAKS,
    LONGITUDE,
    NAME,
    NUMBER,
    SPELLINGS,
    WHEN,
    counted,
    secrets,
)
from wildlab.geometry.gravity import normal_gravity
from wildlab.sharing.places import geohash, locator, plus_code
from wildlab.sharing.scan import Finding, Secrets, SecretSearch, readings, scan, search_limits

# Off the equator and the meridian, where a coordinate is a small number like any other.
# A round number says nothing of a place either: 2.0 stands everywhere.
LATITUDES, LONGITUDES = (
    some.integers(1_500_000, most).filter(lambda a: a % 10_000 > 99).map(lambda a: a / 1e6)
    .flatmap(lambda a: some.sampled_from([a, -a]))
    for most in (78_000_000, 178_000_000)
)  # fmt: skip


def found(text: str, known: Secrets) -> list[tuple[str, str]]:
    return [(kind, written) for kind, written, _ in SecretSearch(known).found_in(text)]


def kinds(text: str, known: Secrets) -> set[str]:
    return {written for _, written in found(text, replace(known, moments=(), words=()))}


def places(text: str, known: Secrets) -> list[str]:
    only = replace(known, moments=(), words=(), numbers=())
    return [written for kind, written in found(text, only) if kind == "place"]


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_each_spelling_is_found(spelling):
    for latitude, longitude in ((LATITUDE, LONGITUDE), (-24.113587, 31.472936), (19.436257, -99.131264)):
        text = f"<p>it was at {SPELLINGS[spelling](latitude, longitude)} then</p>"
        assert places(text, secrets(latitude, longitude)), text


ANYWHERE = sorted(one for one in SPELLINGS if "entities" not in one and "alone" not in one)


@given(latitude=LATITUDES, longitude=LONGITUDES)
@settings(max_examples=15)
def test_each_spelling_is_found_anywhere(latitude, longitude):
    look = SecretSearch(replace(secrets(latitude, longitude), moments=(), words=(), numbers=()))
    missed = [
        (spelling, text)
        for spelling in ANYWHERE
        for text in [SPELLINGS[spelling](latitude, longitude)]
        if not any(hit.kind == "place" for hit in look.hits(text))
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
    assert geohash(latitude, longitude, len(code))[:-1] == code[:-1]


# From the test data of the Open Location Code's own project (encoding).
@pytest.mark.parametrize(
    ("before", "latitude", "longitude"),
    [
        ("7FG49QCJ", 20.3700625, 2.7821875),
        ("8FVC2222", 47.0000625, 8.0000625),
        ("4VCPPQGP", -41.2730625, 174.7859375),
    ],
)
def test_plus_codes_as_published(before, latitude, longitude):
    assert plus_code(latitude, longitude) == before


def test_locators_as_published():
    # Munich and Washington, of the locator's own description; Montevideo; the station W1AW.
    assert locator(48.14666, 11.60833) == "JN58td"
    assert locator(-34.91, -56.21166) == "GF15vc"
    assert locator(41.714775, -72.727260) == "FN31pr"


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
}


@pytest.mark.parametrize("code", MGRS)
def test_mgrs_as_others_write_it(code):
    known = secrets(*MGRS[code])
    coarse = f"{code[:-10]} {code[-10:-7]} {code[-5:-2]}"
    assert "MGRS" in kinds(f"at {code}.", known) and "MGRS" in kinds(f"at {coarse}", known)
    # Twenty kilometres to the east, or to the north, is elsewhere.
    for place in (-10, -5):
        other = f"{code[:place]}{(int(code[place : place + 2]) + 20) % 100:02d}{code[place:][2:]}"
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
    assert "a geohash" in kinds(f"see {geohash(latitude, longitude, 9)}!", known)
    assert "a geohash" in kinds(geohash(latitude, longitude, 8).upper(), known)
    assert "a Maidenhead locator" in kinds(f"from {locator(latitude, longitude)}", known)
    plus = plus_code(latitude, longitude)
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
        ('<path d="M62.4138 12.6838"/>', True),
        ('<polyline points="1,2 6224.828,1241.028"/>', True),
        ('<path d="M6224.8 1241.0"/>', True),
        ("<text>62.4138 12.6838</text>", True),
        ('<path data-x="62.4138 12.6838" d="M1 2"/>', True),
    ],
)
def test_lines_of_a_drawing_are_no_places_and_places_among_them_are(drawn, found):
    """Pixels to a tenth hold no place; what is finer or larger in a drawing may."""
    known = replace(secrets(62.4138, 12.6838), words=("M300",), moments=(), numbers=())
    said = [one.kind for one in scan({"a": f"<p>a</p><svg viewBox='0 0 900 600'>{drawn}</svg>"}, known)]
    assert said == (["place"] * len(said) if found else []) and bool(said) == found, said


def test_tables_within_links_are_read():
    table = base64.b64encode(f"a,b\n{LATITUDE:.4f},{LONGITUDE:.4f}\n".encode()).decode()
    assert places(f'<a download="a.csv" href="data:text/csv;base64,{table}">CSV</a>', secrets())


@pytest.mark.parametrize("way", DATES)
def test_the_day_is_found_and_others_are_not(way):
    known = replace(secrets(), places=np.empty((0, 3)), words=(), numbers=())
    assert any(kind == "date" for kind, _ in found(f"at {WHEN.strftime(way)}, or", known))
    # Far enough for another day everywhere on Earth, another week and another time of day.
    for days in (9.3, -9.3, 40.3):
        other = (WHEN + timedelta(days)).strftime(way)
        assert found(f"at {other}, or", known) == [], other


@pytest.mark.parametrize("way", counted(WHEN))
def test_counts_of_time_are_found_and_others_are_not(way):
    known = replace(secrets(), places=np.empty((0, 3)), words=(), numbers=())
    assert any(kind == "date" for kind, _ in found(f"at {counted(WHEN)[way]}.", known))
    assert found(f"at {counted(WHEN + timedelta(9.3))[way]}.", known) == []


def test_the_month_may_be_said():
    assert found("Flown in May 2023 (UTC), 2023-05", replace(secrets(), numbers=())) == []


@pytest.mark.parametrize(
    "text",
    [NAME, NAME.upper(), "vesle-trollholmen", "VesleTrollholmen", "vesle_trollholmen.bin", "Trollholmen"],
)
def test_names_are_found_and_others_are_not(text):
    known = replace(secrets(), words=(NAME, "Bjørnøya"))
    assert ("name", "a name") in found(f"seen from {text}!", known)
    for other in ("Store Trollhol", "a vessel", "Bjerkøya"):
        assert not [kind for kind, _ in found(other, known) if kind == "name"]
    assert ("name", "a name") in found("near Bjornoya", known)
    assert ("name", "a name") in found("x" + "<b>" + "Bjørn</b>øya", known)


@pytest.mark.parametrize(
    "text",
    [
        f"{NUMBER}", f"{NUMBER:.3f} m", f"undulation {NUMBER:.2f}", f"-{NUMBER}", f"{HEIGHT / 0.3048:.1f} ft",
        f"{HEIGHT / 0.3048:.2f}", "pressure 995.0 hPa",
    ],
)  # fmt: skip
def test_its_heights_are_found_in_metres_feet_and_pressure_and_others_are_not(text):
    assert any(kind == "number" for kind, _ in found(text, secrets()))
    for other in (
        f"{NUMBER + 0.05:.4f}",
        f"geoid {NUMBER + 1:.2f}",
        f"{HEIGHT / 0.3048 + 3:.2f}",
        "height 995.0",
    ):
        assert not [kind for kind, _ in found(other, secrets()) if kind == "number"], other


def test_names_of_files_are_looked_at():
    for name in ("Vesle_Trollholmen.html", "20230517.html", "n63.41798.html", "a-32VNR6932.html"):
        (first, *_) = scan({name: ""}, secrets())
        assert first.file == f"the name of the file {name}"
    assert scan({"flight-public.html": ""}, secrets()) == []


@pytest.mark.parametrize("kind", LEAKS)
def test_a_finding_hides_what_it_found(kind):
    (finding, *_) = scan({"a.html": LEAKS[kind][1]}, secrets())
    assert finding.kind == LEAKS[kind][0] and finding.found
    assert finding.found not in repr(finding) and finding.found not in str(finding)
    assert "63.4" not in repr(secrets()) and isinstance(finding, Finding)


def test_escapes_inside_of_escapes_are_taken_away():
    text = "".join(f"%26%23{ord(letter)};" for letter in f"{LATITUDE} {LONGITUDE}")
    assert f"{LATITUDE} {LONGITUDE}" in readings(text)[-1] and places(text, secrets())


def test_what_is_not_looked_for_is_said():
    said = search_limits(replace(secrets(), words=("boat", "no", "12", "/home/kari/flights")))
    assert any("'boat'" in one for one in said) and any("'no'" in one for one in said)
    assert not any("kari" in one for one in said)
    # A list of a thousand lines hides the one that matters; that one comes first.
    many = search_limits(replace(secrets(), words=("boat", *(f"{n:04d}" for n in range(1046)))))
    assert "'boat'" in many[0] and "1046" in many[1] and len(many) == 3
