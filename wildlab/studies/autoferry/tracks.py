"""Tracks of the boats by each sensor: settings, tuning, the numbers recorded, and the page's tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.tracks.comparison import COLUMNS, table
from wildlab.analysis.tracks.noise_model import of_targets
from wildlab.analysis.tracks.scans import sensors_of
from wildlab.analysis.tracks.sensor_tuning import SensorTuning, tune
from wildlab.analysis.tracks.tracks import SensorTrack
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import read_settings
from wildlab.paths import DATA
from wildlab.reporting.report import Report
from wildlab.studies.autoferry.comparison import KEYS, OUTCOMES, Held, consistent, stays

#: What is known of the boats, apart from the flights.
BOATS, _ = of_targets(read_settings(DATA / "settings" / "autoferry.toml").targets)
SENSORS = ("lidar", "radar", "ir", "eo")


def case_of(flight: Flight) -> str:
    """``scenario-3`` for ``autoferry-3``; other flights keep their name."""
    return flight.name.replace("autoferry-", "scenario-").lower()


def tune_sensor(flight: Flight, sensor: str) -> SensorTuning:
    """Everything of a sensor from one scenario, see `wildlab.analysis.tracks.sensor_tuning.tune`."""
    return tune(flight, sensor, BOATS.reach)


def tune_sensors(flight: Flight) -> dict[str, SensorTuning]:
    """The same of each of `SENSORS` that the flight has."""
    return {sensor: tune_sensor(flight, sensor) for sensor in SENSORS if sensor in sensors_of(flight)}


def tracks_table(followed: Mapping[str, Sequence[SensorTrack]]) -> pd.DataFrame:
    """A row for each track, with its ``case``: `wildlab.analysis.tracks.comparison.table` of all."""
    each = [table(ones, BOATS.size_m).assign(case=case) for case, ones in followed.items()]
    return pd.concat(each, ignore_index=True)


def record(report: Report, tracks: pd.DataFrame, tunings: Mapping[str, SensorTuning], held: Held) -> None:
    """Record every track, every tuning, and what became of the tracks with the filter that is held fixed."""
    record_tracks(report, tracks)
    record_tunings(report, tunings)
    record_outcomes(report, held.found, held.use, held.fixed)
    gained = int(held.hindsight["gained"].sum())
    report.metric("tracks_gained_with_hindsight", "all-sensors", gained, "1", n=len(held.hindsight))


def record_tracks(report: Report, tracks: pd.DataFrame) -> None:
    """Record every number of every track, under ``sensor/target/case/filter``."""
    for _, row in tracks.iterrows():
        subject = "/".join([*(str(row[key]) for key in KEYS), str(row["filter"])])
        of_other_kind = {
            "position": {"lag1_autocorrelation"},
            "bearing": {"lag1_autocorrelation_north", "lag1_autocorrelation_east"},
        }[row["kind"]]
        for name, unit in COLUMNS.items():
            if name not in of_other_kind:
                of = "detections" if name.startswith(("anis", "lag1")) else "compared"
                report.metric(name, subject, row[name], unit, n=int(row[of]))
        report.metric("detections_used", subject, int(row["detections"]), "1")


def record_tunings(report: Report, tunings: Mapping[str, SensorTuning]) -> None:
    """Record what was fitted of each sensor."""
    for sensor, one in tunings.items():
        scale, unit = (180 / np.pi, "deg") if one.kind == "bearing" else (1.0, "m")
        report.metric(
            "clock_offset", sensor, one.offset_s, "s", n=one.n, low=one.offset_low_s, high=one.offset_high_s
        )
        report.metric("error_sd", sensor, scale * one.sd, unit, n=one.n)
        report.metric("error_correlation_time", sensor, one.correlation_time_s, "s", n=one.n)


def record_outcomes(report: Report, found: pd.DataFrame, use: pd.DataFrame, fixed: str) -> None:
    """Record how many tracks have each outcome, of each sensor and of all, and how many stay at best."""
    groups = [(str(sensor), rows) for sensor, rows in found.groupby("sensor", sort=False)]
    for sensor, rows in [*groups, ("all-sensors", found)]:
        for name in OUTCOMES:
            count = int((rows["outcome"] == name).sum())
            report.metric(f"tracks_{name.replace(' ', '_')}", f"{fixed}/{sensor}", count, "1", n=len(rows))
    for row in use.to_dict(orient="records"):
        subject = f"{row['filter']}/{row['sensor']}"
        report.metric("tracks_kept_at_best", subject, row["kept"], "1", n=row["tracks"])


def tables(
    held: Held, tunings: Mapping[str, SensorTuning], names: Mapping[str, str]
) -> dict[str, pd.DataFrame]:
    """The page's tables, by the key of their texts; ``names``: words for sensors and filters."""
    return {
        "outcomes": outcomes_table(held.found, names),
        "overview": overview_table(held.judged, names),
        "tunings": tunings_table(tunings, names),
    }


def outcomes_table(found: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """How many tracks of each sensor have each outcome, and of all; see `comparison.outcomes`."""
    groups = [(names[str(sensor)], rows) for sensor, rows in found.groupby("sensor", sort=False)]
    if len(groups) > 1:
        groups.append(("all", found))
    rows = [
        {"sensor": words, "tracks": len(each)}
        | {name: int((each["outcome"] == name).sum()) for name in OUTCOMES}
        for words, each in groups
    ]
    return pd.DataFrame(rows, columns=["sensor", "tracks", *OUTCOMES])


def overview_table(judged: pd.DataFrame, names: Mapping[str, str]) -> pd.DataFrame:
    """A row for each sensor and filter: how many tracks stay, and medians of these tracks."""
    rows = []
    for (sensor, name), group in judged.groupby(["sensor", "filter"], sort=False):
        kept = group[stays(group)]
        rows.append(
            {
                "sensor": names[str(sensor)],
                "filter": names[str(name)],
                "kept": f"{len(kept)} of {len(group)}",
                "rmse": kept["rmse"].median(),
                "anees": kept["anees"].median(),
                "inside": f"{int(consistent(kept).sum())} of {len(kept)}" if len(kept) else "—",
                "anis": kept["anis"].median(),
            }
        )
    return pd.DataFrame(rows)


def tunings_table(tunings: Mapping[str, SensorTuning], names: Mapping[str, str]) -> pd.DataFrame:
    """What was fitted of each sensor: clock, size of its errors, and how they are correlated."""
    rows = []
    for sensor, one in tunings.items():
        angle = one.kind == "bearing"
        ends = " to ".join(f"{end:.1f}" for end in (one.offset_low_s, one.offset_high_s))
        rows.append(
            {
                "sensor": names[sensor],
                "offset": f"{one.offset_s:.2f} ({ends})".replace("-", "−"),
                "sd": f"{np.degrees(one.sd):.1f}°" if angle else f"{one.sd:.1f} m",
                "share": one.share,
                "time": one.correlation_time_s,
            }
        )
    return pd.DataFrame(rows)
