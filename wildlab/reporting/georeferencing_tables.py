"""Positions read from single images: tables, the section on the terrain, and files of points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.accuracy import Accuracy, corrections
from wildlab.analysis.diagnose import Diagnosis
from wildlab.analysis.georeference import errors_of
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.errors import AlongAxis, ErrorSummary, summarise
from wildlab.evaluation.outliers import Outlier
from wildlab.flight.store import Flight
from wildlab.geometry.corrections import BORESIGHT, Calibration
from wildlab.messages.catalogue import load_texts
from wildlab.messages.quantities import length
from wildlab.reporting.report import Report

#: Rows of the table of models, and of that of the worst images.
SHOWN, MOST_IMAGES = 8, 10
_NOISE = {
    "position_horizontal": ("position_horizontal_m", "m"),
    "position_vertical": ("position_vertical_m", "m"),
    "tilt": ("tilt_deg", "deg"),
    "heading": ("heading_deg", "deg"),
    "pixel": ("pixel_px", "px"),
}
#: Fields of an error summary by the names of their metrics.
SUMMARY = {
    "horizontal_error_mean": "mean",
    "horizontal_error_median": "median",
    "horizontal_error_p90": "p90",
    "horizontal_error_max": "max",
    "bias_north": "bias_north",
    "bias_east": "bias_east",
    "sd_north": "sd_north",
    "sd_east": "sd_east",
}


def errors_table(rows: Mapping[str, ErrorSummary]) -> pd.DataFrame:
    """One row of errors for each summary, with its name in the column ``pose``."""
    return pd.DataFrame([{"pose": name, **summary._asdict()} for name, summary in rows.items()])


def groups_table(groups: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """One row of errors for each scored part of a flight, with images and ellipse coverage."""
    return pd.DataFrame(
        [
            {
                "part": name,
                "images": rows["frame_id"].nunique(),
                **summarise(errors_of(rows))._asdict(),
                "inside": 100 * rows["inside_90"].mean(),
            }
            for name, rows in groups.items()
        ]
    )


def worst_images(scored: pd.DataFrame) -> pd.DataFrame:
    """The images with the largest mean error, `MOST_IMAGES` at most, numbered as on the map."""
    each = scored.dropna(subset=["error_m"]).groupby("frame_id", sort=False)["error_m"]
    found = each.agg(["count", "mean", "max"]).nlargest(MOST_IMAGES, "mean").reset_index(names="image")
    return found.assign(number=np.arange(len(found)) + 1)


def worst_sightings(flight: Flight, scored: pd.DataFrame) -> pd.DataFrame:
    """The detection that is furthest off in each of the `worst_images`, with its pixel and a ``line``."""
    worst = worst_images(scored)
    furthest = scored.loc[scored.groupby("frame_id")["error_m"].idxmax().dropna()].set_index("frame_id")
    pixels = flight.table("detections").set_index("detection_id")[["u_px", "v_px"]]
    found = worst.join(furthest.loc[worst["image"]].join(pixels, on="detection_id"), on="image")
    lines = [f"{n}: {length(m)}" for n, m in zip(found["number"], found["error_m"], strict=True)]
    return found.assign(line=lines)


def beside_published(published: pd.DataFrame, theirs: ErrorSummary, ours: ErrorSummary) -> pd.DataFrame:
    """Published figures with those of the same answers scored here (``again``) and of ours (``here``)."""
    table = published[published["name"].isin(SUMMARY)]
    fields = [SUMMARY[name] for name in table["name"]]
    return table.assign(
        quantity=[name.removeprefix("horizontal_error_") for name in table["name"]],
        again=[getattr(theirs, field) for field in fields],
        here=[getattr(ours, field) for field in fields],
    )


def simplest_rivals(diagnosis: Diagnosis) -> list[int]:
    """Numbers of the rivals that hold no other rival, the two of the least held-out error at most."""
    models, winner = diagnosis.models, diagnosis.winner
    rivals = [m for m in diagnosis.ranked.rivals if models[m].causes not in ((), winner.causes)]
    held = [set(models[m].causes) for m in rivals]
    simple = [m for m in rivals if not any(one < set(models[m].causes) for one in held)]
    return sorted(simple, key=lambda m: models[m].gain.with_)[:2]


def models_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """The most likely models, the winner bold, rivals that the page names, and the poses as logged."""
    likeliest = np.argsort(diagnosis.ranked.scores, kind="stable")[:SHOWN].tolist()
    rows = []
    for m in dict.fromkeys([*likeliest, diagnosis.ranked.winner, *simplest_rivals(diagnosis), 0]):
        model = diagnosis.models[m]
        gain = model.gain.gain
        rows.append(
            {
                "what": f"**{model.name}**" if m == diagnosis.ranked.winner else model.name,
                "parameters": len(model.fit.names),
                "error": model.gain.with_,
                "gain": gain.estimate if model.causes else np.nan,
                "low": gain.low if model.causes else np.nan,
                "high": gain.high if model.causes else np.nan,
            }
        )
    return pd.DataFrame(rows)


def parameters_table(report: Report, calibration: Calibration) -> pd.DataFrame:
    """Estimated corrections with their 95 % intervals, one row each; recorded as metrics too."""
    names, rows = load_texts("georeferencing").quantities, []
    for one in corrections(calibration):
        name, value, low, high, unit = one.values()
        metric = f"boresight_{name}" if name in BORESIGHT else f"{name}_offset"
        report.metric(metric, "calibration", value, unit, n=calibration.n_images, low=low, high=high)
        shown = {"what": names[name], "unit": "" if unit == "1" else unit, "zero": low <= 0 <= high}
        rows.append(one | shown)
    return pd.DataFrame(rows)


def axes_table(axes: Mapping[str, AlongAxis]) -> pd.DataFrame:
    """Mean error along each axis, and whether it lasts."""
    return pd.DataFrame(
        [
            {
                "axis": name,
                "mean": one.mean.estimate,
                "low": one.mean.low,
                "high": one.mean.high,
                "share": 100 * one.share,
                "lasting": one.constant,
            }
            for name, one in axes.items()
        ]
    )


def outliers_table(outliers: Sequence[Outlier]) -> pd.DataFrame:
    """Marks, photos and clicks that are outliers, largest first."""
    return pd.DataFrame(
        [
            {
                "kind": one.kind,
                "photo": one.photo or "several",
                "mark": one.mark or ("several" if one.kind == "photo" else "not known"),
                "points": one.points,
                "error": one.off_m,
            }
            for one in outliers
        ]
    )


def parts_table(found: Accuracy) -> pd.DataFrame:
    """What the errors are made of once the cause is removed, RMS (m), largest first; none if unknown."""
    scatter = found.remaining
    if not np.isfinite(scatter.whole_m):
        return pd.DataFrame(columns=["part", "rms"])
    names = load_texts("georeferencing").quantities
    parts = zip(("constant", "image", "point"), scatter.parts_m, strict=True)
    rows = [{"part": names[name], "rms": float(rms)} for name, rms in sorted(parts, key=lambda one: -one[1])]
    return pd.DataFrame([*rows, {"part": names["whole"], "rms": float(scatter.whole_m)}])


def noise_table(noise: WanderNoise, assumed: Mapping[str, float]) -> pd.DataFrame:
    """Assumed and estimated standard deviations, one row each, in degrees, metres and pixels."""
    names = load_texts("georeferencing").quantities
    return pd.DataFrame(
        [
            {
                "what": names[kind],
                "assumed": assumed[key],
                "estimated": np.degrees(noise.sd[kind]) if unit == "deg" else noise.sd[kind],
                "unit": unit,
            }
            for kind, (key, unit) in _NOISE.items()
        ]
    )
