"""Constant offsets of sightings, found on the sightings themselves: height, clock, hours of a zone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from wildlab.flight.checks.sense.sightings import Sightings, glance
from wildlab.flight.checks.sense.trial import Mistake
from wildlab.geometry.frames import Array

#: Heights are looked for this far (m) and clocks this far (s); finer steps near zero.
HEIGHTS = np.sinh(np.linspace(-7.5, 7.5, 41)) * 2.0
CLOCKS = np.sinh(np.linspace(-5.0, 5.0, 41)) * 0.8
HOURS = tuple(h for h in np.arange(-14.0, 14.25, 0.25) if h)
LEAP_S = (18.0, -18.0, 19.0, -19.0, 37.0, -37.0)
GOLDEN = (np.sqrt(5) - 1) / 2


def best_of(cost: Callable[[float], float], grid: Array, rounds: int = 12) -> float:
    """Where a cost is least: the best of a grid, refined between its neighbours."""
    costs = np.array([cost(float(x)) for x in grid])
    if not np.isfinite(costs).any():
        return 0.0
    k = int(np.nanargmin(np.where(np.isfinite(costs), costs, np.inf)))
    low, high = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, len(grid) - 1)])
    for _ in range(rounds):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (low, b) if cost(a) < cost(b) else (a, high)
    return (low + high) / 2


def cost_of(s: Sightings) -> float:
    """How badly sightings fit: with small errors allowed for a constant is hardly seen, and without it takes
    their part, so both count."""
    return float(np.sqrt(np.prod(glance(s))))


def raised(s: Sightings, by: float) -> Sightings:
    """Poses that are higher by so many metres."""
    return replace(s, p_nb=s.p_nb - np.array([0.0, 0.0, by]))


def shifted(s: Sightings, by: float) -> Sightings:
    """The same sightings, had the camera's clock been so many seconds later."""
    return replace(s, **s.looked(by)._asdict())


def height_mistakes(s: Sightings) -> Iterator[Mistake[Sightings]]:
    """A constant by which the poses are too high or too low."""
    by = best_of(lambda h: cost_of(raised(s, h)), HEIGHTS)
    if abs(by) < 3.0:
        return
    part = f"poses.{s.source}"
    yield Mistake(
        "constant height",
        f"the heights of nav/{s.source} are {abs(by):.0f} m too {'low' if by > 0 else 'high'} against "
        "those of "
        "the known points (another vertical reference, as the geoid or the place of the start?)",
        f'`correction_m = {-by:.1f}` more in [vertical] with `taken_off = ["poses"]`, or the right column in '
        f"[{part}.position]",
        lambda x: raised(x, by),
        fitted=True,
    )


def clock_mistakes(s: Sightings, offset_s: float) -> Iterator[Mistake[Sightings]]:
    """A constant by which the camera's clock is late or early; `offset_s` is what the manifest has."""
    by = best_of(lambda t: cost_of(shifted(s, t)), CLOCKS)
    if abs(by) > 0.05:
        yield Mistake(
            "clock of the camera",
            f"the images were taken {abs(by):.2f} s {'later' if by > 0 else 'earlier'} than their stamps say",
            f"`camera_offset_s = {offset_s + by:.2f}` in [clocks]",
            lambda x: shifted(x, by),
            fitted=True,
        )
    for seconds in LEAP_S:
        yield Mistake(
            f"leap seconds ({seconds:g} s)",
            f"the images were taken {abs(seconds):g} s {'later' if seconds > 0 else 'earlier'} than their "
            "stamps say, as between GPS time and UTC",
            f"`camera_offset_s = {offset_s + seconds:g}` in [clocks]",
            lambda x, t=seconds: shifted(x, t),  # type: ignore[misc]
        )
    for hours in HOURS:
        yield Mistake(
            f"zone ({hours:+g} h)",
            f"the stamps of the images are {abs(hours):g} h {'early' if hours > 0 else 'late'}",
            f"the `zone` of the stamps in [frames.time] or [time]: they are {abs(hours):g} h off",
            lambda x, t=3600.0 * hours: shifted(x, t),  # type: ignore[misc]
        )
