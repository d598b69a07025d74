"""What the report on the large ship says, as the computed numbers have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from wildlab.evaluation.runs import Interval, mean_interval, share_interval
from wildlab.studies.large_ship.trial import DETECTOR, START_S, WITH, WITHOUT

NAMES = {WITH: "adjusted", WITHOUT: "not adjusted"}

#: Means of H table 6.1, m, north and east, about an origin that is not printed.
POSITIONS = {"reference": (6.6, 16.4), WITH: (4.8, 12.2), WITHOUT: (3.6, 9.7)}

METHOD = r"""Images are rendered from the true poses of a simulated flight, blurred, counted by a camera with
noise, a fixed pattern, vignetting and dead pixels, and searched with the seven steps of H 4.3, as in the
study of vessel detection. Of the pieces that are found of the ship the largest counts; that they are the
ship's is known, as in H 6.4.1, here from the scene's labels. Where the border of the image cuts it, the
centre is moved along the major axis by H (4.7), for a ship as long as 70 m are from 100 m.

Both kinds of centres go to the sea by H (5.13), with the poses of an autopilot that was neither calibrated
nor synchronised, and through the extended Kalman filter of H 6.3, with segments joined as H 6.4.1 joins
them. Distances are from the ship's own single-frequency receiver, whose errors count, as in the thesis.

H 6.4.1 does not print the filter's parameters. They are those of H 6.4.2, flight 2, for a slow vessel:
$\sigma_v = 0.01$ m/s², $\mathbf{R} = (30\,\mathrm{px})^2$, $\mathbf{P}(0)$ of 10 m and 10 m/s. What else
they could be is in the table of readings."""

LIMITS = [
    "The ship is a hull with a deck, a house and an engine, of 70 m by 14 m, its bow to the south; what it "
    "looked like, how warm it was and how it lay is not printed. How the border cuts it follows from that.",
    "The course of the passes is chosen. Of a ship that enters at one border and leaves at the opposite one, "
    "what the one hides is made up for by the other, so the mean of all images may gain little.",
    "Waves stand still from image to image, and the sea has no foam, no rain, and no other ship.",
]


def _nearer(first: pd.Series, second: pd.Series) -> str:
    count, n = int((first < second).sum()), len(first)
    return f"nearer on {count} of {n} flight{'s' * (n != 1)}"


def summary(spread: pd.DataFrame) -> list[str]:
    """Three sentences on what `trial.trial` gives, one row for each flight."""
    middle = spread.median()

    def of(name: str) -> tuple[float, float]:
        return float(middle[WITH, name]), float(middle[WITHOUT, name])

    (pixel, plain_pixel), (sd, plain_sd), (mae, plain_mae) = (
        of("pixel_error"), of("sd_both"), of("mae_after_start"),
    )  # fmt: skip
    mean, plain_mean = of("error_of_mean")
    in_image = (
        f"Moved along its axis, the centre of what shows of the ship is {pixel:.0f} px from the true one in "
        f"place of {plain_pixel:.0f} px"
    )
    nearer = _nearer(spread[WITH, "mae_after_start"], spread[WITHOUT, "mae_after_start"])
    scatter = "less" if sd < plain_sd else "no less"
    return [
        f"{in_image}, and on the sea positions scatter {scatter}: by {sd:.1f} m against {plain_sd:.1f} m.",
        f"After {START_S:.0f} seconds the track is {mae:.1f} m off with the adjustment and {plain_mae:.1f} m "
        f"without; with it, it is {nearer}.",
        f"The mean of all positions is {mean:.1f} m from the ship's receiver with it, and {plain_mean:.1f} m "
        "without.",
    ]


def cause_words(spread: pd.DataFrame) -> str:
    """Where errors come from: what true poses would leave of scatter and of the mean."""
    parts = []
    ratios = []
    for subject in (WITH, WITHOUT):
        ratio = spread[subject, "sd_true_poses"] / spread[subject, "sd_both"]
        ratios.append(float(ratio.median()))
        left, whole = (spread[subject, name].median() for name in ("error_true_poses", "error_of_mean"))
        parts.append(
            f"{NAMES[subject]}, {100 * ratios[-1]:.0f} % of the scatter, and {left:.1f} m of the "
            f"{whole:.1f} m that the mean is off"
        )
    verdict = (
        "So most of the scatter is in which part of the ship shows; the thesis puts it down to the poses."
        if min(ratios) > np.sqrt(0.5)
        else "So much of the scatter comes from the poses, as the thesis has it."
    )
    return f"With the true poses there would be left: {'; '.join(parts)}. {verdict}"


def detected_words(spread: pd.DataFrame) -> str:
    """How often the ship was found, and how often it was cut and moved."""
    found = pooled(spread, "detection_rate")
    cut, moved = (100 * spread[DETECTOR, name].median() for name in ("share_cut", "share_moved"))
    alarms = round(float((spread[DETECTOR, "images"] * spread[DETECTOR, "false_alarms_per_image"]).sum()))
    return (
        f"In {100 * found.estimate:.1f} % of the images that show any of it the ship is found (95 % interval "
        f"{100 * found.low:.1f} to {100 * found.high:.1f} %), with {alarms} false "
        f"alarm{'s' * (alarms != 1)}. The border cuts it in {cut:.0f} % of the images, and of the detections "
        f"the centres of {moved:.0f} % are moved: those whose contour is closed, whose major axis is half as "
        "long again as the minor one, and meets the border that cuts them."
    )


def pooled(spread: pd.DataFrame, name: str) -> Interval:
    """A share of all images of all flights, with Wilson's interval as if images were independent."""
    images = spread[DETECTOR, "images"].to_numpy(float)
    count = round(float((images * spread[DETECTOR, name]).sum()))
    return share_interval(count, round(float(images.sum())))


def ellipse_words(spread: pd.DataFrame) -> str:
    """How often stated 90 % ellipses hold the truth, in the image and on the sea, over flights."""
    parts = []
    for subject in (WITH, WITHOUT):
        shares = []
        for name, where in (("ellipse_coverage_90", "in the image"), ("ground_coverage_90", "on the sea")):
            values = spread[subject, name]
            shown = f"{100 * values.mean():.0f} % {where}"
            if values.notna().sum() > 1:
                _, low, high = mean_interval(values)
                shown += f" ({100 * max(low, 0):.0f} to {100 * min(high, 1):.0f})"
            shares.append(shown)
        parts.append(f"{NAMES[subject]} {' and '.join(shares)}")
    lowest = min(float(spread[who, "ellipse_coverage_90"].mean()) for who in (WITH, WITHOUT))
    honest = (
        "What the detector states of a ship that large is too small."
        if lowest < 0.85
        else "What the detector states of it is enough."
    )
    pieces = 100 * float(spread[DETECTOR, "share_in_pieces"].median())
    broken = (
        f" In {pieces:.0f} % of the detections the contour has gaps: pieces of it are found, not the ship."
        if pieces > 0
        else ""
    )
    return f"The stated 90 % ellipses hold the ship's centre: {'; '.join(parts)}. {honest}{broken}"


def rest_words(spread: pd.DataFrame) -> str:
    """When the estimated speed stays below the limit."""
    parts = []
    for subject in (WITH, WITHOUT):
        times = spread[subject, "time_to_rest"]
        never = int(times.isna().sum())
        shown = f"after {times.median():.0f} s" if times.notna().any() else "never"
        some = f", on {never} flights never" if never and shown != "never" else ""
        parts.append(f"{NAMES[subject]} {shown}{some}")
    return f"The estimated speed stays below 1 m/s: {'; '.join(parts)} (median)."


def readings_words(table: pd.DataFrame) -> str:
    """What the readings change in the comparison of both tracks."""
    base = table.iloc[1]
    moved = table[table["subject"] == WITH]
    better = moved[moved["mae_after_start"] < base["mae_after_start"]]
    best, worst = (moved.loc[getattr(moved["mae_after_start"], end)()] for end in ("idxmin", "idxmax"))
    return (
        f"On the flight of the figures {len(better)} of {len(moved)} readings with the adjustment give a "
        f"track nearer than the one without it ({base['mae_after_start']:.1f} m after the start): from "
        f"{best['mae_after_start']:.1f} m with “{best['reading']}” to {worst['mae_after_start']:.1f} m with "
        f"“{worst['reading']}”."
    )


def printed_table(published: Mapping[tuple[str, str], float]) -> pd.DataFrame:
    """Table 6.1 as printed, with what can be compared of it."""
    rows = []
    for k, axis in enumerate(("north", "east")):
        reference = POSITIONS["reference"][k]
        values = [POSITIONS[subject][k] for subject in (WITH, WITHOUT)]
        rows.append(
            {
                "measure": f"mean {axis} position",
                "reference": f"{reference:.1f}",
                "adjusted": f"{values[0]:.1f}",
                "plain": f"{values[1]:.1f}",
                "compared": " and ".join(f"{reference - value:.1f}" for value in values),
            }
        )
    for axis in ("north", "east"):
        values = [published[f"sd_{axis}", subject] for subject in (WITH, WITHOUT)]
        rows.append(
            {
                "measure": f"SD {axis} position",
                "reference": "x",
                "adjusted": f"{values[0]:.1f}",
                "plain": f"{values[1]:.1f}",
                "compared": "as printed",
            }
        )
    return pd.DataFrame(rows)
