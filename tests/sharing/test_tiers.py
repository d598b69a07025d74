"""Who is told what: categories against the guide's own numbers, and cells against another library."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from tests.sharing.canary import canary
from wildlab.errors import WildlabError
from wildlab.flight.manifest import FILE_NAME, LocationsPart, manifest_toml, read_manifest
from wildlab.flight.store import accept_changes, confirmed_locations, with_checksums
from wildlab.sharing.tiers import (
    TIERS,
    cell_of,
    confirmed_treatment,
    half_diagonal,
    round_up,
    treatment_of,
)

GEOD = Geod(ellps="WGS84")


@pytest.mark.parametrize(
    ("category", "cell"), [(1, None), (2, 0.1), (3, 0.01), (4, 0.001)], ids=["1", "2", "3", "4"]
)
def test_the_public_is_told_the_cell_of_the_guide(category, cell):
    """GBIF's guide, table 7."""
    for agreed in (None, 4):
        found = treatment_of(LocationsPart(category=category, agreed_category=agreed), "public")
        assert (found.cell_deg, found.date, found.exact, found.stated) == (cell, "month", False, True)


def test_a_cell_is_as_far_off_as_the_guide_says_where_it_is_largest():
    """Chapman and Wieczorek, table 3: what one digit less adds at the equator, corner to corner, metres."""
    for size, added in ((0.1, 15_691), (0.01, 1_570), (0.001, 157)):
        assert 2 * half_diagonal(0.0, size) == pytest.approx(added, abs=1)


@pytest.mark.parametrize(
    ("locations", "category"),
    [
        ({}, 1),
        ({"sensitivity": "withheld"}, 1),
        ({"sensitivity": "generalised"}, 2),
        ({"sensitivity": "open"}, 4),
    ],
)
def test_without_a_category_the_most_careful_that_fits_is_assumed(locations, category):
    found = treatment_of(LocationsPart(**locations), "public")  # type: ignore[arg-type]
    assert (found.category, found.stated) == (category, False)


def test_a_partner_is_told_what_was_agreed_and_else_what_the_public_is():
    found = treatment_of(LocationsPart(category=2, agreed_category=3), "partner")
    assert (found.category, found.cell_deg, found.date) == (3, 0.01, "day")
    for category in (1, 2, 3, 4):
        locations = LocationsPart(category=category)
        one, other = (treatment_of(locations, tier) for tier in ("public", "partner"))
        assert one.cell_deg == other.cell_deg
        assert other.date == ("month" if category < 3 else "day")


def test_no_tier_is_told_less_than_a_more_careful_one():
    order = ["month", "day", "exact"]
    for category in (1, 2, 3, 4):
        found = [treatment_of(LocationsPart(category=category), tier) for tier in TIERS]
        dates = [order.index(one.date) for one in found]
        assert dates == sorted(dates)
        assert [one.exact for one in found] == [False, False, True]


@given(
    st.floats(-89.9, 89.9), st.floats(-179.9, 179.9), st.sampled_from([0.1, 0.01, 0.001]), st.floats(0, 5e3)
)
def test_no_place_is_farther_from_the_named_point_than_is_said(latitude, longitude, size, reach):
    cell = cell_of(latitude, longitude, size, reach)
    _, _, away = GEOD.inv(longitude, latitude, cell.longitude_deg, cell.latitude_deg)
    assert away + reach <= cell.uncertainty_m * 1.0001
    # No digit more than the cell has, and the same for all in the cell.
    assert round(cell.latitude_deg, 3) == cell.latitude_deg
    assert abs(cell.latitude_deg - latitude) <= 1.11 * size / 2 + 1e-9
    assert cell_of(cell.latitude_deg, cell.longitude_deg, size, reach) == cell


def test_what_is_rounded_up_again_and_again_is_within_what_is_said():
    """0.04455 goes to 0.045, to 0.05 and to 0.1: more than half a cell."""
    cell = cell_of(0.04455, 0.04455, 0.1)
    assert (cell.latitude_deg, cell.longitude_deg) == (0.1, 0.1)
    assert half_diagonal(0.1, 0.1) < GEOD.inv(0.04455, 0.04455, 0.1, 0.1)[2] <= cell.uncertainty_m


@given(st.floats(-90, 90), st.floats(-180, 180))
def test_a_coarse_copy_beside_a_finer_one_tells_nothing_more(latitude, longitude):
    """The coarse cell follows from the middle of the finer one."""
    for fine, coarse in ((0.001, 0.01), (0.01, 0.1), (0.001, 0.1)):
        inner, outer = cell_of(latitude, longitude, fine), cell_of(latitude, longitude, coarse)
        again = cell_of(inner.latitude_deg, inner.longitude_deg, coarse)
        assert (again.latitude_deg, again.longitude_deg) == (outer.latitude_deg, outer.longitude_deg)


@given(st.floats(1e-3, 1e6))
def test_an_uncertainty_is_never_rounded_down(metres):
    assert metres <= round_up(metres) * (1 + 1e-12) <= metres * 1.1001
    assert len(f"{round_up(metres):e}".split("e")[0].rstrip("0").replace(".", "")) <= 2


@pytest.fixture(scope="module")
def careful(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight folder whose manifest states category 1; nothing else of it is read here."""
    folder = tmp_path_factory.mktemp("careful")
    text = manifest_toml(canary(locations={"category": 1}).manifest)
    (folder / FILE_NAME).write_text(with_checksums(text, {}))
    return folder


def public(folder: Path) -> tuple[int, int | None]:
    """The category by which the public is told, and one that is stated and not confirmed."""
    stated = read_manifest(folder / FILE_NAME).locations
    found = confirmed_treatment(stated, confirmed_locations(folder), "public")
    return found.category, found.unconfirmed


def test_a_less_careful_category_counts_once_it_is_confirmed(careful, tmp_path):
    path = tmp_path / FILE_NAME
    path.write_text((careful / FILE_NAME).read_text())
    assert public(tmp_path) == (1, None)
    path.write_text(path.read_text().replace("category = 1", "category = 3"))
    assert public(tmp_path) == (1, 3)
    assert accept_changes(tmp_path) == ["locations"]
    assert public(tmp_path) == (3, None)
    # More careful counts at once.
    path.write_text(path.read_text().replace("category = 3", "category = 2"))
    assert public(tmp_path) == (2, None)


def test_no_turned_bit_names_a_place_that_was_withheld(careful, tmp_path):
    whole = (careful / FILE_NAME).read_bytes()
    begin = whole.index(b"[locations]")
    checksum = whole.index(b"locations =", begin)
    places = [*range(begin, begin + 60), *range(checksum, checksum + 40, 3)]
    read = 0
    for place in places:
        for bit in range(8):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << bit
            (tmp_path / FILE_NAME).write_bytes(damaged)
            try:
                assert public(tmp_path)[0] == 1, damaged[place - 20 : place + 20]
                read += 1
            except WildlabError:
                continue
    assert read > 20
