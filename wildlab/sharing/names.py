"""Neutral names in place of true ones, in the same order, so that what is sorted by name stays as it is; also
in what a tracking filter was told."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from string import ascii_uppercase
from typing import Any, NamedTuple

import pandas as pd

from wildlab.analysis.navigate import REFERENCES
from wildlab.errors import WildlabError
from wildlab.flight.manifest import Settings, TargetsPart
from wildlab.flight.schema import NAV, TABLES
from wildlab.flight.store import PREFERRED

#: Names that say what a thing is and nothing of where: wildlab's own, and those of kinds of sensors. Poses
#: that a report looks up by name keep it: by another name they would be held against another reference.
PLAIN = frozenset(
    (
        *REFERENCES,
        *PREFERRED,
        *("truth", "mekf", "observer", "ekf", "gnss", "imu", "gimbal"),
        *("detector", "click", "clicks", "camera", "thermal", "infrared", "ir", "visible", "rgb", "optical"),
        *("eo", "radar", "lidar", "ais", "sonar"),
    )
)
#: Columns of text whose names are of one kind, by what a neutral name of it begins with.
KINDS: dict[str, str] = {
    "frame_id": "frame",
    "detection_id": "detection",
    "target_id": "target",
    "group": "part",
    "source": "sensor",
    "sensor": "sensor",
}


@dataclass
class Names:
    """Neutral names by kind: ``{"target": {"Sarah the rhino": "target-1"}}``."""

    by_kind: dict[str, dict[str, str]] = field(default_factory=dict)

    def learn(self, kind: str, names: Iterable[str]) -> None:
        """Give each name of a kind its neutral one; once for all that there are of the kind.

        Names of `PLAIN` stay. The numbers follow the order of the true names: what sorts by name, or draws
        random numbers name by name, gives the same results with either.
        """
        known = sorted({name for name in names if name} - PLAIN)
        digits = len(str(len(known)))
        self.by_kind[kind] = {
            name: f"{_begins(kind, name)}-{i:0{digits}d}" for i, name in enumerate(known, start=1)
        }

    def of(self, kind: str, name: str) -> str:
        """The neutral name; of nothing, nothing."""
        return name if not name or name in PLAIN else self.by_kind.get(kind, {}).get(name, kind)


def _begins(kind: str, name: str) -> str:
    """What a neutral name begins with; poses that are a twin's own truth are known by it."""
    return "truth" if kind == "poses" and name.startswith("truth") else kind


def learn_names(
    nav: Mapping[str, pd.DataFrame], tables: Mapping[str, pd.DataFrame], more: Iterable[str]
) -> Names:
    """Neutral names for all that the tables of a flight name.

    Parameters
    ----------
    nav, tables
        Of the flight.
    more
        Further names of sensors, from the manifest.

    Returns
    -------
    Names
    """
    found: dict[str, set[str]] = {kind: set() for kind in KINDS.values()}
    found["sensor"] |= set(more)
    for table in (*nav.values(), *tables.values()):
        for column, kind in KINDS.items():
            if column in table:
                found[kind] |= {str(name) for name in table[column].dropna().unique()}
    names = Names()
    for kind, known in found.items():
        names.learn(kind, known)
    names.learn("poses", nav)
    return names


def rename_identifiers(table: pd.DataFrame, names: Names, schema: str) -> pd.DataFrame:
    """A table with neutral names, and without columns that the schema does not know: they may hold anything.

    Parameters
    ----------
    table
        Is not changed.
    names
        From `learn_names`.
    schema
        Name of the table, or ``"nav"``.

    Returns
    -------
    DataFrame
    """
    known = (NAV if schema == "nav" else TABLES[schema]).column_names
    kept = table[[name for name in table.columns if name in known]].copy()
    for column, kind in KINDS.items():
        if column in kept:
            # A plain dictionary: a name is looked up as it is, and a missing one stays missing.
            kept[column] = [names.of(kind, name) if isinstance(name, str) else name for name in kept[column]]
    return kept


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


def scale_pixels(noise: dict[str, Any], more: float) -> None:
    """Scale a standard deviation in pixels, where plain values have one, as the camera's pixels are."""
    if noise.get("pixel_px"):
        noise["pixel_px"] *= more


def neutral_settings(
    settings: Settings, names: Names, moved: Mapping[str, float], pixels: float = 1.0
) -> Neutral:
    """Settings that tell a filter of a generalised flight the same.

    Parameters
    ----------
    settings
        As they were.
    names
        Neutral names by the true ones.
    moved
        By the true name of a sensor, what was added to its stamps in the generalised flight, s.
    pixels
        How much larger pixels are there.

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
        scale_pixels(data.get("noise", {}), pixels)
        if "clock_offset_s" in data:
            data["clock_offset_s"] = part.clock_offset_s - moved.get(name, 0.0)
            if whole_quarters(data["clock_offset_s"]):
                here = f", and flight.toml about {moved[name]:g} s" if name in moved else ""
                raise WildlabError(
                    f"the settings add {part.clock_offset_s:g} s to the stamps of {name!r}{here}, which "
                    "tells a zone of time",
                    "state this offset in flight.toml and follow the targets again",
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
