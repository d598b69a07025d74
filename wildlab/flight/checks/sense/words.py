"""Lines of a recipe, as findings name them."""

from __future__ import annotations

#: With these a line begins that says what to do, and not what to write.
VERBS = ("turn ", "exchange ")


def negate(key: str, part: str) -> str:
    """What to write where a sign is wrong."""
    return f"turn `negate` of {key} in [{part}]"


def unit(key: str, part: str, name: str) -> str:
    """What to write where a unit is wrong."""
    return f'`unit = "{name}"` for {key} in [{part}]'


def exchange(one: str, other: str, part: str) -> str:
    """What to write where two columns are exchanged."""
    return f"exchange the columns of {one} and {other} in [{part}]"


def fixes(ways: list[str]) -> str:
    """What to do about a mistake, each way with a verb of its own.

    Examples
    --------
    >>> fixes([negate("roll", "poses.a.attitude"), '`looks = "down"` in [mount]'])
    'turn `negate` of roll in [poses.a.attitude]; or write `looks = "down"` in [mount], and import again'
    """
    return (
        "; or ".join(way if way.startswith(VERBS) else f"write {way}" for way in ways) + ", and import again"
    )


def number(value: float) -> str:
    """A number with the digits that are worth reading."""
    if value != 0 and abs(value) < 0.095:
        return f"{value:.2g}"
    return f"{value:.0f}" if abs(value) >= 20 else f"{value:.1f}"


def joined(parts: list[str], last: str = "or") -> str:
    """``"a, b or c"``."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} {last} {parts[-1]}"


def part_of(table: str) -> str:
    """The part of the recipe that a table comes from: ``"nav/x"`` from ``"poses.x"``."""
    return f"poses.{table.removeprefix('nav/')}" if table.startswith("nav/") else table
