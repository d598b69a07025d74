"""Whether a flight goes fast enough for its course to tell the heading, as navigation needs at the start."""

from __future__ import annotations

import numpy as np

from wildlab.flight.clocks import gnss_times
from wildlab.flight.schema import SECOND_COLUMNS
from wildlab.flight.store import Flight

#: Level speed from which an airframe counts as flying, and its course as a heading, m/s.
FLYING = 8.0


def why_no_start(flight: Flight) -> str:
    """Why nothing tells the heading that navigation starts from: a clause, or nothing where something does.

    Two antennas do, or one fix at `FLYING` or faster while inertial samples are there.

    Parameters
    ----------
    flight
        With the tables ``imu`` and ``gnss``, neither empty.

    Returns
    -------
    str
    """
    gnss = flight.table("gnss")
    if set(SECOND_COLUMNS) <= set(gnss.columns) or len(gnss) < 2:
        return "" if len(gnss) > 1 else "there is only one satellite position"
    t, samples = gnss_times(flight), flight.table("imu")["time_s"].to_numpy(float)
    names = ["v_north_m_s", "v_east_m_s"]
    if set(names) <= set(gnss.columns):
        v = gnss[names].to_numpy(float)
    else:
        v = np.gradient(gnss[["north_m", "east_m"]].to_numpy(float), t, axis=0)
    speed = np.hypot(v[:, 0], v[:, 1])
    speed = speed[(t >= samples[0]) & (t < samples[-1]) & np.isfinite(speed)]
    if not len(speed):
        return "no satellite position is of a time with inertial measurements"
    if speed.max() >= FLYING:
        return ""
    return (
        f"the heading at the start is told by two antennas, or the course at {FLYING:g} m/s and faster, and "
        f"the fastest satellite fix moves at {speed.max():.1f} m/s"
    )
