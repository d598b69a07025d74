"""The numbers and claims of the theses, typed from their tables, what a run gave beside each, and what that
comes to: for a number, a claim and a study."""

from __future__ import annotations

import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import LEVEL, prediction_interval, prediction_rank, share_interval
from wildlab.evaluation.replication import (
    Comparison,
    Reproduction,
    compare_calculation,
    compare_flight,
    compare_mean,
    not_judged,
)
from wildlab.evaluation.shares import FAILS, HOLDS, MOSTLY, MOSTLY_NOT, UNDECIDED
from wildlab.flight.files import Strict, check_model
from wildlab.paths import DATA
from wildlab.reporting.metrics import metric

if TYPE_CHECKING:
    import pandas as pd

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


#: From how many flights on there is a 90 % prediction interval of one more.
MANY = 19


def spread_key(n: int) -> str:
    """What a legend calls the spread over ``n`` flights; nothing for one."""
    return "" if n < 2 else "lowest to highest" if n < MANY else "middle 90 %"


def bounds_of(values: pd.Series) -> tuple[float, float]:
    """Lower and upper bound of what is shown as the spread over flights, one row for each.

    NaN for one flight. Rows that are NaN are left out.
    """
    if len(values) < 2:
        return np.nan, np.nan
    if values.notna().sum() < MANY:
        return float(values.min()), float(values.max())
    return prediction_interval(values)


#: What a run recorded, by name and subject: entries of ``metrics.json``.
Recorded = Mapping[tuple[str, str], Mapping[str, Any]]


def size_name(name: str) -> str:
    """The metric that holds the size of a signed mean.

    Examples
    --------
    >>> size_name("mean_north")
    'size_of_mean_north'
    """
    return f"size_of_{name}"


def error_name(name: str) -> str:
    """The metric that holds the standard error of a mean of runs.

    Examples
    --------
    >>> error_name("success_rate")
    'success_rate_se'
    """
    return f"{name}_se"


MINUS = "\u2212"


def recorded_for(row: Mapping[str, Any], ours: Recorded) -> Mapping[str, Any]:
    """What a run recorded for a published number: empty where nothing, sizes where it is compared by size."""
    name, subject = str(row["name"]), str(row["subject"])
    found = ours.get((name, subject), {})
    if not row["by_size"] or found.get("value") is None:
        return found
    sizes = ours.get((size_name(name), subject))
    if sizes is not None:
        return sizes
    # One flight has no spread, and its size needs no record of its own.
    spread = dict.fromkeys(("low", "high", "flights", "centre_low", "centre_high", "power"))
    return {**found, **spread, "value": abs(found["value"])}


def judge(row: Mapping[str, Any], ours: Recorded) -> Comparison | None:
    """Compare a published number with what a run recorded.

    Parameters
    ----------
    row
        A row of `wildlab.reporting.published.load_published`.
    ours
        What the run recorded.

    Returns
    -------
    Comparison or None
        None where the run has no number for it.
    """
    name, subject = str(row["name"]), str(row["subject"])
    found = recorded_for(row, ours)
    here = found.get("value")
    if here is None:
        return None
    value = abs(float(row["value"])) if row["by_size"] else float(row["value"])
    if row["unjudged"]:
        return not_judged(str(row["unjudged"]))
    rounding, known = float(row["rounding"]), ours.get((error_name(name), subject), {})
    error = known.get("value")
    if row["kind"] == CALCULATED and known and error is None:
        return not_judged("a standard error is not known")
    if row["kind"] == CALCULATED:
        compared = compare_calculation(here, value, rounding, inputs=_pair(found, "low", "high"), error=error)
        return replace(compared, fitted=str(row["fitted"]))
    kind = "rate" if row["kind"] in (SHARE_OF_IMAGES, MEAN_OF_RUNS) else quantity_kind(name)
    if not kind:
        return not_judged("no margin is fixed for this quantity")
    # A rate's margin is of odds.
    unit = 100.0 if kind == "rate" and row["unit"] == "%" else 1.0
    if row["kind"] == MEAN_OF_RUNS:
        theirs = None
        if error is not None and found.get("n") and not math.isnan(row["runs"]):
            # Nobody prints it: single runs are taken to vary there as they do here.
            theirs = error / unit * math.sqrt(found["n"] / row["runs"])
        error = None if error is None else error / unit
        compared = compare_mean(here / unit, value / unit, rounding / unit, error, theirs)
    else:
        flights = found.get("flights") or 0
        # Of a share of images the bounds are those of its interval, not of flights.
        alone = row["kind"] == SHARE_OF_IMAGES or prediction_rank(flights) < 1
        share = None
        if kind == "rate" and not math.isnan(row["runs"]):
            share = share_interval(round(value / unit * row["runs"]), row["runs"], LEVEL)[1:]
        compared = compare_flight(
            kind,
            here / unit,
            value / unit,
            rounding / unit,
            share=share,
            centre=_pair(found, "centre_low", "centre_high", unit),
            predicted=None if alone else _pair(found, "low", "high", unit),
            power=found.get("power"),
        )
    return replace(compared, fitted=str(row["fitted"]))


#: What a number has from the published file.
_COPIED = ("name", "subject", "unit", "source", "digits", "kind", "by_size", "again", "fitted")


def compared_number(row: Mapping[str, Any], ours: Recorded, seeds: int | None, kind: str = "twin") -> Number:
    """A published number beside ours, with both answers.

    Parameters
    ----------
    row, ours
        As `judge` takes them.
    seeds
        How many flights the run is of, where it is of more than one.
    kind
        Of the run: of a twin, the runs of one flight are what its bounds are over.

    Returns
    -------
    Number
        Its ``waiting`` is `MISSING` where the run has none.
    """
    found, compared = recorded_for(row, ours), judge(row, ours)
    over = None
    if found.get("low") is not None:
        over = found["flights"] or seeds or (found["n"] if kind == "twin" else None)
    copied: dict[str, Any] = {key: row[key] for key in _COPIED}
    copied |= {key: found.get(key) for key in ("low", "high")}
    return Number(
        **copied,
        published=abs(float(row["value"])) if row["by_size"] else float(row["value"]),
        here=found.get("value"),
        compared=compared,
        waiting=MISSING if compared is None else "",
        reason="" if compared is None else compared.reason,
        ratio=None if compared is None else compared.ratio,
        over=over,
    )


def _pair(found: Mapping[str, Any], low: str, high: str, unit: float = 1.0) -> tuple[float, float] | None:
    """Two bounds that were recorded; None where one is not known."""
    ends = found.get(low), found.get(high)
    return None if ends[0] is None or ends[1] is None else (ends[0] / unit, ends[1] / unit)


FOLDER = DATA / "published"

CALCULATED, MEAN_OF_RUNS, ONE_FLIGHT = "calculated", "mean of runs", "one flight"
#: Of a rate: all images of all flights together are compared, not one flight's.
SHARE_OF_IMAGES = "share of images"
_COLUMNS = [
    *("name", "subject", "value", "digits", "unit", "source", "rounding"),
    *("kind", "by_size", "runs", "again", "fitted", "unjudged"),
]
#: A number in print, 7.90 or 5, without quotes.
Printed = Annotated[Decimal, Field(strict=True)] | Annotated[int, Field(strict=True)]
Kind = Literal["one flight", "calculated", "mean of runs", "share of images"]


class PublishedNumber(Strict):
    """An entry ``[[number]]``. Decimals keep the digits of the print: 7.90 says how far it can be trusted."""

    study: str
    name: str
    subject: str
    value: Printed
    unit: str
    source: str
    within: Printed | None = None
    kind: Kind | None = None
    runs: int | None = None
    again: bool = False
    fitted: str = ""
    unjudged: str = ""


class PublishedClaim(Strict):
    """An entry ``[[claim]]``."""

    study: str
    id: str
    text: str
    source: str
    premise: str | None = None
    threshold: Printed | None = None
    reason: str | None = None
    own: bool = False
    fitted: str = ""
    needs: str | None = None


class PublishedFile(Strict):
    """A whole file, and what it says of all its numbers."""

    kind: Kind = "one flight"
    signs: Literal["defined", "undefined"] = "defined"
    last_digit: Literal["rounded", "within one"] = "rounded"
    number: tuple[PublishedNumber, ...] = ()
    claim: tuple[PublishedClaim, ...] = ()


#: What a quantity is, by its name; the first pattern that fits.
_QUANTITIES = (
    (re.compile(r"(mean_)?sd_\w+"), "standard deviation"),
    (re.compile(r"(nees|nis)(_\w+)?"), "NEES or NIS"),
    (re.compile(r"(size_of_)?mean_(north|east|down|ahead|right)"), "signed mean"),
    (re.compile(r"(\w+_)?(rate|fraction|share)(_\w+)?"), "rate"),
    (re.compile(r"(mae|rmse|\w*error)(_\w+)?"), "error size"),
)


def load_published(study: str, folder: Path = FOLDER) -> pd.DataFrame:
    """The published numbers of one study, in the order of the files.

    Parameters
    ----------
    study
        Its name in ``studies.toml``.
    folder
        That holds the files; left out, ``data/published``.

    Returns
    -------
    DataFrame
        ``name``, ``subject``, ``value`` (float), ``digits`` (decimals printed in the source), ``unit``,
        ``source``, ``rounding`` (what the print leaves open to each side), ``runs`` (NaN where none is
        stated), ``kind``, ``by_size`` (a signed mean that is compared by its size), ``again``, ``fitted``,
        ``unjudged``; no rows where the study has none.

    Raises
    ------
    WildlabError
        If a file is not TOML, an entry has an unknown or missing key, or a number is given twice.

    Examples
    --------
    >>> len(load_published("consistency-bounds"))
    6
    """
    import pandas as pd  # `wildlab list` takes the rows alone, and is there in half the time

    return pd.DataFrame(published_rows(study, folder), columns=_COLUMNS)


def published_values(study: str, folder: Path = FOLDER) -> dict[tuple[str, str], float]:
    """The published numbers of one study by subject and name; parameters as of `load_published`.

    Examples
    --------
    >>> published_values("schmidt-fast-vessel")["ekf", "mae"]
    9.4
    """
    return {(row["subject"], row["name"]): float(row["value"]) for row in published_rows(study, folder)}


def quantity_kind(name: str) -> str:
    """What the quantity of that name is: a key of `wildlab.evaluation.replication.KINDS`.

    Parameters
    ----------
    name
        Of a metric.

    Returns
    -------
    str
        Empty where no margin is fixed for it.

    Examples
    --------
    >>> quantity_kind("mean_sd_roll"), quantity_kind("mean_north"), quantity_kind("mae")
    ('standard deviation', 'signed mean', 'error size')
    """
    return next((kind for pattern, kind in _QUANTITIES if pattern.fullmatch(name)), "")


def published_rows(study: str, folder: Path = FOLDER) -> list[dict[str, Any]]:
    """The rows of `load_published`, with its arguments and errors."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for file, one in _numbers(study, folder):
        key = one.name, one.subject
        if key in rows:
            problem = f"{one.name} of {one.subject} of study {study!r} is given twice"
            raise WildlabError(problem, "keep one of them", file=folder.name)
        rows[key] = {
            **one.model_dump(include={"name", "subject", "unit", "source", "again", "fitted", "unjudged"}),
            "value": float(one.value),
            "digits": _decimals(one.value),
            "rounding": _rounding(one, file),
            "kind": one.kind or file.kind,
            "by_size": file.signs == "undefined" and quantity_kind(one.name) == "signed mean",
            "runs": math.nan if one.runs is None else float(one.runs),
        }
    return list(rows.values())


def _numbers(study: str, folder: Path) -> Iterator[tuple[PublishedFile, PublishedNumber]]:
    for file in _files(folder):
        yield from ((file, one) for one in file.number if one.study == study)


def load_claims(study: str, folder: Path = FOLDER) -> list[dict[str, Any]]:
    """The claims of one study, in the order of the files, each with ``study``, ``id``, ``text`` and
    ``source``, and ``premise``, ``threshold``, ``reason``, ``own`` and ``needs`` where it has them.

    Parameters
    ----------
    study
        Its name in ``studies.toml``.
    folder
        As for `load_published`.

    Returns
    -------
    list of dict
    """
    return [
        one.model_dump(exclude_unset=True)
        for file in _files(folder)
        for one in file.claim
        if one.study == study
    ]


def _files(folder: Path) -> list[PublishedFile]:
    found = []
    for path in sorted(folder.glob("*.toml")):
        try:
            state = path.stat()
            found.append(_read(path, state.st_mtime_ns, state.st_size))
        except (OSError, ValueError) as error:
            raise WildlabError(f"it cannot be read ({error})", "mend the file", file=path.name) from error
    return found


@lru_cache(maxsize=256)
def _read(path: Path, changed: int, size: int) -> PublishedFile:
    """A file, read once as long as it stays the same: each study asks for all of them."""
    content = tomllib.loads(path.read_text(encoding="utf-8"), parse_float=Decimal)
    file = check_model(PublishedFile, content, Path(path.name))
    for one in file.number:
        metric(one.name, one.subject, float(one.value), one.unit)
    return file


def _rounding(one: PublishedNumber, file: PublishedFile) -> float:
    """What the print leaves open to each side: half of the last digit, or of one of so many images."""
    if one.within is not None:
        return float(one.within)
    if file.last_digit == "within one":
        # One table, one last digit: 21 stands beside 21.2, its zero left out.
        return float(10.0 ** -max(_decimals(other.value) for other in file.number))
    if one.runs is not None and (one.kind or file.kind) != MEAN_OF_RUNS:
        return 0.5 / float(one.runs)
    return float(0.5 * 10.0 ** -_decimals(one.value))


def _decimals(value: Decimal | int) -> int:
    exponent = Decimal(value).as_tuple().exponent
    return max(0, -exponent) if isinstance(exponent, int) else 0
