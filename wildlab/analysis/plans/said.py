"""What is said of a plan: numbers, warnings, and what would be better."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wildlab.analysis.plans.coverage import EDGE, SHARP, Covered, gimbal_rate, images_of
from wildlab.analysis.plans.plan import Plan
from wildlab.analysis.plans.request import FURTHEST
from wildlab.analysis.plans.sorties import Sortie, fly_rows
from wildlab.flight.files import printable
from wildlab.flight.readers.vector import Area

#: Share of ground in blurred images alone from which a speed is looked for, and of images to be sharp there.
MUCH, NEARLY_ALL = 0.5, 0.95
#: Metres per second between speeds that are tried, and rows that are flown for that at most.
STEP, ROWS = 0.5, 4


def swing_advice(plan: Plan, covered: Sequence[Covered]) -> list[str]:
    """Where a swing at its own rate blurs most of the ground, what would help, as a sentence.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plans.plan.make_plan`.
    covered
        Of each area, from `wildlab.analysis.plans.coverage.cover`.

    Returns
    -------
    list of str
        Empty where the camera does not swing, its rate was stated, or less than half is blurred.
    """
    wanted = plan.wanted
    if wanted.gimbal == "fixed" or wanted.rate_deg_s is not None:
        return []
    sizes = np.array([area.size for area in plan.areas.areas])
    blurred = float(sizes @ [one.share(one.blurred) for one in covered] / sizes.sum())
    if blurred < MUCH:
        return []
    speed = sharp_speed(plan)
    begins = f"At {wanted.speed_m_s:g} m/s the camera has to swing so fast that most images are blurred"
    if speed is None:
        return [f"{begins}, and slower flights blur them, too: take a smaller swing, or a shorter exposure."]
    return [f"{begins}: at {speed:g} m/s nearly all of them would be sharp (--speed {speed:g})."]


def sharp_speed(plan: Plan) -> float | None:
    """The greatest speed, in steps of `STEP`, at which nearly all images of the first rows are sharp.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plans.plan.make_plan`.

    Returns
    -------
    float or None
        Metres per second, below that of the plan; None where there is none.
    """
    rows = plan.sorties[0].rows[:ROWS]

    def sharp(speed: float) -> bool:
        slower = replace(plan, wanted=replace(plan.wanted, speed_m_s=speed))
        flown = fly_rows(
            "slower", list(rows), plan.pattern, plan.home, slower.wanted, plan.terrain, plan.height
        )
        return bool(images_of(slower, flown).sharp.mean() >= NEARLY_ALL)

    # Slower flights swing slower: the first speed that is too fast is found by halving.
    # A wing has to be faster than the wind.
    least = int(plan.wanted.wind_m_s / STEP) if plan.wanted.vehicle == "fixed-wing" else 0
    low, high = least, int(np.ceil(plan.wanted.speed_m_s / STEP)) - 1
    while high > low:
        middle = (low + high + 1) // 2
        if sharp(middle * STEP):
            low = middle
        else:
            high = middle - 1
    return low * STEP if low > least else None


#: Pixels along an animal below which F 3.2's chain and people alike miss many.
FEW_PIXELS = 5.0
#: Share of the ground seen below which that is said before all else.
LITTLE = 0.5
#: Share of an area that may be missed before it is told of.
UNSEEN = 0.02


def plan_result(plan: Plan, covered: Sequence[Covered]) -> dict[str, Any]:
    """A plan as plain values for JSON; metres of n, and no position on the Earth.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plans.plan.make_plan`.
    covered
        Of each area, from `wildlab.analysis.plans.coverage.cover`.

    Returns
    -------
    dict
        Numbers; ``assumed``, ``warnings`` and ``sentences`` for people.
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
        "furthest_m": round(_furthest(plan), 1),
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
        "warnings": [*warnings(plan), *unseen(plan, covered), *swing_advice(plan, covered)],
        "sentences": summary(plan, covered, sum(found)),
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


def summary(plan: Plan, covered: Sequence[Covered], finds: float) -> list[str]:
    """What a pilot wants to know first."""
    n, rows = len(plan.sorties), len(plan.pattern.rows)
    areas = plan.areas.areas
    size = sum(plan.alone.values())
    where = plan.names[0] if len(areas) == 1 else f"{len(areas)} areas"
    flights = (
        f"one flight of {minutes(plan.duration)}"
        if n == 1
        else f"{n} flights of {minutes(plan.duration)} in all"
    )
    pixels = plan.view.pixels(plan.wanted.camera, plan.wanted.animal_m, plan.height)
    least, most = f"{plan.pattern.distance.min():.0f}", f"{plan.pattern.distance.max():.0f}"
    apart = f" {least if least == most else f'{least} to {most}'} m apart" if rows > len(areas) else ""
    seen = seen_share(plan, covered)
    little = []
    if seen < LITTLE:
        what = "Hardly anything" if seen < LITTLE / 5 else "Less than half"
        little = [f"{what} will be seen as it is planned: {percent(seen)} of the ground."]
    return [
        *little,
        f"{where}, {hectares(size)}: {flights}, over {count(rows, 'row')}{apart}.",
        f"The camera is {plan.height:.0f} m above the ground and sees a strip of {plan.strip:.0f} m; "
        f"{plan.wanted.animal_m:g} m on the ground are {pixels:.0f} pixels.",
        f"Of the ground {percent(seen)} will be seen.{_finds(plan, finds)}",
    ]


def _finds(plan: Plan, finds: float) -> str:
    if math.isnan(finds):
        return ""
    living = sum(animals_in(plan, area) for area in plan.areas.areas)
    return f" Of {head_count(living)} animals {head_count(finds)} should be found, if they keep still."


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


def unseen(plan: Plan, covered: Sequence[Covered]) -> list[str]:
    """Where more than `UNSEEN` of an area is not seen, why, and what helps; a sentence for each area."""
    said = []
    # By itself a swing is as slow as it may be without leaving ground out.
    slower = plan.wanted.gimbal != "fixed" and plan.wanted.rate_deg_s is not None
    sharper = (
        "a slower flight or swing, or a shorter exposure"
        if slower
        else "a slower flight or a shorter exposure"
        if plan.wanted.gimbal == "fixed"
        else "a slower flight, a smaller swing, or a shorter exposure"
    )
    more = (
        "photos nearer to one another (--photo-every), or a larger overlap"
        if plan.wanted.photo_m > 0
        else "a larger overlap, or a lower speed"
    )
    for k, one in enumerate(covered):
        missed = 1 - one.seen
        if missed <= UNSEEN:
            continue
        hidden, blurred = one.share(one.hidden), one.share(one.blurred)
        causes = {
            "hidden by the ground": (hidden, "rows in another direction, or a camera that looks more down"),
            "in blurred images alone": (blurred, sharper),
            "in no image": (missed - hidden - blurred, more),
        }
        parts = [f"{percent(share)} {what}" for what, (share, _) in causes.items() if share > 1e-9]
        helps = max(causes.values())[1]
        said.append(
            f"{percent(missed)} of {plan.names[k]} will not be seen: {', '.join(parts)}. What helps: {helps}."
        )
    return said


def assumed(plan: Plan) -> list[str]:
    """What the plan rests on, each a sentence."""
    wanted = plan.wanted
    said = []
    if plan.cut is not None and plan.wanted.terrain is not None:
        name = printable(Path(plan.wanted.terrain.file).name) if wanted.names else "the map that was given"
        said.append(
            f"The ground is that of {name}, every "
            f"{plan.cut.terrain.step:.3g} m, {plan.cut.rms:.2g} m (rms) from the map's own heights. Trees, "
            "masts and lines are not in it, unless it is a map of surfaces."
        )
    elif plan.terrain is None:
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
    if plan.terrain is not None:
        trees = " or a treetop" if wanted.trees_m > 0 else ""
        said.append(f"The way comes no nearer than {plan.nearest:.0f} m to the ground{trees}, on any side.")
        said.append(
            "The height of the take-off point in the files is the map's own number, whatever the map counts "
            "heights from. The way does not rest on it: an autopilot measures where it takes off."
        )
    said.append(_return_height(plan))
    said.append(_speed(plan))
    if wanted.turn_radius_m > 0:
        said.append(
            f"It turns no tighter than {wanted.turn_radius_m:g} m. Its files end with a return, after which "
            "it circles over home: the landing is the pilot's."
        )
    else:
        said.append(f"It stops at the end of each row, and turns in {wanted.turn_s:g} s.")
    said.append(f"It climbs and sinks at {wanted.climb_m_s:g} m/s at most.")
    if wanted.trees_m > 0:
        said.append(f"Trees are {wanted.trees_m:g} m at most; what they hide counts as seen.")
    looks = (
        "straight down" if wanted.tilt_deg == 90 else f"ahead, {wanted.tilt_deg:g} degrees below the horizon"
    )
    said.append(f"The camera looks {looks}, level however the aircraft leans, its picture's top in flight.")
    said.append(
        f"Photos are taken {wanted.photo_m:g} m apart."
        if wanted.photo_m > 0
        else "The camera films, or takes photos so quickly that they overlap."
    )
    if wanted.gimbal != "fixed":
        keeping = ", turning back where it would look beyond the areas" if wanted.gimbal == "adaptive" else ""
        about = "yaw" if wanted.gimbal == "yaw" else "roll"
        said.append(
            f"It swings {wanted.swing_deg:g} degrees to either side about {about}, at "
            f"{math.degrees(gimbal_rate(plan)):.0f} degrees a second{keeping}."
        )
    said.append(
        f"Ground counts as seen where an image of the rows shows it, not nearer to its edge than "
        f"{100 * EDGE:.0f} % of its shorter side, no further than {FURTHEST:g} heights away, with nothing "
        f"before it, and blurred in {1000 * wanted.exposure_s:g} ms by {100 * SHARP:.0f} % of "
        f"{wanted.animal_m:g} m at most."
    )
    if not math.isnan(sum(animals_in(plan, area) for area in plan.areas.areas)):
        said.append(
            f"Of animals on ground that is seen, {percent(wanted.detection)} are found (--detection); they "
            "are spread evenly, and keep still."
        )
    if wanted.battery_min is None:
        said.append("How long a battery lasts was not said (--battery), so nothing is held against it.")
    else:
        said.append(
            f"A battery lasts {wanted.battery_min:g} minutes, and {100 * wanted.reserve:.0f} % of it are "
            "left at landing."
        )
    said.append(f"The rules allow {wanted.max_height_m:g} m above the ground (--max-height).")
    return said


def _speed(plan: Plan) -> str:
    """Which speed the files command, and so what the times are of."""
    wanted = plan.wanted
    wind = (
        f"a steady wind of {wanted.wind_m_s:g} m/s from {wanted.wind_from_deg:.0f} degrees"
        if wanted.wind_m_s > 0
        else "no wind"
    )
    if wanted.vehicle == "fixed-wing":
        return (
            f"The autopilot holds {wanted.speed_m_s:g} m/s through the air; times are with {wind}, "
            f"{wanted.slowest_m_s:g} to {wanted.fastest_m_s:g} m/s over the ground."
        )
    return (
        f"The autopilot holds {wanted.speed_m_s:g} m/s over the ground, and times are of that; with {wind} "
        f"these are up to {wanted.air_m_s:g} m/s through the air."
    )


def _return_height(plan: Plan) -> str:
    """What a return home that the autopilot begins itself needs."""
    begins = "A return home that the autopilot begins itself (lost link, low battery)"
    if plan.terrain is not None and not np.isfinite(plan.terrain.heights_at(plan.home[None])).all():
        return (
            f"{begins} is above the take-off point, whose height the map does not know: look it up yourself."
        )
    highest = max(float((one.way.height - one.way.ground[0]).max()) for one in plan.sorties)
    return (
        f"{begins} is at its own height: set that to {math.ceil(highest - 1e-6)} m above the take-off point "
        "or more."
    )


def warnings(plan: Plan) -> list[str]:
    """What speaks against flying it as it is, each a sentence."""
    wanted, found = plan.wanted, []
    steepest = max(one.steepest for one in plan.sorties)
    # A hundredth is rounding: what cannot slow down is planned to climb at all that it can do.
    if steepest > 1.01 * wanted.climb_m_s:
        so = (
            "it cannot slow down, so plan slower (--speed)"
            if wanted.vehicle == "fixed-wing"
            else "it has to slow down there, which the times allow for"
        )
        found.append(
            f"The ground rises or falls so that at {wanted.speed_m_s:g} m/s the aircraft would have to climb "
            f"or sink at {steepest:.1f} m/s, and it can do {wanted.climb_m_s:g}: {so}."
        )
    if wanted.vehicle == "multicopter" and wanted.wind_m_s > 0 and wanted.max_air_m_s is None:
        found.append(
            f"Against the wind the aircraft has to fly {wanted.air_m_s:g} m/s through the air to hold "
            f"{wanted.speed_m_s:g} m/s over the ground, and nobody said whether it can (--max-airspeed). "
            "Wind costs battery that these times do not show."
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
    elif pixels < 0.99 * wanted.pixels:
        found.append(
            f"{wanted.animal_m:g} m on the ground are {pixels:.1f} pixels, and {wanted.pixels:g} were asked "
            "for (--pixels): fly lower, or with a camera that looks more down."
        )
    twice = sum(area.size for area in plan.areas.areas) - sum(plan.alone.values())
    if twice > 1e-3 * sum(plan.alone.values()):
        told = wanted.animals is not None or any(not math.isnan(one.animals) for one in plan.areas.areas)
        found.append(
            f"{hectares(twice)} lie in more than one area, and are flown for each: join the areas, or cut "
            f"one back.{' Animals are counted for each area as they were given.' if told else ''}"
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


def percent(share: float) -> str:
    """A share as a person says it; nearly all is not all."""
    if 0 < share < 0.01 or 0.99 < share < 1:
        near = "< 0.1 %" if share < 0.5 else "> 99.9 %"
        return f"{100 * share:.1f} %" if 0.0005 < share < 0.9995 else near
    return f"{100 * share:.0f} %"


def head_count(value: float) -> str:
    """A number of animals that may be expected: three figures, and never half an animal of hundreds."""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def _number(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 3)


def hectares(size: float) -> str:
    """A size in m2 as a person says it."""
    if size < 1e4:
        return f"{size:,.0f} m²"
    return f"{size / 1e4:.1f} ha" if size < 1e6 else f"{size / 1e6:.1f} km²"


def count(n: int, word: str) -> str:
    """ "1 row", "2 rows"."""
    return f"{n} {word}{'' if n == 1 else 's'}"
