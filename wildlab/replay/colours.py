"""Colours of a replay: those of the reports, so that a thing looks the same in both."""

from __future__ import annotations

from wildlab.reporting.figures import BLUE, GREY, ORANGE, colour

FLOWN, VIEW, SIGHTING, TRUTH, GROUND = BLUE, "#1b7f79", ORANGE, "#111111", "#d8e6ee"


def rgba(colour: str, alpha: float = 1.0) -> tuple[int, int, int, int]:
    """``#rrggbb`` as four numbers to 255.

    Examples
    --------
    >>> rgba("#ff8000", 0.5)
    (255, 128, 0, 128)
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue, round(255 * alpha)


def of_filter(name: str) -> str:
    """The colour that reports give a filter; grey where they know none."""
    found = colour(name)
    return found if found.startswith("#") and len(found) == 7 else GREY
