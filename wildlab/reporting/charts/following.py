"""Charts of a flight's tracks by any sensor: maps, squares and errors over time, gains, and whiteness."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from wildlab.analysis.tracks.scores import is_at_rest, seen_of, whitened
from wildlab.analysis.tracks.single_target import SMOOTHED, SensorTrack
from wildlab.analysis.tracks.tracker import TrackingResult
from wildlab.evaluation.consistency import autocorrelation, chi_square_interval, white_bound
from wildlab.geometry.frames import Array
from wildlab.messages.quantities import length
from wildlab.reporting.charts.drawing import (
    LINES,
    TRUTH,
    Shown,
    draw_dots,
    draw_line,
    draw_platform,
    draw_way,
    finish,
    new_strips,
)
from wildlab.reporting.charts.tracks import innovation_correlations
from wildlab.reporting.figures import (
    INK,
    ORANGE,
    WORDS,
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
#: The filters that know of white noise alone: the others are held against the first that is there.
PLAIN = ("ekf", "kf")
#: Filters that are drawn beside it, each in a strip of its own.
MOST_STRIPS = 4
#: Errors that differ by less than this share of the plain filter's are as large.
ALIKE_SHARE = 0.01


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
    drawn = ", ".join(one.sensor for one in mine)
    alt = f"Map in local metres of the track of {target} by {drawn}, with {filter_words(name)}"
    alt += ", beside its true way." if len(truth) else "."
    finish(fig, f"{target}: {filter_words(name)}")
    return fig, slug("map", target), alt, "Tracks that leave the surroundings are cut off."


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
    title = f"{_of(first)}: mean {what.upper()}, {dof:g} is right\n{_brief(drawn)}"
    finish(fig, title, "time (s)", "NEES of the position" if what == "nees" else "NIS of the detections")
    alt = (
        f"{what.upper()} over time of {_of(first)} on a logarithmic axis with the 95 percent band; means: "
        f"{_each(drawn)}."
    )
    return fig, _name(what, first), alt, f"Means: {_each(drawn)}; {dof:g} is ideal."


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
    title = f"{_of(first)}: root mean square error\n{_brief(drawn)}"
    finish(fig, title, "time (s)", "distance from the truth (m)")
    alt = f"Distance from the truth over time of {_of(first)}; root mean squares: {_each(drawn)}."
    caption = "Dotted: reported standard deviation. Means: over scans in which the target was detected."
    return fig, _name("error", first), alt, caption


def whiteness_shown(tracks: Sequence[SensorTrack], elements: Sequence[str]) -> Shown | None:
    """Autocorrelation of the whitened innovations of one target by one sensor; None of too few."""
    first = tracks[0]
    white = {one.filter: found for one in tracks if len(found := whitened(one)) > LAGS + 2}
    if not white:
        return None
    series = {
        name: np.stack([autocorrelation(column, LAGS) for column in one.T]) for name, one in white.items()
    }
    far = {name: f"{max(r[:, 1], key=abs):+.2f}".replace("-", "−") for name, r in series.items()}
    names = {name: WORDS.get(name, filter_words(name)) for name in series}
    title = f"{_of(first)}: autocorrelation at lag one\n{_brief(far)}"
    axes = tuple(f"element {i + 1}" for i in range(len(elements))) if len(elements) > 1 else (elements[0],)
    fig = innovation_correlations(series, white_bound(max(map(len, white.values()))), names, title, axes)
    alt = (
        f"Autocorrelation of the innovations of {_of(first)} over {LAGS} lags with the band of white noise; "
        f"at lag one: {_each(far)}."
    )
    caption = "Innovations in units of their own standard deviation; grey: where white noise stays with 95 %."
    return fig, _name("whiteness", first), alt, caption


def _of(track: SensorTrack) -> str:
    return f"{track.target} by {track.sensor}"


def _name(what: str, track: SensorTrack) -> str:
    return slug(what, track.sensor, track.target)


def _tint(name: str) -> str:
    return colour(name.removesuffix(SMOOTHED))


def _rows_of(tracks: Sequence[SensorTrack], rows: pd.DataFrame) -> pd.DataFrame:
    """What is known of these tracks, by filter."""
    mine = (rows["sensor"] == tracks[0].sensor) & (rows["target"] == tracks[0].target)
    return rows[mine].set_index("filter")


def _each(values: dict[str, str]) -> str:
    """A value of each filter, in words."""
    return "; ".join(f"{filter_words(name)} {value}" for name, value in values.items())


def _brief(values: dict[str, str]) -> str:
    """The same, no more than fit into a title."""
    brief = [f"{short_words(name)} {value}" for name, value in values.items()]
    return " · ".join(brief[:3]) + (" …" if len(brief) > 3 else "")


def _lines(one: SensorTrack, values: Array) -> tuple[Array, Array]:
    """Times and values (K,) of the looks that have one, thinned; NaN between one track and the next."""
    rows = np.flatnonzero(np.isfinite(values))
    rows = rows[thinned(len(rows))]
    new = np.flatnonzero(np.diff(np.searchsorted(one.starts, rows, side="right"))) + 1
    return np.insert(one.times[rows], new, np.nan), np.insert(values[rows], new, np.nan)


class Beside(NamedTuple):
    """How much nearer to the truth a filter is than the plain one, look by look.

    Attributes
    ----------
    filter
        Its name.
    times, gain
        (N,) seconds and metres, of the looks at which the target is seen and both have an error; below zero
        it is farther off.
    nearer, farther
        Shares of these looks. The rest is as far off, to `ALIKE_SHARE`.
    middle
        Median of ``gain``.
    """

    filter: str
    times: Array
    gain: Array
    nearer: float
    farther: float
    middle: float


def beside_plain(tracks: Sequence[SensorTrack]) -> tuple[str, list[Beside]]:
    """Each filter's errors beside the plain one's.

    Parameters
    ----------
    tracks
        Of one target by one sensor, with one filter each.

    Returns
    -------
    plain : str
        The name of the plain filter; "" where it is not among them.
    others : list of Beside
        In the order of the tracks, of those that share looks with it.
    """
    by_name = {one.filter: one for one in tracks}
    plain = next((name for name in PLAIN if name in by_name), "")
    found: list[Beside] = []
    for one in tracks if plain else ():
        white = by_name[plain]
        _, mine, theirs = np.intersect1d(one.times, white.times, return_indices=True)
        away, other = _off_where_seen(one)[mine], _off_where_seen(white)[theirs]
        both = np.isfinite(away) & np.isfinite(other)
        if one.filter == plain or not both.any():
            continue
        gain, alike = (other - away)[both], ALIKE_SHARE * other[both]
        shares = float((gain > alike).mean()), float((gain < -alike).mean())
        found.append(Beside(one.filter, one.times[mine][both], gain, *shares, float(np.median(gain))))
    return plain, found


def _off_where_seen(one: SensorTrack) -> Array:
    """(N,) distance from the truth, m; NaN at looks at which the target is not seen."""
    return np.where(seen_of(one), np.hypot(*one.error[:, :2].T), np.nan)


def beside_plain_shown(tracks: Sequence[SensorTrack]) -> Shown | None:
    """How much nearer to the truth each filter of a target by a sensor is than the plain one, over time.

    One strip for each, so that no line hides another; None where there is nothing to hold against it.
    """
    first = tracks[0]
    plain, others = beside_plain(tracks)
    if not others:
        return None
    shown = others[:MOST_STRIPS]
    fig, strips = new_strips(len(shown), 1.3 * len(shown) + 2.0, 5.8, sharey=True)
    for ax, one in zip(strips, shown, strict=True):
        keep = thinned(len(one.times))
        draw_dots(ax, one.times[keep], one.gain[keep], _tint(one.filter), size=5, alpha=1.0)
        ax.axhline(0, color=INK, lw=0.8)
        ax.set_ylabel(short_words(one.filter))
    even = _even_up_to(strips[0], np.abs(np.concatenate([one.gain for one in shown])))
    fig.supylabel(f"nearer than {short_words(plain)} by (m)", fontsize=10)
    brief = _brief({one.filter: _percent(one.nearer) for one in shown})
    finish(fig, f"{_of(first)}, looks nearer than {short_words(plain)}:\n{brief}", "time (s)")
    said = "; ".join(
        f"{filter_words(one.filter)} nearer at {_percent(one.nearer)} and farther at {_percent(one.farther)} "
        f"of {len(one.gain)} looks, {_nearer(one.middle)} in the middle"
        for one in others
    )
    alt = (
        f"How much nearer to the truth each filter has {_of(first)} than {filter_words(plain)} where it is "
        f"seen, over time, in a strip for each: {said}."
    )
    caption = (
        f"{said[0].upper()}{said[1:]}. Above zero is nearer, below it farther. Of looks with the target "
        f"seen; errors that differ by less than {100 * ALIKE_SHARE:g} % are neither."
    )
    caption += f" The axis is even up to {even:g} m and logarithmic beyond." if even else ""
    caption += f" Drawn are {len(shown)} of {len(others)}." if len(others) > len(shown) else ""
    return fig, slug("beside", plain, first.sensor, first.target), alt, caption


def _even_up_to(ax: Axes, sizes: Array) -> float:
    """Make an axis logarithmic beyond the returned value, m, where a few large values would press the others
    flat; 0 where they do not."""
    middle, largest = float(np.median(sizes)), float(sizes.max())
    if not 0 < UNEVEN * middle < largest:
        return 0.0
    even = float(10 ** np.round(np.log10(middle)))
    ax.set_yscale("symlog", linthresh=even)
    ax.set_yticks(_ticks(even, largest), minor=False)
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter(Powers())
    return even


def _ticks(even: float, largest: float) -> list[float]:
    """Zero and powers of ten to both sides of it, so far apart that their names do not meet.

    Examples
    --------
    >>> _ticks(1.0, 250.0)
    [-100.0, -10.0, -1.0, 0.0, 1.0, 10.0, 100.0]
    """
    decades = int(np.log10(largest / even))
    step = max(1, -(-decades // 2))
    powers = range(decades, -1 if decades < 4 else 0, -step)
    beyond = sorted(even * 10.0**power for power in powers)
    return [-one for one in beyond[::-1]] + [0.0, *beyond]


def _percent(share: float) -> str:
    """A share; one that is not all, or not none, is not called so.

    Examples
    --------
    >>> _percent(1.0), _percent(0.9991), _percent(0.0004), _percent(0.0)
    ('100 %', 'over 99 %', 'under 1 %', '0 %')
    """
    if 0 < share < 0.005:
        return "under 1 %"
    return "over 99 %" if 0.995 <= share < 1 else f"{100 * share:.0f} %"


def _nearer(metres: float) -> str:
    return f"{length(abs(metres))} {'nearer' if metres > 0 else 'farther'}" if metres else "as far off"
