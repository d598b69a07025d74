"""What a filter believes of a sensor and of targets: stated, tuned elsewhere, or assumed.

Stated is what ``flight.toml`` or a settings file says. What nobody says is assumed: the noise of pixels and
the errors of the platform from ``[uncertainty]``, other noise from how rough the detections are from one scan
to the next, targets from ``data/settings/usual.toml``.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from wildlab.analysis.georeference import assumed_deviations
from wildlab.analysis.tracks.scans import SLOTS, Scans, Truth
from wildlab.errors import WildlabError
from wildlab.flight.manifest import (
    CONSIDERED,
    SensorPart,
    Settings,
    TargetsPart,
    read_settings,
    settings_over,
)
from wildlab.flight.store import Flight
from wildlab.geometry.covariances import level_axes
from wildlab.geometry.frames import Array, wrap
from wildlab.paths import DATA
from wildlab.tracking.kalman import TOGETHER, Considered, consider_all
from wildlab.tracking.motion import Motion, white_acceleration
from wildlab.tracking.sensors import POSE

#: Of which noise each element of a measurement has its standard deviation, and in what the file has it.
NOISE_OF = {
    "north": "position_m", "east": "position_m", "range": "range_m", "azimuth": "azimuth_deg",
    "elevation": "elevation_deg", "u": "pixel_px", "v": "pixel_px", "v_north": "velocity_m_s",
    "v_east": "velocity_m_s",
}  # fmt: skip
#: Parts of [uncertainty] that say how wrong a platform may be, by the errors of `POSE`.
OF_PLATFORM = {
    "platform_north": "position_horizontal_m",
    "platform_east": "position_horizontal_m",
    "platform_down": "position_vertical_m",
    "roll": "tilt_deg",
    "pitch": "tilt_deg",
    "heading": "heading_deg",
}
#: H 7.2.2: measurements further apart than this (s) are taken for independent; but the next scan of a slow
#: sensor is no gap, so it is one and a half scans at least.
LONGEST_GAP_S, LONGEST_GAP_LOOKS = 1.0, 1.5

_GATE, _PATIENCE = "probability that its own detection is let in", "a track ends without a detection for"
_REACH, _REACH_OF_RAYS = "a detection of its own is within", "a ray to it is within"
#: What is not asked of targets that detections name.
OF_UNNAMED = (_GATE, _PATIENCE, _REACH, _REACH_OF_RAYS)
STATED, ASSUMED = "stated", "assumed"
#: Where a value is from that this flight's detections say: it is estimated where it is judged, and the page
#: says so; and of a noise that nobody states.
HERE = "estimated here"
ROUGH = f"{HERE}: how rough its detections are"


#: Errors that last are put down to these together, each group with one standard deviation.
GROUPS = (("platform_north", "platform_east"), ("clock",), ("heading",), ("range_bias",), ("roll", "pitch"))


class SensorTuning(NamedTuple):
    """One sensor, as a flight with truth shows it.

    Attributes
    ----------
    offset_s, offset_low_s, offset_high_s
        What to add to the stamps, with a 95 % interval for as many errors as the correlated ones are worth;
        low and high are NaN where the clock was not tuned and is as it was stated.
        A hull seen ahead of or behind its antenna is in it too: on a straight course nothing tells the two
        apart.
    sd
        Of the error of each element, m or rad, standing part included.
    share, correlation_time_s
        The autocorrelation of the errors: ``share * exp(-lag / correlation_time_s)`` beyond lag zero.
    position_sd_m, clock_sd_s, heading_sd_rad
        What the part of the variance that stays from scan to scan is put down to.
    range_m, range_sd_m
        How far away what the sensor saw was: all that is known of the distance at a first bearing.
    interval_s
        Usual time between scans.
    n
        Errors it is from.
    white_sds
        Of each element, what is new at every scan.
    own_sds
        Of each element, where they are of several units.
    range_bias_sd_m, tilt_sd_rad
        As ``heading_sd_rad``, for sensors that measure ranges, and for cameras (about each level axis).
    """

    sensor: str
    kind: str
    offset_s: float
    offset_low_s: float
    offset_high_s: float
    sd: float
    share: float
    correlation_time_s: float
    position_sd_m: float
    clock_sd_s: float
    heading_sd_rad: float
    range_m: float
    range_sd_m: float
    interval_s: float
    n: int
    white_sds: tuple[float, ...]
    own_sds: tuple[float, ...] = ()
    range_bias_sd_m: float = 0.0
    tilt_sd_rad: float = 0.0

    @property
    def clock_tuned(self) -> bool:
        """Whether the offset is an estimate."""
        return bool(np.isfinite(self.offset_low_s))

    @property
    def sds(self) -> Array:
        """(m,) standard deviation of the error of each element, standing part included."""
        return np.array(self.own_sds or (self.sd,) * (1 if self.kind == "bearing" else 2))

    @property
    def considered(self) -> dict[str, float]:
        """Standard deviations of errors that last, by name, m, s or rad; those that are zero too."""
        sds = (self.position_sd_m, self.clock_sd_s, self.heading_sd_rad, self.range_bias_sd_m,
               self.tilt_sd_rad)  # fmt: skip
        return {name: sd for group, sd in zip(GROUPS, sds, strict=True) for name in group}

    def of_each_target(self) -> SensorTuning:
        """With nothing that several targets have in common, but for errors of a camera's pose."""
        if self.kind == "pixel":
            return self
        return self._replace(
            white_sds=tuple(self.sds.tolist()), position_sd_m=0.0, clock_sd_s=0.0, heading_sd_rad=0.0,
            range_bias_sd_m=0.0, tilt_sd_rad=0.0,
        )  # fmt: skip

    @property
    def next_correlation(self) -> float:
        """Correlation of the errors of two successive scans."""
        return float(self.share * np.exp(-self.interval_s / self.correlation_time_s))

    @property
    def fading(self) -> float:
        """What is left of the correlated part from one scan to the next: ``F_c`` of H (7.5)."""
        return float(np.exp(-self.interval_s / self.correlation_time_s))

    @property
    def thinning_s(self) -> float:
        """Lag from which errors are correlated by less than 1/e; nought where they never are by more."""
        return float(max(0.0, self.correlation_time_s * (1 + np.log(max(self.share, 1e-9)))))


class ConsideredError(NamedTuple):
    """An error that lasts: its standard deviation (m, rad, s), for how long (s), whether sensors share it."""

    name: str
    sd: float
    correlation_time_s: float
    shared: bool


class NoiseModel(NamedTuple):
    """Of one sensor.

    Attributes
    ----------
    white
        (m,) standard deviations by which the filters without considered errors go.
    noise
        (m,) what is new at every scan, beside errors that are considered.
    considered
        Errors of the platform, the clock and the range; empty where poses have their covariance.
    lasting
        Share of the variance of the errors that successive scans have in common; None: what the considered
        errors make of it.
    fading
        What is left of the lasting part from one scan to the next.
    thinning_s
        How far apart detections are whose errors are new; NaN where that is not known.
    range_m, range_sd_m
        How far away targets are when a bearing is all that is known; NaN where that is not known.
    """

    sensor: str
    kind: str
    offset_s: float
    white: Array
    noise: Array
    considered: tuple[ConsideredError, ...]
    lasting: float | None
    fading: float
    thinning_s: float
    range_m: float
    range_sd_m: float
    interval_s: float

    @property
    def longest_gap_s(self) -> float:
        """Of a filter on differences."""
        return max(LONGEST_GAP_S, LONGEST_GAP_LOOKS * self.interval_s)


class TargetModel(NamedTuple):
    """Of the targets, see `wildlab.flight.manifest.TargetsPart`; some lengths may be NaN."""

    density: float
    start_speed_m_s: float
    gate_probability: float
    patience_s: float
    reach_m: float
    reach_rad: float
    size_m: float
    identified: str | None

    @property
    def at_rest(self) -> TargetModel:
        """The same of a target that never moves."""
        return self._replace(density=0.0, start_speed_m_s=0.0)

    def motion(self, share: float = 1.0) -> Motion:
        """Constant velocity with white acceleration, or a share of it; without any, and no speed, rest."""
        return partial(white_acceleration, density=share * self.density)

    def reach(self, kind: str) -> float:
        """How near to the true place of a target its detection lies, in m, or in rad of a ray."""
        return self.reach_rad if kind in ("bearing", "pixel") else self.reach_m


class GivenValue(NamedTuple):
    """A value that filters use, in words, and where it is from."""

    subject: str
    what: str
    value: str
    source: str


class GivenValues:
    """What a filter is given of one subject, value by value as it is chosen."""

    def __init__(self, subject: str) -> None:
        self.subject, self.values = subject, list[GivenValue]()

    def add(self, what: str, value: str, source: str) -> None:
        """Note a value in words."""
        self.values.append(GivenValue(self.subject, what, value, source))

    def number(
        self, what: str, unit: str, stated: float | None, other: float, source: str = ASSUMED
    ) -> float:
        """What is stated, else the other, which is from that source."""
        value = float(other if stated is None else stated)
        self.add(what, f"{value:.3g}{unit}", source if stated is None else STATED)
        return value


class SensorInputs(NamedTuple):
    """One sensor: its scans, the model of its errors, targets that it may see, and where values are from."""

    scans: Scans
    noise: NoiseModel
    truths: list[Truth]
    given: Sequence[GivenValue] = ()

    def split(self, target: str) -> tuple[Truth, list[Truth]]:
        """A target's truth, and those of the others."""
        mine = next(one for one in self.truths if one.target == target)
        return mine, [one for one in self.truths if one.target != target]


Against = Literal["truth", "innovations"]


class Tuned(NamedTuple):
    """What a flight says of its sensors.

    ``flight`` is its name, or those of several; ``against`` what detections were held against. ``density``
    (m/s per root second) of the targets, where it was found too.
    """

    flight: str
    against: Against
    sensors: dict[str, SensorTuning]
    density: float | None = None

    @property
    def words(self) -> str:
        """Who says so, in the table of what filters were given."""
        return f"tuned on {self.flight}"

    def given_density(self) -> GivenValue:
        """For the table of what filters were given."""
        words = "acceleration, SD of the velocity that grows in a second"
        return GivenValue("targets", words, f"{self.density or 0.0:.3g} m/s", self.words)


def model_targets(stated: TargetsPart) -> tuple[TargetModel, list[GivenValue]]:
    """What is stated of the targets, else the usual."""
    usual = read_settings(DATA / "settings" / "usual.toml").targets
    given = GivenValues("targets")

    def one(name: str, what: str, unit: str) -> float:
        own, other = getattr(stated, name), getattr(usual, name)
        return float("nan") if own is other is None else given.number(what, unit, own, other)

    found = TargetModel(
        one("acceleration_m_s_sqrt_s", "acceleration, SD of the velocity that grows in a second", " m/s"),
        one("start_speed_m_s", "speed at the start, SD of each axis", " m/s"),
        one("gate_probability", _GATE, ""),
        one("patience_s", _PATIENCE, " s"),
        one("reach_m", _REACH, " m"),
        float(np.radians(one("reach_deg", _REACH_OF_RAYS, "°"))),
        one("size_m", "a track is with it within", " m"),
        stated.identified,
    )
    return found, given.values


def settings_of(flight: Flight, stated: Settings | None = None) -> Settings:
    """What a settings file states, and where it says nothing, ``flight.toml``."""
    own = Settings(sensors=flight.manifest.sensors, targets=flight.manifest.targets)
    return own if stated is None else settings_over(stated, own)


def noise_of_tuning(tuning: SensorTuning) -> NoiseModel:
    """What a flight with truth says of a sensor."""
    lasting = [
        ConsideredError(name, sd, tuning.correlation_time_s, True)
        for name, sd in tuning.considered.items()
        if sd > 0
    ]
    return NoiseModel(
        tuning.sensor,
        tuning.kind,
        tuning.offset_s,
        tuning.sds,
        np.array(tuning.white_sds),
        tuple(lasting),
        tuning.next_correlation,
        tuning.fading,
        tuning.thinning_s,
        tuning.range_m,
        tuning.range_sd_m,
        tuning.interval_s,
    )


def model_noise(
    flight: Flight,
    scans: Scans,
    settings: Settings,
    tuned: SensorTuning | None = None,
    by_tuning: str = "",
) -> tuple[NoiseModel, list[GivenValue]]:
    """What filters believe of one sensor of a flight, and what to say of it.

    Parameters
    ----------
    scans
        Of the sensor, by its clock as it is.
    settings
        From `settings_of`; what it states goes before what was tuned.
    tuned, by_tuning
        What other flights say of the sensor, and `Tuned.words`.

    Raises
    ------
    WildlabError
        Where the noise is not stated and cannot be found.
    """
    part = settings.sensors.get(scans.sensor, SensorPart())
    given = GivenValues(scans.sensor)
    found = None if tuned is None else noise_of_tuning(tuned)
    noise, sources = _noise(flight, scans, settings, found, by_tuning)
    amounts = [_amount(name, float(sd)) for name, sd in zip(scans.elements, noise, strict=True)]
    for one in dict.fromkeys(zip(map(_noise_words, scans.elements), amounts, sources, strict=True)):
        given.add(*one)
    errors = {}
    chosen = _considered(flight, scans, settings, found, by_tuning)
    considered = tuple(error for error, _ in chosen)
    for error, source in chosen:
        name = "tilt" if error.name in TOGETHER["tilt"] else error.name.replace("_", " ")
        lasts = "constant" if np.isinf(error.correlation_time_s) else f"for {error.correlation_time_s:.3g} s"
        errors[name] = f"{_in_unit(error)}, {lasts}", source
    for name, value in errors.items():
        given.add(f"considered error: {name}", *value)
    offset, source = part.clock_offset_s, STATED
    if tuned is not None and tuned.clock_tuned and "clock_offset_s" not in part.model_fields_set:
        offset, source = tuned.offset_s, by_tuning
    if source != STATED or "clock_offset_s" in part.model_fields_set:
        given.add("to be added to its stamps", f"{offset:.2f} s", source)
    base = found or NoiseModel(
        scans.sensor, scans.kind, 0.0, noise, noise, (), None, 1.0,
        float("nan"), float("nan"), float("nan"), scans.interval_s,
    )  # fmt: skip
    interval = base.interval_s if part.rate_hz is None else 1 / part.rate_hz
    fading, thinning = base.fading, base.thinning_s
    if part.correlation_time_s is not None:
        fading, thinning = float(np.exp(-interval / part.correlation_time_s)), part.correlation_time_s
    elif found is None and considered:
        shortest = min(one.correlation_time_s for one in considered)
        fading = float(np.exp(-interval / shortest))
        thinning = shortest if np.isfinite(shortest) else thinning
    names = ("range_m", "range_sd_m", "thinning_s")
    stated: dict[str, Any] = {"lasting": part.correlation} | {name: getattr(part, name) for name in names}
    beliefs = base._replace(
        offset_s=offset,
        white=noise if found is None or STATED in sources else found.white,
        noise=noise,
        considered=considered,
        fading=fading,
        thinning_s=thinning,
        interval_s=interval,
    )._replace(**{name: value for name, value in stated.items() if value is not None})
    return beliefs, given.values


def _noise(
    flight: Flight, scans: Scans, settings: Settings, found: NoiseModel | None, by_tuning: str
) -> tuple[Array, list[str]]:
    """(m,) standard deviations of what is new at each scan, and where each is from."""
    part = settings.sensors.get(scans.sensor, SensorPart())
    values, sources = np.full(len(scans.elements), np.nan), [""] * len(scans.elements)
    rough: Array | None = None
    for i, name in enumerate(scans.elements):
        stated = getattr(part.noise, NOISE_OF[name])
        if stated is not None:
            values[i], sources[i] = np.radians(stated) if NOISE_OF[name].endswith("deg") else stated, STATED
        elif found is not None:
            values[i], sources[i] = found.noise[i], by_tuning
        elif scans.kind == "pixel":
            pixel = flight.manifest.uncertainty.pixel_px
            values[i] = assumed_deviations(flight)["pixel_px"]
            sources[i] = STATED if pixel is not None else ASSUMED
        elif scans.R is not None and np.isfinite(scans.R).any():
            values[i] = float(np.sqrt(np.nanmean(scans.R[..., i, i])))
            sources[i] = "the detections' own"
        else:
            rough = roughness(scans) if rough is None else rough
            values[i], sources[i] = rough[i], ROUGH
    bad = ~(values > 0)
    if bad.any():
        name = scans.elements[int(np.flatnonzero(bad)[0])]
        raise WildlabError(
            f"how noisy {name!r} of the sensor {scans.sensor!r} is, is not stated, and its detections do not "
            "tell",
            f"state {NOISE_OF[name]} in [sensors.{scans.sensor}.noise] of flight.toml or of --settings",
            file=flight.folder,
            field=f"sensors.{scans.sensor}.noise",
        )
    return values, sources


def _considered(
    flight: Flight, scans: Scans, settings: Settings, found: NoiseModel | None, by_tuning: str
) -> list[tuple[ConsideredError, str]]:
    """Each with who says so: what is stated, and what was tuned beside it; else the platform's, unless all
    that lasts was tuned as each target's own."""
    part = settings.sensors.get(scans.sensor, SensorPart())
    stated, named = list[ConsideredError](), set[str]()
    for name, one in part.considered.items():
        if not _considers(scans, name):
            known = ", ".join(slot for slot in CONSIDERED if _considers(scans, slot))
            raise WildlabError(
                f"the error {name!r} cannot be considered for detections of kind {scans.kind!r}",
                f"use one of {known}",
                field=f"sensors.{scans.sensor}.considered",
            )
        sd = np.radians(one.sd) if CONSIDERED[name] == "deg" else one.sd
        time = np.inf if one.correlation_time_s is None else one.correlation_time_s
        stated += [ConsideredError(each, float(sd), float(time), one.shared) for each in errors_named(name)]
        named |= set(errors_named(name))
    tuned = [] if found is None else [one for one in found.considered if one.name not in named]
    if stated or tuned:
        return [(one, STATED) for one in stated] + [(one, by_tuning) for one in tuned]
    if (scans.poses is not None and scans.poses.covariance is not None) or (
        found is not None and found.lasting
    ):
        return []
    stated_sds = {
        name: (getattr(flight.manifest.uncertainty, key), key.endswith("deg"))
        for name, key in OF_PLATFORM.items()
        if name in SLOTS[scans.kind]
    }
    errors = [
        ConsideredError(name, float(np.radians(sd) if degrees else sd), np.inf, True)
        for name, (sd, degrees) in stated_sds.items()
        if sd is not None
    ]
    return [(one, "[uncertainty] of flight.toml") for one in errors]


def errors_named(name: str) -> tuple[str, ...]:
    """The errors of `SLOTS` that one of `CONSIDERED` stands for: a tilt is one about each level axis."""
    return TOGETHER.get(name, (name,))


def _considers(scans: Scans, name: str) -> bool:
    return set(errors_named(name)) <= set(SLOTS[scans.kind])


def _noise_words(element: str) -> str:
    words = {"position_m": "position", "range_m": "range", "azimuth_deg": "bearing", "pixel_px": "pixel",
             "elevation_deg": "elevation", "velocity_m_s": "velocity"}  # fmt: skip
    return f"noise of its {words[NOISE_OF[element]]}, SD of each axis"


def _amount(element: str, value: float) -> str:
    unit = NOISE_OF[element].split("_", 1)[1]
    if unit == "deg":
        return f"{np.degrees(value):.2g}°"
    return f"{value:.2g} {unit.replace('m_s', 'm/s')}"


def _in_unit(error: ConsideredError) -> str:
    unit = "deg" if error.name in TOGETHER["attitude"] else CONSIDERED[error.name]
    return f"{np.degrees(error.sd):.2g}°" if unit == "deg" else f"{error.sd:.2g} {unit}"


def errors_of(scans: Scans, beliefs: NoiseModel) -> Considered | None:
    """Those considered; of poses that have a covariance, that and what is considered beside it."""
    poses, n = scans.poses, len(scans.times)
    of_pose = [one for one in beliefs.considered if one.name in POSE]
    parts = list[Considered]()
    if poses is not None and poses.covariance is not None and np.isfinite(poses.covariance).any():
        turn = np.tile(np.eye(6), (n, 1, 1))
        turn[:, 3:, 3:] = level_axes(poses.R_nb)
        covariance = np.swapaxes(turn, 1, 2) @ np.asarray(poses.covariance, float) @ turn
        for one in of_pose:  # what is stated comes on top of what the poses say of themselves
            covariance[:, POSE.index(one.name), POSE.index(one.name)] += one.sd**2
        parts.append(Considered(POSE, covariance))
    parts += [
        Considered((one.name,), np.full((n, 1, 1), one.sd**2), one.correlation_time_s, (one.shared,))
        for one in beliefs.considered
        if not parts or one not in of_pose
    ]
    return consider_all(*parts) if parts else None


def spread_of(scans: Scans, beliefs: NoiseModel, H_pose: Array) -> Array | None:
    """(N, m, m) what the errors add to measurements with derivatives (N, m, k); None where there are none."""
    errors = errors_of(scans, beliefs)
    if errors is None:
        return None
    H = H_pose[..., [SLOTS[scans.kind].index(name) for name in errors.names]]
    return H @ errors.covariance @ np.swapaxes(H, -1, -2)


#: Median of the size of a standard normal number.
MEDIAN_OF_NORMAL = 0.6744897501960817
#: A quarter of all are smaller than this.
QUARTER_OF_NORMAL = 0.3186393639643751
#: Looks further apart than this many usual intervals are no neighbours.
NEIGHBOURS = 1.5
#: A triple that is so many standard deviations off the line is of no target.
FAR_OFF = 4.0
#: By so much each scan is turned more than the last to see what chance makes of it, rad: no turn comes back.
TURN = np.pi * (3 - np.sqrt(5))
#: What is of targets lies nearer to a line than so many times what chance makes.
NEARER = 0.5


def roughness(scans: Scans) -> Array:
    """(m,) standard deviation of white noise that would make detections as rough as they are.

    Of three successive scans, the middle one less the mean of the others, of the same label, or without
    labels of detections that are nearest to each other from scan to scan; by the median, which a few wrong
    ones do not move. What bends in the way of a target between scans counts as noise, what lasts does not.
    NaN where there are no three scans in a row, or
    nothing in them lies better in line than chance makes it.
    """
    if not scans.labelled:
        return _unnamed(scans)
    found = []
    for name in sorted({str(one) for one in scans.labels.ravel() if one}):
        own = np.where((scans.labels == name)[..., None], scans.detections, np.nan)
        found.append(_triples(scans._replace(detections=own), 0.0)[0])
    values = np.concatenate(found)
    return _spread(values) if len(values) else np.full(values.shape[1], np.nan)


def _spread(values: Array) -> Array:
    """(m,) standard deviations of (N, m) by their medians."""
    return np.median(np.abs(values), axis=0) / MEDIAN_OF_NORMAL


def _unnamed(scans: Scans) -> Array:
    """`roughness` where nobody says which detections are of one target, and some may be of none.

    Two of successive scans go together where each is the other's nearest. Triples of clutter lie much farther
    off the line than those of a target: they are left out by and by, until none is beyond `FAR_OFF`. What is
    left must lie nearer to a line than the same detections do when every scan is turned by another angle,
    where nothing is of one target any more: else it is clutter itself, and NaN.
    """
    nothing = np.full(scans.detections.shape[-1], np.nan)
    values, off = _triples(scans, 0.0)
    if not len(values):
        return nothing
    # Half of all may be clutter: it starts from those that lie best in line.
    sd = np.quantile(np.abs(values), 0.25, axis=0) / QUARTER_OF_NORMAL
    while True:
        good = (np.abs(values) <= FAR_OFF * sd).all(axis=1)
        values, off = values[good], off[good]
        if not len(values):
            return nothing
        before_sd, sd = sd, _spread(values)
        if (sd >= before_sd).all():
            break
    _, by_chance = _triples(scans, TURN)
    alike = len(by_chance) and np.median(off) > NEARER * np.median(by_chance)
    return nothing if alike else sd


def _triples(scans: Scans, turn: float) -> tuple[Array, Array]:
    """(N, m) of three scans' detections that go together the middle one less the mean of the others, and (N,)
    how far that is where they are compared. Each scan is turned by ``turn`` (rad) more than the last."""
    gap = NEIGHBOURS * scans.interval_s
    values = [np.zeros((0, scans.detections.shape[-1]))]
    off = [np.zeros(0)]
    before: list[tuple[float, Array, Array]] = []
    last = np.zeros(0, np.intp)
    for row, (time, z) in enumerate(zip(scans.times, scans.detections, strict=True)):
        here = z[np.isfinite(z).all(axis=-1)]
        if not len(here):
            continue
        if before and time - before[-1][0] > gap:
            before = []
        before = [*before[-2:], (float(time), here, _metric(scans, here, row, row * turn))]
        # Of each detection of this scan, the one of the scan before that it goes together with, or -1.
        own = _mutual(before[-2][2], before[-1][2]) if len(before) > 1 else np.full(len(here), -1)
        if len(before) == 3 and before[2][0] > before[0][0]:
            (t0, z0, x0), (t1, z1, x1), (t2, z2, x2) = before
            third = np.flatnonzero(own >= 0)
            third = third[last[own[third]] >= 0]
            second = own[third]
            first = last[second]
            share = (t1 - t0) / (t2 - t0)
            ahead, behind = z2[third] - z1[second], z0[first] - z1[second]
            ahead, behind = (np.where(np.array(scans.angles), wrap(one), one) for one in (ahead, behind))
            weight = 1 + share**2 + (1 - share) ** 2
            values.append(-((1 - share) * behind + share * ahead) / np.sqrt(weight))
            off.append(np.linalg.norm(x1[second] - (1 - share) * x0[first] - share * x2[third], axis=1))
        last = own
    return np.concatenate(values), np.concatenate(off)


def _metric(scans: Scans, z: Array, row: int, turn: float) -> Array:
    """Detections of a scan where they may be compared, turned by an angle: ranges and bearings as places,
    bearings on a circle."""
    if scans.kind == "bearing":
        azimuth = z[:, 0] + turn
        return np.column_stack([np.cos(azimuth), np.sin(azimuth), z[:, 1:]])
    if scans.kind == "range-bearing":
        azimuth = z[:, 1] + turn
        return z[:, :1] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    c, s = np.cos(turn), np.sin(turn)
    centre = np.nan_to_num(scans.platform[row]) if scans.kind == "position" else np.zeros(2)
    return (z[:, :2] - centre) @ np.array([[c, s], [-s, c]]) + centre


def _mutual(before: Array, here: Array) -> NDArray[np.intp]:
    """(M,) of each detection of a scan its nearest of the scan before, where it is that one's nearest too."""
    back = np.asarray(cKDTree(before).query(here)[1], np.intp)
    forth = np.asarray(cKDTree(here).query(before)[1], np.intp)
    return np.where(forth[back] == np.arange(len(here)), back, -1)
