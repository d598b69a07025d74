"""What to add to the stamps of a flight's images: from known points, or from the motion of the images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.errors import WildlabError
from wildlab.flight.clocks import frame_times
from wildlab.flight.store import Flight
from wildlab.geometry.camera_poses import CameraPoses
from wildlab.geometry.clock_by_points import ClockByPoints, clock_by_points
from wildlab.pipeline.evaluate import blocks_of
from wildlab.pipeline.flow import Reading, camera_poses_at
from wildlab.pipeline.georeference import truth_of

Array = NDArray[np.float64]


def refuse_without_clock(flight: Flight, source: str | None = None) -> None:
    """Refuse a flight whose images have no clock of their own.

    Raises
    ------
    WildlabError
        Where its times merely number the images, or its poses belong to images by name.
    """
    if flight.manifest.time.kind == "sequence":
        raise WildlabError(
            "the images carry no time, so there is no clock to estimate",
            "import with times if the images have any",
            file=flight.folder,
            field="time.kind",
        )
    name, nav = flight.pose_source(source)
    if "frame_id" in nav:
        raise WildlabError(
            "these poses belong to images by name, whatever their clock says",
            "choose other poses with --source, if there are any",
            file=flight.folder,
            field=f"nav/{name}",
        )


def sightings_of(flight: Flight) -> pd.DataFrame:
    """Pixel detections that name a target whose position is known: the rows of ``detections``.

    Parameters
    ----------
    flight
        Any.

    Returns
    -------
    DataFrame
        Empty where there are none.
    """
    detections, truth = flight.detections, flight.truth
    if detections is None or truth is None or "target_id" not in detections:
        return pd.DataFrame()
    known = detections["target_id"].isin(set(truth["target_id"]))
    return detections[(detections["kind"] == "pixel") & known].reset_index(drop=True)


def camera_clock_by_points(flight: Flight, source: str | None = None) -> ClockByPoints:
    """What to add to the stamps of the images so that known points appear where they were seen.

    Parameters
    ----------
    flight
        With frames, poses, pixel detections that name targets, and truth of these.
    source
        Name of the ``nav`` table; may be left out where there is only one.

    Returns
    -------
    ClockByPoints
        All its offsets are whole ones, as ``clocks.camera_offset_s`` has them: not on top of the manifest's.

    Raises
    ------
    WildlabError
        Where the images have no clock, or fewer than four sightings have a pose.
    """
    refuse_without_clock(flight, source)
    pixels = sightings_of(flight)
    frames = flight.table("frames")
    if len(pixels):
        pixels = pixels[pixels["frame_id"].isin(set(frames["frame_id"]))].reset_index(drop=True)
    if len(pixels) < 4:
        raise WildlabError(
            f"{len(pixels)} detections are of a target whose position is known, at least 4 are needed",
            "name the targets of detections and add their truth, or give the images with --images",
            file=flight.folder,
            field="detections",
        )
    at = pd.Index(frames["frame_id"]).get_indexer(pd.Index(pixels["frame_id"]))
    stated = flight.manifest.clocks.camera_offset_s
    times = frame_times(flight)[at]
    table = pd.DataFrame({"target_id": pixels["target_id"].to_numpy(object), "frame_id": pixels["frame_id"]})

    def seen_at(offset: float) -> tuple[CameraPoses, Array]:
        poses = camera_poses_at(flight, times + offset, Reading(source=source))
        if "pan_rad" in frames:
            angles = {name: frames[f"{name}_rad"].to_numpy(float)[at] for name in ("pan", "tilt")}
            poses = replace(poses, **angles)
        return poses, truth_of(flight, table.assign(time_s=times + offset))

    found = clock_by_points(
        seen_at,
        pixels[["u_px", "v_px"]].to_numpy(float),
        pixels["frame_id"].to_numpy(object),
        blocks_of(flight, table.assign(time_s=times)),
    )
    if found is None:
        raise WildlabError(
            "fewer than four sightings of known points have a pose, with any offset of the camera's clock",
            "check that images and poses are of the same time: wildlab check says what overlaps",
            file=flight.folder,
            field="detections",
        )
    return found._replace(
        offset_s=found.offset_s + stated, offsets=found.offsets + stated, rival_s=found.rival_s + stated
    )
