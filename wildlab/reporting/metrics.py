"""``metrics.json``: the numbers a run leaves behind, for tools, tests and the ledger.

::

    {"study", "flight", "kind": "logged"|"twin"|"computed", "seed", "seeds",
     "metrics": [{"name", "subject", "value", "unit", "n", "published", "source", "low", "high",
                 "flights", "centre_low", "centre_high", "power"}],
     "claims":  [{"id", "text", "verdict", "fraction", "seeds", "low", "high", "met", "half", "twice",
                  "difference", "difference_low", "difference_high"}]}

A value that could not be computed is ``null``. ``low`` and ``high`` bound the spread over ``seeds`` flights
(or over ``n`` runs of one): the 90 % prediction interval of one more, from 19 on, the lowest and the
highest of fewer, ``null`` for one. Of a calculation they bound what rounded inputs leave open; where there
are no flights to go over, the middle 90 % of draws with replacement. ``flights`` is how many have a value,
``centre_low`` and ``centre_high`` the 90 % confidence interval of their median, and ``power`` the probability
that a published flight with errors half as large would lie outside (`wildlab.evaluation.replication`). Of a
claim, ``fraction`` is the share of the ``met`` flights that meet its premise, ``low`` and ``high`` its 95 %
interval; ``half`` and ``twice`` the verdicts at other thresholds; ``difference`` the paired mean difference
with its interval.
``seeds`` is how many flights the numbers come from; ``first_look`` in ``status.json`` beside it says where
those are fewer than the study's own.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from wildlab.errors import WildlabError
from wildlab.evaluation.shares import FITTED, NO_PREMISE, SHARE_VERDICTS, UNDECIDABLE

VERDICTS = (*SHARE_VERDICTS, NO_PREMISE, UNDECIDABLE, FITTED)
#: The metric that tells by its subject which poses others were held against; its value is at how many times.
AGAINST = "compared_with"
#: A mean outside of its band by less than this factor may be so by chance, where few values are independent.
NEAR_THE_BAND = 1.5


def band_name(name: str, end: str) -> str:
    """The metric of an end of the band in which the mean of a consistent filter lies.

    Examples
    --------
    >>> band_name("nees", "high")
    'nees_band_high'
    """
    return f"{name}_band_{end}"


def _plain(value: Any) -> float | int | None:
    """A plain number; None and NaN become None."""
    if value is None:
        return None
    if isinstance(value, (bool, str)):
        raise ValueError("it is no number")
    number = float(value)
    if math.isinf(number):
        raise ValueError("it is infinite")
    return None if math.isnan(number) else int(number) if isinstance(value, int) else number


def _known(verdict: str) -> str:
    if verdict not in VERDICTS:
        raise ValueError(f"it is none of: {', '.join(VERDICTS)}")
    return verdict


def _made_of(pattern: str, otherwise: str) -> AfterValidator:
    def check(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError(otherwise)
        return text

    return AfterValidator(check)


Name = Annotated[str, _made_of("[a-z][a-z0-9_]*", "it is not made of a-z, 0-9 and _")]
Subject = Annotated[str, _made_of(r"\S+", "it is empty or has a blank")]
Plain = Annotated[float | int | None, BeforeValidator(_plain)]
Count = Annotated[int | None, BeforeValidator(lambda value: None if value is None else int(value))]
Share = Annotated[Annotated[float, Field(ge=0, le=1)] | None, BeforeValidator(_plain)]
VerdictWord = Annotated[str, BeforeValidator(_known)]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        low, high = getattr(self, "low", None), getattr(self, "high", None)
        if low is not None and high is not None and low > high:
            raise ValueError("its low bound is above the high one")
        return self


class _Metric(_Entry):
    name: Name
    subject: Subject
    value: Plain
    unit: str
    n: Count = None
    published: Plain = None
    source: str | None = None
    low: Plain = None
    high: Plain = None
    flights: Count = None
    centre_low: Plain = None
    centre_high: Plain = None
    power: Plain = None


class _Claim(_Entry):
    id: Subject
    text: str
    verdict: VerdictWord
    fraction: Share = None
    seeds: Count = None
    low: Share = None
    high: Share = None
    met: Count = None
    half: VerdictWord | None = None
    twice: VerdictWord | None = None
    difference: Plain = None
    difference_low: Plain = None
    difference_high: Plain = None


class _Document(_Entry):
    study: str
    flight: str
    kind: Literal["logged", "twin", "computed"]
    seed: Annotated[int, Field(ge=0, strict=True)] | None
    seeds: Annotated[int, Field(ge=0, strict=True)] | None
    metrics: list[dict[str, Any]]
    claims: list[dict[str, Any]]

    @model_validator(mode="after")
    def _once(self) -> Self:
        keys = [(one["name"], one["subject"]) for one in self.metrics] + [(one["id"],) for one in self.claims]
        if several := [key for key, count in Counter(keys).items() if count > 1]:
            raise ValueError(f"{' of '.join(several[0])} is given twice")
        return self


def _checked(model: type[_Entry], values: dict[str, Any], what: str) -> dict[str, Any]:
    try:
        return model(**values).model_dump()
    except ValidationError as error:
        first = error.errors()[0]
        said = first["msg"].removeprefix("Value error, ")
        where = f"{first['loc'][0]} {first['input']!r} of {what}" if first["loc"] else what
        raise WildlabError(f"{where}: {said}", "mend what records it", field="metrics") from None


def metric(name: str, subject: str, value: Any, unit: str, **more: Any) -> dict[str, Any]:
    """One entry of ``metrics``, checked.

    Parameters
    ----------
    name
        Of ``a-z``, ``0-9`` and ``_``.
    subject
        What the number is of, without blanks: ``ekf``, ``level/roll``.
    value
        The number; NaN becomes null.
    unit
        ``"m"``, ``"deg"``; ``"1"`` for a number without.
    **more
        ``n``: how many values it is from. ``published`` and ``source``: the printed number, and where it is
        printed. ``low`` and ``high``: bounds of the value. ``flights``: how many have a value.
        ``centre_low`` and ``centre_high``: 90 %
        confidence interval of the value, as the centre of what all such flights give. ``power``: of
        "outside", for a published flight with errors half as large.

    Returns
    -------
    dict
        As ``metrics.json`` has it.

    Examples
    --------
    >>> metric("rmse", "kf", 1.25, "m")["value"]
    1.25
    """
    given = {"name": name, "subject": subject, "value": value, "unit": unit, **more}
    return _checked(_Metric, given, f"the metric {name!r} of {subject!r}")


def claim(id: str, text: str, verdict: str, **more: Any) -> dict[str, Any]:
    """One entry of ``claims``, checked.

    Parameters
    ----------
    id
        Of the claim, as the published file has it.
    text
        The claim itself.
    verdict
        ``"holds"`` or another of the known verdicts.
    **more
        ``half`` and ``twice``: the verdicts at half and at twice the threshold.
        ``fraction``, ``low`` and ``high``: share of the flights that meet the premise on which it is true,
        and its interval, between 0 and 1. ``seeds`` and ``met``: how many flights, and how many meet the
        premise. ``difference``, ``difference_low`` and ``difference_high``: of what is compared, with its
        interval.

    Returns
    -------
    dict
        As ``metrics.json`` has it.

    Examples
    --------
    >>> claim("better", "The filter is better.", "holds")["verdict"]
    'holds'
    """
    return _checked(_Claim, {"id": id, "text": text, "verdict": verdict, **more}, f"the claim {id!r}")


def document(
    *, metrics: Iterable[dict[str, Any]], claims: Iterable[dict[str, Any]], **about: Any
) -> dict[str, Any]:
    """The whole content of ``metrics.json``; a name and subject, or a claim, that comes twice is an error.

    ``about``: study, flight, kind, seed and seeds.
    """
    given = {**about, "metrics": list(metrics), "claims": list(claims)}
    return _checked(_Document, given, f"the study {about.get('study')!r}")


def read_metrics(path: Path) -> dict[str, Any]:
    """Read and check a ``metrics.json``.

    Parameters
    ----------
    path
        Of a ``metrics.json``.

    Returns
    -------
    dict

    Raises
    ------
    WildlabError
        If it cannot be read or is not what `document` makes.
    """
    try:
        raw = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_constant)
        metrics = [metric(**entry) for entry in raw["metrics"]]
        claims = [claim(**entry) for entry in raw["claims"]]
        return document(**{**raw, "metrics": metrics, "claims": claims})
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise WildlabError(
            f"this is not a metrics file ({type(error).__name__}: {error})", "run the study again", file=path
        ) from error


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")
