"""Rendered images of a ship at rest, features on it in pairs of images, and the velocity that they give.

The ship, its images and the flight's logs are simulated; detector, features, flow and poses are the code
that any flight goes through. The same features are read in several ways: as they were logged, and with one
thing after the other as it truly was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wildlab.analysis.georeference import assumed_deviations, assumed_pose_covariance, camera_poses_at
from wildlab.detection.floating import find_objects
from wildlab.detection.flow import Features, Matches, filled_outlines, find_features, match_features
from wildlab.errors import WildlabError
from wildlab.flight.clocks import between, frame_times
from wildlab.flight.schema import VELOCITY
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.flow import FlowErrors, camera_flow, flow_between, mean_velocity, motion_between
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import (
    draw_dots,
    draw_line,
    draw_picture,
    draw_way,
    finish,
    name_rows,
    new_strips,
    with_breaks,
)
from wildlab.reporting.figures import BLUE, GREY, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.simulation.scene.flights import SceneFlight, VesselLook, corner_of
from wildlab.simulation.twins import AUTOPILOT, TRUTH, simulate_twin
from wildlab.studies.vessel_detection import Photographer

#: What is known of an autopilot's velocity (m/s per axis), of angular rates from two of its attitudes or of
#: a gimbal's angles (deg/s), where nothing states it: a tenth of a degree, twice in an eighth of a second.
USUAL_MOTION = {"velocity_m_s": 0.3, "rate_deg_s": 1.0, "gimbal_rate_deg_s": 1.0}


class FramePair(NamedTuple):
    """Two images of a flight, by their rows in its table ``frames``, and the features found in both."""

    first: int
    second: int
    matches: Matches


class Reading(NamedTuple):
    """How the log of a flight is read for velocities from flow.

    Attributes
    ----------
    source
        Name of the nav table.
    times
        (frames,) s, when the images were really taken, where that is known better than from the stamps.
    camera, mount
        In place of the manifest's.
    plane_down
        Down coordinate of what is seen, m.
    """

    source: str
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
        ``cov_ne``, ``cov_ee``.
    """
    stamps = frame_times(flight) if reading.times is None else reading.times
    rows = np.array([[pair.first, pair.second] for pair in pairs], np.intp).reshape(-1, 2)
    poses = camera_poses_at(flight, stamps, reading.source)
    poses = replace(poses, camera=reading.camera or poses.camera, mount=reading.mount or poses.mount)
    middle = stamps[rows].mean(axis=1)
    nav = flight.nav[reading.source]
    velocities = between(nav["time_s"].to_numpy(float), nav[VELOCITY].to_numpy(float), middle, "nav")
    interval, found = float(np.median(np.diff(stamps))), []
    for pair, when, velocity in zip(pairs, middle, velocities, strict=True):
        apart = float(stamps[pair.second] - stamps[pair.first])
        pose, motion = motion_between(poses.take(pair.first), poses.take(pair.second), apart, velocity)
        matches = pair.matches
        uv, flow = flow_between(matches.first, matches.second, interval)
        errors = flow_errors(flight, pose, matches.sd, interval)
        one = mean_velocity(pose, motion, uv, flow, reading.plane_down, errors)
        own = camera_flow(pose, motion, uv, reading.plane_down).mean(axis=0)
        spread = one.covariance[[0, 0, 1], [0, 1, 1]]
        count = float(len(matches))
        found.append((pair.first, pair.second, when, count, *flow.mean(axis=0), *own, *one.value, *spread))
    return pd.DataFrame(found, columns=list(_COLUMNS))


_COLUMNS = (
    "first", "second", "time_s", "features", "flow_u", "flow_v", "camera_u", "camera_v", "v_north_m_s",
    "v_east_m_s", "cov_nn", "cov_ne", "cov_ee",
)  # fmt: skip


def flow_errors(flight: Flight, pose: CameraPoses, sd: float, interval: float) -> FlowErrors:
    """Covariances of what a velocity is computed from: the manifest's, else the usual ones.

    Parameters
    ----------
    flight
        With its manifest.
    pose
        One.
    sd
        Of a feature's displacement, px: see `wildlab.detection.flow.Matches`.
    interval
        Between the images, s.

    Returns
    -------
    FlowErrors
    """
    stated, usual = assumed_deviations(flight), USUAL_MOTION
    return FlowErrors(
        pixel=np.eye(2) * sd**2,
        flow=np.eye(2) * (sd / interval) ** 2,
        pose=assumed_pose_covariance(pose.R_nb, stated),
        mount=np.eye(3) * np.radians(stated["misalignment_deg"]) ** 2,
        velocity=np.eye(3) * usual["velocity_m_s"] ** 2,
        rates=np.eye(3) * np.radians(usual["rate_deg_s"]) ** 2,
        gimbal_rates=np.eye(2) * np.radians(usual["gimbal_rate_deg_s"]) ** 2,
        plane=stated["plane_height_m"] ** 2,
    )


#: Images of the flight.
IMAGES = "images"
#: Ways to read the same features; the first is what the judged claims are about.
LOGGED, SYNCHRONISED, STILL, TRUE = "logged", "synchronised", "still-gimbal", "true-poses"
READINGS = (LOGGED, SYNCHRONISED, STILL, TRUE)
#: Pairs that follow each other without a gap: errors of one attitude spoil two of them in opposite ways.
STRETCH = 30
#: The ship: as long as the one of H 6.4.1, and five times its beam. H 5.6.3 does not print how long its ship
#: was; the other large one whose length H prints, in figure 4.3, has 55 m. What is on its deck is chosen:
#: without anything no feature detector would find more than corners.
SHIP = VesselLook(lengths=(70.0,), slender=5.0, fittings=30)
#: Around the ship, what of an image is rendered, px.
MARGIN = 40


class Looked(NamedTuple):
    """One flight, the features found in its images, and what there was to see.

    Attributes
    ----------
    flight, scene
        Its logs, and the truth behind them.
    pairs
        Those with features.
    tried
        How many pairs were rendered.
    shares
        (frames,) which share of the ship's outline lies in each image.
    """

    flight: Flight
    scene: SceneFlight
    pairs: list[FramePair]
    tried: int
    shares: NDArray[np.float64]


def stretches(usable: NDArray[np.bool_], pairs: int) -> NDArray[np.intp]:
    """Which pairs are looked at: evenly spread stretches of neighbours, or all where these are fewer.

    Parameters
    ----------
    usable
        (N,) bool, of each pair (its first image's row) whether both images show some of the ship.
    pairs
        About how many are wanted.

    Returns
    -------
    (K,) rows of the first images, in order.

    Examples
    --------
    >>> stretches(np.ones(12, bool), 4).tolist()
    [2, 3, 8, 9]
    """
    rows = np.flatnonzero(usable)
    if len(rows) <= pairs:
        return rows
    size = min(STRETCH, max(-(-pairs // 2), 1))  # two stretches or more: one for each pass
    blocks = [rows[start : start + size] for start in range(0, len(rows), size)]
    count = min(-(-pairs // size), len(blocks))
    chosen = (np.arange(count) + 0.5) * len(blocks) / count  # each in the middle of its part
    return np.asarray(np.concatenate([blocks[int(one)] for one in chosen]))


def look(twin: str, seed: int, pairs: int) -> Looked:
    """Render stretches of a flight, and find features on the ship in both images of each pair.

    Parameters
    ----------
    twin
        With one target.
    seed
        Of the flight, the scene and the camera.
    pairs
        About how many pairs are looked at.

    Raises
    ------
    WildlabError
        If there is no such twin, or too few pairs have features.
    """
    photographer = Photographer(twin, seed, SHIP)
    scene = photographer.flight
    flight = simulate_twin(twin, seed)
    near = np.flatnonzero(scene.near().any(axis=1))
    shares = np.zeros(len(scene.times))
    shares[near] = [scene.shares(int(row))[0] for row in near]
    rows = stretches((shares[:-1] > 0) & (shares[1:] > 0), pairs)
    known: dict[int, Features] = {}

    def features(row: int) -> Features:
        """Of the ship in an image, where the detector has anything that floats; kept for the next pair."""
        if row not in known:
            part = scene.window(row, MARGIN)
            _, counts = photographer.image(row, part)
            found = find_features(counts, filled_outlines(find_objects(counts).labels))
            known[row] = Features(found.uv + corner_of(part), found.descriptors)
        return known[row]

    found = [
        FramePair(int(row), int(row) + 1, match_features(features(int(row)), features(int(row) + 1)))
        for row in rows
    ]
    with_some = [pair for pair in found if len(pair.matches)]
    if len(with_some) < 5:
        raise WildlabError(
            f"on the flight of seed {seed} {len(with_some)} of {len(found)} pairs of images have features",
            "look at more pairs, or at the twin",
            file=twin,
        )
    return Looked(flight, scene, with_some, len(found), shares)


def readings(looked: Looked) -> dict[str, pd.DataFrame]:
    """Velocities by each of `READINGS`, as `pair_velocities` gives them."""
    times, poses = looked.scene.times, looked.scene.poses
    exact = pd.DataFrame({"time_s": times, "pan_rad": poses.pan, "tilt_rad": poses.tilt})
    known = replace(looked.flight, tables=looked.flight.tables | {"gimbal": exact})
    logged = Reading(AUTOPILOT)
    ways = {
        LOGGED: (looked.flight, logged),
        SYNCHRONISED: (looked.flight, logged._replace(times=times)),
        STILL: (known, logged._replace(times=times)),
        TRUE: (known, Reading(TRUTH, times=times, camera=poses.camera, mount=poses.mount)),
    }
    return {name: pair_velocities(flight, looked.pairs, way) for name, (flight, way) in ways.items()}


def velocity_numbers(table: pd.DataFrame) -> dict[str, float]:
    """Means and standard deviations of the velocities of a ship at rest, and whether intervals hold zero."""
    known = table.dropna(subset=["v_north_m_s", "v_east_m_s"])
    numbers: dict[str, float] = {"pairs": len(known)}
    inside = []
    for axis, variance in (("north", "cov_nn"), ("east", "cov_ee")):
        v = known[f"v_{axis}_m_s"].to_numpy(float)
        numbers[f"mean_{axis}"] = v.mean() if len(v) else np.nan
        numbers[f"sd_{axis}"] = v.std(ddof=1) if len(v) > 1 else np.nan
        inside.append(np.abs(v) <= 1.96 * np.sqrt(known[variance].to_numpy(float)))
    numbers["interval_share_95"] = np.mean(inside) if len(known) else np.nan
    return numbers


def numbers_of(looked: Looked, tables: dict[str, pd.DataFrame]) -> dict[tuple[str, str], float]:
    """What a flight gives, by (subject, name): see `RECORDED`."""
    count, shares = len(looked.shares), looked.shares
    usable = int(((shares[:-1] > 0) & (shares[1:] > 0)).sum())
    numbers = {
        (IMAGES, "in_view_share"): (shares > 0).sum() / count,
        (IMAGES, "whole_share"): (shares > 1 - 1e-9).sum() / count,
        # Of all images of the flight, as if the pairs not looked at were like those that were.
        (IMAGES, "feature_rate"): len(looked.pairs) / looked.tried * usable / count,
    }
    for name, table in tables.items():
        numbers |= {(name, key): value for key, value in velocity_numbers(table).items()}
    logged = tables[LOGGED]
    for axis in "uv":
        pair = logged[[f"flow_{axis}", f"camera_{axis}"]].dropna().to_numpy(float)
        numbers[LOGGED, f"correlation_{axis}"] = np.corrcoef(pair.T)[0, 1]
    return numbers


def trial(seed: int, *, twin: str, pairs: int) -> dict[tuple[str, str], float]:
    """One simulated flight over the ship, by `numbers_of`.

    Raises
    ------
    WildlabError
        As `look`.
    """
    looked = look(twin, seed, pairs)
    return numbers_of(looked, readings(looked))


def sizes(runs: pd.DataFrame, subject: str) -> NDArray[np.float64]:
    """Of each flight the standard deviation of a velocity along any axis, (flights,) m/s."""
    north, east = (runs[subject, f"sd_{axis}"].to_numpy(float) for axis in ("north", "east"))
    return np.asarray(np.sqrt((north**2 + east**2) / 2))


#: Displacements are drawn so many times as long: they are of a few pixels.
LONGER = 4.0


def plot_path(looked: Looked) -> Figure:
    """Where the airframe flew, and where the ship lies: H figure 5.14 (a)."""
    way = looked.flight.nav[AUTOPILOT][["north_m", "east_m"]].to_numpy(float)
    fig, ax = new_figure(5.2, 4.4)
    draw_way(ax, way, ORANGE, "airframe, by the autopilot", width=1.7)
    ax.plot(*way[0, ::-1], "o", color=ORANGE, ms=6)
    body = looked.scene.bodies(0)[0]
    ax.fill(*body.corners(body.layers[0])[:, 1::-1].T, color=INK, label="ship")
    map_axes(ax)
    return finish(fig)


def plot_gimbal(looked: Looked) -> Figure:
    """How the gimbal turned, and when the ship was in view: H figure 5.14 (b)."""
    gimbal = looked.flight.table("gimbal")
    fig, ax = new_figure(5.6, 3.0)
    ax.fill_between(
        looked.scene.times, 0, 1, where=looked.shares > 0, transform=ax.get_xaxis_transform(), color=GREY,
        alpha=0.2, lw=0, label="ship in view",
    )  # fmt: skip
    for name, colour in (("pan", BLUE), ("tilt", VERMILLION)):
        draw_line(ax, gimbal["time_s"], np.degrees(gimbal[f"{name}_rad"]), colour, name, width=1.7)
    return finish(fig, "time (s)", "angle (deg)")


def plot_features(looked: Looked) -> Figure:
    """Features on the ship in one image, and how far each moved to the next: H figures 4.2, 5.13."""
    counts = [len(pair.matches) for pair in looked.pairs]
    pair = looked.pairs[int(np.argsort(counts)[len(counts) // 2])]
    kelvin = looked.scene.view(pair.first).kelvin
    fig, ax = new_figure(5.4, 4.5)
    draw_picture(ax, kelvin, limits=(float(kelvin.min()), float(np.quantile(kelvin, 0.995))))
    at, moved = pair.matches.first, LONGER * (pair.matches.second - pair.matches.first)
    ax.quiver(*at.T, *moved.T, angles="xy", scale_units="xy", scale=1, color=ORANGE, width=0.004)
    ax.plot(*at.T, "o", color=ORANGE, ms=3)
    return fig


def plot_flow(table: pd.DataFrame) -> Figure:
    """Flow by the camera's motion and measured flow: H figure 5.15."""
    fig, axes = new_strips(2, 4.8, 5.8)
    for ax, axis, name in zip(axes, "uv", ("horizontal", "vertical"), strict=True):
        # Broken where pairs are not neighbours.
        line = with_breaks(table["time_s"], table[f"camera_{axis}"], 1.0)
        draw_line(ax, *line, VERMILLION, "by the camera's motion", width=1.4)
        draw_dots(ax, table["time_s"], table[f"flow_{axis}"], BLUE, "measured", alpha=1.0)
        ax.set_ylabel(f"{name} (px/s)")
    return finish(fig, "time (s)")


def plot_velocity(table: pd.DataFrame) -> Figure:
    """Velocities of all pairs of images, with their intervals: H figure 5.16."""
    fig, axes = new_strips(2, 4.8, 5.8)
    look: dict[str, Any] = {
        "fmt": "o",
        "color": BLUE,
        "ecolor": GREY,
        "elinewidth": 0.6,
        "ms": 3,
        "label": "pair",
    }
    for ax, axis, variance in zip(axes, ("north", "east"), ("cov_nn", "cov_ee"), strict=True):
        v = table[f"v_{axis}_m_s"].to_numpy(float)
        ax.errorbar(table["time_s"], v, 1.96 * np.sqrt(table[variance].to_numpy(float)), **look)
        ax.axhline(0.0, color=INK, lw=1.2, label="truth")
        ax.axhline(float(np.nanmean(v)), color=VERMILLION, ls="--", lw=1.4, label="mean")
        ax.set_ylabel(f"{axis} (m/s)")
    return finish(fig, "time (s)")


def plot_readings(runs: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """Standard deviation of a pair's velocity by each way of reading the log, medians over flights."""
    medians = [float(pd.Series(sizes(runs, one)).median()) for one in READINGS]
    fig, ax = new_figure(5.8, 3.0)
    ax.barh(
        range(len(READINGS)), medians, color=[BLUE if one == LOGGED else GREY for one in READINGS], height=0.6
    )
    for row, value in enumerate(medians):
        ax.text(value, row, f" {value:.1f}", va="center")
    name_rows(ax, [names[one] for one in READINGS])
    ax.set_xlim(0, 1.15 * max(medians))
    return finish(fig, "SD along an axis (m/s)")


def readings_table(runs: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """A row for each way of reading the same features: medians over flights, and pairs of all flights."""
    medians = ("mean_north", "mean_east", "sd_north", "sd_east")
    return pd.DataFrame(
        [
            {
                "reading": names[one],
                **{name: float(runs[one, name].median()) for name in medians},
                "inside": 100 * float(runs[one, "interval_share_95"].median()),
                "pairs": float(runs[one, "pairs"].sum()),
            }
            for one in READINGS
        ]
    )
