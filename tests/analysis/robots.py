"""Made-up flights: a boat followed from a robot by ranges and bearings, bearings, positions or velocities."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from tests.analysis.building import manifest_of, poses_table
from wildlab.analysis.tracks.noise_model import NoiseModel, model_noise, settings_of
from wildlab.analysis.tracks.scans import Scans, scans_of
from wildlab.analysis.tracks.tracker import TrackingResult, score_tracks
from wildlab.flight.manifest import parse_settings
from wildlab.flight.store import Flight


def boat(t: np.ndarray) -> np.ndarray:
    """North and east of a boat that turns a little."""
    return np.column_stack([80 + 0.8 * t, 40 + 25 * np.sin(t / 25)])


def robot(t: np.ndarray) -> np.ndarray:
    """North and east of the robot."""
    return np.column_stack([0.3 * t, 10 * np.sin(t / 40)])


def robot_flight(
    seed: int = 0,
    *,
    kind: str = "range-bearing",
    heading_off_deg: float = 0.0,
    heading_sd_deg: float | None = None,
    range_sd: float = 0.5,
    bearing_sd_deg: float = 0.3,
    position_sd: float = 1.0,
    seconds: float = 120.0,
    labelled: bool = True,
    truth: bool = True,
    fixed: bool = False,
    name: str = "robot",
    sensor: str = "radar",
    clutter: int = 0,
    late_s: float = 0.0,
    correlation: float = 0.0,
    manifest: dict[str, Any] | None = None,
) -> Flight:
    """A flight whose every number is known; the robot takes its heading for right and it is off.

    What it measures relative to its bow it turns by the heading it believes in: bearings from north are too
    large by how far that is. Stamps are ``late_s`` after what was seen, and to positions that of the robot at
    the stamp was added; their errors have this correlation from one to the next.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(1.0, seconds, 0.5)
    at = np.zeros((len(t), 2)) if fixed else robot(t)
    off = boat(t - late_s) - (at if fixed else robot(t - late_s))
    error = np.zeros(2)
    distance = np.hypot(*off.T)
    azimuth = np.arctan2(off[:, 1], off[:, 0]) + np.radians(heading_off_deg)
    rows = []
    for k in range(len(t)):
        seen = [
            (
                distance[k] + rng.normal(0, range_sd),
                azimuth[k] + rng.normal(0, np.radians(bearing_sd_deg)),
                "boat",
            )
        ]
        seen += [(rng.uniform(20, 200), rng.uniform(-np.pi, np.pi), "") for _ in range(clutter)]
        for i, (r, a, target) in enumerate(seen):
            row: dict[str, Any] = {
                "detection_id": f"{sensor}-{k}-{i}",
                "frame_id": f"{sensor}-{k}",
                "source": sensor,
                "kind": kind,
                "target_id": target if labelled else "",
            }
            if kind == "range-bearing":
                row |= {"range_m": r, "azimuth_rad": a}
            elif kind == "bearing":
                row |= {"azimuth_rad": a}
            elif kind == "position":
                turn = r * np.array([np.cos(a), np.sin(a)])
                drawn = rng.normal(0, position_sd, 2)
                error = correlation * error + np.sqrt(1 - correlation**2) * drawn
                north, east = at[k] + turn + error
                row |= {"north_m": north, "east_m": east, "down_m": 0.0}
            elif kind == "velocity":
                v = (boat(t[k : k + 1] + 0.5) - boat(t[k : k + 1] - 0.5))[0] + rng.normal(0, 0.2, 2)
                row |= {"v_north_m_s": v[0], "v_east_m_s": v[1]}
            rows.append(row)
    stamps = np.zeros(1) if fixed else np.arange(0.0, seconds + 2, 0.2)
    place = np.zeros((1, 2)) if fixed else robot(stamps)
    nav = poses_table(stamps, np.insert(place, 2, 0.0, axis=1), np.tile(np.eye(3), (len(stamps), 1, 1)))
    fine = np.arange(0.0, seconds + 2, 0.2)
    way = pd.DataFrame({"target_id": "boat", "time_s": fine, "down_m": 0.0, "sd_horizontal_m": 0.05})
    way[["north_m", "east_m"]] = boat(fine)
    parts: dict[str, Any] = {"name": name}
    if heading_sd_deg is not None:
        parts["uncertainty"] = {"heading_deg": heading_sd_deg}
    frames = pd.DataFrame(
        {"frame_id": [f"{sensor}-{k}" for k in range(len(t))], "time_s": t, "sensor": sensor}
    )
    tables = {"frames": frames, "detections": pd.DataFrame(rows)}
    if truth:
        tables["truth"] = way
    return Flight(manifest_of(**parts | (manifest or {})), {"own": nav}, tables)


def joined(one: Flight, *others: Flight) -> Flight:
    """One flight with the sensors of several."""
    flights = (one, *others)
    tables = {
        name: pd.concat([each.tables[name] for each in flights], ignore_index=True)
        for name in ("frames", "detections")
    }
    return Flight(one.manifest, one.nav, {**one.tables, **tables})


def seen_only(flight: Flight, keep: np.ndarray) -> Flight:
    """The flight with detections of some of its looks alone; the looks stay."""
    seen, names = flight.tables["detections"], flight.tables["frames"]["frame_id"][keep]
    flight.tables["detections"] = seen[seen["frame_id"].isin(names)].reset_index(drop=True)
    return flight


def paused(flight: Flight, begin: float, end: float) -> Flight:
    """The flight with its target out of sight between two times."""
    t = flight.tables["frames"]["time_s"]
    return seen_only(flight, (t < begin) | (t > end))


def believed(
    flight: Flight, text: str = "", sensor: str = "radar", source: str | None = None
) -> tuple[Scans, NoiseModel]:
    """A sensor's scans, and what filters believe of it by a flight and a file of settings."""
    scans = scans_of(flight, sensor, 0.0, source)
    return scans, model_noise(flight, scans, settings_of(flight, parse_settings(text)))[0]


KNOWN = """
[sensors.radar.noise]
range_m = 0.5
azimuth_deg = 0.3

[targets]
acceleration_m_s_sqrt_s = 0.15
start_speed_m_s = 1.0
"""


def rows_of(followed: TrackingResult, sensor: str = "radar") -> pd.DataFrame:
    rows = score_tracks(followed)
    return rows[rows["sensor"] == sensor].set_index("filter")
