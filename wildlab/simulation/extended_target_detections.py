"""A target of which many images show a part only: what is found is the middle of that part (H 4.3, 6.4.1)."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.errors import WildlabError
from wildlab.simulation.camera_view import Exposures, Numbers, marks, numbered
from wildlab.simulation.clipped_outlines import NOTHING, Blob, visible_part
from wildlab.simulation.error_models import stream
from wildlab.simulation.parameters import TwinParameters
from wildlab.simulation.target_motion import target_outline
from wildlab.simulation.target_parameters import Segments, Target

_APART = 5.0  # s without the target in view, after which it is another segment


def extended_target_frames_and_detections(
    twin: TwinParameters, target: Target, view: Exposures, frames: pd.DataFrame, seed: int
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The images of the segments, and the visible part of the target where most of it shows.

    A frame's group is its segment. A detection has the size of what was found, and whether the edge of the
    image cuts it.

    Raises
    ------
    WildlabError
        Where the target is not in view in so many images, or in another number of segments.
    """
    if twin.segments is None:
        raise ValueError("a target with an outline needs segments")
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


def _visible(view: Exposures, target: Target, seed: int) -> list[Blob]:
    """Of every image what it shows of the target."""
    corners = target_outline(target, seed)(view.times)
    pixels = np.stack([view.pixels(corners[:, i]) for i in range(corners.shape[1])], axis=1)
    size = [view.poses.camera.width, view.poses.camera.height]
    beside = (pixels.max(axis=1) < 0) | (pixels.min(axis=1) > size)
    blobs = []
    for polygon, out in zip(pixels, beside.any(axis=1), strict=True):
        blobs.append(NOTHING if out else visible_part(polygon, *size))
    return blobs


def _kept(segments: Segments, view: Exposures, blobs: list[Blob], *, fewer: bool) -> tuple[Numbers, Numbers]:
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
