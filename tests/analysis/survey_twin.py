"""A twin of a flight over surveyed markers: oblique photos of scattered marks, from slightly wrong poses.

What is wrong on top of that is put in by name, so that a diagnosis can be held against it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from tests.analysis.building import manifest_of, poses_table, surveyed
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import Mount, camera_pose
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import ground_to_pixel

CAMERA = Camera(4056, 3040, 2400.0, 2400.0, 2028.0, 1520.0)
STEP_S = 0.1


@dataclass(frozen=True)
class Survey:
    """What a survey is like and what is wrong with it.

    ``tilt_deg`` stands in the log on top of the true tilt, ``clock_s`` must be added to the stamps,
    ``down_m`` and ``north_m`` are added to the logged position; ``focal`` is by how much the stated focal
    lengths are too large (a share). ``off`` moves what the survey says of a mark (metres, north-east),
    ``turned_deg`` the yaw that is logged while a photo is taken. ``mark_m`` is the spacing of the marks.
    Attitude errors of photos are independent, or, with ``wanders_s``, a Gauss-Markov process of that time
    constant. ``level_m`` is half the range of the heights.
    """

    seed: int = 0
    images: int = 40
    every_s: float = 6.0
    tilt_deg: float = 0.0
    clock_s: float = 0.0
    down_m: float = 0.0
    north_m: float = 0.0
    focal: float = 0.0
    off: dict[str, tuple[float, float]] = field(default_factory=dict)
    turned_deg: dict[int, float] = field(default_factory=dict)
    heading_deg: float = 0.7
    stated_deg: float = 0.7
    stated_heading_deg: float | None = None
    slant_deg: tuple[float, float] = (35.0, 80.0)
    rule: str = "labelled"
    mark_m: float = 18.0
    timed: bool = True
    wanders_s: float = 0.0
    level_m: float = 15.0


def simulate(survey: Survey) -> Flight:
    """The flight as a folder would hold it, the log wrong by what the survey says."""
    rng = np.random.default_rng(survey.seed)
    n = survey.images
    at = 5.0 + survey.every_s * np.arange(n)
    t = np.arange(0.0, at[-1] + 5.0, STEP_S)
    turn = 2 * np.pi * t / 47.0
    way = np.column_stack(
        [60 * np.sin(turn), 60 * np.sin(0.61 * turn + 0.3), -70 - survey.level_m * np.sin(0.37 * turn)]
    )
    # The gimbal dips while the photographs are taken from all sides of the field.
    low, high = survey.slant_deg
    slant = np.radians((low + high) / 2 + (high - low) / 2 * np.sin(2 * np.pi * t / 31.0))
    yaw = np.arctan2(-way[:, 1], -way[:, 0]) + 0.5 * np.sin(2 * np.pi * t / 23.0)
    roll = np.radians(3.0) * np.sin(2 * np.pi * t / 13.0)

    index = np.round(at / STEP_S).astype(int)
    shared = np.radians([0.7, 0.7, survey.heading_deg]) * rng.normal(size=(n, 3))
    keep = np.exp(-survey.every_s / survey.wanders_s) if survey.wanders_s else 0.0
    for i in range(1, n):
        shared[i] = keep * shared[i - 1] + np.sqrt(1 - keep**2) * shared[i]
    logged_then = euler_to_matrix(*np.column_stack([roll, -slant, np.unwrap(yaw)])[index].T)
    true = rotation_vector_to_matrix(shared) @ logged_then
    where = way[index] + rng.normal(0, 0.7, (n, 3))
    marks = _marks(rng, survey.mark_m)
    names = np.array([f"M{i:02d}" for i in range(len(marks))])
    mount = Mount("forward")
    rows = []
    for i in range(n):
        p, R = camera_pose(mount, where[i][None], true[i][None])
        uv = ground_to_pixel(CAMERA, marks, np.repeat(p, len(marks), 0), np.repeat(R, len(marks), 0))
        seen = np.isfinite(uv).all(axis=1) & (uv > 40).all(axis=1) & (uv < [4016, 3000]).all(axis=1)
        for mark in rng.permutation(np.flatnonzero(seen))[:5]:
            rows.append((f"I{i:03d}", names[mark], *(uv[mark] + rng.normal(0, 4.0, 2))))
    detections = pd.DataFrame(rows, columns=["frame_id", "target_id", "u_px", "v_px"])
    detections.insert(0, "detection_id", [f"D{i:03d}" for i in range(len(detections))])
    detections["source"], detections["kind"], detections["plane_down_m"] = "click", "pixel", 0.0
    if survey.rule == "nearest":
        detections["target_id"] = ""

    logged = np.column_stack([roll, -slant + np.radians(survey.tilt_deg), np.unwrap(yaw)])
    for image, degrees in survey.turned_deg.items():
        logged[np.abs(t - at[image]) < survey.every_s / 2, 2] += np.radians(degrees)
    nav = poses_table(t, way + np.array([survey.north_m, 0.0, survey.down_m]), euler_to_matrix(*logged.T))
    truth = surveyed(names, marks + np.array([(*survey.off.get(name, (0.0, 0.0)), 0.0) for name in names]))
    frames = pd.DataFrame({"frame_id": [f"I{i:03d}" for i in range(n)], "time_s": at - survey.clock_s})
    time = {"kind": "utc", "epoch": "2024-01-01T00:00:00Z"} if survey.timed else {"kind": "sequence"}
    if not survey.timed:
        # Photos without times: each has its own pose, and the numbers of the photos stand for times.
        rate = index - round(survey.clock_s / STEP_S)
        nav = nav.iloc[rate].assign(time_s=np.arange(float(n)), frame_id=frames["frame_id"].to_numpy())
        frames["time_s"] = np.arange(float(n))
    stated = survey.stated_deg
    f = CAMERA.fx * (1 + survey.focal)
    manifest = manifest_of(
        replace(CAMERA, fx=f, fy=f),
        name="survey", mount={"looks": "forward"}, time=time, scoring={"rule": survey.rule},
        uncertainty={"pixel_px": 4.0, "position_horizontal_m": 0.7, "position_vertical_m": 0.7,
                     "tilt_deg": stated, "heading_deg": survey.stated_heading_deg or stated,
                     "plane_height_m": 0.1},
    )  # fmt: skip
    tables = {"frames": frames, "detections": detections, "truth": truth}
    return Flight(manifest, {"logged": nav.reset_index(drop=True)}, tables)


def _marks(rng: np.random.Generator, spacing: float) -> np.ndarray:
    """Marks (M, 3) on level ground, about so many metres apart."""
    line = np.arange(-70.0, 71.0, spacing)
    grid = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    return np.column_stack([grid + rng.uniform(-0.25, 0.25, grid.shape) * spacing, np.zeros(len(grid))])
