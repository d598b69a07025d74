"""What a replay shows of a flight: what is there is taken, what lacks is named. Arrays in n, m, s."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.evaluate import score_points
from wildlab.analysis.georeference import covariances_of, georeference, observe
from wildlab.analysis.image_coverage import FLATTEST, POSITION, ground_height, ordered
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import position_nees
from wildlab.flight.clocks import frame_times, gimbal_angles, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.georeference import georeference_pixels, pixel_rays
from wildlab.geometry.terrain import Terrain, pixels_to_terrain

#: Letters of a name that are shown, at most.
MOST_LETTERS = 60


def plain(name: str) -> str:
    """A name as text of one line: nothing that turns, breaks or hides it.

    Examples
    --------
    >>> plain("boat\\n\\u202egnp.exe")
    'boat gnp.exe'
    """
    kept = "".join(" " if one.isspace() else one for one in name if one.isspace() or _visible(one))
    short = " ".join(kept.split())
    return short if len(short) <= MOST_LETTERS else f"{short[: MOST_LETTERS - 1]}…"


def _visible(letter: str) -> bool:
    return not unicodedata.category(letter).startswith("C")


def minutes(seconds: float) -> str:
    """``"25 min 3 s"``."""
    whole = round(seconds)
    return f"{whole // 60} min {whole % 60} s" if whole >= 60 else f"{whole} s"


Array = NDArray[np.float64]
Names = NDArray[np.object_]
#: Corners of an ellipse, and vertices of the ground along its longer side at most.
CORNERS, MOST_NODES = 32, 200
#: Of a normal distribution that an ellipse holds.
SHARE = 0.9


class Path(NamedTuple):
    """Where the aircraft was: (N,) s, (N, 3) m; and what the poses are called."""

    times: Array
    places: Array
    source: str


class Views(NamedTuple):
    """The frames of the camera, in the order of time. NaN where a pose or a footprint is not known.

    Attributes
    ----------
    ids
        (N,) what the flight calls them; never shown.
    times
        (N,) s.
    p_nc, R_nc
        (N, 3) m, (N, 3, 3): the camera's pose; takes a vector from c to n.
    outlines
        (N, B, 3) m, the border of each image on the ground, in order, not closed.
    """

    ids: Names
    times: Array
    p_nc: Array
    R_nc: Array
    outlines: Array


class Sightings(NamedTuple):
    """Detections in images.

    Attributes
    ----------
    frame
        (M,) row of `Views`.
    uv
        (M, 2) px, the middle of the first pixel being (0, 0).
    names
        (M,) the target that each names, "" none.
    """

    frame: NDArray[np.intp]
    uv: Array
    names: Names


class Points(NamedTuple):
    """Detections on the ground.

    Attributes
    ----------
    times, places, covariance
        (K,) s, (K, 3) m, (K, 2, 2) m^2 north before east; a covariance may be NaN.
    names
        (K,) the target, "" none.
    error, nees
        (K,) m and 1, point beside truth; NaN where that is not known.
    """

    times: Array
    places: Array
    covariance: Array
    names: Names
    error: Array
    nees: Array


class Estimates(NamedTuple):
    """One target as one filter follows it: as `Points`, one row for each look, in the order of time."""

    target: str
    filter: str
    sensor: str
    times: Array
    places: Array
    covariance: Array
    error: Array
    nees: Array


class Target(NamedTuple):
    """Where a target really was: (T,) s and (T, 3) m; one row and the time NaN where it never moves."""

    name: str
    times: Array
    places: Array

    @property
    def still(self) -> bool:
        """Whether it never moves."""
        return len(self.times) == 1 and bool(np.isnan(self.times[0]))


@dataclass(frozen=True)
class ReplayScene:
    """All that a replay shows.

    Attributes
    ----------
    name, kind
        Of the flight: what it is called, and ``twin`` or ``logged``.
    timed
        Whether times are times; else they number the images.
    path, camera, views, sightings, points, tracks, truth, terrain
        What there is; None or empty where there is nothing of it.
    ground
        Down coordinate of level ground, m, where there is no terrain; NaN where it is not known.
    lacks
        Clauses: what is not shown, and why.
    """

    name: str
    kind: str
    timed: bool
    path: Path | None = None
    camera: Camera | None = None
    views: Views | None = None
    sightings: Sightings | None = None
    points: Points | None = None
    tracks: tuple[Estimates, ...] = ()
    truth: tuple[Target, ...] = ()
    terrain: Terrain | None = None
    ground: float = float("nan")
    lacks: tuple[str, ...] = field(default=())

    @property
    def length(self) -> float:
        """The last time at which anything happens, s; zero where nothing does."""
        parts = (self.path, self.views, self.points, *self.tracks, *self.truth)
        times = [one.times for one in parts if one is not None]
        known = [float(np.nanmax(t)) for t in times if np.isfinite(t).any()]
        return max([0.0, *known])

    @property
    def extent(self) -> tuple[Array, Array]:
        """The least and the greatest north, east and down of what is shown, (3,) m each; the sea not."""
        parts = [np.empty((0, 3))]
        parts += [self.path.places] if self.path is not None else []
        parts += [self.views.outlines.reshape(-1, 3)] if self.views is not None else []
        parts += [self.points.places] if self.points is not None else []
        parts += [one.places for one in self.tracks]
        parts += [one.places for one in self.truth]
        known = np.concatenate(parts)
        known = known[np.isfinite(known).all(axis=1)]
        if not len(known):
            return np.full(3, -50.0), np.full(3, 50.0)
        return known.min(axis=0), known.max(axis=0)


def heights(scene: ReplayScene) -> Array:
    """Heights (N,) m of the path above the ground that is known, else above the origin of n; never NaN.

    Parameters
    ----------
    scene
        With a path.

    Returns
    -------
    (N,) m
    """
    assert scene.path is not None  # noqa: S101 - for the type checker
    up = -scene.path.places[:, 2]
    if scene.terrain is not None:
        ground = scene.terrain.heights_at(scene.path.places[:, :2])
        # Beside the map the ground is taken to be as high as the map is in the mean.
        return np.asarray(up - np.where(np.isfinite(ground), ground, np.nanmean(scene.terrain.height)))
    return np.asarray(up + (scene.ground if np.isfinite(scene.ground) else 0.0))


def ellipse_rings(places: Array, covariance: Array) -> Array:
    """The ellipses about points on the ground that hold `SHARE` of a normal distribution.

    Parameters
    ----------
    places
        (N, 3) m in n.
    covariance
        (N, 2, 2) m^2, north before east.

    Returns
    -------
    (N, CORNERS + 1, 3) m in n, closed.
    """
    size = float(np.sqrt(-2.0 * np.log(1.0 - SHARE)))  # the chi-square with two degrees of freedom
    values, vectors = np.linalg.eigh(covariance)
    turn = np.linspace(0.0, 2 * np.pi, CORNERS + 1)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    ring = np.einsum("nij,kj->nki", vectors * (size * np.sqrt(np.maximum(values, 0.0)))[:, None, :], circle)
    rings = np.repeat(places[:, None, :], len(turn), axis=1)
    rings[..., :2] += ring
    return rings


def relief(height: NDArray[np.float32], step: float) -> tuple[Array, NDArray[np.uint8], Array]:
    """Terrain thinned to `MOST_NODES` along its longer side, shaded from the north-west.

    Parameters
    ----------
    height
        (R, C) m, NaN where nothing is known; rows run north.
    step
        Between nodes, m.

    Returns
    -------
    heights, colours, normals
        (r, c) m, (r, c, 3) and (r, c, 3) east, north, up.
    """
    every = max(1, -(-max(height.shape) // MOST_NODES))
    h = np.asarray(height[::every, ::every], float)
    up_north, up_east = np.gradient(np.nan_to_num(h), every * step) if min(h.shape) > 1 else (0 * h, 0 * h)
    normals = np.stack([-up_east, -up_north, np.ones_like(h)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    light = normals @ (np.array([-1.0, 1.0, 1.2]) / np.linalg.norm([-1.0, 1.0, 1.2]))
    tone = np.clip(0.75 + 0.5 * (light - np.median(light)), 0.45, 1.0)
    colours = (tone[..., None] * np.array([222, 226, 206])).clip(0, 255).astype(np.uint8)
    return h, colours, normals


def mesh(
    height: NDArray[np.float32], north: float, east: float, step: float
) -> tuple[Array, NDArray[np.uint32], NDArray[np.uint8], Array]:
    """Terrain as triangles, thinned to `MOST_NODES` along its longer side and shaded from the north-west.

    Parameters
    ----------
    height
        (R, C) m, NaN where nothing is known; rows run north.
    north, east
        Of its first node, m.
    step
        Between nodes, m.

    Returns
    -------
    vertices, triangles, colours, normals
        (V, 3) m east, north, up; (T, 3); (V, 3); (V, 3). A triangle with an unknown corner is left out.
    """
    h, colours, normals = relief(height, step)
    every = max(1, -(-max(height.shape) // MOST_NODES))
    rows, columns = h.shape
    x, y = np.meshgrid(east + every * step * np.arange(columns), north + every * step * np.arange(rows))
    vertices = np.stack([x, y, np.nan_to_num(h)], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel()
    c, d = corner[1:, :-1].ravel(), corner[1:, 1:].ravel()
    triangles = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    triangles = triangles[np.isfinite(h.ravel())[triangles].all(axis=1)]
    return vertices, triangles.astype(np.uint32), colours.reshape(-1, 3), normals.reshape(-1, 3)


#: More are not shown: a picture on a screen does not have them, and files grow.
MOST_POSES, MOST_FRAMES, MOST_POINTS = 6000, 3000, 6000
#: Rays along each side of an image.
SIDE = 5


def scene_of(
    flight: Flight,
    source: str | None = None,
    estimates: pd.DataFrame | None = None,
) -> ReplayScene:
    """What a replay shows of a flight.

    Parameters
    ----------
    flight
        With anything missing.
    source
        Name of the ``nav`` table; left out, the best known one.
    estimates
        A table of tracks, as `wildlab.analysis.tracks.scores.estimates_table` makes it.

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
    points = _points(flight, source, lacks)
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


def spread_evenly(n: int, most: int) -> NDArray[np.intp]:
    """Rows of ``n``, all or ``most`` of them evenly, the first and the last among them."""
    return np.arange(n) if n <= most else np.unique(np.linspace(0, n - 1, most).round().astype(np.intp))


def _path(flight: Flight, source: str | None, lacks: list[str]) -> Path | None:
    if source is None:
        lacks.append("the aircraft: the flight has no poses")
        return None
    nav = flight.nav[source]
    times, places = ordered(nav, POSITION)
    if not len(times):
        lacks.append(f"the aircraft: no pose of {source} has a time and a place")
        return None
    keep = spread_evenly(len(times), MOST_POSES)
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
    return np.union1d(
        spread_evenly(len(ids), MOST_FRAMES // 2), some[spread_evenly(len(some), MOST_FRAMES // 2)]
    )


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


def _points(flight: Flight, source: str | None, lacks: list[str]) -> Points | None:
    if source is None or flight.frames is None or flight.manifest.camera is None:
        return None
    if flight.detections is None or not (flight.detections["kind"] == "pixel").any():
        return None
    try:
        seen = observe(flight, source)
        table = georeference(seen, np.random.default_rng(0))
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
        table = table.iloc[spread_evenly(len(table), MOST_POINTS)].reset_index(drop=True)
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


def _tracks(flight: Flight, table: pd.DataFrame | None, lacks: list[str]) -> tuple[Estimates, ...]:
    if table is None or not len(table):
        lacks.append("tracks: none of this flight are at hand; wildlab track makes them")
        return ()
    level = ground_height(flight)
    found = []
    for (target, name, sensor), rows in table.groupby(["target", "filter", "sensor"], sort=False):
        rows = rows.sort_values("time_s", kind="stable")
        rows = rows.iloc[spread_evenly(len(rows), MOST_POSES)]
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
            keep = good[spread_evenly(len(good), MOST_POSES)]
            found.append(Target(str(name), stamps[keep], where[keep]))
    return tuple(found)
