"""Where a filter starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.tracking.records import Start


def start_from_first(
    times: ArrayLike,
    positions: ArrayLike,
    sd_position: float,
    sd_velocity: float = 0.0,
    n: int = 4,
    **more: float,
) -> Start:
    """Start on the first georeferenced position, with zero speed (H 6.2.4, 6.3.3).

    Parameters
    ----------
    times
        (N,) s.
    positions
        (N, 2) or (N, 3): north, east in n, m, and what is not looked at; the first row with a time and
        without NaN is taken.
    sd_position, sd_velocity
        m and m/s, the same north and east.
    n
        Number of states: 2, 4 or 6.
    more
        ``sd_acceleration``, m/s^2, with six states; zero where it is left out. No other name is looked at.

    Returns
    -------
    Start
        At the time of that row, which is not used again, with a diagonal ``P`` (n, n).

    Raises
    ------
    WildlabError
        Without any position.
    """
    t, p = np.asarray(times, float), np.asarray(positions, float)[:, :2]
    there = np.flatnonzero(np.isfinite(p).all(axis=1) & np.isfinite(t))
    if not len(there):
        raise WildlabError(
            "no measurement gives a position to start from",
            "check poses and plane, or give the filter a start of its own",
            field="positions",
        )
    row = int(there[0])
    sd = np.repeat([sd_position, sd_velocity, more.get("sd_acceleration", 0.0)], 2)[:n]
    x = np.zeros(n)
    x[:2] = p[row]
    return Start(float(t[row]), x, np.diag(sd**2), row)
