"""What a flight has lost: images without a pose, detections off the ground or without a truth, pauses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe
from wildlab.errors import WildlabError
from wildlab.evaluation.streams import Pace
from wildlab.flight.clocks import between, frame_poses, frame_times, gimbal_angles
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels

Array = NDArray[np.float64]

POSITION = ["north_m", "east_m", "down_m"]


class Recovered(NamedTuple):
    """Data that are lost: ``lost`` of ``of``, what they are, and why they are lost."""

    key: str
    lost: int
    of: int
    what: str
    why: str

    @property
    def share(self) -> float:
        """Of all."""
        return self.lost / self.of if self.of else 0.0


def ordered(table: pd.DataFrame, stamps: Array, columns: list[str]) -> tuple[Array, Array]:
    """Increasing stamps (N,) and values (N, K): what is finite, in order, the first of equal stamps."""
    values = table[columns].to_numpy(float)
    known = np.isfinite(stamps) & np.isfinite(values).all(axis=1)
    t, values = stamps[known], values[known]
    _, first = np.unique(t, return_index=True)
    return t[first], values[first]


def detections_of(flight: Flight, source: str | None) -> tuple[int, int, int]:
    detections = flight.detections
    if detections is None:
        return 0, 0, 0
    images = 0 if flight.frames is None else int(flight.frames["frame_id"].isin(detections["frame_id"]).sum())
    placed, _ = _placed(flight, source)
    return len(detections), images, int(placed.sum())


def _placed(flight: Flight, source: str | None) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of the pixel detections, which have a place on the ground, and which a pose; nothing without poses."""
    none = np.zeros(0, bool)
    if source is None or flight.manifest.camera is None:
        return none, none
    try:
        seen = observe(flight, source)
    except WildlabError:
        return none, none
    posed = np.isfinite(seen.poses.p_nc).all(axis=-1)
    points = georeference_pixels(seen.poses, seen.uv, seen.plane_down)
    return np.asarray(np.isfinite(points).all(axis=1)), np.asarray(posed)


def lost_data(flight: Flight, source: str | None, streams: dict[str, Pace]) -> list[Recovered]:
    """What is lost, with its denominator: images, detections, seconds."""
    found = []
    frames, timed = flight.frames, flight.manifest.time.kind == "utc"
    if frames is not None and len(frames) and source is not None:
        try:
            p, _, _ = frame_poses(flight, source)
            pan, tilt = gimbal_angles(flight)
        except WildlabError:
            p, pan, tilt = np.full((len(frames), 3), np.nan), np.zeros(len(frames)), np.zeros(len(frames))
        posed = np.asarray(np.isfinite(p).all(axis=1))
        why = _why_unposed(flight, source, ~posed) if timed and (~posed).any() else ""
        found.append(Recovered("images_without_pose", int((~posed).sum()), len(frames), "images", why))
        turned = np.isfinite(pan + tilt)
        missing = int((posed & ~turned).sum())
        found.append(Recovered("images_without_gimbal", missing, len(frames), "images", ""))
        placed, has_pose = _placed(flight, source)
        away = int((has_pose & ~placed).sum())
        found.append(Recovered("detections_off_ground", away, len(placed), "detections", ""))
    if timed:
        found += _unrecorded(flight, source, streams)
    imu = streams.get("imu")
    if timed and imu is not None and imu.missing:
        found.append(Recovered("inertial_samples", imu.missing, imu.n + imu.missing, "inertial samples", ""))
    found += _untrue(flight)
    return [one for one in found if one.lost]


def _unrecorded(flight: Flight, source: str | None, streams: dict[str, Pace]) -> list[Recovered]:
    """Seconds of the record without poses, satellite positions or inertial samples, and when these are."""
    carried = [pace for name, pace in streams.items() if pace.n and name != "truth"]
    if not carried:
        return []
    begin, end = min(pace.begin for pace in carried), max(pace.end for pace in carried)
    names = {"time_without_satellites": "gnss", "time_without_inertial": "imu"}
    if source is not None and "frame_id" not in flight.nav[source]:
        names = {"time_without_poses": f"nav/{source}"} | names
    found = []
    for key, name in names.items():
        pace = streams.get(name)
        if pace is None or not pace.n or end <= begin:
            continue
        outside = pace.begin - begin + end - pace.end
        lost = round(outside + pace.paused_s)
        said = [
            *([f"{outside:.0f} before it begins or after it ends"] if round(outside) else []),
            *([f"{pace.paused_s:.0f} in its pauses"] if round(pace.paused_s) else []),
        ]
        what = "seconds of the record"
        found.append(Recovered(key, lost, max(1, round(end - begin)), what, " and ".join(said)))
    return found


def _why_unposed(flight: Flight, source: str, unposed: NDArray[np.bool_]) -> str:
    nav, times = flight.nav[source], frame_times(flight)[unposed]
    if "frame_id" in nav:
        return "no pose bears their name"
    stamps = nav["time_s"].to_numpy(float)
    outside = int(((times < np.nanmin(stamps)) | (times > np.nanmax(stamps))).sum())
    within = int(unposed.sum()) - outside
    said = [
        *([f"{outside} before the log of the poses begins or after it ends"] if outside else []),
        *([f"{within} in its pauses"] if within else []),
    ]
    return " and ".join(said)


def _untrue(flight: Flight) -> list[Recovered]:
    """Detections that name a target whose truth is not known at the time."""
    truth, detections, frames = flight.truth, flight.detections, flight.frames
    if truth is None or detections is None or frames is None or "target_id" not in detections or truth.empty:
        return []
    at = pd.Index(frames["frame_id"]).get_indexer(pd.Index(detections["frame_id"]))
    times = np.where(at >= 0, frame_times(flight)[at], np.nan)
    named = detections["target_id"].fillna("").to_numpy(str)
    missing = 0
    for name in np.unique(named[named != ""]):
        rows = truth[truth["target_id"] == name]
        own = times[named == name]
        if rows.empty:
            missing += len(own)
            continue
        stamps = rows["time_s"].to_numpy(float)
        if np.isnan(stamps).all():
            continue
        t, place = ordered(rows, stamps + flight.manifest.clocks.truth_offset_s, POSITION)
        if len(t):
            missing += int(np.isnan(between(t, place, own, "truth")[:, 0]).sum())
    total = int((named != "").sum())
    return [Recovered("detections_without_truth", missing, total, "detections that name a target", "")]
