"""How much an inertial sensor shakes: by band of frequency, and by the measure that limits are stated for.

That measure, ArduPilot's, takes off what is slower than 5 Hz, squares what is left, smooths it below 2 Hz
and takes the root (both first order), for each axis. The autopilot does so at its sensors' own rate, of 1 kHz
or more; a log at a lower rate shows less of it, or, where nothing was filtered before it was thinned,
mirrored into lower bands.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Edges of the bands, Hz: what steers an aircraft is below the first one.
EDGES = (1.0, 5.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
#: What is shaking and not flying, and what is smoothed over, Hz.
FLOOR_HZ, SMOOTH_HZ = 5.0, 2.0
#: Limits of ArduPilot's documentation ("Measuring Vibration"), m/s^2: below the first it is usually fine,
#: above the second estimates of height and position usually suffer.
FINE, HARMFUL = 30.0, 60.0
#: Below this rate (Hz) nothing above the floor is left to see, and so few samples tell nothing.
LEAST_HZ, FEWEST = 20.0, 200
#: Samples of one spectrum.
SEGMENT = 1024


class Vibration(NamedTuple):
    """What an accelerometer (N, 3) shows of shaking.

    Attributes
    ----------
    rate_hz
        Of the samples; nothing above half of it is in them.
    bands
        (B, 2) Hz.
    rms
        (B, 3) m/s^2, of each axis in each band.
    level
        (N, 3) m/s^2 over time, the measure of the limits.
    """

    rate_hz: float
    bands: Array
    rms: Array
    level: Array

    @property
    def worst(self) -> Array:
        """(N,) m/s^2, of the axis that shakes most at the time."""
        return np.asarray(self.level.max(axis=1))

    def share_above(self, limit: float) -> float:
        """Share of the samples at which an axis shakes more than that."""
        return float((self.worst > limit).mean())


def vibration_of(stamps: ArrayLike, force: ArrayLike) -> Vibration | None:
    """How much a sensor shakes.

    Parameters
    ----------
    stamps
        (N,) s, increasing.
    force
        (N, 3) m/s^2, finite.

    Returns
    -------
    Vibration or None
        None where the samples are too few or too slow to tell.

    Examples
    --------
    A sine of 40 Hz and 10 m/s^2 about one axis has a root mean square of 7.1 m/s^2:

    >>> t = np.arange(0, 20, 1 / 200)
    >>> found = vibration_of(t, np.stack([10 * np.sin(2 * np.pi * 40 * t), 0 * t, 0 * t], axis=1))
    >>> found.bands[np.argmax(found.rms[:, 0])].tolist(), round(float(found.rms[:, 0].max()), 1)
    ([20.0, 50.0], 7.1)
    >>> round(float(np.median(found.worst)), 1)
    6.5
    """
    from scipy.signal import welch  # brings scipy.stats along, which takes long

    t, f = np.asarray(stamps, float), np.asarray(force, float)
    if len(t) < FEWEST:
        return None
    rate = 1 / float(np.median(np.diff(t)))
    if not rate >= LEAST_HZ:
        return None
    top = rate / 2
    edges = [edge for edge in EDGES if edge < top] + [top]
    bands = np.array(list(pairwise(edges)))
    length = min(SEGMENT, len(t))
    frequency, density = welch(f, rate, nperseg=length, axis=0)
    width = frequency[1] - frequency[0]
    rms = np.array(
        [
            np.sqrt((density[(frequency >= low) & (frequency < high)] * width).sum(axis=0))
            for low, high in bands
        ]
    )
    shaken = (f - _smoothed(f, FLOOR_HZ, rate)) ** 2
    return Vibration(rate, bands, rms, np.sqrt(np.maximum(_smoothed(shaken, SMOOTH_HZ, rate), 0)))


def _smoothed(values: Array, cut_hz: float, rate_hz: float) -> Array:
    """First-order low pass, as autopilots have it, begun at the first value."""
    from scipy.signal import lfilter  # brings scipy.stats along, which takes long

    delay = 1 / (2 * np.pi * cut_hz)
    a = 1 / (1 + delay * rate_hz)
    out, _ = lfilter([a], [1, a - 1], values, axis=0, zi=(1 - a) * values[:1])
    return np.asarray(out)
