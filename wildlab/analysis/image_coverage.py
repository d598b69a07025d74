"""What the images of a flight have shown of the ground, and what a log has lost of it."""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.georeference import observe, truth_of
from wildlab.errors import WildlabError
from wildlab.evaluation.streams import Pace
from wildlab.flight.clocks import frame_poses, frame_times, gimbal_angles
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, Mask
from wildlab.geometry.georeference import georeference_pixels, pixel_rays
from wildlab.geometry.terrain import pixels_to_terrain

#: Rays along each side of an image, and how far below the horizon (rad) all of them have to point: flatter
#: ones end anywhere.
SIDE, FLATTEST = 5, np.radians(5.0)
#: Cells of the grid across the narrower side of a usual footprint, and at most in all.
ACROSS, MOST_CELLS = 40, 4_000_000


class Coverage(NamedTuple):
    """Images on the ground.

    Attributes
    ----------
    posed
        (N,) bool, those with a pose and gimbal angles.
    flat
        (N,) bool, posed ones that look too near the horizon to have a footprint.
    outlines
        (N, B, 2) m north and east, the border of each on the ground; NaN where it has none.
    counts
        (R, C) how many images show a cell.
    north, east, step
        Of the centre of the cell (0, 0), and between cells, m; rows run north.
    ground
        In words: what the footprints lie on.
    """

    posed: Mask
    flat: Mask
    outlines: Array
    counts: NDArray[np.int32]
    north: float
    east: float
    step: float
    ground: str

    @property
    def placed(self) -> Mask:
        """(N,) bool: the images with a footprint."""
        return np.asarray(np.isfinite(self.outlines).all(axis=(1, 2)))

    @property
    def area_m2(self) -> float:
        """Of the ground that at least one image shows."""
        return float((self.counts > 0).sum()) * self.step**2

    @property
    def looks(self) -> float:
        """Images that show a place, mean over what was seen at all; NaN where nothing was."""
        seen = self.counts[self.counts > 0]
        return float(seen.mean()) if len(seen) else float("nan")


def ground_height(flight: Flight) -> tuple[float, str] | None:
    """Down coordinate of level ground, and where it is from: the truth, else the detections; None without.

    Of a truth it is the mean of the points that never move, as an import has it, and the tracks of targets,
    whose heights are a receiver's, only where there are none.
    """
    truth, detections = flight.truth, flight.detections
    if truth is not None and np.isfinite(truth["down_m"]).any():
        known = truth[np.isfinite(truth["down_m"])]
        fixed = known[known["time_s"].isna()]
        if len(fixed):
            what = "surveyed point" if flight.manifest.kind == "logged" else "fixed point"
            words = f"level ground at the mean height of {len(fixed)} {what}{'' if len(fixed) == 1 else 's'}"
            return float(fixed["down_m"].mean()), words
        tracks = known["target_id"].nunique()
        of = "the track of one target" if tracks == 1 else f"the tracks of {tracks} targets"
        return float(known["down_m"].median()), f"level ground at the median height of {of}"
    if detections is not None and "plane_down_m" in detections:
        stated = detections["plane_down_m"].to_numpy(float)
        if np.isfinite(stated).any():
            return float(np.nanmedian(stated)), "level ground at the median height stated of the detections"
    return None


def cover_images(flight: Flight, source: str | None) -> Coverage | None:
    """What the images of a flight have shown of the ground, as far as their poses and the ground are known.

    Parameters
    ----------
    flight
        The flight.
    source
        Name of the ``nav`` table, or None where it has none.

    Returns
    -------
    Coverage or None
    """
    frames, manifest = flight.frames, flight.manifest
    if frames is None or not len(frames) or source is None or manifest.camera is None:
        return None
    level = (0.0, "the flight's terrain") if flight.terrain is not None else ground_height(flight)
    if level is None:
        return None
    try:
        p, R, _ = frame_poses(flight, source)
        pan, tilt = gimbal_angles(flight)
        mount = manifest.geometry_mount(source)
    except WildlabError:
        return None
    posed = np.isfinite(p).all(axis=1) & np.isfinite(R).all(axis=(1, 2)) & np.isfinite(pan + tilt)
    poses = CameraPoses(manifest.geometry_camera(), mount, p[posed], R[posed], pan[posed], tilt[posed])
    uv = _border(poses.camera.width, poses.camera.height)
    outlines = np.full((len(frames), len(uv), 2), np.nan)
    flat = np.zeros(len(frames), bool)
    if posed.any():
        each = poses.take(np.repeat(np.arange(posed.sum()), len(uv)))
        pixels = np.tile(uv, (int(posed.sum()), 1))
        down = pixel_rays(poses.camera, pixels, each.R_nc)
        steep = down[:, 2] / np.linalg.norm(down, axis=1) > np.sin(FLATTEST)
        steep = steep.reshape(-1, len(uv)).all(axis=1)
        flat[np.flatnonzero(posed)[~steep]] = True
        if flight.terrain is not None:
            points = pixels_to_terrain(each, pixels, flight.terrain).points
        else:
            points = georeference_pixels(each, pixels, np.full(len(pixels), level[0]))
        border = points[:, :2].reshape(-1, len(uv), 2)
        border[~steep] = np.nan
        outlines[posed] = border
    return _counted(posed, flat, outlines, level[1])


def _border(width: int, height: int) -> Array:
    """(4 (SIDE - 1), 2) pixels around an image, in order."""
    along = np.linspace(0, 1, SIDE)[:-1]
    u, v = float(width), float(height)
    sides = [(along * u, 0 * along), (0 * along + u, along * v), (u - along * u, 0 * along + v)]
    sides.append((0 * along, v - along * v))
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def _counted(posed: Mask, flat: Mask, outlines: Array, ground: str) -> Coverage:
    known = outlines[np.isfinite(outlines).all(axis=(1, 2))]
    if not len(known):
        return Coverage(posed, flat, outlines, np.zeros((1, 1), np.int32), 0.0, 0.0, 1.0, ground)
    # Imported where it is called: it takes its time.
    from rasterio import Affine
    from rasterio.enums import MergeAlg
    from rasterio.features import rasterize

    low, high = known.reshape(-1, 2).min(axis=0), known.reshape(-1, 2).max(axis=0)
    extent = high - low
    size = float(np.median(np.ptp(known, axis=1).min(axis=1)))
    step = max(size / ACROSS, float(np.sqrt(extent.prod() / MOST_CELLS)), 1e-3)
    rows, columns = (int(cells) for cells in np.maximum(np.ceil(extent / step), 1).astype(int))
    # Columns run east and rows north; a cell counts where its centre is inside. Edges of an outline seldom
    # run through centres where the grid begins at its corner: such cells would count twice.
    grid = Affine(step, 0, low[1], 0, step, low[0])
    shapes = [({"type": "Polygon", "coordinates": [one[:, ::-1].tolist()]}, 1) for one in _closed(known)]
    counts = rasterize(shapes, (rows, columns), transform=grid, merge_alg=MergeAlg.add, dtype="int32")
    return Coverage(posed, flat, outlines, counts, low[0] + step / 2, low[1] + step / 2, step, ground)


def _closed(outlines: Array) -> Array:
    return np.concatenate([outlines, outlines[:, :1]], axis=1)


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


def ordered(table: pd.DataFrame, columns: list[str], stamps: Array | None = None) -> tuple[Array, Array]:
    """Increasing stamps (N,) and values (N, K): what is finite, in order, the first of equal stamps.

    The stamps are those of the table, unless others are given.
    """
    values = table[columns].to_numpy(float)
    stamps = table["time_s"].to_numpy(float) if stamps is None else stamps
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


def _placed(flight: Flight, source: str | None) -> tuple[Mask, Mask]:
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
        posed, turned = np.zeros(len(frames), bool), np.ones(len(frames), bool)
        with suppress(WildlabError):
            p, angles = frame_poses(flight, source)[0], gimbal_angles(flight)
            posed, turned = np.asarray(np.isfinite(p).all(axis=1)), np.isfinite(np.sum(angles, axis=0))
        why = _why_unposed(flight, source, ~posed) if timed and (~posed).any() else ""
        found.append(Recovered("images_without_pose", int((~posed).sum()), len(frames), "images", why))
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


def _why_unposed(flight: Flight, source: str, unposed: Mask) -> str:
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
    named = detections[detections["target_id"].fillna("") != ""]
    at = pd.Index(frames["frame_id"]).get_indexer(pd.Index(named["frame_id"]))
    times = np.where(at >= 0, frame_times(flight)[at], np.nan)
    with suppress(WildlabError):  # of a truth whose stamps do not increase nothing is known
        places = truth_of(flight, named.assign(time_s=times))
        missing = int(np.isnan(places[:, 0]).sum())
        return [
            Recovered("detections_without_truth", missing, len(named), "detections that name a target", "")
        ]
    return []
