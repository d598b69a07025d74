"""What the report on a flight's tracks says of those that ended and of what started in their place."""

from __future__ import annotations

import numpy as np
import pandas as pd

from wildlab.analysis.following.follow import TrackingResult
from wildlab.analysis.following.noise_model import LONGEST_GAP_LOOKS, LONGEST_GAP_S
from wildlab.reporting.report import Report

#: So many times of new starts are listed; the rest is counted.
MOST_TIMES = 8

METHOD = (
    "A track ends when it is too uncertain for a linearisation: when it was without a detection for more "
    f"than {LONGEST_GAP_S:g} s and {LONGEST_GAP_LOOKS:g} looks, and the second-order part of what the sensor "
    "should see, over the region where the target may be and in the geometry in which it was last seen, is "
    "larger than all that a detection may be wrong by, noise and considered errors together. For a camera "
    "whose axis is off the plumb line by an angle a, that is a standard deviation of the position of about "
    "the distance times the square root of the noise in pixels over f sin(a), f being the focal length in "
    "pixels; straight down over level ground nothing is bent. Where the look that sees the target again is "
    "from nearer or flatter, its geometry counts too. The next detection starts a new track, in the same way "
    "as the first, H 3.4. The filter with white noise decides this for all filters. Positions are not bent, "
    "and one bearing says no place to start on: tracks by these alone do not end so."
)


def summary_sentences(rows: pd.DataFrame) -> list[str]:
    """How often tracks started anew, and over how many looks there was none; nothing where none did."""
    if "anew" not in rows:
        return []
    mine = _pairs(rows)
    again = mine[mine["anew"] > 0]
    if not len(again):
        return []
    times = int(again["anew"].sum())
    some = f"All {len(mine)}" if len(again) == len(mine) else f"{len(again)} of the {len(mine)}"
    who, it = ("The track", "it") if len(mine) == 1 else (f"{some} tracks", "they")
    often = "once" if times == 1 else f"{times} times" + (" in all" if len(again) > 1 else "")
    gone, looks, seen = (int(mine[name].sum()) for name in ("gone", "spanned", "gone_seen"))
    return [
        f"{who} became too uncertain to take a detection, and {it} ended and started anew {often}. From the "
        f"first start to the last end {gone} of {looks} looks have no track and count in no error; the "
        f"target is in sight at {seen if seen else 'none'} of them."
    ]


def anew_table(followed: TrackingResult, rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each target and sensor whose track ended and started anew."""
    found = []
    for _, row in _pairs(rows).iterrows():
        if not row["anew"]:
            continue
        key = (row["sensor"], row["target"])
        one = next(one for one in followed.tracks if (one.sensor, one.target) == key)
        times = [f"{t:.0f}" for t in one.times[one.starts[1:]]]
        more = len(times) - MOST_TIMES
        found.append(
            {
                "track": f"{row['target']}, {row['sensor']}",
                "anew": row["anew"],
                "when": ", ".join(times[:MOST_TIMES]) + (f" and {more} more" if more > 0 else ""),
                "gone": f"{row['gone']} of {row['spanned']}",
                "seen": row["gone_seen"],
                "ended": _longest(one.times, one.without),
            }
        )
    return pd.DataFrame(found)


HEADINGS = {
    "track": "target, sensor",
    "anew": "started anew",
    "when": "at (s)",
    "gone": "looks without a track",
    "seen": "of them in sight",
    "ended": "longest without (s)",
}


def record(report: Report, rows: pd.DataFrame) -> None:
    """How often each track started anew and over how many looks there was none, for ``metrics.json``."""
    for _, row in rows[rows["spanned"] > 0].iterrows():
        subject = f"{row['sensor']}/{row['target']}/{row['filter']}".replace(" ", "-")
        report.metric("started_anew", subject, int(row["anew"]), "1")
        report.metric("looks_without_track", subject, int(row["gone"]), "1", n=int(row["spanned"]))


def _pairs(rows: pd.DataFrame) -> pd.DataFrame:
    """One row for each sensor and target: all filters of both start alike."""
    return rows.drop_duplicates(["sensor", "target"])


def _longest(times: np.ndarray, without: np.ndarray) -> float:
    """The longest time without a track, s."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], without, [False]]).astype(int)))
    if not len(edges):
        return 0.0
    begins, ends = edges[::2], np.minimum(edges[1::2], len(times) - 1)
    return float((times[ends] - times[begins]).max())
