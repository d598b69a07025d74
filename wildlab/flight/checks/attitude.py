"""The attitude against what turns with it: the inertial sensor, the magnetic field, and the course."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.findings import (
    Change,
    Finding,
    Misfit,
    Mistake,
    alternate,
    attitude_mistakes,
    attitudes_in,
    axes_words,
    blame,
    change_attitude,
    change_by,
    change_columns,
    compare,
    crosswise,
    explain,
    finite_rows,
    mistake,
    one_row,
    other_axes,
    rows_of,
    thin,
    undo_in,
)
from wildlab.flight.checks.inertial import (
    FACTOR,
    Inertial,
    airframe_sources,
    attitudes_near,
    fixes,
    increasing_rows,
    moves,
    samples,
    trimmed_size,
)
from wildlab.flight.schema import FIELD, FORCE, POSITION, QUATERNION, RATE, VELOCITY, other_units
from wildlab.flight.store import Flight
from wildlab.geometry.frames import USUAL_GRAVITY, Array, matrix_to_euler, quaternion_to_matrix
from wildlab.names import listed

#: What is left between a good small sensor and a good attitude: turns (rad/s) and forces (m/s^2), and
#: as shares of how much there was of both.
USUAL_RATE, RATE_SHARE, USUAL_FORCE, FORCE_SHARE = 0.03, 0.15, 0.8, 0.15
#: Turns between attitudes: over at most so long (s), at most so many, and at least so many.
STEP_S, MOST, ENOUGH = 0.5, 600, 30
#: The largest of what is left do not count.
_rms = partial(trimmed_size, counted=0.97)
#: A correlation beyond this in either half is a sign, where so many intervals spread by so much (m/s^2).
AGAINST, AGAINST_ENOUGH, LIVELY = 0.4, 100, 0.1
#: Cosine between rates and turns of the attitude, over all, below which no unit makes one of the other.
ALONG = 0.5
#: Without a known mistake, this many times what is usual is said.
UNEXPLAINED = 5.0
#: A heading off by less (rad) is a compass; so many standard deviations beyond it is no chance.
HEADING_OFF, SURE = np.radians(5.0), 3.0
#: A heading from magnetic north is the declination less, to so many deg.
COMPASS_DEG = 2.0
#: Accelerations (m/s^2, root mean square) that give a heading, the correlation with the forces that takes,
#: the share of what a heading does that nothing else may do, and the blocks in time that its standard
#: deviation is from.
MOVED, TOGETHER, OWN, BLOCKS = 0.5, 0.7, 0.25, 10


@dataclass(frozen=True)
class Felt:
    """Intervals: attitudes before and after (K, 3, 3), length (K,), mean rate (K, 3) of the sensor; and
    (J, 3) forces with the attitudes (J, 3, 3) and the accelerations in n (J, 3) they should follow from, at
    moments (J,)."""

    before: Array
    after: Array
    length: Array
    rate: Array
    force: Array
    R_force: Array
    acceleration: Array
    moments: Array

    @property
    def turned(self) -> Array:
        """The mean rates that the attitudes have, (K, 3)."""
        turned = Rotation.from_matrix(np.swapaxes(self.before, 1, 2) @ self.after).as_rotvec()
        return turned / self.length[:, None]

    @property
    def expected(self) -> Array:
        """The forces that follow from attitude and acceleration, (J, 3)."""
        wanted = self.acceleration - np.array([0.0, 0.0, USUAL_GRAVITY])
        return np.asarray(np.einsum("nji,nj->ni", self.R_force, wanted))


def felt(flight: Flight, source: str, imu: Inertial) -> Felt | None:
    """One nav source and the sensor; None where they have too little in common."""
    nav = flight.nav[source]
    values = increasing_rows(nav, QUATERNION, ENOUGH)
    if values is None:
        return None
    t = values[:, 0]
    last = np.minimum(np.searchsorted(t, t + STEP_S / 5), len(t) - 1)
    length = t[last] - t
    inside = (t >= imu.times[0]) & (t[last] <= imu.times[-1])
    good = np.flatnonzero((length > 0) & (length <= STEP_S) & inside)
    if len(good) < ENOUGH:
        return None
    first = good[thin(len(good), MOST)]
    last = last[first]
    used = moves(fixes(flight))
    if used is None and VELOCITY[0] in nav:
        used = moves(nav[["time_s", *POSITION, *VELOCITY]].dropna())
    start, end = (t[first], t[last]) if used is None else (used.start, used.end)
    middle = (start + end) / 2
    rows, R_force = attitudes_near(nav, middle)
    force = imu.mean(FORCE, start, end)[rows]
    acceleration = np.zeros_like(force) if used is None else used.acceleration[rows]
    rate = imu.mean(RATE, t[first], t[last])
    known = np.isfinite(force).all(axis=1) & np.isfinite(acceleration).all(axis=1)
    if known.sum() < ENOUGH or np.isfinite(rate).all(axis=1).sum() < ENOUGH:
        return None
    before, after = (
        Rotation.from_quat(values[at, 1:], scalar_first=True).as_matrix() for at in (first, last)
    )
    return Felt(
        before,
        after,
        length[first],
        rate,
        force[known],
        R_force[known],
        acceleration[known],
        middle[rows][known],
    )


def _felt_misfit(f: Felt) -> Misfit:
    """Turns (first row) and forces (second row), (2, 3), in units of what is usual."""
    turned, expected = f.turned, f.expected
    bias = np.nanmedian(f.rate - turned, axis=0)
    rate = f.rate - turned - bias * (np.abs(bias) < USUAL_RATE)
    # How much there is of both: of the lesser, since a wrong unit makes either large.
    most = min(_rms(turned), _rms(f.rate))
    usual_rate = USUAL_RATE + RATE_SHARE * most
    usual_force = USUAL_FORCE + FORCE_SHARE * _rms(expected - np.median(expected, axis=0))

    def judge(left: Array, usual: float) -> Misfit:
        return crosswise(len(left), 10, lambda _, judged: (_rms(left[judged]) / usual,))

    return np.concatenate([judge(rate, usual_rate), judge(f.force - expected, usual_force)])


def forces(flight: Flight) -> Iterator[Finding]:
    """The inertial sensor against every nav source."""
    imu = samples(flight)
    if imu is None:
        return
    for source in airframe_sources(flight):
        given = felt(flight, source, imu)
        if given is None:
            continue
        named = explain(_felt_misfit, given, felt_mistakes(source))
        before = _felt_misfit(given)[:, 0]
        table = f"nav/{source}"
        facts: dict[str, Any] = {"source": source, "turns": before[0], "forces": before[1]}
        if named:
            after = _felt_misfit(named[0].undone)[:, 0]
            # Rates that are far too small leave no more than the turns.
            slow = _rms(given.rate) * FACTOR < _rms(given.turned)
            yield blame(
                "problem" if before.max() > UNEXPLAINED or slow else "warning",
                "imu" if all("[imu" in one.fix for one in named) else table,
                "",
                "felt-explained",
                named,
                {**facts, "turns_then": after[0], "forces_then": after[1]},
            )
        # Where the turns do not fit either, the sign of a force is none of the causes.
        elif before[0] <= UNEXPLAINED and (axes := against(given)):
            facts["key"] = key = listed(["xyz"[axis] for axis in axes])
            field = f"f_{'xyz'[axes[0]]}_m_s2"
            yield Finding("warning", "imu", field, "force-against", facts, (f"sign of force {key}",))
        elif (error := heading_error(given)) is not None:
            by, sd = np.degrees(error)
            low, high = abs(by) - 1.96 * sd, abs(by) + 1.96 * sd
            declination = flight.manifest.magnetometer.declination_deg or 0.0
            magnetic = abs(by + declination) < 1.96 * sd + COMPASS_DEG
            # The declination stays out: reports show this, and it tells of a place.
            facts |= {"by": by, "low": low, "high": high, "magnetic": magnetic}
            causes = ("declination missing",) if magnetic else ("heading off",)
            back = Rotation.from_euler("z", -error.by).as_matrix()
            turn = change_attitude(source, partial(np.matmul, back))
            yield Finding("warning", table, "", "heading-off", facts, causes, (turn,))
        elif before.max() > UNEXPLAINED:
            yield Finding("warning", table, "", "felt-unexplained", facts)


class HeadingError(NamedTuple):
    """A heading that is too large by a constant, and its standard deviation, rad."""

    by: float
    sd: float


def heading_error(f: Felt) -> HeadingError | None:
    """By how much the level forces, put into n by the attitude, are turned against the accelerations.

    Fitted along are a sensor that is tilted on the airframe, since on a circle gravity would pass for a
    heading, and a receiver whose stamps are late, since in a steady turn that is a heading. Standard
    deviation by leaving out blocks of the flight in turn, since errors of an attitude last. None where it is
    not known to be larger than `HEADING_OFF`, the two do not go together, or all but less than `OWN` of what
    a heading does is as well done by what is fitted along, as on steady circles.
    """

    def level(v: Array) -> Array:
        n = np.einsum("nij,nj->in", f.R_force, v)
        return np.concatenate([n[0], n[1]])

    north, east = f.acceleration[:, 0], f.acceleration[:, 1]
    if np.sqrt(np.mean(north**2 + east**2)) < MOVED:
        return None
    moved, turned = np.r_[north, east], np.r_[-east, north]
    late = np.concatenate([np.gradient(one, f.moments) for one in (north, east)])
    # Unknown: a turn and a scale of the accelerations, two tilts in the body, and a delay.
    A = np.stack([turned, moved, *(level(np.cross(axis, f.force)) for axis in np.eye(3)[:2]), late], axis=1)
    b = level(f.force)
    own = turned - A[:, 1:] @ np.linalg.lstsq(A[:, 1:], turned, rcond=None)[0]
    if own @ own < OWN * (turned @ turned):
        return None
    blocks = np.array_split(np.arange(len(north)), BLOCKS)
    rows = [np.r_[block, block + len(north)] for block in blocks]
    normal, right = np.array([A[r].T @ A[r] for r in rows]), np.array([A[r].T @ b[r] for r in rows])
    solved = [
        np.linalg.lstsq(normal[kept].sum(axis=0), right[kept].sum(axis=0), rcond=None)[0]
        for kept in (np.ones(BLOCKS, bool), *~np.eye(BLOCKS, dtype=bool))
    ]
    left = b - A[:, 2:] @ solved[0][2:]
    if np.hypot(moved @ left, turned @ left) < TOGETHER * np.sqrt((moved @ moved) * (left @ left)):
        return None
    by, *without = (float(np.arctan2(x[0], x[1])) for x in solved)
    off = np.angle(np.exp(1j * (np.array(without) - by)))
    sd = float(np.sqrt((BLOCKS - 1) * np.mean((off - off.mean()) ** 2)))
    return HeadingError(by, sd) if HEADING_OFF + SURE * sd < abs(by) < np.pi / 4 else None


def against(f: Felt) -> list[int]:
    """Axes whose force runs against the one that attitude and velocity ask for, on either half.

    Where an airframe never slips, the force across it is nearly none: its sign shows in this and in no size.
    """
    expected = f.expected
    half = alternate(len(expected), 10)

    def together(rows: NDArray[np.bool_], axis: int) -> float:
        pair = [np.clip(x, *np.percentile(x, [2, 98])) for x in (f.force[rows, axis], expected[rows, axis])]
        lively = len(pair[0]) >= AGAINST_ENOUGH and min(np.std(pair[0]), np.std(pair[1])) > LIVELY
        return float(np.corrcoef(*pair)[0, 1]) if lively else 0.0

    return [axis for axis in range(3) if max(together(half, axis), together(~half, axis)) < -AGAINST]


def _turned_by(M: Array, x: Array) -> Array:
    """Vectors, three columns each, in other axes."""
    return np.hstack([part @ M.T for part in np.split(x, x.shape[1] // 3, 1)])


def felt_mistakes(source: str) -> Iterator[Mistake[Felt]]:
    """Mistakes about the attitude, and about axes and units of the sensor."""
    yield from attitudes_in(source, "attitude", "before", "after", "R_force")
    columns = {"rate": RATE, "force": FORCE}
    for M in other_axes():
        for row in rows_of("inertial-axes"):
            names = row["names"]
            if len(names) == 2 and np.linalg.det(M) < 0 and not np.diag(M).all():
                continue  # a sensor is no mirror, but a wrong sign is
            turn = partial(_turned_by, M)
            correct = change_columns("imu", [one for name in names for one in columns[name]], turn)
            yield mistake(row, undo_in(turn, *names), correct, axes=axes_words(M))
    for name, names in columns.items():
        for row in rows_of(name):
            change = change_by(row)
            undo = undo_in(change, name)
            yield mistake(
                row, _if_turning(change) if name == "rate" else undo, change_columns("imu", names, change)
            )


def _if_turning(change: Change) -> Callable[[Felt], Felt | None]:
    """Another unit of rates only where something turned, since without all that is compared is noise, and in
    the directions of the attitude, which no unit changes."""

    def undo(f: Felt) -> Felt | None:
        turned = f.turned
        good = np.isfinite(f.rate).all(axis=1)
        size = np.sqrt(np.sum(f.rate[good] ** 2) * np.sum(turned[good] ** 2))
        if _rms(turned) < USUAL_RATE or np.sum(f.rate[good] * turned[good]) < ALONG * size:
            return None
        return undo_in(change, "rate")(f)

    return undo


# -- the magnetic field against attitude, place and the usual length: it stands still in n

#: Length of the Earth's field anywhere, with what is magnetic on board (uT).
WEAK, STRONG = 10.0, 150.0
#: Share of the field's turning that an attitude usually leaves unexplained (as a ratio of sizes), and how far
#: its direction in n usually is off (rad).
UNEXPLAINED_FIELD, DIRECTION = 0.3, 0.3
MOST_FIELD, FIELD_STEP_S = 500, 2.0


@dataclass(frozen=True)
class FieldStep:
    """Field before and after a step (N, 3) in b, attitudes then (N, 3, 3), and the direction of the Earth's
    field in n (3,) where the manifest says it. A step is long enough to turn by more than noise."""

    before: Array
    after: Array
    R_before: Array
    R_after: Array
    earth: Array | None


def _field_misfit(s: FieldStep) -> Misfit:
    """Share of the turning that no field in n explains (first row), and how far its direction is off.

    The field in n is the one whose turns in b are those seen. What is magnetic on board falls out.
    """
    turned, change = np.swapaxes(s.R_after, 1, 2) - np.swapaxes(s.R_before, 1, 2), s.after - s.before

    def left(fit: NDArray[np.bool_], judged: NDArray[np.bool_]) -> tuple[float, float]:
        A = turned[fit].reshape(-1, 3)
        earth = np.linalg.solve(A.T @ A + 1e-9 * np.eye(3), A.T @ change[fit].ravel())
        size = np.linalg.norm(change[judged] - turned[judged] @ earth, axis=1)
        total = max(np.mean(np.linalg.norm(change[judged], axis=1) ** 2), 1e-12)
        off = 0.0
        if s.earth is not None:
            cosine = float(earth @ s.earth / max(float(np.linalg.norm(earth)), 1e-9))
            off = float(np.arccos(np.clip(cosine, -1, 1)))
        return float(np.sqrt(np.mean(size**2) / total)) / UNEXPLAINED_FIELD, 1 + off / DIRECTION

    return crosswise(len(change), 10, left)


def field(flight: Flight) -> Iterator[Finding]:
    """The magnetometer: its unit, then its axes against every attitude."""
    table = flight.tables.get("magnetometer")
    if table is None or len(table) < ENOUGH:
        return
    values = finite_rows(table, ("time_s", *FIELD))
    size = np.median(np.linalg.norm(values[:, 1:], axis=1))
    if not WEAK <= size <= STRONG:
        units = other_units("field")
        ways = [unit for unit, factor in units.items() if 20 <= size * factor <= 80]
        inverse = [unit for unit, factor in units.items() if 20 <= size / factor <= 80]
        code = "field-unit" if ways else "field-in-ut" if inverse else "field-size"
        facts = {"size": size, "units": listed(ways or inverse or [""], "or")}
        causes = tuple(f"magnetometer in {unit}" for unit in ways + inverse)
        yield Finding("problem", "magnetometer", FIELD[0], code, facts, causes)
        return
    for source in airframe_sources(flight):
        given = field_steps(values, flight.nav[source], _earth(flight))
        if given is not None:
            yield from compare(
                "field",
                _field_misfit,
                given,
                field_mistakes(source),
                lambda s: {"share": 100 * max(1 - (UNEXPLAINED_FIELD * _field_misfit(s)[0, 0]) ** 2, 0.0)},
                "magnetometer",
                FIELD[0],
                source=source,
            )


def field_steps(values: Array, nav: pd.DataFrame, earth: Array | None) -> FieldStep | None:
    """Steps of the field (N, 4; time first) with the attitudes of a nav table; None of too few."""
    t = values[:, 0]
    first = thin(len(t), MOST_FIELD)
    last = np.minimum(np.searchsorted(t, t[first] + FIELD_STEP_S), len(t) - 1)
    good = (t[last] - t[first] > FIELD_STEP_S / 2) & (t[last] - t[first] < 2 * FIELD_STEP_S)
    first, last = first[good], last[good]
    at = [attitudes_near(nav, t[rows]) for rows in (first, last)]
    both = np.intersect1d(at[0][0], at[1][0])
    if len(both) < ENOUGH:
        return None
    R = [turns[np.searchsorted(rows, both)] for rows, turns in at]
    return FieldStep(values[first[both], 1:], values[last[both], 1:], R[0], R[1], earth)


def _earth(flight: Flight) -> Array | None:
    stated = flight.manifest.magnetometer
    if stated.inclination_deg is None or stated.declination_deg is None:
        return None
    d, i = np.radians([stated.declination_deg, stated.inclination_deg])
    return np.array([np.cos(i) * np.cos(d), np.cos(i) * np.sin(d), np.sin(i)])


def field_mistakes(source: str) -> Iterator[Mistake[FieldStep]]:
    """Axes of the magnetometer that are exchanged or count the other way, and a yaw from elsewhere."""
    yield from attitudes_in(source, "attitude", "R_before", "R_after")
    for M in other_axes():
        turn = undo_in(partial(_turned_by, M), "before", "after")
        yield mistake(one_row("field-axes"), turn, axes=axes_words(M))


# -- where the nose points, and where the aircraft goes
#
# An aircraft may fly sideways or backwards, and wind lets it crab. Both are no mistake, so that nothing is
# said unless a usual mistake, undone, makes heading follow course through turns, and the aircraft lean as it
# turns: who circles a place with the nose towards it leans rightly as it is. Even then it is a warning.

#: Slower than this (m/s) a course is noise or wind.
MOVING = 3.0
#: Over so many seconds a course is taken, and from so many of them.
COURSE_S, MOST_COURSES = 2.0, 2000
#: Mean cosine between heading and course: below the first they do not follow each other, above the second
#: they do (an angle of 26 deg, as in a strong crosswind).
APART, FOLLOWS = 0.5, 0.9
#: Correlation between lean and acceleration that a right heading has at least, in the air.
LEANS = 0.5
#: How much an aircraft leans in a turn, as a share of what a coordinated turn asks for.
COORDINATED = (0.5, 1.5)
#: What explains it within so little of the best explains it as well.
ALIKE = 0.02
#: Length of the mean direction of the courses: above it the aircraft flew straight on, and one constant angle
#: between both could as well be a slip.
STRAIGHT = 0.8


#: Level vectors in n, north + i east.
Complex = NDArray[np.complex128]


def heading(flight: Flight) -> Iterator[Finding]:
    """Every nav source whose heading does not follow its course, or that does not lean as its course bends,
    where a usual mistake says why."""
    for source in airframe_sources(flight):
        given = headed(flight.nav[source])
        if given is None:
            continue
        R, velocity, acceleration = given
        course = np.angle(velocity)
        before, leant = follows(R, course), leaning_of(R, acceleration)[0, 0]
        apart = leaning_of(R, acceleration, velocity)[0]
        aside = before < APART and np.abs(np.exp(1j * course).mean()) <= STRAIGHT
        turned: list[tuple[float, Mistake[Array]]] = []
        leaning: list[tuple[float, Mistake[Array]]] = []
        for one in attitude_mistakes(f"poses.{source}"):
            undone = one.undo(R)
            if undone is None:
                continue
            after = follows(undone, course)
            right = leaning_of(undone, acceleration)[0, 0] > max(LEANS, leant + LEANS / 2)
            if aside and after >= FOLLOWS and right:
                turned.append((after, one))
            if apart.max() < LEANS / 2 and (after >= FOLLOWS or before < FOLLOWS):
                lean, size = leaning_of(undone, acceleration, velocity)
                # A vessel heels outward, and less: that is no mistake.
                right = lean.min() > LEANS and COORDINATED[0] < size[0] < COORDINATED[1]
                leaning += [(lean[0], one)] if right else []
        for found, code, was, first in (
            # Of the heading only the yaw is asked about: mistakes about it come first.
            (turned, "heading-not-course", before, "yaw"),
            (leaning, "lean-not-course", apart[0], ""),
        ):
            if found:
                best = max(after for after, _ in found)
                alike = [one for after, one in found if after > best - ALIKE]
                named = min(alike, key=lambda one: (first not in one.cause, len(one.cause)))
                facts = {"before": was, "n": len(course), "said": named.said, "after": best, "way": named.fix}
                causes, correct = (f"attitude: {named.cause}",), (change_attitude(source, named.undo),)
                yield Finding("warning", f"nav/{source}", "", code, facts, causes, correct)
                break


def headed(nav: pd.DataFrame) -> tuple[Array, Complex, Complex] | None:
    """Attitudes (N, 3, 3), and level velocities and accelerations (N,), north + i east, m/s and m/s^2, where
    the aircraft moves; None where it hardly does."""
    values = increasing_rows(nav, (*QUATERNION, *POSITION), ENOUGH)
    if values is None:
        return None
    t = values[:, 0]
    middle = thin(len(t), MOST_COURSES)
    half = COURSE_S / 2
    place = values[:, 5] + 1j * values[:, 6]
    before, here, after = (np.interp(t[middle] + s, t, place) for s in (-half, 0.0, half))
    inside = (t[middle] - half >= t[0]) & (t[middle] + half <= t[-1])
    gap = np.diff(t, append=np.inf)[middle]
    moved = (after - before) / COURSE_S
    good = inside & (gap <= COURSE_S) & (np.abs(moved) > MOVING)
    if good.sum() < ENOUGH:
        return None
    R = quaternion_to_matrix(values[middle[good], 1:5])
    return R, moved[good], (after - 2 * here + before)[good] / half**2


def follows(R: Array, course: Array) -> float:
    """Mean cosine of the angle between heading and course: one where the nose points where it goes."""
    return float(np.mean(np.cos(matrix_to_euler(R)[:, 2] - course)))


def leaning_of(R: Array, acceleration: Complex, *others: Complex) -> Array:
    """Correlation, -1 to 1, between how the upper side leans in n and the level accelerations, and how much
    it leans as a share of a coordinated turn; of the whole and of each half, (2, 3), less what goes with
    others.

    With the velocity go the drag, against which an airframe leans, too, and a steady circle, on which each of
    its directions is a constant turn from the acceleration.
    """
    A = np.column_stack([np.ones(len(R)), *others])

    def together(_: NDArray[np.bool_], rows: NDArray[np.bool_]) -> tuple[float, float]:
        lean, gained = (
            part[rows] - A[rows] @ np.linalg.lstsq(A[rows], part[rows], rcond=None)[0]
            for part in (-R[:, 0, 2] - 1j * R[:, 1, 2], acceleration)
        )
        size = np.linalg.norm(lean) * np.linalg.norm(gained)
        alike = float((lean @ gained.conj()).real / size) if size > 0 else 0.0
        ratio = np.linalg.norm(lean) / np.linalg.norm(gained) if size > 0 else 0.0
        return alike, alike * float(ratio) * USUAL_GRAVITY

    return crosswise(len(R), 10, together)
