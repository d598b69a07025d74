"""Places as codes: MGRS, geohash, plus codes (Open Location Code), Maidenhead locators, zones of UTM."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from pyproj import Proj

from wildlab.sharing.scan.encodings import DEGREE_M, UPS, UPS_FROM, utm_zones
from wildlab.sharing.scan.hits import Hit
from wildlab.sharing.scan.secrets import Array

GEOHASH = "0123456789bcdefghjkmnpqrstuvwxyz"
PLUS = "23456789CFGHJMPQRVWX"
#: Letters of MGRS' squares: neither I nor O.
SQUARES = "ABCDEFGHJKLMNPQRSTUVWXYZ"
#: Letters of its columns around the poles.
POLAR_COLUMNS = "ABCFGHJKLPQRSTUXYZ"
#: Northings of MGRS begin again after so many squares of 100 km.
ROWS = 20
#: Shorter geohashes and plus codes are coarser than a few kilometres.
SHORTEST_GEOHASH, PLUS_BEFORE = 6, 8

_PLUS = re.compile(
    rf"(?<![A-Z0-9])([{PLUS}]{{2}}(?:[{PLUS}]{{2}}){{1,3}})\+([{PLUS}]{{2,7}})(?![A-Z0-9])", re.IGNORECASE
)
#: Easting and northing of MGRS: to a kilometre or finer.
_DIGITS = r"\s?(\d{2,5}\s\d{2,5}|\d{4,10})(?!\d)"

Cell = tuple[float, float, float, float]


def geohash_cell(code: str) -> Cell:
    """Latitude and longitude of a geohash's middle, and half its height and width, deg.

    Parameters
    ----------
    code
        Small letters.

    Examples
    --------
    >>> latitude, longitude, _, _ = geohash_cell("u4pruydqqvj")
    >>> print(f"{latitude:.5f} {longitude:.5f}")
    57.64911 10.40744
    """
    sides = [[-90.0, 90.0], [-180.0, 180.0]]
    east = True
    for letter in code:
        number = GEOHASH.index(letter)
        for bit in range(4, -1, -1):
            side = sides[int(east)]
            side[1 - (number >> bit & 1)] = sum(side) / 2
            east = not east
    (south, north), (west, right) = sides
    return (south + north) / 2, (west + right) / 2, (north - south) / 2, (right - west) / 2


def geohash_of(latitude: float, longitude: float, length: int) -> str:
    """The geohash of a place, degrees.

    Parameters
    ----------
    latitude, longitude
        Of WGS84, deg.
    length
        How many letters.
    """
    sides = [[-90.0, 90.0], [-180.0, 180.0]]
    east, code = True, ""
    for _ in range(length):
        number = 0
        for _ in range(5):
            side, value = sides[int(east)], longitude if east else latitude
            middle = sum(side) / 2
            number = number << 1 | int(value >= middle)
            side[0 if value >= middle else 1] = middle
            east = not east
        code += GEOHASH[number]
    return code


def plus_cell(before: str, after: str) -> Cell:
    """Latitude and longitude of a full plus code's middle, and half its height and width, deg.

    Parameters
    ----------
    before
        Eight capital letters before the plus.
    after
        Those behind it.

    Examples
    --------
    >>> latitude, longitude, _, _ = plus_cell("8FVC9G8F", "6X")
    >>> print(f"{latitude:.5f} {longitude:.5f}")
    47.36556 8.52494
    """
    letters = before + after
    south, west, step = -90.0, -180.0, 400.0
    tall = wide = 20.0
    for k in range(0, min(len(letters), 10), 2):
        step /= 20
        south += PLUS.index(letters[k]) * step
        if k + 1 < len(letters):
            west += PLUS.index(letters[k + 1]) * step
        tall = wide = step
    for letter in letters[10:]:
        tall, wide = tall / 5, wide / 4
        row, column = divmod(PLUS.index(letter), 4)
        south, west = south + row * tall, west + column * wide
    return south + tall / 2, west + wide / 2, tall / 2, wide / 2


def plus_of(latitude: float, longitude: float) -> str:
    """The eight letters before the plus of a place's code.

    Parameters
    ----------
    latitude, longitude
        Of WGS84, deg.
    """
    # In whole steps of the last letter: fractions of degrees do not divide evenly in binary.
    steps = [min(int((latitude + 90) * 400 + 1e-9), 71_999), int((longitude + 180) % 360 * 400 + 1e-9)]
    code = ""
    for power in (8000, 400, 20, 1):
        for part in steps:
            code += PLUS[part // power % 20]
    return code


def locator_of(latitude: float, longitude: float) -> str:
    """The six letters of a place's Maidenhead locator.

    Parameters
    ----------
    latitude, longitude
        Of WGS84, deg.

    Examples
    --------
    >>> locator_of(48.14666, 11.60833)
    'JN58td'
    """
    east, north = (longitude + 180) % 360, min(latitude + 90, 179.999999)
    field = chr(65 + int(east // 20)) + chr(65 + int(north // 10))
    square = f"{int(east % 20 // 2)}{int(north % 10)}"
    return field + square + chr(97 + int(east % 2 * 12)) + chr(97 + int(north % 1 * 24))


def mgrs_metres(zone: int, column: str, row: str, digits: str) -> tuple[float, float, float] | None:
    """Easting, northing modulo 2000 km, and half the side of the square, m; None where there is none such.

    Parameters
    ----------
    zone
        Of UTM.
    column, row
        The letters of the square of 100 km, capitals.
    digits
        Easting and northing, as many of each.
    """
    if column not in SQUARES or row not in SQUARES[:ROWS]:
        return None
    first = "SAJ"[zone % 3]
    east = SQUARES.index(column) - SQUARES.index(first) + 1
    if not 1 <= east <= 8:
        return None
    north = (SQUARES.index(row) - (5 if zone % 2 == 0 else 0)) % ROWS
    n = len(digits) // 2
    side = 10.0 ** (5 - n)
    return (
        east * 1e5 + int(digits[:n]) * side + side / 2,
        north * 1e5 + int(digits[n:]) * side + side / 2,
        side / 2,
    )


def mgrs_polar_metres(area: str, column: str, row: str, digits: str) -> tuple[float, float, float] | None:
    """Easting and northing of UPS, and half the side of the square, m; None where there is none such.

    Parameters
    ----------
    area
        A and B west and east of the south pole, Y and Z of the north pole.
    column, row
        The letters of the square of 100 km, capitals.
    digits
        Easting and northing, as many of each.
    """
    if column not in POLAR_COLUMNS or row not in SQUARES:
        return None
    column_at = POLAR_COLUMNS.index(column)
    # East of the pole they are counted from it, west of it the last of them ends there.
    east = 20 + column_at if area in "BZ" else 20 - len(POLAR_COLUMNS) + column_at
    north = (8 if area in "AB" else 13) + SQUARES.index(row)
    n = len(digits) // 2
    side = 10.0 ** (5 - n)
    return (
        east * 1e5 + int(digits[:n]) * side + side / 2,
        north * 1e5 + int(digits[n:]) * side + side / 2,
        side / 2,
    )


class Codes:
    """Looks for places that are written as codes."""

    def __init__(self, places: Array, near_m: float) -> None:
        self.places, self.near_m = places, near_m
        self.patterns: dict[str, re.Pattern[str]] = {}
        if not len(places):
            return
        around = [
            (float(np.clip(lat + north, -90, 90)), float(((lon + east) + 180) % 360 - 180))
            for lat, lon in places[:, :2]
            for north in self._steps(1.0)
            for east in self._steps(max(float(np.cos(np.radians(lat))), 0.01))
        ]
        hashes = sorted({geohash_of(lat, lon, 5) for lat, lon in around})
        self.plus = sorted({plus_of(lat, lon) for lat, lon in around})
        zones = {zone for at in around for zone in utm_zones(*at)}
        near = sorted({(zone - 1 + step) % 60 + 1 for zone in zones for step in (-1, 0, 1)})
        zone = "|".join(f"0?{one}" for one in near)
        own = "|".join(f"0?{one}" for one in sorted(zones))
        two = "|".join(f"{one:02d}" for one in sorted(zones))
        locators = "|".join(sorted({locator_of(lat, lon) for lat, lon in around}))
        self.patterns = {
            name: re.compile(pattern, re.IGNORECASE)
            for name, pattern in {
                "geohash": rf"(?<![A-Z0-9])(?:{'|'.join(hashes)})[{GEOHASH}]{{1,7}}(?![A-Z0-9])",
                "MGRS": rf"(?<![A-Z0-9.])({zone})\s?[C-HJ-NP-X]\s?([A-HJ-NP-Z])([A-HJ-NP-V]){_DIGITS}",
                "locator": rf"(?<![A-Z0-9])(?:{locators})(?:[0-9]{{2}}(?:[A-X]{{2}})?)?(?![A-Z0-9])",
                "zone": rf"EPSG\W{{0,12}}(?:326|327|258|230|227)(?:{two})(?!\d)"
                rf"|(?<![A-Z])UTM\W{{0,3}}(?:zone)?\W{{0,3}}(?:{own})(?!\d)",
            }.items()
        }
        if places[:, 0].max() > UPS_FROM[0] or places[:, 0].min() < UPS_FROM[1]:
            self.patterns["polar MGRS"] = re.compile(
                rf"(?<![A-Z0-9.])([ABYZ])\s?([{POLAR_COLUMNS}])([A-HJ-NP-Z]){_DIGITS}", re.IGNORECASE
            )

    def _steps(self, shrink: float) -> Array:
        """Degrees to the sides, no further apart than the smallest cell (of a geohash of five letters)."""
        reach = self.near_m / DEGREE_M / shrink
        return np.linspace(-reach, reach, 2 * int(np.ceil(reach / 0.02)) + 1)

    def found_in(self, text: str) -> Iterator[Hit]:
        """Where a place stands as a code.

        Parameters
        ----------
        text
            Any.
        """
        if not self.patterns:
            return
        for match in self.patterns["geohash"].finditer(text):
            code = match[0].lower()
            telling = len(code) >= 8 or re.search(r"\d", code)
            if (
                len(code) >= SHORTEST_GEOHASH
                and telling
                and not code.isdigit()
                and self._near(geohash_cell(code))
            ):
                yield Hit(match.start(), match.end(), "place", "a geohash")
        for match in _PLUS.finditer(text) if "+" in text else ():
            before, after = match[1].upper(), match[2].upper()
            full = {one[: PLUS_BEFORE - len(before)] + before for one in self.plus}
            if any(self._near(plus_cell(one, after)) for one in full):
                yield Hit(match.start(), match.end(), "place", "a plus code")
        for name in ("MGRS", "polar MGRS"):
            for match in self.patterns[name].finditer(text) if name in self.patterns else ():
                digits = "".join(match[4].split())
                halves = match[4].split()
                if len(digits) % 2 or len({len(half) for half in halves}) > 1:
                    continue
                if self._near_square(match[1].upper(), match[2].upper(), match[3].upper(), digits):
                    yield Hit(match.start(), match.end(), "place", "MGRS")
        for match in self.patterns["locator"].finditer(text):
            yield Hit(match.start(), match.end(), "place", "a Maidenhead locator")
        for match in self.patterns["zone"].finditer(text):
            yield Hit(match.start(), match.end(), "place", "the zone of UTM")

    def _near(self, cell: Cell) -> bool:
        latitude, longitude, tall, wide = cell
        north = np.abs(self.places[:, 0] - latitude) - tall
        east = np.abs((self.places[:, 1] - longitude + 180) % 360 - 180) - wide
        across = np.maximum(np.cos(np.radians(self.places[:, 0])), 0.01)
        reach = self.near_m / DEGREE_M
        return bool(((north <= reach) & (east * across <= reach)).any())

    def _near_square(self, zone: str, column: str, row: str, digits: str) -> bool:
        """Whether a square is near a place; ``zone`` is one of UTM, or an area around a pole."""
        polar = not zone.isdigit()
        if polar:
            metres = mgrs_polar_metres(zone, column, row, digits)
            grid = UPS["south" if zone in "AB" else "north"]
            places = self.places[(self.places[:, 0] < 0) == (zone in "AB")]
        else:
            metres = mgrs_metres(int(zone), column, row, digits)
            grid, places = f"+proj=utm +zone={int(zone)} +ellps=WGS84", self.places
        if metres is None or not len(places):
            return False
        east, north = (np.asarray(one) for one in Proj(grid)(places[:, 1], places[:, 0]))
        off_north = north - metres[1]
        if not polar:
            off_north = (off_north + 1e6) % 2e6 - 1e6
        reach = self.near_m + metres[2]
        return bool(((np.abs(east - metres[0]) <= reach) & (np.abs(off_north) <= reach)).any())
