"""What the report on positions read from single images says: words, tables and metrics about accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from wildlab.evaluation.errors import ErrorSummary, Scatter, summarise
from wildlab.evaluation.pose_noise import PoseNoise
from wildlab.geometry.calibration import BORESIGHT, Calibration
from wildlab.pipeline.evaluate import errors_of
from wildlab.reporting.report import Report

#: Fewer points than this say little about a flight.
FEW = 10
#: Headings of the table of errors, by the fields of an error summary.
ERROR_COLUMNS = {
    "n": "points",
    "bias_north": "mean north",
    "bias_east": "mean east",
    "sd_north": "SD north",
    "sd_east": "SD east",
    "mean": "mean",
    "median": "median",
    "p90": "90 %",
    "max": "largest",
}
ERROR_DIGITS = dict.fromkeys(ERROR_COLUMNS, 2) | {"n": 0, "max": 1}

METHOD = r"""Pinhole camera with Brown distortion (exact inverse by Newton's method), rotation
$\mathbf{R}_c^n = \mathbf{R}_b^n\mathbf{R}_m^b\mathbf{R}_c^m$ from the logged attitude and the mount (H 5.9 to
5.12), ray cut with the horizontal plane at the height of the ground (H 5.13).

Ellipses: covariances of pixel, pose, mount and plane height through the derivatives of the ground point.
Where the depression's standard deviation times its cotangent exceeds one tenth the linear ellipse is known to
be wrong, and 1000 samples decide its size.

Calibration: three angles of the camera's base (and the clock, where there is one), nonlinear least squares
with a soft-L1 loss on errors weighted with their ellipses (after H 5.15 to 5.17); standard deviations from a
sandwich estimate. A parameter counts as undetermined where the data know it no better than one would guess,
or where it is parallel to others with a correlation beyond 0.99.

What counts as one draw of the errors, for halves, intervals and standard deviations: all points of an image;
where the images have times, all of a minute, because the error of a pose wanders over tens of seconds.

Shares of the squared error: one-way analysis of variance with images as groups. Intervals: a thousand times
as many draws with replacement as there are, middle 90 %."""

_NOISE = {
    "position_horizontal": ("position_horizontal_m", "position, horizontal", "m"),
    "position_vertical": ("position_vertical_m", "position, vertical", "m"),
    "roll_pitch": ("roll_deg", "roll and pitch", "deg"),
    "yaw": ("yaw_deg", "yaw", "deg"),
    "pixel": ("pixel_px", "pixel (marking and lens)", "px"),
}
_ELLIPSES = {
    "linear": "computed by linearisation",
    "sampled": "found by sampling, the ray being flat",
    "unbounded": "not given, the ray being too near the horizon",
    "none": "without a point on the ground",
}
_LIMITS = {
    "bias": "Most of the error is constant: a calibration can take it off.",
    "image": (
        "Points of one image are wrong together: the logged pose limits the accuracy, not the "
        "marking of the points."
    ),
    "point": (
        "Points of one image are wrong each in its own way: marking and lens limit the accuracy, "
        "not the pose."
    ),
    "": "There are too few points per image to tell what limits the accuracy.",
}


def record_errors(
    report: Report,
    subject: str,
    scored: pd.DataFrame,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> ErrorSummary:
    """Record the metrics of one scored table under ``subject``, and return its summary.

    ``intervals`` gives low and high by metric name.
    """
    s = summarise(errors_of(scored))
    values = {
        "horizontal_error_mean": s.mean,
        "horizontal_error_median": s.median,
        "horizontal_error_p90": s.p90,
        "horizontal_error_max": s.max,
        "bias_north": s.bias_north,
        "bias_east": s.bias_east,
        "sd_north": s.sd_north,
        "sd_east": s.sd_east,
    }
    for name, value in values.items():
        low, high = (intervals or {}).get(name, (None, None))
        report.metric(name, subject, value, "m", n=s.n, low=low, high=high)
    if scored["inside_90"].notna().any():
        report.metric("ellipse_coverage_90", subject, scored["inside_90"].mean(), "1", n=s.n)
    return s


def length(metres: float, unit: tuple[str, str] = ("metres", "centimetres")) -> str:
    """A length in words: ``5.1 metres``, below a metre ``40 centimetres``."""
    return f"{metres:.1f} {unit[0]}" if not metres < 0.95 else f"{100 * metres:.0f} {unit[1]}"


def short_length(metres: float) -> str:
    """A length for a tile: ``5.1 m``, below a metre ``40 cm``."""
    return length(metres, ("m", "cm"))


def span(values: Any) -> str:
    """The range of values without decimals: ``51 to 111``, or one number where both ends are the same."""
    low, high = f"{np.nanmin(values):.0f}", f"{np.nanmax(values):.0f}"
    return low if low == high else f"{low} to {high}"


def summary_sentences(logged: ErrorSummary, scatter: Scatter) -> list[str]:
    """What a ranger needs to know, in three sentences."""
    bias = float(np.hypot(logged.bias_north, logged.bias_east))
    if logged.n < FEW:
        return [
            f"Only {logged.n} points could be compared with the truth, too few to say how accurate "
            "this flight is.",
            f"Their median error is {length(logged.median)}, the largest {length(logged.max)}.",
            "Mark more known points, in at least six images, and evaluate again.",
        ]
    return [
        f"A position read from a single image of this flight is typically {length(logged.median)} "
        "off, and nine "
        f"times out of ten less than {length(logged.p90)}.",
        f"Over all images the errors average to {length(bias)}.",
        main_limit(scatter),
    ]


def main_limit(scatter: Scatter) -> str:
    """What limits the accuracy most, in a sentence."""
    shares = {"bias": scatter.bias_share, "image": scatter.image_share, "point": scatter.within_share}
    return _LIMITS[max(shares, key=lambda part: shares[part]) if np.isfinite(scatter.image_share) else ""]


def limiting_factors(scatter: Scatter, logged: ErrorSummary, gained: ErrorSummary | None) -> list[str]:
    """The parts of the squared error, largest first, each with what can be done about it.

    ``gained`` is the summary with a calibration from the other half of the images, where there was one.
    """
    if not np.isfinite(scatter.image_share):
        return []
    between, within = np.hypot(*scatter.between_sd), np.hypot(*scatter.within_sd)
    remedy = (
        f"A calibration from half of the images takes the other half from {logged.mean:.1f} to "
        f"{gained.mean:.1f} m."
        if gained
        else "There are too few images to calibrate on half of them."
    )
    parts = [
        (
            scatter.image_share,
            f"**The pose of each image**, {100 * scatter.image_share:.0f} % of the squared error: "
            f"{between:.1f} m that "
            "all points of an image share and the next image does not. No calibration removes it; "
            "averaging over "
            "images does, four of them halve it.",
        ),
        (
            scatter.within_share,
            f"**Single points**, {100 * scatter.within_share:.0f} %: {within:.1f} m that differs from "
            "point to point "
            "within an image: marking, lens, uneven ground.",
        ),
        (
            scatter.bias_share,
            f"**A constant error**, {100 * scatter.bias_share:.0f} %: "
            f"{np.hypot(logged.bias_north, logged.bias_east):.1f} m over all images. {remedy}",
        ),
    ]
    return [text for _, text in sorted(parts, key=lambda part: -part[0])]


def errors_table(rows: Mapping[str, ErrorSummary], first: str = "pose") -> pd.DataFrame:
    """One row of errors for each summary, with its name in the column ``first``."""
    return pd.DataFrame([{first: name, **summary._asdict()} for name, summary in rows.items()])


def beside_published(published: pd.DataFrame, theirs: ErrorSummary, ours: ErrorSummary) -> pd.DataFrame:
    """Published figures with those of the same answers scored here (``again``) and of ours (``here``)."""
    fields = {
        "horizontal_error_mean": ("mean error", "mean"),
        "horizontal_error_median": ("median error", "median"),
        "horizontal_error_p90": ("nine of ten within", "p90"),
    }
    table = published[published["name"].isin(fields)]
    return table.assign(
        quantity=[fields[name][0] for name in table["name"]],
        again=[getattr(theirs, fields[name][1]) for name in table["name"]],
        here=[getattr(ours, fields[name][1]) for name in table["name"]],
    )


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


def ellipse_words(scored: pd.DataFrame) -> str:
    """How the ellipses of a scored table were found, in words."""
    counts = scored["ellipse"].value_counts()
    return ", ".join(f"{count} were {_ELLIPSES[str(kind)]}" for kind, count in counts.items())


def assumed_words(stated: Mapping[str, float]) -> str:
    """The assumed standard deviations in words."""
    return (
        f"{stated['roll_deg']:g}° in roll, {stated['pitch_deg']:g}° in pitch, {stated['yaw_deg']:g}° in yaw, "
        f"{stated['position_horizontal_m']:g} m horizontally and {stated['position_vertical_m']:g} m "
        "vertically"
    )


def noise_table(noise: PoseNoise, stated: Mapping[str, float]) -> pd.DataFrame:
    """Assumed and estimated standard deviations, one row each, in degrees, metres and pixels."""
    rows = []
    for kind, (key, label, unit) in _NOISE.items():
        value = np.degrees(noise.sd[kind]) if unit == "deg" else noise.sd[kind]
        rows.append(
            {
                "what": label,
                "assumed": stated[key],
                "estimated": value,
                "unit": unit,
                "factor": noise.factor[kind],
            }
        )
    return pd.DataFrame(rows)


def calibration_table(report: Report, calibration: Calibration) -> pd.DataFrame:
    """Estimated constant errors in degrees and seconds, one row each; recorded as metrics too."""
    rows = []
    for name in calibration.names:
        scale, unit = (180 / np.pi, "deg") if name in BORESIGHT else (1.0, "s" if name == "clock" else "m")
        value, sd = scale * calibration.value(name), scale * calibration.sd(name)
        label = f"boresight_{name}" if name in BORESIGHT else f"{name}_offset"
        report.metric(
            label,
            "calibration",
            value,
            unit,
            n=calibration.n_images,
            low=value - 1.645 * sd,
            high=value + 1.645 * sd,
        )
        rows.append(
            {
                "what": f"camera {name}",
                "value": value,
                "sd": sd,
                "unit": unit,
                "verdict": "differs from zero" if abs(value) > 2 * sd else "not told from zero",
            }
        )
    return pd.DataFrame(rows)


def undetermined_words(calibration: Calibration) -> list[str]:
    """What was asked for and could not be estimated, and why, one sentence each."""
    return [
        f"The camera's {name} was not estimated: "
        + (
            f"the data cannot tell it from {' and '.join(partners)}."
            if partners
            else "it has no effect that shows."
        )
        for name, partners in calibration.undetermined.items()
    ]


def limits_of(
    points: pd.DataFrame, depression_deg: Any, height_m: Any, *, labelled: bool, timed: bool, enough: bool
) -> list[str]:
    """What a report on these points does not tell."""
    missed = int(points["north_m"].isna().sum())
    limits = [
        f"Nothing about flatter views than {np.nanmin(depression_deg):.0f}° below the horizon, or "
        "greater heights "
        f"than {np.nanmax(height_m):.0f} m.",
        "Whoever or whatever marked the points is part of these errors; another observer or detector "
        "adds its own.",
        "The height of the ground was taken from "
        + ("the survey of each target" if labelled else "the log")
        + "; where it is not known, the error grows.",
    ]
    if missed:
        limits.append(
            f"{missed} of {len(points)} points have no position: no pose, no ground height, or a ray "
            "above the horizon."
        )
    if not timed:
        limits.append(
            "The images carry no time of their own, so an error of the camera's clock cannot be seen."
        )
    if not enough:
        limits.append("Fewer than six images show a known point: calibration and noise were not estimated.")
    return limits
