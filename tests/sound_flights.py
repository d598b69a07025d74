"""Sound flights of five kinds, as people log them: nothing is wrong but the errors that every log has.

Errors of attitude and position are Gauss-Markov processes of tens of seconds; aircraft crab in the wind,
multirotors fly sideways, boats drift. Everything is computed here from the motion, with SciPy's rotations and
a pinhole of its own, so that no check is held against its own formulas.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from tests.sound_logs import (
    GRAVITY,
    NAV_EVERY,
    NED,
    QUATERNION,
    RATE,
    Array,
    Level,
    Motion,
    attitude_error,
    copter_yaw,
    draw_level,
    fly_copter,
    fly_wing,
    from_euler,
    gauss_markov,
    log_motion,
    measure_inertial,
    sample_times,
    smooth,
)
from wildlab.flight.manifest import make_manifest
from wildlab.flight.store import Flight

KINDS = ("fixed wing", "multirotor", "gimbal oblique", "nadir", "boat")
SEEDS = range(1, 11)
CAMERA = {"name": "thermal", "width_px": 640, "height_px": 512, "cx_px": 322.0, "cy_px": 254.0}
EPOCH = "2024-06-12T09:30:00Z"
#: Axes of a camera (right, down, out of the lens) as columns in the mount that it looks down or forward from.
LOOKS_DOWN = Rotation.from_matrix([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
LOOKS_FORWARD = Rotation.from_matrix([[0, 0, 1], [1, 0, 0], [0, 1, 0]])


def simulate_sound_flight(kind: str, seed: int) -> Flight:
    """A flight of one of `KINDS` in which all is as stated; another seed is another course, wind and log."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    make = (_fixed_wing, _multirotor, _gimbal_oblique, _nadir, _boat)[KINDS.index(kind)]
    return make(rng, seed)


def sound_flights() -> Iterator[tuple[str, int, Flight]]:
    """Kind, seed, flight: two of each kind, and all fifty where WILDLAB_ALL_FLIGHTS is set."""
    for kind in KINDS:
        for seed in SEEDS if os.environ.get("WILDLAB_ALL_FLIGHTS") else SEEDS[:2]:
            yield kind, seed, simulate_sound_flight(kind, seed)


# -- images


def _see(p: Array, R: Rotation, points: Array, focal: float) -> Array:
    """Pixels (M, 2) of points (M, 3) from one camera; NaN where the image ends."""
    away = R.inv().apply(points - p)
    with np.errstate(divide="ignore", invalid="ignore"):
        uv = focal * away[:, :2] / away[:, 2:] + [CAMERA["cx_px"], CAMERA["cy_px"]]
    inside = (away[:, 2] > 0) & (uv > 5).all(axis=1) & (uv < [635, 507]).all(axis=1)
    return np.where(inside[:, None], uv, np.nan)


def _on_ground(p: Array, R: Rotation, uv: Array, focal: float) -> Array:
    """Where the ray of a pixel meets the plane at zero; NaN above the horizon."""
    ray = R.apply([*((uv - [CAMERA["cx_px"], CAMERA["cy_px"]]) / focal), 1.0])
    return np.asarray(p - p[2] / ray[2] * ray) if ray[2] > 0.05 else np.full(3, np.nan)


def _marks(rng: Any, p: Array, R: Rotation, focal: float, count: int) -> Array:
    """Points (M, 3) on the ground that some image shows."""
    frames = rng.integers(0, len(p), count)
    found = [_on_ground(p[k], R[int(k)], rng.uniform([40, 40], [600, 470]), focal) for k in frames]
    return np.array([one for one in found if np.isfinite(one).all()])


def _walks(rng: Any, t: Array, starts: Array, speed: float) -> Array:
    """Tracks (M, N, 3) of what walks about from its starts (M, 3)."""
    steps = [np.cumsum(smooth(rng, len(t), speed, 6.0, 2), axis=0) / RATE for _ in starts]
    return np.stack([at + np.column_stack([step, 0 * t]) for at, step in zip(starts, steps, strict=True)])


def _photos(
    rng: Any, t: Array, p: Array, R: Rotation, points: Array, focal: float
) -> tuple[pd.DataFrame, pd.DataFrame, Array]:
    """Images and what was clicked in them, at most four each; `points` (M, 3), or (M, N, 3) that move."""
    at = np.arange(int(2 * RATE), len(t) - 2 * RATE, 2 * RATE)
    rows = []
    for number, k in enumerate(at):
        uv = _see(p[k], R[int(k)], points if points.ndim == 2 else points[:, k], focal)
        seen = rng.permutation(np.flatnonzero(np.isfinite(uv[:, 0])))[:4]
        rows += [(f"I{number:03d}", f"M{j:02d}", *(uv[j] + rng.normal(0, 1.5, 2))) for j in seen]
    detections = pd.DataFrame(rows, columns=["frame_id", "target_id", "u_px", "v_px"])
    detections.insert(0, "detection_id", [f"D{i:03d}" for i in range(len(detections))])
    detections["source"], detections["kind"], detections["plane_down_m"] = "click", "pixel", 0.0
    stamps = t[at] + rng.uniform(-0.02, 0.02)
    frames = pd.DataFrame({"frame_id": [f"I{i:03d}" for i in range(len(at))], "time_s": stamps})
    return frames, detections, at


def _surveyed(rng: Any, marks: Array) -> pd.DataFrame:
    truth = pd.DataFrame({"target_id": [f"M{i:02d}" for i in range(len(marks))], "time_s": np.nan})
    truth[NED] = marks + rng.normal(0, 0.03, marks.shape)
    return truth.assign(sd_horizontal_m=0.03, sd_vertical_m=0.03)


def _tracked(rng: Any, t: Array, walks: Array) -> pd.DataFrame:
    """Receivers on targets, once a second."""
    at, tables = np.arange(0, len(t), RATE), []
    for i, walk in enumerate(walks):
        table = pd.DataFrame(walk[at] + gauss_markov(rng, len(t), [0.5, 0.5, 0.8], 60.0, 3)[at], columns=NED)
        table.insert(0, "time_s", t[at])
        table.insert(0, "target_id", f"M{i:02d}")
        tables.append(table.assign(sd_horizontal_m=0.5, sd_vertical_m=0.8))
    return pd.concat(tables, ignore_index=True)


def _manifest(kind: str, seed: int, level: Level, focal: float, **parts: Any) -> dict[str, Any]:
    """What the owner states: what is so."""
    tilt, heading = np.degrees([level.tilt, level.heading]).tolist()
    return {
        "name": f"{kind.replace(' ', '-')}-{seed}",
        "kind": "logged",
        "locations": {"sensitivity": "open"},
        "origin": {"latitude_deg": 59.0 + 0.3 * seed, "longitude_deg": 10.0 + 0.7 * seed, "height_m": 40.0},
        "platform": {"name": kind},
        "camera": {**CAMERA, "fx_px": focal, "fy_px": focal},
        "time": {"kind": "utc", "epoch": EPOCH},
        "uncertainty": {
            "pixel_px": 1.5, "position_horizontal_m": level.level, "position_vertical_m": level.vertical,
            "tilt_deg": tilt, "heading_deg": heading, "plane_height_m": 0.1,
        },
        **parts,
    }  # fmt: skip


# -- the five kinds


def _fixed_wing(rng: Any, seed: int) -> Flight:
    """Straight down from an aeroplane over surveyed marks."""
    m, level, focal = (
        fly_wing(rng, sample_times(rng), rng.uniform(90, 160)),
        draw_level(rng),
        rng.uniform(500, 800),
    )
    nav, gnss, _ = log_motion(rng, m, level)
    R = m.R * LOOKS_DOWN
    marks = _marks(rng, m.p, R, focal, 60)
    frames, detections, _ = _photos(rng, m.t, m.p, R, marks, focal)
    tables = {"frames": frames, "detections": detections, "truth": _surveyed(rng, marks)}
    tables |= {"gnss": gnss, "imu": measure_inertial(rng, m)}
    manifest = _manifest("fixed wing", seed, level, focal, mount={"looks": "down"})
    return Flight(make_manifest(manifest), {"autopilot": nav}, tables)


def _multirotor(rng: Any, seed: int) -> Flight:
    """A fixed camera that looks forward and down from a multirotor over walking animals with collars."""
    t, level, focal = sample_times(rng), draw_level(rng), rng.uniform(450, 650)
    m = fly_copter(rng, t, rng.uniform(40, 80), rng.uniform(3, 7), copter_yaw(rng, t, seed % 3))
    nav, gnss, _ = log_motion(rng, m, level)
    tilt = rng.uniform(-75, -50)  # deg
    R = m.R * Rotation.from_euler("Y", tilt, degrees=True) * LOOKS_FORWARD
    walks = _walks(rng, t, _marks(rng, m.p, R, focal, 16), 0.6)
    frames, detections, _ = _photos(rng, t, m.p, R, walks, focal)
    tables = {"frames": frames, "detections": detections, "truth": _tracked(rng, t, walks)}
    tables |= {"gnss": gnss, "imu": measure_inertial(rng, m)}
    manifest = _manifest("multirotor", seed, level, focal, mount={"looks": "forward", "tilt_deg": tilt})
    return Flight(make_manifest(manifest), {"autopilot": nav}, tables)


def _gimbal_oblique(rng: Any, seed: int) -> Flight:
    """A gimbal that looks at one place from all around, 12 to 45 deg below the horizon.

    With even seeds poses are those of the airframe, and the gimbal has a log; with odd ones each photo has
    the attitude of the camera. With every fourth the nose points at the place too, across the course.
    """
    t, level, focal = sample_times(rng), draw_level(rng), rng.uniform(600, 1000)
    height, radius = rng.uniform(50, 90), rng.uniform(80, 200)
    around = rng.uniform(-np.pi, np.pi) + rng.choice([-1, 1]) * rng.uniform(0.03, 0.06) * t
    circle = radius * np.column_stack([np.cos(around), np.sin(around)])
    inwards = around + np.pi + smooth(rng, len(t), 0.05, 3.0)[:, 0]
    m = fly_copter(rng, t, height, 1.5, copter_yaw(rng, t, seed % 3) if seed % 4 else inwards, circle)
    look = np.array([0.0, 0.0, 0.0]) - m.p + smooth(rng, len(t), 8.0, 5.0, 3)
    yaw, pitch = np.arctan2(look[:, 1], look[:, 0]), -np.arctan2(look[:, 2], np.hypot(*look.T[:2]))
    held = from_euler(smooth(rng, len(t), 0.005, 1.0)[:, 0], pitch, yaw)
    # Angles of the gimbal's joints; what they cannot turn away, the image leans by.
    ahead = m.R.inv().apply(held.apply([1.0, 0.0, 0.0]))
    pan, tilt = np.arctan2(ahead[:, 1], ahead[:, 0]), -np.arcsin(np.clip(ahead[:, 2], -1, 1))
    of_log = bool(seed % 2)
    R = (held if of_log else m.R * from_euler(0.0, tilt, pan)) * LOOKS_FORWARD
    marks = _marks(rng, m.p, R, focal, 50)
    frames, detections, at = _photos(rng, t, m.p, R, marks, focal)
    tables = {"frames": frames, "detections": detections, "truth": _surveyed(rng, marks)}
    manifest = _manifest("gimbal oblique", seed, level, focal, mount={"looks": "forward"})
    if of_log:
        nav, _, _ = log_motion(rng, Motion(t, m.p, held), level)
        photos = pd.DataFrame({name: np.interp(t[at], nav["time_s"], nav[name]) for name in NED})
        q = (attitude_error(rng, len(t), level) * held)[at].as_quat(scalar_first=True)
        photos[QUATERNION], photos["time_s"] = q, frames["time_s"]
        return Flight(make_manifest(manifest), {"logged": photos.assign(frame_id=frames["frame_id"])}, tables)
    nav, gnss, _ = log_motion(rng, m, level)
    joints = np.column_stack([pan, tilt]) + gauss_markov(rng, len(t), np.radians(0.2), 20.0, 2)
    gimbal = pd.DataFrame(
        np.column_stack([t, joints])[::NAV_EVERY], columns=["time_s", "pan_rad", "tilt_rad"]
    )
    tables |= {"gimbal": gimbal, "gnss": gnss, "imu": measure_inertial(rng, m)}
    return Flight(make_manifest(manifest), {"autopilot": nav}, tables)


def _nadir(rng: Any, seed: int) -> Flight:
    """A survey multirotor over marks, with the camera's own attitude at -90 deg.

    The yaw is along the lanes, one and the same, or against every other lane. With odd seeds each photo has a
    pose, with even ones a log; with every fifth the airframe's log and inertial sensor are there too.
    """
    t, level, focal = sample_times(rng), draw_level(rng), rng.uniform(550, 800)
    n, lane, height = len(t), rng.uniform(60, 110), rng.uniform(50, 100)
    speed, side, towards = rng.uniform(4, 8), rng.uniform(15, 25), rng.uniform(-np.pi, np.pi)
    # Lanes with rounded ends: along and across as functions of the way.
    way = speed * t
    number, part = np.divmod(way, lane + side)
    along = np.where(number % 2 == 0, np.minimum(part, lane), lane - np.minimum(part, lane))
    across = number * side + np.maximum(part - lane, 0.0)
    path = gaussian_filter1d(np.column_stack([along, across]), 1.2 * RATE, axis=0)
    v = np.gradient(path, t, axis=0)
    c, s = np.cos(towards), np.sin(towards)
    p = np.column_stack([path @ np.array([[c, s], [-s, c]]), -height + smooth(rng, n, 0.7, 8.0)])
    p[:, :2] -= p[:, :2].mean(axis=0)
    course = np.unwrap(np.arctan2(v[:, 1], v[:, 0])) + towards
    back = np.pi * gaussian_filter1d((number % 2).astype(float), 1.2 * RATE)
    yaw = (course, np.full(n, towards + rng.uniform(-3, 3)), towards + back + np.pi / 2)[seed % 3]
    pitch = -90 + 0.05 * smooth(rng, n, 1.0, 5.0)[:, 0]  # and now and then past the vertical
    stated = from_euler(0.0, np.radians(pitch), yaw)
    held = attitude_error(rng, n, level) * stated
    R = held * LOOKS_FORWARD
    marks = _marks(rng, p, R, focal, 40)
    frames, detections, at = _photos(rng, t, p, R, marks, focal)
    truth = _surveyed(rng, marks)
    lean = np.gradient(np.gradient(p, t, axis=0), t, axis=0)[:, :2] + 0.12 * np.gradient(p[:, :2], t, axis=0)
    ahead = lean[:, 0] * np.cos(yaw) + lean[:, 1] * np.sin(yaw)
    right = -lean[:, 0] * np.sin(yaw) + lean[:, 1] * np.cos(yaw)
    m = Motion(t, p, from_euler(np.arctan(right / GRAVITY), -np.arctan(ahead / GRAVITY), yaw))
    nav, gnss, _ = log_motion(rng, m, level)
    rows = np.arange(0, n, NAV_EVERY)
    log = nav[["time_s", *NED]]
    if seed % 2:
        rows = at
        log = pd.DataFrame({name: np.interp(frames["time_s"], log["time_s"], log[name]) for name in NED})
        log = log.assign(time_s=frames["time_s"], frame_id=frames["frame_id"])
    # Angles in degrees, with as many digits as logs have.
    turned = from_euler(0.0, *np.radians([pitch[rows].round(3), (np.degrees(yaw[rows]) % 360).round(3)]))
    log = log.round(dict.fromkeys(NED, 3))
    log[QUATERNION] = turned.as_quat(scalar_first=True)
    poses, tables = {"camera": log}, {}
    if seed % 5 == 0:
        poses["airframe"], tables = nav, {"gnss": gnss, "imu": measure_inertial(rng, m)}
    tables |= {"frames": frames, "detections": detections, "truth": truth}
    mount = {"looks": "forward", "poses": "camera"}
    return Flight(make_manifest(_manifest("nadir", seed, level, focal, mount=mount)), poses, tables)


def _boat(rng: Any, seed: int) -> Flight:
    """A slow boat that drifts, now and then astern, with three others about.

    With odd seeds a camera on its mast sees them, with even ones a radar and a camera that gives bearings.
    """
    t, level, focal = sample_times(rng, 120, 180), draw_level(rng), rng.uniform(450, 650)
    n = len(t)
    heading = rng.uniform(-np.pi, np.pi) + smooth(rng, n, 0.8, 10.0)[:, 0]
    ahead = 1.2 + smooth(rng, n, 0.8, 8.0)[:, 0]
    current = rng.uniform(0.2, 0.9) * np.array([np.cos(seed), np.sin(seed)])
    v = np.column_stack([ahead * np.cos(heading), ahead * np.sin(heading)]) + current
    v += 0.3 * ahead[:, None] * np.column_stack([-np.sin(heading), np.cos(heading)])  # leeway
    p = np.column_stack([np.cumsum(v, axis=0) / RATE, -6.0 + smooth(rng, n, 0.15, 1.2)])
    p[:, :2] -= p[:, :2].mean(axis=0)
    waves = smooth(rng, n, 0.025, 0.8, 2)
    m = Motion(t, p, from_euler(waves[:, 0], waves[:, 1], heading))
    angle, away = rng.uniform(-np.pi, np.pi, 3), rng.uniform(40, 120, 3)
    starts = np.column_stack([away * np.cos(angle), away * np.sin(angle), 0 * away])
    nav, gnss, R_logged = log_motion(rng, m, level)
    tables = {"gnss": gnss, "imu": measure_inertial(rng, m)}
    parts: dict[str, Any] = {}
    if seed % 2:
        R = m.R * LOOKS_FORWARD
        # They keep ahead of it.
        front = heading[:, None] + np.array([-0.3, 0.05, 0.35]) + smooth(rng, n, 0.1, 5.0, 3)
        apart = away + smooth(rng, n, 8.0, 8.0, 3)
        there = p[:, None, :2] + apart[..., None] * np.stack([np.cos(front), np.sin(front)], axis=2)
        walks = np.moveaxis(np.dstack([there, np.zeros((n, 3))]), 1, 0)
        frames, detections, _ = _photos(rng, t, p, R, walks, focal)
        parts["mount"] = {"looks": "forward"}
    else:
        walks = _walks(rng, t, starts, 2.0)
        frames, detections = _scanned(rng, m, walks, R_logged, nav)
    tables |= {"frames": frames, "detections": detections, "truth": _tracked(rng, t, walks)}
    manifest = _manifest("boat", seed, level, focal, **parts)
    if not seed % 2:
        del manifest["camera"]
        manifest["scoring"] = {"rule": "nearest"}
    return Flight(make_manifest(manifest), {"autopilot": nav}, tables)


def _scanned(
    rng: Any, m: Motion, walks: Array, logged: Rotation, nav: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Scans of a radar (places) and of a camera (bearings), by the logged heading, with false ones."""
    rows, frames = [], []
    for name, every, clutter in (("radar", 1.5, 1), ("thermal", 0.8, 0)):
        for k in range(RATE, len(m.t) - RATE, int(every * RATE)):
            frame = f"{name}-{k:05d}"
            frames.append((frame, m.t[k], name))
            seen = walks[:, k][rng.random(len(walks)) < 0.8]
            false = m.p[k] + np.column_stack([rng.normal(0, 80, (clutter, 2)), np.full(clutter, -m.p[k, 2])])
            # The sensor measures in b; the log's attitude and place put it into n.
            b = m.R[k].inv().apply(np.vstack([seen, false]) - m.p[k])
            there = logged[k].apply(b)
            own = np.array([np.interp(m.t[k], nav["time_s"], nav[axis]) for axis in NED])
            for one in there:
                azimuth = np.arctan2(one[1], one[0]) + rng.normal(0, np.radians(0.5))
                place = own[:2] + (np.hypot(*one[:2]) + rng.normal(0, 1.5)) * np.array(
                    [np.cos(azimuth), np.sin(azimuth)]
                )
                rows.append((frame, name, azimuth, *place))
    seen_rows = pd.DataFrame(rows, columns=["frame_id", "source", "azimuth_rad", "north_m", "east_m"])
    radar = (seen_rows["source"] == "radar").to_numpy()
    seen_rows["kind"] = np.where(radar, "position", "bearing")
    seen_rows.loc[radar, "azimuth_rad"] = np.nan
    seen_rows.loc[~radar, ["north_m", "east_m"]] = np.nan
    seen_rows["down_m"], seen_rows["elevation_rad"] = np.where(radar, 0.0, np.nan), np.nan
    seen_rows.insert(0, "detection_id", [f"D{i:04d}" for i in range(len(seen_rows))])
    table = pd.DataFrame(frames, columns=["frame_id", "time_s", "sensor"]).sort_values(
        "time_s", kind="stable"
    )
    return table.reset_index(drop=True), seen_rows.assign(target_id="")
