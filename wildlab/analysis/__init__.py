"""Where flights meet algorithms: flight in, tables out. Thin; what notebooks and commands call.

Positions are metres north, east and down from the flight's origin (frame ``n``), attitudes take a vector from
``b`` to ``n``, times are flight time, s. Ground points are (N, 2) or (N, 3) with covariances (N, 2, 2) in
m^2; pixels (N, 2) right and down; poses have covariances (N, 6, 6), position (m, in n) before attitude (rad,
in b). Errors of points are point minus truth; those of tracks and poses truth minus estimate, H (3.11).

What is to be said of it is a fact: a key of a catalogue in ``data/messages/en``, and the numbers that its
text takes.
"""

from __future__ import annotations

#: A key, and texts for its placeholders.
Fact = tuple[str, dict[str, str]]


def fact(key: str, **values: float | str) -> Fact:
    """A fact; numbers as ``:g`` writes them.

    Examples
    --------
    >>> fact("climb", speed=3.0)
    ('climb', {'speed': '3'})
    """
    return key, {name: one if isinstance(one, str) else f"{one:g}" for name, one in values.items()}
