"""A plan: rows over areas as flights, how long they take, what they cost, and what forbids them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.area import Area, Areas, read_areas
from wildlab.geometry.frames import Array, geodetic_to_ned, ned_to_geodetic
from wildlab.geometry.terrain import Terrain
from wildlab.pipeline.plan_sorties import Sortie, split_rows
from wildlab.pipeline.plan_view import View, look
from wildlab.pipeline.plan_wanted import Wanted
from wildlab.planning.patterns import Pattern, lawn_mowers, row_distance

#: A height that is not stated stays this far below the greatest one allowed, metres: way points between
#: which the ground falls away are higher above it.
BELOW_RULE = 5.0
#: The least height that is chosen without being asked for, metres.
LEAST_HEIGHT = 10.0
#: Metres from the take-off point to the areas' middle beyond which it is a slip of a key.
FURTHEST_HOME = 50_000.0


@dataclass(frozen=True, eq=False)
class Plan:
    """What came out.

    Attributes
    ----------
    wanted
        What was asked for.
    areas
        With the origin of n.
    terrain
        Under them; None is flat ground.
    view
        What the camera sees of flat ground.
    height
        Of the lens above the ground, metres.
    strip
        How wide a row's strip is, metres.
    pattern
        All rows.
    home
        (2,) the take-off point in n, metres.
    sorties
        The flights.
    """

    wanted: Wanted
    areas: Areas
    terrain: Terrain | None
    view: View
    height: float
    strip: float
    pattern: Pattern
    home: Array
    sorties: tuple[Sortie, ...]

    @property
    def duration(self) -> float:
        """Of all flights, seconds, without changes of batteries."""
        return sum(one.duration for one in self.sorties)

    def area_seconds(self) -> Array:
        """Seconds on the rows of each area and in the turns between them, (A,)."""
        seconds = np.zeros(len(self.areas.areas))
        for one in self.sorties:
            steps = np.diff(one.course.times)
            on = np.flatnonzero(one.row_of[:-1] >= 0)
            if not len(on):
                continue
            # Between its first and its last piece on rows of an area, a flight is there for that area.
            of = self.pattern.area[one.row_of[on]]
            for area in np.unique(of):
                mine = on[of == area]
                seconds[area] += steps[mine[0] : mine[-1] + 1].sum()
        return seconds


def make_plan(wanted: Wanted, read_terrain: Callable[[Areas], Terrain] | None = None) -> Plan:
    """Plan a flight.

    Parameters
    ----------
    wanted
        What is asked for.
    read_terrain
        Gives the terrain under areas, where ``wanted`` names a map.

    Returns
    -------
    Plan

    Raises
    ------
    WildlabError
        Where nothing can be flown as it is wanted; the message says what and why.
    """
    areas = read_areas(wanted.area)
    view = look(wanted.camera, wanted.tilt_deg)
    height = _height(wanted, view)
    strip = view.width * height
    distance = row_distance(strip, wanted.overlap)
    terrain = None if read_terrain is None else read_terrain(areas)
    home = None if wanted.home is None else _home(wanted.home, areas)
    direction = None if wanted.direction_deg is None else math.radians(wanted.direction_deg)
    pattern = lawn_mowers(
        [area.outline for area in areas.areas],
        distance,
        directions=None if direction is None else [direction] * len(areas.areas),
        turn=_turn_length(wanted),
        start=home,
        back=home is not None,
    )
    if home is None:
        home = pattern.rows[0, 0]
    sorties = split_rows(pattern, home, wanted, terrain, height)
    return Plan(wanted, areas, terrain, view, height, strip, pattern, home, sorties)


def _height(wanted: Wanted, view: View) -> float:
    """The height that was asked for, or the one from which the animal has the pixels it shall have."""
    most = wanted.max_height_m
    if wanted.height_m is not None:
        if wanted.height_m > most:
            raise WildlabError(
                f"a height of {wanted.height_m:g} m, and the rules allow {most:g} m above the ground",
                "fly lower, or state with --max-height what you have permission for",
                field="--height",
            )
        return wanted.height_m
    sharp = wanted.animal_m / wanted.pixels * math.sqrt(wanted.camera.fx * wanted.camera.fy) / view.slant
    if sharp < LEAST_HEIGHT:
        raise WildlabError(
            f"{wanted.animal_m:g} m are {wanted.pixels:g} pixels in this camera from {sharp:.1f} m above the "
            f"ground only, and nothing below {LEAST_HEIGHT:g} m is planned unasked",
            "ask for fewer pixels with --pixels, or state --height",
            field="--pixels",
        )
    return float(math.floor(min(sharp, max(most - BELOW_RULE, min(most, LEAST_HEIGHT)))))


def _home(home: tuple[float, float], areas: Areas) -> Array:
    lat, lon = np.radians(home)
    here = np.asarray(geodetic_to_ned(lat, lon, 0.0, areas.origin)[:2])
    far = float(np.hypot(*here))
    if not far <= FURTHEST_HOME:
        swapped = geodetic_to_ned(lon, lat, 0.0, areas.origin)[:2] if abs(home[1]) <= 90 else here
        order = ": latitude and longitude are swapped" if np.hypot(*swapped) <= FURTHEST_HOME else ""
        raise WildlabError(
            f"the take-off point lies {far / 1000:,.0f} km from the areas{order}",
            "give latitude, then longitude, in degrees",
            field="--home",
        )
    return here


def _turn_length(wanted: Wanted) -> float:
    """What a turn costs, as metres of way: half a circle, or the time that one stands."""
    return math.pi * wanted.turn_radius_m if wanted.turn_radius_m > 0 else wanted.speed_m_s * wanted.turn_s


def on_earth(points: Array, height: Array, areas: Areas) -> tuple[Array, Array, Array]:
    """Places of n as latitude and longitude in degrees, and heights above the ellipsoid.

    Parameters
    ----------
    points
        (N, 2) north and east, metres.
    height
        (N,) above the plane down = 0 of n, metres.
    areas
        With the origin.

    Returns
    -------
    Latitude, longitude (degrees), height (metres): (N,) each.
    """
    p = np.column_stack([points, -np.asarray(height)])
    lat, lon, h = np.moveaxis(ned_to_geodetic(p, areas.origin), -1, 0)
    return np.degrees(lat), np.degrees(lon), h


def rings_on_earth(area: Area, areas: Areas) -> list[Array]:
    """Outline and holes of an area, (K, 2) latitude and longitude in degrees each."""
    return [
        np.stack(on_earth(ring, np.zeros(len(ring)), areas)[:2], axis=1)
        for ring in (area.outline, *area.holes)
    ]
