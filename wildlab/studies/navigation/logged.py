"""The page on the navigation of a logged flight, compared with the attitude found on board."""

from __future__ import annotations

from collections.abc import Sequence

from wildlab.analysis.navigation_errors import Studied, calibrated, summarise
from wildlab.analysis.navigation_inputs import heading_from
from wildlab.analysis.overviews.verdict import VERDICT_LEVEL
from wildlab.analysis.receiver import place_receiver
from wildlab.flight.store import Flight
from wildlab.messages.message import Message
from wildlab.messages.page_texts import load_texts, significant
from wildlab.reporting.report import Report
from wildlab.reporting.wording import Wording
from wildlab.studies.navigation import OVERCONFIDENT, attitude_of, verdict_of_attitude
from wildlab.studies.navigation.charts import differences_table, innovations_table, logged_figures
from wildlab.studies.navigation.receiver import (
    attitude_change,
    latency_message,
    models_table,
    parameters_table,
    parts_table,
    placement_message,
    thirds,
)
from wildlab.studies.page import tile_of

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
        return [Message("noise-unknown", {"refusal": studied.refusal}), latency_message(studied.flight)]
    values = {"fixes": str(receiver.fixes), "models": str(len(receiver.candidates))}
    if receiver.noise is None:
        return [Message("noise-confirmed", values), latency_message(studied.flight)]
    both = studied.scored["mekf"], studied.scored["mekf-receiver"]
    gnss = studied.flight.manifest.gnss
    placed = place_receiver(studied.flight, receiver.chosen.noise)
    return [
        Message("noise-estimated", values),
        Message(f"attitude-{attitude_change(*both, receiver.begin, receiver.end)}"),
        placement_message(placed, [gnss.latency_s, *gnss.lever_arm_m]),
    ]


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
    if receiver is not None:
        named = parts if len(parts) > 1 else thirds(receiver.begin, receiver.end)
        wording.table("parts", parts_table(studied, named))
        wording.table("models", models_table(receiver))
        if receiver.noise is not None:
            wording.table("parameters", parameters_table(receiver))
    report.method(texts.method)
