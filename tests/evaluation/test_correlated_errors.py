"""The factorised covariance is the dense one, and its noise is found from errors of known distribution."""

import numpy as np
import pytest
from scipy.stats import f

from wildlab.evaluation.correlated_errors import (
    Covariance,
    Places,
    PosePoints,
    WanderNoise,
    degrees_of_freedom,
    estimate_wander,
    fit_generalised,
)
from wildlab.evaluation.pose_noise import KINDS

SD = dict(zip(KINDS, (0.7, 0.7, 0.012, 0.02, 4.0), strict=True))
NOISE = WanderNoise(SD, 0.8, (60.0, 15.0, 40.0))


def drawn_points(images=40, seed=0, every=3.0):
    rng = np.random.default_rng(seed)
    n = 4 * images
    return PosePoints(
        rng.normal(size=(n, 2, 6)) * [1.0, 1.0, 1.0, 70.0, 70.0, 70.0],
        np.tile(0.02**2 * np.array([[1.0, -0.4], [-0.4, 0.8]]), (n, 1, 1)),
        np.tile(0.05**2 * np.array([[1.0, 0.6], [0.6, 2.0]]), (n, 1, 1)),
        rng.permutation(np.repeat(every * np.arange(images), 4)),
    )


def dense(points, noise):
    """The covariance (2N, 2N) by its definition."""
    n, sd = len(points.time), np.array([noise.sd[kind] for kind, axes in KINDS.items() for _ in axes])
    G, apart = points.derivatives * sd, np.abs(points.time[:, None] - points.time)
    C, lasts = np.zeros((n, 2, n, 2)), np.take(noise.lasts, (0, 0, 0, 1, 1, 2))
    for axis in range(6):
        part = noise.share * np.exp(-apart / lasts[axis]) + (1 - noise.share) * (apart == 0)
        C += part[:, None, :, None] * G[:, :, None, None, axis] * G[None, None, :, :, axis]
    for i in range(n):
        C[i, :, i] += points.own[i] + noise.sd["pixel"] ** 2 * points.pixel[i]
    return C.reshape(2 * n, 2 * n)


@pytest.mark.parametrize("place_sd", [None, 0.5, np.inf])
def test_it_is_the_dense_covariance(place_sd):
    points = drawn_points(12)
    n, C, B = len(points.time), dense(points, NOISE), np.random.default_rng(1).normal(size=(48, 2, 3))
    expected, determinant = np.linalg.inv(C), np.linalg.slogdet(C)[1]
    of, places = np.arange(n) % 7, None
    if place_sd is not None:
        Z = np.kron(np.eye(7)[of], np.eye(2))
        places = Places(of, np.full(n, place_sd), np.zeros(n, bool))
        if np.isfinite(place_sd):
            C = C + place_sd**2 * Z @ Z.T
            expected, determinant = np.linalg.inv(C), np.linalg.slogdet(C)[1]
        else:
            S = Z.T @ expected @ Z
            determinant += np.linalg.slogdet(S)[1]
            expected = expected - expected @ Z @ np.linalg.solve(S, Z.T @ expected)
    inner, logarithm = Covariance(points, NOISE, places).weigh(B)
    columns = B.reshape(2 * n, 3)
    np.testing.assert_allclose(inner, columns.T @ expected @ columns, rtol=1e-9, atol=1e-7)
    assert logarithm == pytest.approx(determinant)


def test_the_noise_is_found_whatever_is_constant():
    points = drawn_points()
    L = np.linalg.cholesky(dense(points, NOISE))
    constant = np.tile(5.0 * np.eye(2), (len(points.time), 1, 1))
    rng = np.random.default_rng(2)
    assumed = {kind: 2.0 * sd for kind, sd in SD.items()}
    errors = (L @ rng.normal(size=len(L))).reshape(-1, 2) + 20.0
    found = estimate_wander(points, errors, constant, assumed).noise
    for kind, sd in SD.items():
        assert found.sd[kind] == pytest.approx(sd, rel=0.5), kind
    assert found.share > 0.5


@pytest.mark.slow
def test_a_constant_against_errors_that_wander_is_as_certain_as_its_interval_says():
    """A heading that wanders for as long as half of the flight, tilts that do not, by twenty flights."""
    noise = WanderNoise({**SD, "tilt": 0.02, "heading": 0.02}, 0.95, (60.0, 10.0, 60.0))
    points = drawn_points(24, every=5.0)
    L = np.linalg.cholesky(dense(points, noise))
    # A turn about down, the same for all images, moves each point as its derivative says.
    J, rng = points.derivatives[..., 5:6] * np.radians(15.0), np.random.default_rng(3)
    white, wandering = 0, 0
    for _ in range(20):
        errors = (L @ rng.normal(size=len(L))).reshape(-1, 2)
        found = estimate_wander(points, errors, J, SD)
        fit = fit_generalised(J, errors, Covariance(points, found.noise))
        wald = float(fit.x[0] ** 2 * fit.information[0, 0])
        freedom, (alone,) = degrees_of_freedom(J, fit.x, points, found)
        assert alone == pytest.approx(freedom)
        wandering += f.sf(wald, 1, freedom) < 0.05
        alone = fit_generalised(J, errors, Covariance(points, found.noise._replace(share=0.02)))
        white += float(alone.x[0] ** 2 * alone.information[0, 0]) > 3.84
    assert white > 8
    assert wandering <= 2


def test_degrees_of_freedom_are_those_of_a_variance_where_the_noise_is_white():
    """Of 2 N residuals of one unknown variance and two constants 2 N - 2, as of Student's distribution."""
    points = drawn_points(40)._replace(derivatives=np.zeros((160, 2, 6)), own=np.zeros((160, 2, 2)))
    points = points._replace(pixel=np.tile(np.eye(2), (160, 1, 1)))
    J, errors = np.tile(np.eye(2), (160, 1, 1)), np.random.default_rng(5).normal(0, 3.0, (160, 2))
    found = estimate_wander(points, errors, J, {**SD, "pixel": 3.0})
    freedom, each = degrees_of_freedom(J, np.ones(2), points, found)
    assert [freedom, *each] == pytest.approx([318.0] * 3, rel=0.1)


@pytest.mark.parametrize("every", [3.0, 0.0])
def test_the_error_of_a_logged_place_wanders_with_that_of_logged_positions(every):
    """Against the dense covariance; two of three things move, and images may be taken at once."""
    points = drawn_points(12, every=every)
    n, C, B = len(points.time), dense(points, NOISE), np.random.default_rng(1).normal(size=(48, 2, 3))
    of, sd = np.arange(n) % 3, np.array([0.5, 3.0, 1.0])
    apart = np.abs(points.time[:, None] - points.time) * (of > 0)
    rho = np.exp(-apart / NOISE.lasts[0]) * (of[:, None] == of)
    C = C + np.kron(rho * np.outer(sd[of], sd[of]), np.eye(2))
    inner, logarithm = Covariance(points, NOISE, Places(of, sd[of], of > 0)).weigh(B)
    columns = B.reshape(2 * n, 3)
    np.testing.assert_allclose(inner, columns.T @ np.linalg.solve(C, columns), rtol=1e-9)
    assert logarithm == pytest.approx(np.linalg.slogdet(C)[1])
