"""What a camera along a way detects of animals that walk, and what images could have shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wildlab.analysis.plan_coverage import ExecutionErrors
from wildlab.geometry.camera import Camera, in_image, normalise
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array, Indices, Mask, euler_to_matrix
from wildlab.geometry.georeference import Terrain, ground_to_pixel, intersect_terrain, pixel_rays
from wildlab.geometry.uncertainty import PoseErrors, ground_covariance
from wildlab.geometry.viewsheds import lines_clear

#: Further than this from the camera nothing is looked for, m: where its image shows the horizon.
FURTHEST = 150.0
#: Points are this far above the ground when lines of sight are asked for, m: they lie on it otherwise.
ABOVE = 0.05
#: By how much a circle about a footprint is wider than its corners need.
WIDER = 1.2

#: Places (..., 2) m -> probability that an image has a detection of an animal that is there.
Sight = Callable[[Array], Array]


class Detector(NamedTuple):
    """What becomes of an animal in an image.

    Attributes
    ----------
    detected
        Probability that an image that shows its middle has a detection of it.
    sd
        Of the detection, each axis, px.
    border
        How far inside the image the middle must be, px.
    height
        Of the middle above the ground, m.
    """

    detected: float
    sd: float
    border: float
    height: float


class Images(NamedTuple):
    """A way with all that its images say; T images, A animals, D detections.

    Attributes
    ----------
    times
        (T,) s, ascending.
    poses
        Where the camera was, as far as is known: T rows.
    z, R
        (D, 2) m and (D, 2, 2) m^2: detections on the ground; NaN where a ray met none.
    image
        (D,) which image each is in, ascending.
    animal
        (D,) whose each is, which the tracks are not nominal; -1 for a detection of no animal.
    truth
        (T, A, 2) m.
    in_view
        (T, A) bool: whether an image truly shows an animal.
    """

    times: Array
    poses: CameraPoses
    z: Array
    R: Array
    image: Indices
    animal: Indices
    truth: Array
    in_view: Mask

    def taken(self, image: int) -> tuple[Array, Array, Indices]:
        """Detections, covariances and animals of one image."""
        rows = slice(*np.searchsorted(self.image, [image, image + 1]))
        return self.z[rows], self.R[rows], self.animal[rows]

    def first(self, count: int) -> Images:
        """So many images from the beginning."""
        rows = slice(0, int(np.searchsorted(self.image, count)))
        return Images(
            self.times[:count], self.poses.take(slice(0, count)), self.z[rows], self.R[rows],
            self.image[rows], self.animal[rows], self.truth[:count], self.in_view[:count],
        )  # fmt: skip


def pose_errors(errors: ExecutionErrors, sd: float, R_nc: Array, headings: Array) -> PoseErrors:
    """The errors of a way as `ground_covariance` takes them of poses at the lens.

    Parameters
    ----------
    errors
        Of the way; its angles are about the axes of a level platform.
    sd
        Of detections, px.
    R_nc
        (N, 3, 3) attitudes of the camera, in whose own axes errors of the attitude are nominal.
    headings
        (N,) of the platform, rad.

    Returns
    -------
    PoseErrors
    """
    # Columns: the platform's axes in n, ahead, to the right and down.
    axes = euler_to_matrix(0.0, 0.0, headings)
    turned = np.swapaxes(R_nc, -1, -2) @ axes * [errors.roll, errors.pitch, errors.yaw]
    pose = np.zeros((len(headings), 6, 6))
    pose[:, range(3), range(3)] = np.square([errors.horizontal, errors.horizontal, errors.vertical])
    pose[:, 3:, 3:] = turned @ np.swapaxes(turned, -1, -2)
    return PoseErrors(pixel=sd**2 * np.eye(2), pose=pose, mount=np.zeros((3, 3)), plane=0.0)


def shown(
    terrain: Terrain, camera: Camera, p_nc: ArrayLike, R_nc: ArrayLike, places: ArrayLike, detector: Detector
) -> Mask:
    """Which places an image shows: inside its border, not too far, and with nothing in between.

    Parameters
    ----------
    terrain
        The ground.
    camera
        Intrinsic parameters.
    p_nc, R_nc
        Pose of the camera, (3,) and (3, 3), or one for each place.
    places
        (N, 2) m, of animals.
    detector
        Height of their middles, and the border.

    Returns
    -------
    (N,) bool
    """
    at = np.asarray(places, float).reshape(-1, 2)
    p = np.broadcast_to(np.asarray(p_nc, float), (len(at), 3))
    near = np.flatnonzero(np.hypot(*(at - p[:, :2]).T) < FURTHEST)
    found = np.zeros(len(at), bool)
    if not len(near):
        return found
    R = np.asarray(R_nc, float)
    points = np.column_stack([at[near], -terrain.heights_at(at[near]) - detector.height])
    uv = ground_to_pixel(camera, points, p[near], R if R.ndim == 2 else R[near])
    inside = in_image(camera, uv, detector.border)
    hit = near[inside]
    if len(hit):
        found[hit] = lines_clear(terrain, points[inside] - [0.0, 0.0, ABOVE], p[hit])
    return found


def take_images(
    terrain: Terrain,
    nominal: CameraPoses,
    true: CameraPoses,
    headings: Array,
    times: ArrayLike,
    truth: Array,
    errors: ExecutionErrors,
    detector: Detector,
    rng: np.random.Generator,
) -> Images:
    """Detections of animals along a way: seen from where the camera is, put where it is said to be.

    Parameters
    ----------
    terrain
        The ground.
    nominal, true
        Poses as they are known, and as they are; T rows.
    headings
        (T,) of the platform, rad.
    times
        (T,) s.
    truth
        (T, A, 2) m.
    errors
        Of the nominal poses, which each detection's covariance follows from.
    detector
        What becomes of an animal in an image.
    rng
        Random numbers.

    Returns
    -------
    Images
        Without false detections.
    """
    places = np.asarray(truth, float)
    T, A = places.shape[:2]
    image, animal = (one.ravel() for one in np.meshgrid(np.arange(T), np.arange(A), indexing="ij"))
    in_view = shown(
        terrain, true.camera, true.p_nc[image], true.R_nc[image], places.reshape(-1, 2), detector
    ).reshape(T, A)
    image, animal = np.nonzero(in_view & (rng.random((T, A)) < detector.detected))
    z, R = np.zeros((0, 2)), np.zeros((0, 2, 2))
    if len(image):
        z, R = put_on_ground(
            terrain,
            nominal.take(image),
            true.take(image),
            headings[image],
            places[image, animal],
            errors,
            detector,
            rng,
        )
    return Images(np.asarray(times, float), nominal, z, R, image, animal, places, in_view)


def put_on_ground(
    terrain: Terrain,
    nominal: CameraPoses,
    true: CameraPoses,
    headings: Array,
    places: Array,
    errors: ExecutionErrors,
    detector: Detector,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Detections (D, 2) m of animals at places (D, 2), and their covariances (D, 2, 2) m^2.

    There is a pose and a heading for each. The covariance takes the ground about a detection as level.
    """
    points = np.column_stack([places, -terrain.heights_at(places) - detector.height])
    uv = ground_to_pixel(true.camera, points, true.p_nc, true.R_nc)
    uv = uv + detector.sd * rng.standard_normal(uv.shape)
    # Rays from a camera so much lower meet the ground where middles above it are looked at.
    up = np.array([0.0, 0.0, detector.height])
    rays = pixel_rays(nominal.camera, uv, nominal.R_nc)
    met = intersect_terrain(terrain, rays, nominal.p_nc + up).points - up
    assumed = pose_errors(errors, detector.sd, nominal.R_nc, headings)
    return met[:, :2], ground_covariance(nominal, uv, met[:, 2], assumed, rng).covariance


def footprint_circles(terrain: Terrain, poses: CameraPoses) -> tuple[Array, Array]:
    """A circle that holds what each image shows: middles (T, 2) m and radii (T,) m.

    Rays through the corners and the middles of the sides are followed to the ground, or to `FURTHEST` where
    they do not meet it; `WIDER` allows for ground between them that lies higher.
    """
    camera = poses.camera
    u, v = np.meshgrid([0.0, camera.width / 2, camera.width], [0.0, camera.height / 2, camera.height])
    rays = np.column_stack([normalise(camera, np.column_stack([u.ravel(), v.ravel()])), np.ones(u.size)])
    T, K = len(poses.p_nc), len(rays)
    directions = np.einsum("tij,kj->tki", poses.R_nc, rays / np.linalg.norm(rays, axis=1, keepdims=True))
    starts = np.broadcast_to(poses.p_nc[:, None], directions.shape)
    met = intersect_terrain(terrain, directions.reshape(-1, 3), starts.reshape(-1, 3), FURTHEST).points
    ends = np.where(np.isfinite(met), met, (starts + FURTHEST * directions).reshape(-1, 3))
    flat = ends.reshape(T, K, 3)[..., :2]
    middle = flat.mean(axis=1)
    radius = np.linalg.norm(flat - middle[:, None], axis=-1).max(axis=1)
    return middle, np.asarray(WIDER * radius + 2 * terrain.step)


def sight_from(terrain: Terrain, camera: Camera, p_nc: Array, R_nc: Array, detector: Detector) -> Sight:
    """Probability that an image has a detection of an animal at a place, as far as its pose is known.

    Parameters
    ----------
    terrain
        The ground.
    camera
        Intrinsic parameters.
    p_nc, R_nc
        (3,) and (3, 3), the pose.
    detector
        What becomes of an animal in an image.

    Returns
    -------
    Sight
    """

    def sight(places: Array) -> Array:
        seen = shown(terrain, camera, p_nc, R_nc, places, detector)
        return np.where(seen, detector.detected, 0.0).reshape(places.shape[:-1])

    return sight
