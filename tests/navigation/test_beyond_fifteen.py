"""The MEKF's states beyond the fifteen of H: axes that are not where they should be, correlated fixes."""

import numpy as np
import pytest

from tests.navigation import reference_mekf
from tests.navigation.flights import GNSS_SD, GRAVITY, LEVERS, NOISE, begin, fixes, fly, moved, spoil
from tests.navigation.test_mekf import (
    EARTH,
    between,
    errors_of,
    nees_of,
    some_state,
    spoilt,
)
from wildlab.geometry.frames import flat_earth, local_earth, rotation_vector_to_matrix
from wildlab.navigation.aiding import GaussMarkov, positions, velocities
from wildlab.navigation.mekf import Outages, prepare, run_mekf
from wildlab.navigation.strapdown import AxisErrors, ImuSamples
from wildlab.simulation.error_models import gauss_markov
from wildlab.simulation.onboard_sensors import misaligned_triad


@pytest.fixture(scope="module")
def flight():
    return fly()


@pytest.mark.slow
def test_compiled_and_reference_agree_on_axes_and_gauss_markov_errors(flight):
    """With every state beyond the fifteen, a gap, and one antenna of two with a Gauss-Markov error."""
    imu, start, antennas, _ = spoilt(flight, 0, every=50)
    keep = (imu.times < 30) & ~((imu.times > 20.0) & (imu.times < 21.3))
    imu = ImuSamples(*(part[keep] for part in imu))
    correlated = antennas[1]._replace(gauss_markov=GaussMarkov(np.array([0.1, 0.2, 0.3]), 15.0))
    seconds = np.arange(1.0, 29)
    moving = velocities(seconds, moved(seconds)[0], 0.5)
    moving = moving._replace(gauss_markov=GaussMarkov(np.array([0.2, 0.2, 0.4]), 3.0))
    aiding = [antennas[0], correlated, moving]
    axes, earth = AxisErrors(0.01, 0.003, 0.005), local_earth(0.9, 100.0)
    wanted = np.arange(0.5, 29.5, 1.0)
    found = run_mekf(imu, start, NOISE, earth, aiding, wanted, axes=axes)
    ready = prepare(imu, start, NOISE, aiding, wanted, 0.9999, Outages(), axes)
    beyond = 18 + 3 + 3
    assert ready.covariance.shape == (15 + beyond, 15 + beyond)
    states, covariances, nis, verdicts = reference_mekf.mekf(ready, earth.as_array(), 5.0)
    known = np.isfinite(found.position).all(axis=1)
    ours = np.hstack(
        [found.position, found.velocity, found.quaternion, found.accelerometer_bias, found.gyro_bias]
    )
    assert np.abs(ours - states[:, :16])[known].max() < 1e-8
    theirs = covariances[:, :15, :15]
    scale = np.sqrt(np.einsum("kii,kjj->kij", theirs, theirs))
    assert (np.abs(found.covariance - theirs) / scale)[known].max() < 1e-7
    assert np.allclose(found.innovations.nis, nis, rtol=1e-6)
    assert np.array_equal(found.innovations.verdict, verdicts)
    without = run_mekf(imu, start, NOISE, earth, [antennas[0]], wanted)
    assert np.abs(without.covariance - found.covariance)[known].max() > 0


@pytest.mark.parametrize("seed", range(3))
def test_transition_with_axes_is_the_derivative_of_a_step(seed):
    """By finite differences of readings from axes that are a little wrong."""
    rng = np.random.default_rng(seed)
    x, f, w, dt = some_state(rng), rng.uniform(-15, 15, 3), rng.uniform(-1, 1, 3), 0.01
    earth = flat_earth(GRAVITY).as_array()

    def step(errors):
        # What there is, where that much of the reading came of the axes.
        E = errors.reshape(2, 3, 3)
        there = f - E[0] @ (f - x[10:13]), w - E[1] @ (w - x[13:16])
        return reference_mekf.strapdown_step(x, *there, dt, earth)[0]

    after = step(np.zeros(18))
    found = np.stack(
        [(between(after, step(h)) - between(after, step(-h))) / 2e-4 for h in 1e-4 * np.eye(18)], -1
    )
    Phi = reference_mekf.transition(np.concatenate([x, np.zeros(18)]), f, w, dt, earth, (1.0, 1.0), axes=True)
    assert np.abs(found - Phi[:15, 15:]).max() < 2 * dt * dt
    assert np.abs(Phi[3:9, 15:]).max() > 0.02


def test_wrong_axes_are_owned_up_to():
    """Gyros turned by half a degree: told so, the filter stays within its bounds; else it is wrong."""
    flight = fly()
    imu, biases = spoil(flight, np.random.default_rng(11))
    lean = rotation_vector_to_matrix(np.array([0.0, 0.009, -0.006]))
    turned = imu._replace(angular_rate=imu.angular_rate @ lean.T)
    rng = np.random.default_rng(12)
    start, antennas = begin(flight, biases, rng), fixes(flight, rng)
    rows = np.arange(9000, len(flight.imu.times), 50)
    nees = {}
    for name, axes in (("told", AxisErrors(0.006)), ("not told", None)):
        found = run_mekf(turned, start, NOISE, EARTH, antennas, flight.imu.times[rows], axes=axes)
        nees[name] = nees_of(errors_of(found, flight.motion, rows), found.covariance, slice(6, 9)).mean() / 3
    assert nees["told"] < 2.5
    assert nees["not told"] > 2 * nees["told"]


def test_a_correlated_fix_keeps_its_place_in_doubt(flight):
    """Averaging does not help against an error that stays: the position remains that uncertain."""
    imu, start, antennas, _ = spoilt(flight, 13)
    rng = np.random.default_rng(14)
    slow = [gauss_markov(len(a.times), 0.2, [0.2] * 3, 60.0, rng) for a in antennas]
    rows = np.arange(9000, len(flight.imu.times), 50)
    told, untold = (
        run_mekf(
            imu,
            start,
            NOISE,
            EARTH,
            [
                positions(a.times, a.value + s, GNSS_SD, lever, gauss_markov_sd=sd, gauss_markov_time=60.0)
                for a, s, lever, sd in zip(antennas, slow, LEVERS, (size, size), strict=True)
            ],
            flight.imu.times[rows],
        )
        for size in (0.2, 0.0)
    )
    squares = [
        nees_of(errors_of(found, flight.motion, rows), found.covariance, slice(0, 3)).mean() / 3
        for found in (told, untold)
    ]
    assert np.sqrt(told.covariance[:, 0, 0]).min() > 0.05
    assert squares[0] < 3 < 10 < squares[1]


def test_axis_errors_have_the_covariance_of_misaligned_triads():
    """Turned as a whole and leaning one by one, each evenly up to its limit: the simulated sensor's own."""
    rng = np.random.default_rng(15)
    package, lean = np.radians(0.25), np.radians(0.05)
    triads = np.array([(misaligned_triad(lean, package, rng) - np.eye(3)).ravel() for _ in range(10_000)])
    stated = AxisErrors(package / np.sqrt(3), lean / np.sqrt(3)).covariance()
    assert np.abs(np.cov(triads.T) - stated).max() < 0.03 * stated.max()
    assert AxisErrors(0.0, 0.0, 0.01).covariance()[4, 4] == pytest.approx(1e-4)
