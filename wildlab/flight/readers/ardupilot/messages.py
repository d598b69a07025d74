"""Messages of an ArduPilot log, one table per name: what is the same in its binary and its text form."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: What a raw value is divided by, by its format character; others stand as they are.
DIVISORS = {"c": 100.0, "C": 100.0, "e": 100.0, "E": 100.0, "L": 1e7}
#: Format characters of text.
TEXT_CHARACTERS = "nNZ"

Unit = Literal["deg", "rad/s", "m", "m/s", "m/s2", "uT"]
#: Wanted unit -> label in messages UNIT -> what takes a value to the wanted one.
_LABELS: dict[Unit, dict[str, float]] = {
    "deg": dict.fromkeys(("deg", "degheading", "deglatitude", "deglongitude"), 1.0)
    | {"rad": math.degrees(1)},
    "rad/s": {"rad/s": 1.0, "deg/s": math.radians(1)},
    "m": {"m": 1.0},
    "m/s": {"m/s": 1.0},
    "m/s2": {"m/s/s": 1.0},
    "uT": {"Gauss": 100.0},
}
#: Where the log says no units: a magnetic field is in milligauss, all else in the unit that is wanted.
_UNSAID: dict[Unit, float] = {"uT": 0.1}


@dataclass(frozen=True, eq=False)
class Table:
    """All messages of one name.

    Attributes
    ----------
    name
        As in its FMT.
    fields, characters
        Names of its columns, and the format character of each.
    rows
        (N,) where each stands in the file, counted from 1.
    column
        Values (N,) of the i-th field, divided as its character says.
    labels, multipliers
        Of each field what messages FMTU, UNIT and MULT say; empty where there are none.
    """

    name: str
    fields: tuple[str, ...]
    characters: str
    rows: NDArray[np.int64]
    column: Callable[[int], NDArray[Any]]
    labels: tuple[str, ...] = ()
    multipliers: tuple[float, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def has(self, *names: str) -> bool:
        """Whether it has all of these fields."""
        return set(names) <= set(self.fields)

    def numbers(self, *names: str, unit: Unit | None = None) -> Array:
        """(N,) the first of these fields that it has, in a unit; NaN where it has none of them."""
        for name in names:
            at = self.fields.index(name) if name in self.fields else -1
            if at >= 0 and self.characters[at] not in TEXT_CHARACTERS + "a":
                # NaN of the signalling kind in a damaged log is a NaN like others.
                with np.errstate(invalid="ignore"):
                    values = np.asarray(self.column(at)).astype(np.float64)
                return values if unit is None else values * self._factor(at, unit)
        return np.full(len(self), np.nan)

    def texts(self, name: str) -> list[str]:
        """(N,) a field of text; none where it has no such field."""
        return [str(one) for one in self.column(self.fields.index(name))] if name in self.fields else []

    def take(self, which: NDArray[Any]) -> Table:
        """The messages that a mask or an index picks."""
        column = self.column
        return replace(self, rows=self.rows[which], column=lambda at: column(at)[which])

    def instances(self) -> list[Table]:
        """One table per sensor, in their order; itself where messages do not say which."""
        for name in ("I", "C", "Instance"):
            if name in self.fields and len(self):
                which = self.numbers(name)
                return [self.take(which == one) for one in np.unique(which)]
        return [self] if len(self) else []

    def _factor(self, at: int, unit: Unit) -> float:
        usual = _UNSAID.get(unit, 1.0)
        label = self.labels[at] if at < len(self.labels) else ""
        if label not in _LABELS[unit]:
            return usual
        # The multiplier is one of raw values: a character that divides has it in it.
        if self.characters[at] in DIVISORS:
            return _LABELS[unit][label]
        by = self.multipliers[at] if at < len(self.multipliers) else 0.0
        return _LABELS[unit][label] * by if by > 0 and math.isfinite(by) else usual


def percent(count: int, total: int) -> str:
    """A share in percent, as it stands in sentences.

    Examples
    --------
    >>> percent(1, 30000), percent(299, 300)
    ('0.0033 %', '99.7 %')
    """
    value = 100 * count / total
    return f"{value:.2g} %" if value < 1 else f"{value:.1f} %"


def merge(tables: Sequence[Table]) -> Table:
    """Messages of one name whose columns differ, as one table: NaN or "" where one has no such field."""
    if len(tables) == 1:
        return tables[0]
    fields = tuple(dict.fromkeys(name for table in tables for name in table.fields))
    first = [next(table for table in tables if name in table.fields) for name in fields]
    characters = "".join(
        table.characters[table.fields.index(name)] for name, table in zip(fields, first, strict=True)
    )
    rows = np.concatenate([table.rows for table in tables])
    order = np.argsort(rows, kind="stable")

    def column(at: int) -> NDArray[Any]:
        name = fields[at]
        if characters[at] in TEXT_CHARACTERS + "a":
            parts: list[NDArray[Any]] = []
            for table in tables:
                part = np.full(len(table), "", dtype=object)
                if name in table.fields:
                    part[:] = [str(one) for one in table.column(table.fields.index(name))]
                parts.append(part)
            return np.concatenate(parts)[order]
        return np.concatenate([table.numbers(name) for table in tables])[order]

    said = next((table for table in tables if table.labels), None)
    if said is None or said.fields != fields[: len(said.fields)]:
        return Table(tables[0].name, fields, characters, rows[order], column)
    return Table(
        tables[0].name,
        fields,
        characters,
        rows[order],
        column,
        labels=said.labels,
        multipliers=said.multipliers,
    )


def with_units(tables: dict[str, Table], kinds: dict[str, int]) -> dict[str, Table]:
    """The same tables with what FMTU, UNIT and MULT say of their fields.

    Parameters
    ----------
    tables
        By name.
    kinds
        The number of each kind of message, by name.
    """
    if not {"FMTU", "UNIT", "MULT"} <= set(tables):
        return tables
    units, mults, said = tables["UNIT"], tables["MULT"], tables["FMTU"]
    label = dict(zip(_letters(units), units.texts("Label"), strict=False))
    multiplier = dict(zip(_letters(mults), mults.numbers("Mult").tolist(), strict=False))
    of_kind = {
        int(kind): (unit_ids, mult_ids)
        for kind, unit_ids, mult_ids in zip(
            said.numbers("FmtType"), said.texts("UnitIds"), said.texts("MultIds"), strict=False
        )
        if math.isfinite(kind)
    }
    made = dict(tables)
    for name, table in tables.items():
        unit_ids, mult_ids = of_kind.get(kinds.get(name, -1), ("", ""))
        labels = tuple(label.get(one, "") for one in unit_ids)
        made[name] = replace(
            table, labels=labels, multipliers=tuple(multiplier.get(one, 0.0) for one in mult_ids)
        )
    return made


def _letters(table: Table) -> list[str]:
    """Ids of units: characters, stored as numbers."""
    if "Id" in table.fields and table.characters[table.fields.index("Id")] in TEXT_CHARACTERS:
        return table.texts("Id")
    return [chr(int(one)) if 0 < one < 128 else "" for one in table.numbers("Id")]
