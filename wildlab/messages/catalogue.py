"""The texts of the page in one language: a TOML file for each, so that a partner can add theirs.

English is whole. What another language lacks is shown in English, and said. A text may only have the
placeholders that the English one has, and all of them: a number that a translation drops would not be told.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.flight.files import read_toml
from wildlab.messages.message import Day, Message, Quantity, Value
from wildlab.paths import DATA

#: Where the files are, one for each language, named by its code.
FOLDER = DATA / "edition"
ENGLISH = "en"
#: Before the keys of texts that stand in place of others where it is not known that anything flew.
UNFLOWN = "unflown."
#: A text that depends on how many: for one, and for all other numbers.
FORMS = ("one", "many")
#: More than a page takes; a translation is a sentence.
LONGEST = 400
_PLACEHOLDER = re.compile(r"\{([a-z][a-z0-9_]*)\}")
_CODE = re.compile(r"[a-z]{2,3}(-[A-Za-z0-9]{2,8})*")

#: Text by its key; where it depends on how many, by form too.
Texts = Mapping[str, str | Mapping[str, str] | tuple[str, ...]]


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
    return sorted((path.stem for path in FOLDER.glob("*.toml")), key=lambda one: (one != ENGLISH, one))


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
    english = _read(FOLDER / f"{ENGLISH}.toml")
    if isinstance(language, str) and not language.endswith(".toml"):
        path = FOLDER / f"{language}.toml"
        if not _CODE.fullmatch(language) or not path.is_file():
            raise WildlabError(
                f"there is no language {language[:40]!r}",
                f"choose one of {', '.join(languages())}, or give a file: {ENGLISH}.toml of data/edition "
                "with its texts translated",
                field="language",
            )
    else:
        path = Path(language)
    own = english if path == FOLDER / f"{ENGLISH}.toml" else _read(path)
    for key, text in own.items():
        _check(key, text, english.get(key), path)
    code = own.get("language.code")
    name = own.get("language.name")
    if not isinstance(code, str) or not _CODE.fullmatch(code) or not isinstance(name, str):
        raise WildlabError(
            f"the language has the code {code!r}" if isinstance(name, str) else "the language has no name",
            'begin the file with [language], code = "sw" (ISO 639) and name = "Kiswahili"',
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
        if isinstance(value, Mapping) and not (value and set(value) <= set(FORMS)):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", tuple(value) if isinstance(value, list) else value


def _check(key: str, text: Any, english: Any, path: Path) -> None:
    """Refuse a text that English does not have, of another kind, or with other placeholders."""

    def refuse(problem: str, fix: str) -> WildlabError:
        return WildlabError(problem, fix, file=path, field=key)

    if english is None:
        raise refuse("no text has this name", f"see {ENGLISH}.toml of data/edition for the names there are")
    if isinstance(english, Mapping):
        if not isinstance(text, Mapping) or set(text) != set(FORMS):
            raise refuse("this text depends on how many", 'give it as {one = "...", many = "..."}')
        pairs = [(text[form], english[form]) for form in FORMS]
    elif isinstance(english, tuple):
        if not isinstance(text, tuple) or len(text) != len(english):
            raise refuse(f"this is not a list of {len(english)} texts", "give as many as the English file")
        pairs = list(zip(text, english, strict=True))
    else:
        pairs = [(text, english)]
    # "One object" need not say 1, so that number alone may lack in the text for one.
    wanted = {name for _, theirs in pairs for name in _PLACEHOLDER.findall(theirs)}
    for i, (ours, _) in enumerate(pairs):
        if not isinstance(ours, str):
            raise refuse(f"this is {type(ours).__name__}, and not text", "put it into quotes")
        if len(ours) > LONGEST:
            raise refuse(f"this text has {len(ours)} characters", f"use {LONGEST} at most")
        optional = {"n"} if isinstance(english, Mapping) and FORMS[i] == "one" else set()
        found = set(_PLACEHOLDER.findall(ours))
        if found - wanted or (not isinstance(english, tuple) and wanted - found - optional):
            braced = ", ".join(f"{{{name}}}" for name in sorted(wanted)) or "none"
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
    return _PLACEHOLDER.findall(text)


def say(language: Language, said: Value) -> str:
    """A text in a language, not escaped.

    Parameters
    ----------
    language
        From `load_language`.
    said
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
    if isinstance(said, str):
        return said
    if isinstance(said, Quantity):
        return _quantity(language, said)
    if isinstance(said, Day):
        return _day(language, said)
    if isinstance(said, Message):
        text = language.texts[said.key]
        if isinstance(text, Mapping):
            text = text["one" if said.n == 1 else "many"]
        values = {name: say(language, value) for name, value in said.values.items()}
        if said.n is not None:
            values.setdefault("n", _number(language, said.n))
        return _fill(str(text), values)
    parts = [say(language, one) for one in said]
    if len(parts) < 2:
        return "".join(parts)
    first = parts[:-1]
    return _fill(str(language.texts["format.list"]), {"first": ", ".join(first), "last": parts[-1]})


def _fill(text: str, values: Mapping[str, str]) -> str:
    # One pass: a value that looks like a placeholder stays what it is.
    return _PLACEHOLDER.sub(lambda match: values[match[1]], text)


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
    return _fill(str(language.texts["format.date" if day.whole else "format.month_year"]), values)
