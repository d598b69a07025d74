"""What the camera takes and what is found in its images: frames, and detections of targets seen as points."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.geometry.camera import in_image
from wildlab.geometry.frames import Array
from wildlab.simulation.animal_detections import animal_detections
from wildlab.simulation.camera_view import Exposures, Numbers, marks, numbered
from wildlab.simulation.error_models import computer_stamps, stream
from wildlab.simulation.extended_target_detections import extended_target_frames_and_detections
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.target_motion import target_path
from wildlab.simulation.target_parameters import Target
from wildlab.simulation.trajectory import Motion

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


def _in_view(twin: TwinParameters, view: Exposures, target: Target, uv: Array) -> Numbers:
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
