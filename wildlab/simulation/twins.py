"""Twins as flights: a trajectory, the sensors that saw it, and the tables they wrote.

`simulate_twin` gives a flight as `load_flight` gives one. What differs from a logged flight is that the nav
source ``truth`` exists; nothing downstream needs it.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.flight.manifest import Manifest, make_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera, in_image
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel, pixel_to_plane
from wildlab.geometry.mount import Mount, camera_pose, helgesen_misalignment
from wildlab.simulation.aboard import (
    autopilot_tables,
    gnss_table,
    imu_table,
    nav_table,
    payload_attitude,
    ticks,
)
from wildlab.simulation.parameters import TwinParameters, load_twin
from wildlab.simulation.sensors import computer_stamps, stream
from wildlab.simulation.trajectory import (
    FlightPath,
    Motion,
    Signal,
    Turn,
    Wander,
    attitude_of,
    loiter,
    move,
    random_wander,
)

#: Nav sources of a twin.
AUTOPILOT = "autopilot"
UNCALIBRATED = "autopilot-uncalibrated"
TRUTH = "truth"
PAYLOAD_TRUTH = "truth-payload"

#: Tables that take most of the time and most of the room, and that not every study needs.
OPTIONAL_TABLES = ("imu", "gnss")

#: Column of the frames that holds the on-board computer's stamps.
ONBOARD_STAMP = "time_onboard_s"


def simulate_twin(name_or_path: str | Path, seed: int, without: Collection[str] = ()) -> Flight:
    """A twin as a flight in memory. The same seed gives the same flight, to the last bit.

    The nav source ``truth`` is the pose of the airframe with the camera, ``truth-payload`` that of the
    payload with the IMU and the antennas, which is what a navigation system with these sensors can know.

    Parameters
    ----------
    name_or_path
        A twin that comes with wildlab (``"static-antenna"``), or a file like those in ``data/twins``.
    seed
        A whole number from 0.
    without
        Tables to leave out, to save time: any of ``OPTIONAL_TABLES``. The others are the same without them.

    Raises
    ------
    WildlabError
        Where the twin or one of its parameters is unusable, the seed is negative, or the target does not come
        into view often enough.
    """
    return simulate(load_twin(name_or_path), seed, without)


def simulate(twin: TwinParameters, seed: int, without: Collection[str] = ()) -> Flight:
    """As :func:`simulate_twin`, from parameters in memory."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**63:
        raise WildlabError(f"{seed!r} is not a seed", "give a whole number from 0", field="seed")
    if unknown := sorted(set(without) - set(OPTIONAL_TABLES)):
        raise WildlabError(
            f"{unknown[0]!r} is not a table that can be left out",
            f"use any of {', '.join(OPTIONAL_TABLES)}",
            field="without",
        )
    path, attitude = trajectory(twin, stream(seed, "trajectory"))
    manifest = twin_manifest(twin, int(seed))
    camera, mount = manifest.geometry_camera(), manifest.geometry_mount()

    duration, camera_rate = twin.flight.duration.si, twin.camera.frame_rate.si
    true = move(path, attitude, ticks(twin.autopilot.rate.si, duration))
    calibrated, uncalibrated = autopilot_tables(twin, true, int(seed))
    known = move(path, attitude, ticks(twin.truth.rate.si, duration))
    nav = {AUTOPILOT: calibrated, UNCALIBRATED: uncalibrated, TRUTH: nav_table(known)}
    payload = payload_attitude(twin, attitude, int(seed))
    nav[PAYLOAD_TRUTH] = nav_table(move(path, payload, ticks(twin.truth.rate.si, duration)))
    exposures = twin.camera.recording_start.si + np.arange(int(twin.camera.images.number)) / camera_rate
    frames = _frames(twin, exposures, int(seed))
    detections = _marks(twin, camera, mount, move(path, attitude, exposures), frames, int(seed))
    truth = pd.DataFrame(
        {
            "target_id": [twin.target.identifier.text],
            "time_s": [np.nan],
            "north_m": [0.0],
            "east_m": [0.0],
            "down_m": [-twin.target.height.si],
            "sd_horizontal_m": [twin.target.sd.si],
            "sd_vertical_m": [twin.target.sd.si],
        }
    )
    tables = {"frames": frames, "detections": detections, "truth": truth}
    if "imu" not in without:
        tables["imu"] = imu_table(twin, path, payload, int(seed))
    if "gnss" not in without:
        tables["gnss"] = gnss_table(twin, path, payload, int(seed))
    return Flight(manifest, nav, tables)


def twin_manifest(twin: TwinParameters, seed: int) -> Manifest:
    """What `flight.toml` of the twin says; its uncertainties are what one would assume, not the truth."""
    c, m, assumed = twin.camera, twin.mount, twin.assumed
    misalignment = helgesen_misalignment(
        m.misalignment_roll.number, m.misalignment_tilt.number, m.misalignment_pan.number
    )
    return make_manifest(
        {
            "name": f"{twin.name}-{seed}",
            "kind": "twin",
            "description": twin.description,
            "locations": {"sensitivity": "open"},
            "origin": {
                "latitude_deg": twin.place.latitude.number,
                "longitude_deg": twin.place.longitude.number,
                "height_m": twin.place.height.number,
            },
            "platform": {"name": twin.flight.platform.text},
            "camera": {
                "name": c.name.text,
                "width_px": int(c.width.number),
                "height_px": int(c.height.number),
                "fx_px": c.fx.number,
                "fy_px": c.fy.number,
                "cx_px": c.cx.number,
                "cy_px": c.cy.number,
            },
            "mount": {
                "looks": "down",
                "pan_deg": m.pan.number,
                "tilt_deg": m.tilt.number,
                "misalignment_roll_deg": misalignment[0],
                "misalignment_tilt_deg": misalignment[1],
                "misalignment_pan_deg": misalignment[2],
            },
            "time": {"kind": "utc", "epoch": twin.place.epoch.text},
            "vertical": {"reference": "ellipsoid", "note": "the origin of n lies at sea level"},
            "uncertainty": {
                "pixel_px": assumed.pixel.number,
                "position_horizontal_m": assumed.horizontal.number,
                "position_vertical_m": assumed.vertical.number,
                "plane_height_m": assumed.plane_height.number,
                "roll_deg": assumed.roll.number,
                "pitch_deg": assumed.pitch.number,
                "yaw_deg": assumed.yaw.number,
                "note": "what the published facts suggest; the simulated errors are set apart from it",
            },
            "scoring": {"rule": "labelled"},
            "twin": {"name": twin.name, "seed": seed},
        }
    )


def trajectory(twin: TwinParameters, rng: np.random.Generator) -> tuple[FlightPath, Signal]:
    """The twin's path and attitude as functions of time, with its own control errors and sway."""
    f = twin.flight
    start = rng.uniform(0.0, 2 * math.pi)  # where on the circle the log happens to begin
    path_band = (f.path_shortest_period.si, f.path_longest_period.si)
    sway_band = (f.sway_shortest_period.si, f.sway_longest_period.si)
    radius, altitude = (random_wander(sd.si, *path_band, rng) for sd in (f.radius_sd, f.altitude_sd))
    roll, pitch, yaw = (random_wander(sd.si, *sway_band, rng) for sd in (f.roll_sd, f.pitch_sd, f.yaw_sd))
    return _circle(twin, loiter_centre(twin), start, radius, altitude, (roll, pitch, yaw))


def loiter_centre(twin: TwinParameters) -> Array:
    """North and east (2,) of the circle's centre, m.

    Laid so that the undisturbed flight has the target in the middle of the image where its course is the one
    asked for: in a banked turn the camera looks outwards, so the target lies outside of the circle.

    Raises
    ------
    WildlabError
        Where the camera does not look down at the target's height there.
    """
    there = move(*_circle(twin, np.zeros(2), 0.0), np.zeros(1))
    manifest = twin_manifest(twin, 0)
    middle = [[twin.camera.width.number / 2, twin.camera.height.number / 2]]
    p_nc, R_nc = camera_pose(manifest.geometry_mount(), there.position, there.R_nb)
    ground = pixel_to_plane(manifest.geometry_camera(), middle, p_nc, R_nc, -twin.target.height.si)[0]
    if np.isnan(ground).any():
        raise WildlabError(
            "the camera does not look down at the target's height where it should pass over it",
            "raise flight.altitude, or bring mount.tilt and mount.pan nearer to zero",
            field="flight.altitude",
        )
    return np.asarray(-ground[:2])


def _circle(
    twin: TwinParameters,
    centre: Array,
    turned: float,
    radius_wander: Wander | None = None,
    altitude_wander: Wander | None = None,
    sway: tuple[Wander, Wander, Wander] | None = None,
) -> tuple[FlightPath, Signal]:
    """Path and attitude of the loiter; it begins ``turned`` rad round from where it passes the target."""
    f = twin.flight
    turn: Turn = "clockwise" if f.turn.text == "clockwise" else "counter-clockwise"
    blows_to = f.wind_from.si + math.pi
    wind = f.wind_speed.si * np.array([math.cos(blows_to), math.sin(blows_to), 0.0])
    quarter = math.pi / 2 if turn == "clockwise" else -math.pi / 2
    path = loiter(
        centre,
        f.loiter_radius.si,
        f.altitude.si,
        f.airspeed.si,
        wind=wind[:2],
        turn=turn,
        start_angle=f.course_at_target.si - quarter + turned,
        radius_wander=radius_wander,
        altitude_wander=altitude_wander,
    )
    gravity, trim = twin.place.gravity.si, f.trim_pitch.si
    return path, attitude_of(path, wind=wind, trim_pitch=trim, gravity=gravity, sway=sway)


def _frames(twin: TwinParameters, exposures: Array, seed: int) -> pd.DataFrame:
    clock = twin.onboard_clock
    return pd.DataFrame(
        {
            "frame_id": [f"f{number:06d}" for number in range(1, len(exposures) + 1)],
            "time_s": exposures + twin.camera.latency.si,
            ONBOARD_STAMP: computer_stamps(
                exposures + twin.camera.latency.si,
                clock.offset.si,
                clock.drift.si,
                clock.latency.si,
                stream(seed, "on-board clock"),
            ),
        }
    )


def _marks(
    twin: TwinParameters, camera: Camera, mount: Mount, true: Motion, frames: pd.DataFrame, seed: int
) -> pd.DataFrame:
    """The target as a person marks it in the first images that show it."""
    target = np.array([0.0, 0.0, -twin.target.height.si])
    p_nc, R_nc = camera_pose(mount, true.position, true.R_nb)
    uv = ground_to_pixel(camera, np.broadcast_to(target, p_nc.shape), p_nc, R_nc)
    wanted = int(twin.target.observations.number)
    seen = np.flatnonzero(in_image(camera, uv, twin.target.border.si))[:wanted]
    if len(seen) < wanted:
        raise WildlabError(
            f"the target is in view in {len(seen)} images only, not in {wanted}",
            "lower target.observations or flight.loiter_radius, or raise camera.images",
            field="target.observations",
        )
    rng = stream(seed, "marking")
    marked = uv[seen] + twin.camera.marking_sd.si * rng.standard_normal((wanted, 2))
    marked = np.clip(marked, 0.0, [camera.width, camera.height])  # nobody marks outside of the image
    return pd.DataFrame(
        {
            "detection_id": [f"d{number:06d}" for number in range(1, wanted + 1)],
            "frame_id": frames["frame_id"].to_numpy()[seen],
            "source": "manual",
            "kind": "pixel",
            "u_px": marked[:, 0],
            "v_px": marked[:, 1],
            "target_id": twin.target.identifier.text,
            "plane_down_m": -twin.target.height.si,
        }
    )
