"""Texts of one page, and the recorded numbers that are put into them.

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

A placeholder ``{subject/name}`` is a recorded number with its unit, ``{subject/name:form}`` one of `FORMS`;
``{name}`` is a value that the study gives. A number that is not known becomes "nan", and a page leaves the
sentence out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.flight.files import read_toml
from wildlab.paths import DATA

FOLDER = DATA / "messages" / "en"
#: A recorded number: an entry of ``metrics.json``.
Entry = Mapping[str, Any]
_PLACEHOLDER = re.compile(r"\{(?:([^{}:\s]+)/)?([a-z][a-z0-9_]*)(?::([a-z]+))?\}")
_UNITS = {"1": "", "": "", "deg": "°", "%": " %"}


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
        raise WildlabError(
            f"a page has no {unknown[0]!r}", "see the texts of another page", file=path, field=unknown[0]
        )
    try:
        return PageTexts(
            content.get("subtitle", ""),
            tuple(content.get("limits", ())),
            content.get("method", ""),
            content.get("answer", {}),
            tuple(TileText(**one) for one in content.get("tile", ())),
            content.get("subject", {}),
            content.get("quantity", {}),
            {key: FigureText(**one) for key, one in content.get("figure", {}).items()},
            {key: TableText(**one) for key, one in content.get("table", {}).items()},
        )
    except TypeError as error:
        raise WildlabError(f"an entry has a key that is none ({error})", "mend it", file=path) from None


def significant(value: float, figures: int = 2) -> str:
    """A number with so many significant figures, whole from a hundred on, and a true minus sign.

    Examples
    --------
    >>> significant(0.0312), significant(9.96), significant(-153.2), significant(float("nan"))
    ('0.031', '10', '−153', 'nan')
    """
    if not math.isfinite(value) or not value:
        return "0" if not value else str(value).replace("-", "−").replace("inf", "∞")
    value = float(f"{value:.{figures}g}") if abs(value) < 10**figures else value
    digits = max(0, figures - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{digits}f}".replace("-", "−")


def measure(value: float, unit: str) -> str:
    """A number with its unit; one without a unit alone.

    Examples
    --------
    >>> measure(9.81, "m"), measure(0.31, "deg"), measure(2.04, "1"), measure(99.6, "%")
    ('9.8 m', '0.31°', '2.0', '99.6 %')
    """
    if unit == "%":
        return percent_of(value / 100)
    return f"{significant(value)}{unit_words(unit)}"


def unit_words(unit: str) -> str:
    """What follows a number with that unit: a blank and the unit, nothing for "1"."""
    return _UNITS.get(unit, f" {unit}")


def percent_of(value: float) -> str:
    """A share from 0 to 1 in per cent, never rounded to all or to none.

    Examples
    --------
    >>> percent_of(0.934), percent_of(0.9999), percent_of(0.004), percent_of(1.0)
    ('93 %', '99.99 %', '0.4 %', '100 %')
    """
    if not math.isfinite(value):
        return "nan"
    least = min(value, 1 - value)
    digits = 0 if least < 1e-9 else max(0, math.ceil(-math.log10(199 * least)))
    return f"{100 * value:.{digits}f} %"


def _pair(entry: Entry, low: str, high: str) -> tuple[float, float]:
    ends = entry.get(low), entry.get(high)
    return (math.nan, math.nan) if None in ends else (float(ends[0]), float(ends[1]))  # type: ignore[arg-type]


def _value(entry: Entry) -> float:
    return math.nan if entry.get("value") is None else float(entry["value"])


def _range(entry: Entry, low: str = "low", high: str = "high") -> str:
    ends = _pair(entry, low, high)
    return measure(_value(entry), entry["unit"]) + (
        "" if math.isnan(ends[0]) else f" ({significant(ends[0])} to {significant(ends[1])})"
    )


def _percent_range(entry: Entry) -> str:
    ends = _pair(entry, "low", "high")
    return percent_of(_value(entry)) + (
        "" if math.isnan(ends[0]) else f" ({percent_of(ends[0])} to {percent_of(ends[1])})"
    )


#: What a placeholder may ask of a recorded number.
FORMS: Mapping[str, Callable[[Entry], str]] = {
    "value": lambda entry: measure(_value(entry), entry["unit"]),
    "number": lambda entry: significant(_value(entry)),
    "percent": lambda entry: percent_of(_value(entry)),
    "range": _range,  # of flights
    "interval": lambda entry: _range(entry, "centre_low", "centre_high"),  # of the median
    "shares": _percent_range,
    "count": lambda entry: str(entry.get("n")),
}


def fill(text: str, recorded: Mapping[tuple[str, str], Entry], values: Mapping[str, Any]) -> str:
    """A text with its numbers.

    Parameters
    ----------
    text
        With placeholders; see the module.
    recorded
        By name and subject, as `wildlab.reporting.report.Report.recorded` has them.
    values
        By name: a text as it is, a number with two significant figures.

    Returns
    -------
    str

    Raises
    ------
    KeyError
        If nothing was recorded for a placeholder, or it asks for a form that there is not: a fault of ours.

    Examples
    --------
    >>> mae = {"value": 9.81, "unit": "m", "low": 5.12, "high": 16.3}
    >>> fill("{n} flights: {ekf/mae:range}", {("mae", "ekf"): mae}, {"n": 20})
    '20 flights: 9.8 m (5.1 to 16)'
    """

    def one(match: re.Match[str]) -> str:
        subject, name, form = match.groups()
        if subject is not None:
            return FORMS[form or "value"](recorded[name, subject])
        value = values[name]
        if isinstance(value, str | int):
            return str(value)
        return percent_of(value) if form == "percent" else significant(float(value))

    return _PLACEHOLDER.sub(one, text)


def words_of(names: Mapping[str, str], name: str) -> str:
    """What a subject or quantity is called: its words, or its name with blanks."""
    return names.get(name, name.replace("_", " ").replace("-", " "))
