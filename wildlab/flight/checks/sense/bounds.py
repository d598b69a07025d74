"""Values that nothing on Earth has: the bounds are in the schema, with each column."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from wildlab.flight.checks.findings import Finding, count, first_row
from wildlab.flight.checks.sense import words
from wildlab.flight.schema import NAV, TABLES, Table
from wildlab.flight.store import Flight


def bounds(flight: Flight) -> Iterator[Finding]:
    """Values outside of the bounds of their column, by row.

    Parameters
    ----------
    flight
        The flight.

    Yields
    ------
    Finding
    """
    for name, nav in flight.nav.items():
        yield from outside(f"nav/{name}", NAV, nav)
    for name, table in flight.tables.items():
        yield from outside(name, TABLES[name], table)


def outside(name: str, schema: Table, data: pd.DataFrame) -> Iterator[Finding]:
    """Values of one table outside of the bounds of their columns; NaN is not."""
    for column in schema.columns:
        if column.bounds is None or column.name not in data:
            continue
        values = data[column.name].to_numpy(float)
        low, high = column.bounds
        bad = (values < low) | (values > high)
        bad &= np.isfinite(values)  # what is not a finite number is said elsewhere
        if bad.any():
            row = first_row(bad)
            yield Finding(
                "problem",
                name,
                column.name,
                f"{count(bad, 'value')} beyond what is possible ({low:g} to {high:g} {column.unit}), "
                f"first in row {row} "
                f"with {values[row]:.6g}",
                f"check unit and column in [{words.part_of(name)}] of the recipe, or take out those rows",
                ("beyond bounds",),
            )
