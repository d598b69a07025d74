"""What the inertial sensor feels against attitude and velocity: gravity, turns, and which axes are which."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.corrections import Correction, change_attitude, change_columns
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import FORCE as FORCES
from wildlab.flight.checks.inertial_data import (
    POSITION,
    QUATERNION,
    VELOCITY,
    Inertial,
    airframe_sources,
    attitudes_near,
    fixes,
    moves,
    samples,
)
from wildlab.flight.checks.inertial_data import RATE as RATES
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.attitudes import attitude_mistakes
from wildlab.flight.checks.sense.trial import Misfit, Mistake, Named, corrections_of, explain
from wildlab.flight.store import Flight
from wildlab.flight.units import other_units
from wildlab.geometry.frames import Array
from wildlab.geometry.gravity import USUAL_GRAVITY

#: What is left between a good small sensor and a good attitude: turns (rad/s) and forces (m/s^2), and
#: as shares of how much there was of both.
RATE, RATE_SHARE, FORCE, FORCE_SHARE = 0.03, 0.15, 0.8, 0.15
#: Turns between attitudes: over at most so long (s), at most so many, and at least so many.
STEP_S, MOST, ENOUGH = 0.5, 600, 30
COUNTED = 0.97
#: A correlation beyond this in either half is a sign, where so many intervals spread by so much (m/s^2).
AGAINST, AGAINST_ENOUGH, LIVELY = 0.4, 100, 0.1
#: Cosine between rates and turns of the attitude, over all, below which no unit makes one of the other.
ALONG = 0.5
#: Without a known mistake, this many times what is usual is said.
UNEXPLAINED = 5.0
#: A heading off by less (rad) is a compass; so many standard deviations beyond it is no chance.
HEADING_OFF, SURE = np.radians(5.0), 3.0
#: Accelerations (m/s^2, root mean square) that tell a heading, the correlation with the forces that takes,
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


def felt(flight: Flight, source: str, imu: Inertial) -> Felt | None:
    """One nav source and the sensor; None where they have too little in common."""
    nav = flight.nav[source]
    if len(nav) < ENOUGH:
        return None
    values = nav[["time_s", *QUATERNION, *POSITION]].to_numpy(float)
    values = values[np.isfinite(values[:, :5]).all(axis=1)]
    t = values[:, 0]
    if len(t) < ENOUGH or (np.diff(t) <= 0).any():
        return None
    last = np.minimum(np.searchsorted(t, t + STEP_S / 5), len(t) - 1)
    first = np.arange(len(t))
    good = (
        (last > first)
        & (t[last] - t[first] <= STEP_S)
        & (t[first] >= imu.times[0])
        & (t[last] <= imu.times[-1])
    )
    first, last = first[good], last[good]
    if len(first) < ENOUGH:
        return None
    pick = np.unique(np.linspace(0, len(first) - 1, MOST).astype(int))
    first, last = first[pick], last[pick]
    R = Rotation.from_quat(values[:, 1:5], scalar_first=True)
    rate = imu.mean_rate(t[first], t[last])
    moved = moves(fixes(flight))
    own = None
    if moved is None and VELOCITY[0] in nav:
        own = moves(nav[["time_s", *POSITION, *VELOCITY]].dropna())
    used = moved or own
    if used is not None:
        start, end, acceleration = used.start, used.end, used.acceleration
        middle = (start + end) / 2
        rows, R_force = attitudes_near(nav, middle)
        force = imu.mean_force(start, end)[rows]
        acceleration = acceleration[rows]
    else:
        middle = (t[first] + t[last]) / 2
        rows, R_force = attitudes_near(nav, middle)
        force = imu.mean_force(t[first], t[last])[rows]
        acceleration = np.zeros_like(force)
    known = np.isfinite(force).all(axis=1) & np.isfinite(acceleration).all(axis=1)
    if known.sum() < ENOUGH or np.isfinite(rate).all(axis=1).sum() < ENOUGH:
        return None
    return Felt(
        R[first].as_matrix(),
        R[last].as_matrix(),
        t[last] - t[first],
        rate,
        force[known],
        R_force[known],
        acceleration[known],
        middle[rows][known],
    )


def misfit(f: Felt) -> Misfit:
    """Turns (first row) and forces (second row), (2, 3), in units of what is usual."""
    turned = _turns(f)
    rate = f.rate - turned
    rate -= np.nanmedian(rate, axis=0) * (np.abs(np.nanmedian(rate, axis=0)) < RATE)  # a bias
    expected = np.einsum("nji,nj->ni", f.R_force, f.acceleration - [0.0, 0.0, USUAL_GRAVITY])
    rows = []
    for left, much, usual, share in (
        (rate, _size(turned, f.rate), RATE, RATE_SHARE),
        (
            f.force - expected,
            _size(expected - _middle(expected), expected - _middle(expected)),
            FORCE,
            FORCE_SHARE,
        ),
    ):
        half = np.arange(len(left)) // 10 % 2 == 0
        rows.append([_rms(left[which]) / (usual + share * much) for which in (half | True, half, ~half)])
    return np.array(rows)


def _middle(values: Array) -> Array:
    return np.asarray(np.median(values, axis=0))


def _size(one: Array, other: Array) -> float:
    """How much there is of both: of the lesser, since a wrong unit makes either large."""
    return min(_rms(one), _rms(other))


def _rms(values: Array) -> float:
    length = np.sort(np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1))
    return (
        float(np.sqrt(np.mean(length[: max(1, int(COUNTED * len(length)))] ** 2))) if len(length) else np.inf
    )


def forces(flight: Flight) -> Iterator[Finding]:
    """The inertial sensor against every nav source."""
    imu = samples(flight)
    if imu is None:
        return
    found: list[tuple[str, Felt, list[Named[Felt]]]] = []
    for source in airframe_sources(flight):
        given = felt(flight, source, imu)
        if given is not None:
            found.append((source, given, explain(misfit, given, felt_mistakes(source))))
    for source, given, named in found:
        before = misfit(given)[:, 0]
        if named:
            after = misfit(named[0].undone)[:, 0]
            yield Finding(
                "problem" if before.max() > UNEXPLAINED else "warning",
                "imu" if all("[imu" in one.mistake.write for one in named) else f"nav/{source}",
                "",
                f"turns and forces of the inertial sensor and of nav/{source} differ by "
                f"{words.number(before[0])} and "
                f"{words.number(before[1])} times what is usual: "
                f"{' or '.join(one.mistake.said for one in named)}; then "
                f"it is {words.number(after[0])} and {words.number(after[1])}",
                words.fixes([one.mistake.write for one in named]),
                tuple(one.mistake.cause for one in named),
                corrections_of(named),
            )
        # Where the turns do not fit either, the sign of a force is none of the causes.
        elif before[0] <= UNEXPLAINED and (axes := against(given)):
            key = " and ".join("xyz"[axis] for axis in axes)
            yield Finding(
                "warning",
                "imu",
                f"f_{'xyz'[axes[0]]}_m_s2",
                f"the force along {key} runs against the one that follows from nav/{source} and the "
                "velocities",
                f"{words.negate(key, 'imu.force')}, or look for the fault in [poses.{source}.attitude]",
                (f"sign of force {key}",),
            )
        elif (turned := heading_error(given)) is not None:
            yield _turned_finding(source, turned)
        elif before.max() > UNEXPLAINED:
            yield Finding(
                "warning",
                f"nav/{source}",
                "",
                f"turns and forces of the inertial sensor and of nav/{source} differ by "
                f"{words.number(before[0])} and "
                f"{words.number(before[1])} times what is usual, and none of the usual mistakes "
                "explains it (an attitude "
                "in degrees, and the recipe says rad?)",
                f"check units and axes of [poses.{source}.attitude], [imu.force] and [imu.rate], and "
                "the stamps",
            )


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


def _turned_finding(source: str, error: HeadingError) -> Finding:
    by, sd = np.degrees(error)
    low, high = sorted((abs(by) - 1.96 * sd, abs(by) + 1.96 * sd))
    back = Rotation.from_euler("z", -error.by).as_matrix()
    return Finding(
        "warning",
        f"nav/{source}",
        "",
        f"the heading of nav/{source} is {abs(by):.0f} deg too {'large' if by > 0 else 'small'} "
        f"({low:.0f} to {high:.0f}, 95 %), as the forces and the accelerations of the receiver have it",
        f"count the yaw in [poses.{source}.attitude] from true north: from magnetic north it is off by the "
        "declination; else check the compass",
        ("heading off",),
        (change_attitude(source, lambda R: np.asarray(back @ R)),),
    )


def against(f: Felt) -> list[int]:
    """Axes whose force runs against the one that attitude and velocity ask for, on either half.

    Where an airframe never slips, the force across it is nearly none: its sign shows in this and in no size.
    """
    expected = np.einsum("nji,nj->ni", f.R_force, f.acceleration - [0.0, 0.0, USUAL_GRAVITY])
    half = np.arange(len(expected)) // 10 % 2 == 0
    found = []
    for axis in range(3):
        together = []
        for rows in (half, ~half):
            pair = [
                np.clip(x, *np.percentile(x, [2, 98])) for x in (f.force[rows, axis], expected[rows, axis])
            ]
            lively = len(pair[0]) >= AGAINST_ENOUGH and min(np.std(pair[0]), np.std(pair[1])) > LIVELY
            together.append(float(np.corrcoef(*pair)[0, 1]) if lively else 0.0)
        if max(together) < -AGAINST:
            found.append(axis)
    return found


def felt_mistakes(source: str) -> Iterator[Mistake[Felt]]:
    """Mistakes about the attitude, and about axes and units of the sensor."""
    for a in attitude_mistakes(f"poses.{source}"):
        yield a.within("attitude", _attitude(a.undo), change_attitude(source, a.undo))
    for M in other_axes():
        for key in ("rate", "force", "both"):
            if key == "both" and np.linalg.det(M) < 0 and not np.diag(M).all():
                continue  # a sensor is no mirror, but a wrong sign is
            parts = "[imu.rate] and [imu.force]" if key == "both" else f"[imu.{key}]"
            yield Mistake(
                f"axes of {parts}: {axes_words(M)}",
                f"the axes of the sensor ({key if key != 'both' else 'rate and force'}) are others: "
                f"{axes_words(M)}",
                f"columns and `negate` in {parts} so that {axes_words(M)} of now",
                lambda f, M=M, key=key: replace(  # type: ignore[misc]
                    f,
                    rate=f.rate @ M.T if key != "force" else f.rate,
                    force=f.force @ M.T if key != "rate" else f.force,
                ),
                corrections=(_columns({"rate": RATES, "force": FORCES, "both": RATES + FORCES}[key], M),),
            )
    for key, factors in (
        ("rate", other_units("rate")),
        ("force", other_units("acceleration")),
    ):
        si = "rad/s" if key == "rate" else "m/s2"
        for unit, factor in factors.items():
            for scale, said, write in (
                (factor, f"the {key} is in {unit}, and the recipe says {si}", unit),
                (1 / factor, f"the {key} is in {si}, and the recipe says {unit}", si),
            ):
                yield Mistake(
                    f"{key}: {said.split('is in ')[1]}",
                    said,
                    f'`unit = "{write}"` in [imu.{key}]',
                    lambda f, k=scale, key=key: _scaled(f, key, k),  # type: ignore[misc]
                    corrections=(_columns(RATES if key == "rate" else FORCES, scale * np.eye(3)),),
                )


def _columns(names: tuple[str, ...], M: Array) -> Correction:
    """Other axes or another unit (3, 3) of rate, force or both."""
    return change_columns(
        "imu", names, lambda x: np.hstack([part @ M.T for part in np.split(x, len(names) // 3, 1)])
    )


def _scaled(f: Felt, key: str, by: float) -> Felt | None:
    """Another unit; of rates only where something turned, since without all that is compared is noise, and
    in the directions of the attitude, which no unit changes."""
    if key == "force":
        return replace(f, force=by * f.force)
    turned = _turns(f)
    good = np.isfinite(f.rate).all(axis=1)
    size = np.sqrt(np.sum(f.rate[good] ** 2) * np.sum(turned[good] ** 2))
    if _rms(turned) < RATE or np.sum(f.rate[good] * turned[good]) < ALONG * size:
        return None
    return replace(f, rate=by * f.rate)


def _turns(f: Felt) -> Array:
    turned = Rotation.from_matrix(np.swapaxes(f.before, 1, 2) @ f.after).as_rotvec()
    return np.asarray(turned / f.length[:, None])


def other_axes() -> Iterator[Array]:
    """The 47 ways (3, 3) to exchange axes and turn them round, but for leaving them as they are."""
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            M = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if not (np.eye(3) == M).all():
                yield M


def axes_words(M: Array) -> str:
    """``"x is minus y, y is x"`` for a matrix that takes what is read to what is right."""
    said = []
    for i, row in enumerate(np.asarray(M)):
        j = int(np.argmax(np.abs(row)))
        if i != j or row[j] < 0:
            said.append(f"{'xyz'[i]} is {'minus ' if row[j] < 0 else ''}{'xyz'[j]}")
    return ", ".join(said)


def _attitude(undo: Callable[[Array], Array | None]) -> Callable[[Felt], Felt | None]:
    def change(f: Felt) -> Felt | None:
        before, after, R_force = (undo(R) for R in (f.before, f.after, f.R_force))
        if before is None or after is None or R_force is None:
            return None
        return replace(f, before=before, after=after, R_force=R_force)

    return change
