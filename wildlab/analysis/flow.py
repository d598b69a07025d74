"""A flight's poses and features of a vessel in pairs of its images: velocities, one for each pair (H 5.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.analysis.georeference import assumed_deviations, assumed_pose_covariance
from wildlab.detection.flow import Matches
from wildlab.errors import WildlabError
from wildlab.flight.clocks import between, frame_times, poses_at
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.flow import camera_flow, flow_between, motion_between
from wildlab.geometry.flow_uncertainty import FlowErrors, mean_velocity
from wildlab.geometry.frames import Array
from wildlab.geometry.mount import Mount

#: What is known of an autopilot's velocity (m/s per axis), of angular rates from two of its attitudes or of
#: a gimbal's angles (deg/s), where nothing states it: a tenth of a degree, twice in an eighth of a second.
USUAL_MOTION = {"velocity_m_s": 0.3, "rate_deg_s": 1.0, "gimbal_rate_deg_s": 1.0}
_VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]


class FramePair(NamedTuple):
    """Two images of a flight, by their rows in its table ``frames``, and the features found in both."""

    first: int
    second: int
    matches: Matches


@dataclass(frozen=True)
class Reading:
    """How the log of a flight is read for velocities from flow.

    Attributes
    ----------
    source
        Name of the nav table; None where there is only one.
    times
        (frames,) s, when the images were really taken, where that is known better than from the stamps.
    camera, mount
        In place of the manifest's.
    plane_down
        Down coordinate of what is seen, m.
    """

    source: str | None = None
    times: Array | None = None
    camera: Camera | None = None
    mount: Mount | None = None
    plane_down: float = 0.0


def pair_velocities(
    flight: Flight,
    pairs: Sequence[FramePair],
    reading: Reading,
) -> pd.DataFrame:
    """Velocities of a target from pairs of images that follow each other, H (5.30).

    Two images are as far apart as the median of the flight's stamps: the camera keeps its pace.

    Parameters
    ----------
    flight
        With frames and poses; a gimbal's angles where it has some.
    pairs
        Each of two frames, the second one the next that was taken.
    reading
        Of the log.

    Returns
    -------
    DataFrame
        A row for each pair: ``first`` and ``second`` (rows of the frames), ``time_s`` half way, ``features``,
        measured flow ``flow_u`` and ``flow_v``, that of the camera's own motion ``camera_u`` and ``camera_v``
        (px/s, means over the features), ``v_north_m_s``, ``v_east_m_s`` and their covariance ``cov_nn``,
        ``cov_ne``, ``cov_ee``. NaN where a pair has no features or no pose.

    Raises
    ------
    WildlabError
        Where the flight has no frames or poses, a row is none of its frames, or ``times`` has another length.
    """
    stamps = frame_times(flight) if reading.times is None else np.asarray(reading.times, float)
    if len(stamps) != len(flight.table("frames")):
        raise WildlabError(
            f"{len(stamps)} times for {len(flight.table('frames'))} frames",
            "give one for each",
            field="times",
        )
    rows = np.array([[pair.first, pair.second] for pair in pairs], np.intp).reshape(-1, 2)
    if len(rows) and (rows.min() < 0 or rows.max() >= len(stamps)):
        raise WildlabError(
            f"frame {int(rows.max() if rows.max() >= len(stamps) else rows.min())} of {len(stamps)}",
            "give rows of the table frames, from 0",
            field="pairs",
        )
    poses = camera_poses_at(flight, stamps, reading)
    middle = stamps[rows].mean(axis=1)
    velocities = _nav_velocities(flight, middle, reading)
    usual = float(np.median(np.diff(stamps))) if len(stamps) > 1 else np.nan
    found = []
    for number, pair in enumerate(pairs):
        apart = float(stamps[pair.second] - stamps[pair.first])
        velocity = None if velocities is None else velocities[number]
        row = _one(flight, poses, pair, (apart, usual), velocity, reading.plane_down)
        found.append({"first": pair.first, "second": pair.second, "time_s": middle[number], **row})
    return pd.DataFrame(found, columns=list(_COLUMNS))


_COLUMNS = (
    "first", "second", "time_s", "features", "flow_u", "flow_v", "camera_u", "camera_v", "v_north_m_s",
    "v_east_m_s", "cov_nn", "cov_ne", "cov_ee",
)  # fmt: skip


def camera_poses_at(flight: Flight, times: Array, reading: Reading) -> CameraPoses:
    """The camera's poses at times (N,) s, by the log: NaN where it has none."""
    name, nav = flight.pose_source(reading.source)
    p_nb, R_nb, covariance = poses_at(nav, times)
    manifest = flight.manifest
    mount = reading.mount or manifest.geometry_mount(name)
    pan, tilt = None, None
    if flight.gimbal is not None:
        angles = np.unwrap(flight.gimbal[["pan_rad", "tilt_rad"]].to_numpy(float), axis=0)
        pan, tilt = between(flight.gimbal["time_s"].to_numpy(float), angles, times, "gimbal").T
    camera = reading.camera or manifest.geometry_camera()
    return CameraPoses(camera, mount, p_nb, R_nb, pan, tilt, covariance)


def _nav_velocities(flight: Flight, times: Array, reading: Reading) -> Array | None:
    """(N, 3) m/s in n, where the source has them; None where it has not."""
    nav = flight.pose_source(reading.source)[1]
    if not set(_VELOCITY) <= set(nav.columns):
        return None
    return between(nav["time_s"].to_numpy(float), nav[_VELOCITY].to_numpy(float), times, "nav")


def _one(
    flight: Flight,
    poses: CameraPoses,
    pair: FramePair,
    times: tuple[float, float],
    velocity: Array | None,
    plane_down: float,
) -> dict[str, float]:
    """A row of `pair_velocities`; ``times`` are those between the two poses, and between the two images."""
    row = dict.fromkeys(_COLUMNS[4:], np.nan) | {"features": float(len(pair.matches))}
    one, two = poses.take(pair.first), poses.take(pair.second)
    if (
        not (times[0] > 0 and times[1] > 0)
        or not np.isfinite(one.R_nc + two.R_nc + one.p_nc + two.p_nc).all()
    ):
        return row
    pose, motion = motion_between(one, two, times[0], velocity)
    if not len(pair.matches) or not np.isfinite(motion.velocity).all():
        return row
    uv, flow = flow_between(pair.matches.first, pair.matches.second, times[1])
    row["flow_u"], row["flow_v"] = flow.mean(axis=0)
    row["camera_u"], row["camera_v"] = camera_flow(pose, motion, uv, plane_down).mean(axis=0)
    errors = flow_errors(flight, pose, pair.matches.sd, times[1])
    found = mean_velocity(pose, motion, uv, flow, plane_down, errors)
    row["v_north_m_s"], row["v_east_m_s"] = found.value
    row["cov_nn"], row["cov_ne"], row["cov_ee"] = found.covariance[[0, 0, 1], [0, 1, 1]]
    return row


def flow_errors(flight: Flight, pose: CameraPoses, sd: float, interval: float) -> FlowErrors:
    """Covariances of what a velocity is computed from: the log's, the manifest's, else the usual ones.

    Parameters
    ----------
    flight
        With its manifest.
    pose
        One; its covariance where the log has one.
    sd
        Of a feature's displacement, px: see `wildlab.detection.flow.Matches`.
    interval
        Between the images, s.

    Returns
    -------
    FlowErrors
    """
    stated, usual = assumed_deviations(flight), USUAL_MOTION
    covariance = pose.covariance
    if covariance is None:
        covariance = assumed_pose_covariance(pose.R_nb, stated)
    moving = flight.gimbal is not None
    return FlowErrors(
        pixel=np.eye(2) * sd**2,
        flow=np.eye(2) * (sd / interval) ** 2,
        pose=covariance,
        mount=np.eye(3) * np.radians(stated["misalignment_deg"]) ** 2,
        velocity=np.eye(3) * usual["velocity_m_s"] ** 2,
        rates=np.eye(3) * np.radians(usual["rate_deg_s"]) ** 2,
        gimbal_rates=np.eye(2) * (np.radians(usual["gimbal_rate_deg_s"]) if moving else 0.0) ** 2,
        plane=stated["plane_height_m"] ** 2,
    )
