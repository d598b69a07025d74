"""What `check_flight` looks at, one function per question. Each yields findings, none changes anything."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pandas as pd

from wildlab.flight.clocks import covariances
from wildlab.flight.files import printable
from wildlab.flight.schema import NAV, TABLES, extra_columns
from wildlab.flight.store import Flight

Level = Literal["problem", "warning", "note"]

#: Logs print quaternions with few digits: four leave an error of 2e-4 in the norm.
NORM_TOLERANCE = 1e-3

POSE = ("time_s", "north_m", "east_m", "down_m", "q_w", "q_x", "q_y", "q_z")
QUATERNION = ("q_w", "q_x", "q_y", "q_z")
POSITION = ("north_m", "east_m", "down_m")


@dataclass(frozen=True)
class Finding:
    """Something to know about a flight.

    ``problem``: what it concerns cannot be used. ``warning``: it can, but look. ``note``: good to know.
    `table` is ``nav/<source>``, the name of a table, or ``flight.toml``. What `check_flight` returns are
    whole sentences, which name table and field. `causes`: the usual mistakes that explain it; `corrections`
    undo them in a flight, or give None where they cannot (`wildlab.flight.checks.corrections`).
    """

    level: Level
    table: str
    field: str
    sentence: str
    fix: str
    causes: tuple[str, ...] = ()
    corrections: tuple[Callable[[Flight], Flight | None], ...] = dataclasses.field(
        default=(), compare=False, repr=False
    )


def whole(one: Finding) -> Finding:
    """The finding in whole sentences, the first of which names table and field."""
    where = ", ".join(filter(None, (one.table, one.field)))
    return replace(one, sentence=f"{where}: {one.sentence}.", fix=f"{one.fix[:1].upper()}{one.fix[1:]}.")


def values(flight: Flight) -> Iterator[Finding]:
    """Numbers that are not numbers, and columns nobody knows."""
    for name, nav in flight.nav.items():
        for column in POSE:
            bad = ~np.isfinite(nav[column].to_numpy())
            if bad.any():
                yield Finding(
                    "problem",
                    f"nav/{name}",
                    column,
                    f"{count(bad, 'pose')} not a finite number here, first in row {first_row(bad)}",
                    "remove those rows, or fill them from the log",
                )
        norm = np.linalg.norm(nav[list(QUATERNION)].to_numpy(), axis=1)
        off = np.abs(norm - 1) > NORM_TOLERANCE
        if off.any():
            yield Finding(
                "problem",
                f"nav/{name}",
                "q_w",
                f"{count(off, 'quaternion')} not normalised, first in row {first_row(off)} with length "
                f"{norm[off][0]:.4g}",
                "check the order and the unit of the four columns; a rotation has length 1",
            )
        P = covariances(nav)
        if P is not None:
            P = P[np.isfinite(P).all(axis=(1, 2))]
            negative = np.linalg.eigvalsh(P)[:, 0] < -1e-9 * np.trace(P, axis1=1, axis2=2)
            if negative.any():
                yield Finding(
                    "problem",
                    f"nav/{name}",
                    "cov_00",
                    f"{count(negative, 'covariance')} no covariance at all (an eigenvalue below zero)",
                    "check the order of the 21 columns cov_ij",
                )
        yield from _unknown_columns(f"nav/{name}", nav)
    for name, table in flight.tables.items():
        for known in TABLES[name].columns:
            if known.dtype == "float" and known.name in table:
                value = table[known.name].to_numpy()
                bad = np.isinf(value) if known.may_be_nan else ~np.isfinite(value)
                if bad.any():
                    yield Finding(
                        "problem",
                        name,
                        known.name,
                        f"{count(bad, 'row')} not a finite number here, first row {first_row(bad)}",
                        "remove those rows, or fill them",
                    )
        yield from _unknown_columns(name, table)


def _unknown_columns(name: str, table: pd.DataFrame) -> Iterator[Finding]:
    schema = NAV if name.startswith("nav/") else TABLES[name]
    for column in extra_columns(schema, table):
        close = difflib.get_close_matches(column, schema.column_names, n=1)
        yield Finding(
            "warning",
            name,
            printable(column),
            "this column is not known, so nothing uses it",
            f"rename it if you meant {close[0]!r}" if close else "leave it, or take it out",
        )


def order(flight: Flight) -> Iterator[Finding]:
    """Timestamps that run backwards or stand still."""
    series = [(f"nav/{name}", nav) for name, nav in flight.nav.items() if "frame_id" not in nav]
    series += [
        (name, flight.tables[name])
        for name in ("imu", "gnss", "magnetometer", "gimbal")
        if name in flight.tables
    ]
    for name, table in series:
        yield from _increasing(name, table["time_s"], "")
    if flight.truth is not None:
        for target, rows in flight.truth.groupby("target_id", sort=False):
            times = rows["time_s"]
            if times.isna().all():
                continue
            if times.isna().any():
                yield Finding(
                    "problem",
                    "truth",
                    "time_s",
                    f"target {target!r} has rows with a time and rows without",
                    "give every row of a moving target its time; a fixed point has one row without",
                )
            else:
                yield from _increasing("truth", times, f" of target {target!r}")
    if flight.frames is not None:
        step = np.diff(flight.frames["time_s"].to_numpy())
        if (step < 0).any():
            yield from _increasing("frames", flight.frames["time_s"], "")
        elif again := _same_time(flight.frames):
            yield Finding(
                "warning",
                "frames",
                "time_s",
                f"{again} frames have the same time as the one before"
                + (" of their sensor" if "sensor" in flight.frames else ""),
                "use stamps with fractions of a second; at 20 m/s half a second is 10 m",
            )


def _same_time(frames: pd.DataFrame) -> int:
    """How many frames have the time of the one before, of the same sensor: two may look at once."""
    looks = [rows for _, rows in frames.groupby("sensor", sort=False)] if "sensor" in frames else [frames]
    return sum(int((np.diff(rows["time_s"].to_numpy()) == 0).sum()) for rows in looks)


def _increasing(name: str, times: pd.Series, whose: str) -> Iterator[Finding]:
    step = np.diff(times.to_numpy())
    bad = step <= 0
    if bad.any():
        row = first_row(bad) + 1
        yield Finding(
            "problem",
            name,
            "time_s",
            f"the timestamps{whose} are not increasing in {int(bad.sum())} of {len(bad)} steps: "
            f"{times.iloc[row - 1]:.3f} s in row {row - 1} is followed by {times.iloc[row]:.3f} s",
            "look at those rows for a wrong stamp or a clock that was set back, and mend it; else sort the "
            "rows by time and take out repeated ones",
        )


def count(bad: np.ndarray, what: str) -> str:
    """``"1 of 20 poses is"``, ``"3 of 20 poses are"``."""
    n = int(bad.sum())
    return f"{n} of {len(bad)} {what}s {'is' if n == 1 else 'are'}"


def first_row(bad: np.ndarray) -> int:
    """Row of the first bad value, counted from 0."""
    return int(np.argmax(bad))
