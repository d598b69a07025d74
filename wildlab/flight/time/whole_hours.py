"""Clocks that are off by whole or half hours, as by another zone, by when two things were under way."""

from __future__ import annotations

import numpy as np

Span = tuple[float, float]

#: Share of the shorter that has to lie within the other then, and the farthest that zones are apart, s.
WITHIN, FARTHEST_S = 0.9, 14 * 3600.0
HALF_HOUR_S = 1800.0


def whole_hours(one: Span | None, other: Span | None) -> float | None:
    """What to add to the stamps of one so that it was under way with the other: half hours and hours alone.

    Parameters
    ----------
    one, other
        First and last stamp, s.

    Returns
    -------
    float or None
        Seconds; None where they share time as they are, where no such step brings them together, and where
        several do: of these whole hours go before half ones.

    Examples
    --------
    >>> whole_hours((3600.0, 4500.0), (0.0, 900.0)), whole_hours((3000.0, 3900.0), (0.0, 900.0))
    (-3600.0, None)
    """
    if one is None or other is None or _shared(one, other, 0.0) > 0:
        return None
    steps = np.arange(HALF_HOUR_S, FARTHEST_S + 1, HALF_HOUR_S)
    found = [float(by) for by in (*steps, *-steps) if _shared(one, other, float(by)) >= WITHIN]
    whole = [by for by in found if by % 3600 == 0]
    chosen = found if len(found) == 1 else whole
    return chosen[0] if len(chosen) == 1 else None


def hours_words(seconds: float) -> str:
    """``1 h``, ``5 h 30 min``, ``30 min``: of a length, whatever its sign.

    Examples
    --------
    >>> hours_words(-3600.0), hours_words(19800.0), hours_words(1800.0)
    ('1 h', '5 h 30 min', '30 min')
    """
    hours, minutes = divmod(round(abs(seconds) / 60), 60)
    return " ".join([*([f"{hours} h"] if hours else []), *([f"{minutes} min"] if minutes else [])])


def _shared(one: Span, other: Span, by: float) -> float:
    """Share of the shorter that both have once ``by`` is added to the first."""
    common = min(one[1] + by, other[1]) - max(one[0] + by, other[0])
    return max(common, 0.0) / max(min(one[1] - one[0], other[1] - other[0]), 1.0)
