"""The rest of what `check_flight` looks at: names, places and pixels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import POSITION, Finding, count, first_row
from wildlab.flight.clocks import frame_poses
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.schema import DETECTION_KINDS
from wildlab.flight.store import Flight

#: Truth further from every pose than this belongs to another flight, or has its coordinates exchanged.
FAR_M = 20_000.0
#: No lens magnifies one way 2 % more than the other: then the calibration is of something else.
FOCAL_RATIO = 0.02


def truth_place(flight: Flight) -> Iterator[Finding]:
    """Truth that is nowhere near the flight."""
    if flight.truth is None or not flight.nav:
        return
    poses = np.concatenate([nav[list(POSITION)].to_numpy() for nav in flight.nav.values()])
    poses = poses[np.isfinite(poses).all(axis=1)]
    truth = flight.truth[list(POSITION)].to_numpy()
    if len(poses) == 0 or len(truth) == 0:
        return
    low, high = poses.min(axis=0)[:2], poses.max(axis=0)[:2]
    beyond = np.maximum(np.maximum(low - truth[:, :2], truth[:, :2] - high), 0)
    distance = np.hypot(beyond[:, 0], beyond[:, 1])
    far = distance > FAR_M
    if far.any():
        name = flight.truth["target_id"].iloc[first_row(far)]
        yield Finding(
            "problem",
            "truth",
            "north_m",
            f"{count(far, 'position')} far from the flight: target {name!r} is "
            f"{distance[far][0] / 1e3:.0f} km from the nearest pose",
            "check that latitude and longitude are not exchanged, their signs and units, and that it is the "
            "truth of this flight",
        )
        return
    above = truth[:, 2] < poses[:, 2].min()
    if above.any():
        yield Finding(
            "problem" if above.all() else "warning",
            "truth",
            "down_m",
            f"{count(above, 'position')} above the highest pose of the platform",
            "check the vertical reference of both and [vertical]; down is positive downwards",
        )


def identity(flight: Flight) -> Iterator[Finding]:
    """Names that occur twice, or name nothing."""
    frames, detections, truth = flight.frames, flight.detections, flight.truth
    for name, nav in flight.nav.items():
        if "frame_id" in nav:
            yield from _twice(f"nav/{name}", "frame_id", nav["frame_id"], "each frame has one pose")
    if frames is not None:
        yield from _twice("frames", "frame_id", frames["frame_id"], "give each frame its own name")
    if truth is not None:
        fixed = truth.loc[truth["time_s"].isna(), "target_id"]
        yield from _twice(
            "truth", "target_id", fixed, "a point that never moves has one row: use ids that differ"
        )
    if detections is None:
        return
    pairs = (
        detections[["detection_id", "source"]].agg(" of ".join, axis=1) if len(detections) else pd.Series()
    )
    yield from _twice("detections", "detection_id", pairs, "a detection may occur once per source")
    known = set(frames["frame_id"]) if frames is not None else set()
    lost = ~detections["frame_id"].isin(known).to_numpy()
    # Another sensor's bearing or position need not belong to an image.
    lost &= ~((detections["frame_id"] == "") & (detections["kind"] != "pixel")).to_numpy()
    if lost.any():
        yield Finding(
            "problem",
            "detections",
            "frame_id",
            f"{count(lost, 'detection')} in a frame that is not in the table of frames, first "
            f"{detections['frame_id'].iloc[first_row(lost)]!r}",
            "add the frame, or mend its name",
        )
    if truth is not None and "target_id" in detections:
        strange = ~detections["target_id"].isin({"", *truth["target_id"]}).to_numpy()
        if strange.any():
            yield Finding(
                "warning",
                "detections",
                "target_id",
                f"{count(strange, 'detection')} of a target without truth, first "
                f"{detections['target_id'].iloc[first_row(strange)]!r}",
                "add the target to the truth, or leave the id empty: such detections are not scored",
            )


def _twice(table: str, field: str, names: pd.Series, fix: str) -> Iterator[Finding]:
    again = names.duplicated().to_numpy()
    if again.any():
        example = names.iloc[first_row(again)]
        yield Finding("problem", table, field, f"{example!r} stands here more than once", fix)


def image(flight: Flight) -> Iterator[Finding]:
    """Detections against the camera: pixels in the image, ground below the lens."""
    camera = flight.manifest.camera
    if camera is not None:
        yield from _calibration(camera)
    if flight.detections is None:
        return
    detections = flight.detections
    kind = detections["kind"].to_numpy()
    for name, columns in DETECTION_KINDS.items():
        if (kind == name).any():
            for column in columns:
                bad = (kind == name) & ~np.isfinite(detections[column].to_numpy())
                if bad.any():
                    yield Finding(
                        "problem",
                        "detections",
                        column,
                        f"{count(bad, 'detection')} of kind {name!r} without a number here, first "
                        f"{detections['detection_id'].iloc[first_row(bad)]!r}",
                        "fill it, or remove those rows",
                    )
    pixel = kind == "pixel"
    if not pixel.any():
        return
    if camera is None:
        yield Finding(
            "problem",
            "flight.toml",
            "camera",
            "there are pixels, and no camera they could be of",
            "add the part [camera] with the calibration",
        )
        return
    u, v = detections["u_px"].to_numpy(), detections["v_px"].to_numpy()
    outside = pixel & ((u < -0.5) | (u > camera.width_px) | (v < -0.5) | (v > camera.height_px))
    if outside.any():
        first = first_row(outside)
        yield Finding(
            "problem" if outside[pixel].all() else "warning",
            "detections",
            "u_px",
            f"{count(outside, 'pixel')} outside of the image of {camera.width_px} x {camera.height_px}, "
            f"first ({u[first]:g}, {v[first]:g})",
            "check the unit of the pixels and the size of the image",
        )
    yield from _ground(flight, pixel)


def _calibration(camera: CameraPart) -> Iterator[Finding]:
    ratio = camera.fx_px / camera.fy_px
    if abs(ratio - 1) > FOCAL_RATIO:
        yield Finding(
            "note",
            "flight.toml",
            "camera.fx_px",
            f"fx and fy differ by {100 * abs(ratio - 1):.1f} %, which no lens with square pixels does",
            "check the calibration, and expect the boresight estimate to take up part of it",
        )
    if not (0 < camera.cx_px < camera.width_px and 0 < camera.cy_px < camera.height_px):
        yield Finding(
            "warning",
            "flight.toml",
            "camera.cx_px",
            f"the principal point ({camera.cx_px:g}, {camera.cy_px:g}) lies outside of the image",
            "check that the calibration is for this image size",
        )


def _ground(flight: Flight, pixel: np.ndarray) -> Iterator[Finding]:
    detections = flight.detections
    if detections is None or flight.frames is None or not flight.nav:
        return
    if flight.terrain is not None:
        return  # the ground is that of the map
    if "plane_down_m" not in detections or not np.isfinite(detections.loc[pixel, "plane_down_m"]).any():
        yield Finding(
            "note",
            "detections",
            "plane_down_m",
            "no detection says how high the ground is there",
            "the height of the truth or of the origin has to serve",
        )
        return
    for name in flight.nav:
        try:
            p, _, _ = frame_poses(flight, name, np.inf)
        except WildlabError:  # said by `order` already
            continue
        lens = pd.Series(p[:, 2], index=flight.frames["frame_id"])
        height = detections["frame_id"].map(lens[~lens.index.duplicated()]).to_numpy(float)
        above = pixel & (detections["plane_down_m"].to_numpy() <= height)
        if above.any():
            yield Finding(
                "problem" if above[pixel].all() else "warning",
                "detections",
                "plane_down_m",
                f"{count(above, 'ground plane')} above the camera as nav/{name} has it",
                "check the vertical reference of both and [vertical]; down is positive downwards",
            )
