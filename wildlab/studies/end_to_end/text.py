"""What the report on drawn and rendered detections says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import mean_interval, mean_share_interval
from wildlab.evaluation.shares import Check, Decision, decide
from wildlab.reporting.text import percent
from wildlab.studies.end_to_end.trial import DRAWN, KINDS, MARGIN, RENDERED, followed_by

FILTERS = {
    "kf": "linear filter, on the ground",
    "ekf": "extended filter, on pixels",
    "cv": "constant velocity",
    "singer": "Singer's model",
    "coloured": "differenced measurements",
}

METHOD = f"""The frames in which the twin marks its vessel are rendered from the camera's true poses,
{MARGIN} px around the vessel: sea, vessel, wake and engine in kelvin, blurred, and counted by a camera with
noise, a fixed pattern, vignetting and dead pixels. The seven steps of H 4.3 search them with the printed
thresholds. Of what is found of the vessel the largest piece takes the place of the drawn detection; that it
is the vessel's is known from the scene's labels, as the thesis neglects data association here.

Everything else is that of the two cases: the same flights, poses, clocks, tunings and truth, and claims by
the same thresholds. A drawn detection is the vessel's true pixel and white noise; a rendered one has the
errors that come with the vessel's shape, its wake and its height above the water."""

LIMITS = [
    "How the vessel looked is not printed: its length, warmth, engine and wake are chosen.",
    "Only frames that the twin marks are rendered, so neither kind can find the vessel in other ones.",
    "Only the surroundings of the vessel are rendered: false alarms elsewhere in images are not seen.",
]


def limits(flights: int) -> list[str]:
    """`LIMITS`, and what so many flights leave open."""
    return [
        *LIMITS,
        f"A verdict that more flights allow may be undecided on {flights}, with either kind.",
    ]


#: Shares between which ellipses that say 90 % are honest.
HONEST = (0.85, 0.95)


def summary(spread: pd.DataFrame, verdicts: pd.DataFrame) -> list[str]:
    """Three sentences: on pixels, on tracks, and on claims.

    Parameters
    ----------
    spread
        What `trial.trial` gives, one row for each flight.
    verdicts
        From `verdicts_table`.
    """
    middle = spread.median()
    first = followed_by(spread)[0]
    mae = {kind: float(middle[f"{kind}-{first}", "mae"]) for kind in KINDS}
    off = {kind: float(middle[kind, "pixel_rms"]) for kind in KINDS}
    others = turned(verdicts)
    moved = int((verdicts["flights"] > 0).sum())
    n = len(verdicts)
    claims = (
        f"None of {n} claims of the thesis gets another verdict"
        if others == 0
        else f"{others} of {n} claims of the thesis get{'s' * (others == 1)} another verdict"
    )
    return [
        f"A detector in rendered images finds the vessel in {percent(found_share(spread))} of the frames and "
        f"is {off[RENDERED]:.1f} px off, where the twin draws {off[DRAWN]:.1f} px.",
        f"Tracked with the {FILTERS[first]}, the vessel is {mae[RENDERED]:.1f} m from where it is on average "
        f"with these, and {mae[DRAWN]:.1f} m with drawn detections: medians of {len(spread)} "
        f"flight{'s' * (len(spread) != 1)}.",
        f"{claims}; {moved or 'none'} come{'s' * (moved < 2)} out otherwise on some flight.",
    ]


def found_share(spread: pd.DataFrame) -> float:
    """Of all rendered frames of all flights, in how many the vessel was found."""
    images = spread[RENDERED, "images"].to_numpy(float)
    return float((images * spread[RENDERED, "detection_rate"]).sum() / images.sum())


def with_interval(values: pd.Series, scale: float = 1.0, decimals: int = 1, *, share: bool = False) -> str:
    """Mean over flights with its 95 % interval, that of a ``share`` within 0 and 1; alone of one flight.

    Examples
    --------
    >>> with_interval(pd.Series([1.0, 2.0, 3.0]))
    '2.0 (−0.5 to 4.5)'
    """
    found = mean_share_interval(values) if share else mean_interval(values)
    mean, low, high = (f"{scale * end:.{decimals}f}".replace("-", "\N{MINUS SIGN}") for end in found)
    return mean if np.isnan(found.low) else f"{mean} ({low} to {high})"


def detections_table(spread: pd.DataFrame) -> pd.DataFrame:
    """The detections themselves, drawn and rendered: means over flights with intervals."""
    shown = (
        ("found (% of frames)", "detection_rate", 100.0, 1),
        ("off, root mean square (px)", "pixel_rms", 1.0, 2),
        ("bias ahead (px)", "bias_ahead", 1.0, 2),
        ("bias to the right (px)", "bias_right", 1.0, 2),
        ("scatter (px)", "pixel_sd", 1.0, 2),
        ("stated standard deviation (px)", "stated_sd", 1.0, 2),
        ("outline's centre in its 90 % ellipse (%)", "ellipse_coverage_90", 100.0, 0),
        ("vessel in its 90 % ellipse on the sea, true poses (%)", "ground_coverage_90_true_poses", 100.0, 0),
        ("receiver in it, the flight's poses (%)", "ground_coverage_90", 100.0, 0),
        ("false alarms an image", "false_alarms_per_image", 1.0, 3),
    )
    rows = []
    for words, name, scale, decimals in shown:
        row = {"quantity": words}
        for kind in KINDS:
            row[kind] = (
                with_interval(spread[kind, name], scale, decimals, share=scale == 100.0)
                if (kind, name) in spread
                else "not drawn"
            )
        rows.append(row)
    return pd.DataFrame(rows)


def tracks_table(spread: pd.DataFrame) -> pd.DataFrame:
    """Each filter's mean distance, NEES and NIS with both kinds: medians over flights."""
    middle = spread.median()
    rows = []
    for who in followed_by(spread):
        row: dict[str, Any] = {"filter": FILTERS[who]}
        for name in ("mae", "nees", "nis"):
            for kind in KINDS:
                row[f"{name}_{kind}"] = float(middle[f"{kind}-{who}", name])
        rows.append(row)
    return pd.DataFrame(rows)


def decided(decision: Decision) -> str:
    """A verdict with what it is by.

    Examples
    --------
    >>> decided(decide([True, True, False]))
    'undecided: 2 of 3'
    """
    return f"{decision.verdict}: {decision.true} of {decision.met}" if decision.met else decision.verdict


def verdicts_table(
    checks: Mapping[str, Mapping[str, Mapping[str, Check]]], claims: Mapping[str, Sequence[Mapping[str, Any]]]
) -> pd.DataFrame:
    """Every claim with its verdict by either kind of detections.

    Parameters
    ----------
    checks
        By kind, case and the claim's id.
    claims
        Of each case, as `wildlab.reporting.published.load_claims` gives them.

    Returns
    -------
    DataFrame
        ``claim``, ``source``; for each kind the ``verdict_`` and, under its own name, that with its counts;
        ``flights``, on how many the claim comes out otherwise.
    """
    rows = []
    for case, several in claims.items():
        for claim in several:
            threshold = None if "threshold" not in claim else float(claim["threshold"])
            row: dict[str, Any] = {"claim": claim["text"], "source": claim["source"]}
            true = {}
            for kind in KINDS:
                check = checks[kind][case][claim["id"]]
                true[kind] = check.holds(threshold)
                decision = decide(true[kind], check.premise)
                row |= {f"verdict_{kind}": decision.verdict, kind: decided(decision)}
            row["flights"] = int((true[DRAWN] != true[RENDERED]).sum())
            rows.append(row)
    return pd.DataFrame(rows)


def turned(verdicts: pd.DataFrame) -> int:
    """How many claims have another verdict by the rendered detections than by the drawn ones."""
    return int((verdicts[f"verdict_{DRAWN}"] != verdicts[f"verdict_{RENDERED}"]).sum())


def bias_words(spread: pd.DataFrame) -> str:
    """What the detector's errors are like, beside those that a twin draws."""
    ahead = float(spread[RENDERED, "bias_ahead"].median())
    sd, rms = (float(spread[RENDERED, name].median()) for name in ("pixel_sd", "pixel_rms"))
    drawn = float(spread[DRAWN, "pixel_rms"].median())
    # Of each flight: a median of squares over that of others may be above all of them.
    shares = (spread[RENDERED, "bias_ahead"] ** 2 + spread[RENDERED, "bias_right"] ** 2) / spread[
        RENDERED, "pixel_rms"
    ] ** 2
    way = "behind" if ahead < 0 else "ahead of"
    ratio = rms / drawn
    beside = f"{1 / ratio:.1f} times smaller than" if ratio < 1 else f"{ratio:.1f} times as large as"
    return (
        f"The detector's errors are {beside} the drawn ones. On average they lie {abs(ahead):.2f} px {way} "
        f"the vessel's point, and scatter by {sd:.2f} px; the bias is {100 * shares.median():.0f} % of their "
        "mean square."
    )


def ellipse_word(shares: pd.Series) -> str:
    """What the shares of flights say of 90 % ellipses: honest where 85 to 95 % is what their interval allows.

    Examples
    --------
    >>> ellipse_word(pd.Series([0.9, 0.91, 0.9])), ellipse_word(pd.Series([0.7, 0.71, 0.7]))
    ('honest', 'too small')
    """
    low, high = mean_interval(shares)[1:]
    if high < HONEST[0]:
        return "too small"
    if low > HONEST[1]:
        return "too large"
    return "honest" if low >= HONEST[0] and high <= HONEST[1] else "undecided"


def turned_words(verdicts: pd.DataFrame) -> str:
    """Which claims get another verdict by rendered detections."""
    others = verdicts[verdicts[f"verdict_{DRAWN}"] != verdicts[f"verdict_{RENDERED}"]]
    if others.empty:
        return "No claim gets another verdict."
    said = [f"“{row['claim']}” ({row[DRAWN]}; {row[RENDERED]})" for _, row in others.iterrows()]
    return f"Another verdict, drawn and then rendered: {' '.join(said)}."


def ellipse_words(spread: pd.DataFrame) -> str:
    """Whether stated ellipses hold the truth, in the image and on the sea."""
    parts = []
    for name, where in (
        ("ellipse_coverage_90", "in the image"),
        ("ground_coverage_90_true_poses", "on the sea with true poses"),
        ("ground_coverage_90", "on the sea with those of the flight"),
    ):
        values = spread[RENDERED, name]
        parts.append(f"{with_interval(values, 100, 0, share=True)} % {where} ({ellipse_word(values)})")
    return f"The 90 % ellipses with the detector's covariances hold the vessel: {', '.join(parts)}."
