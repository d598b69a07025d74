"""Whether poses, frames and truth are of the same time, and where in between there are none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wildlab.flight.checks.findings import Finding, Level, bad_rows, part_of
from wildlab.flight.clocks import frame_times, gnss_times, longest_gap
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
#: Share of the shorter that has to lie within the longer, and what it may be less while clocks are in doubt.
WITHIN, DOUBT = 0.9, 0.5
HOURS = tuple(float(h) for h in np.arange(-26.0, 26.25, 0.25) if h)


class _Log(NamedTuple):
    """Stamps of poses, or of the truth of a target, against the times of the frames."""

    name: str
    low: float
    high: float
    outside: NDArray[np.bool_]

    @property
    def level(self) -> Level:
        if self.outside.all():
            return "problem"
        return "note" if self.outside.mean() < FEW_OUTSIDE else "warning"


def overlap(flight: Flight) -> Iterator[Finding]:
    """Whether poses, frames and truth are of the same time; truths that are outside alike are one finding."""
    frames = flight.frames
    if frames is None or len(frames) == 0:
        return
    times, ids = frame_times(flight), frames["frame_id"]
    for name, nav in flight.nav.items():
        table = f"nav/{name}"
        if "frame_id" in nav:
            lost, first = ~ids.isin(nav["frame_id"]).to_numpy(), {"first": ids.to_numpy(object)}
            yield from bad_rows(lost, None, table, "frame_id", "frame-without-pose", first)
        else:
            log = _against("poses", nav["time_s"].to_numpy(float), times)
            if log is not None:
                yield _outside(table, "the poses run", [log], times)
    if flight.truth is None or flight.manifest.time.kind != "utc":
        return
    alike: list[list[_Log]] = []
    for target, rows in flight.truth.groupby("target_id", sort=False):
        stamps = rows["time_s"].to_numpy(float) + flight.manifest.clocks.truth_offset_s
        log = _against(str(target), stamps, times)
        if log is not None:
            same = next((logs for logs in alike if _alike(logs[0], log)), None)
            if same is None:
                alike.append([log])
            else:
                same.append(log)
    for logs in alike:
        named = _listed([repr(one.name) for one in logs], " more")
        yield _outside("truth", f"the truth of {named} runs", logs, times)


def _against(name: str, stamps: Array, times: Array) -> _Log | None:
    """A log outside of which there are frames; None where there are none, or nothing has a time."""
    known = stamps[np.isfinite(stamps)]
    if not (np.isfinite(times).any() and len(known)):
        return None
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
    late, early = max(most.low - first, 0.0), max(last - most.high, 0.0)
    facts: dict[str, Any] = {
        "runs": runs,
        "from": _span([one.low for one in logs]),
        "to": _span([one.high for one in logs]),
        "first": first,
        "last": last,
        "several": len(logs) > 1,
        "n": int(most.outside.sum()),
        "of": len(times),
        "late": late,
        "early": early,
    }
    code = "times-outside-by-quarters" if _quarters(late) or _quarters(early) else "times-outside"
    return Finding(level, table, "time_s", "times-apart" if level == "problem" else code, facts)


def _span(values: list[float]) -> str:
    low, high = f"{min(values):.3f}", f"{max(values):.3f}"
    return low if low == high else f"between {low} and {high}"


def _listed(names: list[str], more: str) -> str:
    rest = f" and {len(names) - LISTED}{more}" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + rest


def _quarters(seconds: float) -> bool:
    """Whether it is near a whole number of quarters of an hour, and not near none."""
    whole = QUARTER_S * round(seconds / QUARTER_S)
    return whole != 0 and abs(seconds - whole) <= NEAR_QUARTER_S


def gaps(flight: Flight) -> Iterator[Finding]:
    """Frames between poses that are too far apart for one to be given, and what was detected in them."""
    frames, detections = flight.frames, flight.detections
    if frames is None or len(frames) == 0:
        return
    times = frame_times(flight)
    for name, nav in flight.nav.items():
        stamps = nav["time_s"].to_numpy(float)
        if "frame_id" in nav or len(stamps) < 2 or not (np.diff(stamps) > 0).all():
            continue  # said elsewhere, or a pose that holds at all times
        before = np.clip(np.searchsorted(stamps, times) - 1, 0, len(stamps) - 2)
        within = (times > stamps[before]) & (times < stamps[before + 1])
        lost = within & (np.diff(stamps)[before] > longest_gap(stamps))
        without = 0
        if detections is not None:
            of_lost = detections["frame_id"].isin(frames["frame_id"][lost])
            # A position needs no pose to have a place.
            without = int((of_lost & (detections["kind"] != "position")).sum())
        spans = [f"{stamps[k]:.3f} s to {stamps[k + 1]:.3f} s" for k in np.unique(before[lost])]
        facts = {
            "what": "look" if "sensor" in frames else "frame",
            "spans": _listed(spans, " more times"),
            "without": without,
            "detections": 0 if detections is None else len(detections),
        }
        yield from bad_rows(lost, "warning", f"nav/{name}", "time_s", "pose-gap", facts)


def stamps(flight: Flight) -> Iterator[Finding]:
    """Parts of a flight that a whole number of hours brings together: zones."""
    if flight.manifest.time.kind != "utc":
        return
    spans = _spans(flight)
    off = {name: [o for o in spans if o != name and _common(spans[name], spans[o]) < DOUBT] for name in spans}
    # Who disagrees with the most is the one that is wrong; of two, the one that is not of the poses.
    most = max((len(others) for others in off.values()), default=0)
    if most == 0:
        return
    wrong = [name for name, others in off.items() if len(others) == most]
    name = wrong[0] if len(spans) > 2 and most == len(spans) - 1 else wrong[-1]
    other, (start, end) = off[name][0], spans[name]
    for hours in HOURS:
        if _common((start + 3600 * hours, end + 3600 * hours), spans[other]) >= WITHIN:
            facts = {"hours": hours, "other": other, "part": part_of(name)}
            causes = (f"zone ({hours:+g} h)",)
            yield Finding("problem", name, "time_s", "stamps-of-another-zone", facts, causes)
            return


def _spans(flight: Flight) -> dict[str, tuple[float, float]]:
    """First and last time of each part that has two."""
    times: dict[str, Any] = {
        f"nav/{name}": nav["time_s"] for name, nav in flight.nav.items() if not name.startswith("truth")
    }
    if flight.imu is not None:
        times["imu"] = flight.imu["time_s"]
    if flight.gnss is not None:
        times["gnss"] = gnss_times(flight)
    if "magnetometer" in flight.tables:
        times["magnetometer"] = flight.tables["magnetometer"]["time_s"]
    if flight.truth is not None:
        times["truth"] = flight.truth["time_s"] + flight.manifest.clocks.truth_offset_s
    if flight.frames is not None:
        times["frames"] = frame_times(flight)
    known = {name: np.asarray(t, float)[np.isfinite(np.asarray(t, float))] for name, t in times.items()}
    spans = {name: (float(t.min()), float(t.max())) for name, t in known.items() if len(t) > 1}
    return {name: span for name, span in spans.items() if span[1] > span[0]}


def _common(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Share of the shorter that both have."""
    common = min(one[1], other[1]) - max(one[0], other[0])
    return max(common, 0.0) / max(min(one[1] - one[0], other[1] - other[0]), 1e-9)
