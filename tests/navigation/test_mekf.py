"""The MEKF against its plain version, against finite differences, and against its own claims."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.navigation import reference_mekf
from tests.navigation.flights import (
    GNSS_SD,
    GRAVITY,
    LEVERS,
    NOISE,
    START_SD,
    begin,
    fixes,
    fly,
    moved,
    spoil,
)  # fmt: skip
from wildlab.geometry.frames import flat_earth, local_earth, matrix_to_rotation_vector, quaternion_to_matrix
from wildlab.navigation import kernels
from wildlab.navigation.aiding import positions, standstill, velocities
from wildlab.navigation.mekf import (
    ACCEPTED,
    FORCED,
    REJECTED,
    InitialState,
    Outages,
    pose_covariance,
    prepare,
    run_mekf,
)  # fmt: skip
from wildlab.navigation.strapdown import ImuNoise, ImuSamples

EARTH = flat_earth(GRAVITY)


def some_state(rng):
    q = rng.standard_normal(4)
    parts = [rng.uniform(-200, 200, 3), rng.uniform(-20, 20, 3), q / np.linalg.norm(q)]
    return np.concatenate([*parts, rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.02, 0.02, 3)])


def shifted(x, error):
    """The state with an error composed on to it, H (7.23)."""
    mrp = error[6:9] / 4
    turn = Rotation.from_mrp(mrp)
    q = (Rotation.from_quat(x[6:10], scalar_first=True) * turn).as_quat(scalar_first=True)
    return np.concatenate([x[:6] + error[:6], q, x[10:] + error[9:]])


def between(x, other):
    """The error that takes ``x`` to ``other``."""
    turn = Rotation.from_quat(x[6:10], scalar_first=True).inv() * Rotation.from_quat(
        other[6:10], scalar_first=True
    )
    return np.concatenate([other[:6] - x[:6], 4 * turn.as_mrp(), other[10:] - x[10:]])


def differences(function, steps):
    """Columns of the derivative of a function of the error state at zero."""
    return np.stack([(function(h) - function(-h)) / (2 * h.max()) for h in np.diag(steps)], axis=-1)


@pytest.mark.parametrize("seed", range(5))
def test_transition_is_the_derivative_of_a_step(seed):
    rng = np.random.default_rng(seed)
    x, f, w = some_state(rng), rng.uniform(-15, 15, 3), rng.uniform(-1, 1, 3)
    earth, dt = flat_earth(GRAVITY).as_array(), 0.01
    after = reference_mekf.strapdown_step(x, f, w, dt, earth)[0]
    found = differences(
        lambda e: between(after, reference_mekf.strapdown_step(shifted(x, e), f, w, dt, earth)[0]),
        np.full(15, 1e-4),
    )
    Phi = reference_mekf.transition(x, f, w, dt, earth, (1.0, 1.0))
    # What a gyro bias does within one step is taken to first order of the angle turned in it.
    assert np.abs(found - Phi)[:, :12].max() < 1e-7
    assert np.abs(found - Phi)[:, 12:].max() < 2 * dt * dt
    assert np.abs(Phi - np.eye(15)).max() > 0.05


@pytest.mark.parametrize("kind", [kernels.POSITION, kernels.VELOCITY])
@pytest.mark.parametrize("seed", range(3))
def test_measurement_jacobians_are_derivatives_of_the_innovation(kind, seed):
    rng = np.random.default_rng(seed)
    x, w, value, lever = some_state(rng), rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3), rng.uniform(-2, 2, 3)
    y, H = reference_mekf.predict_measurement(kind, x, w, value, lever)
    found = differences(
        lambda e: -reference_mekf.predict_measurement(kind, shifted(x, e), w, value, lever)[0],
        np.full(15, 1e-4),
    )
    assert np.abs(found - H).max() < 1e-6
    compiled_y, compiled_H = np.zeros(3), np.zeros((3, 15))
    kernels.predict_measurement(kind, x, w, value, lever, np.empty((3, 3)), compiled_y, compiled_H)
    assert np.abs(compiled_y - y).max() < 1e-12
    assert np.abs(compiled_H - H).max() < 1e-12


@pytest.fixture(scope="module")
def flight():
    return fly()


def spoilt(flight, seed, **options):
    rng = np.random.default_rng(seed)
    imu, biases = spoil(flight, rng)
    return imu, begin(flight, biases, rng), fixes(flight, rng, **options), biases


@pytest.mark.slow
def test_compiled_and_plain_agree(flight):
    """With every kind of measurement, a gap, an outage that the gate must forgive, and the turning Earth."""
    imu, start, antennas, _ = spoilt(flight, 0, every=50)
    short = imu.times < 40
    keep = short & ~((imu.times > 20.0) & (imu.times < 21.3))
    imu = ImuSamples(*(part[keep] for part in imu))
    rng = np.random.default_rng(1)
    t = np.arange(1.0, 39, 0.7)
    later = np.where(antennas[0].times > 30, 2.0, 0)[:, None]
    jumped = [antenna._replace(value=antenna.value + later) for antenna in antennas]
    aiding = [
        *jumped,
        velocities(t, moved(t - 0.1)[0], 0.5, LEVERS[0], latency=0.1),
        standstill([3.0, 7.0], 30.0),
    ]
    earth = local_earth(0.9, 100.0)
    wanted = np.sort(np.concatenate([[12.3456, 20.5], rng.uniform(0, 39, 40)]))
    outages = Outages(patience=3.0)
    found = run_mekf(imu, start, NOISE, earth, aiding, wanted, outages=outages)
    ready = prepare(imu, start, NOISE, aiding, wanted, 0.9999, outages)
    states, covariances, nis, verdicts = reference_mekf.mekf(ready, earth.as_array(), 3.0)
    known = np.isfinite(found.position).all(axis=1)
    assert known.sum() > 30
    assert not known[np.searchsorted(wanted, 20.5)]
    biases = [found.accelerometer_bias, found.gyro_bias]
    ours = np.hstack([found.position, found.velocity, found.quaternion, *biases])
    assert np.abs(ours - states)[known].max() < 1e-9
    scale = np.sqrt(np.einsum("kii,kjj->kij", covariances, covariances))
    assert (np.abs(found.covariance - covariances) / scale)[known].max() < 1e-9
    assert np.allclose(found.innovations.nis, nis, rtol=1e-7)
    assert np.array_equal(found.innovations.verdict, verdicts)
    assert {REJECTED, ACCEPTED, FORCED} == set(verdicts)


def errors_of(found, motion, rows):
    """Position, velocity and attitude error (true less estimated), (K, 9)."""
    R = quaternion_to_matrix(found.quaternion)
    turn = matrix_to_rotation_vector(np.swapaxes(R, -1, -2) @ motion.R_nb[rows])
    return np.hstack([motion.position[rows] - found.position, motion.velocity[rows] - found.velocity, turn])


def nees_of(errors, covariance, block):
    return np.einsum(
        "ki,kij,kj->k", errors[:, block], np.linalg.inv(covariance[:, block, block]), errors[:, block]
    )


def test_two_antennas_give_the_pose(flight):
    imu, start, antennas, biases = spoilt(flight, 3)
    found = run_mekf(imu, start, NOISE, EARTH, antennas, flight.imu.times[::10])
    rows = np.arange(len(flight.imu.times))[::10]
    late = found.times > 60
    errors = errors_of(found, flight.motion, rows)[late]
    assert np.abs(errors).max(axis=0)[:3].max() < 0.08
    assert np.degrees(np.sqrt((errors[:, 6:] ** 2).mean(axis=0))).max() < 0.5
    assert (found.innovations.verdict == ACCEPTED).mean() > 0.998
    # Observed over turns, the gyros' bias comes out well below what was known of it at the start.
    assert np.abs(found.gyro_bias[-1] - biases[-1, 3:]).max() < 0.5 * NOISE.gyro_bias_sd


def test_an_outage_is_survived(flight):
    """The covariance grows without GNSS and falls after; nothing good is left out when it comes back."""
    imu, start, antennas, _ = spoilt(flight, 4, outage=(200.0, 260.0))
    found = run_mekf(imu, start, NOISE, EARTH, antennas, np.array([199.0, 220, 240, 259.9, 262.0, 300]))
    sd = np.sqrt(found.covariance[:, 0, 0])
    assert sd[0] < sd[1] < sd[2] < sd[3]
    assert sd[3] > 30 * sd[0]
    assert sd[4] < 3 * sd[0]
    assert sd[5] < 1.5 * sd[0]
    back = found.innovations.times > 260
    assert (found.innovations.verdict[back] == ACCEPTED).mean() > 0.99


def test_a_filter_too_sure_of_itself_is_not_locked_out(flight):
    """Told that its gyros are a hundred times better than they are, it drifts away in the outage."""
    imu, start, antennas, _ = spoilt(flight, 5, outage=(100.0, 160.0))
    sure = ImuNoise(NOISE[0] / 100, NOISE[1] / 100, 1e-4, np.inf, 1e-7, np.inf)
    tight = start._replace(covariance=start.covariance * 1e-4)
    found = run_mekf(imu, tight, sure, EARTH, antennas, [330.0 - 0.02], outages=Outages(patience=2.0))
    verdict = found.innovations.verdict
    assert (verdict == REJECTED).sum() > 5
    assert (verdict == FORCED).sum() >= 1
    assert np.linalg.norm(found.position[0] - flight.motion.position[-2]) < 5.0
    never = run_mekf(imu, tight, sure, EARTH, antennas, [330.0 - 0.02], outages=Outages(patience=np.inf))
    assert np.linalg.norm(never.position[0] - flight.motion.position[-2]) > 50.0


def test_outliers_are_left_out_and_counted(flight):
    imu, start, antennas, _ = spoilt(flight, 6)
    bad = np.arange(200, len(antennas[0].times), 97)
    antennas[0].value[bad] += 3.0
    found = run_mekf(imu, start, NOISE, EARTH, antennas, flight.imu.times[6000::10])
    rejected = found.innovations.times[
        (found.innovations.verdict == REJECTED) & (found.innovations.source == 0)
    ]
    assert set(np.round(antennas[0].times[bad], 6)) <= set(np.round(rejected, 6))
    assert len(rejected) <= len(bad) + 2
    error = found.position - flight.motion.position[6000::10]
    assert np.abs(error).max() < 0.1


def test_a_gap_is_said_and_crossed_with_doubt(flight):
    imu, start, antennas, _ = spoilt(flight, 7)
    keep = ~((imu.times > 100) & (imu.times < 102))
    gappy = ImuSamples(*(part[keep] for part in imu))
    wanted = np.array([99.0, 101.0, 102.0, 110.0, 150.0])
    found = run_mekf(gappy, start, NOISE, EARTH, antennas, wanted)
    assert len(found.gaps) == 1
    assert found.gaps[0].end == pytest.approx(102.0)
    assert np.isnan(found.position[1]).all()
    turn = np.sqrt(np.trace(found.covariance[:, 6:9, 6:9], axis1=1, axis2=2))
    assert turn[2] > 20 * turn[0]
    assert turn[4] < 2 * turn[0]
    rows = np.searchsorted(flight.imu.times, wanted - 1e-6)
    quaternion = np.where(np.isnan(found.quaternion), 0.5, found.quaternion)
    errors = errors_of(found._replace(quaternion=quaternion), flight.motion, rows)[2:]
    spread = np.sqrt(np.einsum("kii->ki", found.covariance[2:, :9, :9]))
    assert (np.abs(errors) < 5 * spread).all()


def test_latency_puts_a_fix_where_it_belongs(flight):
    imu, start, antennas, _ = spoilt(flight, 8)
    late = [a._replace(times=a.times + 0.25) for a in antennas]
    again = [
        positions(a.times, a.value, GNSS_SD, lever, latency=0.25)
        for a, lever in zip(late, LEVERS, strict=True)
    ]
    wanted = flight.imu.times[8000::50]
    known = run_mekf(imu, start, NOISE, EARTH, again, wanted)
    assert np.abs(known.position - flight.motion.position[8000::50]).max() < 0.1
    ignored = run_mekf(imu, start, NOISE, EARTH, late, wanted, gate_probability=1.0)
    assert np.median(np.linalg.norm(ignored.position - flight.motion.position[8000::50], axis=1)) > 3.0


def test_wanted_times_may_repeat_lie_outside_or_be_unknown(flight):
    imu, start, antennas, _ = spoilt(flight, 12)
    wanted = np.array([50.0, np.nan, 10.0, 50.0, -3.0, 1000.0])
    found = run_mekf(imu, start, NOISE, EARTH, antennas, wanted)
    assert np.array_equal(found.times, wanted, equal_nan=True)
    assert np.isfinite(found.position[[0, 2, 3]]).all()
    assert np.array_equal(found.position[0], found.position[3])
    assert np.isnan(found.position[[1, 4, 5]]).all()
    assert pose_covariance(found.covariance).shape == (6, 6, 6)
    alone = run_mekf(imu, start, NOISE, EARTH, antennas, [10.0])
    assert np.allclose(alone.position[0], found.position[2], atol=1e-12)


PHASES = {"straight": (60, 90), "turn": (90, 130), "outage": (200, 260), "recovered": (262, 330)}


@pytest.mark.slow
def test_consistent_over_fifty_flights(flight):
    """NEES over its degrees of freedom is 1 for an ideal filter, in every part of the flight."""
    rows = np.arange(6000, len(flight.imu.times), 50)
    times = flight.imu.times[rows]
    nees, nis = [], []
    for seed in range(50):
        imu, start, antennas, _ = spoilt(flight, 1000 + seed, outage=(200.0, 260.0))
        found = run_mekf(imu, start, NOISE, EARTH, antennas, times, gate_probability=1.0)
        errors = errors_of(found, flight.motion, rows)
        nees.append([nees_of(errors, found.covariance, slice(a, a + 3)) / 3 for a in (0, 3, 6)])
        nis.append(found.innovations.nis[found.innovations.times > 60].mean() / 3)
    mean = np.mean(nees, axis=0)
    for phase, (begin_s, end_s) in PHASES.items():
        part = (times >= begin_s) & (times < end_s)
        for name, value in zip(("position", "velocity", "attitude"), mean[:, part].mean(axis=1), strict=True):
            assert 0.7 < value < 1.4, (phase, name)
    assert np.mean(nis) == pytest.approx(1.0, abs=0.03)


def test_standing_still_holds_the_velocity():
    times = np.arange(0, 60, 0.02)
    rng = np.random.default_rng(11)
    imu = ImuSamples(
        times,
        np.array([0, 0, -GRAVITY]) + 0.02 * rng.standard_normal((len(times), 3)),
        0.001 * rng.standard_normal((len(times), 3)),
    )
    start = InitialState(0.0, np.concatenate([np.zeros(6), [1.0], np.zeros(9)]), np.diag(START_SD**2))
    held = run_mekf(imu, start, NOISE, EARTH, [standstill(np.arange(1, 60, 1.0), 0.01)], [59.9])
    free = run_mekf(imu, start, NOISE, EARTH, [], [59.9])
    assert np.abs(held.velocity).max() < 0.02
    assert np.sqrt(held.covariance[0, 3, 3]) < 0.02 < np.sqrt(free.covariance[0, 3, 3])


@pytest.mark.parametrize("seed", range(6))
def test_a_correction_is_the_plain_one(seed):
    """Random covariances and measurements, with and without errors of the axes."""
    rng = np.random.default_rng(seed)
    axes = bool(seed % 2)
    n = kernels.N_ERRORS + axes * kernels.N_AXES + 3 * (seed % 3)
    A = rng.normal(size=(n, n))
    P, x, H, y = A @ A.T / n + 1e-3 * np.eye(n), rng.normal(size=n + 1), np.zeros((3, n)), np.zeros(3)
    x[6:10] /= np.linalg.norm(x[6:10])
    columns = rng.choice(n, rng.integers(1, n + 1), replace=False)
    H[:, columns], y[:] = rng.normal(size=(3, len(columns))), 0.3 * rng.normal(size=3)
    R = rng.uniform(0.1, 2.0, 3)
    expected, covariance = reference_mekf.correct(x.copy(), P.copy(), H, y, np.diag(R), axes)
    used = kernels.columns_of(H)
    assert sorted(used) == sorted(columns)
    HP, inverse = H @ P, np.full((3, 3), np.nan)
    kernels.invert(H @ HP.T + np.diag(R), inverse)
    K, M, work = np.full((3, n), np.nan), np.full((n, n), np.nan), np.full((3, 4), np.nan)
    kernels.correct(x, P, H, used, y, R, axes, inverse, HP, K, M, work)
    x[6:10] *= np.sign(x[6:10] @ expected[6:10])
    assert np.allclose(x, expected, rtol=1e-10, atol=1e-12)
    assert np.allclose(P, covariance, rtol=1e-10, atol=1e-11) and np.array_equal(P, P.T)
    if axes:
        dense = slice(kernels.N_ERRORS, kernels.N_ERRORS + kernels.N_AXES)
        assert np.array_equal(K[:, dense], np.zeros((3, kernels.N_AXES))), "considered, not estimated"
