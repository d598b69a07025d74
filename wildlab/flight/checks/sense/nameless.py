"""Pixels that name no target: how many of them are where a known target is.

What a detector saw may be a known target, another one, or nothing. So it is not asked by how far rays pass
the nearest known target, which where most of what is seen is something else says nothing, but what share of
them meets one; and only mistakes are tried that change what is seen as a whole. Lengths, places and heights
are left out: with these, what is beside a known target is easily brought to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.attitudes import attitude_mistakes
from wildlab.flight.checks.sense.constants import best_of, shifted
from wildlab.flight.checks.sense.lens import mount_mistakes, pixel_mistakes
from wildlab.flight.checks.sense.sightings import Sightings, finite, missed, with_attitude
from wildlab.flight.checks.sense.trial import MOST_NAMED, Mistake, halves_of
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: A ray meets a target that it passes by no more than so many times what is expected, and no more than this.
MEETS, MEETS_DEG = 3.0, 6.0
#: Undone, a mistake has to bring so many times as many rays to a target, on the whole and on either half, and
#: this share at least, which where all is right needs no explanation; where a number was chosen to make it
#: fit, twice as many times.
MORE, LEAST = 2.0, 0.3
#: Mistakes are named together whose shares are so near each other.
ALIKE = 0.9
#: Clocks that are looked for, s.
CLOCKS = np.arange(-30.0, 30.5, 0.5)


class _Named(NamedTuple):
    mistake: Mistake[Sightings]
    share: float


def shares(s: Sightings) -> Array:
    """(3,) of all rays, and of those of either half of the images, the share that meets a known target."""
    m = missed(s)
    with np.errstate(invalid="ignore"):
        angle = np.linalg.norm(m.turn, axis=1)
        meets = finite(m) & (angle < np.minimum(MEETS * m.expected, np.radians(MEETS_DEG)))
    return np.array([float(meets[rows].mean()) for rows in (slice(None), *halves_of(s.image))])


def nameless(flight: Flight, given: Sightings) -> Iterator[Finding]:
    """What is wrong with a detector's flight, where a usual mistake says why few of its rays meet a target.

    Parameters
    ----------
    flight
        Whose clocks they are.
    given
        Pixels without names, with all known targets.
    """
    before, named = shares(given), []
    if before[0] >= LEAST:
        return
    for mistake in _mistakes(flight, given):
        undone = mistake.undo(given)
        if undone is None:
            continue
        after = shares(undone)
        more = MORE**2 if mistake.fitted else MORE
        if after[0] >= LEAST and (after >= more * before).all():
            named.append(_Named(mistake, float(after[0])))
    if not named:
        return
    best = max(one.share for one in named)
    alike = [one for one in named if one.share >= ALIKE * best]
    alike.sort(key=lambda one: (one.mistake.fitted, -one.share))
    named = alike[:MOST_NAMED]
    yield Finding(
        "warning",
        f"nav/{given.source}",
        "",
        f"{100 * before[0]:.0f} % of the detections, none of which has a name, are where a known target is; "
        + " or ".join(f"{100 * one.share:.0f} % were if {one.mistake.said}" for one in named),
        f"{words.fixes([one.mistake.write for one in named])}; or, where most detections are of others than "
        "the known targets, state `others = true` in [targets.many]",
        tuple(one.mistake.cause for one in named),
    )


def _mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    yield from mount_mistakes(s)
    for one in attitude_mistakes(f"poses.{s.source}"):
        yield one.within("", with_attitude(one.undo))
    yield from pixel_mistakes(s)
    by = best_of(lambda t: -float(shares(shifted(s, t)).min()), CLOCKS)
    if flight.manifest.time.kind == "utc" and abs(by) >= 1.0:
        offset = flight.manifest.clocks.camera_offset_s + by
        yield Mistake(
            "clock of the camera",
            f"the images were taken {abs(by):.1f} s {'later' if by > 0 else 'earlier'} than their stamps say",
            f"`camera_offset_s = {offset:.1f}` in [clocks]",
            lambda x: shifted(x, by),
            fitted=True,
        )
