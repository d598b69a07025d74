"""What filters are called on pages and in legends, and lengths beside them."""

from __future__ import annotations

WORDS = {
    "ekf": "white noise (EKF)",
    "ukf": "white noise (UKF)",
    "imm": "two motions (IMM)",
    "coloured": "coloured noise",
    "schmidt": "considered errors (Schmidt)",
    "thinned": "thinned detections",
}
SHORT = dict(zip(WORDS, ("EKF", "UKF", "IMM", "coloured", "Schmidt", "thinned"), strict=True))


def short_words(name: str) -> str:
    """A filter's name for titles."""
    base = name.removesuffix("-smoothed")
    return SHORT.get(base, base) + (" smoothed" if name != base else "")


def filter_words(name: str) -> str:
    """A filter's name in words; a smoothed one says so."""
    base = name.removesuffix("-smoothed")
    return WORDS.get(base, base) + (", smoothed" if name != base else "")


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
