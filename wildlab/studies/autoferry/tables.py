"""The tables of the report on boats followed by a ferry's sensors, and the numbers that it records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from wildlab.analysis.following.sensor_tracks import COLUMNS, FILTERS
from wildlab.analysis.following.sensor_tuning import SensorTuning
from wildlab.reporting.report import Report
from wildlab.studies.autoferry.comparison import (
    OUTCOMES,
    WHITES,
    check_claims,
    consistent,
    kept_cases,
    outcomes,
    stays,
)
from wildlab.studies.autoferry.text import FILTER_WORDS, KEYS, OUTCOME_WORDS, SENSOR_WORDS, named, signed

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
CLAIM_COLUMNS = {"claim": "claim", "source": "where", "verdict": "verdict", "count": "true on"}
#: On which tracks each claim is true, by its id.
Checks = Mapping[str, NDArray[np.bool_]]
TRACK_COLUMNS = {
    "target": "boat",
    "scenario": "scenario",
    "words": "filter",
    "detections": "detections",
    "near": "near its boat",
    "kept": "stays",
    "rmse": "RMSE (m)",
    "anees": "mean NEES",
    "bound": "its 95 % band",
    "inside": "NEES in its own band",
    "anis": "mean NIS",
    "lag1": "lag-one correlation",
}
TRACK_DIGITS = {"rmse": 1, "anees": 2, "anis": 2, "lag1": 2}
CASE_COLUMNS = {
    "sensor": "sensor",
    "target": "boat",
    "scenario": "scenario",
    "words": "outcome",
    "anees_white": "NEES, white noise",
    "bound_white": "its band",
    "anees": "NEES",
    "bound": "its band",
    "rmse": "RMSE (m)",
    "rmse_ratio": "RMSE, ratio",
    "near": "near its boat",
}
CASE_DIGITS = {"anees_white": 1, "anees": 1, "rmse": 1, "rmse_ratio": 2}


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
            f"heading {np.degrees(one.heading_sd_rad):.1f}°": np.degrees(one.heading_sd_rad) > 0.05,
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
        near=_near(rows),
        kept=np.where(stays(rows), "yes", "no"),
        inside=_shares(rows["fraction_nees_inside"], rows["compared"]),
        bound=_band(rows["nees_low"], rows["nees_high"]),
        # The axis on which they are more correlated.
        lag1=[
            float(one[np.argmax(np.abs(one))]) if len(one) else np.nan
            for one in (values[np.isfinite(values)] for values in lag1.to_numpy(float))
        ],
    )


def outcomes_table(found: pd.DataFrame) -> pd.DataFrame:
    """How many tracks of each sensor have each outcome, and of all; see `comparison.outcomes`."""
    groups = [(named([sensor]), rows) for sensor, rows in found.groupby("sensor", sort=False)]
    if len(groups) > 1:
        groups.append(("all", found))
    rows = [{"sensor": words} | _counts(rows) for words, rows in groups]
    return pd.DataFrame(rows, columns=["sensor", "tracks", *OUTCOME_WORDS.values()])


def filters_table(table: pd.DataFrame, fixed: str) -> pd.DataFrame:
    """The outcomes of every filter, were it the one that is held fixed; ``fixed`` is, and stands first."""
    names = dict.fromkeys(name for some in FILTERS.values() for name in some if name not in WHITES)
    rows = []
    for name in sorted(names, key=lambda one: one != fixed):
        found = outcomes(table, KEYS, name)
        said = FILTER_WORDS[name] + (" (held fixed)" if name == fixed else "")
        rows.append({"filter": said} | _counts(found))
    return pd.DataFrame(rows)


def cases_table(found: pd.DataFrame) -> pd.DataFrame:
    """Every track with what became of it, sensor by sensor."""
    return found.assign(
        sensor=[named([sensor]) for sensor in found["sensor"]],
        scenario=found["case"].str.removeprefix("scenario-"),
        words=found["outcome"].map(OUTCOME_WORDS),
        bound=_band(found["nees_low"], found["nees_high"]),
        bound_white=_band(found["nees_low_white"], found["nees_high_white"]),
        near=_near(found),
    )


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """One row for each sensor and filter: how many tracks stay, how far off those are, and how honest."""
    rows = []
    for (sensor, name), group in table.groupby(["sensor", "filter"], sort=False):
        kept = group[stays(group)]
        rows.append(
            {
                "sensor": named([sensor]),
                "filter": FILTER_WORDS.get(str(name), str(name)),
                "kept": f"{len(kept)} of {len(group)}",
                "rmse": kept["rmse"].median(),
                "rmse_all": group["rmse"].median(),
                "anees": kept["anees"].median(),
                "inside": f"{int(consistent(kept).sum())} of {len(kept)}" if len(kept) else "—",
                "anis": kept["anis"].median(),
            }
        )
    return pd.DataFrame(rows)


OVERVIEW_COLUMNS = {
    "sensor": "sensor",
    "filter": "filter",
    "kept": "tracks that stay",
    "rmse": "their RMSE (m)",
    "anees": "mean NEES",
    "inside": "in its band",
    "anis": "mean NIS",
    "rmse_all": "RMSE of all (m)",
}
OVERVIEW_DIGITS = {"rmse": 1, "rmse_all": 1, "anees": 1, "anis": 2}


def claims_by_sensor(table: pd.DataFrame, texts: Mapping[str, str]) -> pd.DataFrame:
    """In how many cases of each sensor each claim is true, as text: ``4 of 10``; see `kept_cases`."""
    kept = kept_cases(table, KEYS)
    rows = []
    for claim, text in texts.items():
        row = {"claim": text}
        for sensor, words in SENSOR_WORDS.items():
            true = check_claims(kept[kept["sensor"] == sensor], KEYS)[claim]
            row[words] = f"{int(true.sum())} of {len(true)}" if len(true) else "—"
        rows.append(row)
    return pd.DataFrame(rows)


def claims_table(decided: pd.DataFrame, claims: Sequence[Mapping[str, str]], true: Checks) -> pd.DataFrame:
    """What `monte_carlo.decide_claims` gives for ``true``, with the count behind every share."""
    counts = [f"{int(true[claim['id']].sum())} of {len(true[claim['id']])}" for claim in claims]
    return decided.assign(count=counts)


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


def _counts(found: pd.DataFrame) -> dict[str, object]:
    counts: dict[str, object] = {"tracks": len(found)}
    return counts | {words: int((found["outcome"] == name).sum()) for name, words in OUTCOME_WORDS.items()}


def _band(low: pd.Series, high: pd.Series) -> list[str]:
    return [f"{a:.1f} to {b:.1f}" for a, b in zip(low, high, strict=True)]


def _shares(share: pd.Series, n: pd.Series) -> list[str]:
    pairs = zip(share, n, strict=True)
    return [f"{100 * part:.0f} % of {whole:.0f}" if np.isfinite(part) else "—" for part, whole in pairs]


def _near(rows: pd.DataFrame) -> list[str]:
    return _shares(rows["share_with_target"], rows["seen"])
