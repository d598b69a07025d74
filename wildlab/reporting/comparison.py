"""Several flights on one page: a column for each, and a figure for each number that two or more have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.overviews.verdict import Verdict
from wildlab.analysis.tracks.judged import LEADING
from wildlab.messages.quantities import NOTHING, area, duration, metres, number, percent, way_length
from wildlab.names import listed
from wildlab.reporting.charts.drawing import dots_chart
from wildlab.reporting.layout import LIMITS, arranged, with_glossary
from wildlab.reporting.notebook_pages import examine
from wildlab.reporting.own_flights import OwnFlight
from wildlab.reporting.page import TAGS, page
from wildlab.reporting.report import open_report
from wildlab.reporting.text import csv_link

#: Rounding errors of what is zero.
NO_MORE = 1e-9
#: What is said where a flight lacks a number; the reason follows.
NOT_MEASURED = "not measured"


class Quantity(NamedTuple):
    """A number that flights are compared by.

    Attributes
    ----------
    key
        Column of the CSV.
    label
        What it is called.
    about
        The report that gives it.
    name, subject
        Of the number there.
    unit
        Of the axis of its figure.
    words
        Takes value, low and high (NaN where there are none) and gives what the table shows.
    n
        What its ``n`` counts; "" where it says nothing.
    goal
        What would be ideal, for the figure; None where there is no such.
    drawn
        Whether there is a figure of it.
    """

    key: str
    label: str
    about: str
    name: str
    subject: str
    unit: str
    words: Callable[[float, float, float], str]
    n: str = ""
    goal: float | None = None
    drawn: bool = False


def _m(value: float, low: float, high: float) -> str:
    return metres(value, low, high) if np.isfinite(low + high) else metres(value)


def _unit(unit: str) -> Callable[[float, float, float], str]:
    return lambda value, low, high: f"{number(value)} {unit}".strip()


def _share(value: float, low: float, high: float) -> str:
    return percent(value, 0)


QUANTITIES = (
    Quantity("duration_s", "length", "overview", "duration", "flight", "s", lambda v, *_: duration(v)),
    Quantity("path_m", "path", "overview", "path_length", "flight", "m", lambda v, *_: way_length(v)),
    Quantity(
        "height_m",
        "height above ground, median and middle 90 %",
        "overview",
        "height_above_ground",
        "flight",
        "m",
        _m,
        drawn=True,
    ),
    Quantity(
        "images_with_pose",
        "images with a pose",
        "overview",
        "images_with_pose",
        "flight",
        "%",
        _share,
        "images",
        1.0,
        True,
    ),
    Quantity(
        "area_m2",
        "ground in the images",
        "overview",
        "area_seen",
        "flight",
        "m²",
        lambda v, *_: area(v),
        "images",
    ),
    Quantity("detections", "detections", "overview", "detections", "flight", "", _unit("")),
    Quantity("gnss_hz", "satellite positions", "overview", "rate", "gnss", "Hz", _unit("Hz"), "positions"),
    Quantity(
        "gnss_paused_s",
        "pauses of the satellite receiver",
        "overview",
        "paused",
        "gnss",
        "s",
        _unit("s"),
        "pauses",
    ),
    Quantity("imu_hz", "inertial samples", "overview", "rate", "imu", "Hz", _unit("Hz"), "samples"),
    Quantity(
        "imu_paused_s",
        "pauses of the inertial sensor",
        "overview",
        "paused",
        "imu",
        "s",
        _unit("s"),
        "pauses",
    ),
    Quantity(
        "shaking_max",
        "strongest shaking",
        "overview",
        "shaking_max",
        "flight",
        "m/s²",
        _unit("m/s²"),
        "samples",
        None,
        True,
    ),
    Quantity(
        "error_mean_m",
        "mean error of a position",
        "georeferencing",
        "horizontal_error_mean",
        "logged-pose",
        "m",
        _m,
        "points",
        None,
        True,
    ),
    Quantity(
        "error_p90_m",
        "error of nine in ten",
        "georeferencing",
        "horizontal_error_p90",
        "logged-pose",
        "m",
        _m,
        "points",
        None,
        True,
    ),
    Quantity("gain_m", "gain by its cause", "georeferencing", "gain", "winner", "m", _m, "points", 0.0, True),
    Quantity(
        "ellipses_hold",
        "truth in the 90 % ellipses",
        "georeferencing",
        "ellipse_coverage_90",
        "logged-pose",
        "%",
        _share,
        "points",
        0.9,
        True,
    ),
    Quantity("roll_deg", "roll against the reference", "navigation", "rms_roll", "mekf", "°", _unit("°")),
    Quantity("pitch_deg", "pitch against the reference", "navigation", "rms_pitch", "mekf", "°", _unit("°")),
    Quantity(
        "yaw_deg", "yaw against the reference", "navigation", "rms_yaw", "mekf", "°", _unit("°"), drawn=True
    ),
    Quantity(
        "track_rmse_m",
        "track error",
        "tracking",
        "rmse",
        "leading filter",
        "m",
        _unit("m"),
        "comparisons",
        None,
        True,
    ),
    Quantity(
        "track_nees_inside",
        "NEES of the track inside its 95 % band",
        "tracking",
        "fraction_nees_inside",
        "leading filter",
        "%",
        _share,
        "comparisons",
        0.95,
        True,
    ),
)


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
    report = flight.report(quantity.about)
    if report is None:
        return None
    entry = report.numbers.get((quantity.name, quantity.subject))
    if quantity.subject == "mekf":
        # What the page on the navigation speaks of, where the receiver's noise was found.
        entry = report.numbers.get((quantity.name, "mekf-receiver"), entry)
    if quantity.about == "tracking":
        best = next((subject for name, subject in report.numbers if name == LEADING), "ekf")
        alike = [
            one
            for (name, subject), one in report.numbers.items()
            if name == quantity.name and subject.endswith(f"/{best}")
        ]
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
    report = flight.report(quantity.about)
    overview = flight.report("overview")
    if report is None:
        lacking = [] if overview is None else overview.lacking
        said = next((one for one in lacking if one.startswith(quantity.about)), "")
        reason = said.partition("(")[2].removesuffix(")")
        return reason or f"there is no report on the {quantity.about}"
    if report.state != "done":
        return f"the report on the {quantity.about} is {report.state}"
    if quantity.about == "tracking" and any(name == quantity.name for name, _ in report.numbers):
        return "several tracks, none of which stands for all"
    return f"the {quantity.about} has no such number of this flight"


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
            "verdict": flight.verdict or "no overview",
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
    report.head(f"{len(flights)} flights compared", ", ".join(flight.name for flight in flights))
    worst, level = _worst(flights)
    report.summary([_counted(flights)], level=level, verdict=worst)
    report.section("Side by side")
    report.table(
        _aligned(flights),
        columns={"quantity": "", **{f"flight{k}": flight.name for k, flight in enumerate(flights)}},
        caption="Each number with its interval where there is one, and in brackets what it is over.",
    )
    figures = [made for quantity in QUANTITIES if quantity.drawn and (made := _figure(flights, quantity))]
    if figures:
        report.section("All flights on one axis", "Only what was measured on two flights or more is drawn.")
        for k in range(0, len(figures), 2):
            report.figures(figures[k : k + 2])
    reasons = _reasons(flights)
    if reasons:
        report.section("What was not measured, and why", part=LIMITS)
        report.points(reasons)
    report.section("Their reports")
    report.points(f"{flight.name}: {', '.join(one.about for one in flight.reports)}" for flight in flights)
    link = csv_link(flights_table(flights), "flights", "All numbers, a row for each flight, as CSV")
    footer = f"<p>{link or 'All numbers, a row for each flight, are in flights.csv beside this page'}.</p>"
    body = with_glossary(arranged("\n".join(report.parts)))
    whole = page(title="Flights compared", body=body, kicker="wildlab › flights › comparison", footer=footer)
    examine(whole, "comparison")
    return whole


def _worst(flights: Sequence[OwnFlight]) -> tuple[tuple[str, str], str]:
    """The verdict that presses most, whose it is, and its colour."""
    words = [flight.verdict or Verdict.UNJUDGED for flight in flights]
    # A flight that could not be judged may be worse than a sound one.
    word = max(words, key=lambda one: 0.5 if one == Verdict.UNJUDGED else one.level)
    whose = [flight.name for flight, one in zip(flights, words, strict=True) if one == word]
    return (word, f"So is {listed(whose)}, and nothing here presses more."), word.colour


def _counted(flights: Sequence[OwnFlight]) -> str:
    words = [flight.verdict or "no overview" for flight in flights]
    counts = "; ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    return f"{len(flights)} flights: {counts}."


def _aligned(flights: Sequence[OwnFlight]) -> pd.DataFrame:
    rows: list[dict[str, str]] = []

    def row(label: str, cells: Sequence[str]) -> None:
        rows.append({"quantity": label, **{f"flight{k}": cell for k, cell in enumerate(cells)}})

    row("verdict", [f"**{flight.verdict or 'no overview'}**" for flight in flights])
    row("what it is", [TAGS.get(flight.kind, flight.kind) for flight in flights])
    row("evaluated", [flight.finished or NOTHING for flight in flights])
    for quantity in QUANTITIES:
        entries = [entry_of(flight, quantity) for flight in flights]
        if any(entry is not None for entry in entries):
            row(quantity.label, [NOT_MEASURED if one is None else _cell(one, quantity) for one in entries])
    return pd.DataFrame(rows)


def _cell(entry: Mapping[str, Any], quantity: Quantity) -> str:
    value, low, high = (_plain(entry[part]) for part in ("value", "low", "high"))
    over = f" ({entry['n']} {quantity.n})" if quantity.n and entry["n"] is not None else ""
    return f"{quantity.words(value, low, high)}{over}"


def _plain(value: Any) -> float:
    """NaN for none, and zero for what is one but for rounding."""
    if value is None:
        return float("nan")
    return 0.0 if abs(float(value)) < NO_MORE else float(value)


def _figure(flights: Sequence[OwnFlight], quantity: Quantity) -> tuple[Any, str, str, str] | None:
    found = [(flight.name, entry) for flight in flights if (entry := entry_of(flight, quantity)) is not None]
    if len(found) < 2:
        return None
    scale = 100.0 if quantity.unit == "%" else 1.0

    def values(part: str) -> list[float]:
        return [scale * _plain(entry[part]) for _, entry in found]

    value, low, high = values("value"), values("low"), values("high")
    least, most = int(np.argmin(value)), int(np.argmax(value))
    unit = f" ({quantity.unit})" if quantity.unit else ""
    title = f"{quantity.label[:1].upper()}{quantity.label[1:]}"
    of = f"{title}{unit} of {len(found)} of {len(flights)} flights"
    said = (
        f"{of}: {number(value[least])} on each."
        if value[least] == value[most]
        else f"{of}: least on {found[least][0]}, {number(value[least])}, most on {found[most][0]}, "
        f"{number(value[most])}."
    )
    goal = None if quantity.goal is None else scale * quantity.goal
    chart = dots_chart([name for name, _ in found], value, low, high, f"{quantity.label}{unit}", title, goal)
    return chart, quantity.key.replace("_", "-"), said, said


def _reasons(flights: Sequence[OwnFlight]) -> list[str]:
    """What flights lack, those that lack the same for the same reason together."""
    found: dict[tuple[str, str], list[str]] = {}
    for flight in flights:
        for quantity in QUANTITIES:
            if entry_of(flight, quantity) is None:
                found.setdefault((flight.name, why_not(flight, quantity)), []).append(quantity.label)
    return [
        f"**{name}**: {', '.join(dict.fromkeys(labels))}: {why}." for (name, why), labels in found.items()
    ]
