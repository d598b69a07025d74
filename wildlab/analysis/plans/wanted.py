"""What a flight is planned for: the aircraft, the camera, the rules; and which numbers are no such thing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.terrain_model import TerrainSays
from wildlab.flight.writers.mission import Heights, Vehicle
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array

#: The least height that is chosen without being asked for, and above treetops, metres.
LEAST_HEIGHT, CLEARANCE = 10.0, 10.0
Gimbal = Literal["fixed", "yaw", "roll", "adaptive"]
#: By field: the option, least and greatest value, unit. What lies outside is a slip of a unit or a key.
LIMITS: dict[str, tuple[str, float, float, str]] = {
    "height_m": ("--height", 2.0, 5000.0, "m"),
    "trees_m": ("--trees", 0.0, 120.0, "m"),
    "animal_m": ("--animal", 0.05, 30.0, "m"),
    "pixels": ("--pixels", 1.0, 500.0, "px"),
    "speed_m_s": ("--speed", 0.5, 80.0, "m/s"),
    "max_air_m_s": ("--max-airspeed", 0.5, 80.0, "m/s"),
    "overlap": ("--overlap", 0.0, 0.9, ""),
    "tilt_deg": ("--tilt", -30.0, 90.0, "deg"),
    "swing_deg": ("--swing", 0.0, 80.0, "deg"),
    "rate_deg_s": ("--rate", 0.1, 720.0, "deg/s"),
    "exposure_s": ("--exposure", 0.0, 1.0, "s"),
    "wind_m_s": ("--wind", 0.0, 60.0, "m/s"),
    "wind_from_deg": ("--wind-from", 0.0, 360.0, "deg"),
    "turn_radius_m": ("--turn-radius", 0.0, 2000.0, "m"),
    "turn_s": ("--turn-time", 0.0, 120.0, "s"),
    "climb_m_s": ("--climb", 0.1, 30.0, "m/s"),
    "battery_min": ("--battery", 0.5, 6000.0, "min"),
    "reserve": ("--reserve", 0.0, 0.9, ""),
    "max_height_m": ("--max-height", 2.0, 20_000.0, "m"),
    "direction_deg": ("--direction", 0.0, 360.0, "deg"),
    "animals": ("--animals", 0.0, 1e6, ""),
    "density_km2": ("--density", 0.0, 1e6, "animals/km2"),
    "detection": ("--detection", 0.0, 1.0, ""),
    "photo_m": ("--photo-every", 0.0, 10_000.0, "m"),
}


@dataclass(frozen=True, eq=False)
class Wanted:
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
    exposure_s
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
    exposure_s: float = 0.010
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
        for field, (option, low, high, unit) in LIMITS.items():
            value = getattr(self, field)
            if value is not None and not low <= value <= high:
                span = f"from {low:g} to {high:g} {unit}".rstrip()
                raise WildlabError(f"a value of {value:g}", f"give a number {span}", field=option)
        if (self.gimbal == "fixed") is not (self.swing_deg == 0):
            raise WildlabError(
                f"a gimbal that is {self.gimbal} with a swing of {self.swing_deg:g} degrees",
                "give --gimbal and --swing together, or neither",
                field="--swing",
            )
        if self.wind_m_s > 0 and self.wind_from_deg is None:
            raise WildlabError(
                f"a wind of {self.wind_m_s:g} m/s from nowhere",
                "say with --wind-from whence it blows, degrees clockwise from north",
                field="--wind",
            )
        if self.vehicle == "multicopter" and self.air_m_s > (self.max_air_m_s or math.inf):
            raise WildlabError(
                f"{self.speed_m_s:g} m/s over the ground against a wind of {self.wind_m_s:g} m/s are "
                f"{self.air_m_s:g} m/s through the air, and the aircraft can do {self.max_air_m_s:g}",
                "plan slower with --speed, or wait for less wind",
                field="--max-airspeed",
            )
        if self.vehicle == "fixed-wing" and self.wind_m_s >= self.speed_m_s:
            raise WildlabError(
                f"a wind of {self.wind_m_s:g} m/s against an airspeed of {self.speed_m_s:g} m/s: the "
                "aircraft would not come home",
                "wait for less wind, or fly faster with --speed",
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
        return np.asarray(self.wind_m_s * np.array([math.cos(towards), math.sin(towards)]))

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
