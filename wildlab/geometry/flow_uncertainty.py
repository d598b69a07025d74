"""How wrong a velocity from optical flow may be: a 2x2 covariance from all that it is computed from.

With the ray ``d`` (depth 1), its depth ``h = drop / d_z`` and ``w`` by which the ray turns, all in n, the
velocity over the plane is ``O (v + h w)``, where ``O = [I, -d_h / d_z]`` lets a vector slide along the ray
onto the plane. That is H (5.30) without an inverse, and its derivatives follow by hand.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.errors import WildlabError
from wildlab.geometry.camera import normalise, normalise_jacobian
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.flow import CameraMotion, camera_rates, gimbal_axes, lens_velocity, target_velocity
from wildlab.geometry.frames import Array, skew
from wildlab.geometry.georeference import matching


class FlowErrors(NamedTuple):
    """Covariances of what a velocity is computed from, each given once or in N rows. SI units and radians.

    Attributes
    ----------
    pixel, flow
        (2, 2) of where the feature is, px^2, and of its flow, (px/s)^2; of each feature on its own.
    pose
        (6, 6): position in n, rotation vector in b.
    mount
        (3, 3): rotation vector in m, after pan and tilt.
    velocity
        (3, 3) of the airframe's velocity in n, (m/s)^2.
    rates
        (3, 3) of its angular velocity in b, (rad/s)^2.
    gimbal_rates
        (2, 2) of pan and tilt, (rad/s)^2.
    plane
        Variance of the plane's height, m^2.
    interval
        Variance of the time between the images over its square: flow is a displacement over that time.
    """

    pixel: Array
    flow: Array
    pose: Array
    mount: Array
    velocity: Array
    rates: Array
    gimbal_rates: Array
    plane: Array | float
    interval: Array | float = 0.0


class FlowJacobians(NamedTuple):
    """Derivatives of the velocity, (N, 2) north and east, with respect to each source of error."""

    pixel: Array  # (N, 2, 2)
    flow: Array  # (N, 2, 2)
    pose: Array  # (N, 2, 6)
    mount: Array  # (N, 2, 3)
    velocity: Array  # (N, 2, 3)
    rates: Array  # (N, 2, 3)
    gimbal_rates: Array  # (N, 2, 2)
    plane: Array  # (N, 2)
    interval: Array  # (N, 2), with respect to the logarithm of the time between the images


class Velocity(NamedTuple):
    """A velocity over the plane, north and east: ``value`` (2,) m/s, ``covariance`` (2, 2)."""

    value: Array
    covariance: Array


def flow_jacobians(
    poses: CameraPoses, motion: CameraMotion, uv: ArrayLike, flow: ArrayLike, plane_down: ArrayLike
) -> FlowJacobians:
    """Derivatives of `wildlab.geometry.flow.target_velocity`, north and east.

    Parameters
    ----------
    poses, motion, uv, flow, plane_down
        As there; N pixels.

    Returns
    -------
    FlowJacobians
        Rows of rays that miss the plane are NaN.

    Raises
    ------
    WildlabError
        As there.
    """
    pixels, planes = matching(poses, uv, plane_down)
    measured = np.asarray(flow, float)
    camera, R, R_bc, R_bm = poses.camera, poses.R_nb, poses.R_bc, poses.R_bm
    xy = normalise(camera, pixels)
    by_pixel = normalise_jacobian(camera, xy)
    slide = np.einsum("...ij,...j->...i", by_pixel, measured)
    d_b = _apply(R_bc, np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1))
    x_b = _apply(R_bc, np.concatenate([slide, np.zeros((*xy.shape[:-1], 1))], axis=-1))
    rates = camera_rates(poses, motion)
    w_b = np.cross(rates, d_b) + x_b
    d_n, w_n = _apply(R, d_b), _apply(R, w_b)
    drop = np.broadcast_to(planes - poses.p_nc[..., 2], d_n.shape[:-1])
    hits = (d_n[..., 2] > 0) & (drop > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        steep = np.where(hits, d_n[..., 2], np.nan)
        depth = (drop / steep)[..., None, None]
        slope = d_n[..., :2] / steep[..., None]
    onto = np.concatenate([np.broadcast_to(np.eye(2), (*slope.shape, 2)), -slope[..., None]], axis=-1)
    moved = lens_velocity(poses, motion) + depth[..., 0] * w_n
    sink = (moved[..., 2] / steep)[..., None, None]

    def through(dd: Array, dw: Array, dv: Array | float = 0.0, dz: Array | float = 0.0) -> Array:
        """From derivatives (N, 3, k) of ray, of its turning and of the lens's velocity, and (N, k) of its
        height (down)."""
        deeper = -(np.asarray(dz) + depth[..., 0] * dd[..., 2, :]) / steep[..., None]
        change = dv + w_n[..., :, None] * deeper[..., None, :] + depth * dw - sink * dd
        return np.asarray(onto @ change)

    none = np.zeros((*d_n.shape, 3))
    eye = none + np.eye(3)
    R_all, lever = np.broadcast_to(R, none.shape), skew(poses.lever_arm)
    spin = skew(rates)
    by_ray = R_bc[..., :, :2] @ by_pixel
    by_flow = R_all @ by_ray
    along = R_all @ (spin @ by_ray + R_bc[..., :, :2] @ _bend(poses, pixels, measured))
    turned = -R_all @ skew(d_b)  # of the ray, by a turn of b: by its error, or a second of its rate
    around = np.cross(np.broadcast_to(np.asarray(motion.rates, float), d_n.shape), poses.lever_arm)
    pose = np.empty((*slope.shape, 6))
    pose[..., :3] = through(none, none, 0.0, eye[..., 2, :])
    pose[..., 3:] = through(turned, -R_all @ skew(w_b), -R_all @ skew(around), (-R_all @ lever)[..., 2, :])
    swung = -R_bm @ skew(np.einsum("...ji,...j->...i", R_bm, d_b))
    slid = -R_bm @ skew(np.einsum("...ji,...j->...i", R_bm, x_b))
    axes = gimbal_axes(poses.mount, poses.pan)
    flow_only = through(none[..., :2], by_flow)
    return FlowJacobians(
        pixel=through(by_flow, along),
        flow=flow_only,
        pose=pose,
        mount=through(R_all @ swung, R_all @ (spin @ swung + slid)),
        velocity=through(none, none, eye),
        rates=through(none, turned, -R_all @ lever),
        gimbal_rates=through(none[..., :2], turned @ axes),
        plane=through(none[..., :1], none[..., :1], 0.0, -np.ones((*d_n.shape[:-1], 1)))[..., 0],
        interval=-np.einsum("...ij,...j->...i", flow_only, measured),
    )


def _apply(R: Array, vectors: Array) -> Array:
    """(N, 3) turned by (N, 3, 3) or (3, 3)."""
    return np.asarray(np.einsum("...ij,...j->...i", R, vectors))


def _bend(poses: CameraPoses, uv: Array, flow: Array) -> Array:
    """How the same flow is another one of the ray elsewhere in the image, (N, 2, 2): zero without distortion.

    By central differences of the exact derivative, a hundredth of a pixel either way.
    """
    if not poses.camera.distorts:
        return np.zeros((*uv.shape, 2))
    columns = []
    for step in 0.01 * np.eye(2):
        there, here = (
            normalise_jacobian(poses.camera, normalise(poses.camera, uv + s)) for s in (step, -step)
        )
        columns.append(np.einsum("...ij,...j->...i", there - here, flow) / 0.02)
    return np.stack(columns, axis=-1)


def velocity_covariance(jacobians: FlowJacobians, errors: FlowErrors) -> Array:
    """Covariance of each velocity on its own, (N, 2, 2) (m/s)^2.

    Parameters
    ----------
    jacobians
        From `flow_jacobians`.
    errors
        Of the sources.

    Returns
    -------
    (N, 2, 2), NaN where the derivatives are.
    """
    return _own(jacobians, errors) + _shared(jacobians, errors)


def _own(J: FlowJacobians, errors: FlowErrors) -> Array:
    """What each feature has for itself."""
    return _carried(J.pixel, errors.pixel) + _carried(J.flow, errors.flow)


def _shared(J: FlowJacobians, errors: FlowErrors) -> Array:
    """What all features of a pair of images have in common."""
    return np.asarray(
        _carried(J.pose, errors.pose)
        + _carried(J.mount, errors.mount)
        + _carried(J.velocity, errors.velocity)
        + _carried(J.rates, errors.rates)
        + _carried(J.gimbal_rates, errors.gimbal_rates)
        + _outer(J.plane, errors.plane)
        + _outer(J.interval, errors.interval)
    )


def _carried(J: Array, covariance: Array) -> Array:
    return np.asarray(J @ covariance @ np.swapaxes(J, -1, -2))


def _outer(J: Array, variance: Array | float) -> Array:
    return np.asarray(np.asarray(variance)[..., None, None] * J[..., :, None] * J[..., None, :])


def mean_velocity(
    poses: CameraPoses,
    motion: CameraMotion,
    uv: ArrayLike,
    flow: ArrayLike,
    plane_down: ArrayLike,
    errors: FlowErrors,
) -> Velocity:
    """One velocity from all features of a target in one pair of images: their mean.

    Errors of pixels and flows are those of each feature, and average out; those of pose, motion, plane and
    interval are the same for all, and do not.

    Parameters
    ----------
    poses, motion, uv, flow, plane_down
        As for `wildlab.geometry.flow.target_velocity`, of one pair: one pose, N pixels.
    errors
        Each given once.

    Returns
    -------
    Velocity
        NaN where no ray meets the plane.

    Raises
    ------
    WildlabError
        Where there is more than one pose, or no feature.
    """
    pixels = np.asarray(uv, float)
    if poses.rows or pixels.ndim != 2 or not len(pixels):
        raise WildlabError(
            f"poses of the rows {poses.rows} for pixels of the shape {pixels.shape}",
            "give one pose and at least one feature, (N, 2)",
            field="poses",
        )
    velocities = target_velocity(poses, motion, pixels, flow, plane_down)
    J = flow_jacobians(poses, motion, pixels, flow, plane_down)
    there = np.isfinite(velocities).all(axis=1)
    if not there.any():
        return Velocity(np.full(2, np.nan), np.full((2, 2), np.nan))
    J = FlowJacobians(*(part[there] for part in J))
    own = _own(J, errors).mean(axis=0) / int(there.sum())
    middle = FlowJacobians(*(part.mean(axis=0) for part in J))
    return Velocity(velocities[there].mean(axis=0), own + _shared(middle, errors))
