"""Courses between waypoints: straight legs, turns of a given radius, through a steady wind.

A route is first drawn as straight lines and arcs and flown at a steady airspeed (the wind triangle solved for
every direction), and then smoothed by a B-spline, which is what an airframe does that needs a few seconds to
roll into a turn. The spline gives position, velocity and acceleration in closed form.

`twin_trajectory` is the motion of a twin along its course, as a function of time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline

from wildlab.errors import WildlabError
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import georeference_pixels
from wildlab.simulation import kernels
from wildlab.simulation.landscape import even_times, heights_along
from wildlab.simulation.manifest import true_mount, twin_manifest
from wildlab.simulation.parameters import Group, TwinParameters
from wildlab.simulation.target_motion import enclosure_axes
from wildlab.simulation.trajectory import (
    AttitudeDisturbance,
    Disturbance,
    FlightPath,
    Signal,
    Trajectory,
    band_limited_disturbance,
    fixed_wing_trajectory,
    no_disturbance,
    thrust_aligned_trajectory,
)

Shape = Literal["eight", "racetrack"]

_DEGREE = 7  # five derivatives without a jump: position up to the rate of the angular acceleration
#: Time from a tenth to nine tenths of a step after smoothing, in spline intervals: 2.56 SDs of sqrt(8/12).
_RISE = 2.1
_SPACING = 0.5  # m between the points of a course


class ControlErrors(NamedTuple):
    """How far off its course an airframe is: north, east and in altitude, m."""

    north: Disturbance
    east: Disturbance
    altitude: Disturbance


def shape_corners(shape: Shape, length: float, width: float) -> Array:
    """Corners of a closed course, x along it and y to its right. (4, 2) m.

    ``eight`` crosses itself in its middle, the origin, twice a lap; long and narrow it is a straight
    fly-over, a turn and a fly-over back. ``racetrack`` passes the origin in the middle of one leg, one way.
    """
    x, y = length / 2, width / 2
    if shape == "eight":
        return np.array([[-x, -y], [x, y], [x, -y], [-x, y]])
    return np.array([[-x, 0.0], [x, 0.0], [x, width], [-x, width]])


def filleted_course(corners: ArrayLike, radius: float) -> Array:
    """A closed course through waypoints, each cut by an arc of that radius. (M, 2) m, half a metre apart.

    The first point is the middle of the first leg; the last one is the first again.

    Raises
    ------
    ValueError
        Where two turns do not fit on the leg between them.
    """
    c = np.asarray(corners, float)
    legs = np.roll(c, -1, axis=0) - c
    lengths = np.linalg.norm(legs, axis=1)
    along = legs / lengths[:, None]
    before = np.roll(along, 1, axis=0)
    turn = np.arctan2(
        before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], np.einsum("ij,ij->i", before, along)
    )
    cut = radius * np.tan(np.abs(turn) / 2)
    if not np.all(cut + np.roll(cut, -1) <= lengths * (1 + 1e-9)):
        raise ValueError("the turns do not fit on the legs between them")
    pieces = []
    for i in range(len(c)):
        following = (i + 1) % len(c)
        pieces.append(_line(c[i] + cut[i] * along[i], c[following] - cut[following] * along[i]))
        pieces.append(_arc(c[following] - cut[following] * along[i], along[i], turn[following], radius))
    half = _line(c[0] + cut[0] * along[0], c[1] - cut[1] * along[0])
    middle = len(half) // 2
    points = np.concatenate([*pieces, half[:1]])
    course = np.concatenate([points[middle:-1], points[: middle + 1]])
    apart = np.linalg.norm(np.diff(course, axis=0), axis=1)
    return np.asarray(course[np.concatenate([[True], apart > 1e-9])])


def _line(start: Array, end: Array) -> Array:
    """Points from start up to, not including, the end."""
    count = max(int(np.ceil(np.linalg.norm(end - start) / _SPACING)), 1)
    return np.asarray(start + np.arange(count)[:, None] / count * (end - start))


def _arc(start: Array, along: Array, turn: float, radius: float) -> Array:
    """Points of the turn from start up to, not including, its end; a positive turn is to the right."""
    count = max(int(np.ceil(abs(turn) * radius / _SPACING)), 1)
    angle = np.arange(count) / count * abs(turn)
    right = np.array([-along[1], along[0]]) * np.sign(turn)
    sideways = 1 - np.cos(angle)
    return np.asarray(start + radius * (np.outer(np.sin(angle), along) + np.outer(sideways, right)))


def lap_times(course: ArrayLike, airspeed: float, wind: ArrayLike) -> Array:
    """When each point of a course is passed, from 0, at a steady airspeed through a steady wind. (M,) s.

    Raises
    ------
    ValueError
        Where the airframe cannot hold the course against the wind.
    """
    step = np.diff(np.asarray(course, float), axis=0)
    far = np.linalg.norm(step, axis=1)
    along = step / far[:, None]
    w = np.asarray(wind, float)
    cross = along[:, 0] * w[1] - along[:, 1] * w[0]
    if not np.hypot(*w) < airspeed:
        raise ValueError("the airspeed must exceed the wind")
    speed = along @ w + np.sqrt(airspeed**2 - cross**2)
    return np.concatenate([[0.0], np.cumsum(far / speed)])


class Laps(NamedTuple):
    """A closed course, flown round and round at a steady speed through a steady wind.

    Attributes
    ----------
    course
        (M, 2) north and east, m, as :func:`filleted_course` gives it.
    airspeed, duration
        m/s and s. Motion is defined from a few seconds before 0 to a few after the duration.
    wind
        Velocity of the air over the ground, north and east, (2,) m/s.
    drift
        Velocity of the whole course over the ground, (2,) m/s: a pattern that is moved along with a target.
    start
        How far round the airframe is at time 0, as a fraction of a lap.
    roll_time
        Time to roll into a turn (from a tenth to nine tenths of it), s.
    """

    course: ArrayLike
    airspeed: float
    duration: float
    wind: ArrayLike = (0.0, 0.0)
    drift: ArrayLike = (0.0, 0.0)
    start: float = 0.0
    roll_time: float = 2.0


def laps_path(laps: Laps, altitude: ArrayLike, errors: ControlErrors | None = None) -> FlightPath:
    """Position, velocity and acceleration on laps of a closed course.

    Parameters
    ----------
    altitude
        Times and altitudes above the origin of n, (K, 2) s and m: linear between, steady before and after.
    errors
        How far off the course the airframe is, m.

    Raises
    ------
    ValueError
        Where the airframe cannot hold the course.
    """
    points, over = np.asarray(laps.course, float), np.asarray(laps.drift, float)
    knots, lap, passed = _flown(laps)
    profile = np.asarray(altitude, float)
    rough = np.stack(
        [
            np.interp(lap, passed, points[:, 0]) + over[0] * knots,
            np.interp(lap, passed, points[:, 1]) + over[1] * knots,
            -np.interp(knots, profile[:, 0], profile[:, 1]),
        ],
        axis=-1,
    )
    interval = laps.roll_time / _RISE
    start, coefficients = _polynomials(_smoothed(knots, rough, interval))
    off = errors or ControlErrors(no_disturbance(), no_disturbance(), no_disturbance())
    signs = (1.0, 1.0, -1.0)

    def path(times: Array) -> tuple[Array, Array, Array]:
        t = np.ascontiguousarray(times, float)
        p, v, a = (np.empty((len(t), 3)) for _ in range(3))
        kernels.piecewise_polynomial(t, start, interval, coefficients, p, v, a)
        for axis, (error, sign) in enumerate(zip(off, signs, strict=True)):
            for part, derivative in zip((p, v, a), error.with_derivatives(t), strict=True):
                part[:, axis] += sign * derivative
        return p, v, a

    return path


def _polynomials(spline: BSpline) -> tuple[float, Array]:
    """Where a spline begins, s, and its polynomials between knots: (M, 3, 8), in ascending powers."""
    pieces = spline.t[_DEGREE : -_DEGREE - 1]
    taylor = [spline.derivative(d)(pieces) / math.factorial(d) for d in range(_DEGREE + 1)]
    return float(pieces[0]), np.ascontiguousarray(np.stack(taylor, axis=-1))


def leg_headings(laps: Laps) -> Signal:
    """Direction of the leg that is flown, turned round at corners in the time it takes: (N,) s -> (N,) rad.

    For what can turn on the spot: unlike the direction of the velocity it is known where a course reverses.
    """
    knots, lap, passed = _flown(laps)
    legs = np.diff(np.asarray(laps.course, float), axis=0)
    leg = np.clip(np.searchsorted(passed, lap, side="right") - 1, 0, len(legs) - 1)
    spline = _smoothed(knots, np.unwrap(np.arctan2(legs[leg, 1], legs[leg, 0])), laps.roll_time / _RISE)
    return lambda times: np.asarray(spline(np.asarray(times, float)))


def _flown(laps: Laps) -> tuple[Array, Array, Array]:
    """Times of the control points, how long into its lap each is, and when a lap's points are passed; s."""
    passed = lap_times(laps.course, laps.airspeed, np.subtract(laps.wind, laps.drift))
    # From some before 0 to some after the duration.
    interval = laps.roll_time / _RISE
    count = int(np.ceil(laps.duration / interval)) + 6 * (_DEGREE + 1)
    knots = np.asarray(interval * (np.arange(count) - 3 * (_DEGREE + 1)), float)
    return knots, np.mod(knots + laps.start * passed[-1], passed[-1]), passed


def _smoothed(knots: Array, rough: Array, interval: float) -> BSpline:
    """The spline with these control points, at the middles of its basis functions: lines stay lines."""
    count = len(knots)
    support = interval * (np.arange(count + _DEGREE + 1) - (_DEGREE + 1) / 2) + knots[0]
    return BSpline(support, rough, _DEGREE, extrapolate=False)


def rows(enclosure: Group, distance: float) -> Array:
    """Corners of a course back and forth over one enclosure, along its length (F 5.2, fig 5.1). (2 K, 2) m.

    As many rows as are needed for no point within the fence to be further than half the distance from one;
    they are evenly spaced and reach from fence to fence.
    """
    count = max(int(np.ceil(enclosure.width.si / distance - 1e-9)), 1)
    aside = (np.arange(count) + 0.5) * enclosure.width.si / count - enclosure.width.si / 2
    ends = np.tile([-0.5, 0.5, 0.5, -0.5], count)[: 2 * count] * enclosure.length.si
    middle, along, across = enclosure_axes(enclosure)
    return np.asarray(middle + np.outer(ends, along) + np.outer(np.repeat(aside, 2), across))


def survey_course(enclosures: Sequence[Group], distance: float) -> Array:
    """Rows over one enclosure after the other, in their order, and back to the first corner. (M, 2) m.

    Each enclosure is entered at the corner nearest to where the one before was left.
    """
    course: list[Array] = []
    for enclosure in enclosures:
        there = rows(enclosure, distance)
        # Rows from either side, each from either end: four ways round, each with its own way out.
        ways = [there, there[::-1], _mirrored(there), _mirrored(there)[::-1]]
        if course:
            ways.sort(key=lambda way: float(np.linalg.norm(way[0] - course[-1][-1])))
        course.append(ways[0])
    points = np.concatenate(course)
    return np.concatenate([points, points[:1]])


def _mirrored(corners: Array) -> Array:
    """The same rows, each flown the other way."""
    return np.asarray(corners.reshape(-1, 2, 2)[:, ::-1].reshape(-1, 2))


def cable_heights(cable: Group, lap: float, duration: float) -> Array:
    """Times and heights over the ground, (K, 2) s and m, lowest at the start of each span of a lap (s)."""
    count = int(np.ceil(duration / lap * cable.spans.number)) * 16 + 1
    span = np.arange(count) / 16
    middle, swing = (cable.highest.si + cable.lowest.si) / 2, (cable.highest.si - cable.lowest.si) / 2
    return np.stack([span * lap / cable.spans.number, middle - swing * np.cos(2 * np.pi * span)], axis=-1)


Turn = Literal["clockwise", "counter-clockwise"]


def loiter_path(
    centre: ArrayLike,
    radius: float,
    altitude: float,
    airspeed: float,
    *,
    wind: ArrayLike = (0.0, 0.0),
    turn: Turn = "clockwise",
    start_angle: float = 0.0,
    radius_error: Disturbance | None = None,
    altitude_error: Disturbance | None = None,
) -> FlightPath:
    """A circle over the ground, flown at a steady airspeed through a steady wind.

    The ground speed on the nominal circle solves the wind triangle exactly, so the bank and the crab angle
    vary around the loop; the control errors then move the airframe off the circle by a few metres, and its
    airspeed off the nominal one in the same proportion.

    Parameters
    ----------
    centre
        North and east of the centre, (2,) m.
    radius, altitude
        Metres; the altitude above the origin of n.
    airspeed
        m/s, above the speed of the wind.
    wind
        Velocity of the air over the ground, north and east, (2,) m/s.
    turn
        Which way round, seen from above.
    start_angle
        Bearing of the airframe from the centre at time 0, rad, from north towards east.
    radius_error, altitude_error
        Control errors, m: how far outside of the circle, and how far above the altitude, it is; None is none.

    Returns
    -------
    Times (N,) s -> position, velocity and acceleration of b in n, (N, 3) m, m/s and m/s^2.

    Raises
    ------
    ValueError
        Where the wind is as fast as the airframe, or the radius is not positive.
    """
    c = np.asarray(centre, float)
    w = np.asarray(wind, float)
    if not np.hypot(*w) < airspeed or not radius > 0:
        raise ValueError("the airspeed must exceed the wind, and the radius zero")
    off_radius, off_altitude = radius_error or no_disturbance(), altitude_error or no_disturbance()
    sense = 1.0 if turn == "clockwise" else -1.0
    circle = tuple(float(part) for part in (radius, airspeed, *w, sense, start_angle))
    times_of_angles = _times_of_angles(circle)

    def path(times: Array) -> tuple[Array, Array, Array]:
        t = np.ascontiguousarray(times, float)
        angles = np.empty(len(t))
        kernels.angles_on_circle(t, circle, *times_of_angles, angles)
        p, v, a = (np.empty((len(t), 3)) for _ in range(3))
        kernels.circle_motion(angles, circle, off_radius.with_derivatives(t), p, v, a)
        p[:, :2] += c
        off = off_altitude.with_derivatives(t)
        p[:, 2], v[:, 2], a[:, 2] = -altitude - off[0], -off[1], -off[2]
        return p, v, a

    return path


def _times_of_angles(circle: tuple[float, ...]) -> tuple[float, Array, Array]:
    """The time to turn through an angle x, as ``mean x + Re sum_k series_k (exp(i k x) - 1)``.

    The rate is periodic in the angle, so its inverse has an integral that is a Fourier series: exact to
    rounding with a few dozen terms. An integrator of differential equations would leave an error of its own
    in every derivative.

    Returns
    -------
    The mean, s per rad, and the real and imaginary parts of the series, (K,) s.
    """
    radius, airspeed, *wind, sense, start = circle
    count = 1024
    turned = 2 * np.pi * np.arange(count) / count  # how far around since the start, always increasing
    c, s = np.cos(start + sense * turned), np.sin(start + sense * turned)
    tail, cross = sense * np.stack([-s, c], axis=-1) @ wind, np.stack([c, s], axis=-1) @ wind
    rates = sense * (tail + np.sqrt(airspeed**2 - cross**2)) / radius  # by the wind triangle
    spectrum = np.fft.rfft(1.0 / np.abs(rates)) / count
    mean = float(spectrum[0].real)
    series = 2 * spectrum[1:-1] / (1j * np.arange(1, count // 2))
    strong = np.flatnonzero(np.abs(series) > 1e-17 * mean)
    series = series[: strong[-1] + 1] if len(strong) else series[:1]
    return mean, np.ascontiguousarray(series.real), np.ascontiguousarray(series.imag)


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
        Where its turns do not fit.
    """
    if twin.survey is not None:
        return survey_course(list(twin.enclosures.values()), twin.survey.row_distance.si)
    route = twin.route
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
    """
    there = _along(twin, _circle(twin, np.zeros(2), 0.0), None)(np.zeros(1))
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
    radius_error: Disturbance | None = None,
    altitude_error: Disturbance | None = None,
) -> FlightPath:
    """The loiter's path; it begins ``turned`` rad round from where it passes the target."""
    circle: Group = twin.loiter
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
