"""The page on the navigation of a logged flight, compared with the attitude found on board."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.analysis.navigate import (
    NavigationErrors,
    Studied,
    calibrated,
    summarise,
)
from wildlab.analysis.navigation_inputs import Placement, Receiver, heading_from, place_receiver
from wildlab.analysis.verdict import VERDICT_LEVEL
from wildlab.evaluation.intervals import block_mean, time_blocks
from wildlab.flight.store import Flight
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import significant
from wildlab.navigation.receiver import SIZE
from wildlab.reporting.report import Report, Wording
from wildlab.studies.navigation import (
    OVERCONFIDENT,
    attitude_of,
    differences_table,
    innovations_table,
    logged_figures,
    verdict_of_attitude,
)
from wildlab.studies.page import tile_of

#: So many standard deviations from what is configured are an error: four numbers are looked at.
FAR = 3.0
_PARTS = (
    ("white noise, level", 0),
    ("white noise, height", 1),
    ("slow error, level", 0),
    ("slow error, height", 1),
    ("how long that keeps", None),
    ("over what its change is smooth", None),
)


def parameters_table(receiver: Receiver) -> pd.DataFrame:
    """Every number of the noise that was chosen, and what is configured.

    Returns
    -------
    DataFrame
        ``source``, ``what``, ``unit``, ``stated``, ``found``, ``low`` and ``high`` (two standard deviations
        by the information in the innovations; NaN at the limit of what was tried).
    """
    rows = []
    scale, chosen = receiver.scale, receiver.chosen
    for index, (name, noise, stated, unit) in enumerate(
        (("position", chosen.noise.position, scale.position, "m"),
         ("velocity", chosen.noise.velocity, scale.velocity, "m/s"))
    ):  # fmt: skip
        if stated is None:
            continue
        for place, (what, axis) in enumerate(_PARTS):
            if place > 1 and (noise.order == 0 or (place == 5 and noise.order == 1)):
                continue
            value = noise[place] * (stated[axis] if place < 2 and axis is not None else 1.0)
            spread = float(np.exp(2 * chosen.sd[SIZE * index + place]))
            rows.append(
                {
                    "source": name,
                    "what": what,
                    "unit": "s" if axis is None else unit,
                    "stated": stated[axis] if place < 2 and axis is not None else np.nan,
                    "found": value,
                    "low": value / spread,
                    "high": value * spread,
                }
            )
    return pd.DataFrame(rows)


def attitude_change(before: NavigationErrors, after: NavigationErrors, begin: float, end: float) -> str:
    """How the attitude's difference from the reference changed between two times, s: ``nearer``, ``farther``,
    ``same``, or ``unknown`` where the time is too short."""
    inside = (before.times >= begin) & (before.times < end)
    squares = [np.degrees(one.error[inside, 6:]) ** 2 @ np.ones(3) for one in (before, after)]
    known = np.isfinite(squares[0]) & np.isfinite(squares[1])
    change = (squares[1] - squares[0])[known]
    span = block_mean(change, time_blocks(before.times[inside][known], seconds=True))
    if not np.isfinite(span.low):
        return "unknown"
    return "farther" if span.low > 0 else "nearer" if span.high < 0 else "same"


def placement_message(found: Placement, configured: ArrayLike) -> Message:
    """How late the receiver is and where its antenna sits, and what of that is not as configured.

    Parameters
    ----------
    found
        As `wildlab.analysis.navigation_inputs.place_receiver` gives it.
    configured
        (4,) latency, s, and lever arm, m.
    """
    given = np.asarray(configured, float)
    likely = np.array([found.latency, *found.lever])
    known = np.isfinite(found.sd)
    if not known.any():
        return Message("placement-unknown")
    wrong = known & (np.abs(likely - given) > FAR * found.sd)
    values = {"latency": f"{likely[0]:.3f}", "configured": f"{given[0]:.3f}"}
    if not wrong.any():
        return Message("placement-confirmed", values)
    write = [f"latency_s = {likely[0]:.3f}"] if wrong[0] else []
    if wrong[1:].any():
        write.append(f"lever_arm_m = [{', '.join(f'{value:.2f}' for value in likely[1:])}]")
    return Message("placement-wrong", {**values, "settings": " and ".join(write)})


Part = tuple[str, float, float]


def attitude_messages(studied: Studied, part: Part) -> list[Message]:
    """How far the filter's attitude is from the one found on board, with the configured noise and with that
    estimated on the flight."""
    name, *between = part
    off, predicted = attitude_of(summarise(studied.scored["mekf"], *between))
    values = {"part": name, "off": significant(off), "predicted": significant(predicted)}
    values["ratio"] = significant(off / predicted)
    said = [Message("overconfident" if off > OVERCONFIDENT * predicted else "plausible", values)]
    if "mekf-receiver" in studied.scored:
        off, predicted = attitude_of(summarise(studied.scored["mekf-receiver"], *between))
        said.append(Message("receiver", {"off": significant(off), "predicted": significant(predicted)}))
    return said


def receiver_messages(studied: Studied) -> list[Message]:
    """What was found of the receiver's noise, and of when and where its fixes are taken."""
    receiver = studied.receiver
    if receiver is None:
        return [Message("noise-unknown", {"refusal": studied.refusal})]
    values = {"fixes": str(receiver.fixes), "models": str(len(receiver.candidates))}
    gnss = studied.flight.manifest.gnss
    placed = place_receiver(studied.flight, receiver.chosen.noise)
    placement = placement_message(placed, [gnss.latency_s, *gnss.lever_arm_m])
    if receiver.noise is None:
        return [Message("noise-confirmed", values), placement]
    both = studied.scored["mekf"], studied.scored["mekf-receiver"]
    change = attitude_change(*both, receiver.begin, receiver.end)
    return [Message("noise-estimated", values), Message(f"attitude-{change}"), placement]


def observer_limits(flight: Flight) -> list[Message]:
    """What the observer's figures depend on, for a flight with one antenna."""
    source = heading_from(flight)
    if source == "antennas":
        return []
    found = [Message("observer-course" if source == "course" else "observer-field")]
    return found if calibrated(flight) else [*found, Message("observer-biases")]


def show_logged(report: Report, studied: Studied, parts: Sequence[Part]) -> None:
    """Fill the report of a logged flight, whose numbers are recorded already; ``parts`` of it, s."""
    first, last = parts[0], max(until for _, _, until in parts)
    window = (first[1], last)
    texts = load_texts("navigation-logged")
    wording = Wording(report, texts)
    names = texts.subjects
    mine = summarise(studied.scored["mekf"], *first[1:])
    verdict = verdict_of_attitude(mine)
    report.head(names["question"], wording.say(texts.subtitle))
    said = attitude_messages(studied, first)
    reason = Message("reason", said[0].values)
    report.summary(
        wording.messages(said),
        level=verdict.colour,
        verdict=(verdict.value, wording.messages([reason])[0]),
    )
    report.metric(VERDICT_LEVEL, "navigation", verdict.level, "1")
    report.tiles([tile_of(report, one, wording) for one in texts.tiles])
    main, *others = logged_figures(studied, window)
    wording.figure(main.text, main.fig, main.name, main=True)
    wording.table("differences", differences_table(studied, parts, names))
    report.section("The receiver's noise")
    report.points(wording.messages(receiver_messages(studied)))
    if studied.found["mekf"].signs:
        report.section("What should make you doubt the filter")
        report.points(studied.found["mekf"].signs)
    report.section("Figures")
    for i in range(0, len(others), 2):
        report.figures([wording.captioned(one.text, one.fig, one.name) for one in others[i : i + 2]])
    limits = [wording.say(one) for one in texts.limits]
    report.limits([*limits, *wording.messages(observer_limits(studied.flight))])
    report.section("Details")
    wording.table("innovations", innovations_table(studied, window))
    receiver = studied.receiver
    if receiver is not None and receiver.noise is not None:
        wording.table("parameters", parameters_table(receiver))
    report.method(texts.method)
