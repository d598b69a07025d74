"""The one form of a study's page: answer, main figure, numbers, published and ours, claims, figures.

A study computes; its texts lie in ``data/messages/en/<case>.toml`` (`wildlab.messages.catalogue`). What is
recorded (`wildlab.reporting.report.Report.metric`) are the facts from which the texts' numbers come, and by
which the study's rules choose its sentences (`wildlab.studies.rules`).

Of many simulated flights the published numbers stand beside ours, and claims have verdicts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import LEVEL, Interval, median_interval, share_interval
from wildlab.evaluation.replication import power_of
from wildlab.evaluation.shares import (
    ALMOST_ALL,
    ALMOST_NONE,
    FAILS,
    FITTED,
    HOLDS,
    MOSTLY,
    MOSTLY_NOT,
    NO_PREMISE,
    UNDECIDABLE,
    UNDECIDED,
    Check,
    decide_check,
    paired_difference,
)
from wildlab.messages.catalogue import PageTexts, TileText
from wildlab.messages.quantities import FORMS, number, percent, unit_words
from wildlab.names import listed
from wildlab.reporting.published import (
    SHARE_OF_IMAGES,
    bounds_of,
    load_claims,
    load_published,
    quantity_kind,
    size_name,
)
from wildlab.reporting.report import Report, Wording
from wildlab.simulation.parameters import (
    TwinParameters,
    each_parameter,
    fitted_to,
    load_twin,
    parameters_table,
    status_words,
)
from wildlab.studies.rules import keys_of

#: Headings of the table that `decide_claims` gives.
CLAIM_COLUMNS = {
    "claim": "claim",
    "source": "where",
    "verdict": "verdict",
    "share": "how often true",
    "difference": "difference, mean",
    "premise": "premise",
    "threshold": "at half and twice the threshold",
}
#: By how much a threshold is varied.
TIMES = {"half": 0.5, "twice": 2.0}
#: What stands over the claims.
CLAIMS_EXPLAINED = (
    "A claim holds where the 95 % interval of the share of flights on which it is true lies at or above "
    "90 %, on most flights above 50 %; likewise it fails below 50 % and does not hold below 10 %. Where the "
    "interval has 50 % in it, it is undecided. A vague word has a threshold, which is ours: the verdicts at "
    "half and at twice of it stand beside, where what is measured can be on either side of them. "
    "Differences are means over flights, with their 95 % interval, and the sign that the claim gives them."
)


def record_spread(
    report: Report, unit_of: Callable[[str], str | None], spread: pd.DataFrame, n: Mapping[str, int]
) -> None:
    """Record medians over flights, as their range what `bounds_of` gives, and the flights below the print.

    A signed mean that is published is recorded by its size as well, which is what it is compared by where
    the thesis does not define its sign.

    Parameters
    ----------
    unit_of
        The unit of a number by its name; None where it is not recorded.
    spread
        Columns (subject, name), one row for each flight; a flight on which a quantity was not computed has
        NaN.
    n
        How many observations stand behind each subject, where that is known.
    """
    for subject, name in keys_of(spread):
        unit = unit_of(name)
        if unit is None:
            continue
        values, printed = spread[subject, name], report.printed(name, subject)
        if printed is not None and printed["kind"] == SHARE_OF_IMAGES:
            share, images = pooled_share(spread, subject, name)
            if images:
                centre = share_interval(min(share.estimate, 1.0) * images, images, LEVEL)
                report.metric(
                    name, subject, share.estimate, unit, n=images, low=share.low, high=share.high,
                    flights=int(values.notna().sum()), centre_low=centre.low, centre_high=centre.high,
                )  # fmt: skip
                continue
        _record(report, name, subject, values, unit, n.get(subject))
        if printed is not None and quantity_kind(name) == "signed mean" and len(values) > 1:
            _record(report, size_name(name), subject, values.abs(), unit, n.get(subject))


def pooled_share(spread: pd.DataFrame, subject: str, name: str) -> tuple[Interval, int]:
    """A share of all images of all flights, with its 95 % interval, and how many images there are.

    Parameters
    ----------
    spread
        One row for each flight; besides the share of each flight it has how many ``images`` there were.
    subject, name
        Of the share. Of a mean count the interval is that of a share, and ends at one.

    Returns
    -------
    (share, images)
        The share is NaN where there is no image.
    """
    images, rate = (spread[subject, one].to_numpy(float) for one in ("images", name))
    known = np.isfinite(rate) & (images > 0)
    count, of = round(float((images * rate)[known].sum())), round(float(images[known].sum()))
    if not of:
        return Interval(np.nan, np.nan, np.nan), 0
    share = share_interval(min(count, of), of)
    return share._replace(estimate=count / of), of


def _record(
    report: Report,
    name: str,
    subject: str,
    values: pd.Series,
    unit: str,
    n: int | None,
) -> None:
    low, high = bounds_of(values)
    centre_low, centre_high = median_interval(values)
    kind = quantity_kind(name)
    report.metric(
        name,
        subject,
        values.median(),
        unit,
        n=n,
        low=low,
        high=high,
        flights=int(np.isfinite(values).sum()),
        centre_low=centre_low,
        centre_high=centre_high,
        power=power_of(values / 100 if kind == "rate" and unit == "%" else values, kind) if kind else None,
    )


def decide_claims(
    report: Report, claims: Sequence[Mapping[str, Any]], checks: Mapping[str, Check]
) -> pd.DataFrame:
    """Record the verdict on each claim, and return them as a table of `CLAIM_COLUMNS`.

    A claim that ``needs`` what no simulated flight has cannot be decided; it asks for no check.

    Parameters
    ----------
    claims
        As `wildlab.reporting.published.load_claims` gives them, with the thresholds of vague words.
    checks
        By the claim's id what the flights give for it.

    Raises
    ------
    WildlabError
        If a claim has no check, or a check needs a threshold that is not stated.
    """
    rows = []
    for claim in claims:
        text = claim["text"] + (" (Ours, not the thesis's.)" if claim.get("own") else "")
        if "needs" in claim:
            report.claim(claim["id"], claim["text"], UNDECIDABLE)
            undecidable = {
                "share": f"needs {claim['needs']}",
                "difference": "",
                "premise": "",
                "threshold": "",
            }
            rows.append({"claim": text, "source": claim["source"], "verdict": UNDECIDABLE} | undecidable)
            continue
        if claim["id"] not in checks:
            raise WildlabError(
                f"nothing was computed for the claim {claim['id']!r}",
                "give it a check whose numbers every flight has, or take it out of data/published",
                field=report.study,
            )
        check = checks[claim["id"]]
        threshold = None if "threshold" not in claim else float(claim["threshold"])
        found = decide_check(check, threshold)
        at = {}
        if threshold is not None and found.verdict != NO_PREMISE:
            at = {
                key: decide_check(check, times * threshold).verdict
                for key, times in TIMES.items()
                if check.reaches(times * threshold)
            }
        apart = None
        if check.first is not None and check.second is not None:
            apart = paired_difference(check.first, check.second)
        share = found.share
        report.claim(
            claim["id"],
            claim["text"],
            FITTED if claim.get("fitted") else found.verdict,
            fraction=None if share is None else share.estimate,
            low=None if share is None else share.low,
            high=None if share is None else share.high,
            seeds=found.flights,
            # Images together, and a calculation, are of no number of flights.
            met=None if check.calculated or (check.pooled and check.pooled.of) else found.met,
            half=at.get("half"),
            twice=at.get("twice"),
            difference=None if apart is None else apart.estimate,
            difference_low=None if apart is None else apart.low,
            difference_high=None if apart is None else apart.high,
        )
        rows.append(
            {
                "claim": text,
                "source": claim["source"],
                "verdict": f"{FITTED} ({claim['fitted']})" if claim.get("fitted") else found.verdict,
                "share": _share_words(found, check),
                "difference": "" if apart is None else _difference_words(apart, check),
                "premise": _premise_words(claim.get("premise", ""), check, found),
                "threshold": _threshold_words(threshold, at, claim.get("reason", "")),
            }
        )
    return pd.DataFrame(rows)


def _share_words(found: Any, check: Check) -> str:
    if check.calculated and check.measured is not None:
        least, most = f"{check.measured.min():.3g}", f"{check.measured.max():.3g}"
        apart = f"{least} to {most}" if least != most else least
        return f"a calculation: {apart} {check.unit}".rstrip()
    if check.pooled is not None and check.pooled.of:
        count, of = check.pooled
        ends = share_interval(count, of)[1:]
        return f"{count} of {of} {check.unit or 'images'} ({percent(ends[0])} to {percent(ends[1])})"
    if found.share is None:
        return f"{found.met} of {found.flights} flights meet the premise"
    low, high = (100 * end for end in found.share[1:])
    told = f"{found.true} of {found.met}"
    beyond = f", of {found.flights} flights in all" if found.met < found.flights else ""
    beyond += ": too few to decide" if found.verdict == UNDECIDED and found.true in (0, found.met) else ""
    return f"{told} ({low:.0f} to {high:.0f} %){beyond}"


def _difference_words(apart: Interval, check: Check) -> str:
    """A difference of what a check compares, and on which side of zero its claim has it, where it says so."""
    lead = np.asarray(check.first, float) - np.asarray(check.second, float)
    true = () if check.true is None else check.true
    side = next((end for end, so in ((">", lead > 0), ("<", lead < 0)) if np.array_equal(true, so)), "")
    claimed = f"; claimed {side} 0" if side else ""
    return interval_words(apart, 1 if abs(apart.estimate) >= 10 else 2, check.unit) + claimed


def interval_words(found: Interval, digits: int, unit: str = "", least: float = -np.inf) -> str:
    """A number with its interval, which ends at ``least``; alone where it has none.

    Examples
    --------
    >>> interval_words(Interval(2.0, -0.5, 4.5), 1, "m"), interval_words(Interval(2.0, np.nan, np.nan), 1)
    ('2.0 (−0.5 to 4.5) m', '2.0')
    """
    ends = [number(max(end, least), digits) for end in found[1:]]
    around = f" ({ends[0]} to {ends[1]})" if np.isfinite(found.low) else ""
    return f"{number(found.estimate, digits)}{around} {unit}".rstrip()


def _premise_words(premise: str, check: Check, found: Any) -> str:
    if not premise:
        return ""
    if check.premise is None:
        return premise
    return f"{premise}: {found.met} of {found.flights} flights"


def _threshold_words(threshold: float | None, at: Mapping[str, str], reason: str) -> str:
    if threshold is None:
        return ""
    why = f" ({reason})" if reason else ""
    if not at:
        return f"{threshold:g}{why}"
    beside = ", ".join(f"at {TIMES[key] * threshold:g} {verdict}" for key, verdict in at.items())
    return f"{beside}; taken: {threshold:g}{why}"


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
    if decided is not None and len(decided) and decided[["premise", "threshold"]].astype(bool).any(axis=None):
        columns = {name: CLAIM_COLUMNS[name] for name in ("claim", "premise", "threshold")}
        report.table(decided, columns=columns, fold="Premises and thresholds of the claims")
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
