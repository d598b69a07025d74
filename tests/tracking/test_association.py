"""Which detection is nearest, by which sensor, and what lies outside the gate."""

import numpy as np
import pytest
from scipy.stats import chi2

from tests.tracking.poses import overflight, turned
from wildlab.tracking import measurement as m
from wildlab.tracking.association import distances, gate_threshold, nearest_within

P = np.diag([20.0, 12.0, 4.0, 4.0])
ANGLES = {"position": (False, False), "pixel": (False, False), "azimuth and elevation": (True, False)}
NOISE = {"position": np.diag([100.0, 100.0]), "pixel": np.diag([360.0, 160.0]),
         "azimuth and elevation": np.diag(np.radians([6.0, 3.0]) ** 2)}  # fmt: skip


def expected(kind, position, poses):
    if kind == "position":
        shape = (*np.shape(position)[:-1], 1, 1)
        return m.Prediction(np.asarray(position), np.tile(np.eye(2), shape), np.zeros((*shape[:-2], 2, 6)))
    if kind == "pixel":
        return m.predict_pixel(position, poses, 0.0)
    return m.predict_azimuth_elevation(position, poses, 0.0)


@pytest.mark.parametrize("kind", ANGLES)
def test_many_tracks_at_once_are_as_one_after_the_other(kind):
    _, _, poses, truth = overflight(30)
    rng = np.random.default_rng(0)
    there = truth[:, :2] + rng.normal(0, 3, (30, 2))
    both = np.stack([truth[:, :2], truth[:, :2] + [10.0, 15.0]], axis=1)
    each = poses.take((slice(None), None))
    z = expected(kind, both, each).z
    z[3, 1] = np.nan
    seen = expected(kind, there, poses)
    nis = distances(seen, ANGLES[kind], P, z, NOISE[kind])
    assert nis.shape == (30, 2)
    for k in range(30):
        H = seen.H_position[k]
        S = H @ P[:2, :2] @ H.T + NOISE[kind]
        for j in range(2):
            if (k, j) == (3, 1):
                assert np.isnan(nis[k, j])
                continue
            v = z[k, j] - seen.z[k]
            if kind == "azimuth and elevation":
                v[0] = np.angle(np.exp(1j * v[0]))
            assert np.isclose(nis[k, j], v @ np.linalg.inv(S) @ v)
    assert nearest_within(nis, 0.99, 2)[3] == 0


@pytest.mark.parametrize("kind", ["pixel", "azimuth and elevation"])
def test_who_is_not_in_sight_has_no_detection(kind):
    _, _, poses, truth = overflight(1)
    up = turned(poses, slice(None))
    nis = distances(expected(kind, truth[:, :2], up), ANGLES[kind], P, np.zeros((1, 3, 2)), NOISE[kind])
    assert np.isnan(nis).all()
    assert nearest_within(nis, 1.0, 2).tolist() == [-1]


def test_outside_the_gate_there_is_no_neighbour():
    nis = np.array([[5.0, 3.0, np.nan], [np.nan, np.nan, np.nan], [30.0, 20.0, 10.0]])
    assert nearest_within(nis, 0.95, 2).tolist() == [1, -1, -1]
    assert nearest_within(nis, 1.0, 2).tolist() == [1, -1, 2]
    assert gate_threshold(0.95, 3) == pytest.approx(chi2.ppf(0.95, 3))
