"""A flight's detections as points on the ground, each with its covariance, as files for maps, and against
surveyed truth.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.analysis import Fact, fact
from wildlab.errors import WildlabError
from wildlab.evaluation.intervals import time_blocks
from wildlab.files import write_atomic, write_csv
from wildlab.flight.clocks import (
    frame_times,
    gimbal_angles,
    gimbal_at,
    pose_finder,
    poses_at,
    truth_at,
    truth_deviations,
)
from wildlab.flight.schema import POSITION
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.corrections import Calibration, PosesAt, calibrated_poses
from wildlab.geometry.covariances import ellipse_axes, inside_ellipse, pose_covariance
from wildlab.geometry.frames import Array, Indices, Mask, ned_to_geodetic
from wildlab.geometry.georeference import Terrain, georeference_pixels, pixels_to_terrain
from wildlab.geometry.rays import RAY_STATUS
from wildlab.geometry.uncertainty import PoseErrors, ground_covariance

#: Standard deviations assumed where neither the log nor the manifest states one; those of the attitude as in
#: `wildlab.geometry.covariances`.
USUAL = {
    "pixel_px": 2.0,
    "position_horizontal_m": 2.0,
    "position_vertical_m": 3.0,
    "tilt_deg": 1.0,
    "heading_deg": 2.0,
    "misalignment_deg": 0.0,
    "plane_height_m": 1.0,
}


@dataclass(frozen=True)
class Observations:
    """The pixel detections of a flight with everything needed to put them on the ground. One row each.

    Attributes
    ----------
    flight, source
        Whose they are, and the name of the ``nav`` table that the poses come from.
    table
        ``detection_id``, ``frame_id``, ``group``, ``target_id``, ``time_s`` (flight time), and ``ground``:
        whose height that has, ``terrain``, ``stated`` or ``truth``; "" where it is not known.
    uv
        (N, 2) pixels.
    poses
        The camera's, one a detection; NaN where the log has none, a covariance where it states one. The mount
        is calibrated or not.
    plane_down
        Down coordinate of the ground at each detection, (N,); NaN where it is not known. Over terrain, of the
        point where the ray meets it.
    terrain
        The flight's, where it has one.
    """

    flight: Flight
    source: str
    table: pd.DataFrame
    uv: Array
    poses: CameraPoses
    plane_down: Array
    terrain: Terrain | None = None

    def take(self, rows: Mask) -> Observations:
        """The observations of some rows."""
        return replace(
            self,
            table=self.table[rows].reset_index(drop=True),
            uv=self.uv[rows],
            poses=self.poses.take(rows),
            plane_down=self.plane_down[rows],
        )

    def of(self, scored: pd.DataFrame) -> Observations:
        """The observations of a scored table."""
        return self.take(self.table["detection_id"].isin(scored["detection_id"]).to_numpy())


def observe(
    flight: Flight, source: str | None = None, stamps: str = "time_s", clock_shift: float = 0.0
) -> Observations:
    """Collect the pixel detections of a flight with the poses of one navigation source.

    The ground of a detection is the flight's terrain; without one, the detection's own ``plane_down_m``. Only
    where neither is known is it the height of the target it names: the truth then has a part in the answer.

    Parameters
    ----------
    flight
        With frames, pixel detections and poses.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's.
    stamps
        Column of the frames that holds the camera's stamps.
    clock_shift
        Seconds added to the stamps on top of the manifest's offset.

    Returns
    -------
    Observations

    Raises
    ------
    WildlabError
        Where the flight has no frames, detections or poses, no such column, or two sources to choose from.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> flight = simulate_twin("large-ship", 1)
    >>> seen = observe(flight, "autopilot")
    >>> seen.uv.shape == (len(flight.detections), 2)
    True
    """
    detections = flight.table("detections")
    frames = flight.table("frames")
    if stamps not in frames:
        known = ", ".join(name for name in map(str, frames) if name.startswith("time"))
        raise WildlabError(
            f"the frames have no stamps {stamps!r}",
            f"use one of: {known}",
            file=flight.folder,
            field="frames",
        )
    pixels = detections[detections["kind"] == "pixel"].reset_index(drop=True)
    if pixels.empty:
        raise WildlabError(
            "there is no detection of the kind 'pixel'",
            "add detections with u_px and v_px",
            file=flight.folder,
            field="detections",
        )
    name, _ = flight.pose_source(source)
    at = flight.frame_rows(pixels["frame_id"])
    own_clock = frames[stamps].to_numpy(float) - frames["time_s"].to_numpy(float)
    times = (frame_times(flight) + own_clock + clock_shift)[at]
    table = pd.DataFrame(
        {
            "detection_id": pixels["detection_id"],
            "frame_id": pixels["frame_id"],
            "group": frames["group"].to_numpy()[at] if "group" in frames else "",
            "target_id": pixels["target_id"].fillna("") if "target_id" in pixels else "",
            "time_s": np.where(at < 0, np.nan, times),
        }
    )
    down = truth_of(flight, table)[:, 2]
    table["ground"] = np.where(np.isnan(down), "", "truth")
    if "plane_down_m" in pixels:
        stated = pixels["plane_down_m"].notna().to_numpy()
        down[stated] = pixels.loc[stated, "plane_down_m"]
        table.loc[stated, "ground"] = "stated"
    if flight.terrain is not None:
        table["ground"] = "terrain"
    uv, poses = pixels[["u_px", "v_px"]].to_numpy(float), camera_poses(flight, name, times, at)
    return _grounded(Observations(flight, name, table, uv, poses, down, flight.terrain))


def camera_poses(flight: Flight, source: str, times: Array, rows: Indices) -> CameraPoses:
    """The camera's poses at the images in rows (N,) of the frames, at times (N,) s by the log's clock.

    NaN where the log has none, and for a row of -1. A pose that belongs to an image by name is its own.
    """
    name, nav = flight.pose_source(source)
    p_nb, R_nb, covariance = poses_at(nav, times, flight.table("frames")["frame_id"].iloc[rows])
    pan, tilt = gimbal_angles(flight, times, rows)
    p_nb[rows < 0], R_nb[rows < 0] = np.nan, np.nan
    m = flight.manifest
    return CameraPoses(m.geometry_camera(), m.geometry_mount(name), p_nb, R_nb, pan, tilt, covariance)


def camera_poses_at(flight: Flight, times: Array, source: str | None = None) -> CameraPoses:
    """The camera's poses at times (N,) s, by the log: NaN where it has none."""
    name, nav = flight.pose_source(source)
    p_nb, R_nb, covariance = poses_at(nav, times)
    pan, tilt = (None, None) if flight.gimbal is None else gimbal_at(flight.gimbal, times)
    manifest = flight.manifest
    return CameraPoses(
        manifest.geometry_camera(), manifest.geometry_mount(name), p_nb, R_nb, pan, tilt, covariance
    )


def _grounded(observations: Observations) -> Observations:
    """Over terrain, the plane of each observation is level at the point where its ray meets the ground."""
    o = observations
    if o.terrain is None:
        return o
    return replace(o, plane_down=pixels_to_terrain(o.poses, o.uv, o.terrain).points[:, 2])


def shifting_poses(observations: Observations) -> PosesAt:
    """From seconds to the poses of observations whose camera stamps are so much later; the last few are kept.

    They keep their covariance, and angles of a gimbal that the images state.
    """
    flight, times = observations.flight, observations.table["time_s"].to_numpy(float)
    find = pose_finder(flight.nav[observations.source], observations.table["frame_id"])
    rows = flight.frame_rows(observations.table["frame_id"])

    @lru_cache(maxsize=4)
    def at(shift: float) -> CameraPoses:
        p_nb, R_nb = find(times + shift)
        poses = replace(observations.poses, p_nb=p_nb, R_nb=R_nb)
        if flight.gimbal is None:
            return poses
        pan, tilt = gimbal_angles(flight, times + shift, rows)
        return replace(poses, pan=pan, tilt=tilt)

    return at


def calibrated(observations: Observations, calibration: Calibration) -> Observations:
    """The observations with an estimated calibration applied to mount, camera, pose and times."""
    poses = calibrated_poses(calibration, shifting_poses(observations))
    times = observations.table["time_s"] + calibration.value("clock")
    return _grounded(replace(observations, table=observations.table.assign(time_s=times), poses=poses))


def pose_errors(observations: Observations, assumed: dict[str, float] | None = None) -> PoseErrors:
    """Covariances of what the ground points are computed from.

    The pose's covariance is the log's where it has one; all else comes from ``assumed``, then the manifest's
    ``[uncertainty]``, then :data:`USUAL`, in that order. ``assumed`` overrides the log too. The height of
    terrain is as good as its map is said to be.

    Parameters
    ----------
    observations
        From `observe`.
    assumed
        Standard deviations by the names of :data:`USUAL`.

    Returns
    -------
    PoseErrors
        Of the N observations.
    """
    ground = observations.terrain
    of_map = {} if ground is None or np.isnan(ground.sd) else {"plane_height_m": ground.sd}
    sd = assumed_deviations(observations.flight) | of_map | (assumed or {})
    pose = observations.poses.covariance
    if pose is None or assumed is not None:
        pose = assumed_pose_covariance(observations.poses.R_nb, sd)
    return PoseErrors(
        pixel=np.eye(2) * sd["pixel_px"] ** 2,
        pose=pose,
        mount=np.eye(3) * np.radians(sd["misalignment_deg"]) ** 2,
        plane=sd["plane_height_m"] ** 2,
    )


def assumed_pose_covariance(R_nb: Array, sd: dict[str, float]) -> Array:
    """Covariance of poses whose log has none: (6, 6) or (N, 6, 6), see `pose_covariance`.

    Parameters
    ----------
    R_nb
        (3, 3) or (N, 3, 3): which way the body lies.
    sd
        By the names of :data:`USUAL`.
    """
    tilt, heading = np.radians([sd["tilt_deg"], sd["heading_deg"]])
    return pose_covariance(sd["position_horizontal_m"], sd["position_vertical_m"], tilt, heading, R_nb)


def assumed_deviations(flight: Flight) -> dict[str, float]:
    """Standard deviations by the names of :data:`USUAL`: the manifest's, else the usual ones."""
    stated = flight.manifest.uncertainty
    return {
        name: usual if getattr(stated, name) is None else float(getattr(stated, name))
        for name, usual in USUAL.items()
    }


def georeference(
    observations: Observations, rng: np.random.Generator, errors: PoseErrors | None = None
) -> pd.DataFrame:
    """Ground points of a flight's pixel detections, one row each, NaN where the ray misses the ground.

    Returns
    -------
    DataFrame
        The table of the observations with ``north_m``, ``east_m``, ``down_m``, the covariance ``cov_nn``,
        ``cov_ne``, ``cov_ee`` (m2) and ``ellipse`` (how the covariance was found). Over terrain also ``ray``:
        what became of it, in the words of `wildlab.geometry.georeference.RAY_STATUS`.
    """
    o = observations
    if errors is None:
        errors = pose_errors(o)
    met = None if o.terrain is None else pixels_to_terrain(o.poses, o.uv, o.terrain)
    ground = georeference_pixels(o.poses, o.uv, o.plane_down) if met is None else met.points
    surface = o.plane_down if o.terrain is None else o.terrain
    covariance, method = ground_covariance(o.poses, o.uv, surface, errors, rng, met)
    more = {} if met is None else {"ray": [RAY_STATUS[int(one)] for one in met.became]}
    return o.table.assign(
        north_m=ground[:, 0],
        east_m=ground[:, 1],
        down_m=ground[:, 2],
        cov_nn=covariance[:, 0, 0],
        cov_ne=covariance[:, 0, 1],
        cov_ee=covariance[:, 1, 1],
        ellipse=method,
        **more,
    )


def covariances_of(points: pd.DataFrame) -> Array:
    """The covariances (N, 2, 2) of a table of ground points.

    Parameters
    ----------
    points
        From `georeference`.

    Returns
    -------
    (N, 2, 2) m^2, north before east

    Examples
    --------
    >>> points = pd.DataFrame({"cov_nn": [4.0], "cov_ne": [1.0], "cov_ee": [2.0]})
    >>> covariances_of(points).tolist()
    [[[4.0, 1.0], [1.0, 2.0]]]
    """
    c = points[["cov_nn", "cov_ne", "cov_ne", "cov_ee"]].to_numpy(float)
    return c.reshape(-1, 2, 2)


def truth_of(flight: Flight, table: pd.DataFrame) -> Array:
    """True positions (N, 3) in n of the targets that detections name; NaN where none is named or known.

    Parameters
    ----------
    flight
        The flight.
    table
        With ``target_id`` and ``time_s``, N rows.

    Returns
    -------
    (N, 3) m
    """
    if flight.truth is None or flight.truth.empty:
        return np.full((len(table), 3), np.nan)
    times, offset = table["time_s"].to_numpy(float), flight.manifest.clocks.truth_offset_s
    targets, where = truth_at(flight.truth, times, offset)
    at = pd.Index(targets).get_indexer(pd.Index(table["target_id"]))
    return np.where((at >= 0)[:, None], where[at, np.arange(len(at))], np.nan)


def ground_facts(observations: Observations, points: pd.DataFrame) -> list[Fact]:
    """What the points lie on, and what became of the rays.

    Parameters
    ----------
    observations, points
        What was put on the ground, and where it lies.

    Returns
    -------
    list of Fact
        Of ``data/messages/en/terminal.toml``.
    """
    placed, of = int(points["north_m"].notna().sum()), len(points)
    if observations.terrain is None:
        whose = points.loc[points["north_m"].notna(), "ground"].value_counts()
        heights = {name: int(whose.get(name, 0)) for name in ("stated", "truth")}
        return [fact("ground-level", placed=placed, of=of, **heights)]
    became = "; ".join(f"{n} {words}" for words, n in points["ray"].value_counts().items())
    return [fact("ground-terrain", of=of, became=became or "none")]


#: What is written, by the end of the name.
SUFFIXES = (".csv", ".geojson")
#: Share of the truth that the ellipses are to hold, and corners of one as a polygon.
LEVEL, CORNERS = 0.9, 72
#: What heights on a map count from.
ELLIPSOID = "height above the WGS 84 ellipsoid"


def write_points(flight: Flight, points: pd.DataFrame, path: Path, source: str = "") -> None:
    """Write points as CSV (metres from the flight's origin), or as GeoJSON with their ellipses as polygons
    (WGS84 longitude, latitude, of points the height above what the flight's heights count from).

    Parameters
    ----------
    flight
        Whose they are.
    points
        From `wildlab.analysis.georeference.georeference`; those without a place are in the CSV alone.
    path
        Ends with one of `SUFFIXES`.
    source
        The poses that they come from.

    Raises
    ------
    WildlabError
        Where it ends otherwise.
    """
    if path.suffix not in SUFFIXES:
        raise WildlabError(
            f"nobody knows how to write {path.suffix!r}", f"end it with {' or '.join(SUFFIXES)}", file=path
        )
    if path.suffix == ".csv":
        write_csv(path, _described(flight, points, "down from the flight's origin", source), "%.3f")
        return
    reference = flight.manifest.vertical.counted_from
    counted = ELLIPSOID if reference == "ellipsoid" else f"height above {reference}"
    table = _described(flight, points, counted, source)
    placed = table[table["north_m"].notna() & table["down_m"].notna()]
    degrees = _degrees(flight, placed[POSITION].to_numpy(float))
    places: list[object] = [[*row[:2].round(8).tolist(), round(float(row[2]), 3)] for row in degrees]
    known = placed[placed["long_90_m"].notna() & placed["short_90_m"].notna()]
    rings = [[_degrees(flight, one)[:, :2].round(8).tolist()] for one in _rings(known)]
    features = _features(placed, "Point", places) + _features(known, "Polygon", rings)
    content = {"type": "FeatureCollection", "features": features}
    write_atomic(path, json.dumps(content, allow_nan=False, separators=(",", ":")))


def _features(table: pd.DataFrame, kind: str, places: Sequence[object]) -> list[dict[str, object]]:
    """One feature a row, with what `PROPERTIES` names."""
    rows = table[[name for name in PROPERTIES if name in table]].to_dict("records")
    known = [{key: None if value != value else value for key, value in row.items()} for row in rows]
    return [
        {"type": "Feature", "geometry": {"type": kind, "coordinates": place}, "properties": row}
        for place, row in zip(places, known, strict=True)
    ]


def _described(flight: Flight, points: pd.DataFrame, vertical: str, source: str) -> pd.DataFrame:
    """The points with what they lie on, and half axes (m) and bearing (deg) of their 90 % ellipses."""
    ground = "level ground" if flight.terrain is None else "terrain"
    kinds = points["ellipse"].fillna("")
    long, short, bearing = ellipse_axes(covariances_of(points))
    return points.assign(
        long_90_m=long,
        short_90_m=short,
        bearing_deg=np.degrees(bearing) % 180,
        level=LEVEL,
        method=[f"{ground}, ellipse {kind}" if kind else ground for kind in kinds],
        vertical_reference=vertical,
        source=source,
        flight=flight.name,
    )


#: What goes along with a point into a map.
PROPERTIES = (
    "detection_id", "frame_id", "target_id", "time_s", "long_90_m", "short_90_m", "bearing_deg", "level",
    "ground", "ellipse", "method", "vertical_reference", "source", "flight",
)  # fmt: skip


def _degrees(flight: Flight, place: Array) -> Array:
    llh = ned_to_geodetic(place, flight.manifest.origin_tuple())
    return np.stack([np.degrees(llh[:, 1]), np.degrees(llh[:, 0]), llh[:, 2]], axis=1)


def _rings(placed: pd.DataFrame) -> Array:
    """(N, CORNERS + 1, 3) m in n, closed, the ellipses at the heights of their points; counterclockwise on a
    map, as RFC 7946 has outer rings."""
    turn = np.linspace(0, -2 * np.pi, CORNERS + 1)
    along = placed["long_90_m"].to_numpy(float)[:, None] * np.cos(turn)
    across = placed["short_90_m"].to_numpy(float)[:, None] * np.sin(turn)
    bearing = np.radians(placed["bearing_deg"].to_numpy(float))[:, None]
    north = along * np.cos(bearing) - across * np.sin(bearing)
    east = along * np.sin(bearing) + across * np.cos(bearing)
    middle = placed[POSITION].to_numpy(float)[:, None, :]
    return middle + np.stack([north, east, np.zeros_like(north)], axis=2)


def score_points(flight: Flight, points: pd.DataFrame) -> pd.DataFrame:
    """Errors of ground points against the truth, by the flight's scoring rule.

    ``labelled``: the target that the detection names; points without one are left out. ``nearest``: the
    target nearest to the point, horizontally, among those whose position is known at that time.

    Parameters
    ----------
    flight
        With truth.
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        The points that can be judged, with ``truth_id``, ``error_north_m``, ``error_east_m``, ``error_m``
        (NaN where the ray missed the ground), ``truth_sd_m`` (see `truth_deviations`), ``best_truth`` (see
        `best_known`) and ``inside_90`` (whether the truth lies in the 90 % ellipse, widened by its own error;
        NaN where there is no ellipse).

    Raises
    ------
    WildlabError
        Where the flight has no truth, or none of its points can be judged.

    Examples
    --------
    >>> from wildlab.analysis.georeference import georeference, observe
    >>> from wildlab.simulation.twins import simulate_twin
    >>> flight = simulate_twin("large-ship", 1)
    >>> points = georeference(observe(flight, "truth"), np.random.default_rng(0))
    >>> bool(score_points(flight, points)["error_m"].median() < 20)
    True
    """
    truth = flight.table("truth")
    xy = points[["north_m", "east_m"]].to_numpy(float)
    if flight.manifest.scoring.rule == "labelled":
        where, names = truth_of(flight, points), points["target_id"].to_numpy(str)
    else:
        offset = flight.manifest.clocks.truth_offset_s
        targets, positions = truth_at(truth, points["time_s"].to_numpy(float), offset_s=offset)
        distance = np.linalg.norm(positions[:, :, :2] - xy, axis=2)
        nearest = np.where(np.isnan(distance), np.inf, distance).argmin(axis=0)
        where, names = positions[nearest, np.arange(len(points))], np.asarray(targets)[nearest]
    known = np.isfinite(where[:, :2]).all(axis=1)
    if not known.any():
        raise WildlabError(
            "no detection can be compared with the truth",
            "name the targets in the detections' target_id, or set the scoring rule to 'nearest'",
            file=flight.folder,
            field="detections.target_id",
        )
    error = (xy - where[:, :2])[known]
    scored = points[known].assign(
        truth_id=names[known],
        truth_sd_m=truth_deviations(flight, names[known]),
        error_north_m=error[:, 0],
        error_east_m=error[:, 1],
        error_m=np.hypot(*error.T),
    )
    covariance = error_covariances(scored)
    inside = inside_ellipse(error, covariance).astype(float)
    inside[~np.isfinite(covariance).all(axis=(1, 2))] = np.nan
    best = _best_truth(scored, set(truth.loc[truth["time_s"].notna(), "target_id"]))
    return scored.assign(inside_90=inside, best_truth=best).reset_index(drop=True)


#: Fewer points than this say little about a flight, and so do fewer images.
FEW_POINTS, FEWEST_IMAGES = 10, 6
#: Truths whose standard deviations differ by no more than this are equally well known, m.
ALIKE_M = 0.5


def _best_truth(scored: pd.DataFrame, tracks: Collection[str]) -> Mask:
    """Which points are compared with the best known truth that enough of them have; all where none has.

    Where nothing is stated, a mark counts as exact and a receiver's track as the least known.
    """
    sd, track = scored["truth_sd_m"].to_numpy(float), scored["truth_id"].isin(tracks).to_numpy()
    sd = np.where(track & (sd == 0), np.inf, sd)
    for least in np.unique(sd):
        rows = sd <= least + ALIKE_M
        located = scored[rows & scored["error_m"].notna().to_numpy()]
        if len(located) >= FEW_POINTS and located["frame_id"].nunique() >= FEWEST_IMAGES:
            return np.asarray(rows)
    return np.ones(len(scored), bool)


def best_known(scored: pd.DataFrame) -> pd.DataFrame:
    """The rows of a scored table that are compared with its best known truth."""
    return scored[scored["best_truth"]]


def error_covariances(scored: pd.DataFrame) -> Array:
    """The covariances (N, 2, 2) m^2 of the errors of a scored table: of its points and of the truth."""
    return covariances_of(scored) + scored["truth_sd_m"].to_numpy(float)[:, None, None] ** 2 * np.eye(2)


def errors_of(scored: pd.DataFrame) -> Array:
    """The errors (N, 2) north-east of a scored table.

    Parameters
    ----------
    scored
        From `score_points`.

    Returns
    -------
    (N, 2) m, point minus truth

    Examples
    --------
    >>> errors_of(pd.DataFrame({"error_north_m": [1.0], "error_east_m": [2.0]})).tolist()
    [[1.0, 2.0]]
    """
    return scored[["error_north_m", "error_east_m"]].to_numpy(float)


def recorded_answers(flight: Flight) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Positions that other programs gave for the same detections, scored like ours.

    Parameters
    ----------
    flight
        With detections of the kind ``position``, and truth.

    Returns
    -------
    answers, unlabelled
        Scored tables by program; and the programs that name no target with a truth where they have to.
    """
    detections, frames = flight.table("detections"), flight.table("frames")
    answers, unlabelled = dict[str, pd.DataFrame](), list[str]()
    for program, rows in detections[detections["kind"] == "position"].groupby("source", sort=False):
        names = rows["target_id"].fillna("") if "target_id" in rows else pd.Series("", rows.index)
        known = names.isin(set(flight.table("truth")["target_id"]))
        if flight.manifest.scoring.rule == "labelled" and not known.any():
            unlabelled.append(str(program))
            continue
        at = flight.frame_rows(rows["frame_id"])
        points = rows[["detection_id", "frame_id", "north_m", "east_m"]].assign(
            target_id=names, time_s=frames["time_s"].to_numpy(float)[at],
            cov_nn=np.nan, cov_ne=np.nan, cov_ee=np.nan,
        )  # fmt: skip
        answers[str(program)] = score_points(flight, points.reset_index(drop=True))
    return answers, unlabelled


def blocks_of(flight: Flight, table: pd.DataFrame) -> Indices:
    """Which block in time order (N,) each point belongs to: see `wildlab.evaluation.intervals.time_blocks`.

    Parameters
    ----------
    flight
        Says whether its times are times, or merely number the images.
    table
        With ``frame_id`` and ``time_s``, N rows.

    Returns
    -------
    (N,) integers from 0
    """
    times = table["time_s"].to_numpy(float)
    if flight.timed and np.isfinite(times).all():
        return time_blocks(times, seconds=True)
    place = flight.frame_rows(table["frame_id"])
    return time_blocks(place, seconds=False)


def known_points(observations: Observations, scored: pd.DataFrame) -> tuple[Observations, Array]:
    """The observations that were scored, and the points (N, 3) they should have met.

    North and east are those of the truth, down is the ground that the ray was cut with.
    """
    chosen = observations.of(scored)
    names = scored.set_index("detection_id").loc[chosen.table["detection_id"], "truth_id"].to_numpy()
    where = truth_of(chosen.flight, chosen.table.assign(target_id=names))
    return chosen, np.column_stack([where[:, :2], chosen.plane_down])
