"""Numbers as a page writes them: digits that make sense, units, shares, and what is not known."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

#: What a number that could not be computed looks like.
NOTHING = "–"
#: A number that is not known, and where one sentence ends and another begins.
_NAN, _SENTENCE = re.compile(r"(?<![\w-])nan(?![\w-])"), re.compile(r"(?<=[.!?])\s+(?=[^a-z])")
#: A recorded number: an entry of ``metrics.json``.
Entry = Mapping[str, Any]
_UNITS = {"1": "", "": "", "deg": "°", "%": " %"}


def significant(value: float) -> str:
    """A number with two significant figures, whole from a hundred on, and a true minus sign.

    Examples
    --------
    >>> significant(0.0312), significant(9.96), significant(-153.2), significant(float("nan"))
    ('0.031', '10', '−153', 'nan')
    """
    if not math.isfinite(value) or not value:
        return "0" if not value else str(value).replace("-", "−").replace("inf", "∞")
    value = float(f"{value:.2g}") if abs(value) < 100 else value
    digits = max(0, 1 - math.floor(math.log10(abs(value))))
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
    return percent(value, 0)


def number(value: Any, digits: int | None = None) -> str:
    """A number as a reader wants it: a true minus sign, ``digits`` decimals, three figures if not told."""
    try:
        value = float(value)
    except (TypeError, ValueError):
        return NOTHING
    if math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if digits is None:
        magnitude = abs(value)
        if magnitude != 0 and not 1e-4 <= magnitude < 1e7:
            return f"{value:.2e}".replace("-", "−")
        digits = 0 if magnitude >= 100 else max(0, 2 - math.floor(math.log10(magnitude))) if magnitude else 0
    shown = f"{value:.{max(0, digits)}f}"
    if float(shown) == 0:
        shown = shown.lstrip("-")
    return shown.replace("-", "−")


def percent(share: float, digits: int = 1) -> str:
    """A share in per cent; with more digits where it would be rounded to all or to none.

    Parameters
    ----------
    share
        From 0 to 1; a mean count may be above.
    digits
        Behind the point.

    Returns
    -------
    str
        "nan %" where it is not known; see `known`.

    Examples
    --------
    >>> percent(0.9999), percent(1.0), percent(0.004, 0), percent(0.0004)
    ('99.99 %', '100 %', '0.4 %', '0.04 %')
    """
    if not math.isfinite(share):
        return "nan %"
    least = min(share, 1 - share)
    if least < 1e-9:
        return f"{100 * share:.0f} %"
    digits = max(digits, math.ceil(-math.log10(199 * least)))
    return f"{100 * share:.{digits}f} %"


def percent_between(share: Sequence[float], digits: int = 1) -> str:
    """A share in per cent with its interval, where it has one: estimate, low and high end, from 0 to 1.

    Examples
    --------
    >>> percent_between((0.5, 0.25, 0.75)), percent_between((0.5, math.nan, math.nan))
    ('50.0 % (25.0 % to 75.0 %)', '50.0 %')
    """
    estimate, low, high = (percent(one, digits) for one in share)
    return estimate if math.isnan(share[1]) or low == high else f"{estimate} ({low} to {high})"


def known(text: str) -> str:
    """``text`` without the sentences that give a number which is not known.

    Whatever a page says goes through this: Python writes NaN as "nan", and what has one in it says nothing.

    Examples
    --------
    >>> known("It is 3.0 m off. By 2 flights it is nan m. Two are left.")
    'It is 3.0 m off. Two are left.'
    """
    if not _NAN.search(text):
        return text
    return " ".join(one for one in _SENTENCE.split(text) if not _NAN.search(one))


def metres(value: float, low: float | None = None, high: float | None = None) -> str:
    """``4.3 m``, or with its interval ``4.3 m (3.9 to 4.8)``."""
    digits = 1 if not abs(value) < 0.95 else 2
    if low is None or high is None or not math.isfinite(low + high):
        return f"{value:.{digits}f} m"
    return f"{value:.{digits}f} m ({low:.{digits}f} to {high:.{digits}f})"


def length(metres: float) -> str:
    """Metres with sensible digits.

    Examples
    --------
    >>> length(0.234), length(12.3), length(3.46), length(6_070_000.0)
    ('0.23 m', '12 m', '3.5 m', '6070 km')
    """
    if metres >= 10_000:
        return f"{metres / 1000:.0f} km"
    return f"{metres:.2f} m" if metres < 1 else f"{metres:.1f} m" if metres < 10 else f"{metres:.0f} m"


def way_length(metres: float) -> str:
    """The length of a path.

    Examples
    --------
    >>> way_length(840.0), way_length(3400.0)
    ('840 m', '3.4 km')
    """
    return f"{metres:.0f} m" if metres < 1000 else f"{metres / 1000:.1f} km"


def area(square_metres: float) -> str:
    """An area of ground.

    Examples
    --------
    >>> area(840.0), area(3.4e4), area(1.2e7)
    ('840 m²', '3.4 ha', '12.0 km²')
    """
    if square_metres < 1e4:
        return f"{square_metres:.0f} m²"
    return f"{square_metres / 1e4:.1f} ha" if square_metres < 1e6 else f"{square_metres / 1e6:.1f} km²"


def duration(seconds: float) -> str:
    """A duration; says so where there is none.

    Examples
    --------
    >>> duration(37.2), duration(1500.0), duration(7500.0), duration(float("nan"))
    ('37 s', '25 min', '2 h 5 min', 'of unknown length')
    """
    if not math.isfinite(seconds):
        return "of unknown length"
    if seconds < 120:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def nice_length(about: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``about``.

    Examples
    --------
    >>> nice_length(7.3), nice_length(1999.0)
    (5.0, 1000.0)
    """
    power = 10.0 ** math.floor(math.log10(about))
    return max(step * power for step in (1, 2, 5) if step * power <= about * (1 + 1e-9))


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
