"""What the camera takes and what is found in its images: frames, and detections of targets seen as points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from wildlab.errors import WildlabError
from wildlab.geometry.camera import in_image
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.geometry.viewsheds import lines_clear
from wildlab.simulation.error_models import computer_stamps, stream
from wildlab.simulation.landscape import ground_heights, twin_land
from wildlab.simulation.manifest import true_mount, twin_manifest
from wildlab.simulation.onboard_sensors import gimbal_angles
from wildlab.simulation.parameters import Group, TwinParameters
from wildlab.simulation.target_motion import animal_paths, target_outline, target_path
from wildlab.simulation.trajectory import Motion

#: Numbers of images.
Numbers = NDArray[np.intp]


class Exposures:
    """The camera at N exposures: their ``times`` (N,) s, and its true ``poses``."""

    def __init__(self, twin: TwinParameters, true: Motion) -> None:
        self.times = true.times
        camera = twin_manifest(twin, 0).geometry_camera()
        angles = (None, None) if twin.gimbal is None else gimbal_angles(twin.gimbal, true.times)
        self.poses = CameraPoses(camera, true_mount(twin), true.position, true.R_nb, *angles)
        self._marking_sd = twin.camera.marking_sd.si

    def pixels(self, points: ArrayLike) -> Array:
        """Where points in n, (N, 3) m, one for each exposure, are in the images: (N, 2) px; NaN behind."""
        return ground_to_pixel(self.poses.camera, points, self.poses.p_nc, self.poses.R_nc)

    def marked(self, pixels: ArrayLike, rng: np.random.Generator) -> Array:
        """Pixels (K, 2) as they are marked, with noise; nobody marks outside of the image."""
        uv = np.asarray(pixels, float)
        noisy = uv + self._marking_sd * rng.standard_normal(uv.shape)
        return np.clip(noisy, 0.0, [self.poses.camera.width, self.poses.camera.height])


def marks(
    frames: pd.DataFrame, images: Numbers, marked: Array, source: str, target: str, plane_down: float | Array
) -> pd.DataFrame:
    """Rows of detections of one target: in which of the images, (K,), and where, (K, 2) px."""
    return pd.DataFrame(
        {
            "detection_id": "",
            "frame_id": frames["frame_id"].to_numpy()[images],
            "source": source,
            "kind": "pixel",
            "u_px": marked[:, 0],
            "v_px": marked[:, 1],
            "target_id": target,
            "plane_down_m": plane_down,
        }
    )


def numbered(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Detections of several targets in the order of the images, each with its own number."""
    together = pd.concat(tables).sort_values("frame_id", kind="stable", ignore_index=True)
    together["detection_id"] = [f"d{number:06d}" for number in range(1, len(together) + 1)]
    return together


class Blob(NamedTuple):
    """The visible part of an outline.

    Attributes
    ----------
    centre
        (2,) px; NaN where nothing shows.
    area
        px^2.
    major, minor
        Full axes of the ellipse with the same second moments (H 4.5, 4.6), px.
    angle
        Of the major axis, from u towards v, rad, within a quarter turn of u.
    cut
        Whether the edge of the image cuts the outline.
    """

    centre: Array
    area: float
    major: float
    minor: float
    angle: float
    cut: bool


NOTHING = Blob(np.full(2, np.nan), 0.0, np.nan, np.nan, np.nan, False)


def clip_polygon(polygon: ArrayLike, width: float, height: float) -> Array:
    """The part of a convex polygon within an image, by cutting it at one edge after the other.

    Parameters
    ----------
    polygon
        (K, 2) corners in order, either way round.
    width, height
        The image reaches from 0 to these.

    Returns
    -------
    (M, 2) corners in the same order; (0, 2) where nothing is left.
    """
    corners = np.asarray(polygon, float)
    for axis, limit, side in ((0, 0.0, 1.0), (0, width, -1.0), (1, 0.0, 1.0), (1, height, -1.0)):
        if len(corners) == 0:
            break
        inside = side * (corners[:, axis] - limit)
        kept: list[Array] = []
        for here, there, d_here, d_there in zip(
            corners, np.roll(corners, -1, axis=0), inside, np.roll(inside, -1), strict=True
        ):
            if d_here >= 0:
                kept.append(here)
            if (d_here > 0 > d_there) or (d_here < 0 < d_there):
                cut = here + d_here / (d_here - d_there) * (there - here)
                cut[axis] = limit
                kept.append(cut)
        corners = np.array(kept).reshape(-1, 2)
    return corners


def moments(polygon: ArrayLike) -> tuple[float, Array, Array]:
    """Area, centroid (2,) and covariance (2, 2) of the area within a polygon (K, 2) without crossings."""
    corners = np.asarray(polygon, float)
    middle = corners.mean(axis=0)  # about it, so that little is lost where the polygon lies far from zero
    a = corners - middle
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = cross.sum() / 2
    centre = ((a + b) * cross[:, None]).sum(axis=0) / (6 * area)
    both = a + b
    second = np.einsum("k,ki,kj->ij", cross, a, a) + np.einsum("k,ki,kj->ij", cross, b, b)
    second = (second + np.einsum("k,ki,kj->ij", cross, both, both)) / (24 * area)
    return float(abs(area)), middle + centre, second - np.outer(centre, centre)


def visible_part(polygon: ArrayLike, width: float, height: float) -> Blob:
    """What an image shows of a convex outline with corners (K, 2) px; a corner that is NaN shows nothing."""
    corners = np.asarray(polygon, float)
    if not np.isfinite(corners).all():
        return NOTHING
    shown = clip_polygon(corners, width, height)
    if len(shown) < 3:
        return NOTHING
    area, centre, covariance = moments(shown)
    if not area > 1e-9:
        return NOTHING
    sizes, axes = np.linalg.eigh(covariance)
    along = axes[:, 1]
    angle = float(np.arctan(along[1] / along[0])) if along[0] != 0 else np.pi / 2
    minor, major = 4 * np.sqrt(np.maximum(sizes, 0.0))
    outside = (corners < 0) | (corners > [width, height])
    return Blob(centre, area, float(major), float(minor), angle, bool(outside.any()))


def animal_detections(
    twin: TwinParameters, animals: Group, view: Exposures, frames: pd.DataFrame, seed: int
) -> pd.DataFrame:
    """Animals as they are marked, where no hill hides them. How high a body is above the ground is not known.

    Raises
    ------
    WildlabError
        Where no image shows any.
    """
    tables, land = [], twin_land(twin)
    for name, path in animal_paths(twin, seed).items():
        points = path(view.times)
        uv = view.pixels(points)
        rng = stream(seed, f"marking of {name}")
        inside = in_image(view.poses.camera, uv, animals.border.si)
        found = inside & (rng.random(len(uv)) < animals.detected.number)
        if land is not None:
            there = np.flatnonzero(found)
            found[there] = lines_clear(land, points[there], view.poses.p_nc[there])
        images = np.flatnonzero(found)
        marked = view.marked(uv[images], rng)
        # Without a map of the ground one would take it for as high as it is under the aircraft.
        under = -ground_heights(twin, view.poses.p_nc[images, :2])
        tables.append(marks(frames, images, marked, animals.marked_by.text, name, under))
    detections = numbered(tables)
    if detections.empty:
        raise WildlabError(
            "no animal comes into view",
            "lay the course over the enclosures, or raise camera.images",
            field="animals",
        )
    return detections


_APART = 5.0  # s without the target in view, after which it is another segment


def extended_target_frames_and_detections(
    twin: TwinParameters, target: Group, view: Exposures, frames: pd.DataFrame, seed: int
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The images of the segments, and the visible part of the target where most of it shows.

    A frame's group is its segment. A detection has the size of what was found, and whether the edge of the
    image cuts it.

    Raises
    ------
    WildlabError
        Where the target is not in view in so many images, or in another number of segments.
    """
    blobs = _visible(view, target, seed)
    images, segment = _kept(twin.segments, view, blobs, fewer=twin.moved_from is not None)
    areas = np.array([blobs[image].area for image in images])
    wanted = int(target.observations.number)
    found = np.sort(np.argsort(-areas, kind="stable")[:wanted])
    chosen = images[found]
    shown = [blobs[image] for image in chosen]
    marked = view.marked(np.array([blob.centre for blob in shown]), stream(seed, "marking"))
    table = marks(frames, chosen, marked, target.marked_by.text, target.identifier.text, -target.height.si)
    table = table.assign(
        area_px=[blob.area for blob in shown],
        major_px=[blob.major for blob in shown],
        minor_px=[blob.minor for blob in shown],
        angle_rad=[blob.angle for blob in shown],
        touches_border=[float(blob.cut) for blob in shown],
    )
    groups = np.array([f"segment-{number + 1}" for number in segment], object)
    return frames.iloc[images].assign(group=groups).reset_index(drop=True), numbered([table])


def _visible(view: Exposures, target: Group, seed: int) -> list[Blob]:
    """Of every image what it shows of the target."""
    corners = target_outline(target, seed)(view.times)
    pixels = np.stack([view.pixels(corners[:, i]) for i in range(corners.shape[1])], axis=1)
    size = [view.poses.camera.width, view.poses.camera.height]
    beside = (pixels.max(axis=1) < 0) | (pixels.min(axis=1) > size)
    blobs = []
    for polygon, out in zip(pixels, beside.any(axis=1), strict=True):
        blobs.append(NOTHING if out else visible_part(polygon, *size))
    return blobs


def _kept(segments: Group, view: Exposures, blobs: list[Blob], *, fewer: bool) -> tuple[Numbers, Numbers]:
    """Numbers of the images that are kept, the first ones that show the target, and of their segments.

    ``fewer`` says that there may be fewer images than asked for, in another number of segments.
    """
    seen = np.flatnonzero([blob.area > 0 for blob in blobs])
    wanted, count = int(segments.images.number), int(segments.count.number)
    if len(seen) < wanted and not (fewer and len(seen)):
        raise WildlabError(
            f"the target is in view in {len(seen)} images only, not in {wanted}",
            "lower segments.images, or raise camera.images and flight.duration",
            field="segments.images",
        )
    seen = seen[:wanted]
    segment = np.concatenate([[0], np.cumsum(np.diff(view.times[seen]) > _APART)])
    if segment[-1] + 1 != count and not fewer:
        raise WildlabError(
            f"the first {wanted} images that show the target are {segment[-1] + 1} segments, not {count}",
            "change segments.count, or how fast the target is passed",
            field="segments.count",
        )
    return seen, segment


#: Column of the frames that holds the on-board computer's stamps.
ONBOARD_STAMP = "time_onboard_s"
#: Group of the frames from the first to the last detection of a twin's subset.
SUBSET = "subset"


def exposure_times(twin: TwinParameters) -> Array:
    """When each image is taken, (N,) s."""
    camera = twin.camera
    return np.asarray(camera.recording_start.si + np.arange(int(camera.images.number)) / camera.frame_rate.si)


def frames_and_detections(twin: TwinParameters, true: Motion, seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The images and what is found in them, in the order of the images.

    Parameters
    ----------
    true
        Motion of the airframe at the exposures.

    Raises
    ------
    WildlabError
        Where a target is not in view often enough.
    """
    frames = frames_table(twin, true.times, seed)
    view = Exposures(twin, true)
    if twin.animals is not None:
        return frames, animal_detections(twin, twin.animals, view, frames, seed)
    if twin.target is not None and twin.target.outline is not None:
        return extended_target_frames_and_detections(twin, twin.target, view, frames, seed)
    detections = detections_table(twin, view, frames, seed)
    return with_subset(twin, frames, detections), detections


def frames_table(twin: TwinParameters, exposures: Array, seed: int) -> pd.DataFrame:
    """Images with the camera's synchronised stamps and the on-board computer's, where there are both."""
    clock, camera = twin.onboard_clock, twin.camera
    stamps = exposures + camera.latency.si
    frames = pd.DataFrame({"frame_id": [f"f{number:06d}" for number in range(1, len(exposures) + 1)]})
    if clock is None:
        return frames.assign(time_s=stamps)
    rng = stream(seed, "on-board clock")
    onboard = computer_stamps(stamps, clock.offset.si, clock.drift.si, clock.latency.si, rng)
    if camera.stamped_by is not None and camera.stamped_by.text == "computer":
        return frames.assign(time_s=onboard)
    return frames.assign(time_s=stamps, **{ONBOARD_STAMP: onboard})


def detections_table(twin: TwinParameters, view: Exposures, frames: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Targets as they are marked in the images, in the order of the images.

    Raises
    ------
    WildlabError
        Where a target is not in view often enough.
    """
    pixels = [view.pixels(target_path(target, seed)(view.times)) for target in twin.targets]
    views = [_in_view(twin, view, target, uv) for target, uv in zip(twin.targets, pixels, strict=True)]
    tables = []
    for which, chosen in enumerate(_chosen(twin, views, seed)):
        target = twin.targets[which]
        rng = stream(seed, "marking" if which == 0 else f"marking of {target.identifier.text}")
        marked = view.marked(pixels[which][chosen], rng)
        tables.append(
            marks(frames, chosen, marked, target.marked_by.text, target.identifier.text, -target.height.si)
        )
    return numbered(tables)


def with_subset(twin: TwinParameters, frames: pd.DataFrame, detections: pd.DataFrame) -> pd.DataFrame:
    """The frames with their group, where the twin has a subset; else as they are."""
    if twin.subset is None:
        return frames
    first = int(twin.subset.first.number) - 1
    last = first + int(twin.subset.observations.number) - 1
    ends = detections["frame_id"].to_numpy()
    if twin.moved_from is not None:  # with fewer detections it ends with the last of them
        last = min(last, len(ends) - 1)
    if first > last:
        raise WildlabError(
            f"the subset begins with detection {first + 1}, and there are {len(ends)}",
            "lower subset.first, or raise target.observations",
            field="subset.first",
        )
    inside = frames["frame_id"].between(ends[first], ends[last])
    return frames.assign(group=np.where(inside, SUBSET, "").astype(object))


def _in_view(twin: TwinParameters, view: Exposures, target: Group, uv: Array) -> Numbers:
    """Numbers of the images that show the target, (K,)."""
    seen = np.flatnonzero(in_image(view.poses.camera, uv, target.border.si))
    wanted = int(target.observations.number)
    if len(seen) < wanted and (twin.moved_from is None or not len(seen)):
        group = "target" if target is twin.target else "second_target"
        nearer = "loiter.radius" if twin.loiter is not None else "route.length"
        raise WildlabError(
            f"the target is in view in {len(seen)} images only, not in {wanted}",
            f"lower {group}.observations or {nearer}, or raise camera.images",
            field=f"{group}.observations",
        )
    return seen


def _chosen(twin: TwinParameters, views: list[Numbers], seed: int) -> list[Numbers]:
    """Those of the images that show a target in which it is marked, per target."""
    # Where a twin was moved there may be fewer.
    wanted = [
        min(int(target.observations.number), len(images))
        for target, images in zip(twin.targets, views, strict=True)
    ]
    if twin.pair is not None:
        both, rng = int(twin.pair.both.number), stream(seed, "misses")
        return _pair_chosen(views, wanted, both, rng, fewer=twin.moved_from is not None)
    if twin.targets[0].choice.text == "first":
        return [views[0][: wanted[0]]]
    return [np.sort(stream(seed, "misses").choice(views[0], wanted[0], replace=False))]


def _pair_chosen(
    views: list[Numbers], wanted: list[int], both: int, rng: np.random.Generator, *, fewer: bool
) -> list[Numbers]:
    """Images for each of two targets, of which just ``both`` are common; ``fewer`` where there are not so
    many, if that is allowed."""
    in_common = np.intersect1d(views[0], views[1])
    if fewer:
        both = min(both, len(in_common), *wanted)
    if len(in_common) < both:
        raise WildlabError(
            f"both targets are in view in {len(in_common)} images only, not in {both}",
            "lower pair.both, or bring the courses of the targets nearer to each other",
            field="pair.both",
        )
    together = rng.choice(in_common, both, replace=False)
    # The second target first: where it is marked alone, the first one has been missed if it is in view.
    second = rng.choice(np.setdiff1d(views[1], together), wanted[1] - both, replace=False)
    left = np.setdiff1d(views[0], np.concatenate([together, second]))
    if fewer:
        wanted = [min(wanted[0], both + len(left)), wanted[1]]
    if len(left) < wanted[0] - both:
        raise WildlabError(
            f"the first target is left with {both + len(left)} images, not {wanted[0]}, where the second is "
            "marked in so many and both in so few",
            "lower the observations of either, or raise camera.images",
            field="target.observations",
        )
    first = rng.choice(left, wanted[0] - both, replace=False)
    return [np.sort(np.concatenate([together, alone])) for alone in (first, second)]
