"""Displacement against velocity: what a log says of where it went, twice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from wildlab.flight.checks.corrections import change_columns, change_place
from wildlab.flight.checks.findings import POSITION, Finding
from wildlab.flight.checks.inertial_data import VELOCITY
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.places import place_mistakes
from wildlab.flight.checks.sense.trial import Misfit, Mistake, corrections_of, explain
from wildlab.flight.store import Flight
from wildlab.flight.units import other_units
from wildlab.geometry.frames import Array, Origin

#: Velocity and displacement of a small receiver agree to this (m/s), level and vertical, and to this share.
LEVEL, VERTICAL, SHARE = 0.4, 0.5, 0.05
#: Intervals: at least so long (s), at most so many, at least so many that moved so fast (m/s).
STEP_S, LONGEST_S, MOST, ENOUGH, MOVING = 1.0, 5.0, 400, 20, 1.0
#: The largest twentieth of what is left does not count: steps of a receiver.
COUNTED = 0.95
#: Units of speed as a recipe names them, in m/s.
SPEEDS = other_units("speed")


@dataclass(frozen=True)
class Moved:
    """Intervals: positions (K, 3) before and after, length (K,) s, mean velocity (K, 3)."""

    before: Array
    after: Array
    length: Array
    velocity: Array


def moved(table: pd.DataFrame) -> Moved | None:
    """Intervals of a table with positions and velocities; None where there are none, or nothing moved."""
    if VELOCITY[0] not in table:
        return None
    values = table[["time_s", *POSITION, *VELOCITY]].to_numpy(float)
    values = values[np.isfinite(values).all(axis=1)]
    t = values[:, 0]
    if len(t) < ENOUGH or (np.diff(t) <= 0).any():
        return None
    last = np.searchsorted(t, t + STEP_S)
    first = np.flatnonzero(last < len(t))
    last = last[first]
    good = t[last] - t[first] <= LONGEST_S
    first, last = first[good], last[good]
    thin = max(1, -(-len(first) // MOST))
    first, last = first[::thin], last[::thin]
    if len(first) < ENOUGH:
        return None
    total = np.zeros((len(t), 3))
    total[1:] = np.cumsum((values[1:, 4:] + values[:-1, 4:]) / 2 * np.diff(t)[:, None], axis=0)
    length = t[last] - t[first]
    mean = (total[last] - total[first]) / length[:, None]
    m = Moved(values[first, 1:4], values[last, 1:4], length, mean)
    speed = np.linalg.norm((m.after - m.before) / length[:, None], axis=1)
    fast = (speed > MOVING) | (np.linalg.norm(mean, axis=1) > MOVING)
    return m if fast.sum() >= ENOUGH else None


def misfit(m: Moved) -> Misfit:
    """How far displacement and velocity are apart, (2, 3), in units of what is usual; both rows alike."""
    gone = (m.after - m.before) / m.length[:, None]
    left = gone - m.velocity
    speed = np.minimum(_size(gone), _size(m.velocity))
    usual = np.maximum([LEVEL, LEVEL, VERTICAL], SHARE * speed)
    rows = np.arange(len(left)) // 10 % 2 == 0
    return np.tile([_size(left[which] / usual) for which in (rows | True, rows, ~rows)], (2, 1))


def _size(values: Array) -> float:
    length = np.sort(np.linalg.norm(values, axis=1))
    return float(np.sqrt(np.mean(length[: max(1, int(COUNTED * len(length)))] ** 2)))


def motion(flight: Flight) -> Iterator[Finding]:
    """Every table with positions and velocities."""
    tables = {f"nav/{name}": nav for name, nav in flight.nav.items() if not name.startswith("truth")}
    if flight.gnss is not None:
        tables["gnss"] = flight.gnss
    for name, table in tables.items():
        if "frame_id" in table:
            continue
        given = moved(table)
        if given is None:
            continue
        before = misfit(given)[0, 0]
        mistakes = motion_mistakes(name, flight.manifest.origin_tuple())
        named = explain(misfit, given, map(_still_moving, mistakes))
        if not named:
            if before > 10.0:
                yield Finding(
                    "warning",
                    name,
                    VELOCITY[0],
                    f"displacement and velocity differ by {before:.0f} times what is usual, and none of "
                    "the usual "
                    "mistakes explains it",
                    f"check columns and units of [{words.part_of(name)}.velocity], and the stamps",
                )
            continue
        yield Finding(
            "problem",
            name,
            VELOCITY[0],
            f"displacement and velocity differ by {words.number(_apart(given))} m/s: "
            + " or ".join(one.mistake.said for one in named)
            + f"; then it is {words.number(_apart(named[0].undone))} m/s",
            words.fixes([one.mistake.write for one in named]),
            tuple(one.mistake.cause for one in named),
            corrections_of(named),
        )


def _apart(m: Moved) -> float:
    return _size((m.after - m.before) / m.length[:, None] - m.velocity)


def _still_moving(mistake: Mistake[Moved]) -> Mistake[Moved]:
    """The mistake, where undoing it leaves something that moves: nothing agrees with nothing in any unit."""

    def undo(m: Moved) -> Moved | None:
        found = mistake.undo(m)
        if found is None:
            return None
        gone = (found.after - found.before) / found.length[:, None]
        return found if max(_size(gone), _size(found.velocity)) > MOVING else None

    return replace(mistake, undo=undo)


def motion_mistakes(table: str, origin: Origin) -> Iterator[Mistake[Moved]]:
    """Mistakes about velocities, and about positions."""
    part = words.part_of(table)
    where = f"{part}.velocity"

    def mistake(cause: str, said: str, write: str, change: Callable[[Array], Array]) -> Mistake[Moved]:
        return Mistake(
            cause,
            said,
            write,
            lambda m: replace(m, velocity=change(m.velocity)),
            corrections=(change_columns(table, VELOCITY, change),),
        )

    for key, keys in (
        ("velocity", [1, 1, 1]),
        ("north, east or speed", [1, 1, 0]),
        ("down or up", [0, 0, 1]),
    ):
        for unit, factor in SPEEDS.items():
            one = np.where(keys, factor, 1.0)
            yield mistake(
                f"{key} in {unit}, read as m/s",
                f"the velocity ({key}) is in {unit}, and the recipe says m/s",
                words.unit(key, where, unit),
                lambda v, k=one: v * k,  # type: ignore[misc]
            )
            yield mistake(
                f"{key} in m/s, read as {unit}",
                f"the velocity ({key}) is in m/s, and the recipe says {unit}",
                words.unit(key, where, "m/s"),
                lambda v, k=one: v / k,  # type: ignore[misc]
            )
    for key, sign in (
        ("north", [-1, 1, 1]),
        ("east", [1, -1, 1]),
        ("north and east", [-1, -1, 1]),
        ("down (or up)", [1, 1, -1]),
    ):
        yield mistake(
            f"sign of {key}",
            f"the velocity {key} has the wrong sign",
            words.negate(key, where),
            lambda v, s=np.array(sign): v * s,  # type: ignore[misc]  # noqa: B008
        )
    yield mistake(
        "velocity north and east exchanged",
        "the velocities north and east are exchanged",
        words.exchange("north", "east", where),
        lambda v: v[:, [1, 0, 2]],
    )
    yield mistake(
        "course in radians, read as degrees",
        "the course is in radians, and the recipe says degrees",
        words.unit("course", where, "rad"),
        lambda v: _course(v, np.degrees(np.arctan2(v[:, 1], v[:, 0]))),
    )
    yield Mistake(
        "course in degrees, read as radians",
        "the speed fits and the course does not, as where it is in degrees and the recipe says rad",
        words.unit("course", where, "deg"),
        _nearest_course,
        fitted=True,
    )
    for place in place_mistakes(part, origin):
        yield place.within("position", _places(place.undo), change_place(table, place.undo))


def _course(v: Array, course: Array) -> Array:
    speed = np.hypot(v[:, 0], v[:, 1])
    return np.column_stack([speed * np.cos(course), speed * np.sin(course), v[:, 2]])


def _nearest_course(m: Moved) -> Moved:
    """Courses in degrees that read as radians would be these, those nearest to the displacement."""
    seen = np.arctan2(m.velocity[:, 1], m.velocity[:, 0]) % (2 * np.pi)
    gone = m.after - m.before
    wanted = np.degrees(np.arctan2(gone[:, 1], gone[:, 0])) % 360
    turns = np.round((wanted - seen) / (2 * np.pi))
    return replace(m, velocity=_course(m.velocity, np.radians(seen + 2 * np.pi * turns)))


def _places(undo: Callable[[Array], Array | None]) -> Callable[[Moved], Moved | None]:
    def change(m: Moved) -> Moved | None:
        both = undo(np.concatenate([m.before, m.after]))
        return None if both is None else replace(m, before=both[: len(m.before)], after=both[len(m.before) :])

    return change
