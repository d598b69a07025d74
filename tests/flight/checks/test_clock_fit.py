"""How well an offset of the camera's clock is known, and if a turn of the camera looks like it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from wildlab.flight.checks.sense.constants import HARD, clock_fit, clock_mistakes
from wildlab.flight.checks.sense.sightings import Look, Sightings
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import euler_to_matrix
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.geometry.mount import Mount, camera_pose

IMAGES, EACH, SPEED, HEIGHT, OFF_M = 60, 3, 20.0, 90.0, 0.5


def flown(*, forward: bool, late: float = 0.0, off_m: float = 0.0) -> Sightings:
    """Straight down, in every direction; the wind blows the same speed from anywhere, or it flies forward."""
    rng = np.random.default_rng(5)
    heading = np.repeat(rng.uniform(-np.pi, np.pi, IMAGES), EACH)
    course = heading if forward else np.repeat(rng.uniform(-np.pi, np.pi, IMAGES), EACH)
    n = len(heading)
    p = np.column_stack([rng.uniform(-200, 200, (n, 2)), np.full(n, -HEIGHT)])
    v = SPEED * np.column_stack([np.cos(course), np.sin(course), np.zeros(n)])
    R = euler_to_matrix(np.zeros(n), np.zeros(n), heading)
    points = np.column_stack([p[:, :2] + rng.uniform(-10, 10, (n, 2)), np.zeros(n)])
    lens, mount = Camera(640, 512, 700.0, 700.0, 320.0, 256.0), Mount("down")
    uv = ground_to_pixel(lens, points, *camera_pose(mount, p + late * v, R))
    points[:, :2] += np.repeat(rng.normal(0, off_m, (IMAGES, 2)), EACH, axis=0)
    zero, name = np.zeros(n), np.arange(n).astype(str).astype(object)
    return Sightings(
        "log", lens, mount, zero, zero, uv, p, R, points[None], np.arange(n) // EACH,
        np.tile([0.02, 2.0, 2.0], (n, 1)), (0.0, 0.0, 0.0),
        lambda shift: Look(p + shift * v, R, points[None], zero, zero), name, name,
    )  # fmt: skip


def test_forward_flight_alone_does_not_tell_a_clock_from_a_tilt():
    alike, apart = clock_fit(flown(forward=True), 0.0), clock_fit(flown(forward=False), 0.0)
    assert alike is None or alike.correlation > 0.95
    assert apart is not None and apart.correlation < 0.3


def test_the_interval_is_that_of_as_many_images():
    """Each image says where it was along its course to so many metres."""
    found = clock_fit(flown(forward=False, late=0.5, off_m=OFF_M), 0.5)
    assert found.sd_s == pytest.approx(OFF_M / SPEED / np.sqrt(IMAGES), rel=0.3)


@pytest.mark.parametrize("late", [0.5, -0.5])
def test_the_advice_has_the_interval(late):
    first = next(clock_mistakes(flown(forward=False, late=late, off_m=4 * OFF_M), 0.0))
    low, high, alike = (float(x) for x in re.findall(r"\d\.\d+", first.said)[1:4])
    assert low < abs(late) < high and high - low < 0.1 and alike < HARD
