"""The ground that rays are cut with: whether they meet it, and whether it is where the truth says."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.sightings import MOST
from wildlab.flight.clocks import frame_times, gimbal_angles, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.ray_ends import BELOW
from wildlab.geometry.terrain import pixels_to_terrain

#: A mark is where something was marked, so its ray goes down: more that do not than this share are a fault.
LOST = 0.5
#: Ground heights that differ from those of the truth by more than this (m), by so many times what is stated,
#: and by so many times their own spread.
STEP_M, STATED, SPREAD = 8.0, 5.0, 3.0


def ground(flight: Flight) -> Iterator[Finding]:
    """Rays of detections against the ground, and ground against truth."""
    detections, truth = flight.detections, flight.truth
    if detections is None or flight.frames is None or flight.manifest.camera is None:
        return
    pixel = (detections["kind"] == "pixel").to_numpy()
    if pixel.sum() < 4 or flight.frames["frame_id"].duplicated().any():
        return
    yield from _rays(flight, detections[pixel])
    if truth is None or not len(truth) or "plane_down_m" not in detections or flight.terrain is not None:
        return
    down = detections["plane_down_m"].to_numpy(float)
    heights = truth.groupby("target_id")["down_m"].median()
    if flight.manifest.scoring.rule == "labelled" and "target_id" in detections:
        known = detections["target_id"].map(heights).to_numpy(float)
    else:
        known = np.full(len(down), float(truth["down_m"].median()))
    apart = (down - known)[pixel & np.isfinite(down - known)]
    if len(apart) < 4:
        return
    off = float(np.median(apart))
    spread = 1.4826 * float(np.median(np.abs(apart - off)))
    stated = np.hypot(flight.manifest.uncertainty.plane_height_m or 1.0, _sd(truth))
    if abs(off) > max(STEP_M, STATED * stated, SPREAD * spread):
        where = "above" if off < 0 else "below"
        yield Finding(
            "warning",
            "detections",
            "plane_down_m",
            f"the ground of the detections lies {abs(off):.0f} m {where} the known points: another reference",
            f'`correction_m = {-off:.1f}` more in [vertical] with `taken_off = ["ground"]`, or the right '
            "column in [detections.ground]",
            ("ground heights against truth",),
        )


def _sd(truth: pd.DataFrame) -> float:
    stated = truth["sd_vertical_m"].median() if "sd_vertical_m" in truth else np.nan
    return float(stated) if np.isfinite(stated) else 2.0


def _rays(flight: Flight, pixels: pd.DataFrame) -> Iterator[Finding]:
    """The share of rays that meet the ground, where it is known how high that is."""
    if len(pixels) > MOST:
        pixels = pixels.iloc[np.linspace(0, len(pixels) - 1, MOST).astype(int)]
    plane = (
        pixels["plane_down_m"].to_numpy(float) if "plane_down_m" in pixels else np.full(len(pixels), np.nan)
    )
    if flight.truth is not None and len(flight.truth):
        plane = np.where(np.isfinite(plane), plane, float(flight.truth["down_m"].median()))
    terrain = flight.terrain
    frame = pd.Index(flight.table("frames")["frame_id"]).get_indexer(pd.Index(pixels["frame_id"]))
    for name, nav in flight.nav.items():
        if flight.manifest.mount.poses not in ("", name):
            continue  # the mount says nothing of a camera on these poses
        try:
            times = frame_times(flight)
            p, R, _ = poses_at(nav, times[frame], pixels["frame_id"])
            pan, tilt = (angle[frame] for angle in gimbal_angles(flight))
            poses = CameraPoses(
                flight.manifest.geometry_camera(), flight.manifest.geometry_mount(), p, R, pan, tilt
            )
            uv = pixels[["u_px", "v_px"]].to_numpy(float)
            if terrain is None:
                met, under = georeference_pixels(poses, uv, plane), p[:, 2] >= plane
            else:
                found = pixels_to_terrain(poses, uv, terrain)
                met, under = found.points, found.became == BELOW
        except ValueError:  # said by the checks of times
            continue
        known = np.isfinite(p).all(axis=1) & (frame >= 0)
        if terrain is None:
            known &= np.isfinite(plane)
        if known.sum() < 4:
            continue
        lost = 1 - float(np.isfinite(met[known, 0]).mean())
        if lost > LOST:
            other = "forward" if flight.manifest.mount.looks == "down" else "down"
            below = float(np.mean(under[known]))
            why = (
                "the poses lie below the ground: check the vertical reference of both and [vertical]"
                if below > LOST
                else f"check the signs of roll and pitch in [poses.{name}.attitude], and the mount: "
                f'`looks = "{other}"` in [mount] where the camera looks {other}'
            )
            yield Finding(
                "problem" if lost > 0.9 else "warning",
                f"nav/{name}",
                "",
                f"{words.number(100 * lost)} % of the marks look past the ground: their rays do not meet it",
                why,
                ("rays miss the ground",),
            )
