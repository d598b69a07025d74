"""What a tracking filter is told of sensors and targets: ``[sensors.NAME]`` and ``[targets]`` of a flight, or
a file of its own.

Nothing of it has to be stated: `wildlab.analysis.tracks.noise_model` says what is assumed in its place.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from wildlab.flight.files import Strict, check_model, did_you_mean, parse_toml, read_toml

#: Errors that a filter may consider, with the unit of their standard deviation. Position of the platform (and
#: of the part of a target that is seen), the tilt (about each level axis) and the heading of its attitude,
#: the clock of the sensor, and a range that is too long.
CONSIDERED: dict[str, str] = {
    "platform_north": "m", "platform_east": "m", "platform_down": "m",
    "tilt": "deg", "heading": "deg", "clock": "s", "range_bias": "m",
}  # fmt: skip

#: A kind of target of which many are followed at once has at most so many fellows.
MOST_HULLS = 5

Above = Annotated[float, Field(gt=0, le=1e6)]
NotNegative = Annotated[float, Field(ge=0, le=1e6)]
Share = Annotated[float, Field(ge=0, lt=1)]
Probability = Annotated[float, Field(gt=0, lt=1)]
Lengths = tuple[Annotated[float, Field(ge=0, le=1000)], ...]


class HullPart(Strict):
    """A kind of target by its size: how long and broad it is, and how many targets are so,
    beside the shares of the other kinds."""

    name: Annotated[str, Field(min_length=1, max_length=40)]
    length_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    beam_m: Annotated[float, Field(ge=0, le=1000)] = 0.0
    share: Above = 1.0

    @model_validator(mode="after")
    def _longer_than_broad(self) -> HullPart:
        if self.beam_m > self.length_m:
            raise ValueError(f"beam_m = {self.beam_m:g} is above length_m = {self.length_m:g}")
        return self


class ManyTargetsPart(Strict):
    """What a tracker of many targets is told, see `wildlab.tracking.many.target_model.ManyTargetModel`."""

    hulls: Annotated[tuple[HullPart, ...], Field(max_length=MOST_HULLS)] = ()
    lifetime_s: Above | None = None
    birth: Probability | None = None
    visible_s: Above | None = None
    hidden_s: Above | None = None
    gate: Above | None = None
    confirmed: Probability | None = None
    hits: Annotated[int, Field(ge=1, le=1000)] | None = None
    shown: Share | None = None
    forgotten: Probability | None = None
    lost_m: Above | None = None
    fastest_m_s: Above | None = None
    moves_m: Annotated[float, Field(ge=0, le=1e6)] | None = None
    over_s: Above | None = None
    apart_m: Above | None = None
    others: bool = False


class ManySensorPart(Strict):
    """What it is told of a sensor, see `wildlab.tracking.many.target_model.ManySensorModel`; those of hulls
    have one number for each kind."""

    detection: Probability | None = None
    clutter_per_m2: Above | None = None
    clutter_per_rad: Above | None = None
    near_m: Annotated[float, Field(ge=0, le=1e6)] | None = None
    far_m: Above | None = None
    patience_s: Above | None = None
    several: bool | None = None
    rough_m: Lengths = ()
    along_m: Lengths = ()
    near_side_m: Lengths = ()
    near_end_m: Lengths = ()

    @model_validator(mode="after")
    def _near_before_far(self) -> ManySensorPart:
        if self.near_m is not None and self.far_m is not None and self.near_m >= self.far_m:
            raise ValueError(f"near_m = {self.near_m:g} is not below far_m = {self.far_m:g}")
        return self


class ConsideredPart(Strict):
    """One error that lasts: its standard deviation, and for how long it is the same.

    Without ``correlation_time_s`` it is constant. ``shared``: sensors that also consider it have one and the
    same error, as those on one platform have its position and heading.
    """

    sd_m: Above | None = None
    sd_deg: Above | None = None
    sd_s: Above | None = None
    correlation_time_s: Above | None = None
    shared: bool = True

    @property
    def sd(self) -> float:
        """In the unit that is stated."""
        return next(float(one) for one in (self.sd_m, self.sd_deg, self.sd_s) if one is not None)


class NoisePart(Strict):
    """Standard deviations of what is new at every detection, per axis. Absent: not known."""

    position_m: Above | None = None
    range_m: Above | None = None
    azimuth_deg: Above | None = None
    elevation_deg: Above | None = None
    pixel_px: Above | None = None
    velocity_m_s: Above | None = None


class SensorPart(Strict):
    """One sensor.

    ``clock_offset_s`` is added to its stamps. ``correlation`` is the share of the variance of its errors that
    lasts from one look to the next, fading over ``correlation_time_s``: what the filter for coloured noise
    and the tracker of many targets work with. ``thinning_s``: how far apart detections have to be whose
    errors are new. ``range_m`` and ``range_sd_m``: how far away targets are when a bearing is all that is
    known.
    """

    noise: NoisePart = NoisePart()
    rate_hz: Above | None = None
    clock_offset_s: float = 0.0
    correlation: Share | None = None
    correlation_time_s: Above | None = None
    thinning_s: Annotated[float, Field(ge=0, le=1e5)] | None = None
    range_m: Above | None = None
    range_sd_m: Above | None = None
    considered: dict[str, ConsideredPart] = Field(default_factory=dict)
    many: ManySensorPart = ManySensorPart()

    @model_validator(mode="after")
    def _known(self) -> SensorPart:
        for name, one in self.considered.items():
            if name not in CONSIDERED:
                raise ValueError(f"no error {name!r} can be considered; use one of {', '.join(CONSIDERED)}")
            stated = [unit for unit in ("m", "deg", "s") if getattr(one, f"sd_{unit}") is not None]
            if stated != [CONSIDERED[name]]:
                raise ValueError(
                    f"the error {name!r} has its standard deviation in {CONSIDERED[name]}; "
                    f"give sd_{CONSIDERED[name]} and no other"
                )
        return self


class TargetsPart(Strict):
    """The targets.

    ``acceleration_m_s_sqrt_s``: the standard deviation of each axis of the velocity that grows in a second.
    ``start_speed_m_s``: of each axis at the start; where both are zero targets are at rest.
    ``gate_probability``: that a target's own detection is let in. ``patience_s``: without one for longer, a
    track ends. ``reach_m`` and ``reach_deg``: what lies no farther from the true place of a target than this
    may be its detection, where none has a name. ``size_m``: a track that is nearer to its target than this is
    with it. ``identified``: detections belong to the target they name, to the one in whose gate they are
    nearest, or all to one.
    """

    acceleration_m_s_sqrt_s: NotNegative | None = None
    start_speed_m_s: NotNegative | None = None
    gate_probability: Annotated[float, Field(gt=0, lt=1)] | None = None
    patience_s: Above | None = None
    reach_m: Above | None = None
    reach_deg: Annotated[float, Field(gt=0, le=180)] | None = None
    size_m: Above | None = None
    identified: Literal["label", "gate", "one"] | None = None
    many: ManyTargetsPart | None = None

    @model_validator(mode="after")
    def _at_rest(self) -> TargetsPart:
        if self.start_speed_m_s == 0 and self.acceleration_m_s_sqrt_s != 0:
            raise ValueError("without a start_speed_m_s targets are at rest; set acceleration_m_s_sqrt_s = 0")
        return self


class Settings(Strict):
    """The whole of a ``settings.toml``, and the two parts of a ``flight.toml``."""

    sensors: dict[str, SensorPart] = Field(default_factory=dict)
    targets: TargetsPart = TargetsPart()


def read_settings(path: Path) -> Settings:
    """Read a ``settings.toml``.

    Raises
    ------
    WildlabError
        Where it is missing, not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(Settings, read_toml(path, "what a tracking filter is told"), path)


def parse_settings(text: str) -> Settings:
    """The same from a text; nothing is stated in an empty one.

    Raises
    ------
    WildlabError
        Where it is not TOML, or a key is unknown, missing or wrong.
    """
    return check_model(Settings, parse_toml(text, Path("settings.toml")), None)


def absent_sensors(settings: Settings, there: Collection[str]) -> dict[str, str]:
    """The sensors that are told of and that a flight does not have, each with a clause on what may be meant.

    Examples
    --------
    >>> absent_sensors(parse_settings("[sensors.radra]"), ["radar", "lidar"])
    {'radra': "did you mean 'radar'? Known are lidar, radar"}
    """
    return {name: did_you_mean(name, there) for name in settings.sensors if name not in there}


def settings_over(stated: Settings, own: Settings) -> Settings:
    """``stated`` where it says something, else what a flight says of ``own``; a sensor counts as a whole."""
    before, after = (one.targets.model_dump(exclude_none=True, exclude_unset=True) for one in (own, stated))
    targets = before | after
    if "many" in before and "many" in after:
        targets["many"] = before["many"] | after["many"]
    return Settings(sensors={**own.sensors, **stated.sensors}, targets=TargetsPart(**targets))
