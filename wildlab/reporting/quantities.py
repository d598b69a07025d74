"""Lengths, areas and durations with the units and digits that a reader wants."""

from __future__ import annotations

import math


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


def fine_length(metres: float) -> str:
    """Metres with a decimal below a hundred.

    Examples
    --------
    >>> fine_length(6.72), fine_length(113.0), fine_length(3420.0)
    ('6.7 m', '113 m', '3.4 km')
    """
    return f"{metres:.1f} m" if metres < 100 else way_length(metres)


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
