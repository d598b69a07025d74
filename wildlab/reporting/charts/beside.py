"""How much nearer to the truth each filter of a target is than the plain one, look by look."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.ticker import NullLocator

from wildlab.analysis.following.filters import SMOOTHED
from wildlab.analysis.following.judged import seen_of
from wildlab.analysis.following.sensor_tracks import SensorTrack
from wildlab.geometry.frames import Array
from wildlab.reporting.charts.following import UNEVEN, Shown, few, slug
from wildlab.reporting.figure_text import Powers
from wildlab.reporting.figures import INK, colour, new_figure, thinned
from wildlab.reporting.filter_names import filter_words, short_words
from wildlab.reporting.quantities import length

#: The filters that know of white noise alone: the others are held against the first that is there.
PLAIN = ("ekf", "kf")
#: Filters that are drawn beside it, each in a strip of its own.
MOST_STRIPS = 4
#: Errors that differ by less than this share of the plain filter's are as large.
ALIKE_SHARE = 0.01


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
    if not plain:
        return "", found
    white = by_name[plain]
    off = _off_where_seen(white)
    for one in tracks:
        if one.filter == plain:
            continue
        _, mine, theirs = np.intersect1d(one.times, white.times, return_indices=True)
        away, other = _off_where_seen(one)[mine], off[theirs]
        both = np.isfinite(away) & np.isfinite(other)
        if not both.any():
            continue
        gain, alike = (other - away)[both], ALIKE_SHARE * other[both]
        found.append(
            Beside(
                one.filter,
                one.times[mine][both],
                gain,
                float((gain > alike).mean()),
                float((gain < -alike).mean()),
                float(np.median(gain)),
            )
        )
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
    fig, strips = new_figure(
        5.8, 1.3 * len(shown) + 2.0, rows=len(shown), sharex=True, sharey=True, squeeze=False
    )
    for ax, one in zip(strips[:, 0], shown, strict=True):
        tint, keep = colour(one.filter.removesuffix(SMOOTHED)), thinned(len(one.times))
        ax.plot(one.times[keep], one.gain[keep], ".", color=tint, ms=5, mec="none")
        ax.axhline(0, color=INK, lw=0.8)
        ax.set_ylabel(short_words(one.filter))
    sizes = np.abs(np.concatenate([one.gain for one in shown]))
    middle, largest = float(np.median(sizes)), float(sizes.max())
    uneven = middle > 0 and largest > UNEVEN * middle
    even = float(10 ** np.round(np.log10(middle))) if uneven else 0.0
    if uneven:
        ax = strips[0, 0]
        ax.set_yscale("symlog", linthresh=even)
        ax.set_yticks(_ticks(even, largest), minor=False)
        ax.yaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_formatter(Powers())
    fig.supylabel(f"nearer than {short_words(plain)} by (m)", fontsize=10)
    strips[-1, 0].set_xlabel("time (s)")
    brief = [f"{short_words(one.filter)} {_percent(one.nearer)}" for one in shown]
    strips[0, 0].set_title(
        f"{first.target} by {first.sensor}, looks nearer than {short_words(plain)}:\n{few(brief)}"
    )
    said = "; ".join(
        f"{filter_words(one.filter)} nearer at {_percent(one.nearer)} and farther at {_percent(one.farther)} "
        f"of {len(one.gain)} looks, {_nearer(one.middle)} in the middle"
        for one in others
    )
    alt = (
        f"How much nearer to the truth each filter has {first.target} by {first.sensor} than "
        f"{filter_words(plain)} where it is seen, over time, in a strip for each: {said}."
    )
    caption = (
        f"{said[0].upper()}{said[1:]}. Above zero is nearer, below it farther. Of looks with the target "
        f"seen; errors that differ by less than {100 * ALIKE_SHARE:g} % are neither."
    )
    if uneven:
        caption += f" The axis is even up to {even:g} m and logarithmic beyond."
    if len(others) > len(shown):
        caption += f" Drawn are {len(shown)} of {len(others)}."
    return fig, slug("beside", plain, first.sensor, first.target), alt, caption


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
