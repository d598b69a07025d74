"""What `wildlab plan` does: areas read, a plan made and judged, and files written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from wildlab.analysis.plans.coverage import Covered, cover
from wildlab.analysis.plans.plan import Plan, make_plan, on_earth, rings_on_earth
from wildlab.analysis.plans.request import PlanRequest
from wildlab.analysis.plans.result import plan_result
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_json
from wildlab.flight.writers import Mission, plan_geojson, plan_kml, qgc_plan, waypoints_text

#: Files besides those of each flight. All but the page and its numbers hold positions on the Earth.
MAPS = ("plan.geojson", "plan.kml")
RESULT, PAGE = "result.json", "report.html"


def missions(plan: Plan) -> list[Mission]:
    """The flights of a plan as missions of an autopilot.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plans.plan.make_plan`.

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


def plan_texts(plan: Plan) -> dict[str, str]:
    """What the files of a plan hold.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plans.plan.make_plan`.

    Returns
    -------
    dict
        By name; all of them hold positions on the Earth.

    Raises
    ------
    WildlabError
        Where a flight has more way points than autopilots take.
    """
    flights = missions(plan)
    outlines = [(area.name, rings_on_earth(area, plan.areas)) for area in plan.areas.areas]
    texts = {}
    for one in flights:
        name = one.name.replace(" ", "-")
        texts[f"{name}.waypoints"] = waypoints_text(one)
        texts[f"{name}.plan"] = _json(qgc_plan(one))
    texts[MAPS[0]] = _json(plan_geojson(outlines, flights))
    texts[MAPS[1]] = plan_kml("wildlab plan", outlines, flights)
    return texts


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


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
            "name a folder of its own with --out",
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


def plan_flight(
    wanted: PlanRequest, into: Path, console: Console, *, overwrite: bool = False
) -> tuple[Plan, list[Covered], dict[str, Any]]:
    """Plan, and write what a pilot takes along.

    Parameters
    ----------
    wanted
        What is asked for.
    into
        The folder; made where it is not there.
    console
        Where progress is shown.
    overwrite
        Whether an earlier plan there may be replaced.

    Returns
    -------
    plan, covered
        For its page.
    result
        For JSON, also in ``result.json``: numbers, facts, and ``places``, the files that hold positions.

    Raises
    ------
    WildlabError
        Where nothing can be flown as it is wanted, or the folder is not free.
    """
    refuse_folder(into, overwrite)
    with console.status("planning") as status:
        plan = make_plan(wanted)
        texts = plan_texts(plan)

        def tell(done: int, of: int) -> None:
            status.update(f"looking what will be seen: {done} of {of} areas")

        tell(0, len(plan.areas.areas))
        covered = cover(plan, tell)
        result = plan_result(plan, covered)
    into.mkdir(parents=True, exist_ok=True)
    clear_folder(into)
    for name, text in texts.items():
        write_atomic(into / name, text)
    result["places"] = list(texts)
    write_json(into / RESULT, result)
    return plan, covered, result
