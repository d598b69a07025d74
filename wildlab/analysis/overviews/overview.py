"""What there is to know of a flight whatever it lacks: its streams, its path, what is wrong on it.

Nothing here needs a certain table: where one lacks, what would come of it is None, or an empty table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.overviews.alarms import QUATERNION, VELOCITY, Alarm, alarms_of, jumps_of
from wildlab.analysis.overviews.image_coverage import Coverage, cover_images, ground_height
from wildlab.analysis.overviews.lost import POSITION, Recovered, detections_of, lost_data, ordered
from wildlab.evaluation.streams import Pace, pace_of, runs_of
from wildlab.evaluation.vibration import FINE, Vibration, vibration_of
from wildlab.flight.checks.check import Use, find, usable_for
from wildlab.flight.clocks import frame_times, gnss_times, longest_gap
from wildlab.flight.store import Flight
from wildlab.geometry.frames import matrix_to_euler, quaternion_to_matrix

Array = NDArray[np.float64]

FORCE = ["f_x_m_s2", "f_y_m_s2", "f_z_m_s2"]
RATE = ["w_x_rad_s", "w_y_rad_s", "w_z_rad_s"]
#: Four satellites give a place, five show that one of them is wrong, and six which.
FEW_SATELLITES = 6
#: A position that is this many times as uncertain as it usually is.
UNSURE = 3.0
#: What may be wrong on a path, worst first.
TROUBLES = (
    "no poses",
    "position jumps",
    "no satellite positions",
    f"fewer than {FEW_SATELLITES} satellites",
    f"satellite position {UNSURE:g} times as uncertain as usual",
    f"shaken by more than {FINE:g} m/s²",
    "no inertial samples",
)


class Path(NamedTuple):
    """Where a platform, or else a receiver or a target, was: (N,) times in s and (N, 3) m in n.

    ``who`` is what it is of, ``timed`` whether the times are times and do not number the images.
    """

    who: str
    times: Array
    place: Array
    timed: bool


class Issue(NamedTuple):
    """One thing that is wrong for some time: one of `TROUBLES`, and (K, 2) begin and end, s."""

    what: str
    spells: Array

    @property
    def seconds(self) -> float:
        """All spells together."""
        return float(np.diff(self.spells, axis=1).sum())


@dataclass(frozen=True)
class Overview:
    """Everything that the overview of a flight shows.

    Attributes
    ----------
    flight, source
        The flight, and the poses that are shown of it, if there are any.
    streams
        Pace of every stream by its name.
    length_s
        From the first to the last stamp of what was carried, s; NaN where there is no time.
    path
        Where it flew, or the nearest to that which is known.
    alarms
        What is so wrong that it comes before all else, worst first.
    troubles
        Those of `TROUBLES` that there are.
    searched
        Of what troubles were looked for: ``poses``, ``satellites``, ``inertial samples``.
    series
        Over time: ``height``, ``speed``, ``attitude``, ``turning``, each {name: (times, values)}.
    above
        Height above ground: (N,) m along the path, and what the ground is; None where it is not known.
    vibration
        Of the inertial sensor, and the (N,) stamps of its samples; None where it cannot be told.
    coverage, uncovered
        What the images showed, or why that is not known.
    detections
        How many, in how many of the images, and how many of their pixels have a place on the ground.
    lost
        Data that are lost, most first.
    uses
        What the flight is good for.
    problems, warnings
        How many findings of either kind the checks of its tables have.
    """

    flight: Flight
    source: str | None
    streams: dict[str, Pace]
    length_s: float
    path: Path | None
    alarms: tuple[Alarm, ...]
    troubles: tuple[Issue, ...]
    searched: tuple[str, ...]
    series: dict[str, dict[str, tuple[Array, Array]]]
    above: tuple[Array, str] | None
    vibration: tuple[Vibration, Array] | None
    coverage: Coverage | None
    uncovered: str
    detections: tuple[int, int, int]
    lost: tuple[Recovered, ...]
    uses: tuple[Use, ...]
    problems: int
    warnings: int

    @property
    def detections_in_images(self) -> int:
        """How many detections are pixels: no other can be put on the ground by a camera's ray."""
        found = self.flight.detections
        return 0 if found is None else int((found["kind"] == "pixel").sum())


def troubled_for(overview: Overview, share: float) -> list[Issue]:
    """Troubles that last for a share of the flight or more, longest first.

    Parameters
    ----------
    overview
        Of the flight.
    share
        Of its length.

    Returns
    -------
    list of Issue
    """
    if not overview.length_s > 0:
        return []
    long = [one for one in overview.troubles if one.seconds >= share * overview.length_s]
    return sorted(long, key=lambda one: -one.seconds)


def look_over(flight: Flight, source: str | None = None) -> Overview:
    """Collect what there is to know of a flight.

    Parameters
    ----------
    flight
        With anything missing.
    source
        Name of the ``nav`` table to show; left out, the best known one.

    Returns
    -------
    Overview

    Raises
    ------
    WildlabError
        Where a source is named that the flight has not.

    Examples
    --------
    >>> from wildlab.simulation.twins import simulate_twin
    >>> found = look_over(simulate_twin("large-ship", 1))
    >>> found.path.who, found.problems
    ('nav/autopilot', 0)
    """
    if source is not None:
        flight.pose_source(source)
    source = source or next(iter(flight.estimated_sources), None)
    streams = paces(flight)
    timed = flight.manifest.time.kind == "utc"
    carried = [pace for name, pace in streams.items() if pace.n and name != "truth"] or [
        pace for pace in streams.values() if pace.n
    ]
    length = max(p.end for p in carried) - min(p.begin for p in carried) if carried and timed else np.nan
    path = _path(flight, source)
    vibration = _vibration(flight)
    coverage, uncovered = cover_images(flight, source)
    findings = [one.level for one in find(flight, meaning=False)]
    return Overview(
        flight=flight,
        source=source,
        streams=streams,
        length_s=float(length),
        path=path,
        alarms=tuple(alarms_of(flight, source, streams.get(f"nav/{source}"), vibration)) if timed else (),
        troubles=tuple(_troubles(flight, source, streams, vibration)) if timed else (),
        searched=_searched(flight, source, streams) if timed else (),
        series=_series(flight) if timed else {},
        above=_above(flight, path),
        vibration=vibration,
        coverage=coverage,
        uncovered=uncovered,
        detections=detections_of(flight, source),
        lost=tuple(sorted(lost_data(flight, source, streams), key=lambda one: -one.share)),
        uses=tuple(usable_for(flight)),
        problems=findings.count("problem"),
        warnings=findings.count("warning"),
    )


def paces(flight: Flight) -> dict[str, Pace]:
    """Pace of every stream of a flight by the name of its table; of a table without stamps there is none."""
    tables = {f"nav/{name}": nav for name, nav in flight.nav.items()} | flight.tables
    found = {}
    for name, table in tables.items():
        if name == "detections" or "time_s" not in table:
            continue
        stamps = table["time_s"].to_numpy(float)
        if name == "frames":
            stamps = frame_times(flight)
        elif name == "gnss":
            stamps = gnss_times(flight)
        elif name == "truth":
            # One of many targets stands for when all were followed.
            stamps = np.unique(stamps[np.isfinite(stamps)]) + flight.manifest.clocks.truth_offset_s
        known = np.sort(stamps[np.isfinite(stamps)])
        found[name] = pace_of(stamps, longest_gap(known))
    return found


def _path(flight: Flight, source: str | None) -> Path | None:
    timed = flight.manifest.time.kind == "utc"
    if source is not None:
        nav = flight.nav[source]
        t, place = ordered(nav, nav["time_s"].to_numpy(float), POSITION)
        if len(t):
            return Path(f"nav/{source}", t, place, timed)
    if flight.gnss is not None:
        t, place = ordered(flight.gnss, gnss_times(flight), POSITION)
        if len(t):
            return Path("gnss", t, place, timed)
    truth = flight.truth
    if truth is not None and len(truth):
        first = truth[truth["target_id"] == truth["target_id"].iloc[0]]
        t, place = ordered(first, first["time_s"].to_numpy(float), POSITION)
        if len(t) > 1:
            return Path("truth", t + flight.manifest.clocks.truth_offset_s, place, timed)
    return None


def _troubles(
    flight: Flight, source: str | None, streams: dict[str, Pace], vibration: tuple[Vibration, Array] | None
) -> list[Issue]:
    found: dict[str, Array] = {}
    nav = flight.nav.get(source) if source is not None else None
    if nav is not None and "frame_id" not in nav:
        found["no poses"] = streams[f"nav/{source}"].gaps
        found["position jumps"] = jumps_of(nav, streams[f"nav/{source}"])[0]
    if flight.gnss is not None and "gnss" in streams:
        gnss, stamps = flight.gnss, gnss_times(flight)
        found["no satellite positions"] = streams["gnss"].gaps
        if "satellites" in gnss:
            t, count = ordered(gnss, stamps, ["satellites"])
            found[TROUBLES[3]] = runs_of(count[:, 0] < FEW_SATELLITES, t)
        if "sd_horizontal_m" in gnss:
            t, sd = ordered(gnss, stamps, ["sd_horizontal_m"])
            if len(t):
                found[TROUBLES[4]] = runs_of(sd[:, 0] > UNSURE * np.median(sd), t)
    if vibration is not None:
        found[TROUBLES[5]] = runs_of(vibration[0].worst > FINE, vibration[1])
    if "imu" in streams:
        found["no inertial samples"] = streams["imu"].gaps
    return [Issue(what, found[what]) for what in TROUBLES if len(found.get(what, ()))]


def _searched(flight: Flight, source: str | None, streams: dict[str, Pace]) -> tuple[str, ...]:
    """Of what there is enough to look for troubles in."""
    posed = source is not None and "frame_id" not in flight.nav[source]
    there = {"poses": posed and streams[f"nav/{source}"].n > 1}
    for name, of in (("satellites", "gnss"), ("inertial samples", "imu")):
        there[name] = of in streams and streams[of].n > 1
    return tuple(name for name, some in there.items() if some)


def _series(flight: Flight) -> dict[str, dict[str, tuple[Array, Array]]]:
    height, speed, attitude, turning = {}, {}, {}, {}
    for name, nav in flight.nav.items():
        t, place = ordered(nav, nav["time_s"].to_numpy(float), POSITION)
        if not len(t):
            continue
        height[name] = t, -place[:, 2]
        if set(VELOCITY) <= set(nav) and nav[VELOCITY].notna().any().all():
            at, v = ordered(nav, nav["time_s"].to_numpy(float), VELOCITY)
            speed[name] = at, np.hypot(v[:, 0], v[:, 1])
        at, q = ordered(nav, nav["time_s"].to_numpy(float), QUATERNION)
        good = np.linalg.norm(q, axis=1) > 0
        if good.any():
            attitude[name] = at[good], np.degrees(matrix_to_euler(quaternion_to_matrix(q[good])))
    if flight.gnss is not None:
        t, place = ordered(flight.gnss, gnss_times(flight), POSITION)
        if len(t):
            height["satellites"] = t, -place[:, 2]
        if set(VELOCITY) <= set(flight.gnss):
            t, v = ordered(flight.gnss, gnss_times(flight), VELOCITY)
            if len(t):
                speed["satellites"] = t, np.hypot(v[:, 0], v[:, 1])
    if flight.imu is not None:
        t, w = ordered(flight.imu, flight.imu["time_s"].to_numpy(float), RATE)
        if len(t):
            turning["inertial sensor"] = t, np.degrees(w)
    return {"height": height, "speed": speed, "attitude": attitude, "turning": turning}


def _above(flight: Flight, path: Path | None) -> tuple[Array, str] | None:
    if path is None or path.who == "truth":
        return None
    if flight.terrain is not None:
        ground = flight.terrain.heights_at(path.place[:, :2])
        return -path.place[:, 2] - ground, "the flight's terrain"
    level = ground_height(flight)
    return None if level is None else (level[0] - path.place[:, 2], level[1])


def _vibration(flight: Flight) -> tuple[Vibration, Array] | None:
    if flight.imu is None or flight.manifest.time.kind != "utc":
        return None
    t, force = ordered(flight.imu, flight.imu["time_s"].to_numpy(float), FORCE)
    found = vibration_of(t, force)
    return None if found is None else (found, t)


def length_of_way(times: ArrayLike, places: ArrayLike) -> float:
    """Length of a path over the ground, m: steps below half a second are joined, for what shakes is no way.

    They are counted from the first pose, so that no clock has a say in it.

    Parameters
    ----------
    times
        (N,) s, in order.
    places
        (N, 2) m.

    Examples
    --------
    >>> t = np.arange(0.0, 10.0, 0.01)
    >>> shaken = np.column_stack([5 * t, 0.1 * np.tile([1.0, -1.0], len(t) // 2)])
    >>> round(length_of_way(t, shaken), 1)
    47.5
    """
    t, place = np.asarray(times, float), np.asarray(places, float)
    if not len(t):
        return 0.0
    keep = np.concatenate([[0], np.flatnonzero(np.diff(np.floor(2 * (t - t[0] + 1e-6))) > 0) + 1])
    return float(np.linalg.norm(np.diff(place[keep], axis=0), axis=1).sum())
