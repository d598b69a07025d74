"""What `check_flight` looks at in inertial and satellite measurements: gaps, clocks, then units and axes.

How long the specific force is does not depend on the attitude, and the receiver's velocity tells it too: so
two clocks can be compared before anything else is known.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from wildlab.flight.checks import axes as findings_axes
from wildlab.flight.checks.corrections import APART, shift_clock
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import STEP_S, Array, Inertial, Moves, fixes, moves, samples
from wildlab.flight.store import Flight
from wildlab.geometry.gravity import USUAL_GRAVITY

#: Longer without a sample than this, the attitude is not measured any more: half a roll takes no longer.
IMU_GAP_S = 0.5
#: Longer without a fix than this, dead reckoning by a small sensor is metres off.
OUTAGE_S = 5.0
#: Less of the shorter log than this in common, the clocks are in doubt.
COMMON = 0.5
#: How far apart clocks are looked for, how finely, and from which offset on it is worth saying.
LAG_S, COARSE_S, FINE_S, OFFSET_S = 60.0, 0.25, 0.02, 0.4
#: Correlation that makes an offset believable, how much less it has to leave unexplained (as a ratio of
#: variances) than no offset, and by what logarithm of the likelihood it has to be the better explanation.
ALIKE, BETTER, SURE = 0.6, 1.2, 10.0
#: Peaks that differ by less than this are equally high.
ROUNDS = 0.01
#: Without any correlation above this over all offsets, the logs are not of one flight.
UNLIKE = 0.3
#: Intervals and standard deviation (m/s^2) of the force without which nothing can be told, and without which
#: the lack of a correlation means nothing.
ENOUGH, LIVELY, VERY_LIVELY = 30, 0.2, 0.3


def inertial(flight: Flight) -> Iterator[Finding]:
    """Everything about `imu` and `gnss` that makes navigation wrong without looking wrong."""
    imu, table = samples(flight), fixes(flight)
    if imu is not None:
        yield from _gaps(imu)
    if table is not None:
        yield from _outages(table["time_s"].to_numpy(), imu)
    if imu is None:
        return
    apart = list(_overlap(imu, table))
    yield from apart
    moved = None if any(one.level == "problem" for one in apart) else moves(table)
    wrong = list(findings_axes.units(flight, imu, moved))
    yield from wrong
    if any(one.field.startswith("f_") for one in wrong):
        return
    late = [] if moved is None else list(_offset(flight, imu, moved))
    yield from late
    if not wrong and not late:
        yield from findings_axes.axes(flight, imu, moved)


def _gaps(imu: Inertial) -> Iterator[Finding]:
    step = np.diff(imu.times)
    long = step > max(IMU_GAP_S, 5 * float(np.median(step)))
    if long.any():
        worst = int(np.argmax(step))
        yield Finding(
            "warning",
            "imu",
            "time_s",
            f"nothing was measured for {step[worst]:.1f} s after {imu.times[worst]:.3f} s"
            + (f", the longest of {int(long.sum())} gaps" if long.sum() > 1 else ""),
            "look for the lost samples in the raw log; without them attitude and position are a guess there, "
            "and for a while after",
        )


def _outages(times: Array, imu: Inertial | None) -> Iterator[Finding]:
    # A receiver that falls silent before the end leaves an outage too; before its first fix it had none.
    end = times[-1] if imu is None or imu.times[0] > times[-1] else max(times[-1], imu.times[-1])
    step = np.diff(np.append(times, end))
    long = step > max(OUTAGE_S, 5 * float(np.median(step)))
    if long.any():
        worst = int(np.argmax(step))
        yield Finding(
            "warning",
            "gnss",
            "time_s",
            f"there is no satellite position for {step[worst]:.1f} s after {times[worst]:.3f} s"
            + (f", the longest of {int(long.sum())} outages" if long.sum() > 1 else ""),
            "expect position and velocity to drift there, and look at the uncertainty stated with them",
        )


def _overlap(imu: Inertial, table: pd.DataFrame | None) -> Iterator[Finding]:
    if table is None:
        return
    times = table["time_s"].to_numpy()
    common = min(times[-1], imu.times[-1]) - max(times[0], imu.times[0])
    shorter = min(times[-1] - times[0], imu.times[-1] - imu.times[0])
    if common < COMMON * shorter:
        runs = (
            f"the inertial samples run from {imu.times[0]:.3f} s to {imu.times[-1]:.3f} s, the satellite "
            f"positions from {times[0]:.3f} s to {times[-1]:.3f} s: "
        )
        yield Finding(
            "problem" if common <= 0 else "warning",
            "gnss",
            "time_s",
            runs
            + ("they do not overlap in time" if common <= 0 else f"only {common:.0f} s are common to both"),
            "take both stamps from one clock, or state gnss_offset_s in [clocks]; GPS time is ahead of UTC "
            "by the leap seconds",
            (APART,),
        )


def _offset(flight: Flight, imu: Inertial, moved: Moves) -> Iterator[Finding]:
    """Whether what the receiver says was felt is felt at another time."""
    expected = np.linalg.norm(moved.acceleration - [0.0, 0.0, USUAL_GRAVITY], axis=1)

    def felt_at(lag: float) -> Array:
        return np.asarray(np.linalg.norm(imu.mean_force(moved.start + lag, moved.end + lag), axis=1))

    def alike(lag: float) -> float:
        felt = felt_at(lag)
        good = np.isfinite(felt)
        # An offset that leaves little in common could fit by accident.
        if good.sum() < max(ENOUGH, len(felt) / 4) or min(felt[good].std(), expected[good].std()) < LIVELY:
            return np.nan
        return float(np.corrcoef(felt[good], expected[good])[0, 1])

    coarse = np.arange(-LAG_S, LAG_S + COARSE_S / 2, COARSE_S)
    found = np.array([alike(lag) for lag in coarse])
    here = alike(0.0)
    if np.isnan(here) or np.isnan(found).all():
        return
    # Whoever flies rounds is as like himself a round later: of peaks equally high the nearest is meant.
    high = np.flatnonzero(np.nan_to_num(found, nan=-1.0) > np.nanmax(found) - ROUNDS)
    peaks = [i for i in high if found[i] == np.nanmax(found[max(0, i - 8) : i + 9])]
    middle = coarse[min(peaks, key=lambda i: abs(coarse[i]))]
    fine = np.arange(middle - COARSE_S, middle + COARSE_S + FINE_S / 2, FINE_S)
    near = np.array([alike(lag) for lag in fine])
    best = float(fine[np.nanargmax(near)])
    most = float(np.nanmax(near))
    unexplained = (1 - here**2) / max(1 - most**2, 1e-12)
    # Overlapping intervals count once.
    likelier = float(np.sum(np.diff(moved.start, append=moved.end[-1]).clip(max=STEP_S))) / STEP_S
    likelier *= 0.5 * np.log(unexplained)
    if most < UNLIKE and moved.measured and np.nanstd(felt_at(0.0)) > VERY_LIVELY:
        yield Finding(
            "warning",
            "gnss",
            "time_s",
            "velocity changes of the receiver have nothing in common with what the inertial sensor feels "
            f"(correlation {here:.2f}, and below {UNLIKE:g} for any offset up to {LAG_S:.0f} s)",
            "check that both are of the same flight and the same clock",
        )
    elif most > ALIKE and abs(best) > OFFSET_S and unexplained > BETTER and likelier > SURE:
        offset = flight.manifest.clocks.gnss_offset_s + best
        yield Finding(
            "warning",
            "gnss",
            "time_s",
            f"the stamps seem to be {abs(best):.1f} s {'early' if best > 0 else 'late'} against those of the "
            f"inertial sensor (correlation of the forces {most:.2f} then, {here:.2f} as it is)",
            f"take both stamps from one clock, or set gnss_offset_s = {offset:.1f} in [clocks] (latency_s in "
            "[gnss] if it is the receiver's delay)",
            corrections=(shift_clock("gnss_offset_s", best),),
        )
