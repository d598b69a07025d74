"""What the report on the operator's view says, as the computed numbers have it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import mean_interval
from wildlab.replay.scene import ReplayScene
from wildlab.reporting.text import percent
from wildlab.studies.replay.trial import CLOCK, NONE, ONE, SEVERAL, SINGLE, Moments

#: The screenshots: kind of moment, figure of F, and what its caption says.
SCREENSHOTS = (
    (ONE, "fig-7-20", "one of several targets in view, and detected"),
    (SINGLE, "fig-b-1", "one animal detected"),
    (NONE, "fig-b-2", "no animal in view, several tracks running"),
)
METHOD = rf"""The flight is simulated; poses and detections come from its tables as from a log; each image is
a frame of that log: this is the program's "simulation from data" (F 6.3.3). What is in view is told by the
true poses and places: a target whose place the image shows, whether or not the ground hides it.

Each animal that is detected is followed from its first detection to the end by a Kalman filter of a
random walk, F (4.5), whose place gains 1 m² in a second; F used particles. Detections carry the animals'
names, so none is given to the wrong track. "Several" and "a number of" are read as {SEVERAL} at least.

For the clock the stamps of the images are moved by up to a second, drawn for each flight; by hand that
is taken off to the nearest tenth of a second. Errors are distances of detections on the ground from the
truth, the median of a flight."""


def moment_for(moments: Moments, kind: str) -> int | None:
    """The row of the moment that is drawn: the middle one of its kind; None where there is none."""
    rows = np.flatnonzero(moments.of(kind))
    return int(rows[len(rows) // 2]) if len(rows) else None


def title(moments: Moments, row: int) -> str:
    """The message of a view, of its own numbers."""
    seen, found, running = (int(one[row]) for one in (moments.in_view, moments.detected, moments.running))
    return f"{_count(seen)} in view, {found} detected, {running} {'track' if running == 1 else 'tracks'}"


def _count(n: int) -> str:
    return "no animal" if n == 0 else "1 animal" if n == 1 else f"{n} animals"


def alt(scene: ReplayScene, moments: Moments, row: int) -> str:
    """What a view shows, for who cannot see it."""
    return (
        f"Map about the aircraft {moments.times[row]:.0f} s into the flight, with what its camera sees, "
        f"{int(moments.running[row])} tracks with 90 % ellipses and the true places of "
        f"{len(scene.truth)} animals; beside it the image with {int(moments.detected[row])} detections."
    )


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences: which moments there are, how long nothing is in view, and the clock."""
    kinds = [(name, caption) for name, _, caption in SCREENSHOTS]
    missing = [caption for name, caption in kinds if not (spread[name, "share_of_frames"] > 0).all()]
    n = len(spread)
    if any(spread[name, "share_of_frames"].isna().any() for name, _ in kinds):
        first = ""
    elif missing:
        first = f"Not each of the {n} flights has a moment like every screenshot: {'; '.join(missing)}."
    else:
        first = f"Each of the {n} flights has moments like all {len(kinds)} screenshots."
    empty, busy = (spread[kind, "share_of_frames"].mean() for kind in (NONE, SINGLE))
    second = (
        f"For {percent(float(empty))} of the frames no animal is in view while several tracks run; one "
        f"animal is detected in {percent(float(busy))}."
    )
    return [first, second, clock_words(spread)]


def clock_words(spread: pd.DataFrame) -> str:
    """What setting the clock by hand gains, in metres, with the interval of the mean over flights."""
    unset, after = (spread[CLOCK, name].to_numpy(float) for name in ("error_unset", "error_set"))
    gain = mean_interval(unset - after)
    words = ("takes", "off") if gain.estimate >= 0 else ("adds", "to")
    text = (
        f"Setting the images' clock by hand {words[0]} {abs(gain.estimate):.2f} m {words[1]} "
        f"the {unset.mean():.2f} m that detections are typically wrong"
    )
    if np.isfinite(gain.low) and np.isfinite(gain.high):
        text += f" ({gain.low:.2f} to {gain.high:.2f} m over {len(spread)} flights)"
    return f"{text}."
