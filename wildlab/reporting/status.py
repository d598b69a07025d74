"""What became of a study: every published number and claim beside what came out here.

A published number counts as *reproduced* when our value lies within the tolerance that `data/published`
states for it, or when the published value lies in the middle 90 % of our simulated flights, of fewer than 30
between the lowest and the highest. Where there is neither, the difference is shown and nothing is claimed.
Nothing is claimed of a first look either, whose numbers come from fewer flights than the study's own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

REPRODUCED, DIFFERS, NOT_JUDGED, MISSING = "reproduced", "differs", "not judged", "not reproduced yet"
#: The state of a study of which only a first look is there, and the verdict on whatever it has a number for.
FIRST_LOOK = "first look"


class ListedStudy(Protocol):
    """What a page says of a study besides its numbers: an entry of ``studies.toml``."""

    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def section(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def twin(self) -> str | None: ...
    @property
    def dataset(self) -> str | None: ...
    @property
    def recipe(self) -> str | None: ...


@dataclass(frozen=True)
class Number:
    """A published number and ours. ``difference`` is ours minus theirs; None where we have none."""

    name: str
    subject: str
    unit: str
    source: str
    published: float
    digits: int
    here: float | None
    low: float | None
    high: float | None
    within: float | None
    verdict: str
    reason: str = ""
    #: Over how many flights ``low`` and ``high`` are; None where they are of another kind.
    over: int | None = None

    @property
    def difference(self) -> float | None:
        return None if self.here is None else self.here - self.published


@dataclass(frozen=True)
class Claim:
    """A claim and what became of it; verdict "not tested yet" where no run has decided."""

    id: str
    text: str
    source: str
    verdict: str
    fraction: float | None = None
    seeds: int | None = None


@dataclass(frozen=True)
class StudyStatus:
    """One study: ``state`` is "done", `FIRST_LOOK`, "failed", "not run" or "broken off"; ``reason`` says why
    it failed, ``first_look`` what a first look shows of what ("5 of 200 flights")."""

    study: ListedStudy
    state: str
    reason: str = ""
    seconds: float | None = None
    finished: str = ""
    flight: str = ""
    seeds: int | None = None
    first_look: str = ""
    has_report: bool = False
    numbers: list[Number] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)

    @property
    def ran(self) -> bool:
        """Whether there are numbers."""
        return self.state in ("done", FIRST_LOOK)

    def count(self, verdict: str) -> int:
        """How many of the numbers have that verdict."""
        return sum(number.verdict == verdict for number in self.numbers)


def verdict_on(
    here: float | None, published: float, within: float | None, low: float | None, high: float | None
) -> str:
    """Whether a number of ours reproduces a published one.

    Parameters
    ----------
    within
        The tolerance stated for it, where one is.
    low, high
        The bounds over flights (`wildlab.reporting.spread.bounds_of`), where there were several.
    """
    if here is None:
        return MISSING
    # A hair of slack: 5.45 - 5.3 is 0.1500000000000004.
    if within is not None and abs(here - published) <= within + 1e-9:
        return REPRODUCED
    if low is not None and high is not None and low - 1e-9 <= published <= high + 1e-9:
        return REPRODUCED
    return NOT_JUDGED if within is None and (low is None or high is None) else DIFFERS


def look_words(first_look: Any) -> str:
    """What is shown of what: "5 of 200 flights"; nothing for a full report, or what is none of ours."""
    try:
        parts = [
            f"{int(few)} of {int(whole)} {'flights' if name == 'seeds' else str(name).replace('_', ' ')}"
            for name, (few, whole) in first_look.items()
        ]
    except (AttributeError, TypeError, ValueError):
        return ""
    return ", ".join(parts)
