"""Parameters of where a twin flies, of its airframe, and of its course."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from wildlab.flight.files import Strict
from wildlab.simulation.parameter_quantities import (
    Angle,
    AngleSpread,
    Count,
    Duration,
    Length,
    LengthSpread,
    Parameter,
    Speed,
    Text,
    moment,
    quantity,
    word,
)

Arm = Annotated[Parameter, quantity("m", -1e3, 1e3)]


class Place(Strict):
    """Where and when the twin flies."""

    latitude: Annotated[Parameter, quantity("deg", -90, 90)]
    longitude: Annotated[Parameter, quantity("deg", -180, 180)]
    height: Annotated[Parameter, quantity("m", -1e3, 1e4)]
    gravity: Annotated[Parameter, quantity("m/s^2", 9, 10)]
    epoch: Annotated[Parameter, moment()]


class AirframeFlight(Strict):
    """The airframe, the wind, and how well course and attitude are held; the course itself stands apart.

    A fixed wing, unless ``kind`` says something else: it banks into turns. A multicopter leans towards where
    it accelerates, a gondola hangs level; ``airspeed`` is their speed along the course.
    """

    platform: Text
    duration: Duration
    altitude: Length
    airspeed: Annotated[Parameter, quantity("m/s", high=100, above=0)]
    wind_speed: Speed
    wind_from: Angle
    trim_pitch: Annotated[Parameter, quantity("deg", -30, 30)]
    track_sd: LengthSpread
    altitude_sd: LengthSpread
    path_shortest_period: Duration
    path_longest_period: Duration
    roll_sd: AngleSpread
    pitch_sd: AngleSpread
    yaw_sd: AngleSpread
    attitude_shortest_period: Duration
    attitude_longest_period: Duration
    kind: Annotated[Parameter, word("fixed wing", "multicopter", "gondola")] | None = None

    @model_validator(mode="after")
    def _flies(self) -> AirframeFlight:
        if self.wind_speed.number > 0.8 * self.airspeed.number:
            raise ValueError(
                "wind_speed is more than 0.8 of airspeed, too much to hold a course; "
                "lower wind_speed or raise airspeed"
            )
        for band in ("path", "attitude"):
            shortest, longest = f"{band}_shortest_period", f"{band}_longest_period"
            if getattr(self, shortest).number > getattr(self, longest).number:
                raise ValueError(f"{shortest} is longer than {longest}; exchange the two")
        return self


class Loiter(Strict):
    """A circle beside the target, flown from wherever on it the log happens to begin."""

    radius: Length
    turn: Annotated[Parameter, word("clockwise", "counter-clockwise")]
    course_at_target: Angle


class Route(Strict):
    """A closed course over the target (see `wildlab.simulation.waypoint_courses`), moved along with it."""

    shape: Annotated[Parameter, word("eight", "racetrack")]
    length: Length
    width: Length
    turn_radius: Length
    course: Angle
    ahead: Arm
    right: Arm
    drift_speed: Speed
    drift_course: Angle
    start: Annotated[Parameter, quantity("1", -1, 1)]
    roll_time: Annotated[Parameter, quantity("s", high=20, above=0.2)]


class Survey(Strict):
    """Rows back and forth over one enclosure after the other, and round again (F 5.2)."""

    row_distance: Length
    turn_time: Annotated[Parameter, quantity("s", high=60, above=0.2)]


class Cable(Strict):
    """What a gondola hangs from: its height over the ground, up and down once in each span of a lap."""

    lowest: Length
    highest: Length
    spans: Count

    @model_validator(mode="after")
    def _ordered(self) -> Cable:
        if self.lowest.number > self.highest.number:
            raise ValueError("lowest is above highest; exchange the two")
        return self


class Land(Strict):
    """Ground that is not level (see `wildlab.simulation.landscape`), and how courses follow it.

    ``follow`` is the length of way over which an autopilot, or a cable's pylons, average the ground's height;
    altitudes are above that.
    """

    seed: Count
    north: Length
    east: Length
    step: Length
    relief: Length
    follow: Length


class Climb(Strict):
    """One change of altitude during the flight."""

    altitude: Length
    start: Annotated[Parameter, quantity("s", 0, 7200)]
    duration: Duration
