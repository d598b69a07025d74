"""Many animals image after image: who is seen, lost and found again."""

import numpy as np
import pytest

from tests.tracking.particles.worlds import NOISE, RULES, SIZE, WALK
from wildlab.geometry.covariances import gate_threshold
from wildlab.tracking import kalman
from wildlab.tracking.particles import (
    ImageLook,
    effective_size,
    moments,
    move,
    no_herd,
    step_nearest,
)

R = NOISE**2 * np.eye(2)


def free(cloud, seen, dt, rng):
    return move(cloud, WALK, dt, rng)


def everywhere(probability):
    """To be detected as probably in all places."""
    return lambda places: np.full(places.shape[:-1], probability)


def look(time, *z, sight=lambda p: np.zeros(p.shape[:-1]), noise=R):
    return ImageLook(time, np.reshape(z, (-1, 2)).astype(float), np.tile(noise, (len(z), 1, 1)), sight)


def test_one_animal_and_nothing_else_is_the_single_filter(rng):
    """A detection in each image, none false: the Kalman filter's, within the error of the particles."""
    rules = RULES._replace(moves=free, particles=20_000)
    sight = everywhere(0.9)
    at, x, P = np.array([60.0, 45.0]), None, None
    herd = no_herd(rules)
    for k in range(8):
        at = at + rng.standard_normal(2) * np.sqrt(WALK(4.0)[1][0, 0])
        z = at + NOISE * rng.standard_normal(2)
        herd, taken = step_nearest(herd, look(4.0 * k, z, sight=sight), rules, rng)
        if x is None:
            x, P = z, R
        else:
            x, P, *_ = kalman.update(*kalman.predict(x, P, *WALK(4.0)), z, np.eye(2), R)
        assert taken.tolist() == [1] and herd.identity.tolist() == [1]
        mean, covariance = moments(herd.cloud)
        assert np.abs(mean[0] - x).max() < 6 * np.sqrt(P[0, 0] / 5000)
        np.testing.assert_allclose(covariance[0], P, atol=0.1)


def test_both_lost_rules_and_found_again_under_the_same_name(rng):
    by_spread = RULES._replace(lost_trace=40.0)
    herd, _ = step_nearest(no_herd(RULES), look(0.0, [50.0, 40.0]), by_spread, rng)
    herd, _ = step_nearest(herd, look(20.0), by_spread, rng)  # 2 (4 + 0.25 * 20) = 18
    assert not herd.lost.any()
    herd, _ = step_nearest(herd, look(80.0), by_spread, rng)  # 48
    assert herd.lost.tolist() == [True]
    other, taken = step_nearest(herd, look(80.0, [110.0, 80.0]), by_spread, rng)
    assert taken.tolist() == [2] and other.lost.tolist() == [True, False]
    found, taken = step_nearest(herd, look(80.0, [55.0, 44.0]), by_spread, rng)
    assert taken.tolist() == [1] and not found.lost.any() and found.seen_at.tolist() == [80.0]

    by_search = RULES._replace(lost_doubt=0.05)
    herd, _ = step_nearest(no_herd(RULES), look(0.0, [50.0, 40.0]), by_search, rng)
    wide = everywhere(0.5)
    for k in range(1, 5):
        herd, _ = step_nearest(herd, look(float(k), sight=wide), by_search, rng)
        assert np.isclose(herd.missed[0], 0.5**k) and not herd.lost.any()
    herd, _ = step_nearest(herd, look(5.0, sight=wide), by_search, rng)
    assert herd.lost.tolist() == [True]
    herd, _ = step_nearest(herd, look(6.0, [50.0, 41.0], sight=wide), by_search, rng)
    assert herd.missed.tolist() == [1.0] and not herd.lost.any()


@pytest.mark.parametrize(("share", "name"), [(0.9, 1), (1.1, 2)])
def test_a_lost_one_is_found_in_its_gate_alone(share, name, rng):
    rules = RULES._replace(lost_trace=40.0)
    herd, _ = step_nearest(no_herd(rules), look(0.0, [50.0, 40.0]), rules, rng)
    herd, _ = step_nearest(herd, look(80.0), rules, rng)
    assert herd.lost.tolist() == [True]
    # At the time of that image it does not move: squared distances are those to the cloud as it is.
    mean, covariance = moments(herd.cloud)
    edge = np.sqrt(gate_threshold(rules.gate_probability, 2))
    off = np.sqrt(share) * edge * np.linalg.cholesky(covariance[0] + R)[:, 0]
    _, taken = step_nearest(herd, look(80.0, mean[0] + off), rules, rng)
    assert taken.tolist() == [name]


def test_without_negative_information_an_empty_image_says_nothing(rng):
    half = lambda p: np.where(p[..., 0] > 50, 1.0, 0.0)  # noqa: E731
    start, _ = step_nearest(no_herd(RULES), look(0.0, [50.0, 40.0]), RULES, rng)
    quiet = RULES._replace(negative=False)
    told, _ = step_nearest(start, look(0.0, sight=half), RULES, np.random.default_rng(1))
    untold, _ = step_nearest(start, look(0.0, sight=half), quiet, np.random.default_rng(1))
    assert (told.cloud.x[0, :, 0][told.cloud.w[0] > 0] <= 50).all()
    np.testing.assert_allclose(untold.cloud.w, start.cloud.w, rtol=1e-12)
    np.testing.assert_allclose(told.missed, untold.missed)


def test_nothing_at_all_and_very_much(rng):
    rules = RULES._replace(particles=50)
    herd, taken = step_nearest(no_herd(rules), look(0.0), rules, rng)
    assert not len(taken) and not len(herd.identity)
    crowd = rng.uniform(0, SIZE, (1000, 2))
    sight = everywhere(0.5)
    for k in range(2):
        herd, taken = step_nearest(herd, look(float(k), *crowd, sight=sight), rules, rng)
        assert len(taken) == 1000 and len(set(herd.identity.tolist())) == len(herd.identity)
        np.testing.assert_allclose(herd.cloud.w.sum(axis=1), 1)


def test_a_ray_that_met_no_ground_keeps_its_place_and_nothing_else(rng):
    sight = everywhere(0.5)
    start = no_herd(RULES)
    gaps = look(0.0, [np.nan, np.nan], [50.0, 40.0], [90.0, 70.0], sight=sight)
    gaps.R[2] = np.nan
    herd, taken = step_nearest(start, gaps, RULES, np.random.default_rng(1))
    alone = look(0.0, [50.0, 40.0], sight=sight)
    wanted, _ = step_nearest(start, alone, RULES, np.random.default_rng(1))
    assert taken.tolist() == [0, 1, 0]
    np.testing.assert_array_equal(herd.cloud.x, wanted.cloud.x)


#: A detection that is sharper than the cloud about it, and a rule that has few particles for it.
SMALL = 0.04 * np.eye(2)
SPARSE = RULES._replace(moves=free, particles=500, gate_probability=0.999)


def test_it_is_what_a_kalman_filter_would_have():
    off, covariances, means = 20.0, [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        herd, _ = step_nearest(no_herd(SPARSE), look(0.0, [0.0, 0.0], noise=SMALL), SPARSE, rng)
        # 1600 s later an animal may be 20 m off each way: of 500 particles hardly one is as near as 0.2 m.
        found = look(1600.0, [off, 0.0], noise=SMALL)
        herd, names = step_nearest(herd, found, SPARSE, rng)
        assert names.tolist() == [1]
        mean, covariance = moments(herd.cloud)
        means.append(mean[0])
        covariances.append(covariance[0])
    gain = 400.04 / 400.08
    assert np.mean(means, axis=0) == pytest.approx([gain * off, 0.0], abs=0.1)
    assert np.mean(covariances, axis=0) == pytest.approx(gain * SMALL, abs=0.004)
    assert min(np.linalg.eigvalsh(one).min() for one in covariances) > 0.02


def test_a_handful_of_particles_is_not_taken_for_what_is_known():
    """Of n points drawn from a distribution the variance about their own mean is 1 - 1/n of its own.

    After 32 s an animal may be sqrt(8) m off: of 500 particles the detection leaves 2 * 500 * 0.04 / 8 = 5.
    """
    covariances = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        herd, _ = step_nearest(no_herd(SPARSE), look(0.0, [0.0, 0.0], noise=SMALL), SPARSE, rng)
        herd, _ = step_nearest(herd, look(32.0, [0.0, 0.0], noise=SMALL), SPARSE, rng)
        covariances.append(moments(herd.cloud)[1][0])
    assert np.trace(np.mean(covariances, axis=0)) == pytest.approx(2 * 0.04 * 8.04 / 8.08, rel=0.05)


def test_a_cloud_with_particles_enough_stays_its_own(rng):
    wide = 4.0 * np.eye(2)
    herd, _ = step_nearest(no_herd(SPARSE), look(0.0, [0.0, 0.0], noise=wide), SPARSE, rng)
    before = herd.cloud.x.copy()
    herd, _ = step_nearest(herd, look(0.0, [1.0, 0.0], noise=wide), SPARSE, rng)
    # No time has passed: what is left of it are its own particles.
    assert np.isin(herd.cloud.x[0, :, 0], before[0, :, 0]).all()
    assert effective_size(herd.cloud.w)[0] > 100
