"""The one form of a study's page: answer, main figure, numbers, published and ours, claims, figures.

A study computes; its texts lie in ``data/messages/en/<case>.toml`` (`wildlab.messages.catalogue`). What is
recorded (`wildlab.reporting.report.Report.metric`) are the facts from which the texts' numbers come, and by
which the study's rules choose its sentences (`wildlab.studies.rules`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.evaluation.shares import (
    ALMOST_ALL,
    ALMOST_NONE,
    FAILS,
    HOLDS,
    MOSTLY,
    MOSTLY_NOT,
    NO_PREMISE,
    Check,
)
from wildlab.messages.catalogue import PageTexts, TileText
from wildlab.messages.quantities import FORMS, number, unit_words
from wildlab.names import listed
from wildlab.reporting.published import load_claims, load_published
from wildlab.reporting.report import Report, Wording
from wildlab.simulation.parameters import (
    TwinParameters,
    each_parameter,
    fitted_to,
    load_twin,
    parameters_table,
    status_words,
)
from wildlab.studies.monte_carlo import CLAIM_COLUMNS, CLAIMS_EXPLAINED, decide_claims

#: Of so many flights each, ranges that lie apart are no chance: a rank test's two-sided probability is 3 %.
ENOUGH_APART = 4


class Shown(NamedTuple):
    """A figure, the key of its texts, and its file's name where that is another."""

    fig: Figure
    text: str
    name: str = ""


class Facts:
    """What a study has recorded, for the rules that choose its sentences; NaN where something is not known.

    Parameters
    ----------
    recorded
        Entries of ``metrics.json`` by name and subject.
    verdicts
        Of claims, by their id.
    shares
        By a claim's id the 95 % interval of the share of flights on which it is true, where it has one.

    Examples
    --------
    >>> facts = Facts({("mae", "ekf"): {"value": 9.4, "low": 5.0, "high": 14.0}}, {"nis-similar": "holds"})
    >>> float(facts.number("ekf/mae")), facts.holds("nis-similar")
    (9.4, True)
    """

    def __init__(
        self,
        recorded: Mapping[tuple[str, str], Mapping[str, Any]],
        verdicts: Mapping[str, str],
        shares: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        self.recorded, self.verdicts, self.shares = recorded, verdicts, shares or {}

    def number(self, key: str, what: str = "value") -> Any:
        """A recorded number by "subject/name", or another entry of it, as ``low`` or ``n``.

        With ``*`` in the key the numbers of all that fit, one alone where one does.
        """
        entries = {f"{subject}/{name}": entry for (name, subject), entry in self.recorded.items()}
        fit = [
            entry
            for known, entry in entries.items()
            if known == key or ("*" in key and fnmatchcase(known, key))
        ]
        found = np.array(
            [math.nan if (one := entry.get(what)) is None else one for entry in fit or [{}]], float
        )
        return found if len(found) > 1 else found[0]

    def holds(self, claim: str) -> bool:
        """Whether a claim holds."""
        return self.verdicts.get(claim) == HOLDS

    def choose(self, claim: str, yes: str, no: str, unclear: str = "unclear") -> str:
        """``yes`` where the claim holds on most flights or on all, ``no`` where it fails on as many."""
        verdict = self.verdicts.get(claim)
        return yes if verdict in (HOLDS, MOSTLY) else no if verdict in (FAILS, MOSTLY_NOT) else unclear

    def outcome(self, claim: str) -> str:
        """How a claim came out, as the end of a text's key.

        Returns
        -------
        str
            ``holds``; ``fails``; ``split`` where it is true on some flights and not on others, so many that
            nearly all and nearly none are ruled out; ``few`` where it is undecided otherwise; ``unknown``
            where it was not tested.
        """
        if self.verdicts.get(claim, NO_PREMISE) == NO_PREMISE:
            return "unknown"
        low, high = self.shares.get(claim, (0.0, 1.0))
        split = low > ALMOST_NONE and high < ALMOST_ALL
        return self.choose(claim, "holds", "fails", "split" if split else "few")

    def compare(self, first: str, second: str) -> str:
        """Which of two numbers, by "subject/name", is larger.

        Returns
        -------
        str
            ``more`` or ``less`` where the intervals of their medians lie apart, or the ranges of
            `ENOUGH_APART` flights; ``unclear`` where they overlap; ``few`` where there is no interval;
            ``unknown`` without a number.
        """
        if math.isnan(self.number(first) + self.number(second)):
            return "unknown"
        one, other = self._bounds(first), self._bounds(second)
        if np.isnan([*one, *other]).any():
            return "few"
        return "more" if one[0] > other[1] else "less" if other[0] > one[1] else "unclear"

    def _bounds(self, key: str) -> tuple[float, float]:
        ends = (
            ("low", "high") if self.number(key, "flights") == ENOUGH_APART else ("centre_low", "centre_high")
        )
        low, high = (float(self.number(key, end)) for end in ends)
        return low, high


Answer = Callable[[Facts], Sequence[str]]


def show_page(
    report: Report,
    texts: PageTexts,
    *,
    title: str,
    answer: Answer,
    figures: Sequence[Shown],
    checks: Mapping[str, Check] | None = None,
    tables: Mapping[str, pd.DataFrame] | None = None,
    values: Mapping[str, Any] | None = None,
    thesis: str = "H",
) -> None:
    """Write a study's page from what its report has recorded.

    Parameters
    ----------
    report
        With every number recorded that the page shows.
    texts
        Of the page; every sentence, caption and limit is one of them.
    title
        The question that the page answers.
    answer
        What is recorded -> keys of the sentences that answer it, most important first.
    figures
        The first is the page's main figure; the others stand two by two.
    checks
        By claim what the flights give for it; None where the study tests none, or has recorded its verdicts.
    tables
        Further tables by the key of their texts.
    values
        What placeholders without a subject stand for.
    thesis
        Whose figures the figures' names number: "H" or "F".

    Raises
    ------
    KeyError
        If a text, or a number that one names, is missing: a fault of the study.
    """
    wording = Wording(report, texts, values, thesis)
    decided = None if checks is None else decide_claims(report, load_claims(report.study), checks)
    facts = Facts(
        report.recorded,
        {one["id"]: one["verdict"] for one in report.claims},
        {one["id"]: (one["low"], one["high"]) for one in report.claims if one["low"] is not None},
    )
    report.head(title, wording.say(texts.subtitle))
    # All are filled in, so that a fault of one that is not chosen shows.
    sentences = {key: wording.say(text) for key, text in texts.answers.items()}
    report.summary([sentences[key] for key in answer(facts)])
    # A number may be of several flights or of a sensor that somebody's own flight has not.
    there = [one for one in texts.tiles if (one.name, one.subject) in report.recorded]
    report.tiles([tile_of(report, one, wording) for one in there])
    first, *others = figures
    wording.figure(first.text, first.fig, first.name, main=True)
    report.published("Published and here", texts.subjects, texts.quantities)
    _claims(report, decided)
    ordered = sorted((tables or {}).items(), key=lambda one: not texts.tables[one[0]].open)
    for key, frame in ordered:
        if texts.tables[key].open:
            wording.table(key, frame)
    if others:
        report.section("Figures")
    for i in range(0, len(others), 2):
        report.figures([wording.captioned(one.text, one.fig, one.name) for one in others[i : i + 2]])
    report.limits([wording.say(one) for one in texts.limits])
    report.section("Details")
    if decided is not None and len(decided):
        _premises(report, decided)
    for key, frame in ordered:
        if not texts.tables[key].open:
            wording.table(key, frame)
    rule = [] if decided is None or decided.empty else [CLAIMS_EXPLAINED]
    report.method("\n\n".join([texts.method, *rule]).strip())


def tile_of(report: Report, tile: TileText, wording: Wording) -> tuple[str, str]:
    """A recorded number, and its words with its interval and the published number."""
    entry = report.recorded[tile.name, tile.subject]
    words = wording.say(tile.text)
    low, high = entry.get("low"), entry.get("high")
    printed = report.printed(tile.name, tile.subject)
    # Beside a published number ours has its digits: 95.93 beside 96.83 is not 96 beside 97.
    plain = tile.form == "value" and printed is not None and entry["value"] is not None
    digits = int(printed["digits"]) if printed is not None else 0

    def shown(value: Any, form: str) -> str:
        return number(value, digits) if plain else FORMS[form]({**entry, "value": value})

    if low is not None and high is not None:
        ends = [shown(end, "percent" if tile.form == "percent" else "number") for end in (low, high)]
        # The range of flights, or the interval of the number itself.
        whose = "flights: " if entry.get("centre_low") is not None else ""
        words += f" ({whose}{' to '.join(ends)})" if ends[0] != ends[1] else ""
    if printed is not None:
        words += f"; published {shown(printed['value'], tile.form if not plain else 'number')}"
    unit = unit_words(entry["unit"]) if plain else ""
    return shown(entry["value"], tile.form) + unit, words


def _claims(report: Report, decided: pd.DataFrame | None) -> None:
    """With shares and differences where they are of flights; a study may have decided others by itself."""
    effects = {one["id"]: ("", "") for one in report.claims}
    if decided is not None:
        effects |= {
            one["id"]: (row["share"], row["difference"])
            for one, row in zip(report.claims, decided.to_dict("records"), strict=True)
        }
    report.claims_in_sight("Claims of the thesis", effects)


def _premises(report: Report, decided: pd.DataFrame) -> None:
    if (decided["premise"].astype(bool) | decided["threshold"].astype(bool)).any():
        columns = {name: CLAIM_COLUMNS[name] for name in ("claim", "premise", "threshold")}
        report.table(decided, columns=columns, fold="Premises and thresholds of the claims")


def show_twins(report: Report, twins: Sequence[str], study: str) -> None:
    """The section of a report on what was simulated: every parameter of each twin, folded away.

    Parameters
    ----------
    twins
        Their names.
    study
        Whose published tables stand beside them.
    """
    report.section("What was simulated")
    for twin in twins:
        table = parameters_table(twin)
        report.table(
            table,
            fold=f"The twin {twin}: {status_words(table)}",
            caption=f"Every parameter of the twin. {fit_words(load_published(study), load_twin(twin))}",
        )


def fit_words(published: pd.DataFrame, twin: TwinParameters) -> str:
    """What of a twin was fitted to which published tables, and what beside it is no test or a prediction.

    Parameters
    ----------
    published
        Columns ``source`` and ``fitted``, as `wildlab.reporting.published.load_published` gives them.
    """
    parts = ["No parameter of this twin was fitted to a published table."]
    if tables := fitted_to(twin):
        groups = dict.fromkeys(group for group, _, p in each_parameter(twin) if p.fitted_to)
        what = listed([group.replace("_", " ") for group in groups])
        parts = [
            f"Of this twin's parameters {what} were fitted to {listed(tables)} (sizes were chosen by how "
            "near they bring these tables; what causes such errors is not known)."
        ]
    predicted = []
    for source, reasons in published.groupby("source", sort=False)["fitted"]:
        used = [reason for reason in reasons if reason]
        if not used:
            predicted.append(str(source))
            continue
        what = "What stands" if len(used) == len(reasons) else f"{len(used)} of {len(reasons)} numbers"
        verb = "is" if len(used) == len(reasons) else "are"
        parts.append(f"{what} beside {source} {verb} no test: {'; '.join(dict.fromkeys(used))}.")
    if predicted:
        parts.append(f"What stands beside {listed(predicted)} is a prediction.")
    return " ".join(parts)
