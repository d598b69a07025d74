"""Ground covariances: derivatives against finite differences, coverage against Monte Carlo."""

import numpy as np
import pytest

from wildlab.geometry.camera import Camera, normalise
from wildlab.geometry.camera_poses import CameraPoses, Mount, camera_rotation, mount_rotation
from wildlab.geometry.covariances import ellipse_axes, inside_ellipse
from wildlab.geometry.frames import euler_to_matrix, rotation_vector_to_matrix
from wildlab.geometry.georeference import georeference_pixels, pixel_to_plane
from wildlab.geometry.uncertainty import (
    PoseErrors,
    ground_covariance,
    ground_jacobians,
    ray_flatness,
    sample_ground,
)
from wildlab.studies.sensitivity import TAU2

BENT = Camera(640, 512, 700.0, 705.0, 322.0, 250.0, 1.5, (-0.1, 0.05, 0.001, -0.002, 0.0))
ZERO = np.zeros(3)
TURNED = Mount("down", pan=0.3, tilt=-0.2, misalignment=(0.03, -0.05, 0.02), lever_arm=(0.4, -0.1, 0.2))


def errors(attitude_deg: float, pixel=2.0, position=1.0, mount_deg=0.0, plane=1.0) -> PoseErrors:
    s = np.radians(attitude_deg)
    return PoseErrors(
        pixel=np.eye(2) * pixel**2,
        pose=np.diag([position**2] * 3 + [s * s] * 3),
        mount=np.eye(3) * np.radians(mount_deg) ** 2,
        plane=plane**2,
    )


def test_derivatives_against_finite_differences():
    rng = np.random.default_rng(3)
    n = 40
    uv = rng.uniform([0, 0], [640, 512], (n, 2))
    p = rng.uniform([-50, -50, -300], [50, 50, -60], (n, 3))
    R = euler_to_matrix(*rng.uniform([-0.4, -0.4, -3], [0.4, 0.4, 3], (n, 3)).T)
    plane = rng.uniform(-5, 5, n)

    def ground(pixel=ZERO[:2], position=ZERO, attitude=ZERO, mount=ZERO, height=0.0):
        turned = R @ rotation_vector_to_matrix(attitude)
        R_bm = mount_rotation(TURNED)
        R_mc = R_bm.T @ camera_rotation(TURNED)
        R_nc = turned @ R_bm @ rotation_vector_to_matrix(mount) @ R_mc
        foot = p + position + turned @ np.array(TURNED.lever_arm)
        return pixel_to_plane(BENT, uv + pixel, foot, R_nc, plane + height)[:, :2]

    def numeric(name: str, size: int, h: float):
        if size == 1:
            return (ground(**{name: h}) - ground(**{name: -h})) / (2 * h)
        return np.stack(
            [(ground(**{name: h * e}) - ground(**{name: -h * e})) / (2 * h) for e in np.eye(size)], -1
        )

    J = ground_jacobians(CameraPoses(BENT, TURNED, p, R), uv, plane)
    scale = np.abs(J.pose[..., 3:]).max()
    assert np.allclose(J.pixel, numeric("pixel", 2, 1e-3), rtol=1e-5, atol=1e-5)
    assert np.allclose(J.pose[..., :3], numeric("position", 3, 1e-3), rtol=1e-6, atol=1e-6)
    assert np.allclose(J.pose[..., 3:], numeric("attitude", 3, 1e-6), rtol=1e-5, atol=1e-6 * scale)
    assert np.allclose(J.mount, numeric("mount", 3, 1e-6), rtol=1e-5, atol=1e-6 * scale)
    assert np.allclose(J.plane, numeric("height", 1, 1e-3), rtol=1e-6, atol=1e-6)


def test_straight_down_has_a_closed_form():
    """Height h, focal length f: position + h^2 attitude + (h/f)^2 pixel; the plane's height plays no part."""
    h = 200.0
    uv, rng = np.array([[TAU2.cx, TAU2.cy]]), np.random.default_rng(0)
    poses = CameraPoses(TAU2, Mount("down"), np.array([[0, 0, -h]]), np.eye(3))
    result = ground_covariance(poses, uv, 0.0, errors(1.0), rng)
    angle = (h * np.radians(1.0)) ** 2
    expected = np.diag([1 + angle + (2 * h / TAU2.fy) ** 2, 1 + angle + (2 * h / TAU2.fx) ** 2])
    assert result.method.tolist() == ["linear"]
    assert np.allclose(result.covariance[0], expected)


def test_flatness_is_the_slope_of_the_depression_by_finite_differences():
    """Exact, and on its own: the depression of a ray is turned by each source's small steps."""
    R_nb, mount = euler_to_matrix(0.2, -0.5, 0.7), Mount("forward", 0.9, -0.3, (0.1, -0.05, 0.02))
    R_bm = mount_rotation(mount)
    R_mc, uv, h = R_bm.T @ camera_rotation(mount), np.array([600.0, 480.0]), 1e-6

    def depression(pixel=ZERO[:2], attitude=ZERO, wobble=ZERO):
        R = R_nb @ rotation_vector_to_matrix(attitude) @ R_bm @ rotation_vector_to_matrix(wobble) @ R_mc
        north, east, down = R @ [*normalise(BENT, uv + pixel), 1.0]
        return np.arctan2(down, np.hypot(north, east))

    def slope(name: str, size: int):
        return np.array(
            [(depression(**{name: h * e}) - depression(**{name: -h * e})) / (2 * h) for e in np.eye(size)]
        )

    pose, none = CameraPoses(BENT, mount, ZERO, R_nb), errors(0.0, pixel=0.0)
    for field, name, size in (("pixel", "pixel", 2), ("pose", "attitude", 3), ("mount", "wobble", 3)):
        A = np.random.default_rng(size).normal(size=(size, size))
        spread = 1e-4 * A @ A.T
        given = np.kron(np.diag([0.0, 1.0]), spread) if field == "pose" else spread
        expected = np.sqrt(slope(name, size) @ spread @ slope(name, size)) / np.tan(depression())
        found = ray_flatness(pose, [uv], none._replace(**{field: given}))[0]
        assert found == pytest.approx(expected, rel=1e-6), field


def test_samples_scatter_about_the_point_as_the_derivatives_say():
    """Turned mount with a lever arm, bent lens, errors that are small and differ from axis to axis."""
    rng = np.random.default_rng(6)
    pose = CameraPoses(BENT, TURNED, np.array([5.0, -3.0, -20.0]), euler_to_matrix(0.2, -0.3, 0.7))
    uv = np.array([500.0, 100.0])
    A, B = rng.normal(size=(6, 6)), rng.normal(size=(3, 3))
    sd = np.repeat([0.01, 0.001], 3)
    e = PoseErrors(np.diag([0.2, 0.5]) ** 2, sd[:, None] * A @ A.T * sd, 1e-6 * B @ B.T, 0.02**2)
    draws = sample_ground(pose, uv, 1.0, e, rng, 100_000)[:, :2]
    stated = ground_covariance(pose, uv, 1.0, e, rng)
    assert stated.method.tolist() == ["linear"]
    C = stated.covariance[0]
    assert np.abs(np.cov(draws.T) - C).max() < 0.03 * np.abs(C).max()
    assert np.allclose(draws.mean(axis=0), georeference_pixels(pose, uv, 1.0)[:2], atol=1e-3)


@pytest.mark.parametrize("pitch_deg", [-90, -40, -25, -20, -15])
@pytest.mark.parametrize("attitude_deg", [0.2, 1.0, 2.0])
def test_ninety_per_cent_ellipses_hold_ninety_per_cent(pitch_deg, attitude_deg):
    """Independent draws against each ellipse, the pixel anywhere in the middle of the image."""
    rng = np.random.default_rng([abs(pitch_deg), int(10 * attitude_deg)])
    mount, e = Mount("forward"), errors(attitude_deg, mount_deg=0.1)
    p, R = np.array([3.0, -2.0, -120.0]), euler_to_matrix(0.05, np.radians(pitch_deg), rng.uniform(-3, 3))
    pose = CameraPoses(TAU2, mount, p, R)
    for uv in (np.array([TAU2.cx, TAU2.cy]), np.array([200.0, 300.0])):
        result = ground_covariance(pose, uv, 0.0, e, rng)
        centre = georeference_pixels(pose, uv, 0.0)[:2]
        draws = sample_ground(pose, uv, 0.0, e, rng, 8000)[:, :2]
        share = inside_ellipse(draws - centre, result.covariance[0]).mean()
        assert 0.85 <= share <= 0.95, (result.method, share)


def test_flat_rays_are_sampled_and_hopeless_ones_refused():
    mount, e = Mount("forward"), errors(2.0)
    pitches = np.radians([-60.0, -15.0, -3.0, 10.0])
    R = euler_to_matrix(np.zeros(4), pitches, np.zeros(4))
    uv = np.tile([TAU2.cx, TAU2.cy], (4, 1))
    poses = CameraPoses(TAU2, mount, np.array([0, 0, -100.0]), R)
    result = ground_covariance(poses, uv, 0.0, e, np.random.default_rng(0))
    assert result.method.tolist() == ["linear", "sampled", "unbounded", "none"]
    assert np.isfinite(result.covariance[:2]).all()
    assert np.isnan(result.covariance[2:]).all()


def test_ellipse_axes_against_eigenvalues():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(50, 2, 2))
    C = A @ np.swapaxes(A, 1, 2)
    long_axis, short_axis, bearing = ellipse_axes(C)
    values, vectors = np.linalg.eigh(C)
    scale = -2 * np.log(0.1)  # chi-square with two degrees of freedom is an exponential
    assert np.allclose(long_axis**2, scale * values[:, 1])
    assert np.allclose(short_axis**2, scale * values[:, 0], atol=1e-9)
    along = np.stack([np.cos(bearing), np.sin(bearing)], -1)
    assert np.allclose(np.abs(np.einsum("ni,ni->n", along, vectors[:, :, 1])), 1)
