"""What a replay shows of a flight: what is there is taken, what lacks is named. Arrays in n, m, s."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.accuracy import observe_calibrated
from wildlab.analysis.georeference import (
    covariances_of,
    error_covariances,
    errors_of,
    georeference,
    score_points,
)
from wildlab.analysis.overview import cover_images, ground_height, ordered
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import position_nees
from wildlab.flight.clocks import frame_times
from wildlab.flight.schema import POSITION
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.georeference import Terrain
from wildlab.replay.images import spread_evenly

#: Letters of a name that are shown, at most.
MOST_LETTERS = 60


def plain(name: str) -> str:
    """A name as text of one line: nothing that turns, breaks or hides it.

    Examples
    --------
    >>> plain("boat\\n\\u202egnp.exe")
    'boat gnp.exe'
    """
    short = " ".join("".join(one if one.isprintable() else " " for one in name).split())
    return short if len(short) <= MOST_LETTERS else f"{short[: MOST_LETTERS - 1]}…"


Array = NDArray[np.float64]
Names = NDArray[np.object_]
#: Nodes of the ground along its longer side, at most.
MOST_NODES = 200


class Path(NamedTuple):
    """Where the aircraft was: (N,) s, (N, 3) m; and what the poses are called."""

    times: Array
    places: Array
    source: str


class Views(NamedTuple):
    """The frames of the camera, in the order of time.

    Attributes
    ----------
    ids
        (N,) what the flight calls them; never shown.
    times
        (N,) s.
    outlines
        (N, B, 2) m, the border of each image on the ground, in order, not closed; NaN where it is not known.
    """

    ids: Names
    times: Array
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
        """The least and the greatest north and east of what is shown, (2,) m each."""
        parts = [] if self.views is None else [self.views.outlines.reshape(-1, 2)]
        parts += [one.places[:, :2] for one in (self.path, self.points, *self.tracks, *self.truth) if one]
        known = np.concatenate([np.empty((0, 2)), *parts])
        known = known[np.isfinite(known).all(axis=1)]
        return (known.min(axis=0), known.max(axis=0)) if len(known) else (np.full(2, -50.0), np.full(2, 50.0))


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


def relief(height: NDArray[np.float32], step: float) -> tuple[Array, NDArray[np.uint8]]:
    """Terrain thinned to `MOST_NODES` along its longer side, shaded from the north-west.

    Parameters
    ----------
    height
        (R, C) m, NaN where nothing is known; rows run north.
    step
        Between nodes, m.

    Returns
    -------
    heights, colours
        (r, c) m and (r, c, 3).
    """
    every = max(1, -(-max(height.shape) // MOST_NODES))
    h = np.asarray(height[::every, ::every], float)
    up_north, up_east = np.gradient(np.nan_to_num(h), every * step) if min(h.shape) > 1 else (0 * h, 0 * h)
    normals = np.stack([-up_east, -up_north, np.ones_like(h)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    light = normals @ (np.array([-1.0, 1.0, 1.2]) / np.linalg.norm([-1.0, 1.0, 1.2]))
    tone = np.clip(0.75 + 0.5 * (light - np.median(light)), 0.45, 1.0)
    colours = (tone[..., None] * np.array([222, 226, 206])).clip(0, 255).astype(np.uint8)
    return h, colours


#: More are not shown: a picture on a screen does not have them, and files grow.
MOST_POSES, MOST_FRAMES, MOST_POINTS = 6000, 3000, 6000


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
        A table of tracks, as `wildlab.analysis.tracks.tracker.estimates_table` makes it.

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
            "there is nothing to play back",
            "see wildlab check",
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
    ids, cover = frames["frame_id"].to_numpy(object)[rows], cover_images(flight, source)
    if cover is None:
        lacks.append("what the camera sees of the ground: camera, poses or ground are not known")
        return Views(ids, times[rows], np.full((len(rows), 4, 2), np.nan))
    for count, why in (
        (int((~cover.posed[rows]).sum()), "they have no pose"),
        (int(cover.flat[rows].sum()), "part of the image looks past the ground, or nearly so"),
    ):
        if count:
            lacks.append(f"footprints of {count} of {len(rows)} frames: {why}")
    return Views(ids, times[rows], cover.outlines[rows])


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
        seen, errors = observe_calibrated(flight, source)
        table = georeference(seen, np.random.default_rng(0), errors)
    except WildlabError as refusal:
        lacks.append(f"detections on the ground: {refusal.problem}")
        return None
    xyz = table[POSITION].to_numpy(float)
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
    error, of_error = np.full((len(table), 2), np.nan), P.copy()
    if flight.truth is not None:
        try:
            scored = score_points(flight, table.assign(row=np.arange(len(table))))
            rows = scored["row"].to_numpy(int)
            error[rows], of_error[rows] = errors_of(scored), error_covariances(scored)
        except WildlabError as refusal:
            lacks.append(f"errors of the detections: {refusal.problem}")
    return Points(
        table["time_s"].to_numpy(float),
        table[POSITION].to_numpy(float),
        P,
        table["target_id"].astype(str).to_numpy(object),
        np.hypot(*error.T),
        position_nees(error, of_error),
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
        where = rows[POSITION].to_numpy(float)
        if np.isnan(stamps).all():
            found.append(Target(str(name), stamps[:1], where[:1]))
            continue
        good = np.flatnonzero(np.isfinite(stamps) & np.isfinite(where).all(axis=1))
        good = good[np.argsort(stamps[good], kind="stable")]
        if len(good):
            keep = good[spread_evenly(len(good), MOST_POSES)]
            found.append(Target(str(name), stamps[keep], where[keep]))
    return tuple(found)
