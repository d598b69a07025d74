"""Sensors of a ferry and two boats with satellite positions: the filters of H 7.2 to 7.4 on public data.

One filter is held fixed against the one that takes errors for white, where nothing was tuned.

A filter gains on a track where it keeps the track with its boat, is at most a tenth less accurate, and has a
mean NEES in the band of a consistent filter that the white one's is outside of. Each track has exactly one of
`OUTCOMES`, so that no denominator shrinks: lost tracks are counted, and apart.

What the tracker is told of the harbour: drawn at random, chosen on one scenario, used on the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from wildlab.analysis.tracks.many import score_identities, track_jointly
from wildlab.analysis.tracks.noise_model import (
    SensorInputs,
    SensorTuning,
    TargetModel,
    model_targets,
    noise_of_tuning,
)
from wildlab.analysis.tracks.scans import scans_of, sensors_of, truths_at
from wildlab.analysis.tracks.single_target import SensorTrack, track_target
from wildlab.analysis.tracks.tracker import score_track, seen_of
from wildlab.analysis.tracks.tuning import tune
from wildlab.evaluation.consistency import position_nees
from wildlab.evaluation.identities import Identities
from wildlab.flight.files import check_model, read_toml
from wildlab.flight.manifest import Settings, read_settings
from wildlab.flight.store import Flight
from wildlab.geometry.frames import Array
from wildlab.paths import DATA
from wildlab.reporting.charts.drawing import draw_way, finish, fit_map, mark_level
from wildlab.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    PURPLE,
    VERMILLION,
    colour,
    map_axes,
    new_figure,
    plain_numbers,
)
from wildlab.reporting.many_tracks import LARGEST, SMALLEST, rms_error
from wildlab.reporting.report import Report
from wildlab.studies.page import Shown, record_spread

#: Degrees of freedom of the NEES of a position, and so what its mean should be.
IDEAL = 2.0
#: How much larger the error of a filter may be that is to count as better for its consistency.
PRICE = 1.1
#: A track stays with its boat ("mostly tracked", as multi-target trackers are judged) where it is near it in
#: at least this share of the scans in which the sensor saw something there; else it is lost.
MOSTLY = 0.8
#: The filters that are held against each other, by kind of detection, first the one with white noise.
FILTERS = {
    "position": ("kf", "coloured", "schmidt", "thinned"),
    "bearing": ("ekf", "schmidt", "thinned"),
}
WHITES = tuple(names[0] for names in FILTERS.values())
#: Columns of `tracks_table`, as they are recorded, with their units.
COMPARED = {
    "rmse": "m", "mae": "m", "anees": "1", "anees_alone": "1", "anis": "1", "lag1_autocorrelation": "1",
    "fraction_nees_inside": "1", "share_followed": "1", "share_with_target": "1",
}  # fmt: skip
_NAMES = {"nees": "anees", "nis": "anis", "lag1": "lag1_autocorrelation", "inside": "fraction_nees_inside",
          "followed": "share_followed"}  # fmt: skip
#: What became of a track with a filter, beside the white one's: it enters its band at the price allowed, or
#: at a higher one; both are in; neither is; it leaves it; or the track is lost.
OUTCOMES = ("gained", "too dear", "both inside", "neither inside", "spoilt", "lost")
_COUNTED = ("gained", "spoilt", "lost")
#: What names one track.
KEYS = ["sensor", "target", "case"]


def follow_flight(
    flight: Flight, tunings: Mapping[str, SensorTuning], targets: TargetModel
) -> list[SensorTrack]:
    """Every target with truth, by every sensor that has a tuning, with each of `FILTERS`."""
    found = []
    for sensor, tuning in tunings.items():
        scans = scans_of(flight, sensor, tuning.offset_s)
        one = SensorInputs(scans, noise_of_tuning(tuning), truths_at(flight, scans.times))
        for truth in one.truths:
            found += track_target({sensor: one}, truth.target, targets, FILTERS[scans.kind])
    return found


def tracks_table(followed: Sequence[SensorTrack], size_m: float = np.nan) -> pd.DataFrame:
    """`wildlab.analysis.tracks.tracker.score_tracks`, with the names of `COMPARED`.

    ``anees_alone`` takes the truth for exact; ``share_with_target`` is the share of the scans in which the
    sensor saw something near the boat in which the track is nearer to it than ``size_m``.
    """
    rows = []
    for one in followed:
        kind, seen = "bearing" if one.innovation.shape[1] == 1 else "position", seen_of(one)
        alone = position_nees(one.error[seen, :2], one.covariance[seen, :2, :2])
        there = np.hypot(*one.error[:, :2].T) < size_m  # NaN, where there is no track, is not there
        rows.append(
            score_track(one, kind)
            | {
                "anees_alone": alone[np.isfinite(alone)].mean() if np.isfinite(alone).any() else np.nan,
                "share_with_target": there[one.near].mean() if one.near.any() and size_m > 0 else np.nan,
            }
        )
    return pd.DataFrame(rows).rename(columns=_NAMES)


def off_ideal(anees: ArrayLike) -> Array:
    """By what factor a mean NEES is too large or too small, as a logarithm: 0 is ideal."""
    return np.abs(np.log(np.asarray(anees, float) / IDEAL))


def stays(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Which tracks stay with their boat, by the rows of `tracks_table`; see `MOSTLY`.

    One that never began, or whose boat the sensor never saw, does not.
    """
    return np.asarray(table["share_with_target"] >= MOSTLY, bool)


def consistent(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Which tracks have their mean NEES in its 95 % band.

    That is the band of a mean of as many independent values as the track's correlated ones are worth.
    """
    return np.asarray((table["anees"] >= table["nees_low"]) & (table["anees"] <= table["nees_high"]), bool)


def beside_white(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Every track of another filter beside the same one of the filter with white noise.

    Parameters
    ----------
    table
        Rows of `tracks_table`, of one flight or many.
    keys
        Columns that name a case: what was followed, by what, when.

    Returns
    -------
    The rows of the other filters, with the columns of the white one as ``*_white``, ``rmse_ratio`` and
    ``nearer`` (whether the mean NEES is nearer its ideal). Cases without a track are left out.
    """
    known = table[np.isfinite(table["rmse"]) & np.isfinite(table["anees"])]
    white = known[known["filter"].isin(WHITES)]
    both = known[~known["filter"].isin(WHITES)].merge(white, on=list(keys), suffixes=("", "_white"))
    compared: pd.DataFrame = both.assign(
        rmse_ratio=both["rmse"] / both["rmse_white"],
        nearer=off_ideal(both["anees"]) < off_ideal(both["anees_white"]),
    )
    return compared


def outcomes(table: pd.DataFrame, keys: Sequence[str], fixed: str) -> pd.DataFrame:
    """What one filter does to every case, beside the filter with white noise.

    Parameters
    ----------
    table
        Rows of `tracks_table`.
    keys
        Columns that name a case.
    fixed
        Name of the filter; cases of a kind of detection that it is not for are left out.

    Returns
    -------
    One row for each case: ``outcome`` (of `OUTCOMES`), and the columns of the two filters' rows, the white
    one's as ``*_white``.
    """
    kinds = [kind for kind, names in FILTERS.items() if fixed in names]
    rows = table[table["kind"].isin(kinds)]
    white = rows[rows["filter"].isin(WHITES)]
    both = rows[rows["filter"] == fixed].merge(white, on=list(keys), suffixes=("", "_white"), how="left")
    behind = both[[name for name in both if str(name).endswith("_white")]]
    before = behind.rename(columns=lambda name: str(name).removesuffix("_white"))
    kept, inside, inside_white = stays(both), consistent(both), consistent(before)
    ratio = both["rmse"] / both["rmse_white"]
    outcome = np.select(
        [~kept, inside & inside_white, inside & (ratio <= PRICE), inside, inside_white],
        ["lost", "both inside", "gained", "too dear", "spoilt"],
        "neither inside",
    )
    found: pd.DataFrame = both.assign(outcome=outcome)
    return found


class Held(NamedTuple):
    """One filter held fixed, and what became of the tracks.

    Attributes
    ----------
    fixed
        The filter, from `choose_filter`.
    judged
        Tracks of the flights that nothing was tuned on; of the only one where there is one.
    use, found
        From `of_use`, and of the sensors that are of use from `outcomes`.
    """

    fixed: str
    judged: pd.DataFrame
    use: pd.DataFrame
    found: pd.DataFrame

    @property
    def counts(self) -> dict[str, int]:
        """How many tracks there are, and how many gained, were spoilt or lost."""
        outcome = self.found["outcome"]
        return {"tracks": len(outcome)} | {name: int((outcome == name).sum()) for name in _COUNTED}


def hold_fixed(tracks: pd.DataFrame, first: str) -> Held:
    """Choose a filter on the flight ``first``, and judge it on the others."""
    own = tracks["case"] == first
    fixed = choose_filter(tracks[own], KEYS)
    judged = tracks if own.all() else tracks[~own]
    use = of_use(judged)
    useful = judged[judged["sensor"].isin(use.loc[use["of_use"], "sensor"])]
    return Held(fixed, judged, use, outcomes(useful, KEYS, fixed))


def choose_filter(table: pd.DataFrame, keys: Sequence[str]) -> str:
    """The filter to hold fixed, from the flight that everything is tuned on and nothing else.

    Of those for positions other than the white one, the one whose mean NEES, the truth taken for exact, lies
    nearest its ideal (mean of `off_ideal`) among those that are, in the median, within `PRICE`; among all
    where none is. Tracks that the white filter loses are left out.

    Parameters
    ----------
    table
        Rows of `tracks_table` of that flight.
    keys
        Columns that name a case.
    """
    both = beside_white(kept_cases(table, keys), keys)
    both = both[both["kind"] == "position"]
    if both.empty:
        return FILTERS["position"][1]
    off = pd.Series(off_ideal(both["anees_alone"]), both.index).groupby(both["filter"], sort=False).mean()
    cheap = both.groupby("filter", sort=False)["rmse_ratio"].median() <= PRICE
    return str((off[cheap] if cheap.any() else off).idxmin())


def kept_cases(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """The rows, of all filters, of the cases whose track stays with its boat with white noise.

    What follows something else says nothing of how a filter takes its errors.
    """
    white = table[table["filter"].isin(WHITES)]
    kept = white.loc[stays(white), list(keys)]
    return table.merge(kept, on=list(keys))


def claim_numbers(table: pd.DataFrame) -> dict[str, NDArray[Any]]:
    """What the rules of claims ask of cases with a track, by "filter/column": of white noise, of differencing
    and of the Schmidt filter; means over time are held against the band of their worth."""
    both = beside_white(table, KEYS)
    rows = {name: both[both["filter"] == name] for name in ("coloured", "schmidt")}
    rows["white"] = table[table["filter"].isin(WHITES) & np.isfinite(table["anees"])]
    return {f"{who}/{name}": some[name].to_numpy() for who, some in rows.items() for name in some}


def of_use(table: pd.DataFrame) -> pd.DataFrame:
    """Whether each sensor alone locates boats: a filter keeps more than half of its tracks with them.

    Returns
    -------
    One row for each sensor, in the order of the table: ``sensor``, ``filter`` (the one that keeps most),
    ``kept``, ``tracks``, ``of_use``.
    """
    rows = []
    for sensor, group in table.groupby("sensor", sort=False):
        kept = pd.Series(stays(group), group.index).groupby(group["filter"], sort=False).sum()
        best = str(kept.idxmax())
        of, most = int((group["filter"] == best).sum()), int(kept.max())
        rows.append((str(sensor), best, most, of, 2 * most > of))
    return pd.DataFrame(rows, columns=["sensor", "filter", "kept", "tracks", "of_use"])


#: What is known of the boats, apart from the flights.
BOATS, _ = model_targets(read_settings(DATA / "settings" / "autoferry.toml").targets)
SENSORS = ("lidar", "radar", "ir", "eo")


def case_of(flight: Flight) -> str:
    """``scenario-3`` for ``autoferry-3``; other flights keep their name."""
    return flight.name.replace("autoferry-", "scenario-").lower()


def tune_sensor(flight: Flight, sensor: str) -> SensorTuning:
    """Everything of a sensor from one scenario, see `wildlab.analysis.tracks.tuning.tune`."""
    return tune([flight], sensor, BOATS.reach)


def tune_sensors(flight: Flight) -> dict[str, SensorTuning]:
    """The same of each of `SENSORS` that the flight has."""
    return {sensor: tune_sensor(flight, sensor) for sensor in SENSORS if sensor in sensors_of(flight)}


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
    """How many tracks of each sensor have each outcome, and of all; see `outcomes`."""
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
    return finish(fig, ylabel="mean NEES of a track")


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
    ax.set_title(case.replace("-", " ").capitalize())
    return finish(fig)


#: The ways to look: by one sensor, by both, and with the cameras too.
MODES: dict[str, tuple[str, ...]] = {
    "radar": ("radar",),
    "lidar": ("lidar",),
    "both": ("lidar", "radar"),
    "cameras": ("lidar", "radar", "ir", "eo"),
}
#: At whose looks it is judged: those of the cameras are many more, and would weigh most.
JUDGED_AT = ("lidar", "radar")
#: How far away a boat is asked for, m: as far as the radar sees, or the lidar a boat of its size.
RADAR_REACH_M = 200.0
LIDAR_REACH_M = {"havfruen": 105.0, "gunnerus": 125.0, "jet-boat": 70.0}
#: Of a boat whose size is not known, m.
USUAL_REACH_M = 105.0


class Tuned(NamedTuple):
    """One draw, and where it was tuned its mean GOSPA, m, and the mean NEES / 2 of its tracks, the truth
    taken for exact."""

    number: int
    settings: Settings
    gospa: float
    anees: float


def reach_of(flight: Flight, mode: str) -> dict[str, float]:
    """Metres by target up to which it is asked for."""
    truth = flight.table("truth")
    names = [str(name) for name in truth["target_id"].unique()]
    if "radar" in MODES[mode]:
        return dict.fromkeys(names, RADAR_REACH_M)
    return {
        name: next((reach for key, reach in LIDAR_REACH_M.items() if key in name.lower()), USUAL_REACH_M)
        for name in names
    }


def errors_of(flight: Flight) -> dict[str, SensorTuning]:
    """Of each sensor, as one scenario tells: its clock, and how its errors last from scan to scan."""
    return {sensor: tune_sensor(flight, sensor) for sensor in MODES["cameras"]}


def draw(rng: np.random.Generator, errors: Mapping[str, SensorTuning]) -> Settings:
    """Everything that the tracker is told, from the ranges of ``data/drawn_settings.toml``.

    Parameters
    ----------
    errors
        From `errors_of`.
    """
    ranges = read_toml(DATA / "drawn_settings.toml", "what settings are drawn from")
    told: dict[str, Any] = ranges["same"]
    for path, how in ranges["drawn"].items():
        *parts, name = path.split(".")
        reduce(lambda part, one: part.setdefault(one, {}), parts, told)[name] = _drawn(rng, how)
    hull = told["sensors"]["lidar"]["many"]
    hull["near_end_m"] = np.multiply(hull["near_side_m"], hull["near_end_m"]).tolist()
    for name, sensor in told["sensors"].items():
        sensor["clock_offset_s"] = errors[name].offset_s
        # Of bearings scans are thinned instead.
        if "thinning_s" not in sensor:
            sensor["correlation"] = errors[name].next_correlation
            sensor["correlation_time_s"] = errors[name].correlation_time_s
    return check_model(Settings, told, None)


def _drawn(rng: np.random.Generator, how: Any) -> Any:
    if isinstance(how, list):
        return [_drawn(rng, one) for one in how]
    if not isinstance(how, dict):
        return how
    (kind, values), *_ = how.items()
    if kind == "of":
        return np.asarray(rng.choice(values)).item()
    return float(np.exp(rng.uniform(*np.log(values))) if kind == "log" else rng.uniform(*values))


def gospa_of(lives: Identities | None) -> float:
    """Mean over the looks, m; infinite where there is nothing to compare."""
    return float(np.mean([one.distance for one in lives.gospa])) if lives is not None else np.inf


def follow_mode(flight: Flight, mode: str, settings: Settings) -> tuple[Identities | None, Identities | None]:
    """A scenario by the sensors of a mode, beside its true boats: as it is known in the end, and by then."""
    followed = track_jointly(flight, settings=settings, sensors=MODES[mode])
    ends = followed, followed._replace(shown=followed.filtered)
    in_the_end, by_then = (score_identities(one, reach_of(flight, mode), JUDGED_AT) for one in ends)
    return in_the_end, by_then


def anees_of(lives: Identities | None) -> float:
    """Mean NEES / 2 over tracks, each by its NEES; NaN where there is none.

    The truth is taken for exact, so that no draw is preferred for what somebody assumed of the truth.
    """
    on = [one for one in (lives.tracks.values() if lives else ()) if np.isfinite(one.anees)]
    values = [one.anees_alone / 2 for one in on]
    return float(np.average(values, weights=[one.compared for one in on])) if on else np.nan


def tune_modes(flight: Flight, draws: int, seed: int) -> dict[str, Tuned]:
    """Draw settings, and choose those of each mode by how the tracker does with them on one scenario.

    Those go first with which errors are as large as the tracks say, and among them those with a small GOSPA:
    GOSPA alone prefers tracks that are too sure of themselves, which lose their boat elsewhere.

    Parameters
    ----------
    draws
        How many.

    Returns
    -------
    The best, by mode.
    """
    errors = errors_of(flight)
    found: dict[str, list[Tuned]] = {mode: [] for mode in MODES}
    for number, rng in enumerate(np.random.default_rng(seed).spawn(draws), start=1):
        settings = draw(rng, errors)
        for mode, tuned in found.items():
            lives, _ = follow_mode(flight, mode, settings)
            tuned.append(Tuned(number, settings, gospa_of(lives), anees_of(lives)))
    return {mode: min(tuned, key=order) for mode, tuned in found.items()}


def order(one: Tuned) -> tuple[bool, float, int]:
    """What draws are chosen by: first those whose errors are as large as the tracks say, then by GOSPA."""
    return not SMALLEST <= one.anees <= LARGEST, one.gospa, one.number


def row_of(lives: Identities | None, by_then: Identities | None, case: str, mode: str) -> dict[str, object]:
    """One scenario by one mode, from `follow_mode`."""
    if lives is None:
        return {"case": case, "mode": mode}
    seen = [life for life in lives.targets.values() if life.visible]
    return {
        "case": case,
        "mode": mode,
        "gospa": gospa_of(lives),
        "gospa_online": gospa_of(by_then),
        "rmse": rms_error(lives),
        "tracked": 100 * float(np.mean([life.tracked for life in seen])) if seen else np.nan,
        "swaps": lives.swaps,
        "breaks": lives.breaks,
        "anees": anees_of(lives),
    }


def judge_all(flights: Mapping[str, Flight], tuned: Mapping[str, Tuned]) -> pd.DataFrame:
    """Every scenario by every mode with its settings."""
    return pd.DataFrame(
        [
            row_of(*follow_mode(flight, mode, tuned[mode].settings), case, mode)
            for mode in MODES
            for case, flight in flights.items()
        ]
    )


#: Medians over scenarios, by name: of which number of each, and its unit.
MEDIANS = {
    "gospa_median": ("gospa", "m"),
    "gospa_online_median": ("gospa_online", "m"),
    "tracked_median": ("tracked", "%"),
}


def over_scenarios(rows: pd.DataFrame, first: str) -> pd.DataFrame:
    """What each mode gives on each scenario but the first, on which everything was tuned.

    Returns
    -------
    DataFrame
        Columns (``elsewhere/`` and the mode, a name of `MEDIANS`), a row for each scenario.
    """
    by_mode = rows.pivot(index="case", columns="mode").drop(index=first)
    return pd.DataFrame(
        {
            (f"elsewhere/{mode}", name): by_mode[column, mode]
            for mode in rows["mode"].unique()
            for name, (column, _) in MEDIANS.items()
        }
    )


def record_scores(report: Report, rows: pd.DataFrame, first: str) -> dict[str, int]:
    """Record the numbers of each scenario; and by mode, of all but the first, medians (`MEDIANS`) with the
    lowest and the highest, and how often a boat's track changes.

    Returns
    -------
    dict
        These changes.
    """
    each = (
        ("gospa", "gospa", "m"), ("gospa_online", "gospa_online", "m"),
        ("rmse", "rmse", "m"), ("swaps", "swaps", "1"), ("breaks", "breaks", "1"),
        ("mean_nees_by_two", "anees", "1"),
    )  # fmt: skip
    for _, one in rows.iterrows():
        for name, column, unit in each:
            report.metric(name, f"{one['case']}/{one['mode']}", one[column], unit)
    units = {name: unit for name, (_, unit) in MEDIANS.items()}
    record_spread(report, units.get, over_scenarios(rows, first), {})
    changes = {}
    for mode, own in rows.groupby("mode", sort=False):
        seen = own.loc[own["case"] != first, ["swaps", "breaks"]].dropna()
        changes[str(mode)] = int(seen.to_numpy().sum())
        report.metric("track_changes", f"elsewhere/{mode}", changes[str(mode)], "1", n=len(seen))
    return changes
