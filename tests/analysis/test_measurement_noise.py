"""Noise by the view against rays that err, and thinning by innovations against what is known to be new."""

from __future__ import annotations

import numpy as np
import pytest

from wildlab.analysis.pose_noise import (
    FRACTION,
    NOISES,
    VARIATIONS,
    follow_variations,
    interval_of_news,
    noise_by_altitude,
    noise_by_direction,
    noises_of,
    thinned,
)
from wildlab.analysis.tracks.sighting import CvTuning, Sighting, follow_positions
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel
from wildlab.geometry.mount import Mount
from wildlab.simulation.twins import simulate_twin

CAMERA = Camera(640, 512, 1159.2, 1167.8, 313.0, 265.0)
TUNING = CvTuning(0.05, 10.0, 10.0, 7.0, 20.0)


def looking(roll: float, pitch: float, uv: tuple[float, float], plane: float = -10.0) -> Sighting:
    """One frame from 210 m above the plane."""
    poses = CameraPoses(
        CAMERA, Mount("down"), np.array([[5.0, -3.0, -220.0]]), euler_to_matrix([roll], [pitch], [0.4])
    )
    pixel, planes = np.array([uv]), np.array([plane])
    ground = georeference_pixels(poses, pixel, planes)[:, :2]
    return Sighting(np.zeros(1), pixel, ground, poses, planes, np.full((1, 4), np.nan))


def test_noise_is_that_of_rays_that_err_by_an_angle():
    """Sampled: the ray is turned at random about axes across it, and meets the plane elsewhere."""
    rng = np.random.default_rng(3)
    ray, height, angle = np.array([0.5, -0.3, 0.9]), 180.0, 1e-3
    ray /= np.linalg.norm(ray)
    n = 100_000
    turns = rotation_vector_to_matrix(angle * rng.standard_normal((n, 3)))
    hit = turns @ ray
    ground = height * hit[:, :2] / hit[:, 2:]
    (R,) = noise_by_direction([3 * ray], [height], angle)
    # A sample's covariance is known to its size times the root of two over the number.
    assert np.cov(ground.T) == pytest.approx(R, abs=5 * R.max() * np.sqrt(2 / n))


def test_straight_down_all_three_are_a_share_of_the_height():
    seen = looking(0.0, 0.0, (CAMERA.cx, CAMERA.cy))
    for R in noises_of(seen).values():
        assert R[0] == pytest.approx((FRACTION * 210.0) ** 2 * np.eye(2), abs=1e-9)


def test_each_noise_follows_what_its_name_says():
    middle, corner = (CAMERA.cx, CAMERA.cy), (600.0, 480.0)
    level, banked = noises_of(looking(0.0, 0.0, middle)), noises_of(looking(0.5, 0.0, middle))
    aside = noises_of(looking(0.0, 0.0, corner))
    by_altitude, by_tilt, by_place = NOISES
    for one in (level, banked, aside):
        assert one[by_altitude] == pytest.approx(noise_by_altitude([210.0]))
    assert aside[by_tilt] == pytest.approx(level[by_tilt])
    assert banked[by_place] == pytest.approx(banked[by_tilt])
    # Banked by a to the right, the camera looks left: h / cos^2 across the course, h / cos along it.
    values = np.sqrt(np.linalg.eigvalsh(banked[by_tilt][0])) / (FRACTION * 210.0)
    assert values == pytest.approx([1 / np.cos(0.5), 1 / np.cos(0.5) ** 2])
    along = np.array([np.cos(0.4), np.sin(0.4)])
    assert along @ banked[by_tilt][0] @ along == pytest.approx((FRACTION * 210.0 / np.cos(0.5)) ** 2)
    assert np.linalg.eigvalsh(aside[by_place] - level[by_place]).min() > 0


def passes(errors: np.ndarray, seed: int = 0) -> Sighting:
    """A point at rest seen from straight above at 10 Hz, its georeferenced positions off by these errors."""
    n = len(errors)
    poses = CameraPoses(CAMERA, Mount("down"), np.tile([0.0, 0.0, -300.0], (n, 1)), np.eye(3))
    ground = np.column_stack([errors, np.zeros(n)])
    uv = ground_to_pixel(CAMERA, ground, poses.p_nc, poses.R_nc)
    truth = np.zeros((n, 4))
    return Sighting(np.arange(n) / 10, uv, errors.copy(), poses, np.zeros(n), truth)


def test_thinning_finds_how_long_errors_last():
    """Errors that are drawn anew every ten frames, and errors that always are."""
    rng = np.random.default_rng(5)
    lasting, white = np.repeat(rng.normal(0, 7, (200, 2)), 10, axis=0), rng.normal(0, 7, (2000, 2))
    quiet = TUNING._replace(acceleration=1e-4)
    both = [passes(errors) for errors in (lasting, white)]
    intervals = [interval_of_news(seen, follow_positions(seen, quiet)) for seen in both]
    assert intervals[0] == pytest.approx(1.0, rel=0.35) and intervals[1] < 0.15
    mixed = passes(np.column_stack([white[:, 0], lasting[:, 1]]))
    assert interval_of_news(mixed, follow_positions(mixed, quiet)) > 0.5, "the element that lasts counts"
    few = thinned(both[0], intervals[0])
    times = few.times[few.seen]
    assert np.diff(times).min() >= intervals[0] - 0.1 and few.seen[0]
    assert len(few.times) == 2000 and (np.isnan(few.uv).all(axis=1) == ~few.seen).all()


def test_noise_of_its_own_for_each_row_is_used():
    """A detection that counts for nothing beside one that counts for everything."""
    seen = passes(np.array([[0.0, 0.0], [10.0, 0.0], [-4.0, 0.0]]))
    R = np.eye(2) * np.array([1.0, 1e-6, 1e8])[:, None, None]
    track = follow_positions(seen, TUNING._replace(velocity_0=1e-3, acceleration=1e-6), R)
    assert track.x[1:, 0] == pytest.approx([10.0, 10.0], abs=0.01)


@pytest.mark.slow
def test_on_a_twin_each_variation_has_its_own_track():
    from wildlab.analysis.tracks.sighting import sighting

    seen = sighting(simulate_twin("slow-vessel-eight", 1, ("imu", "gnss")), "autopilot")
    base = follow_positions(seen, TUNING)
    found = follow_variations(seen, TUNING, base)
    assert tuple(found) == VARIATIONS
    ends = {tuple(track.x[-1]) for _, track in found.values()} | {tuple(base.x[-1])}
    assert len(ends) == 5
    assert [given.seen.sum() for given, _ in found.values()][:3] == [600] * 3
    assert 5 < found["thinned"][0].seen.sum() < 200
