"""Places and days as they are commonly written, which are looked for, and as codes, which are refused."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache

import numpy as np
from pyproj import Transformer

from wildlab.sharing.scan import Secrets

#: Somewhere in the north of the Baltic Sea, and on both sides of the other hemispheres.
LATITUDE, LONGITUDE, HEIGHT = 63.417982, 10.391237, 152.738
WHEN = datetime(2023, 5, 17, 6, 42, 19, tzinfo=UTC)
NAME = "Vesle Trollholmen"
NUMBER = 40.8217


def secrets(latitude: float = LATITUDE, longitude: float = LONGITUDE) -> Secrets:
    return Secrets(
        places=np.array([[latitude, longitude, HEIGHT]]),
        words={NAME: "flight.toml: name"},
        moments=(WHEN,),
        numbers=(NUMBER,),
    )


def sexagesimal(angle: float, digits: int) -> tuple[int, int, str]:
    """Degrees, minutes, and seconds as text, rounded together."""
    units = round(abs(angle) * 3600 * 10**digits)
    whole, seconds = divmod(units, 60 * 10**digits)
    text = f"{seconds / 10**digits:0{digits + 3 if digits else 2}.{digits}f}"
    return whole // 60, whole % 60, text


def minutes(angle: float, digits: int) -> tuple[int, str]:
    units = round(abs(angle) * 60 * 10**digits)
    whole, rest = divmod(units, 60 * 10**digits)
    return whole, f"{rest / 10**digits:0{digits + 3}.{digits}f}"


@cache
def to_grid(code: int) -> Transformer:
    return Transformer.from_crs(4326, code, always_xy=True)


def _ns(latitude: float) -> str:
    return "N" if latitude >= 0 else "S"


def _ew(longitude: float) -> str:
    return "E" if longitude >= 0 else "W"


def utm(latitude: float, longitude: float) -> tuple[int, float, float]:
    zone = int((longitude + 180) // 6) + 1
    code = (32600 if latitude >= 0 else 32700) + zone
    east, north = to_grid(code).transform(longitude, latitude)
    return zone, east, north


def _dms(pattern: str, digits: int) -> Callable[[float, float], str]:
    def written(latitude: float, longitude: float) -> str:
        a, b = sexagesimal(latitude, digits), sexagesimal(longitude, digits)
        return pattern.format(*a, *b, n=_ns(latitude), e=_ew(longitude))

    return written


def _dm(pattern: str, digits: int) -> Callable[[float, float], str]:
    def written(latitude: float, longitude: float) -> str:
        a, b = minutes(latitude, digits), minutes(longitude, digits)
        return pattern.format(*a, *b, n=_ns(latitude), e=_ew(longitude))

    return written


# ruff: noqa: E501 - one spelling a line
SPELLINGS: dict[str, Callable[[float, float], str]] = {
    "two decimals": lambda a, b: f"{a:.2f}, {b:.2f}",
    "four decimals": lambda a, b: f"{a:.4f} {b:.4f}",
    "all decimals": lambda a, b: f"({a!r}, {b!r})",
    "the other order": lambda a, b: f"[{b:.6f}, {a:.6f}]",
    "decimal commas": lambda a, b: f"{a:.4f}; {b:.4f}".replace(".", ","),
    "in JSON": lambda a, b: f'{{"latitude_deg": {a:.5f},\n  "longitude_deg": {b:.5f}}}',
    "with hemispheres": lambda a, b: f"{_ns(a)} {abs(a):.4f}° {_ew(b)} {abs(b):.4f}°",
    "in an address": lambda a, b: f"https://maps.example/@{a:.5f},{b:.5f},17z",
    "latitude alone": lambda a, b: f"y {a:.6f}",
    "longitude alone": lambda a, b: f"x {b:.6f}",
    "ISO 6709": lambda a, b: f"{a:+010.6f}{b:+011.6f}/",
    "DMS": _dms("{0}°{1:02d}'{2}\"{n} {3}°{4:02d}'{5}\"{e}", 1),
    "DMS, primes": _dms("{0}° {1}′ {2}″ {n}, {3}° {4}′ {5}″ {e}", 2),
    "DMS, whole seconds": _dms("{n} {0}°{1:02d}'{2}\" {e} {3}°{4:02d}'{5}\"", 0),
    "DMS, entities": _dms("{0}&deg;{1}&prime;{2}&Prime;{n} {3}&#176;{4}&#8242;{5}&quot;{e}", 1),
    "DMS, words": _dms("{0} deg {1}' {2}\" {n}, {3} deg {4}' {5}\" {e}", 2),
    "DMS, colons": _dms("{0}:{1:02d}:{2} {n} {3}:{4:02d}:{5} {e}", 1),
    "DMS, blanks": _dms("{0} {1:02d} {2} {n}   {3} {4:02d} {5} {e}", 2),
    "DMS, latitude alone": _dms("{n} {0}°{1:02d}'{2}\"", 0),
    "DM": _dm("{0}° {1}' {n}, {2}° {3}' {e}", 3),
    "UTM": lambda a, b: "{1:.1f} {2:.1f}".format(*utm(a, b)),
    "UTM, whole metres": lambda a, b: "E {1:.0f} N {2:.0f}".format(*utm(a, b)),
    "UTM northing alone": lambda a, b: "N {2:.2f}".format(*utm(a, b)),
    "float32": lambda a, b: f"{float(np.float32(a))!r} {float(np.float32(b))!r}",
}  # fmt: skip


def _tile(latitude: float, longitude: float, zoom: int = 16) -> str:
    """Of a map on the web."""
    x = (longitude + 180) / 360 * 2**zoom
    y = (1 - math.asinh(math.tan(math.radians(latitude))) / math.pi) / 2 * 2**zoom
    return f"{zoom}/{int(x)}/{int(y)}"


#: Spellings that the second wall does not know: they are of no form that a report has.
CODED: dict[str, Callable[[float, float], str]] = {
    "a tile of a map": _tile,
    "base64": lambda a, b: base64.b64encode(f"{a:.4f} {b:.4f}".encode()).decode(),
    "hexadecimal": lambda a, b: f"{a:.4f} {b:.4f}".encode().hex(),
    "float64, hexadecimal": lambda a, b: f"{a.hex()} {b.hex()}",
    "fractions, as in EXIF": lambda a, b: " ".join(
        f"{x}/1 {y}/1 {round(float(z) * 100)}/100" for x, y, z in (sexagesimal(a, 2), sexagesimal(b, 2))
    ),
    "an encoded polyline": lambda a, b: "".join(_polyline(round(v * 1e5)) for v in (a, b)),
    "digits as words": lambda a, b: f"{round(a * 1e7)}x{round(b * 1e7)}",
}  # fmt: skip


def _polyline(value: int) -> str:
    """As routes are handed over on the web."""
    value = ~(value << 1) if value < 0 else value << 1
    letters = ""
    while value >= 0x20:
        letters += chr((0x20 | value & 0x1F) + 63)
        value >>= 5
    return letters + chr(value + 63)


#: The day of `WHEN` in the spellings that are looked for; %-codes of strftime.
DATES = (
    "%Y-%m-%d", "%Y/%m/%d", "%Y:%m:%d", "%Y_%m_%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y",
    "%-m/%-d/%y", "%-d/%-m/%y", "%-d.%-m.%y", "%m/%d/%y", "%d.%m.%y", "%y-%m-%d", "%Y%m%d", "%Y%m%dT%H%M",
    "%Y-%m-%dT%H:%M:%SZ", "%-d %B %Y", "%B %-d, %Y", "%-d. %b %Y", "%b %-d '%y", "%-dth of %B %Y", "%Y %b %-d",
    "%A, %-d %B %Y", "%H:%M:%S", "%-H:%M:%S",
)  # fmt: skip


#: One of each thing that is looked for: what kind it is found as, and how it is written.
LEAKS: dict[str, tuple[str, str]] = {
    "degrees": ("place", SPELLINGS["four decimals"](LATITUDE, LONGITUDE)),
    "DMS": ("place", SPELLINGS["DMS, words"](LATITUDE, LONGITUDE)),
    "UTM": ("place", SPELLINGS["UTM"](LATITUDE, LONGITUDE)),
    "name": ("name", "seen from VESLE_TROLLHOLMEN north"),
    "date": ("date", "on 17 May 2023 it"),
    "number": ("number", "undulation 40.82 m"),
}
