"""A small flight whose every error is known: images of surveyed markers, from slightly wrong poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.analysis.building import manifest_of, poses_table, surveyed
from wildlab.analysis.georeference import Observations, georeference, observe, pose_errors, score_points
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import Mount, camera_pose
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.studies.sensitivity import TAU2

SPEED = 15.0


def build(
    *,
    seed: int = 0,
    n_images: int = 40,
    rule: str = "labelled",
    misalignment_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    attitude_deg: float = 0.0,
    position_m: float = 0.0,
    pixel_px: float = 0.0,
    clock_s: float = 0.0,
    moving: bool = False,
) -> Flight:
    """Images at one a second, four markers in each; the manifest knows nothing of the misalignment."""
    rng = np.random.default_rng(seed)
    true_mount = Mount("down", misalignment=tuple(np.radians(misalignment_deg)))
    t = np.arange(-20, n_images * 10 + 20) / 10.0
    heading = 0.4 * t
    euler = np.column_stack([0.15 * np.sin(0.5 * t), 0.1 * np.cos(0.9 * t), heading])
    p = np.column_stack(
        [SPEED / 0.4 * np.sin(heading), -SPEED / 0.4 * np.cos(heading), -90 - 25 * np.sin(0.21 * t)]
    )
    nav = poses_table(t, p, euler_to_matrix(*euler.T))

    at = np.arange(n_images) * 1.0  # flight time of the images; the camera's own stamps are off by the clock
    index = np.searchsorted(t, at - 1e-6)
    shared = rng.normal(0, np.radians(attitude_deg), (n_images, 3))
    seen = euler_to_matrix(*(euler[index] + shared).T)
    where = p[index] + rng.normal(0, position_m, (n_images, 3))
    image = np.repeat(np.arange(n_images), 4)
    markers = np.column_stack(
        [where[image, :2] + rng.uniform(-15, 15, (len(image), 2)), rng.normal(0, 1.0, len(image))]
    )
    uv = ground_to_pixel(TAU2, markers, *camera_pose(true_mount, where[image], seen[image]))
    uv += rng.normal(0, pixel_px, uv.shape)
    names = [f"M{i:03d}" for i in range(len(image))]
    frames = pd.DataFrame({"frame_id": [f"I{i:03d}" for i in range(n_images)], "time_s": at - clock_s})
    detections = pd.DataFrame(
        {
            "detection_id": [f"D{i:03d}" for i in range(len(image))],
            "frame_id": frames["frame_id"].to_numpy()[image],
            "source": "click",
            "kind": "pixel",
            "u_px": uv[:, 0],
            "v_px": uv[:, 1],
            "target_id": names if rule == "labelled" else "",
            "plane_down_m": markers[:, 2],
        }
    )
    truth = surveyed(names, markers)
    if moving:  # each marker on a track of its own that passes its place when it is seen
        rows = []
        for name, marker, k in zip(names, markers, image, strict=True):
            for dt in (-0.5, 0.5):
                rows.append([name, at[k] + dt, marker[0] + 2.0 * dt, marker[1] - 1.0 * dt, marker[2]])
        truth = pd.DataFrame(rows, columns=truth.columns)
    manifest = manifest_of(
        TAU2,
        name="synthetic",
        mount={"looks": "down"},
        uncertainty={"pixel_px": 2.0, "position_horizontal_m": 1.0, "position_vertical_m": 1.0,
                     "tilt_deg": 1.0, "heading_deg": 1.0, "plane_height_m": 0.1},
        scoring={"rule": rule},
    )  # fmt: skip
    return Flight(manifest, {"logged": nav}, {"frames": frames, "detections": detections, "truth": truth})


@pytest.fixture
def make_flight() -> Callable[..., Flight]:
    return build


def receiver(flight: Flight, **columns: object) -> pd.DataFrame:
    """A receiver that agrees with the poses twice a second, with more columns by its times."""
    nav = flight.nav["logged"]
    t = np.arange(float(nav["time_s"].min()), float(nav["time_s"].max()), 0.5)
    at = {name: np.interp(t, nav["time_s"], nav[name]) for name in ("north_m", "east_m", "down_m")}
    more = {name: values(t) if callable(values) else values for name, values in columns.items()}
    return pd.DataFrame({"time_s": t, **at, **more})


def without_poses(flight: Flight, begin: float, end: float) -> Flight:
    nav = flight.nav["logged"]
    flight.nav["logged"] = nav[(nav["time_s"] < begin) | (nav["time_s"] > end)].reset_index(drop=True)
    return flight


def changed(flight: Flight, parts: dict[str, Any] | None = None, **tables: pd.DataFrame) -> Flight:
    """The flight with parts of its manifest replaced, and some of its tables."""
    manifest = replace_in_manifest(flight.manifest, parts or {})
    return replace(flight, manifest=manifest, tables={**flight.tables, **tables})


def first_seconds(flight: Flight, seconds: float) -> Flight:
    """The flight's inertial unit and receivers up to that time, and nothing else of it."""
    tables = {name: flight.table(name) for name in ("imu", "gnss")}
    few = {name: t[t["time_s"] < seconds].reset_index(drop=True) for name, t in tables.items()}
    return replace(flight, tables=few)


def score(
    flight: Flight,
    observations: Observations | None = None,
    deviations: dict[str, float] | None = None,
    seed: int = 0,
) -> pd.DataFrame:
    """The errors of a flight's detections, as observed by its log or otherwise."""
    seen = observations or observe(flight)
    errors = pose_errors(seen, deviations)
    return score_points(flight, georeference(seen, np.random.default_rng(seed), errors))
