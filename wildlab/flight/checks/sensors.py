"""What other sensors than the camera saw: in whose looks, and whether it is where the truth is.

Positions and bearings against the truth are judged by how often something is seen where a target is. Every
look counts alike, so that one full of clutter says no more than the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import (
    ALIKE,
    FAR_BETTER_ALONE,
    Finding,
    Level,
    Misfit,
    Mistake,
    blame,
    change_by,
    explain,
    far_better,
    mistake,
    one_row,
    place_mistakes,
    rows_of,
    thin,
    undo_in,
)
from wildlab.flight.clocks import frame_times, poses_at, truth_at
from wildlab.flight.manifest import Settings, absent_sensors
from wildlab.flight.schema import POSITION
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, wrap
from wildlab.names import listed

#: A detection is of a target within this of it: so far (m) and a share of the distance, or this angle (rad).
NEAR_M, NEAR_SHARE, NEAR_RAD = 8.0, 0.02, np.radians(2.0)
#: Detections looked at of one source, as many of every look, and the fewest that say anything.
MOST, ENOUGH = 600, 40
#: Among clutter and shores, this share of what a sensor sees is usually a target; below that one, none is.
USUAL, NONE = 0.25, 0.01
#: Clocks and zones that are tried, s.
CLOCKS = (*np.arange(-75.0, 76.0, 1.5), -3600.0, 3600.0, -7200.0, 7200.0)
#: Turns that are looked for, deg: what declination, compasses and mountings are off by. At either end it is
#: no constant of some degrees, but the flank of something else.
TURNS = np.arange(-20.0, 20.5, 0.5)
#: So many standard deviations of what looks differ by, another explanation has to be better by.
CLEARLY = 2.0
#: What is seen this near (m) to a target may be of it; a constant offset is at least so large, and holds for
#: at least this share of it and so many detections.
AROUND_M, OFF_M, SHARE, ENOUGH_AROUND = 60.0, 15.0, 0.4, 30


def looks_of_others(frames: pd.DataFrame, detections: pd.DataFrame) -> pd.DataFrame:
    """The detections whose frame names another sensor than their source does.

    Parameters
    ----------
    frames, detections
        As in a flight.

    Returns
    -------
    DataFrame
        Those rows of the detections, with ``sensor``, that of their frame; "" where it names none. Without
        rows where the frames name no sensors at all, and so each source is one.
    """
    if "sensor" not in frames:
        return detections.iloc[:0].assign(sensor="")
    of_frame = frames.drop_duplicates("frame_id").set_index("frame_id")["sensor"]
    sensor = detections["frame_id"].map(of_frame)
    # A frame that is in no table is another fault, said elsewhere.
    return detections.assign(sensor=sensor)[sensor.notna() & (sensor != detections["source"])]


def sensors(flight: Flight) -> Iterator[Finding]:
    """Detections that a sensor made in the looks of another one, sources that are no sensor's, and sensors of
    ``[sensors]`` that there are not."""
    frames, detections = flight.frames, flight.detections
    if frames is None or detections is None:
        return
    named = {name for name in frames["sensor"] if name} if "sensor" in frames else set(detections["source"])
    stated = Settings(sensors=flight.manifest.sensors)
    for name, meant in absent_sensors(stated, named).items() if named else ():
        yield Finding("warning", "flight.toml", f"sensors.{name}", "sensor-absent", {"meant": meant})
    for (source, sensor), rows in looks_of_others(frames, detections).groupby(
        ["source", "sensor"], sort=True
    ):
        facts = {
            "n": len(rows),
            "of": int((detections["source"] == source).sum()),
            "source": source,
            "sensor": sensor,
            "first": rows.iloc[0]["frame_id"],
            "names": bool(sensor),
        }
        if source in named:
            yield Finding("problem", "detections", "source", "source-contradicts-sensor", facts)
        elif sensor:
            level: Level = "note" if (detections["source"] == sensor).any() else "warning"
            yield Finding(level, "detections", "source", "source-is-no-sensor", facts)


# -- what sensors saw against the truth


@dataclass(frozen=True)
class SourceLooks:
    """What one source saw: places (N, 3) in n or azimuths (N,), from where (N, 3), and the targets (M, N, 3);
    where the bow pointed, (N,) rad from north towards east; the number of the look (N,), counted from 0
    without gaps; own place, targets and bow had the sensor's stamps and then the truth been later by so much;
    and how far away (N,) m, where it says so beside the azimuth."""

    source: str
    places: Array | None
    azimuth: Array | None
    own: Array
    targets: Array
    heading: Array
    look: NDArray[np.intp]
    at: Callable[[float, float], tuple[Array, Array, Array]]
    distance: Array | None = None

    @property
    def seen_at(self) -> Array:
        """Towards where each detection is, (N,) rad from true north towards east."""
        if self.azimuth is not None:
            return self.azimuth
        away = np.asarray(self.places) - self.own
        return np.arctan2(away[:, 1], away[:, 0])

    def turned(self, by_deg: float) -> SourceLooks:
        """The same looks with all bearings, or all places about the own one, turned clockwise."""
        by = np.radians(by_deg)
        if self.azimuth is not None:
            return replace(self, azimuth=self.azimuth + by)
        c, n = np.cos(by), np.sin(by)
        about = (np.asarray(self.places) - self.own) @ np.array([[c, n, 0.0], [-n, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, places=self.own + about)

    def with_stamps(self, by: float) -> SourceLooks:
        """The same looks had the sensor's stamps been later: what it placed about itself goes along."""
        own, targets, heading = self.at(by, 0.0)
        places = None if self.places is None else self.places + (own - self.own)
        return replace(self, own=own, targets=targets, heading=heading, places=places)


Scans = tuple[SourceLooks, ...]


def scans_of(flight: Flight) -> Scans:
    """The sources of positions and bearings, with enough detections each."""
    detections, frames, truth = flight.detections, flight.frames, flight.truth
    if detections is None or frames is None or truth is None or not len(truth) or not flight.nav:
        return ()
    # Positions for the same pixels are answers of another program, and judged with them.
    if frames["frame_id"].duplicated().any() or (detections["kind"] == "pixel").any():
        return ()
    found = []
    nav, offset = next(iter(flight.nav.values())), flight.manifest.clocks.truth_offset_s
    for (source, kind), rows in detections.groupby(["source", "kind"], sort=False):
        if kind not in ("position", "bearing", "range-bearing") or len(rows) < ENOUGH:
            continue
        rows = _some_of_each_look(rows)
        frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(rows["frame_id"]))
        rows, frame = rows[frame >= 0], frame[frame >= 0]
        times = frame_times(flight)[frame] + _clock(flight, str(source))

        def at(
            shift: float, of_truth: float, times: Array = times, ids: pd.Series = rows["frame_id"]
        ) -> tuple[Array, Array, Array]:
            own, R, _ = poses_at(nav, times + shift, ids)
            targets = truth_at(truth, times + shift + of_truth, offset_s=offset)[1]
            return own, targets, np.arctan2(R[:, 1, 0], R[:, 0, 0])

        try:
            own, targets, heading = at(0.0, 0.0)
        except (WildlabError, ValueError):  # said by the checks of times
            continue
        if len(rows) < ENOUGH:
            continue
        position = kind == "position"
        found.append(
            SourceLooks(
                str(source),
                rows[POSITION].to_numpy(float) if position else None,
                None if position else rows["azimuth_rad"].to_numpy(float),
                own,
                targets,
                heading,
                np.unique(frame, return_inverse=True)[1],
                at,
                rows["range_m"].to_numpy(float) if kind == "range-bearing" else None,
            )
        )
    return tuple(found)


def _clock(flight: Flight, source: str) -> float:
    """What is stated of the clock of a sensor, s."""
    stated = flight.manifest.sensors.get(source)
    return 0.0 if stated is None else stated.clock_offset_s


def _some_of_each_look(rows: pd.DataFrame) -> pd.DataFrame:
    """At most `MOST` detections, as many of every look where there are, drawn with a fixed seed."""
    looks = rows["frame_id"].drop_duplicates().to_numpy()
    looks = looks[thin(len(looks), MOST)]
    rows = rows.reset_index(drop=True)
    mixed = rows[rows["frame_id"].isin(looks)].sample(frac=1.0, random_state=0)
    return mixed[mixed.groupby("frame_id").cumcount() < max(1, MOST // len(looks))].sort_index()


def hits(s: SourceLooks) -> Array:
    """Whether each detection is where a target is, (N,), 0 or 1."""
    away = s.targets - s.own
    distance = np.hypot(away[..., 0], away[..., 1])
    with np.errstate(invalid="ignore"):
        if s.places is not None:
            off = np.hypot(*np.moveaxis((s.targets - s.places)[..., :2], -1, 0))
            near = off < NEAR_M + NEAR_SHARE * distance
        else:
            near = np.abs(wrap(s.azimuth - np.arctan2(away[..., 1], away[..., 0]))) < NEAR_RAD
            if s.distance is not None:
                apart = np.linalg.norm(away, axis=-1)
                near &= np.abs(apart - s.distance) < NEAR_M + NEAR_SHARE * apart
    return np.asarray(near.any(axis=0), float)


def shares(s: SourceLooks) -> Array:
    """Of every look, the share of its detections that are where a target is, (L,)."""
    return np.bincount(s.look, hits(s)) / np.bincount(s.look)


def misfit(scans: Scans) -> Misfit:
    """The usual share of hits over the one there is, (2, 3), the mean of all sources; both rows alike.

    The share is the mean of those of all looks; halves are every other look, NaN where there is one alone.
    """
    result = np.zeros(3)
    for s in scans:
        share = shares(s)
        halves = (share[::2], share[1::2]) if len(share) > 1 else (share * np.nan, share * np.nan)
        means = [part.mean() for part in (share, *halves)]
        result += np.log(np.maximum(means, NONE)) / len(scans)
    return USUAL * np.tile(np.exp(-result), (2, 1))


def _percent(scans: Scans) -> float:
    return float(100 * USUAL / misfit(scans)[0, 0])


def scans(flight: Flight) -> Iterator[Finding]:
    """Other sensors against the truth: what concerns all of them first, then each."""
    given = scans_of(flight)
    if not given:
        return
    named = explain(misfit, given, common_mistakes(flight))
    of_each = [explain(misfit, (one,), source_mistakes(one, _clock(flight, one.source))) for one in given]
    # Each source as its own mistakes leave it, where it has any.
    undone = tuple(own[0].undone[0] if own else one for one, own in zip(given, of_each, strict=True))
    turn = best_turn(given, [*(one.undone for one in named), *([undone] if any(of_each) else [])])
    if turn is not None:
        yield _turned_finding(given, turn)
        return
    # What concerns all is simpler; but it is not it where the sources' own mistakes explain far more.
    if named and misfit(named[0].undone)[0, 0] <= ALIKE * misfit(undone)[0, 0]:
        facts = {"share": _percent(given), "then": _percent(named[0].undone)}
        yield blame("problem", "truth", "", "scans-explained", named, facts, [])
        return
    for one, own in zip(given, of_each, strict=True):
        turn = best_turn((one,), [way.undone for way in own])
        if turn is not None:
            yield _turned_finding((one,), turn)
        elif own:
            then = {"share": _percent((one,)), "then": _percent(own[0].undone), "source": one.source}
            field = "north_m" if one.places is not None else "azimuth_rad"
            yield blame("problem", "detections", field, "source-explained", own, then, [])


def common_mistakes(flight: Flight) -> Iterator[Mistake[Scans]]:
    """Mistakes about the truth, about the own place, and about clocks."""
    for part, field in (("truth", "targets"), (f"poses.{next(iter(flight.nav))}", "own")):
        for place in place_mistakes(part, flight.manifest.origin_tuple()):
            if place.about != "height":
                yield place.within(part, _each(undo_in(place.undo, field)))
    for seconds in CLOCKS:
        if seconds:
            hours = abs(seconds) >= 3600

            def later(s: SourceLooks, by: float = seconds) -> SourceLooks:
                own, targets, _ = s.at(0.0, by)
                return replace(s, own=own, targets=targets)

            yield mistake(
                one_row("truth-clock"),
                _each(later),
                fitted=True,
                amount=f"{abs(seconds) / 3600:g} h" if hours else f"{abs(seconds):g} s",
                by=seconds,
                hours=hours,
                offset=flight.manifest.clocks.truth_offset_s - seconds,
            )


def _each(change: Callable[[SourceLooks], SourceLooks | None]) -> Callable[[Scans], Scans | None]:
    def undo(given: Scans) -> Scans | None:
        done = tuple(one for one in map(change, given) if one is not None)
        return done if len(done) == len(given) else None

    return undo


def source_mistakes(one: SourceLooks, offset_s: float = 0.0) -> Iterator[Mistake[Scans]]:
    """Mistakes about the positions, the bearings or the clock of one source.

    Parameters
    ----------
    one
        What it saw, with the offset of its clock as it is stated.
    offset_s
        That offset.
    """
    # The clock of the sensor alone: what it saw stays, and all else is where it was at other times.
    by = min(CLOCKS, key=lambda t: misfit((one.with_stamps(t),))[0, 0])
    if by != 0:
        undo = _each(lambda s: s.with_stamps(by))
        row = one_row("sensor-clock")
        yield mistake(row, undo, fitted=True, source=one.source, by=by, offset=offset_s + by)
    groups = {"seen-places": "places", "range": "distance", "azimuth": "azimuth"}
    for group, field in groups.items():
        if getattr(one, field) is not None:
            for row in rows_of(group):
                change = change_by(row, np.radians(1.0))
                undo = _each(undo_in(change, field) if "bow" not in row else _from_bow(change, row["bow"]))
                yield mistake(row, undo, source=one.source)


def _from_bow(change: Callable[[Array], Array | None], times: float) -> Callable[[SourceLooks], SourceLooks]:
    return lambda s: replace(s, azimuth=change(np.asarray(s.azimuth)) + times * s.heading)  # type: ignore[operator]


# -- a constant turn of all that a sensor sees, as of a compass or a mounting that is off by some degrees


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

    def turned(by: float) -> Scans:
        return tuple(s.turned(by) for s in given)

    # All within the gate of a bearing fit alike: the middle of these.
    k = int(np.argmin([misfit(turned(by))[0, 0] for by in TURNS]))
    by = float(TURNS[k])
    if k in (0, len(TURNS) - 1):
        return None
    for _ in range(3):
        by += float(np.degrees(np.median(np.concatenate([_off(s) for s in turned(by)]))))
    done = turned(by)
    if not far_better(before, misfit(done), fitted=True):
        return None
    return None if any(_clearly_more(other, done) for other in rivals) else by


def _off(s: SourceLooks) -> Array:
    """By how much (rad, clockwise) each detection that is where a target is would have to be turned."""
    good = hits(s) > 0
    away = (s.targets - s.own)[:, good]
    off = wrap(np.arctan2(away[..., 1], away[..., 0]) - s.seen_at[good])
    off = np.where(np.isfinite(off), off, np.inf)
    return np.asarray(np.take_along_axis(off, np.abs(off).argmin(axis=0)[None], axis=0)[0])


def _clearly_more(one: Scans, other: Scans) -> bool:
    """Whether more of what is seen is at a target in `one`, by more than looks differ by chance."""
    more = np.concatenate([shares(a) - shares(b) for a, b in zip(one, other, strict=True)])
    return bool(more.mean() > CLEARLY * more.std() / np.sqrt(len(more)))


def _turned_finding(given: Scans, turn_deg: float) -> Finding:
    first = given[0]
    facts = {
        "share": _percent(given),
        "then": _percent(tuple(s.turned(turn_deg) for s in given)),
        "turn": turn_deg,
        "heading": -turn_deg,
        "names": listed([s.source for s in given]),
        "first": first.source,
    }
    field = "azimuth_rad" if first.azimuth is not None else "north_m"
    return Finding("warning", "detections", field, "sensors-turned", facts, ("heading off",))


# -- one target whose truth is off: other sensors see it beside where it is said to be


def offset_of(away: Array) -> tuple[Array, float, float]:
    """Where most of what is seen around a target lies: the offset (2,) m, and the shares there and at it.

    Parameters
    ----------
    away
        (N, 2): detections less the target, m, all of them near.

    Returns
    -------
    The offset, the share of detections near it, and the share near the target itself.

    Examples
    --------
    >>> offset, there, here = offset_of(np.array([[25.0, 0.0]] * 40 + [[-30.0, 9.0]] * 10))
    >>> print(offset, there, here)
    [25.  0.] 0.8 0.0
    """
    near = np.linalg.norm(away[:, None] - away[None], axis=2) < NEAR_M
    centre = away[int(np.argmax(near.sum(axis=1)))]
    for _ in range(3):
        centre = away[np.linalg.norm(away - centre, axis=1) < NEAR_M].mean(axis=0)
    there = float(np.mean(np.linalg.norm(away - centre, axis=1) < NEAR_M))
    return centre, there, float(np.mean(np.linalg.norm(away, axis=1) < NEAR_M))


def targets(flight: Flight) -> Iterator[Finding]:
    """Every target against the sources of positions."""
    scans = [one for one in scans_of(flight) if one.places is not None]
    if flight.truth is None:
        return
    for k, name in enumerate(dict.fromkeys(flight.truth["target_id"])):
        for scan in scans:
            level = (scan.targets - np.asarray(scan.places))[..., :2]
            others = np.linalg.norm(level, axis=2)
            with np.errstate(invalid="ignore"):
                nearest = np.nanmin(np.where(np.isfinite(others), others, np.inf), axis=0)
                own = (nearest == others[k]) & (others[k] < AROUND_M)
            if own.sum() < ENOUGH_AROUND:
                continue
            offset, there, here = offset_of(-level[k, own])
            size = np.hypot(*offset)
            if size > OFF_M and there > SHARE and there > FAR_BETTER_ALONE * max(here, 0.01):
                seen = {"there": 100 * there, "here": 100 * here, "size": size}
                facts = {"source": scan.source, "name": name, **seen}
                yield Finding("warning", "truth", "target_id", "target-beside", facts, ("one mark off",))
                break
