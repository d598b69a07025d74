"""Whether known points are where the poses have them, and if not, which mistake it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from wildlab.flight.checks.corrections import change_attitude, change_camera, change_place
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.attitudes import attitude_mistakes
from wildlab.flight.checks.sense.constants import clock_mistakes, height_mistakes, turn_mistakes
from wildlab.flight.checks.sense.lens import calibration_mistakes, mount_mistakes, pixel_mistakes
from wildlab.flight.checks.sense.nameless import nameless
from wildlab.flight.checks.sense.places import place_mistakes
from wildlab.flight.checks.sense.sightings import (
    Missed,
    Sightings,
    degrees,
    finite,
    glance,
    left_over,
    metres,
    metres_left,
    misfit,
    missed,
    sightings,
    with_attitude,
)
from wildlab.flight.checks.sense.trial import ALIKE, FAR_BETTER, Mistake, Named, explain
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: Without a known mistake, misses this many times what is expected and this large (deg) are still said.
UNEXPLAINED, UNEXPLAINED_DEG = 4.0, 8.0
#: A single photo or mark is named where most of its misses are so many times those of all, by at least so
#: many points, and so many times what is expected.
SINGLE, SINGLE_POINTS, SINGLE_EXPECTED = 6.0, 2, 5.0
#: Rays that pass known points by less than this (m) are not told apart.
CLOSE_M = 0.1
#: So many photos of a flight in which all is as stated may be named, in the mean.
BY_CHANCE = 0.05


def seen(flight: Flight) -> Iterator[Finding]:
    """Clicks on known points against the poses, for each nav source.

    Parameters
    ----------
    flight
        The flight.

    Yields
    ------
    Finding
    """
    for name in flight.nav:
        if name.startswith("truth"):  # a twin's own, no log
            continue
        given = sightings(flight, name)
        if given is not None:
            yield from judge(flight, given)


def judge(flight: Flight, given: Sightings) -> Iterator[Finding]:
    """The findings about one nav source."""
    if not given.named:
        many = flight.manifest.targets.many
        if many is not None and many.others:
            return  # most of what is detected may be of those whose places nobody knows
        yield from nameless(flight, given)
        if flight.manifest.scoring.rule == "nearest":
            yield from _single(given)
        return
    named = explain(misfit, given, camera_mistakes(flight, given), glance)
    # Misfits are in units of what is expected, which a mistake may change too: metres have to fall as well.
    named = [one for one in named if _nearer(given, one.undone)]
    if named:
        yield _finding(given, named)
        given = named[0].undone
    else:
        now = misfit(given)[0, 0]
        angle = degrees(given)
        if now > UNEXPLAINED and angle > UNEXPLAINED_DEG:
            yield Finding(
                "warning",
                f"nav/{given.source}",
                "",
                f"the rays of clicks on known points pass them by {words.number(metres(given))} m, "
                f"{angle:.0f} deg (median), and none of the usual mistakes explains it",
                "check mount, attitude, clock and names of the points: the report shows how errors go "
                "together",
            )
    yield from _single(given)


def camera_mistakes(flight: Flight, s: Sightings) -> Iterator[Mistake[Sightings]]:
    """All usual mistakes that change where known points are seen."""
    part = f"poses.{s.source}"
    yield from mount_mistakes(s)
    for b in attitude_mistakes(part):
        yield b.within("", with_attitude(b.undo), change_attitude(s.source, b.undo))
    yield from pixel_mistakes(s)
    yield from calibration_mistakes(s)
    for a in place_mistakes(part, s.origin):
        yield a.within("poses", _position(a.undo), change_place(f"nav/{s.source}", a.undo))
    for a in place_mistakes("truth", s.origin):
        yield a.within("truth", _points(a.undo), change_place("truth", a.undo))
    yield from height_mistakes(s)
    yield from turn_mistakes(s)
    if flight.manifest.time.kind == "utc":
        yield from clock_mistakes(s, flight.manifest.clocks.camera_offset_s)


def _position(undo: Callable[[Array], Array | None]) -> Callable[[Sightings], Sightings | None]:
    def change(s: Sightings) -> Sightings | None:
        p = undo(s.p_nb)
        return None if p is None else replace(s, p_nb=p)

    return change


def _points(undo: Callable[[Array], Array | None]) -> Callable[[Sightings], Sightings | None]:
    def change(s: Sightings) -> Sightings | None:
        p = undo(s.points)
        return None if p is None else replace(s, points=p)

    return change


def _plain(given: Sightings, undone: Sightings) -> bool:
    """Whether the distance falls by far with nothing else taken off."""
    return metres(undone) * FAR_BETTER <= metres(given)


def _nearer(given: Sightings, undone: Sightings) -> bool:
    """Whether the distance that is told of falls."""
    return _plain(given, undone) or metres_left(undone) < metres_left(given)


def _finding(given: Sightings, named: list[Named[Sightings]]) -> Finding:
    # Where other small errors hide what is gained, it is the distance without these that shows it.
    plain = _plain(given, named[0].undone)
    far = metres if plain else metres_left
    # What is as good in angles and leaves ten times the distance explains it less.
    left = np.nan_to_num([far(one.undone) for one in named], nan=np.inf)
    named = [one for one, off in zip(named, left, strict=True) if off <= ALIKE * max(left.min(), CLOSE_M)]
    first, *others = named
    said = (
        f"{first.mistake.said}: that brings the distance by which rays pass known points"
        f"{'' if plain else ', small constant errors of mount and position taken off,'} from "
        f"{words.number(far(given))} m to {words.number(far(first.undone))} m (median)"
    )
    if others:
        alike = [f"{one.mistake.said} ({words.number(far(one.undone))} m)" for one in others]
        said += f"; as well explained: {words.joined(alike)}"
    return Finding(
        "problem",
        f"nav/{given.source}",
        "",
        said,
        words.fixes([one.mistake.write for one in named]),
        tuple(one.mistake.cause for one in named),
        tuple(
            correct
            for one in named
            for correct in one.mistake.corrections or (change_camera(one.undone.camera, one.undone.mount),)
        ),
    )


def _single(s: Sightings) -> Iterator[Finding]:
    """One photo, or one mark, that is off while the others are not."""
    m = missed(s)
    good = finite(m)
    if good.sum() < 8:
        return
    angle = left_over(m, good)
    size = angle / m.expected
    # What is expected takes the mean of the angles; one photo may be off by the one that is known least.
    least = np.sqrt(m.expected**2 - s.sd[:, 0] ** 2 + s.sd[:, 3] ** 2)
    for what, names, table in (("photo", s.frames, "frames"), ("mark", s.labels, "truth")):
        most = np.sqrt(2 * np.log(max(len(set(names)), 1) / BY_CHANCE))
        far = (
            (size > SINGLE * float(np.median(size[good]))) & (size > SINGLE_EXPECTED) & (angle > most * least)
        )
        off = _off(far, names, good)
        if not off or len(off) > max(1, len(set(names)) // 5):
            continue
        listed = words.joined(
            [
                f"{name!r} ({words.number(float(np.degrees(angle)))} deg)"
                for name, angle in _angles(m, names, off)[:5]
            ],
            "and",
        )
        many = len(off) > 1
        yield Finding(
            "warning",
            table,
            "frame_id" if what == "photo" else "target_id",
            f"{'some' if many else 'one'} {what}{'s' if many else ''} off while the others fit, with "
            f"nav/{s.source}: {listed}",
            "check "
            f"{'pose, time and name' if what == 'photo' else 'place and name'}, "
            f"or leave {'them' if many else 'it'} out",
            (f"one {what} off",),
        )


def _angles(m: Missed, names: NDArray[np.object_], off: list[str]) -> list[tuple[str, float]]:
    size = np.linalg.norm(m.turn, axis=1)
    return [(name, float(np.nanmedian(size[names == name]))) for name in off]


def _off(far: NDArray[np.bool_], names: NDArray[np.object_], good: NDArray[np.bool_]) -> list[str]:
    """Those whose points are for the most part far, where so many of them are hardly together by chance.

    Far ones are everywhere: wrong clicks, and detections of what is no known point.
    """
    rows = {str(name): (names == name) & good for name in dict.fromkeys(names) if name != ""}
    rows = {name: of for name, of in rows.items() if of.sum() >= SINGLE_POINTS}
    # More than half of them: one wrong click is not a wrong photo.
    off = [name for name, of in rows.items() if far[of].mean() > 0.5]
    others = good & ~np.isin(names.astype(str), off)
    # As if there had been half a far one more, so that none seen is not none ever.
    share = (far[others].sum() + 0.5) / (others.sum() + 1)
    by_chance = {
        name: len(rows) * float(bdtrc(far[rows[name]].sum() - 1, rows[name].sum(), share)) for name in off
    }
    return [name for name in off if by_chance[name] < BY_CHANCE]
