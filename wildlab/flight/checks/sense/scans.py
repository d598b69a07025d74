"""What is wrong where other sensors and the truth disagree: usual mistakes about both, and clocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.looks import USUAL, Scans, SourceLooks, misfit, scans_of
from wildlab.flight.checks.sense.places import LENGTHS, place_mistakes
from wildlab.flight.checks.sense.trial import ALIKE, Mistake, explain
from wildlab.flight.checks.sense.turned import best_turn, turned_finding
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: Clocks and zones that are tried, s.
CLOCKS = (*np.arange(-75.0, 76.0, 1.5), -3600.0, 3600.0, -7200.0, 7200.0)


def scans(flight: Flight) -> Iterator[Finding]:
    """Other sensors against the truth: what concerns all of them first, then each."""
    given = tuple(scans_of(flight))
    if not given:
        return
    named = explain(misfit, given, common_mistakes(flight))
    of_each = [explain(misfit, (one,), source_mistakes(one, _offset(flight, one))) for one in given]
    # Each source as its own mistakes leave it, where it has any.
    undone = tuple(own[0].undone[0] if own else one for one, own in zip(given, of_each, strict=True))
    turn = best_turn(given, [*(one.undone for one in named), *([undone] if any(of_each) else [])])
    if turn is not None:
        yield turned_finding(given, turn)
        return
    # What concerns all is simpler; but it is not it where the sources' own mistakes explain far more.
    if named and misfit(named[0].undone)[0, 0] > ALIKE * misfit(undone)[0, 0]:
        named = []
    if named:
        share, then = (100 * USUAL / misfit(x)[0, 0] for x in (given, named[0].undone))
        yield Finding(
            "problem",
            "truth",
            "",
            f"{share:.0f} % of the detections of a look are where a target is (mean of all looks): "
            f"{' or '.join(one.mistake.said for one in named)}; then it is {then:.0f} %",
            words.fixes([one.mistake.write for one in named]),
            tuple(one.mistake.cause for one in named),
        )
        return
    for one, own in zip(given, of_each, strict=True):
        turn = best_turn((one,), [way.undone for way in own])
        if turn is not None:
            yield turned_finding((one,), turn)
            continue
        if not own:
            continue
        share, then = (100 * USUAL / misfit(x)[0, 0] for x in ((one,), own[0].undone))
        yield Finding(
            "problem",
            "detections",
            "north_m" if one.places is not None else "azimuth_rad",
            f"{share:.0f} % of the detections of {one.source} in a look are where a target is (mean of all "
            f"looks): {' or '.join(way.mistake.said for way in own)}; then it is {then:.0f} %",
            words.fixes([way.mistake.write for way in own]),
            tuple(way.mistake.cause for way in own),
        )


def common_mistakes(flight: Flight) -> Iterator[Mistake[Scans]]:
    """Mistakes about the truth, about the own place, and about clocks."""
    origin = flight.manifest.origin_tuple()

    def of(which: str, undo: Callable[[Array], Array | None]) -> Callable[[Scans], Scans | None]:
        def change(given: Scans) -> Scans | None:
            done: list[SourceLooks] = []
            for s in given:
                moved = undo(s.targets if which == "targets" else s.own)
                if moved is None:
                    return None
                done.append(replace(s, targets=moved) if which == "targets" else replace(s, own=moved))
            return tuple(done)

        return change

    for part, which in (("truth", "targets"), (f"poses.{next(iter(flight.nav))}", "own")):
        for place in place_mistakes(part, origin):
            if place.about != "height":
                yield place.within(part, of(which, place.undo))
    for seconds in CLOCKS:
        if seconds == 0:
            continue
        hours = abs(seconds) >= 3600
        amount = f"{abs(seconds) / 3600:g} h" if hours else f"{abs(seconds):g} s"
        yield Mistake(
            f"clock of the truth ({amount})",
            f"the truth is {amount} {'late' if seconds > 0 else 'early'} against the detections",
            "the `zone` of its stamps in [truth.time]"
            if hours
            else f"`truth_offset_s = {flight.manifest.clocks.truth_offset_s - seconds:g}` in [clocks]",
            lambda given, t=seconds: tuple(_later(s, t) for s in given),  # type: ignore[misc]
            fitted=True,
        )


def _later(s: SourceLooks, by: float) -> SourceLooks:
    own, targets = s.at(by)
    return replace(s, own=own, targets=targets)


def _offset(flight: Flight, one: SourceLooks) -> float:
    """What is stated of its clock, s."""
    stated = flight.manifest.sensors.get(one.source)
    return 0.0 if stated is None else stated.clock_offset_s


def source_mistakes(one: SourceLooks, offset_s: float = 0.0) -> Iterator[Mistake[Scans]]:
    """Mistakes about the positions, the bearings or the clock of one source.

    Parameters
    ----------
    one
        What it saw, with the offset of its clock as it is stated.
    offset_s
        That offset.
    """
    yield from _clock_mistakes(one, offset_s)
    block = f'the [[detections]] with source = "{one.source}"'

    def each(change: Callable[[SourceLooks], SourceLooks]) -> Callable[[Scans], Scans]:
        return lambda given: tuple(change(s) for s in given)

    if one.places is not None:
        part, of = "detections.position", f" of {block}"
        for cause, key, matrix in (
            (
                "north and east are exchanged",
                words.exchange("north", "east", part) + of,
                [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
            ),
            ("north has the wrong sign", words.negate("north", part) + of, np.diag([-1, 1, 1])),
            ("east has the wrong sign", words.negate("east", part) + of, np.diag([1, -1, 1])),
            (
                "north and east have the wrong sign",
                words.negate("north and east", part) + of,
                np.diag([-1, -1, 1]),
            ),
            *(
                (
                    f"it is in {unit}, and was read as m",
                    words.unit("north and east", part, unit) + of,
                    k * np.eye(3),
                )
                for unit, k in LENGTHS.items()
            ),
            *(
                (
                    f"it is in m, and was read as {unit}",
                    words.unit("north and east", part, "m") + of,
                    np.eye(3) / k,
                )
                for unit, k in LENGTHS.items()
            ),
        ):
            yield Mistake(
                f"{one.source}: {cause}",
                cause,
                key,
                each(lambda s, M=np.array(matrix, float): replace(s, places=s.places @ M.T)),  # type: ignore[misc]  # noqa: B008
            )
        return
    if one.distance is not None:
        for unit, k in LENGTHS.items():
            for factor, cause, write in (
                (k, f"the range is in {unit}, and was read as m", unit),
                (1 / k, f"the range is in m, and was read as {unit}", "m"),
            ):
                yield Mistake(
                    f"{one.source}: {cause}",
                    cause,
                    f'`unit = "{write}"` of `range` in {block}',
                    each(lambda s, f=factor: replace(s, distance=f * s.distance)),  # type: ignore[misc]
                )
    azimuth = f"`azimuth` in {block}"
    towards = "it counts from true north towards east"
    for cause, write, bearing in (
        (
            "the bearing counts to the left (wrong sign)",
            f"turn `negate` of {azimuth}: {towards}",
            lambda a: -a,
        ),
        (
            "the bearing is off by 90 deg: it counts from east",
            f"the bearing plus 90 deg as {azimuth}: {towards}",
            lambda a: a + np.pi / 2,
        ),
        (
            "the bearing is off by -90 deg: it counts from west",
            f"the bearing minus 90 deg as {azimuth}: {towards}",
            lambda a: a - np.pi / 2,
        ),
        (
            "the bearing is off by 180 deg: it counts from south",
            f"the bearing plus 180 deg as {azimuth}: {towards}",
            lambda a: a + np.pi,
        ),
        (
            "the bearing counts to the left from east",
            f"90 deg minus the bearing as {azimuth}: {towards}",
            lambda a: np.pi / 2 - a,
        ),
        (
            "the bearing counts to the left from west",
            f"-90 deg minus the bearing as {azimuth}: {towards}",
            lambda a: -np.pi / 2 - a,
        ),
        (
            "the bearing counts to the left from south",
            f"180 deg minus the bearing as {azimuth}: {towards}",
            lambda a: np.pi - a,
        ),
        (
            "the bearing is in degrees, and was read as radians",
            f'`unit = "deg"` of {azimuth}',
            np.radians,
        ),
        (
            "the bearing is in radians, and was read as degrees",
            f'`unit = "rad"` of {azimuth}',
            np.degrees,
        ),
    ):
        yield Mistake(
            f"{one.source}: {cause}",
            cause,
            write,
            each(lambda s, b=bearing: replace(s, azimuth=b(s.azimuth))),  # type: ignore[misc]
        )
    yield Mistake(
        f"{one.source}: the bearing from the bow counts to the left",
        "the bearing counts from the bow to the left (wrong sign)",
        f'turn `negate` of {azimuth}, with `counts_from = "bow"`',
        each(lambda s: replace(s, azimuth=2 * s.heading - s.azimuth)),  # type: ignore[operator]
    )
    yield Mistake(
        f"{one.source}: the bearing counts from the bow",
        "the bearing counts from the bow, and was taken to count from north",
        f'`counts_from = "bow"` in {block}',
        each(lambda s: replace(s, azimuth=s.azimuth + s.heading)),  # type: ignore[operator]
    )


def _clock_mistakes(one: SourceLooks, offset_s: float) -> Iterator[Mistake[Scans]]:
    """The clock of the sensor alone: what it saw stays, and all else is where it was at other times."""
    if one.stamped is None:
        return
    best = min(CLOCKS, key=lambda t: float(misfit((_stamped(one, t),))[0, 0]))
    if best != 0:
        yield Mistake(
            f"{one.source}: clock ({best:g} s)",
            f"its stamps are about {abs(best):g} s {'early' if best > 0 else 'late'}",
            f"`clock_offset_s = {offset_s + best:g}` in [sensors.{one.source}]",
            lambda given: tuple(_stamped(s, best) for s in given),
            fitted=True,
        )


def _stamped(s: SourceLooks, by: float) -> SourceLooks:
    if s.stamped is None:
        return s
    own, targets, heading = s.stamped(by)
    # What a sensor on board places, it places about itself.
    places = None if s.places is None else s.places + (own - s.own)
    return replace(s, own=own, targets=targets, heading=heading, places=places)
