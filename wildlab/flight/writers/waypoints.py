"""MAVLink's plain text of a mission, ``QGC WPL 110``, which Mission Planner and QGroundControl open.

Source: https://mavlink.io/en/file_formats/#mission_plain_text_file
"""

from __future__ import annotations

import math

from wildlab.flight.writers.mission import GLOBAL, WAYPOINT, Mission, mission_items


def waypoints_text(mission: Mission) -> str:
    """A mission as ``.waypoints``.

    Parameters
    ----------
    mission
        The flight.

    Returns
    -------
    str
        Line 0 is the home position; fields between tabs: number, current, frame, command, four parameters,
        latitude, longitude (degrees), height (metres), whether to go on.

    Raises
    ------
    WildlabError
        As `wildlab.flight.writers.mission.mission_items`.

    Examples
    --------
    >>> import numpy as np
    >>> one = np.array([1.0])
    >>> mission = Mission("sortie 1", one, one, 50 * one, 50 * one, (1.0, 1.0, 0.0), 10.0)
    >>> print(waypoints_text(mission).splitlines()[0])
    QGC WPL 110
    """
    lat, lon, height = mission.home
    lines = ["QGC WPL 110", _line(0, GLOBAL, WAYPOINT, (0, 0, 0, 0, lat, lon, height), current=True)]
    for number, item in enumerate(mission_items(mission), start=1):
        lines.append(_line(number, item.frame, item.command, item.parameters))
    return "\n".join(lines) + "\n"


def _line(
    number: int, frame: int, command: int, parameters: tuple[float, ...], *, current: bool = False
) -> str:
    # The format has no word for what the autopilot shall choose; zero is what ground stations write there.
    *first, lat, lon, height = (0.0 if math.isnan(one) else one for one in parameters)
    words = [str(number), str(int(current)), str(frame), str(command)]
    words += [f"{one:.8f}" for one in first]
    words += [f"{lat:.8f}", f"{lon:.8f}", f"{height:.6f}", "1"]
    return "\t".join(words)
