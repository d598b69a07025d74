"""What a tracker of many targets is told of them, of their hulls and of the sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
        For how long a target is shown after it saw it last.
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
    calm, stay_s
        Targets may also go calmly: with this share of ``density``, below one. Each motion lasts so long, in
        the mean. At one there is no other.
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
    calm: float = 1.0
    stay_s: float = 30.0


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
    """One look of one sensor.

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
        measurements of the look have in common, such as those of the platform's pose. ``R`` is without them.
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
