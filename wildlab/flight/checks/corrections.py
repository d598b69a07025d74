"""Corrections of a flight, and the findings that are left with one: when a mistake explains others, it alone
is reported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from wildlab.errors import WildlabError
from wildlab.flight.checks.findings import POSITION, QUATERNION, Finding
from wildlab.flight.manifest import replace_in_manifest
from wildlab.flight.store import Flight
from wildlab.geometry.camera import Camera
from wildlab.geometry.frames import Array, matrix_to_quaternion, quaternion_to_matrix
from wildlab.geometry.mount import Mount

#: Causes that are in one table alone, or in the stamps: nothing about another table explains them.
LEAP, APART = "leap of the position", "little time in common"

Correction = Callable[[Flight], Flight | None]


def change_columns(table: str, names: Sequence[str], change: Callable[[Array], Array | None]) -> Correction:
    """Correct columns (N, K) of one table, ``"nav/x"`` or another; None where they cannot be that mistake."""

    def correct(flight: Flight) -> Flight | None:
        source = table.removeprefix("nav/")
        data = flight.nav[source] if table.startswith("nav/") else flight.tables[table]
        values = change(data[list(names)].to_numpy(float))
        if values is None:
            return None
        changed = data.assign(**dict(zip(names, np.asarray(values).T, strict=True)))
        if table.startswith("nav/"):
            return replace(flight, nav={**flight.nav, source: changed})
        return replace(flight, tables={**flight.tables, table: changed})

    return correct


def change_attitude(source: str, undo: Callable[[Array], Array | None]) -> Correction:
    """Correct the attitudes ``R_nb`` of one nav source."""

    def change(q: Array) -> Array | None:
        R = undo(quaternion_to_matrix(q))
        return None if R is None else matrix_to_quaternion(R)

    return change_columns(f"nav/{source}", QUATERNION, change)


def change_place(table: str, undo: Callable[[Array], Array | None]) -> Correction:
    """Correct the positions of one table."""
    return change_columns(table, POSITION, undo)


def shift_poses(source: str, by: float) -> Correction:
    """Shift the stamps of one nav source by so many seconds."""
    return change_columns(f"nav/{source}", ["time_s"], lambda t: t + by)


def shift_clock(name: str, by: float) -> Correction:
    """Add seconds to one of the offsets of ``[clocks]``."""

    def correct(flight: Flight) -> Flight:
        offset = getattr(flight.manifest.clocks, name) + by
        return replace(flight, manifest=replace_in_manifest(flight.manifest, {"clocks": {name: offset}}))

    return correct


def change_camera(camera: Camera, mount: Mount) -> Correction:
    """State another calibration and another mount."""
    roll, tilt, pan = np.degrees(mount.misalignment).tolist()
    parts = {
        "camera": {
            **{f"{name}_px": float(getattr(camera, name)) for name in ("fx", "fy", "cx", "cy")},
            **dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion, strict=True)),
        },
        "mount": {
            "looks": mount.looks,
            "misalignment_roll_deg": roll,
            "misalignment_tilt_deg": tilt,
            "misalignment_pan_deg": pan,
            "lever_arm_m": mount.lever_arm,
        },
    }

    def correct(flight: Flight) -> Flight:
        return replace(flight, manifest=replace_in_manifest(flight.manifest, parts))

    return correct


def report_alone(
    flight: Flight, found: Sequence[Finding], again: Callable[[Flight], list[Finding]]
) -> list[Finding]:
    """The findings less those that vanish where another one's mistake is corrected.

    Parameters
    ----------
    flight
        That they are of.
    found
        All findings.
    again
        Gives all findings of a corrected flight.

    Returns
    -------
    list of Finding
        The mistake whose correction leaves the fewest findings and brings no new ones; then, in the same way,
        what is still found with it. Notes stay as they were.
    """
    notes = [one for one in found if one.level == "note"]
    return [*_explained(flight, _once([one for one in found if one.level != "note"]), again), *notes]


def _once(found: list[Finding]) -> list[Finding]:
    """Of what nothing explains about a whole table, the first: another pair says the same of it."""
    first = {one.table: one for one in reversed(found) if not one.field and not one.causes}
    return [one for one in found if one.field or one.causes or one is first[one.table]]


def _explained(
    flight: Flight, found: list[Finding], again: Callable[[Flight], list[Finding]]
) -> list[Finding]:
    if len(found) < 2:
        return found
    before = {_about(one) for one in found}
    kept = [one for one in found if LEAP in one.causes or APART in one.causes]
    best: tuple[Finding, Flight, list[Finding]] | None = None
    # Of corrections that explain as much, the one whose finding names fewer mistakes says more.
    for one in sorted(found, key=lambda one: len(one.causes)):
        for correct in one.corrections:
            try:
                corrected = correct(flight)
                left = [] if corrected is None else [x for x in again(corrected) if x.level != "note"]
                left = kept + [x for x in left if LEAP not in x.causes and APART not in x.causes]
            except (WildlabError, ValueError):
                continue
            about = {_about(x) for x in left}
            if corrected is None or _about(one) in about or about - before:
                continue
            if best is None or len(left) < len(best[2]):
                best = one, corrected, left
            if not left:
                break
        if best is not None and not best[2]:
            break
    if best is None or len(best[2]) >= len(found) - 1:
        return found
    return [best[0], *_explained(best[1], best[2], again)]


def _about(one: Finding) -> tuple[str, str]:
    return one.table, one.field
