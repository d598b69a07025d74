"""QGroundControl's plan file: JSON with mission, fence and rally points.

Source: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html
"""

from __future__ import annotations

import math
from typing import Any

from wildlab.flight.writers.mission import ABOVE_TAKE_OFF, ABOVE_TERRAIN, NO_FRAME, Mission, mission_items

#: QGroundControl's numbers: ArduPilot; quadrotor and aeroplane; heights above take-off and terrain.
_FIRMWARE = 3
_VEHICLES = {"multicopter": 2, "fixed-wing": 1}
_ALTITUDE_MODES = {ABOVE_TAKE_OFF: 1, ABOVE_TERRAIN: 4}


def qgc_plan(mission: Mission) -> dict[str, Any]:
    """A mission as the content of a ``.plan``.

    Parameters
    ----------
    mission
        The flight.

    Returns
    -------
    dict
        For JSON. The fence is empty: whether a fence that an autopilot enforces is wise here, the pilot
        decides.

    Raises
    ------
    WildlabError
        As `wildlab.flight.writers.mission.mission_items`.
    """
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        "mission": {
            "version": 2,
            "firmwareType": _FIRMWARE,
            "vehicleType": _VEHICLES[mission.vehicle],
            "cruiseSpeed": mission.speed,
            "hoverSpeed": mission.speed,
            "globalPlanAltitudeMode": _ALTITUDE_MODES[
                ABOVE_TAKE_OFF if mission.heights == "take-off" else ABOVE_TERRAIN
            ],
            "plannedHomePosition": [round(one, 8) for one in mission.home],
            "items": _items(mission),
        },
    }


def _items(mission: Mission) -> list[dict[str, Any]]:
    items = []
    for number, item in enumerate(mission_items(mission), start=1):
        *first, lat, lon, height = item.parameters
        parameters = [*first, round(lat, 8), round(lon, 8), round(height, 3)]
        entry: dict[str, Any] = {
            "type": "SimpleItem",
            "autoContinue": True,
            "command": item.command,
            "doJumpId": number,
            "frame": item.frame,
            "params": [None if math.isnan(one) else one for one in parameters],
        }
        if item.frame != NO_FRAME:
            entry |= {
                "Altitude": parameters[6],
                "AltitudeMode": _ALTITUDE_MODES[item.frame],
                "AMSLAltAboveTerrain": None,
            }
        items.append(entry)
    return items
