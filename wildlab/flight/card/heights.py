"""What the heights of a card's flight count from, once those of all its logs are brought together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, cast

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.heights import NO_GRID, choose_reference
from wildlab.flight.readers.log import Stream

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
