"""What of a flight the navigation filters take: samples, aiding, how they err, where to start; and the
receiver.

How a flight's receiver errs, how late it is and where it sits is found by the innovations of the filter. Only
the flight's own inertial samples and satellites go into it, and no pose that was found on board: what is
chosen by this may be judged by that.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.flight.checks.inertial import FLYING
from wildlab.flight.clocks import gnss_times
from wildlab.flight.schema import LEVER_COLUMNS, SECOND_COLUMNS
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array, Mask
from wildlab.geometry.gravity import Earth, local_earth
from wildlab.navigation.aiding import Aiding, positions, velocities
from wildlab.navigation.alignment import align_at_rest, align_from_baseline, align_from_course, find_rest
from wildlab.navigation.magnetometer import earth_field, hard_iron, share_turned
from wildlab.navigation.mekf import InitialState, Navigation, run_mekf
from wildlab.navigation.noise import AxisErrors, ImuNoise, with_turn_on
from wildlab.navigation.observer import baseline_reference, course_reference, field_reference
from wildlab.navigation.receiver import (
    Candidate,
    ReceiverNoise,
    Scale,
    SourceNoise,
    choose,
    gaussian_log_likelihood,
    maximise,
    tell,
)
from wildlab.navigation.strapdown import ImuSamples

POSITION = ["north_m", "east_m", "down_m"]
VELOCITY = ["v_north_m_s", "v_east_m_s", "v_down_m_s"]
FIELD = ("field_x_ut", "field_y_ut", "field_z_ut")
#: Share of the magnetic field's turning that gyros in the same axes explain at least; it is nearer one.
TURNED = 0.6
#: How much wider than the fixes behind it the heading at the start is taken to be.
LOOSE = 5.0


#: See `heading_from`.
Heading = Literal["antennas", "field", "course"]


class Inputs(NamedTuple):
    """Samples, aiding by what it is called in a report, and the start."""

    imu: ImuSamples
    aiding: dict[str, Aiding]
    start: InitialState


def imu_noise(flight: Flight) -> ImuNoise:
    """How the flight's inertial sensor errs, from ``[imu]`` of the manifest, with its biases at switching on.

    Raises
    ------
    WildlabError
        Where one of the figures is not stated there.
    """
    stated = flight.manifest.imu
    hour = 3600.0
    figures = {
        "velocity_random_walk_m_s_sqrt_h": 1 / np.sqrt(hour),
        "angle_random_walk_deg_sqrt_h": np.radians(1.0) / np.sqrt(hour),
        "accelerometer_bias_m_s2": 1.0,
        "accelerometer_bias_time_s": 1.0,
        "gyro_bias_deg_h": np.radians(1.0) / hour,
        "gyro_bias_time_s": 1.0,
    }
    missing = stated.unstated_noise()
    if missing:
        raise WildlabError(
            f"how the inertial sensor errs is not stated ({missing[0]} and {len(missing) - 1} more)"
            if len(missing) > 1
            else f"how the inertial sensor errs is not stated ({missing[0]})",
            "take the figures from its data sheet, or from the log's own standstill",
            file=flight.folder,
            field=f"imu.{missing[0]}",
        )
    noise = ImuNoise(*(float(getattr(stated, name)) * scale for name, scale in figures.items()))
    gyro = np.radians(stated.gyro_turn_on_deg_h or 0.0) / hour
    return with_turn_on(noise, stated.accelerometer_turn_on_m_s2 or 0.0, float(gyro))


def axis_errors(flight: Flight) -> AxisErrors | None:
    """How far the inertial sensor's axes may be off, from ``[imu]`` of the manifest, where it says so.

    Stated are limits; anything up to them counts as equally likely.
    """
    stated = flight.manifest.imu
    limits = (
        np.radians(stated.misalignment_deg or 0.0),
        np.radians(stated.axis_misalignment_deg or 0.0),
        (stated.scale_error_percent or 0.0) / 100,
    )
    return AxisErrors(*(float(limit / np.sqrt(3)) for limit in limits)) if any(limits) else None


def inputs_of(
    flight: Flight,
    *,
    velocity: bool = True,
    noise: ImuNoise | None = None,
    position_sd: tuple[float, float] | None = None,
    accelerometer_bias: ArrayLike = (0.0, 0.0, 0.0),
) -> Inputs:
    """What both filters need of a flight.

    Parameters
    ----------
    velocity
        Whether to use GNSS velocities where the flight has them.
    noise
        As `imu_noise` gives it: says how far biases at the start may be off, where the manifest states that.
    position_sd
        Of each level axis and of the height, m, in place of what is stated; positions then count as white.
    accelerometer_bias
        (3,) m/s^2, taken off what the accelerometers measured.

    Raises
    ------
    WildlabError
        Where the flight lacks inertial samples, satellite positions, or what is known of their errors.
    """
    gnss, samples = flight.table("gnss"), samples_of(flight)
    off = np.asarray(accelerometer_bias, float)
    samples = samples._replace(specific_force=samples.specific_force - off)
    t, p = gnss_times(flight), gnss[POSITION].to_numpy(float)
    sd = _position_sd(flight, gnss)
    spread = float(np.sqrt(2) * np.nanmedian(sd))
    wander, wander_time = _wander(flight)
    if position_sd is not None:
        wander = np.zeros(3)
        sd = np.tile([position_sd[0], position_sd[0], position_sd[1]], (len(t), 1))
    white = np.sqrt(np.maximum(sd**2 - wander**2, (0.01 * sd) ** 2))
    arms = _levers(flight, gnss)
    aiding = {"position": positions(t, p, white, arms[0], 0.0, wander, wander_time)}
    moving = set(VELOCITY) <= set(gnss.columns)
    v = _velocities(gnss, t)
    spread_v = _velocity_sd(flight, gnss)
    if velocity and moving and spread_v is not None:
        aiding["velocity"] = velocities(t, v, spread_v, arms[0])
    gravity = local_earth(flight.manifest.origin_tuple()[0], flight.manifest.origin_tuple()[2]).gravity
    known: dict[str, float] = {}
    if noise is not None:  # where nobody says what biases are at switching on, they may be anything usual
        if flight.manifest.imu.accelerometer_turn_on_m_s2 is not None:
            known["accelerometer_bias_sd"] = noise.accelerometer_bias_sd
        if flight.manifest.imu.gyro_turn_on_deg_h is not None:
            known["gyro_bias_sd"] = noise.gyro_bias_sd
    if set(SECOND_COLUMNS) <= set(gnss.columns):
        second = gnss[list(SECOND_COLUMNS)].to_numpy(float)
        aiding["second position"] = positions(t, second, white, arms[1], 0.0, wander, wander_time)
        # The fixes that it starts from are taken in once more: loosely here, so that they count once.
        known["baseline_sd"] = LOOSE * spread
        start = align_from_baseline(samples, t, p, second, *arms, gravity=gravity, **known)
    else:
        rest = find_rest(samples, t, v) if moving else None
        if rest is None:
            start = align_from_course(samples, t, p, v, gravity=gravity, **known)
        else:
            start = align_at_rest(samples, t, p, v, rest=rest, gravity=gravity, min_speed=FLYING, **known)
    return Inputs(samples, aiding, start)


def _position_sd(flight: Flight, gnss: pd.DataFrame) -> Array:
    """(N, 3) from the log, else from the manifest's ``[uncertainty]``."""
    sds = []
    for column, stated in (
        ("sd_horizontal_m", flight.manifest.uncertainty.position_horizontal_m),
        ("sd_vertical_m", flight.manifest.uncertainty.position_vertical_m),
    ):
        known = gnss[column].to_numpy(float) if column in gnss else np.full(len(gnss), np.nan)
        known = np.where(known > 0, known, np.nan if stated is None else stated)
        if not np.isfinite(known).any():
            raise WildlabError(
                "how uncertain the satellite positions are is not stated",
                f"add the column {column}, or [uncertainty] position_horizontal_m and position_vertical_m",
                file=flight.folder,
                field=f"gnss.{column}",
            )
        sds.append(np.where(np.isnan(known), np.nanmax(known), known))
    return np.stack([sds[0], sds[0], sds[1]], axis=-1)


def _wander(flight: Flight) -> tuple[Array, float]:
    """The part of a position's deviation that fixes share (3,) m, and for how long, s; from the manifest."""
    stated = flight.manifest.gnss
    if stated.wander_time_s is None:
        return np.zeros(3), np.inf
    level, vertical = stated.wander_horizontal_m or 0.0, stated.wander_vertical_m or 0.0
    return np.array([level, level, vertical]), stated.wander_time_s


def _velocity_sd(flight: Flight, gnss: pd.DataFrame) -> Array | None:
    """(N, 1) from the log, else (3,) from the manifest's ``[uncertainty]``; None if neither says."""
    if "sd_velocity_m_s" in gnss:
        return gnss["sd_velocity_m_s"].to_numpy(float)[:, None]
    stated = flight.manifest.uncertainty
    level, vertical = stated.velocity_horizontal_m_s, stated.velocity_vertical_m_s
    return None if level is None or vertical is None else np.array([level, level, vertical])


def _velocities(gnss: pd.DataFrame, times: Array) -> Array:
    """(N, 3) m/s, as logged or else from the positions."""
    if set(VELOCITY) <= set(gnss.columns):
        return gnss[VELOCITY].to_numpy(float)
    return np.gradient(gnss[POSITION].to_numpy(float), times, axis=0)


def _levers(flight: Flight, gnss: pd.DataFrame) -> list[Array]:
    """From b to the first antenna and to the second one, (3,) m in b each."""
    return [_lever(flight, gnss, LEVER_COLUMNS[:3]), _lever(flight, gnss, LEVER_COLUMNS[3:])]


def _lever(flight: Flight, gnss: pd.DataFrame, columns: tuple[str, ...]) -> Array:
    if set(columns) <= set(gnss.columns):
        return gnss[list(columns)].iloc[0].to_numpy(float)
    return np.array(flight.manifest.gnss.lever_arm_m)


def samples_of(flight: Flight) -> ImuSamples:
    """The flight's inertial samples."""
    imu = flight.table("imu")
    return ImuSamples(
        imu["time_s"].to_numpy(float),
        imu[["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]].to_numpy(float),
        imu[["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]].to_numpy(float),
    )


def heading_from(flight: Flight) -> Heading:
    """What shows the observer the heading, the best that the flight has: two antennas, the magnetic field
    where the manifest says how the Earth's lies there, or the course."""
    stated = flight.manifest.magnetometer
    if set(SECOND_COLUMNS) <= set(flight.table("gnss").columns):
        return "antennas"
    known = None not in (stated.inclination_deg, stated.declination_deg)
    return "field" if known and "magnetometer" in flight.tables else "course"


def second_vector(flight: Flight) -> Aiding:
    """The observer's second vector, of what `heading_from` names.

    Raises
    ------
    WildlabError
        Where it is the magnetic field, and that cannot be used.
    """
    gnss, t, stated = flight.table("gnss"), gnss_times(flight), flight.manifest.magnetometer
    which = heading_from(flight)
    if which == "antennas":
        both = (gnss[columns].to_numpy(float) for columns in (POSITION, list(SECOND_COLUMNS)))
        return baseline_reference(t, *both, *_levers(flight, gnss))
    if which == "field":
        lies = np.radians([stated.declination_deg or 0.0, stated.inclination_deg or 0.0])
        return field_reference(*_field(flight), earth_field(*lies))
    return course_reference(t, _velocities(gnss, t), FLYING)


def _field(flight: Flight) -> tuple[Array, Array]:
    """Times (N,) and the field (N, 3) in b, less what is magnetic on board: stated or found in the air.

    Raises
    ------
    WildlabError
        Where the field does not turn as the gyros say: its axes are not those of the inertial samples.
    """
    table, gnss = flight.table("magnetometer"), flight.table("gnss")
    times, field = table["time_s"].to_numpy(float), table[list(FIELD)].to_numpy(float)
    flown = np.full(len(times), True)
    if set(VELOCITY) <= set(gnss.columns):
        t, v = gnss_times(flight), gnss[VELOCITY].to_numpy(float)
        fast = t[np.hypot(v[:, 0], v[:, 1]) >= FLYING]
        if len(fast):
            flown = (times >= fast[0]) & (times <= fast[-1])
    stated = flight.manifest.magnetometer.hard_iron_ut
    field = field - (hard_iron(field[flown]) if stated is None else stated)
    share = share_turned(times[flown], field[flown], samples_of(flight))
    if share < TURNED:
        raise WildlabError(
            f"of the magnetic field's turning in the air, the gyros explain {100 * max(share, 0):.0f} %",
            "check axes and signs of [magnetometer.field], and that both are on the same clock",
            file=flight.folder,
            field="magnetometer",
        )
    return times, field


#: A fix that the filter misses by so many of the deviations it expects is no noise: it is left out.
GROSS = 30.0
#: Where more than this share of a source is so, the filter has lost its way, and there is nothing to learn.
LOST = 0.05
#: So much of a flight is looked at, s, and so much before it settles the filter.
LONGEST_S, SETTLING_S = 600.0, 60.0
#: Fewer fixes than this say nothing of their correlation.
FEWEST = 60
#: So far from what is stated a latency, s, and a lever arm, m per axis, are looked for.
LATEST_S, FARTHEST_M = 0.5, 5.0
#: Inertial samples a second that are enough for what happens between two fixes.
RATE_HZ = 50.0


class Receiver(NamedTuple):
    """How a flight's receiver errs.

    Attributes
    ----------
    candidates
        Models that were tried, what is stated first.
    chosen
        The one with the largest score; the first, where what is stated does.
    begin, end
        Part of the flight that it was found from, s.
    scale
        What is stated, of positions and of velocities.
    fixes
        How many positions that were.
    """

    candidates: list[Candidate]
    chosen: Candidate
    begin: float
    end: float
    scale: Scale
    fixes: int

    @property
    def noise(self) -> ReceiverNoise | None:
        """What to tell the filter in place of what is stated; None where what is stated is as good."""
        return None if self.chosen is self.candidates[0] else self.chosen.noise


class Placement(NamedTuple):
    """How late a receiver is and where its antenna sits, as its own fixes are likeliest.

    Attributes
    ----------
    latency, lever
        s, and (3,) m from the inertial sensor to the antenna, in b.
    sd
        (4,) of them, latency first, by the information in the innovations: right where the noise is. NaN
        where it was not looked for.
    """

    latency: float
    lever: Array
    sd: Array


class Filter(NamedTuple):
    """All but the aiding that a run takes."""

    imu: ImuSamples
    start: InitialState
    noise: ImuNoise
    earth: Earth
    axes: AxisErrors | None

    def run(self, aiding: dict[str, Aiding], wanted: Array, gate: float) -> Navigation:
        given = self.imu, self.start, self.noise, self.earth, list(aiding.values()), wanted
        return run_mekf(*given, axes=self.axes, gate_probability=gate)


def told(aiding: dict[str, Aiding], noise: ReceiverNoise) -> dict[str, Aiding]:
    """Aiding by name, as `navigation_inputs.inputs_of` gives it, with this noise in place of its own."""
    of: dict[str, SourceNoise] = {
        "position": noise.position, "second position": noise.position, "velocity": noise.velocity,
    }  # fmt: skip
    return {name: tell(one, of[name]) for name, one in aiding.items()}


def without_gross(flight: Flight, given: Inputs) -> dict[str, Aiding]:
    """The aiding of a flight, less what the filter, told what is stated, misses by more than `GROSS`.

    Raises
    ------
    WildlabError
        Where that is more than `LOST` of a source.
    """
    filtered = filter_of(flight, given)
    found = filtered.run(given.aiding, given.imu.times[-1:], 0.9999).innovations
    kept = {}
    for index, (name, source) in enumerate(given.aiding.items()):
        bad = (found.source == index) & (found.nis > 3 * GROSS**2)
        if bad.sum() > LOST * len(source.times):
            raise WildlabError(
                f"{bad.sum()} of {len(source.times)} fixes ({name}) are more than {GROSS:.0f} deviations "
                "from what the filter expects: it is lost, and nothing can be learnt of the receiver's noise",
                "check units, axes and clocks of inertial sensors and GNSS first",
                file=flight.folder,
                field="gnss",
            )
        keep = ~np.isin(source.times, found.times[bad])
        kept[name] = _rows(source, keep)
    return kept


def receiver_noise(flight: Flight) -> Receiver:
    """How the flight's receiver errs: the noise under which its fixes are likeliest to the filter.

    Found from the flight's first `LONGEST_S` in the air, or, where no velocity tells, from a minute after its
    start on.

    Parameters
    ----------
    flight
        With the tables ``imu`` and ``gnss``.

    Returns
    -------
    Receiver

    Raises
    ------
    WildlabError
        Where the flight lacks what the filter needs, has fewer than `FEWEST` fixes in that part, or the
        filter is lost on it.

    Examples
    --------
    >>> from wildlab.flight import load_flight
    >>> receiver_noise(load_flight("flights/mine")).noise  # doctest: +SKIP
    """
    given = inputs_of(flight, noise=imu_noise(flight))
    aiding = without_gross(flight, given)
    begin, end = _part(flight, given)
    inside = (aiding["position"].times >= begin) & (aiding["position"].times <= end)
    if inside.sum() < FEWEST:
        raise WildlabError(
            f"{inside.sum()} fixes in the part that is looked at are too few to tell noise and correlation",
            f"navigate with what is stated; {FEWEST} fixes are enough",
            file=flight.folder,
            field="gnss",
        )
    short = _shortened(filter_of(flight, given), aiding, begin, end)

    def run(noise: ReceiverNoise) -> tuple[Array, Array]:
        found = short.run(told(aiding, noise), short.imu.times[-1:], 1.0).innovations
        late = found.times >= begin
        return found.innovation[late], found.S[late]

    stated = {name: np.sqrt(np.median(one.variance, axis=0))[[0, 2]] for name, one in given.aiding.items()}
    for name, one in given.aiding.items():
        if one.gauss_markov is not None:
            stated[name] = np.hypot(stated[name], one.gauss_markov.sd[[0, 2]])
    interval = float(np.median(np.diff(aiding["position"].times[inside])))
    scale = Scale(stated["position"], stated.get("velocity"), interval, end - begin)
    candidates = choose(run, scale)
    chosen = max(candidates, key=lambda one: one.score)
    return Receiver(candidates, chosen, begin, end, scale, int(inside.sum()))


def place_receiver(flight: Flight, noise: ReceiverNoise) -> Placement:
    """How late the receiver is and where its antenna sits, as the flight's fixes are likeliest.

    Of a flight with two antennas, whose levers it knows, only how late it is.

    Parameters
    ----------
    flight
        With the tables ``imu`` and ``gnss``.
    noise
        Of the receiver, as `receiver_noise` finds it.

    Returns
    -------
    Placement

    Raises
    ------
    WildlabError
        As `receiver_noise`.
    """
    given = inputs_of(flight, noise=imu_noise(flight))
    aiding = told(without_gross(flight, given), noise)
    begin, end = _part(flight, given)
    short = _shortened(filter_of(flight, given), aiding, begin, end)
    # The same fixes whatever the latency: a few at either end are left out, and so are those of the settling.
    low, high = max(begin, short.start.time) + LATEST_S, end - LATEST_S
    aiding = {name: _rows(one, (one.times >= short.start.time + LATEST_S)) for name, one in aiding.items()}
    aiding = {name: _rows(one, one.times <= high) for name, one in aiding.items()}
    stated = np.array([flight.manifest.gnss.latency_s, *given.aiding["position"].lever[0]])

    def run(p: Array) -> tuple[Array, Array]:
        late = p[0] - stated[0]
        moved = {
            name: one._replace(times=one.times - late, lever=one.lever + (p[1:] - stated[1:]))
            for name, one in aiding.items()
        }
        found = short.run(moved, short.imu.times[-1:], 1.0).innovations
        counted = found.times + late >= low - 1e-9
        return found.innovation[counted], found.S[counted]

    free = [0] if "second position" in aiding else [0, 1, 2, 3]
    reach = np.array([LATEST_S, *[FARTHEST_M] * 3])
    # Far from where it is largest, the likelihood does not say which way: so a search over latencies first.
    tried = [stated + np.array([late, 0.0, 0.0, 0.0]) for late in np.linspace(-LATEST_S, LATEST_S, 21)]
    likely = [gaussian_log_likelihood(*run(one)) for one in tried]
    start = tried[int(np.argmax(likely))]
    found = maximise(run, start, free, stated - reach, stated + reach, enough=0.5, iterations=12)
    return Placement(float(found.parameters[0]), found.parameters[1:], found.sd)


def _rows(source: Aiding, keep: Mask) -> Aiding:
    return source._replace(
        times=source.times[keep], value=source.value[keep], variance=source.variance[keep],
        lever=source.lever[keep],
    )  # fmt: skip


def filter_of(flight: Flight, given: Inputs) -> Filter:
    latitude, _, height = flight.manifest.origin_tuple()
    return Filter(
        given.imu, given.start, imu_noise(flight), local_earth(latitude, height), axis_errors(flight)
    )


def _part(flight: Flight, given: Inputs) -> tuple[float, float]:
    """From when to when the flight is looked at, s."""
    gnss, t = flight.table("gnss"), gnss_times(flight)
    begin, end = given.start.time + SETTLING_S, float(given.imu.times[-1])
    if set(VELOCITY) <= set(gnss.columns):
        fast = t[np.hypot(*gnss[VELOCITY[:2]].to_numpy(float).T) >= FLYING]
        if len(fast):
            begin, end = max(float(fast[0]), given.start.time), min(float(fast[-1]), end)
    return begin, min(end, begin + LONGEST_S)


def _shortened(whole: Filter, aiding: dict[str, Aiding], begin: float, end: float) -> Filter:
    """The filter over that part and what settles it, with no more samples than it takes.

    It starts from where it was with what is stated, and surer of its position and velocity than it may be by
    whatever the fixes had in common: by as much they are widened.
    """
    start, since = whole.start, begin - SETTLING_S
    if since > start.time:
        there = whole.run(aiding, np.array([since]), 0.9999)
        if np.isfinite(there.covariance).all():
            parts = (
                there.position,
                there.velocity,
                there.quaternion,
                there.accelerometer_bias,
                there.gyro_bias,
            )
            P = there.covariance[0].copy()
            for first, name in ((0, "position"), (3, "velocity")):
                if name in aiding:
                    P[first : first + 3, first : first + 3] += np.diag(
                        np.median(aiding[name].variance, axis=0)
                    )
            start = InitialState(since, np.concatenate([part[0] for part in parts]), P)
    times = whole.imu.times
    rows = (times >= start.time - 1.0) & (times <= end)
    samples = ImuSamples(*(part[rows] for part in whole.imu))
    return whole._replace(imu=thinned(samples, RATE_HZ), start=start)


def thinned(imu: ImuSamples, rate: float) -> ImuSamples:
    """Means of so many samples that follow each other that about ``rate`` (Hz) are left.

    The first and the last one stay, so that the whole time is still there.
    """
    step = float(np.median(np.diff(imu.times)))
    every = max(1, int(np.floor(1 / (rate * step) + 1e-6)))
    if every == 1:
        return imu
    n = len(imu.times) // every * every
    times = imu.times[:n].reshape(-1, every).mean(axis=1)
    values = [part[:n].reshape(-1, every, 3).mean(axis=1) for part in imu[1:]]
    return ImuSamples(
        np.concatenate([imu.times[:1], times, imu.times[-1:]]),
        *(np.concatenate([p[:1], v, p[-1:]]) for p, v in zip(imu[1:], values, strict=True)),
    )
