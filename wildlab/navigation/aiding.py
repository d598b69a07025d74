"""Aiding measurements of the inertial navigation: position and velocity, with their uncertainty.

H 7.3 has the positions of two GNSS antennas, which give the heading as well. Beyond it: antennas' velocities
and standing still.

The magnetic field as a direction: beyond H, whose second vector is the baseline between two antennas.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array, flat_earth, quaternion_to_matrix
from wildlab.navigation import kernels
from wildlab.navigation.kernels import Integers
from wildlab.navigation.strapdown import (
    Gap,
    ImuSamples,
    Measurements,
    Timeline,
    checked_imu,
    find_gaps,
    integrate_strapdown,
    lay_out,
)


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov error that a source's measurements share.

    Attributes
    ----------
    sd
        (3,) stationary standard deviation per axis of n, m or m/s.
    time
        Correlation time, s.
    """

    sd: Array
    time: float


class Aiding(NamedTuple):
    """Measurements of one kind from one source: (N,) times, (N, 3) values, variances and lever arms.

    ``gauss_markov`` comes on top of the variances, which are those of the white noise.
    """

    kind: int
    times: Array
    value: Array
    variance: Array
    lever: Array
    gauss_markov: GaussMarkov | None = None


def _aiding(
    kind: int, times: ArrayLike, value: ArrayLike, sd: ArrayLike, lever: ArrayLike, what: str
) -> Aiding:
    t = np.asarray(times, float)
    shape = (len(t), 3) if t.ndim == 1 else (0, 3)
    try:
        z, spread, arm = (np.array(np.broadcast_to(np.asarray(a, float), shape)) for a in (value, sd, lever))
    except ValueError:
        raise WildlabError(
            f"{what} of shape {np.shape(value)} and standard deviations of shape {np.shape(sd)} do not go "
            f"with times of shape {t.shape}",
            "give times (N,), values (N, 3), and standard deviations (N, 3), (3,) or one number",
            field=what,
        ) from None
    keep = np.isfinite(t) & np.isfinite(z).all(axis=1)
    z, spread, arm, t = z[keep], spread[keep], arm[keep], t[keep]
    if not (np.isfinite(spread).all() and (spread > 0).all()):
        raise WildlabError(
            f"{what} have a standard deviation that is not a positive number",
            "give every measurement one",
            field=what,
        )
    return Aiding(kind, t, z, spread**2, arm)


def positions(
    times: ArrayLike,
    p_n: ArrayLike,
    sd: ArrayLike,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    latency: float = 0.0,
    gauss_markov_sd: ArrayLike = 0.0,
    gauss_markov_time: float = np.inf,
) -> Aiding:
    """Positions of a GNSS antenna, H (7.25).

    Parameters
    ----------
    times
        (N,) s, as stamped.
    p_n
        (N, 3) m in n; rows with NaN are left out.
    sd
        Standard deviations, m: (N, 3), (3,) or one number.
    lever_arm
        Of the antenna in b, (3,) m.
    latency
        How long before its stamp a fix was valid, s.
    gauss_markov_sd, gauss_markov_time
        Of a first-order Gauss-Markov error on top of ``sd``, which neighbouring fixes share (multipath, for
        instance): standard deviation, m, (3,) or one number, and correlation time, s. The filter estimates
        it.

    Returns
    -------
    Aiding

    Raises
    ------
    WildlabError
        For shapes that do not fit, or a standard deviation that is not positive.
    ValueError
        For a ``gauss_markov_sd`` that is neither (3,) nor one number.
    """
    t = np.asarray(times, float) - latency
    found = _aiding(kernels.POSITION, t, p_n, sd, lever_arm, "GNSS positions")
    slow = np.array(np.broadcast_to(np.asarray(gauss_markov_sd, float), 3))
    return found._replace(gauss_markov=GaussMarkov(slow, gauss_markov_time) if slow.any() else None)


def velocities(
    times: ArrayLike,
    v_n: ArrayLike,
    sd: ArrayLike,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    latency: float = 0.0,
) -> Aiding:
    """Velocities of a GNSS antenna; beyond H.

    Parameters
    ----------
    times
        (N,) s, as stamped.
    v_n
        (N, 3) m/s in n; rows with NaN are left out.
    sd
        Standard deviations, m/s: (N, 3), (3,) or one number.
    lever_arm
        Of the antenna in b, (3,) m.
    latency
        How long before its stamp a velocity was valid, s.

    Returns
    -------
    Aiding

    Raises
    ------
    WildlabError
        For shapes that do not fit, or a standard deviation that is not positive.
    """
    t = np.asarray(times, float) - latency
    return _aiding(kernels.VELOCITY, t, v_n, sd, lever_arm, "GNSS velocities")


def standstill(times: ArrayLike, sd: float) -> Aiding:
    """Times at which the airframe is known to stand still; beyond H.

    Parameters
    ----------
    times
        (N,) s.
    sd
        Standard deviation of each component of the velocity, which is zero, m/s.

    Returns
    -------
    Aiding

    Raises
    ------
    WildlabError
        For shapes that do not fit, or a standard deviation that is not positive.
    """
    return _aiding(kernels.VELOCITY, times, np.zeros(3), sd, np.zeros(3), "times of standing still")


def set_out(
    imu: ImuSamples, start: float, aiding: Sequence[Aiding], wanted: Array, max_gap: float
) -> tuple[Timeline, list[Gap]]:
    """The line of time from ``start`` (s) on, with the times that are wanted (M,), and the gaps along it.

    Raises
    ------
    WildlabError
        For inertial samples that cannot be used, or a start outside them.
    """
    samples = checked_imu(imu)
    if not samples.times[0] <= start < samples.times[-1]:
        raise WildlabError(
            f"the start at {start} s is not within the inertial samples, {samples.times[0]} to "
            f"{samples.times[-1]} s",
            "check that inertial sensors and GNSS are on the same clock",
            field="start",
        )
    others = np.concatenate([np.empty(0)] + [source.times for source in aiding])
    gaps = [gap for gap in find_gaps(samples.times, max_gap) if gap.end > start]
    return lay_out(samples, start, others, wanted, max_gap), gaps


def gather(
    aiding: Sequence[Aiding], line: Timeline, first: int = 0
) -> tuple[Measurements, Integers, list[int]]:
    """Measurements in order of time, the index of the aiding of each, and how many of each lie outside.

    The states of Gauss-Markov errors follow each other from index ``first`` on, in order of the aiding.
    """
    low, high = line.times[0], line.times[-1]
    inside = [(source.times >= low) & (source.times <= high) for source in aiding]
    unused = [int(np.sum(~keep)) for keep in inside]
    pairs = list(zip(aiding, inside, strict=True))
    t = np.concatenate([np.empty(0)] + [a.times[keep] for a, keep in pairs])
    order = np.argsort(t, kind="stable")

    def joined(parts: list[Array], tail: tuple[int, ...] = (3,)) -> Array:
        return np.ascontiguousarray(np.concatenate([np.empty((0, *tail)), *parts])[order], float)

    kind = joined([np.full(int(keep.sum()), a.kind, float) for a, keep in pairs], ()).astype(np.int64)
    source = joined([np.full(int(k.sum()), i, float) for i, (_, k) in enumerate(pairs)], ()).astype(np.int64)
    sizes = np.array([0 if a.gauss_markov is None else 3 for a in aiding] + [0])
    states = np.where(sizes > 0, first + np.cumsum(sizes) - sizes, -1).astype(np.int64)
    measured = Measurements(
        np.searchsorted(line.times, t[order]).astype(np.int64), kind, joined([a.value[k] for a, k in pairs]),
        joined([a.variance[k] for a, k in pairs]), joined([a.lever[k] for a, k in pairs]), states[source],
    )  # fmt: skip
    return measured, source, unused


#: Largest standard deviation of a centre, over the radius: a heading by it is then good to some two degrees.
SURE = 0.03
#: Samples that are wrong in the same way, motor currents change no faster: what they count as one.
CORRELATED = 50


def hard_iron(field_b: ArrayLike) -> Array:
    """The part of the field that turns with the airframe.

    The Earth's field has one length, so measurements lie on a sphere around it: its centre by linear least
    squares.

    Parameters
    ----------
    field_b
        (N, 3) in b, as measured, of any unit; rows with NaN are left out.

    Returns
    -------
    (3,) in b, in the unit of ``field_b``.

    Raises
    ------
    WildlabError
        Where there are fewer than ten measurements, or they cover too little of a sphere to say where its
        centre is.
    """
    m = np.asarray(field_b, float)
    m = m[np.isfinite(m).all(axis=1)]
    if len(m) >= 10:
        sphere = np.column_stack([2 * m, np.ones(len(m))])
        square = (m**2).sum(axis=1)
        found, _, rank, _ = np.linalg.lstsq(sphere, square, rcond=None)
        centre, radius = found[:3], float(np.median(np.linalg.norm(m - found[:3], axis=1)))
        if rank == 4:
            missed = float(np.var(square - sphere @ found))
            spread = missed * np.linalg.inv(sphere.T @ sphere)[:3, :3]
            if np.sqrt(np.linalg.eigvalsh(spread)[-1] * CORRELATED) < SURE * radius:
                return np.asarray(centre)
    raise WildlabError(
        "the magnetic field was seen from too few sides to tell the Earth's from that of the airframe",
        "log turns with bank to both sides, or state hard_iron_ut in [magnetometer]",
        field="magnetometer",
    )


def earth_field(declination: float, inclination: float) -> Array:
    """Direction of the Earth's field.

    Parameters
    ----------
    declination
        From true north, positive towards east, rad.
    inclination
        From the horizontal, positive downwards, rad.

    Returns
    -------
    (3,) in n, of length one.
    """
    level = np.cos(inclination)
    return np.array([level * np.cos(declination), level * np.sin(declination), np.sin(inclination)])


def share_turned(times: ArrayLike, field_b: ArrayLike, imu: ImuSamples, step: float = 2.0) -> float:
    """How much of the field's turning in b the gyros explain: near one where both are in the same axes.

    The Earth's field stands still in n, so in b it turns as the airframe does, the other way round. With an
    axis flipped or exchanged it turns in ways that no gyro felt, and the share falls, below zero even.

    Parameters
    ----------
    times, field_b
        (N,) s and (N, 3) in b, of any unit, without the part that turns with the airframe.
    imu
        Of the same flight.
    step
        From one sample compared to the next, s: long enough to turn by more than the field's noise.

    Returns
    -------
    float
        One less the ratio of what is left unexplained to all change; NaN where nothing turns.

    Raises
    ------
    WildlabError
        For inertial samples that cannot be used; see `timeline.checked_imu`.
    """
    t, m = np.asarray(times, float), np.asarray(field_b, float)
    samples = checked_imu(imu)
    every = max(1, round(step / float(np.median(np.diff(t))))) if len(t) > 1 else 1
    t, m = t[::every], m[::every]
    inside = (t >= samples.times[0]) & (t <= samples.times[-1]) & np.isfinite(m).all(axis=1)
    t, m = t[inside], m[inside]
    if len(t) < 2:
        return float("nan")
    none = np.zeros(3)
    moved = integrate_strapdown(samples, none, none, [1.0, 0.0, 0.0, 0.0], flat_earth(0.0), max_gap=np.inf)
    R = quaternion_to_matrix(moved.quaternion[np.searchsorted(samples.times, t)])
    expected = np.einsum("kji,kjl,kl->ki", R[1:], R[:-1], m[:-1])
    change = float(((m[1:] - m[:-1]) ** 2).sum())
    return 1 - float(((m[1:] - expected) ** 2).sum()) / change if change > 0 else float("nan")
