"""The magnetic field against attitude, place and the usual length: it stands still in n."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.flight.checks.corrections import change_attitude
from wildlab.flight.checks.findings import Finding
from wildlab.flight.checks.inertial_data import airframe_sources, attitudes_near
from wildlab.flight.checks.sense.attitudes import attitude_mistakes
from wildlab.flight.checks.sense.inertial_checks import axes_words, other_axes
from wildlab.flight.checks.sense.trial import Misfit, Mistake, corrections_of, explain
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

FIELD = ("field_x_ut", "field_y_ut", "field_z_ut")
#: Length of the Earth's field anywhere, with what is magnetic on board (uT).
WEAK, STRONG = 10.0, 150.0
#: Share of the field's turning that an attitude usually leaves unexplained (as a ratio of sizes), and how far
#: its direction in n usually is off (rad).
UNEXPLAINED, DIRECTION = 0.3, 0.3
UNITS = {"nT": 1e-3, "T": 1e6, "G": 100.0, "mG": 0.1}
MOST, ENOUGH = 500, 30
#: From one sample to the one compared with it, s: long enough to turn by more than noise.
STEP_S = 2.0


@dataclass(frozen=True)
class FieldStep:
    """Field before and after a step (N, 3) in b, attitudes then (N, 3, 3), and the direction of the Earth's
    field in n (3,) where the manifest says it."""

    before: Array
    after: Array
    R_before: Array
    R_after: Array
    earth: Array | None


def _turned(s: FieldStep, rows: NDArray[np.bool_]) -> Array:
    return np.asarray(np.swapaxes(s.R_after[rows], 1, 2) - np.swapaxes(s.R_before[rows], 1, 2))


def _fit(s: FieldStep, rows: NDArray[np.bool_]) -> Array:
    """The field in n (3,): the one whose turns in b are those seen. What is magnetic on board falls out."""
    A, change = _turned(s, rows).reshape(-1, 3), (s.after - s.before)[rows].ravel()
    return np.asarray(np.linalg.solve(A.T @ A + 1e-9 * np.eye(3), A.T @ change))


def misfit(s: FieldStep) -> Misfit:
    """Share of the turning that no field in n explains (first row), and how far its direction is off."""
    half = np.arange(len(s.before)) // 10 % 2 == 0
    result = np.empty((2, 3))
    for column, (fit, judged) in enumerate(((half | True, half | True), (half, ~half), (~half, half))):
        earth = _fit(s, fit)
        change = (s.after - s.before)[judged]
        left = np.linalg.norm(change - _turned(s, judged) @ earth, axis=1)
        total = max(float(np.mean(np.linalg.norm(change, axis=1) ** 2)), 1e-12)
        result[0, column] = float(np.sqrt(np.mean(left**2) / total)) / UNEXPLAINED
        off = 0.0
        if s.earth is not None:
            cosine = float(earth @ s.earth / max(float(np.linalg.norm(earth)), 1e-9))
            off = float(np.arccos(np.clip(cosine, -1, 1)))
        result[1, column] = 1 + off / DIRECTION
    return result


def field(flight: Flight) -> Iterator[Finding]:
    """The magnetometer: its unit, then its axes against every attitude."""
    table = flight.tables.get("magnetometer")
    if table is None or len(table) < ENOUGH:
        return
    values = table[["time_s", *FIELD]].to_numpy(float)
    values = values[np.isfinite(values).all(axis=1)]
    size = float(np.median(np.linalg.norm(values[:, 1:], axis=1)))
    if not WEAK <= size <= STRONG:
        ways = [unit for unit, factor in UNITS.items() if 20 <= size * factor <= 80]
        inverse = [unit for unit, factor in UNITS.items() if 20 <= size / factor <= 80]
        said = f"the magnetic field is {size:.3g} uT long (median), and that of the Earth is 22 to 67 uT"
        said += "".join(f"; it is in {unit}" for unit in ways)
        said += "".join(f"; it is in uT, and the recipe says {unit}" for unit in inverse if not ways)
        fix = " or ".join(f'write `unit = "{unit}"` in [magnetometer.field]' for unit in ways)
        if inverse and not ways:
            fix = 'write `unit = "uT"` in [magnetometer.field]'
        yield Finding(
            "problem",
            "magnetometer",
            FIELD[0],
            said,
            fix or "check the unit in [magnetometer.field]",
            tuple(f"magnetometer in {unit}" for unit in ways + inverse),
        )
        return
    for source in airframe_sources(flight):
        given = seen_by(values, flight.nav[source], _earth(flight))
        if given is None:
            continue
        named = explain(misfit, given, field_mistakes(source))
        if named:
            before, after = (
                100 * (1 - (UNEXPLAINED * misfit(x)[0, 0]) ** 2) for x in (given, named[0].undone)
            )
            yield Finding(
                "problem",
                "magnetometer",
                FIELD[0],
                f"of the field's turning the attitude of nav/{source} explains {max(before, 0):.0f} %, "
                "or it points "
                f"elsewhere than stated: {' or '.join(one.mistake.said for one in named)}; then it is "
                f"{after:.0f} %",
                " or ".join(f"write {one.mistake.write}" for one in named) + ", and import again",
                tuple(one.mistake.cause for one in named),
                corrections_of(named),
            )


def seen_by(values: Array, nav: pd.DataFrame, earth: Array | None) -> FieldStep | None:
    """Steps of the field (N, 4; time first) with the attitudes of a nav table; None of too few."""
    t = values[:, 0]
    first = np.unique(np.linspace(0, len(t) - 1, MOST).astype(int))
    last = np.minimum(np.searchsorted(t, t[first] + STEP_S), len(t) - 1)
    good = (t[last] - t[first] > STEP_S / 2) & (t[last] - t[first] < 2 * STEP_S)
    first, last = first[good], last[good]
    at = [attitudes_near(nav, t[rows]) for rows in (first, last)]
    both = np.intersect1d(at[0][0], at[1][0])
    if len(both) < ENOUGH:
        return None
    R = [turns[np.searchsorted(rows, both)] for rows, turns in at]
    return FieldStep(values[first[both], 1:], values[last[both], 1:], R[0], R[1], earth)


def _earth(flight: Flight) -> Array | None:
    stated = flight.manifest.magnetometer
    if stated.inclination_deg is None or stated.declination_deg is None:
        return None
    d, i = np.radians([stated.declination_deg, stated.inclination_deg])
    return np.array([np.cos(i) * np.cos(d), np.cos(i) * np.sin(d), np.sin(i)])


def field_mistakes(source: str) -> Iterator[Mistake[FieldStep]]:
    """Axes of the magnetometer that are exchanged or count the other way, and a yaw from elsewhere."""
    for a in attitude_mistakes(f"poses.{source}"):
        yield a.within("attitude", _attitude(a.undo), change_attitude(source, a.undo))
    for M in other_axes():
        yield Mistake(
            f"axes of the magnetometer: {axes_words(M)}",
            f"its axes are others: {axes_words(M)}",
            f"columns and `negate` in [magnetometer.field] so that {axes_words(M)} of now",
            lambda s, M=M: replace(s, before=s.before @ M.T, after=s.after @ M.T),  # type: ignore[misc]
        )


def _attitude(undo: Callable[[Array], Array | None]) -> Callable[[FieldStep], FieldStep | None]:
    def change(s: FieldStep) -> FieldStep | None:
        before, after = undo(s.R_before), undo(s.R_after)
        return None if before is None or after is None else replace(s, R_before=before, R_after=after)

    return change
