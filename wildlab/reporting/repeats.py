"""What the report on a flight without truth says: spread and consistency, and what cannot be said."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wildlab.analysis.overviews.verdict import MANY_LOST, Evidence, Verdict, verdict_of
from wildlab.analysis.repeats import Repeats
from wildlab.reporting.georeferencing import short_length
from wildlab.reporting.georeferencing_cause import amiss_sentence, cause_sentence, lost_sentence

#: Ellipses whose size is off by less than this factor fit the spread.
CLOSE = 1.25


def summary_sentences(found: Repeats, amiss: Sequence[str] = ()) -> list[str]:
    """How far apart sightings lie, whether the ellipses fit that, and what was lost.

    Parameters
    ----------
    found
        From `judge_repeats`.
    amiss
        What does not fit together in the flight: `wildlab.flight.checks.sense.sense.sense_sentences`.

    Returns
    -------
    list of str
        What does not fit together first.
    """
    first = amiss_sentence(amiss)
    said = _found_sentences(found)
    return [first, *said] if first else said


def _found_sentences(found: Repeats) -> list[str]:
    lost = lost_sentence(found.lost, len(found.points))
    if found.spread is None:
        return [
            "Nothing has a position from two images or more, so nothing can be said of how good the "
            "positions are.",
            *([lost] if lost else []),
        ]
    s = found.spread
    said = [
        f"Sightings of the same thing from different images scatter by {short_length(s.sd)} along either "
        f"axis ({s.sightings} sightings of {s.things} things).",
        "How far off they are together cannot be said without known points.",
    ]
    if np.isfinite(s.consistent):
        said.append(consistency_sentence(s.consistent))
    if found.diagnosis is not None:
        said.append(cause_sentence(found.diagnosis))
    return [lost, *said] if found.lost > MANY_LOST * len(found.points) else [*said, *([lost] if lost else [])]


def consistency_sentence(ratio: float) -> str:
    """Whether the ellipses fit the spread; ``ratio`` is the spread over what they say."""
    if ratio > CLOSE:
        return (
            f"The ellipses are too small: the scatter is {ratio:.1f} times what they say, and what all "
            "images share comes on top."
        )
    if ratio < 1 / CLOSE:
        return (
            f"The scatter is {ratio:.1f} times what the ellipses say: they are too large, or what they hold "
            "is mostly shared by all images."
        )
    return "The scatter fits the ellipses, as far as images differ."


def verdict(found: Repeats, amiss: Sequence[str] = ()) -> tuple[Verdict, str]:
    """What it comes to, and why: never sound, for the errors themselves are not known."""
    contradictions, total = sum(one.startswith("problem") for one in amiss), len(found.points)
    word = verdict_of(Evidence(problems=contradictions, lost=found.lost / total if total else np.nan))
    if contradictions:
        count = "1 finding" if contradictions == 1 else f"{contradictions} findings"
        return word, f"The logs contradict each other: {count}."
    if word == Verdict.MEND:
        return word, f"{found.lost} of {total} points have no position."
    return word, "Without points whose place is known, errors stay unknown."


def limits(found: Repeats) -> list[str]:
    """What such a report does not tell."""
    said = [
        "How far off the positions are: an error that all images share (height, clock, boresight seen from "
        "one side) moves all sightings together and does not show.",
        "How far a thing moved between its sightings: that counts as scatter, and makes the ellipses look "
        "too small.",
    ]
    if (found.things["images"] < 2).any():
        alone = int((found.things["images"] < 2).sum())
        said.append(
            f"Anything about {alone} of {len(found.things)} things that have a position from one image only, "
            "or from none."
        )
    return said
