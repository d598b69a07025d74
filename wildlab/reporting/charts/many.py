"""Charts of many targets at once: identities on a map and over time, and what is wrong at each look."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from wildlab.analysis.tracks.many import ManyTracks, known_scans
from wildlab.evaluation.identities import Identities
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.drawing import (
    TRUTH,
    Shown,
    draw_dots,
    draw_line,
    draw_platform,
    draw_way,
    finish,
    name_rows,
    new_strips,
    with_breaks,
)
from wildlab.reporting.charts.following import SENSOR_COLOURS
from wildlab.reporting.figures import INK, VERMILLION, map_axes, mark_gaps, new_figure

#: Tracks that have a colour and a name of their own in a map: the longest.
MOST_NAMED = 6
#: Letters of a target's name in a chart.
LONGEST_NAME = 14
#: Looks farther apart than so many usual ones are no line.
PAUSE = 8.0


def ways_of(followed: ManyTracks) -> dict[int, Array]:
    """(L, 3) times and places of every track, the longest first."""
    ways: dict[int, list[tuple[float, float, float]]] = {}
    for look in followed.shown:
        for identity, x in zip(look.identity, look.x, strict=True):
            ways.setdefault(int(identity), []).append((look.time, float(x[0]), float(x[1])))
    longest = sorted(ways, key=lambda name: (-len(ways[name]), name))
    return {name: np.array(ways[name]) for name in longest}


def parted(way: Array, times: list[float]) -> Array:
    """A way (L, 3) of times and places, with a row of NaN wherever it misses some of the times."""
    # Several sensors may look at one time.
    order = np.searchsorted(np.unique(times), way[:, 0])
    return np.asarray(np.insert(way, np.flatnonzero(np.diff(order) > 1) + 1, np.nan, axis=0))


def short(name: object) -> str:
    """A target's name as far as there is room for it."""
    text = str(name)
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 1]}…"


def _many(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def colours_of(followed: ManyTracks) -> dict[object, str]:
    """By identity: the longest tracks have a colour of their own in every chart, the others that of ink."""
    names = list(ways_of(followed))
    own = dict(zip(names, SENSOR_COLOURS[:MOST_NAMED], strict=False))
    return {name: own.get(name, INK) for name in names}


def map_shown(followed: ManyTracks) -> Shown:
    """Where every track went, in local metres, north up, beside the true ways."""
    fig, ax = new_figure(5.6, 5.4)
    for way in followed.truth.values():
        draw_way(ax, way, name="truth", zorder=3, **TRUTH)
    if followed.scans:
        draw_platform(ax, np.array([scan.platform for scan in followed.scans]), "platform")
    ways, tints = ways_of(followed), colours_of(followed)
    times = [look.time for look in followed.shown]
    for identity, way in ways.items():
        # Where a track is absent for a while no line says where it was.
        tint, named = tints[identity], tints[identity] != INK
        name = f"track {identity}" if named else "other tracks"
        draw_way(ax, parted(way, times)[:, 1:], tint, name, width=1.8 if named else 1.0)
        ax.plot(way[:1, 2], way[:1, 1], "o", color=tint, ms=5)
    map_axes(ax)
    finish(fig, _many(len(ways), "track"))
    alt = f"Map in local metres of {_many(len(ways), 'track')}"
    alt += f" beside the true ways of {_many(len(followed.truth), 'target')}." if followed.truth else "."
    rest = "" if len(ways) <= MOST_NAMED else f" The {MOST_NAMED} longest have a colour."
    return fig, "map", alt, f"A dot is where a track was first believed.{rest}"


def identities_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """Which track is on each target, over time."""
    names = [name for name, life in lives.targets.items() if life.visible]
    fig, ax = new_figure(5.8, 1.6 + 0.5 * len(names))
    times, tints = _times_of(followed), colours_of(followed)
    for row, name in enumerate(names):
        on = [one.get(name) for one in lives.followed]
        for identity in dict.fromkeys(one for one in on if one is not None):
            mine = np.array([one == identity for one in on])
            ax.plot(times[mine], np.full(int(mine.sum()), row), "|", color=tints[identity], ms=11, mew=1.6)
    name_rows(ax, [short(name) for name in names])
    changes = lives.swaps + lives.breaks
    title = "No target changes its track" if not changes else f"Tracks change {_times(changes)}"
    finish(fig, title, "time since the first look (s)")
    alt = f"For {_many(len(names), 'target')} the track that is on it at each look; colours are tracks. "
    alt += "None changes." if not changes else f"They change {_times(changes)}."
    shown = {one for looks in lives.followed for one in looks.values()}
    dark = sum(tints[one] == INK for one in shown)
    colours = "a colour is a track" if dark < 2 else f"a colour is a track, but dark is any of {dark} others"
    return fig, "identities", alt, f"A mark is a look with a track on the target; {colours}."


def wrong_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """GOSPA at each look, and how many targets are missed and tracks false."""
    fig, (upper, lower) = new_strips(2, 4.2, 5.8)
    times = _times_of(followed)
    distance, missed, false = (
        np.array([getattr(one, part) for one in lives.gospa]) for part in ("distance", "n_missed", "n_false")
    )
    draw_dots(upper, times, distance, SENSOR_COLOURS[0], alpha=1.0)
    upper.axhline(distance.mean(), color=INK, lw=1.2, ls="--")
    pause = PAUSE * float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    # Over a pause no line says what nobody looked at.
    draw: dict[str, Any] = {"width": 1.4, "drawstyle": "steps-mid"}
    draw_line(lower, *with_breaks(times, missed, pause), SENSOR_COLOURS[0], "targets missed", **draw)
    draw_line(lower, *with_breaks(times, -false, pause), VERMILLION, "tracks on nothing", **draw)
    most = max(int(missed.max()), int(false.max()), 1)
    lower.set(ylabel="how many", ylim=(-most - 0.5, most + 0.5))
    lower.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    lower.yaxis.set_major_formatter(lambda value, _: f"{abs(value):.0f}")
    pauses = mark_gaps(upper, times, pause)
    finish(fig, f"{distance.mean():.1f} m in the mean", "time since the first look (s)", "GOSPA (m)")
    alt = (
        f"GOSPA with a cut-off of {followed.cutoff_m:g} m at {len(times)} looks, {distance.mean():.1f} m in "
        f"the mean; targets missed at {int((missed > 0).sum())} looks, tracks on nothing at "
        f"{int((false > 0).sum())}."
    )
    caption = "Dashed: the mean. Below: targets missed upwards, tracks on nothing downwards."
    if pauses:
        caption += " Grey: nobody looked, or no true place is known."
        alt += f" {_many(pauses, 'pause')}, the longest of {np.diff(times).max():.0f} s."
    return fig, "gospa", alt, caption


def _times_of(followed: ManyTracks) -> Array:
    """(N,) s since the first look, of the looks at which true places are known."""
    times = np.array([scan.time for scan in followed.scans])
    return np.asarray((times - times[0])[known_scans(followed)])
