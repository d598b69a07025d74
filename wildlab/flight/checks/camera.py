"""The camera, pixels in the image, the ground that rays are cut with, and what terrain there is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import (
    Finding,
    Level,
    Mistake,
    bad_rows,
    blame,
    change_by,
    finite_rows,
    messages,
    mistake,
    phrase,
    rows_of,
    thin,
)
from wildlab.flight.checks.known_points import MOST
from wildlab.flight.clocks import frame_poses, frame_times, gimbal_angles, poses_at
from wildlab.flight.manifest import CameraPart
from wildlab.flight.schema import DETECTION_KINDS, POSITION
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.georeference import BELOW, Terrain, georeference_pixels, pixels_to_terrain

#: No lens magnifies one way 2 % more than the other: then the calibration is of something else.
FOCAL_RATIO = 0.02
#: Fields of view (deg) across the image that a camera of a drone may have: long telephoto to fisheye.
NARROW, WIDE = 1.0, 150.0
#: Lenses are centred to a few percent of the image; further off, an image was cropped, or it is a mistake.
OFF_CENTRE, OFF_FAR, CENTRED = 0.08, 0.2, 0.03
#: A mark is where something was marked, so its ray goes down: more that do not than this share are a fault.
LOST = 0.5
#: Ground heights that differ from those of the truth by more than this (m), by so many times what is stated,
#: and by so many times their own spread.
STEP_M, STATED, SPREAD = 8.0, 5.0, 3.0


def image(flight: Flight) -> Iterator[Finding]:
    """Detections against the camera: pixels in the image, ground below the lens."""
    camera, detections = flight.manifest.camera, flight.detections
    if camera is not None:
        yield from _calibration(camera)
    if detections is None:
        return
    kind = detections["kind"].to_numpy()
    for name, columns in DETECTION_KINDS.items():
        for column in columns if (kind == name).any() else ():
            bad = (kind == name) & ~np.isfinite(detections[column].to_numpy())
            named = {"kind": name, "first": detections["detection_id"].to_numpy(object)}
            yield from bad_rows(bad, "problem", "detections", column, "detection-not-finite", named)
    pixel = kind == "pixel"
    if not pixel.any():
        return
    if camera is None:
        yield Finding("problem", "flight.toml", "camera", "no-camera")
        return
    u, v = detections["u_px"].to_numpy(), detections["v_px"].to_numpy()
    outside = pixel & ((u < -0.5) | (u > camera.width_px) | (v < -0.5) | (v > camera.height_px))
    level: Level = "problem" if outside[pixel].all() else "warning"
    facts: dict[str, Any] = {"width": camera.width_px, "height": camera.height_px, "u": u, "v": v}
    yield from bad_rows(outside, level, "detections", "u_px", "pixel-outside", facts)
    if flight.frames is None or not flight.nav or flight.terrain is not None:
        return  # without a terrain the ground is a plane
    if "plane_down_m" not in detections or not np.isfinite(detections.loc[pixel, "plane_down_m"]).any():
        yield Finding("note", "detections", "plane_down_m", "no-ground-height")
        return
    for name in flight.nav:
        try:
            p, _, _ = frame_poses(flight, name, np.inf)
        except WildlabError:  # said by `order` already
            continue
        lens = pd.Series(p[:, 2], index=flight.frames["frame_id"])
        height = detections["frame_id"].map(lens[~lens.index.duplicated()]).to_numpy(float)
        above = pixel & (detections["plane_down_m"].to_numpy() <= height)
        level = "problem" if above[pixel].all() else "warning"
        yield from bad_rows(above, level, "detections", "plane_down_m", "plane-above", {"source": name})


def _calibration(camera: CameraPart) -> Iterator[Finding]:
    ratio = camera.fx_px / camera.fy_px
    if abs(ratio - 1) > FOCAL_RATIO:
        facts = {"percent": 100 * abs(ratio - 1)}
        yield Finding("note", "flight.toml", "camera.fx_px", "focal-lengths-differ", facts)
    if not (0 < camera.cx_px < camera.width_px and 0 < camera.cy_px < camera.height_px):
        facts = {"cx": camera.cx_px, "cy": camera.cy_px}
        yield Finding("warning", "flight.toml", "camera.cx_px", "centre-outside", facts)


def lens(flight: Flight) -> Iterator[Finding]:
    """What cannot be the calibration of this image: principal point, focal length and field of view."""
    camera = flight.manifest.camera
    if camera is None:
        return
    widest = max(camera.width_px / camera.fx_px, camera.height_px / camera.fy_px)
    across = np.degrees(2 * np.arctan(widest / 2))
    facts = {"fx": camera.fx_px, "across": across}
    if across > WIDE:
        causes = ("focal length in mm",)
        yield Finding("problem", "flight.toml", "camera.fx_px", "view-wide", facts, causes)
    elif across < NARROW:
        yield Finding("warning", "flight.toml", "camera.fx_px", "view-narrow", facts)
    c = np.array([camera.cx_px, camera.cy_px])
    size = np.array([camera.width_px, camera.height_px], float)
    now = _off_centre(c, size)
    if now <= OFF_CENTRE:
        return
    named: list[Mistake[Any]] = []
    for row in rows_of("centre"):
        point, of = change_by(row, size)(c), size[row.get("size_order", [0, 1])]
        if point is not None and _off_centre(point, of) <= CENTRED:
            width, height = of / row.get("scale", 1.0)
            stated = {"cx": point[0], "cy": point[1], "width": width, "height": height}
            named.append(mistake(row, lambda x: x, fitted=False, **stated))
    inside = bool(((c > 0) & (c < size)).all())
    if named or (now > OFF_FAR and inside):  # outside of the image: said with the calibration
        facts = {"cx": c[0], "cy": c[1], "width": size[0], "height": size[1]}
        code = "centre-explained" if named else "centre-far"
        yield blame("warning", "flight.toml", "camera.cx_px", code, named, facts)


def _off_centre(point: np.ndarray, of: np.ndarray) -> float:
    return float(np.abs(point / of - 0.5).max())


def ground(flight: Flight) -> Iterator[Finding]:
    """Rays of detections against the ground, and ground against truth."""
    detections, truth, frames = flight.detections, flight.truth, flight.frames
    if detections is None or frames is None or flight.manifest.camera is None:
        return
    pixel = (detections["kind"] == "pixel").to_numpy()
    if pixel.sum() < 4 or frames["frame_id"].duplicated().any():
        return
    yield from _rays(flight, detections[pixel], frames)
    if truth is None or not len(truth) or "plane_down_m" not in detections or flight.terrain is not None:
        return
    down = detections["plane_down_m"].to_numpy(float)
    if flight.manifest.scoring.rule == "labelled" and "target_id" in detections:
        heights = truth.groupby("target_id")["down_m"].median()
        known = detections["target_id"].map(heights).to_numpy(float)
    else:
        known = np.full(len(down), truth["down_m"].median())
    apart = (down - known)[pixel & np.isfinite(down - known)]
    if len(apart) < 4:
        return
    off = np.median(apart)
    spread = 1.4826 * np.median(np.abs(apart - off))
    of_truth = float(truth["sd_vertical_m"].median()) if "sd_vertical_m" in truth else np.nan
    sd = of_truth if np.isfinite(of_truth) else 2.0
    stated = np.hypot(flight.manifest.uncertainty.plane_height_m or 1.0, sd)
    if abs(off) > max(STEP_M, STATED * stated, SPREAD * spread):
        facts = {"off": off, "correction": -off}
        causes = ("ground heights against truth",)
        yield Finding("warning", "detections", "plane_down_m", "ground-off-truth", facts, causes)


def _rays(flight: Flight, pixels: pd.DataFrame, frames: pd.DataFrame) -> Iterator[Finding]:
    """The share of rays that meet the ground, where it is known how high that is."""
    pixels = pixels.iloc[thin(len(pixels), MOST)]
    plane = np.full(len(pixels), np.nan)
    if "plane_down_m" in pixels:
        plane = pixels["plane_down_m"].to_numpy(float)
    if flight.truth is not None and len(flight.truth):
        plane = np.where(np.isfinite(plane), plane, flight.truth["down_m"].median())
    terrain, manifest = flight.terrain, flight.manifest
    frame = pd.Index(frames["frame_id"]).get_indexer(pd.Index(pixels["frame_id"]))
    for name, nav in flight.nav.items():
        if manifest.mount.poses not in ("", name):
            continue  # the mount says nothing of a camera on these poses
        try:
            p, R, _ = poses_at(nav, frame_times(flight)[frame], pixels["frame_id"])
            pan, tilt = (angle[frame] for angle in gimbal_angles(flight))
            poses = CameraPoses(manifest.geometry_camera(), manifest.geometry_mount(), p, R, pan, tilt)
            uv = pixels[["u_px", "v_px"]].to_numpy(float)
            if terrain is None:
                met, under = georeference_pixels(poses, uv, plane), p[:, 2] >= plane
            else:
                found = pixels_to_terrain(poses, uv, terrain)
                met, under = found.points, found.became == BELOW
        except ValueError:  # said by the checks of times
            continue
        known = np.isfinite(p).all(axis=1) & (frame >= 0) & (np.isfinite(plane) | (terrain is not None))
        if known.sum() < 4:
            continue
        lost = 1 - np.isfinite(met[known, 0]).mean()
        if lost > LOST:
            other = "forward" if manifest.mount.looks == "down" else "down"
            below = np.mean(under[known]) > LOST
            facts = {"percent": 100 * lost, "source": name, "other": other}
            code = "rays-from-below" if below else "rays-past-ground"
            level: Level = "problem" if lost > 0.9 else "warning"
            yield Finding(level, f"nav/{name}", "", code, facts, ("rays miss the ground",))


#: Poses that far below the ground are said, metres: a terrain's cell rounds the place it takes off from.
DEEP = 5.0
#: Fewer of them are what the noise of low flights does, as a share.
FEW = 0.01
#: Known points off the ground by more than that, metres, and by so many times their spread, are said.
OFF, OFF_SPREAD = 3.0, 2.0


def terrain_sentence(flight: Flight) -> str:
    """What terrain a flight has, as a clause; no coordinates."""
    texts = messages("checks")
    ground, record = flight.terrain, flight.manifest.terrain
    if ground is None:
        return str(texts["no-terrain"]["said"])
    north, far_north, east, far_east = ground.extent
    known = np.isfinite(ground.height)
    facts: dict[str, Any] = {
        "north": _length(far_north - north),
        "east": _length(far_east - east),
        "step": ground.step,
        "relief": np.ptp(ground.height[known]),
        "holes": 100 * (1 - known.mean()),
        "record": record,
    }
    if record is not None:
        facts["counted"] = texts["terrain-recorded"][record.heights]
    return phrase(texts["terrain" if record is None else "terrain-recorded"]["said"], facts)


def terrain_findings(flight: Flight) -> Iterator[Finding]:
    """What terrain there is; poses that are not over it, or below it."""
    ground = flight.terrain
    if ground is None:
        return
    facts: dict[str, Any] = {
        "terrain": terrain_sentence(flight),
        "sd": ground.sd,
        "unknown": bool(np.isnan(ground.sd)),
    }
    yield Finding("note", "terrain.tif", "", "terrain-there", facts)
    yield from _known_points(flight, ground)
    for name, nav in flight.nav.items():
        p = finite_rows(nav, POSITION)
        if not len(p):
            continue
        above = -p[:, 2] - ground.heights_at(p[:, :2])
        over = np.isfinite(above)
        north, far_north, east, far_east = ground.extent
        beyond = (p[:, 0] < north) | (p[:, 0] > far_north) | (p[:, 1] < east) | (p[:, 1] > far_east)
        for which, code in ((~over & beyond, "beyond-terrain"), (~over & ~beyond, "over-hole")):
            if which.any():
                yield Finding("warning", f"nav/{name}", "", code, {"percent": 100 * which.mean()})
        above = above[over]
        below = above < -DEEP
        if below.mean() > FEW:
            level: Level = "problem" if below.all() else "warning"
            facts = {"percent": 100 * below.mean(), "deep": DEEP, "most": -above.min()}
            yield Finding(level, f"nav/{name}", "down_m", "below-ground", facts)
        elif over.any():
            facts = {"median": np.median(above), "low": above.min(), "high": above.max()}
            yield Finding("note", f"nav/{name}", "down_m", "above-ground", facts)


def _known_points(flight: Flight, ground: Terrain) -> Iterator[Finding]:
    """Whether points of the truth that never move lie on the ground."""
    truth = flight.truth
    if truth is None:
        return
    still = truth[truth["time_s"].isna()].drop_duplicates("target_id")[POSITION].to_numpy(float)
    above = -still[:, 2] - ground.heights_at(still[:, :2])
    above = above[np.isfinite(above)]
    if len(above) < 3:
        return
    middle = np.median(above)
    spread = 1.4826 * np.median(np.abs(above - middle))
    off = abs(middle) > max(OFF, OFF_SPREAD * spread)
    facts = {"n": len(above), "above": middle, "spread": spread}
    code = "points-off-ground" if off else "points-on-ground"
    yield Finding("warning" if off else "note", "terrain.tif", "", code, facts)


def _length(metres: float) -> str:
    return f"{metres / 1000:.1f} km" if metres >= 1000 else f"{metres:.0f} m"
