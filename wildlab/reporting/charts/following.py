"""Charts of a flight's tracks by any sensor: maps, squares and errors over time, and whiteness; and of many
targets at once: identities on a map and over time, and what is wrong at each look."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from wildlab.analysis.tracks.many import ManyTracks, known_scans
from wildlab.analysis.tracks.single_target import SMOOTHED, SensorTrack
from wildlab.analysis.tracks.tracker import TrackingResult, is_at_rest, whitened
from wildlab.evaluation.consistency import autocorrelation, chi_square_interval, white_bound
from wildlab.evaluation.identities import Identities
from wildlab.geometry.frames import Array
from wildlab.messages.catalogue import fill, load_texts
from wildlab.messages.quantities import length
from wildlab.reporting.charts.drawing import (
    LINES,
    TRUTH,
    Shown,
    correlations_chart,
    draw_dots,
    draw_line,
    draw_platform,
    draw_way,
    finish,
    name_rows,
    new_strips,
    with_breaks,
)
from wildlab.reporting.figures import (
    INK,
    ORANGE,
    VERMILLION,
    Powers,
    colour,
    filter_words,
    log_band,
    map_axes,
    mark_gaps,
    new_figure,
    short_words,
    thinned,
)

SENSOR_COLOURS = (*LINES[:4], ORANGE, LINES[4])
#: Lags of innovations shown, detections; metres beyond the targets' ways that a map shows, as a share.
LAGS, MARGIN = 20, 0.15
#: Where the largest value is this many times the middle one, an axis that is even would show it alone.
UNEVEN = 20.0
#: A pause in the detections longer than this many of its usual intervals is shaded.
PAUSE = 5.0


def slug(*words: str) -> str:
    """A name of a figure; where letters of the words cannot stand in it, a digest tells it from others.

    Examples
    --------
    >>> slug("map", "boat 1"), slug("map", "$") == slug("map", "å")
    ('map-boat-1', False)
    """
    text = "-".join(words).lower()
    plain = "".join(c if c.isalnum() and c.isascii() else "-" for c in text)
    strange = any(c not in " _-" for c in text if not (c.isalnum() and c.isascii()))
    return f"{plain}-{hashlib.sha256(text.encode()).hexdigest()[:6]}" if strange else plain


def map_shown(
    followed: TrackingResult, target: str, name: str, truth: Array, platforms: dict[str, Array]
) -> Shown:
    """The way of one target as each sensor's track by one filter has it; north up, local metres.

    Parameters
    ----------
    truth
        (K, 2) north, east of the target; empty where it is not known.
    platforms
        (N, 2) ways of the platforms, by name.
    """
    mine = [one for one in followed.tracks if (one.target, one.filter) == (target, name)]
    fig, ax = new_figure(5.6, 5.0)
    # Beside the whole way of the platform, a target at rest and its track are a dot.
    at_rest = bool(mine) and all(map(is_at_rest, mine))
    platforms = {} if at_rest else platforms
    for words, way in platforms.items():
        draw_platform(ax, way, words)
    shown = [truth] if len(truth) else []
    for one, tint in zip(mine, SENSOR_COLOURS * len(mine), strict=False):
        x = one.estimate[np.isfinite(one.estimate[:, 0])][:, :2]
        if len(x):
            draw_way(ax, one.estimate, tint, one.sensor, width=1.6)
            shown.append(_middle(x))
    if len(truth):
        draw_way(
            ax, truth, name="truth", **(TRUTH | {"marker": "+", "ms": 13, "mew": 2} if at_rest else TRUTH)
        )
    if shown:
        every = np.concatenate([*shown, *platforms.values()])
        low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
        margin = MARGIN * np.maximum(high - low, 10.0)
        (bottom, left), (top, right) = low - margin, high + margin
        ax.set(xlim=(left, right), ylim=(bottom, top))
    map_axes(ax)
    finish(fig)
    return captioned(fig, "tracking", "map", slug("map", target), target=target, filter=filter_words(name))


def _middle(x: Array) -> Array:
    """Without the ends that stray."""
    low, high = np.quantile(x, 0.02, axis=0), np.quantile(x, 0.98, axis=0)
    return x[((x >= low) & (x <= high)).all(axis=1)] if len(x) > 50 else x


def squares_shown(tracks: Sequence[SensorTrack], rows: pd.DataFrame, what: str) -> Shown:
    """NEES (``"nees"``) or NIS of one target by one sensor over time, by filter, with the band."""
    first, mean = tracks[0], _rows_of(tracks, rows)[what]
    dof = 2.0 if what == "nees" else first.dof
    fig, ax = new_figure(5.8, 3.8)
    drawn: dict[str, str] = {}
    limits = [float(dof)]
    for one in tracks:
        values = one.nees if what == "nees" else one.nis
        if not np.isfinite(values).any():
            continue
        t, y = _lines(one, values)
        y = np.maximum(y, 1e-4)
        if what == "nees":
            draw_line(ax, t, y, _tint(one.filter), filter_words(one.filter), width=1.4,
                      ls="--" if one.filter.endswith(SMOOTHED) else "-")  # fmt: skip
        else:
            draw_dots(ax, t, y, _tint(one.filter), filter_words(one.filter), size=3.5)
        limits += [float(np.nanmin(y)), float(np.nanmax(y))]
        drawn[one.filter] = f"{mean[one.filter]:.2f}"
    low, high = chi_square_interval(dof)
    log_band(ax, low, high)
    ax.set_ylim(max(min(limits) / 2, low / 30), 3 * max(limits))
    used = first.times[np.isfinite(first.nis)]
    if len(used) > 2:
        mark_gaps(ax, used, max(PAUSE * float(np.median(np.diff(used))), 1.0))
    finish(fig, "time (s)", "NEES of the position" if what == "nees" else "NIS of the detections")
    return _of_filters(fig, "squares", what, first, drawn, score=what.upper(), dof=f"{dof:g}")


def errors_shown(tracks: Sequence[SensorTrack], rows: pd.DataFrame) -> Shown:
    """Distance from the truth over time of one target by one sensor, and the reported standard deviation."""
    first, rmse = tracks[0], _rows_of(tracks, rows)["rmse"].to_dict()
    fig, ax = new_figure(5.8, 3.6)
    drawn: dict[str, str] = {}
    sizes: list[Array] = []
    for one in tracks:
        away = np.hypot(*one.error[:, :2].T)
        there = np.isfinite(away)
        if not there.any():
            continue
        stated = np.sqrt(np.trace(one.covariance[:, :2, :2], axis1=1, axis2=2))
        draw_line(ax, *_lines(one, away), _tint(one.filter), filter_words(one.filter), width=1.5)
        draw_line(ax, *_lines(one, np.where(there, stated, np.nan)), _tint(one.filter), width=1.0, ls=":")
        drawn[one.filter] = length(float(rmse[one.filter]))
        sizes.append(away[there])
    draw_line(ax, [], [], INK, "reported standard deviation", width=1.0, ls=":")
    # One filter that is lost would press all others flat.
    if len(sizes) > 1 and max(map(np.max, sizes)) > UNEVEN * min(map(np.max, sizes)):
        ax.set_yscale("log")
        ax.set_ylim(bottom=max(float(np.quantile(np.concatenate(sizes), 0.01)), 1e-3))
        ax.yaxis.set_major_formatter(Powers())
    else:
        ax.set_ylim(bottom=0)
    finish(fig, "time (s)", "error (m)")
    return _of_filters(fig, "errors", "error", first, drawn)


def whiteness_shown(tracks: Sequence[SensorTrack], elements: Sequence[str]) -> Shown | None:
    """Autocorrelation of the whitened innovations of one target by one sensor; None of too few."""
    first = tracks[0]
    white = {one.filter: found for one in tracks if len(found := whitened(one)) > LAGS + 2}
    if not white:
        return None
    series = {name: [autocorrelation(column, LAGS) for column in found.T] for name, found in white.items()}
    far = {
        name: f"{max((r[1] for r in columns), key=abs):+.2f}".replace("-", "−")
        for name, columns in series.items()
    }
    labels = [f"element {i + 1}" for i in range(len(elements))] if len(elements) > 1 else elements
    strips = {
        f"autocorrelation,\n{label}": {
            filter_words(name): (columns[i], _tint(name)) for name, columns in series.items()
        }
        for i, label in enumerate(labels)
    }
    fig = correlations_chart(strips, [white_bound(max(map(len, white.values())))] * len(strips))
    return _of_filters(fig, "whiteness", "whiteness", first, far, lags=str(LAGS))


def captioned(fig: Figure, page: str, key: str, name: str, **values: str) -> Shown:
    """A figure with its name, and its title, alternative text and caption out of a page's catalogue."""
    text = load_texts(page).figures[key]
    title, alt, caption = (fill(one, {}, values) for one in (text.title, text.alt, text.caption))
    fig.axes[0].set_title(title)
    return fig, name, alt, caption


def _of_filters(
    fig: Figure, key: str, what: str, first: SensorTrack, drawn: Mapping[str, str], **values: str
) -> Shown:
    """A figure of one target by one sensor, with a number of each filter; titles have no room for many."""
    brief = [f"{short_words(name)} {value}" for name, value in drawn.items()]
    values |= {
        "of": f"{first.target} by {first.sensor}",
        "brief": " · ".join(brief[:3]) + (" …" if len(brief) > 3 else ""),
        "each": "; ".join(f"{filter_words(name)} {value}" for name, value in drawn.items()),
    }
    return captioned(fig, "tracking", key, slug(what, first.sensor, first.target), **values)


def _tint(name: str) -> str:
    return colour(name.removesuffix(SMOOTHED))


def _rows_of(tracks: Sequence[SensorTrack], rows: pd.DataFrame) -> pd.DataFrame:
    """What is known of these tracks, by filter."""
    mine = (rows["sensor"] == tracks[0].sensor) & (rows["target"] == tracks[0].target)
    return rows[mine].set_index("filter")


def _lines(one: SensorTrack, values: Array) -> tuple[Array, Array]:
    """Times and values (K,) of the looks that have one, thinned; NaN between one track and the next."""
    rows = np.flatnonzero(np.isfinite(values))
    rows = rows[thinned(len(rows))]
    new = np.flatnonzero(np.diff(np.searchsorted(one.starts, rows, side="right"))) + 1
    return np.insert(one.times[rows], new, np.nan), np.insert(values[rows], new, np.nan)


#: Tracks that have a colour and a name of their own in a map: the longest.
MOST_NAMED = 6
#: Letters of a target's name in a chart.
LONGEST_NAME = 14
#: Looks farther apart than so many usual ones are no line.
LONG_PAUSE = 8.0


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


def short_name(name: object) -> str:
    """A target's name as far as there is room for it."""
    text = str(name)
    return text if len(text) <= LONGEST_NAME else f"{text[: LONGEST_NAME - 1]}…"


def colours_of(followed: ManyTracks) -> dict[object, str]:
    """By identity: the longest tracks have a colour of their own in every chart, the others that of ink."""
    names = list(ways_of(followed))
    own = dict(zip(names, SENSOR_COLOURS[:MOST_NAMED], strict=False))
    return {name: own.get(name, INK) for name in names}


def tracks_shown(followed: ManyTracks) -> Shown:
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
    finish(fig)
    values = {"tracks": len(ways), "targets": len(followed.truth), "most": MOST_NAMED}
    return captioned(fig, "tracking-many", "map", "map", **{key: str(n) for key, n in values.items()})


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
    name_rows(ax, [short_name(name) for name in names])
    finish(fig, "time since the first look (s)")
    values = {"changes": lives.swaps + lives.breaks, "targets": len(names), "most": MOST_NAMED}
    given = {key: str(n) for key, n in values.items()}
    return captioned(fig, "tracking-many", "identities", "identities", **given)


def wrong_shown(followed: ManyTracks, lives: Identities) -> Shown:
    """GOSPA at each look, and how many targets are missed and tracks false."""
    fig, (upper, lower) = new_strips(2, 4.2, 5.8)
    times = _times_of(followed)
    distance, missed, false = (
        np.array([getattr(one, part) for one in lives.gospa]) for part in ("distance", "n_missed", "n_false")
    )
    draw_dots(upper, times, distance, SENSOR_COLOURS[0], alpha=1.0)
    upper.axhline(distance.mean(), color=INK, lw=1.2, ls="--")
    pause = LONG_PAUSE * float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    # Over a pause no line says what nobody looked at.
    draw: dict[str, Any] = {"width": 1.4, "drawstyle": "steps-mid"}
    draw_line(lower, *with_breaks(times, missed, pause), SENSOR_COLOURS[0], "targets missed", **draw)
    draw_line(lower, *with_breaks(times, -false, pause), VERMILLION, "tracks on nothing", **draw)
    most = max(int(missed.max()), int(false.max()), 1)
    lower.set(ylabel="how many", ylim=(-most - 0.5, most + 0.5))
    lower.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    lower.yaxis.set_major_formatter(lambda value, _: f"{abs(value):.0f}")
    mark_gaps(upper, times, pause)
    finish(fig, "time since the first look (s)", "GOSPA (m)")
    values = {
        "mean": f"{distance.mean():.1f}",
        "cutoff": f"{followed.cutoff_m:g}",
        "looks": str(len(times)),
        "missed": str(int((missed > 0).sum())),
        "false": str(int((false > 0).sum())),
    }
    return captioned(fig, "tracking-many", "gospa", "gospa", **values)


def _times_of(followed: ManyTracks) -> Array:
    """(N,) s since the first look, of the looks at which true places are known."""
    times = np.array([scan.time for scan in followed.scans])
    return np.asarray((times - times[0])[known_scans(followed)])
