"""Usual mistakes about attitudes: angles, their units and signs, axes. Functions of ``R_nb``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np

from wildlab.flight.checks.sense import words
from wildlab.flight.checks.sense.trial import Mistake
from wildlab.geometry.frames import (
    R_NED_ENU,
    Array,
    euler_to_matrix,
    matrix_to_euler,
    matrix_to_quaternion,
    quaternion_to_matrix,
)

FLIP = np.diag([1.0, -1.0, -1.0])
AXES = ("roll", "pitch", "yaw")
DEGREES = float(np.degrees(1.0))


def attitude_mistakes(part: str) -> Iterator[Mistake[Array]]:
    """Mistakes about the attitudes (N, 3, 3) of one nav source; `part` as ``"poses.logged"``."""
    where = f"{part}.attitude"

    def angles(change: Callable[[Array], Array | None]) -> Callable[[Array], Array | None]:
        def undo(R: Array) -> Array | None:
            changed = change(matrix_to_euler(R))
            return None if changed is None else euler_to_matrix(*np.moveaxis(changed, -1, 0))

        return undo

    for n in (1, 2, 3):
        for some in combinations(range(3), n):
            key = words.joined([AXES[i] for i in some], "and")
            flip = np.where(np.isin(np.arange(3), some), -1.0, 1.0)
            yield Mistake(
                f"sign of {key}",
                f"{key} {'has' if n == 1 else 'have'} the wrong sign",
                words.negate(key, where),
                angles(lambda e, s=flip: e * s),  # type: ignore[misc]
            )
    for turn, what in ((90.0, "a quarter turn"), (-90.0, "minus a quarter turn"), (180.0, "half a turn")):
        yield Mistake(
            f"yaw off by {turn:g} deg",
            f"the yaw is off by {what}",
            f"the yaw plus {turn:g} deg in [{where}], counted from true north towards east",
            angles(lambda e, t=turn: e + np.radians([0.0, 0.0, t])),  # type: ignore[misc]
        )
    for turn, what in ((90.0, "east"), (-90.0, "west"), (180.0, "south")):
        yield Mistake(
            f"yaw counted from {what} towards north" if turn == 90 else f"yaw negated and from {what}",
            f"the yaw counts to the left from {what}",
            f"{turn:g} deg minus the yaw in [{where}], so that it counts from true north towards east",
            angles(lambda e, t=turn: e * [1, 1, -1] + np.radians([0.0, 0.0, t])),  # type: ignore[misc]
        )
    for axis, key in enumerate(AXES[:2]):
        for turn in (90.0, -90.0, 180.0):
            yield Mistake(
                f"{key} off by {turn:g} deg",
                f"the {key} is off by {turn:g} deg",
                f"the {key} plus {turn:g} deg in [{where}]: both are zero where the airframe is level",
                angles(lambda e, t=turn, i=axis: e + np.radians(t) * np.eye(3)[i]),  # type: ignore[misc]
            )
    # A pitch that counts from straight down.
    for sign, turn in ((-1, 90.0), (-1, -90.0)):
        yield Mistake(
            f"pitch counted from the vertical ({turn:g} deg minus pitch)",
            "the pitch counts from the vertical",
            f"{turn:g} deg minus the pitch in [{where}], so that it is zero at the horizon",
            angles(lambda e, t=turn, s=sign: e * [1, s, 1] + np.radians([0.0, t, 0.0])),  # type: ignore[misc]
        )
    for n in (1, 2, 3):
        for some in combinations(range(3), n):
            key = words.joined([AXES[i] for i in some], "and")
            scale = np.where(np.isin(np.arange(3), some), DEGREES, 1.0)
            yield Mistake(
                f"{key} in radians, read as degrees",
                f"{key} {'is' if n == 1 else 'are'} in radians, and the recipe says degrees",
                words.unit(key, where, "rad"),
                angles(lambda e, s=scale: _read_as_degrees(e, s)),  # type: ignore[misc]
            )
    for some in ((0,), (1,), (0, 1)):
        key = words.joined([AXES[i] for i in some], "and")
        scale = np.where(np.isin(np.arange(3), some), 1 / DEGREES, 1.0)
        yield Mistake(
            f"{key} in degrees, read as radians",
            f"{key} {'is' if len(some) == 1 else 'are'} in degrees, and the recipe says radians",
            words.unit(key, where, "deg"),
            angles(lambda e, s=scale: e * s),  # type: ignore[misc]
        )
    for one, other in ((0, 1), (0, 2), (1, 2)):
        order = [0, 1, 2]
        order[one], order[other] = order[other], order[one]
        yield Mistake(
            f"{AXES[one]} and {AXES[other]} exchanged",
            f"{AXES[one]} and {AXES[other]} are exchanged",
            words.exchange(AXES[one], AXES[other], where),
            angles(lambda e, o=tuple(order): _lower(e[..., list(o)], _other(e)[..., list(o)])),  # type: ignore[misc]
        )
    yield Mistake(
        "attitude the other way round",
        "the attitude takes vectors from the world to the body",
        f"turn `inverse` of the quaternion in [{where}]",
        lambda R: np.swapaxes(R, -1, -2),
    )
    yield Mistake(
        "axes flu-enu",
        "the attitude is between forward-left-up and east-north-up",
        f'`axes = "flu-enu"` in [{where}] (or take it out, where it stands there)',
        lambda R: np.asarray(R_NED_ENU @ R @ FLIP),
    )
    for order_of, rolled in (("xyzw", [3, 0, 1, 2]), ("wxyz", [1, 2, 3, 0])):
        yield Mistake(
            f"quaternion in the order {order_of}",
            f"the quaternion is in the order {order_of}",
            f'`order = "{order_of}"` in [{where}]',
            lambda R, o=rolled: quaternion_to_matrix(matrix_to_quaternion(R)[..., o]),  # type: ignore[misc]
        )


def _other(angles: Array) -> Array:
    """The other angles of the same attitude: those past the vertical."""
    return np.asarray(np.array([np.pi, np.pi, np.pi]) + angles * [1, -1, 1])


def _lower(one: Array, other: Array) -> Array:
    """Of two readings of each angle the one with less roll."""
    lean = [np.abs(np.angle(np.exp(1j * a[..., :1]))) for a in (one, other)]
    return np.where(lean[0] <= lean[1], one, other)


def _read_as_degrees(angles: Array, scale: Array) -> Array | None:
    """Angles as they are where a number in radians was read as degrees: never beyond a turn, that is."""
    turned = angles * scale
    return turned if np.nanmax(np.abs(turned)) <= 2 * np.pi + 1e-6 else None


def rotations_of_axes() -> list[Array]:
    """The 24 rotations that take axes to axes, (3, 3) each, the identity first."""
    found: list[Array] = []
    for looks in range(4):
        for lean in range(4):
            for turn in range(4):
                R = np.round(euler_to_matrix(*(np.pi / 2 * np.array([looks, lean, turn]))))
                if not any((other == R).all() for other in found):
                    found.append(R)
    return found
