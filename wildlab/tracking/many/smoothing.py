"""Back over the tracks of many targets once the flight is over: what was seen later tells of what was before.

Which measurements were of which target stays as it was taken at the time, and the covariance knows nothing
of what was taken wrongly: among many false measurements it is too small. Kinds of hull stay merged.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from wildlab.tracking.many.run import Shown
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.smoothing import smooth_states

Array = NDArray[np.float64]


def smooth_many(shown: Sequence[Shown], density: float) -> list[tuple[Array, Array]]:
    """Smoothed estimates of all tracks at all scans.

    Where a track was not shown for a while, it is smoothed on either side by itself: what its filter learnt
    meanwhile is not known here.

    Parameters
    ----------
    shown
        From `run_many`.
    density
        `TargetBeliefs.density` that it was run with.

    Returns
    -------
    list of x, P
        For each scan (N, 4) and (N, 4, 4), in the order of its ``identity``.
    """
    after = [(one.x.copy(), one.P.copy()) for one in shown]
    rows: dict[int, list[tuple[int, int]]] = {}
    for scan, one in enumerate(shown):
        for place, identity in enumerate(one.identity.tolist()):
            rows.setdefault(identity, []).append((scan, place))
    for where in rows.values():
        scans = np.array([scan for scan, _ in where])
        for part in np.split(np.arange(len(where)), np.flatnonzero(np.diff(scans) > 1) + 1):
            mine = [where[k] for k in part]
            times = [shown[scan].time for scan, _ in mine]
            x, P = (np.array([after[scan][which][place] for scan, place in mine]) for which in (0, 1))
            x, P = smooth_states(times, x, P, partial(white_acceleration, density=density))
            for (scan, place), mean, covariance in zip(mine, x, P, strict=True):
                after[scan][0][place], after[scan][1][place] = mean, covariance
    return after
