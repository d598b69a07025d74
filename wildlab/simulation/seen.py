"""What the camera takes and what is found in its images: frames and detections."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.manifest import Manifest
from wildlab.geometry.camera import in_image
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import ground_to_pixel
from wildlab.geometry.mount import camera_pose
from wildlab.simulation.models import Target
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.sensors import computer_stamps, stream
from wildlab.simulation.targets import target_path
from wildlab.simulation.trajectory import Motion

#: Numbers of images.
Numbers = NDArray[np.intp]

#: Column of the frames that holds the on-board computer's stamps.
ONBOARD_STAMP = "time_onboard_s"
#: Group of the frames from the first to the last detection of a twin's subset.
SUBSET = "subset"


def exposure_times(twin: TwinParameters) -> Array:
    """When each image is taken, (N,) s."""
    camera = twin.camera
    return np.asarray(camera.recording_start.si + np.arange(int(camera.images.number)) / camera.frame_rate.si)


def frames_table(twin: TwinParameters, exposures: Array, seed: int) -> pd.DataFrame:
    """Images with the camera's synchronised stamps and the on-board computer's."""
    clock = twin.onboard_clock
    stamps = exposures + twin.camera.latency.si
    return pd.DataFrame(
        {
            "frame_id": [f"f{number:06d}" for number in range(1, len(exposures) + 1)],
            "time_s": stamps,
            ONBOARD_STAMP: computer_stamps(
                stamps,
                clock.offset.si,
                clock.drift.si,
                clock.latency.si,
                stream(seed, "on-board clock"),
            ),
        }
    )


def detections_table(
    twin: TwinParameters, manifest: Manifest, true: Motion, frames: pd.DataFrame, seed: int
) -> pd.DataFrame:
    """Targets as they are marked in the images, in the order of the images.

    Parameters
    ----------
    true
        Motion of the airframe at the exposures of ``frames``.

    Raises
    ------
    WildlabError
        Where a target is not in view often enough.
    """
    pixels = [_pixels(manifest, target, true, seed) for target in twin.targets]
    camera = manifest.geometry_camera()
    views = [_in_view(twin, manifest, target, uv) for target, uv in zip(twin.targets, pixels, strict=True)]
    tables = []
    for which, chosen in enumerate(_chosen(twin, views, seed)):
        target = twin.targets[which]
        rng = stream(seed, "marking" if which == 0 else f"marking of {target.identifier.text}")
        marked = pixels[which][chosen] + twin.camera.marking_sd.si * rng.standard_normal((len(chosen), 2))
        # Nobody marks outside of the image.
        marked = np.clip(marked, 0.0, [camera.width, camera.height])
        tables.append(
            pd.DataFrame(
                {
                    "detection_id": "",
                    "frame_id": frames["frame_id"].to_numpy()[chosen],
                    "source": target.marked_by.text,
                    "kind": "pixel",
                    "u_px": marked[:, 0],
                    "v_px": marked[:, 1],
                    "target_id": target.identifier.text,
                    "plane_down_m": -target.height.si,
                }
            )
        )
    together = pd.concat(tables).sort_values("frame_id", kind="stable", ignore_index=True)
    together["detection_id"] = [f"d{number:06d}" for number in range(1, len(together) + 1)]
    return together


def with_subset(twin: TwinParameters, frames: pd.DataFrame, detections: pd.DataFrame) -> pd.DataFrame:
    """The frames with their group, where the twin has a subset; else as they are."""
    if twin.subset is None:
        return frames
    first = int(twin.subset.first.number) - 1
    last = first + int(twin.subset.observations.number) - 1
    ends = detections["frame_id"].to_numpy()
    inside = frames["frame_id"].between(ends[first], ends[last])
    return frames.assign(group=np.where(inside, SUBSET, "").astype(object))


def _pixels(manifest: Manifest, target: Target, true: Motion, seed: int) -> Array:
    """Where the target is in each image, (N, 2) px; NaN behind the camera."""
    p_nc, R_nc = camera_pose(manifest.geometry_mount(), true.position, true.R_nb)
    return ground_to_pixel(manifest.geometry_camera(), target_path(target, seed)(true.times), p_nc, R_nc)


def _in_view(twin: TwinParameters, manifest: Manifest, target: Target, uv: Array) -> Numbers:
    """Numbers of the images that show the target, (K,)."""
    seen = np.flatnonzero(in_image(manifest.geometry_camera(), uv, target.border.si))
    wanted = int(target.observations.number)
    if len(seen) < wanted:
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
    wanted = [int(target.observations.number) for target in twin.targets]
    if twin.pair is not None:
        return _pair_chosen(views, wanted, int(twin.pair.both.number), stream(seed, "misses"))
    if twin.target.choice.text == "first":
        return [views[0][: wanted[0]]]
    return [np.sort(stream(seed, "misses").choice(views[0], wanted[0], replace=False))]


def _pair_chosen(
    views: list[Numbers], wanted: list[int], both: int, rng: np.random.Generator
) -> list[Numbers]:
    """Images for each of two targets, of which just ``both`` are common."""
    in_common = np.intersect1d(views[0], views[1])
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
    if len(left) < wanted[0] - both:
        raise WildlabError(
            f"the first target is left with {both + len(left)} images, not {wanted[0]}, where the second is "
            "marked in so many and both in so few",
            "lower the observations of either, or raise camera.images",
            field="target.observations",
        )
    first = rng.choice(left, wanted[0] - both, replace=False)
    return [np.sort(np.concatenate([together, alone])) for alone in (first, second)]
