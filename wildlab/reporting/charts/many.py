"""Charts of many targets at once: identities on a map and over time, and what is wrong at each look."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import MaxNLocator

from wildlab.analysis.many.follow import ManyTracks, known_looks
from wildlab.evaluation.identities import Identities
from wildlab.geometry.frames import Array
from wildlab.names import figure_name
from wildlab.reporting.charts.following import SENSOR_COLOURS, Shown
from wildlab.reporting.figures import GREY, INK, VERMILLION, map_axes, mark_gaps, new_figure

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
        ax.plot(way[:, 1], way[:, 0], color="black", lw=1.2, ls=(0, (4, 2)), label="truth", zorder=3)
    platform = np.array([scan.platform for scan in followed.scans])
    if len(platform) and np.ptp(platform, axis=0).max() > 0:
        ax.plot(platform[:, 1], platform[:, 0], color=GREY, lw=1.2, label="platform")
    elif len(platform):
        ax.plot(platform[:1, 1], platform[:1, 0], "^", color=GREY, ms=8, label="platform")
    ways = ways_of(followed)
    tints = colours_of(followed)
    for identity, way in ways.items():
        # Where a track is absent for a while no line says where it was.
        way = parted(way, [look.time for look in followed.shown])
        named = tints[identity] != INK
        label = f"track {identity}" if named else "other tracks"
        ax.plot(
            way[:, 2], way[:, 1], color=tints[identity], lw=1.8 if named else 1.0, label=figure_name(label)
        )
        ax.plot(way[:1, 2], way[:1, 1], "o", color=tints[identity], ms=5)
    handles, labels = ax.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    fig.legend(once.values(), once.keys(), loc="outside lower center", ncols=3)
    count = len(ways)
    ax.set_title("1 track" if count == 1 else f"{count} tracks")
    map_axes(ax)
    alt = f"Map in local metres of {_many(count, 'track')}"
    alt += f" beside the true ways of {_many(len(followed.truth), 'target')}." if followed.truth else "."
    rest = "" if count <= MOST_NAMED else f" The {MOST_NAMED} longest have a colour."
    return fig, "map", alt, f"A dot is where a track was first believed.{rest}"


def identities_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """Which track is on each target, over time."""
    names = [name for name, life in lives.targets.items() if life.visible]
    fig, ax = new_figure(5.8, 1.6 + 0.5 * len(names))
    start = followed.scans[0].time
    times = (np.array([scan.time for scan in followed.scans]) - start)[known_looks(followed)]
    tints = colours_of(followed)
    for row, name in enumerate(names):
        on = [one.get(name) for one in lives.followed]
        for identity in dict.fromkeys(one for one in on if one is not None):
            mine = np.array([one == identity for one in on])
            ax.plot(times[mine], np.full(int(mine.sum()), row), "|", color=tints[identity], ms=11, mew=1.6)
    ax.set_yticks(range(len(names)), [figure_name(short(name)) for name in names])
    ax.set_ylim(-0.6, len(names) - 0.4)
    ax.set_xlabel("time since the first look (s)")
    changes = lives.swaps + lives.breaks
    ax.set_title("No target changes its track" if not changes else f"Tracks change {_times(changes)}")
    alt = f"For {_many(len(names), 'target')} the track that is on it at each look; colours are tracks. "
    alt += "None changes." if not changes else f"They change {_times(changes)}."
    shown = {one for looks in lives.followed for one in looks.values()}
    dark = sum(tints[one] == INK for one in shown)
    colours = "a colour is a track" if dark < 2 else f"a colour is a track, but dark is any of {dark} others"
    return fig, "identities", alt, f"A mark is a look with a track on the target; {colours}."


def wrong_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """GOSPA at each look, and how many targets are missed and tracks false."""
    fig, axes = new_figure(5.8, 4.2, rows=2, sharex=True)
    times = (np.array([scan.time for scan in followed.scans]) - followed.scans[0].time)[known_looks(followed)]
    distance = np.array([one.distance for one in lives.gospa])
    axes[0].plot(times, distance, ".", color=SENSOR_COLOURS[0], ms=4)
    axes[0].axhline(distance.mean(), color=INK, lw=1.2, ls="--")
    axes[0].set_ylabel("GOSPA (m)")
    axes[0].set_title(f"{distance.mean():.1f} m in the mean")
    missed = np.array([one.n_missed for one in lives.gospa])
    false = np.array([one.n_false for one in lives.gospa])
    pause = PAUSE * float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    # Over a pause no line says what nobody looked at.
    after = np.flatnonzero(np.diff(times) > pause) + 1
    for values, tint, what in (
        (missed, SENSOR_COLOURS[0], "targets missed"), (-false, VERMILLION, "tracks on nothing")
    ):  # fmt: skip
        axes[1].step(
            np.insert(times, after, times[after]),
            np.insert(values.astype(float), after, np.nan),
            where="mid", color=tint, lw=1.4, label=figure_name(what),
        )  # fmt: skip
    axes[1].set_ylabel("how many")
    axes[1].set_xlabel("time since the first look (s)")
    most = max(int(missed.max()), int(false.max()), 1)
    axes[1].set_ylim(-most - 0.5, most + 0.5)
    axes[1].yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes[1].yaxis.set_major_formatter(lambda value, _: f"{abs(value):.0f}")
    fig.legend(loc="outside lower center", ncols=2)
    mark_gaps(axes[0], times, pause)
    alt = (
        f"GOSPA with a cut-off of {followed.cutoff_m:g} m at {len(times)} looks, {distance.mean():.1f} m in "
        "the mean; "
        f"targets missed at {int((missed > 0).sum())} looks, tracks on nothing at {int((false > 0).sum())}."
    )
    caption = "Dashed: the mean. Below: targets missed upwards, tracks on nothing downwards."
    if len(after):
        caption += " Grey: nobody looked, or no true place is known."
        alt += f" {_many(len(after), 'pause')}, the longest of {np.diff(times).max():.0f} s."
    return fig, "gospa", alt, caption
