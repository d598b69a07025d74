"""Joint association of two vessels that cross, by distance alone."""

from __future__ import annotations

import numpy as np

from wildlab.evaluation.identities import Identities, Moment, compare_identities
from wildlab.studies.crossing_vessels.trial.crossing import (
    APART_M,
    BOATS,
    EVERY,
    TUNING,
    WINDOW_S,
    Crossing,
    Numbers,
    apart_times,
)
from wildlab.tracking.many import POINT, ManySensorModel, ManyTargetModel, run_many
from wildlab.tracking.many import Scan as Look

#: Joint integrated data association beside them, by distance alone (H 8.2 names it as what would come next).
JOINT = "jipda"
#: What joint association is told: the printed noise of `TUNING`, as white acceleration of the same strength.
#: Chosen, once: nearly all that is in view is detected and hardly anything else is; a vessel is in view for
#: some seconds in each lap and then for half a minute not, and both are there for good.
SENSOR = ManySensorModel(
    name="camera", detection=0.95, clutter=1e-8, near_m=0.0, far_m=np.inf, patience_s=np.inf,
    rough_m=(0.0,), along_m=(0.0,), near_side_m=(0.0,),
)  # fmt: skip
TARGETS = ManyTargetModel(
    hulls=(POINT,), density=TUNING.acceleration, start_speed_m_s=TUNING.velocity_0, lifetime_s=1e6, birth=0.9,
    visible_s=5.0, hidden_s=30.0, gate=float(np.sqrt(TUNING.gate)), confirmed=0.9, hits=2, shown=0.5,
    forgotten=1e-3, lost_m=1e4, fastest_m_s=np.inf, moves_m=0.0, over_s=0.0, apart_m=0.0,
)  # fmt: skip


def joint_of(crossing: Crossing, density: float) -> Identities:
    """The same detections by joint integrated data association, against the vessels at every image."""
    number = np.searchsorted(np.unique(crossing.looks.image), crossing.looks.image)
    R = TUNING.measurement**2 * np.eye(2)
    looks = [
        Look(float(time), 0, np.zeros(2), crossing.looks.positions[rows], np.tile(R, (int(rows.sum()), 1, 1)))
        for k, time in enumerate(crossing.times)
        for rows in [number == k]
    ]
    ignored, scans = np.zeros(2, bool), []
    for k, one in enumerate(run_many(looks, [SENSOR], TARGETS._replace(density=density))):
        if k % EVERY:
            continue
        known = np.isfinite(crossing.truth[:, k]).all(axis=1)
        shown = np.isin([0, 1], crossing.boat[number == k])
        scans.append(
            Moment(
                one.time, one.x[:, :2], one.P[:, :2, :2], one.identity.tolist(), crossing.truth[known, k],
                [BOATS[n] for n in np.flatnonzero(known)], shown[known], ignored[known],
            )
        )  # fmt: skip
    return compare_identities(scans, APART_M)


def density_of(interval: float) -> float:
    """White acceleration that spreads velocities as fast as `TUNING`'s, which is held from image to image.

    An acceleration drawn anew every T s adds (sd T)^2 to the variance of a velocity each time.
    """
    return TUNING.acceleration * float(np.sqrt(interval))


def joint_swapped(crossing: Crossing, told: Identities) -> tuple[bool, bool]:
    """As `swapped`, of tracks that are shared: whether each is on the other vessel than before the crossing.

    A vessel's track is the one that is on it most often: before the crossing since the beginning, after it in
    `WINDOW_S` from when the two are apart again, and at the end in the last.
    """
    times = crossing.times
    until, since = apart_times(crossing)
    at = times[::EVERY]

    def mostly(low: float, high: float) -> list[object]:
        rows = np.flatnonzero((at >= low) & (at <= high))
        found: list[object] = []
        for boat in BOATS:
            names = [told.followed[row][boat] for row in rows if boat in told.followed[row]]
            found.append(max(sorted(set(names), key=str), key=names.count) if names else None)
        return found

    before = mostly(float(times[0]), until)

    def exchanged(after: list[object]) -> bool:
        return None not in before and after[0] == before[1] and after[1] == before[0]

    end = float(times[-1])
    return exchanged(mostly(since, since + WINDOW_S)), exchanged(mostly(end - WINDOW_S, end))


def joint_numbers(crossing: Crossing) -> Numbers:
    """What `UNITS` names of joint association; it gives no detection to one track alone."""
    told = joint_of(crossing, density_of(crossing.looks.interval))
    after, end = joint_swapped(crossing, told)
    anees = [track.anees for track in told.tracks.values() if np.isfinite(track.anees)]
    return {
        (JOINT, "swapped"): float(after),
        (JOINT, "swapped_at_end"): float(end),
        (JOINT, "swaps"): float(told.swaps),
        (JOINT, "breaks"): float(told.breaks),
        (JOINT, "gospa"): float(np.mean([one.distance for one in told.gospa])),
        (JOINT, "anees"): float(np.median(anees)) if anees else np.nan,
    }
