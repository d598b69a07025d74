"""Sensors of a ferry and two boats with satellite positions: the filters of H 7.2 to 7.4 on public data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wildlab.analysis.tracks.noise_model import SensorTuning, model_targets
from wildlab.analysis.tracks.scans import sensors_of
from wildlab.analysis.tracks.single_target import SensorTrack
from wildlab.analysis.tracks.tuning import tune
from wildlab.evaluation.intervals import share_interval
from wildlab.flight.store import Flight
from wildlab.flight.tracking_settings import read_settings
from wildlab.paths import DATA
from wildlab.reporting.charts.drawing import draw_way, finish, mark_level
from wildlab.reporting.charts.forms import fit_map, plain_numbers
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    VERMILLION,
    colour,
    map_axes,
    new_figure,
)
from wildlab.reporting.report import Report
from wildlab.studies.autoferry import comparison
from wildlab.studies.autoferry.comparison import (
    COMPARED,
    FILTERS,
    IDEAL,
    KEYS,
    OUTCOMES,
    Held,
    consistent,
    stays,
)
from wildlab.studies.page import Facts, Shown
from wildlab.studies.protocol import Study

#: What is known of the boats, apart from the flights.
BOATS, _ = model_targets(read_settings(DATA / "settings" / "autoferry.toml").targets)
SENSORS = ("lidar", "radar", "ir", "eo")


def case_of(flight: Flight) -> str:
    """``scenario-3`` for ``autoferry-3``; other flights keep their name."""
    return flight.name.replace("autoferry-", "scenario-").lower()


def tune_sensor(flight: Flight, sensor: str) -> SensorTuning:
    """Everything of a sensor from one scenario, see `wildlab.analysis.tracks.tuning.tune`."""
    return tune(flight, sensor, BOATS.reach)


def tune_sensors(flight: Flight) -> dict[str, SensorTuning]:
    """The same of each of `SENSORS` that the flight has."""
    return {sensor: tune_sensor(flight, sensor) for sensor in SENSORS if sensor in sensors_of(flight)}


def tracks_table(followed: Mapping[str, Sequence[SensorTrack]]) -> pd.DataFrame:
    """A row for each track, with its ``case``: `wildlab.studies.autoferry.comparison.tracks_table` of all."""
    each = [comparison.tracks_table(ones, BOATS.size_m).assign(case=case) for case, ones in followed.items()]
    return pd.concat(each, ignore_index=True)


def record(report: Report, tracks: pd.DataFrame, tunings: Mapping[str, SensorTuning], held: Held) -> None:
    """Record every track, every tuning, and what became of the tracks with the filter that is held fixed."""
    record_tracks(report, tracks)
    record_tunings(report, tunings)
    record_outcomes(report, held.found, held.use, held.fixed)


def record_tracks(report: Report, tracks: pd.DataFrame) -> None:
    """Record every number of every track, under ``sensor/target/case/filter``."""
    for _, row in tracks.iterrows():
        subject = "/".join([*(str(row[key]) for key in KEYS), str(row["filter"])])
        for name, unit in COMPARED.items():
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


Followed = Mapping[str, Sequence[SensorTrack]]
SENSOR_COLOURS = {"lidar": BLUE, "radar": VERMILLION, "ir": PURPLE, "eo": GREEN}
#: Metres beyond the targets' paths that a map shows.
MARGIN_M = 40.0


def figures(
    flights: Mapping[str, Flight], followed: Followed, held: Held, names: Mapping[str, str]
) -> list[Shown]:
    """Mean NEES of all tracks, and a map of each flight judged.

    Parameters
    ----------
    flights, followed
        By case.
    held
        The filter whose tracks the maps show; its white counterpart where it is not for a kind of detection.
    names
        Words for sensors and filters.
    """
    drawn = {held.fixed if held.fixed in some else some[0] for some in FILTERS.values()}
    found = [Shown(mean_nees(held.judged, names), "mean-nees")]
    for name in held.judged["case"].unique():
        mine = [one for one in followed[name] if one.filter in drawn]
        found.append(Shown(track_map(flights[name], mine, name, names), "map", f"map-{name}"))
    return found


def mean_nees(tracks: pd.DataFrame, names: Mapping[str, str]) -> Figure:
    """The mean NEES of every track by sensor and filter, with the ideal; lost tracks are hollow."""
    fig, ax = new_figure(5.8, 3.8)
    known = tracks[np.isfinite(tracks["anees"])]
    ends, place = [], 0
    for sensor, group in known.groupby("sensor", sort=False):
        left = place
        for name, rows in group.groupby("filter", sort=False):
            at = place + (np.linspace(-0.22, 0.22, len(rows)) if len(rows) > 1 else np.zeros(1))
            kept, tint = stays(rows), colour(str(name))
            ax.plot(at[kept], rows["anees"][kept], "o", color=tint, ms=4)
            ax.plot(at[~kept], rows["anees"][~kept], "o", mec=tint, mfc="white", ms=4)
            place += 1
        ends.append(((left + place - 1) / 2, names[str(sensor)].replace(" ", "\n")))
        place += 1
    mark_level(ax, IDEAL, "2, ideal")
    ax.set_yscale("log")
    plain_numbers(ax.yaxis)
    ax.set_xticks([x for x, _ in ends], [label for _, label in ends])
    ax.grid(axis="x", visible=False)
    for name in ("kf", *FILTERS["position"][1:]):
        ax.plot([], [], "o", color=colour(name), ms=5, label=names[name])
    ax.plot([], [], "o", mec=GREY, mfc="white", ms=5, label="lost")
    return finish(fig, "", ylabel="mean NEES of a track")


def track_map(flight: Flight, followed: Sequence[SensorTrack], case: str, names: Mapping[str, str]) -> Figure:
    """Paths of the boats (black), of the platform (grey) and of each sensor's tracks, in local metres."""
    fig, ax = new_figure(5.8, 5.0)
    _, nav = flight.pose_source()
    ways = {str(name): rows for name, rows in flight.table("truth").groupby("target_id", sort=False)}
    places = {
        name: rows[["north_m", "east_m"]].to_numpy(float) for name, rows in (ways | {"own ship": nav}).items()
    }
    for name, way in places.items():
        color, width, aside = (GREY, 3.0, (6, -14)) if name == "own ship" else ("black", 2.4, (6, 5))
        draw_way(ax, way, color, width=width, zorder=2)
        ax.plot(*way[-1, ::-1], "o", color=color, ms=5, zorder=4)
        ax.annotate(name, way[-1, ::-1], aside, textcoords="offset points", fontsize=10, zorder=5)
    for one in followed:
        draw_way(
            ax, one.estimate, SENSOR_COLOURS.get(one.sensor, GREY), names[one.sensor], width=1.3, zorder=3
        )
    fit_map(ax, np.concatenate(list(places.values())), MARGIN_M)
    map_axes(ax)
    return finish(fig, case.replace("-", " ").capitalize())


def answer(facts: Facts) -> list[str]:
    """What one filter held fixed gains and spoils, then which sensors keep their tracks."""
    return [f"filter-{_gain(facts)}", f"sensors-{_use(facts)}"]


def _gain(facts: Facts) -> str:
    """Of all sensors, by the interval of the share that gained of those that gained or were spoilt."""
    subject = next(
        (who for name, who in facts.recorded if (name, who[-12:]) == ("tracks_gained", "/all-sensors")), ""
    )
    gained, spoilt = (facts.value(subject, f"tracks_{name}") for name in ("gained", "spoilt"))
    if math.isnan(gained + spoilt) or gained + spoilt == 0:
        return "unknown"
    _, low, high = share_interval(gained, gained + spoilt)
    return "helps" if low > 0.5 else "harms" if high < 0.5 else "neither"


def _use(facts: Facts) -> str:
    """Whether each sensor alone keeps more than half of its tracks with their boats."""
    kept = {
        who.split("/")[-1]: 2 * facts.value(who, name) > facts.value(who, name, "n")
        for name, who in facts.recorded
        if name == "tracks_kept_at_best"
    }
    useless = {sensor for sensor, enough in kept.items() if not enough}
    if not kept:
        return "unknown"
    return "all" if not useless else "ranging" if useless == {"ir", "eo"} else "some"


STUDY = Study("autoferry", answer=answer)
