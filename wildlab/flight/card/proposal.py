"""A recipe in the making: what the user states, the blocks that it gets, and what was decided.

What the heights of a card's flight count from is decided once those of all its logs are brought together.
What is assumed where logs say nothing stands in data, and is written into the recipe with a note.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import PurePosixPath
from typing import Any, Literal, NamedTuple, cast

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.card.images import camera_of_images, clock_of_images
from wildlab.flight.card.roles import OTHER, PARTS_SHOWN, Choice
from wildlab.flight.files import dump_toml, printable, read_toml
from wildlab.flight.heights import NO_GRID, choose_reference
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.readers.log import Stream
from wildlab.paths import DATA

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
    focal_px
        Focal length of the camera, where the rest is as the images have it.
    camera_offset_s
        What to add to the stamps of the images, None for an estimate.
    geoid_m
        How far the geoid is above the ellipsoid there.
    take_off_m
        Height of the take-off above sea level.
    start
        When the clock of a log that does not know UTC stood at zero.
    zone
        Of wall clocks that carry none.
    """

    name: str
    camera: CameraPart | None = None
    focal_px: float | None = None
    camera_offset_s: float | None = None
    geoid_m: float | None = None
    take_off_m: float | None = None
    start: datetime | None = None
    zone: str | None = None


@dataclass
class Proposal:
    """A recipe, as nested mappings and as text, and what was decided on the way, in sentences."""

    data: dict[str, Any]
    notes: list[str] = field(default_factory=list)

    def text(self, choices: Sequence[Choice]) -> str:
        """The recipe as TOML, with what it rests on in front."""
        lines = [
            "# Written by wildlab import. To change it: wildlab import THIS --source FOLDER --out FLIGHT"
        ]
        for one in choices:
            if one.item.problem == OTHER:
                continue
            role = one.role + (f" {one.target}" if one.target else "")
            lines.append(_comment(f"{one.item.shown}: {role} ({one.why})"))
        lines += [_comment(one) for one in self.notes]
        return "\n".join(lines) + "\n\n" + dump_toml(self.data, inline=True)


def _comment(text: str) -> str:
    """One line of a comment, whatever is in the text."""
    return "# " + re.sub(r"[\x00-\x1f\x7f\u0085\u2028\u2029]+", " ", text)


def stream_of(choice: Choice, part: str) -> Stream:
    """A part that a role asks for.

    Raises
    ------
    WildlabError
        Where no row of it can be used, as where a role was stated that the file does not have the data for.
    """
    stream = choice.item.part(part)
    if stream is None:
        raise WildlabError(
            f"{choice.item.shown} is to be {choice.role!r}, and has no {PARTS_SHOWN.get(part, part)} that "
            "can be used",
            f"say what else it is, or leave it out: --role {choice.item.name}=nothing",
            field="--role",
        )
    return stream


def has_utc(stream: Stream) -> bool:
    """Whether some row that can be used has a time in UTC."""
    times = stream.columns.get("time_s")
    return times is not None and bool(np.isfinite(times[stream.used]).any())


def angles(stream: Stream) -> tuple[str, str] | None:
    """Which angles a part has: beginning and end of their columns' names, None without any."""
    for end in ("_world_deg", "_deg"):
        names = [f"{axis}{end}" for axis in ("roll", "pitch", "yaw")]
        if all(name in stream.columns for name in names):
            values = np.column_stack([stream.columns[name] for name in names])[stream.used]
            if np.isfinite(values).all(axis=1).any():
                return "", end
    return None


Kind = Literal["ellipsoid", "sea", "home"]
#: A part of a file: (name of the file, part).
Key = tuple[str, str]


class Chosen(NamedTuple):
    """Which heights of a part are taken, and what is added to them, m."""

    kind: Kind
    add_m: float = 0.0


@dataclass(frozen=True)
class Heights:
    """The reference of a flight, for each part how it gets there, and sentences on it."""

    reference: str
    chosen: dict[Key, Chosen]
    notes: list[str] = field(default_factory=list)

    def of(self, file: str, part: str) -> Chosen | None:
        """How a part's heights are taken; None where it has none."""
        return self.chosen.get((file, part))


def heights_of(
    streams: Mapping[Key, Stream],
    own: Collection[Key],
    geoid_m: float | None,
    take_off_m: float | None = None,
) -> Heights:
    """One reference for all parts with heights, see `wildlab.flight.heights.choose_reference`; the take-off
    where none has any other.

    Parameters
    ----------
    streams
        The parts that have positions.
    own
        Those of the vehicle itself.
    geoid_m
        How far the geoid is above the ellipsoid, m, where the user states it.
    take_off_m
        Height of the take-off above sea level, m, likewise.

    Returns
    -------
    Heights

    Raises
    ------
    WildlabError
        Where there is no one reference for all.
    """
    names = {key: f"{key[0]} ({key[1]})" for key in streams}
    by_name = {names[key]: stream for key, stream in streams.items()}
    alone = streams and set(streams) <= set(own) and all(map(_above_take_off_alone, streams.values()))
    if alone and take_off_m is None:
        said = ["Heights count from the take-off, since the log has no others; --take-off states its height."]
        return Heights("take-off", {key: Chosen("home") for key in streams}, said)
    try:
        plan = choose_reference(by_name, [names[key] for key in own if key in names], geoid_m, take_off_m)
    except WildlabError as error:
        option = "--take-off" if "take-off" in error.problem else "--geoid"
        fix = f"{error.fix} ({option} METRES), or leave a file out (--role FILE=nothing)"
        raise WildlabError(error.problem, fix, field=option) from None
    chosen = {
        key: Chosen(cast(Kind, use.column.removeprefix("height_").removesuffix("_m")), round(use.add_m, 4))
        for key, name in names.items()
        if (use := plan.uses.get(name)) is not None
    }
    said = [f"Heights of {name}: {use.reason}." for name, use in plan.uses.items() if use.add_m]
    said += [f"{name} has places and no heights." for name in plan.without]
    if plan.reference == "sea" and chosen:
        said.insert(
            0,
            f"Heights count from mean sea level, since {NO_GRID}; --geoid states how high it is.",
        )
    return Heights({"sea": "mean sea level"}.get(plan.reference, plan.reference), chosen, said)


def _above_take_off_alone(stream: Stream) -> bool:
    """Whether a part has heights above the take-off, and none of another kind in any row that can be used."""
    others = [stream.columns.get(f"height_{kind}_m") for kind in ("ellipsoid", "sea")]
    if any(one is not None and np.isfinite(one[stream.used]).any() for one in others):
        return False
    return "height_home_m" in stream.columns


class Sources:
    """The logs' tables that a recipe asks for, each named once."""

    def __init__(self, wishes: Wishes, streams: dict[Key, Stream], own: Collection[Key]) -> None:
        self.wishes, self.streams = wishes, streams
        self.heights: Heights = heights_of(streams, own, wishes.geoid_m, wishes.take_off_m)
        self.logs: dict[str, dict[str, Any]] = {}

    def over_time(self, choice: Choice, part: str, name: str) -> dict[str, Any]:
        """What every block over time has: its table, which of its rows count, and their times."""
        return {"file": self.table(choice, part, name), "where": USED, "time": UTC}

    def table(self, choice: Choice, part: str, name: str) -> str:
        """The name of a table of one part of a log, with its heights and stamps brought to the flight's."""
        found = choice.item
        block: dict[str, Any] = {"file": found.name, "format": found.format, "part": part}
        if self.wishes.zone is not None:
            block["zone"] = self.wishes.zone
        chosen = self.heights.of(found.name, part)
        if chosen is not None:
            block |= {"height": chosen.kind} | ({"add_m": chosen.add_m} if chosen.add_m else {})
        stream = stream_of(choice, part)
        # Images have ways of their own to their time; points and pixels have none.
        if part not in ("photos", "marks", "clicks") and not has_utc(stream):
            if self.wishes.start is None:
                raise _no_utc(choice)
            block["offset_s"] = self.wishes.start.timestamp()
        self.logs[name] = block
        return name


def _no_utc(choice: Choice) -> WildlabError:
    """What to state of a log that does not know UTC."""
    clock = choice.item.log.clock if choice.item.log is not None else None
    if clock is not None and "zone" in clock.base:
        problem = f"the clock of {choice.item.shown} is local time, and nothing says its zone"
        return WildlabError(problem, "state it, as --zone Europe/Oslo or --zone +02:00", field="--zone")
    problem = f"the clock of {choice.item.shown} does not know UTC"
    return WildlabError(
        problem, "state when it stood at zero, as --start 2026-05-01T06:00:00Z", field="--start"
    )


# -- the vehicle: poses and sensors

FILE = DATA / "recipes" / "assumed.toml"


def assumed(part: str) -> dict[str, Any]:
    """What is assumed of ``"uncertainty"`` or ``"imu"``, as it stands in a recipe."""
    return dict(read_toml(FILE, "what is assumed where logs say nothing")[part])


def uncertainty_of(streams: Mapping[tuple[str, str], Stream]) -> tuple[dict[str, Any], str]:
    """The part ``[uncertainty]``: positions by the receivers' own statements where there are any.

    Parameters
    ----------
    streams
        The parts with positions.

    Returns
    -------
    dict, and a sentence on it
    """
    found, stated = assumed("uncertainty"), []
    for key, column in (
        ("position_horizontal_m", "sd_horizontal_m"),
        ("position_vertical_m", "sd_vertical_m"),
    ):
        values = [one.columns[column][one.used] for one in streams.values() if column in one.columns]
        every = np.concatenate([np.empty(0), *values])
        every = every[np.isfinite(every) & (every > 0)]
        if len(every):
            found[key] = round(float(np.median(every)), 4)
            stated.append(key.removesuffix("_m").replace("_", " "))
    if stated:
        found["note"] = (
            f"{' and '.join(stated).capitalize()}: median of what the receiver stated. The rest: "
            + found["note"]
        )
    said = (
        f"Assumed, since no log states it: pixels to {found['pixel_px']:g} px, tilt to "
        f"{found['tilt_deg']:g} deg, heading to {found['heading_deg']:g} deg"
    )
    if "position horizontal" not in stated:
        level, height = found["position_horizontal_m"], found["position_vertical_m"]
        said += f", positions to {level:g} m ({height:g} m in height)"
    return found, said + ". [uncertainty] has them: ellipses and verdicts on consistency rest on that."


def quantity(column: str, unit: str) -> dict[str, Any]:
    return {"column": column, "unit": unit}


def position() -> dict[str, Any]:
    return {
        "latitude": quantity("latitude_deg", "deg"),
        "longitude": quantity("longitude_deg", "deg"),
        "height": quantity("height_m", "m"),
    }


def velocity(stream: Stream) -> dict[str, Any]:
    """The velocity, where each row that can be used has one."""
    names = [f"v_{axis}_m_s" for axis in ("north", "east", "down")]
    if any(name not in stream.columns for name in names):
        return {}
    values = np.column_stack([stream.columns[name] for name in names])[stream.used]
    if not np.isfinite(values).all() or _only_level(stream):
        return {}
    axes = ("north", "east", "down")
    return {"velocity": {axis: quantity(name, "m/s") for axis, name in zip(axes, names, strict=True)}}


def attitude(stream: Stream) -> dict[str, Any]:
    parts = ("q_w", "q_x", "q_y", "q_z")
    turned = all(name in stream.columns for name in parts)
    if turned and np.isfinite(stream.columns["q_w"][stream.used]).all():
        return {"quaternion": parts, "order": "wxyz"}
    _, end = angles(stream) or ("", "_deg")
    return {axis: quantity(f"{axis}{end}", "deg") for axis in ("roll", "pitch", "yaw")}


def spreads(stream: Stream) -> dict[str, Any]:
    names = {
        "horizontal": ("sd_horizontal_m", "m"),
        "vertical": ("sd_vertical_m", "m"),
        **{axis: (f"sd_{axis}_deg", "deg") for axis in ("tilt", "heading")},
    }
    for column, _ in names.values():
        values = stream.columns.get(column)
        if values is None or not (np.isfinite(values) & (values > 0))[stream.used].all():
            return {}
    return {"spreads": {name: quantity(column, unit) for name, (column, unit) in names.items()}}


def truth_spreads(stream: Stream) -> dict[str, Any]:
    names = {"sd_horizontal": "sd_horizontal_m", "sd_vertical": "sd_vertical_m"}
    return {key: quantity(column, "m") for key, column in names.items() if column in stream.columns}


#: A vehicle that goes up or down by more than this does not do so at 0 m/s.
CLIMBED_M = 3.0


def _only_level(stream: Stream) -> bool:
    """Whether a receiver that does not measure climbing says 0 for it, as those that speak NMEA do."""
    if stream.columns["v_down_m_s"][stream.used].any():
        return False
    heights = [one[stream.used] for name, one in stream.columns.items() if name.startswith("height_")]
    return any(np.isfinite(one).any() and np.nanmax(one) - np.nanmin(one) > CLIMBED_M for one in heights)


def add_vehicle(proposal: Proposal, sources: Sources, own: Choice, name: str, receiver: bool) -> None:
    """What the vehicle's own log has: poses, and its sensors."""
    data = proposal.data
    if own.item.part("gnss") is not None and receiver:
        add_satellites(proposal, sources, own, name)
    if own.item.part("poses") is not None:
        add_poses(proposal, sources, own, "autopilot")
    imu, field_, gimbal = (own.item.part(one) for one in ("imu", "magnetometer", "gimbal"))
    if imu is not None:
        data["imu"] = {
            **assumed("imu"),
            **sources.over_time(own, "imu", f"{name}-imu"),
            "force": {axis: quantity(f"f_{axis}_m_s2", "m/s2") for axis in "xyz"},
            "rate": {axis: quantity(f"w_{axis}_rad_s", "rad/s") for axis in "xyz"},
        }
    if field_ is not None:
        data["magnetometer"] = {
            **sources.over_time(own, "magnetometer", f"{name}-magnetometer"),
            "field": {axis: quantity(f"field_{axis}_ut", "uT") for axis in "xyz"},
        }
    if gimbal is not None:
        add_gimbal(proposal, sources, own, gimbal, name)


def add_satellites(proposal: Proposal, sources: Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "gnss")
    block = sources.over_time(choice, "gnss", f"{name}-gnss")
    block |= {"position": position(), **velocity(stream), **truth_spreads(stream)}
    if "sd_velocity_m_s" in stream.columns:
        block["sd_velocity"] = quantity("sd_velocity_m_s", "m/s")
    block |= {key: key for key in ("satellites", "fix") if key in stream.columns}
    proposal.data["gnss"] = block


def add_poses(proposal: Proposal, sources: Sources, choice: Choice, name: str) -> None:
    stream = stream_of(choice, "poses")
    block = sources.over_time(choice, "poses", f"{name}-poses")
    block |= {"attitude": attitude(stream), **velocity(stream), **spreads(stream)}
    placed = "latitude_deg" in stream.columns
    block |= {"position": position()} if placed else {"position_from": "gnss"}
    proposal.data.setdefault("poses", {})[name] = block


def add_gimbal(proposal: Proposal, sources: Sources, own: Choice, stream: Stream, name: str) -> None:
    """A gimbal's angles: against the airframe a table of its own, against the world the camera's poses."""
    block = sources.over_time(own, "gimbal", f"{name}-gimbal")
    if {"pan_deg", "tilt_deg"} <= set(stream.columns):
        turned = {"pan": quantity("pan_deg", "deg"), "tilt": quantity("tilt_deg", "deg")}
        proposal.data["gimbal"] = block | turned
    elif angles(stream) is not None and "gnss" in proposal.data:
        attitude = {axis: quantity(f"{axis}_world_deg", "deg") for axis in ("roll", "pitch", "yaw")}
        poses = block | {"position_from": "gnss", "attitude": attitude}
        proposal.data.setdefault("poses", {})["camera"] = poses
    else:
        del sources.logs[block["file"]]


# -- what was seen: images, pixels of things in them, and where these truly were


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
    others = [one for one in by_role["images"] if one.item.name != images.item.name]
    for one in others:
        proposal.notes.append(
            f"The images of {one.item.shown} are left out: {images.item.shown} has more, and a flight has "
            "those of one folder."
        )
    camera, how = camera_of_images(images.item, wishes.camera, wishes.focal_px)
    if camera is None:
        proposal.notes.append(
            f"The images are left out: {how}. Give the camera with --camera, or with --focal alone."
        )
        return
    data["camera"] = camera.model_dump()
    proposal.notes.append(f"The camera: {how}.")
    clock = clock_of_images(
        images.item,
        None if own is None else own.item,
        wishes.camera_offset_s,
        records := _triggers(sources, own, triggers),
        [one.item for one in by_role.get("target", ())],
    )
    proposal.notes.append(clock.note)
    if records is not None and "triggers" not in clock.block and wishes.camera_offset_s is None:
        proposal.notes.append(
            f"{int(records[1].used.sum())} records of triggers fit no images for certain, and are not used."
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
    if own is not None and own.item.part("poses") is not None:
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
        stream = None if one is None else one.item.part("triggers")
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
    proposal.notes.append(said)
    return {left[0]: name}


def add_targets(proposal: Proposal, sources: Sources, by_role: Mapping[str, Sequence[Choice]]) -> None:
    """Truth: tracks of targets, and points that do not move."""
    truth = []
    names = named_as_clicked(proposal, by_role)
    for number, one in enumerate(by_role.get("target", ()), 1):
        part = "gnss" if one.item.part("gnss") is not None else "poses"
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
        proposal.notes.append("The pixels are left out: there are no images that they are of.")
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
            proposal.notes.append(
                f"{one.item.shown}: {strange} of {len(stream)} pixels are of no image here, and left out."
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
        stream, chosen = stream_of(one, "marks"), sources.heights.of(one.item.name, "marks")
        if chosen is not None:
            column = stream.columns[f"height_{chosen.kind}_m"][stream.used] + chosen.add_m
            heights += column[np.isfinite(column)].tolist()
    if not heights:
        return _take_off(proposal, sources)
    mean, spread = float(np.mean(heights)), float(np.ptp(heights))
    if len(heights) > 1 and spread > 0:
        uncertain_plane(proposal, float(np.std(heights, ddof=1)))
    proposal.notes.append(
        f"The ground is taken to be level at the mean of {len(heights)} surveyed points, which differ by "
        f"{spread:.1f} m. A map does better: --terrain."
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
            proposal.notes.append(
                "The ground is taken to be level and as high as the take-off. A map does better: --terrain."
            )
            return math.floor(float(np.median(of_home)) * 1000 + 0.5) / 1000
    return None
