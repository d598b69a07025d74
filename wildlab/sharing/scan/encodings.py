"""How a place can be written as two or three numbers, and what those numbers are for the true places."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pymap3d
from numpy.typing import NDArray
from pyproj import Proj

from wildlab.sharing.scan.secrets import Array

#: Metres per degree of latitude, for how near is near.
DEGREE_M = 111_320.0
#: Zones of UTM to either side of the own: Norway counts from zone 31 to 36 in zone 33.
ZONES = 3

#: Where UTM ends and the polar grids begin, deg; they overlap by half a degree.
UPS_FROM = (83.5, -79.5)
#: The grids around the poles (Universal Polar Stereographic).
UPS = {
    name: f"+proj=stere +lat_0={pole} +lon_0=0 +k=0.994 +x_0=2000000 +y_0=2000000 +ellps=WGS84"
    for name, pole in (("north", 90), ("south", -90))
}


class Axis(NamedTuple):
    """One of the numbers.

    Attributes
    ----------
    name
        ``"latitude"``.
    values
        (N,) of the places, without their sign, in the order of the places.
    per_metre
        (N,) how much a metre on the ground changes it.
    decimals
        How many decimals a single one of them needs to count, or None: alone it says too little.
    """

    name: str
    values: Array
    per_metre: Array
    decimals: int | None = None


class Encoding(NamedTuple):
    """One way of writing places.

    Attributes
    ----------
    name
        ``"decimal degrees"``.
    axes
        Two or three.
    decimals
        How many decimals each of two together needs to count.
    """

    name: str
    axes: tuple[Axis, ...]
    decimals: int


def encodings_of(places: Array) -> list[Encoding]:
    """Every way of writing places as numbers that is looked for.

    Parameters
    ----------
    places
        (N, 3) as `Secrets` has them.
    """
    if not len(places):
        return []
    latitude, longitude = places[:, 0], places[:, 1]
    height = np.nan_to_num(places[:, 2])
    across = DEGREE_M * np.maximum(np.cos(np.radians(latitude)), 0.01)
    found = []
    for name, unit, pair, alone in (
        ("decimal degrees", 1.0, 2, 5),
        ("radians", np.pi / 180, 4, 7),
        ("E7 degrees", 1e7, 0, 0),
        ("E6 degrees", 1e6, 0, 0),
        ("milliarcseconds", 3.6e6, 0, 0),
        ("arcseconds", 3600.0, 0, 3),
        ("arcminutes", 60.0, 2, None),
        ("gradians", 10 / 9, 3, None),
    ):
        around = np.where(longitude < 0, longitude + 360, longitude)
        for east in (longitude, around) if (longitude < 0).any() else (longitude,):
            axes: tuple[Axis, ...] = (
                Axis("latitude", np.abs(latitude) * unit, unit / DEGREE_M + 0 * latitude, alone),
                Axis("longitude", np.abs(east) * unit, unit / across, alone),
            )
            found.append(Encoding(name, axes, pair))
    x, y, z = pymap3d.geodetic2ecef(latitude, longitude, height)
    one = np.ones(len(places))
    for name, unit in (("ECEF in metres", 1.0), ("ECEF in kilometres", 1e-3), ("ECEF in centimetres", 100.0)):
        axes = tuple(
            Axis(axis, np.abs(values) * unit, one * unit, 1 if unit == 1 else 4 if unit < 1 else 0)
            for axis, values in (("x", x), ("y", y), ("z", z))
        )
        found.append(Encoding(name, axes, 0 if unit >= 1 else 1))
    return found + _grids(latitude, longitude)


def utm_zones(latitude: float, longitude: float) -> set[int]:
    """The zones of UTM a place is in: by its longitude, and by the exceptions of the standard.

    Zone 32 reaches west to 3 degrees in the band V (southern Norway), and around Svalbard, in the band X, the
    zones 31, 33, 35 and 37 leave nothing to those between. Programs may know the exceptions or not.

    Parameters
    ----------
    latitude, longitude
        Of WGS84, deg.

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


def _grids(latitude: Array, longitude: Array) -> list[Encoding]:
    """Eastings and northings: UTM of the zones around, Web Mercator, and other common grids."""
    zones = {zone for at in zip(latitude, longitude, strict=True) for zone in utm_zones(*map(float, at))}
    around = sorted({(zone - 1 + shift) % 60 + 1 for zone in zones for shift in range(-ZONES, ZONES + 1)})
    grids: list[tuple[str, str, bool]] = [
        (
            f"UTM zone {zone}{' counted from the south' if south else ''}",
            f"+proj=utm +zone={zone} +ellps=WGS84{' +south' if south else ''}",
            zone in zones,
        )
        for zone in around
        for south in (False, True)
    ]
    # A zone of three degrees: Gauss-Krueger writes its number before the easting, South Africa's Lo nothing.
    for middle in sorted({int(m) for m in np.round(longitude / 3)}):
        grids.append(
            (
                f"Gauss-Krueger zone {middle}",
                f"+proj=tmerc +lon_0={3 * middle} +k=1 +x_0={middle * 1_000_000 + 500_000} +ellps=bessel",
                False,
            )
        )
    for middle in sorted({int(2 * np.floor(m / 2) + 1) for m in longitude}):
        grids.append((f"Lo{middle}", f"+proj=tmerc +lon_0={middle} +k=1 +ellps=WGS84", False))
    for name, reached in (("north", latitude.max() > UPS_FROM[0]), ("south", latitude.min() < UPS_FROM[1])):
        if reached:
            grids.append((f"UPS {name}", UPS[name], True))
    grids.append(("Web Mercator", "+proj=webmerc +datum=WGS84", True))
    grids.append(("World Mercator", "+proj=merc +datum=WGS84", True))
    grids.append(
        ("ETRS89 LAEA", "+proj=laea +lat_0=52 +lon_0=10 +x_0=4321000 +y_0=3210000 +ellps=GRS80", False)
    )
    found = []
    for name, definition, own in grids:
        east, north = (np.asarray(metres, float) for metres in Proj(definition)(longitude, latitude))
        good: NDArray[np.bool_] = np.isfinite(east) & np.isfinite(north) & (np.abs(east) < 1e8)
        if not good.any():
            continue
        stretch = (
            np.maximum(1 / np.maximum(np.cos(np.radians(latitude)), 0.05), 1) if "Mercator" in name else 1.0
        )
        axes = tuple(
            Axis(axis, np.where(good, np.abs(values), np.inf), np.full(len(east), stretch), decimals)
            for axis, values, decimals in (
                ("easting", east, 2 if own else None),
                ("northing", north, 1 if own else None),
            )
        )
        found.append(Encoding(name, axes, 0))
    return found
