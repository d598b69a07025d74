"""Two cameras' detections joined: exact geometry, honest covariances, and what one alone saw."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.stats import chi2

from tests.refused import refused
from wildlab.detection.detections import Detections, describe, no_detections
from wildlab.detection.fusion import GATE, fuse_detections, fuse_located, fuse_points, through_homography
from wildlab.detection.ground import Located, locate
from wildlab.geometry.camera import Camera
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.georeference import georeference_pixels, ground_to_pixel
from wildlab.geometry.mount import Mount

THERMAL = Camera(640, 512, 760.0, 760.0, 319.5, 255.5)
COLOUR = Camera(1280, 720, 1065.0, 1065.0, 639.5, 359.5)
P = np.array([[2.0, 0.4], [0.4, 1.0]])
Q = np.array([[0.5, -0.2], [-0.2, 3.0]])


def pose(camera: Camera, pan: float = 0.0) -> CameraPoses:
    return CameraPoses(camera, Mount(pan=pan), np.array([0.0, 0, -80.0]), np.eye(3))


def through_the_ground(uv: np.ndarray, a: CameraPoses, b: CameraPoses) -> np.ndarray:
    ground = georeference_pixels(a, uv, 0.0)
    return ground_to_pixel(b.camera, ground, b.p_nc, b.R_nc)


def homography(a: CameraPoses, b: CameraPoses) -> np.ndarray:
    """From pixels of a to those of b for cameras at one place: K_b R K_a^-1, without any plane."""

    def K(c: Camera) -> np.ndarray:
        return np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1]])

    return K(b.camera) @ b.R_nc.T @ a.R_nc @ np.linalg.inv(K(a.camera))


def detections(uv: np.ndarray, covariance: np.ndarray) -> Detections:
    labels = np.zeros((40, 40 * max(len(uv), 1)), np.int32)
    for row in range(len(uv)):
        labels[10:20, 40 * row + 10 : 40 * row + 20] = row + 1
    found = describe(labels, labels.astype(float) + 1, labels >= 0)
    return replace(found, uv=uv, covariance=covariance)


def test_joined_it_is_the_mean_weighted_by_information() -> None:
    found = fuse_points([[1.0, 2.0]], [P], [[2.0, 1.0]], [Q])
    information = np.linalg.inv(P) + np.linalg.inv(Q)
    mean = np.linalg.solve(information, np.linalg.solve(P, [1.0, 2.0]) + np.linalg.solve(Q, [2.0, 1.0]))
    assert np.allclose(found.points[0], mean)
    assert np.allclose(found.covariance[0], np.linalg.inv(information))
    apart = np.array([-1.0, 1.0])
    assert found.distance2[0] == pytest.approx(apart @ np.linalg.solve(P + Q, apart))
    turned = fuse_points([[2.0, 1.0]], [Q], [[1.0, 2.0]], [P])
    assert np.allclose(turned.points, found.points) and np.allclose(turned.covariance, found.covariance)
    both = fuse_points([[1.0, 2.0]], [P], [[2.0, 1.0]], [Q], shared=[[4.0, 0], [0, 9.0]])
    assert np.allclose(both.covariance - found.covariance, np.diag([4.0, 9.0]))
    assert np.allclose(both.points, found.points)


def test_what_one_alone_saw_stays_as_it_is() -> None:
    found = fuse_points([[0, 0], [100, 0]], [P, P], [[0.5, 0.5], [0, 100]], [Q, Q])
    assert found.by_both.tolist() == [True, False, False]
    assert found.first.tolist() == [0, 1, -1] and found.second.tolist() == [0, -1, 1]
    assert np.allclose(found.points[1:], [[100, 0], [0, 100]]) and np.allclose(found.covariance[1:], [P, Q])
    assert np.isnan(found.distance2[1:]).all()
    for a, b in (([], [[1.0, 2]]), ([[1.0, 2]], []), ([], [])):
        one = fuse_points(a, [P] * len(a), b, [Q] * len(b))
        assert len(one.points) == len(a) + len(b) and not one.by_both.any()


def test_of_all_joinings_the_likeliest_with_the_most_pairs() -> None:
    rng = np.random.default_rng(4)
    for _ in range(30):
        a, b = rng.uniform(0, 6, (4, 2)), rng.uniform(0, 6, (4, 2))
        found = fuse_points(a, [np.eye(2)] * 4, b, [np.eye(2)] * 4)
        d2 = ((a[:, None] - b[None]) ** 2).sum(axis=2) / 2
        limit = chi2.ppf(GATE, 2)

        def worth(order: tuple[int, ...], d2: np.ndarray = d2, limit: float = limit) -> tuple[int, float]:
            pairs = [d2[i, j] for i, j in enumerate(order) if d2[i, j] <= limit]
            return -len(pairs), sum(pairs)

        best = min(map(worth, permutations(range(4))))
        assert (-found.by_both.sum(), np.nansum(found.distance2)) == pytest.approx(best)
        assert len(set(found.first[found.by_both])) == found.by_both.sum()


def test_ellipses_hold_the_truth_as_often_as_they_say_and_so_does_the_gate() -> None:
    rng = np.random.default_rng(1)
    n = 4000
    truth = np.column_stack([np.arange(n) * 1000.0, np.zeros(n)])
    a = truth + rng.multivariate_normal([0, 0], P, n)
    b = truth + rng.multivariate_normal([0, 0], Q, n)
    rows = [fuse_points(a[k : k + 50], [P] * 50, b[k : k + 50], [Q] * 50) for k in range(0, n, 50)]
    joined = sum(one.by_both.sum() for one in rows)
    assert joined / n == pytest.approx(GATE, abs=0.006)
    off = np.concatenate(
        [one.points[one.by_both] - truth[k * 50 + one.first[one.by_both]] for k, one in enumerate(rows)]
    )
    nees = np.einsum("ni,ij,nj->n", off, np.linalg.inv(rows[0].covariance[0]), off)
    assert (nees < chi2.ppf(0.9, 2)).mean() == pytest.approx(0.9, abs=0.015)
    d2 = np.concatenate([one.distance2[one.by_both] for one in rows])
    assert np.median(d2) == pytest.approx(chi2.ppf(0.5 * GATE, 2), rel=0.06)


def test_a_homography_carries_points_exactly_and_covariances_to_first_order() -> None:
    a, b = pose(COLOUR, pan=0.3), pose(THERMAL)
    H = homography(a, b)
    uv = np.array([[400.0, 300.0], [700.0, 500.0], [639.5, 359.5]])
    moved, covariance = through_homography(uv, [P, P, P], 7.0 * H)
    assert np.allclose(moved, through_the_ground(uv, a, b), atol=1e-8)
    rng = np.random.default_rng(1)
    drawn = through_homography(rng.multivariate_normal(uv[1], P, 40_000), np.tile(P, (40_000, 1, 1)), H)[0]
    assert np.allclose(np.cov(drawn.T), covariance[1], atol=0.03)
    wider = through_homography(uv, [P, P, P], H, registration_px=2.0)[1]
    assert np.allclose(wider - covariance, 4 * np.eye(2))
    beyond = through_homography([[1.0, 0.0], [0.0, 0.0]], [P, P], [[1, 0, 0], [0, 1, 0], [1, 0, -1]])[0]
    assert np.isnan(beyond[0]).all() and np.isfinite(beyond[1]).all()


def test_thermal_and_colour_side_by_side() -> None:
    """Four things: two that both see, one that is cold, one that is pale; each at its exact place."""
    a, b = pose(THERMAL), pose(COLOUR, pan=0.2)
    seen = np.array([[100.0, 100], [320, 250], [500, 400]])
    others = np.array([seen[1], seen[2], [200.0, 300.0]])
    first = detections(seen, np.tile(P, (3, 1, 1)))
    second = detections(through_the_ground(others, a, b), np.tile(Q, (3, 1, 1)))
    found = fuse_detections(first, second, homography(b, a), registration_px=0.5)
    assert found.first.tolist() == [1, 2, 0, -1] and found.second.tolist() == [0, 1, -1, 2]
    assert np.allclose(found.points, [seen[1], seen[2], seen[0], others[2]], atol=1e-6)
    assert np.allclose(found.distance2[:2], 0, atol=1e-9)
    assert (np.linalg.det(found.covariance[:2]) < np.linalg.det(P)).all()
    exact = fuse_detections(first, second, homography(b, a))
    assert np.allclose(found.covariance[3] - exact.covariance[3], 0.25 * np.eye(2))
    lonely = fuse_detections(first, no_detections(), np.eye(3))
    assert lonely.first.tolist() == [0, 1, 2] and (lonely.second == -1).all()


def test_through_the_ground_it_is_the_same_place() -> None:
    a, b = pose(THERMAL), pose(COLOUR, pan=0.2)
    seen = np.array([[320.0, 250.0], [500, 400]])
    none, small = np.zeros((6, 6)), np.zeros((3, 3))
    first = locate(detections(seen, np.tile(P, (2, 1, 1))), a, none, small)
    second = locate(detections(through_the_ground(seen[::-1], a, b), np.tile(Q, (2, 1, 1))), b, none, small)
    found = fuse_located(first, second, shared=np.eye(2))
    assert found.by_both.all() and found.second.tolist() == [1, 0]
    assert np.allclose(found.points, georeference_pixels(a, seen, 0.0)[:, :2], atol=1e-6)
    assert (np.linalg.eigvalsh(found.covariance) > 1).all()
    lost = Located(np.full((1, 3), np.nan), np.full((1, 2, 2), np.nan), np.zeros(1), np.array(["none"]))
    assert fuse_located(lost, second).second.tolist() == [0, 1]


def test_what_cannot_be_joined_is_refused() -> None:
    for call, word in (
        (lambda: fuse_points([[0, 0]], [P], [[0, 0]], [Q], gate=1.0), "gate"),
        (lambda: fuse_points([[0, 0]], [P, P], [[0, 0]], [Q]), "shape"),
        (lambda: fuse_points([[0, np.nan]], [P], [[0, 0]], [Q]), "of the first"),
        (lambda: fuse_points([[0, 0]], [P], [[0, 0]], [-Q]), "of the second"),
        (lambda: through_homography([[0, 0]], [P], np.ones((3, 3))), "invertible"),
        (lambda: through_homography([[0, 0]], [P], np.eye(3), -1.0), "registration"),
    ):
        with refused(word):
            call()
