"""What terrain a flight has, and whether it lies over it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from wildlab.flight.checks.findings import POSITION, Finding, Level, messages, phrase
from wildlab.flight.store import Flight
from wildlab.geometry.terrain import Terrain

#: Poses that far below the ground are said, metres: a terrain's cell rounds the place it takes off from.
DEEP = 5.0
#: Fewer of them are what the noise of low flights does, as a share.
FEW = 0.01
#: Known points off the ground by more than that, metres, and by so many times their spread, are said.
OFF, SPREAD = 3.0, 2.0


def terrain_sentence(flight: Flight) -> str:
    """What terrain a flight has, as a clause; no coordinates."""
    texts = messages("checks")
    ground, record = flight.terrain, flight.manifest.terrain
    if ground is None:
        return str(texts["no-terrain"]["said"])
    north, far_north, east, far_east = ground.extent
    known = np.isfinite(ground.height)
    facts: dict[str, Any] = {
        "north": _length(far_north - north),
        "east": _length(far_east - east),
        "step": ground.step,
        "relief": np.ptp(ground.height[known]),
        "holes": 100 * (1 - known.mean()),
        "record": record,
    }
    if record is not None:
        facts["counted"] = texts["terrain-recorded"][record.heights]
    return phrase(texts["terrain" if record is None else "terrain-recorded"]["said"], facts)


def terrain_findings(flight: Flight) -> Iterator[Finding]:
    """What terrain there is; poses that are not over it, or below it."""
    ground = flight.terrain
    if ground is None:
        return
    facts: dict[str, Any] = {
        "terrain": terrain_sentence(flight),
        "sd": ground.sd,
        "unknown": bool(np.isnan(ground.sd)),
    }
    yield Finding("note", "terrain.tif", "", "terrain-there", facts)
    yield from _known_points(flight, ground)
    for name, nav in flight.nav.items():
        p = nav[list(POSITION)].to_numpy(float)
        p = p[np.isfinite(p).all(axis=1)]
        if not len(p):
            continue
        above = -p[:, 2] - ground.heights_at(p[:, :2])
        over = np.isfinite(above)
        north, far_north, east, far_east = ground.extent
        beyond = (p[:, 0] < north) | (p[:, 0] > far_north) | (p[:, 1] < east) | (p[:, 1] > far_east)
        for which, code in ((~over & beyond, "beyond-terrain"), (~over & ~beyond, "over-hole")):
            if which.any():
                yield Finding("warning", f"nav/{name}", "", code, {"percent": 100 * which.mean()})
        above = above[over]
        below = above < -DEEP
        if below.mean() > FEW:
            level: Level = "problem" if below.all() else "warning"
            facts = {"percent": 100 * below.mean(), "deep": DEEP, "most": -above.min()}
            yield Finding(level, f"nav/{name}", "down_m", "below-ground", facts)
        elif over.any():
            facts = {"median": np.median(above), "low": above.min(), "high": above.max()}
            yield Finding("note", f"nav/{name}", "down_m", "above-ground", facts)


def _known_points(flight: Flight, ground: Terrain) -> Iterator[Finding]:
    """Whether points of the truth that never move lie on the ground."""
    truth = flight.truth
    if truth is None:
        return
    still = truth[truth["time_s"].isna()].drop_duplicates("target_id")[list(POSITION)].to_numpy(float)
    above = -still[:, 2] - ground.heights_at(still[:, :2])
    above = above[np.isfinite(above)]
    if len(above) < 3:
        return
    middle = float(np.median(above))
    spread = 1.4826 * float(np.median(np.abs(above - middle)))
    off = abs(middle) > max(OFF, SPREAD * spread)
    facts = {"n": len(above), "above": middle, "spread": spread}
    code = "points-off-ground" if off else "points-on-ground"
    yield Finding("warning" if off else "note", "terrain.tif", "", code, facts)


def _length(metres: float) -> str:
    return f"{metres / 1000:.1f} km" if metres >= 1000 else f"{metres:.0f} m"
