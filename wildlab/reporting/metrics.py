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
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from wildlab.errors import WildlabError
from wildlab.evaluation.shares import FITTED, NO_PREMISE, SHARE_VERDICTS, UNDECIDABLE

KINDS = ("logged", "twin", "computed")
VERDICTS = (*SHARE_VERDICTS, NO_PREMISE, UNDECIDABLE, FITTED)

#: The metric that tells by its subject which poses others were held against; its value is at how many times.
AGAINST = "compared_with"

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_SUBJECT = re.compile(r"\S+")


def plain_number(value: Any, what: str) -> float | int | None:
    """``value`` as a plain number; None and NaN become None.

    Raises
    ------
    WildlabError
        If it is infinite or not a number at all.
    """
    if value is None:
        return None
    if isinstance(value, (bool, str)):
        raise WildlabError(f"{what} is {value!r}", "give a number or None")
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise WildlabError(f"{what} is of type {type(value).__name__}", "give a number or None") from error
    if math.isnan(number):
        return None
    if math.isinf(number):
        raise WildlabError(f"{what} is infinite", "give a number or None")
    return int(number) if isinstance(value, int) else number


#: What an entry of ``metrics`` has besides name, subject, value and unit, and one of ``claims`` besides id,
#: text and verdict; None where it is not given.
_METRIC: dict[str, type] = {
    "n": int,
    "published": float,
    "source": str,
    **dict.fromkeys(("low", "high"), float),
    "flights": int,
    **dict.fromkeys(("centre_low", "centre_high", "power"), float),
}
_GONE = frozenset({"below"})
_CLAIM: dict[str, type] = {
    "fraction": float,
    "seeds": int,
    **dict.fromkeys(("low", "high"), float),
    "met": int,
    **dict.fromkeys(("half", "twice"), str),
    **dict.fromkeys(("difference", "difference_low", "difference_high"), float),
}


def _entry(kinds: dict[str, type], given: dict[str, Any], what: str) -> dict[str, Any]:
    if unknown := set(given) - set(kinds):
        raise TypeError(f"{what} has no {min(unknown)!r}")
    return {
        name: None
        if given.get(name) is None
        else plain_number(given[name], f"{name} of {what}")
        if kind is float
        else kind(given[name])
        for name, kind in kinds.items()
    }


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
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        problem = f"the metric name {name!r} is not made of a-z, 0-9 and _"
        raise WildlabError(problem, "rename it: tools read it", field="metrics")
    if not isinstance(subject, str) or not _SUBJECT.fullmatch(subject):
        problem = f"the subject {subject!r} of metric {name!r} is empty or has a blank"
        raise WildlabError(problem, "join its parts with / or -", field="metrics")
    what = f"{name} of {subject}"
    value = plain_number(value, f"the value of {what}")
    entry = {"name": name, "subject": subject, "value": value, "unit": str(unit)} | _entry(
        _METRIC, more, what
    )
    if entry["low"] is not None and entry["high"] is not None and entry["low"] > entry["high"]:
        raise WildlabError(f"the low bound of {what} is above the high one", "swap them", field="metrics")
    return entry


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
    if not isinstance(id, str) or not _SUBJECT.fullmatch(id):
        raise WildlabError(f"the claim id {id!r} is empty or has a blank", "use letters, digits, - and _")
    entry = _entry(_CLAIM, more, f"claim {id}")
    for one in (verdict, *(entry[name] for name in ("half", "twice") if entry[name] is not None)):
        if one not in VERDICTS:
            raise WildlabError(
                f"the verdict {one!r} of claim {id!r} is unknown", f"use one of: {', '.join(VERDICTS)}"
            )
    for name in ("fraction", "low", "high"):
        if entry[name] is not None and not 0 <= entry[name] <= 1:
            problem = f"the {name} of claim {id!r} is {entry[name]}"
            raise WildlabError(problem, "give a share from 0 to 1")
    return {"id": id, "text": str(text), "verdict": verdict} | entry


def document(
    *,
    study: str,
    flight: str,
    kind: str,
    seed: int | None,
    seeds: int | None,
    metrics: Iterable[dict[str, Any]],
    claims: Iterable[dict[str, Any]],
) -> dict[str, Any]:
    """The whole content of ``metrics.json``; a name and subject, or a claim, that comes twice is an error."""
    if kind not in KINDS:
        raise WildlabError(f"the kind {kind!r} is unknown", f"use one of: {', '.join(KINDS)}", field="kind")
    for field, number in (("seed", seed), ("seeds", seeds)):
        if number is not None and (isinstance(number, bool) or not isinstance(number, int) or number < 0):
            raise WildlabError(f"{field} is {number!r}", "give a whole number, or None", field=field)
    metrics, claims = list(metrics), list(claims)
    seen: set[tuple[str, ...]] = set()
    for key in [(m["name"], m["subject"]) for m in metrics] + [(c["id"],) for c in claims]:
        if key in seen:
            raise WildlabError(f"{' of '.join(key)} is given twice", "give each number and claim once")
        seen.add(key)
    return {
        "study": study,
        "flight": flight,
        "kind": kind,
        "seed": seed,
        "seeds": seeds,
        "metrics": metrics,
        "claims": claims,
    }


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
        return document(
            study=str(raw["study"]),
            flight=str(raw["flight"]),
            kind=raw["kind"],
            seed=raw["seed"],
            seeds=raw["seeds"],
            # What an earlier version wrote besides is of no use to this one.
            metrics=[
                metric(**{key: entry[key] for key in entry if key not in _GONE}) for entry in raw["metrics"]
            ],
            claims=[claim(**entry) for entry in raw["claims"]],
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise WildlabError(
            f"this is not a metrics file ({type(error).__name__}: {error})", "run the study again", file=path
        ) from error


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")
