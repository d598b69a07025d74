"""A flight as a scene: what is there is taken, what lacks is said."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.evaluate import score_points
from wildlab.analysis.georeference import Observations, covariances_of, georeference, observe
from wildlab.analysis.overviews.image_coverage import FLATTEST, POSITION, ground_height, ordered
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import position_nees
from wildlab.flight.clocks import frame_times, gimbal_angles, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.georeference import georeference_pixels, pixel_rays
from wildlab.geometry.terrain import pixels_to_terrain
from wildlab.replay.scene import Array, Estimates, Path, Points, ReplayScene, Sightings, Target, Views

#: More are not shown: a picture on a screen does not have them, and files grow.
MOST_POSES, MOST_FRAMES, MOST_POINTS = 6000, 3000, 6000
#: Rays along each side of an image.
SIDE = 5


def scene_of(
    flight: Flight,
    source: str | None = None,
    estimates: pd.DataFrame | None = None,
    *,
    ellipses: bool = True,
) -> ReplayScene:
    """What a replay shows of a flight.

    Parameters
    ----------
    flight
        With anything missing.
    source
        Name of the ``nav`` table; left out, the best known one.
    estimates
        A table of tracks, as `wildlab.analysis.tracks.judged.estimates_table` makes it.

    ellipses
        Whether points on the ground get their covariance, which takes most of the time.

    Returns
    -------
    Scene
        Its time begins with the first pose that is shown, or the first frame where there is none.

    Raises
    ------
    WildlabError
        Where a source is named that the flight has not, or there is nothing that could be shown.
    """
    if source is not None:
        flight.pose_source(source)
    source = source or next(iter(flight.estimated_sources), None)
    lacks: list[str] = []
    path = _path(flight, source, lacks)
    views = _views(flight, source, lacks)
    sightings = _sightings(flight, views, lacks)
    points = _points(flight, source, lacks, ellipses)
    tracks = _tracks(flight, estimates, lacks)
    truth = _truth(flight, lacks)
    if path is None and views is None and not truth and not tracks:
        raise WildlabError(
            "there is nothing to play back: neither poses, nor images, nor truth",
            "add nav/<source>.parquet or frames.parquet; wildlab check says what is there",
            file=flight.folder,
        )
    begin = _first([path, views, *tracks, *truth])
    level = ground_height(flight)
    if flight.terrain is None and level is None:
        lacks.append("the ground: neither terrain nor truth says how high it lies")
    return ReplayScene(
        name=flight.name,
        kind=flight.manifest.kind,
        timed=flight.manifest.time.kind == "utc",
        path=None if path is None else path._replace(times=path.times - begin),
        camera=None if flight.manifest.camera is None else flight.manifest.geometry_camera(),
        views=None if views is None else views._replace(times=views.times - begin),
        sightings=sightings,
        points=None if points is None else points._replace(times=points.times - begin),
        tracks=tuple(one._replace(times=one.times - begin) for one in tracks),
        truth=tuple(one._replace(times=one.times - begin) for one in truth),
        terrain=flight.terrain,
        ground=float("nan") if level is None or flight.terrain is not None else level[0],
        lacks=tuple(lacks),
    )


def _first(parts: list[Path | Views | Estimates | Target | None]) -> float:
    """When the replay begins: with the first of these that has a time."""
    for part in parts:
        if part is not None and np.isfinite(part.times).any():
            return float(np.nanmin(part.times))
    return 0.0


def _evenly(n: int, most: int) -> NDArray[np.intp]:
    """Rows of `n`, all or `most` of them evenly, the first and the last among them."""
    return np.arange(n) if n <= most else np.unique(np.linspace(0, n - 1, most).round().astype(np.intp))


def _path(flight: Flight, source: str | None, lacks: list[str]) -> Path | None:
    if source is None:
        lacks.append("the aircraft: the flight has no poses")
        return None
    nav = flight.nav[source]
    times, places = ordered(nav, nav["time_s"].to_numpy(float), POSITION)
    if not len(times):
        lacks.append(f"the aircraft: no pose of {source} has a time and a place")
        return None
    keep = _evenly(len(times), MOST_POSES)
    return Path(times[keep], places[keep], source)


def _views(flight: Flight, source: str | None, lacks: list[str]) -> Views | None:
    frames = flight.frames
    if frames is None or not len(frames):
        lacks.append("images: the flight has no frames")
        return None
    times = frame_times(flight)
    # Looks of a radar are frames, too, and have no picture.
    rows = np.flatnonzero(np.isfinite(times) & _of_camera(flight, frames))
    rows = rows[np.argsort(times[rows], kind="stable")]
    if len(rows) > MOST_FRAMES:
        kept = _kept_frames(flight, frames["frame_id"].to_numpy(object)[rows])
        lacks.append(f"every frame: {len(kept)} of {len(rows)} are, those with detections first")
        rows = rows[kept]
    if not len(rows):
        lacks.append("images: no frame of a camera has a time")
        return None
    n = len(rows)
    ids = frames["frame_id"].to_numpy(object)[rows]
    nothing = Views(ids, times[rows], *_nowhere(n))
    if source is None or flight.manifest.camera is None:
        what = "poses" if source is None else "camera"
        lacks.append(f"what the camera looked at: the flight has no {what}")
        return nothing
    try:
        p, R, _ = poses_at(flight.nav[source], times[rows], list(ids))
        pan, tilt = (angle[rows] for angle in gimbal_angles(flight))
    except WildlabError as error:
        lacks.append(f"what the camera looked at: {error.problem}")
        return nothing
    poses = CameraPoses(flight.manifest.geometry_camera(), flight.manifest.geometry_mount(), p, R, pan, tilt)
    outlines = footprints(flight, poses)
    unposed = int((~np.isfinite(poses.p_nc).all(axis=1)).sum())
    open_ended = int((~np.isfinite(outlines).all(axis=(1, 2))).sum()) - unposed
    if unposed:
        lacks.append(f"the camera of {unposed} of {n} frames: they have no pose")
    if open_ended > 0 and (flight.terrain is not None or ground_height(flight) is not None):
        lacks.append(
            f"footprints of {open_ended} of {n} frames: part of the image looks past the ground, or nearly so"
        )
    return Views(ids, times[rows], poses.p_nc, poses.R_nc, outlines)


def _kept_frames(flight: Flight, ids: NDArray[np.object_]) -> NDArray[np.intp]:
    """Rows of too many frames: half of them evenly over the flight, the rest where something is detected."""
    seen = np.zeros(len(ids), bool)
    if flight.detections is not None:
        pixels = flight.detections[flight.detections["kind"] == "pixel"]["frame_id"]
        seen = np.isin(ids, pixels.to_numpy(object))
    some = np.flatnonzero(seen)
    return np.union1d(_evenly(len(ids), MOST_FRAMES // 2), some[_evenly(len(some), MOST_FRAMES // 2)])


def _of_camera(flight: Flight, frames: pd.DataFrame) -> NDArray[np.bool_]:
    """(N,) which frames are a camera's: those of sensors that detect pixels, where it says which look."""
    if "sensor" not in frames or flight.detections is None:
        return np.ones(len(frames), bool)
    pixels = flight.detections[flight.detections["kind"] == "pixel"]["frame_id"]
    sensors = frames["sensor"].fillna("")
    cameras = set(sensors[frames["frame_id"].isin(set(pixels))])
    return np.asarray(sensors.isin(cameras)) if cameras else np.ones(len(frames), bool)


def _nowhere(n: int) -> tuple[Array, Array, Array]:
    return np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((n, 4 * (SIDE - 1), 3), np.nan)


def border(width: int, height: int) -> Array:
    """(4 (SIDE - 1), 2) pixels around an image in order, corners first on each side."""
    along = np.linspace(0, 1, SIDE)[:-1]
    low, u, v = -0.5, width - 0.5, height - 0.5
    sides = [
        (low + along * (u - low), np.full_like(along, low)),
        (np.full_like(along, u), low + along * (v - low)),
        (u - along * (u - low), np.full_like(along, v)),
        (np.full_like(along, low), v - along * (v - low)),
    ]
    return np.concatenate([np.stack(side, axis=1) for side in sides])


def footprints(flight: Flight, poses: CameraPoses) -> Array:
    """The borders of images on the ground of a flight.

    Parameters
    ----------
    flight
        Its terrain is the ground, else a level plane (see `ground_height`).
    poses
        Of N images.

    Returns
    -------
    (N, B, 3) m in n; NaN for an image of which one ray misses the ground, or meets it flatter than
    `FLATTEST`, or where the ground is not known.
    """
    n, uv = len(poses.p_nc), border(poses.camera.width, poses.camera.height)
    each, pixels = poses.take(np.repeat(np.arange(n), len(uv))), np.tile(uv, (n, 1))
    level = ground_height(flight)
    if flight.terrain is not None:
        ground = pixels_to_terrain(each, pixels, flight.terrain).points
    elif level is not None:
        ground = georeference_pixels(each, pixels, np.full(len(pixels), level[0]))
    else:
        return np.full((n, len(uv), 3), np.nan)
    rays = pixel_rays(poses.camera, pixels, each.R_nc)
    with np.errstate(invalid="ignore"):
        steep = rays[:, 2] > np.sin(FLATTEST) * np.linalg.norm(rays, axis=1)
    outlines = ground.reshape(n, len(uv), 3).copy()
    outlines[~(steep & np.isfinite(ground).all(axis=1)).reshape(n, -1).all(axis=1)] = np.nan
    return outlines


def _sightings(flight: Flight, views: Views | None, lacks: list[str]) -> Sightings | None:
    table = flight.detections
    if table is None or not len(table):
        lacks.append("detections: the flight has none")
        return None
    others = table[table["kind"] != "pixel"]
    if len(others):
        kinds = ", ".join(sorted(set(others["kind"])))
        lacks.append(f"{len(others)} detections that are not of pixels ({kinds})")
    if views is None:
        return None
    pixels = table[table["kind"] == "pixel"]
    at = pd.Index(views.ids).get_indexer(pd.Index(pixels["frame_id"])) if len(pixels) else np.empty(0, int)
    uv = pixels[["u_px", "v_px"]].to_numpy(float) if len(pixels) else np.empty((0, 2))
    good = (at >= 0) & np.isfinite(uv).all(axis=1)
    names = (pixels["target_id"].fillna("") if "target_id" in pixels else pd.Series("", pixels.index)).astype(
        str
    )
    return Sightings(at[good].astype(np.intp), uv[good], names.to_numpy(object)[good])


def _points(flight: Flight, source: str | None, lacks: list[str], ellipses: bool) -> Points | None:
    if source is None or flight.frames is None or flight.manifest.camera is None:
        return None
    if flight.detections is None or not (flight.detections["kind"] == "pixel").any():
        return None
    try:
        seen = observe(flight, source)
        table = georeference(flight, seen, np.random.default_rng(0)) if ellipses else _placed(seen)
    except WildlabError as refusal:
        lacks.append(f"detections on the ground: {refusal.problem}")
        return None
    xyz = table[["north_m", "east_m", "down_m"]].to_numpy(float)
    good = np.isfinite(xyz).all(axis=1) & np.isfinite(table["time_s"].to_numpy(float))
    if not good.all():
        lacks.append(f"{int((~good).sum())} of {len(table)} detections on the ground: their rays miss it")
    table = table[good].sort_values("time_s", kind="stable").reset_index(drop=True)
    if len(table) > MOST_POINTS:
        lacks.append(f"every detection on the ground: {MOST_POINTS} of {len(table)} are, evenly")
        table = table.iloc[_evenly(len(table), MOST_POINTS)].reset_index(drop=True)
    if not len(table):
        return None
    P = covariances_of(table)
    error = np.full((len(table), 2), np.nan)
    if flight.truth is not None:
        try:
            scored = score_points(flight, table.assign(row=np.arange(len(table))))
            error[scored["row"].to_numpy(int)] = scored[["error_north_m", "error_east_m"]].to_numpy(float)
        except WildlabError as refusal:
            lacks.append(f"errors of the detections: {refusal.problem}")
    return Points(
        table["time_s"].to_numpy(float),
        table[["north_m", "east_m", "down_m"]].to_numpy(float),
        P,
        table["target_id"].astype(str).to_numpy(object),
        np.hypot(*error.T),
        position_nees(error, P),
    )


def _placed(seen: Observations) -> pd.DataFrame:
    """The table of `georeference` without covariances."""
    if seen.terrain is not None:
        ground = pixels_to_terrain(seen.poses, seen.uv, seen.terrain).points
    else:
        ground = georeference_pixels(seen.poses, seen.uv, seen.plane_down)
    columns = dict(zip(("north_m", "east_m", "down_m"), ground.T, strict=True))
    unknown = dict.fromkeys(("cov_nn", "cov_ne", "cov_ee"), np.nan)
    return seen.table.assign(**columns, **unknown)


def _tracks(flight: Flight, table: pd.DataFrame | None, lacks: list[str]) -> tuple[Estimates, ...]:
    if table is None or not len(table):
        lacks.append("tracks: none of this flight are at hand; wildlab track makes them")
        return ()
    level = ground_height(flight)
    found = []
    for (target, name, sensor), rows in table.groupby(["target", "filter", "sensor"], sort=False):
        rows = rows.sort_values("time_s", kind="stable")
        rows = rows.iloc[_evenly(len(rows), MOST_POSES)]
        xy = rows[["north_m", "east_m"]].to_numpy(float)
        if flight.terrain is not None:
            down = -flight.terrain.heights_at(xy)
        else:
            down = np.full(len(xy), 0.0 if level is None else level[0])
        found.append(
            Estimates(
                str(target),
                str(name),
                str(sensor),
                rows["time_s"].to_numpy(float),
                np.column_stack([xy, np.nan_to_num(down)]),
                rows[["p_00", "p_01", "p_01", "p_11"]].to_numpy(float).reshape(-1, 2, 2),
                np.hypot(*rows[["error_north_m", "error_east_m"]].to_numpy(float).T),
                rows["nees"].to_numpy(float),
            )
        )
    return tuple(found)


def _truth(flight: Flight, lacks: list[str]) -> tuple[Target, ...]:
    if flight.truth is None or not len(flight.truth):
        lacks.append("truth, and errors beside it: the flight has none")
        return ()
    offset = flight.manifest.clocks.truth_offset_s
    found = []
    for name, rows in flight.truth.groupby("target_id", sort=False):
        stamps = rows["time_s"].to_numpy(float) + offset
        where = rows[["north_m", "east_m", "down_m"]].to_numpy(float)
        if np.isnan(stamps).all():
            found.append(Target(str(name), stamps[:1], where[:1]))
            continue
        good = np.flatnonzero(np.isfinite(stamps) & np.isfinite(where).all(axis=1))
        good = good[np.argsort(stamps[good], kind="stable")]
        if len(good):
            keep = good[_evenly(len(good), MOST_POSES)]
            found.append(Target(str(name), stamps[keep], where[keep]))
    return tuple(found)
