"""What was found on a card, as rows of a table and as sentences; no place is told."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.flight.card.roles import OTHER, PARTS_SHOWN, ROLES, Choice
from wildlab.flight.files import printable
from wildlab.flight.readers.log import Clock, Stream

#: Headings of `rows_of`.
HEADINGS = ("file", "format", "begins (UTC)", "lasts", "holds", "time from", "heights from", "role")
#: A rate is of so many steps together, and a pause is a step of so many usual ones.
STRETCH, PAUSE = 10, 5.0
_REFERENCES = {"height_ellipsoid_m": "ellipsoid", "height_sea_m": "sea level", "height_home_m": "take-off"}


def rows_of(choices: Sequence[Choice]) -> list[list[str]]:
    """A row for each thing that was found, under `HEADINGS`."""
    return [_row(one) for one in choices if one.item.problem != OTHER]


def _row(choice: Choice) -> list[str]:
    found, role = choice.item, choice.role + (f" {choice.target}" if choice.target else "")
    if found.log is None:
        return [found.shown, found.called, "", "", printable(found.problem), "", "", role]
    parts = found.log.parts
    times = np.concatenate([np.empty(0), *(_times(one) for one in parts.values())])
    begins = lasts = ""
    if len(times):
        begins = datetime.fromtimestamp(float(times.min()), UTC).strftime("%Y-%m-%d %H:%M:%S")
        lasts = f"{np.ptp(times):.0f} s"
    references = [
        text for name, text in _REFERENCES.items() if any(name in one.columns for one in parts.values())
    ]
    return [
        found.shown,
        found.called,
        begins,
        lasts,
        ", ".join(_amount(name, stream) for name, stream in parts.items()) or "nothing that can be used",
        found.log.clock.base if found.log.clock is not None else "",
        ", ".join(references),
        role,
    ]


def _amount(name: str, stream: Stream) -> str:
    if name in PARTS_SHOWN:
        return f"{len(stream)} {PARTS_SHOWN[name]}"
    return f"{name} {len(stream)}{paced(_times(stream))}"


def paced(stamps: ArrayLike) -> str:
    """The rate of a stream while it runs, and its pauses, as they stand behind its name.

    A rate is of stretches of samples and not of single steps: what comes in bursts has the rate of the whole,
    and a step of several usual ones is a pause and no part of the rate.

    Parameters
    ----------
    stamps
        (N,) s, in any order.

    Returns
    -------
    str
        Empty where there is no rate.

    Examples
    --------
    >>> paced(np.concatenate([np.arange(0, 60, 0.1), np.arange(90, 150, 0.1)]))
    ' at 10 Hz (1 pause, 30.1 s)'
    >>> paced(np.repeat(np.arange(0, 60, 0.5), 5) + np.tile(np.arange(5) * 1e-3, 120))  # five at once
    ' at 10 Hz'
    """
    t = np.sort(np.asarray(stamps, float))
    width = min(STRETCH, len(t) - 1)
    if width < 1:
        return ""
    stretches = (t[width:] - t[:-width]) / width
    usual = float(np.median(stretches))
    if not usual > 0:
        return ""
    steps = np.diff(t)
    pauses = steps[steps > PAUSE * usual]
    # Of stretches without a pause, where there are such.
    before = np.concatenate([[0], np.cumsum(steps > PAUSE * usual)])
    running = stretches[before[width:] == before[:-width]]
    rate = 1 / float(np.median(running)) if len(running) and np.median(running) > 0 else 1 / usual
    count = f"{len(pauses)} pause{'' if len(pauses) == 1 else 's'}"
    return f" at {rate:.3g} Hz" + (f" ({count}, {pauses.sum():.3g} s)" if len(pauses) else "")


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
            fixes = one.item.part("gnss")
            own = [log.vehicle and f"is of {log.vehicle}", "" if fixes is None else _quality(fixes), *own]
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
#: As MAVLink numbers them, and all readers with it.
_FIXES = {2: "level", 3: "in space", 4: "differential", 5: "RTK float", 6: "RTK fixed", 7: "static", 8: "PPP"}


def _quality(fixes: Stream) -> str:
    """How good the satellite positions are that can be used, by what the receiver says."""
    notes = []
    known = {
        name: values[fixes.used] for name, values in fixes.columns.items() if name in ("fix", "satellites")
    }
    known = {name: values[np.isfinite(values)] for name, values in known.items()}
    if len(known.get("fix", ())):
        counted = Counter(_FIXES.get(int(one), f"of kind {int(one)}") for one in known["fix"])
        notes.append("fixes " + ", ".join(f"{kind} {n}" for kind, n in counted.most_common()))
    if len(known.get("satellites", ())):
        low, middle, high = np.percentile(known["satellites"], (0, 50, 100))
        notes.append(f"satellites {low:.0f} to {high:.0f}, median {middle:.0f}")
    return ", ".join(notes)


def _unused(part: str, stream: Stream) -> str:
    reasons = Counter(str(why) for why in stream.columns["why"] if why)
    told = ", ".join(f"{count} {why}" for why, count in reasons.most_common())
    return f"{int((~stream.used).sum())} of {len(stream)} rows of {part} are not used ({told})"
