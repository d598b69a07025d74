"""How evenly a sensor's samples came, and how much an inertial sensor shakes.

Shaking is measured as limits are stated for it, ArduPilot's way: what is slower than 5 Hz is taken off, what
is left squared, smoothed below 2 Hz and its root taken (both first order), for each axis. The autopilot does
so at its sensors' own rate, of 1 kHz or more; a log at a lower rate shows less of it, or, where nothing was
filtered before it was thinned, mirrored into lower bands.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Steps beyond so many usual ones miss a sample. A stream is even where the middle 90 % of its steps are
#: within this share of the median: what is triggered now and then has no rate.
MISSED, EVEN = 1.5, 0.5


class Pace(NamedTuple):
    """The stamps of a stream.

    Attributes
    ----------
    n
        Samples with a stamp.
    begin, end
        First and last stamp, s; NaN where there is none.
    step_s
        Median step; NaN below two samples.
    wavering_s
        Half the width of the middle 90 % of the steps.
    missing
        Samples that the steps leave out, where the stream is even; else 0.
    gaps
        (K, 2) begin and end of every pause longer than the longest that was asked for, s.
    unordered
        Steps that do not increase.
    """

    n: int
    begin: float
    end: float
    step_s: float
    wavering_s: float
    missing: int
    gaps: Array
    unordered: int

    @property
    def length_s(self) -> float:
        """From the first to the last stamp."""
        return self.end - self.begin

    @property
    def rate_hz(self) -> float:
        """Samples a second, by the median step; NaN where there is none."""
        return 1 / self.step_s if self.step_s > 0 else float("nan")

    @property
    def even(self) -> bool:
        """Whether the stream has a rate."""
        return bool(self.wavering_s <= EVEN * self.step_s)

    @property
    def paused_s(self) -> float:
        """All pauses together."""
        return float(np.diff(self.gaps, axis=1).sum())

    @property
    def missing_share(self) -> float:
        """Samples that are missing, of those that should be there."""
        return self.missing / max(1, self.n + self.missing)


def pace_of(stamps: ArrayLike, longest_s: float) -> Pace:
    """The pace of a stream.

    Parameters
    ----------
    stamps
        (N,) s; what is not finite is left out.
    longest_s
        Pause that is still none.

    Returns
    -------
    Pace

    Examples
    --------
    >>> pace = pace_of([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 2.8], 1.0)
    >>> round(pace.rate_hz), pace.gaps.tolist()
    (10, [[0.8, 2.8]])
    """
    given = np.asarray(stamps, float)
    given = given[np.isfinite(given)]
    nan = float("nan")
    if not len(given):
        return Pace(0, nan, nan, nan, nan, 0, np.empty((0, 2)), 0)
    t = np.sort(given)
    steps = np.diff(t)
    steps = steps[steps > 0]
    if not len(steps):
        return Pace(
            len(t), float(t[0]), float(t[-1]), nan, nan, 0, np.empty((0, 2)), int((np.diff(given) <= 0).sum())
        )
    median = float(np.median(steps))
    low, high = np.quantile(steps, [0.05, 0.95])
    wavering = float(high - low) / 2
    lacking = steps[steps > MISSED * median]
    missing = int((np.rint(lacking / median) - 1).sum()) if wavering <= EVEN * median else 0
    at = np.flatnonzero(np.diff(t) > longest_s)
    gaps = np.stack([t[at], t[at + 1]], axis=1)
    unordered = int((np.diff(given) <= 0).sum())
    return Pace(len(t), float(t[0]), float(t[-1]), median, wavering, missing, gaps, unordered)


def runs_of(mask: ArrayLike, stamps: ArrayLike) -> Array:
    """Begin and end of every run of samples that a mask marks.

    Parameters
    ----------
    mask
        (N,) bool.
    stamps
        (N,) increasing.

    Returns
    -------
    (K, 2)
        A run ends with the first sample behind it, the last one with its own.

    Examples
    --------
    >>> runs_of([False, True, True, False, True], [0.0, 1.0, 2.0, 3.0, 4.0]).tolist()
    [[1.0, 3.0], [4.0, 4.0]]
    """
    marked, t = np.asarray(mask, bool), np.asarray(stamps, float)
    if not marked.any():
        return np.empty((0, 2))
    edges = np.diff(np.concatenate([[False], marked, [False]]).astype(int))
    begin, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return np.stack([t[begin], t[np.minimum(end, len(t) - 1)]], axis=1)


#: What is shaking and not flying, and what is smoothed over, Hz.
FLOOR_HZ, SMOOTH_HZ = 5.0, 2.0
#: Limits of ArduPilot's documentation ("Measuring Vibration"), m/s^2: below the first it is usually fine,
#: above the second estimates of height and position usually suffer.
FINE, HARMFUL = 30.0, 60.0
#: Below this rate (Hz) nothing above the floor is left to see, and so few samples tell nothing.
LEAST_HZ, FEWEST = 20.0, 200


def vibration_of(stamps: ArrayLike, force: ArrayLike) -> Array | None:
    """How much a sensor shakes over time, m/s^2, by the measure of the limits.

    Parameters
    ----------
    stamps
        (N,) s, increasing.
    force
        (N, 3) m/s^2, finite.

    Returns
    -------
    (N, 3) array or None
        Of each axis; None where the samples are too few or too slow to tell.

    Examples
    --------
    A sine of 40 Hz and 10 m/s^2 along one axis, whose root mean square is 7.1 m/s^2:

    >>> t = np.arange(0, 20, 1 / 200)
    >>> found = vibration_of(t, np.stack([10 * np.sin(2 * np.pi * 40 * t), 0 * t, 0 * t], axis=1))
    >>> round(float(np.median(found[:, 0])), 1)
    6.5
    """
    t, f = np.asarray(stamps, float), np.asarray(force, float)
    if len(t) < FEWEST:
        return None
    rate = 1 / float(np.median(np.diff(t)))
    if not rate >= LEAST_HZ:
        return None
    shaken = (f - _smoothed(f, FLOOR_HZ, rate)) ** 2
    return np.asarray(np.sqrt(np.maximum(_smoothed(shaken, SMOOTH_HZ, rate), 0)))


def _smoothed(values: Array, cut_hz: float, rate_hz: float) -> Array:
    """First-order low pass, as autopilots have it, begun at the first value."""
    from scipy.signal import lfilter  # brings scipy.stats along, which takes long

    delay = 1 / (2 * np.pi * cut_hz)
    a = 1 / (1 + delay * rate_hz)
    out, _ = lfilter([a], [1, a - 1], values, axis=0, zi=(1 - a) * values[:1])
    return np.asarray(out)
