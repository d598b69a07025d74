"""What the positions that errors are held against are themselves: surveyed marks, or tracks of receivers.

A known position errs too. What it errs by is in every error that is held against it, and no sentence on these
errors may put it down to clicks or the lens alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight


class KnownPositions(NamedTuple):
    """Of how many points the truth is what.

    Attributes
    ----------
    marked, tracked
        Points held against a position that never moves, and against one of a track.
    marks, tracks
        How many of these there are.
    mark_sd_m, track_sd_m
        Median of the stated standard deviations of each horizontal axis, m; NaN where none is stated.
    """

    marked: int
    tracked: int
    marks: int
    tracks: int
    mark_sd_m: float
    track_sd_m: float


#: A simulated flight's truth is exact: nothing is to be said of it.
EXACT = KnownPositions(0, 0, 0, 0, float("nan"), float("nan"))


def known_positions(flight: Flight, scored: pd.DataFrame) -> KnownPositions:
    """What the points of a flight were held against.

    Parameters
    ----------
    flight
        With truth.
    scored
        From `wildlab.analysis.evaluate.score_points`, of it.

    Returns
    -------
    KnownPositions
        `EXACT` for a simulated flight.
    """
    if flight.manifest.kind == "twin":
        return EXACT
    truth = flight.table("truth")
    moving = truth["time_s"].notna().groupby(truth["target_id"]).any()
    used = scored["truth_id"].astype(str)
    tracked = used.isin(moving[moving].index).to_numpy(bool)

    def stated(which: set[str]) -> float:
        if "sd_horizontal_m" not in truth:
            return float("nan")
        sd = truth.loc[truth["target_id"].isin(which), "sd_horizontal_m"].to_numpy(float)
        return float(np.nanmedian(sd)) if np.isfinite(sd).any() else float("nan")

    marks, tracks = set(used[~tracked]), set(used[tracked])
    counts = int((~tracked).sum()), int(tracked.sum()), len(marks), len(tracks)
    return KnownPositions(*counts, stated(marks), stated(tracks))


def known_limits(known: KnownPositions) -> list[str]:
    """That known positions err too, marks and tracks apart; nothing where the truth is exact."""
    said = []
    if known.tracked:
        what = "the track of a receiver" if known.tracks == 1 else f"tracks of {known.tracks} receivers"
        said.append(_limit(known.tracked, f"{what} at a target", known.track_sd_m))
    if known.marked:
        what = "a surveyed mark" if known.marks == 1 else f"{known.marks} surveyed marks"
        said.append(_limit(known.marked, what, known.mark_sd_m))
    return said


def _limit(points: int, what: str, sd_m: float) -> str:
    stated = f"stated as {sd_m:.2g} m in each axis" if np.isfinite(sd_m) else "which nothing states"
    count = "One point is" if points == 1 else f"{points} points are"
    return f"{count} held against {what}: the error of that position itself, {stated}, is in these figures."


def also_own_error(known: KnownPositions) -> str:
    """What more than marking and the lens differs from point to point: a clause to add, or nothing."""
    return ", the error of the target's own receiver" if known.tracked else ""


def noise_label(label: str, known: KnownPositions) -> str:
    """What a deviation is of: that of pixels has the error of the target's receiver in it."""
    return (
        label.replace("marking and lens", f"marking, lens{also_own_error(known)}") if known.tracked else label
    )


def ground_words(known: KnownPositions) -> str:
    """Where the height of the ground at each target comes from."""
    if known.tracked and known.marked:
        return "the survey of the marks and the receiver's track of each other target"
    return "the receiver's track of each target" if known.tracked else "the survey of each target"


#: Zones are whole quarters of an hour, s.
ZONE_S = 900.0


def offset_sentence(flight: Flight) -> str:
    """That an offset of the camera's clock was applied, which flatters where it was fitted on these points.

    Parameters
    ----------
    flight
        Its manifest has the offset, and does not say where it came from.

    Returns
    -------
    str
        Nothing for a simulated flight, without an offset, and where it is a zone alone.
    """
    offset = flight.manifest.clocks.camera_offset_s
    zone = ZONE_S * round(offset / ZONE_S)
    if flight.manifest.kind == "twin" or abs(offset - zone) < 1e-6:
        return ""
    beside = f" beside a zone of {zone / 3600:+g} h" if zone else ""
    return (
        f"The camera's clock was corrected by {offset - zone:+.2f} s{beside}, and flight.toml does not say "
        "from what. If it was fitted on these same points, these figures flatter: another flight would "
        "tell. What `wildlab check` proposes is fitted on them."
    )
