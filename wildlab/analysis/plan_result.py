"""What `wildlab plan` leaves: a plan made and judged, its numbers and facts, and its files."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from wildlab.analysis import Fact, fact
from wildlab.analysis.plan import Plan, Sortie, make_plan
from wildlab.analysis.plan_coverage import EDGE, SHARP, Covered, cover, gimbal_rate
from wildlab.analysis.plan_request import FURTHEST, PlanRequest
from wildlab.errors import WildlabError
from wildlab.files import write_atomic, write_json
from wildlab.flight.files import printable
from wildlab.flight.readers.vector import Area, Areas
from wildlab.flight.writers import Mission, plan_geojson, plan_kml, qgc_plan, waypoints_text
from wildlab.geometry.frames import Array, ned_to_geodetic

#: Pixels along an animal below which F 3.2's chain and people alike miss many.
FEW_PIXELS = 5.0
#: Share of the ground seen below which that is said before all else, and below which hardly anything is.
LITTLE, HARDLY = 0.5, 0.1
#: Share of an area that may be missed before it is told of.
UNSEEN = 0.02


def plan_result(plan: Plan, covered: Sequence[Covered]) -> dict[str, Any]:
    """A plan as plain values for JSON; metres of n, and no position on the Earth.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.
    covered
        Of each area, from `wildlab.analysis.plan_coverage.cover`.

    Returns
    -------
    dict
        Numbers; ``assumed``, ``warnings`` and ``sentences`` are facts, `wildlab.reporting.plan` has their
        words.
    """
    wanted, view = plan.wanted, plan.view
    seconds = plan.area_seconds()
    living = [animals_in(plan, area) for area in plan.areas.areas]
    found = [n * one.seen * wanted.detection for n, one in zip(living, covered, strict=True)]
    return {
        "height_m": plan.height,
        "strip_m": round(plan.strip, 2),
        "animal_pixels": round(view.pixels(wanted.camera, wanted.animal_m, plan.height), 2),
        "duration_s": round(plan.duration, 1),
        "nearest_ground_m": round(plan.nearest, 1),
        "furthest_m": round(
            max(float(np.hypot(*(one.way.points - plan.home).T).max()) for one in plan.sorties), 1
        ),
        "seen": round(seen_share(plan, covered), 4),
        "animals": _number(sum(living)),
        "expected_finds": _number(sum(found)),
        "areas": [
            {
                "name": plan.names[k],
                "seen": round(covered[k].seen, 4),
                "hidden": round(covered[k].share(covered[k].hidden), 4),
                "blurred": round(covered[k].share(covered[k].blurred), 4),
                "animals": _number(living[k]),
                "expected_finds": _number(found[k]),
                "size_m2": round(area.size, 1),
                "rows": int((plan.pattern.area == k).sum()),
                "row_distance_m": round(float(plan.pattern.distance[k]), 2),
                "seconds": round(float(seconds[k]), 1),
            }
            for k, area in enumerate(plan.areas.areas)
        ],
        "sorties": [_sortie(plan, one) for one in plan.sorties],
        "assumed": assumed(plan),
        "warnings": [*warnings(plan), *unseen(plan, covered)],
        "sentences": summary(plan, seen_share(plan, covered), sum(living), sum(found)),
    }


def _sortie(plan: Plan, one: Sortie) -> dict[str, Any]:
    names = [plan.names[k] for k in dict.fromkeys(plan.pattern.area[one.rows].tolist())]
    battery = plan.wanted.battery_min
    return {
        "name": one.name,
        "areas": names,
        "rows": len(one.rows),
        "way_points": len(one.way.points),
        "length_m": round(one.course.length, 1),
        "duration_s": round(one.duration, 1),
        "of_battery": None if battery is None else round(one.duration / (60 * battery), 4),
        "least_above_ground_m": round(one.way.least, 2),
        "most_above_ground_m": round(one.way.most, 2),
        "steepest_m_s": round(one.steepest, 2),
    }


def summary(plan: Plan, seen: float, living: float, finds: float) -> list[Fact]:
    """What a pilot wants to know first."""
    wanted, n, rows, areas = plan.wanted, len(plan.sorties), len(plan.pattern.rows), plan.areas.areas
    where = plan.names[0] if len(areas) == 1 else f"{len(areas)} areas"
    least, most = f"{plan.pattern.distance.min():.0f}", f"{plan.pattern.distance.max():.0f}"
    apart = f" {least if least == most else f'{least} to {most}'} m apart" if rows > len(areas) else ""
    pixels = plan.view.pixels(wanted.camera, wanted.animal_m, plan.height)
    found = []
    if seen < LITTLE:
        found.append(fact("hardly-anything" if seen < HARDLY else "less-than-half", seen=percent(seen)))
    return [
        *found,
        fact(
            "one-flight" if n == 1 else "flights",
            where=where,
            size=hectares(sum(plan.alone.values())),
            n=n,
            time=minutes(plan.duration),
            rows=count(rows, "row"),
            apart=apart,
        ),
        fact(
            "strip",
            height=f"{plan.height:.0f}",
            strip=f"{plan.strip:.0f}",
            animal=wanted.animal_m,
            pixels=f"{pixels:.0f}",
        ),
        fact("seen", seen=percent(seen)),
        *([] if math.isnan(finds) else [fact("finds", living=head_count(living), finds=head_count(finds))]),
    ]


def seen_share(plan: Plan, covered: Sequence[Covered]) -> float:
    """Share of all areas together that is seen; what lies in several of them counts once."""
    sizes = list(plan.alone.values())
    return sum(size * one.seen for size, one in zip(sizes, covered, strict=True)) / sum(sizes)


def animals_in(plan: Plan, area: Area) -> float:
    """How many animals live in an area: what its file says, else what was asked for; NaN if nobody said."""
    wanted = plan.wanted
    if not math.isnan(area.animals):
        return area.animals
    if wanted.animals is not None:
        return wanted.animals
    return math.nan if wanted.density_km2 is None else wanted.density_km2 * plan.alone[area.name] / 1e6


def unseen(plan: Plan, covered: Sequence[Covered]) -> list[Fact]:
    """Where more than `UNSEEN` of an area is not seen, why, and what helps; a fact for each area."""
    wanted, found = plan.wanted, []
    # By itself a swing is as slow as it may be without leaving ground out.
    swing = "fixed" if wanted.gimbal == "fixed" else "own" if wanted.rate_deg_s is None else "stated"
    for k, one in enumerate(covered):
        missed, hidden, blurred = 1 - one.seen, one.share(one.hidden), one.share(one.blurred)
        if missed <= UNSEEN:
            continue
        causes = {
            "hidden": hidden,
            f"blurred-{swing}": blurred,
            "photos" if wanted.photo_m > 0 else "overlap": missed - hidden - blurred,
        }
        parts = {
            name: percent(share)
            for name, share in zip(("hidden", "blurred", "nowhere"), causes.values(), strict=True)
        }
        worst = max(causes, key=lambda name: causes[name])
        found.append(fact(f"unseen-{worst}", missed=percent(missed), area=plan.names[k], **parts))
    return found


def assumed(plan: Plan) -> list[Fact]:
    """What the plan rests on."""
    wanted, found = plan.wanted, list[Fact]()
    if plan.cut is not None and wanted.terrain is not None:
        name = printable(Path(wanted.terrain.file).name) if wanted.names else "the map that was given"
        step, rms = f"{plan.cut.terrain.step:.3g}", f"{plan.cut.rms:.2g}"
        found.append(fact("ground-map", name=name, step=step, rms=rms))
    elif plan.terrain is None:
        found.append(fact("ground-flat"))
    if wanted.home is None:
        found.append(fact("home"))
    found.append(fact("above-take-off" if wanted.heights == "take-off" else "above-ground"))
    if plan.terrain is not None:
        found += [
            fact("nearest-trees" if wanted.trees_m > 0 else "nearest", nearest=f"{plan.nearest:.0f}"),
            fact("take-off-height"),
        ]
    if plan.terrain is not None and not np.isfinite(plan.terrain.heights_at(plan.home[None])).all():
        found.append(fact("return-unknown"))
    else:
        highest = max(float((one.way.height - one.way.ground[0]).max()) for one in plan.sorties)
        found.append(fact("return", height=str(math.ceil(highest - 1e-6))))
    found.append(
        fact(
            f"speed-{wanted.vehicle}-{'wind' if wanted.wind_m_s > 0 else 'calm'}",
            speed=wanted.speed_m_s,
            slowest=wanted.slowest_m_s,
            fastest=wanted.fastest_m_s,
            air=wanted.air_m_s,
            wind=wanted.wind_m_s,
            **{"from": f"{wanted.wind_from_deg or 0.0:.0f}"},
        )
    )
    found.append(
        fact("turn-radius", radius=wanted.turn_radius_m)
        if wanted.turn_radius_m > 0
        else fact("turn-stop", time=wanted.turn_s)
    )
    found.append(fact("climb", speed=wanted.climb_m_s))
    if wanted.trees_m > 0:
        found.append(fact("trees", height=wanted.trees_m))
    found.append(fact("looks-down" if wanted.tilt_deg == 90 else "looks-ahead", tilt=wanted.tilt_deg))
    found.append(fact("photos", apart=wanted.photo_m) if wanted.photo_m > 0 else fact("films"))
    if wanted.gimbal != "fixed":
        rate = f"{math.degrees(gimbal_rate(plan)):.0f}"
        found.append(fact(f"swing-{wanted.gimbal}", swing=wanted.swing_deg, rate=rate))
    found.append(
        fact(
            "counts",
            edge=f"{100 * EDGE:.0f}",
            furthest=FURTHEST,
            exposure=wanted.exposure_ms,
            sharp=f"{100 * SHARP:.0f}",
            animal=wanted.animal_m,
        )
    )
    if not math.isnan(sum(animals_in(plan, area) for area in plan.areas.areas)):
        found.append(fact("detection", share=percent(wanted.detection)))
    if wanted.battery_min is None:
        found.append(fact("battery-unknown"))
    else:
        found.append(fact("battery", time=wanted.battery_min, reserve=f"{100 * wanted.reserve:.0f}"))
    found.append(fact("rules", height=wanted.max_height_m))
    return found


def warnings(plan: Plan) -> list[Fact]:
    """What speaks against flying it as it is."""
    wanted, found = plan.wanted, list[Fact]()
    steepest = max(one.steepest for one in plan.sorties)
    # A hundredth is rounding: what cannot slow down is planned to climb at all that it can do.
    if steepest > 1.01 * wanted.climb_m_s:
        found.append(
            fact(
                f"steep-{wanted.vehicle}",
                speed=wanted.speed_m_s,
                steepest=f"{steepest:.1f}",
                climb=wanted.climb_m_s,
            )
        )
    if wanted.vehicle == "multicopter" and wanted.wind_m_s > 0 and wanted.max_air_m_s is None:
        found.append(fact("airspeed", air=wanted.air_m_s, speed=wanted.speed_m_s))
    unknown = sum(one.way.unknown for one in plan.sorties)
    if unknown > 0:
        found.append(fact("unknown-ground", way=f"{unknown:.0f}"))
    pixels = plan.view.pixels(wanted.camera, wanted.animal_m, plan.height)
    if pixels < max(FEW_PIXELS, 0.99 * wanted.pixels):
        key = "few-pixels" if pixels < FEW_PIXELS else "fewer-pixels"
        found.append(fact(key, animal=wanted.animal_m, pixels=f"{pixels:.1f}", wanted=wanted.pixels))
    alone = sum(plan.alone.values())
    twice = sum(area.size for area in plan.areas.areas) - alone
    if twice > 1e-3 * alone:
        told = wanted.animals is not None or any(not math.isnan(one.animals) for one in plan.areas.areas)
        found.append(fact("overlap-animals" if told else "overlap", size=hectares(twice)))
    if any(len(area.holes) for area in plan.areas.areas):
        found.append(fact("holes"))
    return found


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 3)


def minutes(seconds: float) -> str:
    """ "12 min", "1 h 05 min": rounded up, as whoever waits counts."""
    whole = math.ceil(seconds / 60 - 1e-9)
    return f"{whole} min" if whole < 60 else f"{whole // 60} h {whole % 60:02d} min"


def percent(share: float) -> str:
    """A share as a person says it; nearly all is not all."""
    if 0 < share < 0.01 or 0.99 < share < 1:
        near = "< 0.1 %" if share < 0.5 else "> 99.9 %"
        return f"{100 * share:.1f} %" if 0.0005 < share < 0.9995 else near
    return f"{100 * share:.0f} %"


def head_count(value: float) -> str:
    """A number of animals that may be expected: three figures, and never half an animal of hundreds."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def hectares(size: float) -> str:
    """A size in m2 as a person says it."""
    if size < 1e4:
        return f"{size:,.0f} m²"
    return f"{size / 1e4:.1f} ha" if size < 1e6 else f"{size / 1e6:.1f} km²"


def count(n: int, word: str) -> str:
    """ "1 row", "2 rows"."""
    return f"{n} {word}{'' if n == 1 else 's'}"


def on_earth(points: Array, height: Array, areas: Areas) -> tuple[Array, Array, Array]:
    """Places of n as latitude and longitude in degrees, and heights above the ellipsoid.

    Parameters
    ----------
    points
        (N, 2) north and east, metres.
    height
        (N,) above the plane down = 0 of n, metres.
    areas
        With the origin.

    Returns
    -------
    Latitude, longitude (degrees), height (metres): (N,) each.
    """
    p = np.column_stack([points, -np.asarray(height)])
    lat, lon, h = np.moveaxis(ned_to_geodetic(p, areas.origin), -1, 0)
    return np.degrees(lat), np.degrees(lon), h


def rings_on_earth(area: Area, areas: Areas) -> list[Array]:
    """Outline and holes of an area, (K, 2) latitude and longitude in degrees each."""
    return [
        np.stack(on_earth(ring, np.zeros(len(ring)), areas)[:2], axis=1)
        for ring in (area.outline, *area.holes)
    ]


#: Files besides those of each flight. All but the page and its numbers hold positions on the Earth.
MAPS = ("plan.geojson", "plan.kml")
RESULT, PAGE = "result.json", "report.html"


def missions(plan: Plan) -> list[Mission]:
    """The flights of a plan as missions of an autopilot.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.

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
        From `wildlab.analysis.plan.make_plan`.

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
