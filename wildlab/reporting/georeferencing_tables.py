"""Positions read from single images: tables, the section on the terrain, and files of points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from wildlab.analysis.accuracy import Accuracy
from wildlab.analysis.diagnose import Diagnosis
from wildlab.analysis.evaluate import blocks_of, errors_of, score_points
from wildlab.analysis.georeference import (
    Observations,
    georeference,
    on_level,
    points_geojson,
    shift_from_level,
    with_axes,
)
from wildlab.evaluation.correlated_errors import WanderNoise
from wildlab.evaluation.errors import AlongAxis, ErrorSummary, bootstrap_interval, summarise
from wildlab.evaluation.outliers import Outlier
from wildlab.files import csv_text
from wildlab.flight.store import Flight
from wildlab.geometry.calibration import BORESIGHT, Calibration
from wildlab.messages.catalogue import Message, load_texts
from wildlab.messages.quantities import measure
from wildlab.reporting.report import Report, Wording
from wildlab.reporting.text import data_link

#: Fewer images than this give no interval.
FEWEST_IMAGES = 6


def terrain_section(report: Report, flight: Flight, observations: Observations, points: pd.DataFrame) -> None:
    """The section on the terrain, and its metrics; nothing where the flight has none.

    Parameters
    ----------
    report
        Is added to.
    flight
        The flight.
    observations, points
        What was georeferenced, and where it lies.
    """
    if observations.terrain is None:
        return
    placed = points["north_m"].notna()
    report.metric("rays_on_ground", "terrain", float(placed.mean()), "1", n=len(points))
    shift = shift_from_level(observations, points)
    if shift.n:
        report.metric("shift_from_level_ground", "terrain", shift.median, "m", n=shift.n)
    message = Message(
        "terrain-shift", {"shift": measure(shift.median, "m"), "most": measure(shift.largest, "m")}
    )
    both = _errors_on_both(flight, observations, points) if placed.any() else None
    if both is not None:
        medians = np.median(both[["error_m", "error_m_level"]].to_numpy(float), axis=0)
        report.metric("horizontal_error_median", "level-ground", float(medians[1]), "m", n=len(both))
        message = terrain_message(float(medians[0]), float(medians[1]), _gain_interval(flight, both))
    wording = Wording(report, load_texts("georeferencing"))
    report.section("Terrain", " ".join(wording.messages([message])))


def _errors_on_both(flight: Flight, observations: Observations, points: pd.DataFrame) -> pd.DataFrame | None:
    """Points with an error over terrain (``error_m``) and on level ground (``error_m_level``)."""
    if flight.truth is None or not len(flight.truth):
        return None
    flat = georeference(on_level(observations), np.random.default_rng(0))
    both = score_points(flight, points).merge(
        score_points(flight, flat), on="detection_id", suffixes=("", "_level")
    )
    both = both[np.isfinite(both["error_m"]) & np.isfinite(both["error_m_level"])]
    return None if both.empty else both


def _gain_interval(flight: Flight, both: pd.DataFrame) -> tuple[float, float]:
    """Of how much less the median error over terrain is, 95 %; NaN for too few images."""
    if both["frame_id"].nunique() < FEWEST_IMAGES:
        return np.nan, np.nan
    # Two distances in place of north and east: what is drawn again and again is the same.
    distances = both[["error_m", "error_m_level"]].to_numpy(float)
    rng = np.random.default_rng(0)
    return bootstrap_interval(_gain, distances, blocks_of(flight, both), rng, level=0.95)


def _gain(distances: np.ndarray) -> float:
    """How much less the median of the first column is than that of the second."""
    return float(np.median(distances[:, 1]) - np.median(distances[:, 0]))


def terrain_message(terrain: float, level: float, interval: tuple[float, float]) -> Message:
    """Which is nearer to the truth, by the interval of the difference of median errors.

    Parameters
    ----------
    terrain, level
        Median errors, metres.
    interval
        Of how much less the first is than the second, 95 %; NaN where there is none.

    Examples
    --------
    >>> terrain_message(2.0, 5.0, (1.0, 4.0)).key, terrain_message(2.0, 5.0, (-1.0, 4.0)).key
    ('terrain-nearer', 'terrain-undecided')
    """
    low, high = interval
    key = "terrain-nearer" if low > 0 else "level-nearer" if high < 0 else "terrain-undecided"
    return Message(key, {"terrain": measure(terrain, "m"), "level": measure(level, "m")})


#: Rows of the table of models.
SHOWN = 8
#: Unit of each parameter, and how many of that are one.
_UNITS = {
    **dict.fromkeys(("roll", "tilt", "pan", "heading"), ("deg", 180 / np.pi)),
    **dict.fromkeys(("down", "north", "east"), ("m", 1.0)),
    **dict.fromkeys(("focal", "aspect"), ("%", 100.0)),
    **dict.fromkeys(("centre_u", "centre_v"), ("px", 1.0)),
    "clock": ("s", 1.0),
    "radial": ("1", 1.0),
}
_NOISE = {
    "position_horizontal": ("position_horizontal_m", "m"),
    "position_vertical": ("position_vertical_m", "m"),
    "tilt": ("tilt_deg", "deg"),
    "heading": ("heading_deg", "deg"),
    "pixel": ("pixel_px", "px"),
}
#: What the files of points have of a point, m and degrees; times count from the first image.
POINT_COLUMNS = ("point", "seconds", "north_m", "east_m", "long_90_m", "short_90_m", "bearing_deg")
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


def beside_published(published: pd.DataFrame, theirs: ErrorSummary, ours: ErrorSummary) -> pd.DataFrame:
    """Published figures with those of the same answers scored here (``again``) and of ours (``here``)."""
    table = published[published["name"].isin(SUMMARY)]
    fields = [SUMMARY[name] for name in table["name"]]
    return table.assign(
        quantity=[name.removeprefix("horizontal_error_") for name in table["name"]],
        again=[getattr(theirs, field) for field in fields],
        here=[getattr(ours, field) for field in fields],
    )


def models_table(diagnosis: Diagnosis) -> pd.DataFrame:
    """The most likely models, the winner bold, and the poses as logged."""
    shown = list(np.argsort(diagnosis.ranked.scores, kind="stable")[:SHOWN])
    shown += [m for m in (diagnosis.ranked.winner, 0) if m not in shown]
    rows = []
    for m in shown:
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
    zero = set(calibration.names) - set(significant_parameters(calibration))
    for name in calibration.names:
        unit, scale = _UNITS[name]
        value, (low, high) = scale * calibration.value(name), (scale * x for x in calibration.interval(name))
        metric = f"boresight_{name}" if name in BORESIGHT else f"{name}_offset"
        report.metric(metric, "calibration", value, unit, n=calibration.n_images, low=low, high=high)
        rows.append(
            {
                "what": names[name],
                "value": value,
                "low": low,
                "high": high,
                "unit": "" if unit == "1" else unit,
                "zero": name in zero,
            }
        )
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


def points_table(points: pd.DataFrame) -> pd.DataFrame:
    """Places in local metres with their ellipses, without names, dates or anything else that locates them.

    Parameters
    ----------
    points
        From `wildlab.analysis.georeference.georeference`.

    Returns
    -------
    DataFrame
        With `POINT_COLUMNS`; ``seconds`` is the time since the first point, NaN where that is not known.
    """
    times = points["time_s"].to_numpy(float)
    first = np.nanmin(times) if np.isfinite(times).any() else np.nan
    table = with_axes(points).assign(point=np.arange(1, len(points) + 1), seconds=times - first)
    return table[list(POINT_COLUMNS)].round(3)


def point_links(flight: Flight, points: pd.DataFrame, source: str | None) -> list[str]:
    """Links that hand over all points: metres for all, places where locations are open."""
    links = [
        data_link(csv_text(points_table(points)).encode(), "text/csv", "points.csv", "CSV, local metres")
    ]
    if flight.manifest.locations.sensitivity == "open":
        places = points_geojson(flight, points, source or "").encode()
        links.append(data_link(places, "application/geo+json", "points.geojson", "GeoJSON, exact places"))
    return [link for link in links if link]


def significant_parameters(calibration: Calibration) -> tuple[str, ...]:
    """Parameters whose interval leaves zero out."""
    ends = {name: calibration.interval(name) for name in calibration.names}
    return tuple(name for name, (low, high) in ends.items() if low > 0 or high < 0)
