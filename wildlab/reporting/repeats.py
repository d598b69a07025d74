"""The page on a flight without truth: how far apart sightings of the same thing lie, and what that tells."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wildlab.analysis.accuracy import Repeats
from wildlab.analysis.verdict import (
    FEW_POINTS,
    MANY_LOST,
    VERDICT_LEVEL,
    Evidence,
    Verdict,
    verdict_of,
)
from wildlab.flight.store import Flight
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import significant
from wildlab.reporting.georeferencing import (
    cause_message,
    short_length,
    show_contradictions,
    show_models,
)
from wildlab.reporting.georeferencing_tables import parameters_table
from wildlab.reporting.report import Report, Wording

#: Ellipses whose size is off by less than this factor fit the spread.
CLOSE = 1.25
#: Rows of the table of things.
SHOWN = 20


def answer(found: Repeats) -> Message:
    """How far apart sightings lie, and whether the ellipses fit that."""
    spread, total = found.spread, len(found.points)
    values = {"lost": str(found.lost), "total": str(total)}
    if found.lost > MANY_LOST * total:
        return Message("many-lost", values)
    if spread is None:
        return Message("none-twice", values)
    values |= {
        "scatter": short_length(spread.sd),
        "sightings": str(spread.sightings),
        "things": str(spread.things),
        "ratio": significant(spread.consistent),
    }
    if math.isnan(spread.consistent) or spread.sightings < FEW_POINTS:
        return Message("scatter", values)
    if spread.consistent > CLOSE:
        return Message("ellipses-small", values)
    return Message("ellipses-large" if spread.consistent < 1 / CLOSE else "ellipses-fit", values)


def verdict(found: Repeats, problems: int = 0) -> tuple[Verdict, Message]:
    """What it comes to, and why: never sound, for the errors themselves are not known."""
    total = len(found.points)
    word = verdict_of(Evidence(problems=problems, lost=found.lost / total if total else math.nan))
    if problems:
        return word, Message("reason-contradictions", {"problems": str(problems)})
    if word == Verdict.MEND:
        return word, Message("reason-lost", {"lost": str(found.lost), "total": str(total)})
    return word, Message("reason-unknown")


def show_repeats(report: Report, flight: Flight, found: Repeats, amiss: Sequence[str]) -> None:
    """Write the page, but for its terrain, and record its numbers.

    Parameters
    ----------
    report
        Is added to.
    flight, found
        The flight, and its sightings.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.check.sense_sentences`.
    """
    texts = load_texts("repeat-sightings")
    wording = Wording(report, texts)
    spread, diagnosis, total = found.spread, found.diagnosis, len(found.points)
    images = found.points["frame_id"].nunique()
    report.head(texts.subjects["question"], f"{images} images, {total} points, no truth")
    word, reason = verdict(found, sum(one.startswith("problem") for one in amiss))
    said = wording.messages([answer(found)])
    cause = Wording(report, load_texts("georeferencing"))
    if diagnosis is not None and spread is not None:
        said += cause.messages([cause_message(diagnosis)])
    report.summary(said, level=word.colour, verdict=(word.value, wording.messages([reason])[0]))
    report.metric(VERDICT_LEVEL, "georeferencing", word.level, "1")
    show_contradictions(report, amiss, shown=flight.manifest.locations.sensitivity == "open")
    if spread is not None:
        report.metric("sighting_spread", "logged-pose", spread.sd, "m", n=spread.sightings)
        report.metric("sighting_consistency", "logged-pose", spread.consistent, "1", n=spread.sightings)
        report.tiles(
            [
                (short_length(spread.sd), texts.subjects["tile-scatter"]),
                (f"{spread.things} of {len(found.things)}", texts.subjects["tile-things"]),
                (f"{found.lost} of {total}", texts.subjects["tile-lost"]),
            ]
        )
        wording.table("things", found.things.head(SHOWN))
    if diagnosis is not None:
        gain = diagnosis.winner.gain.gain
        n = len(diagnosis.scored)
        report.metric("sighting_gain", "winner", gain.estimate, "m", n=n, low=gain.low, high=gain.high)
        report.metric("cause_certain", "winner", float(diagnosis.counts), "1", n=n)
        if diagnosis.winner.causes:
            cause.table("parameters", parameters_table(report, diagnosis.calibration))
    report.limits([wording.say(one) for one in texts.limits])
    report.section("Details")
    show_models(report, cause, diagnosis)
    report.method(texts.method)
