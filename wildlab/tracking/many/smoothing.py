"""Back over the tracks of many targets once the flight is over: what was seen later tells of what was before.

Which measurements were of which target stays as it was taken at the time, and the covariance knows nothing
of what was taken wrongly: among many false measurements it is too small. Kinds of hull stay merged; targets
that may also go calmly are smoothed by the lively motion.

Errors that measurements share stay considered and are not estimated. With ``e`` for truth minus estimate and
``o`` for these errors, ``e_k = G e_k+1|k + B o_k+1 + r``, and what is left, ``r``, has nothing to do with any
later error: so ``e^s_k = G e^s_k+1 + B o_k+1 + r``, whose covariance follows from one row back, whatever
gains the filter had. Of errors that fade, what the smoothed estimate at the next row has in common with them
is taken to fade as they do: where they fade within some tens of looks the squared errors were up to a third
larger than stated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wildlab.tracking.many.run import Shown
from wildlab.tracking.maritime import white_acceleration
from wildlab.tracking.schmidt import fade

Array = NDArray[np.float64]


def smooth_many(
    shown: Sequence[Shown], density: float, lasting_s: Sequence[float] = ()
) -> list[tuple[Array, Array]]:
    """Smoothed estimates of all tracks at all scans.

    Where a track was not shown for a while, it is smoothed on either side by itself: what its filter learnt
    meanwhile is not known here.

    Parameters
    ----------
    shown
        From `run_many`.
    density
        `TargetBeliefs.density` that it was run with.
    lasting_s
        As `run_many` was told.

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
            x, P, C = (
                np.array([getattr(shown[scan], name)[place] for scan, place in mine]) for name in "xPC"
            )
            x, P = smooth_considering(times, x, P, C, density, lasting_s)
            for (scan, place), mean, covariance in zip(mine, x, P, strict=True):
                after[scan][0][place], after[scan][1][place] = mean, covariance
    return after


def smooth_considering(
    times: Sequence[float], x: Array, P: Array, C: Array, density: float, lasting_s: Sequence[float] = ()
) -> tuple[Array, Array]:
    """Back over one track.

    Parameters
    ----------
    times
        (N,) s, in order.
    x, P, C
        (N, 4), (N, 4, 4) and (N, 4, k) with all measurements up to then.
    density, lasting_s
        As in `smooth_many`.

    Returns
    -------
    x, P
        With all measurements. Without shared errors those of Rauch, Tung and Striebel.
    """
    after, spread, common = x.copy(), P.copy(), C[-1]
    for row in range(len(times) - 2, -1, -1):
        dt = times[row + 1] - times[row]
        F, Q = white_acceleration(dt, density)
        left = np.diag([fade(dt, float(one)) for one in lasting_s])
        ahead, P_ahead, C_ahead = F @ x[row], F @ P[row] @ F.T + Q, F @ C[row] @ left
        # Of e_k with what is ahead and with the errors then; given these, with what is ahead alone.
        by_errors = C[row] @ left
        own = P_ahead - C_ahead @ C_ahead.T
        G = np.linalg.solve(own, (P[row] @ F.T - by_errors @ C_ahead.T).T).T
        B = by_errors - G @ C_ahead
        rest = P[row] - G @ P_ahead @ G.T - G @ C_ahead @ B.T - B @ C_ahead.T @ G.T - B @ B.T
        later_x, later_P = after[row + 1], spread[row + 1]
        after[row] = x[row] + G @ (later_x - ahead)
        both = G @ common @ B.T
        smoothed = rest + G @ later_P @ G.T + both + both.T + B @ B.T
        spread[row] = (smoothed + smoothed.T) / 2
        common = C[row] - G @ F @ C[row] - B @ left + (B + G @ common) @ left
    return after, spread
