"""How far to believe tracks: errors and NEES by the truth, NIS and whiteness, two sensors side by side; and
estimates as a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.tracks.scans import Scans
from wildlab.analysis.tracks.single_target import SMOOTHED, STATE, TOGETHER, SensorTrack
from wildlab.analysis.tracks.tracker import TrackingResult
from wildlab.errors import WildlabError
from wildlab.evaluation.consistency import (
    Average,
    autocorrelation,
    average,
    chi_square_interval,
    effective_sample_size,
    nees,
    share_inside,
    whiten,
)
from wildlab.evaluation.errors import summarise_track, track_errors
from wildlab.evaluation.intervals import share_interval
from wildlab.files import write_csv
from wildlab.flight.checks.check import FEWEST_SCANS
from wildlab.geometry.frames import Array

#: Fewer independent values than this, estimated from the values themselves, make an interval too narrow.
FEW_INDEPENDENT = 30.0
#: Of fewer independent values than this nothing is judged: nearly any filter would pass.
FEWEST = 5
#: The metric whose subject is the filter that a page speaks of.
LEADING = "leading_filter"
CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN = "consistent", "overconfident", "too cautious", "not judged"


def verdict(mean: Average) -> str:
    """Whether a filter is consistent, by the 95 % band of its mean NEES or NIS; few scans are not judged."""
    if mean.n < FEWEST_SCANS:
        return UNKNOWN
    return CONSISTENT if mean.inside else OVERCONFIDENT if mean.mean > mean.high else CAUTIOUS


def worth(values: Array) -> float:
    """How many independent values a series with NaN is worth."""
    known = values[np.isfinite(values)]
    return effective_sample_size(known, len(known) - 1) if len(known) > 3 else float(len(known))


def mean_of(values: Array, dof: float) -> Average:
    """The mean with the band for as many independent values as there are."""
    return average(values, dof, worth(values))


def worth_of_errors(errors: Array, covariances: Array) -> float:
    """How many independent errors (N, 2) with their covariances there are.

    Of errors in units of their own standard deviation, about zero and not about their mean: an error that is
    the same throughout is one, however steady its square is.
    """
    white = whiten(errors, covariances)
    white = white[np.isfinite(white).all(axis=1)]
    n = len(white)
    if n < 4:
        return float(n)
    padded = np.fft.rfft(white, 2 * n, axis=0)
    products = np.fft.irfft(np.abs(padded) ** 2, axis=0)[:n].sum(axis=1)
    r = products[1:] / products[0] * n / (n - np.arange(1, n))
    stop = np.flatnonzero(r[: n // 2] <= 0)
    r = r[: stop[0]] if len(stop) else r[: n // 2]
    # Of squares, whose correlation is the square of that of the errors.
    return float(max(1.0, n / (1 + 2 * float(np.sum(r**2)))))


def score_tracks(followed: TrackingResult) -> pd.DataFrame:
    """One row for each track.

    ``sensor``, ``kind``, ``target``, ``filter``; ``detections`` used after the start, and ``used`` with it;
    ``rmse`` and ``mae`` beside the truth, of ``compared`` scans at which the target was seen, and
    ``rmse_without`` of the ``without`` others; of those seen: ``nees`` with ``nees_low``, ``nees_high`` and
    ``nees_worth`` independent values, its ``verdict``; ``inside``, the share of scans in the band of single
    values, with ``inside_low``, ``inside_high``; the same of ``nis``, its degrees of freedom ``dof`` and
    ``nis_verdict``; ``lag1``: the largest autocorrelation of an element of the whitened innovations from one
    detection to the next; ``followed``: the share of scans with truth that have a track; ``restarts``: how
    often a track ended and another started, and ``untracked``: scans without a track, of ``spanned`` from the
    first start to the end of the last, ``untracked_in_view`` of them with the target in sight.
    """
    return pd.DataFrame([score_track(one, kind_of(followed, one.sensor)) for one in followed.tracks])


def leading_filter(rows: pd.DataFrame) -> str:
    """The filter that is spoken of: of those with most consistent tracks the one of least error.

    Parameters
    ----------
    rows
        From `score_tracks`. Without truth NIS takes the place of errors and of
        NEES; smoothed tracks, and those of all sensors together where there are others, do not count.

    Returns
    -------
    str
    """
    alone = rows[~rows["filter"].str.endswith(SMOOTHED)]
    alone = alone if (alone["kind"] == TOGETHER).all() else alone[alone["kind"] != TOGETHER]
    truth = bool((alone["compared"] > 0).any())
    ratio = (alone["nis"] / alone["dof"]).where(alone["nis"] > 0)
    off = alone["rmse"] if truth else pd.Series(np.abs(np.log(ratio)), alone.index)
    # Beside the best filter on the same target: filters need not have the same tracks.
    least = off.groupby([alone["sensor"], alone["target"]]).transform("min")
    of = alone["filter"]
    consistent = (alone["verdict" if truth else "nis_verdict"] == CONSISTENT).groupby(of).sum()
    worse = (off - least if not truth else off / least).groupby(of).median().fillna(np.inf)

    def order(name: str) -> tuple[int, bool, float, bool]:
        # Innovations do not show an error that lasts: without truth the white filter comes after its equals.
        white = name == "ekf"
        return -consistent[name], white and not truth and consistent[name] > 0, worse[name], white

    return str(min(dict.fromkeys(of), key=order))


def kind_of(followed: TrackingResult, sensor: str) -> str:
    """What a sensor detects; several at once are ``together``."""
    return followed.scans[sensor].kind if sensor in followed.scans else TOGETHER


def score_track(one: SensorTrack, kind: str) -> dict[str, object]:
    """A row of `score_tracks`, of a track by a sensor that detects what the kind says."""
    seen, used = seen_of(one), used_of(one)
    summary = summarise_track(track_errors((one.estimate + one.error)[seen], one.estimate[seen]))
    away = np.hypot(*one.error[~seen, :2].T)
    away = away[np.isfinite(away)]
    m, squares = one.dof, one.nees[seen]
    of_nees, of_nis = mean_of(squares, 2), mean_of(one.nis, m)
    if of_nees.n:
        independent = worth_of_errors(one.error[seen, :2], one.covariance[seen, :2, :2])
        of_nees = average(squares, 2, min(of_nees.worth, independent))
    inside = share_inside(squares, chi_square_interval(2))
    band = (np.nan, np.nan)
    if of_nees.n and of_nees.worth >= 1:
        band = share_interval(inside * of_nees.worth, of_nees.worth)[1:]
    white = whitened(one)
    lags = [float(autocorrelation(column, 1)[1]) for column in white.T] if len(white) > 3 else []
    return {
        "sensor": one.sensor,
        "kind": kind,
        "target": one.target,
        "filter": one.filter,
        "detections": int(np.isfinite(one.nis).sum()),
        "used": int(used.sum()),
        "restarts": max(len(one.starts) - 1, 0),
        "untracked": int(one.without.sum()),
        "spanned": int(one.last - one.starts[0]) if len(one.starts) else 0,
        "untracked_in_view": int((one.without & seen).sum()),
        "compared": of_nees.n,
        "rmse": summary.rmse,
        "without": len(away),
        "rmse_without": float(np.sqrt(np.mean(away**2))) if len(away) else np.nan,
        "mae": summary.mae,
        "nees": of_nees.mean,
        "nees_low": of_nees.low,
        "nees_high": of_nees.high,
        "nees_worth": of_nees.worth,
        "verdict": verdict(of_nees) if used.sum() >= FEWEST_SCANS else UNKNOWN,
        "inside": inside,
        "inside_low": band[0],
        "inside_high": band[1],
        "nis": of_nis.mean,
        "nis_low": of_nis.low,
        "nis_high": of_nis.high,
        "nis_worth": of_nis.worth,
        "nis_verdict": verdict(of_nis),
        "dof": m,
        "lag1": max(lags, key=abs, default=np.nan),
        "followed": float(np.isfinite(one.error[:, 0]).sum() / one.known.sum())
        if one.known.any()
        else np.nan,
    }


def used_of(one: SensorTrack) -> NDArray[np.bool_]:
    """(N,) scans whose detection a track took, that of its start among them."""
    return np.isfinite(one.nis) | (one.detection != "" if len(one.detection) else False)


def seen_of(one: SensorTrack) -> NDArray[np.bool_]:
    """(N,) scans at which the target was seen, whether or not its track took the detection."""
    return one.near | used_of(one)


def whitened(one: SensorTrack) -> Array:
    """(K, m) innovations of the detections used, each in units of its own standard deviation."""
    used = np.isfinite(one.nis)
    if len(one.sizes):
        return np.empty((0, 0))  # scans of several sensors have no elements in common
    return np.asarray(whiten(one.innovation[used], one.S[used])) if used.any() else one.innovation[used]


class SensorPair(NamedTuple):
    """Two sensors' tracks of one target by one filter: how far apart, and how far they say they may be.

    ``rms`` m over ``n`` scans; ``squares``: the mean of the squared distance in units of both covariances,
    two where both are right and their errors have nothing to do with each other.
    """

    target: str
    filter: str
    one: str
    other: str
    rms: float
    n: int
    squares: Average


def compare_sensors(followed: TrackingResult) -> list[SensorPair]:
    """Every two sensors that follow the same target by the same filter, at the scans of the first."""
    found = []
    groups: dict[tuple[str, str], list[SensorTrack]] = {}
    for track in followed.tracks:
        groups.setdefault((track.target, track.filter), []).append(track)
    for (target, name), tracks in groups.items():
        # Smoothed ones lean on the motion that both assume, twice: their distance proves little.
        apart_from = [one for one in tracks if one.sensor in followed.scans and not name.endswith(SMOOTHED)]
        for a, b in combinations(apart_from, 2):
            x, P = _between(b, a.times, 0.0 if is_at_rest(b) else followed.targets.density)
            gap = a.estimate[:, :2] - x
            both = np.isfinite(gap).all(axis=1)
            if not both.any():
                continue
            squares = np.full(len(gap), np.nan)
            squares[both] = nees(gap[both], (a.covariance[:, :2, :2] + P)[both])
            rms = float(np.sqrt(np.mean(np.sum(gap[both] ** 2, axis=1))))
            found.append(
                SensorPair(target, name, a.sensor, b.sensor, rms, int(both.sum()), mean_of(squares, 2))
            )
    return found


def is_at_rest(one: SensorTrack) -> bool:
    """Whether a track is of a target that never moves: it has no velocity to be uncertain of."""
    velocity = one.covariance[np.isfinite(one.estimate[:, 0]), 2:4, 2:4]
    return len(velocity) > 0 and not velocity.any()


def _between(one: SensorTrack, times: Array, density: float) -> tuple[Array, Array]:
    """Position (N, 2) and its covariance at other times: carried on from the scan before, and the
    less certain the longer, as the filters believe."""
    row = np.searchsorted(one.times, times, side="right") - 1
    there = row >= 0
    row = np.maximum(row, 0)
    dt = (times - one.times[row])[:, None]
    x = one.estimate[row, :2] + dt * one.estimate[row, 2:4]
    F = np.tile(np.eye(2, 4), (len(times), 1, 1))
    F[:, 0, 2] = F[:, 1, 3] = dt[:, 0]
    P = F @ one.covariance[row] @ np.swapaxes(F, 1, 2)
    P[:, :2, :2] += (density**2 * np.maximum(dt[:, 0], 0.0) ** 3 / 3)[:, None, None] * np.eye(2)
    ended = ~there | (times > one.times[-1])
    x[ended] = np.nan
    return x, P


#: Units of the elements of a measurement, as names of columns have them.
UNITS = {
    "north": "m", "east": "m", "range": "m", "azimuth": "rad", "elevation": "rad", "u": "px", "v": "px",
    "v_north": "m_s", "v_east": "m_s",
}  # fmt: skip
#: Columns that a table of tracks must have for its tracks to be shown.
COLUMNS = (
    "target", "filter", "sensor", "time_s", "north_m", "east_m", "p_00", "p_01", "p_11",
    "error_north_m", "error_east_m", "nees",
)  # fmt: skip


def estimates_table(tracks: Sequence[SensorTrack], scans: dict[str, Scans]) -> pd.DataFrame:
    """Every scan at which a track was under way.

    Parameters
    ----------
    tracks
        From `wildlab.analysis.tracks.tracker.track`.
    scans
        Likewise, by sensor.

    Returns
    -------
    DataFrame
        ``sensor``, ``target``, ``filter``, ``time_s``; ``track``, which of the target's tracks it is, from 1:
        between two there is none; the state, metres and m/s in n; ``p_ij`` its
        covariance, the upper triangle; ``detection`` that was used, "" none; ``innovation_...`` in the unit
        of each element, ``s_ij`` their covariance, in the order of the elements; ``nis``; and
        ``error_north_m``, ``error_east_m`` (truth minus estimate) and ``nees`` where the truth is known.
    """
    return pd.concat([_of(one, scans) for one in tracks], ignore_index=True)


def _of(one: SensorTrack, scans: dict[str, Scans]) -> pd.DataFrame:
    rows = np.isfinite(one.estimate).all(axis=1)
    n = int(rows.sum())
    columns: dict[str, object] = {
        "sensor": np.full(n, one.sensor, object),
        "target": np.full(n, one.target, object),
        "filter": np.full(n, one.filter, object),
        "time_s": one.times[rows],
        "track": np.maximum(np.searchsorted(one.starts, np.flatnonzero(rows), side="right"), 1),
    }
    columns |= dict(zip(STATE, one.estimate[rows].T, strict=True))
    for i in range(4):
        columns |= {f"p_{i}{j}": one.covariance[rows, i, j] for j in range(i, 4)}
    columns["detection"] = one.detection[rows]
    if one.sensor not in scans:  # of several sensors: each scan has the elements of its own
        names = tuple(str(i) for i in range(one.innovation.shape[1]))
        columns |= {f"innovation_{name}": one.innovation[rows, i] for i, name in enumerate(names)}
    else:
        names = ("north", "east") if one.filter == "coloured" else scans[one.sensor].elements
        for i, name in enumerate(names):
            columns[f"innovation_{name}_{UNITS[name]}"] = one.innovation[rows, i]
    for i in range(len(names)):
        columns |= {f"s_{i}{j}": one.S[rows, i, j] for j in range(i, len(names))}
    columns["nis"] = one.nis[rows]
    columns |= dict(zip(("error_north_m", "error_east_m"), one.error[rows, :2].T, strict=True))
    columns["nees"] = one.nees[rows]
    return pd.DataFrame(columns)


def write_estimates(table: pd.DataFrame, folder: Path) -> None:
    """Write ``estimates.parquet`` and ``estimates.csv`` into a folder; metres, no place on Earth."""
    table.to_parquet(folder / "estimates.parquet", index=False)
    write_csv(folder / "estimates.csv", table, "%.9g")


def read_estimates(path: Path) -> pd.DataFrame:
    """A table that `write_estimates` wrote.

    Raises
    ------
    WildlabError
        Where it cannot be read, or lacks one of `COLUMNS`, or has words where numbers belong.
    """
    again = "make the table again: wildlab track"
    try:
        table = pd.read_parquet(path)
        lacking = [name for name in COLUMNS if name not in table]
        if not lacking:
            table = table.astype(dict.fromkeys(COLUMNS[3:], float))
    except Exception as error:  # whatever a damaged file gives
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise WildlabError(f"is not a readable table of tracks ({first})", again, file=path) from None
    if lacking:
        raise WildlabError("this column is missing", again, file=path, field=lacking[0])
    return table
