"""A constant turn of all that a sensor sees, as of a compass or a mounting that is off by some degrees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.looks import USUAL, Scans, SourceLooks, hits, misfit, seen_at, shares
from wildlab.flight.checks.sense.trial import far_better
from wildlab.geometry.frames import Array, wrap

#: Turns that are looked for, deg: what declination, compasses and mountings are off by. At either end it is
#: no constant of some degrees, but the flank of something else.
TURNS = np.arange(-20.0, 20.5, 0.5)
#: So many standard deviations of what looks differ by, another explanation has to be better by.
CLEARLY = 2.0


def turned(s: SourceLooks, by_deg: float) -> SourceLooks:
    """The same looks with all bearings, or all places about the own one, turned clockwise."""
    by = np.radians(by_deg)
    if s.azimuth is not None:
        return replace(s, azimuth=s.azimuth + by)
    if s.places is None:
        return s
    c, n = np.cos(by), np.sin(by)
    about = (s.places - s.own) @ np.array([[c, n, 0.0], [-n, c, 0.0], [0.0, 0.0, 1.0]])
    return replace(s, places=s.own + about)


def best_turn(given: Scans, rivals: Sequence[Scans]) -> float | None:
    """The turn (deg, clockwise) that brings what is seen to the targets.

    Parameters
    ----------
    given
        The looks of all sources that are turned alike.
    rivals
        The same as other explanations have them.

    Returns
    -------
    float or None
        None where no turn brings far more of it to a target, or where a rival does clearly more.
    """
    before = misfit(given)
    if not before[0, 0] > 1.0:
        return None

    def left(by: float) -> float:
        return float(misfit(tuple(turned(s, by) for s in given))[0, 0])

    costs = [left(by) for by in TURNS]
    # All within the gate of a bearing fit alike: the middle of these.
    k = int(np.argmin(costs))
    by = float(TURNS[k])
    if k in (0, len(TURNS) - 1):
        return None
    for _ in range(3):
        by += float(np.degrees(np.median(np.concatenate([_off(turned(s, by)) for s in given]))))
    done = tuple(turned(s, by) for s in given)
    if not far_better(before, misfit(done), fitted=True):
        return None
    return None if any(_clearly_more(other, done) for other in rivals) else by


def _off(s: SourceLooks) -> Array:
    """By how much (rad, clockwise) each detection that is where a target is would have to be turned."""
    good = hits(s) > 0
    away = (s.targets - s.own)[:, good]
    to = np.arctan2(away[..., 1], away[..., 0])
    off = wrap(to - seen_at(s)[good])
    off = np.where(np.isfinite(off), off, np.inf)
    return np.asarray(np.take_along_axis(off, np.abs(off).argmin(axis=0)[None], axis=0)[0])


def _clearly_more(one: Scans, other: Scans) -> bool:
    """Whether more of what is seen is at a target in `one`, by more than looks differ by chance."""
    more = np.concatenate([shares(a) - shares(b) for a, b in zip(one, other, strict=True)])
    return bool(more.mean() > CLEARLY * more.std() / np.sqrt(len(more)))


def turned_finding(given: Scans, turn_deg: float) -> Finding:
    """The warning that says so."""
    share, then = (100 * USUAL / misfit(x)[0, 0] for x in (given, tuple(turned(s, turn_deg) for s in given)))
    names = words.joined([s.source for s in given], "and")
    side = "left" if turn_deg < 0 else "right"
    size = words.number(abs(turn_deg))
    first = given[0]
    return Finding(
        "warning",
        "detections",
        "azimuth_rad" if first.azimuth is not None else "north_m",
        f"the heading is off by about {-turn_deg:+.1f} deg as the truth has it: {share:.0f} % of the "
        f"detections of {names} in a look are where a target is (mean of all looks), and {then:.0f} % were "
        f"all of them turned to the {side} by {size} deg",
        f"correct the heading, or how {names} is mounted, by {turn_deg:+.1f} deg and import again; or "
        f"state it as an error that lasts: `sd_deg = {size}` in [sensors.{first.source}.considered.heading]",
        ("heading off",),
    )
