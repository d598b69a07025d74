"""Several flights on one page: a column for each, and a figure for each number that two or more have."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.verdict import Verdict
from wildlab.messages.catalogue import Message, fill, load_texts
from wildlab.messages.quantities import NOTHING, area, duration, metres, number, percent, way_length
from wildlab.names import listed
from wildlab.paths import DATA
from wildlab.reporting.charts.drawing import DASHED, Values, rows_chart
from wildlab.reporting.figures import GREY
from wildlab.reporting.front_page import OwnFlight, pill_of
from wildlab.reporting.notebook_pages import LIMITS, finished_page
from wildlab.reporting.report import Wording, open_report
from wildlab.reporting.text import TAGS, csv_link

#: Rounding errors of what is zero.
NO_MORE = 1e-9


class Quantity(NamedTuple):
    """A number that flights are compared by, as ``data/compared.toml`` has it.

    Attributes
    ----------
    key, label
        Column of the CSV, and what it is called.
    report, name, subject
        The report that gives it, and the number there.
    unit, written
        Of the axis of its figure; how it is written, a key of `FORMATS`.
    n
        What its ``n`` counts; "" where nothing.
    goal
        What would be ideal, for the figure; None where there is no such.
    drawn
        Whether there is a figure of it.
    """

    key: str
    label: str
    report: str
    name: str
    subject: str
    unit: str
    written: str
    n: str = ""
    goal: float | None = None
    drawn: bool = False


QUANTITIES = tuple(
    Quantity(**row) for row in tomllib.loads((DATA / "compared.toml").read_text("utf-8"))["quantity"]
)
#: How value, low and high end (NaN where there are none) of a number are written, with its unit.
FORMATS: Mapping[str, Callable[[float, float, float, str], str]] = {
    "duration": lambda value, *_: duration(value),
    "way": lambda value, *_: way_length(value),
    "area": lambda value, *_: area(value),
    "share": lambda value, *_: percent(value, 0),
    "length": lambda value, low, high, _: metres(value, low, high),
    "number": lambda value, low, high, unit: f"{number(value)} {unit}".strip(),
}


def entry_of(flight: OwnFlight, quantity: Quantity) -> Mapping[str, Any] | None:
    """The number of a flight; of tracks that of the leading filter, where there is one of it alone.

    Parameters
    ----------
    flight
        With its reports.
    quantity
        Of `QUANTITIES`.

    Returns
    -------
    dict or None
        As ``metrics.json`` has it.
    """
    report = flight.report(quantity.report)
    if report is None:
        return None
    entry = report.numbers.get((quantity.name, quantity.subject))
    if quantity.report == "tracking":
        alike = [*report.of_leading_filter(quantity.name).values()]
        entry = alike[0] if len(alike) == 1 else None
    return None if entry is None or entry["value"] is None else entry


def why_not(flight: OwnFlight, quantity: Quantity) -> str:
    """Why a flight has no such number, as a clause.

    Parameters
    ----------
    flight, quantity
        As for `entry_of`.

    Returns
    -------
    str
    """
    report, overview = flight.report(quantity.report), flight.report("overview")
    if report is None:
        lacking = [] if overview is None else overview.lacking
        reason = next((one for one in lacking if one.startswith(quantity.report)), "")
        if reason := reason.partition("(")[2].removesuffix(")"):
            return reason
        key = "no-report"
    elif report.state != "done":
        key = "not-done"
    else:
        several = quantity.report == "tracking" and any(name == quantity.name for name, _ in report.numbers)
        key = "several" if several else "no-number"
    state = "" if report is None else report.state
    return fill(load_texts("comparison").answers[key], {}, {"report": quantity.report, "state": state})


def flights_table(flights: Sequence[OwnFlight]) -> pd.DataFrame:
    """A row for each flight, for ``flights.csv``: what it is, its verdict, its numbers with low, high and n.

    Parameters
    ----------
    flights
        To be compared.

    Returns
    -------
    DataFrame
        A number that was not measured is NaN, and its column ``..._why`` says why.
    """
    rows = []
    for flight in flights:
        row: dict[str, object] = {
            "flight": flight.name,
            "kind": flight.kind,
            "verdict": pill_of(flight)[0],
            "evaluated": flight.finished,
        }
        for quantity in QUANTITIES:
            entry = entry_of(flight, quantity)
            for part in ("value", "low", "high", "n"):
                name = quantity.key if part == "value" else f"{quantity.key}_{part}"
                row[name] = np.nan if entry is None or entry[part] is None else entry[part]
            row[f"{quantity.key}_why"] = "" if entry is not None else why_not(flight, quantity)
        rows.append(row)
    return pd.DataFrame(rows)


def comparison_page(flights: Sequence[OwnFlight]) -> str:
    """The whole page.

    Parameters
    ----------
    flights
        Two or more.

    Returns
    -------
    str
        HTML. Other reports are named, not linked: the page is mailed alone.
    """
    report = open_report(study="comparison", kind="computed")
    wording = Wording(report, load_texts("comparison"), {"n": len(flights)})
    texts, title = wording.texts.subjects, wording.say(wording.texts.subjects["title"])
    report.head(title, ", ".join(flight.name for flight in flights))
    words = [pill_of(flight)[0] for flight in flights]
    counts = "; ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    report.summary(wording.messages([Message("counted", {"counts": counts})]), **_worst(flights, wording))
    side = wording.texts.tables["flights"]
    report.section(side.title)
    names = {f"flight{k}": flight.name for k, flight in enumerate(flights)}
    report.table(_aligned(flights, texts), columns={"quantity": "", **names}, caption=side.caption)
    figures = [made for one in QUANTITIES if one.drawn and (made := _figure(flights, one, wording))]
    if figures:
        report.section(texts["drawn"], texts["drawn-intro"])
        for k in range(0, len(figures), 2):
            report.figures(figures[k : k + 2])
    if reasons := wording.messages(_reasons(flights)):
        report.section(texts["reasons"], part=LIMITS)
        report.points(reasons)
    report.section(texts["reports"])
    report.points(f"{flight.name}: {', '.join(one.about for one in flight.reports)}" for flight in flights)
    link = csv_link(flights_table(flights), "flights", texts["csv"])
    return finished_page(
        report.parts,
        title=title,
        name="comparison",
        kicker="wildlab › flights › comparison",
        footer=f"<p>{link or texts['beside']}.</p>",
    )


def _worst(flights: Sequence[OwnFlight], wording: Wording) -> dict[str, Any]:
    """The verdict that presses most with whose it is, and its colour."""
    words = [flight.verdict or Verdict.UNJUDGED for flight in flights]
    # A flight that could not be judged may be worse than a sound one.
    word = max(words, key=lambda one: 0.5 if one == Verdict.UNJUDGED else one.level)
    whose = listed([flight.name for flight, one in zip(flights, words, strict=True) if one == word])
    return {
        "verdict": (word.value, *wording.messages([Message("worst", {"flights": whose})])),
        "level": word.colour,
    }


def _aligned(flights: Sequence[OwnFlight], texts: Mapping[str, str]) -> pd.DataFrame:
    rows = [
        (texts["verdict"], *(f"**{pill_of(flight)[0]}**" for flight in flights)),
        (texts["kind"], *(TAGS.get(flight.kind, flight.kind) for flight in flights)),
        (texts["evaluated"], *(flight.finished or NOTHING for flight in flights)),
    ]
    for quantity in QUANTITIES:
        entries = [entry_of(flight, quantity) for flight in flights]
        if any(entry is not None for entry in entries):
            cells = (texts["not-measured"] if one is None else _cell(one, quantity) for one in entries)
            rows.append((quantity.label, *cells))
    return pd.DataFrame(rows, columns=["quantity", *(f"flight{k}" for k in range(len(flights)))])


def _cell(entry: Mapping[str, Any], quantity: Quantity) -> str:
    value, low, high = (_plain(entry[part]) for part in ("value", "low", "high"))
    over = f" ({entry['n']} {quantity.n})" if quantity.n and entry["n"] is not None else ""
    return f"{FORMATS[quantity.written](value, low, high, quantity.unit)}{over}"


def _plain(value: Any) -> float:
    """NaN for none, and zero for what is one but for rounding."""
    if value is None:
        return float("nan")
    return 0.0 if abs(float(value)) < NO_MORE else float(value)


def _figure(
    flights: Sequence[OwnFlight], quantity: Quantity, wording: Wording
) -> tuple[Any, str, str, str] | None:
    found = [(flight.name, entry) for flight in flights if (entry := entry_of(flight, quantity)) is not None]
    if len(found) < 2:
        return None
    scale = 100.0 if quantity.unit == "%" else 1.0
    value, low, high = (
        [scale * _plain(entry[part]) for _, entry in found] for part in ("value", "low", "high")
    )
    unit = f" ({quantity.unit})" if quantity.unit else ""
    title = f"{quantity.label[:1].upper()}{quantity.label[1:]}"
    (said,) = wording.messages(
        [Message("drawn", {"what": f"{title}{unit}", "n": len(found), "all": len(flights)})]
    )
    goal = None if quantity.goal is None else scale * quantity.goal
    names = [name if len(name) <= 24 else f"{name[:22]}…" for name, _ in found]
    dots = {"": Values(value, np.array([low, high]))}
    chart = rows_chart(names, dots, f"{quantity.label}{unit}", size=(4.6, 1.3 + 0.36 * len(names)))
    if goal is not None:
        chart.axes[0].axvline(goal, color=GREY, **DASHED)
    return chart, quantity.key.replace("_", "-"), said, said


def _reasons(flights: Sequence[OwnFlight]) -> list[Message]:
    """What flights lack, those that lack the same for the same reason together."""
    found: dict[tuple[str, str], list[str]] = {}
    for flight in flights:
        for quantity in QUANTITIES:
            if entry_of(flight, quantity) is None:
                found.setdefault((flight.name, why_not(flight, quantity)), []).append(quantity.label)
    return [
        Message("reason", {"flight": name, "quantities": ", ".join(dict.fromkeys(labels)), "why": why})
        for (name, why), labels in found.items()
    ]
