"""Dead reckoning and filters against other people's integrator, Kalman filter and geodesy."""

import numpy as np
import pymap3d
import pytest
from filterpy.kalman import KalmanFilter
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from wildlab.geometry.frames import (
    flat_earth,
    geodetic_to_ecef,
    local_earth,
    matrix_to_quaternion,
    normal_gravity,
    quaternion_to_matrix,
)
from wildlab.navigation.aiding import positions, velocities
from wildlab.navigation.mekf import InitialState, run_mekf
from wildlab.navigation.observer import earth_axes
from wildlab.navigation.strapdown import ImuNoise, ImuSamples, integrate_strapdown

ORIGIN = (np.radians(59.0), np.radians(10.0), 120.0)


def force(t):
    return np.array([2.0 * np.sin(0.5 * t), 1.0 * np.cos(0.3 * t), -9.7 + 0.8 * np.sin(0.2 * t)])


def rate(t):
    return np.array([0.3 * np.sin(0.7 * t), 0.05 + 0.1 * np.cos(0.4 * t), 0.2 * np.sin(0.1 * t)])


def inertial_motion(t, y):
    """Newton's law in a frame that does not turn: no Coriolis force, no centrifugal one, no rate of the
    Earth.

    y is position, velocity and nine elements of the rotation matrix. Gravitation is the ellipsoid's gravity
    (pymap3d says where down is) without the centrifugal force that is part of it.
    """
    spin = 7.292115e-5
    p, v, R = y[:3], y[3:6], y[6:].reshape(3, 3)
    turned = Rotation.from_rotvec([0, 0, spin * t]).as_matrix()
    p_e = turned.T @ p
    lat, lon, h = pymap3d.ecef2geodetic(*p_e, deg=False)
    down = -np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    pull = normal_gravity(lat, h) * down - spin**2 * np.array([p_e[0], p_e[1], 0.0])
    w = rate(t)
    S = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    return np.concatenate([v, R @ force(t) + turned @ pull, (R @ S).ravel()])


def test_dead_reckoning_agrees_with_newton_in_inertial_space():
    """Two minutes of violent motion, to 27 km from the origin of n."""
    p_e, R_en = earth_axes(ORIGIN)
    assert np.allclose(p_e, geodetic_to_ecef(*ORIGIN))
    R_nb = Rotation.from_euler("ZYX", [0.8, 0.1, -0.2]).as_matrix()
    v_n = np.array([20.0, -5.0, 1.0])
    spin = np.array([0, 0, 7.292115e-5])
    y = np.concatenate([p_e, R_en @ v_n + np.cross(spin, p_e), (R_en @ R_nb).ravel()])
    end = 120.0
    solved = solve_ivp(inertial_motion, (0, end), y, method="DOP853", rtol=1e-12, atol=1e-9).y[:, -1]
    turned = Rotation.from_rotvec(spin * end).as_matrix()
    p = R_en.T @ (turned.T @ solved[:3] - p_e)
    v = R_en.T @ (turned.T @ solved[3:6] - np.cross(spin, turned.T @ solved[:3]))
    R = R_en.T @ turned.T @ solved[6:].reshape(3, 3)
    times = np.arange(0, end + 1e-9, 0.002)
    imu = ImuSamples(times, np.stack([force(t) for t in times]), np.stack([rate(t) for t in times]))
    start = np.zeros(3), v_n, matrix_to_quaternion(R_nb)
    found = integrate_strapdown(imu, *start, local_earth(ORIGIN[0], ORIGIN[2]))
    distance = np.linalg.norm(p)
    assert distance > 20e3
    off = Rotation.from_matrix(R.T @ quaternion_to_matrix(found.quaternion[-1])).magnitude()
    assert np.degrees(off) < 1e-4
    # The plumb line is taken to lean as on a sphere, which is right to a few per mille of the lean.
    assert np.linalg.norm(found.velocity[-1] - v) < 0.01
    assert np.linalg.norm(found.position[-1] - p) < 0.5
    flat = integrate_strapdown(imu, *start, flat_earth(float(normal_gravity(ORIGIN[0], ORIGIN[2]))))
    assert np.linalg.norm(flat.position[-1] - p) > 10 * np.linalg.norm(found.position[-1] - p)


def test_without_rotation_the_mekf_is_filterpys_kalman_filter():
    """Attitude and gyros perfectly known: position, velocity and accelerometer bias are a linear problem."""
    step, tau, sd, walk = 0.05, 30.0, 0.2, 0.03
    times = np.arange(0, 40 + step / 2, step)
    rng = np.random.default_rng(0)
    R = Rotation.from_euler("ZYX", [0.6, -0.2, 0.4]).as_matrix()
    f = rng.standard_normal((len(times), 3)) + R.T @ [0, 0, -9.81]
    p_sd, v_sd, bias_sd = 1.5, 0.4, 0.3
    t = times[20::20]
    z_p, z_v = 10 * rng.standard_normal((len(t), 3)), rng.standard_normal((len(t), 3))
    state = np.concatenate([np.zeros(6), matrix_to_quaternion(R), np.zeros(6)])
    known = np.diag(np.repeat([4.0, 1.0, 0.0, bias_sd**2, 0.0], 3))
    noise = ImuNoise(walk, 0.0, sd, tau, 0.0, np.inf)
    aiding = [positions(t, z_p, p_sd), velocities(t, z_v, v_sd)]
    imu = ImuSamples(times, f, np.zeros((len(times), 3)))
    start = InitialState(0.0, state, known)
    ours = run_mekf(imu, start, noise, flat_earth(), aiding, t, gate_probability=1.0)

    kept = np.exp(-step / tau)
    eye = np.eye(3)
    theirs = KalmanFilter(dim_x=9, dim_z=3, dim_u=3)
    theirs.x, theirs.P = np.zeros((9, 1)), known[np.ix_([*range(6), 9, 10, 11], [*range(6), 9, 10, 11])]
    theirs.F = np.block(
        [
            [eye, step * eye, -(step**2) / 2 * R],
            [0 * eye, eye, -step * R],
            [0 * eye, 0 * eye, kept * eye],
        ]
    )
    theirs.B = np.vstack([step**2 / 2 * eye, step * eye, 0 * eye])
    axis = np.zeros((3, 3))
    axis[:2, :2] = walk**2 * np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
    axis[2, 2] = sd**2 * (1 - kept**2)
    theirs.Q = np.kron(axis, eye)
    H = {"p": np.eye(3, 9), "v": np.eye(3, 9, 3)}
    row = 0
    for k in range(1, len(times)):
        push = R @ (f[k - 1] + f[k]) / 2 + [0, 0, 9.81]
        theirs.predict(u=push[:, None])
        if row < len(t) and abs(times[k] - t[row]) < step / 2:
            for what, z, spread in (("p", z_p, p_sd), ("v", z_v, v_sd)):
                theirs.update(z[row][:, None], R=spread**2 * eye, H=H[what])
            x = theirs.x.ravel()
            assert ours.position[row] == pytest.approx(x[:3], abs=1e-9)
            assert ours.velocity[row] == pytest.approx(x[3:6], abs=1e-9)
            assert ours.accelerometer_bias[row] == pytest.approx(x[6:], abs=1e-9)
            order = [*range(6), 9, 10, 11]
            assert np.allclose(ours.covariance[row][np.ix_(order, order)], theirs.P, atol=1e-10)
            row += 1
    assert row == len(t)
