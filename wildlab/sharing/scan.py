"""The second wall: whether what is about to be sent tells one of the secrets that are known of a flight.

Pages are written from an allow-list (`wildlab.sharing.allow_list`), which refuses what is no words, numbers
or drawings of ours. What is of the right form may still be the flight's: its places, dates, names, heights
and other numbers that locate are looked for here in their common spellings. Not looked for: what is drawn
(the pixels of pictures), and what was hidden on purpose. The secrets are gathered here too: of the machine
always, of a flight where it is generalised.
"""

from __future__ import annotations

import base64
import binascii
import getpass
import html
import re
import socket
import sys
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.heights import undulation
from wildlab.flight.manifest import Manifest
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import parse_settings
from wildlab.geometry.frames import Array, ned_to_geodetic
from wildlab.geometry.gravity import EARTH_RATE, normal_gravity
from wildlab.paths import ROOT
from wildlab.sharing.allow_list import own_phrases, own_vocabulary
from wildlab.sharing.generalisation import Generalised, first_stamp, new_origin
from wildlab.sharing.names import names_in
from wildlab.sharing.numbers import Dates, Hit, Numbers, numbers_of
from wildlab.sharing.places import Places
from wildlab.sharing.reports import Source
from wildlab.sharing.tiers import Treatment

#: Of one kind in one file; the rest is counted in one finding.
MOST_OF_A_KIND = 8
#: Names: shorter ones are only found where they stand alone, or not at all; so many hits of one are listed.
LONG, SHORTEST, MOST = 4, 3, 20
#: Of names that cannot be looked for, for one reason, so many are told.
MOST_TOLD = 12
#: A number stands for itself where so many digits agree with the true one; beside a word that says what it is
#: (within so many characters), so many do.
DIGITS, BESIDE, NEAR = 5, 3, 40
_SAYING = re.compile(
    r"undulation|geoid|origin|ellipsoid|altitude|elevation|above\s+sea|sea\s+level|amsl|declination"
    r"|inclination|gravity|h[oö]he|høyde|hoyde|terrain|_msl|height_m|pressure|\bft\b|\bfeet\b",
    re.IGNORECASE,
)
# WGS84: semi-major axis (m), first eccentricity squared.
_A, _E2 = 6378137.0, 6.69437999014e-3
FEET = 0.3048
#: Signs that stand for others: minus, primes, thin blanks, ordinals for degrees.
_ALIKE = str.maketrans({
    **dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\ufe63\uff0d", "-"),
    **dict.fromkeys("\u2032\u2018\u2019\u02b9\u00b4", "'"),
    **dict.fromkeys("\u2033\u201c\u201d\u02ba", '"'),
    **dict.fromkeys("\u00a0\u2007\u2008\u2009\u200a\u202f\u2060", " "),
    **dict.fromkeys("\u00ba\u02da\u2070", "\u00b0"),
    **dict.fromkeys("\u200b\u200c\u200d\ufeff\u00ad", ""),
    "\u066b": ".", "\u066c": ",", "\uff0e": ".",
})  # fmt: skip
_OTHER_DIGIT = re.compile(r"(?![0-9])\d")
_DATA = re.compile(r"data:([\w/+.-]+);base64,([A-Za-z0-9+/=]*)")
_TAG = re.compile(r"<(?:!--|-->|/?[A-Za-z][^<>]{0,2000}>)")
#: Lines of drawings, and when they move. Among thousands of numbers in pixels some pair always is somebody's
#: place; none hides in tenths of pixels within a sheet (below 2000), so of those nothing is read.
_DRAWN = re.compile(r"""(\s(?:d|points|transform)=")([A-Za-z0-9.,;()\s+-]*)(?=")""")
_PAPER = re.compile(r"(?:[^\d.]*+(?:1?\d{1,3}(?:\.\d)?|\.\d\d?)(?!\.?\d))*+[^\d.]*")
_PARTS = re.compile(r"[^\W_]+")
#: What has no letters of the Latin alphabet to stand for it when signs above letters are lost.
_PLAIN = str.maketrans({"ø": "o", "æ": "ae", "œ": "oe", "ß": "ss", "ł": "l", "đ": "d", "ð": "d", "þ": "th"})
_SIGNS = re.compile("[\u0300-\u036f]")


@dataclass(frozen=True)
class Secrets:
    """What must not be in what is sent. Printed, it shows none of it.

    Attributes
    ----------
    places
        (N, 3) latitude and longitude (deg, WGS84), height above the ellipsoid (m; NaN where not known).
    near_m
        How near to one of them a written place is a leak.
    cell_deg
        Places on this grid may be written (0.1: 60.1 N 10.3 E); 0 means that none may.
    words
        Names, labels, file names, folders, users, hosts, hashes.
    moments
        UTC, with a zone: when it was, where only the month may be said. The days they fall on are looked for,
        and their seconds.
    numbers
        Other numbers that locate: heights, the geoid's undulation, gravity, declination. Their sign does not
        count.
    """

    places: Array = field(default_factory=lambda: np.empty((0, 3)), repr=False)
    near_m: float = 1000.0
    cell_deg: float = 0.0
    words: tuple[str, ...] = field(default=(), repr=False)
    moments: tuple[datetime, ...] = field(default=(), repr=False)
    numbers: tuple[float, ...] = field(default=(), repr=False)


@dataclass(frozen=True)
class Finding:
    """Something that must not be in what is sent.

    Attributes
    ----------
    file
        Its name.
    kind
        ``"place"``, ``"date"``, ``"name"`` or ``"number"``.
    written
        How: ``"latitude and longitude, decimal degrees"``.
    found
        The text itself, shortened: for the sender's eyes, so it is not shown when printed.
    """

    file: str
    kind: str
    written: str
    found: str = field(default="", repr=False)

    def __str__(self) -> str:
        return f"{self.file}: {self.kind}: {self.written}"


def scan(files: Mapping[str, str], secrets: Secrets | SecretSearch) -> list[Finding]:
    """What must not be in texts and their names, and is.

    Parameters
    ----------
    files
        Texts by the names under which they are sent.
    secrets
        What is looked for; prepared before, where several are looked through.

    Returns
    -------
    list
        Findings; empty where nothing was found.

    Examples
    --------
    >>> known = Secrets(places=np.array([[60.12342, 10.25022, 40.0]]))
    >>> print(scan({"page.html": "<p>60&deg; 7' 24.3&quot; N, 10&deg; 15' 0.8&quot; E</p>"}, known)[0])
    page.html: place: latitude and longitude, degrees, minutes and seconds
    """
    sought = secrets if isinstance(secrets, SecretSearch) else SecretSearch(secrets)
    findings: list[Finding] = []
    for name, content in files.items():
        for where, text in ((f"the name of the file {name}", name), (name, content)):
            found = dict.fromkeys((kind, how, excerpt) for kind, how, excerpt in sought.found_in(text))
            kinds = {kind: [one for one in found if one[0] == kind] for kind, *_ in found}
            for several in kinds.values():
                findings += [Finding(where, *one) for one in several[:MOST_OF_A_KIND]]
                if len(several) > MOST_OF_A_KIND:
                    kind, how, _ = several[MOST_OF_A_KIND]
                    findings.append(
                        Finding(where, kind, f"{how}: {len(several) - MOST_OF_A_KIND} more like this")
                    )
    return findings


class SecretSearch:
    """What is looked for, prepared once for all texts."""

    def __init__(self, secrets: Secrets) -> None:
        places = np.asarray(secrets.places, float).reshape(-1, 3)
        self.phrases = list(dict.fromkeys(
            spelt for phrase in phrases_of(secrets.words)[0] for spelt in (phrase, tuple(map(_bare, phrase)))
        ))  # fmt: skip
        self.places = Places(places, secrets.near_m, secrets.cell_deg)
        self.dates = Dates(secrets.moments)
        self.numbers = sorted(
            {abs(float(one)) for one in (*secrets.numbers, *derived_numbers(places)) if one}
        )

    def found_in(self, text: str) -> Iterator[tuple[str, str, str]]:
        """Kind, spelling and excerpt of all that is found, in all readings of a text."""
        for reading in readings(text):
            for hit in self.hits(reading):
                piece = reading[max(hit.start - 12, 0) : min(hit.end, hit.start + 120) + 12]
                yield hit.kind, hit.written, re.sub(r"\s+", " ", piece)

    def hits(self, text: str) -> Iterator[Hit]:
        """All that is found in one reading."""
        yield from self._names(text)
        text = text.translate(_ALIKE)
        text = _OTHER_DIGIT.sub(lambda one: str(int(one[0])) if one[0].isdecimal() else "?", text)
        numbers = numbers_of(text)
        yield from self.dates.found_in(text, numbers)
        yield from _scalars(text, numbers, self.numbers)
        yield from self.places.found_in(text, numbers)

    def _names(self, text: str) -> Iterator[Hit]:
        small = unicodedata.normalize("NFKC", text).casefold()
        for spelt in dict.fromkeys((small, _bare(small))):
            # Most words are ruled out at once by the different words of the text.
            haystack = "\n".join(set(_PARTS.findall(spelt)))
            for phrase in self.phrases:
                if all(part in haystack for part in phrase):
                    body = r"[\W_]{0,3}".join(re.escape(part) for part in phrase)
                    short = len("".join(phrase)) < LONG
                    pattern = rf"(?<![^\W_]){body}(?![^\W_])" if short else body
                    for match in islice(re.finditer(pattern, spelt), MOST):
                        yield Hit(match.start(), match.end(), "name", "a name")


def readings(text: str) -> list[str]:
    """A text without its pictures and drawings and with its tables; without its escapes; without its tags."""
    tables: list[str] = []

    def packed(match: re.Match[str]) -> str:
        if match[1] == "image/png":
            return " "
        try:
            tables.append(base64.b64decode(match[2], validate=True).decode("utf-8", "replace"))
        except binascii.Error:
            return match[0]
        return " "

    def drawn(match: re.Match[str]) -> str:
        return match[1] if _PAPER.fullmatch(match[2]) else match[0]

    text = _DATA.sub(packed, text)
    if "<svg" in text:
        text = _DRAWN.sub(drawn, text)
    found = [text]
    for _ in range(3):  # escapes may stand inside of escapes
        found.append(unquote(html.unescape(found[-1]), errors="replace"))
    bare = [_TAG.sub("", found[-1]), _TAG.sub(" ", found[-1])] if _TAG.search(found[-1]) else []
    return list(dict.fromkeys([*found, *bare, *tables]))


def search_limits(secrets: Secrets) -> list[str]:
    """What of the secrets is not looked for, and why: sentences for the sender."""
    said = phrases_of(secrets.words)[1]
    return [*said, "What is drawn is not read: the pixels of pictures, and letters drawn as outlines."]


def _bare(text: str) -> str:
    """Without the signs above letters: ``"bjornoya"``."""
    return text if text.isascii() else _SIGNS.sub("", unicodedata.normalize("NFKD", text.translate(_PLAIN)))


def parts_of(word: str) -> tuple[str, ...]:
    """The parts of a word, in small letters: ``("nordre", "fjell")`` of ``"Nordre_Fjell"``."""
    return tuple(_PARTS.findall(unicodedata.normalize("NFKC", word).casefold()))


def phrases_of(words: Iterable[str]) -> tuple[list[tuple[str, ...]], list[str]]:
    """What can be looked for of names, in parts; and sentences on what cannot, and why, the rarest first.

    Parameters
    ----------
    words
        As they are: paths are taken apart, and so are names with blanks, - and _.
    """
    wanted: dict[tuple[str, ...], None] = {}
    skipped: dict[str, dict[str, None]] = {}
    for word in dict.fromkeys(words):
        for piece in (piece for piece in re.split(r"[/\\]", word) if piece.strip()):
            stem = piece.rpartition(".")[0] or piece
            for one in dict.fromkeys((piece, stem)):
                phrase = parts_of(one)
                reason = _useless(phrase)
                if not reason:
                    wanted[phrase] = None
                elif one == piece and phrase:
                    skipped.setdefault(reason, {})[one] = None
            telling = [part for part in parts_of(stem) if len(part) >= LONG and not part.isdigit()]
            wanted.update({(part,): None for part in telling if part not in own_vocabulary()})
    rare = sorted(skipped.items(), key=lambda one: len(one[1]))
    said = []
    for reason, ones in rare:
        some = ", ".join(map(repr, islice(ones, MOST_TOLD))) + (" and so on" if len(ones) > MOST_TOLD else "")
        said.append(f"{len(ones)} of the names are not looked for, {some}; of each: {reason}")
    return list(wanted), said


def _useless(phrase: tuple[str, ...]) -> str:
    """Why a phrase cannot be looked for; nothing where it can."""
    joined = "".join(phrase)
    if len(joined) < SHORTEST:
        return f"it has fewer than {SHORTEST} letters, and stands everywhere"
    if joined.isdigit() and len(joined) < 6:
        return "it is a short number, and stands everywhere"
    if all(part in own_vocabulary() for part in phrase) and f" {' '.join(phrase)} " in own_phrases():
        return "wildlab's own reports use it"
    return ""


def derived_numbers(places: Array, most: int = 3) -> list[float]:
    """Numbers that follow from a place and give it away: gravity, the geoid's undulation, radii of the Earth,
    what a degree measures, its height in feet and the pressure of the standard atmosphere there (hPa).

    Parameters
    ----------
    places
        (N, 3) as `Secrets` has them, the origin first: of so many only, since of more, by chance one number
        is always among those of a page.
    """
    some = places[:most]
    if not len(some):
        return []
    latitude, height = np.radians(some[:, 0]), np.nan_to_num(some[:, 2])
    s2 = np.sin(latitude) ** 2
    meridian, normal = _A * (1 - _E2) / (1 - _E2 * s2) ** 1.5, _A / np.sqrt(1 - _E2 * s2)
    degree = np.radians(1.0)
    heights = undulation(some[:, 0], some[:, 1])
    found = [
        normal_gravity(latitude, height),
        meridian, normal, meridian * degree, normal * np.cos(latitude) * degree,
        EARTH_RATE * np.cos(latitude), EARTH_RATE * np.sin(latitude),
        height / FEET, 1013.25 * (1 - 2.25577e-5 * np.clip(height, -1e3, 1e4)) ** 5.25588,
        *([] if heights is None else [heights, (height - heights) / FEET]),
    ]  # fmt: skip
    return [float(value) for value in np.concatenate(found) if np.isfinite(value)]


def _scalars(text: str, numbers: Numbers, true: Iterable[float]) -> Iterator[Hit]:
    """Where one of the true numbers is written: to five digits, or to three beside a word that names it."""
    digits = numbers.digits
    for value in true:
        size = 10.0 ** np.floor(np.log10(value))
        off = np.abs(numbers.value - value)
        # Rounded to its last digit, or cut off after it.
        fits = off <= np.maximum(numbers.half * 1.000001, size * 1e-9)
        fits |= (numbers.value < value) & (off < 2 * numbers.half)
        fits |= (off <= size * 10.0 ** (1 - DIGITS) / 2) & (digits > DIGITS)
        # A zero has no digit that agrees, however many it is written with.
        for k in np.flatnonzero(fits & (numbers.value > 0) & (digits >= BESIDE)):
            start, end = int(numbers.start[k]), int(numbers.end[k])
            if digits[k] >= DIGITS:
                yield Hit(start, end, "number", "a number that locates")
            elif _SAYING.search(text[max(start - NEAR, 0) : end + NEAR]):
                yield Hit(start, end, "number", "a number that locates, named beside it")


#: So many places of each table are looked for; the scan finds what is near to one of them.
_PLACES_EACH = 20
#: A place that is written and lies no farther from the flight than this is a leak, m: beyond, it is chance.
_NEAR = 2000.0
#: So many digits of a hash tell it: what the foot of a report prints.
_SHORT = 8


def machine_secrets() -> Secrets:
    """Who makes the copy, and where on which machine."""
    words = [str(folder) for folder in (Path.home(), ROOT, Path.cwd(), sys.prefix) if folder is not None]
    for ask in (getpass.getuser, socket.gethostname):
        try:
            words.append(ask())
        except (OSError, KeyError):
            continue
    return Secrets(words=tuple(dict.fromkeys(words)))


def flight_secrets(
    flight: Flight, made: Generalised, treatment: Treatment, source: Source, folder: Path
) -> Secrets:
    """What tells where, when and of whom a flight is.

    Parameters
    ----------
    flight, made
        The true one, and its generalised copy.
    treatment
        What may be told.
    source
        Its reports, with the hashes of its files.
    folder
        Where it lies.

    Returns
    -------
    Secrets
    """
    m = flight.manifest
    moments = []
    # A day may be told to those who are told it.
    if m.time.epoch is not None and treatment.date == "month":
        first = m.time.epoch.timestamp() + first_stamp(flight)
        moments = [datetime.fromtimestamp(t, UTC) for t in (first, first + _length(flight))]
    paths = (str(folder.resolve()), *(str(one.resolve()) for one in source.folders))
    words = (
        *_known_texts(m.model_dump()),
        *_known_names(made),
        *_told(source, made),
        *paths,
        *_hashes(source),
    )
    return Secrets(
        places=_known_places(flight),
        near_m=_NEAR,
        cell_deg=treatment.cell_deg or 0.0,
        words=tuple(dict.fromkeys(words)),
        moments=tuple(moments),
        numbers=tuple(_known_numbers(m)),
    )


def all_of(several: Sequence[Secrets]) -> Secrets:
    """The secrets of all: nobody's may be in the copy of another."""
    with_places = [one for one in several if len(one.places)]
    return Secrets(
        places=np.concatenate([one.places for one in several]),
        near_m=max((one.near_m for one in with_places), default=_NEAR),
        cell_deg=max((one.cell_deg for one in with_places), default=0.0),
        words=tuple(dict.fromkeys(word for one in several for word in one.words)),
        moments=tuple(moment for one in several for moment in one.moments),
        numbers=tuple(number for one in several for number in one.numbers),
    )


def _known_places(flight: Flight) -> Array:
    """(N, 3) latitude and longitude, deg, and height, m: the origin, the middle, and some of every table."""
    p = [np.zeros((1, 3)), new_origin(flight)[None]]
    for table in (*flight.nav.values(), *flight.tables.values()):
        if {"north_m", "east_m", "down_m"} <= set(table):
            rows = table[["north_m", "east_m", "down_m"]].to_numpy(float)
            rows = rows[np.isfinite(rows).all(axis=1)]
            p.append(
                rows[np.unique(np.linspace(0, len(rows) - 1, _PLACES_EACH).astype(int))]
                if len(rows)
                else rows
            )
    llh = ned_to_geodetic(np.concatenate(p), flight.manifest.origin_tuple())
    return np.column_stack([np.degrees(llh[:, 0]), np.degrees(llh[:, 1]), llh[:, 2]])


def _length(flight: Flight) -> float:
    tables = [*flight.nav.values(), *flight.tables.values()]
    spans = [table["time_s"].max() - table["time_s"].min() for table in tables if "time_s" in table]
    return float(max((span for span in spans if pd.notna(span)), default=0.0))


def _known_numbers(m: Manifest) -> Iterator[float]:
    """Other numbers that locate."""
    yield m.origin.height_m
    yield float(normal_gravity(np.radians(m.origin.latitude_deg), m.origin.height_m))
    if m.vertical.correction_m:
        yield m.vertical.correction_m
    for angle in (m.magnetometer.declination_deg, m.magnetometer.inclination_deg):
        if angle:
            yield angle
    if m.terrain is not None:
        yield from (one for one in (m.terrain.added_m, *m.terrain.cell_m) if one and one != m.terrain.step_m)


def _known_texts(value: Any) -> Iterator[str]:
    """All that is stated in words, whatever it is."""
    if isinstance(value, str):
        # Kinds of hulls of a generalised flight have letters.
        yield from () if re.fullmatch("kind [A-Z]", value) else (value,)
    elif isinstance(value, Mapping | list | tuple):
        for one in value.values() if isinstance(value, Mapping) else value:
            yield from _known_texts(one)


def _known_names(made: Generalised) -> Iterator[str]:
    for kind, known in made.names.by_kind.items():
        # A true name like target-7 is what a neutral one looks like, and says as little.
        yield from (name for name in _some(known) if not re.fullmatch(rf"{kind}[-_ ]?\d*", name))


def _told(source: Source, made: Generalised) -> Iterator[str]:
    """Names in the settings that reports were made with: of sensors that the flight may not have too."""
    for parameters in source.parameters.values():
        try:
            named = names_in(parse_settings(str(parameters.get("settings") or "")))
        except WildlabError:
            # Made by another wildlab; where the report is made again, this is said there.
            continue
        yield from (name for name in named if made.names.of("sensor", name) != name)


def _some(names: Iterable[str]) -> list[str]:
    """All names of a kind; of thousands of frames the first and last, whose parts are those of all."""
    known = list(names)
    return known if len(known) <= 1000 else [*known[:500], *known[-500:]]


def _hashes(source: Source) -> Iterator[str]:
    """What files are known by."""
    files = source.flight.get("files")
    sources = source.flight.get("sources")
    for digest in (*(files.values() if isinstance(files, dict) else ()), *(sources or ())):
        yield from (str(digest), str(digest)[:_SHORT])
