"""A recipe in the making: what the user states, the tables that it asks for, and what was decided.

What the heights of a card's flight count from is decided once those of all its logs are brought together.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal, NamedTuple, cast

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.card.found import OTHER
from wildlab.flight.card.roles import PARTS_SHOWN, Choice
from wildlab.flight.files import dump_toml
from wildlab.flight.heights import NO_GRID, choose_reference
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.readers.log import Stream

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
    said: list[str] = field(default_factory=list)

    def text(self, choices: Sequence[Choice]) -> str:
        """The recipe as TOML, with what it rests on in front."""
        lines = [
            "# Written by wildlab import. To change it: wildlab import THIS --source FOLDER --into FLIGHT"
        ]
        for one in choices:
            if one.found.problem == OTHER:
                continue
            role = one.role + (f" {one.target}" if one.target else "")
            lines.append(_comment(f"{one.found.shown}: {role} ({one.why})"))
        lines += [_comment(one) for one in self.said]
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
    stream = choice.found.part(part)
    if stream is None:
        raise WildlabError(
            f"{choice.found.shown} is to be {choice.role!r}, and has no {PARTS_SHOWN.get(part, part)} that "
            "can be used",
            f"say what else it is, or leave it out: --role {choice.found.name}=nothing",
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
    said: list[str] = field(default_factory=list)

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
            "Heights count from mean sea level, since no log says how high the geoid is there and "
            f"{NO_GRID}; --geoid states it.",
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
        found = choice.found
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
    clock = choice.found.log.clock if choice.found.log is not None else None
    if clock is not None and "zone" in clock.base:
        problem = f"the clock of {choice.found.shown} is local time, and nothing says its zone"
        return WildlabError(problem, "state it, as --zone Europe/Oslo or --zone +02:00", field="--zone")
    problem = f"the clock of {choice.found.shown} does not know UTC"
    return WildlabError(
        problem, "state when it stood at zero, as --start 2026-05-01T06:00:00Z", field="--start"
    )
