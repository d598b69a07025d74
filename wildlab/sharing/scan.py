"""The second wall: what must not be in a copy, and the search for it as it is commonly written.

Pages are written from an allow-list (`wildlab.sharing.allow_list`), which refuses codes, counts of time and
whatever else is of no form of ours. What is of the right form may still be the flight's: its places in
degrees or UTM, its days, names, heights and other numbers that locate. Not looked for: what is drawn (the
pixels of pictures).
"""

from __future__ import annotations

import base64
import getpass
import html
import re
import socket
import sys
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pyproj import Proj

from wildlab.errors import WildlabError
from wildlab.flight.manifest import Manifest, parse_settings
from wildlab.flight.schema import POSITION
from wildlab.flight.store import Flight
from wildlab.flight.terrain import undulation
from wildlab.geometry.frames import Array, ned_to_geodetic, normal_gravity
from wildlab.paths import DATA, ROOT
from wildlab.sharing.allow_list import DATA_ADDRESS, FORMS, own_phrases, own_vocabulary, sheet_words
from wildlab.sharing.generalisation import Generalised, first_stamp, names_in, new_origin
from wildlab.sharing.recomputation import Source
from wildlab.sharing.tiers import Treatment, describe

#: So many places of each table are looked for; the scan finds what is near to one of them.
_PLACES_EACH = 20
#: A place that is written and lies no farther from the flight than this is a leak, m: beyond, it is chance.
_NEAR = 2000.0
#: So many digits of a hash tell it: what the foot of a report prints.
_SHORT = 8


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
        Names, labels, file names, folders, users, hosts, hashes, with where each stands.
    moments
        UTC, with a zone: when it was, where only the month may be said.
    numbers
        Other numbers that locate: heights, the geoid's undulation, gravity, declination. Their sign does not
        count.
    """

    places: Array = field(default_factory=lambda: np.empty((0, 3)), repr=False)
    near_m: float = 1000.0
    cell_deg: float = 0.0
    words: Mapping[str, str] = field(default_factory=dict, repr=False)
    moments: tuple[datetime, ...] = field(default=(), repr=False)
    numbers: tuple[float, ...] = field(default=(), repr=False)


def machine_secrets() -> Secrets:
    """Who makes the copy, and where on which machine."""
    folders = {"home": Path.home(), "wildlab": ROOT, "working": Path.cwd(), "Python's": sys.prefix}
    words = {str(folder): f"the {what} folder" for what, folder in folders.items()}
    for what, ask in (("user", getpass.getuser), ("host", socket.gethostname)):
        try:
            words[ask()] = f"the {what} of this machine"
        except (OSError, KeyError):
            continue
    return Secrets(words=words)


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
    words = {str(one.resolve()): "a folder" for one in (folder, *source.folders)}
    words |= dict.fromkeys(_hashes(source), "a digest")
    words |= dict.fromkeys(_told(source, made), "the settings of a report")
    words |= dict(_known_names(made)) | dict(_known_texts(m.model_dump(), "flight.toml"))
    return Secrets(
        places=_known_places(flight),
        near_m=_NEAR,
        cell_deg=treatment.cell_deg or 0.0,
        words=words,
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
        words={word: where for one in several for word, where in one.words.items()},
        moments=tuple(moment for one in several for moment in one.moments),
        numbers=tuple(number for one in several for number in one.numbers),
    )


def _known_places(flight: Flight) -> Array:
    """(N, 3) latitude and longitude, deg, and height, m: the origin, the middle, and some of every table."""
    p = [np.zeros((1, 3)), new_origin(flight)[None]]
    for table in (*flight.nav.values(), *flight.tables.values()):
        if set(POSITION) <= set(table):
            rows = table[POSITION].to_numpy(float)
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
    geoid = undulation(m.origin.latitude_deg, m.origin.longitude_deg)
    if geoid is not None:
        yield float(geoid)
    if m.vertical.correction_m:
        yield m.vertical.correction_m
    for angle in (m.magnetometer.declination_deg, m.magnetometer.inclination_deg):
        if angle:
            yield angle
    if m.terrain is not None:
        yield from (one for one in (m.terrain.added_m, *m.terrain.cell_m) if one and one != m.terrain.step_m)


def _known_texts(value: Any, where: str) -> Iterator[tuple[str, str]]:
    """All that is stated in words, whatever it is, with its field."""
    if isinstance(value, str):
        # Kinds of hulls of a generalised flight have letters.
        yield from () if re.fullmatch("kind [A-Z]", value) else ((value, where),)
    elif isinstance(value, Mapping | list | tuple):
        for key, one in value.items() if isinstance(value, Mapping) else enumerate(value):
            yield from _known_texts(one, f"{where}: {key}" if ":" not in where else f"{where}.{key}")


def _known_names(made: Generalised) -> Iterator[tuple[str, str]]:
    for kind, known in made.names.by_kind.items():
        # A true name like target-7 is what a neutral one looks like, and says as little.
        names = (name for name in _some(known) if not re.fullmatch(rf"{kind}[-_ ]?\d*", name))
        yield from ((name, f"a {kind} of the flight's tables") for name in names)


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


#: Names: shorter ones are only found where they stand alone, or not at all.
LONG, SHORTEST = 4, 3
#: Of names that cannot be looked for, so many are told.
MOST_TOLD = 12
#: A number stands for itself where so many digits agree with the true one; beside a word that says what it is
#: (within so many characters), so many do.
DIGITS, BESIDE, NEAR = 5, 3, 40
_SAYING = re.compile(
    r"undulation|geoid|origin|ellipsoid|altitude|elevation|above\s+sea|sea\s+level|amsl|declination"
    r"|inclination|gravity|h[oö]he|høyde|hoyde|terrain|_msl|height_m",
    re.IGNORECASE,
)
#: Metres per degree of latitude, for how near is near.
DEGREE_M = 111_320.0
#: The two numbers of a place stand no further apart in the text than this, characters.
TOGETHER = 160
#: A single number must agree with the true one to this, m, or to its last digit.
ALONE_M = 0.55
_TAG = re.compile(r"<(?:!--|-->|/?[A-Za-z][^<>]{0,2000}>)")
#: Lines of drawings, and when they move. Among thousands of numbers in pixels some pair always is somebody's
#: place; none hides in tenths of pixels within a sheet, so of those nothing is read.
_DRAWN = re.compile(r"""(\sd=")([A-Za-z0-9.,;()\s+-]*)(?=")""")
_PARTS = re.compile(r"[^\W_]+")
#: What has no letters of the Latin alphabet to stand for it when signs above letters are lost.
_PLAIN = str.maketrans({"ø": "o", "æ": "ae", "œ": "oe", "ß": "ss", "ł": "l", "đ": "d", "ð": "d", "þ": "th"})
_SIGNS = re.compile("[\u0300-\u036f]")
#: A number with a point or a comma; degrees with minutes, seconds or both.
_DECIMALS = (r"(?<![\d.])\d+(?:\.(\d+))?", r"(?<![\d,])\d+,(\d+)")
_SEXAGESIMAL = re.compile(
    r"(?<![\d.,])(\d{1,3})(?:(\s?(?:°|deg)\W{0,2})|[: ])(\d{1,2})"
    r"(?:[.,](\d+)|\W{1,3}(\d{1,2})(?:[.,](\d+))?)?(?!\d)"
)
#: Months by number, as English, German, Norwegian, Swedish and Danish begin to write them.
MONTHS = (
    "jan", "feb", "mar|mär|mrz", "apr", "mai|may|maj", "jun", "jul", "aug", "sep", "oct|okt", "nov",
    "dec|dez|des",
)  # fmt: skip
#: A date elsewhere on Earth may be the day before or after the one in UTC.
BEHIND, AHEAD = timedelta(hours=-12), timedelta(hours=14)


@dataclass(frozen=True)
class Finding:
    """Something that must not be in what is sent.

    Attributes
    ----------
    file
        Its name.
    kind
        ``"place"``, ``"date"``, ``"name"`` or ``"number"``.
    found, word
        The text itself, shortened, and of a name which one it is and where that stands: for the sender's
        eyes, so it is not shown when printed.
    """

    file: str
    kind: str
    found: str = field(repr=False)
    word: str = field(default="", repr=False)

    def __str__(self) -> str:
        return f"{self.file}: {self.kind}"


class SecretSearch:
    """Secrets, prepared once for all texts.

    Examples
    --------
    >>> search = SecretSearch(Secrets(places=np.array([[60.12342, 10.25022, 40.0]])))
    >>> print(search.scan({"page.html": "<p>60&deg; 7' 24.3&quot; N, 10&deg; 15' 0.8&quot; E</p>"})[0])
    page.html: place
    """

    def __init__(self, secrets: Secrets) -> None:
        self.phrases = {
            spelt: f"{word!r}, {secrets.words[word]}"
            for phrase, word in phrases_of(secrets.words)[0].items()
            for spelt in (phrase, tuple(map(_bare, phrase)))
        }
        self.near_m, self.cell_deg = secrets.near_m, secrets.cell_deg
        self.places = list(_axes(secrets.places)) if len(secrets.places) else []
        self.dates = _date_pattern(secrets.moments)
        self.numbers = sorted({abs(one) for one in secrets.numbers if one})

    def scan(self, files: Mapping[str, str]) -> list[Finding]:
        """Find what must not be in texts, by the names under which they are sent, or in these names."""
        return [
            Finding(where, *found)
            for name, content in files.items()
            for where, text in ((f"the name of the file {name}", name), (name, content))
            for found in dict.fromkeys(self._found_in(text))
        ]

    def _found_in(self, text: str) -> Iterator[tuple[str, str, str]]:
        """Kind, excerpt and name of all that is found, in all readings of a text."""
        for reading in map(_same_signs, readings(text)):
            found = [("name", *one) for one in self._names(reading)]
            found += [("date", *match.span(), "") for match in self.dates.finditer(reading)]
            numbers = _decimals(reading)
            found += [("number", *span, "") for span in _scalars(reading, numbers, self.numbers)]
            found += [("place", *span, "") for span in self._places(reading, numbers)]
            for kind, start, end, word in found:
                piece = reading[max(start - 12, 0) : min(end, start + 120) + 12]
                yield kind, re.sub(r"\s+", " ", piece), word

    def _names(self, text: str) -> Iterator[tuple[int, int, str]]:
        small = text.casefold()
        for spelt in dict.fromkeys((small, _bare(small))):
            # Most words are ruled out at once by the different words of the text.
            haystack = "\n".join(set(_PARTS.findall(spelt)))
            for phrase, word in self.phrases.items():
                if all(part in haystack for part in phrase):
                    body = r"[\W_]{0,3}".join(re.escape(part) for part in phrase)
                    short = len("".join(phrase)) < LONG
                    matches = re.finditer(rf"(?<![^\W_]){body}(?![^\W_])" if short else body, spelt)
                    # A name of one word within a longer word of ours, as "Mage" in "image", is none.
                    around = _longer_words(phrase[0]) if len(phrase) == 1 else ()
                    for match in matches:
                        if not any(spelt.startswith(one, max(match.start() - at, 0)) for one, at in around):
                            yield *match.span(), word
                            break

    def _places(self, text: str, numbers: Array) -> Iterator[tuple[int, int]]:
        """Two numbers that belong to the same place and stand close together, or one that is fine enough."""
        angles = numbers
        if self.cell_deg:
            cells = numbers[:, 2] / self.cell_deg
            angles = numbers[np.abs(cells - np.round(cells)) > 1e-6]
        angles = np.vstack([angles, _sexagesimal(text)])
        for values, per_metre, coarsest, alone in self.places:
            some = angles if coarsest < 0.1 else numbers
            some = some[some[:, 3] <= coarsest]
            near = []
            for axis, scale in zip(values, per_metre, strict=True):
                reach = self.near_m * scale
                low, high = (axis - reach).min() - coarsest, (axis + reach).max() + coarsest
                there = some[(some[:, 2] >= low) & (some[:, 2] <= high)]
                off = np.abs(there[:, 2:3] - axis)
                exact = off <= np.maximum(ALONE_M * scale, there[:, 3:4])
                fine = (there[:, 3] <= alone) | (there[:, 4] > 0)
                yield from there[exact.any(axis=1) & fine, :2].astype(int)
                near.append((there, off <= reach + there[:, 3:4]))
            (a, one), (b, other) = near
            for row, mine in zip(a[one.any(axis=1)], one[one.any(axis=1)], strict=True):
                gap = np.maximum(row[0] - b[:, 1], b[:, 0] - row[1])
                # Below zero the two overlap: two readings of one and the same number.
                for k in np.flatnonzero((gap >= 0) & (gap <= TOGETHER) & (other & mine).any(axis=1)):
                    yield int(min(row[0], b[k, 0])), int(max(row[1], b[k, 1]))


def readings(text: str) -> list[str]:
    """A text without its pictures and drawings and escapes; the same without its tags; and its tables."""
    tables: list[str] = []

    def packed(match: re.Match[str]) -> str:
        if match[1] != "image/png":
            tables.append(base64.b64decode(match[2]).decode("utf-8", "replace"))
        return " "

    def drawn(match: re.Match[str]) -> str:
        return match[1] if FORMS["paper"].fullmatch(match[2]) else match[0]

    text = html.unescape(_DRAWN.sub(drawn, DATA_ADDRESS.sub(packed, text)))
    return list(dict.fromkeys([text, _TAG.sub("", text), *tables]))


def search_limits(secrets: Secrets) -> list[str]:
    """What of the secrets is not looked for: sentences for the sender."""
    names = phrases_of(secrets.words)[1]
    some = ", ".join(map(repr, names[:MOST_TOLD])) + (" and so on" if len(names) > MOST_TOLD else "")
    return [*([describe("unsearched", n=len(names), names=some)] if names else []), describe("undrawn")]


def _same_signs(text: str) -> str:
    return text if text.isascii() else unicodedata.normalize("NFKC", text)


def _bare(text: str) -> str:
    """Without the signs above letters: ``"bjornoya"``."""
    return text if text.isascii() else _SIGNS.sub("", unicodedata.normalize("NFKD", text.translate(_PLAIN)))


def parts_of(word: str) -> tuple[str, ...]:
    """The parts of a word, in small letters: ``("nordre", "fjell")`` of ``"Nordre_Fjell"``."""
    return tuple(_PARTS.findall(unicodedata.normalize("NFKC", word).casefold()))


@cache
def _longer_words(part: str) -> tuple[tuple[str, int], ...]:
    """Words of reports, of the sheets and of their styles that a name is a part of, and where in them it
    begins."""
    styles = "".join(one.read_text(encoding="utf-8") for one in sorted((DATA / "pages").glob("*.css")))
    words = own_vocabulary() | sheet_words() | set(_PARTS.findall(styles.casefold()))
    spelt = words | set(map(_bare, words))
    return tuple((word, word.index(part)) for word in sorted(spelt) if part in word)


def phrases_of(words: Iterable[str]) -> tuple[dict[tuple[str, ...], str], list[str]]:
    """What can be looked for of names, in parts, with the name; and the names of which nothing can.

    Parameters
    ----------
    words
        As they are: paths are taken apart, and so are names with blanks, - and _.
    """
    wanted: dict[tuple[str, ...], str] = {}
    skipped: dict[str, None] = {}
    written = own_vocabulary() | sheet_words()
    for word in dict.fromkeys(words):
        for piece in (piece for piece in re.split(r"[/\\]", word) if piece.strip()):
            stem = piece.rpartition(".")[0] or piece
            for one in dict.fromkeys((piece, stem)):
                phrase = parts_of(one)
                if _can_be_sought(phrase):
                    wanted[phrase] = word
                elif one == piece and phrase:
                    skipped[one] = None
            telling = [part for part in parts_of(stem) if len(part) >= LONG and not part.isdigit()]
            wanted.update({(part,): word for part in telling if part not in written})
    return wanted, list(skipped)


def _can_be_sought(phrase: tuple[str, ...]) -> bool:
    """Not what is too short, a short number, a phrase of wildlab's own reports, or a word of its sheets: it
    stands everywhere."""
    joined = "".join(phrase)
    ours = all(part in own_vocabulary() for part in phrase) and f" {' '.join(phrase)} " in own_phrases()
    ours |= len(phrase) == 1 and joined in sheet_words()
    return len(joined) >= (6 if joined.isdigit() else SHORTEST) and not ours


def _decimals(text: str) -> Array:
    """Numbers (N, 5): start and end in the text, value without its sign, half of what its last digit counts,
    and 0."""
    rows = [
        (match.start(), match.end(), float(match[0].replace(",", ".")), 0.5 * 10.0 ** -len(match[1] or ""), 0)
        for pattern in _DECIMALS
        for match in re.finditer(pattern, text)
    ]
    return np.array(rows, float).reshape(-1, 5)


def _sexagesimal(text: str) -> Array:
    """Degrees with minutes, in degrees, as `_decimals`; last, whether it is so written that one says all."""
    rows = []
    for match in _SEXAGESIMAL.finditer(text):
        degrees, mark, minutes, of_minute, seconds, of_second = match.groups()
        parts = f"{minutes}.{of_minute or 0}", f"{seconds or 0}.{of_second or 0}"
        if max(map(float, parts)) < 60 and (mark or of_minute or seconds):
            half = 0.5 / (3600 if seconds else 60) * 10.0 ** -len((of_second if seconds else of_minute) or "")
            value = int(degrees) + float(parts[0]) / 60 + float(parts[1]) / 3600
            rows.append((*match.span(), value, half, bool(mark and seconds)))
    return np.array(rows, float).reshape(-1, 5)


def _axes(places: Array) -> Iterator[tuple[Array, Array, float, float]]:
    """The two numbers of each place (2, N) without signs, what a metre changes them by, and half of what the
    last digit may count of two together and of one alone."""
    latitude, longitude = places[:, 0], places[:, 1]
    across = DEGREE_M * np.maximum(np.cos(np.radians(latitude)), 0.01)
    one = np.ones_like(latitude)
    yield np.abs([latitude, longitude]), np.array([one / DEGREE_M, 1 / across]), 0.0085, 0.51e-5
    # Beside the own zone its neighbours: those of the exceptions of Norway and Svalbard are among them.
    own = {int((east + 180) // 6) for east in longitude}
    for zone in sorted({(zone + shift) % 60 + 1 for zone in own for shift in (-1, 0, 1)}):
        east, north = Proj(proj="utm", zone=zone, ellps="WGS84")(longitude, latitude)
        good = np.isfinite(east) & (np.abs(latitude) <= 84)
        if good.any():
            yield np.array([east, north % 1e7])[:, good], np.array([one, one])[:, good], 0.51, 0.051


def _date_pattern(moments: Iterable[datetime]) -> re.Pattern[str]:
    """The days of moments anywhere on Earth, as 2026-05-01, 01.05.2026, 5/1/26, 20260501 and 1 May 2026, and
    their times of day to the second."""
    known = list(moments)
    days = {(moment + shift).date() for moment in known for shift in (BEHIND, timedelta(0), AHEAD)}
    # 00:00:00 is no time of day but the lack of one.
    forms = [rf"0?{one:%-H:%M:%S}" for one in known if one.hour or one.minute or one.second]
    for one in sorted(days):
        year, d, m = rf"(?:{one:%Y}|{one:%y})", rf"0?{one.day}", rf"0?{one.month}"
        gap, name = r"[\s,._/-]{0,3}(?:of |de )?", rf"(?<![^\W\d_])(?:{MONTHS[one.month - 1]})[^\W\d_]{{0,8}}"
        day = rf"{d}(?!\d)(?:st|nd|rd|th|\.)?"
        forms += [
            rf"{one:%Y}[-/.:_\u2010]{m}[-/.:_\u2010]{d}", rf"{one:%y}[-/.]{m}[-/.]{d}",
            rf"(?:{d}[-/.]{m}|{m}[-/.]{d})[-/.]{year}", f"{one:%Y%m%d}",
            rf"{name}{gap}{day}{gap}'?{year}", rf"{one:%Y}{gap}{name}{gap}{day}", rf"{day}{gap}{name}\d*",
        ]  # fmt: skip
    return re.compile(rf"(?<!\d)(?:{'|'.join(forms)})(?!\d)" if forms else "(?!)", re.IGNORECASE)


def _scalars(text: str, numbers: Array, true: Iterable[float]) -> Iterator[tuple[int, int]]:
    """Where one of the true numbers is written: to five digits, or to three beside a word that names it."""
    start, end, found, half, _ = numbers.T
    # Leading zeros do not count, and a zero has no digit that agrees, however many it is written with.
    digits = np.floor(np.log10(np.maximum(found, 1e-300) / (2 * half)) + 1e-9) + 1
    for value in true:
        size = 10.0 ** np.floor(np.log10(value))
        off = np.abs(found - value)
        # Rounded to its last digit, or cut off after it.
        fits = (off <= half * 1.000001) | ((found < value) & (off < 2 * half))
        fits |= (off <= size * 10.0 ** (1 - DIGITS) / 2) & (digits > DIGITS)
        for k in np.flatnonzero(fits & (digits >= BESIDE)):
            one, other = int(start[k]), int(end[k])
            if digits[k] >= DIGITS or _SAYING.search(text[max(one - NEAR, 0) : other + NEAR]):
                yield one, other
