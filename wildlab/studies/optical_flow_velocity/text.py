"""What the report on velocity from optical flow says, as the computed numbers have it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pandas as pd

from wildlab.detection.flow import FlowThresholds
from wildlab.evaluation.runs import mean_share_interval, share_interval
from wildlab.studies.optical_flow_velocity.trial import (
    CALIBRATED,
    DECK,
    IMAGES,
    LIKELY,
    LOGGED,
    READINGS,
    SHIP,
    SLOW,
    STAMPS,
    STILL,
    SYNCHRONISED,
    TRUE,
    WITHIN_M_S,
    largest_means,
    mean_decided,
    sizes,
)

#: Images of H 5.6.3 with features on the ship; every pair of subsequent ones is used there.
PRINTED_IMAGES = 250
#: What "particularly vulnerable" is taken to mean, as with the claim: so much of the scatter is left at most.
PARTICULAR = 0.5

NAMES = {
    IMAGES: "images",
    LOGGED: "as logged",
    STAMPS: "intervals by the stamps",
    SYNCHRONISED: "synchronised",
    STILL: "synchronised, gimbal's angles exact",
    CALIBRATED: "mount calibrated",
    DECK: "features taken as high as the deck",
    TRUE: "all poses exact",
    SLOW: "as logged, gimbal slow",
    LIKELY: "as logged, likely speeds",
}
#: What each way of reading the log changes.
EXPLAINED = {
    LOGGED: "the autopilot's pose and velocity, stamps of a computer, the camera's pace as the interval",
    STAMPS: "the same, the interval between two images by their own two stamps",
    SYNCHRONISED: "as logged, but each image has the time at which it was taken",
    STILL: "synchronised, with the gimbal's true angles: as sure as those of a gimbal that stands still",
    CALIBRATED: "as logged, with the mount as it is",
    DECK: "as logged, with the plane as high as the deck, not the sea",
    TRUE: "true poses, velocities, times, mount and camera: what is left comes from the images",
    SLOW: "as logged, pairs between which the gimbal hardly moved",
    LIKELY: "as logged, without velocities that no ship has",
}
#: Names of the thresholds' reasons: H prints none of them.
REASONS = {
    "contrast": "half of OpenCV's own 0.04: thermal images have few levels",
    "ratio": "Lowe (2004)",
    "agreement": "px about one motion of all",
    "largest_turn": "between two images; rad, and share of the size",
    "fewest": "fewer fit each other by chance",
    "largest_gimbal_rate": "rad/s; H 5.6.3 proposes a limit without a number",
    "largest_speed": "m/s, 49 kn; H 5.6.3 proposes a limit without a number",
    "smallest_sd": "px; no feature is found better than that",
}

METHOD = r"""Each flight is that of the twin. Its images are rendered from the true poses, in kelvin, blurred,
and counted by a camera with noise, a fixed pattern, vignetting and dead pixels. The detector of H 4.3 finds
what floats, and SIFT features are sought within its convex outline only. FLANN pairs them between two images
that follow each other; a pair is kept if the nearest descriptor is clearly nearer than the second nearest,
and if it moved with most of the others.

Pose and gimbal's angles are interpolated in the log at the times of both images. Half way between lies the
pose of (5.22), rates are differences over the interval, and the velocity is the log's. The displacement of
each feature over the interval less the flow of the camera's own motion, (5.24), gives a velocity over the sea
by (5.30); that of a pair of images is the mean over its features. The definition of flow in H is a
displacement in pixels, and (5.18) a derivative: taken by the letter, (5.30) would be metres an image.

The covariance carries the errors of pixel, pose, mount, velocity, rates, gimbal and plane to the velocity.
What all features of a pair have in common does not average out. Standard deviations are the manifest's, and
those of rates usual ones: nobody told them what the simulation has.

Pairs are looked at in stretches without gaps, spread over both passes. An error of one attitude spoils the
pair before it and that after it in opposite ways; slower errors spoil both alike. The interval of a flight's
mean counts as many independent pairs as their autocorrelation leaves, summed up to the first one that is not
positive. Where it has both sides of 1 m/s in it, the flight does not tell whether its mean is within that."""


def limits(pairs: int) -> list[str]:
    """What the study leaves out, where about so many ``pairs`` of each flight are rendered."""
    return [
        f"How many features a ship has depends on what is on its deck. Here that is {SHIP.fittings} small "
        "things, warm and cold: chosen, as H shows one picture of the ship and no sizes.",
        "H 5.6.3 counts about 400 images with a part of the ship, and says that it was out of view for 38 of "
        "80 s: at 7.5 Hz that leaves 315. Both cannot be; the course is laid by the times.",
        f"Of each flight about {pairs} pairs are rendered, in stretches. H has features in {PRINTED_IMAGES} "
        "images, and used every pair of them.",
        "All the autopilot's errors are those of the airframe's twin. Its real noise from one attitude to "
        "the next is not known, and the scatter follows it.",
    ]


def axes(spread: pd.DataFrame, subject: str, name: str) -> tuple[float, float]:
    """Medians over flights of a number north and east (``name`` is ``"mean"`` or ``"sd"``)."""
    north, east = (float(spread[subject, f"{name}_{axis}"].median()) for axis in ("north", "east"))
    return north, east


def size(spread: pd.DataFrame, subject: str) -> float:
    """Standard deviation along any axis, the median over flights, m/s."""
    found = sizes(spread, subject)
    known = found[np.isfinite(found)]
    return float(np.median(known)) if len(known) else float("nan")


def flights(count: int) -> str:
    """So many flights, in words that fit one."""
    return f"{count} flight{'s' * (count != 1)}"


def mean_words(spread: pd.DataFrame) -> str:
    """On how many flights the mean is within 1 m/s, of those whose pairs can tell."""
    means, decided = largest_means(spread), mean_decided(spread)
    known = int(decided.sum())
    pairs = spread[LOGGED, "pairs"]
    used = f"{pairs.min():.0f}" + (f" to {pairs.max():.0f}" if pairs.max() > pairs.min() else "")
    count = f"There are {used} pairs a flight; the thesis used every pair of its {PRINTED_IMAGES} images."
    largest = f"The largest mean is {means.max():.2f} m/s off."
    if not known:
        return (
            f"On none of {flights(len(spread))} can the pairs tell whether the mean velocity of a ship at "
            f"rest is within {WITHIN_M_S:g} m/s north and east: the 95 % intervals of the means, which "
            f"count the neighbours' correlation, have both sides of it in them. {largest} {count}"
        )
    count_within = int((means[decided] <= WITHIN_M_S).sum())
    within = share_interval(count_within, known)
    rest = f", on {len(spread) - known} more the pairs cannot tell" if known < len(spread) else ""
    return (
        f"On {count_within} of {flights(known)} ({100 * within.low:.0f} to "
        f"{100 * within.high:.0f} %) the mean velocity of a ship at rest comes out within {WITHIN_M_S:g} m/s "
        f"north and east{rest}. {largest} {count}"
    )


def mean_tile(spread: pd.DataFrame) -> tuple[str, str]:
    """The mean of a flight, the larger of both axes, and how well its pairs know it: medians over flights."""
    halves = pd.concat([spread[LOGGED, f"half_mean_{axis}"] for axis in ("north", "east")], axis=1)
    half = float(halves.max(axis=1).dropna().median()) if halves.notna().any(axis=None) else float("nan")
    known = f"known to ± {half:.1f} m/s (95 %); " if np.isfinite(half) else ""
    return (
        f"{np.nanmedian(largest_means(spread)):.1f} m/s",
        f"mean velocity of a ship at rest, the larger of north and east; {known}published: within 1 m/s",
    )


def synchronised_words(spread: pd.DataFrame) -> str:
    """How much of the scatter exact times leave, beside the thesis's "particularly vulnerable"."""
    left = sizes(spread, SYNCHRONISED) / sizes(spread, LOGGED)
    left = left[np.isfinite(left)]
    if not len(left):
        return "What exact times alone leave of the scatter no flight can tell."
    span = f" (on single flights {100 * left.min():.0f} to {100 * left.max():.0f} %)" if len(left) > 1 else ""
    verdict = (
        "so it is here"
        if left.max() < PARTICULAR
        else "so it is not here"
        if left.min() >= PARTICULAR
        else "so it is on some of the flights only"
    )
    return (
        f"Exact times alone leave {100 * float(np.median(left)):.0f} % of a flight's standard "
        f"deviation{span}. The thesis calls the velocity particularly vulnerable to errors of "
        f"synchronisation; if that is to mean that they make half of it, {verdict}."
    )


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what the flights give."""
    sd = size(spread, LOGGED)
    return [
        mean_words(spread),
        f"A single pair of images says {'little' if sd > 1.0 else 'much'}: its velocity has a standard "
        f"deviation of {sd:.1f} m/s along an axis.",
        cause_words(spread),
    ]


def cause_words(spread: pd.DataFrame) -> str:
    """What the scatter comes from: how much of it is left with each thing as it truly was."""
    whole = size(spread, LOGGED)
    left = {one: size(spread, one) for one in (SYNCHRONISED, STILL, CALIBRATED)}
    parts = ", ".join(f"{value:.1f} m/s {_WITH[one]}" for one, value in left.items())
    image = size(spread, TRUE)
    if not np.isfinite([image, whole]).all():
        return ""
    from_poses = (
        "Most of it comes from the poses"
        if image < 0.5 * whole
        else "Much of it comes from the images themselves"
    )
    return f"{from_poses}: with all of them exact {image:.1f} m/s are left; {parts}."


_WITH = {
    SYNCHRONISED: "with exact times alone",
    STILL: "with exact times and gimbal angles",
    CALIBRATED: "with a calibrated mount alone",
}


def readings_table(spread: pd.DataFrame) -> pd.DataFrame:
    """A row for each way of reading the same features: medians over flights."""
    rows = []
    for subject in (*READINGS, SLOW, LIKELY):
        mean, sd = axes(spread, subject, "mean"), axes(spread, subject, "sd")
        rows.append(
            {
                "reading": NAMES[subject], "mean_north": mean[0], "mean_east": mean[1], "sd_north": sd[0],
                "sd_east": sd[1], "inside": 100 * float(spread[subject, "interval_share_95"].median()),
                "pairs": float(spread[subject, "pairs"].sum()), "what": EXPLAINED[subject],
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def interval_words(spread: pd.DataFrame) -> str:
    """How often the stated 95 % interval of a pair's velocity holds the true one."""
    shares = spread[LOGGED, "interval_share_95"]
    pairs = int(spread[LOGGED, "pairs"].sum())
    if shares.notna().sum() < 2:  # pairs of one flight share its errors
        share, span, word = float(shares.mean()), "", "one flight cannot tell whether that is right"
    else:
        share, low, high = mean_share_interval(shares)
        span = f" ({100 * low:.0f} to {100 * high:.0f} %, over flights)"
        rounding = 1e-9  # of flights that are all alike
        word = "about right"
        if high < 0.95 - rounding:
            word = "too sure"
        elif low > 0.95 + rounding:
            word = "too cautious"
    return (
        f"The 95 % interval that goes with a pair's velocity holds the true one in {100 * share:.0f} %{span} "
        f"of a flight's pairs, of {pairs} in all, north and east counted apart: {word}."
    )


def stamps_words(spread: pd.DataFrame) -> str:
    """What the stamps' own intervals would do."""
    stamped, steady = size(spread, STAMPS), size(spread, LOGGED)
    busy = "a computer that is busy now and then" if stamped > 2 * steady else "the computer"
    return (
        f"H does not say which interval a displacement is divided by. By the two stamps of {busy} the "
        f"standard deviation is {stamped:.3g} m/s; by the camera's own pace, which is taken here, it is "
        f"{steady:.1f} m/s."
    )


def gimbal_words(spread: pd.DataFrame) -> str:
    """What dropping pairs with a moving gimbal, or with unlikely speeds, leaves and gains."""
    pairs = spread[LOGGED, "pairs"].sum()
    slow, likely = (100 * spread[one, "pairs"].sum() / pairs for one in (SLOW, LIKELY))
    scatter = size(spread, SLOW)
    slow_words = f" with a standard deviation of {scatter:.1f} m/s" if np.isfinite(scatter) else ""
    return (
        "H 5.6.3 proposes to drop pairs between which the gimbal moved, or whose velocity is unlikely. "
        f"{slow:.0f} % of the pairs pass the first limit{slow_words}, {likely:.0f} % the second with "
        f"{size(spread, LIKELY):.1f} m/s, beside {size(spread, LOGGED):.1f} m/s of all."
    )


def thresholds_table(thresholds: FlowThresholds) -> pd.DataFrame:
    """Every threshold with its value and why it is so."""
    return pd.DataFrame(
        [
            {
                "name": one.name.replace("_", " "), "value": f"{getattr(thresholds, one.name):.3g}",
                "status": "chosen", "reason": REASONS[one.name],
            }
            for one in fields(thresholds)
        ]
    )  # fmt: skip
