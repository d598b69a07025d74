"""What became of a study: every published number and claim beside what came out here."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from wildlab.evaluation.replication import Comparison, Reproduction
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDED
from wildlab.paths import DATA

FILE = DATA / "cases.toml"


class Case(NamedTuple):
    """One case of a thesis: its name, its section ("H 5.6.1"), and what it shows, a sentence."""

    id: str
    section: str
    shows: str


def load_cases() -> list[Case]:
    """All cases, in the order of the theses.

    Examples
    --------
    >>> load_cases()[0].id
    'camera-calibration'
    """
    return [Case(**entry) for entry in tomllib.loads(FILE.read_text(encoding="utf-8"))["case"]]


#: As published, in all that was decided; in part; in less than half of it.
AS_PUBLISHED, IN_PART, NOT_AS_PUBLISHED = "as published", "partly as published", "not as published"
#: Less than half was decided; nothing was judged.
OPEN, ALONE = "undecided", "not compared"
LEVELS = {AS_PUBLISHED: "good", IN_PART: "warn", NOT_AS_PUBLISHED: "bad", OPEN: "neutral", ALONE: "neutral"}
#: What is said of several claims with a verdict; of others, that they are not judged.
_CLAIMS = {
    HOLDS: "hold",
    MOSTLY: "hold on most flights",
    UNDECIDED: "undecided",
    MOSTLY_NOT: "fail on most flights",
    FAILS: "do not hold",
}


class Standing(NamedTuple):
    """A verdict in a word or two, why, and the colour that goes with the word (`Report.summary`)."""

    word: str
    reason: str
    level: str


def standing(numbers: Iterable[Comparison], claims: Iterable[str]) -> Standing:
    """What single verdicts come to.

    Parameters
    ----------
    numbers
        Of `wildlab.evaluation.replication`, one for each published number. What was fitted to its number is
        counted apart.
    claims
        Of `wildlab.evaluation.shares`, one for each claim.

    Returns
    -------
    Standing
        Its counts add up to the totals that it gives. It is as published where all that is decided is
        reproduced or holds, and at least half of what is judged is decided.

    Examples
    --------
    >>> standing([], ["holds", "holds", "holds on most flights"])
    Standing(word='partly as published', reason='3 claims: 2 hold, 1 hold on most flights.', level='warn')
    >>> standing([], []).word
    'not compared'
    """
    numbers, claims = list(numbers), list(claims)
    given = Counter(one.reproduction for one in numbers if not one.fitted)
    fitted = Counter(one.reproduction for one in numbers if one.fitted)
    told = Counter(claims)
    good = given[Reproduction.REPRODUCED] + told[HOLDS]
    bad = given[Reproduction.CONTRADICTED] + told[FAILS] + told[MOSTLY_NOT]
    decided = good + bad + told[MOSTLY]
    judged = decided + given[Reproduction.OPEN] + told[UNDECIDED]
    if not judged:
        word = ALONE
    elif 2 * decided < judged:
        word = OPEN
    elif good == decided:
        word = AS_PUBLISHED
    else:
        word = IN_PART if 2 * bad <= decided else NOT_AS_PUBLISHED
    said = []
    for what, counts in (("number", given), ("fitted number", fitted)):
        parts = [f"{counts[one]} {one}" for one in Reproduction if counts[one]]
        said += [_counted(counts.total(), what, parts)] if parts else []
    parts = [f"{told[one]} {words}" for one, words in _CLAIMS.items() if told[one]]
    rest = len(claims) - sum(told[one] for one in _CLAIMS)
    parts += [f"{rest} not judged"] if rest else []
    said += [_counted(len(claims), "claim", parts)] if parts else []
    reason = "; ".join(said) + "." if said else "No published number or claim is judged here."
    return Standing(word, reason, LEVELS[word])


def _counted(total: int, what: str, parts: Sequence[str]) -> str:
    return f"{total} {what}{'s' * (total != 1)}: {', '.join(parts)}"


#: Of a number that no run has given yet.
MISSING = "not reproduced yet"
#: The state of a study of which only a first look is there, and the verdict on whatever it has a number for.
FIRST_LOOK = "first look"


@dataclass(frozen=True)
class Number:
    """A published number and ours.

    ``compared`` is None where no run has given ours. ``waiting`` is `MISSING` then, `FIRST_LOOK` where ours
    are of a first look, and else "".

    Where it is compared by its size, ``published``, ``here`` and the bounds are sizes. ``ratio`` is ours to
    theirs; None where we have none, or where one is not above zero.
    """

    name: str
    subject: str
    unit: str
    source: str
    published: float
    digits: int
    here: float | None
    low: float | None
    high: float | None
    compared: Comparison | None
    waiting: str = ""
    reason: str = ""
    #: "calculated", "mean of runs", "one flight" or "share of images".
    kind: str = "one flight"
    ratio: float | None = None
    by_size: bool = False
    #: What of ours was chosen by it; "" where nothing was.
    fitted: str = ""
    #: The same printed number as another entry: counted there.
    again: bool = False
    #: Over how many flights ``low`` and ``high`` are; None where they are of another kind.
    over: int | None = None

    @property
    def answers(self) -> tuple[str, str]:
        """Close? and compatible?, or twice what it waits for."""
        if self.compared is None or self.waiting:
            return self.waiting, self.waiting
        return self.compared.closeness.value, self.compared.compatibility.value


@dataclass(frozen=True)
class Claim:
    """A claim and what became of it; verdict "not tested yet" where no run has decided."""

    id: str
    text: str
    source: str
    verdict: str
    fraction: float | None = None
    seeds: int | None = None
    #: The 95 % interval of the share, and how many flights meet the premise.
    low: float | None = None
    high: float | None = None
    met: int | None = None
    #: A sentence of ours, not of a thesis.
    own: bool = False


@dataclass(frozen=True)
class StudyStatus:
    """One study: ``state`` is "done", `FIRST_LOOK`, "failed", "not run", "broken off" or "damaged";
    ``reason`` says why it failed, what does not fit, or that the report has no digests; ``first_look`` what a
    first look shows of what ("5 of 200 flights")."""

    #: Its entry in ``studies.toml``.
    study: Any
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

    @property
    def counted(self) -> list[Number]:
        """The numbers that are counted here: each printed number once."""
        return [number for number in self.numbers if not number.again]


def _count(value: Any) -> str:
    """A number as it is written, 200 or 7.5; no number at all raises a ValueError or TypeError."""
    whole = int(value)
    return str(whole) if whole == value or not isinstance(value, float) else f"{value:g}"


#: What the numbers count that a first look takes fewer of, where their names do not say it.
LOOK_WORDS = {
    "seeds": "flights",
    "varied_runs": "runs with one part changed",
    "pairs": "pairs of images",
    "fields": "enclosures",
    "rate": "images a second",
    "percent_of_lap": "% of the lap",
    "frames": "rendered images",
    "rendered": "rendered flights",
}


def describe_first_look(first_look: Any) -> str:
    """What is shown of what: "5 of 200 flights"; nothing for a full report, or what is none of ours."""
    try:
        parts = [
            f"{int(few)} of {_count(whole)} {LOOK_WORDS.get(name, name)}"
            for name, (few, whole) in first_look.items()
        ]
    except (AttributeError, TypeError, ValueError):
        return ""
    return ", ".join(parts)
