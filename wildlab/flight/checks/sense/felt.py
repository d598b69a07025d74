"""What the inertial sensor feels against attitude and velocity: gravity, turns, and which axes are which."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation

from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import (
    POSITION,
    QUATERNION,
    VELOCITY,
    Inertial,
    attitudes_near,
    fixes,
    moves,
    samples,
)
from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.attitudes import attitude_mistakes
from wildlab.flight.checks.sense.trial import Misfit, Mistake, Named, explain
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
#: Without a known mistake, this many times what is usual is said.
UNEXPLAINED = 5.0


@dataclass(frozen=True)
class Felt:
    """Intervals: attitudes before and after (K, 3, 3), length (K,), mean rate (K, 3) of the sensor; and
    (J, 3) forces with the attitudes (J, 3, 3) and the accelerations in n (J, 3) they should follow from."""

    before: Array
    after: Array
    length: Array
    rate: Array
    force: Array
    R_force: Array
    acceleration: Array


def felt(flight: Flight, source: str, imu: Inertial) -> Felt | None:
    """One nav source and the sensor; None where they have too little in common."""
    nav = flight.nav[source]
    if "frame_id" in nav or len(nav) < ENOUGH:
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
    for source in flight.nav:
        given = None if source.startswith("truth") else felt(flight, source, imu)
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
            )
        elif axes := against(given):
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
        yield Mistake(f"attitude: {a.cause}", f"attitude: {a.said}", a.write, _attitude(a.undo))
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
                )


def _scaled(f: Felt, key: str, by: float) -> Felt | None:
    """Another unit; of rates only where something turned, since without all that is compared is noise."""
    if key == "force":
        return replace(f, force=by * f.force)
    return None if _rms(_turns(f)) < RATE else replace(f, rate=by * f.rate)


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
