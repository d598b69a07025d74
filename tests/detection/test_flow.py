"""Features in two images of a known motion, and the velocity of a textured plane from a camera that flies."""

from functools import cache

import cv2
import numpy as np
import pytest

from wildlab.detection import flow
from wildlab.detection.flow import (
    agreeing,
    find_features,
    match_features,
    nearest_by_ratio,
)
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses, Mount
from wildlab.geometry.covariances import inside_ellipse
from wildlab.geometry.flow import CameraMotion, FlowErrors, flow_between, mean_velocity, motion_between
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix

SHAPE = (160, 200)


def matched(first, second, inside_first, inside_second):
    return match_features(find_features(first, inside_first), find_features(second, inside_second))


@cache
def texture(seed, shape=(600, 600)):
    """A smooth random picture with detail of several sizes, kelvin."""
    rng = np.random.default_rng(seed)
    picture = np.zeros(shape, np.float32)
    for sd in (2.0, 4.0, 8.0):
        layer = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), sd)
        picture += layer / layer.std()
    return 290 + 3 * picture


def shifted(picture, du, dv):
    """A window of a picture whose content lies (du, dv) px further right and down."""
    M = np.array([[1.0, 0.0, -200.0 + du], [0.0, 1.0, -200.0 + dv]])
    return cv2.warpAffine(picture, M, SHAPE[::-1], flags=cv2.INTER_CUBIC)


EVERYWHERE = np.ones(SHAPE, bool)


def test_a_shift_is_found_to_a_fraction_of_a_pixel():
    picture = texture(1)
    found = matched(shifted(picture, 0, 0), shifted(picture, 3.3, -2.6), EVERYWHERE, EVERYWHERE)
    assert len(found) > 20
    displacement = found.second - found.first
    assert np.allclose(displacement.mean(axis=0), [3.3, -2.6], atol=0.05)
    # What it says of one displacement is how they scatter.
    assert found.sd == pytest.approx(np.sqrt((displacement - [3.3, -2.6]).var()), rel=0.3)


def test_the_same_pairs_each_time_and_the_same_as_by_comparing_all_with_all():
    rng = np.random.default_rng(2)
    one = rng.standard_normal((60, 128)).astype(np.float32)
    two = one[rng.permutation(60)][:50] + 0.3 * rng.standard_normal((50, 128)).astype(np.float32)
    here, there = nearest_by_ratio(one, two, 0.9)
    distance = np.linalg.norm(one[:, None] - two[None], axis=2)
    ordered = np.sort(distance, axis=1)
    good = ordered[:, 0] < 0.9 * ordered[:, 1]
    expected = {}
    for row in np.flatnonzero(good):
        column = int(distance[row].argmin())
        if column not in expected or distance[row, column] < distance[expected[column], column]:
            expected[column] = int(row)
    assert dict(zip(there.tolist(), here.tolist(), strict=True)) == expected
    assert len(expected) > 40


def test_something_else_that_moves_otherwise_is_left_out():
    rng = np.random.default_rng(4)
    here = rng.uniform(0, 100, (30, 2))
    there = here + [4.0, -1.0] + 0.2 * rng.standard_normal((30, 2))
    there[:6] += [15.0, 9.0]
    found = agreeing(here, there)
    assert len(found) == 24
    assert np.array_equal(found.first, here[6:])
    assert 0.1 < found.sd < 0.35


def test_what_turns_or_grows_too_much_is_chance(monkeypatch):
    here = np.random.default_rng(9).uniform(0, 60, (12, 2))
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    assert len(agreeing(here, here @ turn.T)) == 0
    assert len(agreeing(here, 1.3 * here)) == 0
    monkeypatch.setattr(flow, "LARGEST_TURN", 0.4)
    assert len(agreeing(here, here @ turn.T)) == 12


def test_the_scatter_of_few_features_is_that_of_what_moved_them(monkeypatch):
    """A motion of four numbers takes four of the differences: of five features six are left."""
    rng, variances = np.random.default_rng(11), []
    monkeypatch.setattr(flow, "SMALLEST_SD", 1e-6)
    for _ in range(400):
        here = rng.uniform(0, 60, (5, 2))
        there = here + [3.0, -2.0] + 0.2 * rng.standard_normal((5, 2))
        found = agreeing(here, there)
        assert len(found) == 5
        variances.append(found.sd**2)
    assert np.mean(variances) == pytest.approx(0.2**2, rel=0.15)
    monkeypatch.setattr(flow, "SMALLEST_SD", 0.07)
    exact = agreeing(here, here + np.array([3.0, -2.0]))
    assert exact.sd == 0.07, "features that fit exactly are not known exactly"


def test_nothing_is_found_where_nothing_is():
    even, empty = np.full(SHAPE, 290.0), np.zeros(SHAPE, bool)
    picture = shifted(texture(6), 0, 0)
    assert len(matched(even, even, EVERYWHERE, EVERYWHERE)) == 0
    none = matched(picture, picture, empty, EVERYWHERE)
    assert len(none) == 0 and np.isnan(none.sd)
    lost = np.full(SHAPE, np.nan)
    assert len(matched(lost, lost, EVERYWHERE, EVERYWHERE)) == 0
    # Another picture: what matches by chance does not agree.
    other = shifted(texture(7), 0, 0)
    assert len(matched(picture, other, EVERYWHERE, EVERYWHERE)) < 6
    assert len(agreeing(np.zeros((2, 2)), np.zeros((2, 2)))) == 0


# --- the oracle: a textured plane that moves, and a camera that moves and turns over it

CAMERA = Camera(200, 160, 240.0, 240.0, 99.5, 79.5)
METRE = 3.0  # texture pixels per metre
PLANE = 0.0


def warped(picture, pose, shift):
    """The plane as a camera at a pose sees it, by the homography between the two: exact."""
    R_cn, p = pose.R_nc.T, pose.p_nc
    to_camera = CAMERA.matrix @ np.column_stack([R_cn[:, 0], R_cn[:, 1], -R_cn @ p])
    # Texture pixel (column, row) -> north, east.
    to_plane = np.array(
        [[0, -1 / METRE, 100 + shift[0]], [1 / METRE, 0, -100 + shift[1]], [0, 0, 1.0]], float
    )
    return cv2.warpPerspective(picture, to_camera @ to_plane, SHAPE[::-1], flags=cv2.INTER_CUBIC)


def draw(seed, interval=0.1333):
    """Velocity found, its covariance, and the true one: everything that is told is off by what is stated."""
    rng = np.random.default_rng(seed)
    picture = texture(seed % 4)
    truth = rng.uniform(-8, 8, 2)
    v = np.array([*(18 * np.array([np.cos(h := rng.uniform(-np.pi, np.pi)), np.sin(h)])), rng.uniform(-1, 1)])
    rates, gimbal = rng.normal(0, 0.08, 3), rng.normal(0, 0.06, 2)
    R0, p0 = euler_to_matrix(*rng.uniform(-0.15, 0.15, 2), h), np.array([0.0, 0.0, -rng.uniform(90, 120)])
    mount, angles = Mount("down"), np.array([0.05, rng.uniform(-0.2, 0.2)])

    def pose(time):
        pan, tilt = angles + gimbal * time
        R = R0 @ rotation_vector_to_matrix(rates * time)
        return CameraPoses(CAMERA, mount, p0 + v * time, R, np.array(pan), np.array(tilt))

    ends = (-interval / 2, interval / 2)
    images = [warped(picture, pose(end), truth * end) + 0.05 * rng.standard_normal(SHAPE) for end in ends]
    inside = np.zeros(SHAPE, bool)
    inside[55:105, 65:135] = True
    matches = matched(*images, inside, inside)
    sd = np.array([0.3, 0.3, 2.0, 0.02, 0.02, 0.03])
    sd_v, sd_w, sd_g, sd_plane, sd_t = 0.2, 0.01, 0.01, 0.5, 0.02
    errors = FlowErrors(
        pixel=np.eye(2) * matches.sd**2,
        flow=np.eye(2) * (matches.sd / interval) ** 2,
        pose=np.diag(sd**2),
        mount=np.zeros((3, 3)),
        velocity=np.eye(3) * sd_v**2,
        rates=np.eye(3) * sd_w**2,
        gimbal_rates=np.eye(2) * sd_g**2,
        plane=sd_plane**2,
        interval=sd_t**2,
    )
    middle, _ = motion_between(pose(ends[0]), pose(ends[1]), interval)
    off = sd * rng.standard_normal(6)
    told = CameraPoses(
        CAMERA, mount, middle.p_nb + off[:3], middle.R_nb @ rotation_vector_to_matrix(off[3:]),
        middle.pan, middle.tilt,
    )  # fmt: skip
    motion = CameraMotion(
        v + sd_v * rng.standard_normal(3),
        rates + sd_w * rng.standard_normal(3),
        gimbal + sd_g * rng.standard_normal(2),
    )
    uv, flow = flow_between(matches.first, matches.second, interval * np.exp(sd_t * rng.standard_normal()))
    found = mean_velocity(told, motion, uv, flow, PLANE + sd_plane * rng.standard_normal(), errors)
    return found.value, found.covariance, truth


def within(draws):
    found, covariance, truth = (np.array(part) for part in zip(*draws, strict=True))
    axes = np.abs(found - truth) <= 1.96 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return axes.mean(), inside_ellipse(found - truth, covariance, 0.95).mean(), found - truth


def test_the_velocity_of_a_textured_plane_lies_within_its_interval():
    axes, ellipse, error = within([draw(seed) for seed in range(24)])
    assert axes >= 0.9
    assert ellipse >= 0.9
    # And the interval is not merely wide: the errors fill it.
    assert axes < 1
    assert np.abs(error.mean(axis=0)).max() < 1


def test_features_come_from_inside_alone():
    picture = texture(3)
    inside = np.zeros(SHAPE, bool)
    inside[40:120, 60:150] = True
    found = matched(shifted(picture, 0, 0), shifted(picture, 2, 1), inside, inside)
    assert len(found) >= 5
    for uv in (found.first, found.second):
        assert inside[np.rint(uv[:, 1]).astype(int), np.rint(uv[:, 0]).astype(int)].all()
