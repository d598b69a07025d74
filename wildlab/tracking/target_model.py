"""What a tracker of many targets is given, and what follows for a target whose hull is seen in part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.geometry.frames import Array


class Hull(NamedTuple):
    """A kind of target by its size.

    Attributes
    ----------
    name
        What it is called.
    length_m, beam_m
        Its length and breadth.
    share
        How many of all targets are of this kind, before anything was seen of one.
    """

    name: str
    length_m: float
    beam_m: float
    share: float = 1.0


class ManySensorModel(NamedTuple):
    """One sensor. Those with K elements have one for each kind of hull.

    Attributes
    ----------
    name
        What it is called.
    detection
        Probability that a target that is visible is detected in a scan.
    clutter
        False measurements for each square metre and scan, or each radian where it has bearings, above zero.
    near_m, far_m
        Between which distances it sees; measurements from elsewhere are not used, and targets there are not
        missed.
    patience_s
        For time shown after it was last seen.
    rough_m
        (K,) standard deviation of each axis that a hull adds to the noise of a measurement: which part of it
        is seen.
    along_m
        (K,) the same along the hull, which points where it goes.
    near_side_m
        (K,) how far on this side of the hull's middle the part lies that is seen, of one seen from its side.
    several
        Whether one hull may give several measurements in a scan.
    bearings
        Whether it measures bearings: these move tracks, and neither begin nor confirm one; nor are they
        sightings that one is shown for.
    near_end_m
        (K,) as ``near_side_m``, of a hull that heads for the platform or away from it; empty: the same.
    correlation, lasting_s
        Share of the variance of a measurement, the hull's part included, that stays with its target from scan
        to scan, a first-order process of that correlation time: the same part of a hull is seen. It is
        considered and not estimated. Not of bearings.
    """

    name: str
    detection: float
    clutter: float
    near_m: float
    far_m: float
    patience_s: float
    rough_m: tuple[float, ...]
    along_m: tuple[float, ...]
    near_side_m: tuple[float, ...]
    several: bool = False
    bearings: bool = False
    near_end_m: tuple[float, ...] = ()
    correlation: float = 0.0
    lasting_s: float = 0.0


class ManyTargetModel(NamedTuple):
    """The targets.

    Attributes
    ----------
    hulls
        The K kinds.
    density
        m/s per square root of a second: standard deviation of each axis of the velocity that grows in one.
    start_speed_m_s
        Standard deviation of each axis of the velocity of a new track.
    lifetime_s
        For how long a target is there, in the mean.
    birth
        Probability that a measurement that nobody takes is a new target.
    visible_s, hidden_s
        For how long a target within reach can be seen, and cannot, in the mean.
    gate
        How many standard deviations a measurement may be off.
    confirmed, hits
        From which probability of existence and how many scans with a measurement on a track is confirmed.
    shown
        A confirmed track is shown while it exists with a higher probability.
    forgotten
        Below which probability it ends; ``lost_m`` standard deviation of its position above which it does,
        beside errors that all measurements share.
    fastest_m_s
        A track that is faster follows no target.
    moves_m, over_s
        A track is shown once it has moved so far within so long: what stays is a buoy or the shore.
    apart_m
        Tracks nearer to each other than this, and alike in velocity, are one.
    """

    hulls: tuple[Hull, ...]
    density: float
    start_speed_m_s: float
    lifetime_s: float
    birth: float
    visible_s: float
    hidden_s: float
    gate: float
    confirmed: float
    hits: int
    shown: float
    forgotten: float
    lost_m: float
    fastest_m_s: float
    moves_m: float
    over_s: float
    apart_m: float


def own_lasting(sensors: Sequence[ManySensorModel]) -> tuple[float, ...]:
    """For how long errors last that each target has of its own.

    Parameters
    ----------
    sensors
        In the order in which the tracker has them.

    Returns
    -------
    tuple of float
        s, of two axes of each sensor with ``correlation``; they stand behind errors that measurements share.
    """
    return tuple(one.lasting_s for one in sensors if one.correlation > 0 for _ in range(2))


def own_columns(sensors: Sequence[ManySensorModel], sensor: int, errors: int) -> slice:
    """Which of so many errors are a target's own by this sensor; the first sensor's are behind all shared."""
    first = errors - len(own_lasting(sensors[sensor:]))
    return slice(first, first + len(own_lasting(sensors[sensor : sensor + 1])))


#: Places (N, 2) in n to whether they are in view, (N,).
Sees = Callable[[Array], NDArray[np.bool_]]


class Scan(NamedTuple):
    """One scan of one sensor.

    Attributes
    ----------
    time
        s.
    sensor
        Which of the sensors, by its place among them.
    platform
        (2,) north, east in n, m.
    z, R
        (M, 2) and (M, 2, 2): places in n with their covariances, m and m^2; or (M, 1) and (M, 1, 1): bearings
        from north, rad and rad^2.
    sees
        Which of (N, 2) places a camera shows, (N,) bool; None: whatever is within reach is looked at.
    shared
        (M, 2, k) of places: how far, m, each is moved by one standard deviation of each of k errors that all
        measurements of the scan have in common, such as those of the platform's pose. ``R`` is without them.
        None: there are none.
    """

    time: float
    sensor: int
    platform: Array
    z: Array
    R: Array
    sees: Sees | None = None
    shared: Array | None = None


#: One kind of target, as small as a point.
POINT = Hull("point", 0.0, 0.0)


def largest_of(hulls: tuple[Hull, ...]) -> NDArray[np.bool_]:
    """(K,) which columns are of the largest kind of hull."""
    largest = max(hulls, key=lambda hull: hull.length_m)
    return np.array([hull == largest for hull in hulls], bool)


def at_least(kinds: Array, least: float) -> Array:
    """(T, K) with no hull less probable than that, beside another; sums may exceed one."""
    return kinds if kinds.shape[1] < 2 else np.maximum(kinds, least)


#: At this speed, m/s, a target's course is half believed to be its heading; a slower one points anywhere.
STEERS_M_S = 0.5
#: No scan makes a kind of hull more probable than by this factor, however many measurements it has.
MOST_TOLD = 20.0
#: A kind of hull never gets less probable than this: what was wrongly merged once must find its way back.
LEAST_KIND = 0.02


def near_side(x: ArrayLike, platform: ArrayLike, sensor: ManySensorModel) -> Array:
    """Where on its hull a target is seen, from the hull's middle: the near side of an ellipse.

    ``sensor.near_side_m`` is how far that is where the hull is seen from its side, ``near_end_m`` where it is
    seen along its heading, and as often as not where nobody knows the heading (`STEERS_M_S`).

    Parameters
    ----------
    x
        (T, K, 4) north, east and velocities, for each kind of hull.
    platform
        (2,) where it is looked from.

    Returns
    -------
    (T, K, 2) m, towards the platform; never more than half-way to it.
    """
    to = np.asarray(platform, float) - np.asarray(x, float)[..., :2]
    distance = np.linalg.norm(to, axis=-1, keepdims=True)
    side = np.asarray(sensor.near_side_m)[:, None]
    end = np.asarray(sensor.near_end_m or sensor.near_side_m)[:, None]
    v = np.asarray(x, float)[..., 2:]
    square = (v**2).sum(axis=-1, keepdims=True)
    course = (to * v).sum(axis=-1, keepdims=True) ** 2
    # How much of the heading lies in the line of sight: the square of a cosine.
    known = np.divide(course, square * distance**2, out=np.zeros_like(course), where=square * distance > 0)
    steers = square / (square + STEERS_M_S**2)
    along = steers * known + (1 - steers) / 2
    length = np.minimum(np.sqrt(along * end**2 + (1 - along) * side**2), distance / 2)
    return np.asarray(np.divide(to, distance, out=np.zeros_like(to), where=distance > 0) * length)


def hull_noise(x: ArrayLike, sensor: ManySensorModel) -> Array:
    """Covariances (T, K, 2, 2), m^2, of which part of a hull is seen; ``x`` (T, K, 4).

    Along the hull it is longer. Where a target hardly moves its heading is not known: half of it is then
    along either axis.
    """
    v = np.asarray(x, float)[..., 2:]
    square = (v**2).sum(axis=-1)[..., None, None]
    steers = square / (square + STEERS_M_S**2)
    outer = v[..., :, None] * v[..., None, :]
    heading = np.divide(outer, square, out=np.zeros_like(outer), where=square > 0)
    along = steers * heading + (1 - steers) * np.eye(2) / 2
    rough, length = np.asarray(sensor.rough_m), np.asarray(sensor.along_m)
    return np.asarray(rough[:, None, None] ** 2 * np.eye(2) + length[:, None, None] ** 2 * along)


def lasting_part(noise: Array, correlation: float) -> Array:
    """What one standard deviation of the lasting error of each axis moves a measurement by (..., 2, 2), m.

    ``noise`` (..., 2, 2) m^2: its whole covariance, of which ``correlation`` lasts. The symmetric root, which
    turns with the covariance.
    """
    det = noise[..., 0, 0] * noise[..., 1, 1] - noise[..., 0, 1] * noise[..., 1, 0]
    root = np.sqrt(np.maximum(det, 0.0))[..., None, None]
    scale = np.sqrt(np.trace(noise, axis1=-2, axis2=-1)[..., None, None] + 2 * root)
    return np.asarray(np.sqrt(correlation) * (noise + root * np.eye(2)) / scale)


class Gathered(NamedTuple):
    """Measurements with those of one hull merged.

    ``z`` (M', 2), ``R`` (M', 2, 2) and ``shared`` (M', 2, k); ``kinds`` (T, K) of the tracks, which several
    measurements tell something of.
    """

    z: Array
    R: Array
    shared: Array
    kinds: Array


def gather(
    z: Array,
    R: Array,
    shared: Array,
    mean: Array,
    kinds: Array,
    established: NDArray[np.bool_],
    likelihood: Array,
    sensor: ManySensorModel,
    hulls: tuple[Hull, ...],
) -> Gathered:
    """Merge the measurements of a scan that lie along one large hull to one of the part that is followed.

    Each counts in the share in which it is of that part, by its likelihood: what a ship shows in every scan
    keeps the track where it is, and its stern, seen now and then, pulls it less. How far the parts lie from
    each other is noise of what they are merged to.

    Each measurement goes to the established track that it is likeliest of, or where no gate takes it, to the
    one whose hull it may lie on. Where one track has two and more, it is of the largest kind, or the others
    are clutter: the kinds learn the ratio of both densities. They are merged where the largest is likelier.

    Parameters
    ----------
    z, R, shared
        (M, 2), (M, 2, 2) and (M, 2, k).
    mean
        (T, 2) where tracks of the largest kind would be.
    kinds
        (T, K) probabilities.
    established
        (T,) tracks that may have a hull; a new one is too young for it.
    likelihood
        (T, K, M).
    """
    largest = largest_of(hulls)
    hull = hulls[int(largest.argmax())]
    one = sensor.bearings or not sensor.several
    if one or len(z) < 2 or not established.any() or hull.length_m <= 0:
        return Gathered(z, R, shared, kinds)
    kinds = kinds.copy()
    of_any = np.einsum("tk,tkm->tm", kinds, likelihood)
    whose = of_any.argmax(axis=0)
    taken = of_any.max(axis=0) > 0
    free = np.ones(len(z), bool)
    merged_z, merged_R, merged_shared = [], [], []
    of_largest = np.einsum("tk,tkm->tm", kinds[:, largest], likelihood[:, largest])
    further = 1.0 / (hull.length_m * max(hull.beam_m, 1.0)) / sensor.clutter
    for track in np.flatnonzero(established):
        on_hull = np.linalg.norm(z - mean[track], axis=1) < 0.6 * hull.length_m
        mine = (taken & (whose == track) & (likelihood[track, largest] > 0).any(axis=0)) | (~taken & on_hull)
        rows = np.flatnonzero(mine & free)
        if len(rows) < 2:
            continue
        low, high = z[rows].min(axis=0), z[rows].max(axis=0)
        if np.linalg.norm(high - low) >= hull.length_m:
            continue
        kinds[track, largest] *= min(further ** (len(rows) - 1), MOST_TOLD)
        kinds[track] /= kinds[track].sum()
        if kinds[track, largest].sum() > 0.5:
            free[rows] = False
            share = of_largest[track, rows]
            share = share / share.sum() if share.any() else np.full(len(rows), 1 / len(rows))
            middle = share @ z[rows]
            merged_z.append(middle)
            off = z[rows] - middle
            merged_R.append(R[rows].mean(axis=0) + (share[:, None] * off).T @ off)
            merged_shared.append(np.einsum("m,mik->ik", share, shared[rows]))
    if not merged_z:
        return Gathered(z, R, shared, kinds)
    pairs = ((z, merged_z), (R, merged_R), (shared, merged_shared))
    z, R, shared = (np.concatenate([alone[free], np.array(merged)]) for alone, merged in pairs)
    return Gathered(z, R, shared, kinds)


def on_one_hull(x: ArrayLike, other: ArrayLike, hull: Hull) -> bool:
    """Whether two tracks (4,) with like velocities lie along the course of the first, on one hull."""
    a, b = np.asarray(x, float), np.asarray(other, float)
    speed = float(np.linalg.norm(a[2:]))
    if speed <= STEERS_M_S or np.linalg.norm(a[2:] - b[2:]) >= ALIKE_M_S:
        return False
    ahead, apart = a[2:] / speed, b[:2] - a[:2]
    across = abs(ahead[0] * apart[1] - ahead[1] * apart[0])
    return bool(abs(apart @ ahead) < hull.length_m and across < max(hull.beam_m, 1.0) / 2 + 1.0)


#: Velocities of two parts of one hull differ by less than this, m/s.
ALIKE_M_S = 1.5
