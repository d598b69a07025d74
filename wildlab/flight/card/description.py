"""What was found on a card, as rows of a table and as sentences; no place is told."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.card.roles import OTHER, ROLES, Choice
from wildlab.flight.files import printable
from wildlab.flight.readers.log import Clock, Stream

#: Headings of `rows_of`.
HEADINGS = ("file", "format", "begins (UTC)", "lasts", "role")


def rows_of(choices: Sequence[Choice]) -> list[list[str]]:
    """A row for each thing that was found, under `HEADINGS`."""
    return [_row(one) for one in choices if one.item.problem != OTHER]


def _row(choice: Choice) -> list[str]:
    found, role = choice.item, choice.role + (f" {choice.target}" if choice.target else "")
    times = np.concatenate([np.empty(0), *map(_times, [] if found.log is None else found.log.parts.values())])
    begins = lasts = ""
    if len(times):
        begins = datetime.fromtimestamp(float(times.min()), UTC).strftime("%Y-%m-%d %H:%M:%S")
        lasts = f"{np.ptp(times):.0f} s"
    return [found.shown, found.called, begins, lasts, role]


def _times(stream: Stream) -> NDArray[np.float64]:
    values = stream.columns.get("time_s")
    if values is None:
        return np.empty(0)
    used = np.asarray(values[stream.used], float)
    return np.asarray(used[np.isfinite(used)])


def sentences_of(choices: Sequence[Choice]) -> list[str]:
    """What of each thing is not used and why, what was lost, and what its reader noted."""
    notes = []
    others = [one.item.shown for one in choices if one.item.problem == OTHER]
    if others:
        more = f" and {len(others) - 3} more" if len(others) > 3 else ""
        notes.append(f"No logs by their endings, and not looked at: {', '.join(others[:3])}{more}")
    for one in choices:
        log, name = one.item.log, one.item.shown
        own = [f"is not used: {printable(one.why)}"] if one.role == "nothing" or log is None else []
        if one.item.problem == OTHER:
            continue
        if log is not None:
            if not own:
                own = [f"is taken for {ROLES[one.role]}{one.target and f', {one.target}'}: {one.why}"]
            own = [log.vehicle and f"is of {log.vehicle}", *own]
            # An image without a place is one all the same, and its reader says what it lacks.
            own += [
                _unused(part, rows)
                for part, rows in log.parts.items()
                if part != "photos" and not rows.used.all()
            ]
            own += [*log.lost, *log.notes]
            # Stamps that are UTC already were brought nowhere.
            if (
                log.clock is not None
                and log.clock.pairs > 2
                and (log.clock.rate != 1.0 or log.clock.spread_s > 0)
            ):
                own.append(_rate(log.clock))
        notes += [f"{name}: {printable(text)}" for text in own if text]
    return notes


def _rate(clock: Clock) -> str:
    """How a log's clock runs, as far as its pairs of stamps can tell."""
    ppm, sd = 1e6 * (1 / clock.rate - 1), 1e6 * clock.rate_sd
    runs = f"runs {abs(ppm):.0f} ppm {'fast' if ppm > 0 else 'slow'}"
    if clock.rate == 1.0 or (not math.isnan(sd) and abs(ppm) < TOLD * sd):
        runs = "cannot be told to run fast or slow" + (f" (to {TOLD * sd:.0f} ppm)" if 0.5 < sd < 1e6 else "")
    spread = f"{1000 * clock.spread_s:.0f} ms ({1000 * clock.largest_s:.0f} at most)"
    return f"its clock, by {clock.pairs} pairs of {clock.base}, {runs}; residuals {spread}"


#: A rate differs from 1 where it is so many of its standard deviations away from it.
TOLD = 2.0


def _unused(part: str, stream: Stream) -> str:
    reasons = Counter(str(why) for why in stream.columns["why"] if why)
    told = ", ".join(f"{count} {why}" for why, count in reasons.most_common())
    return f"{int((~stream.used).sum())} of {len(stream)} rows of {part} are not used ({told})"
