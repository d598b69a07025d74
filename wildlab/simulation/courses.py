"""The course a twin flies: its path and its attitude as functions of time."""

from __future__ import annotations

import math

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import pixel_to_plane
from wildlab.geometry.mount import camera_pose
from wildlab.simulation.models import Loiter, Route
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.routes import Shape, fly, outline, shape_corners
from wildlab.simulation.settings import twin_manifest
from wildlab.simulation.trajectory import (
    FlightPath,
    Signal,
    Turn,
    Wander,
    attitude_of,
    loiter,
    move,
    random_wander,
)

Sway = tuple[Wander, Wander, Wander]


def trajectory(twin: TwinParameters, rng: np.random.Generator) -> tuple[FlightPath, Signal]:
    """The twin's path and attitude as functions of time, with its own control errors and sway.

    Raises
    ------
    WildlabError
        Where the course cannot be flown.
    """
    f = twin.flight
    path_band = (f.path_shortest_period.si, f.path_longest_period.si)
    sway_band = (f.sway_shortest_period.si, f.sway_longest_period.si)
    if twin.route is not None:
        north, east, altitude = (
            random_wander(sd.si, *path_band, rng) for sd in (f.track_sd, f.track_sd, f.altitude_sd)
        )
        path = _route(twin, twin.route, (north, east), altitude)
        roll, pitch, yaw = (random_wander(sd.si, *sway_band, rng) for sd in (f.roll_sd, f.pitch_sd, f.yaw_sd))
        return path, _attitude(twin, path, (roll, pitch, yaw))
    start = rng.uniform(0.0, 2 * math.pi)  # where on the circle the log happens to begin
    radius, altitude = (random_wander(sd.si, *path_band, rng) for sd in (f.track_sd, f.altitude_sd))
    roll, pitch, yaw = (random_wander(sd.si, *sway_band, rng) for sd in (f.roll_sd, f.pitch_sd, f.yaw_sd))
    return _circle(twin, loiter_centre(twin), start, radius, altitude, (roll, pitch, yaw))


def _wind(twin: TwinParameters) -> Array:
    """Velocity of the air over the ground, (3,) m/s."""
    blows_to = twin.flight.wind_from.si + math.pi
    return twin.flight.wind_speed.si * np.array([math.cos(blows_to), math.sin(blows_to), 0.0])


def _attitude(twin: TwinParameters, path: FlightPath, sway: Sway | None) -> Signal:
    gravity, trim = twin.place.gravity.si, twin.flight.trim_pitch.si
    return attitude_of(path, wind=_wind(twin), trim_pitch=trim, gravity=gravity, sway=sway)


def _route(
    twin: TwinParameters, route: Route, track_wander: tuple[Wander, Wander], altitude_wander: Wander
) -> FlightPath:
    """The closed course about the target, turned, moved aside and moved along."""
    f = twin.flight
    shape: Shape = "eight" if route.shape.text == "eight" else "racetrack"
    corners = shape_corners(shape, route.length.si, route.width.si)
    corners += np.array([route.ahead.si, route.right.si])
    cos, sin = math.cos(route.course.si), math.sin(route.course.si)
    corners = corners @ np.array([[cos, sin], [-sin, cos]])
    if twin.target.motion is not None:
        corners += np.array([twin.target.motion.north.si, twin.target.motion.east.si])
    along = route.drift_course.si
    altitude = [[0.0, f.altitude.si]]
    if twin.climb is not None:
        begins, takes = twin.climb.start.si, twin.climb.duration.si
        altitude = [[begins, f.altitude.si], [begins + takes, twin.climb.altitude.si]]
    try:
        return fly(
            outline(corners, route.turn_radius.si),
            f.airspeed.si,
            f.duration.si,
            altitude=altitude,
            wind=_wind(twin)[:2],
            drift=route.drift_speed.si * np.array([math.cos(along), math.sin(along)]),
            start=route.start.number,
            roll_time=route.roll_time.si,
            track_wander=track_wander,
            altitude_wander=altitude_wander,
        )
    except ValueError as error:
        raise WildlabError(
            f"this course cannot be flown: {error}",
            "lower route.turn_radius, flight.wind_speed or route.drift_speed, or raise route.width",
            field="route",
        ) from None


def loiter_centre(twin: TwinParameters) -> Array:
    """North and east (2,) of the circle's centre, m.

    Laid so that the undisturbed flight has the target in the middle of the image where its course is the one
    asked for: in a banked turn the camera looks outwards, so the target lies outside of the circle.

    Raises
    ------
    WildlabError
        Where the camera does not look down at the target's height there.
    ValueError
        Where the twin flies no loiter.
    """
    if twin.loiter is None:
        raise ValueError("this twin flies no loiter")
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
    sway: Sway | None = None,
) -> tuple[FlightPath, Signal]:
    """Path and attitude of the loiter; it begins ``turned`` rad round from where it passes the target."""
    circle: Loiter | None = twin.loiter
    if circle is None:
        raise ValueError("this twin flies no loiter")
    turn: Turn = "clockwise" if circle.turn.text == "clockwise" else "counter-clockwise"
    quarter = math.pi / 2 if turn == "clockwise" else -math.pi / 2
    path = loiter(
        centre,
        circle.radius.si,
        twin.flight.altitude.si,
        twin.flight.airspeed.si,
        wind=_wind(twin)[:2],
        turn=turn,
        start_angle=circle.course_at_target.si - quarter + turned,
        radius_wander=radius_wander,
        altitude_wander=altitude_wander,
    )
    return path, _attitude(twin, path, sway)
