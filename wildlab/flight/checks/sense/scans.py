"""Positions and bearings that other sensors saw against the truth: how often something is seen where a target
is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.places import LENGTHS, place_mistakes
from wildlab.flight.checks.sense.trial import ALIKE, Misfit, Mistake, explain
from wildlab.flight.clocks import frame_times, poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, wrap

#: A detection is of a target within this of it: so far (m) and a share of the distance, or this angle (rad).
NEAR_M, NEAR_SHARE, NEAR_RAD = 8.0, 0.02, np.radians(2.0)
#: Detections looked at of one source, and the fewest that say anything.
MOST, ENOUGH = 600, 40
#: Among clutter and shores, this share of what a sensor sees is usually a target; below that one, none is.
USUAL, NONE = 0.25, 0.01
#: Clocks and zones that are tried, s.
CLOCKS = (*np.arange(-75.0, 76.0, 1.5), -3600.0, 3600.0, -7200.0, 7200.0)


@dataclass(frozen=True)
class Scan:
    """What one source saw: places (N, 3) in n or azimuths (N,), from where (N, 3), and the targets (M, N, 3);
    targets and own place at other times; and where the bow pointed, (N,) rad from north towards east."""

    source: str
    places: Array | None
    azimuth: Array | None
    own: Array
    targets: Array
    at: Callable[[float], tuple[Array, Array]]
    heading: Array


def scans_of(flight: Flight) -> list[Scan]:
    """The sources of positions and bearings, with enough detections each."""
    detections, frames, truth = flight.detections, flight.frames, flight.truth
    if detections is None or frames is None or truth is None or not len(truth) or not flight.nav:
        return []
    if frames["frame_id"].duplicated().any():
        return []
    # Positions for the same pixels are answers of another program, and judged with them.
    if (detections["kind"] == "pixel").any():
        return []
    found = []
    nav = next(iter(flight.nav.values()))
    for (source, kind), rows in detections.groupby(["source", "kind"], sort=False):
        if kind not in ("position", "bearing", "range-bearing") or len(rows) < ENOUGH:
            continue
        rows = rows.iloc[np.unique(np.linspace(0, len(rows) - 1, MOST).astype(int))]
        frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(rows["frame_id"]))
        rows, frame = rows[frame >= 0], frame[frame >= 0]
        try:
            times = frame_times(flight)[frame]
            ids = rows["frame_id"]

            def at(shift: float, times: Array = times, ids: pd.Series = ids) -> tuple[Array, Array]:
                own, _, _ = poses_at(nav, times, ids)
                offset = flight.manifest.clocks.truth_offset_s
                return own, truth_at(truth, times + shift, offset_s=offset)[1]

            own, targets = at(0.0)
            R = poses_at(nav, times, ids)[1]
        except (WildlabError, ValueError):  # said by the checks of times
            continue
        if len(rows) < ENOUGH:
            continue
        position = kind == "position"
        found.append(
            Scan(
                str(source),
                rows[["north_m", "east_m", "down_m"]].to_numpy(float) if position else None,
                None if position else rows["azimuth_rad"].to_numpy(float),
                own,
                targets,
                at,
                np.arctan2(R[:, 1, 0], R[:, 0, 0]),
            )
        )
    return found


def hits(s: Scan) -> Array:
    """Whether each detection is where a target is, (N,), 0 or 1."""
    away = s.targets - s.own
    distance = np.hypot(away[..., 0], away[..., 1])
    with np.errstate(invalid="ignore"):
        if s.places is not None:
            off = np.hypot(*np.moveaxis((s.targets - s.places)[..., :2], -1, 0))
            near = off < NEAR_M + NEAR_SHARE * distance
        else:
            off = np.abs(wrap(s.azimuth - np.arctan2(away[..., 1], away[..., 0])))
            near = off < NEAR_RAD
    return np.asarray(near.any(axis=0), float)


def misfit(scans: tuple[Scan, ...]) -> Misfit:
    """The usual share of hits over the one there is, (2, 3), the mean of all sources; both rows alike."""
    result = np.zeros(3)
    for s in scans:
        hit = hits(s)
        half = np.arange(len(hit)) // 10 % 2 == 0
        shares = [float(hit[rows].mean()) for rows in (half | True, half, ~half)]
        result += np.log(np.maximum(shares, NONE)) / len(scans)
    return USUAL * np.tile(np.exp(-result), (2, 1))


def scans(flight: Flight) -> Iterator[Finding]:
    """Other sensors against the truth: what concerns all of them first, then each."""
    given = tuple(scans_of(flight))
    if not given:
        return
    named = explain(misfit, given, common_mistakes(flight))
    of_each = [explain(misfit, (one,), source_mistakes(one)) for one in given]
    if named:
        # What concerns all is simpler; but it is not it where the sources' own mistakes explain far more.
        undone = tuple(own[0].undone[0] if own else one for one, own in zip(given, of_each, strict=True))
        if misfit(named[0].undone)[0, 0] > ALIKE * misfit(undone)[0, 0]:
            named = []
    if named:
        share, then = (100 * USUAL / misfit(x)[0, 0] for x in (given, named[0].undone))
        yield Finding(
            "problem",
            "truth",
            "",
            f"{share:.0f} % of the detections are where a target is: "
            f"{' or '.join(one.mistake.said for one in named)}; then it is {then:.0f} %",
            words.fixes([one.mistake.write for one in named]),
            tuple(one.mistake.cause for one in named),
        )
        return
    for one, own in zip(given, of_each, strict=True):
        if not own:
            continue
        share, then = (100 * USUAL / misfit(x)[0, 0] for x in ((one,), own[0].undone))
        yield Finding(
            "problem",
            "detections",
            "north_m" if one.places is not None else "azimuth_rad",
            f"{share:.0f} % of the detections of {one.source} are where a target is: "
            f"{' or '.join(way.mistake.said for way in own)}; then it is {then:.0f} %",
            words.fixes([way.mistake.write for way in own]),
            tuple(way.mistake.cause for way in own),
        )


Scans = tuple[Scan, ...]


def common_mistakes(flight: Flight) -> Iterator[Mistake[Scans]]:
    """Mistakes about the truth, about the own place, and about clocks."""
    origin = flight.manifest.origin_tuple()

    def of(which: str, undo: Callable[[Array], Array | None]) -> Callable[[Scans], Scans | None]:
        def change(given: Scans) -> Scans | None:
            done: list[Scan] = []
            for s in given:
                moved = undo(s.targets if which == "targets" else s.own)
                if moved is None:
                    return None
                done.append(replace(s, targets=moved) if which == "targets" else replace(s, own=moved))
            return tuple(done)

        return change

    for part, which in (("truth", "targets"), (f"poses.{next(iter(flight.nav))}", "own")):
        for place in place_mistakes(part, origin):
            if place.about == "level":
                yield Mistake(
                    f"{part}: {place.cause}", f"{part}: {place.said}", place.write, of(which, place.undo)
                )
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


def _later(s: Scan, by: float) -> Scan:
    own, targets = s.at(by)
    return replace(s, own=own, targets=targets)


def source_mistakes(one: Scan) -> Iterator[Mistake[Scans]]:
    """Mistakes about the positions or the bearings of one source."""
    part = f"detections of {one.source}"

    def each(change: Callable[[Scan], Scan]) -> Callable[[Scans], Scans]:
        return lambda given: tuple(change(s) for s in given)

    if one.places is not None:
        for cause, key, matrix in (
            ("north and east are exchanged", "exchange north and east", [[0, 1, 0], [1, 0, 0], [0, 0, 1]]),
            ("north has the wrong sign", words.negate("north", part), np.diag([-1, 1, 1])),
            ("east has the wrong sign", words.negate("east", part), np.diag([1, -1, 1])),
            (
                "north and east have the wrong sign",
                words.negate("north and east", part),
                np.diag([-1, -1, 1]),
            ),
            *(
                (
                    f"it is in {unit}, and the recipe says m",
                    words.unit("north and east", part, unit),
                    k * np.eye(3),
                )
                for unit, k in LENGTHS.items()
            ),
            *(
                (
                    f"it is in m, and the recipe says {unit}",
                    words.unit("north and east", part, "m"),
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
    for cause, write, bearing in (
        ("the bearing counts to the left (wrong sign)", words.negate("azimuth", part), lambda a: -a),
        ("the bearing is off by 90 deg: it counts from east", "plus 90 deg", lambda a: a + np.pi / 2),
        ("the bearing is off by -90 deg: it counts from west", "minus 90 deg", lambda a: a - np.pi / 2),
        ("the bearing is off by 180 deg: it counts from south", "plus 180 deg", lambda a: a + np.pi),
        ("the bearing counts to the left from east", "90 deg minus the bearing", lambda a: np.pi / 2 - a),
        ("the bearing counts to the left from west", "-90 deg minus it", lambda a: -np.pi / 2 - a),
        ("the bearing counts to the left from south", "180 deg minus it", lambda a: np.pi - a),
        (
            "the bearing is in degrees, and the recipe says rad",
            words.unit("azimuth", part, "deg"),
            np.radians,
        ),
        (
            "the bearing is in radians, and the recipe says deg",
            words.unit("azimuth", part, "rad"),
            np.degrees,
        ),
    ):
        yield Mistake(
            f"{one.source}: {cause}",
            cause,
            f"{write} for the azimuth of the {part}, from true north towards east",
            each(lambda s, b=bearing: replace(s, azimuth=b(s.azimuth))),  # type: ignore[misc]
        )
    yield Mistake(
        f"{one.source}: the bearing counts from the bow",
        "the bearing counts from the bow, and the recipe says from north",
        f'`counts_from = "bow"` for the {part}',
        each(lambda s: replace(s, azimuth=s.azimuth + s.heading)),  # type: ignore[operator]
    )


def share_of(s: Scan) -> float:
    """Share of the detections of a source that are where a target is."""
    return float(hits(s).mean())
