"""What a flight is planned for: the aircraft, the camera, the rules, the areas; and which numbers are no such
thing.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import cv2
import numpy as np
from scipy.spatial import cKDTree

from wildlab.errors import WildlabError
from wildlab.flight.manifest import TerrainSays
from wildlab.flight.readers.vector import Area, crossing, ring_area
from wildlab.flight.writers import Heights, Vehicle
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array, Mask
from wildlab.geometry.georeference import intersect_plane, pixel_rays
from wildlab.paths import DATA
from wildlab.planning.courses import fly
from wildlab.planning.gimbal import GimbalAngles, camera_attitudes
from wildlab.planning.patterns import contains, edge_directions, grid_points, lawn_mower

#: Points to a side on which overlapping areas are counted.
ACROSS = 200


def simplified(ring: Array, tolerance: float) -> Array:
    """A ring with fewer corners, none of which lies further from it than a tolerance (Douglas and Peucker).

    Parameters
    ----------
    ring
        (K, 2) metres, not closed, that does not cross itself.
    tolerance
        Metres; corners that lie nearer to the simpler ring are left out.

    Returns
    -------
    (L, 2) metres, some of the corners in their order. The ring itself where the simpler one would cross
    itself or bound next to nothing.

    Examples
    --------
    >>> ring = np.array([[0.0, 0.0], [0.0, 50.0], [0.2, 100.0], [100.0, 100.0], [100.0, 0.0]])
    >>> print(len(simplified(ring, 1.0)))
    4
    """
    if len(ring) <= 4:
        return ring
    kept = cv2.approxPolyDP(ring.astype(np.float32), tolerance, closed=True)[:, 0]
    simpler = ring[np.unique(cKDTree(ring).query(kept)[1])]
    if len(simpler) < 3 or ring_area(simpler) < ring_area(ring) / 2 or crossing(simpler) is not None:
        return ring
    return simpler


def sizes_alone(areas: Sequence[Area]) -> dict[str, float]:
    """How much of each area lies in no area before it: together, what all of them cover.

    Parameters
    ----------
    areas
        Outlines and holes in n.

    Returns
    -------
    dict
        Square metres, by name. Where areas overlap, counted on `ACROSS` points to a side.
    """
    found = {}
    for k, area in enumerate(areas):
        low, high = area.outline.min(axis=0), area.outline.max(axis=0)
        near = [
            one
            for one in areas[:k]
            if (one.outline.min(axis=0) < high).all() and (one.outline.max(axis=0) > low).all()
        ]
        share = 0.0
        if near:
            side = [low[axis] + (high - low)[axis] * (np.arange(ACROSS) + 0.5) / ACROSS for axis in (0, 1)]
            points = grid_points(*side)
            points = points[_within(area, points)]
            before = np.zeros(len(points), bool)
            for one in near:
                before |= _within(one, points)
            share = float(before.mean()) if len(points) else 0.0
        found[area.name] = area.size * (1 - share)
    return found


def _within(area: Area, points: Array) -> Mask:
    """Which points (N, 2) lie in an area, and not in its holes."""
    inside = contains(area.outline, points)
    for hole in area.holes:
        inside &= ~contains(hole, points)
    return inside


#: Rows and columns of the image that are looked at; angles of a swing.
SAMPLES = 65
#: Ground that is further away than this many heights is not counted as seen: animals in it are small, and
#: whatever stands hides them (F 8.2).
FURTHEST = 4.0
#: Where the camera starts: one height above the ground.
_LENS = np.array([0.0, 0.0, -1.0])


class GroundView(NamedTuple):
    """What is seen from a height, all in heights: multiply by the height for metres.

    Attributes
    ----------
    width
        Of the strip that is seen across the way, with all swings.
    ahead
        (2,) nearest and furthest ground that one image shows, ahead of the aircraft.
    slant
        From the lens to the ground in the middle of one image.
    middle
        That ground, ahead of the aircraft.
    """

    width: float
    ahead: tuple[float, float]
    slant: float
    middle: float

    @property
    def length(self) -> float:
        """Of the ground in one image, along the way."""
        return self.ahead[1] - self.ahead[0]

    def pixels(self, camera: Camera, length: float, height: float) -> float:
        """Across how many pixels something of a length (m) is seen from a height (m)."""
        return math.sqrt(camera.fx * camera.fy) * length / (self.slant * height)


def look(camera: Camera, tilt_deg: float, gimbal: str = "fixed", swing_deg: float = 0.0) -> GroundView:
    """What a camera sees of flat ground.

    Parameters
    ----------
    camera
        Its intrinsic parameters.
    tilt_deg
        Below the horizon; 90 is straight down.
    gimbal, swing_deg
        As for `wildlab.analysis.plan_request.PlanRequest`.

    Returns
    -------
    View
        Without a swing the width is that of the middle one of the image's rows that see ground no further
        away than `FURTHEST` heights, for a camera that looks down of the narrowest one. A swing adds what
        that row sees at its ends.

    Raises
    ------
    WildlabError
        Where no row sees such ground, or it does not at the end of a swing.
    """
    across, down = np.linspace(0, camera.width - 1, SAMPLES), np.linspace(0, camera.height - 1, SAMPLES)
    uv = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = pixel_rays(camera, uv, _attitude(tilt_deg))
    points = intersect_plane(rays, _LENS, 0.0).reshape(SAMPLES, SAMPLES, 3)
    slant: Array = np.linalg.norm(points - _LENS, axis=-1)
    with np.errstate(invalid="ignore"):
        seen = (slant <= FURTHEST).all(axis=1)
    if not seen.any():
        edge = math.degrees(math.asin(float(np.nanmax(rays[:, 2] / np.linalg.norm(rays, axis=1)))))
        where = f"{abs(edge):.0f} degrees {'above' if edge < 0 else 'below'} the horizon"
        raise WildlabError(
            f"a camera tilted by {tilt_deg:g} degrees looks {where} at the lowest",
            f"tilt it further down, to see ground within {FURTHEST:g} heights",
            field="--tilt",
        )
    rows = np.flatnonzero(seen)
    middle = int(rows[len(rows) // 2])
    if gimbal != "fixed":
        width = _swept(camera, tilt_deg, gimbal, swing_deg, float(down[middle]))
    elif tilt_deg > 80:
        # With a bent lens an edge is a curve: what lies between its innermost points is surely seen.
        width = float(points[rows, -1, 1].min() - points[rows, 0, 1].max())
    else:
        width = float(np.ptp(points[middle, :, 1]))
    ahead = points[rows, :, 0]
    centre = points[middle, SAMPLES // 2]
    return GroundView(
        width,
        (float(ahead.min()), float(ahead.max())),
        float(slant[middle, SAMPLES // 2]),
        float(centre[0]),
    )


def _attitude(tilt_deg: float, roll: Array | float = 0.0, yaw: Array | float = 0.0) -> Array:
    """``R_nc`` of a camera on an aircraft that flies level to the north; (3, 3) or (N, 3, 3)."""
    turned = np.broadcast_arrays(np.atleast_1d(roll), np.atleast_1d(yaw), -math.radians(tilt_deg))
    angles = GimbalAngles(np.zeros(len(turned[0])), turned[0], turned[2], turned[1])
    found = camera_attitudes(np.zeros(len(turned[0])), angles)
    return found[0] if np.ndim(roll) == np.ndim(yaw) == 0 else found


def _swept(camera: Camera, tilt_deg: float, gimbal: str, swing_deg: float, row: float) -> float:
    """How wide the strip is that a row of the image sees in a whole swing, in heights."""
    angles = np.radians(np.linspace(-swing_deg, swing_deg, SAMPLES))
    R = _attitude(tilt_deg, yaw=angles) if gimbal == "yaw" else _attitude(tilt_deg, roll=angles)
    sides = []
    for column in (0.0, (camera.width - 1) / 2, camera.width - 1.0):
        uv = np.tile([column, row], (SAMPLES, 1))
        points = intersect_plane(pixel_rays(camera, uv, R), _LENS, 0.0)
        far = np.linalg.norm(points - _LENS, axis=1)
        if not (far <= FURTHEST).all():
            raise WildlabError(
                f"a swing of {swing_deg:g} degrees looks further than {FURTHEST:g} heights",
                "swing less, or tilt the camera further down",
                field="--swing",
            )
        sides.append(points[:, 1])
    return float(np.max(sides) - np.min(sides))


#: The least height that is chosen without being asked for, and above treetops, metres.
LEAST_HEIGHT, CLEARANCE = 10.0, 10.0
Gimbal = Literal["fixed", "yaw", "roll", "adaptive"]
#: Each with its option, and what lies outside of which is a slip of a unit or a key.
NUMBERS = tomllib.loads((DATA / "plan.toml").read_text("utf-8"))["number"]


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """What was asked for.

    Attributes
    ----------
    area
        GeoJSON or KML.
    camera
        Its intrinsic parameters.
    terrain
        Which elevation map, and what it does not say of itself; None plans over flat ground.
    trees_m
        Height of the tallest trees.
    height_m
        Of the lens above the ground; None takes it from ``animal_m`` and ``pixels``.
    animal_m, pixels
        Length of what is looked for, and across how many pixels it shall be seen.
    speed_m_s
        Over the ground, which is what the autopilot of a multicopter holds; through the air of a fixed wing.
    max_air_m_s
        What a multicopter can fly through the air; None where nobody said.
    overlap
        Share of a row's strip that the next row sees again.
    tilt_deg
        Of the camera below the horizon, ahead; 90 is straight down.
    gimbal, swing_deg, rate_deg_s
        ``"fixed"``, or how the camera swings to either side of its tilt (F 5.4), how far, and how fast; no
        rate takes the slowest one that leaves nothing out.
    exposure_ms
        For which an image is exposed; of a microbolometer, its thermal time constant.
    wind_m_s, wind_from_deg
        From where the wind blows, clockwise from north; None where there is no wind.
    turn_radius_m, turn_s
        An aircraft that cannot stop has a radius; one that can needs the time for each turn.
    climb_m_s
        Greatest speed of climbing or sinking.
    battery_min, reserve
        How long a battery lasts, and which share of it is left at landing. None where nobody said.
    max_height_m
        Above the ground, by the rules.
    direction_deg
        Of the rows, clockwise from north; None takes the quickest.
    home
        Latitude and longitude of the take-off point, degrees; None takes the beginning of the first row.
    animals, density_km2
        How many live in each area, or on a square kilometre; None where nobody said.
    detection
        Share of animals in view that are found.
    heights
        Above what an autopilot keeps its height.
    photo_m
        Metres between photos; 0 leaves the camera alone.
    names
        Whether page and numbers may tell the names of areas and of the map, which may tell where it is.
    """

    area: Path
    camera: Camera
    terrain: TerrainSays | None = None
    trees_m: float = 0.0
    height_m: float | None = None
    animal_m: float = 1.5
    pixels: float = 10.0
    speed_m_s: float = 10.0
    max_air_m_s: float | None = None
    overlap: float = 0.2
    tilt_deg: float = 90.0
    gimbal: Gimbal = "fixed"
    swing_deg: float = 0.0
    rate_deg_s: float | None = None
    exposure_ms: float = 10.0
    wind_m_s: float = 0.0
    wind_from_deg: float | None = None
    turn_radius_m: float = 0.0
    turn_s: float = 3.0
    climb_m_s: float = 3.0
    battery_min: float | None = None
    reserve: float = 0.2
    max_height_m: float = 120.0
    direction_deg: float | None = None
    home: tuple[float, float] | None = None
    animals: float | None = None
    density_km2: float | None = None
    detection: float = 1.0
    heights: Heights = "take-off"
    photo_m: float = 0.0
    names: bool = False

    def __post_init__(self) -> None:
        for one in NUMBERS:
            value, low, high = getattr(self, one["field"]), one["least"], one["most"]
            if value is not None and not low <= value <= high:
                span = f"from {low:g} to {high:g} {one['unit']}".rstrip()
                raise WildlabError(f"a value of {value:g}", f"give a number {span}", field=one["option"])
        if (self.gimbal == "fixed") is not (self.swing_deg == 0):
            raise WildlabError(
                f"a gimbal that is {self.gimbal} with a swing of {self.swing_deg:g} degrees",
                "give --gimbal and --swing together, or neither",
                field="--swing",
            )
        if self.wind_m_s > 0 and self.wind_from_deg is None:
            raise WildlabError(
                f"a wind of {self.wind_m_s:g} m/s from nowhere",
                "say --wind-from, degrees clockwise from north",
                field="--wind",
            )
        if self.vehicle == "multicopter" and self.air_m_s > (self.max_air_m_s or math.inf):
            raise WildlabError(
                f"{self.speed_m_s:g} m/s against this wind are {self.air_m_s:g} m/s through the air, more "
                f"than {self.max_air_m_s:g}",
                "plan a lower --speed, or wait for less wind",
                field="--max-airspeed",
            )
        if self.vehicle == "fixed-wing" and self.wind_m_s >= self.speed_m_s:
            raise WildlabError(
                f"in a wind of {self.wind_m_s:g} m/s it would not come home at {self.speed_m_s:g} m/s",
                "wait for less wind, or give a higher --speed",
                field="--wind",
            )
        if self.animals is not None and self.density_km2 is not None:
            raise WildlabError(
                "how many animals there are is said twice", "give --animals or --density", field="--animals"
            )
        if self.home is not None and not (abs(self.home[0]) <= 90 and abs(self.home[1]) <= 180):
            raise WildlabError(
                "the take-off point is at no place on the Earth",
                "give latitude and longitude in degrees, as 58.66,16.46",
                field="--home",
            )

    @property
    def wind(self) -> Array:
        """(2,) where the air goes to, north and east, m/s."""
        towards = math.radians((self.wind_from_deg or 0.0) + 180.0)
        return self.wind_m_s * np.array([math.cos(towards), math.sin(towards)])

    @property
    def drift(self) -> Array:
        """(2,) what the wind adds to the way over ground, m/s: a multicopter's autopilot leaves nothing."""
        return self.wind if self.vehicle == "fixed-wing" else np.zeros(2)

    @property
    def fastest_m_s(self) -> float:
        """Over the ground at most."""
        return self.speed_m_s + (self.wind_m_s if self.vehicle == "fixed-wing" else 0.0)

    @property
    def slowest_m_s(self) -> float:
        """Over the ground at least."""
        return self.speed_m_s - (self.wind_m_s if self.vehicle == "fixed-wing" else 0.0)

    @property
    def air_m_s(self) -> float:
        """Through the air at most."""
        return self.speed_m_s + (self.wind_m_s if self.vehicle == "multicopter" else 0.0)

    @property
    def vehicle(self) -> Vehicle:
        """What has a turn radius cannot stop."""
        return "fixed-wing" if self.turn_radius_m > 0 else "multicopter"

    @property
    def least_m(self) -> float:
        """Metres above the ground below which nothing is planned unasked."""
        return max(self.trees_m + CLEARANCE if self.trees_m > 0 else 0.0, LEAST_HEIGHT)

    @property
    def usable_s(self) -> float:
        """Seconds that one flight may take; infinite where nobody said how long a battery lasts."""
        return math.inf if self.battery_min is None else 60.0 * self.battery_min * (1.0 - self.reserve)


#: Directions that are flown through for each area, at most.
MOST_TRIED = 12


def directions(outlines: Sequence[Array], distance: float, wanted: PlanRequest) -> list[float] | None:
    """Of the rows over each area.

    Parameters
    ----------
    outlines
        (K, 2) each, metres.
    distance
        Between rows, metres.
    wanted
        A direction, or the aircraft and the wind.

    Returns
    -------
    list of float or None
        Radians from north to the east, as stated or the quickest of those along the edges of each outline,
        without the ways there and back. None where the shortest rows are the quickest: a multicopter stops
        to turn, and its autopilot holds its speed over the ground.
    """
    if wanted.direction_deg is not None:
        return [math.radians(wanted.direction_deg)] * len(outlines)
    if wanted.vehicle == "multicopter":
        return None
    turn = math.pi * wanted.turn_radius_m

    def seconds(outline: Array, angle: float) -> float:
        rows = lawn_mower(outline, distance, direction=angle, turn=turn)
        course = fly(
            rows,
            wanted.speed_m_s,
            turn_radius=wanted.turn_radius_m,
            wind=wanted.drift,
            spacing=wanted.turn_radius_m / 10,
        )
        return course.duration

    def quickest(outline: Array) -> float:
        tried = [float(one) for one in edge_directions(outline, MOST_TRIED)]
        return min(tried, key=lambda angle: seconds(outline, angle))

    return [quickest(outline) for outline in outlines]
