"""Interacting multiple models (IMM), H 3.2.3: extended filters with different motions, through filterpy.

Same arguments as `wildlab.tracking.run.run_filter`; one detection per row. Errors of the pose widen the noise
of the measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from wildlab.errors import WildlabError
from wildlab.geometry.frames import Array
from wildlab.tracking.association import nearest_detection
from wildlab.tracking.consider_parameters import Considers, Errors, errors_of
from wildlab.tracking.inputs import check_rows, check_start, checked, single_detection
from wildlab.tracking.kalman import correct, predict
from wildlab.tracking.motion import Motion
from wildlab.tracking.predictions import Prediction
from wildlab.tracking.records import Start, State, Track, record, step_through
from wildlab.tracking.sensors import Sensor, angles_at, check_states, difference, on_state

#: A mode that fits this much worse than the best keeps so small a share, and can come back.
LEAST_LIKELIHOOD = 1e-100


class ModeTrack(NamedTuple):
    """A `Track` and how probable each of the K motion models was after each of the N rows."""

    track: Track
    probabilities: Array  # (N, K), NaN before the start


class _Mode:
    """One of an IMM's filters, with what filterpy asks of it: x, P, likelihood, predict and update."""

    def __init__(self, x: Array, P: Array) -> None:
        self.x, self.P, self.likelihood = x.copy(), P.copy(), 1.0
        self.F, self.Q = np.eye(len(x)), np.zeros((len(x), len(x)))
        self.expected: Prediction | None = None
        self.innovation, self.S = np.zeros(0), np.zeros((0, 0))
        self.R = self.S

    def predict(self, u: None = None) -> None:
        self.x, self.P = predict(self.x, self.P, self.F, self.Q)

    def evaluate(self, row: int, z: Array, R: Array, sensor: Sensor, errors: Errors | None) -> bool:
        """Whether this mode's target would be seen; then innovation and ``S`` are there."""
        expected = sensor.predict(row, self.x[: sensor.states])
        R = R if errors is None else R + errors.spread(row, expected.H_pose)
        self.expected, self.R = expected, R
        if not all(np.isfinite(part).all() for part in (expected.z, expected.H_position, R)):
            return False
        H = on_state(expected.H_position, len(self.x))
        near = nearest_detection(z[None], expected.z, H @ self.P @ H.T, R[None], angles_at(sensor, row), row)
        if near is None:
            return False
        self.innovation, self.S = near.innovation, near.S
        return True

    def log_likelihood(self) -> float:
        weighed = self.innovation @ np.linalg.solve(self.S, self.innovation)
        return float(-(weighed + np.linalg.slogdet(2 * np.pi * self.S)[1]) / 2)

    def update(self, z: Array) -> None:
        if self.expected is None:
            raise AssertionError("evaluate() comes first")
        H = on_state(self.expected.H_position, len(self.x))
        done = correct(self.x, self.P, self.innovation, H, self.R)
        self.x, self.P = done.x, done.P


def run_imm(
    times: ArrayLike,
    measurements: ArrayLike,
    R: ArrayLike,
    sensor: Sensor,
    motions: Sequence[Motion],
    mean_stay: Sequence[float],
    start: Start,
    *,
    pose: Considers | None = None,
    gate_probability: float = 1.0,
    output_times: ArrayLike | None = None,
) -> ModeTrack:
    """Interacting multiple models over extended filters, H 3.2.3.

    All models start alike and equally probable. Innovation, ``S`` and NIS are the mixture's.

    Parameters
    ----------
    times
        (N,) s, in order.
    measurements
        (N, m) in the sensor's units; rows of NaN are frames without a detection.
    R
        (m, m) or (N, m, m), in the sensor's units squared.
    sensor
        From `wildlab.tracking.measurement`, with a pose for each row.
    motions
        K >= 2 models of the same n states.
    mean_stay
        (K,) s that each lasts on average; it is left for each of the others alike. The probabilities of
        switching over a step follow from it for any step.
    start
        ``x`` (n,) and ``P`` (n, n), see `wildlab.tracking.run.Start`.
    pose
        Errors to consider, as in `run_filter`; but as if they were new at every measurement, H (7.40)-(7.41):
        ``R + H^o P^o H^o'``, with the derivatives at each mode's state. None: poses are taken as true.
    gate_probability
        Probability that the target's own measurement is let in, H (3.9), in (0, 1]; 1 is no gate.
    output_times
        (M,) s, in order; the measurements' own when not given.

    Returns
    -------
    ModeTrack
        The mixture's track, and how probable each model was after each row.

    Raises
    ------
    WildlabError
        As `wildlab.tracking.run.run_filter`; several detections in a frame; fewer than two models, or not
        one ``mean_stay`` above zero for each.
    """
    given = single_detection(checked(times, measurements, R, gate_probability, output_times, sensor.sizes))
    check_start(start)
    check_rows(sensor.rows, len(given.times), "sensor")
    check_states(sensor, len(start.x))
    errors = errors_of(pose, sensor, len(given.times))
    K, stay = len(motions), np.asarray(mean_stay, float)
    if K < 2 or stay.shape != (K,) or not (stay > 0).all():
        raise WildlabError(
            f"{K} motion models and mean_stay {tuple(mean_stay)}",
            "give at least two models, and for each the seconds that it lasts",
            field="mean_stay",
        )
    rates = np.tile(1 / stay[:, None] / (K - 1), (1, K))
    np.fill_diagonal(rates, -1 / stay)
    modes = [_Mode(np.asarray(start.x, float), np.asarray(start.P, float)) for _ in motions]
    # Imported here, for it brings scipy.stats along, which takes longer than all else that is imported.
    from filterpy.kalman import IMMEstimator

    weights = np.full(K, 1 / K)
    probabilities = np.full((len(given.times), K), np.nan)
    if start.row >= 0:
        probabilities[start.row] = weights

    def mixed(means: Sequence[Array], covariances: Sequence[Array], shares: Array) -> tuple[Array, Array]:
        centre = np.tensordot(shares, means, 1)
        off = np.asarray(means) - centre
        spread = np.asarray(covariances) + off[:, :, None] * off[:, None, :]
        return np.asarray(centre), np.asarray(np.tensordot(shares, spread, 1))

    def step(row: int, state: State, track: Track) -> State:
        nonlocal weights
        dt = given.times[row] - state[0]
        for mode, motion in zip(modes, motions, strict=True):
            mode.F, mode.Q = motion(dt)
        # Made anew at each row: filterpy's own object forgets to switch where there is no measurement.
        imm = IMMEstimator(modes, weights, expm(rates * dt))
        imm.predict()
        weights = imm.cbar
        z = given.z[row, 0]
        R_now = given.R[row, 0]
        if np.isfinite(z).all() and all([one.evaluate(row, z, R_now, sensor, errors) for one in modes]):
            middle = modes[0].innovation  # angles: the others' are near it, on the same side of the wrap
            gaps = [middle + difference(one.innovation, middle, angles_at(sensor, row)) for one in modes]
            innovation, S = mixed(gaps, [mode.S for mode in modes], weights)
            nis = float(innovation @ np.linalg.solve(S, innovation))
            record(track, row, innovation, S, nis, 0, nis <= given.thresholds[row])
            if track.used[row]:
                logs = np.array([mode.log_likelihood() for mode in modes])
                for mode, relative in zip(modes, np.exp(logs - logs.max()), strict=True):
                    mode.likelihood = max(float(relative), LEAST_LIKELIHOOD)
                imm.update(z)
                weights = imm.mu
        probabilities[row] = weights
        x, P = mixed([mode.x for mode in modes], [mode.P for mode in modes], weights)
        return given.times[row], x, (P + P.T) / 2

    def predict_to(state: State, time: float) -> tuple[Array, Array]:
        """Each mode goes its own way; between rows none is left for another."""
        gone = [predict(m.x, m.P, *f(time - state[0])) for m, f in zip(modes, motions, strict=True)]
        return mixed([x for x, _ in gone], [P for _, P in gone], weights)

    return ModeTrack(step_through(given, start, predict_to, step), probabilities)
