"""Animals tracked through images: who is seen, lost and found again, and what is left out changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.planning.ground import FLAT
from wildlab.analysis.animal_images import (
    Detector,
    Images,
    sight_from,
    take_images,
)
from wildlab.analysis.animal_trackers import (
    Aircraft,
    ImageScan,
    KalmanTracker,
    Ledger,
    ParticleTracker,
    Patrolled,
    Visits,
    blind,
    next_scan,
    patrol,
    track_animals,
)
from wildlab.analysis.plan_coverage import ExecutionErrors
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN, CameraPoses
from wildlab.geometry.covariances import gate_threshold
from wildlab.geometry.frames import Array, euler_to_matrix
from wildlab.planning.coverage import walks
from wildlab.planning.gimbal import look_down
from wildlab.planning.patterns import contains, rectangle
from wildlab.planning.planner import SEARCH
from wildlab.tracking import kalman
from wildlab.tracking.particles import effective_size, walk_of

CAMERA = Camera(640, 480, 1267.0, 1117.0, 356.0, 216.6)
DETECTOR = Detector(detected=0.9, sd=1.0, border=0.0, height=0.7)
ERRORS = ExecutionErrors(0.2, 0.2, 300.0, 0.002, 0.002, 0.005, 60.0)
FENCE = rectangle(0.0, 0.0, 200.0, 160.0, 0.0)


def nowhere(places: Array) -> Array:
    """What an image shows that shows nothing."""
    return np.zeros(places.shape[:-1])


def over_and_over(seed: int, speed_sd: float, seconds: float = 300.0) -> Images:
    """A camera 50 m up that goes back and forth over a field with eight animals."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 0.5)
    p = np.column_stack([90 * np.sin(times / 15), 60 * np.sin(times / 47), np.full(len(times), -50.0)])
    R = np.tile(euler_to_matrix(0.0, 0.0, 0.0) @ R_MC_DOWN, (len(times), 1, 1))
    told = CameraPoses.at_lens(CAMERA, p, R, np.eye(3))
    truth = np.swapaxes(walks(FENCE, times, 8, speed_sd, 1.0, rng), 0, 1)
    return take_images(FLAT, told, told, np.zeros(len(times)), times, truth, ERRORS, DETECTOR, rng)


def particles(seed: int, speed_sd: float, fence: Array | None = FENCE, **more: Any) -> ParticleTracker:
    fences = [] if fence is None else [partial(contains, fence)]
    rng = np.random.default_rng(seed)
    return ParticleTracker(walk_of(speed_sd, 1.0), fences, rng, **{"particles": 300} | more)


def test_images_that_are_left_out_show_no_particle():
    images = over_and_over(1, 0.0)
    tracker, clouds = particles(1, 0.0), list[tuple[float, Array]]()

    class Spied:
        """Keeps where the particles were after each image."""

        known, reach = tracker.known, tracker.reach

        def step(self, scan: ImageScan) -> np.ndarray:
            names = tracker.step(scan)
            clouds.append((scan.time, tracker.cloud.x.reshape(-1, 2).copy()))
            return names

    track_animals(images, FLAT, DETECTOR, Spied(), walk_of(0.0, 1.0))
    looked = np.array([time for time, _ in clouds])
    left_out = np.flatnonzero(~np.isin(images.times, looked))
    assert len(left_out) > 50
    asked = 0
    for k in left_out:
        # Nothing moves: the particles are where the image before has left them.
        places = clouds[int(np.searchsorted(looked, images.times[k], side="right")) - 1][1]
        p, R = images.poses.p_nc[k], images.poses.R_nc[k]
        sight = sight_from(FLAT, CAMERA, p, R, DETECTOR)
        assert not sight(places).any()
        asked += len(places)
    assert asked > 10_000


def test_a_kalman_track_is_the_textbooks():
    tracker, motion = KalmanTracker(walk_of(0.5, 1.0), 0.99), walk_of(0.5, 1.0)
    first, second = np.array([[3.0, 4.0]]), np.array([[5.0, 4.5]])
    R = np.array([[[4.0, 1.0], [1.0, 2.0]]])
    tracker.step(ImageScan(0.0, first, R, nowhere))
    assert tracker.step(ImageScan(10.0, second, R, nowhere)).tolist() == [1]
    P = R[0] + motion(10.0)[1]
    # In the form of information: precisions add.
    after = np.linalg.inv(np.linalg.inv(P) + np.linalg.inv(R[0]))
    mean = after @ (np.linalg.solve(P, first[0]) + np.linalg.solve(R[0], second[0]))
    _, got, covariance = tracker.known()
    assert got[0] == pytest.approx(mean) and covariance[0] == pytest.approx(after)
    assert tracker.step(
        ImageScan(11.0, np.array([[90.0, 0.0], [np.nan, 0.0]]), np.tile(R, (2, 1, 1)), nowhere)
    ).tolist() == [2, 0]


def test_no_particle_leaves_the_fence_it_began_in():
    cloud = particles(7, 2.0)
    scan = ImageScan(0.0, np.array([[70.0, 60.0]]), np.eye(2)[None], nowhere)
    cloud.step(scan)
    cloud.step(blind(900.0))
    assert cloud.home.tolist() == [0]
    assert contains(FENCE, cloud.cloud.x).all()
    assert np.ptp(cloud.cloud.x[..., 0]) > 100
    cloud.give_up(1)
    assert cloud.lost.tolist() == [True]


def test_negative_information_moves_a_track_out_of_what_was_seen():
    cloud = particles(8, 0.5)
    whole = ImageScan(0.0, np.array([[0.0, 0.0]]), 25 * np.eye(2)[None], nowhere)
    cloud.step(whole)

    def west(places: Array) -> Array:
        return 0.9 * (places[..., 1] < 0)

    cloud.step(ImageScan(1.0, np.zeros((0, 2)), np.zeros((0, 2, 2)), west))
    _, mean, _ = cloud.known()
    # Half a normal distribution at 10 % of its weight: the mean is 0.8 sd times 9/11.
    assert mean[0, 1] == pytest.approx(np.sqrt(2 / np.pi) * np.sqrt(25.25) * 9 / 11, rel=0.2)


class Scripted:
    """A tracker with these traces before and after an image, to whose detections it gives these tracks."""

    def __init__(self, names: list[int], *traces: dict[int, float]) -> None:
        self.names, self.traces = np.array(names), list(traces)

    def step(self, scan: ImageScan) -> np.ndarray:
        self.now = self.traces.pop(0)
        return self.names

    def known(self) -> tuple[np.ndarray, Array, Array]:
        covariances = np.reshape(list(self.now.values()), (-1, 1, 1)) / 2 * np.eye(2)
        return np.array(list(self.now), np.int64), np.zeros((len(self.now), 2)), covariances


def test_a_ledger_knows_who_got_which_track_and_takes_a_false_detection_for_no_animal():
    ledger = Ledger(3)
    ledger.take(0, Scripted([1, 2, 3], {}, {1: 4.0, 2: 6.0, 3: 8.0}), blind(0.0), np.arange(3))
    for image, time in ((1, 10.0), (2, 50.0)):
        ledger.take(image, Scripted([4], {3: 8.0}, {3: 8.0, 4: 9.0}), blind(time), np.array([-1]))
    before = {1: 50.0, 2: 60.0, 3: 7.0}
    tracker = Scripted([1, 3, 0], before, {1: 5.0, 2: 60.0, 3: 4.0})
    ledger.take(9, tracker, blind(90.0), np.array([1, 2, 0]))
    first, _, _, false, again, third, last = ledger.found
    assert first.away == np.inf and first.own == 0 and np.isnan(first.before)
    assert (third.animal, third.track, third.own, third.away) == (1, 1, 2, 90.0)
    assert (third.before, third.after, third.after_last, third.own_before) == (50.0, 5.0, 4.0, 60.0)
    assert (false.animal, false.own, false.away) == (-1, 0, np.inf)
    assert np.isnan(false.own_before) and again.away == np.inf and again.own == 0
    # The last animal's own track and time are not those of the detections that are nobody's.
    assert (last.own, last.away, last.own_before) == (3, 90.0, 7.0)


class Told:
    """A tracker with one track at the origin, whose animal is within 5 m of it."""

    def step(self, scan: ImageScan) -> np.ndarray:
        return np.zeros(0, np.int64)

    def known(self) -> tuple[np.ndarray, Array, Array]:
        return np.array([1]), np.zeros((1, 2)), np.eye(2)[None]

    def reach(self) -> Array:
        return np.array([5.0])


@pytest.mark.parametrize(
    ("away", "motion", "told"),
    [(14.0, 0.0, True), (16.0, 0.0, False), (18.0, 0.5, True), (22.0, 0.5, False)],
)
def test_an_image_is_looked_at_where_an_animal_may_be_in_it(away, motion, told):
    # A footprint of 10 m; an animal within 5 m of its track, which strays by 0.5 m in a second, four of it in
    # the four seconds up to the station.
    times = np.arange(6.0)
    middle = np.full((6, 2), 500.0)
    middle[3] = [away, 0.0]
    wanted = np.zeros(6, bool)
    wanted[4] = True
    found = next_scan(Told(), 0, times, middle, np.full(6, 10.0), wanted, walk_of(motion, 1.0))
    assert found == ((3, True) if told else (4, False))


# -- who is seen, lost and found again

WALK = walk_of(0.5, 1.0)
R = 4.0 * np.eye(2)
#: A detection that is sharper than the cloud about it, and a tracker that has few particles for it.
SMALL = 0.04 * np.eye(2)
SPARSE = {"particles": 500, "gate_probability": 0.999}


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def everywhere(probability: float) -> Callable[[Array], Array]:
    """To be detected as probably in all places."""
    return lambda places: np.full(places.shape[:-1], probability)


def scan(time: float, *z: Any, sight: Callable[[Array], Array] = nowhere, noise: Array = R) -> ImageScan:
    return ImageScan(time, np.reshape(z, (-1, 2)).astype(float), np.tile(noise, (len(z), 1, 1)), sight)


def test_one_animal_and_nothing_else_is_the_single_filter(rng: np.random.Generator):
    """A detection in each image, none false: the Kalman filter's, within the error of the particles."""
    tracker = particles(1, 0.5, None, particles=20_000)
    at, x, P = np.array([60.0, 45.0]), None, None
    for k in range(8):
        at = at + rng.standard_normal(2) * np.sqrt(WALK(4.0)[1][0, 0])
        z = at + 2.0 * rng.standard_normal(2)
        taken = tracker.step(scan(4.0 * k, z, sight=everywhere(0.9)))
        if x is None:
            x, P = z, R
        else:
            x, P, *_ = kalman.update(*kalman.predict(x, P, *WALK(4.0)), z, np.eye(2), R)
        names, mean, covariance = tracker.known()
        assert taken.tolist() == [1] and names.tolist() == [1]
        assert np.abs(mean[0] - x).max() < 6 * np.sqrt(P[0, 0] / 5000)
        np.testing.assert_allclose(covariance[0], P, atol=0.1)


@pytest.mark.parametrize(("share", "name"), [(0.9, 1), (1.1, 2)])
def test_a_lost_one_is_found_in_its_gate_alone_under_the_same_name(share, name):
    tracker = particles(3, 0.5)
    tracker.step(scan(0.0, [50.0, 40.0]))
    tracker.step(scan(80.0))
    tracker.give_up(1)
    # At the time of that image it does not move: squared distances are those to the cloud as it is.
    _, mean, covariance = tracker.known()
    away = np.sqrt(share * gate_threshold(0.99, 2)) * np.linalg.cholesky(covariance[0] + R)[:, 0]
    assert tracker.step(scan(80.0, mean[0] + away)).tolist() == [name]
    assert tracker.lost.tolist() == [False] if name == 1 else [True, False]
    assert tracker.seen_now(name)


def test_without_negative_information_an_empty_image_says_nothing():
    half = lambda p: np.where(p[..., 0] > 50, 1.0, 0.0)  # noqa: E731
    given, quiet = (particles(1, 0.5, negative=negative) for negative in (True, False))
    for one in (given, quiet):
        one.step(scan(0.0, [50.0, 40.0]))
    before = quiet.cloud.w.copy()
    for one in (given, quiet):
        one.step(scan(0.0, sight=half))
    assert (given.cloud.x[0, :, 0][given.cloud.w[0] > 0] <= 50).all()
    np.testing.assert_allclose(quiet.cloud.w, before, rtol=1e-12)


def test_nothing_at_all_and_very_much(rng: np.random.Generator):
    tracker = particles(1, 0.5, particles=50)
    assert not len(tracker.step(scan(0.0))) and not len(tracker.known()[0])
    crowd = rng.uniform(0, [120.0, 90.0], (1000, 2))
    for k in range(2):
        assert len(tracker.step(scan(float(k), *crowd, sight=everywhere(0.5)))) == 1000
        np.testing.assert_allclose(tracker.cloud.w.sum(axis=1), 1)


def test_a_ray_that_met_no_ground_keeps_its_place_and_nothing_else():
    gaps = scan(0.0, [np.nan, np.nan], [50.0, 40.0], [90.0, 70.0])
    gaps.R[2] = np.nan
    tracker, other = particles(1, 0.5), particles(1, 0.5)
    assert tracker.step(gaps).tolist() == [0, 1, 0]
    other.step(scan(0.0, [50.0, 40.0]))
    np.testing.assert_array_equal(tracker.cloud.x, other.cloud.x)


def test_it_is_what_a_kalman_filter_would_have():
    away, covariances, means = 20.0, [], []
    for seed in range(40):
        tracker = particles(seed, 0.5, None, **SPARSE)
        tracker.step(scan(0.0, [0.0, 0.0], noise=SMALL))
        # 1600 s later an animal may be 20 m off each way: of 500 particles hardly one is as near as 0.2 m.
        assert tracker.step(scan(1600.0, [away, 0.0], noise=SMALL)).tolist() == [1]
        _, mean, covariance = tracker.known()
        means.append(mean[0])
        covariances.append(covariance[0])
    gain = 400.04 / 400.08
    assert np.mean(means, axis=0) == pytest.approx([gain * away, 0.0], abs=0.1)
    assert np.mean(covariances, axis=0) == pytest.approx(gain * SMALL, abs=0.004)
    assert min(np.linalg.eigvalsh(one).min() for one in covariances) > 0.02


def test_a_handful_of_particles_is_not_taken_for_what_is_known():
    """Of n points drawn from a distribution the variance about their own mean is 1 - 1/n of its own.

    After 32 s an animal may be sqrt(8) m off: of 500 particles the detection leaves 2 * 500 * 0.04 / 8 = 5.
    """
    covariances = []
    for seed in range(60):
        tracker = particles(seed, 0.5, None, **SPARSE)
        for time in (0.0, 32.0):
            tracker.step(scan(time, [0.0, 0.0], noise=SMALL))
        covariances.append(tracker.known()[2][0])
    assert np.trace(np.mean(covariances, axis=0)) == pytest.approx(2 * 0.04 * 8.04 / 8.08, rel=0.05)


def test_a_cloud_with_particles_enough_stays_its_own():
    wide, tracker = 4.0 * np.eye(2), particles(1, 0.5, None, **SPARSE)
    tracker.step(scan(0.0, [0.0, 0.0], noise=wide))
    before = tracker.cloud.x.copy()
    tracker.step(scan(0.0, [1.0, 0.0], noise=wide))
    # No time has passed: what is left of it are its own particles.
    assert np.isin(tracker.cloud.x[0, :, 0], before[0, :, 0]).all()
    assert effective_size(tracker.cloud.w)[0] > 100


# -- a search that its tracks steer: rows alone, visits, animals that are not there any more

FIELD = rectangle(0.0, 0.0, 300.0, 300.0, 0.0)
AIRCRAFT = Aircraft(
    Camera(640, 480, 600.0, 600.0, 320.0, 240.0), look_down, 50.0, 5.0,
    ExecutionErrors(0.1, 0.1, 300.0, 0.001, 0.001, 0.001, 60.0), Detector(1.0, 1.0, 0.0, 0.7),
)  # fmt: skip
ROWS = np.array([[-100.0, -100.0], [100.0, -100.0], [100.0, 100.0], [-100.0, 100.0]])
TIMES = np.arange(0.0, 600.0)
VISITS = Visits(alpha=1.0, c=5.0, worth_m2=20.0, patience=10.0)


def flown(places: np.ndarray, visits: Visits, lives: int) -> Patrolled:
    """Animals that stand at places (A, 2), or walk where there are times."""
    truth = np.broadcast_to(places, (len(TIMES), *places.shape[-2:]))
    return patrol(
        FLAT, AIRCRAFT, ROWS, np.zeros(4, int), np.array([lives]), TIMES, truth, particles(1, 0.5, FIELD),
        visits, np.random.default_rng(2),
    )  # fmt: skip


def test_rows_alone_reach_every_way_point_and_end():
    done = flown(np.array([[0.0, -100.0]]), VISITS._replace(worth_m2=np.inf), lives=2)
    assert (done.goal == SEARCH).all()
    length = 600.0
    assert done.times[-1] == pytest.approx(length / AIRCRAFT.speed, abs=4)
    for point in ROWS:
        assert np.linalg.norm(done.p_nc[:, :2] - point, axis=1).min() < 1e-6
    assert done.p_nc[:, 2] == pytest.approx(-50.0)
    assert np.isinf(done.done).all() and not done.given_up


def test_a_choice_is_the_greatest_of_f_5_2():
    done = flown(np.array([[-60.0, -100.0]]), VISITS, lives=2)
    reached = 0
    for k in range(1, len(done.times)):
        known = done.known[k - 1]
        here = done.p_nc[k - 1, :2]
        while reached < 4 and np.linalg.norm(here - ROWS[reached]) < 1e-6 and done.goal[k - 1] == SEARCH:
            reached += 1
        if reached == 4:
            break
        spread = np.trace(known.covariance, axis1=1, axis2=2)
        worth = np.where(spread >= 20, spread / np.linalg.norm(known.mean - here, axis=1), 0.0)
        search = VISITS.c / np.linalg.norm(ROWS[reached] - here)
        assert (done.goal[k] != SEARCH) == bool(len(worth) and worth.max() > search)


def test_an_enclosure_with_all_its_animals_is_left():
    done = flown(np.array([[-60.0, -100.0], [40.0, -100.0]]), VISITS._replace(worth_m2=np.inf), lives=2)
    assert np.isfinite(done.done).all()
    assert done.times[-1] < done.done[0] + 2 and done.times[-1] < 60


def test_a_search_ends_once_its_patience_does():
    there = np.full((len(TIMES), 1, 2), [-60.0, -100.0])
    there[25:] = [140.0, 140.0]  # seen once, then across the field at once
    done = flown(there, VISITS, lives=3)
    first = int(np.flatnonzero(done.goal == 1)[0])
    ends = first + int(np.argmax(done.goal[first:] != 1))
    # On the way over a field of 300 m at 5 m/s, and then patience; images that miss it move where it may be.
    assert 1 in done.given_up and ends - first < 60 + VISITS.patience + 2
    assert ends < len(done.goal)  # and then flies on
