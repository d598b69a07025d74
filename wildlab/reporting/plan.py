"""The page of a plan: a map, how long it takes, what it rests on, and what speaks against it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from scipy.ndimage import distance_transform_edt

from wildlab.analysis.plan import Plan
from wildlab.analysis.plan_coverage import Covered
from wildlab.analysis.plan_result import count, head_count, hectares, minutes, origin_text, percent
from wildlab.geometry.frames import Array
from wildlab.geometry.georeference import Terrain
from wildlab.messages.catalogue import Message, load_texts, words
from wildlab.messages.quantities import NOTHING
from wildlab.names import figure_name
from wildlab.planning.patterns import distances_along
from wildlab.reporting.charts.drawing import draw_cells, draw_fences, draw_way, mark_place
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, map_axes, new_figure
from wildlab.reporting.notebook_pages import finished_page
from wildlab.reporting.report import Wording, open_report

#: Colours of flights, over and over.
FLIGHTS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE)
#: Ground of an area by what becomes of it.
GROUND = {"seen": "#D6EBDF", "hidden": "#D55E00", "only blurred": "#CC79A7", "in no image": "#F0C24B"}
#: Places along a flight at which its ground is drawn.
PLACES = 800
#: Flights that a key names one by one.
NAMED = 6


def with_words(result: Mapping[str, Any]) -> dict[str, Any]:
    """The result of a plan with the sentences of the catalogue in place of its facts.

    Parameters
    ----------
    result
        From `wildlab.analysis.plan_result.plan_result`.

    Returns
    -------
    dict
    """
    said = {name: words("plan", result[name]) for name in ("assumed", "warnings", "sentences")}
    return {**result, **said}


def plan_page(
    plan: Plan, covered: Sequence[Covered], result: Mapping[str, Any], *, exact: bool = False
) -> str:
    """The whole page, without anything that has to be fetched.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plan.make_plan`.
    covered
        Of each area, from `wildlab.analysis.plan_coverage.cover`.
    result
        From `with_words`.
    exact
        Whether it may tell where on the Earth this is.

    Returns
    -------
    str
        HTML.

    Raises
    ------
    WildlabError
        If the page would break a promise of `wildlab.reporting.notebook_pages.examine`.
    """
    n = len(result["sorties"])
    report = open_report(study="plan", kind="computed")
    values = {"flights": count(n, "flight"), "time": minutes(result["duration_s"])}
    wording = Wording(report, load_texts("plan"), values)
    texts, names = wording.texts.subjects, ", ".join(one["name"] for one in result["areas"][:4])
    more = len(result["areas"]) - 4
    names += f" and {count(more, 'more area')}" if more > 0 else ""
    (title,) = wording.messages([Message("title-many" if n > 1 else "title")])
    place = wording.say(texts["exact"], {"origin": origin_text(plan)}) if exact else texts["withheld"]
    report.head(title, f"{names}; {place}")
    against = " ".join(result["warnings"])
    sound = "battery-unchecked" if plan.wanted.battery_min is None else "no-objection"
    found = "look-closer" if against else sound
    reason = against or wording.texts.answers[found]
    level = "warn" if against else "neutral"
    report.summary(result["sentences"], level=level, verdict=(texts[found], reason))
    report.tiles(_tiles(plan, result, wording))
    _show_map(wording, plan, covered, result)
    wording.table("areas", _areas(result))
    wording.table("flights", _flights(result))
    if plan.terrain is not None:
        report.section(texts["heights"])
        _show_heights(wording, plan, plan.terrain)
    report.section(texts["assumed"])
    report.points(result["assumed"])
    return finished_page(report.parts, title=title, name="plan", kicker="wildlab › plan")


def _tiles(plan: Plan, result: Mapping[str, Any], wording: Wording) -> list[tuple[str, str]]:
    texts, longest = wording.texts.subjects, max(one["duration_s"] for one in result["sorties"])
    # A return of a fixed wing circles over home until the pilot lands it.
    ending = "landing" if plan.wanted.vehicle == "multicopter" else "home"
    tiles = [(minutes(longest), texts[f"longest-{ending}"]), (percent(result["seen"]), texts["seen"])]
    if result["expected_finds"] is not None:
        words = wording.say(texts["finds"], {"animals": head_count(result["animals"])})
        tiles.append((head_count(result["expected_finds"]), words))
    return [
        *tiles,
        (f"{result['height_m']:.0f} m", texts["height"]),
        (f"{result['animal_pixels']:.0f} px", texts["pixels"]),
        (f"{result['furthest_m']:.0f} m", texts["furthest"]),
    ]


def _show_map(wording: Wording, plan: Plan, covered: Sequence[Covered], result: Mapping[str, Any]) -> None:
    fig, ax = new_figure(5.8, 5.2)
    shown = {kind for one in covered for kind in _draw_covered(ax, one)}
    for area, name, cells in zip(plan.areas.areas, plan.names, covered, strict=True):
        draw_fences(ax, [area.outline, *area.holes])
        mark_place(ax, roomiest_place(cells), name, below=True)
    many = len(plan.sorties) > NAMED
    for k, one in enumerate(plan.sorties):
        colour = FLIGHTS[k % len(FLIGHTS)]
        draw_way(ax, one.course.points, colour, "" if many else one.name, width=1.0)
        for row in one.rows:
            _arrow(ax, plan.pattern.rows[row], colour)
    ax.plot(plan.home[1], plan.home[0], "^", color=INK, ms=8, label="take-off", zorder=5)
    # Above and to the right there is room for the arrow to the north, below for the scale.
    ax.margins(0.15)
    map_axes(ax)
    ax.set_aspect("equal", adjustable="box")
    handles, _ = ax.get_legend_handles_labels()
    ground = [Patch(color=c, label=figure_name(what)) for what, c in GROUND.items()]
    handles += [ground[kind] for kind in sorted(shown)]
    ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
    north, east = np.ptp(np.concatenate([area.outline for area in plan.areas.areas]), axis=0)
    wording.values |= {
        "seen": percent(result["seen"]),
        "areas": count(len(plan.areas.areas), "area"),
        "rows": count(len(plan.pattern.rows), "row"),
        "north": f"{north:.0f}",
        "east": f"{east:.0f}",
    }
    wording.figure("map", fig, main=True)


def roomiest_place(cells: Covered) -> Array:
    """(2,) m north and east: furthest from all fences of an area, whose middle may lie in a hole."""
    room = distance_transform_edt(np.pad(cells.inside, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(np.argmax(room), room.shape)
    return np.array([cells.north + row * cells.step, cells.east + column * cells.step])


def _draw_covered(ax: Axes, one: Covered) -> set[int]:
    """Draw the ground of an area by what becomes of it; which of `GROUND` there are."""
    kind = np.select([one.looks > 0, one.hidden, one.blurred], [0, 1, 2], 3)
    shown = np.ma.masked_array(kind, ~one.inside)
    look = {"cmap": ListedColormap(list(GROUND.values())), "vmin": -0.5, "vmax": 3.5, "zorder": 1}
    draw_cells(ax, shown, one.east, one.north, one.step, **look)
    return set(np.unique(kind[one.inside]).tolist())


def _show_heights(wording: Wording, plan: Plan, terrain: Terrain) -> None:
    """The ground below each flight, and the way above it, from the take-off point's height."""
    fig, ax = new_figure(6.0, 3.0)
    base = float(plan.sorties[0].way.ground[0])
    begin, low, high, top = 0.0, np.inf, -np.inf, -np.inf
    for k, one in enumerate(plan.sorties):
        way = one.way
        along = begin + distances_along(way.points)
        places = np.linspace(along[0], along[-1], PLACES)
        where = np.stack([np.interp(places, along, way.points[:, axis]) for axis in (0, 1)], axis=1)
        ground = terrain.heights_at(where) - base
        ax.fill_between(places / 1000, ground, y2=-1e5, color="#CFC7B8", lw=0)
        ax.plot(along / 1000, way.height - base, color=FLIGHTS[k % len(FLIGHTS)], lw=1.2)
        low, high = min(low, float(np.nanmin(ground))), max(high, float(way.height.max()) - base)
        top, begin = max(top, float(np.nanmax(ground))), float(along[-1])
    ax.set(xlabel="way (km)", ylabel="above take-off (m)", ylim=(low - 5, high + 10), xlim=(0, begin / 1000))
    wording.values |= {
        "least": f"{min(one.way.least for one in plan.sorties):.0f}",
        "most": f"{max(one.way.most for one in plan.sorties):.0f}",
        "way": f"{begin / 1000:.1f}",
        "low": f"{low:.0f}",
        "high": f"{top:.0f}",
    }
    wording.figure("heights", fig)


def _arrow(ax: Axes, row: Array, colour: str) -> None:
    begin, end = row[0], row[1]
    middle, step = (begin + end) / 2, (end - begin) / max(float(np.linalg.norm(end - begin)), 1e-9)
    ax.annotate(
        "",
        xy=(float(middle[1] + step[1]), float(middle[0] + step[0])),
        xytext=(float(middle[1]), float(middle[0])),
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.0},
    )


def _flights(result: Mapping[str, Any]) -> pd.DataFrame:
    rows = []
    for one in result["sorties"]:
        low, high = one["least_above_ground_m"], one["most_above_ground_m"]
        used = one["of_battery"]
        rows.append(
            {
                "flight": one["name"],
                "areas": ", ".join(one["areas"]),
                "time": minutes(one["duration_s"]),
                "battery": NOTHING if used is None else f"{100 * used:.0f} %",
                "rows": one["rows"],
                "points": one["way_points"],
                "km": one["length_m"] / 1000,
                "above": f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}",
            }
        )
    return pd.DataFrame(rows)


def _areas(result: Mapping[str, Any]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {
                "area": one["name"],
                "size": hectares(one["size_m2"]),
                "seen": percent(one["seen"]),
                "hidden": percent(one["hidden"]),
                "finds": NOTHING
                if one["expected_finds"] is None
                else f"{head_count(one['expected_finds'])} of {head_count(one['animals'])}",
                "rows": one["rows"],
                "distance": one["row_distance_m"],
                "time": minutes(one["seconds"]),
            }
            for one in result["areas"]
        ]
    )
