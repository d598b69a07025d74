"""What a finding is: a code with facts. The words lie in ``data/messages/checks.toml``, once."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from string import Formatter
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.names import listed
from wildlab.paths import DATA

Level = Literal["problem", "warning", "note"]

#: Logs print quaternions with few digits: four leave an error of 2e-4 in the norm.
NORM_TOLERANCE = 1e-3

POSITION = ("north_m", "east_m", "down_m")
QUATERNION = ("q_w", "q_x", "q_y", "q_z")
VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
POSE = ("time_s", *POSITION, *QUATERNION)


@dataclass(frozen=True)
class Finding:
    """Something to know about a flight.

    Attributes
    ----------
    level
        ``problem``: what it concerns cannot be used. ``warning``: it can, but look. ``note``: good to know.
    table, field
        ``nav/<source>``, the name of a table, or ``flight.toml``; and what of it.
    code
        Of its text in ``data/messages/checks.toml``.
    facts
        Numbers, names and choices that the text states.
    causes
        The usual mistakes that explain it.
    corrections
        Undo them in a flight, or give None where they cannot (`wildlab.flight.checks.mistakes`).
    """

    level: Level
    table: str
    field: str
    code: str
    facts: Mapping[str, Any] = dataclasses.field(default_factory=dict, hash=False)
    causes: tuple[str, ...] = ()
    corrections: tuple[Callable[[Flight], Flight | None], ...] = dataclasses.field(
        default=(), compare=False, repr=False
    )

    @property
    def clause(self) -> str:
        """What is so, without place and full stop."""
        return phrase(messages("checks")[self.code]["said"], self.facts)

    @property
    def remedy(self) -> str:
        """What to do, likewise."""
        return phrase(messages("checks")[self.code]["fix"], self.facts)

    @property
    def sentence(self) -> str:
        """What is so, with table and field."""
        return f"{', '.join(filter(None, (self.table, self.field)))}: {self.clause}."

    @property
    def fix(self) -> str:
        """What to do."""
        return f"{self.remedy[:1].upper()}{self.remedy[1:]}."


@cache
def messages(name: str) -> dict[str, Any]:
    """The texts of one file of ``data/messages``."""
    return tomllib.loads((DATA / "messages" / f"{name}.toml").read_text(encoding="utf-8"))


#: ``{name:one|other}`` and ``{name>0:one|other}``; each of both may hold fields.
_CHOICE = re.compile(r"\{(\w+)(>0)?:((?:[^{}|]|\{[^{}]*\})*)\|((?:[^{}|]|\{[^{}]*\})*)\}")


class _Phrase(Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec in ("and", "or"):
            return listed(value, format_spec)
        if format_spec.startswith("abs"):
            return self.format_field(abs(value), format_spec[3:])
        return number(value) if format_spec == "digits" else str(super().format_field(value, format_spec))


def phrase(text: str, facts: Mapping[str, Any]) -> str:
    """A text with its facts.

    Beside what `str.format` knows, ``{n:frame|frames}`` chooses the first where a number is 1 or a fact is
    so, ``{by>0:late|early}`` where positive; ``{names:and}`` joins a list, ``{by:abs.2f}`` is a size, and
    ``{size:digits}`` has the digits that are worth reading.

    Examples
    --------
    >>> phrase("{n} {n:row|rows} of {names:and}, {off:digits} m", {"n": 2, "names": ["a", "b"], "off": 0.01})
    '2 rows of a and b, 0.01 m'
    """

    def choose(found: re.Match[str]) -> str:
        fact = facts[found[1]]
        return found[3] if (fact > 0 if found[2] else fact == 1) else found[4]

    return _Phrase().vformat(_CHOICE.sub(choose, text), (), facts)


def say(use: str, **facts: Any) -> str:
    """The clause of what a flight can be used for."""
    return phrase(messages("checks")["use"][use], facts)


def number(value: float) -> str:
    """A number with the digits that are worth reading."""
    if value != 0 and abs(value) < 0.095:
        return f"{value:.2g}"
    return f"{value:.0f}" if abs(value) >= 20 else f"{value:.1f}"


def bad_rows(
    bad: NDArray[np.bool_],
    level: Level | None,
    table: str,
    field: str,
    code: str,
    facts: Mapping[str, Any] | None = None,
    causes: tuple[str, ...] = (),
) -> Iterator[Finding]:
    """A finding where any row (N,) is bad: how many ``n`` of how many ``of``, and the first, ``row``.

    Without a level it is a problem where all are bad, otherwise a warning. Facts that are columns (N,) or
    (N, K) are given for the first bad row.
    """
    if bad.any():
        row = int(np.argmax(bad))
        counted: dict[str, Any] = {"n": int(bad.sum()), "of": len(bad), "row": row}
        for key, value in (facts or {}).items():
            counted[key] = value[row] if isinstance(value, np.ndarray) else value
        yield Finding(level or ("problem" if bad.all() else "warning"), table, field, code, counted, causes)


def thin(n: int, most: int) -> NDArray[np.intp]:
    """At most so many of n rows, evenly."""
    return np.unique(np.linspace(0, n - 1, most).astype(np.intp))


def finite_rows(table: pd.DataFrame, names: Sequence[str]) -> Array:
    """The rows of some columns that hold numbers alone, (N, K)."""
    values = table[[*names]].to_numpy(float)
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def part_of(table: str) -> str:
    """The part of the recipe that a table comes from: ``"poses.x"`` for ``"nav/x"``."""
    return f"poses.{table.removeprefix('nav/')}" if table.startswith("nav/") else table
