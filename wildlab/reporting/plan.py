"""The page of a plan: a map, how long it takes, what it rests on, and what speaks against it."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline

from wildlab.analysis.plans.command import origin_text
from wildlab.analysis.plans.coverage import Covered
from wildlab.analysis.plans.plan import Plan
from wildlab.analysis.plans.said import count, head_count, hectares, minutes, percent
from wildlab.flight.readers.area import Area
from wildlab.geometry.frames import Array
from wildlab.geometry.terrain import Terrain
from wildlab.messages.quantities import NOTHING
from wildlab.names import figure_name
from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, PURPLE, VERMILLION, map_axes, new_figure
from wildlab.reporting.figures import png_bytes as png
from wildlab.reporting.layout import with_glossary
from wildlab.reporting.notebook_pages import examine
from wildlab.reporting.page import page
from wildlab.reporting.text import escape

#: Colours of flights, over and over.
FLIGHTS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE)
#: Ground of an area by what becomes of it.
GROUND = {"seen": "#D6EBDF", "hidden": "#D55E00", "only blurred": "#CC79A7", "in no image": "#F0C24B"}
#: Places along a flight at which its ground is drawn.
PLACES = 800
#: Flights that a key names one by one.
NAMED = 6


def plan_page(
    plan: Plan, covered: Sequence[Covered], result: Mapping[str, Any], *, exact: bool = False
) -> str:
    """The whole page, without anything that has to be fetched.

    Parameters
    ----------
    plan
        From `wildlab.analysis.plans.plan.make_plan`.
    covered
        Of each area, from `wildlab.analysis.plans.coverage.cover`.
    result
        From `wildlab.analysis.plans.said.plan_result`.
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
    title = f"{count(n, 'flight')} of {minutes(result['duration_s'])}{' in all' if n > 1 else ''}"
    names = ", ".join(one["name"] for one in result["areas"][:4])
    more = len(result["areas"]) - 4
    names += f" and {count(more, 'more area')}" if more > 0 else ""
    place = f"n begins at {origin_text(plan)} (latitude, longitude)" if exact else "where it is, is withheld"
    parts = [
        f'<header><h1>{escape(title)}</h1><p class="sub">{escape(names)}; {escape(place)}</p></header>',
        _summary(result),
        _tiles(plan, result),
        "<h2>Where it flies, and what it sees</h2>",
        _figure(*_map(plan, covered, result)),
        "<h2>Areas</h2>",
        _areas(result),
        "<h2>Flights</h2>",
        _flights(result),
    ]
    if plan.terrain is not None:
        parts += ["<h2>Heights</h2>", _figure(*_heights(plan, plan.terrain))]
    parts += ["<h2>What this rests on</h2>", _points(result["assumed"])]
    whole = page(title=title, body=with_glossary("\n".join(parts)), kicker="wildlab › plan")
    examine(whole, "plan")
    return whole


def _summary(result: Mapping[str, Any]) -> str:
    first, *then = result["sentences"]
    against = result["warnings"]
    level, pill, word = ("warn", "part", "look closer") if against else ("neutral", "", "no objection")
    reason = " ".join(against) or "No check of the plan objects to it."
    return (
        f'<section class="summary {level}" aria-label="Summary"><p><b>{escape(first)}</b> '
        f'{escape(" ".join(then))}</p><p class="verdict"><span class="pill {pill}">{word}</span> '
        f"{escape(reason)}</p></section>"
    )


def _tiles(plan: Plan, result: Mapping[str, Any]) -> str:
    longest = max(one["duration_s"] for one in result["sorties"])
    tiles = [
        (minutes(longest), f"the longest flight, from take-off to {_ending(plan)}"),
        (percent(result["seen"]), "of the ground is seen"),
    ]
    if result["expected_finds"] is not None:
        living = head_count(result["animals"])
        tiles.append((head_count(result["expected_finds"]), f"finds expected, of {living} animals"))
    tiles += [
        (f"{result['height_m']:.0f} m", "above the ground"),
        (f"{result['animal_pixels']:.0f} px", "across what is looked for"),
        (f"{result['furthest_m']:.0f} m", "from take-off at the most"),
    ]
    return (
        '<ul class="tiles">'
        + "".join(f"<li><b>{escape(big)}</b><span>{escape(small)}</span></li>" for big, small in tiles)
        + "</ul>"
    )


def _ending(plan: Plan) -> str:
    """With what a flight ends: a return of a fixed wing circles over home until the pilot lands it."""
    return "landing" if plan.wanted.vehicle == "multicopter" else "home and down"


def _map(plan: Plan, covered: Sequence[Covered], result: Mapping[str, Any]) -> tuple[Figure, str, str]:
    fig, ax = new_figure(5.8, 5.2)
    there = [_draw_covered(ax, one) for one in covered]
    for area, name in zip(plan.areas.areas, plan.names, strict=True):
        _draw_area(ax, area, name)
    many = len(plan.sorties) > NAMED
    for k, one in enumerate(plan.sorties):
        points, colour = one.course.points, FLIGHTS[k % len(FLIGHTS)]
        ax.plot(
            points[:, 1], points[:, 0], color=colour, lw=1.0, label=None if many else figure_name(one.name)
        )
        for row in one.rows:
            _arrow(ax, plan.pattern.rows[row], colour)
    ax.plot(plan.home[1], plan.home[0], "^", color=INK, ms=8, label="take-off", zorder=5)
    low, high = _drawn(plan)
    side = high - low
    # Above and to the right there is room for the arrow to the north, below for the scale.
    ax.set(xlim=(low[1] - 0.06 * side.max(), high[1] + 0.12 * side.max()))
    ax.set(ylim=(low[0] - 0.10 * side.max(), high[0] + 0.06 * side.max()))
    map_axes(ax)
    ax.set_aspect("equal", adjustable="box")
    rows = len(plan.pattern.rows)
    ax.set_title(f"{percent(result['seen'])} is seen, in {count(len(plan.sorties), 'flight')}")
    handles, _ = ax.get_legend_handles_labels()
    shown = np.any(there, axis=0)
    handles += [
        Patch(color=c, label=figure_name(what))
        for (what, c), some in zip(GROUND.items(), shown, strict=True)
        if some
    ]
    ax.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
    spread = _extent(plan)
    alt = (
        f"Map, north up, of {count(len(plan.areas.areas), 'area')} over {spread[0]:.0f} m by "
        f"{spread[1]:.0f} m with {count(rows, 'row')} of "
        f"{count(len(plan.sorties), 'flight')} and the take-off point."
    )
    alt += " " + " ".join(
        f"{one['name']}: {percent(one['seen'])} seen, {percent(one['hidden'])} hidden, "
        f"{percent(one['blurred'])} blurred."
        for one in result["areas"][:NAMED]
    )
    return fig, alt, "North is up. Arrows show which way a row is flown; the triangle is the take-off point."


def _drawn(plan: Plan) -> tuple[Array, Array]:
    """The least and the greatest north and east of areas, ways and take-off, metres."""
    points = [area.outline for area in plan.areas.areas] + [one.course.points for one in plan.sorties]
    every = np.concatenate([*points, plan.home[None]])
    return every.min(axis=0), every.max(axis=0)


def _draw_covered(ax: Axes, one: Covered) -> list[bool]:
    """The ground of an area, by what becomes of it; whether there is any of each kind."""
    seen = one.looks > 0
    kinds = [seen, one.hidden, one.blurred, ~(seen | one.hidden | one.blurred)]
    colours = np.ones((*one.inside.shape, 4))
    colours[~one.inside] = 0
    for which, colour in zip(kinds, GROUND.values(), strict=True):
        colours[which & one.inside] = to_rgba(colour)
    half = one.step / 2
    rows, columns = one.inside.shape
    ax.imshow(
        colours,
        origin="lower",
        extent=(
            one.east - half,
            one.east + columns * one.step - half,
            one.north - half,
            one.north + rows * one.step - half,
        ),
        interpolation="nearest",
        zorder=1,
    )
    return [bool((which & one.inside).any()) for which in kinds]


def _heights(plan: Plan, terrain: Terrain) -> tuple[Figure, str, str]:
    """The ground below each flight, and the way above it, from the take-off point's height."""
    fig, ax = new_figure(6.0, 3.0)
    base = float(plan.sorties[0].way.ground[0])
    begin, low, high, top = 0.0, np.inf, -np.inf, -np.inf
    for k, one in enumerate(plan.sorties):
        way = one.way
        along = begin + np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(way.points, axis=0), axis=1))])
        places = np.linspace(along[0], along[-1], PLACES)
        where = np.stack([np.interp(places, along, way.points[:, axis]) for axis in (0, 1)], axis=1)
        ground = terrain.heights_at(where) - base
        ax.fill_between(places / 1000, ground, y2=-1e5, color="#CFC7B8", lw=0)
        ax.plot(along / 1000, way.height - base, color=FLIGHTS[k % len(FLIGHTS)], lw=1.2)
        low, high = min(low, float(np.nanmin(ground))), max(high, float(way.height.max()) - base)
        top, begin = max(top, float(np.nanmax(ground))), float(along[-1])
    ax.set(xlabel="way (km)", ylabel="above take-off (m)", ylim=(low - 5, high + 10), xlim=(0, begin / 1000))
    least, most = min(one.way.least for one in plan.sorties), max(one.way.most for one in plan.sorties)
    ax.set_title(f"{least:.0f} to {most:.0f} m above the ground")
    alt = (
        f"The way and the ground below it over {begin / 1000:.1f} km. From the take-off point, the ground "
        f"lies between {low:.0f} and {top:.0f} m; the way is {least:.0f} to {most:.0f} m above it."
    )
    return fig, alt, "The flights one after the other, each in its colour of the map."


def _draw_area(ax: Axes, area: Area, name: str) -> None:
    rings = [area.outline, *area.holes]
    corners = np.concatenate([np.concatenate([ring, ring[:1]])[:, ::-1] for ring in rings])
    codes = np.concatenate(
        [[Outline.MOVETO, *([Outline.LINETO] * (len(ring) - 1)), Outline.CLOSEPOLY] for ring in rings]
    )
    # Holes show only where they run the other way round; a line round each says where they are.
    ax.add_patch(PathPatch(Outline(corners, codes), facecolor="none", edgecolor=INK, lw=1.4, zorder=3))
    middle = area.outline.mean(axis=0)
    ax.annotate(
        name,
        xy=(float(middle[1]), float(middle[0])),
        ha="center",
        va="center",
        fontsize=10,
        color=INK,
        zorder=6,
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.75},
    )


def _arrow(ax: Axes, row: Array, colour: str) -> None:
    begin, end = row[0], row[1]
    middle, step = (begin + end) / 2, (end - begin) / max(float(np.linalg.norm(end - begin)), 1e-9)
    ax.annotate(
        "",
        xy=(float(middle[1] + step[1]), float(middle[0] + step[0])),
        xytext=(float(middle[1]), float(middle[0])),
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.0},
    )


def _extent(plan: Plan) -> Array:
    points = np.concatenate([area.outline for area in plan.areas.areas])
    return np.asarray(np.ptp(points, axis=0))


def _flights(result: Mapping[str, Any]) -> str:
    battery = any(one["of_battery"] is not None for one in result["sorties"])
    heads = ["flight", "areas", "time", "of a battery", "rows", "way points", "km", "above ground, m"]
    rows = []
    for one in result["sorties"]:
        low, high = one["least_above_ground_m"], one["most_above_ground_m"]
        span = f"{low:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"
        rows.append(
            [
                one["name"],
                ", ".join(one["areas"]),
                minutes(one["duration_s"]),
                NOTHING if one["of_battery"] is None else f"{100 * one['of_battery']:.0f} %",
                str(one["rows"]),
                str(one["way_points"]),
                f"{one['length_m'] / 1000:.1f}",
                span,
            ]
        )
    if not battery:
        heads, rows = _without(3, heads, rows)
    return _table(heads, rows, text=2)


def _areas(result: Mapping[str, Any]) -> str:
    heads = ["area", "size", "seen", "hidden", "finds", "rows", "row distance, m", "time"]
    rows = [
        [
            one["name"],
            hectares(one["size_m2"]),
            percent(one["seen"]),
            percent(one["hidden"]),
            NOTHING
            if one["expected_finds"] is None
            else f"{head_count(one['expected_finds'])} of {head_count(one['animals'])}",
            str(one["rows"]),
            f"{one['row_distance_m']:.1f}",
            minutes(one["seconds"]),
        ]
        for one in result["areas"]
    ]
    if all(one["expected_finds"] is None for one in result["areas"]):
        heads, rows = _without(4, heads, rows)
    note = (
        '<p class="note">Times are of rows and the turns between them, without the ways there and back.</p>'
    )
    return _table(heads, rows, text=1) + note


def _without(column: int, heads: list[str], rows: list[list[str]]) -> tuple[list[str], list[list[str]]]:
    return heads[:column] + heads[column + 1 :], [row[:column] + row[column + 1 :] for row in rows]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]], text: int) -> str:
    """A table whose first columns are words."""

    def kind(column: int) -> str:
        return ' class="text"' if column < text else ""

    head = "".join(f'<th scope="col"{kind(k)}>{escape(one)}</th>' for k, one in enumerate(heads))
    body = "".join(
        f'<tr><th scope="row" class="text">{escape(row[0])}</th>'
        + "".join(f"<td{kind(k)}>{escape(one)}</td>" for k, one in enumerate(row[1:], start=1))
        + "</tr>"
        for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _points(sentences: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(one)}</li>" for one in sentences) + "</ul>"


def _figure(figure: Figure, alt: str, caption: str) -> str:
    encoded = base64.b64encode(png(figure)).decode("ascii")
    return (
        f'<figure><img alt="{escape(alt)}" src="data:image/png;base64,{encoded}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
