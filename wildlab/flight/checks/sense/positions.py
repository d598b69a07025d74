"""The positions of a nav source against those of the receiver: place, height and time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.checks.corrections import change_place, shift_clock, shift_poses
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import fixes
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.constants import best_of
from wildlab.flight.checks.sense.places import place_mistakes
from wildlab.flight.checks.sense.trial import Misfit, Mistake, corrections_of, explain
from wildlab.flight.clocks import poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: Usual standard deviations (m), and what a delay of so many seconds makes of the speed.
LEVEL, VERTICAL, DELAY_S = 3.0, 6.0, 0.4
#: Fixes looked at, and the fewest that say anything.
MOST, ENOUGH = 300, 10
SHIFTS = np.sinh(np.linspace(-5.0, 5.0, 61)) * 1.6
HOURS = tuple(float(h) for h in np.arange(-14.0, 14.5, 0.5) if h)


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


def pair_of(flight: Flight, source: str) -> PositionPair | None:
    """Nav source and receiver at the times of the fixes; None where they have too little in common."""
    table = fixes(flight)
    nav = flight.nav[source]
    if table is None or "frame_id" in nav or len(nav) < 2:
        return None
    table = table.iloc[np.unique(np.linspace(0, len(table) - 1, MOST).astype(int))]
    t = table["time_s"].to_numpy(float)
    p = table[["north_m", "east_m", "down_m"]].to_numpy(float)
    brief = nav[["time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z"]]

    def at(shift: float) -> tuple[Array, Array]:
        there, R, _ = poses_at(brief, t + shift)
        return there, R

    try:
        there, R = at(0.0)
    except (WildlabError, ValueError):
        return None
    stated = flight.manifest.uncertainty
    speed = np.linalg.norm(np.gradient(p, t, axis=0), axis=1)
    speed = np.minimum(speed, 4 * np.median(speed) + 1)
    level = np.hypot(stated.position_horizontal_m or LEVEL, DELAY_S * speed)
    vertical = np.full(len(t), stated.position_vertical_m or VERTICAL)
    usual = np.maximum(np.column_stack([level, level, vertical]), [1.0, 1.0, 2.0])
    lever = np.array(flight.manifest.gnss.lever_arm_m, float)
    found = PositionPair(there, p, R, lever, usual, at)
    return found if np.isfinite(there).all(axis=1).sum() >= ENOUGH else None


def misfit(pair: PositionPair) -> Misfit:
    """How far both are apart, (2, 3), in units of what is usual: less a constant, and as it is."""
    left = pair.gnss - np.einsum("nij,j->ni", pair.R_nb, pair.lever) - pair.nav
    good = np.isfinite(left).all(axis=1)
    if good.sum() < ENOUGH or good.mean() < 0.3:
        return np.full((2, 3), np.inf)
    left, usual = left[good], pair.usual[good]
    rows = np.arange(len(left)) // 5 % 2 == 0
    result = np.empty((2, 3))
    for column, (fit, judged) in enumerate(((rows | True, rows | True), (rows, ~rows), (~rows, rows))):
        constant = np.median(left[fit], axis=0)
        result[0, column] = _size((left[judged] - constant) / usual[judged])
        result[1, column] = _size(left[judged] / usual[judged])
    return result


def _size(values: Array) -> float:
    return float(np.median(np.linalg.norm(values, axis=1))) / 1.54  # of three axes


def positions(flight: Flight) -> Iterator[Finding]:
    """Every nav source against the receiver."""
    for source in flight.nav:
        if source.startswith("truth"):
            continue
        given = pair_of(flight, source)
        if given is None:
            continue
        named = explain(misfit, given, position_mistakes(flight, source, given))
        now = misfit(given)
        said = f"the positions of nav/{source} and gnss are {_apart(given)} apart"
        if named:
            yield Finding(
                "problem",
                f"nav/{source}",
                "north_m",
                f"{said}: {' or '.join(one.mistake.said for one in named)}; then they are "
                f"{_apart(named[0].undone)} apart",
                words.fixes([one.mistake.write for one in named]),
                tuple(one.mistake.cause for one in named),
                corrections_of(named),
            )
        elif now[1, 0] > 6.0:
            yield Finding(
                "warning",
                f"nav/{source}",
                "north_m",
                f"{said} ({now[1, 0]:.0f} times what is usual), and none of the usual mistakes explains it",
                f"check [poses.{source}.position], [gnss.position], their stamps and vertical reference",
            )


def _apart(pair: PositionPair) -> str:
    left = pair.gnss - np.einsum("nij,j->ni", pair.R_nb, pair.lever) - pair.nav
    level, vertical = np.nanmedian(np.hypot(left[:, 0], left[:, 1])), np.nanmedian(np.abs(left[:, 2]))
    return f"{words.number(float(level))} m level and {words.number(float(vertical))} m in height"


def position_mistakes(flight: Flight, source: str, pair: PositionPair) -> Iterator[Mistake[PositionPair]]:
    """Mistakes about the places of both, a constant height, and clocks."""
    origin = flight.manifest.origin_tuple()

    def of(
        which: str, undo: Callable[[Array], Array | None]
    ) -> Callable[[PositionPair], PositionPair | None]:
        def change(p: PositionPair) -> PositionPair | None:
            moved = undo(getattr(p, which))
            if moved is None:
                return None
            return replace(p, nav=moved) if which == "nav" else replace(p, gnss=moved)

        return change

    for part, which in ((f"poses.{source}", "nav"), ("gnss", "gnss")):
        for place in place_mistakes(part, origin):
            correct = change_place(part.replace("poses.", "nav/"), place.undo)
            yield place.within(part, of(which, place.undo), correct)
    left = pair.gnss - pair.nav
    up = float(np.nanmedian(-left[:, 2]))
    yield Mistake(
        "constant height",
        f"the heights of gnss are {abs(up):.0f} m {'above' if up > 0 else 'below'} those of "
        f"nav/{source} (geoid, "
        "or height above the start?)",
        f'`correction_m` of {up:.1f} m in [vertical] with `taken_off = ["gnss"]`, or of {-up:.1f} m '
        'with `["poses"]`',
        lambda p: replace(p, gnss=p.gnss + np.array([0.0, 0.0, up])),
        fitted=True,
        corrections=(
            change_place("gnss", lambda p: p + np.array([0.0, 0.0, up])),
            change_place(f"nav/{source}", lambda p: p - np.array([0.0, 0.0, up])),
        ),
    )
    if np.abs(pair.lever).max() > 5:
        for unit, factor in (("mm", 1e-3), ("cm", 1e-2)):
            yield Mistake(
                f"lever arm in {unit}",
                f"the lever arm of the antenna is in {unit}",
                "metres for `lever_arm_m` in [gnss]",
                lambda p, f=factor: replace(p, lever=f * p.lever),  # type: ignore[misc]
            )
    by = best_of(lambda s: float(np.sqrt(np.prod(misfit(_shifted(pair, s))[:, 0]))), SHIFTS)
    if abs(by) > 0.3:
        offset = flight.manifest.clocks.gnss_offset_s + by
        yield Mistake(
            "clock of the receiver",
            f"the stamps of gnss and nav/{source} are {abs(by):.1f} s apart",
            f"`gnss_offset_s = {offset:.1f}` in [clocks] if those of gnss are "
            f"{'early' if by > 0 else 'late'}, else "
            f"the time in [poses.{source}]",
            lambda p: _shifted(p, by),
            fitted=True,
            corrections=(shift_clock("gnss_offset_s", by), shift_poses(source, -by)),
        )


def _shifted(pair: PositionPair, by: float) -> PositionPair:
    nav, R = pair.at(by)
    return replace(pair, nav=nav, R_nb=R)
