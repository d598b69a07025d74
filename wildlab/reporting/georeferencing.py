"""What the report on positions read from single images says: words, tables and metrics about accuracy."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.analysis.accuracy import Accuracy
from wildlab.analysis.evaluate import errors_of
from wildlab.analysis.overviews.verdict import FEW_POINTS
from wildlab.evaluation.errors import ErrorSummary, summarise
from wildlab.evaluation.pose_noise import PoseNoise
from wildlab.reporting import known_positions as truths
from wildlab.reporting.report import Report

#: Fewer points than this say little about a flight.
FEW = FEW_POINTS
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

_METHOD = r"""Pinhole camera with Brown distortion (exact inverse by Newton's method), rotation
$\mathbf{R}_c^n = \mathbf{R}_b^n\mathbf{R}_m^b\mathbf{R}_c^m$ from the logged attitude and the mount (H 5.9 to
5.12), ray GROUND

Blocks: points of neighbouring images, in time order; a minute where the images have times and last for six,
otherwise three images where that leaves six blocks. Errors of one block are not taken for independent.

Cause: constant errors of position, height, boresight, clock and lens, and their sums, are fitted by
generalised least squares (after H 5.15 to 5.17). The covariance of the errors has white noise of each point
and pose errors of each image, part of which is a Gauss-Markov process; their sizes, that part and its time
constants maximise the restricted likelihood, with a broad prior about what was stated. Models are ordered by
Schwarz's criterion; the simplest one within odds of 19 to 1 of the best wins, and others within them that
have no more parameters and do not hold it are not separable from it. It is certain where none of these is
left, where its gain on blocks of images that it was not fitted to has a 90 % interval (Student's, by the
number of blocks) above zero, and where its estimate would be chance in less than 0.1 % (Wald's test with
Satterthwaite's degrees of freedom, times the number of parameters tried). Corrections beyond what is
plausible are not offered. A sum of which the data cannot tell the parts (correlation beyond 0.99, or known no
better than one would guess) is not tried. Intervals of parameters: 95 %, under that covariance.

Far out: so many times the robust spread of its like that the largest of as many normal errors is as far with
probability 0.001; marks first, then photos, then clicks. It is looked for before the cause, with every
parameter taken off that the data determine, and kept out of what models are fitted to and ranked by; then
once more with the cause taken off, and where other points are far out then, the search is repeated without
these. Where more than a quarter of the points is far out no cause is certain.

Ellipses: the factor is the root of the 90 % quantile of the normalised squared error over that of chi-square;
its interval from drawing blocks with replacement. No draw holds a larger error than was seen, so its high end
is at least that of the mean logarithm of all squared errors (Student's, by the number of blocks). Noise: most
likely standard deviations, five images in a hundred taken to be ten times as far off.

Shares of the squared error: one-way analysis of variance with images as groups. Intervals of the figures at
the top: as many blocks with replacement as there are, a thousand times, middle 90 %. They say how far these
images decide the figure, not what another day would bring."""

_ON_PLANE = """cut with the horizontal plane at the height of the ground (H 5.13).

Ellipses: covariances of pixel, pose, mount and plane height through the derivatives of the ground point.
Where the depression's standard deviation times its cotangent exceeds one tenth the linear ellipse is known to
be wrong, and 1000 samples decide its size."""

_ON_TERRAIN = """followed from cell to cell of the flight's terrain, whose surface is bilinear between its
nodes, to where it first meets the ground. A ray that leaves the map, comes to a hole of it, or starts below
the ground has no point.

Ellipses: covariances of pixel, pose, mount and terrain height through the derivatives of where the ray meets
the plane that touches the ground. Rays to 16 points of each ellipse are followed, too: where one meets the
ground a fifth of the ellipse or more from that plane, or not at all, or where the ray is flat against the
slope (as for level ground: one tenth), 1000 samples decide its size. They are called split where they fall
into a near and a far group. No ellipse is given where more than 5 % of them meet no ground.

What follows looks for causes and noise on level ground as high as each point on the terrain."""

_NOISE = {
    "position_horizontal": ("position_horizontal_m", "position, horizontal", "m"),
    "position_vertical": ("position_vertical_m", "position, vertical", "m"),
    "tilt": ("tilt_deg", "tilt, each level axis", "deg"),
    "heading": ("heading_deg", "heading", "deg"),
    "pixel": ("pixel_px", "pixel (marking and lens)", "px"),
}
_ELLIPSES = {
    "linear": "computed by linearisation",
    "sampled": "found by sampling, the ray being flat",
    "split": "found by sampling, a ridge parting the samples",
    "unbounded": "not given, the ray being too near the horizon",
    "none": "without a point on the ground",
}


_OVER_TERRAIN = {
    "sampled": "found by sampling, the ray being flat or the ground bent",
    "unbounded": "not given, too many of the samples meeting no ground",
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
    record_summary(report, subject, s, intervals)
    if scored["inside_90"].notna().any():
        known = int(scored["inside_90"].notna().sum())
        report.metric("ellipse_coverage_90", subject, scored["inside_90"].mean(), "1", n=known)
    return s


def record_summary(
    report: Report,
    subject: str,
    summary: ErrorSummary,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> None:
    """Record the figures of a summary of errors under ``subject``."""
    values = {
        "horizontal_error_mean": summary.mean,
        "horizontal_error_median": summary.median,
        "horizontal_error_p90": summary.p90,
        "horizontal_error_max": summary.max,
        "bias_north": summary.bias_north,
        "bias_east": summary.bias_east,
        "sd_north": summary.sd_north,
        "sd_east": summary.sd_east,
    }
    for name, value in values.items():
        low, high = (intervals or {}).get(name, (None, None))
        report.metric(name, subject, value, "m", n=summary.n, low=low, high=high)


def record_accuracy(
    report: Report, found: Accuracy, answers: Mapping[str, pd.DataFrame]
) -> dict[str, ErrorSummary]:
    """Record the metrics of a flight and of other programs' answers; return the summaries of these."""
    record_errors(report, "logged-pose", found.scored, found.intervals)
    diagnosis = found.diagnosis
    if diagnosis is not None:
        gain = diagnosis.winner.gain.gain
        n = int(diagnosis.inliers.sum())
        report.metric("gain", "winner", gain.estimate, "m", n=n, low=gain.low, high=gain.high)
        if diagnosis.outliers:
            gain, n = diagnosis.winner.gain_of_all.gain, len(diagnosis.inliers)
            report.metric(
                "gain", "winner/with-far-out", gain.estimate, "m", n=n, low=gain.low, high=gain.high
            )
        if diagnosis.counts:
            record_summary(report, "calibrated-pose", diagnosis.held_summary())
    if diagnosis and diagnosis.outliers and diagnosis.inliers.any():
        kept, whole = diagnosis.held_summary(diagnosis.inliers), diagnosis.held_summary()
        record_summary(report, "without-far-out", kept)
        report.metric("gain", "without-far-out", whole.mean - kept.mean, "m", n=kept.n)
        out = int((~diagnosis.inliers).sum())
        report.metric("points_far_out", "winner", out, "1", n=len(diagnosis.inliers))
    if np.isfinite(found.learnt):
        report.metric("ellipse_coverage_90", "logged-pose/estimated-noise", found.learnt, "1")
    others = {}
    for program, table in answers.items():
        subject = "recorded-answers" if len(answers) == 1 else f"recorded-answers/{program}"
        others[program] = record_errors(report, subject, table)
    return others


def named(tables: Mapping[str, pd.DataFrame], kind: str, *, shown: bool) -> dict[str, pd.DataFrame]:
    """Tables by the names that a report and its metrics may have for them.

    Parameters
    ----------
    tables
        By the names that the flight gives, which may tell of a place.
    kind
        What they are, ``"part"``: where their names are not shown, they are numbered.
    shown
        Whether the flight's locations are open.

    Returns
    -------
    dict
        In the same order; blanks are hyphens, and no two names are alike.
    """
    found: dict[str, pd.DataFrame] = {}
    for i, (name, table) in enumerate(tables.items(), 1):
        short = re.sub(r"\s+", "-", name.strip()) if shown else f"{kind}-{i}"
        while short in found:
            short += "-again"
        found[short] = table
    return found


def scatter_title(logged: ErrorSummary) -> str:
    """Title of the figure of the errors: whether they centre on the truth."""
    bias = float(np.hypot(logged.bias_north, logged.bias_east))
    if bias < 0.25 * logged.mean:
        return "Errors centre on the truth"
    return f"The middle of the errors lies {short_length(bias)} off"


def vertical_words(correction: float, left_in: ErrorSummary | None = None, labelled: bool = False) -> str:
    """What the vertical correction that was taken off on import is worth; ``left_in``, the errors without it.

    Without these it is only said that there is one: the height of the geoid tells of a place.
    """
    if left_in is None:
        return "**Vertical reference.** The recorded heights were of another kind; corrected on import."
    fault = "Aircraft and ground share the fault."
    if labelled:
        fault = f"Left in, the mean error would be {left_in.mean:.0f} m."
    too_high = f"The recorded heights stand {correction:.1f} m too high; taken off on import."
    return f"**Vertical reference.** {too_high} {fault}"


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


def headline(logged: ErrorSummary, total: int) -> list[str]:
    """The first sentences of the summary: how far off, of how many points."""
    if not logged.n:
        return []
    of = f"{logged.n} points" if logged.n == total else f"{logged.n} of {total} points"
    if logged.n < FEW:
        return [
            f"Only {of} could be compared with the truth, too few to say how accurate this flight is.",
            f"Their median error is {length(logged.median)}, the largest {length(logged.max)}.",
            "Mark more known points, in at least six images, and evaluate again.",
        ]
    return [
        f"A position read from a single image of this flight is typically {length(logged.median)} off, and "
        f"nine times out of ten less than {length(logged.p90)} ({of})."
    ]


def errors_table(rows: Mapping[str, ErrorSummary], first: str = "pose") -> pd.DataFrame:
    """One row of errors for each summary, with its name in the column ``first``."""
    return pd.DataFrame([{first: name, **summary._asdict()} for name, summary in rows.items()])


def unlabelled_words(programs: Sequence[str], *, shown: bool = True) -> list[str]:
    """That answers of other programs could not be judged, as a list of no or one sentence."""
    if not programs:
        return []
    who = ", ".join(programs) if shown else "other programs"
    return [
        f"Positions recorded by {who} name no target with a known position, so they are not "
        "judged: fill target_id of those detections."
    ]


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


def ellipse_words(scored: pd.DataFrame, *, terrain: bool = False) -> str:
    """How the ellipses of a scored table were found, in words; over ``terrain`` for other reasons."""
    words = _ELLIPSES | (_OVER_TERRAIN if terrain else {})
    counts = scored["ellipse"].value_counts()
    return ", ".join(f"{count} were {words[str(kind)]}" for kind, count in counts.items())


def method_words(*, terrain: bool) -> str:
    """How it was computed, on level ground or over terrain."""
    return _METHOD.replace("GROUND", _ON_TERRAIN if terrain else _ON_PLANE)


def assumed_words(stated: Mapping[str, float]) -> str:
    """The assumed standard deviations in words."""
    return (
        f"{stated['tilt_deg']:.3g}° in tilt (about each level axis), "
        f"{stated['heading_deg']:.3g}° in heading, "
        f"{stated['position_horizontal_m']:.3g} m horizontally and {stated['position_vertical_m']:.3g} m "
        "vertically"
    )


def noise_table(
    noise: PoseNoise, stated: Mapping[str, float], known: truths.KnownPositions = truths.EXACT
) -> pd.DataFrame:
    """Assumed and estimated standard deviations, one row each, in degrees, metres and pixels.

    ``known``: what the errors were held against.
    """
    rows = []
    for kind, (key, label, unit) in _NOISE.items():
        value = np.degrees(noise.sd[kind]) if unit == "deg" else noise.sd[kind]
        rows.append(
            {
                "what": truths.noise_label(label, known),
                "assumed": stated[key],
                "estimated": value,
                "unit": unit,
                "factor": noise.factor[kind],
            }
        )
    return pd.DataFrame(rows)


def limits_of(
    points: pd.DataFrame,
    depression_deg: Any,
    height_m: Any,
    *,
    labelled: bool,
    timed: bool,
    enough: bool,
    certain: bool = False,
    terrain: bool = False,
    known: truths.KnownPositions = truths.EXACT,
) -> list[str]:
    """What a report on these points does not tell; ``certain``: a cause gained something for certain.

    ``known``: what the errors were held against.
    """
    ground = "an elevation map" if terrain else truths.ground_words(known) if labelled else "the log"
    missed = int(points["north_m"].isna().sum())
    limits = [
        "Whoever or whatever marked the points is part of these errors; another person or detector "
        "adds its own.",
        f"The height of the ground was taken from {ground}; where it is not known, the error grows.",
        *truths.known_limits(known),
    ]
    if np.isfinite(height_m).any():
        limits.insert(
            0,
            f"Nothing about flatter views than {np.nanmin(depression_deg):.0f}° below the horizon, or "
            f"greater heights than {np.nanmax(height_m):.0f} m.",
        )
    if missed:
        limits.append(
            f"{missed} of {len(points)} points have no position: no pose, no ground height, or a ray "
            + ("that meets no ground." if terrain else "above the horizon.")
        )
    if not timed:
        limits.append(
            "The images carry no time of their own, or each a pose of its own: an error of the camera's "
            "clock cannot be seen."
        )
    if certain:
        limits.append(
            "Whether the cause stays: an error that wanders over minutes (of a satellite fix, of a heading) "
            "looks constant too, and images that a fit had not seen share it with their neighbours."
        )
    if not enough:
        limits.append(
            "Fewer than six images have a point with a known error and an ellipse: no interval is given, and "
            "neither cause nor noise was looked for."
        )
    return limits
