"""What one sensor of a moving platform saw, scan by scan, as arrays for filters; and the truth beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clocks import frame_times, poses_at, truth_at
from wildlab.flight.store import Flight

Array = NDArray[np.float64]

#: The kinds of detections that need nothing but the platform's position, and how many numbers each has.
KINDS = {"position": ("north_m", "east_m"), "bearing": ("azimuth_rad",)}
#: Velocities of the truth and of the platform are taken over a second.
OVER_S = 1.0


class Scans(NamedTuple):
    """N scans of a sensor with up to K detections each, in order of time.

    ``times`` (N,) s; ``detections`` (N, K, 2) north, east in n, or (N, K, 1) bearings from north, NaN where
    there are fewer; ``platform`` and ``platform_velocity`` (N, 2), NaN outside of the log of the platform.
    """

    sensor: str
    kind: str
    times: Array
    detections: Array
    platform: Array
    platform_velocity: Array

    @property
    def interval_s(self) -> float:
        """The usual time between two scans."""
        return float(np.median(np.diff(self.times)))


class Truth(NamedTuple):
    """Where one target was at N scans: ``position`` and ``velocity`` (N, 2), NaN where not known.

    ``sd_m`` of each axis of the position; zero where the truth does not say.
    """

    target: str
    position: Array
    velocity: Array
    sd_m: float

    @property
    def covariance(self) -> Array:
        """(2, 2) of the position."""
        return np.eye(2) * self.sd_m**2


def sensors_of(flight: Flight) -> list[str]:
    """The sensors that looked, in the order of their first scan.

    Raises
    ------
    WildlabError
        Where the frames do not say which sensor looked.
    """
    frames = flight.table("frames")
    if "sensor" not in frames:
        raise WildlabError(
            "the frames do not say which sensor looked",
            "name it for every frame, also for those that saw nothing",
            file=flight.folder,
            field="frames.sensor",
        )
    return [str(name) for name in frames["sensor"].drop_duplicates()]


def scans_of(flight: Flight, sensor: str, offset_s: float = 0.0) -> Scans:
    """The scans of a sensor, its detections those of the source of that name.

    Parameters
    ----------
    offset_s
        What to add to the sensor's stamps. The platform's position goes with the stamp: what was seen stands
        where the platform was then, so positions move with it.

    Raises
    ------
    WildlabError
        Where there is no such sensor, it detects something else than positions or bearings, or the flight
        has no poses.
    """
    known = sensors_of(flight)
    if sensor not in known:
        raise WildlabError(
            f"there is no sensor {sensor!r}", f"use one of {', '.join(known)}", file=flight.folder
        )
    frames = flight.table("frames")
    stamps = frame_times(flight)
    chosen = (frames["sensor"] == sensor).to_numpy()
    frame_ids, stamps = frames.loc[chosen, "frame_id"], stamps[chosen]
    seen = flight.table("detections")
    seen = seen[(seen["source"] == sensor) & seen["frame_id"].isin(frame_ids)]
    kinds = sorted(set(seen["kind"]))
    if len(kinds) != 1 or kinds[0] not in KINDS:
        raise WildlabError(
            f"the sensor {sensor!r} detects {' and '.join(kinds) or 'nothing'}",
            f"a target can be followed by detections of one kind: {' or '.join(KINDS)}",
            file=flight.folder,
            field="detections.kind",
        )
    columns = KINDS[kinds[0]]
    row = pd.Index(frame_ids).get_indexer(pd.Index(seen["frame_id"]))
    order = np.argsort(row, kind="stable")
    row = row[order]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    detections = np.full((len(stamps), int(place.max(initial=0)) + 1, len(columns)), np.nan)
    detections[row, place] = seen[list(columns)].to_numpy(float)[order]
    _, nav = flight.pose_source()
    platform = poses_at(nav, stamps + offset_s)[0][:, :2]
    if kinds[0] == "position":
        detections += (platform - poses_at(nav, stamps)[0][:, :2])[:, None]
    ahead, behind = (
        poses_at(nav, _inside(nav, stamps + offset_s + step))[0][:, :2] for step in (OVER_S / 2, -OVER_S / 2)
    )
    return Scans(sensor, kinds[0], stamps + offset_s, detections, platform, (ahead - behind) / OVER_S)


def truths_at(flight: Flight, times: ArrayLike) -> list[Truth]:
    """Every target at given times (N,), interpolated only across gaps that the truth's own rate explains."""
    at = np.asarray(times, float)
    truth, offset = flight.table("truth"), flight.manifest.clocks.truth_offset_s
    names, position = truth_at(truth, at, offset_s=offset)
    _, ahead = truth_at(truth, at + OVER_S / 2, offset_s=offset)
    _, behind = truth_at(truth, at - OVER_S / 2, offset_s=offset)
    sd = {}
    if "sd_horizontal_m" in truth:
        sd = truth.groupby("target_id")["sd_horizontal_m"].median().to_dict()
    return [
        Truth(name, p[:, :2], (a - b)[:, :2] / OVER_S, float(np.nan_to_num(sd.get(name, 0.0))))
        for name, p, a, b in zip(names, position, ahead, behind, strict=True)
    ]


def _inside(nav: pd.DataFrame, times: Array) -> Array:
    """Times brought into the log, for differences at its ends."""
    stamps = nav["time_s"].to_numpy(float)
    return np.clip(times, stamps[0], stamps[-1])
