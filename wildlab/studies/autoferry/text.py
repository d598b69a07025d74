"""What the report on boats followed by several sensors of a ferry says: words, tables and metrics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from wildlab.flight.store import Flight
from wildlab.pipeline.sensor_tracks import ACCELERATION_DENSITY, COLUMNS, PATIENCE_S
from wildlab.pipeline.sensor_tuning import REACH, SensorTuning
from wildlab.reporting.report import Report
from wildlab.studies.autoferry.comparison import PRICE, WHITES, beside_white, check_claims

#: What names one track: sensor, target and flight.
KEYS = ["sensor", "target", "case"]
SENSOR_WORDS = {"lidar": "lidar", "radar": "radar", "ir": "thermal camera", "eo": "colour camera"}
FILTER_WORDS = {
    "kf": "white noise",
    "ekf": "white noise",
    "coloured": "differenced",
    "schmidt": "Schmidt",
    "thinned": "thinned",
}
#: A track whose error (RMSE, m) is below this stays with its boat: about the length of the smaller boats and
#: half of the ship's.
WITH_ITS_BOAT_M = 15.0

TUNING_COLUMNS = {
    "sensor": "sensor",
    "offset": "add to stamps (s)",
    "sd": "error, SD",
    "share": "lasting share",
    "time": "lasts (s)",
    "causes": "the lasting part is put down to",
    "thinned": "thinned to one in (s)",
}
TUNING_DIGITS = {"share": 2, "time": 1, "thinned": 1}
TRACK_COLUMNS = {
    "target": "boat",
    "scenario": "scenario",
    "words": "filter",
    "detections": "detections",
    "followed": "followed (%)",
    "rmse": "RMSE (m)",
    "anees": "mean NEES",
    "bound": "its 95 % band",
    "inside": "NEES in band (%)",
    "anis": "mean NIS",
    "lag1": "lag-one correlation",
}
TRACK_DIGITS = {"followed": 0, "rmse": 1, "anees": 2, "inside": 0, "anis": 2, "lag1": 2}
GAIN_COLUMNS = {
    "sensor": "sensor",
    "scenario": "scenario",
    "anees_white": "NEES, white noise",
    "rmse_white": "RMSE (m)",
    "words": "best of the others",
    "anees": "its NEES",
    "rmse_ratio": "its RMSE, ratio",
    "gained": "more consistent",
}
GAIN_DIGITS = {"anees_white": 1, "rmse_white": 1, "anees": 1, "rmse_ratio": 2}


def case_of(flight: Flight) -> str:
    """``scenario-3`` for ``autoferry-3``; other flights keep their name."""
    return flight.name.replace("autoferry-", "scenario-").lower()


def record_tracks(report: Report, table: pd.DataFrame) -> None:
    """Record every number of every track, under ``sensor/target/case/filter``."""
    for _, row in table.iterrows():
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


def record_tunings(report: Report, tunings: Mapping[str, SensorTuning]) -> pd.DataFrame:
    """Record what was fitted of each sensor, and return it as a table."""
    rows = []
    for sensor, one in tunings.items():
        angle = one.kind == "bearing"
        scale, unit = (180 / np.pi, "deg") if angle else (1.0, "m")
        report.metric(
            "clock_offset", sensor, one.offset_s, "s", n=one.n, low=one.offset_low_s, high=one.offset_high_s
        )
        report.metric("error_sd", sensor, scale * one.sd, unit, n=one.n)
        report.metric("error_correlation_time", sensor, one.correlation_time_s, "s", n=one.n)
        low, high = (signed(end, 1) for end in (one.offset_low_s, one.offset_high_s))
        causes = {
            f"position {one.position_sd_m:.1f} m": one.position_sd_m > 0.05,
            f"clock {one.clock_sd_s:.1f} s": one.clock_sd_s > 0.05,
            f"heading {np.degrees(one.yaw_sd_rad):.1f}°": np.degrees(one.yaw_sd_rad) > 0.05,
        }
        rows.append(
            {
                "sensor": SENSOR_WORDS.get(sensor, sensor),
                "offset": f"{signed(one.offset_s)} ({low} to {high})",
                "sd": f"{scale * one.sd:.1f}{'°' if angle else ' m'}",
                "share": one.share,
                "time": one.correlation_time_s,
                "causes": ", ".join(words for words, there in causes.items() if there),
                "thinned": max(one.thinning_s, one.interval_s),
            }
        )
    return pd.DataFrame(rows)


def tracks_table(table: pd.DataFrame, sensor: str) -> pd.DataFrame:
    """The tracks of one sensor, as a reader wants them."""
    rows = table[table["sensor"] == sensor]
    lag1 = rows[[name for name in COLUMNS if name.startswith("lag1")]]
    return rows.assign(
        scenario=rows["case"].str.removeprefix("scenario-"),
        words=rows["filter"].map(FILTER_WORDS),
        followed=100 * rows["share_followed"],
        inside=100 * rows["fraction_nees_inside"],
        bound=[
            f"{low:.1f} to {high:.1f}" for low, high in zip(rows["nees_low"], rows["nees_high"], strict=True)
        ],
        # The axis on which they are more correlated.
        lag1=[
            float(one[np.argmax(np.abs(one))]) if len(one) else np.nan
            for one in (values[np.isfinite(values)] for values in lag1.to_numpy(float))
        ],
    )


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """One row for each sensor and filter: medians over the tracks, and against the white filter."""
    both = beside_white(table, KEYS)
    rows = []
    for (sensor, name), group in table.groupby(["sensor", "filter"], sort=False):
        against = both[(both["sensor"] == sensor) & (both["filter"] == name)]
        tracks = group[np.isfinite(group["rmse"])]
        rows.append(
            {
                "sensor": SENSOR_WORDS.get(str(sensor), str(sensor)),
                "filter": FILTER_WORDS.get(str(name), str(name)),
                "tracks": len(tracks),
                "rmse": tracks["rmse"].median(),
                "anees": tracks["anees"].median(),
                "inside": 100 * tracks["fraction_nees_inside"].median(),
                "anis": tracks["anis"].median(),
                "nearer": f"{int(against['nearer'].sum())} of {len(against)}" if len(against) else "",
            }
        )
    return pd.DataFrame(rows)


OVERVIEW_COLUMNS = {
    "sensor": "sensor",
    "filter": "filter",
    "tracks": "tracks",
    "rmse": "RMSE (m)",
    "anees": "mean NEES",
    "inside": "NEES in band (%)",
    "anis": "mean NIS",
    "nearer": "NEES nearer 2",
}
OVERVIEW_DIGITS = {"rmse": 1, "anees": 1, "inside": 0, "anis": 2}


def gains_table(found: pd.DataFrame) -> pd.DataFrame:
    """What `wildlab.studies.autoferry.comparison.gains` gives, in words, sensor by sensor."""
    found = found.sort_values("sensor", key=lambda names: names.map(list(SENSOR_WORDS).index), kind="stable")
    return found.assign(
        sensor=found["sensor"].map(SENSOR_WORDS),
        scenario=found["case"].str.removeprefix("scenario-"),
        words=[FILTER_WORDS.get(name, "none at that price") for name in found["filter"]],
    )


def claims_by_sensor(table: pd.DataFrame, texts: Mapping[str, str]) -> pd.DataFrame:
    """In how many cases of each sensor each claim is true, as text: ``4 of 10``."""
    rows = []
    for claim, text in texts.items():
        row = {"claim": text}
        for sensor, words in SENSOR_WORDS.items():
            true = check_claims(table[table["sensor"] == sensor], KEYS)[claim]
            row[words] = f"{int(true.sum())} of {len(true)}" if len(true) else "—"
        rows.append(row)
    return pd.DataFrame(rows)


def summary_sentences(
    tracks: pd.DataFrame, gained: Mapping[str, pd.Series], kinds: Mapping[str, str]
) -> list[str]:
    """What a ranger needs to know. ``gained`` by sensor; ``kinds`` of detections by sensor."""
    white = tracks[tracks["filter"].isin(WHITES) & tracks["rmse"].notna()]
    error = white.groupby("sensor")["rmse"].median()
    over = int((white["anees"] > white["nees_high"]).sum())
    ranging = [sensor for sensor in error.index if kinds[sensor] == "position"]
    looking = [sensor for sensor in error.index if kinds[sensor] == "bearing"]
    sentences = []
    if ranging:
        places = " and ".join(f"{error[one]:.0f} metres with the {SENSOR_WORDS[one]}" for one in ranging)
        sentences.append(f"Typically, a boat's track is off by {places}.")
    if looking:
        places = " and ".join(f"{error[one]:.0f} metres with the {SENSOR_WORDS[one]}" for one in looking)
        sentences.append(
            f"Cameras tell directions only, and from a ship as slow as this one that means {places}."
        )
    last = f"In {over} of {len(white)} tracks the simple filter was surer of itself than it should have been"
    if ranging:
        where = " and ".join(
            f"{int(gained[one].sum())} of {len(gained[one])} scenarios with the {SENSOR_WORDS[one]}"
            for one in ranging
        )
        last += f"; one of the others was more honest, and at most a tenth less accurate, in {where}"
    return [*sentences, f"{last}."]


def alone_words(both: pd.DataFrame, sensors: Iterable[str]) -> str:
    """In how many cases each filter, were it the only choice, is more consistent at the price allowed.

    ``both`` is what `wildlab.studies.autoferry.comparison.beside_white` gives.
    """
    words = []
    for sensor in sensors:
        rows = both[both["sensor"] == sensor]
        better = rows["nearer"] & (rows["rmse_ratio"] <= PRICE)
        counts = better.groupby(rows["filter"], sort=False).agg(["sum", "count"])
        parts = [
            f"{FILTER_WORDS[str(name)]} {row['sum']} of {row['count']}" for name, row in counts.iterrows()
        ]
        words.append(f"{SENSOR_WORDS[sensor]}: {', '.join(parts)}")
    return "; ".join(words)


def strays(tracks: pd.DataFrame) -> str:
    """The tracks by position that do not stay with their boat, in a sentence; empty where all do."""
    white = tracks[tracks["filter"].isin(WHITES) & (tracks["kind"] == "position")]
    lost = white[white["rmse"] > WITH_ITS_BOAT_M]
    named = [
        f"{row['target']} by {SENSOR_WORDS[row['sensor']]} in {str(row['case']).replace('-', ' ')} "
        f"({row['rmse']:.0f} m, {100 * row['share_followed']:.0f} % of the time)"
        for _, row in lost.iterrows()
    ]
    return f"Tracks by position, white noise assumed, that do not stay: {'; '.join(named)}." if named else ""


def remarks(tracks: pd.DataFrame) -> list[str]:
    """What stands behind the verdicts, with the numbers that say so."""
    white = tracks[tracks["filter"].isin(WHITES)]
    differenced = tracks[(tracks["filter"] == "coloured") & tracks["rmse"].notna()]
    lag1 = differenced[["lag1_autocorrelation_north", "lag1_autocorrelation_east"]]
    negative = (lag1.min(axis=1) < -1.96 / np.sqrt(differenced["detections"])).sum()
    nis = {str(kind): rows["anis"].median() for kind, rows in white.groupby("kind", sort=False)}
    expected = {"position": 2, "bearing": 1}
    thinned = tracks[(tracks["filter"] == "thinned") & tracks["rmse"].notna()].merge(
        white, on=KEYS, suffixes=("", "_white")
    )
    poorer = (thinned["rmse"] > thinned["rmse_white"]).sum()
    return [
        "With white noise assumed, the median of the mean NIS is "
        + " and ".join(
            f"{value:.2f} for a {kind}, where {expected[kind]} is right" for kind, value in nis.items()
        )
        + ": the noise that covers the errors is larger than what changes from one detection to the next.",
        f"In {int(negative)} of {len(differenced)} differenced tracks neighbouring innovations are "
        "correlated negatively, as they are where part of an error is new at every detection and is "
        "differenced too.",
        f"Thinned tracks are less accurate than those of all detections in {int(poorer)} of {len(thinned)} "
        "cases.",
    ]


def signed(value: float, decimals: int = 2) -> str:
    """With a true minus."""
    return f"{value:.{decimals}f}".replace("-", "−")


def method_text(first: str) -> str:
    """How it was computed; ``first`` is the flight everything was tuned on."""
    return rf"""
Each boat is followed by each sensor on its own: constant velocity with white acceleration
(${ACCELERATION_DENSITY:.2f}$ m/s per root second: a boat at 2.5 m/s may turn by a right angle in 20 s), the
nearest detection in a 99 % gate, a track dropped after {PATIENCE_S:g} s without one. Positions go through the
linear filter, bearings through the extended one, started at the mean distance that {first} shows. All filters
of a track get the same detections, those that the filter with white noise let in.

SensorTuning, on {first} alone: the detection nearest to a boat within {REACH["position"]:g} m or
{np.degrees(REACH["bearing"]):g}° is taken for its own. The clock offset is the one with the least sum of
squared errors. $\sigma$ is their root mean square, standing part included; their autocorrelation is fitted by
$c\, e^{{-t/\tau}}$. Differencing takes $F_c = e^{{-T/\tau}}$ and the variance that $e_2 - F_c e_1$ then has
(H (7.5)-(7.12)); after more than a second, or one and a half scans, the position itself is used. The Schmidt
filter considers position, clock and heading, each with the variance that non-negative least squares gives it,
fading with $\tau$; the rest is white. Thinning keeps detections so far apart that their errors are correlated
by less than $1/e$.

NEES is of the position, truth minus estimate; the truth's own variance is added to the filter's. A mean NEES
is overconfident where it lies above the 95 % interval for as many independent values as the correlated ones
are worth. It counts as nearer 2 where its ratio to 2 is smaller, whichever way.
"""
