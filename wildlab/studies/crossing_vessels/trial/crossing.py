"""Two vessels that cross, as one flight saw them: detections on the sea, and where the two were."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.georeference import (
    Observations,
    observe,
)
from wildlab.analysis.rendered import exposures_of
from wildlab.analysis.tracks.sighting import truth_states
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.geometry.georeference import georeference_pixels
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking.many.bank import Looks, Tuning

Array = NDArray[np.float64]
Index = NDArray[np.int64]
#: Numbers of a flight by (subject, name).
Numbers = dict[tuple[str, str], float]

#: The vessels as H 6.4.4 names them.
BOATS = ("boat 1", "boat 2")
#: Boat of a detection that is of neither.
NONE = -1
#: H 6.4.4; the gate is of 99 %, of the 95 to 99 % of H 3.3, and the largest speed, which serves the start
#: alone, the deviation of the first velocity. Both are chosen.
TUNING = Tuning(
    measurement=17.5, acceleration=0.2, velocity_0=5.0, gate=gate_threshold(0.99, 2), max_speed=5.0
)
#: Apart again are vessels twice the measurement noise from each other; how a crossing went is seen in the two
#: minutes from then on, several laps, and how it ended in the last two. Chosen.
APART_M, WINDOW_S = 2 * TUNING.measurement, 120.0
#: Tracks are held against the vessels at every so many images with a detection: neighbours tell the same.
EVERY = 5


class Crossing(NamedTuple):
    """What one flight saw of the two.

    Attributes
    ----------
    looks
        All detections.
    boat
        (D,) 0 or 1: whose each is, as by manual classification; `NONE` where it is of nothing.
    times
        (K,) s, of the images with detections.
    truth
        (2, K, 2) where the two were by their own receivers, m.
    """

    looks: Looks
    boat: Index
    times: Array
    truth: Array

    @property
    def apart(self) -> Array:
        """(K,) distance between the two, m."""
        return np.asarray(np.linalg.norm(self.truth[0] - self.truth[1], axis=-1))


def gather(flight: Flight, source: str = "autopilot") -> Crossing:
    """The detections of both vessels on the sea, with the poses of a source."""
    seen = observe(flight, source)
    return arrange(flight, seen, np.array([BOATS.index(name) for name in seen.table["target_id"]]))[0]


def arrange(flight: Flight, seen: Observations, boat: Index) -> tuple[Crossing, Index]:
    """Observations on the sea, in order; and which of them are left, in that order, to have a place.

    ``boat`` (N,) is 0 or 1, or `NONE` for a detection of nothing.
    """
    positions = georeference_pixels(seen.poses, seen.uv, seen.plane_down)[:, :2]
    number = exposures_of(seen.table).astype(int)
    stamps = frame_times(flight)
    at = {one: stamp for one, stamp in zip(exposures_of(flight.table("frames")), stamps, strict=True)}
    order = np.lexsort((boat, number))
    order = order[np.isfinite(positions[order]).all(axis=1)]
    images = np.unique(number[order])
    times = np.array([at[int(one)] for one in images])
    looks = Looks(number[order], positions[order], float(np.median(np.diff(stamps))))
    truth = np.stack([truth_states(flight, name, times)[:, :2] for name in BOATS])
    return Crossing(looks, boat[order], times, truth), order


def apart_times(crossing: Crossing) -> tuple[float, float]:
    """When the two were last `APART_M` from each other before they were nearest, and first after it, s.

    The first and the last time where they never were.
    """
    apart, times = crossing.apart, crossing.times
    nearest = int(np.nanargmin(apart))
    before, after = (np.flatnonzero(part > APART_M) for part in (apart[:nearest], apart[nearest:]))
    return (
        float(times[before[-1]] if len(before) else times[0]),
        float(times[nearest + after[0]] if len(after) else times[-1]),
    )
