"""The filter against filterpy, and the filter at rest against the weighted mean it must equal."""

import numpy as np
from filterpy.kalman import KalmanFilter

from wildlab.tracking.kalman import filter_at_rest, predict, update


def test_predict_and_update_agree_with_filterpy_over_random_models():
    rng = np.random.default_rng(0)
    for _ in range(20):
        n, m = rng.integers(1, 6), rng.integers(1, 4)

        def spread(k):
            A = rng.normal(size=(k, k))
            return A @ A.T + 0.1 * np.eye(k)

        F, H = rng.normal(size=(n, n)), rng.normal(size=(m, n))
        Q, R, x, P = spread(n), spread(m), rng.normal(size=n), spread(n)
        oracle = KalmanFilter(dim_x=n, dim_z=m)
        oracle.F, oracle.H, oracle.Q, oracle.R, oracle.x, oracle.P = F, H, Q, R, x.copy(), P.copy()
        for z in rng.normal(size=(5, m)):
            oracle.predict()
            oracle.update(z)
            x, P = predict(x, P, F, Q)
            step = update(x, P, z, H, R)
            x, P = step.x, step.P
            assert np.allclose(x, oracle.x, rtol=1e-10, atol=1e-10)
            assert np.allclose(P, oracle.P, rtol=1e-10, atol=1e-10)
            assert np.allclose(step.S, oracle.S)
            assert np.allclose(step.innovation, oracle.y)


def test_at_rest_the_filter_is_the_weighted_mean():
    rng = np.random.default_rng(1)
    A = rng.normal(size=(30, 2, 2))
    R = A @ np.swapaxes(A, 1, 2) + 0.2 * np.eye(2)
    z = rng.normal(size=(30, 2))
    information = np.linalg.inv(R)
    P = np.linalg.inv(information.sum(axis=0))
    mean = P @ np.einsum("nij,nj->i", information, z)
    filtered = filter_at_rest(z, R)
    assert np.allclose(filtered.x[-1], mean)
    assert np.allclose(filtered.P[-1], P)


def test_a_missing_measurement_carries_the_estimate_on():
    z = np.array([[np.nan, 0], [1.0, 2.0], [np.nan, np.nan], [3.0, 4.0]])
    filtered = filter_at_rest(z, np.tile(np.eye(2), (4, 1, 1)))
    assert np.isnan(filtered.x[0]).all()
    assert np.allclose(filtered.x[1:], [[1, 2], [1, 2], [2, 3]])
    assert np.isnan(filtered.innovation[:3]).all()
    assert np.allclose(filtered.innovation[3], [2, 2])
    assert np.isnan(filter_at_rest(z * np.nan, np.tile(np.eye(2), (4, 1, 1))).x).all()
