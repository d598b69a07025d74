"""Where a flight says it went, twice: displacement and velocity, poses and receiver, leaps, origin.

Whoever flies straight on is as far off by a leap along his way as by late stamps. What tells the two apart is
in the leaping table alone: its places go where its velocity, or its places before and after, did not. A clock
that is off leaves every table as smooth as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import median_filter

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import (
    LEAP,
    POSE,
    Finding,
    Level,
    Misfit,
    Mistake,
    blame,
    change_by,
    change_columns,
    compare,
    crosswise,
    finite_rows,
    mistake,
    one_row,
    part_of,
    place_mistakes,
    places_in,
    raise_by,
    rows_of,
    shift_clock,
    shift_poses,
    thin,
    undo_in,
)
from wildlab.flight.checks.inertial import fixes, increasing_rows, intervals, trimmed_size
from wildlab.flight.checks.known_points import LONGEST_LEVER, best_of
from wildlab.flight.clocks import poses_at
from wildlab.flight.schema import POSITION, VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Origin, geodetic_to_ned, ned_to_geodetic

#: Velocity and displacement of a small receiver agree to this (m/s), level and vertical, and to this share.
LEVEL, VERTICAL, SHARE = 0.4, 0.5, 0.05
#: Intervals: at least so long (s), at most so many, at least so many that moved so fast (m/s).
STEP_S, LONGEST_S, MOST, ENOUGH, MOVING = 1.0, 5.0, 400, 20, 1.0
#: The largest twentieth of what is left does not count: steps of a receiver.
_size = partial(trimmed_size, counted=0.95)


@dataclass(frozen=True)
class Moved:
    """Intervals: positions (K, 3) before and after, length (K,) s, mean velocity (K, 3)."""

    before: Array
    after: Array
    length: Array
    velocity: Array

    @property
    def gone(self) -> Array:
        """The velocity that the positions have, (K, 3)."""
        return (self.after - self.before) / self.length[:, None]


def moved(table: pd.DataFrame) -> Moved | None:
    """Intervals of a table with positions and velocities; None where there are none, or nothing moved."""
    if VELOCITY[0] not in table:
        return None
    values = increasing_rows(table, (*POSITION, *VELOCITY), ENOUGH)
    if values is None:
        return None
    t = values[:, 0]
    first, last = intervals(t, STEP_S, LONGEST_S, MOST)
    if len(first) < ENOUGH:
        return None
    total = cumulative_trapezoid(values[:, 4:], t, axis=0, initial=0)
    length = t[last] - t[first]
    m = Moved(values[first, 1:4], values[last, 1:4], length, (total[last] - total[first]) / length[:, None])
    fast = (np.linalg.norm(m.gone, axis=1) > MOVING) | (np.linalg.norm(m.velocity, axis=1) > MOVING)
    return m if fast.sum() >= ENOUGH else None


def _motion_misfit(m: Moved) -> Misfit:
    """How far displacement and velocity are apart, (2, 3), in units of what is usual; both rows alike."""
    speed = np.minimum(_size(m.gone), _size(m.velocity))
    left = (m.gone - m.velocity) / np.maximum([LEVEL, LEVEL, VERTICAL], SHARE * speed)
    return crosswise(len(left), 10, lambda _, judged: (_size(left[judged]),) * 2)


def motion(flight: Flight) -> Iterator[Finding]:
    """Displacement against velocity, of every table with positions and velocities."""
    tables = {f"nav/{name}": nav for name, nav in flight.nav.items() if not name.startswith("truth")}
    if flight.gnss is not None:
        tables["gnss"] = flight.gnss
    for name, table in tables.items():
        given = None if "frame_id" in table else moved(table)
        if given is not None:
            yield from compare(
                "motion",
                _motion_misfit,
                given,
                map(_moving, motion_mistakes(name, flight.manifest.origin_tuple())),
                lambda m: {"apart": _size(m.gone - m.velocity)},
                name,
                VELOCITY[0],
                limit=10.0,
                part=part_of(name),
            )


def _moving(one: Mistake[Moved]) -> Mistake[Moved]:
    """The same mistake where it leaves something that moves: nothing agrees with nothing in any unit."""

    def undo(m: Moved) -> Moved | None:
        found = one.undo(m)
        return found if found and max(_size(found.gone), _size(found.velocity)) > MOVING else None

    return replace(one, undo=undo)


def motion_mistakes(table: str, origin: Origin) -> Iterator[Mistake[Moved]]:
    """Mistakes about velocities, and about positions."""
    part = part_of(table)
    velocities = [(row, change_by(row)) for row in rows_of("velocity")]
    read = one_row("course-in-radians"), lambda v: _course(v, np.degrees(np.arctan2(v[:, 1], v[:, 0])))
    velocities.append(read)
    for row, change in velocities:
        yield mistake(row, undo_in(change, "velocity"), change_columns(table, VELOCITY, change), part=part)
    yield mistake(one_row("course-in-degrees"), _nearest_course, fitted=True, part=part)
    yield from places_in(table, origin, "position", "before", "after")


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


# -- the positions of a nav source against those of the receiver

#: Usual standard deviations (m), and what a delay of so many seconds makes of the speed.
USUAL_LEVEL, USUAL_VERTICAL, DELAY_S = 3.0, 6.0, 0.4
#: Fixes looked at, and the fewest that say anything.
MOST_FIXES, ENOUGH_FIXES = 300, 10
SHIFTS = np.sinh(np.linspace(-5.0, 5.0, 61)) * 1.6


@dataclass(frozen=True)
class PositionPair:
    """Positions (N, 3) of both, what is usual of their difference (N, 3), attitudes and the lever arm; and
    the nav positions at other times."""

    nav: Array
    gnss: Array
    R_nb: Array
    lever: Array
    usual: Array
    at: Callable[[float], tuple[Array, Array]]

    @property
    def left(self) -> Array:
        """How far the receiver is from where the poses have its antenna, (N, 3) m."""
        return np.asarray(self.gnss - np.einsum("nij,j->ni", self.R_nb, self.lever) - self.nav)

    def apart(self) -> dict[str, float]:
        """Medians of the distance level and in height, m."""
        level, height = np.hypot(*self.left.T[:2]), np.abs(self.left[:, 2])
        return {"horizontal": np.nanmedian(level), "height": np.nanmedian(height)}

    def shifted(self, by: float) -> PositionPair:
        """The same with poses that are so many seconds later."""
        nav, R = self.at(by)
        return replace(self, nav=nav, R_nb=R)


def pair_of(flight: Flight, source: str) -> PositionPair | None:
    """Nav source and receiver at the times of the fixes; None where they have too little in common."""
    table, nav = fixes(flight), flight.nav[source]
    if table is None or "frame_id" in nav or len(nav) < 2:
        return None
    table = table.iloc[thin(len(table), MOST_FIXES)]
    t, p = table["time_s"].to_numpy(float), table[POSITION].to_numpy(float)
    brief = nav[POSE]

    def at(shift: float) -> tuple[Array, Array]:
        return poses_at(brief, t + shift)[:2]

    try:
        there, R = at(0.0)
    except (WildlabError, ValueError):
        return None
    stated = flight.manifest.uncertainty
    speed = np.linalg.norm(np.gradient(p, t, axis=0), axis=1)
    speed = np.minimum(speed, 4 * np.median(speed) + 1)
    level = np.hypot(stated.position_horizontal_m or USUAL_LEVEL, DELAY_S * speed)
    vertical = np.full(len(t), stated.position_vertical_m or USUAL_VERTICAL)
    usual = np.maximum(np.column_stack([level, level, vertical]), [1.0, 1.0, 2.0])
    lever = np.array(flight.manifest.gnss.lever_arm_m, float)
    found = PositionPair(there, p, R, lever, usual, at)
    return found if np.isfinite(there).all(axis=1).sum() >= ENOUGH_FIXES else None


def _position_misfit(pair: PositionPair) -> Misfit:
    """How far both are apart, (2, 3), in units of what is usual: less a constant, and as it is."""
    good = np.isfinite(pair.left).all(axis=1)
    if good.sum() < ENOUGH_FIXES or good.mean() < 0.3:
        return np.full((2, 3), np.inf)
    left, usual = pair.left[good], pair.usual[good]

    def size(values: Array) -> float:
        return float(np.median(np.linalg.norm(values, axis=1))) / 1.54  # of three axes

    return crosswise(
        len(left),
        5,
        lambda fit, judged: (
            size((left[judged] - np.median(left[fit], axis=0)) / usual[judged]),
            size(left[judged] / usual[judged]),
        ),
    )


def positions(flight: Flight) -> Iterator[Finding]:
    """The positions of every nav source against those of the receiver."""
    for source in flight.nav:
        given = None if source.startswith("truth") else pair_of(flight, source)
        if given is not None:
            yield from compare(
                "positions",
                _position_misfit,
                given,
                position_mistakes(flight, source, given),
                PositionPair.apart,
                f"nav/{source}",
                "north_m",
                limit=6.0,
                source=source,
            )


def position_mistakes(flight: Flight, source: str, pair: PositionPair) -> Iterator[Mistake[PositionPair]]:
    """Mistakes about the places of either, heights from elsewhere, and clocks that differ."""
    origin = flight.manifest.origin_tuple()
    yield from places_in(f"nav/{source}", origin, f"poses.{source}", "nav")
    yield from places_in("gnss", origin, "gnss", "gnss")
    up = float(np.nanmedian(-(pair.gnss - pair.nav)[:, 2]))
    yield mistake(
        one_row("gnss-height"),
        lambda p: replace(p, gnss=p.gnss + np.array([0.0, 0.0, up])),
        raise_by("gnss", -up),
        raise_by(f"nav/{source}", up),
        fitted=True,
        source=source,
        up=up,
        down=-up,
    )
    if np.abs(pair.lever).max() > LONGEST_LEVER:
        for row in rows_of("lever-arm"):
            yield mistake(row, undo_in(change_by(row), "lever"), what="antenna", part="gnss")
    by = best_of(lambda s: float(np.sqrt(np.prod(_position_misfit(pair.shifted(s))[:, 0]))), SHIFTS)
    if abs(by) > 0.3:
        yield mistake(
            one_row("gnss-clock"),
            lambda p: p.shifted(by),
            shift_clock("gnss_offset_s", by),
            shift_poses(source, -by),
            fitted=True,
            source=source,
            by=by,
            offset=flight.manifest.clocks.gnss_offset_s + by,
        )


# -- leaps of a position: a jump of the fix, or a filter that began anew, which a clock would seem to explain

#: A leap is over within so many seconds, at least so long (m), and so many of the usual spreads of a stretch
#: as long.
WITHIN_S, LEAST_M, FAR = 2.0, 5.0, 12.0
#: Places so long before and after it (s) say how far it went.
BESIDE_S = 5.0
#: Rows closer than that (s) tell no more.
FINEST_S = 0.1
#: A velocity is the median of the steps of so long (s), of three at least, where the table has none.
STEPS_S = 3.0
#: Rows below which nothing is told from noise; leaps beyond which a table is rough, and not leaping.
FEWEST, MOST_LEAPS = 30, 5


#: Receivers leap by up to 20 m now and then; what is beyond this (m) is said in any case, less only where a
#: clock would be blamed for it, by how such causes begin.
LARGE_M, CLOCKS = 25.0, ("clock", "leap seconds")


class Leap(NamedTuple):
    """Where a position leapt: the table (with the target, of truth), when, and by how much, (3,) m in n."""

    table: str
    time_s: float
    by: Array


def find_leaps(table: pd.DataFrame, name: str = "") -> list[Leap]:
    """Leaps of the positions of one table, in the order of time.

    Parameters
    ----------
    table
        With ``time_s``, a position and perhaps a velocity; of one target.
    name
        What the leaps are said to be of.

    Examples
    --------
    >>> t = np.arange(0.0, 60.0, 0.5)
    >>> north = 10 * t + np.where(t > 20, 40, 0)
    >>> place = pd.DataFrame({"time_s": t, "north_m": north, "east_m": 0.0, "down_m": 0.0})
    >>> [(one.time_s, one.by.round(1).tolist()) for one in find_leaps(place)]
    [(20.5, [40.0, 0.0, 0.0])]
    """
    has_velocity = VELOCITY[0] in table
    values = table[["time_s", *POSITION, *(VELOCITY if has_velocity else [])]].to_numpy(float)
    values = values[np.isfinite(values[:, :4]).all(axis=1)]
    steps_s = np.diff(values[:, 0])
    if len(steps_s) < FEWEST or (steps_s <= 0).any() or (usual := float(np.median(steps_s))) > WITHIN_S:
        return []
    values = values[:: max(1, int(FINEST_S / usual))]
    usual = max(usual, FINEST_S)
    t, p = values[:, 0], values[:, 1:4]
    step = np.diff(t)[:, None]
    gone = np.diff(p, axis=0)
    if has_velocity and np.isfinite(values[:, 4:]).all():
        expected = (values[1:, 4:] + values[:-1, 4:]) / 2 * step
    else:
        # Longer ones clip turns: a leap of one row stands out of three.
        steps = 1 + 2 * max(1, int(STEPS_S / usual / 2))
        expected = median_filter(gone / step, (steps, 1), mode="nearest") * step
    # Behind a gap nobody knows how far it should have gone.
    unexplained = np.where(step > max(WITHIN_S, 3 * usual), 0.0, gone - expected)
    left = np.concatenate([np.zeros((1, 3)), np.cumsum(unexplained, axis=0)])
    end = np.minimum(np.searchsorted(t, t + WITHIN_S), len(t) - 1)
    size = np.linalg.norm(left[end] - left, axis=1)
    limit = max(LEAST_M, FAR * np.median(size))
    found: list[Leap] = []
    # The first row of each run of stretches that are too long is as much before the leap as a stretch is.
    rows = np.flatnonzero(size > limit)
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(rows) else []:
        first, last = int(run[0]), int(end[run[-1]])
        row = first + int(np.argmax(np.linalg.norm(unexplained[first:last], axis=1))) + 1
        before = left[(t >= t[first] - BESIDE_S) & (t <= t[first])]
        after = left[(t >= t[last]) & (t <= t[last] + BESIDE_S)]
        by = np.median(after, axis=0) - np.median(before, axis=0)
        # What comes back at once is a stray place.
        if np.linalg.norm(by) > limit:
            found.append(Leap(name, float(t[row]), by))
    return found if len(found) <= MOST_LEAPS else []


def without_leaps(flight: Flight) -> tuple[Flight, list[Leap]]:
    """The flight with the leaps of all its positions taken off, and these."""
    every: list[Leap] = []

    def smooth(table: pd.DataFrame, name: str) -> pd.DataFrame:
        found = find_leaps(table, name)
        every.extend(found)
        place = table[POSITION].to_numpy(float)
        for one in found:
            place = np.where(table["time_s"].to_numpy(float)[:, None] >= one.time_s, place - one.by, place)
        return table.assign(**dict(zip(POSITION, place.T, strict=True))) if found else table

    nav = {
        name: table if name.startswith("truth") or "frame_id" in table else smooth(table, f"nav/{name}")
        for name, table in flight.nav.items()
    }
    tables = dict(flight.tables)
    if flight.gnss is not None:
        tables["gnss"] = smooth(flight.gnss, "gnss")
    if flight.truth is not None and len(flight.truth):
        targets = flight.truth.groupby("target_id", sort=False)
        parts = [smooth(rows, f"truth of {target}") for target, rows in targets]
        tables["truth"] = pd.concat(parts).loc[flight.truth.index]
    return replace(flight, nav=nav, tables=tables), every


def leaps(found: Iterable[Leap]) -> Iterator[Finding]:
    """What is said of leaps."""
    for one in found:
        table, _, target = one.table.partition(" of ")
        facts = {"of": f" of {target}" if target else "", "size": np.linalg.norm(one.by), "at": one.time_s}
        yield Finding("problem", table, "north_m", "leap", facts, (LEAP,))


#: Nothing that is tracked is faster, m/s; a place is far from those before and after it from here, m.
FASTEST, STRAY_M = 340.0, 100.0


def stray_places(flight: Flight) -> Iterator[Finding]:
    """Rows whose place nothing can go to and come back from in the time."""
    tables = {f"nav/{name}": table for name, table in flight.nav.items()}
    if flight.truth is not None and len(flight.truth):
        tables |= {f"truth of {one}": rows for one, rows in flight.truth.groupby("target_id", sort=False)}
    for name, table in tables.items():
        values = table[["time_s", *POSITION]].to_numpy(float) if "time_s" in table else np.empty((0, 4))
        values = values[np.isfinite(values).all(axis=1)]
        gone, step = np.linalg.norm(np.diff(values[:, 1:], axis=0), axis=1), np.diff(values[:, 0])
        far = (gone > np.maximum(STRAY_M, FASTEST * step)) & (step > 0)
        stray = np.append(far, True) & np.insert(far, 0, True) if far.any() else np.zeros(0, bool)
        if stray.any():
            row = int(np.flatnonzero(stray)[0])
            facts = {"n": int(stray.sum()), "at": values[row, 0], "size": gone[max(row - 1, 0)]}
            yield Finding("warning", name.partition(" of ")[0], "north_m", "stray-places", facts)


# -- where the flight is: about its origin, and its tables near each other

#: From here on a local level at the origin is worth a word, and from there on it cannot serve (m): attitudes
#: are against the level where the aircraft is, and turn by a degree in 111 km, more near the poles.
FAR_AWAY, TOO_FAR = 20_000.0, 100_000.0
#: Tables whose middles are this much (m) further apart than they are long do not belong together.
APART_M = 20_000.0


def origin(flight: Flight) -> Iterator[Finding]:
    """The origin of the local frame against where the flight is."""
    flown = {name: at for name, at in middles(flight).items() if name.startswith("nav/") or name == "gnss"}
    at = min(flown.values(), key=_level, default=np.zeros(3))
    away = _level(at)
    if away < FAR_AWAY:
        return
    o, stated = flight.manifest.origin, flight.manifest.origin_tuple()
    here = ned_to_geodetic(at, stated)
    ways: dict[str, str] = {}
    for row in rows_of("origin"):
        lat, lon = np.asarray(change_by(row)(np.array([o.latitude_deg, o.longitude_deg]))).tolist()
        there = (float(np.radians(lat)), float(np.radians(lon)), o.height_m)
        if abs(lat) <= 90 and _level(geodetic_to_ned(here[0], here[1], here[2], there)) < FAR_AWAY:
            way: Mistake[Array] = mistake(row, lambda x: x, lat=lat, lon=lon)
            ways[way.cause] = way.fix
    shown = flight.manifest.locations.sensitivity == "open"
    facts = {
        "km": away / 1e3,
        "angle": turned(at, stated),
        "named": "; ".join(ways),
        "open": shown,
        "ways": " or ".join(ways.values() if shown else ways),
    }
    level: Level = "problem" if away > TOO_FAR else "warning"
    code, causes = "origin-explained" if ways else "origin-far", tuple(ways) or ("origin far away",)
    yield Finding(level, "flight.toml", "origin", code, facts, causes)


def _level(at: Array) -> float:
    return float(np.hypot(*at[:2]))


def turned(at: Array, origin: Origin) -> float:
    """How far level and north at a place (3,) in n are turned against those of the origin, degrees.

    Examples
    --------
    >>> print(f"{turned(np.array([111_000.0, 0.0, 0.0]), (0.0, 0.0, 0.0)):.2f}")
    1.00
    """
    p = np.asarray(at, float)[None]
    latitude, longitude, height = ned_to_geodetic(p, origin)[0]
    north = geodetic_to_ned(latitude + 1e-6, longitude, height, origin) - p[0]
    up = geodetic_to_ned(latitude, longitude, height + 10.0, origin) - p[0]
    north, down = north / np.linalg.norm(north), -up / np.linalg.norm(up)
    R = np.stack([north, np.cross(down, north), down])
    return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))))


def middles(flight: Flight) -> dict[str, Array]:
    """The middle (3,) in n of each table of positions."""
    tables = {f"nav/{name}": nav for name, nav in flight.nav.items()}
    tables |= {name: flight.tables[name] for name in ("gnss", "truth") if name in flight.tables}
    places = {name: finite_rows(table, POSITION) for name, table in tables.items()}
    return {name: np.median(p, axis=0) for name, p in places.items() if len(p)}


def together(flight: Flight) -> Iterator[Finding]:
    """Tables that are nowhere near each other, and the mistake that brings one to the others.

    Which of two is wrong, the origin of the recipe may say: the right one is near it.
    """
    places = middles(flight)
    anchor = min(places, key=lambda name: _level(places[name]), default="")
    for name, at in places.items():
        other = places[anchor]
        apart = _level(at - other)
        if name == anchor or apart < APART_M:
            continue
        ways = [*_nearer(name, at, other, flight), *_nearer(anchor, other, at, flight)][:3]
        ways = [replace(way, cause=f"{name}: {way.cause}") for way in ways]
        code = "tables-apart-explained" if ways else "tables-apart"
        facts = {"name": name, "km": apart / 1e3, "anchor": anchor}
        yield blame("problem", name, "north_m", code, ways, facts, [])


def _nearer(name: str, at: Array, other: Array, flight: Flight) -> Iterator[Mistake[Array]]:
    """Mistakes that bring a place to another."""
    for one in place_mistakes(part_of(name), flight.manifest.origin_tuple(), local=False):
        moved = None if one.about == "height" else one.undo(at[None])
        if moved is not None and _level(moved[0] - other) < APART_M:
            yield replace(one, said=f"in {name} {one.said}")
