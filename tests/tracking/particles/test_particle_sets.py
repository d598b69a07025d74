"""Many animals image after image: who is seen, lost, found again, and how many there are."""

import numpy as np
import pytest

from tests.tracking.particles.worlds import NOISE, RULES, SIZE, WALK, inside, world
from wildlab.errors import WildlabError
from wildlab.evaluation import share_interval
from wildlab.geometry.validation import gate_threshold
from wildlab.tracking import kalman
from wildlab.tracking.particles import (
    ImageLook,
    count_interval,
    count_probabilities,
    effective_size,
    existence_after,
    expect,
    grid_over,
    moments,
    move,
    no_herd,
    step_counting,
    step_nearest,
    walk_matrix,
)

R = NOISE**2 * np.eye(2)


def free(cloud, seen, dt, rng):
    return move(cloud, WALK, dt, rng)


def everywhere(probability):
    """To be detected as probably in all places."""
    return lambda places: np.full(places.shape[:-1], probability)


def begun(step, rules, rng, **more):
    """No herd, or three animals that nobody has seen."""
    return (
        no_herd(rules) if step is step_nearest else expect(rules, 3.0, inside, np.zeros(2), SIZE, rng, **more)
    )


def look(time, *z, sight=lambda p: np.zeros(p.shape[:-1]), clutter=0.0, noise=R):
    return ImageLook(
        time, np.reshape(z, (-1, 2)).astype(float), np.tile(noise, (len(z), 1, 1)), sight, clutter
    )


@pytest.mark.parametrize("step", [step_nearest, step_counting])
def test_one_animal_and_nothing_else_is_the_single_filter(step, rng):
    """A detection in each image, none false: the Kalman filter's, within the error of the particles."""
    rules = RULES._replace(moves=free, particles=20_000)
    sight = everywhere(0.9)
    at, x, P = np.array([60.0, 45.0]), None, None
    herd = no_herd(rules) if step is step_nearest else expect(rules, 1.0, inside, np.zeros(2), SIZE, rng)
    for k in range(8):
        at = at + rng.standard_normal(2) * np.sqrt(WALK(4.0)[1][0, 0])
        z = at + NOISE * rng.standard_normal(2)
        herd, taken = step(herd, look(4.0 * k, z, sight=sight), rules, rng)
        if x is None:
            x, P = z, R
        else:
            x, P, *_ = kalman.update(*kalman.predict(x, P, *WALK(4.0)), z, np.eye(2), R)
        assert taken.tolist() == [1] and herd.identity.tolist() == [1]
        mean, covariance = moments(herd.cloud)
        assert np.abs(mean[0] - x).max() < 6 * np.sqrt(P[0, 0] / 5000)
        np.testing.assert_allclose(covariance[0], P, atol=0.1)
    assert herd.existence[0] > 0.99999 if step is step_counting else herd.existence[0] == 1


def test_who_is_not_where_it_should_be_is_less_and_less_there():
    """An animal at rest that images cannot miss but by the detector: the rule of Bayes, image by image."""
    rng = np.random.default_rng(5)
    rules = RULES._replace(moves=lambda cloud, seen, dt, rng: cloud)
    sight = everywhere(0.6)
    herd = expect(rules, 3.0, inside, np.zeros(2), SIZE, rng, particles=200_000)
    clutter = 1e-4
    herd, _ = step_counting(herd, look(0.0, [60.0, 45.0], sight=sight, clutter=clutter), rules, rng)
    # Three animals in the enclosure's area, those seen of a detector that sees 0.6.
    new = 0.6 * 3 / np.prod(SIZE)
    r = new / (new + clutter)
    assert np.isclose(herd.existence[0], r, rtol=0.05)
    assert np.isclose(herd.expected_unseen, 3 * 0.4)
    r = herd.existence[0]
    for k in range(1, 4):
        herd, _ = step_counting(herd, look(float(k), sight=sight, clutter=clutter), rules, rng)
        r = existence_after(r, 0.4)
        assert np.isclose(herd.existence[0], r) and np.isclose(herd.missed[0], 0.4**k)
        assert np.isclose(herd.expected_unseen, 3 * 0.4 ** (k + 1))
    for k in range(4, 20):
        herd, _ = step_counting(herd, look(float(k), sight=sight, clutter=clutter), rules, rng)
    assert not len(herd.identity)


def test_one_detection_is_shared_out_among_all_it_may_be_of(rng):
    """A track's, an animal's that was never seen, or false: by hand, with normal densities."""
    rules = RULES._replace(moves=lambda cloud, seen, dt, rng: cloud, particles=40_000)
    sight, p, clutter = everywhere(0.6), 0.6, 2e-4
    herd = expect(rules, 5.0, inside, np.zeros(2), SIZE, rng, particles=200_000)
    herd, _ = step_counting(herd, look(0.0, [60.0, 45.0], sight=sight, clutter=clutter), rules, rng)
    r, u = herd.existence[0], herd.expected_unseen
    after, taken = step_counting(herd, look(1.0, [63.0, 45.0], sight=sight, clutter=clutter), rules, rng)
    g = np.exp(-0.5 * 9 / (2 * NOISE**2)) / (2 * np.pi * 2 * NOISE**2)  # track and detection both unsure
    new = p * u / np.prod(SIZE)
    assert taken.tolist() == [1]
    mine, others = r * p * g, (1 - r * p) * (new + clutter)
    assert np.isclose(
        after.expected_unseen, 0.4 * u + others / (mine + others) * new / (new + clutter), rtol=2e-3
    )
    seen = 1 - p + p * g / (new + clutter)
    assert np.isclose(after.existence[0], r * seen / (1 - r + r * seen), rtol=0.01)


def test_those_never_seen_are_the_exact_grid(rng):
    """No detection at all: where animals may still be, and how many, by the matrix of moves."""
    herd = expect(RULES, 8.0, inside, np.zeros(2), SIZE, rng, particles=30_000)
    grid = grid_over(inside, [0, 0], SIZE, 2.0)
    T, intensity = walk_matrix(grid, 0.5, 4.0), np.full(len(grid.places), 8.0 / len(grid.places))
    for k, one in enumerate(world(rng, 0, images=12, clutter=0.0)):
        herd, _ = step_counting(herd, one, RULES, rng)
        intensity = (T @ intensity if k else intensity) * (1 - one.sight(grid.places))
    # The error of a share of 30 000 particles, and that of cells of 2 m at the edges of the images.
    assert abs(herd.expected_unseen / intensity.sum() - 1) < 0.03
    mean, _ = moments(herd.unseen)
    assert np.abs(mean[0] - intensity @ grid.places / intensity.sum()).max() < 1.0


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


@pytest.mark.parametrize("step", [step_nearest, step_counting])
def test_nothing_at_all_and_very_much(step, rng):
    rules = RULES._replace(particles=50)
    herd, taken = step(begun(step, rules, rng, particles=400), look(0.0), rules, rng)
    assert not len(taken) and not len(herd.identity)
    crowd = rng.uniform(0, SIZE, (1000, 2))
    sight = everywhere(0.5)
    for k in range(2):
        herd, taken = step(herd, look(float(k), *crowd, sight=sight, clutter=0.05), rules, rng)
        assert len(taken) == 1000 and len(set(herd.identity.tolist())) == len(herd.identity)
        assert (herd.existence <= 1).all()
        np.testing.assert_allclose(herd.cloud.w.sum(axis=1), 1)


@pytest.mark.parametrize("step", [step_nearest, step_counting])
def test_a_ray_that_met_no_ground_keeps_its_place_and_nothing_else(step, rng):
    sight = everywhere(0.5)
    start = begun(step, RULES, rng)
    gaps = look(0.0, [np.nan, np.nan], [50.0, 40.0], [90.0, 70.0], sight=sight, clutter=1e-6)
    gaps.R[2] = np.nan
    herd, taken = step(start, gaps, RULES, np.random.default_rng(1))
    alone = look(0.0, [50.0, 40.0], sight=sight, clutter=1e-6)
    wanted, _ = step(start, alone, RULES, np.random.default_rng(1))
    assert taken.tolist() == [0, 1, 0]
    np.testing.assert_array_equal(herd.cloud.x, wanted.cloud.x)
    np.testing.assert_array_equal(herd.existence, wanted.existence)


def test_a_detection_that_can_only_be_false_starts_nothing(rng):
    """Nobody is left to be found, or nobody can be seen there."""
    sight = everywhere(0.9)
    none = expect(RULES, 0.0, inside, np.zeros(2), SIZE, rng)
    herd, taken = step_counting(none, look(0.0, [50.0, 40.0], sight=sight, clutter=1e-5), RULES, rng)
    assert taken.tolist() == [0] and not len(herd.identity)
    blind = expect(RULES, 5.0, inside, np.zeros(2), SIZE, rng)
    herd, taken = step_counting(blind, look(0.0, [50.0, 40.0], clutter=1e-5), RULES, rng)
    assert taken.tolist() == [0] and np.isclose(herd.expected_unseen, 5.0)


@pytest.mark.parametrize("step", [step_nearest, step_counting])
def test_time_does_not_go_back_and_a_step_leaves_what_was_known_alone(step, rng):
    herd, _ = step(begun(step, RULES, rng), look(5.0, [50.0, 40.0], clutter=1e-5), RULES, rng)
    kept = herd.cloud.x.copy(), herd.cloud.w.copy()
    step(herd, look(5.0, [50.0, 41.0], clutter=1e-5), RULES, rng)
    step(herd, look(5.0, [90.0, 41.0], clutter=1e-5), RULES, rng)
    np.testing.assert_array_equal(kept[0], herd.cloud.x)
    np.testing.assert_array_equal(kept[1], herd.cloud.w)
    with pytest.raises(WildlabError, match="Sort"):
        step(herd, look(4.0), RULES, rng)


def test_a_number_below_zero_is_not_expected():
    with pytest.raises(WildlabError, match="zero or more"):
        expect(RULES, -1.0, inside, np.zeros(2), SIZE, np.random.default_rng())


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


WORLDS = 200


def held_exactly(p, number, probability):
    """How much of a number lies in the likeliest numbers that hold a probability to the last digit.

    Whole numbers cannot hold 90 % to the digit; the least likely one that is needed is let in
    for the part of it that is needed.
    """
    before = p[p > p[number]].sum()
    return float(np.clip((probability - before) / p[number], 0, 1))


def counted(images):
    """What the 90 % interval held, and the exact one; how probable it said that is; how far off its mean."""
    held, exact, said, off = [], [], [], []
    for seed in range(WORLDS):
        rng = np.random.default_rng([seed, 2024])
        animals = int(rng.poisson(12))
        looks = world(rng, animals, images=images)
        herd = expect(RULES, 12.0, inside, np.zeros(2), SIZE, rng, particles=3000)
        for look in looks:
            herd, _ = step_counting(herd, look, RULES, rng)
        p = count_probabilities(herd.existence, herd.expected_unseen)
        count = count_interval(p, 0.9)
        exact.append(held_exactly(p, animals, 0.9) if animals < len(p) else 0.0)
        held.append(count.low <= animals <= count.high)
        said.append(count.probability)
        off.append(count.mean - animals)
    return np.array(held), np.array(exact), np.array(said), np.array(off)


@pytest.mark.slow
def test_counts_hold_what_they_promise():
    held, exact, said, off = counted(15)
    # Shares of at most one with a mean of 0.9 have a deviation of 0.3 at most.
    assert abs(exact.mean() - 0.9) < 2.5 * 0.3 / np.sqrt(WORLDS)
    between = share_interval(held.sum(), WORLDS, 0.99)
    assert between.low <= said.mean() <= between.high
    assert abs(off.mean()) < 3 * off.std(ddof=1) / np.sqrt(WORLDS)
