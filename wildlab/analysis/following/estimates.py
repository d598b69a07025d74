"""Estimates as a table: one row for each look, target and filter, with covariances and innovations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from wildlab.analysis.following.sensor_tracks import SensorTrack
from wildlab.analysis.scans import Scans
from wildlab.errors import WildlabError
from wildlab.files import write_csv

STATE = ("north_m", "east_m", "v_north_m_s", "v_east_m_s")
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
    """Every look at which a track was under way.

    Parameters
    ----------
    tracks
        From `wildlab.analysis.following.follow.follow_targets`.
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
    if one.sensor not in scans:  # of several sensors: each look has the elements of its own
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
        numbers = list(COLUMNS[3:])
        table[numbers] = table[numbers].astype(float)
    except KeyError:
        lacking = next(name for name in COLUMNS if name not in table)
        raise WildlabError("this column is missing", again, file=path, field=lacking) from None
    except Exception as error:  # whatever a damaged file gives
        first = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise WildlabError(f"is not a readable table of tracks ({first})", again, file=path) from None
    for name in COLUMNS[:3]:
        if name not in table:
            raise WildlabError("this column is missing", again, file=path, field=name)
    return table
