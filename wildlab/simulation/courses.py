"""The course a twin flies: its path and its attitude as functions of time."""

from __future__ import annotations

import math

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.models import Loiter
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.routes import Shape, fly, headings, lap_times, outline, shape_corners
from wildlab.simulation.settings import true_mount, twin_manifest
from wildlab.simulation.surveys import cable_heights, survey_course
from wildlab.simulation.trajectory import (
    FlightPath,
    Signal,
    Turn,
    Wander,
    attitude_of,
    leaning_attitude,
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
    if twin.loiter is None:
        north, east, altitude = (
            random_wander(sd.si, *path_band, rng) for sd in (f.track_sd, f.track_sd, f.altitude_sd)
        )
        path = _laps(twin, (north, east), altitude)
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
    f, gravity, trim = twin.flight, twin.place.gravity.si, twin.flight.trim_pitch.si
    if f.kind is None or f.kind.text == "fixed wing":
        return attitude_of(path, wind=_wind(twin), trim_pitch=trim, gravity=gravity, sway=sway)
    start, turn_time = _timing(twin)
    ahead = headings(
        _closed_course(twin), f.airspeed.si, f.duration.si, wind=_felt(twin), start=start, roll_time=turn_time
    )
    pull = gravity if f.kind.text == "multicopter" else math.inf
    return leaning_attitude(path, ahead, trim_pitch=trim, gravity=pull, sway=sway)


def _laps(twin: TwinParameters, track_wander: tuple[Wander, Wander], altitude_wander: Wander) -> FlightPath:
    """A closed course, flown round and round.

    Raises
    ------
    WildlabError
        Where the course cannot be flown.
    """
    f = twin.flight
    start, roll_time = _timing(twin)
    try:
        course = _closed_course(twin)
        return fly(
            course,
            f.airspeed.si,
            f.duration.si,
            altitude=_altitudes(twin, course),
            wind=_wind(twin)[:2],
            drift=_drift(twin),
            start=start,
            roll_time=roll_time,
            track_wander=track_wander,
            altitude_wander=altitude_wander,
        )
    except ValueError as error:
        raise WildlabError(
            f"this course cannot be flown: {error}",
            "lower route.turn_radius, flight.wind_speed or route.drift_speed, or raise route.width",
            field="route",
        ) from None


def _timing(twin: TwinParameters) -> tuple[float, float]:
    """Where on the lap a closed course begins, and how long its corners take, s."""
    if twin.survey is not None:
        return 0.0, twin.survey.turn_time.si
    return (0.0, 1.0) if twin.route is None else (twin.route.start.number, twin.route.roll_time.si)


def _drift(twin: TwinParameters) -> Array:
    """Velocity of the whole course over the ground, (2,) m/s."""
    if twin.route is None:
        return np.zeros(2)
    along = twin.route.drift_course.si
    return twin.route.drift_speed.si * np.array([math.cos(along), math.sin(along)])


def _felt(twin: TwinParameters) -> Array:
    """Wind against a course that drifts, (2,) m/s."""
    return np.asarray(_wind(twin)[:2] - _drift(twin))


def _altitudes(twin: TwinParameters, course: Array) -> Array:
    """Times and altitudes, (K, 2) s and m."""
    f = twin.flight
    if twin.cable is not None:
        lap = float(lap_times(course, f.airspeed.si, _felt(twin))[-1])
        return cable_heights(twin.cable, lap, f.duration.si)
    if twin.climb is not None:
        begins, takes = twin.climb.start.si, twin.climb.duration.si
        return np.array([[begins, f.altitude.si], [begins + takes, twin.climb.altitude.si]])
    return np.array([[0.0, f.altitude.si]])


def _closed_course(twin: TwinParameters) -> Array:
    """Rows over the enclosures; or a shape about the target, turned and moved aside. (M, 2) m.

    Raises
    ------
    ValueError
        Where its turns do not fit, or the twin flies no closed course.
    """
    if twin.survey is not None:
        return survey_course(list(twin.enclosures.values()), twin.survey.row_distance.si)
    route = twin.route
    if route is None:
        raise ValueError("this twin flies no closed course")
    shape: Shape = "eight" if route.shape.text == "eight" else "racetrack"
    corners = shape_corners(shape, route.length.si, route.width.si)
    corners += np.array([route.ahead.si, route.right.si])
    cos, sin = math.cos(route.course.si), math.sin(route.course.si)
    corners = corners @ np.array([[cos, sin], [-sin, cos]])
    if twin.target is not None and twin.target.motion is not None:
        corners += np.array([twin.target.motion.north.si, twin.target.motion.east.si])
    return outline(corners, route.turn_radius.si)


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
    if twin.loiter is None or twin.target is None:
        raise ValueError("this twin flies no loiter")
    there = move(*_circle(twin, np.zeros(2), 0.0), np.zeros(1))
    camera = twin_manifest(twin, 0).geometry_camera()
    middle = [[twin.camera.width.number / 2, twin.camera.height.number / 2]]
    poses = CameraPoses(camera, true_mount(twin), there.position, there.R_nb)
    ground = georeference_pixels(poses, middle, -twin.target.height.si)[0]
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
