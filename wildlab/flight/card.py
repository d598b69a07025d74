"""A memory card becomes a flight: its recipe with what was decided, and the flight itself.

The recipe is text that a user can read and change. What the heights of a card's flight count from is decided
once those of all its logs are brought together. What is assumed where logs say nothing stands in data, and is
written into the recipe with a note.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from wildlab.errors import WildlabError
from wildlab.files import write_atomic
from wildlab.flight.card_items import (
    OTHER,
    PARTS_SHOWN,
    ROLES,
    Choice,
    choose_roles,
    clock_of_images,
    has_place,
    one_camera,
    search,
    source_folder,
    span_of,
)
from wildlab.flight.files import dump_toml, printable, read_toml
from wildlab.flight.importing import import_flight
from wildlab.flight.manifest import CameraPart, TerrainSays
from wildlab.flight.readers.labels import note_of_kinds
from wildlab.flight.readers.log import PARTS, Stream
from wildlab.flight.readers.photos import camera_of
from wildlab.flight.schema import QUATERNION
from wildlab.flight.store import Flight
from wildlab.flight.terrain import NO_GRID, HeightPlan, HeightUse, choose_reference
from wildlab.names import match_names
from wildlab.paths import DATA

#: Rows that can be used.
USED: list[dict[str, Any]] = [{"column": "use", "equals": 1.0}]
#: Rows that have a time; an image without a place is one.
TIMED: list[dict[str, Any]] = [{"column": "time_s", "above": 0.0}]
STAMP = {"column": "time_s", "format": "unix"}
#: Below any angle in degrees: a condition that leaves rows without one out.
NO_ANGLE = -1e6
#: A vehicle that goes up or down by more than this does not do so at 0 m/s.
CLIMBED_M = 3.0
#: How far level ground beside a take-off is assumed to be from its height, standard deviation, m.
TAKE_OFF_SD_M = 5.0
#: What is assumed where logs say nothing, as it stands in a recipe.
ASSUMED = DATA / "recipes" / "assumed.toml"
#: The parts that a recipe begins with.
ORDER = (
    *("name", "description", "locations", "platform", "camera", "mount", "time", "clocks", "vertical"),
    *("uncertainty", "logs"),
)
TURNS, AXES = ("roll", "pitch", "yaw"), ("north", "east", "down")


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


class Proposal:
    """A recipe of a flight, as nested mappings and as text, and what was decided on the way, in sentences.

    Parameters
    ----------
    source
        The folder that all names are below.
    choices
        From `choose_roles`.
    wishes
        What the user states.

    Raises
    ------
    WildlabError
        Where nothing says where a camera was, no time is known, or heights cannot be brought together.
    """

    def __init__(self, source: Path, choices: Sequence[Choice], wishes: Wishes) -> None:
        _refuse_without_zone(choices)
        self.source, self.choices, self.wishes = source, choices, wishes
        self.by_role = {role: [one for one in choices if one.role == role] for role in ROLES}
        self.notes: list[str] = []
        self.left_out: tuple[str, str] | None = None
        self.logs: dict[str, dict[str, Any]] = {}
        self.data: dict[str, Any] = {"name": wishes.name}
        self.own, camera, receiver, self.triggers = map(self._only, ("own", "camera", "receiver", "triggers"))
        images = self._only("images")
        lens: str | None = None
        if images is not None:
            found, lens, said = one_camera(images.item, images.target, wishes.camera)
            images = replace(images, item=found)
            self.notes += [said] if said else []
        placed = images is not None and has_place(images.item) and bool(angles(stream_of(images, "photos")))
        if not (self.own or camera or receiver or placed):
            raise self._without_poses(images)
        aboard = [(one, part) for one in (self.own, camera) for part in ("poses", "gnss")]
        aboard += [(receiver, "gnss"), (images, "photos")]
        others = [(one, part) for one in self.by_role["target"] for part in ("gnss", "poses")]
        self.streams = {
            key_of(one, part): stream
            for one, part in (*aboard, *others, *((one, "marks") for one in self.by_role["marks"]))
            if one is not None and "latitude_deg" in (stream := one.item.part(part)).columns
            if stream.used.any()
        }
        before = len(self.notes)
        self.heights = self._choose_heights({key_of(one, part) for one, part in aboard if one is not None})
        self._state(" ".join(self.notes[before:]))
        if self.own is not None:
            self._add_vehicle(self.own, receiver is None)
        if receiver is not None:
            self._add_satellites(receiver, "receiver")
        if camera is not None:
            self._add_poses(camera, "camera")
        if images is not None:
            self._add_frames(images, lens, placed)
        self._add_mount(camera is not None or "camera" in self.data.get("poses", {}))
        self._add_targets()
        if self.by_role["clicks"]:
            self._add_clicks(images)
        self._add_uncertainty()
        self.data["logs"] = self.logs
        if "poses" not in self.data and "gnss" not in self.data:
            raise self._without_poses(images)
        self.data = {key: self.data[key] for key in ORDER if key in self.data} | self.data

    def _without_poses(self, images: Choice | None) -> WildlabError:
        """What a pose lacks, and what would give it."""
        if self.left_out is not None:
            problem, fix = self.left_out
            return WildlabError(f"the images are left out: {problem}", fix)
        if images is not None and has_place(images.item):
            return WildlabError(
                "the images say where the camera was, nothing says which way it looked (roll, pitch, yaw)",
                "add the log of the vehicle (--role FILE=own), or a table of angles (data/recipes/README.md)",
            )
        return WildlabError(
            "nothing here says where a camera was",
            "name its log (--role FILE=own), or write a recipe (data/recipes/README.md)",
        )

    def _leave_out_images(self, problem: str, fix: str) -> None:
        self.left_out = problem, fix
        self.notes.append(f"The images are left out: {problem}. {fix[0].upper()}{fix[1:]}.")

    @property
    def recipe(self) -> str:
        """The recipe as TOML, with what it rests on in front."""
        lines = ["# To change it: wildlab import THIS --source FOLDER --out FLIGHT"]
        for one in self.choices:
            if one.item.problem != OTHER:
                role = one.role + (f" {one.target}" if one.target else "")
                lines.append(_comment(f"{one.item.shown}: {role} ({one.why})"))
        lines += map(_comment, self.notes)
        return "\n".join(lines) + "\n\n" + dump_toml(self.data)

    def _only(self, role: str) -> Choice | None:
        """The one thing of a role that only one can have; of several the one with the most rows."""
        several = self.by_role[role]

        def rows(one: Choice) -> int:
            return sum(int(part.used.sum()) for part in one.item.log.parts.values())

        taken = max(several, key=rows, default=None)
        self.notes += [
            f"{one.item.shown} is left out: {taken.item.shown} has more rows ({role})."
            for one in several
            if taken is not None and one is not taken
        ]
        return taken

    def _choose_heights(self, own: set[str]) -> HeightPlan:
        """One reference for all parts with heights; the take-off where none has any other."""
        wishes, streams = self.wishes, self.streams
        alone = streams and streams.keys() <= own and all(map(_above_take_off_alone, streams.values()))
        if alone and wishes.take_off_m is None:
            self.notes.append("Heights count from the take-off: --take-off states its height.")
            use = HeightUse("height_home_m", 0.0, "")
            return HeightPlan("take-off", dict.fromkeys(streams, use))
        try:
            plan = choose_reference(
                streams, [one for one in streams if one in own], wishes.geoid_m, wishes.take_off_m
            )
        except WildlabError as error:
            option = "--take-off" if "take-off" in error.problem else "--geoid"
            fix = f"{error.fix} ({option} METRES), or leave it out (--role FILE=nothing)"
            raise WildlabError(error.problem, fix, field=option) from None
        if plan.reference == "sea" and plan.uses:
            self.notes.append(
                f"Heights count from mean sea level, since {NO_GRID}; --geoid states how high it is."
            )
        self.notes += [f"Heights of {name}: {use.reason}." for name, use in plan.uses.items() if use.add_m]
        self.notes += [f"{name} has places and no heights." for name in plan.without]
        return plan

    def _state(self, of_heights: str) -> None:
        """What is so of the whole flight."""
        start, reference = self.wishes.start, self.heights.reference
        vehicle = "" if self.own is None else self.own.item.log.vehicle
        self.data |= {
            "description": f"Logged by {vehicle}." if vehicle else "",
            "locations": {"sensitivity": "withheld"},
            "platform": {"name": vehicle or "not stated"},
            "vertical": {
                "reference": "mean sea level" if reference == "sea" else reference,
                "note": of_heights,
            },
            "time": {"kind": "utc"} | ({"epoch": start} if start is not None else {}),
        }

    # -- the logs' tables, each named once

    def _over_time(self, choice: Choice, part: str, name: str) -> dict[str, Any]:
        """What every block over time has: its table, which of its rows count, and their times."""
        return {"file": self._table(choice, part, name), "where": USED, "time": STAMP}

    def _table(self, choice: Choice, part: str, name: str) -> str:
        """The name of a table of one part of a log, with its heights and stamps brought to the flight's."""
        found = choice.item
        block: dict[str, Any] = {"file": found.name, "format": found.format, "part": part}
        if self.wishes.zone is not None:
            block["zone"] = self.wishes.zone
        use = self.heights.uses.get(key_of(choice, part))
        if use is not None:
            block["height"] = use.column.removeprefix("height_").removesuffix("_m")
            block |= {"add_m": added} if (added := round(use.add_m, 4)) else {}
        # Images have ways of their own to their time; points and pixels have none.
        if part not in ("photos", "marks", "clicks") and not has_utc(stream_of(choice, part)):
            if self.wishes.start is None:
                raise _no_utc(choice)
            block["offset_s"] = self.wishes.start.timestamp()
        self.logs[name] = block
        return name

    # -- the vehicle: poses and sensors

    def _add_vehicle(self, own: Choice, receiver: bool) -> None:
        """What the vehicle's own log has: poses, and its sensors."""
        if own.item.part("gnss") and receiver:
            self._add_satellites(own, "vehicle")
        if own.item.part("poses"):
            self._add_poses(own, "autopilot")
        if own.item.part("imu"):
            self.data["imu"] = {
                **read_assumed("imu"),
                **self._over_time(own, "imu", "vehicle-imu"),
                "force": quantities("xyz", "f_{}_m_s2", "m/s2"),
                "rate": quantities("xyz", "w_{}_rad_s", "rad/s"),
            }
        if own.item.part("magnetometer"):
            block = self._over_time(own, "magnetometer", "vehicle-magnetometer")
            self.data["magnetometer"] = block | {"field": quantities("xyz", "field_{}_ut", "uT")}
        if own.item.part("gimbal"):
            self._add_gimbal(own)

    def _add_satellites(self, choice: Choice, name: str) -> None:
        stream = stream_of(choice, "gnss")
        block = self._over_time(choice, "gnss", f"{name}-gnss")
        block |= {"position": position(), **velocity(stream), **stated_spreads(stream)}
        if "sd_velocity_m_s" in stream.columns:
            block |= quantities(["sd_velocity"], "{}_m_s", "m/s")
        self.data["gnss"] = block | {key: key for key in ("satellites", "fix") if key in stream.columns}

    def _add_poses(self, choice: Choice, name: str) -> None:
        stream = stream_of(choice, "poses")
        block = self._over_time(choice, "poses", f"{name}-poses")
        block |= {"attitude": attitude(stream), **velocity(stream), **pose_spreads(stream)}
        placed = "latitude_deg" in stream.columns
        block |= {"position": position()} if placed else {"position_from": "gnss"}
        self.data.setdefault("poses", {})[name] = block

    def _add_gimbal(self, own: Choice) -> None:
        """Its angles: against the airframe a table of their own, against the world the camera's poses."""
        stream = stream_of(own, "gimbal")
        block = self._over_time(own, "gimbal", "vehicle-gimbal")
        if {"pan_deg", "tilt_deg"} <= set(stream.columns):
            self.data["gimbal"] = block | quantities(("pan", "tilt"), "{}_deg", "deg")
        elif angles(stream) and "gnss" in self.data:
            block |= {"position_from": "gnss", "attitude": quantities(TURNS, "{}_world_deg", "deg")}
            self.data.setdefault("poses", {})["camera"] = block
        else:
            del self.logs[block["file"]]

    # -- what was seen: images, pixels of things in them, and where these truly were

    def _add_frames(self, images: Choice, lens: str | None, placed: bool) -> None:
        """The images, with the poses that stand in them."""
        photos, data, wishes, own = stream_of(images, "photos"), self.data, self.wishes, self.own
        camera, how = camera_of(images.item.log, wishes.camera, wishes.focal_px)
        if camera is None:
            self._leave_out_images(how, "give --camera or --focal")
            return
        data["camera"] = camera.model_dump()
        self.notes.append(f"The camera: {how}.")
        clock = clock_of_images(
            images.item,
            None if own is None else own.item,
            wishes.camera_offset_s,
            records := self._records(),
            [one.item for one in self.by_role["target"]],
        )
        self.notes.append(clock.note)
        if clock.kind == "sequence" and any(map(self.by_role.get, ("own", "camera", "receiver", "target"))):
            self._leave_out_images(
                "the logs go by time",
                "import as many images as there are records of triggers, or write times into them "
                "(exiftool -DateTimeOriginal)",
            )
            del data["camera"]
            self.logs.pop("triggers", None)
            return
        if records is not None and not clock.triggers and wishes.camera_offset_s is None:
            self.notes.append(f"{int(records[1].used.sum())} triggers fit no images for certain: not used.")
        stems = {PurePosixPath(str(one)).stem for one in photos.columns["file"]}
        id_ = "stem" if len(stems) == len(photos) else "file"
        file = self._table(images, "photos", "images")
        self.logs[file] |= {"triggers": clock.triggers} if clock.triggers else {}
        self.logs[file] |= {} if lens is None else {"camera": lens}
        if not clock.triggers:
            self.logs.pop("triggers", None)
        frames: dict[str, Any] = {"file": file, "id": id_}
        if clock.kind == "sequence":
            data["time"] = {"kind": "sequence"}
        else:
            frames |= {"time": STAMP, "where": TIMED}
        if clock.offset_s:
            data["clocks"] = {"camera_offset_s": clock.offset_s}
        data["frames"] = frames
        if placed and (own is None or not own.item.part("poses")):
            end = angles(photos)
            data.setdefault("poses", {})["camera" if end == "_world_deg" else "images"] = {
                "file": file,
                "where": [*USED, *({"column": f"{axis}{end}", "above": NO_ANGLE} for axis in TURNS)],
                "frame": id_,
                "position": position(),
                "attitude": quantities(TURNS, "{}" + end, "deg"),
            }

    def _records(self) -> tuple[str, Stream] | None:
        """The table of the triggers' records, where there are any, and its rows."""
        for one in (self.triggers, self.own):
            if one is not None and has_utc(stream := one.item.part("triggers")):
                return self._table(one, "triggers", "triggers"), stream
        return None

    def _add_mount(self, camera: bool) -> None:
        """Which way the camera looks: along its own poses where there are any, else down."""
        if "frames" not in self.data:
            return
        if camera:
            poses = list(self.data.get("poses", {}))
            own = {"poses": "camera"} if "camera" in poses and len(poses) > 1 else {}
            self.data["mount"] = own | {"looks": "forward"}
            others = [name for name in poses if name != "camera"]
            self.notes.append(
                f"[mount] is on the camera's own poses (--source camera), not on {', '.join(others)}."
                if own
                else "The lens points along the poses."
            )
        elif "gimbal" not in self.data:
            self.data["mount"] = {"looks": "down"}
            self.notes.append("The camera is taken to look straight down: see [mount].")

    def _add_targets(self) -> None:
        """Truth: tracks of targets, and points that do not move."""
        truth = []
        for number, one in enumerate(self.by_role["target"], 1):
            part = "gnss" if one.item.part("gnss") else "poses"
            block = self._over_time(one, part, f"target-{number}")
            block |= {"target": one.target, "position": position()}
            truth.append(block | stated_spreads(stream_of(one, part)))
        for number, one in enumerate(self.by_role["marks"], 1):
            stream = stream_of(one, "marks")
            block = {"file": self._table(one, "marks", f"marks-{number}"), "where": USED, "id": "name"}
            truth.append(block | {"position": position()} | stated_spreads(stream))
        if truth:
            self.data["truth"] = truth

    def _add_clicks(self, images: Choice | None) -> None:
        """What was clicked in the images."""
        if images is None or "frames" not in self.data:
            self.notes.append("The pixels are left out: no images.")
            return
        frames, clicks = self.data["frames"], self.by_role["clicks"]
        level = self._level()
        photos = stream_of(images, "photos")
        match = match_names(map(str, photos.columns["file"]))
        blocks = []
        for number, one in enumerate(clicks, 1):
            stream = stream_of(one, "clicks")
            block: dict[str, Any] = {
                "source": "clicks" if len(clicks) == 1 else f"clicks-{number}",
                "file": self._table(one, "clicks", f"clicks-{number}"),
                "where": USED,
                "prefix": f"click-{number}-",
                "frame": "stem" if frames["id"] == "stem" else "image",
                "pixel": quantities("uv", "{}_px", "px"),
            }
            kinds = "" if self.by_role["marks"] else note_of_kinds(stream, one.item.shown)
            self.notes += [kinds] if kinds else []
            block |= {"target": "name"} if "name" in stream.columns and not kinds else {}
            if level is not None:
                block["ground"] = {"height": {"value": level, "unit": "m"}}
            self.logs[block["file"]]["images"] = frames["file"]
            strange = sum(match(str(name)) is None for name in stream.columns["image"][stream.used])
            if strange:
                self.notes.append(
                    f"{one.item.shown}: {strange} of {len(stream)} pixels are of no image here, and left out."
                )
            blocks.append(block)
        self.data["detections"] = blocks

    def _level(self) -> float | None:
        """Height of level ground: the mean of the surveyed points', or that of the take-off, where a log has
        heights above it beside others."""
        heights: list[float] = []
        for one in self.by_role["marks"]:
            heights += self._heights_of(key_of(one, "marks"))
        if heights:
            mean, spread = float(np.mean(heights)), float(np.ptp(heights))
            if len(heights) > 1 and spread > 0:
                self._uncertain_plane(float(np.std(heights, ddof=1)))
            self.notes.append(
                f"The ground is taken to be level, as {len(heights)} surveyed points within "
                f"{spread:.1f} m have it: better a map, --terrain."
            )
            return round(mean, 3)
        for key, stream in self.streams.items():
            home = stream.columns.get("height_home_m")
            of_home = [] if home is None else self._heights_of(key, home)
            if of_home:
                self._uncertain_plane(TAKE_OFF_SD_M)
                self.notes.append(
                    "The ground is taken to be level, as the take-off: better a map, --terrain."
                )
                return round(float(np.median(of_home)), 3)
        return None

    def _heights_of(self, key: str, above: Any = 0.0) -> list[float]:
        """Heights of a part that can be used, m, less those above something."""
        use, stream = self.heights.uses.get(key), self.streams.get(key)
        if use is None or stream is None:
            return []
        column = (stream.columns[use.column] + round(use.add_m, 4) - above)[stream.used]
        return [float(one) for one in column[np.isfinite(column)]]

    def _uncertain_plane(self, sd_m: float) -> None:
        """The ground's height is as uncertain as that: ellipses know it."""
        self.data["uncertainty"] = {"plane_height_m": round(max(sd_m, 0.01), 3)}

    def _add_uncertainty(self) -> None:
        """How good poses are, where not each of them says so itself: positions by the receivers' own
        statements where there are any."""
        if any("spreads" not in one for one in self.data.get("poses", {}).values()):
            found = read_assumed("uncertainty")
            for way in ("horizontal", "vertical"):
                name = f"sd_{way}_m"
                values = [s.columns[name][s.used] for s in self.streams.values() if name in s.columns]
                every = np.concatenate([np.empty(0), *values])
                every = every[np.isfinite(every) & (every > 0)]
                if len(every):
                    found[f"position_{way}_m"] = round(float(np.median(every)), 4)
            found["note"] = f"Positions as the receivers state, where they do. The rest: {found['note']}"
            self.data["uncertainty"] = found | self.data.get("uncertainty", {})
            self.notes.append("Standard deviations that no log states are assumed: see [uncertainty].")
        if "imu" in self.data:
            self.notes.append("[imu] assumes a typical sensor.")


def _refuse_without_zone(choices: Sequence[Choice]) -> None:
    """A log whose clock states no zone may be the vehicle's own: none without an attitude takes its place."""
    if any(one.role == "own" and one.item.part("poses") for one in choices):
        return
    for one in choices:
        if one.role == "nothing" and "without a zone" in one.why:
            raise _no_zone(one)


def _no_zone(choice: Choice) -> WildlabError:
    return WildlabError(
        f"the clock of {choice.item.shown} is local time of no stated zone",
        f"state it, as --zone Europe/Oslo, or leave it out: --role {choice.item.name}=nothing",
        field="--zone",
    )


def _no_utc(choice: Choice) -> WildlabError:
    """What to state of a log that does not know UTC."""
    if "zone" in choice.item.log.clock:
        return _no_zone(choice)
    problem = f"the clock of {choice.item.shown} does not know UTC"
    return WildlabError(
        problem, "state when it stood at zero, as --start 2026-05-01T06:00:00Z", field="--start"
    )


def _above_take_off_alone(stream: Stream) -> bool:
    """Whether a part has heights above the take-off, and none of another kind in any row that can be used."""
    others = [stream.columns.get(f"height_{kind}_m") for kind in ("ellipsoid", "sea")]
    if any(one is not None and np.isfinite(one[stream.used]).any() for one in others):
        return False
    return "height_home_m" in stream.columns


def _comment(text: str) -> str:
    """One line of a comment, whatever is in the text."""
    return "# " + re.sub(r"[\x00-\x1f\x7f\u0085\u2028\u2029]+", " ", text)


def key_of(choice: Choice, part: str) -> str:
    """What a part of a file is called in sentences."""
    return f"{choice.item.name} ({part})"


def stream_of(choice: Choice, part: str) -> Stream:
    """A part that a role asks for.

    Raises
    ------
    WildlabError
        Where no row of it can be used, as where a role was stated that the file does not have the data for.
    """
    stream = choice.item.part(part)
    if not stream:
        raise WildlabError(
            f"{choice.item.shown} is no {choice.role!r}: it has no {PARTS_SHOWN.get(part, part)} to use",
            f"choose another role, or --role {choice.item.name}=nothing",
            field="--role",
        )
    return stream


def has_utc(stream: Stream) -> bool:
    """Whether some row that can be used has a time in UTC."""
    times = stream.columns.get("time_s")
    return times is not None and bool(np.isfinite(times[stream.used]).any())


# -- what a part of a log gives a recipe


def read_assumed(part: str) -> dict[str, Any]:
    """What is assumed of ``"uncertainty"`` or ``"imu"``, as it stands in a recipe."""
    return dict(read_toml(ASSUMED, "what is assumed where logs say nothing")[part])


def quantities(names: Iterable[str], column: str, unit: str) -> dict[str, Any]:
    """Quantities by name, each with a column that has the name in it."""
    return {name: {"column": column.format(name), "unit": unit} for name in names}


def position() -> dict[str, Any]:
    return quantities(("latitude", "longitude"), "{}_deg", "deg") | quantities(["height"], "{}_m", "m")


def angles(stream: Stream) -> str:
    """How the columns of a part's angles end; nothing where it has none."""
    for end in ("_world_deg", "_deg"):
        values = _together(stream, [f"{axis}{end}" for axis in TURNS])
        if values is not None and np.isfinite(values).all(axis=1).any():
            return end
    return ""


def attitude(stream: Stream) -> dict[str, Any]:
    turned = _together(stream, QUATERNION)
    if turned is not None and np.isfinite(turned[:, 0]).all():
        return {"quaternion": QUATERNION, "order": "wxyz"}
    return quantities(TURNS, "{}" + (angles(stream) or "_deg"), "deg")


def velocity(stream: Stream) -> dict[str, Any]:
    """The velocity, where each row that can be used has one; none of a receiver that does not measure
    climbing and says 0 for it, as those that speak NMEA do."""
    values = _together(stream, [f"v_{axis}_m_s" for axis in AXES])
    if values is None or not np.isfinite(values).all():
        return {}
    heights = [one[stream.used] for name, one in stream.columns.items() if name.startswith("height_")]
    climbs = any(np.isfinite(one).any() and np.nanmax(one) - np.nanmin(one) > CLIMBED_M for one in heights)
    if climbs and not values[:, 2].any():
        return {}
    return {"velocity": quantities(AXES, "v_{}_m_s", "m/s")}


def pose_spreads(stream: Stream) -> dict[str, Any]:
    lengths, turns = ("horizontal", "vertical"), ("tilt", "heading")
    names = [*(f"sd_{one}_m" for one in lengths), *(f"sd_{one}_deg" for one in turns)]
    values = _together(stream, names)
    if values is None or not (np.isfinite(values) & (values > 0)).all():
        return {}
    return {"spreads": quantities(lengths, "sd_{}_m", "m") | quantities(turns, "sd_{}_deg", "deg")}


def stated_spreads(stream: Stream) -> dict[str, Any]:
    """Standard deviations of positions that a part has."""
    names = ("sd_horizontal", "sd_vertical")
    return quantities((one for one in names if f"{one}_m" in stream.columns), "{}_m", "m")


def _together(stream: Stream, names: Sequence[str]) -> Any:
    """Columns side by side, of rows that can be used, (N, K); None where one is not there."""
    if any(name not in stream.columns for name in names):
        return None
    return np.column_stack([stream.columns[name] for name in names])[stream.used]


# -- a card, read and imported


def read_card(
    paths: Sequence[Path],
    wishes: Wishes,
    roles: Mapping[str, str],
    tell: Callable[[str], None] = lambda name: None,
) -> Proposal:
    """Read files and folders, choose what each is for, and write down how a flight is made of them.

    Parameters
    ----------
    paths
        Files and folders: raw logs, folders of images, a whole memory card. Only read.
    wishes, roles
        As for `Proposal` and `choose_roles`.
    tell
        Called with the name of each file before it is read.

    Raises
    ------
    WildlabError
        Where nothing of it makes a flight, with the reason.
    """
    source = source_folder(paths)
    found = search(paths, source, wishes.zone, tell)
    if all(one.problem == OTHER for one in found):
        raise WildlabError("nothing in it is a log or an image", "name the folder of the logs", file=source)
    choices = choose_roles(found, roles)
    try:
        return Proposal(source, choices, wishes)
    except WildlabError as error:
        if error.file is not None:
            raise
        seen = "; ".join(f"{one.item.shown}: {one.role} ({printable(one.why)})" for one in choices[:20])
        raise WildlabError(
            f"{error.problem}. Found: {seen}", error.fix, file=source, field=error.field
        ) from None


def recipe_beside(flight: Path) -> Path:
    """Where the recipe of a flight lies: beside its folder."""
    return flight.with_name(f"{flight.name}.recipe.toml")


def import_card(
    card: Proposal,
    into: Path,
    overwrite: bool = False,
    calibration: Path | None = None,
    terrain: TerrainSays | None = None,
) -> Flight:
    """Write a card's flight, and its recipe beside it: both, or neither.

    Parameters
    ----------
    card
        From `read_card`.
    into, overwrite, calibration, terrain
        As for `import_flight`.

    Raises
    ------
    WildlabError
        As `import_flight`; and where there is a recipe already.
    """
    beside = recipe_beside(into)
    if beside.exists() and not overwrite:
        fix = "choose another, or --overwrite"
        raise WildlabError("there is a recipe already", fix, file=beside)
    with tempfile.TemporaryDirectory(prefix="wildlab-") as folder:
        path = Path(folder) / beside.name
        path.write_text(card.recipe, encoding="utf-8")
        flight = import_flight(path, card.source, into, overwrite, calibration, terrain)
    write_atomic(beside, card.recipe.encode("utf-8"))
    return flight


#: Headings of `rows_of`.
HEADINGS = ("file", "format", "begins (UTC)", "lasts", "role")


def rows_of(choices: Sequence[Choice]) -> list[list[str]]:
    """A row for each thing that was found, under `HEADINGS`."""
    return [_row(one) for one in choices if one.item.problem != OTHER]


def _row(choice: Choice) -> list[str]:
    found, role = choice.item, choice.role + (f" {choice.target}" if choice.target else "")
    spans = [span for part in PARTS if (span := span_of(found, [part]))]
    begins = lasts = ""
    if spans:
        first, last = min(one[0] for one in spans), max(one[1] for one in spans)
        begins, lasts = f"{datetime.fromtimestamp(first, UTC):%Y-%m-%d %H:%M:%S}", f"{last - first:.0f} s"
    return [found.shown, found.called, begins, lasts, role]


def sentences_of(choices: Sequence[Choice]) -> list[str]:
    """What of each thing is not used and why, what was lost, and what its reader noted."""
    notes = []
    others = [one.item.shown for one in choices if one.item.problem == OTHER]
    if others:
        more = f" and {len(others) - 3} more" if len(others) > 3 else ""
        notes.append(f"No logs by their endings, and not looked at: {', '.join(others[:3])}{more}")
    for one in choices:
        log, name = one.item.log, one.item.shown
        if one.item.problem == OTHER:
            continue
        role = f"is taken for {ROLES[one.role]}{one.target and f', {one.target}'}: {one.why}"
        if one.role == "nothing" or one.item.problem:
            role = f"is not used: {printable(one.why)}"
        own = [log.vehicle and f"is of {log.vehicle}", role]
        # An image without a place is one all the same, and its reader says what it lacks.
        own += [
            _unused(part, rows)
            for part, rows in log.parts.items()
            if part != "photos" and not rows.used.all()
        ]
        own += [*log.lost, *log.notes]
        notes += [f"{name}: {printable(text)}" for text in own if text]
    return notes


def _unused(part: str, stream: Stream) -> str:
    reasons = Counter(str(why) for why in stream.columns["why"] if why)
    told = ", ".join(f"{count} {why}" for why, count in reasons.most_common())
    return f"{int((~stream.used).sum())} of {len(stream)} rows of {part} are not used ({told})"
