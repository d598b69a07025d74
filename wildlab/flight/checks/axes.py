"""Units and axes of inertial measurements: what is wrong with them gives an attitude that looks plausible.

Each is held against what knows better: gravity, the course over ground, the attitude of a nav source.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import linear_sum_assignment

from wildlab.flight.checks.corrections import Correction, change_columns
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import FORCE, RATE, Array, Inertial, Moves, attitudes_near, turns
from wildlab.flight.store import Flight
from wildlab.geometry.gravity import USUAL_GRAVITY

#: Half of all samples lie above and half below: this one does not mind manoeuvres.
PLAUSIBLE = (5.0, 20.0)  # m/s^2
IN_G = (0.5, 2.0)
#: Means over a second of what is felt agree with the receiver much better than this.
CLOSE = 1.4
#: deg/s for rad/s is a factor of 57; a tenth of it is beyond any manoeuvre.
FACTOR = 10.0
#: Sustained over a second: more than one and a half turns.
FASTEST = 10.0  # rad/s
#: Turning counts from here on, flying as well.
TURNING, SLOWEST = 0.05, 5.0  # rad/s, m/s
ENOUGH = 10
#: Axes are judged where they were moved (rad/s, m/s^2), over so many intervals, by so clear a correlation.
MOVED_RATE, MOVED_FORCE, INTERVALS, CLEAR = 0.02, 0.7, 30, 0.6
#: So closely the rate about z follows the course where the nose points where it goes.
FOLLOWS = 0.9
#: The mean force points within 45 deg of where it should, or away from it.
ALONG = 0.7

#: Of so many seconds, spread over the flight, it is asked how far the airframe turned in each.
SECONDS = 300_000

AXES = "xyz"


def units(flight: Flight, imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """Specific force in g, without gravity, or in another unit; angular rate in deg/s."""
    size = float(np.median(imu.sizes_of_forces()))
    low, high = PLAUSIBLE
    expected = "gravity alone is 9.8"
    if moved is not None and moved.measured:
        felt_then = np.linalg.norm(imu.mean_force(moved.start, moved.end), axis=1)
        good = np.isfinite(felt_then)
        if good.sum() >= INTERVALS:
            size = float(np.median(felt_then[good]))
            should = float(
                np.median(np.linalg.norm(moved.acceleration[good] - [0, 0, USUAL_GRAVITY], axis=1))
            )
            low, high = should / CLOSE, should * CLOSE
            expected += f", with the accelerations of the receiver {should:.3g}"
    if not low <= size <= high:
        felt = f"the specific force is {size:.3g} m/s^2 long (median), and {expected}"
        if IN_G[0] <= size <= IN_G[1]:
            felt += ": it is in g, or gravity was taken off"
            fix = (
                'set unit = "g" in [imu.force] of the recipe and import again; or, where gravity was taken '
                "off, use the raw samples"
            )
        elif size < low:
            felt += ": gravity was taken off, or the unit is wrong"
            fix = "use the raw samples of the accelerometer, and check the unit in [imu.force] of the recipe"
        else:
            fix = "check the unit in [imu.force] of the recipe"
        scale = np.sqrt(low * high) / size
        correct = change_columns("imu", FORCE, lambda f: scale * f)
        yield Finding("problem", "imu", "f_z_m_s2", felt, fix, corrections=(correct,))
    yield from _rate_unit(flight, imu, moved)


def _rate_unit(flight: Flight, imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    degrees = 'set unit = "deg/s" in [imu.rate] of the recipe and import again'
    radians = 'set unit = "rad/s" in [imu.rate] of the recipe and import again, if it says "deg/s"'
    for turn in turns(flight):
        rate = imu.mean_rate(turn.start, turn.end)
        size = np.linalg.norm(turn.rate, axis=1)
        good = np.isfinite(rate).all(axis=1) & (size > TURNING)
        if good.sum() >= ENOUGH:
            ratio = float(np.median(np.linalg.norm(rate[good], axis=1) / size[good]))
            # Another unit leaves the direction as it was; another clock, or another attitude, does not.
            if not 1 / FACTOR < ratio < FACTOR and _together(rate[good], turn.rate[good]) > CLEAR:
                said = f"the angular rate is {ratio:.2g} times that of the attitude in nav/{turn.source}"
                said += ": it is in deg/s" if ratio > FACTOR else ": it is far too small"
                fix = degrees if ratio > FACTOR else radians
                unit = np.radians(1.0) if ratio > FACTOR else np.degrees(1.0)
                correct = change_columns("imu", RATE, lambda w, unit=unit: unit * w)  # type: ignore[misc]
                yield Finding("problem", "imu", "w_z_rad_s", said, fix, corrections=(correct,))
                return
    if moved is not None:
        rate = np.linalg.norm(imu.mean_rate(moved.start, moved.end), axis=1)
        course = np.abs(moved.course_rate(SLOWEST))
        good = np.isfinite(rate) & (course > TURNING)
        if good.sum() >= ENOUGH:
            ratio = float(np.median(rate[good] / course[good]))
            if ratio > FACTOR:
                said = f"the angular rate is {ratio:.2g} times as fast as the course over ground turns"
                correct = change_columns("imu", RATE, np.radians)
                yield Finding(
                    "problem", "imu", "w_z_rad_s", f"{said}: it is in deg/s", degrees, corrections=(correct,)
                )
                return
            if ratio < 1 / FACTOR:
                said = f"the angular rate is only {ratio:.2g} times as fast as the course over ground turns"
                fix = f"{radians}; leave it for an aircraft that flies sideways without turning"
                yield Finding("warning", "imu", "w_z_rad_s", said, fix)
                return
    end = imu.times[imu.times >= imu.times[0] + 1.0]
    end = end[:: max(1, len(end) // SECONDS)]
    fast = np.linalg.norm(imu.mean_rate(end - 1.0, end), axis=1) if len(end) else np.zeros(1)
    if float(np.nanmax(fast)) > FASTEST:
        turned = float(np.nanmax(fast)) / (2 * np.pi)
        said = f"the airframe turns up to {turned:.0f} times around within a second: this looks like deg/s"
        yield Finding("problem", "imu", "w_z_rad_s", said, degrees)


def axes(flight: Flight, imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """Axes that are exchanged or point the other way; units have to be right."""
    found = list(_gravity(imu, moved)) or list(_against_attitude(flight, imu, moved))
    yield from found or _against_course(imu, moved)


def _gravity(imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """On average an aircraft neither climbs nor falls: the mean force points to its upper side."""
    mean = imu.mean_of_forces()
    size = float(np.linalg.norm(mean))
    if size < USUAL_GRAVITY / 2 or mean[2] < -ALONG * size:
        return
    where = (
        np.array2string(mean, precision=1, separator=", ", sign=" ", floatmode="fixed").strip("[]").strip()
    )
    said = f"the mean specific force is ({where}) m/s^2, and has to point along -z"
    axis = int(np.argmax(np.abs(mean)))
    corrections: tuple[Correction, ...] = ()
    name = f"{'-' if mean[axis] > 0 else ''}{AXES[axis]}"
    if axis != 2 and abs(mean[axis]) > ALONG * size:
        fix = f"exchange the axes in [imu.force] and [imu.rate] of the recipe: down is along {name} here"
    elif axis == 2 and mean[2] > ALONG * size:
        fix = (
            "if z points up in the log, as in forward-left-up, set negate for y and z of [imu.force] and "
            "[imu.rate]; if z points down, the log counts gravity instead of what is felt: set negate for x, "
            "y and z of [imu.force] alone"
        )
        corrections = (
            change_columns("imu", (*FORCE, *RATE), lambda x: x * [1, -1, -1, 1, -1, -1]),
            change_columns("imu", FORCE, lambda f: -f),
        )
        told = _z_follows_course(imu, moved)
        if told is not None and abs(told) > CLEAR:
            fix += (
                " (here the turns say that z points up)"
                if told < 0
                else " (here the turns say that z points down)"
            )
    else:
        fix = "check how the sensor sits in the airframe: x is forward, y right, z down"
    yield Finding("problem", "imu", f"f_{AXES[axis]}_m_s2", said, fix, corrections=corrections)


def _against_attitude(flight: Flight, imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    for turn in turns(flight):
        rate = imu.mean_rate(turn.start, turn.end)
        yield from _mapping("rate", rate, turn.rate, MOVED_RATE, turn.source)
        if moved is None:
            continue
        middle = (moved.start + moved.end) / 2
        rows, R = attitudes_near(flight.nav[turn.source], middle)
        wanted = moved.acceleration[rows] - [0.0, 0.0, USUAL_GRAVITY]
        expected = np.einsum("kji,kj->ki", R, wanted)
        felt = imu.mean_force(moved.start, moved.end)[rows]
        yield from _mapping("force", felt, expected, MOVED_FORCE, turn.source)


def _mapping(what: str, measured: Array, expected: Array, moved: float, source: str) -> Iterator[Finding]:
    """Whether the axes go with those of the attitude, as they are or otherwise."""
    good = np.isfinite(measured).all(axis=1) & np.isfinite(expected).all(axis=1)
    if good.sum() < INTERVALS:
        return
    measured, expected = measured[good], expected[good]
    lively = np.flatnonzero((expected.std(axis=0) > moved) & (measured.std(axis=0) > moved / 10))
    if len(lively) == 0:
        return
    C = np.corrcoef(measured[:, lively].T, expected[:, lively].T)[: len(lively), len(lively) :]
    mine, theirs = linear_sum_assignment(-np.abs(C))
    clear = np.abs(C[mine, theirs]) > CLEAR
    wrong = clear & ((mine != theirs) | (C[mine, theirs] < 0))
    # An exchange has to be clearly better than no exchange: axes of a manoeuvre may well move together.
    wrong &= C[mine, theirs] ** 2 > C[mine, mine] * np.abs(C[mine, mine]) + 0.2
    if not wrong.any():
        return
    pairs = []
    for i in np.flatnonzero(wrong):
        sign = "minus " if C[mine[i], theirs[i]] < 0 else ""
        pairs.append(f"{AXES[lively[mine[i]]]} goes with {sign}{AXES[lively[theirs[i]]]}")
    axis = AXES[lively[mine[int(np.argmax(wrong))]]]
    yield Finding(
        "warning",
        "imu",
        f"w_{axis}_rad_s" if what == "rate" else f"f_{axis}_m_s2",
        f"the {'angular rates' if what == 'rate' else 'specific forces'} do not fit the attitude in "
        f"nav/{source}: {', '.join(pairs)} of it",
        f"set columns and negate in [imu.{what}] of the recipe accordingly (x is forward, y right, z down), "
        f"or look for the fault in nav/{source}",
    )


def _z_follows_course(imu: Inertial, moved: Moves | None) -> float | None:
    """How the rate about z goes with that of the course, -1 to 1, where there are turns."""
    both = None if moved is None else _turning(imu, moved)
    return None if both is None else _together(both[0][:, 2], both[1])


def _together(a: Array, b: Array) -> float:
    """As a correlation, but about zero: a circle is flown one way all the time."""
    size = np.sqrt(np.sum(a**2) * np.sum(b**2))
    return float(np.sum(a * b) / size) if size > 0 else 0.0


def _turning(imu: Inertial, moved: Moves) -> tuple[Array, Array] | None:
    rate, course = imu.mean_rate(moved.start, moved.end), moved.course_rate(SLOWEST)
    good = np.isfinite(rate).all(axis=1) & np.isfinite(course)
    if (good & (np.abs(course) > TURNING)).sum() < INTERVALS:
        return None
    return rate[good], course[good]


def _against_course(imu: Inertial, moved: Moves | None) -> Iterator[Finding]:
    """A course to the right is a turn to the right about z; a banked turn raises the nose either way."""
    both = None if moved is None else _turning(imu, moved)
    if both is None:
        return
    rate, course = both
    turning = np.abs(course) > TURNING
    about_z = _together(rate[:, 2], course)
    # Who flies sideways turns as the course does by chance alone, and never as closely.
    if about_z < -FOLLOWS:
        yield Finding(
            "warning",
            "imu",
            "w_z_rad_s",
            f"the rate about z runs against the course over ground (correlation {about_z:.2f})",
            "set negate for z of [imu.rate] in the recipe, and look at the other axes: x is forward, y "
            "right, z down, each turning right-handed",
        )
        return
    about_y = _together(rate[turning, 1], np.abs(course[turning]))
    if about_z > FOLLOWS and about_y < -CLEAR:
        yield Finding(
            "warning",
            "imu",
            "w_y_rad_s",
            f"the nose drops in turns to either side (correlation {about_y:.2f} of the rate about y), and a "
            "banked turn raises it",
            "if the sensor sits the wrong way round, set negate for x and y of [imu.force] and [imu.rate]; "
            "else look at the sign of y",
        )
