"""A flight for an autopilot: its way points, and the items that MAVLink makes of them.

Commands, frames and parameters are those of MAVLink's common set (https://mavlink.io/en/messages/common.html).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array

Heights = Literal["take-off", "ground"]
Vehicle = Literal["multicopter", "fixed-wing"]

WAYPOINT, RETURN, TAKE_OFF, CHANGE_SPEED, TRIGGER_DISTANCE = 16, 20, 22, 178, 206
#: MAV_FRAME: global with height above sea level; none; above the take-off point; above the terrain.
GLOBAL, NO_FRAME, ABOVE_TAKE_OFF, ABOVE_TERRAIN = 0, 2, 3, 10
FRAMES: dict[Heights, int] = {"take-off": ABOVE_TAKE_OFF, "ground": ABOVE_TERRAIN}
#: Items that autopilots of small memory take.
MOST_ITEMS = 700


@dataclass(frozen=True, eq=False)
class Mission:
    """One flight, from take-off to landing.

    Attributes
    ----------
    name
        Of the flight.
    latitude, longitude
        (N,) of the way points, degrees of WGS84.
    above_home, above_ground
        (N,) heights above the take-off point, and above the ground below the way point, metres.
    home
        Latitude, longitude (degrees) and height (metres above whatever the terrain's heights are above; zero
        where there is none) of the take-off point.
    speed
        Through the air, or over the ground where ``vehicle`` hovers, m/s.
    heights
        Above what the autopilot shall keep its height.
    vehicle
        Which kind.
    photo_distance
        Metres between photos; zero where the mission does not trigger the camera.
    """

    name: str
    latitude: Array
    longitude: Array
    above_home: Array
    above_ground: Array
    home: tuple[float, float, float]
    speed: float
    heights: Heights = "take-off"
    vehicle: Vehicle = "multicopter"
    photo_distance: float = 0.0

    def __post_init__(self) -> None:
        rows = [np.asarray(getattr(self, name), float) for name in _ROWS]
        if any(one.shape != rows[0].shape or one.ndim != 1 for one in rows) or not len(rows[0]):
            raise WildlabError(
                f"way points of the shapes {[one.shape for one in rows]}",
                "give one value for each way point, and one way point at least",
                field=self.name,
            )
        whole = np.isfinite(rows).all() and all(map(math.isfinite, (*self.home, self.speed)))
        if not whole or np.abs(rows[0]).max() > 90 or np.abs(rows[1]).max() > 180:
            raise WildlabError(
                "a way point is at no place on the Earth", "give finite numbers, degrees", field=self.name
            )


_ROWS = ("latitude", "longitude", "above_home", "above_ground")


class Item(NamedTuple):
    """An item of a mission: MAV_CMD, MAV_FRAME, seven parameters; NaN where the autopilot shall choose."""

    command: int
    frame: int
    parameters: tuple[float, float, float, float, float, float, float]


def mission_items(mission: Mission) -> list[Item]:
    """Take-off, speed, way points, way home, in the order in which an autopilot goes through them.

    Parameters
    ----------
    mission
        The flight.

    Returns
    -------
    list of Item
        Without the home position, which formats treat each in their own way.

    Raises
    ------
    WildlabError
        Where there are more than an autopilot takes.
    """
    frame = FRAMES[mission.heights]
    heights = mission.above_home if mission.heights == "take-off" else mission.above_ground
    pitch = 15.0 if mission.vehicle == "fixed-wing" else 0.0
    # A multicopter climbs straight up before it goes anywhere, so its take-off is as high as the first point.
    up = float(mission.above_home[0])
    lat, lon, _ = mission.home
    items = [
        Item(TAKE_OFF, ABOVE_TAKE_OFF, (pitch, 0.0, 0.0, math.nan, lat, lon, max(up, 1.0))),
        Item(CHANGE_SPEED, NO_FRAME, (float(mission.vehicle != "fixed-wing"), mission.speed, -1, 0, 0, 0, 0)),
    ]
    if mission.photo_distance > 0:
        items.append(Item(TRIGGER_DISTANCE, NO_FRAME, (mission.photo_distance, 0, 1, 0, 0, 0, 0)))
    points = zip(mission.latitude, mission.longitude, heights, strict=True)
    items += [Item(WAYPOINT, frame, (0, 0, 0, math.nan, float(a), float(b), float(h))) for a, b, h in points]
    if mission.photo_distance > 0:
        items.append(Item(TRIGGER_DISTANCE, NO_FRAME, (0.0, 0, 0, 0, 0, 0, 0)))
    items.append(Item(RETURN, NO_FRAME, (0.0, 0, 0, 0, 0, 0, 0)))
    if len(items) > MOST_ITEMS:
        raise WildlabError(
            f"{mission.name} has {len(items)} items, and autopilots take about {MOST_ITEMS}",
            "plan with a larger height or row distance, a shorter battery, or fewer areas at a time",
            field="way points",
        )
    return items
