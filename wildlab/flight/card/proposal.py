"""A recipe in the making: what the user states, the tables that it asks for, and what was decided."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from wildlab.errors import WildlabError
from wildlab.flight.card.blocks import has_utc, stream_of
from wildlab.flight.card.found import OTHER
from wildlab.flight.card.heights import Heights, Key, heights_of
from wildlab.flight.card.roles import Choice
from wildlab.flight.manifest_parts import CameraPart
from wildlab.flight.readers.log import Stream
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


class Sources:
    """The logs' tables that a recipe asks for, each named once."""

    def __init__(self, wishes: Wishes, streams: dict[Key, Stream], own: Collection[Key]) -> None:
        self.wishes, self.streams = wishes, streams
        self.heights: Heights = heights_of(streams, own, wishes.geoid_m, wishes.take_off_m)
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
