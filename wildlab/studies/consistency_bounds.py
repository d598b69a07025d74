"""Within which bounds NEES and NIS of a consistent filter lie: H 3.5, example 3.1."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.evaluation.consistency import chi_square_interval, share_inside, simulate_filter_runs
from wildlab.evaluation.intervals import Interval, share_interval
from wildlab.evaluation.shares import FAILS, HOLDS, UNDECIDED
from wildlab.reporting.charts.drawing import Values, draw_lines, finish
from wildlab.reporting.figures import colour, log_band, new_figure

#: What share of a consistent filter's values lies within its 95 % limits.
RIGHT = 0.95
#: An interval of the share that is wider than this decides nothing.
WIDEST = 0.05
#: Measurement noise that each filter believes in, as a share of the true one.
FILTERS = {"honest": 1.0, "overconfident": 0.5}
#: Runs that the third interval averages over.
AVERAGED = 50
_COLOURS = {"honest": colour("kf"), "overconfident": colour("ekf")}


class Squares(NamedTuple):
    """Of both filters.

    Attributes
    ----------
    times
        (steps,) s.
    values
        By filter and then by interval: (runs, steps), for a mean of runs (runs / 50, steps).
    limits
        By interval: what 95 % of a consistent filter's values lie in.
    """

    times: NDArray[np.float64]
    values: Mapping[str, Mapping[str, NDArray[np.float64]]]
    limits: Mapping[str, tuple[float, float]]


def simulate_squares(seed: int, runs: int, steps: int) -> Squares:
    """Simulate runs of both filters on the same noise."""
    limits = {
        "nees-1-run": chi_square_interval(4),
        "nis-1-run": chi_square_interval(2),
        "nis-50-runs": chi_square_interval(2, runs=AVERAGED),
    }
    values = {}
    for name, claimed in FILTERS.items():
        found = simulate_filter_runs(
            np.random.default_rng(seed), runs=runs, steps=steps, claimed_noise=claimed
        )
        whole = runs // AVERAGED * AVERAGED
        mean = found.nis[:whole].reshape(-1, AVERAGED, steps).mean(axis=1)
        values[name] = {"nees-1-run": found.nees, "nis-1-run": found.nis, "nis-50-runs": mean}
    return Squares(found.time_s, values, limits)


def metrics_of(squares: Squares) -> list[tuple[str, str, float, int | None]]:
    """Name, subject, value and count of what is recorded: limits, and shares of values within them."""
    found: list[tuple[str, str, float, int | None]] = []
    for subject, (low, high) in squares.limits.items():
        found += [("interval_low", subject, low, None), ("interval_high", subject, high, None)]
        for who, values in squares.values.items():
            share = share_inside(values[subject], squares.limits[subject])
            found.append(("share_inside", f"{who}/{subject}", share, values[subject].size))
    return found


def decide(inside: ArrayLike) -> tuple[str, Interval]:
    """Whether 95 % of independent values lie within their limits.

    Parameters
    ----------
    inside
        (runs,) bool, one value of each run: neighbouring steps of a run share their error.

    Returns
    -------
    tuple
        The verdict: "holds" where the interval of the share has 95 % in it and is narrow enough to say so,
        "undecided" where it is not, else "does not hold"; and the interval.
    """
    values = np.asarray(inside, bool)
    found = share_interval(int(values.sum()), len(values))
    if not found.low <= RIGHT <= found.high:
        return FAILS, found
    return (HOLDS if found.high - found.low <= WIDEST else UNDECIDED), found


def decide_last(squares: Squares) -> dict[str, tuple[str, Interval, int]]:
    """By interval the verdict, the share and its count, of the honest filter's last value of each run."""
    found = {}
    for subject, (low, high) in squares.limits.items():
        last = squares.values["honest"][subject][:, -1]
        found[subject] = (*decide((last >= low) & (last <= high)), len(last))
    return found


def shares_table(squares: Squares, verdicts: Mapping[str, str], names: Mapping[str, str]) -> pd.DataFrame:
    """Per cent of both filters' values within each interval, and the verdict on the honest one."""
    shares = {
        who: [100 * share_inside(values[subject], limit) for subject, limit in squares.limits.items()]
        for who, values in squares.values.items()
    }
    rows = {"quantity": [names[subject] for subject in squares.limits], **shares}
    return pd.DataFrame(rows | {"verdict": [verdicts[subject] for subject in squares.limits]})


def one_run(squares: Squares, subject: str, label: str, ylim: tuple[float, float]) -> Figure:
    """The first row of values of both filters over time, with their limits."""
    fig, ax = new_figure(5.6, 3.8)
    lines = {
        who: Values(of[subject][0], color=_COLOURS[who], look=".-") for who, of in squares.values.items()
    }
    draw_lines(ax, squares.times, lines)
    log_band(ax, *squares.limits[subject])
    ax.set_ylim(ylim)
    return finish(fig, "time (s)", label)
