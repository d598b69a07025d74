"""What filters are called on pages and in legends."""

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
