"""Stamps of the parts of a flight: whole hours between them are zones, whole factors are units."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wildlab.flight.checks.findings import Finding
from wildlab.flight.clocks import frame_times, gnss_times
from wildlab.flight.store import Flight

#: Share of the shorter that has to lie within the longer, and what it may be less while clocks are in doubt.
WITHIN, DOUBT = 0.9, 0.5
#: Zones are whole quarters of an hour.
HOURS = tuple(float(h) for h in np.arange(-26.0, 26.25, 0.25) if h)
#: Known differences of clocks (s): GPS time and UTC, TAI and UTC, days.
OTHERS = {"a day": 86400.0, "minus a day": -86400.0, "the 18 leap seconds of GPS time": 18.0}


def stamps(flight: Flight) -> Iterator[Finding]:
    """Parts of a flight that a whole number of hours brings together."""
    if flight.manifest.time.kind != "utc":
        return
    spans = {name: span for name, span in _spans(flight).items() if span[1] > span[0]}
    if len(spans) < 2:
        return
    off = {name: [o for o in spans if o != name and _common(spans[name], spans[o]) < DOUBT] for name in spans}
    # Who disagrees with the most is the one that is wrong; of two, the one that is not of the poses.
    most = max(len(others) for others in off.values())
    if most == 0:
        return
    wrong = [name for name, others in off.items() if len(others) == most]
    alone = [name for name in wrong if len(spans) > 2 and most == len(spans) - 1]
    for name in alone[:1] or wrong[-1:]:
        other = off[name][0]
        for hours in HOURS:
            start, end = spans[name]
            moved = (start + 3600 * hours, end + 3600 * hours)
            if _common(moved, spans[other]) >= WITHIN:
                part = {"frames": "frames", "truth": "truth"}.get(name, name.replace("nav/", "poses."))
                yield Finding(
                    "problem",
                    name,
                    "time_s",
                    f"the stamps are {abs(hours):g} h {'early' if hours > 0 else 'late'} against those "
                    f"of {other}: "
                    "another time zone",
                    f"write the `zone` of these stamps for `time` in [{part}] (or in [time], or that of "
                    f"{other}), and "
                    "import again",
                    (f"zone ({hours:+g} h)",),
                )
                break


def _spans(flight: Flight) -> dict[str, tuple[float, float]]:
    found: dict[str, tuple[float, float]] = {}

    def add(name: str, times: np.ndarray) -> None:
        times = times[np.isfinite(times)]
        if len(times) > 1:
            found[name] = (float(times.min()), float(times.max()))

    for name, nav in flight.nav.items():
        if not name.startswith("truth"):
            add(f"nav/{name}", nav["time_s"].to_numpy(float))
    if flight.imu is not None:
        add("imu", flight.imu["time_s"].to_numpy(float))
    if flight.gnss is not None:
        add("gnss", gnss_times(flight))
    if "magnetometer" in flight.tables:
        add("magnetometer", flight.tables["magnetometer"]["time_s"].to_numpy(float))
    if flight.truth is not None:
        add("truth", flight.truth["time_s"].to_numpy(float) + flight.manifest.clocks.truth_offset_s)
    if flight.frames is not None:
        add("frames", frame_times(flight))
    return found


def _common(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Share of the shorter that both have."""
    common = min(one[1], other[1]) - max(one[0], other[0])
    return max(common, 0.0) / max(min(one[1] - one[0], other[1] - other[0]), 1e-9)
