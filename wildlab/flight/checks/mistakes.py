"""The usual mistakes as rows: what is read, what takes it to what is right, what to call it, how to mend it.

The rows lie in ``data/messages/mistakes.toml``. A row is ``value[order] * scale + shift`` in coordinates:
angles of an attitude, latitude, longitude and height, pixels, numbers of a calibration. A block with a
``unit`` has two rows for each other unit of that dimension: either may be the log's, and the other the
recipe's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import permutations, product
from typing import Any, TypeVar

import numpy as np

from wildlab.flight.checks.explanation import Change, Correction, Mistake
from wildlab.flight.checks.findings import messages, phrase
from wildlab.flight.units import UNITS
from wildlab.geometry.frames import (
    R_NED_ENU,
    Array,
    Origin,
    euler_to_matrix,
    geodetic_to_ned,
    matrix_to_euler,
    matrix_to_quaternion,
    ned_to_geodetic,
    quaternion_to_matrix,
)

T = TypeVar("T")
Row = Mapping[str, Any]

FLIP = np.diag([1.0, -1.0, -1.0])
#: What is no scale and no shift of angles.
ATTITUDES: dict[str, Callable[[Array], Array]] = {
    "transposed": lambda R: np.swapaxes(R, -1, -2),
    "flu-enu": lambda R: np.asarray(R_NED_ENU @ R @ FLIP),
    "xyzw": lambda R: quaternion_to_matrix(matrix_to_quaternion(R)[..., [3, 0, 1, 2]]),
    "wxyz": lambda R: quaternion_to_matrix(matrix_to_quaternion(R)[..., [1, 2, 3, 0]]),
}


def rows_of(group: str) -> Iterator[Row]:
    """The rows of a group, each with the texts of its block."""
    for block in messages("mistakes")[group]:
        if "unit" in block:
            units = UNITS[block["unit"]]
            inside = next(unit for unit, factor in units.items() if factor == 1)
            for axes in block.get("rows", [{"axes": 1}]):
                for unit, factor in units.items():
                    for is_in, read, scale in ((unit, inside, factor), (inside, unit, 1 / factor)):
                        if unit != inside:
                            scales = np.where(axes["axes"], scale, 1.0)
                            yield {**block, **axes, "unit": is_in, "read": read, "scale": scales}
        else:
            for row in block.get("rows", [{}]):
                yield {**block, **row}


def change_by(row: Row, unit: Any = 1.0) -> Change:
    """The change of a row, with shifts in a unit; None where a value would be beyond what the row allows."""
    scale, shift = np.array(row.get("scale", 1.0)), np.array(row.get("shift", 0.0)) * unit
    if "of_unit" in row:
        scale = scale * unit
    order = row.get("order")

    def change(read: Array) -> Array | None:
        value = np.asarray((read if order is None else read[..., order]) * scale + shift)
        for name, limited in (("limit_read", read), ("limit", value)):
            if name in row and np.nanmax(np.abs(limited)) > row[name]:
                return None
        return value

    return change


def mistake(
    row: Row,
    undo: Callable[[T], T | None],
    *corrections: Correction,
    fitted: bool = False,
    **facts: Any,
) -> Mistake[T]:
    """The mistake of a row, or of a group of one row by its name."""
    cause, said, fix = (phrase(row[name], {**row, **facts}) for name in ("cause", "said", "fix"))
    return Mistake(cause, said, fix, undo, fitted, corrections, row.get("about", ""))


def one_row(group: str) -> Row:
    """The row of a group that has one."""
    return next(rows_of(group))


def attitude_mistakes(part: str) -> Iterator[Mistake[Array]]:
    """Mistakes about the attitudes (N, 3, 3) of one nav source; `part` as ``"poses.logged"``."""
    for row in rows_of("attitude"):
        yield mistake(row, ATTITUDES.get(row.get("way", "")) or _by_angles(row), part=part)


def _by_angles(row: Row) -> Change:
    exchanged = "order" in row
    change = change_by(row, np.radians(1.0))

    def undo(R: Array) -> Array | None:
        angles = matrix_to_euler(R)
        changed = change(angles)
        # The other angles of the same attitude are those past the vertical: the lower lean is meant.
        other = change(np.pi + angles * [1, -1, 1]) if exchanged else None
        if changed is not None and other is not None:
            lean = [np.abs(np.angle(np.exp(1j * a[..., :1]))) for a in (changed, other)]
            changed = np.where(lean[0] <= lean[1], changed, other)
        return None if changed is None else euler_to_matrix(*np.moveaxis(changed, -1, 0))

    return undo


def place_mistakes(part: str, origin: Origin, local: bool = True) -> Iterator[Mistake[Array]]:
    """Mistakes about one table of positions, as they are undone.

    Parameters
    ----------
    part
        Of the recipe, as ``"poses.logged"``.
    origin
        Of frame n.
    local
        Whether coordinates about the origin count too, beside latitude and longitude.
    """

    def geodetic(change: Change) -> Change:
        def undo(p: Array) -> Array | None:
            changed = change(ned_to_geodetic(p, origin))
            if changed is None:
                return None
            lat, lon, height = np.moveaxis(changed, -1, 0)
            with np.errstate(invalid="ignore"):
                off_earth = (np.abs(lat) > np.pi / 2).any() or (np.abs(lon) > 2 * np.pi).any()
            return None if off_earth else geodetic_to_ned(lat, lon, height, origin)

        return undo

    for group in ("geodetic", "local", "height", "down"):
        for row in rows_of(group):
            if local or group != "local":
                change = change_by(row)
                yield mistake(row, change if group in ("local", "down") else geodetic(change), part=part)


def other_axes() -> Iterator[Array]:
    """The 47 ways (3, 3) to exchange axes and turn them round, but for leaving them as they are."""
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            M = np.eye(3)[list(order)] * np.array(signs)[:, None]
            if not (np.eye(3) == M).all():
                yield M


def axes_words(M: Array) -> str:
    """``"x is minus y, y is x"`` for a matrix that takes what is read to what is right."""
    said = []
    for i, row in enumerate(np.asarray(M)):
        j = int(np.argmax(np.abs(row)))
        if i != j or row[j] < 0:
            said.append(f"{'xyz'[i]} is {'minus ' if row[j] < 0 else ''}{'xyz'[j]}")
    return ", ".join(said)


def rotations_of_axes() -> list[Array]:
    """The 24 rotations that take axes to axes, (3, 3) each, the identity first."""
    found: dict[bytes, Array] = {}
    for turns in product(range(4), repeat=3):
        R = np.round(euler_to_matrix(*(np.pi / 2 * np.array(turns)))) + 0.0
        found.setdefault(R.tobytes(), R)
    return list(found.values())
