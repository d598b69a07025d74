"""What a pilot takes along: way points in the formats of ground stations and maps.

A writer takes arrays and gives text; where it is written, and that positions are secrets, is the business of
whoever calls it. Commands, frames and parameters are those of MAVLink's common set
(https://mavlink.io/en/messages/common.html), QGroundControl's plan is that of
https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html, the plain text that of
https://mavlink.io/en/file_formats/#mission_plain_text_file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple
from xml.sax.saxutils import escape

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
                "give one value each, and one at least",
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
            "plan higher, wider rows, or fewer areas",
            field="way points",
        )
    return items


# -- QGroundControl's plan

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
        As `mission_items`.
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
            "items": _plan_items(mission),
        },
    }


def _plan_items(mission: Mission) -> list[dict[str, Any]]:
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


# -- plain text, ``QGC WPL 110``


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
        As `mission_items`.

    Examples
    --------
    >>> import numpy as np
    >>> one = np.array([1.0])
    >>> mission = Mission("sortie 1", one, one, 50 * one, 50 * one, (1.0, 1.0, 0.0), 10.0)
    >>> print(waypoints_text(mission).splitlines()[0])
    QGC WPL 110
    """
    lat, lon, height = mission.home
    lines = ["QGC WPL 110", _waypoint_line(0, GLOBAL, WAYPOINT, (0, 0, 0, 0, lat, lon, height), current=True)]
    for number, item in enumerate(mission_items(mission), start=1):
        lines.append(_waypoint_line(number, item.frame, item.command, item.parameters))
    return "\n".join(lines) + "\n"


def _waypoint_line(
    number: int, frame: int, command: int, parameters: tuple[float, ...], *, current: bool = False
) -> str:
    # The format has no word for what the autopilot shall choose; zero is what ground stations write there.
    *first, lat, lon, height = (0.0 if math.isnan(one) else one for one in parameters)
    words = [str(number), str(int(current)), str(frame), str(command)]
    words += [f"{one:.8f}" for one in first]
    words += [f"{lat:.8f}", f"{lon:.8f}", f"{height:.6f}", "1"]
    return "\t".join(words)


# -- maps: GeoJSON (RFC 7946) and KML 2.2

#: A name and its rings of (latitude, longitude), degrees, the outer one first; not closed.
Outlined = tuple[str, Sequence[Array]]


def plan_geojson(areas: Sequence[Outlined], missions: Sequence[Mission]) -> dict[str, Any]:
    """A plan as a FeatureCollection.

    Parameters
    ----------
    areas
        That are searched.
    missions
        Of the plan.

    Returns
    -------
    dict
        For JSON. Polygons have the property ``kind`` "area", lines "way", points "way point" with their
        heights in metres: the third coordinate of GeoJSON is above the ellipsoid, which a flight is not
        planned by, so there is none.
    """
    features = [
        _feature(
            {"kind": "area", "name": name},
            "Polygon",
            [_positions(_closed(_right_hand(ring, outer=k == 0))) for k, ring in enumerate(rings)],
        )
        for name, rings in areas
    ]
    for one in missions:
        way = np.stack([one.latitude, one.longitude], axis=1)
        home = np.array([one.home[:2]])
        about = {"kind": "way", "name": one.name, "speed_m_s": one.speed}
        features.append(_feature(about, "LineString", _positions(np.concatenate([home, way, home]))))
        for number, point in enumerate(_positions(way), start=1):
            about = {
                "kind": "way point",
                "name": f"{one.name}, {number}",
                "number": number,
                "height_above_take_off_m": round(float(one.above_home[number - 1]), 3),
                "height_above_ground_m": round(float(one.above_ground[number - 1]), 3),
            }
            features.append(_feature(about, "Point", point))
    return {"type": "FeatureCollection", "features": features}


def plan_kml(name: str, areas: Sequence[Outlined], missions: Sequence[Mission]) -> str:
    """A plan as KML.

    Parameters
    ----------
    name
        Of the document.
    areas, missions
        As for `plan_geojson`.

    Returns
    -------
    str
        Ways are above the ground of whoever shows them (``relativeToGround``): KML knows no height above a
        take-off point.
    """
    parts = []
    for title, rings in areas:
        borders = []
        for k, ring in enumerate(rings):
            tag = "outerBoundaryIs" if k == 0 else "innerBoundaryIs"
            corners = _coordinates(_closed(ring))
            borders.append(f"<{tag}><LinearRing><coordinates>{corners}</coordinates></LinearRing></{tag}>")
        polygon = f"<Polygon>{''.join(borders)}</Polygon>"
        parts.append(f"<Placemark><name>{escape(title)}</name>{polygon}</Placemark>")
    for one in missions:
        way = np.stack([one.latitude, one.longitude], axis=1)
        line = (
            "<LineString><altitudeMode>relativeToGround</altitudeMode>"
            f"<coordinates>{_coordinates(way, one.above_ground)}</coordinates></LineString>"
        )
        parts.append(f"<Placemark><name>{escape(one.name)}</name>{line}</Placemark>")
    body = "\n".join(parts)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"<name>{escape(name)}</name>\n{body}\n</Document></kml>\n"
    )


def _feature(about: dict[str, Any], kind: str, coordinates: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": about,
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def _positions(points: Array) -> list[list[float]]:
    return [[round(float(lon), 8), round(float(lat), 8)] for lat, lon in points]


def _coordinates(points: Array, heights: Array | None = None) -> str:
    above = [""] * len(points) if heights is None else [f",{one:.3f}" for one in heights]
    return " ".join(f"{lon:.8f},{lat:.8f}{height}" for (lat, lon), height in zip(points, above, strict=True))


def _closed(ring: Array) -> Array:
    return np.concatenate([ring, ring[:1]])


def _right_hand(ring: Array, *, outer: bool) -> Array:
    """Counter-clockwise outer rings and clockwise holes, as RFC 7946 wants them."""
    following = np.roll(ring, -1, axis=0)
    clockwise = (ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]).sum() > 0
    return ring[::-1] if clockwise == outer else ring
