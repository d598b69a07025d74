"""What pages say: messages by key, catalogues of texts, and the numbers that are put into them.

A message is a key and its values; which one applies is a rule of whoever knows the numbers. `say` finds its
text in a catalogue, the one for one thing or for many, or, where a number is not known, the one without it.

A page's texts lie in a TOML file of ``data/messages/en``, where an editor reads them top to bottom::

    subtitle = "one tuning, three pose covariances, {flights}"
    limits = ["The truth is a GPS receiver on the vessel."]
    method = '''Paragraphs, with $maths$.'''

    [answer]                            # sentences; the study's `answer` says which of them apply
    overconfident = "The EKF's error is {ekf/error_over_stated} times what it predicts."

    [[tile]]                            # recorded numbers to remember
    subject = "ekf"
    name = "mae"
    text = "mean error of the EKF"

    [subject]                           # words of tables and legends
    ekf = "EKF"
    [quantity]
    mae = "mean error"

    [figure.track-map]
    title = "Tracks and truth"
    alt = "Map of the true path and both tracks."
    caption = "Local metres, north up."

    [table.filters]
    title = "All filters"
    caption = "Medians over the flights."
    columns = { filter = "filter", mae = "mean error (m)" }

A placeholder ``{subject/name}`` is a recorded number with its unit, ``{subject/name:form}`` one of
`wildlab.messages.quantities.FORMS`; ``{name}`` is a value that the study gives. A number that is not known
becomes "nan", and a page leaves the sentence out.

The sheet for partners is in several languages, ``data/messages/edition``, so that a partner can add theirs.
English is whole; what another language lacks is shown in English, and counted. A text may only have the
placeholders that the English one has, and all of them: a number that a translation drops would be lost.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import date
from functools import lru_cache
from numbers import Integral
from pathlib import Path
from typing import Any, NamedTuple, Union

from wildlab.errors import WildlabError
from wildlab.flight.files import read_toml
from wildlab.messages.quantities import FORMS, Entry, percent_of, significant
from wildlab.paths import DATA

#: The texts of pages in English, and those of the sheet for partners, one file for each language.
FOLDER, EDITIONS = DATA / "messages" / "en", DATA / "messages" / "edition"
ENGLISH = "en"
#: Before the keys of texts that stand in place of others where it is not known that anything flew.
UNFLOWN = "unflown."
#: A text that depends on how many, or on whether all its numbers are known.
VARIANTS = ("one", "many", "unknown")
#: More than a page takes; a translation is a sentence.
LONGEST = 400
_PLACEHOLDER = re.compile(r"\{(?:([^{}:\s]+)/)?([a-z][a-z0-9_]*)(?::([a-z]+))?\}")
_CODE = re.compile(r"[a-z]{2,3}(-[A-Za-z0-9]{2,8})*")

#: Text by its key, or by key and variant.
Texts = Mapping[str, str | Mapping[str, str] | tuple[str, ...]]


class Quantity(NamedTuple):
    """A number with what it is of.

    Attributes
    ----------
    kind
        ``length`` (m), ``duration`` (s), ``area`` (m^2), ``share`` (0 to 1), ``angle`` (rad) or ``number``.
    value
        In SI units.
    """

    kind: str
    value: float


class Day(NamedTuple):
    """A date that is shown to the day, or only to the month."""

    date: date
    whole: bool


class Message(NamedTuple):
    """One text of the page.

    Attributes
    ----------
    key
        Of the texts, with dots between its parts: ``verdict.sound``.
    values
        By placeholder.
    n
        What decides between the text for one and for several; None where there is one text for all.
    """

    key: str
    values: Mapping[str, Any] = {}
    n: float | None = None


#: What may stand for a placeholder: a quantity, a date, another text, a list of texts, or text as it is.
Value = Union[Quantity, Day, Message, tuple[Message, ...], str]  # noqa: UP007 - refers to what comes later


def length(metres: float) -> Quantity:
    """Metres."""
    return Quantity("length", metres)


def duration(seconds: float) -> Quantity:
    """Seconds."""
    return Quantity("duration", seconds)


def share(part: float) -> Quantity:
    """A share, from 0 to 1."""
    return Quantity("share", part)


def number(value: float) -> Quantity:
    """A count."""
    return Quantity("number", value)


class TileText(NamedTuple):
    """A number to remember: which one, and what stands below it."""

    subject: str
    name: str
    text: str
    form: str = "value"


class FigureText(NamedTuple):
    """What a figure shows, for who cannot see it and for who does, and its title."""

    alt: str
    caption: str = ""
    title: str = ""


class TableText(NamedTuple):
    """Summary line of a folded table, caption, headings by column; ``open`` where it is in sight."""

    title: str
    caption: str = ""
    columns: Mapping[str, str] = {}
    digits: Mapping[str, int] = {}
    open: bool = False


class PageTexts(NamedTuple):
    """All texts of a page; see the module."""

    subtitle: str = ""
    limits: tuple[str, ...] = ()
    method: str = ""
    answers: Mapping[str, str] = {}
    tiles: tuple[TileText, ...] = ()
    subjects: Mapping[str, str] = {}
    quantities: Mapping[str, str] = {}
    figures: Mapping[str, FigureText] = {}
    tables: Mapping[str, TableText] = {}


class OfPage(dict[str, Any]):
    """Texts of a page by their keys; the error of one that is not there says where it should be."""

    def __init__(self, path: Path, kind: str, texts: Mapping[str, Any]) -> None:
        super().__init__(texts)
        self.path, self.kind = path, kind

    def __missing__(self, key: str) -> Any:
        raise WildlabError("there is no such text", "write it", file=self.path, field=f"{self.kind}.{key}")


@lru_cache
def load_texts(page: str, folder: Path = FOLDER) -> PageTexts:
    """The texts of a page.

    Parameters
    ----------
    page
        Name of the file, without ending: of a study its case.
    folder
        Left out, ``data/messages/en``.

    Returns
    -------
    PageTexts

    Raises
    ------
    WildlabError
        If there is no such file, or it has a key that no page has; names file and key.

    Examples
    --------
    >>> load_texts("schmidt").subjects["ekf"]
    'EKF'
    """
    path = folder / f"{page}.toml"
    content = read_toml(path, "the texts of a page")
    lists: dict[str, type] = {"tile": TileText}
    tables: dict[str, type] = {"figure": FigureText, "table": TableText}
    plain = {"subtitle", "limits", "method", "answer", "subject", "quantity"}
    if unknown := sorted(set(content) - plain - set(lists) - set(tables)):
        raise WildlabError(f"a page has no {unknown[0]!r}", "leave it out", file=path, field=unknown[0])
    try:
        return PageTexts(
            content.get("subtitle", ""),
            tuple(content.get("limits", ())),
            content.get("method", ""),
            OfPage(path, "answer", content.get("answer", {})),
            tuple(TileText(**one) for one in content.get("tile", ())),
            content.get("subject", {}),
            content.get("quantity", {}),
            OfPage(
                path, "figure", {key: FigureText(**one) for key, one in content.get("figure", {}).items()}
            ),
            OfPage(path, "table", {key: TableText(**one) for key, one in content.get("table", {}).items()}),
        )
    except TypeError as error:
        raise WildlabError(f"an entry has a key that is none ({error})", "mend it", file=path) from None


def words(page: str, facts: Iterable[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """The sentences of a catalogue for some facts: keys with the values of their placeholders.

    Examples
    --------
    >>> words("plan", [("climb", {"speed": "3"})])
    ['It climbs and sinks at 3 m/s at most.']
    """
    texts = load_texts(page).answers
    return [fill(texts[key], {}, values) for key, values in facts]


def words_of(names: Mapping[str, str], name: str) -> str:
    """What a subject or quantity is called: its words, or its name with blanks."""
    return names.get(name, name.replace("_", " ").replace("-", " "))


class Language(NamedTuple):
    """The texts in a language.

    Attributes
    ----------
    code, name
        ``nb``, ``norsk (bokmål)``.
    texts
        By key, whole: what the file lacks is English.
    missing
        Keys that the file lacks, and that are English therefore.
    lacking
        All keys that the file lacks, also those of `UNFLOWN`.
    """

    code: str
    name: str
    texts: Texts
    missing: tuple[str, ...]
    lacking: frozenset[str] = frozenset()


def languages() -> list[str]:
    """Codes of the languages that there are, English first.

    Returns
    -------
    list of str
    """
    return sorted((path.stem for path in EDITIONS.glob("*.toml")), key=lambda one: (one != ENGLISH, one))


def load_language(language: str | Path = ENGLISH) -> Language:
    """Texts in a language.

    Parameters
    ----------
    language
        A code of `languages`, or the path of a file like theirs.

    Returns
    -------
    Language

    Raises
    ------
    WildlabError
        If there is no such language, or the file has a text that cannot be used; the message names it.

    Examples
    --------
    >>> load_language("nb").texts["format.decimal"]
    ','
    """
    english = _read(EDITIONS / f"{ENGLISH}.toml")
    if isinstance(language, str) and not language.endswith(".toml"):
        path = EDITIONS / f"{language}.toml"
        if not _CODE.fullmatch(language) or not path.is_file():
            raise WildlabError(
                f"there is no language {language[:40]!r}",
                f"choose one of {', '.join(languages())}, or give a file: {EDITIONS.name}/{ENGLISH}.toml "
                "with its texts translated",
                field="language",
            )
    else:
        path = Path(language)
    own = english if path == EDITIONS / f"{ENGLISH}.toml" else _read(path)
    for key, text in own.items():
        _check(key, text, english.get(key), path)
    code = own.get("language.code")
    name = own.get("language.name")
    if not isinstance(code, str) or not _CODE.fullmatch(code) or not isinstance(name, str):
        raise WildlabError(
            f"the language has the code {code!r}" if isinstance(name, str) else "the language has no name",
            'begin with [language], code = "sw" and name = "Kiswahili"',
            file=path,
            field="language",
        )
    lacking = frozenset(english) - frozenset(own)
    # A language without texts of its own for what did not fly says what it says of what did.
    missing = tuple(key for key in english if key in lacking and not key.startswith(UNFLOWN))
    return Language(code, name, {**english, **own}, missing, lacking)


def _read(path: Path) -> dict[str, Any]:
    return dict(_flat(read_toml(path, "texts of the partner's page"), ""))


def _flat(table: Mapping[str, Any], before: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping) and not (value and set(value) <= set(VARIANTS)):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", tuple(value) if isinstance(value, list) else value


def _check(key: str, text: Any, english: Any, path: Path) -> None:
    """Refuse a text that English does not have, of another kind, or with other placeholders."""

    def refuse(problem: str, fix: str) -> WildlabError:
        return WildlabError(problem, fix, file=path, field=key)

    if english is None:
        raise refuse("no text has this name", f"see {EDITIONS.name}/{ENGLISH}.toml for the names there are")
    if isinstance(english, Mapping):
        if not isinstance(text, Mapping) or set(text) != set(english):
            wanted = ", ".join(f'{one} = "..."' for one in english)
            raise refuse("this text has variants", f"give it as {{{wanted}}}")
        pairs = [(text[variant], english[variant], variant) for variant in english]
    elif isinstance(english, tuple):
        if not isinstance(text, tuple) or len(text) != len(english):
            raise refuse(f"this is not a list of {len(english)} texts", "give as many as the English file")
        pairs = [(ours, "", "list") for ours in text]
    else:
        pairs = [(text, english, "")]
    for ours, theirs, variant in pairs:
        if not isinstance(ours, str):
            raise refuse(f"this is {type(ours).__name__}, and not text", "put it into quotes")
        if len(ours) > LONGEST:
            raise refuse(f"this text has {len(ours)} characters", f"use {LONGEST} at most")
        # "One object" need not say 1, so that number alone may lack in the text for one, or be there.
        optional = {"n"} if variant == "one" else set()
        found, wanted_ = set(placeholders(ours)) - optional, set(placeholders(theirs)) - optional
        if found != wanted_:
            braced = ", ".join(f"{{{name}}}" for name in sorted(wanted_)) or "none"
            raise refuse(
                f"the text {ours[:60]!r} has other placeholders than the English one", f"use {braced}"
            )


def of_unflown(language: Language) -> Language:
    """The language as it speaks of a flight of which it is not known that anything flew.

    Parameters
    ----------
    language
        From `load_language`.

    Returns
    -------
    Language

    Examples
    --------
    >>> of_unflown(load_language()).texts["picture.path"]
    'way of the sensors'
    """
    own = {
        key.removeprefix(UNFLOWN): text
        for key, text in language.texts.items()
        if key.startswith(UNFLOWN)
        and (key not in language.lacking or key.removeprefix(UNFLOWN) in language.lacking)
    }
    return language._replace(texts={**language.texts, **own})


def placeholders(text: str) -> list[str]:
    """Names in braces, in the order in which they stand.

    Parameters
    ----------
    text
        As a file of a language has it.

    Returns
    -------
    list of str

    Examples
    --------
    >>> placeholders("{n} of {of}")
    ['n', 'of']
    """
    return [name for _, name, _ in _PLACEHOLDER.findall(text)]


def fill(
    text: str,
    recorded: Mapping[tuple[str, str], Entry],
    values: Mapping[str, Any],
    language: Language | None = None,
) -> str:
    """A text with its numbers. A value that looks like a placeholder stays what it is.

    Parameters
    ----------
    text
        With placeholders; see the module.
    recorded
        By name and subject, as `wildlab.reporting.report.Report.recorded` has them.
    values
        By name: a text as it is, a number with two significant figures, anything else as `say` says it.
    language
        Of quantities and messages among the values.

    Returns
    -------
    str

    Raises
    ------
    WildlabError
        If nothing was recorded for a placeholder.
    KeyError
        If it asks for a value or a form that there is not: a fault of ours.

    Examples
    --------
    >>> mae = {"value": 9.81, "unit": "m", "low": 5.12, "high": 16.3}
    >>> fill("{n} flights: {ekf/mae:range}", {("mae", "ekf"): mae}, {"n": 20})
    '20 flights: 9.8 m (5.1 to 16)'
    """

    def one(match: re.Match[str]) -> str:
        subject, name, form = match.groups()
        if subject is not None:
            if (name, subject) not in recorded:
                raise WildlabError(
                    f"a text names {subject}/{name}, which was not recorded",
                    "give it a unit in the study's rules, or mend the text",
                    field=text[:60],
                )
            return FORMS[form or "value"](recorded[name, subject])
        value = values[name]
        if isinstance(value, str | Integral):
            return str(value)
        if isinstance(value, float):
            return percent_of(value) if form == "percent" else significant(value)
        return say(language or load_language(), value)

    return _PLACEHOLDER.sub(one, text)


def say(language: Language, value: Value) -> str:
    """A text in a language, not escaped.

    Parameters
    ----------
    language
        From `load_language`.
    value
        A text, or anything that stands in one.

    Returns
    -------
    str

    Raises
    ------
    KeyError
        If there is no such text, or it has a placeholder without a value: a fault of ours.

    Examples
    --------
    >>> say(load_language("nb"), Quantity("length", 6.42))
    '6,4\\xa0meter'
    """
    if isinstance(value, str):
        return value
    if isinstance(value, Quantity):
        return _quantity(language, value)
    if isinstance(value, Day):
        return _day(language, value)
    if isinstance(value, Message):
        text = language.texts[value.key]
        if isinstance(text, Mapping):
            unknown = any(
                isinstance(one, Quantity) and math.isnan(one.value) for one in value.values.values()
            )
            text = text["unknown" if unknown and "unknown" in text else "one" if value.n == 1 else "many"]
        count = {} if value.n is None else {"n": _number(language, value.n)}
        return fill(str(text), {}, {**count, **value.values}, language)
    *first, last = (say(language, one) for one in value)
    return (
        fill(str(language.texts["format.list"]), {}, {"first": ", ".join(first), "last": last})
        if first
        else last
    )


def _number(language: Language, value: float, digits: int = 0) -> str:
    whole, _, rest = f"{abs(value):.{digits}f}".partition(".")
    grouped = (
        str(language.texts["format.thousands"]).join(re.findall(r"\d{1,3}", whole[::-1]))[::-1]
        if len(whole) > 4
        else whole
    )
    minus = "\N{MINUS SIGN}" if value < 0 and float(f"{value:.{digits}f}") else ""
    return f"{minus}{grouped}{language.texts['format.decimal']}{rest}" if rest else f"{minus}{grouped}"


def _quantity(language: Language, quantity: Quantity) -> str:
    kind, value = quantity
    unit, size, digits = _unit(kind, value)
    shown = _number(language, size, digits)
    if not unit:
        return shown
    one = float(f"{size:.{digits}f}") == 1
    # A number and its unit stay on one line.
    return say(language, Message(f"unit.{unit}", {"n": shown}, 1 if one else 2)).replace(" ", "\u00a0")


def _unit(kind: str, value: float) -> tuple[str, float, int]:
    """Unit, number in it, and digits behind the point."""
    if kind == "length":
        if abs(value) < 0.95:
            return "centimetres", 100 * value, 0
        if abs(value) < 1000:
            return "metres", value, 1 if abs(value) < 9.95 else 0
        return "kilometres", value / 1000, 1 if value < 99_950 else 0
    if kind == "duration":
        if value < 90:
            return "seconds", value, 0
        return ("minutes", value / 60, 0) if value < 5400 else ("hours", value / 3600, 1)
    if kind == "area":
        if value < 1e4:
            return "square_metres", value, 0
        return ("hectares", value / 1e4, 0 if value >= 1e5 else 1) if value < 1e6 else (
            "square_kilometres", value / 1e6, 1,
        )  # fmt: skip
    if kind == "angle":
        return "degrees", math.degrees(value), 0
    if kind == "share":
        percent = 100 * value
        # Never rounded to all or to none.
        whole = (
            percent if percent in (0.0, 100.0) else min(max(percent, 1.0), 99.0) if percent < 100 else percent
        )
        return "percent", whole, 0
    return "", value, 0


def _day(language: Language, day: Day) -> str:
    months = language.texts["format.months"]
    values = {
        "day": str(day.date.day),
        "month": str(months[day.date.month - 1]) if isinstance(months, tuple) else str(day.date.month),
        "year": str(day.date.year),
    }
    if not day.whole:
        del values["day"]
    return fill(str(language.texts["format.date" if day.whole else "format.month_year"]), {}, values)
