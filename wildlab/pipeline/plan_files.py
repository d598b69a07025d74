"""What a plan leaves for the pilot: way points of each flight, and a map of all."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_json
from wildlab.flight.writers.maps import plan_geojson, plan_kml
from wildlab.flight.writers.mission import Mission
from wildlab.flight.writers.qgc_plan import qgc_plan
from wildlab.flight.writers.waypoints import waypoints_text
from wildlab.pipeline.plan import Plan, on_earth, rings_on_earth

#: Files besides those of each flight. All but the page and its numbers hold positions on the Earth.
MAPS = ("plan.geojson", "plan.kml")
RESULT, PAGE = "result.json", "report.html"


def missions(plan: Plan) -> list[Mission]:
    """The flights of a plan as missions of an autopilot.

    Parameters
    ----------
    plan
        From `wildlab.pipeline.plan.make_plan`.

    Returns
    -------
    list of Mission
        Heights above the take-off point are differences of heights above the ellipsoid; over flat ground, of
        which nobody said where it lies, the height above ground itself.
    """
    wanted = plan.wanted
    found = []
    at_home = plan.home[None]
    flat = plan.terrain is None
    for one in plan.sorties:
        way = one.way
        # Up is not quite along -down of n away from its origin, so flat ground is taken at its own height.
        lat, lon, high = on_earth(way.points, way.ground if flat else way.height, plan.areas)
        (home_lat,), (home_lon,), (home_high,) = on_earth(at_home, way.ground[:1], plan.areas)
        above_ground = way.height - way.ground
        found.append(
            Mission(
                one.name,
                lat,
                lon,
                above_ground if flat else high - home_high,
                above_ground,
                (float(home_lat), float(home_lon), 0.0 if flat else float(home_high)),
                wanted.speed_m_s,
                wanted.heights,
                wanted.vehicle,
                wanted.photo_m,
            )
        )
    return found


def write_plan(plan: Plan, into: Path) -> list[str]:
    """Write the way points of each flight and the maps.

    Parameters
    ----------
    plan
        From `wildlab.pipeline.plan.make_plan`.
    into
        A folder that is there.

    Returns
    -------
    list of str
        Names of the files; all of them hold positions on the Earth.

    Raises
    ------
    WildlabError
        Where a flight has more way points than autopilots take.
    """
    flights = missions(plan)
    texts = {one.name.replace(" ", "-"): (waypoints_text(one), qgc_plan(one)) for one in flights}
    outlines = [(area.name, rings_on_earth(area, plan.areas)) for area in plan.areas.areas]
    written = []
    for name, (text, content) in texts.items():
        write_atomic(into / f"{name}.waypoints", text)
        write_json(into / f"{name}.plan", content)
        written += [f"{name}.waypoints", f"{name}.plan"]
    write_json(into / MAPS[0], plan_geojson(outlines, flights))
    write_atomic(into / MAPS[1], plan_kml("wildlab plan", outlines, flights))
    return [*written, *MAPS]


def refuse_folder(into: Path, overwrite: bool) -> None:
    """Neither over another plan unasked, nor into a folder of something else.

    Raises
    ------
    WildlabError
        Where the folder holds anything, and it is not a plan that may be replaced.
    """
    if not into.exists():
        return
    held = sorted(one.name for one in into.iterdir()) if into.is_dir() else []
    if not held:
        return
    if RESULT not in held or not any(one.endswith(".waypoints") for one in held):
        raise WildlabError(
            f"the folder holds other things ({', '.join(held[:3])}{', ...' if len(held) > 3 else ''})",
            "name a folder of its own with --into",
            file=into,
        )
    if not overwrite:
        raise WildlabError("there is a plan already", "name another folder, or add --overwrite", file=into)


def clear_folder(into: Path) -> None:
    """Take an earlier plan away: its flights would be taken for flights of the new one."""
    for one in into.iterdir():
        flight = one.name.startswith("sortie-") and one.suffix in (".waypoints", ".plan")
        if flight or one.name in (*MAPS, RESULT, PAGE):
            one.unlink()


def origin_text(plan: Plan) -> str:
    """Where n begins, for a page that may tell it."""
    lat, lon = np.degrees(plan.areas.origin[:2])
    return f"{lat:.6f}, {lon:.6f}"
