"""Positions and bearings that other sensors saw against the truth: how often something is seen where a target
is. Every look counts alike, so that one full of clutter says no more than the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.checks.sense.trial import Misfit
from wildlab.flight.clocks import frame_times, poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, wrap

#: A detection is of a target within this of it: so far (m) and a share of the distance, or this angle (rad).
NEAR_M, NEAR_SHARE, NEAR_RAD = 8.0, 0.02, np.radians(2.0)
#: Detections looked at of one source, as many of every look, and the fewest that say anything.
MOST, ENOUGH = 600, 40
#: Among clutter and shores, this share of what a sensor sees is usually a target; below that one, none is.
USUAL, NONE = 0.25, 0.01


@dataclass(frozen=True)
class SourceLooks:
    """What one source saw: places (N, 3) in n or azimuths (N,), from where (N, 3), and the targets (M, N, 3);
    own place and targets had the truth been later by so much; where the bow pointed, (N,) rad from north
    towards east; the number of the look (N,), counted from 0 without gaps; own place, targets and bow had the
    sensor's stamps been later; and how far away (N,) m, where it says so beside the azimuth."""

    source: str
    places: Array | None
    azimuth: Array | None
    own: Array
    targets: Array
    at: Callable[[float], tuple[Array, Array]]
    heading: Array
    look: NDArray[np.intp]
    stamped: Callable[[float], tuple[Array, Array, Array]] | None = None
    distance: Array | None = None


def scans_of(flight: Flight) -> list[SourceLooks]:
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
        rows = _some_of_each_look(rows)
        frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(rows["frame_id"]))
        rows, frame = rows[frame >= 0], frame[frame >= 0]
        try:
            stated = flight.manifest.sensors.get(str(source))
            times = frame_times(flight)[frame] + (0.0 if stated is None else stated.clock_offset_s)
            ids = rows["frame_id"]

            def at(shift: float, times: Array = times, ids: pd.Series = ids) -> tuple[Array, Array]:
                own, _, _ = poses_at(nav, times, ids)
                offset = flight.manifest.clocks.truth_offset_s
                return own, truth_at(truth, times + shift, offset_s=offset)[1]

            def stamped(
                shift: float, times: Array = times, ids: pd.Series = ids
            ) -> tuple[Array, Array, Array]:
                own, R, _ = poses_at(nav, times + shift, ids)
                offset = flight.manifest.clocks.truth_offset_s
                targets = truth_at(truth, times + shift, offset_s=offset)[1]
                return own, targets, np.arctan2(R[:, 1, 0], R[:, 0, 0])

            own, targets = at(0.0)
            heading = stamped(0.0)[2]
        except (WildlabError, ValueError):  # said by the checks of times
            continue
        if len(rows) < ENOUGH:
            continue
        position = kind == "position"
        found.append(
            SourceLooks(
                str(source),
                rows[["north_m", "east_m", "down_m"]].to_numpy(float) if position else None,
                None if position else rows["azimuth_rad"].to_numpy(float),
                own,
                targets,
                at,
                heading,
                np.unique(frame, return_inverse=True)[1],
                stamped,
                rows["range_m"].to_numpy(float) if kind == "range-bearing" else None,
            )
        )
    return found


Scans = tuple[SourceLooks, ...]


def _some_of_each_look(rows: pd.DataFrame) -> pd.DataFrame:
    """At most `MOST` detections, as many of every look where there are, drawn with a fixed seed."""
    looks = rows["frame_id"].drop_duplicates().to_numpy()
    looks = looks[np.unique(np.linspace(0, len(looks) - 1, min(len(looks), MOST)).astype(int))]
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
            off = np.abs(wrap(s.azimuth - np.arctan2(away[..., 1], away[..., 0])))
            near = off < NEAR_RAD
            if s.distance is not None:
                apart = np.linalg.norm(away, axis=-1)
                near &= np.abs(apart - s.distance) < NEAR_M + NEAR_SHARE * apart
    return np.asarray(near.any(axis=0), float)


def shares(s: SourceLooks) -> Array:
    """Of every look, the share of its detections that are where a target is, (L,)."""
    return np.asarray(np.bincount(s.look, hits(s)) / np.bincount(s.look))


def misfit(scans: tuple[SourceLooks, ...]) -> Misfit:
    """The usual share of hits over the one there is, (2, 3), the mean of all sources; both rows alike.

    The share is the mean of those of all looks; halves are every other look, NaN where there is one alone.
    """
    result = np.zeros(3)
    for s in scans:
        share = shares(s)
        halves = (share[::2], share[1::2]) if len(share) > 1 else (share * np.nan, share * np.nan)
        means = [float(part.mean()) for part in (share, *halves)]
        result += np.log(np.maximum(means, NONE)) / len(scans)
    return USUAL * np.tile(np.exp(-result), (2, 1))


def seen_at(s: SourceLooks) -> Array:
    """Towards where each detection is, (N,) rad from true north towards east."""
    if s.azimuth is not None:
        return s.azimuth
    if s.places is None:
        raise ValueError("a source of neither places nor bearings")
    away = s.places - s.own
    return np.asarray(np.arctan2(away[:, 1], away[:, 0]))
