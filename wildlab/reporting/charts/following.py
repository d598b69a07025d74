"""Charts of a flight's tracks by any sensor: maps, squares of errors over time, and whiteness."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.following.filters import SMOOTHED
from wildlab.analysis.following.follow import TrackingResult
from wildlab.analysis.following.judged import whitened
from wildlab.analysis.following.sensor_tracks import SensorTrack
from wildlab.evaluation.consistency import chi_square_interval
from wildlab.evaluation.whiteness import autocorrelation, white_bound
from wildlab.geometry.frames import Array
from wildlab.names import figure_name
from wildlab.reporting.charts.tracks import innovation_correlations
from wildlab.reporting.figure_text import Powers
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    colour,
    log_band,
    map_axes,
    mark_gaps,
    new_figure,
    thinned,
)
from wildlab.reporting.filter_names import WORDS, filter_words, short_words
from wildlab.reporting.quantities import length

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]

SENSOR_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
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
    for words, way in platforms.items():
        if np.ptp(way, axis=0).max() > 0:
            ax.plot(way[:, 1], way[:, 0], color=GREY, lw=1.4, label=figure_name(words))
        else:
            ax.plot(way[:1, 1], way[:1, 0], "^", color=GREY, ms=8, label=figure_name(words))
    shown = [truth] if len(truth) else []
    for one, tint in zip(mine, SENSOR_COLOURS * len(mine), strict=False):
        x = one.estimate[np.isfinite(one.estimate[:, 0])][:, :2]
        if len(x):
            ax.plot(one.estimate[:, 1], one.estimate[:, 0], color=tint, lw=1.6, label=figure_name(one.sensor))
            shown.append(_middle(x))
    if len(truth):
        ax.plot(truth[:, 1], truth[:, 0], color="black", lw=1.2, ls=(0, (4, 2)), label="truth")
    if shown:
        every = np.concatenate([*shown, *platforms.values()])
        for limit, column in ((ax.set_ylim, 0), (ax.set_xlim, 1)):
            low, high = float(np.nanmin(every[:, column])), float(np.nanmax(every[:, column]))
            margin = MARGIN * max(high - low, 10.0)
            limit(low - margin, high + margin)
    drawn = ", ".join(one.sensor for one in mine)
    ax.set_title(f"{target}: {filter_words(name)}")
    fig.legend(loc="outside lower center", ncols=3)
    map_axes(ax)
    alt = f"Map in local metres of the track of {target} by {drawn}, with {filter_words(name)}"
    alt += ", beside its true way." if len(truth) else "."
    return fig, slug("map", target), alt, "Tracks that leave the surroundings are cut off."


def _middle(x: Array) -> Array:
    """Without the ends that stray."""
    low, high = np.quantile(x, 0.02, axis=0), np.quantile(x, 0.98, axis=0)
    return x[((x >= low) & (x <= high)).all(axis=1)] if len(x) > 50 else x


def squares_shown(tracks: Sequence[SensorTrack], rows: pd.DataFrame, what: str) -> Shown:
    """NEES (``"nees"``) or NIS of one target by one sensor over time, by filter, with the band."""
    first = tracks[0]
    dof = 2.0 if what == "nees" else first.dof
    fig, ax = new_figure(5.8, 3.8)
    lowest = highest = float(dof)
    said, brief = [], []
    mine = rows[(rows["sensor"] == first.sensor) & (rows["target"] == first.target)].set_index("filter")
    for one in tracks:
        values = one.nees if what == "nees" else one.nis
        there = np.isfinite(values)
        if not there.any():
            continue
        t, y = _lines(one, values)
        y = np.maximum(y, 1e-4)
        look = {
            "color": colour(one.filter.removesuffix(SMOOTHED)),
            "label": figure_name(filter_words(one.filter)),
        }
        dashes = "--" if one.filter.endswith(SMOOTHED) else "-"
        if what == "nees":
            ax.plot(t, y, lw=1.4, ls=dashes, **look)
        else:
            ax.plot(t, y, ".", ms=3.5, alpha=0.6, mec="none", **look)
        highest, lowest = max(highest, float(np.nanmax(y))), min(lowest, float(np.nanmin(y)))
        said.append(f"{filter_words(one.filter)} {mine.loc[one.filter, what]:.2f}")
        brief.append(f"{short_words(one.filter)} {mine.loc[one.filter, what]:.2f}")
    low, high = chi_square_interval(dof)
    log_band(ax, low, high)
    ax.set_ylim(max(lowest / 2, low / 30), 3 * highest)
    used = first.times[np.isfinite(first.nis)]
    if len(used) > 2:
        mark_gaps(ax, used, max(PAUSE * float(np.median(np.diff(used))), 1.0))
    ax.set(xlabel="time (s)", ylabel="NEES of the position" if what == "nees" else "NIS of the detections")
    ax.set_title(f"{first.target} by {first.sensor}: mean {what.upper()}, {dof:g} is right\n" + few(brief))
    fig.legend(loc="outside lower center", ncols=2, markerscale=3)
    words = "; ".join(said)
    alt = (
        f"{what.upper()} over time of {first.target} by {first.sensor} on a logarithmic axis with the 95 "
        f"percent band; means: {words}."
    )
    return fig, slug(what, first.sensor, first.target), alt, f"Means: {words}; {dof:g} is ideal."


def _lines(one: SensorTrack, values: Array) -> tuple[Array, Array]:
    """Times and values (K,) of the looks that have one, thinned; NaN between one track and the next."""
    rows = np.flatnonzero(np.isfinite(values))
    rows = rows[thinned(len(rows))]
    new = np.flatnonzero(np.diff(np.searchsorted(one.starts, rows, side="right"))) + 1
    return np.insert(one.times[rows], new, np.nan), np.insert(values[rows], new, np.nan)


def few(brief: Sequence[str]) -> str:
    """No more than fit into a title."""
    return " · ".join(brief[:3]) + (" …" if len(brief) > 3 else "")


def errors_shown(tracks: Sequence[SensorTrack], rows: pd.DataFrame) -> Shown:
    """Distance from the truth over time of one target by one sensor, with what each filter states of it."""
    first = tracks[0]
    mine = rows[(rows["sensor"] == first.sensor) & (rows["target"] == first.target)].set_index("filter")
    fig, ax = new_figure(5.8, 3.6)
    said, brief = [], []
    sizes: list[Array] = []
    for one in tracks:
        away = np.hypot(*one.error[:, :2].T)
        there = np.isfinite(away)
        if not there.any():
            continue
        stated = np.sqrt(np.trace(one.covariance[:, :2, :2], axis1=1, axis2=2))
        tint = colour(one.filter.removesuffix(SMOOTHED))
        ax.plot(*_lines(one, away), color=tint, lw=1.5, label=figure_name(filter_words(one.filter)))
        ax.plot(*_lines(one, np.where(there, stated, np.nan)), color=tint, lw=1.0, ls=":")
        far = length(float(mine["rmse"].to_dict()[one.filter]))
        said.append(f"{filter_words(one.filter)} {far}")
        brief.append(f"{short_words(one.filter)} {far}")
        sizes.append(away[there])
    ax.plot([], [], color=INK, lw=1.0, ls=":", label="what each states of it")
    # One filter that is lost would press all others flat.
    if len(sizes) > 1 and max(map(np.max, sizes)) > UNEVEN * min(map(np.max, sizes)):
        ax.set_yscale("log")
        ax.set_ylim(bottom=max(float(np.quantile(np.concatenate(sizes), 0.01)), 1e-3))
        ax.yaxis.set_major_formatter(Powers())
    else:
        ax.set_ylim(bottom=0)
    ax.set(xlabel="time (s)", ylabel="distance from the truth (m)")
    ax.set_title(f"{first.target} by {first.sensor}: root mean square error\n{few(brief)}")
    fig.legend(loc="outside lower center", ncols=2)
    words = "; ".join(said)
    alt = (
        f"Distance from the truth over time of {first.target} by {first.sensor}; root mean squares: {words}."
    )
    return (
        fig,
        slug("error", first.sensor, first.target),
        alt,
        "Dotted: the standard deviation stated. Means: of looks with the target seen.",
    )


def whiteness_shown(tracks: Sequence[SensorTrack], elements: Sequence[str]) -> Shown | None:
    """Autocorrelation of the whitened innovations of one target by one sensor; None of too few."""
    first = tracks[0]
    series: dict[str, Array] = {}
    n = 0
    for one in tracks:
        white = whitened(one)
        if len(white) > LAGS + 2:
            series[one.filter] = np.stack([autocorrelation(column, LAGS) for column in white.T])
            n = max(n, len(white))
    if not series:
        return None
    far = {name: float(max(r[:, 1], key=abs)) for name, r in series.items()}
    said = [f"{filter_words(name)} {value:+.2f}".replace("-", "−") for name, value in far.items()]
    names = {name: WORDS.get(name, filter_words(name)) for name in series}
    brief = [f"{short_words(name)} {value:+.2f}".replace("-", "−") for name, value in far.items()]
    title = f"{first.target} by {first.sensor}: autocorrelation at lag one\n{few(brief)}"
    axes = tuple(f"element {i + 1}" for i in range(len(elements))) if len(elements) > 1 else (elements[0],)
    fig = innovation_correlations(series, white_bound(n), names, title, axes)
    words = "; ".join(said)
    alt = (
        f"Autocorrelation of the innovations of {first.target} by {first.sensor} over {LAGS} lags with the "
        f"band of white noise; at lag one: {words}."
    )
    caption = "Innovations in units of their own standard deviation; grey: where white noise stays with 95 %."
    return fig, slug("whiteness", first.sensor, first.target), alt, caption
