"""What a twin's camera looks for: one or two targets with a receiver, or animals in enclosures."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from wildlab.flight.files import Strict
from wildlab.simulation.parameter_quantities import (
    Angle,
    Count,
    Duration,
    Length,
    LengthSpread,
    Parameter,
    Pixels,
    Rate,
    Speed,
    Text,
    quantity,
    word,
)

Place = Annotated[Parameter, quantity("m", -1e4, 1e4)]
Height = Annotated[Parameter, quantity("m", -1e3, 1e4)]
Accuracy = Annotated[Parameter, quantity("m", high=100, above=0)]
Arm = Annotated[Parameter, quantity("m", -1e3, 1e3)]


class TargetMotion(Strict):
    """A steady course, where on it the target would have been at time 0, and how it deviates from it.

    With an ``early_speed`` it comes up along that course from behind: that fast at time 0, and slower by what
    is left of the difference after each ``slowing_time``, to 1/e.
    """

    north: Place
    east: Place
    speed: Speed
    course: Angle
    deviation_sd: LengthSpread
    deviation_shortest_period: Duration
    deviation_longest_period: Duration
    early_speed: Speed | None = None
    slowing_time: Duration | None = None

    @model_validator(mode="after")
    def _slowed(self) -> TargetMotion:
        if (self.early_speed is None) != (self.slowing_time is None):
            raise ValueError("early_speed and slowing_time belong together; give both or none")
        return self

    @model_validator(mode="after")
    def _band(self) -> TargetMotion:
        if self.deviation_shortest_period.number > self.deviation_longest_period.number:
            raise ValueError(
                "deviation_shortest_period is longer than deviation_longest_period; exchange the two"
            )
        return self


class TargetGps(Strict):
    """The single-frequency receiver that a target carries, whose log counts as the truth about it."""

    rate: Rate
    horizontal_correlated_sd: LengthSpread
    vertical_correlated_sd: LengthSpread
    correlation_time: Duration
    horizontal_noise: LengthSpread
    vertical_noise: LengthSpread
    resolution: LengthSpread
    ahead: Arm


class Outline(Strict):
    """A rectangle about the target, its bow along the course; an image may show a part of it only."""

    length: Length
    beam: Length


class Target(Strict):
    """Something that is seen: a point that never moves, or, with a motion and a GPS, a vessel.

    ``choice``: marked are the first images that show it, any of them, or those that show most of its outline.
    """

    identifier: Text
    height: Height
    sd: Accuracy
    marked_by: Text
    observations: Count
    choice: Annotated[Parameter, word("first", "missed at random", "largest")]
    border: Pixels
    outline: Outline | None = None
    motion: TargetMotion | None = None
    gps: TargetGps | None = None

    @model_validator(mode="after")
    def _logged(self) -> Target:
        if (self.motion is None) != (self.gps is None):
            raise ValueError(
                "a target that moves needs both motion and gps, one that never moves neither; "
                "add the one or take out the other"
            )
        if self.outline is not None and self.motion is None:
            raise ValueError("an outline needs a motion, whose course is where the bow points; add motion")
        if (self.choice.text == "largest") != (self.outline is not None):
            raise ValueError(
                'what has an outline is marked where most of it shows; write choice = "largest" with an '
                "outline, and only then"
            )
        return self


class MarkedPair(Strict):
    """Images in which both targets are marked."""

    both: Annotated[Parameter, quantity("1", 0, 1e6, whole=True)]


class Subset(Strict):
    """Detections in succession that a table of the source has apart."""

    first: Count
    observations: Count


class Segments(Strict):
    """Periods of a recording in which the target is in view, and of which only these images are kept."""

    count: Count
    images: Count


class Enclosure(Strict):
    """A fenced rectangle about its middle, its long sides along a course, and how many animals live in it."""

    north: Place
    east: Place
    length: Length
    width: Length
    course: Angle
    animals: Count

    @model_validator(mode="after")
    def _long(self) -> Enclosure:
        if self.length.number < self.width.number:
            raise ValueError("the width is more than the length; exchange them and turn the course by 90 deg")
        return self


class Animals(Strict):
    """How animals move, F (4.5) and (4.8), and how they are seen.

    Every ``step`` seconds each takes a new velocity at random, ``speed_sd`` per axis; fences turn it back.
    """

    step: Duration
    speed_sd: Speed
    height: Height
    sd: Accuracy
    rate: Rate
    marked_by: Text
    detected: Annotated[Parameter, quantity("1", high=1, above=0)]
    border: Pixels
