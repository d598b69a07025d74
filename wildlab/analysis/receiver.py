"""How a flight's receiver errs, how late it is and where it sits, by the innovations of the filter.

Only the flight's own inertial samples and satellites go into it, and no pose that was found on board: what is
chosen by this may be judged by that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.analysis.navigation_inputs import VELOCITY, Inputs, axis_errors, imu_noise, inputs_of
from wildlab.errors import WildlabError
from wildlab.flight.checks.inertial import FLYING
from wildlab.flight.clocks import gnss_times
from wildlab.flight.store import Flight
from wildlab.geometry.gravity import Earth, local_earth
from wildlab.navigation.aiding import Aiding
from wildlab.navigation.mekf import InitialState, Navigation, run_mekf
from wildlab.navigation.noise import AxisErrors, ImuNoise
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

Array = NDArray[np.float64]

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
    gross
        Fixes of the whole flight that were left out as no noise.
    """

    candidates: list[Candidate]
    chosen: Candidate
    begin: float
    end: float
    scale: Scale
    fixes: int
    gross: int

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
    gain
        Of the log likelihood over what is stated.
    """

    latency: float
    lever: Array
    sd: Array
    gain: float


class _Filter(NamedTuple):
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
    return {name: tell(one, of[name]) if name in of else one for name, one in aiding.items()}


def without_gross(flight: Flight, given: Inputs) -> dict[str, Aiding]:
    """The aiding of a flight, less what the filter, told what is stated, misses by more than `GROSS`.

    Raises
    ------
    WildlabError
        Where that is more than `LOST` of a source.
    """
    filtered = _filter_of(flight, given)
    found = filtered.run(given.aiding, given.imu.times[-1:], 0.9999).innovations
    kept = {}
    for index, (name, source) in enumerate(given.aiding.items()):
        dof = np.isfinite(found.innovation).sum(axis=1)
        bad = (found.source == index) & (found.nis > dof * GROSS**2)
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
    gross = sum(len(given.aiding[name].times) - len(aiding[name].times) for name in aiding)
    begin, end = _part(flight, given)
    inside = (aiding["position"].times >= begin) & (aiding["position"].times <= end)
    if inside.sum() < FEWEST:
        raise WildlabError(
            f"{inside.sum()} fixes in the part that is looked at are too few to tell noise and correlation",
            f"navigate with what is stated; {FEWEST} fixes are enough",
            file=flight.folder,
            field="gnss",
        )
    short = _shortened(_filter_of(flight, given), aiding, begin, end)

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
    return Receiver(candidates, chosen, begin, end, scale, int(inside.sum()), gross)


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
    short = _shortened(_filter_of(flight, given), aiding, begin, end)
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
    gain = found.log_likelihood - likely[len(likely) // 2]  # the middle one is what is stated
    return Placement(float(found.parameters[0]), found.parameters[1:], found.sd, gain)


def _rows(source: Aiding, keep: NDArray[np.bool_]) -> Aiding:
    return source._replace(
        times=source.times[keep], value=source.value[keep], variance=source.variance[keep],
        lever=source.lever[keep],
    )  # fmt: skip


def _filter_of(flight: Flight, given: Inputs) -> _Filter:
    latitude, _, height = flight.manifest.origin_tuple()
    return _Filter(
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


def _shortened(whole: _Filter, aiding: dict[str, Aiding], begin: float, end: float) -> _Filter:
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
