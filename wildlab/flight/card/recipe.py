"""A recipe out of what was found on a card and its roles: text that a user can read and change."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.card.blocks import (
    angles,
    attitude,
    has_utc,
    position,
    quantity,
    spreads,
    stream_of,
    truth_spreads,
    velocity,
)
from wildlab.flight.card.found import Found
from wildlab.flight.card.heights import Heights, heights_of
from wildlab.flight.card.images import camera_of_images, clock_of_images
from wildlab.flight.card.roles import Choice
from wildlab.flight.files import is_safe_name
from wildlab.flight.manifest import CameraPart
from wildlab.flight.readers.logs.log import Stream
from wildlab.flight.toml import dump_toml

#: Rows that can be used.
USED: list[dict[str, Any]] = [{"column": "use", "equals": 1.0}]
#: Rows that have a time; an image without a place is one.
TIMED: list[dict[str, Any]] = [{"column": "time_s", "above": 0.0}]
UTC = {"column": "time_s", "format": "unix"}
#: Below any angle in degrees: a condition that leaves rows without one out.
NO_ANGLE = -1e6


@dataclass(frozen=True)
class Wishes:
    """What a user states of a flight.

    Attributes
    ----------
    name
        Of the flight.
    camera
        From a file of `wildlab camera`, None for what the images say.
    camera_offset_s
        What to add to the stamps of the images, None for an estimate.
    geoid_m
        How far the geoid is above the ellipsoid there.
    start
        When the clock of a log that does not know UTC stood at zero.
    zone
        Of wall clocks that carry none.
    sensitivity
        Of the places.
    """

    name: str
    camera: CameraPart | None = None
    camera_offset_s: float | None = None
    geoid_m: float | None = None
    start: datetime | None = None
    zone: str | None = None
    sensitivity: str = "withheld"


@dataclass
class Proposal:
    """A recipe, as nested mappings and as text, and what was decided on the way, in sentences."""

    data: dict[str, Any]
    said: list[str] = field(default_factory=list)

    def text(self, choices: Sequence[Choice]) -> str:
        """The recipe as TOML, with what it rests on in front."""
        lines = [
            "# Written by wildlab import. To change it: wildlab import THIS --source FOLDER --into FLIGHT"
        ]
        for one in choices:
            role = one.role + (f" {one.target}" if one.target else "")
            lines.append(_comment(f"{one.found.name}: {role} ({one.why})"))
        lines += [_comment(one) for one in self.said]
        return "\n".join(lines) + "\n\n" + dump_toml(self.data, inline=True)


def _comment(text: str) -> str:
    """One line of a comment, whatever is in the text."""
    return "# " + re.sub(r"[\x00-\x1f\x7f\u0085\u2028\u2029]+", " ", text)


def propose(choices: Sequence[Choice], wishes: Wishes) -> Proposal:
    """A recipe of a flight.

    Parameters
    ----------
    choices
        From `roles.choose_roles`.
    wishes
        What the user states.

    Returns
    -------
    Proposal

    Raises
    ------
    WildlabError
        Where nothing says where a camera was, two things have a role that only one can have, no time is
        known, or heights cannot be brought together.
    """
    by_role: dict[str, list[Choice]] = {}
    for one in choices:
        by_role.setdefault(one.role, []).append(one)
    own, camera, receiver = (_only(by_role, role) for role in ("own", "camera", "receiver"))
    triggers, clicks = _only(by_role, "triggers"), by_role.get("clicks", [])
    images = _most_images(by_role.get("images", []))
    proposal = Proposal({"name": wishes.name})
    placed = _placed(images)
    if own is None and camera is None and receiver is None and not placed:
        raise WildlabError(
            "nothing here says where a camera was",
            "name the log of the flight, or say with --role which file it is",
        )
    sources = _Sources(wishes, heights_of(_streams(own, camera, receiver, images, by_role), wishes.geoid_m))
    proposal.said += sources.heights.said
    vehicle = own.found.log.vehicle if own is not None and own.found.log is not None else ""
    data = proposal.data
    data["description"] = f"Logged by {vehicle}." if vehicle else ""
    data["locations"] = {"sensitivity": wishes.sensitivity}
    data["platform"] = {"name": vehicle or "not stated"}
    data["vertical"] = {"reference": sources.heights.reference, "note": " ".join(sources.heights.said)}
    data["time"] = {"kind": "utc"} | ({"epoch": wishes.start} if wishes.start is not None else {})
    if own is not None:
        _vehicle(proposal, sources, own, "vehicle", receiver is None)
    if receiver is not None:
        _satellites(proposal, sources, receiver, "receiver")
    if camera is not None:
        _poses(proposal, sources, camera, "camera")
    if images is not None:
        _frames(proposal, sources, images, own, triggers, by_role, placed)
    _mount(proposal, camera is not None or "camera" in data.get("poses", {}))
    _targets(proposal, sources, by_role)
    _seen(proposal, sources, clicks, images, by_role)
    data["logs"] = sources.logs
    order = ("name", "description", "locations", "platform", "camera", "mount", "time", "clocks", "vertical")
    proposal.data = {key: data[key] for key in order if key in data} | data
    return proposal


class _Sources:
    """The logs' tables that a recipe asks for, each named once."""

    def __init__(self, wishes: Wishes, heights: Heights) -> None:
        self.wishes, self.heights = wishes, heights
        self.logs: dict[str, dict[str, Any]] = {}

    def table(self, choice: Choice, part: str, name: str) -> str:
        """The name of a table of one part of a log, with its heights and stamps brought to the flight's."""
        found = choice.found
        block: dict[str, Any] = {"file": found.name, "format": found.format, "part": part}
        if self.wishes.zone is not None:
            block["zone"] = self.wishes.zone
        chosen = self.heights.of(found.name, part)
        if chosen is not None:
            block |= {"height": chosen.kind} | ({"add_m": chosen.add_m} if chosen.add_m else {})
        stream = stream_of(choice, part)
        if not has_utc(stream) and self.wishes.start is not None:
            block["offset_s"] = self.wishes.start.timestamp()
        self.logs[name] = block
        return name


def _only(by_role: Mapping[str, Sequence[Choice]], role: str) -> Choice | None:
    """The one thing of a role that only one can have; of several the one with the most rows."""
    several = by_role.get(role, ())
    return max(several, key=lambda one: _rows(one.found), default=None)


def _rows(found: Found) -> int:
    return sum(int(one.used.sum()) for one in found.log.parts.values()) if found.log is not None else 0


def _most_images(several: Sequence[Choice]) -> Choice | None:
    usable = [one for one in several if one.found.log is not None and "photos" in one.found.log.parts]
    return max(usable, key=lambda one: _rows(one.found), default=None)


def _placed(images: Choice | None) -> bool:
    """Whether the images say where the camera was and how it was turned."""
    photos = None if images is None else images.found.part("photos")
    if photos is None or "latitude_deg" not in photos.columns:
        return False
    return angles(photos) is not None


def _streams(
    own: Choice | None,
    camera: Choice | None,
    receiver: Choice | None,
    images: Choice | None,
    by_role: Mapping[str, Sequence[Choice]],
) -> dict[tuple[str, str], Stream]:
    """Every part with heights that the flight will use, by the name of its file and its own."""
    wanted = [(one, part) for one in (own, camera) if one is not None for part in ("poses", "gnss")]
    wanted += [(one, "gnss") for one in (receiver,) if one is not None]
    wanted += [(one, "photos") for one in (images,) if one is not None]
    wanted += [(one, part) for one in by_role.get("target", ()) for part in ("gnss", "poses")]
    wanted += [(one, "marks") for one in by_role.get("marks", ())]
    found = {}
    for one, part in wanted:
        stream = one.found.part(part)
        if stream is not None and "latitude_deg" in stream.columns:
            found[one.found.name, part] = stream
    return found


def _vehicle(proposal: Proposal, sources: _Sources, own: Choice, name: str, receiver: bool) -> None:
    """What the vehicle's own log has: poses, and its sensors."""
    data = proposal.data
    if own.found.part("gnss") is not None and receiver:
        _satellites(proposal, sources, own, name)
    if own.found.part("poses") is not None:
        _poses(proposal, sources, own, "autopilot")
    imu, field_, gimbal = (own.found.part(one) for one in ("imu", "magnetometer", "gimbal"))
    if imu is not None:
        data["imu"] = {
            "file": sources.table(own, "imu", f"{name}-imu"),
            "where": USED,
            "time": UTC,
            "force": {axis: quantity(f"f_{axis}_m_s2", "m/s2") for axis in "xyz"},
            "rate": {axis: quantity(f"w_{axis}_rad_s", "rad/s") for axis in "xyz"},
        }
    if field_ is not None:
        data["magnetometer"] = {
            "file": sources.table(own, "magnetometer", f"{name}-magnetometer"),
            "where": USED,
            "time": UTC,
            "field": {axis: quantity(f"field_{axis}_ut", "uT") for axis in "xyz"},
        }
    if gimbal is not None:
        _gimbal(proposal, sources, own, gimbal, name)


def _satellites(proposal: Proposal, sources: _Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "gnss")
    block: dict[str, Any] = {
        "file": sources.table(choice, "gnss", f"{name}-gnss"),
        "where": USED,
        "time": UTC,
        "position": position(),
        **velocity(stream),
    }
    for key, column, unit in (
        ("sd_horizontal", "sd_horizontal_m", "m"),
        ("sd_vertical", "sd_vertical_m", "m"),
        ("sd_velocity", "sd_velocity_m_s", "m/s"),
    ):
        if column in stream.columns:
            block[key] = quantity(column, unit)
    block |= {key: key for key in ("satellites", "fix") if key in stream.columns}
    proposal.data["gnss"] = block


def _poses(proposal: Proposal, sources: _Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "poses")
    block: dict[str, Any] = {
        "file": sources.table(choice, "poses", f"{name}-poses"),
        "where": USED,
        "time": UTC,
        "attitude": attitude(stream),
        **velocity(stream),
        **spreads(stream),
    }
    if "latitude_deg" in stream.columns:
        block["position"] = position()
    else:
        block["position_from"] = "gnss"
    proposal.data.setdefault("poses", {})[name] = block


def _gimbal(proposal: Proposal, sources: _Sources, own: Choice, stream: Stream, name: str) -> None:
    """A gimbal's angles: against the airframe a table of its own, against the world the camera's poses."""
    file = sources.table(own, "gimbal", f"{name}-gimbal")
    block: dict[str, Any] = {"file": file, "where": USED, "time": UTC}
    if {"pan_deg", "tilt_deg"} <= set(stream.columns):
        angles = {"pan": quantity("pan_deg", "deg"), "tilt": quantity("tilt_deg", "deg")}
        proposal.data["gimbal"] = block | angles
    elif angles(stream) is not None and "gnss" in proposal.data:
        attitude = {axis: quantity(f"{axis}_world_deg", "deg") for axis in ("roll", "pitch", "yaw")}
        poses = block | {"position_from": "gnss", "attitude": attitude}
        proposal.data.setdefault("poses", {})["camera"] = poses
    else:
        del sources.logs[file]


def _mount(proposal: Proposal, camera: bool) -> None:
    """Which way the camera looks: along its own poses where there are any, else down."""
    if "frames" not in proposal.data:
        return
    if camera:
        proposal.data["mount"] = {"looks": "forward"}
        proposal.said.append("The poses are those of the camera itself: its lens points along them.")
    elif "gimbal" not in proposal.data:
        proposal.data["mount"] = {"looks": "down"}
        proposal.said.append(
            "Nothing says how the camera is fixed to the airframe: it is taken to look straight down, the "
            "top of its images forward. Change [mount] where that is wrong."
        )


def _frames(
    proposal: Proposal,
    sources: _Sources,
    images: Choice,
    own: Choice | None,
    triggers: Choice | None,
    by_role: Mapping[str, Sequence[Choice]],
    placed: bool,
) -> None:
    """The images, with the poses that stand in them."""
    photos, data, wishes = stream_of(images, "photos"), proposal.data, sources.wishes
    others = [one for one in by_role["images"] if one is not images]
    for one in others:
        proposal.said.append(
            f"The images of {one.found.name} are left out: a flight has those of one folder, and "
            f"{images.found.name} has more. Import them as a flight of their own."
        )
    camera, how = camera_of_images(images.found, wishes.camera)
    if camera is None:
        proposal.said.append(f"The images are left out: {how}. Give the camera with --camera.")
        return
    data["camera"] = camera.model_dump()
    proposal.said.append(f"The camera: {how}.")
    clock = clock_of_images(
        images.found,
        None if own is None else own.found,
        wishes.camera_offset_s,
        _triggers(sources, own, triggers),
    )
    proposal.said.append(clock.said)
    id_ = "stem" if len(set(_stems(photos))) == len(photos) else "file"
    file = sources.table(images, "photos", "images")
    sources.logs[file] |= clock.block
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


def _triggers(sources: _Sources, own: Choice | None, triggers: Choice | None) -> str | None:
    """The table of the triggers' records, where there are any."""
    for one in (triggers, own):
        if one is not None and one.found.part("triggers") is not None and has_utc(stream_of(one, "triggers")):
            return sources.table(one, "triggers", "triggers")
    return None


def _stems(photos: Stream) -> list[str]:
    return [PurePosixPath(str(one)).stem for one in photos.columns["file"]]


def _targets(proposal: Proposal, sources: _Sources, by_role: Mapping[str, Sequence[Choice]]) -> None:
    """Truth: tracks of targets, and points that do not move."""
    truth = []
    for one in by_role.get("target", ()):
        part = "gnss" if one.found.part("gnss") is not None else "poses"
        stream = stream_of(one, part)
        block: dict[str, Any] = {
            "file": sources.table(one, part, f"target-{one.target}"),
            "where": USED,
            "target": one.target,
            "time": UTC,
            "position": position(),
        }
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


def _seen(
    proposal: Proposal,
    sources: _Sources,
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
            "prefix": f"click-{number}-",
            "frame": "stem" if id_ == "stem" else "image",
            "pixel": {"u": quantity("u_px", "px"), "v": quantity("v_px", "px")},
        }
        if "name" in stream.columns:
            block["target"] = "name"
        if level is not None:
            block["ground"] = {"height": {"value": level, "unit": "m"}}
        blocks.append(block)
    proposal.data["detections"] = blocks


def _level(proposal: Proposal, sources: _Sources, by_role: Mapping[str, Sequence[Choice]]) -> float | None:
    """Height of level ground: the mean of the surveyed points'; None where there are none."""
    heights: list[float] = []
    for one in by_role.get("marks", ()):
        stream, chosen = stream_of(one, "marks"), sources.heights.of(one.found.name, "marks")
        if chosen is not None:
            column = stream.columns[f"height_{chosen.kind}_m"][stream.used] + chosen.add_m
            heights += column[np.isfinite(column)].tolist()
    if not heights:
        return None
    mean, spread = float(np.mean(heights)), float(np.ptp(heights))
    proposal.said.append(
        f"The ground is taken to be level at the mean height of {len(heights)} surveyed points, which differ "
        f"by {spread:.1f} m. An elevation map does better: --terrain."
    )
    return math.floor(mean * 1000 + 0.5) / 1000


def safe_name(text: str) -> str:
    """A flight's name out of a folder's."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", text).strip("-_")[:100]
    return name if is_safe_name(name) else "flight"
