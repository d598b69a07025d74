"""Where the nose points, and where the aircraft goes: heading and course.

An aircraft may fly sideways or backwards, and wind lets it crab. Both are no mistake, so that nothing is said
unless a usual mistake, undone, makes heading follow course through turns, and the aircraft lean as it turns:
who circles a place with the nose towards it leans rightly as it is. Even then it is a warning.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from wildlab.flight.checks.corrections import change_attitude
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import POSITION, QUATERNION, airframe_sources
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.attitudes import attitude_mistakes
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, matrix_to_euler, quaternion_to_matrix

#: Slower than this (m/s) a course is noise or wind.
MOVING = 3.0
#: Over so many seconds a course is taken, and from so many of them.
STEP_S, ENOUGH, MOST = 2.0, 30, 2000
#: Mean cosine between heading and course: below the first they do not follow each other, above the second
#: they do (an angle of 26 deg, as in a strong crosswind).
APART, FOLLOWS = 0.5, 0.9
#: Correlation between lean and acceleration that a right heading has at least, in the air.
LEANS = 0.5
#: What explains it within so little of the best explains it as well.
ALIKE = 0.02
#: Length of the mean direction of the courses: above it the aircraft flew straight on, and one constant angle
#: between both could as well be a slip.
STRAIGHT = 0.8


def heading(flight: Flight) -> Iterator[Finding]:
    """Every nav source whose heading does not follow its course, where a usual mistake says why."""
    for source in airframe_sources(flight):
        given = headed(flight.nav[source])
        if given is None:
            continue
        R, course, acceleration = given
        before, leant = follows(R, course), leans(R, acceleration)
        if before >= APART or np.abs(np.exp(1j * course).mean()) > STRAIGHT:
            continue
        found = []
        for one in attitude_mistakes(f"poses.{source}"):
            undone = one.undo(R)
            after = follows(undone, course) if undone is not None else -1.0
            if undone is not None and after >= FOLLOWS:
                lean = leans(undone, acceleration)
                if lean > max(LEANS, leant + LEANS / 2):
                    found.append((after, one))
        if not found:
            continue
        best = max(after for after, _ in found)
        # Only the yaw is asked about: mistakes about it come first, then the one with the fewest words.
        alike = [one for after, one in found if after > best - ALIKE]
        named = min(alike, key=lambda one: ("yaw" not in one.cause, len(one.cause)))
        yield Finding(
            "warning",
            f"nav/{source}",
            "",
            f"the nose does not point where the aircraft goes (mean cosine {before:.2f} over {len(course)} "
            f"stretches), and it does if {named.said} ({best:.2f})",
            f"{words.fixes([named.write])}; leave it for an aircraft that flies sideways or backwards",
            (f"attitude: {named.cause}",),
            (change_attitude(source, named.undo),),
        )


def headed(nav: pd.DataFrame) -> tuple[Array, Array, Array] | None:
    """Attitudes (N, 3, 3), courses (N,), rad, and level accelerations (N, 2), m/s^2, where the aircraft
    moves; None where it hardly does."""
    values = nav[["time_s", *QUATERNION, *POSITION]].to_numpy(float)
    values = values[np.isfinite(values).all(axis=1)]
    t = values[:, 0]
    if len(t) < ENOUGH or (np.diff(t) <= 0).any():
        return None
    middle = np.unique(np.linspace(0, len(t) - 1, MOST).astype(int))
    before, here, after = (
        np.column_stack([np.interp(t[middle] + s, t, place) for place in values[:, 5:7].T])
        for s in (-STEP_S / 2, 0.0, STEP_S / 2)
    )
    inside = (t[middle] - STEP_S / 2 >= t[0]) & (t[middle] + STEP_S / 2 <= t[-1])
    gap = np.diff(t, append=np.inf)[middle]
    moved = (after - before) / STEP_S
    good = inside & (gap <= STEP_S) & (np.hypot(*moved.T) > MOVING)
    if good.sum() < ENOUGH:
        return None
    acceleration = (after - 2 * here + before)[good] / (STEP_S / 2) ** 2
    R = quaternion_to_matrix(values[middle[good], 1:5])
    return R, np.arctan2(moved[good, 1], moved[good, 0]), acceleration


def follows(R: Array, course: Array) -> float:
    """Mean cosine of the angle between heading and course: one where the nose points where it goes."""
    return float(np.mean(np.cos(matrix_to_euler(R)[:, 2] - course)))


def leans(R: Array, acceleration: Array) -> float:
    """Correlation, -1 to 1, between how the upper side leans in n and the level accelerations (N, 2)."""
    lean = -R[:, :2, 2] + R[:, :2, 2].mean(axis=0)
    gained = acceleration - acceleration.mean(axis=0)
    size = np.sqrt(np.sum(lean**2) * np.sum(gained**2))
    return float(np.sum(lean * gained) / size) if size > 0 else 0.0
