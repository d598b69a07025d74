"""Blocks of a recipe about what was seen: images, pixels of things in them, and where these truly were."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from wildlab.flight.card.images import camera_of_images, clock_of_images
from wildlab.flight.card.proposal import (
    NO_ANGLE,
    TIMED,
    USED,
    UTC,
    Proposal,
    Sources,
    angles,
    has_utc,
    stream_of,
)
from wildlab.flight.card.roles import Choice
from wildlab.flight.card.vehicle import position, quantity, truth_spreads
from wildlab.flight.files import printable
from wildlab.flight.readers.log import Stream


def add_frames(
    proposal: Proposal,
    sources: Sources,
    images: Choice,
    lens: str | None,
    own: Choice | None,
    triggers: Choice | None,
    by_role: Mapping[str, Sequence[Choice]],
    placed: bool,
) -> None:
    """The images, with the poses that stand in them."""
    photos, data, wishes = stream_of(images, "photos"), proposal.data, sources.wishes
    others = [one for one in by_role["images"] if one.found.name != images.found.name]
    for one in others:
        proposal.said.append(
            f"The images of {one.found.shown} are left out: a flight has those of one folder, and "
            f"{images.found.shown} has more. Import them as a flight of their own."
        )
    camera, how = camera_of_images(images.found, wishes.camera, wishes.focal_px)
    if camera is None:
        proposal.said.append(
            f"The images are left out: {how}. Give the camera with --camera, or with --focal alone."
        )
        return
    data["camera"] = camera.model_dump()
    proposal.said.append(f"The camera: {how}.")
    clock = clock_of_images(
        images.found,
        None if own is None else own.found,
        wishes.camera_offset_s,
        records := _triggers(sources, own, triggers),
        [one.found for one in by_role.get("target", ())],
    )
    proposal.said.append(clock.said)
    if records is not None and "triggers" not in clock.block and wishes.camera_offset_s is None:
        proposal.said.append(
            f"The {int(records[1].used.sum())} records of triggers are not used: which image belongs to "
            "which of them is not certain."
        )
    id_ = "stem" if len(set(_stems(photos))) == len(photos) else "file"
    file = sources.table(images, "photos", "images")
    sources.logs[file] |= clock.block | ({} if lens is None else {"camera": lens})
    if "triggers" not in clock.block:
        sources.logs.pop("triggers", None)
    frames: dict[str, Any] = {"file": file, "id": id_}
    if clock.kind == "sequence":
        data["time"] = {"kind": "sequence"}
    else:
        frames |= {"time": UTC, "where": TIMED}
    if clock.offset_s:
        data["clocks"] = {"camera_offset_s": clock.offset_s}
    data["frames"] = frames
    if not placed:
        return
    if own is not None and own.found.part("poses") is not None:
        return
    _, end = angles(photos) or ("", "_deg")
    where = [*USED, *({"column": f"{axis}{end}", "above": NO_ANGLE} for axis in ("roll", "pitch", "yaw"))]
    data.setdefault("poses", {})["camera" if end == "_world_deg" else "images"] = {
        "file": file,
        "where": where,
        "frame": id_,
        "position": position(),
        "attitude": {axis: quantity(f"{axis}{end}", "deg") for axis in ("roll", "pitch", "yaw")},
    }


def _triggers(sources: Sources, own: Choice | None, triggers: Choice | None) -> tuple[str, Stream] | None:
    """The table of the triggers' records, where there are any, and its rows."""
    for one in (triggers, own):
        stream = None if one is None else one.found.part("triggers")
        if one is not None and stream is not None and has_utc(stream):
            return sources.table(one, "triggers", "triggers"), stream
    return None


def _stems(photos: Stream) -> list[str]:
    return [PurePosixPath(str(one)).stem for one in photos.columns["file"]]


def named_as_clicked(proposal: Proposal, by_role: Mapping[str, Sequence[Choice]]) -> dict[str, str]:
    """Names of targets: where one track and one clicked name are left over, they are the same thing."""
    tracks = [one.target for one in by_role.get("target", ())]
    marked = {
        str(name) for one in by_role.get("marks", ()) for name in stream_of(one, "marks").columns["name"]
    }
    clicked = {
        str(name)
        for one in by_role.get("clicks", ())
        for name in stream_of(one, "clicks").columns.get("name", ())
        if str(name)
    }
    left, names = [one for one in tracks if one not in clicked], clicked - marked - set(tracks)
    if len(left) != 1 or len(names) != 1:
        return {}
    name = names.pop()
    said = f"The track {left[0]} is taken for what was clicked as {printable(name)}: no other is left."
    proposal.said.append(said)
    return {left[0]: name}


def add_targets(proposal: Proposal, sources: Sources, by_role: Mapping[str, Sequence[Choice]]) -> None:
    """Truth: tracks of targets, and points that do not move."""
    truth = []
    names = named_as_clicked(proposal, by_role)
    for number, one in enumerate(by_role.get("target", ()), 1):
        part = "gnss" if one.found.part("gnss") is not None else "poses"
        stream = stream_of(one, part)
        block = sources.over_time(one, part, f"target-{number}")
        block |= {"target": names.get(one.target, one.target), "position": position()}
        truth.append(block | truth_spreads(stream))
    for number, one in enumerate(by_role.get("marks", ()), 1):
        stream = stream_of(one, "marks")
        block = {
            "file": sources.table(one, "marks", f"marks-{number}"),
            "where": USED,
            "id": "name",
            "position": position(),
        }
        truth.append(block | truth_spreads(stream))
    if truth:
        proposal.data["truth"] = truth


def add_seen(
    proposal: Proposal,
    sources: Sources,
    clicks: Sequence[Choice],
    images: Choice | None,
    by_role: Mapping[str, Sequence[Choice]],
) -> None:
    """What was clicked in the images."""
    if not clicks:
        return
    if images is None or "frames" not in proposal.data:
        proposal.said.append("The pixels are left out: there are no images that they are of.")
        return
    id_ = proposal.data["frames"]["id"]
    level = _level(proposal, sources, by_role)
    blocks = []
    for number, one in enumerate(clicks, 1):
        stream = stream_of(one, "clicks")
        block: dict[str, Any] = {
            "source": "clicks" if len(clicks) == 1 else f"clicks-{number}",
            "file": sources.table(one, "clicks", f"clicks-{number}"),
            "where": USED,
            "prefix": f"click-{number}-",
            "frame": "stem" if id_ == "stem" else "image",
            "pixel": {"u": quantity("u_px", "px"), "v": quantity("v_px", "px")},
        }
        if "name" in stream.columns:
            block["target"] = "name"
        if level is not None:
            block["ground"] = {"height": {"value": level, "unit": "m"}}
        sources.logs[block["file"]]["images"] = proposal.data["frames"]["file"]
        strange = _strange(stream, images)
        if strange:
            proposal.said.append(
                f"{one.found.shown}: {strange} of {len(stream)} pixels are in images that are not here, or "
                "not taken, and are left out."
            )
        blocks.append(block)
    proposal.data["detections"] = blocks


def _strange(pixels: Stream, images: Choice) -> int:
    """How many pixels are of none of the images."""
    photos = stream_of(images, "photos")
    known = {*_stems(photos), *(str(one) for one in photos.columns["file"])}
    of = [str(one) for one in pixels.columns["image"][pixels.used]]
    return sum(one not in known and PurePosixPath(one).stem not in known for one in of)


def _level(proposal: Proposal, sources: Sources, by_role: Mapping[str, Sequence[Choice]]) -> float | None:
    """Height of level ground: the mean of the surveyed points'; None where there are none."""
    heights: list[float] = []
    for one in by_role.get("marks", ()):
        stream, chosen = stream_of(one, "marks"), sources.heights.of(one.found.name, "marks")
        if chosen is not None:
            column = stream.columns[f"height_{chosen.kind}_m"][stream.used] + chosen.add_m
            heights += column[np.isfinite(column)].tolist()
    if not heights:
        return _take_off(proposal, sources)
    mean, spread = float(np.mean(heights)), float(np.ptp(heights))
    if len(heights) > 1 and spread > 0:
        uncertain_plane(proposal, float(np.std(heights, ddof=1)))
    proposal.said.append(
        f"The ground is taken to be level at the mean height of {len(heights)} surveyed points, which differ "
        f"by {spread:.1f} m. An elevation map does better: --terrain."
    )
    return math.floor(mean * 1000 + 0.5) / 1000


#: How far level ground beside a take-off is assumed to be from its height, standard deviation, m.
TAKE_OFF_SD_M = 5.0


def uncertain_plane(proposal: Proposal, sd_m: float) -> None:
    """The ground's height is as uncertain as that: ellipses know it."""
    part = proposal.data.setdefault("uncertainty", {})
    part["plane_height_m"] = round(max(sd_m, 0.01), 3)


def _take_off(proposal: Proposal, sources: Sources) -> float | None:
    """Height of the take-off, where a log has heights above it beside others; None else."""
    for (file, part), stream in sources.streams.items():
        chosen = sources.heights.of(file, part)
        home = stream.columns.get("height_home_m")
        if chosen is None or home is None:
            continue
        of_home = (stream.columns[f"height_{chosen.kind}_m"] + chosen.add_m - home)[stream.used]
        of_home = of_home[np.isfinite(of_home)]
        if len(of_home):
            uncertain_plane(proposal, TAKE_OFF_SD_M)
            proposal.said.append(
                "The ground is taken to be level and as high as the take-off, since nothing says how high it "
                "is. An elevation map does better: --terrain."
            )
            return math.floor(float(np.median(of_home)) * 1000 + 0.5) / 1000
    return None
