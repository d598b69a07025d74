"""What a tracking filter was told, as a copy may print it: neutral names, no zone of time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from string import ascii_uppercase
from typing import Any, NamedTuple

from wildlab.errors import WildlabError
from wildlab.flight.following import Settings, TargetsPart
from wildlab.sharing.names import PLAIN, Names

#: Offsets of clocks are cut by whole quarters of an hour, which zones of time are made of, s.
QUARTER = 900.0


class Neutral(NamedTuple):
    """Settings as a copy has them, and the sensors that they no longer speak of, as they do not exist."""

    settings: Settings
    left_out: tuple[str, ...]


def whole_quarters(offset_s: float) -> float:
    """What of a clock's offset may be its zone of time, s.

    Examples
    --------
    >>> whole_quarters(7198.5), whole_quarters(-0.5)
    (7200.0, 0.0)
    """
    return offset_s - math.remainder(offset_s, QUARTER)


def neutral_hulls(targets: dict[str, Any]) -> None:
    """Give letters to the kinds of hulls in a ``[targets]`` that is given as plain values; it is changed.

    No numbers: a length stands beside the name.
    """
    for letter, hull in zip(ascii_uppercase, (targets.get("many") or {}).get("hulls", ()), strict=False):
        hull["name"] = f"kind {letter}"


def neutral_settings(settings: Settings, names: Names, moved: Mapping[str, float]) -> Neutral:
    """Settings that tell a filter of a generalised flight the same.

    Parameters
    ----------
    settings
        As they were.
    names
        Neutral names by the true ones.
    moved
        By the true name of a sensor, what was added to its stamps in the generalised flight, s.

    Returns
    -------
    Neutral

    Raises
    ------
    WildlabError
        Where the offset of a clock tells its zone, and is not that of the flight.
    """
    known = names.by_kind.get("sensor", {})
    sensors: dict[str, Any] = {}
    left_out = []
    for name, part in settings.sensors.items():
        if name not in known and name not in PLAIN:
            # Two of them would have one name.
            left_out.append(name)
            continue
        data = part.model_dump(exclude_none=True, exclude_unset=True)
        if "clock_offset_s" in data:
            data["clock_offset_s"] = part.clock_offset_s - moved.get(name, 0.0)
            if whole_quarters(data["clock_offset_s"]):
                here = f", and flight.toml about {moved[name]:g} s" if name in moved else ""
                raise WildlabError(
                    f"the settings add {part.clock_offset_s:g} s to the stamps of {name!r}{here}, which "
                    "tells a zone of time",
                    "state this offset in flight.toml, follow the targets again, and share that",
                    field=f"sensors.{name}.clock_offset_s",
                )
        sensors[names.of("sensor", name)] = data
    targets = settings.targets.model_dump(exclude_none=True, exclude_unset=True)
    neutral_hulls(targets)
    return Neutral(Settings.model_validate({"sensors": sensors, "targets": targets}), tuple(left_out))


def names_in(settings: Settings) -> tuple[str, ...]:
    """All names that somebody gave in settings: of sensors, and of kinds of targets."""
    return *settings.sensors, *hulls_of(settings.targets)


def hulls_of(targets: TargetsPart) -> tuple[str, ...]:
    """What the kinds of targets are called that many are followed of; a name like a neutral one is none."""
    hulls = targets.many.hulls if targets.many is not None else ()
    return tuple(hull.name for hull in hulls if not re.fullmatch("kind [A-Z]", hull.name))
