"""Whether a text tells one of a flight's places: as two numbers, as one that says it all, or as a code."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pymap3d
from numpy.typing import NDArray
from pyproj import Proj

from wildlab.sharing.numbers import Array, Hit, Numbers, angles_of

#: Metres per degree of latitude, for how near is near.
DEGREE_M = 111_320.0
#: Zones of UTM to either side of the own: Norway counts from zone 31 to 36 in zone 33.
ZONES = 3
#: Where UTM ends and the polar grids (Universal Polar Stereographic) begin, deg; they overlap by half a
#: degree.
UPS_FROM = (83.5, -79.5)
#: Two numbers further apart in the text than this (characters) do not belong together.
TOGETHER = 160
#: A single number must agree with the true one to this, m, or to its last digit.
ALONE_M = 0.55
#: Names of angles, how many of them a degree has, and the decimals that two together, and that one, needs.
_ANGLES = (
    ("decimal degrees", 1.0, 2, 5), ("radians", np.pi / 180, 4, 7), ("E7 degrees", 1e7, 0, 0),
    ("E6 degrees", 1e6, 0, 0), ("milliarcseconds", 3.6e6, 0, 0), ("arcseconds", 3600.0, 0, 3),
    ("arcminutes", 60.0, 2, None), ("gradians", 10 / 9, 3, None), ("semicircles", 2.0**31 / 180, 0, 0),
    ("turns", 1 / 360, 5, 7),
)  # fmt: skip
#: Codes are made for points that are no further apart than the smallest cells, deg.
CODE_DEG = 0.0025
_GEOHASH = "0123456789bcdefghjkmnpqrstuvwxyz"
_PLUS = "23456789CFGHJMPQRVWX"
_LOOKS_LIKE = {
    "a plus code": re.compile(rf"[{_PLUS}]{{4}}\+[{_PLUS}]{{2}}", re.IGNORECASE),
    "MGRS": re.compile(r"\d\s?[C-X]\s?[A-Z]{2}\s?\d{2}", re.IGNORECASE),
}
#: Letters of MGRS' squares: neither I nor O.
_SQUARES = "ABCDEFGHJKLMNPQRSTUVWXYZ"


class Axis(NamedTuple):
    """One of the numbers of a place.

    Attributes
    ----------
    name
        ``"latitude"``.
    values
        (N,) of the places, without their sign.
    per_metre
        (N,) how much a metre on the ground changes it.
    decimals
        How many decimals a single one needs to count, or None: alone it says too little.
    """

    name: str
    values: Array
    per_metre: Array
    decimals: int | None = None


class Encoding(NamedTuple):
    """One way of writing places: its name, two or three axes, the decimals that two together need."""

    name: str
    axes: tuple[Axis, ...]
    decimals: int


class Places:
    """Looks for places in texts.

    Parameters
    ----------
    places
        (N, 3) latitude and longitude (deg, WGS84), height above the ellipsoid (m; NaN where not known).
    near_m
        How near to one of them a written place is a leak.
    cell_deg
        Places on this grid may be written; 0 means that none may.
    """

    def __init__(self, places: Array, near_m: float, cell_deg: float = 0.0) -> None:
        self.near_m, self.cell_deg = near_m, cell_deg
        self.encodings = [*_angles(places), *_earth_centred(places), *_grids(places)] if len(places) else []
        self.ranges = [
            [_ranges(axis, near_m, encoding.decimals) for axis in encoding.axes]
            for encoding in self.encodings
        ]
        self.degrees = {
            degree
            for encoding, ranges in zip(self.encodings, self.ranges, strict=True)
            for low, high in ranges
            for begin, end in zip(low, high, strict=True)
            if encoding.name == "decimal degrees"
            for degree in range(max(int(begin), 0), int(end) + 1)
        }
        self.codes = _codes(places, near_m) if len(places) else {}

    def found_in(self, text: str, numbers: Numbers) -> Iterator[Hit]:
        """Where a place stands in a text, whose numbers are given."""
        for name, pattern in self.codes.items():
            # Thousands of codes are only looked for where anything looks like one.
            there = name not in _LOOKS_LIKE or _LOOKS_LIKE[name].search(text)
            for match in pattern.finditer(text) if there else ():
                if not match[0].isdigit() and (name != "a geohash" or _is_geohash(match[0])):
                    yield Hit(match.start(), match.end(), "place", name)
        for encoding, ranges in zip(self.encodings, self.ranges, strict=True):
            degrees = encoding.name == "decimal degrees"
            yield from self._written(numbers, encoding, ranges, self.cell_deg if degrees else 0.0)
            if degrees:
                for name, angles in angles_of(text, numbers, self.degrees):
                    yield from self._written(angles, encoding._replace(name=name), ranges, 0.0)

    def _written(
        self, numbers: Numbers, encoding: Encoding, ranges: list[tuple[Array, Array]], cell: float
    ) -> Iterator[Hit]:
        found = [numbers.take(_within(numbers.value, *one)) for one in ranges]
        if cell > 0:
            found = [one.take(np.abs(one.value / cell - np.round(one.value / cell)) > 1e-6) for one in found]
        for axis, some in zip(encoding.axes, found, strict=True):
            yield from _alone(some, axis, encoding.name)
        fine = [one.take(one.decimals >= encoding.decimals) for one in found]
        for one, other in combinations(range(len(encoding.axes)), 2):
            yield from self._pairs(encoding, (one, other), fine[one], fine[other])

    def _pairs(self, encoding: Encoding, which: tuple[int, int], a: Numbers, b: Numbers) -> Iterator[Hit]:
        """Two numbers that belong to the same place and stand close together."""
        one, other = (encoding.axes[k] for k in which)
        for i in range(len(a.start)) if len(b.start) else ():
            gap = np.maximum(a.start[i] - b.end, b.start - a.end[i])
            # Below zero the two overlap: two readings of one and the same number.
            for j in np.flatnonzero((gap >= 0) & (gap <= TOGETHER)):
                near = np.abs(a.value[i] - one.values) <= self.near_m * one.per_metre + a.half[i]
                near &= np.abs(b.value[j] - other.values) <= self.near_m * other.per_metre + b.half[j]
                if near.any():
                    start, end = min(a.start[i], b.start[j]), max(a.end[i], b.end[j])
                    yield Hit(int(start), int(end), "place", f"{one.name} and {other.name}, {encoding.name}")


def _alone(numbers: Numbers, axis: Axis, name: str) -> Iterator[Hit]:
    """Numbers so fine, and so much those of a place, that one of them gives it away."""
    if axis.decimals is None:
        return
    some = numbers.take(numbers.decimals >= axis.decimals)
    off = np.abs(some.value[:, None] - axis.values)
    close = (off <= np.maximum(ALONE_M * axis.per_metre, some.half[:, None])).any(axis=1)
    for start, end in zip(some.start[close], some.end[close], strict=True):
        yield Hit(int(start), int(end), "place", f"{axis.name}, {name}")


def _ranges(axis: Axis, near_m: float, decimals: int) -> tuple[Array, Array]:
    """Where numbers may lie that are near to a value of an axis: begins and ends (M,), none overlapping."""
    good = np.isfinite(axis.values)
    around = (near_m * axis.per_metre + 0.5 * 10.0**-decimals)[good]
    order = np.argsort(axis.values[good] - around)
    low = (axis.values[good] - around)[order]
    high = np.maximum.accumulate((axis.values[good] + around)[order])
    new = np.concatenate(([True], low[1:] > high[:-1])) if len(low) else np.zeros(0, bool)
    return low[new], high[np.concatenate((new[1:], [True])) if len(low) else new]


def _within(values: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    if not len(low):
        return np.zeros(len(values), bool)
    index = np.searchsorted(low, values, "right") - 1
    return np.asarray((index >= 0) & (values <= high[np.maximum(index, 0)]))


def _angles(places: Array) -> Iterator[Encoding]:
    latitude, longitude = places[:, 0], places[:, 1]
    across = DEGREE_M * np.maximum(np.cos(np.radians(latitude)), 0.01)
    eastwards = [longitude, longitude % 360] if (longitude < 0).any() else [longitude]
    for name, unit, pair, alone in _ANGLES:
        for east in eastwards:
            axes = (
                Axis("latitude", np.abs(latitude) * unit, unit / DEGREE_M + 0 * latitude, alone),
                Axis("longitude", np.abs(east) * unit, unit / across, alone),
            )
            yield Encoding(name, axes, pair)


def _earth_centred(places: Array) -> Iterator[Encoding]:
    metres = pymap3d.geodetic2ecef(places[:, 0], places[:, 1], np.nan_to_num(places[:, 2]))
    for name, unit, alone, pair in (
        ("metres", 1.0, 1, 0),
        ("kilometres", 1e-3, 4, 1),
        ("centimetres", 100.0, 0, 0),
    ):
        axes = (
            Axis(axis, np.abs(one) * unit, np.full(len(one), unit), alone)
            for axis, one in zip("xyz", metres, strict=True)
        )
        yield Encoding(f"ECEF in {name}", tuple(axes), pair)


def utm_zones(latitude: float, longitude: float) -> set[int]:
    """The zones of UTM a place is in: by its longitude, and by the exceptions of the standard.

    Zone 32 reaches west to 3 degrees in the band V (southern Norway), and around Svalbard, in the band X, the
    zones 31, 33, 35 and 37 leave nothing to those between. Programs may know the exceptions or not.

    Examples
    --------
    Bergen:

    >>> sorted(utm_zones(60.39, 5.32))
    [31, 32]
    """
    zones = {int((longitude + 180) // 6) % 60 + 1}
    if 56 <= latitude < 64 and 3 <= longitude < 12:
        zones.add(32)
    if latitude >= 72 and 0 <= longitude < 42:
        zones.add(31 + 2 * int((longitude + 3) // 12))
    return zones


def _zones(places: Array) -> set[int]:
    return {zone for latitude, longitude in places[:, :2] for zone in utm_zones(latitude, longitude)}


def _grids(places: Array) -> Iterator[Encoding]:
    """Eastings and northings: UTM of the zones around, Web Mercator, and other common grids."""
    latitude, longitude = places[:, 0], places[:, 1]
    zones = _zones(places)
    around = sorted({(zone - 1 + shift) % 60 + 1 for zone in zones for shift in range(-ZONES, ZONES + 1)})
    polar = "+proj=stere +lat_0={} +lon_0=0 +k=0.994 +x_0=2000000 +y_0=2000000 +ellps=WGS84"
    grids = [
        (f"UTM zone {zone}{words}", f"+proj=utm +zone={zone} +ellps=WGS84{south}", zone in zones)
        for zone in around
        for words, south in (("", ""), (" counted from the south", " +south"))
    ]
    # A zone of three degrees: Gauss-Krueger writes its number before the easting, South Africa's Lo nothing.
    grids += [
        (
            f"Gauss-Krueger zone {m}",
            f"+proj=tmerc +lon_0={3 * m} +k=1 +x_0={m * 1_000_000 + 500_000} +ellps=bessel",
            False,
        )
        for m in sorted({int(m) for m in np.round(longitude / 3)})
    ]
    grids += [
        (f"Lo{m}", f"+proj=tmerc +lon_0={m} +k=1 +ellps=WGS84", False)
        for m in sorted({int(2 * np.floor(m / 2) + 1) for m in longitude})
    ]
    grids += [("UPS north", polar.format(90), True)] if latitude.max() > UPS_FROM[0] else []
    grids += [("UPS south", polar.format(-90), True)] if latitude.min() < UPS_FROM[1] else []
    grids += [
        ("Web Mercator", "+proj=webmerc +datum=WGS84", True),
        ("World Mercator", "+proj=merc +datum=WGS84", True),
        ("ETRS89 LAEA", "+proj=laea +lat_0=52 +lon_0=10 +x_0=4321000 +y_0=3210000 +ellps=GRS80", False),
    ]
    for name, definition, own in grids:
        metres = [np.abs(np.asarray(one, float)) for one in Proj(definition)(longitude, latitude)]
        good = (metres[0] < 1e8) & (metres[1] < 1e8)
        if not good.any():
            continue
        stretch = (
            1 / np.clip(np.cos(np.radians(latitude)), 0.05, 1) if "Mercator" in name else 1 + 0 * latitude
        )
        axes = (
            Axis(axis, np.where(good, values, np.inf), stretch, alone if own else None)
            for axis, values, alone in zip(("easting", "northing"), metres, (2, 1), strict=True)
        )
        yield Encoding(name, tuple(axes), 0)


def _codes(places: Array, near_m: float) -> dict[str, re.Pattern[str]]:
    """Patterns of the codes of all that is near: geohash, plus code, locator, MGRS, and UTM's zone."""
    north = near_m / DEGREE_M
    around = {
        (round(lat / CODE_DEG) + i, round(lon / CODE_DEG) + k)
        for lat, lon in np.unique(np.round(places[:, :2], 2), axis=0)
        for i in _steps(north)
        for k in _steps(north / max(float(np.cos(np.radians(lat))), 0.01))
    }
    around = {
        (float(np.clip(i * CODE_DEG, -90, 90)), (k * CODE_DEG + 180) % 360 - 180) for i, k in around
    } | {(float(lat), float(lon)) for lat, lon in places[:, :2]}
    zones = _zones(places)
    beside = zones.union(*(utm_zones(*at) for at in around))
    squares = sorted({one for at in around for one in mgrs_squares(*at, beside)})
    full = {plus_code(*at) for at in around}
    # Without the letters of its region, as people say it: 9G8F+6X Oslo.
    plus = "|".join(sorted({*full, *(one[4:] for one in full)}))
    one, two = ("|".join(format(zone, form) for zone in zones) for form in ("d", "02d"))
    patterns = {
        "a geohash": rf"(?<![A-Z0-9])(?:{'|'.join(sorted({geohash(*at, 5) for at in around}))})"
        rf"[{_GEOHASH}]{{1,7}}(?![A-Z0-9])",
        "a plus code": rf"(?<![A-Z0-9])(?:{plus})\+[{_PLUS}]{{2,7}}(?![A-Z0-9])",
        "a Maidenhead locator": rf"(?<![A-Z0-9])(?:{'|'.join(sorted({locator(*at) for at in around}))})"
        r"(?:\d{2}(?:[A-X]{2})?)?(?![A-Z0-9])",
        "MGRS": rf"(?<![A-Z0-9.])(?:{'|'.join(squares) or '(?!)'})(?!\d)",
        "the zone of UTM": rf"EPSG\W{{0,12}}(?:326|327|258|230|227)(?:{two})(?!\d)"
        rf"|(?<![A-Z])UTM\W{{0,3}}(?:zone)?\W{{0,3}}0?(?:{one})(?!\d)",
    }  # fmt: skip
    return {name: re.compile(pattern, re.IGNORECASE) for name, pattern in patterns.items()}


def _steps(reach: float) -> range:
    most = int(np.ceil((reach + 0.005) / CODE_DEG))
    return range(-most, most + 1)


def _is_geohash(code: str) -> bool:
    return len(code) >= 8 or any(letter.isdigit() for letter in code)


def geohash(latitude: float, longitude: float, length: int) -> str:
    """The geohash of a place (deg, WGS84), so many letters long."""
    low, high, number = [-180.0, -90.0], [180.0, 90.0], 0
    for k in range(5 * length):
        axis, value = k % 2, (longitude, latitude)[k % 2]
        middle = (low[axis] + high[axis]) / 2
        number = number << 1 | int(value >= middle)
        (low if value >= middle else high)[axis] = middle
    return "".join(_GEOHASH[number >> 5 * k & 31] for k in reversed(range(length)))


def plus_code(latitude: float, longitude: float) -> str:
    """The eight letters before the plus of a place's Open Location Code (deg, WGS84)."""
    # In whole steps of the last letter: fractions of degrees do not divide evenly in binary.
    steps = min(int((latitude + 90) * 400 + 1e-9), 71_999), int((longitude + 180) % 360 * 400 + 1e-9)
    return "".join(_PLUS[part // power % 20] for power in (8000, 400, 20, 1) for part in steps)


def locator(latitude: float, longitude: float) -> str:
    """The six letters of a place's Maidenhead locator (deg, WGS84).

    Examples
    --------
    >>> locator(48.14666, 11.60833)
    'JN58td'
    """
    east, north = (longitude + 180) % 360, min(latitude + 90, 179.999999)
    coarse, fine = (east // 20, north // 10), (east % 2 * 12, north % 1 * 24)
    upper, lower = ("".join(chr(a + int(one)) for one in two) for a, two in ((65, coarse), (97, fine)))
    return f"{upper}{int(east % 20 // 2)}{int(north % 10)}{lower}"


@cache
def _utm(zone: int) -> Proj:
    return Proj(f"+proj=utm +zone={zone} +ellps=WGS84")


def mgrs_squares(latitude: float, longitude: float, zones: Iterable[int]) -> Iterator[str]:
    """Patterns of MGRS for the square of a kilometre that a place is in (deg, WGS84), or finer, by zones."""
    if not UPS_FROM[1] - 0.5 <= latitude <= UPS_FROM[0] + 0.5:
        return
    for zone in sorted(zones):
        east, north = _utm(zone)(longitude, latitude)
        column = "SAJ"[zone % 3]
        column = _SQUARES[(_SQUARES.index(column) + int(east // 1e5) - 1) % len(_SQUARES)]
        row = _SQUARES[(int(north // 1e5) + (5 if zone % 2 == 0 else 0)) % 20]
        km = f"{int(east % 1e5 // 1e3):02d}\\d{{0,3}}\\s?{int(north % 1e5 // 1e3):02d}\\d{{0,3}}"
        yield rf"0?{zone}\s?[C-HJ-NP-X]\s?{column}{row}\s?{km}"
