"""A plan in words and plain numbers: what it takes, what was assumed, what speaks against it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wildlab.pipeline.plan import Plan
from wildlab.pipeline.plan_sorties import Sortie

#: Pixels along an animal below which F 3.2's chain and people alike miss many.
FEW_PIXELS = 5.0


def plan_result(plan: Plan) -> dict[str, Any]:
    """A plan as plain values for JSON; metres of n, and no position on the Earth.

    Parameters
    ----------
    plan
        From `wildlab.pipeline.plan.make_plan`.

    Returns
    -------
    dict
        Numbers; ``assumed``, ``warnings`` and ``sentences`` for people.
    """
    wanted, view = plan.wanted, plan.view
    seconds = plan.area_seconds()
    return {
        "height_m": plan.height,
        "strip_m": round(plan.strip, 2),
        "animal_pixels": round(view.pixels(wanted.camera, wanted.animal_m, plan.height), 2),
        "duration_s": round(plan.duration, 1),
        "furthest_m": round(_furthest(plan), 1),
        "areas": [
            {
                "name": area.name,
                "size_m2": round(area.size, 1),
                "rows": int((plan.pattern.area == k).sum()),
                "row_distance_m": round(float(plan.pattern.distance[k]), 2),
                "seconds": round(float(seconds[k]), 1),
            }
            for k, area in enumerate(plan.areas.areas)
        ],
        "sorties": [_sortie(plan, one) for one in plan.sorties],
        "assumed": assumed(plan),
        "warnings": warnings(plan),
        "sentences": summary(plan),
    }


def _sortie(plan: Plan, one: Sortie) -> dict[str, Any]:
    names = [plan.areas.areas[k].name for k in dict.fromkeys(plan.pattern.area[one.rows].tolist())]
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


def summary(plan: Plan) -> list[str]:
    """What a pilot wants to know first."""
    n, rows = len(plan.sorties), len(plan.pattern.rows)
    areas = plan.areas.areas
    size = sum(area.size for area in areas)
    where = areas[0].name if len(areas) == 1 else f"{len(areas)} areas"
    flights = "one flight" if n == 1 else f"{n} flights"
    pixels = plan.view.pixels(plan.wanted.camera, plan.wanted.animal_m, plan.height)
    least, most = f"{plan.pattern.distance.min():.0f}", f"{plan.pattern.distance.max():.0f}"
    apart = least if least == most else f"{least} to {most}"
    return [
        f"{where}, {hectares(size)}: {flights} of {minutes(plan.duration)} in all, over {count(rows, 'row')} "
        f"{apart} m apart.",
        f"The camera is {plan.height:.0f} m above the ground and sees a strip of {plan.strip:.0f} m; "
        f"{plan.wanted.animal_m:g} m on the ground are {pixels:.0f} pixels.",
    ]


def assumed(plan: Plan) -> list[str]:
    """What the plan rests on, each a sentence."""
    wanted = plan.wanted
    said = []
    if plan.terrain is None:
        said.append("The ground is flat and as high as the take-off point: no map of heights was given.")
    if wanted.home is None:
        said.append("Take-off is where the first row begins: no other place was given (--home).")
    if wanted.heights == "take-off":
        said.append(
            "Heights in the files are above the take-off point. Taken off from elsewhere, every height is "
            "wrong by the difference in ground height."
        )
    else:
        said.append(
            "Heights in the files are above the autopilot's own map of the ground, which has to have one."
        )
    air = f"{wanted.speed_m_s:g} m/s through the air"
    if wanted.wind_m_s > 0:
        said.append(f"The aircraft flies {air}, in a steady wind of {wanted.wind_m_s:g} m/s from "
                    f"{wanted.wind_from_deg:.0f} degrees.")  # fmt: skip
    else:
        said.append(f"The aircraft flies {air}, and there is no wind.")
    if wanted.turn_radius_m > 0:
        said.append(f"It turns no tighter than {wanted.turn_radius_m:g} m.")
    else:
        said.append(f"It stops at the end of each row, and turns in {wanted.turn_s:g} s.")
    said.append(f"It climbs and sinks at {wanted.climb_m_s:g} m/s at most.")
    looks = (
        "straight down" if wanted.tilt_deg == 90 else f"ahead, {wanted.tilt_deg:g} degrees below the horizon"
    )
    said.append(f"The camera looks {looks}, level however the aircraft leans, its picture's top in flight.")
    if wanted.battery_min is None:
        said.append("How long a battery lasts was not said (--battery), so nothing is held against it.")
    else:
        said.append(
            f"A battery lasts {wanted.battery_min:g} minutes, and {100 * wanted.reserve:.0f} % of it are "
            "left at landing."
        )
    said.append(f"The rules allow {wanted.max_height_m:g} m above the ground (--max-height).")
    return said


def warnings(plan: Plan) -> list[str]:
    """What speaks against flying it as it is, each a sentence."""
    wanted, found = plan.wanted, []
    most = max(one.way.most for one in plan.sorties)
    if most > wanted.max_height_m + 0.05:
        found.append(
            f"Somewhere the way is {most:.0f} m above the ground, and {wanted.max_height_m:g} m are allowed: "
            "plan lower."
        )
    steepest = max(one.steepest for one in plan.sorties)
    if steepest > wanted.climb_m_s:
        found.append(
            f"The ground rises or falls so that at {wanted.speed_m_s:g} m/s the aircraft would have to climb "
            f"or sink at {steepest:.1f} m/s, and it can do {wanted.climb_m_s:g}: it has to slow down there, "
            "which the times allow for."
        )
    unknown = sum(one.way.unknown for one in plan.sorties)
    if unknown > 0:
        found.append(
            f"Below {unknown:.0f} m of the way the map of heights knows nothing; the ground there is taken "
            "to be as at the nearest place that is known."
        )
    pixels = plan.view.pixels(wanted.camera, wanted.animal_m, plan.height)
    if pixels < FEW_PIXELS:
        found.append(
            f"{wanted.animal_m:g} m on the ground are {pixels:.1f} pixels only: fly lower, or do not expect "
            "to see it."
        )
    if any(len(area.holes) for area in plan.areas.areas):
        found.append("Holes in areas are flown over, and not counted as searched.")
    return found


def _furthest(plan: Plan) -> float:
    return max(float(np.hypot(*(one.way.points - plan.home).T).max()) for one in plan.sorties)


def minutes(seconds: float) -> str:
    """ "12 min", "1 h 05 min": rounded up, as whoever waits counts."""
    whole = math.ceil(seconds / 60 - 1e-9)
    return f"{whole} min" if whole < 60 else f"{whole // 60} h {whole % 60:02d} min"


def hectares(size: float) -> str:
    """A size in m2 as a person says it."""
    if size < 1e4:
        return f"{size:,.0f} m²"
    return f"{size / 1e4:.1f} ha" if size < 1e6 else f"{size / 1e6:.1f} km²"


def count(n: int, word: str) -> str:
    """ "1 row", "2 rows"."""
    return f"{n} {word}{'' if n == 1 else 's'}"
