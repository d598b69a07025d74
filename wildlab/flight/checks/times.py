"""Whether poses, frames and truth are of the same time, and where in between there are none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from wildlab.flight.checks.findings import Finding, count, first_row
from wildlab.flight.clocks import frame_times, longest_gap
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array

#: Logs do not begin and end together: fewer frames outside than this share are good to know, no more.
FEW_OUTSIDE = 0.02
#: Logs that begin within so many seconds of each other, and end so, were switched on and off together.
TOGETHER_S = 5.0
#: Zones differ by whole quarters of an hour; so near to one (s), with logs that do not begin at once.
QUARTER_S, NEAR_QUARTER_S = 900.0, 60.0
#: More names, or gaps, than this are counted and not listed.
LISTED = 5


class _Log(NamedTuple):
    """Stamps of poses, or of the truth of a target, against the times of the frames."""

    name: str
    low: float
    high: float
    outside: np.ndarray

    @property
    def level(self) -> str:
        if self.outside.all():
            return "problem"
        return "note" if self.outside.mean() < FEW_OUTSIDE else "warning"


def overlap(flight: Flight) -> Iterator[Finding]:
    """Whether poses, frames and truth are of the same time; truths that are outside alike are one finding."""
    frames = flight.frames
    if frames is None or len(frames) == 0:
        return
    times = frame_times(flight)
    for name, nav in flight.nav.items():
        if "frame_id" in nav:
            lost = ~frames["frame_id"].isin(nav["frame_id"]).to_numpy()
            if lost.any():
                first = frames["frame_id"].iloc[first_row(lost)]
                yield Finding(
                    "problem" if lost.all() else "warning",
                    f"nav/{name}",
                    "frame_id",
                    f"{count(lost, 'frame')} without a pose, first {first!r}",
                    "check that both tables name the frames alike",
                )
        elif len(nav):
            log = _against("poses", nav["time_s"].to_numpy(float), times)
            if log is not None:
                yield _outside(f"nav/{name}", "the poses run", [log], times)
    if flight.truth is None or flight.manifest.time.kind != "utc":
        return
    alike: list[list[_Log]] = []
    for target, rows in flight.truth.groupby("target_id", sort=False):
        stamps = rows["time_s"].to_numpy(float) + flight.manifest.clocks.truth_offset_s
        log = _against(str(target), stamps, times)
        if log is None:
            continue
        same = next((logs for logs in alike if _alike(logs[0], log)), None)
        if same is None:
            alike.append([log])
        else:
            same.append(log)
    for logs in alike:
        named = ", ".join(repr(one.name) for one in logs[:LISTED])
        more = f" and {len(logs) - LISTED} more" if len(logs) > LISTED else ""
        yield _outside("truth", f"the truth of {named}{more} runs", logs, times)


def _against(name: str, stamps: Array, times: Array) -> _Log | None:
    """A log outside of which there are frames; None where there are none, or nothing has a time."""
    if not (np.isfinite(times).any() and np.isfinite(stamps).any()):
        return None
    known = stamps[np.isfinite(stamps)]
    low, high = float(known.min()), float(known.max())
    outside = ~((times >= low) & (times <= high))
    return _Log(name, low, high, outside) if outside.any() else None


def _alike(one: _Log, other: _Log) -> bool:
    near = abs(one.low - other.low) <= TOGETHER_S and abs(one.high - other.high) <= TOGETHER_S
    return near and one.level == other.level


def _outside(table: str, runs: str, logs: list[_Log], times: Array) -> Finding:
    """What is said of logs that are outside alike."""
    known = times[np.isfinite(times)]
    first, last = float(known.min()), float(known.max())
    level = logs[0].level
    most = max(logs, key=lambda one: int(one.outside.sum()))
    said = (
        f"{runs} from {_span([one.low for one in logs])} s to {_span([one.high for one in logs])} s, "
        f"the frames from {first:.3f} s to {last:.3f} s: "
    )
    if level == "problem":
        said += "they do not overlap in time"
        fix = "check the time zone, the format and the unit of the stamps of both, and [clocks]"
        return Finding("problem", table, "time_s", said, fix)
    said += ("up to " if len(logs) > 1 else "") + f"{count(most.outside, 'frame')} outside"
    late, early = max(most.low - first, 0.0), max(last - most.high, 0.0)
    if _quarters(late) or _quarters(early):
        fix = "check the time zone of both, and [clocks]"
    else:
        sides = [
            *([f"begins {late:.1f} s after the first frame"] if late else []),
            *([f"ends {early:.1f} s before the last frame"] if early else []),
        ]
        how = f" ({' and '.join(sides)})" if sides else ""
        fix = f"look whether what made this log{how} was on all the time; else check [clocks]"
    return Finding("note" if level == "note" else "warning", table, "time_s", said, fix)


def _span(values: list[float]) -> str:
    low, high = f"{min(values):.3f}", f"{max(values):.3f}"
    return low if low == high else f"between {low} and {high}"


def _quarters(seconds: float) -> bool:
    """Whether it is near a whole number of quarters of an hour, and not near none."""
    whole = QUARTER_S * round(seconds / QUARTER_S)
    return whole != 0 and abs(seconds - whole) <= NEAR_QUARTER_S


def gaps(flight: Flight) -> Iterator[Finding]:
    """Frames between poses that are too far apart for one to be told, and what was detected in them."""
    frames = flight.frames
    if frames is None or len(frames) == 0:
        return
    times = frame_times(flight)
    word = "look" if "sensor" in frames else "frame"
    for name, nav in flight.nav.items():
        stamps = nav["time_s"].to_numpy(float)
        if "frame_id" in nav or len(stamps) < 2 or not (np.diff(stamps) > 0).all():
            continue  # said elsewhere, or a pose that holds at all times
        before = np.clip(np.searchsorted(stamps, times) - 1, 0, len(stamps) - 2)
        within = (times > stamps[before]) & (times < stamps[before + 1])
        lost = within & (np.diff(stamps)[before] > longest_gap(stamps))
        if not lost.any():
            continue
        spans = [f"{stamps[k]:.3f} s to {stamps[k + 1]:.3f} s" for k in np.unique(before[lost])]
        more = f" and {len(spans) - LISTED} more times" if len(spans) > LISTED else ""
        said = f"{count(lost, word)} without a pose: there is none from {', '.join(spans[:LISTED])}{more}"
        if flight.detections is not None:
            of_lost = flight.detections["frame_id"].isin(frames["frame_id"][lost])
            # A position needs no pose to have a place.
            without = int((of_lost & (flight.detections["kind"] != "position")).sum())
            if without:
                said += (
                    f", and {without} of {len(flight.detections)} detections are in them: they will have no "
                    "place"
                )
        fix = f"fill in the poses of that time from the log, or leave those {word}s out"
        yield Finding("warning", f"nav/{name}", "time_s", said, fix)
