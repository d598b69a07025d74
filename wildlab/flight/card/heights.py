"""What the heights of a flight count from, once those of all its logs are brought together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.readers.logs.log import Stream

Kind = Literal["ellipsoid", "sea", "home"]
#: A part of a file: (name of the file, part).
Key = tuple[str, str]

_WORDS: dict[Kind, str] = {"ellipsoid": "the ellipsoid", "sea": "mean sea level", "home": "the take-off"}


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


def heights_of(streams: Mapping[Key, Stream], geoid_m: float | None) -> Heights:
    """One reference for all parts with heights.

    The ellipsoid where every part gets there: by heights of its own, or from sea level with a height of the
    geoid that is stated, or that one of the receivers logged. Else sea level, where every part has that or
    can be brought there. Else the take-off, where there is one log alone.

    Parameters
    ----------
    streams
        The parts that have positions.
    geoid_m
        How far the geoid is above the ellipsoid, m, where the user states it.

    Returns
    -------
    Heights

    Raises
    ------
    WildlabError
        Where two parts cannot be brought together.
    """
    has = {key: _kinds(stream) for key, stream in streams.items()}
    kinds_of_all = [set(kinds) for kinds in has.values()]
    logged = _logged(streams)
    geoid, why = geoid_m, "as you stated it"
    if geoid is None and logged is not None:
        geoid, why = logged, "as a receiver logged it (median)"
    for kind in ("ellipsoid", "sea", "home"):
        chosen = {key: _reach(kind, kinds, geoid) for key, kinds in has.items()}
        if all(one is not None for one in chosen.values()):
            break
    else:
        names = "; ".join(f"{file} ({part}): {_and(kinds)}" for (file, part), kinds in has.items())
        raise WildlabError(
            f"heights count from different things: {names}",
            "state how far the geoid is above the ellipsoid there (--geoid), or leave a file out (--role)",
            field="--geoid",
        )
    done = {key: one for key, one in chosen.items() if one is not None}
    said = [f"Heights count from {_WORDS[kind]}."] if done else []
    moved = sorted({file for (file, _), one in done.items() if one.add_m})
    if moved and geoid is not None:
        said.append(f"{', '.join(moved)}: the geoid is {geoid:.1f} m above the ellipsoid, {why}.")
    elif kind == "sea" and not any("ellipsoid" in kinds for kinds in kinds_of_all):
        said.append("How far that is above the ellipsoid is not known: --geoid says it.")
    return Heights(_WORDS[kind].removeprefix("the ") if done else "ellipsoid", done, said)


def _kinds(stream: Stream) -> list[Kind]:
    """Which heights every row that can be used has."""
    found: list[Kind] = []
    for kind in _WORDS:
        column = stream.columns.get(f"height_{kind}_m")
        if column is not None and np.isfinite(column[stream.used]).all():
            found.append(kind)
    return found


def _logged(streams: Mapping[Key, Stream]) -> float | None:
    """Median height of the geoid above the ellipsoid, as receivers logged it, m."""
    values = []
    for stream in streams.values():
        c = stream.columns
        if "undulation_m" in c:
            values.append(c["undulation_m"][stream.used])
        elif {"height_ellipsoid_m", "height_sea_m"} <= set(c):
            values.append((c["height_ellipsoid_m"] - c["height_sea_m"])[stream.used])
    every = np.concatenate([np.empty(0), *values])
    every = every[np.isfinite(every)]
    return float(np.median(every)) if len(every) else None


def _reach(kind: Kind, kinds: list[Kind], geoid_m: float | None) -> Chosen | None:
    if kind in kinds:
        return Chosen(kind)
    if geoid_m is None:
        return None
    if kind == "ellipsoid" and "sea" in kinds:
        return Chosen("sea", round(geoid_m, 3))
    return Chosen("ellipsoid", -round(geoid_m, 3)) if kind == "sea" and "ellipsoid" in kinds else None


def _and(kinds: list[Kind]) -> str:
    return " and ".join(_WORDS[kind] for kind in kinds) or "nothing that is stated for every row"
