"""The multiplicative extended Kalman filter of H 7.3, with what a logged flight needs beyond it.

Fifteen error states: position and velocity in n, attitude as four times the modified Rodrigues parameters in
b (``q = q_hat * dq``, H 7.15-7.16), accelerometer bias, gyro bias. What may be measured is in `aiding`. H
(7.26) lost the sign of its attitude block: (7.25), of which it is the derivative, has ``-R S(r)``, and so has
the filter.

Behind the fifteen come, where asked for, what H leaves out and sensors have, and what looks like motion to a
filter of fifteen states. Gauss-Markov errors of positions and velocities are estimated. Misaligned
axes and scale factors are considered, as the pose is in the tracking of H 7.4: estimated, they come out surer
than they are, since what little tells them from biases hangs on estimates that still move.

Everything is computed after the flight, so a latency needs no model: a fix belongs to the time at which it
was valid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from wildlab.errors import WildlabError
from wildlab.geometry.covariances import check_covariance, gate_threshold
from wildlab.geometry.frames import Array, Earth, quaternion_to_matrix
from wildlab.navigation import kernels
from wildlab.navigation.aiding import Aiding, gather, set_out
from wildlab.navigation.kernels import Integers
from wildlab.navigation.strapdown import AxisErrors, Gap, ImuSamples, Measurements, Timeline, checked_imu
from wildlab.navigation.strapdown import ImuNoise as ImuNoise

#: Verdicts on a measurement: left out by its gate; used; used after the covariance was widened.
REJECTED, ACCEPTED, FORCED = kernels.REJECTED, kernels.ACCEPTED, kernels.FORCED


class InitialState(NamedTuple):
    """What is known at the start.

    Attributes
    ----------
    time
        s. Earlier measurements are not used.
    state
        (16,): position (m) and velocity (m/s) in n, quaternion from b to n, scalar first, accelerometer bias
        (m/s^2) and gyro bias (rad/s) in b.
    covariance
        (15, 15) of the errors.
    """

    time: float
    state: Array
    covariance: Array


class Outages(NamedTuple):
    """How the filter gets through times without inertial samples, or without a measurement that passes.

    Attributes
    ----------
    patience
        Where all measurements of a kind were left out for so long (s), the filter has lost its way rather
        than the sensor: the covariance is then widened until the next one fits, which is marked ``FORCED``.
    max_gap
        Intervals between inertial samples longer than this (s) are crossed in a straight line.
    gap_acceleration, gap_rate
        Standard deviations of what may have been meanwhile, m/s^2 and rad/s.
    """

    patience: float = 5.0
    max_gap: float = 0.1
    gap_acceleration: float = 5.0
    gap_rate: float = 0.5


#: What `run_mekf` does where nobody says otherwise.
OUTAGES = Outages()


class Innovations(NamedTuple):
    """Of E measurements in order of time.

    Attributes
    ----------
    times, source
        (E,) s, and the index of the aiding it came from.
    innovation, S
        (E, 3) and (E, 3, 3).
    nis
        (E,) normalised innovation squared, before anything was widened.
    verdict
        (E,) ``REJECTED``, ``ACCEPTED`` or ``FORCED``.
    """

    times: Array
    source: Integers
    innovation: Array
    S: Array
    nis: Array
    verdict: Integers


class Navigation(NamedTuple):
    """The estimate at M times; NaN before the start, behind the last sample, and inside gaps.

    ``covariance`` (M, 15, 15) is of the errors position, velocity (n), attitude (rad, b), biases; ``gaps``
    are the intervals without inertial samples; ``unused`` counts, per aiding, the measurements outside the
    estimate.
    """

    times: Array
    position: Array
    velocity: Array
    quaternion: Array
    accelerometer_bias: Array
    gyro_bias: Array
    covariance: Array
    innovations: Innovations
    gaps: list[Gap]
    unused: list[int]


class MekfInputs(NamedTuple):
    """What both the compiled filter and its reference take.

    ``state`` (n + 1,) and ``covariance`` (n, n) are those of the start, with the errors beyond the fifteen;
    ``extra`` (n - 15, 2) is the density and the time of these, ``axes`` whether the axes' are among them.
    """

    line: Timeline
    measured: Measurements
    source: Integers
    unused: list[int]
    gaps: list[Gap]
    noise: Array
    state: Array
    covariance: Array
    axes: bool
    extra: Array
    gate: float


def prepare(
    imu: ImuSamples, start: InitialState, noise: ImuNoise, aiding: Sequence[Aiding], output_times: Array,
    gate_probability: float, outages: Outages, axes: AxisErrors | None = None,
) -> MekfInputs:  # fmt: skip
    """Timeline, measurements in order of time, and all numbers of the filter."""
    check_initial(start)
    for row, one in enumerate(aiding):
        if one.kind not in NAMES:
            raise WildlabError(
                "a direction in the body beside one in n is a measurement of the observer only",
                "leave it out",
                field=f"aiding[{row}]",
            )
    line, gaps = set_out(imu, start.time, aiding, output_times, outages.max_gap)
    beyond, extra = _extra(aiding, axes)
    state = np.concatenate([start.state, np.zeros(len(extra))])
    covariance = block_diag(start.covariance, beyond)
    measured, source, unused = gather(aiding, line, 15 if axes is None else 33)
    long_run = [
        sd if np.isinf(time) else sd * np.sqrt(2 / time)  # spectral density from the standard deviation
        for sd, time in ((noise[2], noise[3]), (noise[4], noise[5]))
    ]
    numbers = np.array([*noise[:2], long_run[0], noise[3], long_run[1], noise[5], *outages[2:]])
    return MekfInputs(
        line, measured, source, unused, gaps, numbers, state, covariance, axes is not None, extra,
        gate_threshold(gate_probability, 3),
    )  # fmt: skip


def _extra(aiding: Sequence[Aiding], axes: AxisErrors | None) -> tuple[Array, Array]:
    """Covariance at the start (n, n) of the errors beyond the fifteen; densities and times (n, 2)."""
    covariances, processes = [np.empty((0, 0))], [np.empty((0, 2))]
    if axes is not None:
        covariances += [axes.covariance()] * 2
        processes.append(np.tile([0.0, np.inf], (18, 1)))
    for slow in (a.gauss_markov for a in aiding if a.gauss_markov is not None):
        covariances.append(np.diag(slow.sd**2))
        processes.append(np.stack([slow.sd * np.sqrt(2 / slow.time), np.full(3, slow.time)], axis=-1))
    return block_diag(*covariances), np.concatenate(processes)


def check_initial(start: InitialState) -> None:
    """Refuse an initial state that is not finite, or whose covariance is none."""
    state, P = np.asarray(start.state, float), np.asarray(start.covariance, float)
    if state.shape != (16,) or P.shape != (15, 15):
        raise WildlabError(
            f"a state of the shape {state.shape} and a covariance of the shape {P.shape}",
            "give (16,) and (15, 15)",
            field="start",
        )
    lost = np.flatnonzero(~np.isfinite(state))
    if len(lost):
        raise WildlabError(
            f"row {lost[0]} is {state[lost[0]]}", "give every state a value to start from",
            field="start.state",
        )  # fmt: skip
    check_covariance(P, "start.covariance")


def run_mekf(
    imu: ImuSamples,
    start: InitialState,
    noise: ImuNoise,
    earth: Earth,
    aiding: Sequence[Aiding],
    output_times: ArrayLike | None = None,
    *,
    axes: AxisErrors | None = None,
    gate_probability: float = 0.9999,
    outages: Outages = OUTAGES,
) -> Navigation:
    """Position, velocity, attitude and biases with their covariance, from inertial measurements and aiding.

    Parameters
    ----------
    imu
        Inertial measurements; see `ImuSamples`.
    start
        From `alignment.align_at` or of one's own.
    noise, earth
        How the sensors err, and what pulls: `gravity.local_earth`, or `gravity.flat_earth` as in H.
    aiding
        What :func:`positions`, :func:`velocities` and :func:`standstill` give.
    output_times
        (M,) s at which the estimate is wanted, camera stamps for instance; without them, at every inertial
        sample (the covariances of 25 minutes at 250 Hz then take 0.7 GB).
    axes
        How far the inertial sensors' axes may be from where they should be; in a turn, a wrong one is a bias
        that was not there before. Considered, not estimated.
    gate_probability
        Probability that a good measurement is let in, by its NIS, H (3.9). In (0, 1]; 1 leaves none out.
    outages
        See `Outages`.

    Returns
    -------
    Navigation

    Raises
    ------
    WildlabError
        For arrays that do not fit, a start outside the inertial samples, an initial state that is not finite
        or without a covariance, or a ``gate_probability`` outside (0, 1].

    Examples
    --------
    Two seconds at rest, with a fix every half a second:

    >>> import numpy as np
    >>> from wildlab.geometry.frames import flat_earth
    >>> from wildlab.navigation.aiding import positions
    >>> from wildlab.navigation.mekf import InitialState, run_mekf
    >>> from wildlab.navigation.strapdown import STIM300
    >>> from wildlab.navigation.strapdown import ImuSamples
    >>> t = np.arange(0, 2.01, 0.01)
    >>> earth = flat_earth()
    >>> imu = ImuSamples(t, np.tile([0, 0, -earth.gravity], (len(t), 1)), np.zeros((len(t), 3)))
    >>> level = np.concatenate([np.zeros(6), [1, 0, 0, 0], np.zeros(6)])
    >>> start = InitialState(0.0, level, 0.01 * np.eye(15))
    >>> fixes = positions([0.5, 1.0, 1.5, 2.0], np.zeros((4, 3)), sd=0.1)
    >>> found = run_mekf(imu, start, STIM300, earth, [fixes], output_times=[2.0])
    >>> bool(np.abs(found.position).max() < 1e-9), found.innovations.verdict.tolist()
    (True, [1, 1, 1, 1])
    """
    wanted = checked_imu(imu).times if output_times is None else np.asarray(output_times, float)
    times, row = np.unique(wanted, return_inverse=True)
    ready = prepare(imu, start, noise, aiding, times, gate_probability, outages, axes)
    line, measured = ready.line, ready.measured
    states, covariances = np.full((len(times), 16), np.nan), np.full((len(times), 15, 15), np.nan)
    n = len(measured.node)
    innovation, S, nis = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full(n, np.nan)
    verdict = np.zeros(n, np.int64)
    kernels.mekf(
        line.times, line.f, line.w, line.gap, line.row_of_node, earth.as_array(), ready.noise,
        ready.state, ready.covariance, ready.axes, ready.extra, measured.node, measured.kind,
        measured.value, measured.variance, measured.lever, measured.gauss_markov, ready.gate,
        float(outages.patience), states, covariances, innovation, S, nis, verdict,
    )  # fmt: skip
    for gap in ready.gaps:
        unknown = (times > gap.start) & (times < gap.end)
        states[unknown], covariances[unknown] = np.nan, np.nan
    states, covariances = states[row], covariances[row]
    what = Innovations(line.times[measured.node], ready.source, innovation, S, nis, verdict)
    parts = (states[:, :3], states[:, 3:6], states[:, 6:10], states[:, 10:13], states[:, 13:])
    return Navigation(wanted, *parts, covariances, what, ready.gaps, ready.unused)


def pose_covariance(covariance: ArrayLike) -> Array:
    """Position and attitude out of the whole covariance.

    Four times the modified Rodrigues parameters are the rotation vector up to the third order of its size.

    Parameters
    ----------
    covariance
        (M, 15, 15), as `Navigation` has it.

    Returns
    -------
    (M, 6, 6), of the position (m, in n) and of the attitude as a rotation vector (rad, in b).
    """
    P = np.asarray(covariance, float)
    keep = np.array([0, 1, 2, 6, 7, 8])
    return P[..., keep[:, None], keep]


NAMES = {kernels.POSITION: "positions", kernels.VELOCITY: "velocities"}
#: From where on each sign counts; good flights stay well below.
LEFT_OUT, TOO_LARGE, OUTAGE_S = 0.05, 3.0, 10.0
ACCELEROMETER_BIAS, GYRO_BIAS = 1.5, 0.09  # m/s^2 and rad/s: more than sensors that work have


def signs_of_trouble(found: Navigation, aiding: Sequence[Aiding]) -> list[str]:
    """Sentences about an estimate, worst first; none where nothing is wrong.

    Parameters
    ----------
    found, aiding
        What `mekf.run_mekf` gave, and what it was given.

    Returns
    -------
    list of str

    Raises
    ------
    ValueError
        Where there are not as many sources of aiding as the estimate had.
    """
    return [*_misfits(found, aiding), *_biases(found), *_postures(found), *_absences(found, aiding)]


def _misfits(found: Navigation, aiding: Sequence[Aiding]) -> list[str]:
    sentences = []
    for index, source in enumerate(aiding):
        mine = found.innovations.source == index
        if not mine.any():
            continue
        name = f"{NAMES[source.kind]} of source {index + 1}"
        verdict, nis = found.innovations.verdict[mine], found.innovations.nis[mine]
        forced, left_out = int((verdict == FORCED).sum()), float((verdict == REJECTED).mean())
        # The median, which a few outliers do not move: that of chi-square with 3 degrees of freedom.
        ratio = float(np.median(nis)) / 2.366
        if forced:
            sentences.append(
                f"The filter lost its way {'once' if forced == 1 else f'{forced} times'} and had to be "
                f"widened until the {name} fitted: check units, axes and clocks of the inertial sensors."
            )
        if left_out > LEFT_OUT:
            sentences.append(f"{100 * left_out:.0f} % of the {name} did not fit and were left out.")
        if not ratio <= TOO_LARGE:
            sentences.append(
                f"The {name} miss what the filter expects by {np.sqrt(ratio):.1f} times what it allows: "
                "either the noise is larger than stated, or clocks, units, axes or lever arms are wrong."
            )
    return sentences


def _biases(found: Navigation) -> list[str]:
    sentences = []
    for name, bias, limit, unit in (
        ("accelerometers", found.accelerometer_bias, ACCELEROMETER_BIAS, "m/s^2"),
        ("gyros", found.gyro_bias, GYRO_BIAS, "rad/s"),
    ):
        size = np.linalg.norm(bias[np.isfinite(bias).all(axis=1)], axis=1)
        if len(size) and np.quantile(size, 0.9) > limit:
            sentences.append(
                f"The bias of the {name} comes out as {np.quantile(size, 0.9):.2g} {unit}, more than sensors "
                "that work have: check their units and axes."
            )
    return sentences


def _postures(found: Navigation) -> list[str]:
    """All axes turned alike make an estimate that fits, of an airframe that flies in a way none does."""
    v = found.velocity
    fast = np.isfinite(v).all(axis=1) & (np.linalg.norm(v, axis=1) > 5.0)
    if not fast.any():
        return []
    R, course = quaternion_to_matrix(found.quaternion[fast]), v[fast]
    along = (R[:, :, 0] * course).sum(axis=1) / np.linalg.norm(course, axis=1)
    sentences = []
    if np.median(R[:, 2, 2]) < 0:
        sentences.append(
            "It flies on its back most of the time: the z axis of the inertial sensors points up, "
            "rather than down."
        )
    if np.median(along) < -0.5:
        sentences.append(
            "It flies tail first most of the time: the x axis of the inertial sensors points back."
        )
    return sentences


def _absences(found: Navigation, aiding: Sequence[Aiding]) -> list[str]:
    sentences = []
    for gap in found.gaps:
        sentences.append(
            f"Inertial samples are missing from {gap.start:.2f} to {gap.end:.2f} s; "
            "nothing is known in between."
        )
    for index, (source, unused) in enumerate(zip(aiding, found.unused, strict=True)):
        if unused > 0.5 * len(source.times):
            sentences.append(
                f"{unused} of {len(source.times)} {NAMES[source.kind]} of source {index + 1} lie outside the "
                "inertial samples: check that both are on the same clock."
            )
    known = found.times[np.isfinite(found.position).all(axis=1)]
    if len(known):
        used = found.innovations.times[found.innovations.verdict != REJECTED]
        marks = np.concatenate([[known[0]], np.unique(used), [known[-1]]])
        longest = int(np.argmax(np.diff(marks)))
        if marks[longest + 1] - marks[longest] > OUTAGE_S:
            sentences.append(
                f"From {marks[longest]:.0f} to {marks[longest + 1]:.0f} s no measurement was used: "
                "the estimate is dead reckoning there, with the uncertainty that it says."
            )
    return sentences
