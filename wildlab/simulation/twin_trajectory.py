"""The course a twin flies: its path and its attitude as functions of time."""

from __future__ import annotations

import math

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation.courses import (
    ControlErrors,
    Laps,
    Shape,
    Turn,
    cable_heights,
    filleted_course,
    lap_times,
    laps_path,
    leg_headings,
    loiter_path,
    shape_corners,
    survey_course,
)
from wildlab.simulation.landscape import even_times, heights_along
from wildlab.simulation.manifest import true_mount, twin_manifest
from wildlab.simulation.parameter_groups import Loiter
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.trajectory import (
    AttitudeDisturbance,
    Disturbance,
    FlightPath,
    Motion,
    Trajectory,
    band_limited_disturbance,
    fixed_wing_trajectory,
    thrust_aligned_trajectory,
)


def twin_trajectory(twin: TwinParameters, rng: np.random.Generator) -> Trajectory:
    """The twin's motion as a function of time, with its own control errors and gusts.

    Raises
    ------
    WildlabError
        Where the course cannot be flown.
    """
    f = twin.flight
    path_band = (f.path_shortest_period.si, f.path_longest_period.si)
    if twin.loiter is None:
        north, east, altitude = (
            band_limited_disturbance(sd.si, *path_band, rng) for sd in (f.track_sd, f.track_sd, f.altitude_sd)
        )
        path = _laps_path(twin, ControlErrors(north, east, altitude))
        return _along(twin, path, _gusts(twin, rng))
    start = rng.uniform(0.0, 2 * math.pi)  # where on the circle the log happens to begin
    errors = tuple(band_limited_disturbance(sd.si, *path_band, rng) for sd in (f.track_sd, f.altitude_sd))
    path = _circle(twin, loiter_centre(twin), start, *errors)
    return _along(twin, path, _gusts(twin, rng))


def _gusts(twin: TwinParameters, rng: np.random.Generator) -> AttitudeDisturbance:
    """What gusts and control leave of the attitude."""
    f = twin.flight
    band = (f.attitude_shortest_period.si, f.attitude_longest_period.si)
    roll, pitch, yaw = (
        band_limited_disturbance(sd.si, *band, rng) for sd in (f.roll_sd, f.pitch_sd, f.yaw_sd)
    )
    return roll, pitch, yaw


def _wind(twin: TwinParameters) -> Array:
    """Velocity of the air over the ground, (3,) m/s."""
    blows_to = twin.flight.wind_from.si + math.pi
    return twin.flight.wind_speed.si * np.array([math.cos(blows_to), math.sin(blows_to), 0.0])


def _along(twin: TwinParameters, path: FlightPath, gusts: AttitudeDisturbance | None) -> Trajectory:
    """The motion along a path of the kind of airframe that the twin has."""
    f, gravity, trim = twin.flight, twin.place.gravity.si, twin.flight.trim_pitch.si
    if f.kind is None or f.kind.text == "fixed wing":
        return fixed_wing_trajectory(path, wind=_wind(twin), trim_pitch=trim, gravity=gravity, gusts=gusts)
    ahead = leg_headings(_laps(twin))
    pull = gravity if f.kind.text == "multicopter" else math.inf
    return thrust_aligned_trajectory(path, ahead, trim_pitch=trim, gravity=pull, gusts=gusts)


def _laps_path(twin: TwinParameters, errors: ControlErrors) -> FlightPath:
    """A closed course, flown round and round.

    Raises
    ------
    WildlabError
        Where the course cannot be flown.
    """
    try:
        laps = _laps(twin)
        return laps_path(laps, _above_ground(twin, laps, _altitudes(twin, laps)), errors)
    except ValueError as error:
        raise WildlabError(
            f"this course cannot be flown: {error}",
            "lower route.turn_radius, flight.wind_speed or route.drift_speed, or raise route.width",
            field="route",
        ) from None


def _laps(twin: TwinParameters) -> Laps:
    """The twin's closed course, and how it is flown.

    Raises
    ------
    ValueError
        As :func:`_closed_course`.
    """
    laps = _laps_as_written(twin)
    written = twin.moved_from
    if written is None:
        return laps
    # Whoever flies it begins to record where on the lap it suits, however long the lap takes in that wind.
    begins = twin.camera.recording_start.si
    ahead = begins / _lap_time(_laps_as_written(written)) - begins / _lap_time(laps)
    return laps._replace(start=laps.start + ahead)


def _laps_as_written(twin: TwinParameters) -> Laps:
    f = twin.flight
    start, roll_time = _timing(twin)
    return Laps(
        _closed_course(twin), f.airspeed.si, f.duration.si, _wind(twin)[:2], _drift(twin), start, roll_time
    )


def _lap_time(laps: Laps) -> float:
    """How long a lap takes, s."""
    return float(lap_times(laps.course, laps.airspeed, np.subtract(laps.wind, laps.drift))[-1])


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


def _above_ground(twin: TwinParameters, laps: Laps, altitudes: Array) -> Array:
    """Times and altitudes, (K, 2) s and m, of a course whose altitudes are over the ground."""
    if twin.land is None:
        return altitudes
    times = even_times(twin.flight.duration.si)
    place = laps_path(laps, altitudes)(times)[0][:, :2]
    above = np.interp(times, altitudes[:, 0], altitudes[:, 1])
    return np.column_stack([times, above + heights_along(twin, times, place, laps.airspeed)])


def _altitudes(twin: TwinParameters, laps: Laps) -> Array:
    """Times and altitudes over the ground, (K, 2) s and m."""
    f = twin.flight
    if twin.cable is not None:
        return cable_heights(twin.cable, _lap_time(laps), f.duration.si)
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
    return filleted_course(corners, route.turn_radius.si)


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
    there = _undisturbed_start(twin)
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


def _undisturbed_start(twin: TwinParameters) -> Motion:
    """Where and how a loiter about the origin of n begins without control errors and gusts."""
    path = _circle(twin, np.zeros(2), 0.0)
    return _along(twin, path, None)(np.zeros(1))


def _circle(
    twin: TwinParameters,
    centre: Array,
    turned: float,
    radius_error: Disturbance | None = None,
    altitude_error: Disturbance | None = None,
) -> FlightPath:
    """The loiter's path; it begins ``turned`` rad round from where it passes the target."""
    circle: Loiter | None = twin.loiter
    if circle is None:
        raise ValueError("this twin flies no loiter")
    turn: Turn = "clockwise" if circle.turn.text == "clockwise" else "counter-clockwise"
    quarter = math.pi / 2 if turn == "clockwise" else -math.pi / 2
    return loiter_path(
        centre,
        circle.radius.si,
        twin.flight.altitude.si,
        twin.flight.airspeed.si,
        wind=_wind(twin)[:2],
        turn=turn,
        start_angle=circle.course_at_target.si - quarter + turned,
        radius_error=radius_error,
        altitude_error=altitude_error,
    )
