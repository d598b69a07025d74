"""What terrain a flight has, and whether it lies over it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wildlab.flight.checks.findings import POSITION, Finding
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
    ground, record = flight.terrain, flight.manifest.terrain
    if ground is None:
        return "there is no terrain: the ground is level at the height of each target"
    north, far_north, east, far_east = ground.extent
    known = np.isfinite(ground.height)
    said = (
        f"{_length(far_north - north)} north by {_length(far_east - east)} east at {ground.step:.3g} m, "
        f"relief {np.ptp(ground.height[known]):.0f} m, {100 * (1 - known.mean()):.3g} % holes"
    )
    if record is not None:
        counted = {"ellipsoid": "the ellipsoid", "flight": "what the flight's own do", "geoid": "the geoid"}
        said += (
            f"; its heights counted from {counted[record.heights]} ({record.added_m:+.2f} m), resampled "
            f"within {record.error_rms_m:.2g} m (RMS; at most {record.error_max_m:.2g} m)"
        )
    return said


def terrain_findings(flight: Flight) -> Iterator[Finding]:
    """What terrain there is; poses that are not over it, or below it."""
    ground = flight.terrain
    if ground is None:
        return
    yield Finding(
        "note",
        "terrain.tif",
        "",
        terrain_sentence(flight),
        "its standard deviation is not stated: plane_height_m of [uncertainty] is assumed"
        if np.isnan(ground.sd)
        else f"its standard deviation is taken for {ground.sd:.2g} m",
    )
    yield from _known_points(flight, ground)
    for name, nav in flight.nav.items():
        p = nav[list(POSITION)].to_numpy(float)
        p = p[np.isfinite(p).all(axis=1)]
        above = -p[:, 2] - ground.heights_at(p[:, :2])
        over = np.isfinite(above)
        if not len(p):
            continue
        if not over.all():
            north, far_north, east, far_east = ground.extent
            beyond = (p[:, 0] < north) | (p[:, 0] > far_north) | (p[:, 1] < east) | (p[:, 1] > far_east)
            for which, where, help_ in (
                (~over & beyond, "beyond the border of the terrain", "give a map that reaches further"),
                (~over & ~beyond, "over a hole of the terrain", "fill it, or give another map"),
            ):
                if which.any():
                    said = f"{100 * which.mean():.3g} % of the poses are {where}"
                    yield Finding("warning", f"nav/{name}", "", said, help_)
        below = above[over] < -DEEP
        if below.mean() > FEW:
            yield Finding(
                "problem" if below.all() else "warning",
                f"nav/{name}",
                "down_m",
                f"{100 * below.mean():.3g} % of the poses are more than {DEEP:g} m below the ground, "
                f"{-above[over].min():.0f} m at most",
                "check what the map's heights and the flight's count from, and their units",
            )
        elif over.any():
            yield Finding(
                "note",
                f"nav/{name}",
                "down_m",
                f"it flies {np.median(above[over]):.0f} m above the ground of the terrain, "
                f"{above[over].min():.0f} to {above[over].max():.0f} m",
                "compare that with what was flown",
            )


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
    where = "above" if middle >= 0 else "below"
    if abs(middle) > max(OFF, SPREAD * spread):
        yield Finding(
            "warning",
            "terrain.tif",
            "",
            f"{len(above)} known points lie {abs(middle):.1f} m {where} its ground in the median, give or "
            f"take {spread:.1f} m: another vertical reference, or things that stand above the ground",
            "check what the map's heights count from",
        )
    else:
        yield Finding(
            "note",
            "terrain.tif",
            "",
            f"{len(above)} known points lie {abs(middle):.1f} m {where} its ground in the median, give or "
            f"take {spread:.1f} m",
            "that is how far map and survey agree",
        )


def _length(metres: float) -> str:
    return f"{metres / 1000:.1f} km" if metres >= 1000 else f"{metres:.0f} m"
