"""What a camera detects of animals, and what its images would have shown: held against the ground itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.planning.ground import FLAT, with_wall
from wildlab.analysis.animal_images import (
    Detector,
    footprint_circles,
    put_on_ground,
    shown,
    sight_from,
    take_images,
)
from wildlab.analysis.plan_coverage import ExecutionErrors, displaced
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import R_MC_DOWN, CameraPoses
from wildlab.geometry.frames import euler_to_matrix
from wildlab.simulation.landscape import synthetic_landscape

CAMERA = Camera(640, 480, 1267.0, 1117.0, 356.0, 216.6)
LAND = synthetic_landscape(3, north=300, east=300)
EXACT = Detector(detected=1.0, sd=0.0, border=0.0, height=0.7)
NONE = ExecutionErrors(0.0, 0.0, 300.0, 0.0, 0.0, 0.0, 60.0)
SOME = ExecutionErrors(1.0, 1.5, 300.0, 0.01, 0.02, 0.04, 60.0)
ROLLS = SOME._replace(roll=0.04, pitch=0.004, yaw=0.004, horizontal=0.1, vertical=0.1)
PITCHES = ROLLS._replace(roll=0.004, pitch=0.04)


def pose(north: float, east: float, above: float, roll: float, pitch: float, yaw: float) -> CameraPoses:
    """One camera over the land, tilted about a level platform's axes."""
    up = float(LAND.heights_at(np.array([[north, east]]))[0]) + above
    R = euler_to_matrix(roll, pitch, yaw) @ R_MC_DOWN
    return CameraPoses.at_lens(CAMERA, np.array([[north, east, -up]]), R[None], np.eye(3))


tilts = st.floats(-1.0, 1.0)
places = st.floats(-60.0, 60.0)


@settings(max_examples=40, deadline=None)
@given(places, places, st.floats(5.0, 60.0), tilts, st.floats(-0.4, 0.4), st.floats(-3.1, 3.1))
def test_all_that_an_image_shows_lies_in_its_circle(north, east, above, roll, pitch, yaw):
    one = pose(north, east, above, roll, pitch, yaw)
    middle, radius = footprint_circles(LAND, one)
    grid = np.stack(np.meshgrid(np.arange(-145, 145, 2.5), np.arange(-145, 145, 2.5)), axis=-1).reshape(-1, 2)
    seen = shown(LAND, CAMERA, one.p_nc[0], one.R_nc[0], grid, EXACT)
    away = np.linalg.norm(grid[seen] - middle[0], axis=1)
    assert (away <= radius[0]).all()
    sight = sight_from(LAND, CAMERA, one.p_nc[0], one.R_nc[0], EXACT)
    assert np.array_equal(sight(grid), seen.astype(float))


def test_a_hill_hides_what_is_behind_it():
    ridge = with_wall(20, 30.0)
    R = euler_to_matrix(-1.2, 0.0, 0.0) @ R_MC_DOWN  # to the right, east
    p = np.array([0.0, 0.0, -12.0])
    behind = np.array([[0.0, 31.0]])
    assert shown(FLAT, CAMERA, p, R, behind, EXACT).all()
    assert not shown(ridge, CAMERA, p, R, behind, EXACT).any()


def test_without_errors_detections_are_where_the_animals_are():
    rng = np.random.default_rng(1)
    one = pose(10.0, 20.0, 40.0, 0.4, -0.1, 1.0)
    grid = np.stack(np.meshgrid(np.arange(-60, 100, 4.0), np.arange(-60, 100, 4.0)), axis=-1).reshape(-1, 2)
    seen = grid[shown(LAND, CAMERA, one.p_nc[0], one.R_nc[0], grid, EXACT)]
    rows = np.zeros(len(seen), int)
    z, R = put_on_ground(LAND, one.take(rows), one.take(rows), np.zeros(len(seen)), seen, NONE, EXACT, rng)
    assert len(seen) > 10
    assert z == pytest.approx(seen, abs=1e-3)
    assert pytest.approx(0.0, abs=1e-9) == R


@pytest.mark.parametrize("heading", [0.6, 2.5])
@pytest.mark.parametrize("errors", [SOME, ROLLS, PITCHES, NONE])
def test_covariances_are_those_of_many_flights(heading, errors):
    rng = np.random.default_rng(2)
    count = 6000
    R = euler_to_matrix(0.5, 0.1, heading) @ R_MC_DOWN
    told = CameraPoses.at_lens(
        CAMERA, np.tile([0.0, 0.0, -40.0], (count, 1)), np.tile(R, (count, 1, 1)), np.eye(3)
    )
    sizes = (
        [errors.horizontal, errors.horizontal, errors.vertical], [errors.roll, errors.pitch, errors.yaw],
    )  # fmt: skip
    off, turn = (rng.standard_normal((count, 3)) * one for one in sizes)
    headings = np.full(count, heading)
    true = displaced(told, headings, off, turn)
    # Where the optical axis meets the ground.
    at = np.tile(40 * R[:2, 2] / R[2, 2], (count, 1))
    detector = EXACT._replace(sd=2.0, height=0.0)
    z, covariance = put_on_ground(FLAT, told, true, headings, at, errors, detector, rng)
    drawn, said = np.cov((z - at).T), covariance.mean(axis=0)
    scale = np.sqrt(np.outer(np.diag(said), np.diag(said)))
    assert drawn / scale == pytest.approx(said / scale, abs=0.08)


def test_images_detect_only_what_they_show_and_so_often():
    rng = np.random.default_rng(5)
    T, A = 400, 6
    told = pose(0.0, 0.0, 50.0, 0.0, 0.0, 0.0).take(np.zeros(T, int))
    truth = np.tile(np.linspace(-30, 30, A)[:, None] * [0.0, 1.0], (T, 1, 1))
    detector = EXACT._replace(detected=0.8)
    found = take_images(LAND, told, told, np.zeros(T), np.arange(T) * 0.5, truth, NONE, detector, rng)
    assert found.in_view.any() and not found.in_view.all()
    assert found.in_view[found.image, found.animal].all()
    share = len(found.z) / found.in_view.sum()
    assert share == pytest.approx(0.8, abs=3 * np.sqrt(0.16 / found.in_view.sum()))
    assert (np.diff(found.image) >= 0).all()
    z, R, animals = found.taken(7)
    assert len(z) == len(R) == len(animals) == (found.image == 7).sum()
    assert z == pytest.approx(truth[7, animals], abs=1e-3)
    # The first of them are those of the whole way.
    part = found.first(9)
    assert len(part.times) == len(part.poses.p_nc) == len(part.truth) == len(part.in_view) == 9
    assert len(part.image) == (found.image < 9).sum() > 0
    for one, other in zip(part.taken(7), (z, R, animals), strict=True):
        np.testing.assert_array_equal(one, other)
