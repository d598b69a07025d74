"""What one sensor of a moving or fixed platform saw, scan by scan, as arrays for filters; the truth; and what
each scan should see of a target, and what errors that last do to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.evaluation.pose_noise import estimate_position_noise
from wildlab.flight.checks.sensors import looks_of_others
from wildlab.flight.clocks import frame_times, gimbal_angles, poses_at, truth_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.covariances import level_axes
from wildlab.geometry.frames import Array
from wildlab.tracking.sensors import (
    POSE,
    Prediction,
    Sensor,
    difference,
    predict_pixel,
    predict_position,
    predict_range_bearing,
)

#: Elements of a measurement by kind of detection, and the columns that they are read from.
KINDS: dict[str, dict[str, str]] = {
    "position": {"north": "north_m", "east": "east_m"},
    "range-bearing": {"range": "range_m", "azimuth": "azimuth_rad"},
    "bearing": {"azimuth": "azimuth_rad"},
    "pixel": {"u": "u_px", "v": "v_px"},
    "velocity": {"v_north": "v_north_m_s", "v_east": "v_east_m_s"},
}
#: Kinds of detections that say a place, and what says something of the place of a target that is known.
PLACED = ("position", "range-bearing", "pixel")
PLACEABLE = (*PLACED, "bearing")
#: Elements whose differences are wrapped.
ANGLES = ("azimuth", "elevation")
_VELOCITY_COVARIANCE = ("v_cov_nn", "v_cov_ne", "v_cov_ee")
#: Velocities of the truth and of the platform are taken over a second.
OVER_S = 1.0


class Scans(NamedTuple):
    """N scans of a sensor with up to K detections each, in order of time.

    Attributes
    ----------
    times
        (N,) s.
    detections
        (N, K, m): north, east in n; range and bearing from north; bearing, with or without elevation; pixels;
        velocities. NaN where there are fewer.
    platform, platform_velocity
        (N, 2), NaN outside of the log of the platform.
    elements
        What the m numbers are, see `KINDS`; ``elevation`` too.
    labels, ids
        (N, K) which target a detection names, "" none, and its own name.
    R
        (N, K, m, m) covariances that detections have of their own; None where none has.
    drop
        (N,) m, how far below the platform the target's plane is; NaN where that is not known.
    plane_down
        (N,) m, the plane itself.
    poses
        Of the camera that took the pixels, else None.
    """

    sensor: str
    kind: str
    times: Array
    detections: Array
    platform: Array
    platform_velocity: Array
    elements: tuple[str, ...] = ()
    labels: NDArray[np.object_] = np.empty((0, 0), object)
    ids: NDArray[np.object_] = np.empty((0, 0), object)
    R: Array | None = None
    drop: Array = np.empty(0)
    plane_down: Array = np.empty(0)
    poses: CameraPoses | None = None

    @property
    def interval_s(self) -> float:
        """The usual time between two scans."""
        return float(np.median(np.diff(self.times))) if len(self.times) > 1 else 0.0

    @property
    def labelled(self) -> bool:
        """Whether any detection names its target."""
        return bool((self.labels != "").any())

    @property
    def angles(self) -> tuple[bool, ...]:
        """(m,) whose differences are wrapped."""
        return tuple(name in ANGLES for name in self.elements)


class Truth(NamedTuple):
    """Where one target was at N scans: ``position`` and ``velocity`` (N, 2), NaN where not known.

    ``sd_m`` of each axis of the position; zero where the truth does not say. ``fixed``: it never moves.
    """

    target: str
    position: Array
    velocity: Array
    sd_m: float
    fixed: bool = False

    @property
    def covariance(self) -> Array:
        """(2, 2) of the position."""
        return np.eye(2) * self.sd_m**2


def sensors_of(flight: Flight) -> list[str]:
    """The sensors that looked, in the order of their first scan.

    Where the frames name no sensor, each source of detections is one, and every frame is a scan of it.

    Raises
    ------
    WildlabError
        Where the flight has no frames, or nobody is named.
    """
    frames = flight.table("frames")
    if "sensor" in frames:
        found = [str(name) for name in frames["sensor"].drop_duplicates() if name]
    else:
        found = [str(name) for name in flight.table("detections")["source"].drop_duplicates()]
    if not found:
        raise WildlabError(
            "there are no detections, and no frame says which sensor looked",
            "name every frame's sensor, or add detections",
            file=flight.folder,
            field="frames.sensor",
        )
    return found


def scans_of(flight: Flight, sensor: str, offset_s: float = 0.0, source: str | None = None) -> Scans:
    """The scans of a sensor, its detections those of the source of that name, in order of time.

    Parameters
    ----------
    offset_s
        What to add to the sensor's stamps. The platform's position goes with the stamp: what was seen stands
        where the platform was then, so positions move with it.
    source
        Name of the ``nav`` table; may be left out where there is one beside the truth's. One row is a
        platform that stays where it is.

    Raises
    ------
    WildlabError
        Where there is no such sensor, it detects nothing or things of several kinds, its detections are in
        scans of another one, or the flight has no poses.
    """
    known = sensors_of(flight)
    if sensor not in known:
        raise WildlabError(
            f"there is no sensor {sensor!r}", f"use one of {', '.join(known)}", file=flight.folder
        )
    frames = flight.table("frames")
    logged = frame_times(flight)
    mine = np.isfinite(logged)
    if "sensor" in frames:
        mine &= (frames["sensor"] == sensor).to_numpy()
    chosen = np.flatnonzero(mine)
    chosen = chosen[np.argsort(logged[chosen], kind="stable")]
    frame_ids, stamps = frames["frame_id"].iloc[chosen], logged[chosen]
    seen = flight.table("detections")
    others = looks_of_others(frames, seen)
    stray = others[others["source"] == sensor]
    if len(stray):
        looked_by = " and ".join(repr(name) if name else "no sensor" for name in sorted(set(stray["sensor"])))
        raise WildlabError(
            f"{len(stray)} detections of the source {sensor!r} are in looks of {looked_by}",
            "give the detections of each sensor a source of its name, or name in frames.sensor who looked",
            file=flight.folder,
            field="detections.source",
        )
    own_looks = seen["frame_id"].isin(frame_ids)
    kinds = sorted(set(seen.loc[own_looks & (seen["source"] == sensor), "kind"]))
    if not kinds and own_looks.any():
        sources = " and ".join(repr(name) for name in sorted(set(seen.loc[own_looks, "source"])))
        raise WildlabError(
            f"no detection has the source {sensor!r}; those in its looks have the source {sources}",
            f"give what {sensor!r} saw the source of its name, or name in frames.sensor who looked",
            file=flight.folder,
            field="detections.source",
        )
    seen = seen[own_looks & (seen["source"] == sensor)]
    if len(kinds) != 1:
        raise WildlabError(
            f"the sensor {sensor!r} detects {' and '.join(kinds) or 'nothing'}",
            f"use detections of one kind: {' or '.join(KINDS)}",
            file=flight.folder,
            field="detections.kind",
        )
    kind = kinds[0]
    columns = dict(KINDS[kind])
    if kind == "bearing" and "elevation_rad" in seen and np.isfinite(seen["elevation_rad"]).all():
        columns["elevation"] = "elevation_rad"
    row = pd.Index(frame_ids).get_indexer(pd.Index(seen["frame_id"]))
    order = np.argsort(row, kind="stable")
    row, seen = row[order], seen.iloc[order]
    place = np.arange(len(row)) - np.searchsorted(row, row)
    shape = len(stamps), int(place.max(initial=0)) + 1

    def spread(values: NDArray[np.generic], empty: object) -> NDArray[np.generic]:
        found = np.full((*shape, *values.shape[1:]), empty, dtype=object if empty == "" else float)
        found[row, place] = values
        return found

    values = seen[list(columns.values())].to_numpy(float)
    if kind == "range-bearing" and "elevation_rad" in seen:
        # What is measured along the line of sight is shorter on the level.
        values[:, 0] *= np.cos(np.nan_to_num(seen["elevation_rad"].to_numpy(float)))
    detections = np.asarray(spread(values, np.nan), float)
    names = seen["target_id"].fillna("") if "target_id" in seen else pd.Series("", index=seen.index)
    labels, ids = (
        np.asarray(spread(one.to_numpy(object), ""), object) for one in (names, seen["detection_id"])
    )
    own = None
    if kind == "velocity" and set(_VELOCITY_COVARIANCE) <= set(seen):
        a, b, c = (seen[name].to_numpy(float) for name in _VELOCITY_COVARIANCE)
        own = np.asarray(spread(np.stack([a, b, b, c], axis=-1).reshape(-1, 2, 2), np.nan), float)
    name, nav = flight.pose_source(source)
    p, R_nb, covariance = platform_at(nav, stamps + offset_s, frame_ids)
    platform = p[:, :2]
    if kind == "position" and len(nav) > 1:
        detections += (platform - platform_at(nav, stamps, frame_ids)[0][:, :2])[:, None]
    ahead, behind = (
        platform_at(nav, _inside(nav, stamps + offset_s + step))[0][:, :2]
        for step in (OVER_S / 2, -OVER_S / 2)
    )
    plane = _plane_of(flight, seen, row, len(stamps))
    poses = None
    if kind == "pixel":
        pan, tilt = (angle[chosen] for angle in gimbal_angles(flight))
        manifest = flight.manifest
        poses = CameraPoses(
            manifest.geometry_camera(), manifest.geometry_mount(name), p, R_nb, pan, tilt, covariance
        )
        plane = _camera_plane(flight, name, seen, row, plane)
    drop = plane - p[:, 2]
    if kind == "range-bearing" and "elevation_rad" in seen and np.isfinite(seen["elevation_rad"]).any():
        drop = np.zeros(len(stamps))
    return Scans(
        sensor,
        kind,
        stamps + offset_s,
        detections,
        platform,
        (ahead - behind) / OVER_S,
        tuple(columns),
        labels,
        ids,
        own,
        drop,
        plane,
        poses,
    )


def platform_at(
    nav: pd.DataFrame, times: ArrayLike, frame_ids: pd.Series | None = None
) -> tuple[Array, Array, Array | None]:
    """As `poses_at`; a log of one row is of a platform that never moves, and holds at all times."""
    if len(nav) == 1 and "frame_id" not in nav:
        n = len(np.atleast_1d(np.asarray(times, float)))
        p, R, P = poses_at(nav, nav["time_s"].to_numpy(float))
        return p.repeat(n, axis=0), R.repeat(n, axis=0), None if P is None else P.repeat(n, axis=0)
    return poses_at(nav, times, frame_ids)


def _plane_of(flight: Flight, seen: pd.DataFrame, row: NDArray[np.intp], n: int) -> Array:
    """(N,) down coordinate of the plane that targets move on: stated, else the truth's; NaN if neither."""
    stated = np.full(len(seen), np.nan)
    if "plane_down_m" in seen:
        stated = seen["plane_down_m"].to_numpy(float)
    if not np.isfinite(stated).any() and flight.truth is not None and len(flight.truth):
        truth = flight.truth.groupby("target_id")["down_m"].median()
        named = seen["target_id"] if "target_id" in seen else pd.Series("", index=seen.index)
        stated = named.map(truth).fillna(float(truth.median())).to_numpy(float)
    return _filled(stated, row, n)


def _camera_plane(
    flight: Flight, source: str, seen: pd.DataFrame, row: NDArray[np.intp], plane: Array
) -> Array:
    """The same where pixels meet the ground: over terrain it is the terrain's."""
    if flight.terrain is None:
        return plane
    from wildlab.analysis.georeference import observe

    observed = observe(flight, source)
    down = pd.Series(observed.plane_down, index=observed.table["detection_id"])
    down = down[~down.index.duplicated()]
    met = np.asarray(seen["detection_id"].map(down).to_numpy(float), np.float64)
    return _filled(met, row, len(plane))


def _filled(stated: Array, row: NDArray[np.intp], n: int) -> Array:
    """(N,) the value of each scan, between those that have one as time goes by; NaN where there is none."""
    known = np.isfinite(stated)
    if not known.any():
        return np.full(n, np.nan)
    first = np.unique(row[known], return_index=True)
    return np.interp(np.arange(n), first[0], stated[known][first[1]])


def truths_at(flight: Flight, times: ArrayLike) -> list[Truth]:
    """Every target at given times (N,), interpolated only across gaps that the truth's own rate explains."""
    at = np.asarray(times, float)
    truth, offset = flight.table("truth"), flight.manifest.clocks.truth_offset_s
    names, position = truth_at(truth, at, offset_s=offset)
    _, ahead = truth_at(truth, at + OVER_S / 2, offset_s=offset)
    _, behind = truth_at(truth, at - OVER_S / 2, offset_s=offset)
    sd = {}
    if "sd_horizontal_m" in truth:
        sd = truth.groupby("target_id")["sd_horizontal_m"].median().to_dict()
    # A row without a time is of a point that never moves.
    moving = set(truth.loc[truth["time_s"].notna(), "target_id"].astype(str))
    return [
        Truth(
            name,
            p[:, :2],
            (a - b)[:, :2] / OVER_S,
            float(np.nan_to_num(sd.get(name, 0.0))),
            name not in moving,
        )
        for name, p, a, b in zip(names, position, ahead, behind, strict=True)
    ]


def truth_deviations(flight: Flight) -> tuple[dict[str, float], list[str]]:
    """Standard deviations of the true places by target, m, each axis: stated, else estimated, else zero; and
    for which targets it is estimated."""
    found: dict[str, float] = {}
    estimated: list[str] = []
    for name, own in flight.table("truth").groupby("target_id"):
        named = own["sd_horizontal_m"] if "sd_horizontal_m" in own else pd.Series(dtype=float)
        stated = named.dropna()
        if len(stated):
            sd = float(stated.median())
        else:
            times, places = own["time_s"].to_numpy(float), own[["north_m", "east_m"]].to_numpy(float)
            sd = float(np.sqrt(np.mean(estimate_position_noise(times, places) ** 2)))
            estimated += [str(name)] * bool(np.isfinite(sd))
        found[str(name)] = sd if np.isfinite(sd) else 0.0
    return found, estimated


def _inside(nav: pd.DataFrame, times: Array) -> Array:
    """Times brought into the log, for differences at its ends."""
    stamps = nav["time_s"].to_numpy(float)
    return np.clip(times, stamps[0], stamps[-1])


_LEVEL = ("platform_north", "platform_east", "heading", "clock")
#: Errors that may be considered, by kind of detection: the columns of ``H_pose``, in this order. Those of a
#: camera's attitude are about level axes and the vertical, see `wildlab.geometry.covariances`.
SLOTS: dict[str, tuple[str, ...]] = {
    "position": _LEVEL,
    "range-bearing": (*_LEVEL, "range_bias"),
    "bearing": _LEVEL,
    "velocity": (),
    "pixel": (*POSE, "clock"),
}


def predict_scan(scans: Scans, position: ArrayLike, velocity: ArrayLike) -> Prediction:
    """What every scan should have seen of a target at (N, 2) moving with (N, 2)."""
    p, v = np.asarray(position, float), np.asarray(velocity, float)
    return _predict(scans, slice(None), p, v, v - scans.platform_velocity)


def sensor_of(scans: Scans, drift: ArrayLike) -> Sensor:
    """The sensor for the filters, with the target's (N, 2) drift relative to the platform, m/s."""
    moves = np.asarray(drift, float)

    def predict(row: int, state: Array) -> Prediction:
        return _predict(scans, row, state[..., :2], state[..., 2:4], moves[row])

    return Sensor(
        predict,
        scans.angles,
        len(scans.times),
        4 if scans.kind == "velocity" else 2,
        SLOTS[scans.kind],
    )


def _predict(scans: Scans, rows: int | slice, p: Array, v: Array, drift: Array) -> Prediction:
    """Of the rows, at (..., 2) with the velocity and the drift (..., 2)."""
    if scans.kind == "velocity":
        H = np.broadcast_to(np.eye(2, 4, 2), (*v.shape, 4))
        return Prediction(v, H, np.zeros((*v.shape, 0)))
    if scans.kind == "pixel":
        if scans.poses is None:
            raise AssertionError("pixels have poses")
        taken = scans.poses.take(rows) if isinstance(rows, int) else scans.poses
        seen = predict_pixel(p, taken, scans.plane_down[rows])
        pose = seen.H_pose.copy()
        pose[..., 3:] = pose[..., 3:] @ level_axes(taken.R_nb)
        return _with(seen, pose, seen.z, seen.H_position, drift)
    platform = scans.platform[rows]
    if scans.kind == "position":
        seen = predict_position(p, platform)
        return _with(seen, seen.H_pose[..., _OF_LEVEL], seen.z, seen.H_position, drift)
    seen = predict_range_bearing(p, platform, 0.0)
    return _along(seen, scans, rows, drift)


#: The errors of a level platform among those of a pose.
_OF_LEVEL = [POSE.index(name) for name in _LEVEL[:3]]


def _with(seen: Prediction, pose: Array, z: Array, H: Array, drift: Array) -> Prediction:
    """Derivatives for the clock behind those for the pose."""
    clock = np.einsum("...ij,...j->...i", H, drift)[..., None]
    both = np.broadcast_to(pose, (*clock.shape[:-1], pose.shape[-1]))
    return Prediction(z, H, np.concatenate([both, clock], axis=-1))


def _along(level: Prediction, scans: Scans, rows: int | slice, drift: Array) -> Prediction:
    """Range along the line of sight, bearing and elevation; ``level`` has level range and bearing."""
    r, drop = level.z[..., 0], scans.drop[rows]
    pose = level.H_pose[..., _OF_LEVEL]
    # A height that is not known is none: the range is then taken for level.
    drop = np.where(np.isfinite(drop), drop, 0.0) + 0.0 * r
    slant = np.hypot(r, drop)
    share, turn = (r / slant)[..., None], (drop / slant**2)[..., None]
    H_range, H_bearing = level.H_position[..., 0, :], level.H_position[..., 1, :]
    kept = {
        "azimuth": (level.z[..., 1], H_bearing, pose[..., 1, :]),
        "range": (slant, H_range * share, pose[..., 0, :] * share),
        # Down is below the horizon; elevation counts upwards.
        "elevation": (-np.arctan2(drop, r), H_range * turn, pose[..., 0, :] * turn),
    }
    z = np.stack([kept[name][0] for name in scans.elements], axis=-1)
    H, by_pose = (np.stack([kept[name][i] for name in scans.elements], axis=-2) for i in (1, 2))
    seen = _with(level, by_pose, z, H, drift)
    if "range" not in scans.elements:
        return seen
    bias = np.zeros((*seen.H_pose.shape[:-1], 1))
    bias[..., scans.elements.index("range"), 0] = 1.0
    return seen._replace(H_pose=np.concatenate([seen.H_pose, bias], axis=-1))


def errors_near(scans: Scans, truth: Truth, reach: float) -> tuple[Array, NDArray[np.intp]]:
    """Error (N, m) of the detection of a target at every scan, and which it is.

    The one that names it, where detections do; else the nearest within ``reach`` (m, or rad where there is no
    more than angles). Measured minus expected; NaN and -1 where there is none.
    """
    if scans.kind not in SLOTS:
        return np.full(scans.detections[:, 0].shape, np.nan), np.full(len(scans.times), -1)
    expected = predict_scan(scans, truth.position, truth.velocity).z
    error = difference(scans.detections, expected[:, None], scans.angles)
    if scans.labelled:
        size = np.where(scans.labels == truth.target, 0.0, np.inf)
        size = np.where(np.isfinite(error).all(axis=-1), size, np.inf)
        reach = np.inf
    else:
        size = np.linalg.norm(across(scans, error, expected), axis=-1)
        size = np.where(np.isfinite(size), size, np.inf)
    best = np.argmin(size, axis=1)
    rows = np.arange(len(best))
    near = (size[rows, best] < reach) & np.isfinite(size[rows, best])
    return np.where(near[:, None], error[rows, best], np.nan), np.where(near, best, -1)


def across(scans: Scans, error: Array, expected: Array) -> Array:
    """Errors (N, K, m) in one unit: metres, or radians where the distance is not measured."""
    if scans.kind == "pixel" and scans.poses is not None:
        return error / scans.poses.camera.fx
    if scans.kind != "range-bearing":
        return error
    metres = np.ones((len(expected), 2))
    metres[:, scans.elements.index("azimuth")] = expected[:, scans.elements.index("range")]
    return error * metres[:, None]
