"""Filters that the thesis has not, on the flight that the figures show: unscented, and two motion models."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.track import Sighting
from wildlab.studies.schmidt.trial import TUNING
from wildlab.tracking.imm import run_imm
from wildlab.tracking.measurement import pixels
from wildlab.tracking.motion import Motion, constant_velocity, in_steps
from wildlab.tracking.run import Start, Track, start_from_first
from wildlab.tracking.unscented import run_unscented

Array = NDArray[np.float64]


def follow_others(seen: Sighting) -> dict[str, Track]:
    """UKF and IMM with the same tuning, asked at the same frames.

    They step from detection to detection, in steps of a frame, which is the same prediction as from frame to
    frame up to the jitter of the images' stamps. The IMM's second model holds ten times the acceleration;
    each lasts a minute on average. Both are chosen, for nothing of the kind is in the thesis.
    """
    frame = float(np.median(np.diff(seen.times)))

    def stepped(acceleration: float) -> Motion:
        @cache  # nearly all steps are of one length
        def motion(dt: float) -> tuple[Array, Array]:
            return in_steps(dt, lambda step: constant_velocity(step, acceleration), frame)

        return motion

    rows = seen.seen
    sensor = pixels(seen.poses.take(rows), seen.plane_down[rows])
    times, uv = seen.times[rows], seen.uv[rows]
    begin: Start = start_from_first(times, seen.positions[rows], TUNING.position_0, TUNING.velocity_0)
    R = np.eye(2) * TUNING.pixel**2
    calm, brisk = stepped(TUNING.acceleration), stepped(10 * TUNING.acceleration)
    return {
        "ukf": run_unscented(times, uv, R, sensor, calm, begin, output_times=seen.times),
        "imm": run_imm(
            times, uv, R, sensor, (calm, brisk), (60.0, 60.0), begin, output_times=seen.times
        ).track,
    }
