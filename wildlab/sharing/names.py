"""Neutral names in place of true ones, in the same order, so that what is sorted by name stays as it is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import pandas as pd

from wildlab.analysis.navigation_errors import REFERENCES
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


def renamed(table: pd.DataFrame, names: Names, schema: str) -> pd.DataFrame:
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
